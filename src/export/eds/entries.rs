//! The sections of the objects, including entries that the device does not have but CiA 306 requires.

use super::IDENTITY;
use crate::layout::object::{Access, Default, Type};
use crate::layout::{Object, Provenance};
use std::collections::HashMap;

/// Name of sub-index 0 of a record.
const HIGHEST: &str = "Highest sub-index";
/// Data type of CiA 301.
const UNSIGNED8: u16 = 0x5;
/// The identity object of a device without one (D-770): the vendor-ID 0 means that the vendor is unknown.
const UNKNOWN_IDENTITY: &str = "[1018]\nParameterName=Identity\nObjectType=0x9\nSubNumber=2\n\n\
     [1018sub0]\nParameterName=Highest sub-index\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nDefaultValue=0x1\nPDOMapping=0\n\n\
     [1018sub1]\nParameterName=Vendor-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x0\nPDOMapping=0\n\n";

/// PDOs that carry an entry.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Carrier {
    Receive,
    Transmit,
}

/// The objects of a device, as an electronic data sheet describes them.
pub(super) struct Dictionary<'a> {
    objects: &'a [&'a Object],
    /// The PDOs that carry an entry, by index and sub-index.
    carriers: HashMap<(u16, u8), Carrier>,
    /// Number of objects with the same name.
    names: HashMap<String, usize>,
}

impl<'a> Dictionary<'a> {
    /// Creates a dictionary of `objects`, which are in ascending order.
    pub(super) fn new(objects: &'a [&'a Object]) -> Self {
        let mut dictionary = Self { objects, carriers: carriers(objects), names: HashMap::new() };
        for index in dictionary.indices() {
            *dictionary.names.entry(manuals_name(&dictionary.of(index))).or_default() += 1;
        }
        dictionary
    }

    /// Returns the indices in ascending order, each once.
    pub(super) fn indices(&self) -> Vec<u16> {
        let mut indices: Vec<u16> = self.objects.iter().map(|object| object.index).collect();
        indices.push(IDENTITY);
        indices.sort_unstable();
        indices.dedup();
        indices
    }

    fn of(&self, index: u16) -> Vec<&'a Object> {
        self.objects.iter().copied().filter(|object| object.index == index).collect()
    }

    /// Returns the sections of one index.
    pub(super) fn sections(&self, index: u16) -> String {
        let own = self.of(index);
        match &own[..] {
            [] => UNKNOWN_IDENTITY.to_owned(),
            [only] if only.sub == 0 => self.variable(only, &format!("{index:04X}"), &self.name(&own)),
            _ => self.record(index, &own),
        }
    }

    /// Returns the comments on all entries, one line each, without the characters at which some readers end a value.
    pub(super) fn comments(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for index in self.indices() {
            let own = self.of(index);
            if own.is_empty() {
                lines.push(format!("{index:04X}h: the device has no identity object (inferred: D-770)"));
            }
            if own.first().is_some_and(|first| first.sub > 0) {
                lines.push(format!("{index:04X}h: the device has no sub-index 0 (inferred: D-770)"));
            }
            for object in own.iter().copied() {
                lines.push(format!("{index:04X}h sub {}: {}", object.sub, self.about(object, own.len() > 1)));
            }
        }
        lines.iter().map(|line| line.replace(" = ", " is ").replace('=', ":").replace(';', ",")).collect()
    }

    /// Returns the comment on an entry of the device. `is_record`: the object has several entries.
    fn about(&self, object: &Object, is_record: bool) -> String {
        let mut text = documented(object);
        if is_record && object.sub == 0 && object.ty != Some(Type::U8) {
            let octets = object.ty.and_then(Type::bytes).unwrap_or_default();
            let answer = format!(", the device answers with {octets} octets, {} (D-770)", object.default);
            text += &answer;
        }
        let carrier = self.carriers.get(&(object.index, object.sub));
        if object.access == Access::ReadOnly && carrier == Some(&Carrier::Receive) {
            text += ", SDOs can only read it (D-771)";
        }
        text
    }

    /// Returns the name of an object, with the index if several objects have this name in the manual.
    fn name(&self, own: &[&Object]) -> String {
        let name = manuals_name(own);
        let index = own.first().map_or(0, |object| object.index);
        if self.names.get(&name).is_some_and(|count| *count > 1) {
            format!("{name} ({index:04X}h)")
        } else {
            name
        }
    }

    fn record(&self, index: u16, own: &[&Object]) -> String {
        let last = own.last().map_or(0, |object| object.sub);
        let subs = own.iter().filter(|object| object.sub > 0);
        let count = subs.clone().count() + 1;
        let mut text =
            format!("[{index:04X}]\nParameterName={}\nObjectType=0x9\nSubNumber={count}\n\n", self.name(own));
        text += &highest(index, last);
        for object in subs {
            let is_shared = own.iter().filter(|it| it.name == object.name).count() > 1;
            let name =
                if is_shared { format!("{} {}", object.name, object.sub) } else { object.name.to_owned() };
            text += &self.variable(object, &format!("{index:04X}sub{:X}", object.sub), &name);
        }
        text
    }

    /// Returns the section of one entry with a value.
    fn variable(&self, object: &Object, section: &str, name: &str) -> String {
        // An object of the type domain is written as a variable with the data type DOMAIN, because eds-utils accepts
        // only variables as objects with a single entry.
        let data = match object.ty {
            Some(Type::U8) => UNSIGNED8,
            Some(Type::U16) => 0x6,
            Some(Type::U32) | None => 0x7,
            Some(Type::String) => 0x9,
            Some(Type::Domain) => 0xF,
        };
        let default = match object.default {
            Default::Nothing => String::new(),
            Default::Number(number) => format!("DefaultValue=0x{number:X}\n"),
            Default::PlusNode(number) => format!("DefaultValue=$NODEID+0x{number:X}\n"),
            Default::Text(text) => format!("DefaultValue={text}\n"),
        };
        let carrier = self.carriers.get(&(object.index, object.sub)).copied();
        // Decision D-771: in a data sheet, an entry that a PDO writes is not read-only.
        let access = match (object.access, carrier) {
            (_, Some(Carrier::Receive)) => "rww",
            (Access::ReadWrite, Some(Carrier::Transmit)) => "rwr",
            (Access::ReadWrite, None) => "rw",
            (Access::ReadOnly | Access::NotImplemented, _) => "ro",
        };
        format!(
            "[{section}]\nParameterName={name}\nObjectType=0x7\nDataType=0x{data:04X}\nAccessType={access}\n{default}PDOMapping={}\n\n",
            u8::from(carrier.is_some()),
        )
    }
}

