//! Event kind: a followed register has changed.

use super::coded::{Packer, Part, Unpacker};
use super::fields::Fields;
use super::kind::EventText;
use super::reader::Reader;
use crate::event_kinds;
use crate::identity::DeviceIndex;
use crate::layout::{RegisterPhase, Width};

event_kinds! {
    /// A followed register has a new value.
    Changed = 41, "changed", History, at plc {
        /// Offset of the register.
        offset: u32,
        /// The width of the register, the originator of the change, and the register phase at that time.
        how: ChangeDetails,
        /// Value before the change.
        from: u32,
        /// Value after the change.
        to: u32,
    }
}

impl Changed {
    /// Returns the change of the register of this `width` at `offset` of device `plc`. Structures with registers of
    /// different widths can overlay each other, so this register may be only a part of the changed one. Returns `None`
    /// if this part has not changed.
    #[must_use]
    pub fn part(&self, plc: DeviceIndex, offset: u32, width: Width) -> Option<Changed> {
        let place = offset.checked_sub(self.offset)?;
        if plc != self.plc || place + width.bytes() > self.how.width.bytes() {
            return None;
        }
        let [from, to] = [self.from, self.to].map(|value| value >> (8 * place) & width.max_value());
        (from != to).then_some(Changed { plc, offset, how: ChangeDetails { width, ..self.how }, from, to })
    }
}

/// The originator of a change of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// The firmware has changed the register.
    Firmware,
    /// A program that has mapped the RAM.
    Program,
    /// A client of the channel, or a verb of a scenario.
    Channel,
    /// The emulator, because the register is forced.
    Force,
}

impl By {
    const ALL: [By; 4] = [By::Firmware, By::Program, By::Channel, By::Force];

    /// Returns the name of the originator in JSON Lines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            By::Firmware => "firmware",
            By::Program => "program",
            By::Channel => "channel",
            By::Force => "force",
        }
    }
}

/// Facts about a change, in addition to the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChangeDetails {
    /// Width of the register.
    pub width: Width,
    /// Originator of the change.
    pub by: By,
    /// The phase at the time of the change. If structures overlay each other, it shows which structure was valid, and
    /// so the name of the register.
    pub live: RegisterPhase,
}

impl Part for ChangeDetails {
    #[inline]
    fn put(self, packer: &mut Packer) {
        packer.put(self.width.bytes() | (self.by as u32) << 8 | u32::from(self.live.number()) << 16);
    }

    #[inline]
    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        let [width, by, live, rest] = unpacker.take().to_le_bytes();
        let (width, live) = (Width::of_bytes(width.into())?, RegisterPhase::numbered(live));
        let by = By::ALL.get(usize::from(by)).copied()?;
        (rest == 0).then_some(ChangeDetails { width, by, live })
    }
}

impl EventText for Changed {
    fn text(&self, reader: &mut Reader) -> String {
        let place = reader.followed(self.plc, self.offset, self.how.width, self.how.live);
        let meaning = place.meaning_after_comma(self.to);
        let [from, to] = [self.from, self.to].map(|value| place.value(value));
        format!("{} {from} -> {to} by the {}{meaning}", place.label(), self.how.by.name())
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let place = reader.followed(self.plc, self.offset, self.how.width, self.how.live);
        let fields = Fields::new().with("register", place.name()).with("address", place.address());
        let [from, to] = [self.from, self.to].map(|value| place.number(value));
        let fields = fields.with("width", self.how.width.bytes()).with("from", from).with("to", to);
        fields.with("by", self.how.by.name()).with_any("text", place.meaning(self.to))
    }
}
