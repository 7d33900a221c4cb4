//! Snapshot fields of a bus.

use super::{RunningBus, SimBus, Station};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

impl SnapshotFields for SimBus {
    fn save(&self, to: &mut Saving) {
        let Self {
            index: _,
            name: _,
            is_wired: _,
            places: _,
            masters,
            slaves,
            drive_ends,
            stations,
            drives,
            kbit_s: _,
            frame_length: _,
            processor_cycle_us: _,
            running,
            schedule,
            next,
            on_wire,
            reference,
            actual,
            command,
            asked,
            drive_answer,
            response,
            disturbance,
            own_clock,
            receivers_of_traffic: _,
        } = self;
        masters.save(to);
        slaves.save(to);
        drive_ends.save(to);
        drives.save(to);
        to.value(stations);
        // The rate is not saved: it is the rate of the master that started the bus.
        to.value(&running.as_ref().map(|it| (it.own_sync, it.signal, it.start)));
        to.value(&(schedule, next.time, on_wire, reference, actual, command));
        to.value(&(asked, drive_answer, response, disturbance, own_clock));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.receivers_of_traffic.clear();
        self.masters.restore(from)?;
        self.slaves.restore(from)?;
        self.drive_ends.restore(from)?;
        self.drives.restore(from)?;
        self.stations = from.value()?;
        let is_there = |station: &Station| match *station {
            Station::Vacant => true,
            Station::Drive(index) => index < self.drives.len(),
            Station::Node(index) => index < self.slaves.len(),
        };
        from.check(self.stations.iter().all(is_there), "station of the bus")?;
        self.running = match from.value()? {
            None => None,
            Some((own_sync, signal, start)) => {
                let timing = self.masters.first().and_then(|master| master.firmware.timing());
                let timing = timing.ok_or_else(|| from.no("master that runs the bus"))?;
                Some(RunningBus { timing, own_sync, signal, start })
            }
        };
        let time: u64;
        (self.schedule, time, self.on_wire, self.reference, self.actual, self.command) = from.value()?;
        self.next = self.schedule.next();
        (self.asked, self.drive_answer, self.response, self.disturbance, self.own_clock) = from.value()?;
        from.check(self.next.time == time, "time of the next slot")
    }
}
