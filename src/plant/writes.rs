//! Writes of clients into the images, as the access checker sees them.

use super::Plant;
use crate::devices::Context;
use crate::identity::DeviceIndex;
use crate::journal::{By, ChannelWrite, Origin};

impl Plant {
    /// Called before the firmware runs: checks the writes of clients since the last run of the firmware.
    /// Checks one device after the other: first the registers of the device itself, then the registers of its
    /// ports.
    #[inline]
    pub(super) fn look_for_writes(&mut self) {
        (self.has_looked, self.is_seen) = (false, false);
        self.keep_changes(By::Program);
        if self.look_on_cores() {
            return;
        }
        let Plant { now, buses, ports, journal, watches, .. } = self;
        for (watch, ports) in watches.iter_mut().zip(ports.of_devices()) {
            watch.look(*now, journal);
            for port in ports {
                if let Some(watch) = buses[port.bus.index()].watch() {
                    watch.judge_writes(port.place, *now, journal);
                }
            }
        }
    }

    /// Called after the firmware has run: stores the baselines. A later difference from a baseline is then a
    /// write of a client.
    #[inline]
    pub(super) fn leave(&mut self) {
        self.keep_changes(By::Firmware);
        if self.leave_on_cores() {
            return;
        }
        let Plant { buses, ports, watches, .. } = self;
        for (watch, ports) in watches.iter_mut().zip(ports.of_devices()) {
            watch.leave();
            for port in ports {
                if let Some(watch) = buses[port.bus.index()].watch() {
                    watch.store_baseline(port.place);
                }
            }
        }
    }

    /// Records a register write that came through the channel.
    pub fn note_channel_write(&mut self, plc: DeviceIndex, offset: u32, width: u8, value: u32) {
        (self.has_looked, self.is_seen) = (false, false);
        self.forces.apply(&self.devices);
        self.keep_changes(By::Channel);
        self.journal.push(self.now, ChannelWrite { plc, offset, width, value });
        let Some(device) = self.devices.get_mut(plc.index()) else { return };
        if device.address_writes().is_some_and(|writes| writes.answers_write(offset)) {
            self.look_for_writes();
            let origin = Origin::of_device(plc);
            let ctx = &mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 };
            if let Some(writes) = self.devices[plc.index()].address_writes() {
                writes.answer_write(ctx);
            }
            self.leave();
        }
        if let Some(writes) = self.devices[plc.index()].address_writes() {
            writes.written_by_address(offset, width.into());
        }
        self.judge_channel_write(plc, offset, width.into());
    }

    fn judge_channel_write(&mut self, device: DeviceIndex, offset: u32, bytes: u32) {
        let Plant { now, buses, ports, journal, watches, .. } = self;
        if let (Some(watch), Some(ports)) =
            (watches.get_mut(device.index()), ports.of_devices().nth(device.index()))
        {
            watch.written(offset, bytes, *now, journal);
            for port in ports {
                if let Some(watch) = buses[port.bus.index()].watch() {
                    watch.judge_write(port.place, offset, bytes, *now, journal);
                }
            }
        }
    }
}
