//! A whole installation: PLCs with their communication RAM, drives, the buses between them, and one clock for all.
//!
//! Only [`Plant::advance_to`] advances the simulation. The same plant and the same register writes at the same emulated
//! times give the same journal, byte for byte.

mod access;
mod boards;
mod cards;
mod config;
mod cores;
mod drives;
mod force;
mod guests;
mod history;
mod injection;
mod load;
#[cfg(test)]
mod node_frames_tests;
#[cfg(feature = "channel")]
mod outside_stores;
mod ports;
mod schema;
mod skipped_cycles;
mod snapshot;
mod worker_pool;
mod writes;

pub use crate::devices::Power;
pub use config::{PlantConfig, PlantError};
pub use drives::PlantDrive;
pub use force::{ForceError, Forced};
pub use history::FollowError;
#[cfg(feature = "channel")]
pub(crate) use outside_stores::{Outside, Stored};
pub use schema::schema;
pub use snapshot::{Snapshot, SnapshotError, SnapshotFile, SnapshotFileError};

use crate::check::DeviceWatch;
use crate::devices::{BUS_KINDS, BuildError, Bus, CardMemory, Context, Device, Events, World};
use crate::due_queue::{DueQueue, NEVER};
use crate::fault::{FaultKind, Faults};
use crate::identity::{BusIndex, DeviceIndex};
use crate::journal::{By, Journal, Late, Names, Origin};
use crate::layout::{DeviceFit, DeviceLayout as Layout};
use crate::memory::{MemoryError, RegisterWidths, Segment};
use cards::PluggedCard;
use core::cell::RefCell;
use core::num::NonZero;
use force::Forces;
use ports::Ports;
use std::collections::HashMap;
use std::sync::Arc;
use worker_pool::WorkerPool;

/// Number of consecutive failed attempts to run buses independently. After them, the plant makes no attempt
/// for some time.
const TRIES: u32 = 4;
/// Emulated time in microseconds after which [`Plant::advance_while`] calls its function at the latest.
const PART_US: u64 = 100_000;

/// Latest emulated time of a snapshot, in microseconds: 9e9 s, 285 years. Buses calculate with nanoseconds, and many times
/// are sums of the present time and a duration.
pub(crate) const LATEST_US: u64 = 9_000_000_000 * 1_000_000;

/// The whole simulation, with its clock and its journal.
pub struct Plant {
    now: u64,
    next_cycle: u64,
    /// Time of the next event of all devices, in microseconds. The value may be too early: an unnecessary
    /// poll changes nothing.
    next_device: u64,
    cycle_us: u64,
    /// True if no event has occurred since the last processor cycle.
    has_looked: bool,
    /// True if no register was written since the last poll of the registers.
    is_seen: bool,
    /// True if a watched event is to stop [`Plant::advance_until`].
    watching: bool,
    /// The devices in folders. Their scripts may take long.
    folders: Vec<DeviceIndex>,
    /// See [`Plant::end_if`].
    is_ending: Option<Arc<dyn Fn() -> bool + Send + Sync>>,
    devices: Vec<Box<dyn Device>>,
    /// The buses of the plant file, then placeholders for unconnected ports: one placeholder for each kind of
    /// bus, and one for each port that runs alone.
    buses: Vec<Box<dyn Bus>>,
    /// Number of buses in the plant file.
    named_buses: usize,
    /// Time of the next event of each device and bus. Valid only while the clock advances: between two advances, a
    /// client may change the times.
    schedule: DueQueue,
    /// True if `schedule` is stale and must be rebuilt before use.
    is_rescheduled: bool,
    ports: Ports,
    journal: Journal,
    /// Journals of buses that run independently: one for each core, if there are many buses.
    drafts: Vec<Journal>,
    /// Worker threads on the other cores.
    workers: WorkerPool,
    forces: Forces,
    faults: Faults,
    /// Watches of the access checker, one for each device. The watches for ports are in the buses.
    watches: Vec<DeviceWatch>,
    /// Ports with a SYNC edge, as long as their devices were not notified of the edge; empty between events.
    edges: Vec<Origin>,
    /// The option cards with their controllers.
    cards: Arc<[PluggedCard]>,
    /// Register widths of each device, for accesses from outside.
    widths: Vec<RegisterWidths>,
    /// The text of the plant file, and numbers for its settings.
    text: Arc<str>,
    settings: Arc<[u64]>,
}

