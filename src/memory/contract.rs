//! The header page as data, for generators of declarations in other languages.
//!
//! Offsets and kinds come from the Rust structs. The meaning of a field is read from the tables of
//! `docs/reference/attach.md`, so there is only one description.

use super::header::*;

pub use super::struct_tables::{Codes, Field, FieldKind, HeaderStruct};

/// All tables of codes in the header page.
pub const CODES: [Codes; 11] = [
    State::CODES,
    ClockMode::CODES,
    RunSwitch::CODES,
    ProgramState::CODES,
    Project::CODES,
    Start::CODES,
    Power::CODES,
    InterruptResult::CODES,
    OptInitResult::CODES,
    InitialFlagResult::CODES,
    SeatState::CODES,
];

/// Returns the structures of the header page, each before those that contain it; the page itself is the last.
#[must_use]
pub fn structures() -> Vec<&'static HeaderStruct> {
    fn add(of: &'static HeaderStruct, found: &mut Vec<&'static HeaderStruct>) {
        for field in of.fields {
            if let FieldKind::Struct(of) = field.kind {
                add(of, found);
            }
        }
        if !found.iter().any(|known| known.name == of.name) {
            found.push(of);
        }
    }
    let mut found = Vec::new();
    add(&Header::STRUCT, &mut found);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::Bell;

    /// Every byte of the page is in the tables of the contract, under the name of its field.
    #[test]
    #[cfg_attr(miri, ignore = "searches a page for each field, which takes too long under Miri")]
    fn the_attach_contract_describes_every_byte() {
        for of in structures() {
            let mut end = 0;
            for field in of.fields {
                assert_eq!(field.offset, end, "{}.{}", of.name, field.name);
                end += field.bytes();
                let meaning = field.meaning();
                assert!(meaning.is_some(), "docs/reference/attach.md lacks {}.{}", of.name, field.name);
                assert_eq!(meaning == Some(String::new()), field.is_reserved(), "{}.{}", of.name, field.name);
            }
            assert_eq!(end, of.bytes, "{}", of.name);
        }
    }

    /// A change of a field or code needs a new ABI version. A new code needs none, and neither does a new field in a
    /// reserved place.
    #[cfg(feature = "emulator")]
    #[test]
    fn the_page_changes_with_the_version_only() {
        let mut lines = Vec::new();
        for of in structures() {
            lines.push(format!("{}: {} bytes\n", of.name, of.bytes));
            for field in of.fields.iter().filter(|field| !field.is_reserved()) {
                let kind = match field.kind {
                    FieldKind::Integer(bytes) => format!("integer of {bytes} bytes"),
                    FieldKind::Struct(of) => of.name.to_owned(),
                };
                let count = field.count.map_or(String::new(), |count| format!(" x {count}"));
                lines.push(format!("{}.{} at {}: {kind}{count}\n", of.name, field.name, field.offset));
            }
        }
        for codes in CODES {
            lines
                .extend(codes.codes.iter().map(|(code, name, _)| format!("{} {code}: {name}\n", codes.name)));
        }
        let name = format!("header-{ABI_VERSION}");
        crate::format_samples::assert_only_added(&name, "ABI_VERSION", &lines.concat());
    }

    #[test]
    fn a_field_knows_what_it_is() {
        let field = |name| Header::STRUCT.fields.iter().find(|field| field.name == name).unwrap();
        let events = field("events");
        assert_eq!((events.count, events.bytes()), (Some(16), 256));
        assert_eq!(events.kind, FieldKind::Struct(&EventSlot::STRUCT));
        assert_eq!((field("magic").kind, field("magic").count), (FieldKind::Integer(8), None));
        assert_eq!(field("instance").kind, FieldKind::Integer(1));
        assert_eq!(field("magic").meaning().unwrap(), "the text commram and a zero byte");
        assert_eq!(Bell::STRUCT.fields[0].meaning().unwrap(), "number of rings, wrapping; the futex");
    }
}
