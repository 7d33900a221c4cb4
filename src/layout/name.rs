//! Register names: `[plc:]area.register[i][j]` and `[plc:]area.group[i].register`.

use super::descriptor::{Area, Device, Register, Structure};
use super::error::LayoutError;
use super::nearest;
use super::register::RegisterRef;
use std::collections::BTreeSet;

/// Splits off the name of a PLC: `line2:node2.w_CPU_CONTROL`.
#[must_use]
pub fn split_plc(text: &str) -> (Option<&str>, &str) {
    match text.split_once(':') {
        Some((plc, rest)) => (Some(plc), rest),
        None => (None, text),
    }
}

/// What stands in front of names of PLC number `plc`: its name, if there are several PLCs. The reverse of
/// [`split_plc`].
#[must_use]
pub fn plc_prefix(plcs: &[String], plc: u16) -> String {
    match plcs.get(usize::from(plc)) {
        Some(name) if plcs.len() > 1 => format!("{name}:"),
        _ => String::new(),
    }
}

/// A name with the indices behind it.
struct Part<'a> {
    name: &'a str,
    index: Vec<u32>,
}

/// What stands behind the area: one or two parts.
struct Path<'a> {
    text: &'a str,
    group: Option<Part<'a>>,
    register: Part<'a>,
}

impl<'a> Path<'a> {
    fn parse(text: &'a str) -> Result<Self, LayoutError> {
        let wrong = |reason| LayoutError::BadName { text: text.to_owned(), reason };
        let mut parts = Vec::new();
        for piece in text.split('.') {
            let (name, mut rest) = piece.split_at(piece.find('[').unwrap_or(piece.len()));
            let mut index = Vec::new();
            while !rest.is_empty() {
                let inner = rest.strip_prefix('[').ok_or(wrong("something behind a `]`"))?;
                let (number, behind) = inner.split_once(']').ok_or(wrong("a `[` without `]`"))?;
                index.push(number.trim().parse().map_err(|_| wrong("an index that is no number"))?);
                rest = behind;
            }
            match (name.is_empty(), parts.last_mut()) {
                (false, _) => parts.push(Part { name, index }),
                // The vendor's watch window may show a dot between the brackets (manual p. 159).
                (true, Some(Part { index: all, .. })) if !index.is_empty() => all.extend(index),
                (true, _) => return Err(wrong("an empty part")),
            }
        }
        let mut parts = parts.into_iter();
        match (parts.next(), parts.next(), parts.next()) {
            (Some(register), None, _) => Ok(Self { text, group: None, register }),
            (Some(group), Some(register), None) => Ok(Self { text, group: Some(group), register }),
            _ => Err(wrong("too many parts")),
        }
    }

    fn group_name(&self) -> &'a str {
        self.group.as_ref().map_or("", |group| group.name)
    }

    fn is(&self, register: &Register) -> bool {
        register.name == self.register.name && register.group == self.group_name()
    }

    fn is_but_for_case(&self, register: &Register) -> bool {
        register.name.eq_ignore_ascii_case(self.register.name)
            && register.group.eq_ignore_ascii_case(self.group_name())
    }
}

