//! A simulated CANsync bus: one master, up to 32 slaves, frames in their slots.
//!
//! A frame is delivered at the end of its end-of-frame field, to every station that listens at the bus's baud
//! rate. The next frame can begin after the intermission. The content of a frame does not change after its
//! start. Slot times are from the manual's table (5.00005.03a p. 125). Frames have their real lengths,
//! including stuff bits. A frame that extends into the next slot delays the frame of that slot (decision
//! D-280).

mod command;
mod config;
mod disturbance;
mod drives;
mod end;
mod fault;
mod guests;
mod own_clock;
mod ports;
mod process;
mod rates;
mod schedule;
mod slots;
mod snapshot;
#[cfg(test)]
mod tests;
mod watch;

pub use config::BusConfig;
pub use end::{Socket, SocketRole};

use crate::devices::cansync::BaudRate;
use crate::devices::cansync::drive::{Drive, DriveError};
use crate::devices::cansync::firmware::{Built, Master, Slave};
use crate::devices::cansync::frames::{Channel, Frame, FrameLength};
use crate::devices::emulation::traffic_receivers::TrafficReceivers;
use crate::devices::{Bus, Context, SyncSignal, World};
use crate::fault::{Faults, Owner};
use crate::identity::BusIndex;
use crate::journal::{Journal, Origin};
use core::any::Any;
use disturbance::Disturbance;
use drives::Drives;
use end::{DriveEnd, End, PortRef};
use own_clock::OwnClock;
use schedule::{Next, Schedule, Slot};
use serde::{Deserialize, Serialize};
use slots::{OnWire, PLACES};

/// Family name of CANsync buses.
pub(crate) const FAMILY: &str = "cansync";

/// The station connected under a slave number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Station {
    Vacant,
    /// Index into the bus's drives.
    Drive(usize),
    /// Index into the bus's slave nodes.
    Node(usize),
}

/// The sender of the frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Sender {
    Master,
    Slave(u8),
}

/// The running bus: its times and its SYNC signal.
struct RunningBus {
    timing: &'static BaudRate,
    /// True if the master generates the SYNC signal itself.
    own_sync: bool,
    /// The SYNC signal, generated or passed on.
    signal: SyncSignal,
    /// Start of the present interval, in microseconds.
    start: u64,
}

/// A CANsync bus with its nodes and drives.
pub struct SimBus {
    index: BusIndex,
    name: String,
    /// False for the placeholder of unconnected nodes, which has no wires.
    is_wired: bool,
    /// The ports in the order in which they were attached.
    places: Vec<PortRef>,
    /// The master of the bus: one element, or none.
    masters: Vec<End<Master>>,
    slaves: Vec<End<Slave>>,
    /// The drives among `drives` that are ports of devices.
    drive_ends: Vec<DriveEnd>,
    stations: [Station; 32],
    drives: Drives,
    /// Baud rate from the plant file in kbit/s; applies to drives without a baud rate setting.
    kbit_s: u16,
    frame_length: FrameLength,
    /// Length of the processor cycle in microseconds. If it is 0, each poll reads the status of the
    /// controller at once.
    processor_cycle_us: u64,
    running: Option<RunningBus>,
    schedule: Schedule,
    /// The next event. It is set after each change of the schedule.
    next: Next,
    /// The last frame of each kind. A frame is stored as soon as its slot is determined. So several frames
    /// may have times in the future.
    on_wire: [Option<OnWire>; PLACES],
    reference: [Option<Built>; 2],
    actual: [Option<Frame>; 2],
    command: Option<Frame>,
    /// Number of the slave that has not answered the last command yet.
    asked: Option<u8>,
    /// Answer of a drive that waits for the response slot.
    drive_answer: Option<Frame>,
    response: Option<Frame>,
    disturbance: Disturbance,
    own_clock: OwnClock,
    /// Guests that receive the traffic.
    receivers_of_traffic: TrafficReceivers,
}

impl SimBus {
    /// Returns the placeholder for nodes without a connected bus. On this placeholder a master generates its
    /// SYNC signal and sends, but no station receives anything. The journal has no record of this traffic
    /// (decision D-645).
    pub fn unplugged() -> Self {
        Self::empty(BusIndex::of_number(u16::MAX), false, &BusConfig::default())
    }

