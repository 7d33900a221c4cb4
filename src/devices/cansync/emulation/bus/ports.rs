//! The [`Bus`] implementation of a CANsync bus, and the functions of its ports that are not traffic.

use super::end::{DriveEnd, End, PortRef, Socket, SocketRole};
use super::rates::report_mismatch;
use super::schedule::Slot;
use super::{FAMILY, Sender, SimBus, Station};
use crate::devices;
use crate::devices::cansync::BaudRate;
use crate::devices::cansync::drive::Drive;
use crate::devices::cansync::faults::Effect;
use crate::devices::cansync::firmware::Change;
use crate::devices::cansync::records::DriveSet;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::registers::values::ma_sl_mode;
use crate::devices::cansync::rules;
use crate::devices::emulation::can_faults;
use crate::devices::{
    BuildError, Bus, BusGuests, BusView, Context, DriveDetails, DriveState, Drives, Faulty, GuestRefusal,
    Interval, ParameterRefusal, PortWatch, RateMismatch, Shaft, SyncLine, SyncOrigin, SyncSignal, World,
};
use crate::door::{BusMessage, Guest};
use crate::fault::{self, Faults, Hit, Target};
use crate::journal::{Journal, Origin};
use core::any::Any;
use core::mem::offset_of;
use std::sync::Arc;

impl BusView for SimBus {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn bit_s(&self) -> u32 {
        u32::from(self.present_kbit_s()) * 1000
    }

    fn ports(&self) -> Vec<Origin> {
        let masters = self.masters.iter().map(|end| end.origin);
        masters.chain(self.slaves.iter().map(|end| end.origin)).collect()
    }

    fn strangers(&self) -> Vec<RateMismatch> {
        self.of_other_rates()
    }

    fn interval(&self) -> Option<Interval> {
        let timing = self.running.as_ref()?.timing;
        let slot = |(name, start_us): (&str, u32)| devices::Slot::new(name, start_us);
        let BaudRate { t_RC, t_WRC1, t_RDC1, t_WRC2, t_RDC2, t_CC, .. } = *timing;
        let all = [
            ("RC", t_RC),
            ("WRC1", t_WRC1),
            ("RDC1", t_RDC1),
            ("WRC2", t_WRC2),
            ("RDC2", t_RDC2),
            ("CC", t_CC),
        ];
        Some(Interval {
            us: u32::from(timing.b_TIME_PATTERN) * 1000,
            slots: all.into_iter().map(slot).collect(),
        })
    }

    fn participants(&self) -> u32 {
        let present = self.stations.iter().enumerate().filter(|(_, station)| **station != Station::Vacant);
        present.fold(0, |mask, (number, _)| mask | 1 << number)
    }
}

impl Bus for SimBus {
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError> {
        let socket = socket.downcast::<Socket>().map_err(|_| BuildError::OtherFamily)?;
        let place = match &socket.role {
            SocketRole::Master { .. } => {
                self.masters.push(End::master(&socket)?);
                PortRef::Master(self.masters.len() - 1)
            }
            SocketRole::Slave { number, lock } => {
                let index = self.slaves.len();
                self.slaves.push(End::slave(&socket, *number, *lock)?);
                if self.is_wired {
                    self.connect(*number, Station::Node(index));
                }
                PortRef::Slave(index)
            }
            SocketRole::Drive(config) => {
                let drive = Drive::new(config, self.kbit_s)?;
                let (origin, number, kbit_s) = (socket.origin, drive.slave_number(), drive.kbit_s());
                if self.is_wired {
                    self.connect(number, Station::Drive(self.drives.len()));
                }
                self.drives.push(drive);
                self.drive_ends.push(DriveEnd { origin, number, kbit_s, last_frame: None });
                PortRef::Drive(self.drive_ends.len() - 1)
            }
        };
        self.places.push(place);
        Ok(self.places.len() - 1)
    }

    fn power_on(&mut self, place: usize, address: u8, now: u64, _: &mut Journal) -> bool {
        match self.places[place] {
            PortRef::Master(index) => {
                self.masters[index].is_on = true;
                self.masters[index].firmware.power_on(address);
                true
            }
            PortRef::Slave(index) => {
                // Every node gets its number again, even if the number is unchanged: another station may have
                // taken the number, or may have just released it.
                let is_free = self.renumber(index, address);
                let end = &mut self.slaves[index];
                if end.firmware.number() != address {
                    end.begin_as(address);
                }
                end.is_on = true;
                end.firmware.power_on();
                is_free
            }
            PortRef::Drive(index) => {
                self.supply_drive(now, self.drive_ends[index].number, true);
                true
            }
        }
    }

    fn set_processor_cycle(&mut self, us: u32) {
        self.processor_cycle_us = us.into();
    }

