//! A fault in words, as on the command line: `kind field=value ...`.

use super::field_value::REQUIRED;
use super::spec::named;
use super::{FaultKind, FaultSpec, Field, FieldValue, Form};
use crate::layout::{RegType, did_you_mean, value};
use crate::time;
use thiserror::Error;

/// A word that is not a field of a fault.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{text}`: {right}")]
pub struct WordError {
    /// Invalid word of the description.
    pub text: String,
    /// Description of a correct word.
    pub right: String,
}

impl FaultSpec {
    /// Reads a kind and its fields, each as `name=value`. The fields have the same names as in a plant file. Fields of
    /// all `kinds` are accepted, and [`FaultSpec::resolve`] checks later if they suit the kind. If a time has a unit,
    /// the name of the field has no `_us` (`delay=500us`). Numbers may have a base (`id=16#101`).
    ///
    /// # Errors
    /// [`WordError`] for the first field that cannot be read.
    pub fn from_words(
        kinds: &[&'static FaultKind],
        kind: &str,
        fields: &[impl AsRef<str>],
    ) -> Result<Self, WordError> {
        let known = known(kind, kinds);
        let mut spec = FaultSpec { kind: kind.to_owned(), ..FaultSpec::default() };
        for text in fields {
            let text = text.as_ref();
            if text == REQUIRED {
                spec.required = true;
                continue;
            }
            let wrong = |right: String| WordError { text: text.to_owned(), right };
            let (name, given) = text
                .split_once('=')
                .ok_or_else(|| wrong("write a field as name=value, for example count=3".to_owned()))?;
            let name = &name.replace('-', "_");
            let (field, with_unit) =
                field(&known, name).ok_or_else(|| wrong(unknown(&possible(kind, kinds, &known), name)))?;
            if spec.fields.iter().any(|(seen, _)| seen == field.name()) {
                return Err(wrong(format!("{field} is given twice")));
            }
            let given = match field.form() {
                Form::Name | Form::Word(_) => FieldValue::Text(given.to_owned()),
                Form::Port => {
                    number(given).map_or_else(|_| FieldValue::Text(given.to_owned()), FieldValue::Number)
                }
                Form::Time { .. } if with_unit => {
                    FieldValue::Number(time::parse(given).map_err(|error| wrong(error.to_string()))?)
                }
                // Times in microseconds can be larger than register values, so they are read separately.
                Form::Time { .. } => {
                    FieldValue::Number(given.parse().or_else(|_| number(given)).map_err(wrong)?)
                }
                Form::Number { .. } | Form::Hex { .. } => FieldValue::Number(number(given).map_err(wrong)?),
            };
            spec.fields.push((field.name().to_owned(), given));
        }
        Ok(spec)
    }
}

/// Returns the fields of all kinds, each once: first the fields for the target, then the fields of the kinds, then the
/// fields for the time. If several kinds define a field of the same name, the definition of the kind called `kind` is
/// used.
fn known(kind: &str, kinds: &[&'static FaultKind]) -> Vec<&'static Field> {
    let place = kinds.iter().flat_map(|kind| kind.place().fields().iter().copied());
    let (names, numbers): (Vec<_>, Vec<_>) =
        place.partition(|field| !matches!(field.form(), Form::Number { .. }));
    let own = kinds.iter().flat_map(|kind| kind.fields());
    let meant = named(kind, kinds);
    let mut known: Vec<&'static Field> = Vec::new();
    for field in names.into_iter().chain(numbers).chain(own).chain(FaultKind::COMMON) {
        if !known.contains(&field) {
            let meant = meant.and_then(|kind| kind.all_fields().find(|other| *other == field));
            known.push(meant.unwrap_or(field));
        }
    }
    known
}

/// Returns the field of a name, and true if the value must have a unit. This is so if the name of a time has no `_us`.
fn field(known: &[&'static Field], name: &str) -> Option<(&'static Field, bool)> {
    let exact = known.iter().find(|field| field.is_called(name)).map(|field| (*field, false));
    let long = format!("{name}_us");
    let is_time = |field: &&&Field| matches!(field.form(), Form::Time { .. }) && field.is_called(&long);
    exact.or_else(|| known.iter().find(is_time).map(|field| (*field, true)))
}

/// Returns the fields that a message proposes: those of the kinds called `kind`, or `known` if there is no such kind.
fn possible(kind: &str, kinds: &[&'static FaultKind], known: &[&'static Field]) -> Vec<&'static Field> {
    let Some(meant) = named(kind, kinds) else { return known.to_vec() };
    let mut fields: Vec<&'static Field> = Vec::new();
    // Several device folders may declare kinds of one name.
    for field in kinds.iter().filter(|it| it.name() == meant.name()).flat_map(|kind| kind.usable_fields()) {
        if !fields.contains(&field) {
            fields.push(field);
        }
    }
    fields
}

fn unknown(possible: &[&Field], name: &str) -> String {
    let names: Vec<_> = possible.iter().map(|field| field.name().trim_end_matches("_us")).collect();
    let hint = did_you_mean(name, names.iter().copied());
    format!("there is no field `{name}`{hint}; the fields are: {}", names.join(", "))
}

/// Reads a number in the notations of register values.
fn number(text: &str) -> Result<u64, String> {
    value::parse(text, RegType::Udint).map(u64::from).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::{Effect, TargetKind};
    use super::*;

    const fn time(name: &'static str) -> Field {
        Field::new(name, Form::Time { least: 0, most: 1_000_000 }, "")
    }

    const HEX: Form = Form::Hex { least: 0, most: 0xFFFF, digits: 3 };

    static FRAME: FaultKind =
        FaultKind::new(1, "lose_frame", TargetKind::Participant, "", |_| Effect::new(())).with(
            const {
                &[
                    Field::new("slot", Form::Word(&["WRC1"]), ""),
                    Field::new("id", HEX, ""),
                    Field::new("mask", HEX, ""),
                    time("delay_us").or("us"),
                ]
            },
        );
    static NODE: FaultKind = FaultKind::new(2, "node", TargetKind::Port, "", |_| Effect::new(()))
        .with(const { &[time("amplitude_us"), Field::new("error", HEX, ""), Field::new("offset", HEX, "")] });

    fn parsed(kind: &str, fields: &[&str]) -> Result<FaultSpec, String> {
        FaultSpec::from_words(&[&FRAME, &NODE], kind, fields).map_err(|error| error.to_string())
    }

    #[test]
    fn fields_are_those_of_the_plant_file() {
        let spec = parsed("lose_frame", &["bus=drives", "slot=WRC1", "id=16#101", "mask=0x70F", "count=3"]);
        let toml = "kind = 'lose_frame'\nbus = 'drives'\nslot = 'WRC1'\nid = 0x101\nmask = 0x70F\ncount = 3";
        assert_eq!(spec.unwrap(), toml::from_str(toml).unwrap());
    }

    #[test]
    fn two_fields_have_another_name() {
        let other = parsed("x", &["for_us=5000", "us=500"]);
        assert_eq!(other, parsed("x", &["duration_us=5000", "delay_us=500"]));
        assert_eq!(other, parsed("x", &["for=5ms", "us=500"]));
        assert_eq!(other.unwrap(), toml::from_str("kind = 'x'\nduration_us = 5000\ndelay_us = 500").unwrap());
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
        assert_eq!(
            parsed("x", &["at_us=31536000000000"]).unwrap().fields[0].1,
            FieldValue::Number(31_536_000_000_000)
        );
    }

    #[test]
    fn mistakes_are_named() {
        for (field, expected) in [
            ("count", "`count`: write a field as name=value, for example count=3"),
            (
                "colour=1",
                "`colour=1`: there is no field `colour`; the fields are: bus, slave, slot, id, mask, delay, at, \
                 count, duration",
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
        assert_eq!(
            parsed("x", &["colour=1"]).unwrap_err(),
            "`colour=1`: there is no field `colour`; the fields are: bus, plc, node, slave, slot, id, mask, delay, \
             amplitude, error, offset, at, count, duration",
            "all fields, if the kind is not known"
        );
        assert_eq!(parsed("x", &["slave=1", "slave=2"]).unwrap_err(), "`slave=2`: slave is given twice");
        assert!(parsed("x", &["delay=5us", "delay_us=5"]).is_err());
    }
}
