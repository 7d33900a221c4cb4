//! The front panel of a device in the form of registers: a space, and an area with one structure, in the header page.

use crate::model::{
    Area, Device, Field, FieldType, FrontWord, Letter, Owner, Provenance, Space, Structure, Unit,
};
use std::collections::BTreeSet;

/// First byte and size of the front panel in the header page.
const PLACE: (u32, u32) = (3520, 256);
/// The decision about the place of the front panel.
const DECISION: &str = "D-281";

/// The front panel in the form of registers.
pub struct Front {
    /// The addresses of the front panel, after the spaces of the device. No program of the device uses these addresses.
    pub space: Space,
    /// The structure of the words.
    pub words: Structure,
    /// The area; its list of structures is empty, because `words` is not among the structures of the device.
    pub area: Area,
}

/// Returns the front panel of a device; `None` if the device has none.
#[must_use]
pub fn of(device: &Device) -> Option<Front> {
    let last = device.front.last()?;
    let ours = Provenance::Inferred(DECISION.to_owned());
    let pages = device.front.iter().map(|word| word.page.as_str()).filter(|page| !page.is_empty());
    let pages: BTreeSet<_> = pages.collect();
    let page = pages.into_iter().collect::<Vec<_>>().join(", ");
    let words = Structure {
        name: "FRONT_WORDS".to_owned(),
        name_from: ours.clone(),
        size: last.offset + last.scalar.width(),
        align: last.scalar.width(),
        page: page.clone(),
        doc: "What the device has at its front".to_owned(),
        shared: false,
        view: None,
        fields: device.front.iter().map(|word| field(word, &ours)).collect(),
    };
    let (first, bytes) = PLACE;
    let area = Area {
        name: "front".to_owned(),
        name_from: ours,
        space: device.spaces.len(),
        first,
        bytes,
        cpu: None,
        page,
        doc: words.doc.clone(),
        structures: Vec::new(),
    };
    Some(Front { space: space(), words, area })
}

fn space() -> Space {
    let (offset, bytes) = PLACE;
    Space {
        name: "front".to_owned(),
        letter: Letter::F,
        segment: None,
        unit: Unit::Byte,
        first: 0,
        offset,
        bytes,
        page: String::new(),
        doc: "front, in the header page".to_owned(),
    }
}

/// Returns the field of a word. Its existence and its writer are from the device's manual; name, place and type are
/// commram's own.
fn field(word: &FrontWord, ours: &Provenance) -> Field {
    let FrontWord { name, scalar, offset, owner, meaning, source, page, doc, .. } = word;
    let owner: Owner = *owner;
    Field {
        name: name.clone(),
        view_name: String::new(),
        offset: *offset,
        kind: FieldType::Scalar(*scalar),
        dims: Vec::new(),
        used: Vec::new(),
        array_type: String::new(),
        also: String::new(),
        reserved: false,
        owner,
        reset: 0,
        page: page.clone(),
        doc: doc.clone(),
        meaning: *meaning,
        name_from: ours.clone(),
        offset_from: ours.clone(),
        type_from: ours.clone(),
        owner_from: source.clone(),
        reset_from: ours.clone(),
    }
}
