//! Load of the wires of a plant.

use super::Plant;
use crate::identity::BusIndex;
use crate::journal::Source;

/// Maximum delay, in emulated microseconds, with which the journal records frames that it combines into one
/// record.
const LATE_US: u64 = 2_000_000;

impl Plant {
    /// Load of bus `bus` in thousandths: the part of the last `span_us` of emulated time in which frames kept
    /// the wire busy. If less time has passed since power-on, the load is for this time. Only frames that
    /// have arrived count. `None` if no time has passed. The load is computed from the records that the
    /// journal still has. After a start from a snapshot, the journal has no records from before the snapshot,
    /// so the load is `None` until `span_us` have passed (D-543).
    pub fn bus_load(&self, bus: BusIndex, span_us: u64) -> Option<u16> {
        let wire = self.buses().get(bus.index())?;
        let begin = self.now().saturating_sub(span_us);
        if begin < self.journal().since_us() {
            return None;
        }
        let mut busy_ns = 0;
        for record in self.journal().records().rev() {
            if record.time_us > begin {
                if record.event.source() == Source::Bus(bus) {
                    busy_ns += wire.busy_ns(&record.event);
                }
            } else if record.time_us + LATE_US < begin {
                break;
            }
        }
        let passed_us = self.now() - begin;
        // The number of nanoseconds per microsecond is the load in thousandths. `min` is necessary because a
        // frame that ends in the span may have begun before it.
        (passed_us > 0).then(|| (busy_ns / passed_us).min(1000) as u16)
    }
}
