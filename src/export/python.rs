//! A Python module without dependencies. The tables are generated here; the functions are in `python/attach.py`.

use super::constants::{self, Enumeration};
use super::rows;
use super::scope::Scope;
use super::text;
use crate::layout::{BitField, Meaning, Provenance, RegType, Register, Space, Unit, ValueMeaning};
use crate::memory::HEADER_SIZE;
use crate::memory::contract::{self, Codes, Field, FieldKind, HeaderStruct};
use crate::memory::header::{ABI_VERSION, MAGIC};
use std::fmt::Write;

const IMPORTS: &str = "\
import enum
import fcntl
import itertools
import mmap
import operator
import os
import re
import stat
import struct
import sys
import time
from typing import Callable, Iterator, NamedTuple, Optional, Union

";
const ATTACH: &str = include_str!("python/attach.py");

pub(crate) fn generate(scope: &Scope) -> String {
    let mut out = String::from("\"\"\"");
    out.push_str(&text::banner(scope, "python").join("\n"));
    out.push_str("\n\"\"\"\n\n");
    out.push_str(IMPORTS);
    let _ = writeln!(out, "MAGIC = 0x{MAGIC:016X}");
    let _ = writeln!(out, "ABI_VERSION = {ABI_VERSION}");
    let _ = writeln!(out, "LAYOUT_HASH = 0x{:016X}", scope.device.layout_hash);
    let _ = writeln!(out, "HEADER_SIZE = {HEADER_SIZE}");
    let _ = writeln!(out, "SEGMENT_SIZE = {}", scope.device.segment_size());
    contract::CODES.iter().for_each(|of| codes(&mut out, of));
    out.push_str(
        "\n\n# Structures of the header page: offset, kind, number of elements, bytes of one.\n_HEADER = {\n",
    );
    contract::structures().into_iter().for_each(|of| header_struct(&mut out, of));
    out.push_str("}\n");
    constants::enumerations(scope).iter().for_each(|of| enumeration(&mut out, of));
    areas(&mut out, scope);
    structures(&mut out, scope);
    out.push_str("\n# Values: first, last, text, decision. Bits: first, last, zero, one, text, values, joined, reserved, decision.\n\
         # Of what the manual states the decision is None.\n_MEANINGS = {\n");
    scope.meanings().iter().for_each(|(meaning, _)| self::meaning(&mut out, meaning));
    out.push_str("}\n");
    out.push_str(ATTACH);
    out
}

fn codes(out: &mut String, of: &Codes) {
    let _ = writeln!(out, "\n\nclass {}(enum.IntEnum):", of.name);
    for (value, name, doc) in of.codes {
        let _ = writeln!(out, "    {} = {value}  # {}", text::snake(name).to_uppercase(), doc.trim());
    }
}

fn header_struct(out: &mut String, of: &HeaderStruct) {
    let _ = writeln!(out, "    {:?}: {{", of.name);
    for Field { offset, name, kind, count } in of.fields {
        let code = match kind {
            FieldKind::Integer(1) => "B",
            FieldKind::Integer(4) => "I",
            FieldKind::Integer(_) => "Q",
            FieldKind::Struct(of) => of.name,
        };
        let count = count.map_or("None".to_owned(), |count| count.to_string());
        let _ = writeln!(out, "        {name:?}: ({offset}, {code:?}, {count}, {}),", kind.bytes());
    }
    out.push_str("    },\n");
}

/// Returns the name of an enumeration or a constant, with `_` appended if the module itself has another use of the name.
fn free_name(name: &str) -> String {
    if name == "HEADER_SIZE" || text::has_word(ATTACH, name) { format!("{name}_") } else { name.to_owned() }
}

/// Generates an enumeration of the values, or flags if the members are bits. The constants for the lowest bits of
/// fields are not members.
fn enumeration(out: &mut String, of: &Enumeration) {
    if !of.members.is_empty() {
        let base = if of.is_flags { "IntFlag" } else { "IntEnum" };
        let _ = writeln!(out, "\n\nclass {}(enum.{base}):", free_name(&of.name));
        for (name, value, text) in &of.members {
            let number = if *value < 0 { value.to_string() } else { format!("0x{value:X}") };
            let _ = writeln!(out, "    {name} = {number}  # {text}");
        }
    }
    if !of.shifts.is_empty() {
        out.push_str("\n\n");
    }
    for (name, value) in &of.shifts {
        let _ = writeln!(out, "{} = {value}", free_name(name));
    }
}

