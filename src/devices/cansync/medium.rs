//! A simulated CANsync bus: one master, up to 32 slaves, frames in their slots.
//!
//! A frame is delivered at the end of its end-of-frame field, to everybody who listens at the bus's baud rate; the
//! next one can begin after the intermission. Its content is fixed at its start. Slot times are those of the
//! manual's table (5.00005.03a p. 125), frame lengths those of the real frames, stuff bits included. A frame that is
//! so long that it reaches into the next slot keeps that slot's frame waiting (decision D-280).

mod agenda;
mod command;
mod config;
mod disturbance;
mod fault;
mod own_clock;
mod process;
mod slots;

pub use config::BusConfig;

use crate::devices::Context;
use crate::devices::cansync::bus::{Channel, Frame, FrameLength};
use crate::devices::cansync::drive::{Drive, DriveError};
use crate::devices::cansync::firmware::{Built, Master, Slave};
use crate::devices::omega_drive_line_2::Plc;
use crate::devices::omega_drive_line_2::registers::BaudRate;
use crate::fault::Faults;
use crate::journal::{Journal, Origin};
use agenda::{Agenda, Slot};
use disturbance::Disturbance;
use own_clock::OwnClock;
use slots::{OnWire, PLACES};

/// Who is connected under a slave number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Station {
    Nobody,
    /// Index into the bus's drives.
    Drive(usize),
    /// Index of the PLC whose node 1 it is.
    Node(usize),
}

/// Who sends the frame that is on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sender {
    Master,
    Slave(u8),
}

/// The running bus: its times and what is under way.
struct Running {
    timing: &'static BaudRate,
    /// Whether the master makes the SYNC signal itself.
    own_sync: bool,
    /// The rate of the bus whose master makes the SYNC signal.
    sync_rate: &'static BaudRate,
    /// Start of the present interval.
    start: u64,
}

pub(crate) struct SimBus {
    index: u16,
    name: String,
    master: Option<usize>,
    stations: [Station; 32],
    drives: Vec<Drive>,
    /// The drives as they are at power-on.
    fresh: Vec<Drive>,
    /// Baud rate that the drives' DIP switches are set to.
    drives_kbit_s: u16,
    frame_length: FrameLength,
    /// PLCs whose node 1 is on this bus.
    nodes: Vec<usize>,
    running: Option<Running>,
    agenda: Agenda,
    next: u64,
    /// The last frame of each kind; a frame is noted when its slot is fixed, so several may be ahead.
    on_wire: [Option<OnWire>; PLACES],
    reference: [Option<Built>; 2],
    actual: [Option<Frame>; 2],
    command: Option<Frame>,
    /// Slave number that owes an answer to the last command.
    asked: Option<u8>,
    /// A drive's answer, ready for the response slot.
    drive_answer: Option<Frame>,
    response: Option<Frame>,
    disturbance: Disturbance,
    own_clock: OwnClock,
}

impl SimBus {
    /// Bus number `index` of the plant, without nodes.
    pub(crate) fn new(index: usize, config: &BusConfig) -> Result<Self, DriveError> {
        let mut bus = SimBus {
            index: index as u16,
            name: config.name.clone(),
            master: None,
            stations: [Station::Nobody; 32],
            drives: Vec::new(),
            fresh: Vec::new(),
            drives_kbit_s: config.kbit_s,
            frame_length: config.frame_length,
            nodes: Vec::new(),
            running: None,
            agenda: Agenda::empty(),
            next: Agenda::NEVER,
            on_wire: [None; PLACES],
            reference: [None; 2],
            actual: [None; 2],
            command: None,
            asked: None,
            drive_answer: None,
            response: None,
            disturbance: Disturbance::default(),
            own_clock: OwnClock::default(),
        };
        for drive in &config.drives {
            let drive = Drive::new(drive, config.kbit_s)?;
            bus.connect(drive.slave_number(), Station::Drive(bus.drives.len()));
            bus.drives.push(drive);
        }
        bus.fresh.clone_from(&bus.drives);
        Ok(bus)
    }

