//! Patterns of register names: `node2.*STATUS*`, `node2.a_STAT_SL[0..3]`, `node2.a_RD_BMARRAY[*][0]`.

use super::descriptor::{AreaStructure, Register};
use super::device_fit::{DeviceFit, Fit};
use super::error::LayoutError;
use super::register::RegisterRef;

/// A piece of a pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Token {
    /// A letter, compared without case.
    Letter(u8),
    /// `*`: any text.
    Any,
    /// `[0..3]`, `[*]`: an index between these two values, including both.
    Index(u32, u32),
}

/// A pattern of register names.
///
/// The pattern is compared with the names of registers, with and without their area or variable. It must match the
/// whole name, or the part before the indices of an array or before the registers of a sub-structure. So the name of an
/// array without indices means all its elements.
#[derive(Debug)]
pub(super) struct Pattern(Vec<Token>);

impl Pattern {
    /// True if the text is a pattern, and not the name of a single register.
    pub(super) fn is_one(text: &str) -> bool {
        let indices = text.split('[').skip(1).filter_map(|following| following.split(']').next());
        text.contains('*') || indices.into_iter().any(|index| index.contains(".."))
    }

    pub(super) fn parse(text: &str) -> Result<Self, LayoutError> {
        let wrong = || LayoutError::BadName {
            text: text.to_owned(),
            reason: "a range is written [0..3], from the lower index to the higher one, and all of them [*]",
        };
        let mut tokens = Vec::new();
        let mut rest = text;
        while let Some(letter) = rest.chars().next() {
            if let Some((inner, following)) = rest.strip_prefix('[').and_then(|inner| inner.split_once(']')) {
                let index = |text: &str| text.trim().parse::<u32>().map_err(|_| wrong());
                let (first, last) = match inner.split_once("..") {
                    _ if inner.trim() == "*" => (0, u32::MAX),
                    Some((first, last)) => (index(first)?, index(last)?),
                    None => (index(inner)?, index(inner)?),
                };
                if first > last {
                    return Err(wrong());
                }
                tokens.push(Token::Index(first, last));
                rest = following;
                continue;
            }
            if rest.starts_with("..") || matches!(letter, '[' | ']') {
                return Err(wrong());
            }
            let (letters, following) = rest.split_at(letter.len_utf8());
            match letter {
                '*' => tokens.push(Token::Any),
                _ => tokens.extend(letters.bytes().map(Token::Letter)),
            }
            rest = following;
        }
        Ok(Self(tokens))
    }

    /// True if the name of a register matches.
    fn matches(&self, name: &str) -> bool {
        let (mut token, mut rest) = (0, name);
        // Position of the last `*` in the pattern, and the part of the name to which the `*` extends so far. If the
        // rest does not match, the `*` takes one letter more, and the comparison begins again there.
        let mut retry: Option<(usize, &str)> = None;
        loop {
            let fits = match self.0.get(token) {
                None if rest.is_empty() || rest.starts_with(['[', '.']) => return true,
                None => None,
                Some(Token::Any) => {
                    retry = Some((token + 1, rest));
                    Some(0)
                }
                Some(Token::Letter(letter)) => {
                    rest.bytes().next().filter(|it| it.eq_ignore_ascii_case(letter)).map(|_| 1)
                }
                Some(Token::Index(first, last)) => index_at(rest, *first, *last),
            };
            if let Some(len) = fits {
                token += 1;
                rest = rest.get(len..).unwrap_or_default();
                continue;
            }
            let Some((following, from)) = retry else { return false };
            let Some(later) = from.get(1..) else { return false };
            retry = Some((following, later));
            (token, rest) = (following, later);
        }
    }

    /// True if the pattern means this register. As in a name without `*`, a second name needs the area or the variable
    /// before it, and is not used if another register there has this name as its own.
    fn means(&self, register: &RegisterRef) -> bool {
        let RegisterRef { area, placed, register: own, role, .. } = *register;
        let path = register.path();
        if self.matches(&path)
            || self.matches_after(area.name, &path)
            || self.matches_after(placed.variable, &path)
        {
            return true;
        }
        let Some(second) = register.second_path() else { return false };
        let has_role = |other: &AreaStructure| role.is_none() || other.role.is_none() || other.role == role;
        let is_free = |placed: &AreaStructure| {
            let mut others = placed.structure.registers.iter();
            others.all(|other| other.name != own.also || other.group != own.group)
        };
        let mut structures = area.structures.iter().filter(|other| has_role(other));
        self.matches_after(area.name, &second) && structures.all(is_free)
            || self.matches_after(placed.variable, &second) && is_free(placed)
    }

