//! A whole installation: PLCs with their communication RAM, drives, the buses between them, one clock.
//!
//! [`Plant::advance_to`] is the only thing that makes anything happen. Same plant and same register
//! writes at the same emulated times give the same journal, byte for byte.

mod agenda;
mod bus;
mod config;
mod plc;

pub use config::{BusConfig, PlantConfig, PlantError, PlcConfig};
pub use plc::Plc;

use crate::journal::{Event, Journal, Names};
use crate::memory::{MemoryError, Segment};
use bus::SimBus;

/// Everything that is simulated, with its clock and its journal.
pub struct Plant {
    now: u64,
    next_cycle: u64,
    cycle_us: u64,
    plcs: Vec<Plc>,
    buses: Vec<SimBus>,
    journal: Journal,
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
            plcs.push(Plc::new(plc, buses, segment(&plc.name)?)?);
        }
        let mut buses = Vec::with_capacity(config.buses.len());
        for (index, bus) in config.buses.iter().enumerate() {
            buses.push(SimBus::new(config, index, bus)?);
        }
        let cycle_us = u64::from(config.processor_cycle_us.max(1));
        let mut plant =
            Plant { now: 0, next_cycle: cycle_us, cycle_us, plcs, buses, journal: Journal::default() };
        for plc in &mut plant.plcs {
            plc.power_on();
        }
        Ok(plant)
    }

    /// Emulated time in microseconds since power-on.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// When the next event is due; there always is one, the next processor cycle at the latest.
    pub fn next_event(&self) -> u64 {
        self.buses.iter().map(SimBus::next_time).fold(self.next_cycle, u64::min)
    }

    /// Lets emulated time pass until `time`, handling everything that falls due on the way, events at
    /// `time` itself included. A time in the past changes nothing.
    pub fn advance_to(&mut self, time: u64) {
        loop {
            // At the same moment the processor cycle comes before the bus, buses in plant order.
            let mut due = self.next_cycle;
            let mut which = None;
            for (index, bus) in self.buses.iter().enumerate() {
                if bus.next_time() < due {
                    (due, which) = (bus.next_time(), Some(index));
                }
            }
            if due > time {
                break;
            }
            self.now = due;
            match which {
                None => {
                    self.next_cycle += self.cycle_us;
                    self.processor_cycle();
                    self.journal.tick(due);
                }
                Some(index) => self.bus_event(index),
            }
        }
        self.now = self.now.max(time);
        for plc in &self.plcs {
            plc.show_time(self.now);
        }
    }

    /// One look of all nodes at their control registers at the present time: what a rung doorbell asks
    /// for. Does not shift the regular processor cycle.
    pub fn processor_cycle(&mut self) {
        for index in 0..self.plcs.len() {
            self.plcs[index].processor_cycle(index, self.now, &mut self.buses, &mut self.journal);
        }
    }

    /// Whether a PLC has written a `w_CPU_CONTROL` that the firmware has not looked at yet.
    pub fn control_changed(&self) -> bool {
        self.plcs.iter().any(Plc::control_changed)
    }

    fn bus_event(&mut self, index: usize) {
        let Some(bus) = self.buses.get_mut(index) else { return };
        let edge = bus.event(self.now, &mut self.plcs, &mut self.journal);
        if edge {
            self.forward_sync(index);
        }
    }

    /// Passes a SYNC edge on to the buses whose masters take it over from this one (decision D-12).
    fn forward_sync(&mut self, from: usize) {
        for plc in &self.plcs {
            if let Some(to) = plc.forwards_sync_from(from)
                && let Some(bus) = self.buses.get_mut(to)
            {
                bus.forwarded_edge(self.now);
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
    pub fn drives(&self) -> impl Iterator<Item = &crate::drive::Drive> {
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

    /// Notes a register write that came through the channel.
    pub fn note_channel_write(&mut self, plc: usize, offset: u32, width: u8, value: u32) {
        self.journal.push(self.now, Event::ChannelWrite { plc: plc as u16, offset, width, value });
    }
}