fn areas(out: &mut String, scope: &Scope) {
    out.push_str(
        "\n\n# Addresses: letter, segment, whether words are counted, first number, byte of the image, size in bytes.\n_SPACES = [\n",
    );
    for Space { letter, segment, unit, first, offset, bytes, .. } in scope.device.spaces {
        let words = if *unit == Unit::Word { "True" } else { "False" };
        let _ = writeln!(out, "    (\"{letter}\", {segment:?}, {words}, {first}, {offset}, {bytes}),");
    }
    out.push_str("]\n");
    out.push_str(
        "\n# First byte in an image, size in bytes, purpose; structures: type, when it is valid, variable.\n\
         AREAS = {\n",
    );
    for area in &scope.areas {
        let placed = area.structures.iter().map(|placed| {
            format!("({:?}, {:?}, {:?}), ", placed.structure.name, rows::live(area, placed), placed.variable)
        });
        let _ = writeln!(
            out,
            "    {:?}: ({}, {}, {}, ({})),",
            area.name,
            area.first,
            area.bytes,
            quoted(area.doc),
            placed.collect::<String>().trim_end()
        );
    }
    out.push_str("}\n");
}

fn structures(out: &mut String, scope: &Scope) {
    out.push_str(
        "\n# Sub-structure, name, code, offset, dimensions (count, used, stride), how many of them are the\n\
         # sub-structure's, owner, value after power-on, reserved, meaning, purpose, pages, inferred facts.\n\
         _STRUCTURES = {\n",
    );
    for structure in scope.structures() {
        let _ = writeln!(out, "    # {}\n    {:?}: (", text::about(structure), structure.name);
        for register in structure.registers {
            self::register(out, register);
        }
        out.push_str("    ),\n");
    }
    out.push_str("}\n");
}

fn register(out: &mut String, register: &Register) {
    let dims = register.dims.iter().map(|dim| format!("({}, {}, {}), ", dim.count, dim.used, dim.stride));
    let _ = writeln!(
        out,
        "        ({:?}, {:?}, {:?}, {}, ({}), {}, {:?}, 0x{:X}, {}, {}, {}, {}, {}),",
        register.group,
        register.name,
        code(register.ty),
        register.offset,
        dims.collect::<String>().trim_end(),
        register.group_dims,
        register.owner.to_string(),
        register.reset,
        boolean(register.reserved),
        register.meaning.map_or("None".to_owned(), |meaning| format!("{:?}", meaning.name)),
        quoted(register.doc),
        quoted(register.page),
        quoted(&register.provenance())
    );
}

fn meaning(out: &mut String, meaning: &Meaning) {
    let _ = writeln!(out, "    {:?}: (\n        ({}),\n        (", meaning.name, values(meaning.values));
    for BitField { first, last, zero, one, text, values, joined, reserved, source, .. } in meaning.bits {
        let values = self::values(values);
        let (joined, reserved) = (boolean(*joined), boolean(*reserved));
        let [zero, one, text] = [zero, one, text].map(|text| quoted(text));
        let _ = writeln!(
            out,
            "            ({first}, {last}, {zero}, {one}, {text}, ({values}), {joined}, {reserved}, {}),",
            decision(source)
        );
    }
    out.push_str("        ),\n    ),\n");
}

fn values(values: &[ValueMeaning]) -> String {
    let value = |known: &ValueMeaning| {
        format!("({}, {}, {}, {}), ", known.first, known.last, quoted(known.text), decision(&known.source))
    };
    values.iter().map(value).collect::<String>().trim_end().to_owned()
}

/// Returns the decision from which a meaning follows, or `None`.
fn decision(source: &Provenance) -> String {
    source.decision().map_or("None".to_owned(), quoted)
}

/// Returns a text as a string literal of Python. Rust's own escaping is not used, because Python does not know its
/// escapes of unprintable characters.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for sign in text.chars() {
        match sign {
            '"' | '\\' => quoted.extend(['\\', sign]),
            ' '..='~' => quoted.push(sign),
            _ if sign.escape_debug().len() == 1 => quoted.push(sign),
            _ => {
                let _ = write!(quoted, "\\U{:08x}", u32::from(sign));
            }
        }
    }
    quoted + "\""
}

const fn boolean(value: bool) -> &'static str {
    if value { "True" } else { "False" }
}

/// Returns the type code for Python's modules `struct` and `array`.
const fn code(ty: RegType) -> &'static str {
    match ty {
        RegType::Byte | RegType::Usint => "B",
        RegType::Word | RegType::Uint => "H",
        RegType::Dword | RegType::Udint => "I",
        RegType::Sint => "b",
        RegType::Int => "h",
        RegType::Dint => "i",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    #[test]
    fn texts_are_strings_of_python() {
        assert_eq!(quoted("a '\u{e4}' \"\\\n\u{2028}"), "\"a '\u{e4}' \\\"\\\\\\U0000000a\\U00002028\"");
    }

    #[test]
    fn every_register_is_in_the_tables() {
        let module = generate(&Scope::new(&DEVICE, None).unwrap());
        assert!(module.contains(
            "(\"\", \"a_RD_BMARRAY\", \"i\", 832, ((32, 32, 64), (16, 8, 4),), 0, \"firmware\", 0x0, False, None, "
        ));
        assert!(module.contains("    \"node2\": (200000, 32768, "));
        assert!(module.contains("        \"answer\": (192, \"Bell\", None, 8),\n"));
    }
}