    fn matches_after(&self, front: &str, path: &str) -> bool {
        self.matches(&format!("{front}.{path}"))
    }

    /// Returns the pattern with another token at this place.
    fn with(&self, place: usize, token: Token) -> Self {
        let tokens = self.0.iter().enumerate();
        Self(tokens.map(|(at, own)| if at == place { token } else { *own }).collect())
    }

    /// Returns the error for a range of indices that goes beyond the end of all arrays that the pattern means. `found` are
    /// the registers that it means, `all` returns the registers that another pattern means.
    fn beyond_the_end(
        &self,
        text: &str,
        found: &[RegisterRef],
        all: impl Fn(&Pattern) -> Vec<RegisterRef>,
    ) -> Option<LayoutError> {
        let ranges = self.0.iter().enumerate().filter_map(|(at, token)| match token {
            Token::Index(_, last) if *last != u32::MAX => Some((at, *last)),
            _ => None,
        });
        let is_missing = |(at, last): &(usize, u32)| {
            let end = self.with(*at, Token::Index(*last, *last));
            !found.iter().any(|register| end.means(register))
        };
        let (at, last) = ranges.into_iter().find(is_missing)?;
        let elements = all(&self.with(at, Token::Index(0, u32::MAX)));
        let indices = elements.iter().flat_map(|it| {
            let dims = it.index.into_iter().take(it.register.dims.len()).enumerate();
            dims.map(move |(dim, index)| (index, dim, it))
        });
        let is_there = |(index, _, it): &(u16, usize, &RegisterRef)| {
            self.with(at, Token::Index((*index).into(), (*index).into())).means(it)
        };
        let (end, dim, array) = indices.filter(is_there).max_by_key(|(index, ..)| *index)?;
        let Register { group, name, group_dims, .. } = array.register;
        let of = if dim < *group_dims { group } else { name };
        Some(LayoutError::IndexRange { name: text.to_owned(), index: last, of, last: end })
    }
}

/// Returns the length of the index at the start of `text`, if its value is between `first` and `last`.
fn index_at(text: &str, first: u32, last: u32) -> Option<usize> {
    let (number, _) = text.strip_prefix('[')?.split_once(']')?;
    let index: u32 = number.parse().ok()?;
    (first..=last).contains(&index).then_some(number.len() + 2)
}

impl DeviceFit {
    /// Returns the registers that match a pattern, area by area in address order.
    ///
    /// # Errors
    /// The text is no pattern, no register matches, or a range of indices goes beyond the end of the array.
    pub(super) fn matching(&self, text: &str) -> Result<Vec<RegisterRef>, LayoutError> {
        let pattern = Pattern::parse(text)?;
        let all = |pattern: &Pattern| -> Vec<_> {
            let areas = self.device().named_areas().filter(|area| self.area(area) != Fit::Empty);
            areas.flat_map(|area| self.registers_where(area, |it| pattern.means(it))).collect()
        };
        let found = all(&pattern);
        if let Some(error) = pattern.beyond_the_end(text, &found, all) {
            return Err(error);
        }
        if found.is_empty() { Err(LayoutError::NoMatch { pattern: text.to_owned() }) } else { Ok(found) }
    }
}