    fn power_off(&mut self, place: usize, now: u64, journal: &mut Journal) {
        match self.places[place] {
            PortRef::Master(index) => {
                self.masters[index].run(now, journal, |master, ctx| master.power_off(ctx));
                self.masters[index].forget();
                self.masters[index].is_on = false;
                self.stop(now);
            }
            PortRef::Slave(index) => {
                let number = self.slaves[index].firmware.number();
                self.slaves[index].run(now, journal, |slave, ctx| slave.power_off(ctx));
                self.slaves[index].begin_as(number);
                self.slaves[index].is_on = false;
            }
            PortRef::Drive(index) => {
                self.drive_ends[index].last_frame = None;
                self.supply_drive(now, self.drive_ends[index].number, false);
            }
        }
    }

    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool {
        let on_wire = self.on_wire(now, self.places[place]);
        match self.places[place] {
            PortRef::Master(index) => {
                let end = &mut self.masters[index];
                let change = end.run(now, journal, |master, ctx| master.processor_cycle(ctx, on_wire));
                let master = &end.firmware;
                let (is_on_bus, timing, own_sync) =
                    (master.is_on_bus(), master.timing(), !master.forwards_sync());
                if !is_on_bus {
                    end.last_frame = None;
                }
                if change == Change::SetUpStarted && !own_sync && !end.has_sync_in() {
                    end.run(now, journal, |_, ctx| report_no_sync_in(ctx));
                }
                match (change, timing) {
                    (Change::SetUpStarted, Some(timing)) => {
                        self.start(now, timing, own_sync);
                        self.report_mismatches(now, timing.kbit_per_s, journal);
                    }
                    (Change::Restarted, _) => self.stop(now),
                    _ => {}
                }
                is_on_bus
            }
            PortRef::Slave(index) => {
                let bus_kbit_s = self.running.as_ref().map(|running| running.timing.kbit_per_s);
                let has_master = !self.masters.is_empty();
                let end = &mut self.slaves[index];
                end.run(now, journal, |slave, ctx| {
                    let change = slave.processor_cycle(ctx, on_wire);
                    if change == Change::SetUpStarted && !has_master {
                        report_no_master(ctx);
                    }
                    if let (Change::SetUpStarted, Some(kbit_s)) = (change, bus_kbit_s) {
                        report_mismatch(slave, ctx, kbit_s);
                    }
                });
                let is_on_bus = end.firmware.is_on_bus();
                if !is_on_bus {
                    end.last_frame = None;
                }
                is_on_bus
            }
            // A drive has no registers to update.
            PortRef::Drive(_) => false,
        }
    }

    fn last_frame(&self, place: usize) -> Option<u64> {
        match self.places[place] {
            PortRef::Master(index) => self.masters[index].last_frame,
            PortRef::Slave(index) => self.slaves[index].last_frame,
            PortRef::Drive(index) => self.drive_ends[index].last_frame,
        }
    }

    fn is_quiescent(&self, place: usize) -> bool {
        match self.places[place] {
            PortRef::Master(index) => self.masters[index].firmware.is_quiescent(),
            PortRef::Slave(index) => self.slaves[index].firmware.is_quiescent(),
            PortRef::Drive(_) => true,
        }
    }

    #[inline]
    fn poll_changes_nothing(&self, place: usize, now: u64, is_seen: bool) -> bool {
        match self.places[place] {
            PortRef::Master(index) => self.masters[index].firmware.poll_changes_nothing(is_seen),
            PortRef::Slave(index) => self.slaves[index].firmware.poll_changes_nothing(now, is_seen),
            PortRef::Drive(_) => true,
        }
    }

    fn control_changed(&self) -> bool {
        self.slaves.iter().any(|end| end.firmware.control_changed())
            || self.masters.iter().any(|end| end.firmware.control_changed())
    }

    fn next_time(&self) -> u64 {
        self.next.time
    }

    /// The bus is independent until the next edge. An edge also affects devices and other buses.
    fn apart_until(&self) -> u64 {
        self.schedule.at(Slot::Sync).unwrap_or(u64::MAX)
    }

    fn event(&mut self, world: &mut World) -> Option<SyncSignal> {
        if self.slot_due(world) { self.running.as_ref().map(|running| running.signal) } else { None }
    }

    fn watch(&mut self) -> Option<&mut dyn PortWatch> {
        Some(self)
    }

    fn guests(&mut self) -> Option<&mut dyn BusGuests> {
        Some(self)
    }

    fn sync(&self) -> Option<&dyn SyncLine> {
        Some(self)
    }

    fn sync_mut(&mut self) -> Option<&mut dyn SyncLine> {
        Some(self)
    }

    fn drives(&self) -> Option<&dyn Drives> {
        Some(self)
    }

    fn drives_mut(&mut self) -> Option<&mut dyn Drives> {
        Some(self)
    }

    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        Some(self)
    }
}

