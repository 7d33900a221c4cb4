//! One PLC: its communication RAM, its two CANsync nodes, its board, the drive that it is built into.

use super::config::PlcConfig;
use crate::check::{Facts, Rule};
use crate::devices::cansync::bus::SyncLock;
use crate::devices::cansync::drive::BuiltInDrive;
use crate::devices::cansync::firmware::{Change, Master, Seat, Slave};
use crate::devices::cansync::medium::SimBus;
use crate::devices::omega_drive_line_2::baps::{Baps, Pace};
use crate::devices::omega_drive_line_2::board::{Board, Look, Power};
use crate::devices::omega_drive_line_2::ethernet::{Ethernet, Stored};
use crate::devices::omega_drive_line_2::registers::{BAPS, BaudRate, CANsync_INIT_BMSTRUCT, NODE1, NODE2};
use crate::devices::{BuildError, Context};
use crate::journal::{BAPS_NODE, BoardEvent, Event, Journal, Origin};
use crate::layout::Live;
use crate::layout::flags::{RETAIN_OFFSET, is_flag};
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Header, Segment, View, Width};
use core::mem::offset_of;

/// A PLC of the plant.
pub struct Plc {
    name: String,
    lock: SyncLock,
    segment: Segment,
    header: View<Header>,
    /// Where nodes 1 and 2 are.
    pub(crate) seats: [Seat; 2],
    pub(crate) slave: Slave,
    pub(crate) master: Master,
    pub(crate) baps: Baps,
    pub(crate) board: Board,
    ethernet: Ethernet,
    watched: bool,
    /// Index of the bus at node 1.
    bus1: Option<usize>,
    /// Index of the bus at node 2.
    bus2: Option<usize>,
}

impl Plc {
    /// The PLC with the indices of the buses at its nodes 1 and 2.
    pub(crate) fn new(
        config: &PlcConfig,
        [bus1, bus2]: [Option<usize>; 2],
        segment: Segment,
    ) -> Result<Self, BuildError> {
        let drive = BuiltInDrive::new(&config.name, &config.drive)?;
        let lock = SyncLock::new(config.lock_time_us, config.sync_loss_us);
        let header = segment.header()?;
        let seats = [Seat { base: NODE1, place: 0 }, Seat { base: NODE2, place: 1 }];
        header.board.dip.store(u32::from(config.dip));
        header.retain_offset.store(RETAIN_OFFSET);
        header.retain_size.store(config.retain_bytes);
        Ok(Plc {
            name: config.name.clone(),
            lock,
            header,
            slave: Slave::new(&segment, seats[0], config.dip, lock)?,
            master: Master::new(&segment, seats[1])?,
            seats,
            baps: Baps::new(&segment, drive, &config.drive)?,
            board: Board::new(&segment, config.option_sync_us, config.project.into())?,
            ethernet: Ethernet::new(&segment, config.ethernet_mbit)?,
            watched: false,
            segment,
            bus1,
            bus2,
        })
    }

    pub(crate) fn power_on(&mut self, index: usize, now: u64, buses: &mut [SimBus], journal: &mut Journal) {
        let mut ctx = Context { now, journal, origin: Origin { plc: index as u16, node: 1 }, base: NODE1 };
        let dip = self.board.start(&mut ctx);
        self.ethernet.power_on(&mut ctx, dip);
        if dip != self.slave.number() {
            self.change_number(index, dip, &mut ctx, buses);
        }
        self.slave.power_on();
        self.master.power_on(dip);
        self.baps.power_on();
    }

    /// The DIP switches were turned before the restart: node 1 is another slave now.
    fn change_number(&mut self, index: usize, dip: u8, ctx: &mut Context, buses: &mut [SimBus]) {
        let bus = self.bus1.and_then(|bus| buses.get_mut(bus));
        if bus.is_some_and(|bus| !bus.renumber(index, dip)) {
            let (plc, what) = (index as u16, BoardEvent::NumberTaken { number: dip });
            ctx.report(Event::Board { plc, what });
        }
        // The segment was large enough before.
        if let Ok(slave) = Slave::new(&self.segment, self.seats[0], dip, self.lock) {
            self.slave = slave;
        }
    }

    /// Power-off or reset: both nodes leave their buses, that of the master stops. The drive notices nothing but
    /// that nobody asks for anything any more.
    fn go_down(&mut self, index: usize, now: u64, buses: &mut [SimBus], journal: &mut Journal) {
        self.board.stop();
        self.ethernet.power_off();
        let mut ctx = Context { now, journal, origin: Origin { plc: index as u16, node: 1 }, base: NODE1 };
        ctx.report(Event::Board { plc: index as u16, what: BoardEvent::Down });
        self.slave.power_off(&mut ctx);
        (ctx.origin.node, ctx.base) = (2, NODE2);
        self.master.power_off(&mut ctx);
        self.baps.reset();
        if let Some(bus) = self.bus2.and_then(|bus| buses.get_mut(bus)) {
            bus.stop(now);
        }
        // Their RAM and all that they knew is gone.
        let number = self.slave.number();
        if let (Ok(slave), Ok(master)) = (
            Slave::new(&self.segment, self.seats[0], number, self.lock),
            Master::new(&self.segment, self.seats[1]),
        ) {
            (self.slave, self.master) = (slave, master);
        }
    }

