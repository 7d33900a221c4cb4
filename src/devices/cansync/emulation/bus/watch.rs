//! Access checks for the registers of a bus's ports.

use super::SimBus;
use super::end::PortRef;
use crate::devices::PortWatch;
use crate::devices::cansync::emulation::watch::{Facts, NodeWatch};
use crate::journal::{Journal, PortPhase};

impl SimBus {
    /// Returns the access checker of a port with registers, and the facts about the node that the checker
    /// needs.
    #[inline]
    pub(super) fn watched(&mut self, place: usize) -> Option<(&mut NodeWatch, Facts)> {
        Some(match self.places[place] {
            PortRef::Master(index) => {
                let end = &mut self.masters[index];
                (&mut end.watch, end.firmware.facts())
            }
            PortRef::Slave(index) => {
                let end = &mut self.slaves[index];
                (&mut end.watch, end.firmware.facts())
            }
            PortRef::Drive(_) => return None,
        })
    }

    /// Checks the mappings at a SYNC edge: at this moment, active nodes have taken over their mapping.
    #[inline]
    pub(super) fn judge_mappings(&mut self, now: u64, journal: &mut Journal) {
        for place in 0..self.places.len() {
            let watch = match self.places[place] {
                PortRef::Master(index) => &self.masters[index].watch,
                PortRef::Slave(index) => &self.slaves[index].watch,
                PortRef::Drive(_) => continue,
            };
            if watch.is_unsettled()
                && let Some((watch, facts)) = self.watched(place)
                && facts.is_active
            {
                watch.settle(now, &facts, journal);
            }
        }
    }
}

impl PortWatch for SimBus {
    #[inline]
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal) {
        if let Some((watch, facts)) = self.watched(place) {
            watch.look(now, &facts, journal);
        }
    }

    #[inline]
    fn store_baseline(&mut self, place: usize) {
        if let Some((watch, facts)) = self.watched(place) {
            watch.leave(facts.live);
        }
    }

    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        if let Some((watch, facts)) = self.watched(place) {
            watch.written(offset, bytes, now, &facts, journal);
        }
    }

    #[inline]
    fn judge_edge(&mut self, now: u64, journal: &mut Journal) {
        self.judge_mappings(now, journal);
    }

    fn phases(&mut self) -> Vec<PortPhase> {
        let phase = |origin, facts: Facts| PortPhase { port: origin, live: facts.live };
        let masters = self.masters.iter().map(|end| phase(end.origin, end.firmware.facts()));
        masters.chain(self.slaves.iter().map(|end| phase(end.origin, end.firmware.facts()))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::rules;
    use crate::devices::Bus;
    use crate::devices::bm4_o_can_06::registers::{BAUD_RATES, DEVICE};
    use crate::devices::cansync::bus::{Socket, SocketRole};
    use crate::devices::cansync::firmware::NodeLocation;
    use crate::devices::cansync::frames::SyncLock;
    use crate::identity::DeviceIndex;
    use crate::journal::Origin;
    use crate::memory::{Segment, Width};

    /// Six modules in one device, alternately slaves and masters. Each finding must be at the offset of its
    /// module.
    #[test]
    fn every_port_of_a_device_is_watched() {
        const W_OPTION_STATUS: u32 = 2;
        let segment = Segment::heap(DEVICE.segment_size());
        let mut bus = SimBus::unplugged();
        for port in DEVICE.ports {
            let number = port.number.0;
            let role = match number % 2 {
                0 => SocketRole::Master { has_sync_in: false },
                _ => SocketRole::Slave { number, lock: SyncLock::new(0, None) },
            };
            let location = NodeLocation::of(port, &BAUD_RATES);
            let origin = Origin { plc: DeviceIndex(3), node: port.number };
            let socket = Socket { origin, segment: segment.clone(), location, area: port.area, role };
            let place = bus.attach(Box::new(socket)).unwrap();
            bus.power_on(place, number, 0, &mut Journal::default());
            bus.store_baseline(place);
        }
        let mut journal = Journal::default();
        let mut look = |now| {
            (0..DEVICE.ports.len()).for_each(|place| bus.judge_writes(place, now, &mut journal));
            let found = journal.findings().iter().map(|entry| entry.last);
            found.map(|finding| (finding.plc, finding.offset, finding.rule)).collect::<Vec<_>>()
        };
        assert_eq!(look(10), []);
        let statuses = DEVICE.ports.iter().map(|port| port.area.first + W_OPTION_STATUS);
        for offset in statuses.clone() {
            segment.store(offset, Width::Word, 7).unwrap();
        }
        assert_eq!(
            look(20),
            statuses.map(|offset| (DeviceIndex(3), offset, &rules::OWNER)).collect::<Vec<_>>()
        );
    }
}