impl BusGuests for SimBus {
    fn guest_hears(&mut self, guest: u8, receiver: Option<Arc<Guest>>) {
        self.receivers_of_traffic.set(guest, receiver);
    }

    fn guest_sends(
        &mut self,
        guest: u8,
        message: &BusMessage,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), GuestRefusal> {
        let BusMessage::Frame(frame) = message else { return Err(GuestRefusal::NotHere) };
        self.take_guests_frame(guest, frame, now, journal)
    }
}

impl SyncLine for SimBus {
    fn takes_sync(&self, place: usize) -> bool {
        match self.places[place] {
            PortRef::Master(index) => {
                let master = &self.masters[index].firmware;
                master.is_on_bus() && master.forwards_sync()
            }
            PortRef::Slave(_) | PortRef::Drive(_) => false,
        }
    }

    fn forwarded_edge(&mut self, place: usize, now: u64, signal: SyncSignal, journal: &mut Journal) {
        let PortRef::Master(index) = self.places[place] else { return };
        self.masters[index].run(now, journal, |master, ctx| master.passes_sync_on(ctx, signal));
        if let Some(running) = self.running.as_mut().filter(|running| !running.own_sync) {
            running.signal = signal;
            self.schedule.set(Slot::Sync, now);
            self.next = self.schedule.next();
        }
    }

    fn next_sync(&self) -> Option<u64> {
        self.running.as_ref().filter(|running| running.own_sync)?;
        self.schedule.at(Slot::Sync)
    }

    fn sync_origin(&self) -> SyncOrigin {
        let Some(end) = self.masters.first() else { return SyncOrigin::NoMaster };
        let (port, state) = (end.origin, end.firmware.option_status());
        if !end.firmware.is_on_bus() {
            SyncOrigin::Idle { port, register: "w_OPTION_STATUS", state }
        } else if end.firmware.forwards_sync() {
            SyncOrigin::Forwarded { port, setting: "b_MA_SL_MODE 16#02" }
        } else {
            SyncOrigin::Own(port)
        }
    }
}

impl Drives for SimBus {
    fn list(&self) -> Vec<(&str, DriveState)> {
        let look = |drive: &Drive| match self.disturbance.is_off(drive.slave_number()) {
            true => DriveState { state: "off".to_owned(), ..drive.look() },
            false => drive.look(),
        };
        self.drives.look().iter().map(|drive| (drive.name(), look(drive))).collect()
    }

    fn details(&self, drive: usize) -> Option<DriveDetails> {
        let (_, state) = Drives::list(self).into_iter().nth(drive)?;
        Some(DriveDetails { state, ..self.drives.look().get(drive)?.details() })
    }

    fn set_parameter(
        &mut self,
        drive: usize,
        number: u16,
        value: i64,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), ParameterRefusal> {
        let bus = self.index;
        let drive = self.drives.get_mut(drive).ok_or(ParameterRefusal::NotThere)?;
        let slave = drive.slave_number();
        if self.disturbance.is_off(slave) {
            return Err(ParameterRefusal::Off);
        }
        drive.set_parameter(number, value)?;
        journal.push(now, DriveSet { bus, slave, number, value: value as u32 });
        // The drive may have to move now, even if no SYNC edge comes.
        self.wake_drives(now);
        Ok(())
    }

    fn shaft(&self, drive: usize) -> Option<Shaft> {
        Some(self.drives.look().get(drive)?.shaft())
    }

    fn turn_shaft(&mut self, drive: usize, speed: Option<i32>, now: u64) {
        if let Some(drive) = self.drives.get_mut(drive) {
            drive.turn_shaft(speed);
            // The drive may have to move now, even if no SYNC edge comes.
            self.wake_drives(now);
        }
    }

    fn settle(&mut self) {
        self.drives.settle();
    }
}

impl Faulty for SimBus {
    fn faults_changed(&mut self, now: u64, faults: &Faults) {
        let off = faults.acting(self.owner()).fold(0, |off, (target, effect)| match (target, effect) {
            (Target::Participant { number, .. }, Effect::SlaveOff) => {
                off | 1u32.checked_shl(number.into()).unwrap_or(0)
            }
            _ => off,
        });
        self.switch_off_by_faults(now, off);
    }

    /// Applies a fault to a node or drive. A fault hits if it switches a working CAN controller of a node to
    /// BUS-off, or trips a drive that has no fault yet.
    fn fire(&mut self, now: u64, target: Target, effect: &fault::Effect) -> Option<Hit> {
        let hits = match target {
            Target::Port { device, port } if effect.get() == Some(&can_faults::Effect::BusOff) => {
                self.go_bus_off(Origin { plc: device, node: port }, now)
            }
            Target::Participant { number, .. } => match *effect.get()? {
                Effect::Trip(fault) => self.trip_drive(now, number, fault),
                _ => false,
            },
            _ => false,
        };
        hits.then_some(Hit::Plain)
    }
}