    /// Switches power or RESET, as if somebody had turned the switch.
    pub(crate) fn set_power(
        &mut self,
        power: Power,
        index: usize,
        now: u64,
        buses: &mut [SimBus],
        journal: &mut Journal,
    ) {
        let look = self.board.set_power(power);
        self.follow(look, index, now, buses, journal);
    }

    /// One look at the board. Tells whether timers may run otherwise than before.
    #[inline]
    pub(crate) fn look_at_board(
        &mut self,
        index: usize,
        now: u64,
        buses: &mut [SimBus],
        journal: &mut Journal,
    ) -> bool {
        let mut ctx = Context { now, journal, origin: Origin { plc: index as u16, node: 1 }, base: NODE1 };
        let look = self.board.look(&mut ctx);
        self.follow(look, index, now, buses, journal);
        look != Look::Nothing
    }

    fn follow(&mut self, look: Look, index: usize, now: u64, buses: &mut [SimBus], journal: &mut Journal) {
        match look {
            Look::Nothing | Look::Answered => {}
            Look::Held => self.go_down(index, now, buses, journal),
            Look::Off => {
                if self.board.is_up() {
                    self.go_down(index, now, buses, journal);
                }
                self.baps.power_off();
            }
            Look::Up => self.power_on(index, now, buses, journal),
        }
    }

    /// The PLC's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number set at the DIP switches, 0..=31, as read at the last power-on or reset.
    pub fn dip(&self) -> u8 {
        self.board.dip()
    }

    /// The Ethernet configuration that NOVRAM holds, and a number that changes with it.
    pub fn ethernet_config(&self) -> (&Stored, u32) {
        self.ethernet.stored()
    }

    /// What stands in the NOVRAM registers counts as stored, as at power-off.
    pub(crate) fn keep_ethernet_config(&mut self) {
        self.ethernet.keep();
    }

    /// `d_IP_CONFIG` was written through the channel, where also an unchanged value is seen.
    pub(crate) fn ip_config_written(&mut self, index: usize, now: u64, journal: &mut Journal) {
        if self.board.is_up() {
            let origin = Origin { plc: index as u16, node: 1 };
            self.ethernet.take(&mut Context { now, journal, origin, base: 0 });
        }
    }

    /// The board as it stands.
    pub fn board(&self) -> BoardState {
        BoardState::of(&self.header)
    }

    /// Turns a switch in the header page or puts in a request, as a client does. The next look at the boards sees it.
    pub(crate) fn turn(&self, setting: BoardSetting) {
        match setting {
            BoardSetting::Dip(number) => self.header.board.dip.store(number.into()),
            BoardSetting::Leds(leds) => self.header.board.leds.store(leds.into()),
            BoardSetting::Switch(switch) => self.header.board.switch.store(switch.code()),
            BoardSetting::Power(power) => self.header.program.power.store(power.code()),
            BoardSetting::Start(start) => {
                self.header.program.start_request.store(start.code());
                self.header.board_requests.increment();
            }
            BoardSetting::Project(project) => {
                self.header.project_request.store(project.code() + 1);
                self.header.board_requests.increment();
            }
            BoardSetting::Reset | BoardSetting::PowerCycle => {}
        }
    }

    /// `bytes` bytes at `offset` were written by somebody who named the place. If that is a `w_CPU_CONTROL`, 16#0000
    /// in it is a restart, even if it stood there before (decision D-29).
    pub(crate) fn named(&self, offset: u32, bytes: u32) {
        for (restarts, node) in self.header.restarts_written.iter().zip(self.seats) {
            let register = node.base as u32;
            let is_hit = offset < register + 2 && register < offset + bytes;
            if is_hit && self.segment.load(register, Width::Word).is_ok_and(|value| value == 0) {
                restarts.increment();
            }
        }
    }

    /// Whether an access in the right area meets something that this PLC has: it may have fewer retain flags than fit.
    pub(crate) fn has(&self, offset: u32, width: Width) -> bool {
        let end = RETAIN_OFFSET.saturating_add(self.header.retain_size.load());
        !is_flag(offset) || u64::from(offset) + u64::from(width.bytes()) <= end.into()
    }

    /// The communication RAM.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The BAPS with the drive behind it.
    pub fn baps(&self) -> &Baps {
        &self.baps
    }

    /// Bus index at node 1 or 2.
    pub(crate) fn bus_of(&self, node: u8) -> Option<usize> {
        match node {
            1 => self.bus1,
            2 => self.bus2,
            _ => None,
        }
    }