    /// Connects node 1 of PLC `plc` as the slave with this number.
    pub(crate) fn attach_slave(&mut self, plc: usize, number: u8) {
        self.nodes.push(plc);
        self.connect(number, Station::Node(plc));
    }

    /// Connects node 2 of PLC `plc` as the master.
    pub(crate) fn attach_master(&mut self, plc: usize) {
        self.master = Some(plc);
    }

    fn connect(&mut self, number: u8, station: Station) {
        if let Some(place) = self.stations.get_mut(usize::from(number)) {
            *place = station;
        }
    }

    /// Node 1 of PLC `plc` has another slave number; `false` if another station has it, and then the node is not
    /// connected.
    pub(crate) fn renumber(&mut self, plc: usize, number: u8) -> bool {
        for station in &mut self.stations {
            if *station == Station::Node(plc) {
                *station = Station::Nobody;
            }
        }
        match self.stations.get_mut(usize::from(number)) {
            Some(place) if *place == Station::Nobody => {
                *place = Station::Node(plc);
                true
            }
            _ => false,
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn drives(&self) -> &[Drive] {
        &self.drives
    }

    /// The PLCs on this bus, the master first.
    pub(crate) fn plcs(&self) -> impl Iterator<Item = usize> {
        self.master.into_iter().chain(self.nodes.iter().copied())
    }

    #[inline]
    pub(crate) fn next_time(&self) -> u64 {
        self.next
    }

    /// The next SYNC edge, if the master of this bus makes the signal itself.
    pub(crate) fn next_sync(&self) -> Option<u64> {
        self.running.as_ref().filter(|running| running.own_sync)?;
        self.agenda.at(Slot::Sync)
    }

    /// Baud rate of the running bus in kbit/s.
    pub(crate) fn kbit_s(&self) -> Option<u16> {
        self.running.as_ref().map(|running| running.timing.kbit_per_s)
    }

    /// What the controller of `node` is doing: `Some(true)` sending, `Some(false)` receiving.
    pub(crate) fn on_wire(&self, now: u64, node: Origin) -> Option<bool> {
        let wire = self.on_wire.iter().flatten().find(|wire| (wire.from..wire.until).contains(&now))?;
        if node.node == 1 && self.is_off(node.plc.into()) {
            return None;
        }
        Some(match wire.sender {
            Sender::Master => node.node == 2,
            Sender::Slave(number) => {
                node.node == 1
                    && self.stations.get(usize::from(number)) == Some(&Station::Node(usize::from(node.plc)))
            }
        })
    }

    /// Whether the plug of PLC `plc`'s node 1 is pulled.
    fn is_off(&self, plc: usize) -> bool {
        let number = self.stations.iter().position(|station| *station == Station::Node(plc));
        number.is_some_and(|number| self.disturbance.is_off(number as u8)) // at most 31
    }

    /// The master starts synchronous operation; with its own SYNC signal the first edge comes at once.
    pub(crate) fn start(&mut self, now: u64, timing: &'static BaudRate, own_sync: bool) {
        self.stop(now);
        self.running = Some(Running { timing, own_sync, sync_rate: timing, start: now });
        if own_sync {
            self.agenda.set(Slot::Sync, now);
        }
        self.next = self.agenda.next_time();
    }

    /// The master was restarted: no more SYNC, no more frames. The drives go on by their own clocks.
    pub(crate) fn stop(&mut self, now: u64) {
        self.running = None;
        self.agenda.clear();
        self.schedule_own_clock(now);
        self.next = self.agenda.next_time();
        self.on_wire = [None; PLACES];
        self.asked = None;
        self.drive_answer = None;
        self.disturbance.forget_frames();
    }

    /// The rate of the bus whose master makes the SYNC signal of this running bus.
    pub(crate) fn sync_rate(&self) -> Option<&'static BaudRate> {
        self.running.as_ref().map(|running| running.sync_rate)
    }

    /// A SYNC edge of the upper bus arrives at a master that forwards it; `rate` is the signal's.
    pub(crate) fn forwarded_edge(&mut self, now: u64, rate: &'static BaudRate) {
        if let Some(running) = self.running.as_mut().filter(|running| !running.own_sync) {
            running.sync_rate = rate;
            self.agenda.set(Slot::Sync, now);
            self.next = self.agenda.next_time();
        }
    }

    /// Handles the slot that is due at `now`; tells whether it was a SYNC edge that went out on the line.
    pub(crate) fn event(
        &mut self,
        now: u64,
        plcs: &mut [Plc],
        journal: &mut Journal,
        faults: &mut Faults,
    ) -> bool {
        let Some(slot) = self.agenda.take(now) else { return false };
        if slot == Slot::OwnClock {
            self.own_clock_event(now);
            self.next = self.agenda.next_time();
            return false;
        }
        let Some(running) = &mut self.running else { return false };
        if slot == Slot::Sync {
            running.start = now;
        }
        let (timing, own_sync, start) = (running.timing, running.own_sync, running.start);
        let mut run = Run { bus: self, now, start, timing, plcs, journal, faults };
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
            // Needs no running bus; see above.
            Slot::OwnClock => {}
        }
        self.next = self.agenda.next_time();
        edge
    }
}

