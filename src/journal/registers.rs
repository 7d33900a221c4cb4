//! Events in registers of any device, and of the clock.

use super::event::Keeping;
use super::fields::Fields;
use super::history::Stored;
use super::kind::EventText;
use super::reader::{Reader, RegisterLocation};
use crate::event_kinds;
use crate::layout::RegisterPhase;

event_kinds! {
    /// The register that shows the state of a port has changed. Its value also determines which structure is valid.
    State = 3, "state", Rare, at origin {
        /// Offset of the register.
        offset: u32,
        /// Offset of the command register.
        command: u32,
        /// Value before the change.
        from: u16,
        /// Value after the change.
        to: u16,
        /// The phase from now on: if structures overlay each other, it shows which structure is valid.
        live: RegisterPhase,
    }

    /// The firmware answered a handshake register.
    Handshake = 4, "handshake", Registers, at origin {
        /// Offset of the register.
        offset: u32,
        /// Value that the PLC had written.
        request: u16,
        /// Value that the firmware has written in place of the request.
        answer: u16,
        /// True if more answers to the same request will follow.
        more_answers_follow: bool,
    }

    /// The firmware changed a register that does not belong to a handshake.
    Register = 11, "register", Registers, at origin {
        /// Offset of the register.
        offset: u32,
        /// Value before the change.
        from: u32,
        /// Value after the change.
        to: u32,
    }

    /// A register was written through the channel.
    ChannelWrite = 10, "channel_write", Registers, at plc {
        /// Offset of the register.
        offset: u32,
        /// Width in bytes: 1, 2 or 4.
        width: u8,
        /// Value that the client has written.
        value: u32,
    }

    /// A register is forced from now on.
    Force = 30, "force", Rare, at plc {
        /// Offset of the register.
        offset: u32,
        /// Width in bytes: 1, 2 or 4.
        width: u8,
        /// Value that the register keeps.
        value: u32,
    }

    /// A register is no longer forced.
    Unforce = 31, "unforce", Rare, at plc {
        /// Offset of the register.
        offset: u32,
    }

    /// The emulated time of a real-time clock is late, or no longer late. Only real time decides about this event.
    Late = 32, "late", Rare, at plc {
        /// Real time in microseconds by which the clock is late; 0 if it is no longer late.
        late_us: u64,
    }
}

/// Returns the name and address.
fn named(place: &RegisterLocation) -> Fields {
    Fields::new().with("register", place.name()).with("address", place.address())
}

impl EventText for State {
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::State { plc: self.origin.plc, command: self.command }
    }

    #[inline]
    fn stored(&self) -> Option<Stored> {
        Some(Stored { plc: self.origin.plc, offset: self.offset, found: None, now: self.to.into() })
    }

    fn text(&self, reader: &mut Reader) -> String {
        let place = reader.whole(self.origin.plc, self.offset);
        let [from, to] = [self.from, self.to].map(|value| place.value(value.into()));
        format!("{} {from} -> {to}{}", place.label(), place.meaning_after_comma(self.to.into()))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let place = reader.whole(self.origin.plc, self.offset);
        let text = place.meaning(self.to.into()).unwrap_or_default();
        let [from, to] = [self.from, self.to].map(|value| place.number(value.into()));
        named(&place).with("from", from).with("to", to).with("text", text)
    }
}

impl EventText for Handshake {
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::Answer {
            plc: self.origin.plc,
            offset: self.offset,
            request: self.request.into(),
            pending_value: self.more_answers_follow.then_some(self.answer.into()),
        }
    }

    #[inline]
    fn stored(&self) -> Option<Stored> {
        let (found, now) = (Some(self.request.into()), self.answer.into());
        Some(Stored { plc: self.origin.plc, offset: self.offset, found, now })
    }

    fn text(&self, reader: &mut Reader) -> String {
        let place = reader.whole(self.origin.plc, self.offset);
        let [request, answer] = [self.request, self.answer].map(|value| place.value(value.into()));
        format!("{} {request} -> {answer}", place.label())
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let place = reader.whole(self.origin.plc, self.offset);
        let [request, answer] = [self.request, self.answer].map(|value| place.number(value.into()));
        named(&place).with("request", request).with("answer", answer)
    }
}

impl EventText for Register {
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::Counted
    }

    #[inline]
    fn stored(&self) -> Option<Stored> {
        Some(Stored { plc: self.origin.plc, offset: self.offset, found: None, now: self.to })
    }

    fn text(&self, reader: &mut Reader) -> String {
        let place = reader.whole(self.origin.plc, self.offset);
        let meaning = place.meaning_after_comma(self.to);
        format!("{} {} -> {}{meaning}", place.label(), place.value(self.from), place.value(self.to))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let place = reader.whole(self.origin.plc, self.offset);
        let [from, to] = [self.from, self.to].map(|value| place.number(value));
        named(&place).with("from", from).with("to", to).with_any("text", place.meaning(self.to))
    }
}

impl EventText for ChannelWrite {
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::Request { plc: self.plc, offset: self.offset, value: self.value }
    }

    fn text(&self, reader: &mut Reader) -> String {
        let place = reader.accessed(self.plc, self.offset, self.width);
        let meaning = place.meaning(self.value).filter(|meaning| !meaning.is_empty());
        let meaning = meaning.map(|meaning| format!(" ({meaning})")).unwrap_or_default();
        format!("{} := {}{meaning}", place.label(), place.value(self.value))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let place = reader.accessed(self.plc, self.offset, self.width);
        let meaning = place.meaning(self.value);
        let value = place.number(self.value);
        named(&place).with("width", self.width).with("value", value).with_any("text", meaning)
    }
}

impl EventText for Force {
    fn text(&self, reader: &mut Reader) -> String {
        let place = reader.accessed(self.plc, self.offset, self.width);
        format!("{} forced to {}", place.label(), place.value(self.value))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let place = reader.accessed(self.plc, self.offset, self.width);
        named(&place).with("width", self.width).with("value", place.number(self.value))
    }
}

impl EventText for Unforce {
    fn text(&self, reader: &mut Reader) -> String {
        format!("{} no longer forced", reader.whole(self.plc, self.offset).label())
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        named(&reader.whole(self.plc, self.offset))
    }
}

impl EventText for Late {
    fn text(&self, _: &mut Reader) -> String {
        match self.late_us {
            0 => "the emulated time is no longer late".to_owned(),
            late_us => {
                let ms = late_us / 1000;
                format!(
                    "the emulated time is {}.{:03} s late: this machine or a script of a device is too slow",
                    ms / 1000,
                    ms % 1000
                )
            }
        }
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("late_us", self.late_us)
    }
}
