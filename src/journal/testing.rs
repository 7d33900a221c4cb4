//! Kinds of events for tests of the journal, similar to those of families of devices.

use super::{ArrivedFrame, Catalogue, EventCodec, EventText, Fields, Keeping, Reader};
use crate::can::{Frame, Payload};
use crate::event_kinds;
use std::sync::LazyLock;

event_kinds! {
    /// Comes often and is counted.
    Edge = 1, "edge", Registers, at bus {}

    /// Comes often and is not counted.
    Packet = 2, "packet", Traffic, at bus {
        /// Payload of the test event.
        data: u8,
    }

    /// Comes rarely.
    Refused = 7, "refused", Rare, at origin {}
}

impl EventText for Edge {
    fn keeping(&self) -> Keeping {
        Keeping::Counted
    }

    fn text(&self, _: &mut Reader) -> String {
        "EDGE".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

impl EventText for Packet {
    fn text(&self, _: &mut Reader) -> String {
        format!("{:02X}", self.data)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("data", self.data)
    }

    fn frame(&self) -> Option<ArrivedFrame> {
        Some(ArrivedFrame { frame: Frame::standard(0x100, Payload::new(&[self.data])?), guest: None })
    }
}

impl EventText for Refused {
    fn text(&self, _: &mut Reader) -> String {
        "refused".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

/// Returns a catalogue with these kinds and those of any device.
pub(crate) fn catalogue() -> &'static Catalogue {
    static SUM: LazyLock<Catalogue> = LazyLock::new(|| {
        let kinds = [super::KINDS, &[Edge::KIND, Packet::KIND, Refused::KIND]].concat();
        Catalogue { kinds, rules: Vec::new(), faults: Vec::new() }
    });
    &SUM
}
