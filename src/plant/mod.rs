//! A whole installation: PLCs with their communication RAM, drives, the buses between them, one clock.
//!
//! [`Plant::advance_to`] is the only thing that makes anything happen. Same plant and same register
//! writes at the same emulated times give the same journal, byte for byte.

mod boards;
mod config;
mod force;
mod injection;

pub use crate::devices::cansync::medium::BusConfig;
pub use crate::devices::omega_drive_line_2::board::Power;
pub use crate::devices::omega_drive_line_2::{Plc, PlcConfig, ProjectConfig};
pub use config::{PlantConfig, PlantError};
pub use force::{ForceError, Forced};

use crate::check::Checker;
use crate::devices::BuildError;
use crate::devices::cansync::medium::SimBus;
use crate::devices::omega_drive_line_2::baps::Baps;
use crate::devices::omega_drive_line_2::registers::ETHERNET_CONFIG;
use crate::fault::Faults;
use crate::journal::{Event, Journal, Names};
use crate::memory::{MemoryError, Segment};
use force::Forces;

/// Everything that is simulated, with its clock and its journal.
pub struct Plant {
    now: u64,
    next_cycle: u64,
    /// The next BAPS time slice of any PLC.
    next_slice: u64,
    cycle_us: u64,
    /// When the next timer of a board is due.
    next_timer: u64,
    /// Whether a watched event is to stop [`Plant::advance_until`].
    watching: bool,
    plcs: Vec<Plc>,
    buses: Vec<SimBus>,
    journal: Journal,
    forces: Forces,
    faults: Faults,
    checker: Checker,
}

impl Plant {
    /// Builds and powers on the plant. `segment` supplies the RAM of each PLC by its name: heap or image.
    ///
    /// # Errors
    /// If the configuration is refused, or if a segment cannot be had or is too small.
    pub fn new<E>(
        config: &PlantConfig,
        mut segment: impl FnMut(&str) -> Result<Segment, E>,
    ) -> Result<Self, E>
    where
        E: From<MemoryError> + From<PlantError>,
    {
        config.check()?;
        let bus_index = |name: &Option<String>| {
            let name = name.as_ref()?;
            config.buses.iter().position(|bus| bus.name == *name)
        };
        let mut plcs = Vec::with_capacity(config.plcs.len());
        for plc in &config.plcs {
            let buses = [bus_index(&plc.node1), bus_index(&plc.node2)];
            plcs.push(Plc::new(plc, buses, segment(&plc.name)?).map_err(refused::<E>)?);
        }
        let mut buses = Vec::with_capacity(config.buses.len());
        for (index, bus) in config.buses.iter().enumerate() {
            buses.push(SimBus::new(index, bus).map_err(PlantError::from)?);
        }
        for (index, plc) in config.plcs.iter().enumerate() {
            if let Some(bus) = bus_index(&plc.node1).and_then(|bus| buses.get_mut(bus)) {
                bus.attach_slave(index, plc.dip);
            }
            if let Some(bus) = bus_index(&plc.node2).and_then(|bus| buses.get_mut(bus)) {
                bus.attach_master(index);
            }
        }
        let cycle_us = u64::from(config.processor_cycle_us.max(1));
        let mut journal = Journal::default();
        for (index, plc) in plcs.iter_mut().enumerate() {
            plc.power_on(index, 0, &mut buses, &mut journal);
        }
        let checker = Checker::new(plcs.iter().map(Plc::segment))?;
        let mut plant = Plant {
            now: 0,
            next_cycle: cycle_us,
            next_slice: Baps::NEVER,
            cycle_us,
            next_timer: u64::MAX,
            watching: false,
            plcs,
            buses,
            journal,
            checker,
            forces: Forces::default(),
            faults: Faults::default(),
        };
        plant.find_next_timer();
        for fault in config.resolved_faults()? {
            // Checked a moment ago, and there is room for all of them.
            let _ = plant.add_fault(fault);
        }
        Ok(plant)
    }

    /// Emulated time in microseconds since power-on.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// When the next event is due; there always is one, the next processor cycle at the latest.
    pub fn next_event(&self) -> u64 {
        let first = self.next_cycle.min(self.next_slice).min(self.next_timer).min(self.faults.next_time());
        self.buses.iter().map(SimBus::next_time).fold(first, u64::min)
    }

    /// Lets emulated time pass until `time`, handling everything that falls due on the way, events at
    /// `time` itself included. A time in the past changes nothing.
    pub fn advance_to(&mut self, time: u64) {
        while self.advance_until(time) {}
    }

