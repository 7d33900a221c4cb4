//! Constants for the values and bits with an `id`, which the code needs. Each meaning has a module.

use super::text::doc;
use crate::model::{Bit, Device, Meaning, Provenance, Scalar, Value};
use std::fmt::Write;

/// Writes the constants of the meanings that the device or the family declares.
pub(crate) fn emit(out: &mut String, device: &Device) {
    let own = device.meanings.iter().filter(|meaning| !meaning.shared);
    let modules: String = own.filter_map(|meaning| Some(module(device, meaning, meaning.scalar?))).collect();
    if !modules.is_empty() {
        let _ = write!(
            out,
            "/// Values and bits of registers, by the meaning that the layout files give them.\npub mod values {{\n{modules}}}\n\n"
        );
    }
}

fn module(device: &Device, meaning: &Meaning, scalar: Scalar) -> String {
    let mut out = doc("    ", &format!("Meaning `{}`.", meaning.name));
    let _ = writeln!(out, "    pub mod {} {{", meaning.name);
    let of = ConstantOwner { device, meaning, scalar };
    for value in &meaning.values {
        of.value(&mut out, value);
    }
    for bit in &meaning.bits {
        of.bit(&mut out, bit);
    }
    out.push_str("    }\n");
    out
}

/// The owner of the constants.
struct ConstantOwner<'a> {
    device: &'a Device,
    meaning: &'a Meaning,
    scalar: Scalar,
}

impl ConstantOwner<'_> {
    /// Writes the constant of a value: a number for a single value, otherwise a range.
    fn value(&self, out: &mut String, value: &Value) {
        let Value { id: Some(id), first, last, text, source, .. } = value else { return };
        let text = text.replace("{}", "n");
        if first == last {
            self.number(out, id, *first, &format!("16#{first:X}: {text}"), source);
        } else {
            let (ty, digits) = (self.scalar.content(), self.digits());
            let about = format!("16#{first:X} to 16#{last:X}: {text}");
            out.push_str(&doc("        ", &self.constant_doc(&about, source)));
            let _ = writeln!(
                out,
                "        pub const {id}: core::ops::RangeInclusive<{ty}> = 0x{first:0digits$X}..=0x{last:0digits$X};"
            );
        }
    }

    /// Writes the constants of a bit or a field of bits: a mask, and the values of a field at the bit position of the
    /// field.
    fn bit(&self, out: &mut String, bit: &Bit) {
        let Bit { first, last, name, zero, one, source, .. } = bit;
        if let Some(id) = &bit.id {
            let about = if first < last {
                format!("Bits {first} to {last}: {name}")
            } else if zero.is_empty() {
                format!("Bit {first}: {one}")
            } else {
                format!("Bit {first}: 0 {zero}, 1 {one}")
            };
            let mask = u32::MAX >> (31 - (last - first)) << first;
            self.number(out, id, mask, &about, source);
        }
        for value in &bit.values {
            if let Some(id) = &value.id {
                let about = format!("Bits {first} to {last}, {name} {}: {}", value.first, value.text);
                self.number(out, id, value.first << first, &about, &value.source);
            }
        }
    }

    fn number(&self, out: &mut String, id: &str, number: u32, about: &str, source: &Provenance) {
        let (ty, digits) = (self.scalar.content(), self.digits());
        out.push_str(&doc("        ", &self.constant_doc(about, source)));
        let _ = writeln!(out, "        pub const {id}: {ty} = 0x{number:0digits$X};");
    }

    /// Returns the number of hexadecimal digits of a value.
    fn digits(&self) -> usize {
        self.scalar.width() as usize * 2
    }

    fn constant_doc(&self, about: &str, source: &Provenance) -> String {
        let from = match source {
            Provenance::Manual => {
                let manual = &self.device.manual;
                format!("manual {manual} p. {}", self.meaning.page_in(manual))
            }
            Provenance::Documented(document) => document.clone(),
            Provenance::Inferred(decision) => format!("inferred, {decision}"),
        };
        format!("{about} ({from}).")
    }
}