/// True if `text` is a pattern for several registers, with or without a PLC as a prefix.
#[must_use]
pub fn is_pattern(text: &str) -> bool {
    Pattern::is_one(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    fn names(pattern: &str) -> Vec<String> {
        DEVICE.registers(pattern).unwrap().iter().map(RegisterRef::name).collect()
    }

    fn matches(pattern: &str, name: &str) -> bool {
        Pattern::parse(pattern).unwrap().matches(name)
    }

    #[test]
    fn a_star_matches_any_text() {
        assert!(matches("node2.*STATUS*", "node2.w_OPTION_STATUS"));
        assert!(matches("*status", "node2.w_OPTION_STATUS"));
        assert!(!matches("*status", "node2.w_OPTION_STATUS_OLD"));
        assert!(matches("a*b*c", "a1b2b3c"), "the last b is followed by a c");
        assert!(!matches("a*b*c", "a1c2b3"));
        assert!(!matches(&"a*".repeat(60), &"a".repeat(59)), "this ends in a moment");
    }

    #[test]
    fn an_index_is_a_number_of_a_range() {
        assert!(
            matches("a[2..10]", "a[10]") && !matches("a[2..10]", "a[11]") && !matches("a[2..10]", "a[1]")
        );
        assert!(matches("a[*][0]", "a[17][0]") && !matches("a[*][0]", "a[17][1]"));
        assert!(matches("a[ 1 .. 2 ]", "a[1]"));
    }

    #[test]
    fn an_array_without_its_indices_is_all_of_it() {
        assert!(matches("*.a_RD", "node2.a_RD[1][2]") && matches("*.a_RD[0..1]", "node2.a_RD[1][2]"));
        assert!(matches("node*", "node2.a_RD[1][2]") && !matches("*.a_R", "node2.a_RD[1][2]"));
    }

    #[test]
    fn patterns_find_registers_in_the_order_of_their_addresses() {
        let elements = ["node2.a_STAT_SL[0]", "node2.a_STAT_SL[1]"];
        assert_eq!(names("node2.a_STAT_SL[0..1]"), elements);
        let variable = DEVICE.area("node2").unwrap().structures.last().unwrap().variable;
        assert_eq!(names(&format!("{variable}.a_STAT_SL[0..1]")), elements, "by the manual's variable too");
        let status = names("node*.w_OPTION_STATUS");
        assert_eq!(status, ["node1.w_OPTION_STATUS", "node2.w_OPTION_STATUS"]);
        assert_eq!(names("w_OPTION_*"), status);
        assert_eq!(names("node2.a_RD_BMARRAY[*][0]").len(), 32);
        assert_eq!(names("node2.a_RD_BMARRAY[0..31][0..15]").len(), 512, "as `pattern` writes it");
    }

    #[test]
    fn invalid_patterns_and_patterns_without_matches_are_refused() {
        let message = |text| DEVICE.registers(text).unwrap_err().to_string();
        for text in ["node2.a[0..]", "node2.a[3..1]", "node2.a[x..1]", "node2..x*", "node2.*]", "node2.*["] {
            assert!(message(text).contains("a range is written [0..3]"), "{text}");
        }
        assert!(message("node2.*größe*").contains("no register matches `node2.*größe*`"));
    }

    #[test]
    fn a_range_beyond_the_end_of_the_array_is_refused() {
        let message = |text| DEVICE.registers(text).unwrap_err().to_string();
        let beyond = |text: &str, index, of, last| {
            let expected = format!("`{text}`: index {index} is out of range, {of} has elements 0 to {last}");
            assert_eq!(DEVICE.registers(text).unwrap_err().to_string(), expected);
        };
        beyond("node2.a_STAT_SL[30..33]", 33, "a_STAT_SL", 31);
        beyond("node2.a_STAT_SL[32..40]", 40, "a_STAT_SL", 31);
        beyond("node2.a_RD_BMARRAY[0..31][0..16]", 16, "a_RD_BMARRAY", 15);
        beyond("node2.a_RD_BMARRAY[32][*]", 32, "a_RD_BMARRAY", 31);
        beyond("node2.a_DATA_PARAMETER[0..32].w_PAR_NR", 32, "a_DATA_PARAMETER", 31);
        // One of the arrays has this element.
        assert!(DEVICE.registers("node2.a_*[0..31]").is_ok());
        assert!(message("node2.a_STATUS_SL[0..3]").contains("no register matches"));
    }

    #[test]
    fn patterns_find_second_names() {
        for front in ["node2", DEVICE.area("node2").unwrap().structures.last().unwrap().variable] {
            let second = |rest: &str| names(&format!("{front}.a_RD_VALUE{rest}"));
            let own = |rest: &str| names(&format!("{front}.a_RD_BMARRAY{rest}"));
            for rest in ["[1][*]", "[0..1][3]", "[*]"] {
                assert_eq!(second(rest), own(rest));
            }
        }
        // Each register is listed once, also if both of its names match.
        assert_eq!(names("node2.a_RD_*[1][*]").len(), 16);
    }
}