    /// Creates bus number `index` of the plant with its drives, without nodes.
    ///
    /// # Errors
    /// [`DriveError`] names the drive and the wrong setting.
    pub fn new(index: BusIndex, config: &BusConfig) -> Result<Self, DriveError> {
        let mut bus = Self::empty(index, true, config);
        for drive in &config.drives {
            let drive = Drive::new(drive, config.kbit_s)?;
            bus.connect(drive.slave_number(), Station::Drive(bus.drives.len()));
            bus.drives.push(drive);
        }
        Ok(bus)
    }

    fn empty(index: BusIndex, is_wired: bool, config: &BusConfig) -> Self {
        SimBus {
            index,
            name: config.name.clone(),
            is_wired,
            places: Vec::new(),
            masters: Vec::new(),
            slaves: Vec::new(),
            drive_ends: Vec::new(),
            stations: [Station::Vacant; 32],
            drives: Drives::default(),
            kbit_s: config.kbit_s,
            frame_length: config.frame_length,
            processor_cycle_us: 0,
            running: None,
            schedule: Schedule::empty(),
            next: Schedule::empty().next(),
            on_wire: [None; PLACES],
            reference: [None; 2],
            actual: [None; 2],
            command: None,
            asked: None,
            drive_answer: None,
            response: None,
            disturbance: Disturbance::default(),
            own_clock: OwnClock::default(),
            receivers_of_traffic: TrafficReceivers::default(),
        }
    }

    /// Owner of the faults that act on this bus.
    fn owner(&self) -> Owner {
        Owner::Bus(self.index)
    }

    fn connect(&mut self, number: u8, station: Station) {
        if let Some(place) = self.stations.get_mut(usize::from(number)) {
            *place = station;
        }
    }

    /// Returns the drives on this bus.
    pub fn drives(&self) -> &[Drive] {
        self.drives.look()
    }

    /// Starts synchronous operation for the master. If the master itself generates the SYNC signal, the first
    /// edge comes at once.
    fn start(&mut self, now: u64, timing: &'static BaudRate, own_sync: bool) {
        self.stop(now);
        self.running = Some(RunningBus { timing, own_sync, signal: signal_of(timing), start: now });
        if own_sync {
            self.schedule.set(Slot::Sync, now);
        }
        self.next = self.schedule.next();
    }

    /// Stops SYNC and all frames because the master was restarted. The drives continue by their own clocks.
    fn stop(&mut self, now: u64) {
        self.running = None;
        self.schedule.clear();
        self.schedule_own_clock(now);
        self.next = self.schedule.next();
        self.on_wire = [None; PLACES];
        self.asked = None;
        self.drive_answer = None;
        self.disturbance.forget_frames();
    }

    /// Handles the slot at `world.now`. Returns true if the slot was a SYNC edge that went out on the line.
    fn slot_due(&mut self, world: &mut World) -> bool {
        let now = world.now;
        let Some(slot) = self.schedule.take(self.next, now) else { return false };
        if slot == Slot::OwnClock {
            self.own_clock_event(now);
            self.next = self.schedule.next();
            return false;
        }
        let Some(running) = &mut self.running else { return false };
        if slot == Slot::Sync {
            running.start = now;
        }
        let (timing, own_sync, start) = (running.timing, running.own_sync, running.start);
        let World { journal, faults, edges, .. } = world;
        let mut run = Run { bus: self, now, start, timing, journal, faults, edges };
        let mut edge = false;
        match slot {
            Slot::Sync => edge = run.sync_edge(own_sync),
            Slot::ResponseStart => run.response_start(),
            Slot::ResponseEnd => run.response_end(),
            Slot::ResponseTimeout => run.response_timeout(),
            Slot::Build1 => run.build_first(),
            Slot::Built1 => run.built_first(),
            Slot::Built2 => run.built_second(),
            Slot::Reference1End => run.reference_end(Channel::One),
            Slot::BuildActual2 => run.build_actual(Channel::Two),
            Slot::Actual1End => run.actual_end(Channel::One),
            Slot::Reference2End => run.reference_end(Channel::Two),
            Slot::Actual2End => run.actual_end(Channel::Two),
            Slot::CommandStart => run.command_start(),
            Slot::CommandEnd => run.command_end(),
            Slot::Stray => run.stray_frames(),
            // This slot was handled at the beginning of the function, because it does not need a running bus.
            Slot::OwnClock => {}
        }
        self.next = self.schedule.next();
        edge
    }
}

