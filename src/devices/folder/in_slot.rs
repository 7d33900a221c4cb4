//! Option cards: their registers lie in the memory of their controller, at the addresses of an option interface (D-815).
//!
//! The layout of such a controller is made when its plant is read, from the layouts of the controller and of its cards.
//! The card keeps an image with its front panel only.

use super::of_card::CardFacts;
use super::{Loaded, loaded, tables};
use crate::devices::{OptionInterface, Registered, registry};
use crate::layout::{Area, DeviceLayout, Port, Space, Unit};
use crate::memory::DeviceFolder;
use crate::memory::header::{AREAS, TABLE_NAME_LENGTH};
use std::path::Path;
use twox_hash::XxHash3_64;

/// A card at an option interface: the interface, and the layout of the card alone.
pub(crate) type CardAt = (OptionInterface, &'static DeviceLayout);

/// Layouts that were made for cards in slots. They are never freed.
pub(super) struct InSlots {
    controllers: Vec<Composed>,
    /// The layout of a card alone, and the device with its front panel only.
    faces: Vec<(&'static DeviceLayout, &'static Registered)>,
}

/// A controller with cards.
struct Composed {
    controller: &'static DeviceLayout,
    cards: Vec<CardAt>,
    registered: &'static Registered,
}

impl Composed {
    fn is_of(&self, controller: &DeviceLayout, cards: &[CardAt]) -> bool {
        let is_same = |(one, other): (&CardAt, &CardAt)| one.0 == other.0 && core::ptr::eq(one.1, other.1);
        core::ptr::eq(self.controller, controller)
            && self.cards.len() == cards.len()
            && self.cards.iter().zip(cards).all(is_same)
    }
}

impl InSlots {
    pub(super) const fn new() -> Self {
        InSlots { controllers: Vec::new(), faces: Vec::new() }
    }

    /// Maximum number of layouts of one kind.
    pub(super) fn len(&self) -> usize {
        self.controllers.len().max(self.faces.len())
    }

    /// Returns the devices, the last ones first.
    pub(super) fn registered(&self) -> impl Iterator<Item = &'static Registered> {
        let controllers = self.controllers.iter().rev().map(|composed| composed.registered);
        controllers.chain(self.faces.iter().rev().map(|(_, face)| *face))
    }
}

/// Returns the number of bytes from a byte of the image of a card to the same byte in the image of its controller, if the
/// interface begins at byte `first`. The sum wraps.
pub(super) fn shift(card: &DeviceLayout, first: u32) -> u32 {
    space_of(card).map_or(0, |space| first.wrapping_sub(space.offset))
}

/// Returns the space with the registers of a card; `None` if it has none, or several.
fn space_of(card: &DeviceLayout) -> Option<&'static Space> {
    let front = card.front_area.map(|area| area.space.offset);
    let mut own = card.spaces.iter().filter(|space| Some(space.offset) != front);
    own.next().filter(|_| own.next().is_none())
}

/// Returns the layout of a card in a slot, for its own image: the front panel.
///
/// # Errors
/// The process has read too many folders; the error is a line of text.
pub(crate) fn face_of(card: &'static DeviceLayout) -> Result<&'static DeviceLayout, String> {
    let mut loaded = loaded();
    if let Some((_, face)) = loaded.in_slots.faces.iter().find(|(known, _)| core::ptr::eq(*known, card)) {
        return Ok(face.layout);
    }
    check_room(&loaded)?;
    let front = card.front_area.map_or(&[][..], |area| core::slice::from_ref(area.space));
    let mut all = card.layout_hash.to_le_bytes().to_vec();
    all.extend_from_slice(b"in a slot");
    let layout: &'static DeviceLayout = Box::leak(Box::new(DeviceLayout {
        layout_hash: XxHash3_64::oneshot(&all),
        spaces: front,
        areas: &[],
        retain: None,
        ..*card
    }));
    let face: &'static Registered = Box::leak(Box::new(Registered::new(layout)));
    loaded.in_slots.faces.push((card, face));
    Ok(layout)
}

fn check_room(loaded: &Loaded) -> Result<(), String> {
    match loaded.in_slots.len() < loaded.most {
        true => Ok(()),
        false => {
            Err(format!("this process has read {} layouts with option cards, and reads no more", loaded.most))
        }
    }
}

/// Returns the device that `controller` is with these cards, in the order of their interfaces. Each area of a card has its
/// name in the card, and the number of the interface.
///
/// # Errors
/// A card does not fit; the error has the index of the card, and a line of text.
pub(crate) fn with_cards(
    controller: &'static Registered,
    cards: &[CardAt],
) -> Result<&'static Registered, (usize, String)> {
    let mut loaded = loaded();
    let base = controller.layout;
    if let Some(known) = loaded.in_slots.controllers.iter().find(|known| known.is_of(base, cards)) {
        return Ok(known.registered);
    }
    check_room(&loaded).map_err(|reason| (0, reason))?;
    let mut areas: Vec<Area> = base.areas.iter().map(copy_of).collect();
    let mut hashed = base.layout_hash.to_le_bytes().to_vec();
    let mut known: Vec<CardFacts> = Vec::new();
    for (index, (interface, card)) in cards.iter().enumerate() {
        let facts = known.iter().position(|facts| facts.is_of(card)).unwrap_or_else(|| {
            known.push(CardFacts::of(card));
            known.len() - 1
        });
        place(&mut areas, (*interface, card), &mut known[facts]).map_err(|reason| (index, reason))?;
        hashed.extend_from_slice(&interface.first.to_le_bytes());
        hashed.extend_from_slice(&card.layout_hash.to_le_bytes());
    }
    // The retain flags are an additional area of the header page.
    let most = AREAS - usize::from(base.retain.is_some());
    if areas.len() > most {
        let last = cards.len().saturating_sub(1);
        let reason = format!(
            "'{}' would have {} areas with its option cards, and the header page has room for {most}",
            base.name,
            areas.len()
        );
        return Err((last, reason));
    }
    let areas: &'static [Area] = tables::leaked(areas);
    let same = |area: &'static Area| areas.iter().find(|it| it.first == area.first).unwrap_or(area);
    let port = |port: &'static Port| Port { area: same(port.area), ..*port };
    let layout: &'static DeviceLayout = Box::leak(Box::new(DeviceLayout {
        layout_hash: XxHash3_64::oneshot(&hashed),
        areas,
        ports: tables::leaked(base.ports.iter().map(port).collect()),
        own: base.own.map(same),
        ..*base
    }));
    let registered: &'static Registered = Box::leak(Box::new(Registered { layout, ..*controller }));
    let cards = cards.to_vec();
    loaded.in_slots.controllers.push(Composed { controller: base, cards, registered });
    Ok(registered)
}