impl Device {
    /// The area called `name`.
    ///
    /// # Errors
    /// [`LayoutError::UnknownArea`] with all areas, [`LayoutError::WrongCase`].
    pub fn area(&'static self, name: &str) -> Result<&'static Area, LayoutError> {
        if let Some(area) = self.areas.iter().find(|area| area.name == name) {
            return Ok(area);
        }
        if let Some(area) = self.areas.iter().find(|area| area.name.eq_ignore_ascii_case(name)) {
            return Err(LayoutError::WrongCase { given: name.to_owned(), right: area.name.to_owned() });
        }
        let known: Vec<_> = self.areas.iter().map(|area| area.name).collect();
        Err(LayoutError::UnknownArea { area: name.to_owned(), known: known.join(", ") })
    }

    /// The register called `name`, without the name of a PLC. A register that INIT and cyclic structure
    /// share is given as that of the cyclic one.
    ///
    /// # Errors
    /// What is wrong with the name, and what would be right.
    pub fn register(&'static self, name: &str) -> Result<RegisterRef, LayoutError> {
        let found = self.named(name)?;
        let Found { area, structure, register, path } = found;
        let mut given = path.group.iter().flat_map(|group| group.index.iter()).collect::<Vec<_>>();
        let group_given = given.len();
        given.extend(&path.register.index);
        if group_given != register.group_dims || given.len() != register.dims.len() {
            return Err(index_count(register, path.text));
        }
        let mut index = [0; 2];
        for ((slot, dim), given) in index.iter_mut().zip(register.dims).zip(given) {
            *slot = u16::try_from(*given).ok().filter(|i| *i < dim.count).ok_or_else(|| {
                let of = if register.group_dims > 0 { register.group } else { register.name };
                LayoutError::IndexRange { name: path.text.to_owned(), index: *given, of, last: dim.count - 1 }
            })?;
        }
        Ok(RegisterRef { area, structure, register, index })
    }

    /// All registers that `name` stands for, in address order: an area alone, an array without indices,
    /// a sub-structure, or a single register.
    ///
    /// # Errors
    /// As [`Device::register`].
    pub fn registers(&'static self, name: &str) -> Result<Vec<RegisterRef>, LayoutError> {
        let Some((area, path)) = name.split_once('.') else {
            let area = self.area(name)?;
            return Ok(by_address(area, |_| true));
        };
        let area_found = self.area(area)?;
        let parsed = Path::parse(path)?;
        if parsed.group.is_none() && parsed.register.index.is_empty() {
            let wanted = parsed.register.name;
            let all = by_address(area_found, |found| {
                found.register.group == wanted
                    || (found.register.group.is_empty() && found.register.name == wanted)
            });
            if !all.is_empty() {
                return Ok(all);
            }
        }
        match self.register(name) {
            Err(LayoutError::IndexCount { .. }) => {}
            other => return other.map(|one| vec![one]),
        }
        let matches = |given: &[u32], index: &[u16]| {
            given.iter().zip(index).all(|(given, index)| *given == u32::from(*index))
        };
        let all = by_address(area_found, |found| {
            let (group, own) = found.index.split_at(found.register.group_dims);
            let group_index = parsed.group.as_ref().map_or(&[][..], |group| &group.index);
            parsed.is(found.register) && matches(group_index, group) && matches(&parsed.register.index, own)
        });
        if all.is_empty() { self.register(name).map(|one| vec![one]) } else { Ok(all) }
    }

    /// Area and descriptor of `name`, whose indices are not yet checked.
    fn named<'a>(&'static self, name: &'a str) -> Result<Found<'a>, LayoutError> {
        let Some((area, path)) = name.split_once('.') else {
            let reason = "no area in front";
            return Err(LayoutError::BadName { text: name.to_owned(), reason });
        };
        let area = self.area(area)?;
        let path = Path::parse(path)?;
        // The cyclic structure comes last, and it is the one to be preferred.
        let all = || area.structures.iter().rev().map(|placed| placed.structure);
        for structure in all() {
            if let Some(register) = structure.registers.iter().find(|register| path.is(register)) {
                return Ok(Found { area, structure, register, path });
            }
        }
        for structure in all() {
            if let Some(register) = structure.registers.iter().find(|r| path.is_but_for_case(r)) {
                return Err(LayoutError::WrongCase {
                    given: path.text.to_owned(),
                    right: register.pattern(),
                });
            }
        }
        Err(unknown(area, &path))
    }
}

struct Found<'a> {
    area: &'static Area,
    structure: &'static Structure,
    register: &'static Register,
    path: Path<'a>,
}

/// The area's registers that `wanted` accepts, each address once, in ascending order.
fn by_address(area: &'static Area, wanted: impl Fn(&RegisterRef) -> bool) -> Vec<RegisterRef> {
    let structures = area.structures.iter().rev();
    let mut all: Vec<RegisterRef> =
        structures.flat_map(|placed| area.registers_of(placed.structure)).filter(wanted).collect();
    all.sort_by_key(RegisterRef::offset);
    // What INIT and cyclic structure share lies side by side now.
    all.dedup_by(|a, b| a.offset() == b.offset() && a.register.name == b.register.name);
    all
}

impl Register {
    /// The name with the ranges of its indices: `a_RD_BMARRAY[0..31][0..15]`.
    #[must_use]
    pub fn pattern(&self) -> String {
        let mut ranges = self.dims.iter().map(|dim| format!("[0..{}]", dim.count - 1));
        let group: String = ranges.by_ref().take(self.group_dims).collect();
        let own: String = ranges.collect();
        let dot = if self.group.is_empty() { "" } else { "." };
        format!("{}{group}{dot}{}{own}", self.group, self.name)
    }
}

