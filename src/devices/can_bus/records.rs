//! Journal events of CAN buses.

use crate::can::{ErrorState, Fate, Frame};
use crate::event_kinds;
use crate::journal::{
    ArrivedFrame, EventCodec, EventKind, EventText, Fields, Origin, Packer, Part, Reader, Unpacker, hex,
};

/// All event kinds of this module.
pub(crate) static KINDS: &[&EventKind] = &[Transmitted::KIND, Lost::KIND, StateChange::KIND];

event_kinds! {
    /// A frame has arrived. The time is the end of the frame, when its receivers have it, in whole microseconds rounded
    /// up.
    Transmitted = 50, "can_frame", Traffic, at bus {
        /// Content of the frame.
        frame: Frame,
        /// Sender of the frame.
        sender: Origin,
    }

    /// A frame has ended in an error frame. The time is the beginning of the error flag. A frame that no station
    /// acknowledges is recorded once, not at each repetition.
    Lost = 51, "can_lost", Missed, at bus {
        /// The lost frame, and the reason of the loss.
        frame: (Frame, Fate),
        /// Sender of the frame.
        sender: Origin,
    }

    /// The error state of a controller has changed.
    StateChange = 53, "can_state", Rare, at bus {
        /// Station of the controller.
        station: Origin,
        /// Error state from now on.
        state: ErrorState,
        /// Value of the transmit error counter.
        transmit: u16,
        /// Value of the receive error counter.
        receive: u16,
    }
}

/// First bit of the reason, above the length.
const FATE: u32 = 8;

/// A frame that has not arrived, with the reason.
impl Part for (Frame, Fate) {
    fn put(self, packer: &mut Packer) {
        let (id, length, data) = self.0.numbers();
        packer.put(id);
        packer.put(u32::from(length) | (self.1 as u32) << FATE);
        data.put(packer);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        let (id, length, data) = (unpacker.take(), unpacker.take(), u64::take(unpacker)?);
        let fates =
            [Fate::NotAcknowledged, Fate::Disturbed, Fate::Withdrawn, Fate::SenderGone, Fate::Arrives];
        let fate = fates.into_iter().find(|fate| *fate as u32 == length >> FATE)?;
        Some((Frame::of_numbers(id, length as u8, data)?, fate))
    }
}

impl Part for ErrorState {
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        ErrorState::ALL.get(unpacker.take() as usize).copied()
    }
}

/// Returns the reason why a frame has not arrived: the word for programs, and the text.
fn reason(fate: Fate) -> (&'static str, &'static str) {
    match fate {
        Fate::Arrives => ("arrives", "has arrived"),
        Fate::NotAcknowledged => ("not_acknowledged", "is not acknowledged"),
        Fate::Disturbed => ("disturbed", "is destroyed by an error frame"),
        Fate::Withdrawn => ("withdrawn", "is given up after its start bit"),
        Fate::SenderGone => ("sender_gone", "is cut off, its sender is gone"),
    }
}

impl Part for Frame {
    #[inline]
    fn put(self, packer: &mut Packer) {
        let (id, length, data) = self.numbers();
        packer.put(id);
        packer.put(length.into());
        data.put(packer);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        let (id, length, data) = (unpacker.take(), unpacker.take(), u64::take(unpacker)?);
        Frame::of_numbers(id, u8::try_from(length).ok()?, data)
    }
}

/// Formats a frame: `16#123 01 02`, `16#00000123 remote, length 2`.
pub(crate) fn text(frame: &Frame) -> String {
    let rest = if frame.arbitration().is_remote() {
        format!(" remote, length {}", frame.length())
    } else {
        hex(frame.payload().data(), " ")
    };
    let id = frame.arbitration().number();
    if frame.arbitration().is_extended() {
        format!("16#{id:08X}{rest}")
    } else {
        format!("16#{id:03X}{rest}")
    }
}

/// Returns the fields of a frame for programs.
fn fields(frame: &Frame, sender: Origin, reader: &Reader) -> Fields {
    let field = frame.arbitration();
    Fields::new()
        .with("id", field.number())
        .with("extended", field.is_extended())
        .with("remote", field.is_remote())
        .with("length", frame.length())
        .with("data", hex(frame.payload().data(), ""))
        .with("from", reader.port(sender))
}

impl EventText for Transmitted {
    fn text(&self, reader: &mut Reader) -> String {
        format!("{} from {}", text(&self.frame), reader.port(self.sender))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        fields(&self.frame, self.sender, reader)
    }

    fn frame(&self) -> Option<ArrivedFrame> {
        Some(ArrivedFrame { frame: self.frame, guest: self.sender.guest() })
    }
}

impl EventText for Lost {
    fn text(&self, reader: &mut Reader) -> String {
        let (frame, fate) = &self.frame;
        format!("{} from {} {}", text(frame), reader.port(self.sender), reason(*fate).1)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let (frame, fate) = &self.frame;
        fields(frame, self.sender, reader).with("why", reason(*fate).0)
    }
}

impl EventText for StateChange {
    fn text(&self, reader: &mut Reader) -> String {
        let (station, state) = (reader.port(self.station), self.state.name().replace('_', "-"));
        format!("{station} is {state}, {} transmit and {} receive errors", self.transmit, self.receive)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new()
            .with("station", reader.port(self.station))
            .with("state", self.state.name())
            .with("transmit_errors", self.transmit)
            .with("receive_errors", self.receive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{ExtendedId, Payload};
    use crate::identity::PortNumber;
    use crate::identity::{BusIndex, DeviceIndex};

    #[test]
    fn frames_have_a_readable_text() {
        assert_eq!(text(&Frame::standard(0x23, Payload::new(&[0x12, 3]).unwrap())), "16#023 12 03");
        assert_eq!(text(&Frame::remote(ExtendedId::MAX, 4).unwrap()), "16#1FFFFFFF remote, length 4");
    }

    #[test]
    fn each_end_of_a_frame_has_its_reason() {
        let reasons =
            [Fate::NotAcknowledged, Fate::Disturbed, Fate::Withdrawn, Fate::SenderGone, Fate::Arrives]
                .map(reason);
        let names: std::collections::BTreeSet<_> = reasons.iter().map(|(name, _)| *name).collect();
        assert_eq!(names.len(), reasons.len());
        for ((name, text), word) in
            reasons.iter().zip(["acknowledged", "destroyed", "given up", "cut off", "arrived"])
        {
            assert!(text.contains(word), "{name}: {text}");
        }
    }

    /// Words of a record that a client could have changed: they contain an impossible length.
    #[test]
    fn an_event_with_nine_bytes_is_not_a_frame() {
        let sender = Origin { plc: DeviceIndex(0), node: PortNumber(1) };
        let mut words =
            Transmitted { bus: BusIndex(0), frame: Frame::standard(1, Payload::EMPTY), sender }.words();
        words[1] = 9;
        assert_eq!(Transmitted::read(words), None);
    }
}