fn copy_of(area: &Area) -> Area {
    Area { ..*area }
}

/// Replaces the area of an interface by the areas of a card. Every byte of the interface stays in an area, so that
/// snapshots contain all of them.
fn place(areas: &mut Vec<Area>, (interface, card): CardAt, facts: &mut CardFacts) -> Result<(), String> {
    let Some(at) = areas.iter().position(|area| area.first == interface.first) else {
        return Err(format!("there is no option interface {}", interface.number));
    };
    let Some(space) = space_of(card).filter(|space| space.unit == Unit::Byte && card.retain.is_none()) else {
        return Err(format!(
            "an option card has one space of addresses, with unit = \"byte\" and without retain flags, and '{}' has others",
            card.name
        ));
    };
    let whole = copy_of(&areas[at]);
    let begins: Vec<u32> = card.areas.iter().map(|area| area.first - space.offset).collect();
    let end = card.areas.last().map_or(0, |area| area.last() + 1 - space.offset);
    if end > whole.bytes {
        return Err(format!(
            "'{}' has {end} bytes, and option interface {} has {}",
            card.name, interface.number, whole.bytes
        ));
    }
    let piece = |begin: u32, end: u32, of: &Area| Area {
        space: whole.space,
        first: whole.first + begin,
        bytes: end - begin,
        cpu: whole.cpu.map(|(first, last)| (first + begin, last.min(first + (end - 1)))),
        ..*of
    };
    let mut pieces = Vec::new();
    if let Some(first) = begins.first().copied().filter(|first| *first > 0) {
        pieces.push(piece(0, first, &whole));
    }
    for (index, area) in card.areas.iter().enumerate() {
        let end = begins.get(index + 1).copied().unwrap_or(whole.bytes);
        let name = format!("{}{}", area.name, interface.number);
        if name.len() >= TABLE_NAME_LENGTH {
            return Err(format!(
                "the area `{}` of '{}' is called `{name}` at option interface {}; the name of an area has at most {} bytes",
                area.name,
                card.name,
                interface.number,
                TABLE_NAME_LENGTH - 1
            ));
        }
        if areas.iter().any(|other| other.name == name) {
            return Err(format!(
                "the area `{}` of '{}' is called `{name}` at option interface {}, and the controller has an area of this \
                 name; give the area another name",
                area.name, card.name, interface.number
            ));
        }
        pieces.push(piece(begins[index], end, &facts.area(area, interface.number)));
    }
    if !pieces.is_empty() {
        areas.splice(at..=at, pieces);
    }
    Ok(())
}

/// Returns the layout of the card that has an area of a controller; `None` if the area belongs to the controller itself.
#[cfg(feature = "cli")]
pub(crate) fn card_of(controller: &DeviceLayout, area: &str) -> Option<&'static DeviceLayout> {
    let loaded = loaded();
    let is_it = |composed: &&Composed| composed.registered.layout.layout_hash == controller.layout_hash;
    let composed = loaded.in_slots.controllers.iter().find(is_it)?;
    composed.cards.iter().find_map(|(interface, card)| {
        let own = area.strip_suffix(&interface.number.to_string())?;
        card.areas.iter().any(|area| area.name == own).then_some(*card)
    })
}

/// Returns a line that describes a controller with cards, for clients of its instance: [`read_line`] reads it. Paths of folders
/// have no control characters.
pub(crate) fn line<'p>(controller: &str, cards: impl IntoIterator<Item = (u8, &'p Path)>) -> String {
    let cards = cards.into_iter().map(|(interface, dir)| format!("\t{interface}\t{}", dir.display()));
    format!("{controller}{}", cards.collect::<String>())
}

/// Makes the layout of a controller that a line describes. If a folder cannot be read, the image of the controller is
/// later refused for its unknown layout hash. `folders` are those of the instance.
pub(super) fn read_line(line: &str, folders: &[DeviceFolder]) -> Option<()> {
    let mut words = line.split('\t');
    let controller = registry::find(words.next()?)?;
    let mut cards = Vec::new();
    while let (Some(number), Some(dir)) = (words.next(), words.next()) {
        let number: u8 = number.parse().ok()?;
        let interface = controller.emulation.option_interfaces.iter().find(|it| it.number == number)?;
        let folder = folders.iter().find(|folder| folder.path == Path::new(dir))?;
        let card = super::load_registers(folder).ok()?.layout;
        face_of(card).ok()?;
        cards.push((*interface, card));
    }
    with_cards(controller, &cards).ok().map(drop)
}