fn index_count(register: &Register, text: &str) -> LayoutError {
    let needs = if register.dims.is_empty() {
        "is not an array; leave out the index".to_owned()
    } else {
        format!("needs indices: {}", register.pattern())
    };
    LayoutError::IndexCount { name: text.to_owned(), needs }
}

fn unknown(area: &'static Area, path: &Path<'_>) -> LayoutError {
    let registers = || area.structures.iter().flat_map(|placed| placed.structure.registers);
    if path.group.is_none() {
        let members: Vec<_> =
            registers().filter(|register| register.group == path.register.name).map(|r| r.name).collect();
        if !members.is_empty() {
            return LayoutError::NotARegister { name: path.text.to_owned(), registers: members.join(", ") };
        }
    }
    let full =
        |group: &str, name: &str| if group.is_empty() { name.to_owned() } else { format!("{group}.{name}") };
    let wanted = full(path.group_name(), path.register.name);
    let names: BTreeSet<String> = registers().map(|register| full(register.group, register.name)).collect();
    let near = nearest::nearest(&wanted, names.iter().map(String::as_str));
    let hint = match near.as_slice() {
        _ if names.is_empty() => ": it is plain RAM, use an address".to_owned(),
        [] => String::new(),
        near => format!("; nearest: {}", near.join(", ")),
    };
    LayoutError::UnknownRegister { area: area.name, name: wanted, hint }
}

#[cfg(test)]
mod tests {
    use crate::devices::omega_drive_line_2::registers::DEVICE;
    use crate::layout::{LayoutError, split_plc};

    fn error(name: &str) -> String {
        DEVICE.register(name).unwrap_err().to_string()
    }

    #[test]
    fn names_and_addresses_agree_both_ways() {
        for (name, address) in [
            ("node2.w_CPU_CONTROL", "%MW3.200000"),
            ("node1.w_OPTION_STATUS", "%MW3.100002"),
            ("node2.b_MA_SL_MODE", "%MB3.200012"),
            ("node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0", "%MB3.200020"),
            ("node1._CFG_RDC_WORD.b_CFG_RDC1_WORD0", "%MB3.100100"),
            ("node2.a_WR_VALUE[31]", "%MD3.200176"),
            ("node2.a_RD_BMARRAY[3][0]", "%MD3.201024"),
            ("node2.a_CFG_RDC_WORD[31].b_CFG_RDC2_WORD3", "%MB3.200820"),
            ("ethernet_config.d_ROUTER", "%MD3.180028"),
            ("ethernet_config.a_IP_ADDRESS[3]", "%MB3.180023"),
        ] {
            let register = DEVICE.register(name).unwrap();
            assert_eq!(register.address().to_string(), address);
            assert_eq!(register.name(), name);
        }
    }

    #[test]
    fn a_dot_between_the_brackets_is_taken_as_in_the_watch_window() {
        let register = DEVICE.register("node2.a_RD_BMARRAY[3].[15]").unwrap();
        assert_eq!(register.path(), "a_RD_BMARRAY[3][15]");
        assert!(register.is_reserved());
    }

    #[test]
    fn the_plc_is_split_off() {
        assert_eq!(split_plc("line2:node2.w_OMEGA_NR"), (Some("line2"), "node2.w_OMEGA_NR"));
        assert_eq!(split_plc("node2.w_OMEGA_NR"), (None, "node2.w_OMEGA_NR"));
    }

    #[test]
    fn wrong_names_are_answered_with_the_right_ones() {
        assert_eq!(
            error("node3.w_CPU_CONTROL"),
            "unknown area `node3`; the areas are baps, node1, ethernet_config, node2, ethernet, option1, \
             option2, option3"
        );
        assert_eq!(error("Node2.w_CPU_CONTROL"), "`Node2` is spelled `node2`");
        assert_eq!(error("node2.w_cpu_control"), "`w_cpu_control` is spelled `w_CPU_CONTROL`");
        assert_eq!(
            error("node2.a_rd_bmarray[3][0]"),
            "`a_rd_bmarray[3][0]` is spelled `a_RD_BMARRAY[0..31][0..15]`"
        );
        assert_eq!(
            error("node2.w_CPU_CONTRL"),
            "area `node2` has no register `w_CPU_CONTRL`; nearest: w_CPU_CONTROL"
        );
        assert_eq!(
            error("node1.a_WR_VALUE[0]").split(';').next(),
            Some("area `node1` has no register `a_WR_VALUE`")
        );
        assert_eq!(error("option1.x"), "area `option1` has no register `x`: it is plain RAM, use an address");
        assert_eq!(
            error("node2.a_DATA_PARAMETER"),
            "`a_DATA_PARAMETER` is a sub-structure, not a register; its registers are d_PAR_VALUE, w_PAR_NR, \
             w_SUBSL_ADR"
        );
    }

