//! Properties of a PROFIBUS-DP slave that masters need. They become a table for tools, and constants for the firmware.

use super::tables::{provenance, static_name};
use super::text::doc;
use crate::gsd::{Gsd, Key, Value};
use crate::model::{Device, Field, FieldType};
use std::fmt::Write;

/// Writes the table into the module of descriptors.
pub(crate) fn emit(out: &mut String, device: &Device) {
    let Some(gsd) = &device.gsd else { return };
    let Gsd { page, keys, parameters, constants, diagnosis, modules, .. } = gsd;
    let _ = writeln!(
        out,
        "    /// What masters know of it.\n    pub static GSD: Gsd = Gsd {{\n        page: {page:?},\n        keys: &["
    );
    for Key { name, value, bare, from } in keys {
        let value = match value {
            Value::Number(number) => format!("gsd::Value::Number({number})"),
            Value::Text(text) if *bare => format!("gsd::Value::Bare({text:?})"),
            Value::Text(text) => format!("gsd::Value::Text({text:?})"),
        };
        let from = provenance(from);
        let _ = writeln!(out, "            gsd::Key {{ name: {name:?}, value: {value}, from: {from} }},");
    }
    let _ = writeln!(out, "        ],\n        constants: &{constants:?},\n        parameters: &[");
    for parameter in parameters {
        let bit = match parameter.bit {
            None => "None".to_owned(),
            Some((bit, inverted)) => format!("Some(gsd::Bit {{ at: {bit}, inverted: {inverted} }})"),
        };
        let register = register(device, &parameter.register);
        let _ = writeln!(
            out,
            "            gsd::Parameter {{ register: {register}, octet: {}, octets: {}, name: {:?}, bit: {bit}, default: {}, from: {}, to: {} }},",
            parameter.octet,
            parameter.octets(),
            parameter.name,
            parameter.default,
            parameter.from,
            parameter.to
        );
    }
    let diagnosis = diagnosis.as_ref().map_or_else(
        || "None".to_owned(),
        |it| {
            let (register, from) = (register(device, &it.register), provenance(&it.from));
            format!("Some(gsd::Texts {{ register: {register}, octet: {}, from: {from} }})", it.octet)
        },
    );
    let _ = writeln!(out, "        ],\n        diagnosis: {diagnosis},\n        modules: &[");
    for module in modules {
        let _ = writeln!(
            out,
            "            gsd::Module {{ name: {:?}, octets: &{:?}, page: {:?}, from: {} }},",
            module.name,
            module.octets,
            module.page,
            provenance(&module.from)
        );
    }
    out.push_str("        ],\n    };\n\n");
}

/// Returns a reference to a register of a structure.
fn register(device: &Device, (structure, name): &(usize, String)) -> String {
    let structure = &device.structures[*structure];
    let registers = |field: &Field| match field.kind {
        FieldType::Scalar(_) => 1,
        FieldType::Sub(index) => {
            let members = device.substructures[index].fields.iter();
            members.filter(|member| matches!(member.kind, FieldType::Scalar(_))).count()
        }
        FieldType::Padding(_) => 0,
    };
    let before = structure.fields.iter().take_while(|field| field.name != *name);
    format!("&{}.registers[{}]", static_name(&structure.name), before.map(registers).sum::<usize>())
}

/// Writes the numbers of the file, and the user's parameters at their defaults, as constants.
pub(crate) fn constants(out: &mut String, device: &Device) {
    let Some(gsd) = &device.gsd else { return };
    let manual = &device.manual;
    out.push_str("/// What the device description file says.\npub mod gsd {\n");
    for key in &gsd.keys {
        let is_name = key.name.starts_with(|c: char| c.is_ascii_alphabetic()) && !key.name.contains('.');
        let (Value::Number(number), true) = (&key.value, is_name) else { continue };
        out.push_str(&doc("    ", &format!("`{}` (manual {manual} p. {}).", key.name, gsd.page)));
        let _ = writeln!(out, "    pub const {}: u16 = {number};", key.name.to_uppercase());
    }
    let count = gsd.defaults.len();
    let _ = writeln!(
        out,
        "    /// The user's octets of Set_Prm with every parameter at its default.\n    pub const DEFAULTS: [u8; {count}] = {:?};\n}}\n",
        gsd.defaults
    );
}
