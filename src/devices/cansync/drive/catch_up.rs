//! What concerns all drives on a bus alike, and how a drive takes it later.
//!
//! A drive tells nobody anything of its own accord. So it need not take edges and reference values when they come: it is
//! enough that it has taken them, in their order, before somebody looks at it or gives it something that is for it alone.

use super::Drive;
use crate::can::Payload;
use crate::devices::cansync::bus::Channel;

/// Something that has come to all drives on a bus.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Passed {
    /// A SYNC edge, with which an interval of this length begins.
    Edge {
        /// When.
        now_us: u64,
        /// Length of the interval.
        interval_us: u32,
    },
    /// A reference value frame of the master.
    Reference {
        /// Baud rate of the bus: drives that are set to another one do not hear it.
        kbit_s: u16,
        /// Frame 1 or 2.
        channel: Channel,
        /// What is in it.
        payload: Payload,
    },
}

impl Drive {
    /// Takes what has passed since it was last up to date. What the card samples at an edge goes out in its interval, if at
    /// all: of all these edges that is the last one.
    pub(crate) fn catch_up(&mut self, passed: &[Passed]) {
        let last = passed.iter().rposition(|it| matches!(it, Passed::Edge { .. }));
        let taken = last.and_then(|last| passed.get(..last)).map_or(0, |earlier| self.cruise(earlier));
        for (index, it) in passed.iter().enumerate().skip(taken) {
            match *it {
                Passed::Edge { now_us, interval_us } => {
                    self.edge(now_us, interval_us, Some(index) == last);
                }
                Passed::Reference { kbit_s, channel, ref payload } => {
                    if kbit_s == self.kbit_s {
                        self.reference_frame(channel, payload);
                    }
                }
            }
        }
    }
}
