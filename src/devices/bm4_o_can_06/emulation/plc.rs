//! A b maXX PLC: its communication RAM, its front panel, and the parts of its option modules that the buses do not run.

use super::config::{Bm4Config, CONTROLLER_RATES, ModuleConfig, Work};
use super::front::{self, Front};
use super::leds::{LedConditions, Leds};
use super::module::{DIP_9_OFF, DIP_10_ON, DIP_BAUD};
use crate::devices::bm4_o_can_06::registers::{BAUD_RATES, CANsync_PLC_INIT_BMSTRUCT, DEVICE, DIP_LAST};
use crate::devices::cansync::bus::{Socket, SocketRole};
use crate::devices::cansync::firmware::{NodeLocation, note_restarts, report_number_taken};
use crate::devices::cansync::frames::SyncLock;
use crate::devices::records::{BoardEvent, OnBoard};
use crate::devices::{
    AddressWrites, BuildError, Context, Device, DevicePorts, DeviceView, Events, FrontAction, Plug, Power,
};
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::Origin;
use crate::layout::{self, DeviceFit, Fit, Port, Role};
use crate::memory::header::BoardSetting;
use crate::memory::{Header, MemoryError, Segment, View};
use crate::snapshot_fields;

/// DIP switches 3, 2 and 1 of a slave of the controller at 500 kbit/s. The slave has this value until it is
/// connected to its bus.
const UNPLUGGED_BAUD: u8 = 0b101;

/// Time for which H1 flashes after a frame (decision D-367).
const TRAFFIC_US: u64 = 100_000;

/// A module, as the PLC sees it.
struct Module {
    /// Number of the module's port.
    number: PortNumber,
    work: Work,
    /// True if DIP switch 9 is at ON, or the module is a master.
    has_registers: bool,
    /// DIP switches 1 to 3, 9 and 10, encoded as in the header page.
    other_switches: u32,
    regs: View<CANsync_PLC_INIT_BMSTRUCT>,
    /// Number at the DIP switches, as read at the last power-on.
    dip: u8,
    takes_part: bool,
    /// Time of the last edge of the module's SYNC signal, and the interval between this edge and the previous
    /// edge.
    edge: Option<(u64, u64)>,
    /// Time of the last frame that the port sent or received, in microseconds.
    last_frame: Option<u64>,
}

snapshot_fields!(Module { values: dip, takes_part, edge, last_frame; built: number, work, has_registers, other_switches, regs });

impl Module {
    fn new(config: &ModuleConfig, segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Module {
            number: config.port.number,
            work: config.work(),
            has_registers: config.has_registers(),
            other_switches: u32::from(config.dip_baud.unwrap_or(UNPLUGGED_BAUD)) << DIP_BAUD
                | if config.has_registers() { 0 } else { DIP_9_OFF }
                | if config.dip10 { DIP_10_ON } else { 0 },
            regs: segment.view(config.port.area.first)?,
            dip: config.dip,
            takes_part: false,
            edge: None,
            last_frame: None,
        })
    }

    /// Returns the DIP switches of the module as encoded in the header page. Of a slave of the PLC, only the
    /// switches of the number and switch 10 have a function.
    fn switches(&self) -> u32 {
        let others = if self.has_registers { self.other_switches & DIP_10_ON } else { self.other_switches };
        u32::from(self.dip) | others
    }

    /// Index of the module in the list of ports in the header page.
    fn place(&self) -> usize {
        self.number.index()
    }

    /// Returns the interval of the SYNC signal, if there is a signal. The signal ends after two and a half
    /// intervals without an edge, at the same time as the lock of a slave.
    fn interval_us(&self, now: u64) -> Option<u64> {
        let (at, interval) = self.edge?;
        (interval != 0 && (now - at) * 2 <= interval * 5).then_some(interval)
    }

    fn leds(&self, now: u64) -> Leds {
        let has_traffic = self.last_frame.is_some_and(|at| now.saturating_sub(at) <= TRAFFIC_US);
        let seen =
            LedConditions { takes_part: self.takes_part, interval_us: self.interval_us(now), has_traffic };
        let (option, can) = (&self.regs.w_OPTION_STATUS, &self.regs.w_CANsync_STATUS);
        match self.work {
            Work::Master => Leds::of_master(option, can, seen),
            Work::PlcSlave => Leds::of_slave(option, can, seen),
            Work::ControllerSlave(_) => Leds::of_controllers_slave(self.edge.is_some(), seen),
            Work::InitError => Leds::of_init_error(self.has_registers),
            Work::UnknownBaudRate => Leds::of_unknown_baud_rate(),
        }
    }
}

/// A b maXX PLC of the plant.
pub struct Bm4Plc {
    index: DeviceIndex,
    name: String,
    segment: Segment,
    front: Front,
    modules: Vec<Module>,
    /// Number of the port that provides the SYNC signal of event 11.
    sync_source: Option<PortNumber>,
    /// Ports with a SYNC signal that another port can pass on.
    sync_ways: Vec<(PortNumber, PortNumber)>,
}

