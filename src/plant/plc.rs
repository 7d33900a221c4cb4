//! One PLC: its communication RAM, its two CANsync nodes, its board.

use super::bus::SimBus;
use super::config::PlcConfig;
use crate::firmware::Context;
use crate::firmware::cansync::{Change, Master, Slave};
use crate::journal::{Event, Journal, Origin};
use crate::memory::{Header, MemoryError, Segment, View};

/// A PLC of the plant.
pub struct Plc {
    name: String,
    dip: u8,
    segment: Segment,
    header: View<Header>,
    pub(super) slave: Slave,
    pub(super) master: Master,
    /// Index of the bus at node 1.
    bus1: Option<usize>,
    /// Index of the bus at node 2.
    bus2: Option<usize>,
}

impl Plc {
    /// The PLC with the indices of the buses at its nodes 1 and 2.
    pub(super) fn new(
        config: &PlcConfig,
        [bus1, bus2]: [Option<usize>; 2],
        segment: Segment,
    ) -> Result<Self, MemoryError> {
        Ok(Plc {
            name: config.name.clone(),
            dip: config.dip,
            header: segment.header()?,
            slave: Slave::new(&segment, config.dip, config.lock_time_us)?,
            master: Master::new(&segment)?,
            segment,
            bus1,
            bus2,
        })
    }

    pub(super) fn power_on(&mut self) {
        self.header.board.dip.store(u32::from(self.dip));
        self.slave.power_on();
        self.master.power_on(self.dip);
    }

    /// The PLC's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number set at the DIP switches, 0..=31.
    pub fn dip(&self) -> u8 {
        self.dip
    }

    /// The communication RAM.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Bus index at node 1 or 2.
    pub(super) fn bus_of(&self, node: u8) -> Option<usize> {
        match node {
            1 => self.bus1,
            2 => self.bus2,
            _ => None,
        }
    }

    /// The bus that gets its SYNC signal from `bus` through this PLC.
    pub(super) fn forwards_sync_from(&self, bus: usize) -> Option<usize> {
        (self.bus1 == Some(bus) && self.master.is_on_bus() && self.master.forwards_sync())
            .then_some(self.bus2)
            .flatten()
    }

    /// The bus whose SYNC signal this PLC passes on to `bus`.
    pub(super) fn sync_source_of(&self, bus: usize) -> Option<usize> {
        self.bus1.filter(|upper| self.forwards_sync_from(*upper) == Some(bus))
    }

    pub(super) fn control_changed(&self) -> bool {
        self.slave.control_changed() || self.master.control_changed()
    }

    pub(super) fn show_time(&self, now: u64) {
        self.header.virtual_time_us.store(now);
    }

    pub(super) fn count_sync(&self, node: u8) {
        self.header.sync_counter[usize::from(node == 2)].increment();
    }

    pub(super) fn processor_cycle(
        &mut self,
        index: usize,
        now: u64,
        buses: &mut [SimBus],
        journal: &mut Journal,
    ) {
        let origin = |node| Origin { plc: index as u16, node };
        let wire = |bus: Option<usize>, node| bus.and_then(|bus| buses.get(bus)?.on_wire(now, origin(node)));
        let (wire1, wire2) = (wire(self.bus1, 1), wire(self.bus2, 2));

        let mut ctx = Context { now, journal, origin: origin(1) };
        let change = self.slave.processor_cycle(&mut ctx, wire1);
        if change == Change::SetUpStarted {
            self.report_mismatch(&mut ctx, buses);
        }
        ctx.origin = origin(2);
        let change = self.master.processor_cycle(&mut ctx, wire2);
        let Some(bus) = self.bus2.and_then(|bus| buses.get_mut(bus)) else { return };
        match change {
            Change::SetUpStarted => {
                if let Some(timing) = self.master.timing() {
                    bus.start(now, timing, !self.master.forwards_sync());
                }
            }
            Change::Restarted => bus.stop(),
            Change::None | Change::Progressed | Change::Enabled | Change::Disabled => {}
        }
    }

    fn report_mismatch(&self, ctx: &mut Context, buses: &[SimBus]) {
        let bus = self.bus1.and_then(|bus| buses.get(bus)).and_then(SimBus::kbit_s);
        if let (Some(bus_kbit_s), Some(timing)) = (bus, self.slave.timing())
            && bus_kbit_s != timing.kbit_per_s
        {
            let (origin, node_kbit_s) = (ctx.origin, timing.kbit_per_s);
            ctx.report(Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s });
        }
    }
}
