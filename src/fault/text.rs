//! Formats a fault as its description.

use super::spec::port_given;
use super::{Fault, FaultKind, FaultSpec, Field, FieldValue, Form, Limit, Target};
use crate::journal::Names;
use core::fmt::Write as _;

impl Fault {
    /// `lose_frame bus=drives slot=WRC1 id=16#101 count=3`
    #[must_use]
    pub fn text(&self, names: &Names) -> String {
        let mut text = self.kind().name().to_owned();
        for (field, given) in self.given(names) {
            // Writing into a text cannot fail.
            let _ = match (given, field.form()) {
                (FieldValue::Text(word), _) => write!(text, " {field}={word}"),
                (FieldValue::Number(value), Form::Hex { digits, .. }) => {
                    write!(text, " {field}=16#{value:0digits$X}")
                }
                (FieldValue::Number(value), _) => write!(text, " {field}={value}"),
            };
        }
        text
    }

    /// Returns the fields of the fault, without the fields that have their default values.
    fn given(&self, names: &Names) -> Vec<(&'static Field, FieldValue)> {
        let bus = |index| FieldValue::Text(names.bus(index).into_owned());
        let plc = |index| FieldValue::Text(names.plc(index).into_owned());
        let number = |number: u8| FieldValue::Number(number.into());
        let place = match self.target() {
            Target::Bus(index) => vec![bus(index)],
            Target::Participant { bus: index, number: slave } => vec![bus(index), number(slave)],
            Target::Port { device, port } => {
                let known = names.device(device).port_numbered(port);
                vec![plc(device), known.map_or_else(|| number(port.0), port_given)]
            }
            Target::Device(index) => vec![plc(index)],
        };
        let own = self.kind().fields().iter().zip(self.values()).filter_map(|(field, value)| {
            let value = value.filter(|value| field.default_value() != Some(*value))?;
            Some((
                field,
                match field.form() {
                    Form::Word(words) => FieldValue::Text((*words.get(value as usize)?).to_owned()),
                    _ => FieldValue::Number(value.into()),
                },
            ))
        });
        let [at_us, count, duration_us] = FaultKind::COMMON;
        let begin = (self.at_us() > 0).then(|| (at_us, FieldValue::Number(self.at_us())));
        let end = match self.limit() {
            Limit::UntilCleared => None,
            Limit::Count(hits) => Some((count, FieldValue::Number(hits.into()))),
            Limit::Duration(us) => Some((duration_us, FieldValue::Number(us.into()))),
        };
        self.kind().place().fields().iter().copied().zip(place).chain(own).chain(begin).chain(end).collect()
    }
}

impl FaultSpec {
    /// Returns the description of a fault.
    pub fn of(fault: &Fault, names: &Names) -> Self {
        let fields = fault.given(names).into_iter().map(|(field, given)| (field.name().to_owned(), given));
        FaultSpec { kind: fault.kind().name().to_owned(), fields: fields.collect(), required: false }
    }
}
