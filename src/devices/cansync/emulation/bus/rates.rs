//! Stations with another baud rate than the bus. They receive nothing (decision D-540).

use super::SimBus;
use crate::devices::cansync::firmware::Slave;
use crate::devices::cansync::records::{BaudRateMismatch, DriveBaudRateMismatch};
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::rules;
use crate::devices::{Context, ParticipantId, RateMismatch};
use crate::journal::{Finding, Journal};
use core::mem::offset_of;

impl SimBus {
    /// Returns the rate of the running bus, or the rate of the plant file if the bus is stopped.
    pub(super) fn present_kbit_s(&self) -> u16 {
        self.running.as_ref().map_or(self.kbit_s, |running| running.timing.kbit_per_s)
    }

    /// Reports stations with another rate. Called when the bus starts.
    pub(super) fn report_mismatches(&mut self, now: u64, kbit_s: u16, journal: &mut Journal) {
        // On a stopped bus there are no frames that a station could miss because of its rate.
        if self.running.is_none() {
            return;
        }
        for end in self.slaves.iter_mut().filter(|end| end.firmware.is_on_bus()) {
            end.run(now, journal, |slave, ctx| report_mismatch(slave, ctx, kbit_s));
        }
        for drive in self.drives.look().iter().filter(|drive| drive.kbit_s() != kbit_s) {
            let (bus, slave, drive_kbit_s) = (self.index, drive.slave_number(), drive.kbit_s());
            journal.push(now, DriveBaudRateMismatch { bus, slave, drive_kbit_s, bus_kbit_s: kbit_s });
            journal
                .find(now, Finding::at_participant(&rules::DRIVE_BAUD_RATE, bus, slave, drive_kbit_s.into()));
        }
    }

    /// Returns the drives and slave nodes that are set to another rate.
    pub(super) fn of_other_rates(&self) -> Vec<RateMismatch> {
        let present = self.present_kbit_s();
        let stranger =
            |participant, kbit_s: u16| RateMismatch { participant, bit_s: u32::from(kbit_s) * 1000 };
        let drives = self.drives.look().iter().filter(|drive| drive.kbit_s() != present);
        let drives =
            drives.map(|drive| stranger(ParticipantId::Own(drive.name().to_owned()), drive.kbit_s()));
        let nodes = self.slaves.iter().filter(|end| self.is_wired && end.firmware.is_on_bus());
        let nodes = nodes.filter_map(|end| Some((end.origin, end.firmware.timing()?.kbit_per_s)));
        let nodes = nodes.filter(|(_, kbit_s)| *kbit_s != present);
        drives.chain(nodes.map(|(origin, kbit_s)| stranger(ParticipantId::Port(origin), kbit_s))).collect()
    }
}

/// Reports a slave with another rate than its bus: the slave receives nothing. Called at the start of the
/// slave or of the bus, whichever starts later.
pub(super) fn report_mismatch(slave: &Slave, ctx: &mut Context, bus_kbit_s: u16) {
    if let Some(timing) = slave.timing()
        && timing.kbit_per_s != bus_kbit_s
    {
        let (origin, node_kbit_s) = (ctx.origin, timing.kbit_per_s);
        ctx.report(BaudRateMismatch { origin, node_kbit_s, bus_kbit_s, passes_on: false });
        let offset = offset_of!(CANsync_INIT_BMSTRUCT, b_BT_0);
        ctx.find(&rules::BUS_BAUD_RATE, phases::INIT, offset, timing.b_BT_0.into());
    }
}