/// One event in progress, with references to all objects that the event may change.
struct Run<'a> {
    bus: &'a mut SimBus,
    now: u64,
    start: u64,
    timing: &'static BaudRate,
    journal: &'a mut Journal,
    faults: &'a mut Faults,
    /// Ports of devices that must be notified of an edge.
    edges: &'a mut Vec<Origin>,
}

impl Run<'_> {
    fn at(&mut self, slot: Slot, offset_us: u32) {
        self.bus.schedule.set(slot, self.start + u64::from(offset_us));
    }

    /// Runs `f` on the master's firmware.
    #[inline]
    fn master<R>(&mut self, f: impl FnOnce(&mut Master, &mut Context) -> R) -> Option<R> {
        Some(self.bus.masters.first_mut()?.run(self.now, self.journal, f))
    }

    /// Runs `f` on slave node `index` if the node receives frames at the baud rate of the bus.
    #[inline]
    fn node<R>(&mut self, index: usize, f: impl FnOnce(&mut Slave, &mut Context) -> R) -> Option<R> {
        let (kbit_per_s, disturbance) = (self.timing.kbit_per_s, &self.bus.disturbance);
        let hears = |slave: &Slave| slave.hears(kbit_per_s) && !disturbance.is_off(slave.number());
        let end = self.bus.slaves.get_mut(index).filter(|end| hears(&end.firmware))?;
        Some(end.run(self.now, self.journal, f))
    }

    fn each_node(&mut self, mut f: impl FnMut(&mut Slave, &mut Context)) {
        for index in 0..self.bus.slaves.len() {
            self.node(index, &mut f);
        }
    }

    fn station(&self, number: u8) -> Station {
        let station = self.bus.stations.get(usize::from(number)).copied().unwrap_or(Station::Vacant);
        if self.bus.disturbance.is_off(number) { Station::Vacant } else { station }
    }

    /// Returns the drive at `index` if it is set to the bus's baud rate. A drive at another rate receives nothing.
    fn drive(&mut self, index: usize) -> Option<&mut Drive> {
        let kbit_s = self.timing.kbit_per_s;
        self.bus.drives.get_mut(index).filter(|drive| drive.kbit_s() == kbit_s)
    }

    /// Returns the drives that are switched on and set to the bus's baud rate.
    fn drives(&mut self) -> impl Iterator<Item = &mut Drive> {
        let (kbit_s, disturbance) = (self.timing.kbit_per_s, &self.bus.disturbance);
        let hears =
            move |drive: &&mut Drive| drive.kbit_s() == kbit_s && !disturbance.is_off(drive.slave_number());
        self.bus.drives.settle().iter_mut().filter(hears)
    }
}

/// Returns the drives of all CANsync buses in `buses`, as returned by [`Plant::buses`](crate::plant::Plant::buses).
pub fn drives(buses: &[Box<dyn Bus>]) -> impl Iterator<Item = &Drive> {
    buses.iter().filter_map(|bus| bus.as_a::<SimBus>()).flat_map(SimBus::drives)
}

/// Returns true if the node of a [`Socket`] also works without a bus: a master does, because it generates its
/// own SYNC signal.
pub(crate) fn runs_alone(socket: &dyn Any) -> bool {
    socket.downcast_ref::<Socket>().is_some_and(|socket| matches!(socket.role, SocketRole::Master { .. }))
}

/// Returns the SYNC signal of a master at this rate.
fn signal_of(timing: &BaudRate) -> SyncSignal {
    SyncSignal { interval_us: u32::from(timing.b_TIME_PATTERN) * 1000, kbit_s: timing.kbit_per_s }
}