impl Plant {
    /// Builds and powers on the plant. `segment` supplies the RAM of each device by its name and
    /// layout: heap or image.
    ///
    /// # Errors
    /// The configuration is refused, or a memory segment is not accessible or is too small.
    pub fn new<E>(
        config: &PlantConfig,
        mut segment: impl FnMut(&str, &'static Layout) -> Result<Segment, E>,
    ) -> Result<Self, E>
    where
        E: From<MemoryError> + From<PlantError>,
    {
        config.check()?;
        let mut buses: Vec<Box<dyn Bus>> = Vec::with_capacity(config.buses.len() + BUS_KINDS.len());
        for (index, bus) in BusIndex::enumerate(&config.buses) {
            buses.push(bus.build(index).map_err(refused::<E>)?);
        }
        // `check` refuses two buses of one name.
        let named: HashMap<_, _> =
            buses.iter().enumerate().map(|(at, bus)| (bus.name().to_owned(), at)).collect();
        let named_buses = named.len();
        buses.extend(BUS_KINDS.iter().map(|kind| (kind.unplugged)()));
        let mut devices: Vec<Box<dyn Device>> = Vec::with_capacity(config.devices.len());
        let mut ports = Ports::default();
        // An option card has its registers in the image of its controller.
        let mut segments = Vec::with_capacity(config.devices.len());
        for device in &config.devices {
            segments.push(segment(device.name(), device.layout())?);
        }
        for (index, device) in DeviceIndex::enumerate(&config.devices) {
            let segment = segments[index.index()].clone();
            let memory = config.card_place(&**device).map(|(controller, interface)| {
                let segment = segments[controller.index()].clone();
                CardMemory { controller, segment, interface }
            });
            let built = match memory {
                Some(memory) => device.build_card(index, segment, memory),
                None => device.build(index, segment),
            };
            let (mut device, plugs) = built.map_err(refused::<E>)?;
            ports.plug_in(&mut *device, plugs, &mut buses, &named).map_err(refused::<E>)?;
            devices.push(device);
        }
        let cycle_us = u64::from(config.processor_cycle_us.max(1));
        buses.iter_mut().for_each(|bus| bus.set_processor_cycle(config.processor_cycle_us));
        let mut watches = Vec::with_capacity(devices.len());
        for (index, device) in DeviceIndex::enumerate(&devices) {
            watches.push(DeviceWatch::new(index, device.segment(), device.layout())?);
            device.segment().header()?.set_fitted(&device.fitted());
        }
        let widths = devices.iter().map(|device| RegisterWidths::of(&device.fitted())).collect();
        let mut plant = Plant {
            now: 0,
            next_cycle: cycle_us,
            next_device: NEVER,
            cycle_us,
            has_looked: false,
            is_seen: false,
            watching: false,
            folders: in_folders(&mut devices),
            is_ending: None,
            devices,
            schedule: DueQueue::of(buses.len()),
            buses,
            named_buses,
            is_rescheduled: false,
            ports,
            journal: Journal::default(),
            drafts: Vec::new(),
            workers: WorkerPool::default(),
            watches,
            widths,
            forces: Forces::default(),
            faults: Faults::default(),
            edges: Vec::new(),
            cards: cards::plug_in(&config.devices),
            text: Arc::clone(config.text()),
            settings: config.settings(),
        };
        plant.set_cores(NonZero::<usize>::MIN);
        DeviceIndex::first(plant.devices.len()).for_each(|device| plant.start(device));
        plant.find_next_device();
        // The watches compare the registers with their state after power-on.
        plant.leave();
        for fault in config.resolved_faults()? {
            // `resolved_faults` has checked the fault, and the plant file cannot contain too many faults, so
            // no error is possible.
            let _ = plant.add_fault(fault);
        }
        Ok(plant)
    }

    /// Emulated time in microseconds since power-on.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// Returns the time of the next event; the next processor cycle at the latest.
    pub fn next_event(&self) -> u64 {
        let first = self.next_cycle.min(self.next_device).min(self.faults.next_time());
        self.buses.iter().map(|bus| bus.next_time()).fold(first, u64::min)
    }

    /// Lets devices take over changes of their files. Returns true if a device has done so: earlier snapshots
    /// then belong to other settings.
    pub(crate) fn take_over_files(&mut self) -> bool {
        let Plant { now, devices, journal, settings, .. } = self;
        let mut has_changed = false;
        for (index, device) in devices.iter_mut().enumerate() {
            let Some(files) = device.file_changes() else { continue };
            let origin = Origin::of_device(DeviceIndex::at(index));
            let number = files.take_over(&mut Context { now: *now, journal, origin, base: 0 });
            let Some(number) = number else { continue };
            has_changed = true;
            let mut all = settings.to_vec();
            // The number of the processor cycle comes before the numbers of the devices.
            if let Some(setting) = all.get_mut(index + 1) {
                *setting = number;
            }
            *settings = all.into();
        }
        if has_changed {
            self.has_looked = false;
            self.find_next_device();
        }
        has_changed
    }

    /// Advances the clock to `time`, and handles all events up to `time`, including events at `time` itself.
    /// If `time` is in the past, nothing changes.
    pub fn advance_to(&mut self, time: u64) {
        match self.is_ending.clone() {
            None => while self.advance_until(time) {},
            Some(is_ending) => while self.advance_in_slices(time, &*is_ending) == Advance::Watched {},
        }
    }

    /// Advances like [`Plant::advance_to`], but returns before its time when `is_awaited` returns false.
    pub(crate) fn advance_while(&mut self, time: u64, is_awaited: &mut dyn FnMut() -> bool) {
        let is_ending = self.is_ending.clone();
        let is_awaited = RefCell::new(is_awaited);
        let must_end =
            || is_ending.as_ref().is_some_and(|is_ending| is_ending()) || !(is_awaited.borrow_mut())();
        loop {
            // Only a plant with devices in folders pauses within a part.
            let part = self.now.saturating_add(PART_US).min(time);
            while self.advance_in_slices(part, &must_end) == Advance::Watched {}
            if part >= time || must_end() {
                return;
            }
        }
    }

    /// Sets a function that returns true if the owner of the plant must end. [`Plant::advance_to`] then returns before
    /// its time if scripts of devices take long.
    pub(crate) fn end_if(&mut self, is_ending: Arc<dyn Fn() -> bool + Send + Sync>) {
        self.is_ending = Some(is_ending);
    }

    /// Advances like [`Plant::advance_to`], but stops early when a watched event ([`Plant::watch`]) has occurred, and
    /// then returns `true`. The next call handles the remaining events of this moment.
    pub fn advance_until(&mut self, time: u64) -> bool {
        self.advance_in_slices(time, &|| false) == Advance::Watched
    }

    /// Advances like [`Plant::advance_until`], but also pauses when `should_pause` returns true, and then returns
    /// [`Advance::Paused`]. Each call handles at least one event. A pause never divides the events of a moment. It is a
    /// division of the time, which changes no result, so `should_pause` may depend on the real time.
    ///
    /// Only a plant with devices in folders pauses: their scripts may take long.
    pub(crate) fn advance_in_slices(&mut self, time: u64, should_pause: &dyn Fn() -> bool) -> Advance {
        self.look_for_writes();
        self.is_rescheduled = true;
        let mut has_run = false;
        let mut outcome = Advance::Arrived;
        let mut is_slice_over = false;
        let mut tries = TRIES;
        while outcome == Advance::Arrived {
            if is_slice_over && self.now < time && self.next_event() > self.now {
                outcome = Advance::Paused;
                break;
            }
            // Order of events at the same moment: faults, the processor cycle, events of devices, events of buses in
            // plant order.
            if self.is_rescheduled {
                self.schedule_buses();
            }
            let (mut due, mut which) = (self.next_device, NextEvent::Device);
            if !self.drafts.is_empty() && tries > 0 && self.schedule.first() > self.now {
                if self.go_apart(time) {
                    (tries, has_run, self.has_looked) = (TRIES, true, false);
                    continue;
                }
                tries -= 1;
            }
            if self.schedule.first() < due
                && let Some(index) = self.schedule.due(0, self.schedule.first())
            {
                (due, which) = (self.schedule.first(), NextEvent::Bus(BusIndex::at(index)));
            }
            if self.has_looked {
                self.leave_out_cycles(due.min(self.faults.next_time()).min(time.saturating_add(1)));
            }
            if !self.leaves_cycles_out(due, time) {
                (due, which) = (self.next_cycle, NextEvent::Cycle);
            }
            if self.faults.next_time() <= due.min(time) {
                self.now = self.now.max(self.faults.next_time());
                self.advance_faults();
                continue;
            }
            if due > time {
                break;
            }
            self.now = due;
            if has_run {
                self.keep_changes(By::Program);
            }
            has_run = true;
            self.has_looked = false;
            match which {
                NextEvent::Cycle => {
                    self.next_cycle += self.cycle_us;
                    self.has_looked = self.run_cycle();
                    self.journal.tick(due);
                }
                NextEvent::Device => {
                    self.forces.apply(&self.devices);
                    self.devices_due();
                    self.forces.apply(&self.devices);
                }
                NextEvent::Bus(index) => {
                    self.forces.apply(&self.devices);
                    self.bus_events(index, time);
                    self.forces.apply(&self.devices);
                }
            }
            self.keep_changes(By::Firmware);
            if self.watching && self.take_stop() {
                outcome = Advance::Watched;
            }
            is_slice_over = !self.folders.is_empty() && should_pause();
        }
        self.pass_to(if outcome == Advance::Arrived { time } else { self.now });
        if has_run {
            self.leave();
        }
        outcome
    }

    /// Advances the clock to a time before the next event ([`Plant::next_event`]). This is faster than
    /// [`Plant::advance_to`], because it does not check the writes of clients since the last event. If `time`
    /// is in the past, nothing changes.
    #[inline]
    pub fn pass_to(&mut self, time: u64) {
        self.now = self.now.max(time);
        for device in &self.devices {
            device.show_time(self.now);
        }
        self.watches.iter_mut().for_each(|watch| watch.show_time(self.now));
    }

    /// Notifies the access checker that the speed of the clock in the header pages was set, in emulated time per real
    /// time x 1000.
    pub(crate) fn show_speed(&mut self, permille: u32) {
        self.watches.iter_mut().for_each(|watch| watch.show_speed(permille));
    }

    /// Sets the events of device `device` that stop [`Plant::advance_until`], bit n for event n.
    pub fn watch(&mut self, device: DeviceIndex, events: u16) {
        if let Some(its) = self.devices.get_mut(device.index()).and_then(|device| device.events()) {
            its.watched = events;
        }
        self.watching = events_of(&mut self.devices).any(|its| its.watched != 0);
    }

    /// True if a watched event has occurred. Clears the events of all devices, so that they do not stop the
    /// next call.
    fn take_stop(&mut self) -> bool {
        events_of(&mut self.devices).fold(false, |stop, its| stop | its.take_stop())
    }

    /// Handles all events of the devices themselves at the present time.
    fn devices_due(&mut self) {
        self.is_seen = false;
        let Plant { now, devices, journal, faults, edges, .. } = self;
        let mut world = World { now: *now, journal, faults, edges };
        for device in devices.iter_mut().filter(|device| device.next_time() == *now) {
            device.due(&mut world);
        }
        self.pass_signals();
        self.find_next_device();
    }

    #[inline]
    fn find_next_device(&mut self) {
        self.next_device = self.devices.iter().map(|device| device.next_time()).fold(NEVER, u64::min);
    }

    /// Runs a processor cycle at the present time, because a client has rung the doorbell: all boards poll their
    /// switches, and all ports poll their control registers. The times of the regular processor cycles do not change.
    pub fn processor_cycle(&mut self) {
        self.look_for_writes();
        self.run_cycle();
        self.leave();
    }

    /// Returns false if the firmware has written a forced register, so the next cycle must write registers
    /// again.
    fn run_cycle(&mut self) -> bool {
        self.look_at_requests();
        self.forces.apply(&self.devices);
        if !self.faults.is_empty() {
            self.fire();
        }
        for plc in DeviceIndex::first(self.devices.len()) {
            let device = &mut self.devices[plc.index()];
            if device.is_up() {
                let origin = Origin::of_device(plc);
                device.processor_cycle(&mut Context {
                    now: self.now,
                    journal: &mut self.journal,
                    origin,
                    base: 0,
                });
                self.ports_look(plc);
            }
        }
        self.pass_signals();
        self.is_seen = !self.forces.apply(&self.devices);
        self.find_next_device();
        self.is_seen
    }

    /// True if a program has written the control register of a port, or turned a switch of its board, and the firmware
    /// has not polled it yet.
    pub fn control_changed(&self) -> bool {
        self.buses.iter().any(|bus| bus.control_changed())
            || self.devices.iter().any(|device| device.has_changed())
    }

    /// Handles the present event of a bus. If nothing outside the firmware depends on each single event, also handles
    /// the next events of this bus, up to the next event of another participant, and skips processor cycles between them
    /// that change nothing.
    fn bus_events(&mut self, index: BusIndex, time: u64) {
        // If the device of a port handles frames, it must do so before the next event of the bus.
        let is_linked = self.ports.is_linked(index);
        let until = if self.is_unobserved() && !is_linked {
            // A plant with devices in folders may pause at each processor cycle.
            let pause = if self.folders.is_empty() { NEVER } else { self.next_cycle };
            let others = self.schedule.first_besides(index.index()).min(self.next_device);
            others.min(pause).min(time.saturating_add(1))
        } else {
            0
        };
        let signal = loop {
            let Plant { now, next_cycle, buses, journal, faults, edges, .. } = self;
            let Some(bus) = buses.get_mut(index.index()) else { return };
            let mut world = World { now: *now, journal, faults, edges };
            let signal = bus.events(&mut world, until.min(*next_cycle));
            *now = world.now;
            let next = bus.next_time();
            if signal.is_some() || !edges.is_empty() || next >= until || !self.leaves_cycles_out(next, time) {
                self.schedule.set(index.index(), next);
                break signal;
            }
            self.now = next;
        };
        if is_linked {
            self.find_next_device();
        }
        if !self.edges.is_empty() {
            self.tell_edges();
        }
        let Some(signal) = signal else { return };
        self.forward_sync(index, signal);
        if let Some(watch) = self.buses[index.index()].watch() {
            watch.judge_edge(self.now, &mut self.journal);
        }
    }

    /// Records that the emulated time is late by this real time, in microseconds; 0 if it is no longer late. The source
    /// is the first device in a folder, or the first device.
    pub(crate) fn note_late(&mut self, late_us: u64) {
        let plc = self.folders.first().copied().unwrap_or(DeviceIndex::at(0));
        self.journal.push(self.now, Late { plc, late_us });
    }

    /// Returns the names of the devices in folders. Their scripts may take long.
    pub(crate) fn folder_names(&self) -> impl Iterator<Item = &str> {
        self.folders.iter().filter_map(|plc| self.devices.get(plc.index())).map(|device| device.name())
    }

    /// True if the plant has devices in folders. Their scripts may take long.
    #[cfg(feature = "channel")]
    pub(crate) fn has_folders(&self) -> bool {
        !self.folders.is_empty()
    }

    /// Asks all buses for the times of their next events.
    fn schedule_buses(&mut self) {
        for (index, bus) in self.buses.iter().enumerate() {
            self.schedule.set(index, bus.next_time());
        }
        self.is_rescheduled = false;
    }

    /// Notifies the devices of the SYNC edges at their ports. An edge may start an activity of the device or
    /// change its time, so the time of the device's next event is computed again.
    fn tell_edges(&mut self) {
        for Origin { plc, node } in self.edges.drain(..) {
            if let Some(device) = self.devices.get_mut(plc.index()) {
                if let Some(ports) = device.ports() {
                    ports.sync_edge(node, self.now);
                }
                self.next_device = self.next_device.min(device.next_time());
            }
        }
        if self.pass_signals() {
            self.is_seen = false;
            self.find_next_device();
        }
    }

    /// Returns the devices, in the order of the plant file.
    pub fn devices(&self) -> &[Box<dyn Device>] {
        &self.devices
    }

    /// Returns the buses, in the order of the plant file.
    pub fn buses(&self) -> &[Box<dyn Bus>] {
        &self.buses[..self.named_buses]
    }

    /// Returns names of the buses, in the order of the plant file.
    pub fn bus_names(&self) -> impl Iterator<Item = &str> {
        self.buses().iter().map(|bus| bus.name())
    }

    /// True if bus number `bus` is a plain CAN bus, that is, a bus without a protocol above CAN.
    #[cfg(feature = "channel")]
    pub(crate) fn is_can(&self, bus: BusIndex) -> bool {
        self.buses().get(bus.index()).is_some_and(|it| it.family() == crate::devices::can_bus::FAMILY)
    }

    /// Returns the names of PLCs and buses, which a reader of the journal needs.
    pub fn names(&self) -> Names {
        Names {
            plcs: self.devices.iter().map(|device| device.name().to_owned()).collect(),
            buses: self.bus_names().map(str::to_owned).collect(),
            devices: self.devices.iter().map(|device| fitted(&**device)).collect(),
        }
    }

    /// Returns the number of bytes of retain flags that each PLC has, in the order of the plant.
    #[cfg(feature = "cli")]
    pub(crate) fn retain_bytes(&self) -> Vec<u32> {
        self.devices.iter().map(|device| device.header().retain_size.load()).collect()
    }

    /// Returns the journal of the plant.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Clears the findings of the access checker.
    pub fn clear_findings(&mut self) {
        self.journal.clear_findings();
    }
}

/// Returns the device with its options and the number of its declarations.
fn fitted(device: &dyn Device) -> DeviceFit {
    device.fitted().declaring(FaultKind::declarations_of(device.fault_kinds()))
}

/// Returns the devices with firmware in a folder.
fn in_folders(devices: &mut [Box<dyn Device>]) -> Vec<DeviceIndex> {
    let devices = devices.iter_mut().enumerate();
    devices.filter_map(|(at, device)| device.file_changes().map(|_| DeviceIndex::at(at))).collect()
}

/// Returns the events of all devices that have events.
fn events_of(devices: &mut [Box<dyn Device>]) -> impl Iterator<Item = &mut Events> {
    devices.iter_mut().filter_map(|device| device.events())
}

fn refused<E: From<MemoryError> + From<PlantError>>(error: BuildError) -> E {
    match error {
        BuildError::Memory(error) => error.into(),
        other => PlantError::from(other).into(),
    }
}

/// How an advance of the clock has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Advance {
    /// The clock has reached the requested time.
    Arrived,
    /// A watched event has occurred.
    Watched,
    /// The caller wants to do other work. The clock has an earlier time.
    Paused,
}

/// The event that the plant executes next.
enum NextEvent {
    Cycle,
    Device,
    Bus(BusIndex),
}