    /// Whether this PLC's master takes its SYNC signal from `bus`.
    #[inline]
    pub(crate) fn takes_sync_from(&self, bus: usize) -> bool {
        self.bus1 == Some(bus) && self.master.is_on_bus() && self.master.forwards_sync()
    }

    /// The master passes an edge on, of a signal that belongs to `rate`.
    #[inline]
    pub(crate) fn passes_sync_on(
        &mut self,
        index: usize,
        now: u64,
        rate: &'static BaudRate,
        journal: &mut Journal,
    ) {
        let origin = Origin { plc: index as u16, node: 2 };
        self.master.passes_sync_on(&mut Context { now, journal, origin, base: NODE2 }, rate);
    }

    /// The bus whose SYNC signal this PLC passes on to `bus`.
    pub(crate) fn sync_source_of(&self, bus: usize) -> Option<usize> {
        self.bus1.filter(|upper| self.bus2 == Some(bus) && self.takes_sync_from(*upper))
    }

    pub(crate) fn control_changed(&self) -> bool {
        self.slave.control_changed()
            || self.master.control_changed()
            || self.baps.is_called()
            || self.board.has_changed()
    }

    /// What the access checker must know about node 1 and node 2.
    #[inline]
    pub(crate) fn facts(&self) -> [Facts; 2] {
        [self.slave.facts(), self.master.facts()]
    }

    pub(crate) fn show_time(&self, now: u64) {
        self.header.virtual_time_us.store(now);
    }

    pub(crate) fn count_sync(&self, node: u8) {
        self.header.sync_counter[usize::from(node == 2)].increment();
    }

    /// The SYNC signal of `node` as event of the board: that of node 1 if it is on its bus, else that of node 2
    /// (decision D-182).
    #[inline]
    pub(crate) fn sync_event(&mut self, node: u8, now: u64) {
        let source = if self.slave.is_on_bus() { 1 } else { 2 };
        if node == source {
            self.board.sync_net(now);
            self.pass_trigger(now);
        }
    }

    /// The timers of the board that are due.
    pub(crate) fn timers_due(&mut self, now: u64) {
        self.board.timers_due(now);
        self.pass_trigger(now);
    }

    /// The trigger controller is part of the drive.
    #[inline]
    fn pass_trigger(&mut self, now: u64) {
        if self.board.take_controller_pulse() {
            self.baps.trigger_edge(now);
        }
    }

    /// A time slice of the drive, which may have process data for an event task. `pace` as for [`Baps::slice`].
    pub(crate) fn time_slice(
        &mut self,
        index: usize,
        now: u64,
        journal: &mut Journal,
        pace: impl FnMut(&mut Journal, bool) -> Pace,
    ) {
        let events = self.baps.process_data_events();
        let origin = Origin { plc: index as u16, node: BAPS_NODE };
        self.baps.slice(&mut Context { now, journal, origin, base: BAPS }, pace);
        if self.baps.process_data_events() != events {
            self.board.baps(now);
        }
    }

    /// Brings fault number `fault` upon the drive. Tells whether it has power and had no fault.
    pub(crate) fn trip_drive(&mut self, now: u64, fault: u16) -> bool {
        self.board.has_supply() && self.baps.trip(now, fault)
    }

    pub(crate) fn watch(&mut self, events: u16) {
        self.watched = events != 0;
        self.board.watch(events);
    }

    pub(crate) fn is_watched(&self) -> bool {
        self.watched
    }

    /// Looks at all control registers.
    pub(crate) fn processor_cycle(
        &mut self,
        index: usize,
        now: u64,
        buses: &mut [SimBus],
        journal: &mut Journal,
    ) {
        if !self.board.is_up() {
            return;
        }
        self.baps.processor_cycle(now);
        let origin = |node| Origin { plc: index as u16, node };
        let wire = |bus: Option<usize>, node| bus.and_then(|bus| buses.get(bus)?.on_wire(now, origin(node)));
        let (wire1, wire2) = (wire(self.bus1, 1), wire(self.bus2, 2));

        let mut ctx = Context { now, journal, origin: origin(1), base: NODE1 };
        self.ethernet.look(&mut ctx);
        let change = self.slave.processor_cycle(&mut ctx, wire1);
        if change == Change::SetUpStarted {
            self.report_mismatch(&mut ctx, buses);
        }
        (ctx.origin, ctx.base) = (origin(2), NODE2);
        let change = self.master.processor_cycle(&mut ctx, wire2);
        let Some(bus) = self.bus2.and_then(|bus| buses.get_mut(bus)) else { return };
        match change {
            Change::SetUpStarted => {
                if let Some(timing) = self.master.timing() {
                    bus.start(now, timing, !self.master.forwards_sync());
                }
            }
            Change::Restarted => bus.stop(now),
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
            let offset = offset_of!(CANsync_INIT_BMSTRUCT, b_BT_0);
            ctx.find(Rule::BusBaudRate, Live::Init, offset, timing.b_BT_0.into());
        }
    }
}
