//! The watch over the registers of a bus's ports.

use super::SimBus;
use super::end::Place;
use crate::devices::cansync::watch::{Facts, NodeWatch};
use crate::journal::Journal;

impl SimBus {
    /// The watch over a port, and what it must know of the node.
    #[inline]
    pub(super) fn watched(&mut self, place: usize) -> (&mut NodeWatch, Facts) {
        match self.places[place] {
            Place::Master(index) => {
                let end = &mut self.masters[index];
                (&mut end.watch, end.firmware.facts())
            }
            Place::Slave(index) => {
                let end = &mut self.slaves[index];
                (&mut end.watch, end.firmware.facts())
            }
        }
    }

    /// A SYNC edge, at which nodes in active operation have taken their mapping over.
    #[inline]
    pub(super) fn judge_mappings(&mut self, now: u64, journal: &mut Journal) {
        for place in 0..self.places.len() {
            let watch = match self.places[place] {
                Place::Master(index) => &self.masters[index].watch,
                Place::Slave(index) => &self.slaves[index].watch,
            };
            if watch.is_unsettled() {
                let (watch, facts) = self.watched(place);
                if facts.is_active {
                    watch.settle(now, &facts, journal);
                }
            }
        }
    }
}
