//! The 11-bit identifiers of CANsync (manual 5.00005.03a p. 136-143).

use serde::{Deserialize, Serialize};

/// Channel of process data: reference and actual values travel in WRC1/RDC1 or WRC2/RDC2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Channel {
    /// First channel: the frames WRC1 and RDC1.
    One,
    /// Second channel: the frames WRC2 and RDC2.
    Two,
}

impl Channel {
    /// Channels 1 and 2 in the order of their time slots.
    pub const ALL: [Channel; 2] = [Channel::One, Channel::Two];

    /// 0 for channel 1, 1 for channel 2.
    #[inline]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Returns the channel's number in the manual, 1 or 2.
    #[inline]
    pub const fn number(self) -> u8 {
        self as u8 + 1
    }
}

/// The highest slave number (manual 5.00005.03a p. 22).
pub(crate) const LAST_SLAVE: u8 = 31;

/// Kind of a frame according to its identifier.
///
/// A number has 7 bits on the bus; slaves have the numbers 0 to 31. [`FrameKind::id`] uses the lower 7 bits of a
/// number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// Reference value frame of the master. The slave with this number must answer with its actual values. All slaves
    /// read the reference values.
    ReferenceValue(Channel, u8),
    /// Actual value frame sent by the slave with this number.
    ActualValue(Channel, u8),
    /// Action command of the master. The data field selects the slaves.
    Action,
    /// Parameter or up-/download job of the master to the slave with this number.
    Job(u8),
    /// Answer to a job, sent by the slave with this number.
    Response(u8),
}

const NUMBER: u16 = 0x7F;
const ACTION: u16 = 0x010;
const WRC1: u16 = 0x100;
const WRC2: u16 = 0x180;
const RDC1: u16 = 0x300;
const RDC2: u16 = 0x380;
const JOB: u16 = 0x500;
const RESPONSE: u16 = 0x580;

impl FrameKind {
    /// Decodes an identifier; `None` if it is not a CANsync identifier.
    #[inline]
    pub const fn from_id(id: u16) -> Option<Self> {
        let number = (id & NUMBER) as u8;
        match id & !NUMBER {
            WRC1 => Some(FrameKind::ReferenceValue(Channel::One, number)),
            WRC2 => Some(FrameKind::ReferenceValue(Channel::Two, number)),
            RDC1 => Some(FrameKind::ActualValue(Channel::One, number)),
            RDC2 => Some(FrameKind::ActualValue(Channel::Two, number)),
            JOB => Some(FrameKind::Job(number)),
            RESPONSE => Some(FrameKind::Response(number)),
            _ if id == ACTION => Some(FrameKind::Action),
            _ => None,
        }
    }

    /// Returns the time slot of the interval for such a frame (manual 5.00005.03a p. 124-126).
    #[inline]
    pub const fn slot(self) -> &'static str {
        match self {
            FrameKind::ReferenceValue(Channel::One, _) => "WRC1",
            FrameKind::ReferenceValue(Channel::Two, _) => "WRC2",
            FrameKind::ActualValue(Channel::One, _) => "RDC1",
            FrameKind::ActualValue(Channel::Two, _) => "RDC2",
            FrameKind::Action | FrameKind::Job(_) => "CC",
            FrameKind::Response(_) => "RC",
        }
    }

    /// Returns the identifier, 0..=16#5FF.
    #[inline]
    pub const fn id(self) -> u16 {
        let (base, number) = match self {
            FrameKind::ReferenceValue(Channel::One, n) => (WRC1, n),
            FrameKind::ReferenceValue(Channel::Two, n) => (WRC2, n),
            FrameKind::ActualValue(Channel::One, n) => (RDC1, n),
            FrameKind::ActualValue(Channel::Two, n) => (RDC2, n),
            FrameKind::Action => (ACTION, 0),
            FrameKind::Job(n) => (JOB, n),
            FrameKind::Response(n) => (RESPONSE, n),
        };
        base | (number as u16 & NUMBER)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_identifier_survives_a_round_trip() {
        let known = (0..0x800).filter_map(|id| FrameKind::from_id(id).map(|kind| (id, kind)));
        let mut count = 0;
        for (id, kind) in known {
            assert_eq!(kind.id(), id, "{kind:?}");
            count += 1;
        }
        assert_eq!(count, 6 * 128 + 1);
    }

    #[test]
    fn identifiers_of_the_manual() {
        // The bit patterns of p. 136-140 with slave number 3.
        for (pattern, kind) in [
            (0b0010_0000011, FrameKind::ReferenceValue(Channel::One, 3)),
            (0b0011_0000011, FrameKind::ReferenceValue(Channel::Two, 3)),
            (0b0110_0000011, FrameKind::ActualValue(Channel::One, 3)),
            (0b0111_0000011, FrameKind::ActualValue(Channel::Two, 3)),
            (0b00000010000, FrameKind::Action),
            (0b1010_0000011, FrameKind::Job(3)),
            (0b1011_0000011, FrameKind::Response(3)),
        ] {
            assert_eq!(FrameKind::from_id(pattern), Some(kind));
        }
    }

    #[test]
    fn foreign_identifiers_are_none() {
        for id in [0x000, 0x00F, 0x011, 0x07F, 0x080, 0x200, 0x400, 0x600, 0x7FF, 0x800, 0x900, 0xFFFF] {
            assert_eq!(FrameKind::from_id(id), None, "16#{id:03X}");
        }
    }

    #[test]
    fn a_number_never_changes_the_frame_kind() {
        assert_eq!(FrameKind::Job(0xFF).id(), 0x57F);
    }

    #[test]
    fn channels_count_from_one() {
        assert_eq!(Channel::ALL.map(|c| (c.index(), c.number())), [(0, 1), (1, 2)]);
    }
}
