//! The access checker: tells PLC programmers what they did against the manual.
//!
//! The rules are data ([`Rule`]); `docs/checker.md` lists them. What breaks one is a [`Finding`]: an event in the
//! journal, which counts it in its table of [`Findings`]. They come from two places:
//!
//! - [`Checker`] compares the RAM with what the firmware left in it, before the firmware runs again, and so sees
//!   what was written through the map. Writes through the channel it is told.
//! - The firmware reports what it finds when it takes over a command or initialization data.
//!
//! Nothing here changes a register.

mod header;
mod judge;
mod mapping;
mod node;
mod owned;
mod registers;
pub mod rules;
mod word;

use crate::devices::omega_drive_line_2::registers::{NODE1, NODE2};
use crate::journal::Journal;
use crate::layout::Live;
use crate::memory::{MemoryError, Segment};
use header::HeaderWatch;
use node::NodeWatch;
use owned::OwnedWatch;

/// What the rules must know about a node beyond its registers.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Node 2.
    pub is_master: bool,
    /// Which structure is valid.
    pub live: Live,
    /// The node waits for initialization data, and the PLC has ordered to take them over.
    pub takes_over_init: bool,
    /// The node is in active operation.
    pub is_active: bool,
    /// For frames 1 and 2: when in the present interval the deadline was missed, in emulated microseconds, if the
    /// frame went out in the interval before.
    pub missed: [Option<u64>; 2],
    /// Slaves that a master expects, a bit each.
    pub expected: u32,
}

struct PlcWatch {
    header: HeaderWatch,
    /// Node 1 and node 2.
    nodes: [NodeWatch; 2],
    /// What else the firmware owns.
    owned: OwnedWatch,
}

/// Watches over the RAM of all PLCs of a plant. The facts it is given are those of node 1 and node 2 of each PLC,
/// in the order of the PLCs.
pub struct Checker {
    plcs: Vec<PlcWatch>,
    /// The mapping of some node waits to be judged.
    is_unsettled: bool,
}

impl Checker {
    /// A checker over these PLCs, whose registers are as the firmware left them.
    ///
    /// # Errors
    /// If a segment is too small for the nodes.
    pub fn new<'a>(segments: impl IntoIterator<Item = &'a Segment>) -> Result<Self, MemoryError> {
        let watch = |(plc, segment): (usize, &Segment)| {
            let plc = plc as u16;
            Ok(PlcWatch {
                header: HeaderWatch::new(plc, segment)?,
                nodes: [NodeWatch::new(plc, 1, segment)?, NodeWatch::new(plc, 2, segment)?],
                owned: OwnedWatch::new(plc, segment)?,
            })
        };
        let plcs = segments.into_iter().enumerate().map(watch).collect::<Result<_, MemoryError>>()?;
        Ok(Checker { plcs, is_unsettled: false })
    }

    /// Before the firmware runs: judges what was written since [`Checker::leave`].
    #[inline]
    pub fn look(&mut self, now: u64, facts: impl Iterator<Item = [Facts; 2]>, journal: &mut Journal) {
        let mut is_unsettled = false;
        for (plc, facts) in self.plcs.iter_mut().zip(facts) {
            plc.header.look(now, journal);
            plc.owned.look(now, journal);
            for (node, facts) in plc.nodes.iter_mut().zip(&facts) {
                is_unsettled |= node.look(now, facts, journal);
            }
        }
        self.is_unsettled = is_unsettled;
    }

    /// After the firmware has run: notes what it leaves.
    #[inline]
    pub fn leave(&mut self, facts: impl Iterator<Item = [Facts; 2]>) {
        for (plc, facts) in self.plcs.iter_mut().zip(facts) {
            plc.header.leave();
            plc.owned.leave();
            for (node, facts) in plc.nodes.iter_mut().zip(&facts) {
                node.leave(facts.live);
            }
        }
    }

    /// The emulated time in the header pages was set.
    #[inline]
    pub fn show_time(&mut self, now: u64) {
        self.plcs.iter_mut().for_each(|plc| plc.header.show_time(now));
    }

    /// A SYNC edge, at which the nodes for which `concerns` is true take their mapping over.
    #[inline]
    pub fn sync_edge(
        &mut self,
        now: u64,
        facts: impl Iterator<Item = [Facts; 2]>,
        concerns: impl Fn(usize, u8) -> bool,
        journal: &mut Journal,
    ) {
        if !self.is_unsettled {
            return;
        }
        for (index, (plc, facts)) in self.plcs.iter_mut().zip(facts).enumerate() {
            for (number, (node, facts)) in (1..).zip(plc.nodes.iter_mut().zip(&facts)) {
                if node.is_unsettled() && facts.is_active && concerns(index, number) {
                    node.settle(now, facts, journal);
                }
            }
        }
    }

    /// A write of `width` bytes at `offset` of a PLC's RAM came through the channel.
    pub fn written(
        &mut self,
        plc: usize,
        offset: u32,
        width: u8,
        now: u64,
        facts: &[Facts; 2],
        journal: &mut Journal,
    ) {
        let Some(plc) = self.plcs.get_mut(plc) else { return };
        plc.owned.written(offset, width.into(), now, journal);
        for ((node, base), facts) in plc.nodes.iter_mut().zip([NODE1, NODE2]).zip(facts) {
            if let Some(offset) = (offset as usize).checked_sub(base) {
                self.is_unsettled |= node.written(offset, width.into(), now, facts, journal);
            }
        }
    }
}
