//! The phases of ports at each record, for readers that do not know the earlier records.
//!
//! The phase of a port decides which of several overlaid structures is valid, and so the name of a register. A reader
//! knows the phases from the records of states. These records are missing if the journal continues from a snapshot,
//! or has dropped its oldest records.

use super::event::Origin;
#[cfg(feature = "script")]
use super::{Record, State};
use crate::layout::RegisterPhase;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// The phase of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortPhase {
    /// The port whose phase has changed.
    pub port: Origin,
    /// New phase of the port. It selects the valid structure if structures overlay each other.
    pub live: RegisterPhase,
}

/// A port has entered a phase.
struct PhaseChange {
    /// Number of the record of the new state.
    seq: u64,
    entered: PortPhase,
}

/// The changes of phases in the journal.
pub(super) struct PhaseLog {
    /// Phases before the first entry of `changes`. Ports that are missing here are in their first phase.
    begin: BTreeMap<Origin, RegisterPhase>,
    /// Number of the first record for which the phases are known. At this record, the ports are in the phases of
    /// `begin`.
    known_from: u64,
    /// Changes in the order of their numbers.
    changes: VecDeque<PhaseChange>,
    /// The phases after all changes.
    now: BTreeMap<Origin, RegisterPhase>,
    /// Maximum number of changes.
    capacity: usize,
}

impl PhaseLog {
    /// Returns an empty log that keeps the last `capacity` changes, at least one.
    pub(super) fn new(capacity: usize) -> Self {
        PhaseLog {
            begin: BTreeMap::new(),
            known_from: 0,
            changes: VecDeque::new(),
            now: BTreeMap::new(),
            capacity: capacity.max(1),
        }
    }

    /// Takes the state of a port from the record with number `seq`.
    pub(super) fn entered(&mut self, seq: u64, entered: PortPhase) {
        let before = self.now.insert(entered.port, entered.live);
        if before == Some(entered.live) {
            return;
        }
        if self.changes.len() >= self.capacity
            && let Some(PhaseChange { seq, entered }) = self.changes.pop_front()
        {
            self.begin.insert(entered.port, entered.live);
            self.known_from = seq + 1;
        }
        self.changes.push_back(PhaseChange { seq, entered });
    }

    /// Returns the phases before the record with number `seq`. Ports that are missing in the result are in their first
    /// phase. For records that are older than the oldest known change, returns the oldest known phases.
    pub(super) fn before(&self, seq: u64) -> Arc<[PortPhase]> {
        let mut phases = self.begin.clone();
        for PhaseChange { entered, .. } in self.changes.iter().take_while(|change| change.seq < seq) {
            phases.insert(entered.port, entered.live);
        }
        listed(phases)
    }

    /// True if a port changed its phase in one of the records with the numbers `from..end`.
    pub(super) fn has_change_in(&self, from: u64, end: u64) -> bool {
        let first = self.changes.partition_point(|change| change.seq < from);
        self.changes.get(first).is_some_and(|change| change.seq < end)
    }

    /// Continues at the record with number `end`, when the ports are in the phases `present`. The earlier changes are
    /// kept only if they are of the same run.
    pub(super) fn continue_at(
        &mut self,
        end: u64,
        is_same_run: bool,
        present: impl Iterator<Item = PortPhase>,
    ) {
        self.now = present.map(|PortPhase { port, live }| (port, live)).collect();
        if is_same_run && end >= self.known_from {
            self.changes.truncate(self.changes.partition_point(|change| change.seq < end));
            return;
        }
        self.changes.clear();
        self.begin.clone_from(&self.now);
        self.known_from = end;
    }
}

/// Removes the records that end before the time `since_us` from a part of the journal. The first record after removed ones
/// gets the phases that a reader needs ([`Record::phases`]).
#[cfg(feature = "script")]
pub(crate) fn since(records: Vec<Record>, since_us: u64) -> Vec<Record> {
    let mut known = None::<BTreeMap<Origin, RegisterPhase>>;
    let mut has_removed = false;
    let needed = records.into_iter().filter_map(|mut record| {
        if let Some(phases) = &record.phases {
            known = Some(phases.iter().map(|it| (it.port, it.live)).collect());
        } else if record.seq == 0 {
            known = Some(BTreeMap::new());
        }
        let is_needed = record.time_us >= since_us;
        if is_needed
            && has_removed
            && let Some(known) = &known
        {
            record.phases = Some(listed(known.clone()));
        }
        has_removed = !is_needed;
        if let (Some(known), Some(State { origin, live, .. })) = (&mut known, record.event.get()) {
            known.insert(origin, live);
        }
        is_needed.then_some(record)
    });
    needed.collect()
}

fn listed(phases: BTreeMap<Origin, RegisterPhase>) -> Arc<[PortPhase]> {
    phases.into_iter().map(|(port, live)| PortPhase { port, live }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::{DeviceIndex, PortNumber};

    fn phase(node: u8, live: u8) -> PortPhase {
        let port = Origin { plc: DeviceIndex(0), node: PortNumber(node) };
        PortPhase { port, live: RegisterPhase::numbered(live) }
    }

    fn before(log: &PhaseLog, seq: u64) -> Vec<(u8, u8)> {
        log.before(seq).iter().map(|it| (it.port.node.0, it.live.number())).collect()
    }

    #[test]
    fn the_phases_before_a_record_are_those_of_the_earlier_states() {
        let mut log = PhaseLog::new(10);
        log.entered(3, phase(2, 1));
        log.entered(5, phase(2, 2));
        log.entered(6, phase(2, 2));
        log.entered(9, phase(1, 2));
        assert_eq!(before(&log, 3), []);
        assert_eq!(before(&log, 4), [(2, 1)]);
        assert_eq!(before(&log, 9), [(2, 2)]);
        assert_eq!(before(&log, 100), [(1, 2), (2, 2)]);
        assert!(log.has_change_in(4, 6) && log.has_change_in(5, 6));
        assert!(!log.has_change_in(4, 5) && !log.has_change_in(6, 9) && !log.has_change_in(10, 100));
    }

    #[test]
    fn a_full_log_keeps_the_effect_of_dropped_changes() {
        let mut log = PhaseLog::new(2);
        (0..5).for_each(|seq| log.entered(seq, phase(seq as u8, 2)));
        assert_eq!(before(&log, 5), [0, 1, 2, 3, 4].map(|node| (node, 2)));
        assert_eq!(before(&log, 4), [0, 1, 2, 3].map(|node| (node, 2)));
        assert_eq!(before(&log, 0), [0, 1, 2].map(|node| (node, 2)));
    }

    #[test]
    fn a_return_drops_the_later_changes() {
        let mut log = PhaseLog::new(2);
        (0..4).for_each(|seq| log.entered(seq, phase(1, 1 + (seq % 2) as u8)));
        // The log has dropped the changes at records 0 and 1. It knows only the phases after these records.
        log.continue_at(3, true, [phase(1, 1)].into_iter());
        assert_eq!((before(&log, 3), before(&log, 2)), (vec![(1, 1)], vec![(1, 2)]));
        // The plant enters the state that it had at record 3 once more.
        log.entered(3, phase(1, 2));
        assert_eq!(before(&log, 4), [(1, 2)]);
        log.continue_at(1, true, [phase(1, 1)].into_iter());
        assert_eq!((before(&log, 1), before(&log, 50)), (vec![(1, 1)], vec![(1, 1)]));
        // Another run.
        log.continue_at(77, false, [phase(3, 2)].into_iter());
        assert_eq!((before(&log, 77), before(&log, 0)), (vec![(3, 2)], vec![(3, 2)]));
    }
}
