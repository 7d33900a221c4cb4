//! Kinds of journal records that a device in a folder declares: `[[record]]` in its `handshakes.toml`
//! (D-809).

use crate::layout::did_you_mean;
use core::fmt::Write;

/// Maximum number of kinds of a device.
pub(super) const MOST_KINDS: usize = 64;
/// Maximum number of fields of a kind.
pub(super) const MOST_FIELDS: usize = 4;
/// Longest name of a kind, and of a field, in bytes.
pub(super) const LONGEST_NAME: usize = 24;
/// Longest text of a kind in bytes.
pub(super) const LONGEST_TEXT: usize = 80;

/// A kind of record.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct OwnRecord {
    /// Name of the kind.
    pub name: String,
    /// Description of the event.
    pub text: String,
    /// Names of the fields of the kind.
    pub fields: Vec<String>,
    /// Pages of the manual.
    pub page: String,
}

impl OwnRecord {
    /// Checks names and text.
    ///
    /// # Errors
    /// Description of the error, and of the right form.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { name, text, fields, page: _ } = self;
        let is_part = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
        for name in [name].into_iter().chain(fields) {
            let begins = name.starts_with(|letter: char| letter.is_ascii_lowercase());
            if !begins || name.len() > LONGEST_NAME || !name.chars().all(is_part) {
                return Err(format!(
                    "`{name}` is no name of a record or a field; a name has lower-case letters, digits and `_`, at most {LONGEST_NAME}"
                ));
            }
        }
        if text.len() > LONGEST_TEXT {
            return Err(format!("the text has {} bytes; it has at most {LONGEST_TEXT}", text.len()));
        }
        if fields.len() > MOST_FIELDS {
            return Err(format!("{} fields; a record has at most {MOST_FIELDS}", fields.len()));
        }
        match fields.iter().enumerate().find(|(index, field)| fields[..*index].contains(field)) {
            Some((_, field)) => Err(format!("the field `{field}` occurs twice")),
            None => Ok(()),
        }
    }

    /// Returns the kind of this name.
    ///
    /// # Errors
    /// The list does not contain the kind.
    #[cfg_attr(not(any(test, feature = "script")), expect(dead_code, reason = "only scripts write records"))]
    pub(super) fn find<'a>(kinds: &'a [Self], name: &str) -> Result<&'a Self, String> {
        kinds.iter().find(|kind| kind.name == name).ok_or_else(|| {
            let near = did_you_mean(name, kinds.iter().map(|kind| kind.name.as_str()));
            format!("handshakes.toml has no [[record]] with the name `{name}`{near}")
        })
    }

    /// Returns a record in the form of the journal: `limit count=5 mode=1: the counter has reached its
    /// limit`. `value` returns the value of a field.
    ///
    /// # Errors
    /// The error of `value`.
    #[cfg_attr(not(any(test, feature = "script")), expect(dead_code, reason = "only scripts write records"))]
    pub(super) fn line(&self, value: impl Fn(&str) -> Result<i64, String>) -> Result<String, String> {
        let mut line = self.name.clone();
        for field in &self.fields {
            let _ = write!(line, " {field}={}", value(field)?);
        }
        Ok(line + ": " + &self.text)
    }
}

/// Returns the name, fields and text of a line. Journals may come from unknown authors, so any text is accepted.
pub(super) fn parts(line: &str) -> (&str, &str, &str) {
    let (head, text) = line.split_once(": ").unwrap_or((line, ""));
    let (name, values) = head.split_once(' ').unwrap_or((head, ""));
    (name, values, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind() -> OwnRecord {
        let fields = ["count", "mode"].map(str::to_owned).to_vec();
        OwnRecord { name: "limit".into(), text: "the limit: reached".into(), fields, page: "1".into() }
    }

    #[test]
    fn a_line_leads_back_to_its_parts() {
        let line = kind().line(|field| Ok(if field == "count" { 5 } else { -1 })).unwrap();
        assert_eq!(line, "limit count=5 mode=-1: the limit: reached");
        assert_eq!(parts(&line), ("limit", "count=5 mode=-1", "the limit: reached"));
        assert_eq!(parts("x"), ("x", "", ""));
    }

    #[test]
    fn the_longest_line_fits_into_a_record() {
        let name = |letter: &str| letter.repeat(LONGEST_NAME);
        let fields = ["a", "b", "c", "d"].map(name).to_vec();
        let kind = OwnRecord { name: name("n"), text: "t".repeat(LONGEST_TEXT), fields, page: String::new() };
        assert_eq!(kind.check(), Ok(()));
        assert!(kind.line(|_| Ok(i64::from(i32::MIN))).unwrap().len() <= 255);
    }

    #[test]
    fn names_and_texts_have_limits() {
        let refused = |change: &dyn Fn(&mut OwnRecord)| {
            let mut wrong = kind();
            change(&mut wrong);
            wrong.check().unwrap_err()
        };
        assert!(refused(&|it| it.name = "Limit".into()).contains("lower-case letters"));
        assert!(refused(&|it| it.fields[0] = "a b".into()).contains("`a b` is no name"));
        assert!(refused(&|it| it.fields[0] = "mode".into()).contains("`mode` occurs twice"));
        assert!(refused(&|it| it.text = "x".repeat(81)).contains("at most 80"));
        assert!(OwnRecord::find(&[kind()], "limits").unwrap_err().contains("did you mean limit?"));
    }
}