/// Reports a master that starts and must pass on the SYNC signal of another port, although no other port can
/// supply a signal.
fn report_no_sync_in(ctx: &mut Context) {
    let offset = offset_of!(CANsync_INIT_BMSTRUCT, b_MA_SL_MODE);
    ctx.find(&rules::NO_SYNC_IN, phases::INIT, offset, ma_sl_mode::MASTER_SYNC_IN.into());
}

/// Reports a slave that starts without a bus, or on a bus without a master (decision D-743).
fn report_no_master(ctx: &mut Context) {
    let offset = offset_of!(CANsync_INIT_BMSTRUCT, b_MA_SL_MODE);
    ctx.find(&rules::NO_MASTER, phases::INIT, offset, ma_sl_mode::SLAVE.into());
}

impl SimBus {
    /// Returns the port of a node.
    pub(super) fn place_of(&self, origin: Origin) -> Option<PortRef> {
        let is_there = |place: &PortRef| match *place {
            PortRef::Master(index) => self.masters[index].origin == origin,
            PortRef::Slave(index) => self.slaves[index].origin == origin,
            PortRef::Drive(index) => self.drive_ends[index].origin == origin,
        };
        self.places.iter().copied().find(is_there)
    }

    /// Switches the controller of a node to BUS-off. Returns true if it was working.
    fn go_bus_off(&mut self, origin: Origin, now: u64) -> bool {
        let (goes, sender) = match self.place_of(origin) {
            Some(PortRef::Master(index)) => (self.masters[index].firmware.go_bus_off(), Sender::Master),
            Some(PortRef::Slave(index)) => {
                let slave = &mut self.slaves[index].firmware;
                (slave.go_bus_off(), Sender::Slave(slave.number()))
            }
            Some(PortRef::Drive(_)) | None => return false,
        };
        if goes {
            self.destroy_frames_of(now, sender);
        }
        goes
    }

    /// Connects slave node `index`, which is switched on, under `number`. Returns false if another station
    /// has this number; the node is then not connected. If the other station is a node that is off, that node
    /// loses the number. A drive keeps its number even while it is off (decision D-184).
    fn renumber(&mut self, index: usize, number: u8) -> bool {
        if !self.is_wired {
            return true;
        }
        for station in &mut self.stations {
            if *station == Station::Node(index) {
                *station = Station::Vacant;
            }
        }
        let Some(station) = self.stations.get_mut(usize::from(number)) else { return false };
        let is_free = match *station {
            Station::Vacant => true,
            Station::Node(other) => !self.slaves[other].is_on,
            Station::Drive(_) => false,
        };
        if is_free {
            *station = Station::Node(index);
        }
        is_free
    }

    /// Returns the activity of a node's controller at the moment at which a poll at `now` reads its status:
    /// `Some(true)` if it is sending, `Some(false)` if it is receiving.
    fn on_wire(&self, now: u64, place: PortRef) -> Option<bool> {
        let read = self.status_read(now);
        let wire = self.on_wire.iter().flatten().find(|wire| (wire.from..wire.until).contains(&read))?;
        Some(match (wire.sender, place) {
            (_, PortRef::Slave(index)) if self.is_off(index) => return None,
            (Sender::Master, PortRef::Master(_)) => true,
            (Sender::Slave(number), PortRef::Slave(index)) => {
                self.stations.get(usize::from(number)) == Some(&Station::Node(index))
            }
            _ => false,
        })
    }

    /// Returns the time at which the firmware reads the status of the CAN controller in a poll at `now`. The
    /// polls of processor cycles read the status at varying moments of the interval, as if the interval were
    /// not a multiple of the cycle. A poll that a doorbell requests reads the status at once (decision
    /// D-604).
    fn status_read(&self, now: u64) -> u64 {
        /// 2^64 divided by the golden ratio. The multiples of this number are spread evenly over any span.
        const SPREAD: u64 = 0x9E37_79B9_7F4A_7C15;
        let Some(running) = &self.running else { return now };
        let cycle = self.processor_cycle_us;
        if !now.is_multiple_of(cycle) {
            return now;
        }
        // The bus knows all frames of the last half interval, so the moment lies within this span.
        let span = cycle.min(u64::from(running.signal.interval_us) / 2);
        let turn = (now / cycle.max(1)).wrapping_mul(SPREAD);
        let before = (u128::from(turn) * u128::from(span)) >> u64::BITS;
        now.saturating_sub(before as u64)
    }

    /// Returns true if the plug of slave node `index` is pulled.
    fn is_off(&self, index: usize) -> bool {
        let number = self.stations.iter().position(|station| *station == Station::Node(index));
        number.is_some_and(|number| self.disturbance.is_off(number as u8)) // at most 31
    }
}