snapshot_fields!(Bm4Plc {
    parts: front, modules;
    built: index, name, segment, sync_source, sync_ways
});

impl Bm4Plc {
    /// Creates device number `index` of the plant, and its ports, which are not plugged in yet.
    pub(crate) fn new(
        index: DeviceIndex,
        config: &Bm4Config,
        segment: Segment,
    ) -> Result<(Self, Vec<Plug>), BuildError> {
        let face = segment.firmware_header()?;
        let modules = config.modules.iter().map(|module| Module::new(module, &segment));
        let modules = modules.collect::<Result<Vec<_>, _>>()?;
        let plug = |module: &ModuleConfig| {
            let role = match module.work() {
                Work::Master => SocketRole::Master { has_sync_in: config.hands_sync_to(module) },
                Work::PlcSlave => {
                    let lock = SyncLock::new(module.lock_time_us, module.sync_loss_us);
                    SocketRole::Slave { number: module.dip, lock }
                }
                Work::ControllerSlave(kbit_s) => SocketRole::Drive(Box::new(config.drive_of(module, kbit_s))),
                Work::InitError | Work::UnknownBaudRate => return None,
            };
            let number = module.port.number;
            let origin = Origin { plc: index, node: number };
            Some(Plug {
                number,
                family: module.port.medium,
                bus: module.bus.clone(),
                socket: Box::new(Socket {
                    origin,
                    segment: segment.clone(),
                    location: location(module.port),
                    area: module.port.area,
                    role,
                }),
            })
        };
        let ports = config.modules.iter().filter_map(plug).collect();
        let way = |module: &ModuleConfig| Some((module.sync_in_from?.number, module.port.number));
        let device = Bm4Plc {
            index,
            name: config.name.clone(),
            front: Front::new(face),
            modules,
            sync_source: config.sync_source.map(|port| port.number),
            sync_ways: config.modules.iter().filter_map(way).collect(),
            segment,
        };
        device.modules.iter().for_each(|module| device.show_switches(module.number));
        Ok((device, ports))
    }

    fn show_switches(&self, port: PortNumber) {
        if let Some(module) = self.modules.iter().find(|module| module.number == port) {
            self.front.face.put(|page| &page.ports[module.place()].dip, module.switches());
        }
    }

    fn module(&mut self, port: PortNumber) -> Option<&mut Module> {
        self.modules.iter_mut().find(|module| module.number == port)
    }

    fn show_leds(&self, now: u64) {
        for module in &self.modules {
            self.front.face.ports[module.place()].leds.store(module.leds(now).code());
        }
    }
}

impl DeviceView for Bm4Plc {
    fn name(&self) -> &str {
        &self.name
    }

    fn segment(&self) -> &Segment {
        &self.segment
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        &DEVICE
    }

    fn header(&self) -> &Header {
        &self.front.face
    }

    fn fitted(&self) -> DeviceFit {
        let layout = self.layout();
        let empty =
            layout.ports.iter().fold(DeviceFit::unknown(layout), |it, port| it.with(port.number, Fit::Empty));
        let with_registers = self.modules.iter().filter(|module| module.has_registers);
        with_registers.fold(empty, |fitted, module| {
            let role = if module.work == Work::Master { Role::Master } else { Role::Slave };
            fitted.with(module.number, Fit::As(role))
        })
    }

    fn is_drive(&self, port: PortNumber) -> bool {
        let module = self.modules.iter().find(|module| module.number == port);
        module.is_some_and(|module| matches!(module.work, Work::ControllerSlave(_)))
    }

    fn event_level(&self, event: usize) -> Option<u8> {
        front::level(event)
    }
}

impl crate::devices::Front for Bm4Plc {
    /// DIP switches and LEDs belong to the modules; the manual describes no program and no switch for the PLC (decision
    /// D-366).
    fn turn(&self, setting: BoardSetting) -> bool {
        match setting {
            BoardSetting::Power(power) => self.front.face.put(|page| &page.program.power, power.code()),
            BoardSetting::Start(start) => {
                self.front.face.ask(|page| &page.program.start_request, start.code());
            }
            BoardSetting::ModuleDip { port, dip } => {
                let is_it = |module: &&Module| {
                    module.number == port && module.has_registers && module.work != Work::Master
                };
                let Some(module) = self.modules.iter().find(is_it) else { return false };
                let switches = u32::from(dip) | module.switches() & !u32::from(DIP_LAST);
                self.front.face.put(|page| &page.ports[module.place()].dip, switches);
            }
            BoardSetting::Reset | BoardSetting::PowerCycle => {}
            _ => return false,
        }
        true
    }

    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        let BoardSetting::ModuleDip { port, .. } = setting else { return None };
        let module = self.modules.iter().find(|module| module.number == port)?;
        let is_set_in_file = !module.has_registers && module.work != Work::Master;
        is_set_in_file.then_some(
            "DIP switch 9 of the module is at OFF, and the number of a slave of the controller is set in the plant file",
        )
    }

    fn set_power(&mut self, power: Power) -> FrontAction {
        self.front.set_power(power)
    }

    #[inline]
    fn look(&mut self, ctx: &mut Context) -> FrontAction {
        self.front.look(ctx)
    }

    #[inline]
    fn front_has_changed(&self) -> bool {
        self.front.has_changed()
    }

    fn is_up(&self) -> bool {
        self.front.is_up()
    }
}