/// Returns the manual's description of an entry, and the decisions about it.
fn documented(object: &Object) -> String {
    let facts = [("entry", object.row_from), ("default", object.default_from)];
    let from = match Provenance::summary(&facts) {
        documented if documented == Provenance::Manual.to_string() => String::new(),
        inferred => format!(", inferred: {inferred}"),
    };
    format!("{} (p. {}{from})", object.doc, object.page)
}

/// Sub-index 0 of a record: the highest sub-index, in eight bits (D-770).
fn highest(index: u16, last: u8) -> String {
    format!(
        "[{index:04X}sub0]\nParameterName={HIGHEST}\nObjectType=0x7\nDataType=0x{UNSIGNED8:04X}\nAccessType=ro\nDefaultValue=0x{last:X}\nPDOMapping=0\n\n"
    )
}

/// Returns the manual's name of an object. For a record, returns the name of its sub-index 0, or the common start of
/// the names of its entries.
fn manuals_name(own: &[&Object]) -> String {
    match own {
        [] => "Identity".to_owned(),
        [first, ..] if first.sub == 0 => first.name.to_owned(),
        [first, rest @ ..] => {
            let is_common = |at: usize, word: &&str| {
                rest.iter().all(|object| object.name.split(' ').nth(at) == Some(*word))
            };
            let words = first.name.split(' ').enumerate().take_while(|(at, word)| is_common(*at, word));
            let words: Vec<_> = words.map(|(_, word)| word).collect();
            if rest.is_empty() || words.is_empty() {
                format!("Object {:04X}h", first.index)
            } else {
                words.join(" ") + "s"
            }
        }
    }
}

/// Returns the entries in the default mappings of PDOs.
fn carriers(objects: &[&Object]) -> HashMap<(u16, u8), Carrier> {
    let mapped = objects.iter().filter(|object| object.sub > 0).filter_map(|object| {
        let carrier = match object.index {
            0x1600..0x1800 => Carrier::Receive,
            0x1A00..0x1C00 => Carrier::Transmit,
            _ => return None,
        };
        let Default::Number(entry) = object.default else { return None };
        let [index_high, index_low, sub, _] = entry.to_be_bytes();
        Some(((u16::from_be_bytes([index_high, index_low]), sub), carrier))
    });
    mapped.collect()
}