/// One event in progress, with everything it may touch.
struct Run<'a> {
    bus: &'a mut SimBus,
    now: u64,
    start: u64,
    timing: &'static BaudRate,
    plcs: &'a mut [Plc],
    journal: &'a mut Journal,
    faults: &'a mut Faults,
}

impl Run<'_> {
    fn at(&mut self, slot: Slot, offset_us: u32) {
        self.bus.agenda.set(slot, self.start + u64::from(offset_us));
    }

    /// Runs `f` on the master's firmware.
    fn master<R>(&mut self, f: impl FnOnce(&mut Master, &mut Context) -> R) -> Option<R> {
        let index = self.bus.master?;
        let plc = self.plcs.get_mut(index)?;
        let origin = Origin { plc: index as u16, node: 2 };
        let base = plc.seats[1].base;
        Some(f(&mut plc.master, &mut Context { now: self.now, journal: self.journal, origin, base }))
    }

    /// Runs `f` on the slave node of PLC `index`, if it listens.
    fn node<R>(&mut self, index: usize, f: impl FnOnce(&mut Slave, &mut Context) -> R) -> Option<R> {
        let (kbit_per_s, disturbance) = (self.timing.kbit_per_s, &self.bus.disturbance);
        let hears = |slave: &Slave| slave.hears(kbit_per_s) && !disturbance.is_off(slave.number());
        let plc = self.plcs.get_mut(index).filter(|plc| hears(&plc.slave))?;
        let origin = Origin { plc: index as u16, node: 1 };
        let base = plc.seats[0].base;
        Some(f(&mut plc.slave, &mut Context { now: self.now, journal: self.journal, origin, base }))
    }

    fn each_node(&mut self, mut f: impl FnMut(&mut Slave, &mut Context)) {
        for position in 0..self.bus.nodes.len() {
            let index = self.bus.nodes[position];
            self.node(index, &mut f);
        }
    }

    fn station(&self, number: u8) -> Station {
        let station = self.bus.stations.get(usize::from(number)).copied().unwrap_or(Station::Nobody);
        if self.bus.disturbance.is_off(number) { Station::Nobody } else { station }
    }

    /// The drive at `index`, if it is set to the bus's baud rate; otherwise it hears nothing.
    fn drive(&mut self, index: usize) -> Option<&mut Drive> {
        if self.bus.drives_kbit_s == self.timing.kbit_per_s { self.bus.drives.get_mut(index) } else { None }
    }

    /// The drives, if they are set to the bus's baud rate, but for those that are off.
    fn drives(&mut self) -> impl Iterator<Item = &mut Drive> {
        let hear = self.bus.drives_kbit_s == self.timing.kbit_per_s;
        let drives = if hear { &mut self.bus.drives[..] } else { &mut [] };
        let disturbance = &self.bus.disturbance;
        drives.iter_mut().filter(|drive| !disturbance.is_off(drive.slave_number()))
    }
}