    /// As [`Plant::advance_to`], but stops early as soon as an event has occurred that somebody watches
    /// ([`Plant::watch`]), and then returns `true`. What is due at the same moment after the event is left for the
    /// next call.
    pub fn advance_until(&mut self, time: u64) -> bool {
        self.look_for_writes();
        let mut has_run = false;
        let mut stopped = false;
        while !stopped {
            // At the same moment faults come first, then the processor cycle, then the BAPS, then timers, then the
            // buses in plant order.
            let mut due = self.next_cycle;
            let mut which = Due::Cycle;
            if self.next_slice < due {
                (due, which) = (self.next_slice, Due::Slice);
            }
            if self.next_timer < due {
                (due, which) = (self.next_timer, Due::Timer);
            }
            for (index, bus) in self.buses.iter().enumerate() {
                if bus.next_time() < due {
                    (due, which) = (bus.next_time(), Due::Bus(index));
                }
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
            has_run = true;
            match which {
                Due::Cycle => {
                    self.next_cycle += self.cycle_us;
                    self.run_cycle();
                    self.journal.tick(due);
                }
                Due::Slice => {
                    self.forces.apply(&self.plcs);
                    self.time_slices();
                    self.forces.apply(&self.plcs);
                }
                Due::Timer => self.timers_due(),
                Due::Bus(index) => {
                    self.forces.apply(&self.plcs);
                    self.bus_event(index);
                    self.forces.apply(&self.plcs);
                }
            }
            stopped = self.watching && self.take_stop();
        }
        self.pass_to(if stopped { self.now } else { time });
        if has_run {
            self.leave();
        }
        stopped
    }

    /// Lets time pass in which nothing is due ([`Plant::next_event`]): cheaper than [`Plant::advance_to`], which judges
    /// what was written before. A time in the past changes nothing.
    #[inline]
    pub fn pass_to(&mut self, time: u64) {
        self.now = self.now.max(time);
        for plc in &self.plcs {
            plc.show_time(self.now);
        }
        self.checker.show_time(self.now);
    }

    /// What others have written since the firmware last ran is judged before it runs again.
    #[inline]
    fn look_for_writes(&mut self) {
        self.checker.look(self.now, self.plcs.iter().map(Plc::facts), &mut self.journal);
    }

    /// The firmware has run: from now on, others write.
    #[inline]
    fn leave(&mut self) {
        self.checker.leave(self.plcs.iter().map(Plc::facts));
    }

    /// Which events of PLC `plc` stop [`Plant::advance_until`], bit n for event n.
    pub fn watch(&mut self, plc: usize, events: u16) {
        if let Some(plc) = self.plcs.get_mut(plc) {
            plc.watch(events);
        }
        self.watching = self.plcs.iter().any(Plc::is_watched);
    }

    /// Whether a watched event has occurred; all PLCs are asked, so that none is left to stop the next call.
    fn take_stop(&mut self) -> bool {
        self.plcs.iter_mut().fold(false, |stop, plc| stop | plc.board.take_stop())
    }

    #[cold]
    fn timers_due(&mut self) {
        for plc in &mut self.plcs {
            if plc.board.next_time() == self.now {
                plc.timers_due(self.now);
            }
        }
        self.find_next_timer();
        self.find_next_slice();
    }

    fn find_next_timer(&mut self) {
        self.next_timer = self.plcs.iter().map(|plc| plc.board.next_time()).fold(u64::MAX, u64::min);
    }

    /// One look of all boards at their switches and of all nodes at their control registers at the present time:
    /// what a rung doorbell asks for. Does not shift the regular processor cycle.
    pub fn processor_cycle(&mut self) {
        self.look_for_writes();
        self.run_cycle();
        self.leave();
    }

    fn run_cycle(&mut self) {
        self.look_at_requests();
        self.forces.apply(&self.plcs);
        if !self.faults.is_empty() {
            self.strike_controllers();
        }
        for index in 0..self.plcs.len() {
            self.plcs[index].processor_cycle(index, self.now, &mut self.buses, &mut self.journal);
        }
        self.forces.apply(&self.plcs);
        self.find_next_slice();
    }

    /// The BAPS time slices that are due now.
    fn time_slices(&mut self) {
        let Plant { now, plcs, journal, faults, .. } = self;
        for (index, plc) in plcs.iter_mut().enumerate() {
            if plc.baps.next_time() == *now {
                let pace =
                    |journal: &mut Journal, has_waited| faults.baps_pace(*now, index, has_waited, journal);
                plc.time_slice(index, *now, journal, pace);
            }
        }
        self.find_next_slice();
    }

    #[inline]
    fn find_next_slice(&mut self) {
        self.next_slice = self.plcs.iter().map(|plc| plc.baps.next_time()).fold(Baps::NEVER, u64::min);
    }

    /// Whether a PLC has written a `w_CPU_CONTROL`, or turned a switch of its board, that the firmware has not
    /// looked at yet.
    pub fn control_changed(&self) -> bool {
        self.plcs.iter().any(Plc::control_changed)
    }

    fn bus_event(&mut self, index: usize) {
        let Some(bus) = self.buses.get_mut(index) else { return };
        let edge = bus.event(self.now, &mut self.plcs, &mut self.journal, &mut self.faults);
        if edge {
            self.forward_sync(index);
            self.note_slices(index);
            let Plant { now, plcs, journal, checker, .. } = self;
            let concerns =
                |plc: usize, node| plcs.get(plc).is_some_and(|plc| plc.bus_of(node) == Some(index));
            checker.sync_edge(*now, plcs.iter().map(Plc::facts), concerns, journal);
        }
    }

    /// A SYNC edge may have begun or moved time slices of the PLCs on the bus. One that has moved on is looked for too
    /// early then, which does no harm.
    fn note_slices(&mut self, bus: usize) {
        for plc in self.buses.get(bus).into_iter().flat_map(SimBus::plcs) {
            if let Some(plc) = self.plcs.get(plc) {
                self.next_slice = self.next_slice.min(plc.baps.next_time());
            }
        }
    }

    /// Passes a SYNC edge on to the buses whose masters take it over from this one (decision D-12).
    fn forward_sync(&mut self, from: usize) {
        let Some(rate) = self.buses.get(from).and_then(SimBus::sync_rate) else { return };
        for (index, plc) in self.plcs.iter_mut().enumerate() {
            if !plc.takes_sync_from(from) {
                continue;
            }
            plc.passes_sync_on(index, self.now, rate, &mut self.journal);
            if let Some(bus) = plc.bus_of(2).and_then(|bus| self.buses.get_mut(bus)) {
                bus.forwarded_edge(self.now, rate);
            }
        }
    }

    /// The PLCs, in the order of the plant file.
    pub fn plcs(&self) -> &[Plc] {
        &self.plcs
    }

    /// Names of the buses, in the order of the plant file.
    pub fn bus_names(&self) -> impl Iterator<Item = &str> {
        self.buses.iter().map(SimBus::name)
    }

    /// Names of PLCs and buses, for reading the journal.
    pub fn names(&self) -> Names {
        Names {
            plcs: self.plcs.iter().map(|plc| plc.name().to_owned()).collect(),
            buses: self.bus_names().map(str::to_owned).collect(),
        }
    }

    /// The drives of all buses.
    pub fn drives(&self) -> impl Iterator<Item = &crate::devices::cansync::drive::Drive> {
        self.buses.iter().flat_map(SimBus::drives)
    }

    /// Emulated time of the next SYNC edge on the bus at node `node` (1 or 2) of PLC `plc`; `None` while
    /// there is no SYNC signal.
    pub fn next_sync(&self, plc: usize, node: u8) -> Option<u64> {
        let mut bus = self.plcs.get(plc)?.bus_of(node)?;
        // Follow a forwarded signal to the master that makes it; the number of buses bounds the way.
        for _ in 0..=self.buses.len() {
            if let Some(time) = self.buses.get(bus)?.next_sync() {
                return Some(time);
            }
            bus = self.plcs.iter().find_map(|plc| plc.sync_source_of(bus))?;
        }
        None
    }

    /// The journal.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Forgets what the access checker has found.
    pub fn clear_findings(&mut self) {
        self.journal.clear_findings();
    }

    /// Notes a register write that came through the channel.
    pub fn note_channel_write(&mut self, plc: usize, offset: u32, width: u8, value: u32) {
        self.forces.apply(&self.plcs);
        self.journal.push(self.now, Event::ChannelWrite { plc: plc as u16, offset, width, value });
        if offset == ETHERNET_CONFIG as u32 {
            self.look_for_writes();
            if let Some(it) = self.plcs.get_mut(plc) {
                it.ip_config_written(plc, self.now, &mut self.journal);
            }
            self.leave();
        }
        if let Some(it) = self.plcs.get(plc) {
            it.named(offset, width.into());
            let facts = it.facts();
            self.checker.written(plc, offset, width, self.now, &facts, &mut self.journal);
        }
    }
}

fn refused<E: From<MemoryError> + From<PlantError>>(error: BuildError) -> E {
    match error {
        BuildError::Memory(error) => error.into(),
        BuildError::Drive(error) => PlantError::from(error).into(),
    }
}

/// What is due next.
enum Due {
    Cycle,
    Slice,
    Timer,
    Bus(usize),
}
