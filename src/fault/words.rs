//! A fault in words, as on the command line: `kind field=value ...`.

use super::{FaultSpec, Field};
use crate::layout::{RegType, value};
use crate::time;
use thiserror::Error;

/// A word that is no field of a fault.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{text}`: {right}")]
pub struct WordError {
    /// As given.
    pub text: String,
    /// What would be right.
    pub right: String,
}

/// Fields that are times; on the command line their names may stand without the unit, with it in the value.
const TIMES: [Field; 4] = [Field::AtUs, Field::DelayUs, Field::AmplitudeUs, Field::DurationUs];

/// Reads a fault. Whether its fields suit its kind is not looked at here.
fn parse(kind: &str, fields: &[impl AsRef<str>]) -> Result<FaultSpec, WordError> {
    let mut spec = FaultSpec { kind: kind.to_owned(), ..FaultSpec::default() };
    let mut seen = Vec::new();
    for text in fields {
        let text = text.as_ref();
        let wrong = |right: String| WordError { text: text.to_owned(), right };
        let (name, given) = text
            .split_once('=')
            .ok_or_else(|| wrong("write a field as name=value, for example count=3".to_owned()))?;
        let (field, with_unit) = field(name).ok_or_else(|| wrong(unknown(name)))?;
        if seen.contains(&field) {
            return Err(wrong(format!("{field} is given twice")));
        }
        seen.push(field);
        match text_field(&mut spec, field) {
            Some(place) => *place = Some(given.to_owned()),
            None => {
                let number = if with_unit {
                    time::parse(given).map_err(|error| wrong(error.to_string()))?
                } else {
                    number(given, field).map_err(wrong)?
                };
                spec.set_value(field, number);
            }
        }
    }
    Ok(spec)
}

impl FaultSpec {
    /// Reads a kind and its fields, each as `name=value`. The fields are those of a plant file; times may have a
    /// unit, without `_us` in the field's name then (`delay=500us`), and numbers a base (`id=16#101`). Whether the
    /// fields suit the kind only [`FaultSpec::resolve`] tells.
    ///
    /// # Errors
    /// [`WordError`] for the first field that cannot be read.
    pub fn from_words(kind: &str, fields: &[impl AsRef<str>]) -> Result<Self, WordError> {
        parse(kind, fields)
    }
}

/// The field of a name, and whether its value has a unit.
fn field(name: &str) -> Option<(Field, bool)> {
    let is = |field: &Field| field.name() == name || field.other_name() == Some(name);
    let exact = Field::ALL.into_iter().find(is).map(|field| (field, false));
    let is_short_for = |long: &str| long.strip_suffix("_us") == Some(name);
    let short = || {
        let is = |field: &Field| is_short_for(field.name()) || field.other_name().is_some_and(is_short_for);
        TIMES.into_iter().find(is)
    };
    exact.or_else(|| short().map(|field| (field, true)))
}

fn unknown(name: &str) -> String {
    let names: Vec<_> = Field::ALL.into_iter().map(|field| field.name().trim_end_matches("_us")).collect();
    format!("there is no field `{name}`; the fields are: {}", names.join(", "))
}

fn text_field(spec: &mut FaultSpec, field: Field) -> Option<&mut Option<String>> {
    match field {
        Field::Bus => Some(&mut spec.bus),
        Field::Plc => Some(&mut spec.plc),
        Field::Slot => Some(&mut spec.slot),
        _ => None,
    }
}

/// A number in the notations of register values; times in microseconds may be longer than those.
fn number(text: &str, field: Field) -> Result<u64, String> {
    if TIMES.contains(&field)
        && let Ok(us) = text.parse()
    {
        return Ok(us);
    }
    value::parse(text, RegType::Udint).map(u64::from).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(kind: &str, fields: &[&str]) -> Result<FaultSpec, String> {
        let fields: Vec<_> = fields.iter().map(|field| (*field).to_owned()).collect();
        parse(kind, &fields).map_err(|error| error.to_string())
    }

    #[test]
    fn fields_are_those_of_the_plant_file() {
        let spec = parsed("lose_frame", &["bus=drives", "slot=WRC1", "id=16#101", "mask=0x70F", "count=3"]);
        let toml = "kind = 'lose_frame'\nbus = 'drives'\nslot = 'WRC1'\nid = 0x101\nmask = 0x70F\ncount = 3";
        assert_eq!(spec.unwrap(), toml::from_str(toml).unwrap());
        let all = Field::ALL.map(|field| format!("{field}=7"));
        let spec = parse("x", &all).unwrap();
        assert_eq!(spec.to_string().split(' ').count(), 1 + Field::ALL.len());
    }

    #[test]
    fn two_fields_have_another_name() {
        let other = parsed("x", &["for_us=5000", "us=500"]);
        assert_eq!(other, parsed("x", &["duration_us=5000", "delay_us=500"]));
        assert_eq!(other, parsed("x", &["for=5ms", "us=500"]));
        assert_eq!(other.unwrap(), toml::from_str("kind = 'x'\nfor_us = 5000\nus = 500").unwrap());
        assert_eq!(
            parsed("x", &["for=1s", "duration=1s"]).unwrap_err(),
            "`duration=1s`: duration_us is given twice"
        );
    }

    #[test]
    fn times_may_have_a_unit() {
        let with = parsed("x", &["at=2s", "delay=500us", "amplitude=0.04ms", "duration=1min"]);
        let without =
            parsed("x", &["at_us=2000000", "delay_us=500", "amplitude_us=40", "duration_us=60000000"]);
        assert_eq!(with.unwrap(), without.unwrap());
        assert_eq!(parsed("x", &["at_us=31536000000000"]).unwrap().at_us, Some(31_536_000_000_000));
    }

    #[test]
    fn mistakes_are_named() {
        for (field, expected) in [
            ("count", "`count`: write a field as name=value, for example count=3"),
            (
                "colour=1",
                "`colour=1`: there is no field `colour`; the fields are: bus, plc, node, slave, slot, id, mask, \
                 delay, amplitude, error, offset, at, count, duration",
            ),
            ("delay=5", "`delay=5`: a time needs a unit: 5us, 5ms or 5s"),
            (
                "count=many",
                "`count=many`: `many` is no number; write it decimal (67), hexadecimal (16#43 or 0x43) or \
                 binary (2#100_0011)",
            ),
        ] {
            assert_eq!(parsed("lose_frame", &[field]).unwrap_err(), expected);
        }
        assert_eq!(parsed("x", &["slave=1", "slave=2"]).unwrap_err(), "`slave=2`: slave is given twice");
        assert!(parsed("x", &["delay=5us", "delay_us=5"]).is_err());
    }
}