    #[test]
    fn wrong_indices_are_answered_with_the_ranges() {
        assert_eq!(
            error("node2.a_RD_BMARRAY[32][0]"),
            "`a_RD_BMARRAY[32][0]`: index 32 is out of range, a_RD_BMARRAY has elements 0 to 31"
        );
        assert_eq!(
            error("node2.a_RD_BMARRAY[0][16]"),
            "`a_RD_BMARRAY[0][16]`: index 16 is out of range, a_RD_BMARRAY has elements 0 to 15"
        );
        assert_eq!(
            error("node2.a_RD_BMARRAY[0]"),
            "`a_RD_BMARRAY[0]` needs indices: a_RD_BMARRAY[0..31][0..15]"
        );
        assert_eq!(
            error("node2.a_DATA_PARAMETER.w_PAR_NR[3]"),
            "`a_DATA_PARAMETER.w_PAR_NR[3]` needs indices: a_DATA_PARAMETER[0..31].w_PAR_NR"
        );
        assert_eq!(
            error("node2.w_CPU_CONTROL[0]"),
            "`w_CPU_CONTROL[0]` is not an array; leave out the index"
        );
        assert!(error("node2.a_STAT_SL[99999999]").contains("index 99999999 is out of range"));
    }

    #[test]
    fn malformed_names_are_refused_with_the_reason() {
        for (name, reason) in [
            ("w_CPU_CONTROL", "no area in front"),
            ("node2.", "an empty part"),
            ("node2..x", "an empty part"),
            ("node2.a[", "a `[` without `]`"),
            ("node2.a[1]x", "something behind a `]`"),
            ("node2.a[x]", "an index that is no number"),
            ("node2.a[-1]", "an index that is no number"),
            ("node2.a.b.c", "too many parts"),
        ] {
            let error = DEVICE.register(name).unwrap_err();
            assert!(
                matches!(error, LayoutError::BadName { reason: found, .. } if found == reason),
                "{name}: {error}"
            );
        }
    }

    #[test]
    fn a_name_may_stand_for_many_registers() {
        let names = |name: &str| -> Vec<String> {
            DEVICE.registers(name).unwrap().iter().map(|register| register.path()).collect()
        };
        assert_eq!(names("node2.w_CPU_CONTROL"), ["w_CPU_CONTROL"]);
        assert_eq!(names("node2.a_STAT_SL").len(), 32);
        assert_eq!(names("node2.a_RD_BMARRAY").len(), 512);
        assert_eq!(names("node2.a_RD_BMARRAY[7]").first().unwrap(), "a_RD_BMARRAY[7][0]");
        assert_eq!(names("node2.a_RD_BMARRAY[7]").len(), 16);
        assert_eq!(
            names("node2.a_DATA_PARAMETER")[..4],
            [
                "a_DATA_PARAMETER[0].d_PAR_VALUE",
                "a_DATA_PARAMETER[0].w_PAR_NR",
                "a_DATA_PARAMETER[0].w_SUBSL_ADR",
                "a_DATA_PARAMETER[1].d_PAR_VALUE"
            ]
        );
        assert_eq!(names("node2.a_DATA_PARAMETER.w_PAR_NR").len(), 32);
        assert_eq!(names("node1._CFG_RDC_WORD").len(), 16);
        assert_eq!(names("ethernet_config").len(), 10);
        assert_eq!(names("node2").iter().filter(|name| *name == "w_CPU_CONTROL").count(), 1);
        assert!(DEVICE.registers("node2.a_RD_BMARRAY[32]").is_err());
        assert!(DEVICE.registers("node2.nothing").is_err());
    }
}