impl Device for Bm4Plc {
    fn start(&mut self, ctx: &mut Context) {
        self.front.start(ctx);
        for module in &mut self.modules {
            if module.has_registers {
                let dip = self.front.face.requested().ports[module.place()].dip.load();
                module.dip = (dip & u32::from(DIP_LAST)) as u8;
            }
            module.edge = None;
            module.last_frame = None;
            if module.work == Work::InitError && module.has_registers {
                // A module with an error at initialization has no firmware. So the reset of its registers is
                // done here.
                module.regs.reset_from(0);
            }
        }
        self.show_leds(ctx.now);
    }

    fn stop(&mut self, ctx: &mut Context) {
        self.front.stop(ctx);
        for module in &self.modules {
            self.front.face.ports[module.place()].leds.store(0);
        }
    }

    fn is_quiescent(&self) -> bool {
        let is_shown = |module: &Module| {
            let shown = self.front.face.ports[module.place()].leds.load();
            module.edge.is_none() && (!self.front.is_up() || shown == module.leds(0).code())
        };
        !self.front.has_changed() && self.modules.iter().all(is_shown)
    }

    fn events(&mut self) -> Option<&mut Events> {
        Some(&mut self.front.events)
    }

    fn ports(&mut self) -> Option<&mut dyn DevicePorts> {
        Some(self)
    }

    fn address_writes(&mut self) -> Option<&mut dyn AddressWrites> {
        Some(self)
    }
}

impl DevicePorts for Bm4Plc {
    /// Sets DIP switches 1 to 3 of a slave of the controller to the rate of its bus, unless the plant file sets them
    /// (p. 27; decision D-649).
    fn plugged_in(&mut self, port: PortNumber, bit_s: u32) {
        let Some(module) = self.module(port) else { return };
        let of_bus = CONTROLLER_RATES.iter().find(|(_, kbit_s)| u32::from(*kbit_s) * 1000 == bit_s);
        if let (Work::ControllerSlave(None), Some((switches, _))) = (module.work, of_bus) {
            let others = module.other_switches & !(0b111 << DIP_BAUD);
            module.other_switches = others | u32::from(*switches) << DIP_BAUD;
            self.show_switches(port);
        }
    }

    /// Returns the DIP switches of a slave. A master has no DIP switches.
    fn address(&self, port: PortNumber) -> u8 {
        let module = self.modules.iter().find(|module| module.number == port);
        module.map_or(0, |module| module.dip)
    }

    fn address_taken(&mut self, ctx: &mut Context, port: PortNumber) {
        let (plc, number) = (self.index, self.address(port));
        ctx.report(OnBoard { plc, what: BoardEvent::NumberTaken { port, number } });
        report_number_taken(ctx, DEVICE.port_numbered(port), number);
    }

    fn port_joined(&mut self, port: PortNumber, takes_part: bool) {
        if let Some(module) = self.module(port) {
            module.takes_part = takes_part;
            module.edge = None;
        }
    }

    /// The LEDs show the state of the module's firmware and the traffic of its bus.
    fn port_looked(&mut self, port: PortNumber, last_frame: Option<u64>, now: u64) {
        let Some(module) = self.module(port) else { return };
        module.last_frame = last_frame;
        let (place, leds) = (module.place(), module.leds(now).code());
        self.front.face.ports[place].leds.store(leds);
    }

    fn sync_ways(&self) -> &[(PortNumber, PortNumber)] {
        &self.sync_ways
    }

    /// Raises event 11 while the module takes part in its bus (decision D-365).
    #[inline]
    fn sync_edge(&mut self, port: PortNumber, now: u64) {
        let is_source = self.sync_source == Some(port);
        let Some(module) = self.module(port) else { return };
        module.edge = Some((now, module.edge.map_or(0, |(before, _)| now - before)));
        if is_source && module.takes_part {
            self.front.sync(now);
        }
    }
}

impl AddressWrites for Bm4Plc {
    fn written_by_address(&self, offset: u32, bytes: u32) {
        note_restarts(&self.segment, &self.front.face, DEVICE.ports.iter().map(location), offset, bytes);
    }

    fn answers_write(&self, _: u32) -> bool {
        false
    }

    fn answer_write(&mut self, _: &mut Context) {}
}

/// Location of the registers of the module at `port`.
fn location(port: &Port) -> NodeLocation {
    NodeLocation::of(port, &BAUD_RATES)
}
