//! An Omega Drive-Line II: its communication RAM, its board, Ethernet, and the drive that contains it. The buses
//! run its two CANsync nodes and its RS485 port.

use super::config::PlcConfig;
use super::faults::{Effect, pace};
use crate::devices::cansync::bus::{Socket, SocketRole};
use crate::devices::cansync::drive::BuiltInDrive;
use crate::devices::cansync::firmware::{NodeLocation, note_restarts, report_number_taken};
use crate::devices::cansync::frames::SyncLock;
use crate::devices::cansync::records::OwnDriveSet;
use crate::devices::omega_drive_line_2::emulation::baps::Baps;
use crate::devices::omega_drive_line_2::emulation::board::{Board, level};
use crate::devices::omega_drive_line_2::emulation::ethernet::Ethernet;
use crate::devices::omega_drive_line_2::emulation::serial::Serial;
use crate::devices::omega_drive_line_2::registers::{BAPS, BAUD_RATES, DEVICE, ETHERNET_CONFIG};
use crate::devices::records::{BoardEvent, OnBoard};
use crate::devices::{
    AddressWrites, BuildError, CardPulses, Context, ControllerPulses, Device, DevicePorts, DeviceView,
    DriveDetails, DriveState, Drives, Events, Faulty, Front, FrontAction, NovramContents, OptionSlots,
    ParameterRefusal, Plug, Power, Shaft, World,
};
use crate::fault::{self, Hit, Target};
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::{Journal, Origin};
use crate::layout;
use crate::memory::header::BoardSetting;
use crate::memory::{FirmwareHeader, Header, Segment};
use crate::snapshot_fields;

/// Numbers of the ports.
pub(super) const SLAVE: PortNumber = PortNumber(1);
pub(super) const MASTER: PortNumber = PortNumber(2);
pub(super) const SERIAL: PortNumber = PortNumber(3);
/// Number that records use for the BAPS instead of a port number. The BAPS is not a port.
const BAPS_NODE: PortNumber = PortNumber::DEVICE;

/// Location of the registers of the node at `port`.
fn location(port: &layout::Port) -> NodeLocation {
    NodeLocation::of(port, &BAUD_RATES)
}

/// An Omega Drive-Line II of the plant.
pub struct Plc {
    index: DeviceIndex,
    name: String,
    /// With the registers of option cards.
    layout: &'static layout::DeviceLayout,
    segment: Segment,
    face: FirmwareHeader,
    baps: Baps,
    board: Board,
    ethernet: Ethernet,
    /// True if node 1 is in set-up mode or active operation.
    slave_is_on_bus: bool,
}

snapshot_fields!(Plc { values: slave_is_on_bus; parts: baps, board, ethernet; built: index, name, layout, segment, face });

impl Plc {
    /// Creates device number `index` of the plant, and its ports. The ports are not connected yet.
    pub(crate) fn new(
        index: DeviceIndex,
        config: &PlcConfig,
        layout: &'static layout::DeviceLayout,
        segment: Segment,
    ) -> Result<(Self, Vec<Plug>), BuildError> {
        let drive = BuiltInDrive::new(&config.name, &config.drive)?;
        let face = segment.firmware_header()?;
        face.put(|page| &page.board.dip, u32::from(config.dip));
        face.retain_size.store(config.retain_bytes);
        let lock = SyncLock::new(config.lock_time_us, config.sync_loss_us);
        let plug = |port: &'static layout::Port, bus: &Option<String>, role: SocketRole| Plug {
            number: port.number,
            family: "cansync",
            bus: bus.clone(),
            socket: Box::new(Socket {
                origin: Origin { plc: index, node: port.number },
                segment: segment.clone(),
                location: location(port),
                area: port.area,
                role,
            }),
        };
        let slave = SocketRole::Slave { number: config.dip, lock };
        // If node 1 and node 2 were on one bus, node 2 would wait for a signal that it must itself generate.
        let has_sync_in = config.node1.is_some() && config.node1 != config.node2;
        let ports = vec![
            plug(&DEVICE.ports[0], &config.node1, slave),
            plug(&DEVICE.ports[1], &config.node2, SocketRole::Master { has_sync_in }),
            Serial::plug(index, &segment, config.serial.as_deref())?,
        ];
        let device = Plc {
            index,
            name: config.name.clone(),
            layout,
            face,
            baps: Baps::new(&segment, drive, &config.drive)?,
            board: Board::new(&segment, config.option_sync_us, config.project.into())?,
            ethernet: Ethernet::new(&segment, config.ethernet_mbit)?,
            slave_is_on_bus: false,
            segment,
        };
        Ok((device, ports))
    }

    /// Returns the number that the DIP switches had at the last power-on or reset, 0..=31.
    pub fn dip(&self) -> u8 {
        self.board.dip()
    }

    /// Returns the BAPS with its drive.
    pub fn baps(&self) -> &Baps {
        &self.baps
    }

    /// Returns all details of the drive that contains the device.
    fn drive_details(&self) -> DriveDetails {
        let mut details = self.baps.drive().details();
        if !self.board.has_supply() {
            details.state.state = "off".to_owned();
        }
        details
    }

    /// Passes a pulse of the trigger controller to the drive. The trigger controller is a part of the drive.
    #[inline]
    fn pass_trigger(&mut self, now: u64) {
        if self.board.take_controller_pulse() {
            self.baps.trigger_edge(now);
        }
    }

    /// Runs a time slice of the drive. In this slice, the drive may have process data for an event task.
    fn time_slice(&mut self, world: &mut World) {
        let events = self.baps.process_data_events();
        let (now, plc) = (world.now, self.index);
        let World { journal, faults, .. } = world;
        let mut ctx = Context { now, journal, origin: Origin { plc, node: BAPS_NODE }, base: BAPS };
        self.baps.slice(&mut ctx, |journal, has_waited| pace(faults, now, plc, has_waited, journal));
        if self.baps.process_data_events() != events {
            self.board.baps(now);
        }
    }
}

impl DeviceView for Plc {
    fn name(&self) -> &str {
        &self.name
    }

    fn segment(&self) -> &Segment {
        &self.segment
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        self.layout
    }

    fn header(&self) -> &Header {
        &self.face
    }

    fn event_level(&self, event: usize) -> Option<u8> {
        level(event)
    }
}

impl Front for Plc {
    fn turn(&self, setting: BoardSetting) -> bool {
        match setting {
            BoardSetting::Dip(number) => self.face.put(|page| &page.board.dip, number.into()),
            BoardSetting::Leds(leds) => self.face.put(|page| &page.board.leds, leds.into()),
            BoardSetting::Switch(switch) => self.face.put(|page| &page.board.switch, switch.code()),
            BoardSetting::Power(power) => self.face.put(|page| &page.program.power, power.code()),
            BoardSetting::Start(start) => self.face.ask(|page| &page.program.start_request, start.code()),
            BoardSetting::Project(project) => self.face.ask(|page| &page.project_request, project.code() + 1),
            BoardSetting::ModuleDip { .. } | BoardSetting::Front { .. } => return false,
            BoardSetting::Reset | BoardSetting::PowerCycle => {}
        }
        true
    }

    fn set_power(&mut self, power: Power) -> FrontAction {
        self.board.set_power(power)
    }

    #[inline]
    fn look(&mut self, ctx: &mut Context) -> FrontAction {
        self.board.look(ctx)
    }

    #[inline]
    fn front_has_changed(&self) -> bool {
        self.board.has_changed()
    }

    fn is_up(&self) -> bool {
        self.board.is_up()
    }

    fn supply_failed(&mut self) {
        self.baps.power_off();
    }
}

impl Device for Plc {
    fn start(&mut self, ctx: &mut Context) {
        let dip = self.board.start(ctx);
        self.ethernet.power_on(ctx, dip);
        self.baps.power_on();
    }

    /// Stops the PLC. The drive continues, and only detects that there are no requests.
    fn stop(&mut self, ctx: &mut Context) {
        self.board.stop();
        self.ethernet.power_off();
        ctx.report(OnBoard { plc: self.index, what: BoardEvent::Down });
        self.baps.reset();
    }

    fn has_changed(&self) -> bool {
        self.baps.is_called() || self.board.has_changed()
    }

    fn processor_cycle(&mut self, ctx: &mut Context) {
        self.baps.processor_cycle(ctx.now);
        self.ethernet.look(ctx);
    }

    fn is_quiescent(&self) -> bool {
        !self.board.has_changed()
    }

    fn poll_changes_nothing(&self) -> bool {
        !self.has_changed() && (!self.is_up() || self.ethernet.poll_changes_nothing())
    }

    #[inline]
    fn next_time(&self) -> u64 {
        self.baps.next_time().min(self.board.next_time())
    }

    fn due(&mut self, world: &mut World) {
        if self.baps.next_time() == world.now {
            self.time_slice(world);
        }
        if self.board.next_time() == world.now {
            self.board.timers_due(world.now);
            self.pass_trigger(world.now);
        }
    }

    fn events(&mut self) -> Option<&mut Events> {
        Some(self.board.events())
    }

    fn ports(&mut self) -> Option<&mut dyn DevicePorts> {
        Some(self)
    }

    fn drives(&self) -> Option<&dyn Drives> {
        Some(self)
    }

    fn drives_mut(&mut self) -> Option<&mut dyn Drives> {
        Some(self)
    }

    fn address_writes(&mut self) -> Option<&mut dyn AddressWrites> {
        Some(self)
    }

    fn novram(&self) -> Option<&dyn NovramContents> {
        Some(self)
    }

    fn novram_mut(&mut self) -> Option<&mut dyn NovramContents> {
        Some(self)
    }

    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        Some(self)
    }

    fn option_slots(&mut self) -> Option<&mut dyn OptionSlots> {
        Some(self)
    }
}

impl DevicePorts for Plc {
    fn address(&self, _: PortNumber) -> u8 {
        self.board.dip()
    }

    fn address_taken(&mut self, ctx: &mut Context, port: PortNumber) {
        let (plc, number) = (self.index, self.board.dip());
        ctx.report(OnBoard { plc, what: BoardEvent::NumberTaken { port, number } });
        report_number_taken(ctx, DEVICE.port_numbered(port), number);
    }

    fn port_joined(&mut self, port: PortNumber, takes_part: bool) {
        if port == SLAVE {
            self.slave_is_on_bus = takes_part;
        }
    }

    /// Node 2 can pass on the SYNC signal of node 1 (decision D-12).
    fn sync_ways(&self) -> &[(PortNumber, PortNumber)] {
        &[(SLAVE, MASTER)]
    }

    /// Fires the event of the board for a SYNC edge. The source is node 1 while it is on its bus, otherwise
    /// node 2 (decision D-182).
    #[inline]
    fn sync_edge(&mut self, port: PortNumber, now: u64) {
        let source = if self.slave_is_on_bus { SLAVE } else { MASTER };
        if port == source {
            self.board.sync_net(now);
            self.pass_trigger(now);
        }
    }
}

impl OptionSlots for Plc {
    fn take_pulses(&mut self) -> ControllerPulses {
        self.board.take_card_pulses()
    }

    fn card_pulses(&mut self, slot: u8, pulses: CardPulses, now: u64) {
        self.board.option_card(slot, pulses, now);
        self.pass_trigger(now);
    }
}

impl Drives for Plc {
    fn list(&self) -> Vec<(&str, DriveState)> {
        vec![("drive", self.drive_details().state)]
    }

    fn details(&self, drive: usize) -> Option<DriveDetails> {
        (drive == 0).then(|| self.drive_details())
    }

    fn set_parameter(
        &mut self,
        _: usize,
        number: u16,
        value: i64,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), ParameterRefusal> {
        if !self.board.has_supply() {
            return Err(ParameterRefusal::Off);
        }
        self.baps.set_parameter(now, number, value)?;
        journal.push(now, OwnDriveSet { plc: self.index, number, value: value as u32 });
        Ok(())
    }

    fn shaft(&self, _: usize) -> Option<Shaft> {
        Some(self.baps.drive().shaft())
    }

    fn turn_shaft(&mut self, _: usize, speed: Option<i32>, now: u64) {
        self.baps.turn_shaft(now, speed);
    }
}

impl AddressWrites for Plc {
    fn written_by_address(&self, offset: u32, bytes: u32) {
        let nodes = DEVICE.ports.iter().filter(|port| port.number != SERIAL);
        note_restarts(&self.segment, &self.face, nodes.map(location), offset, bytes);
    }

    /// True only for `d_IP_CONFIG`.
    fn answers_write(&self, offset: u32) -> bool {
        offset == ETHERNET_CONFIG
    }

    fn answer_write(&mut self, ctx: &mut Context) {
        if self.board.is_up() {
            self.ethernet.take(ctx);
        }
    }
}

impl NovramContents for Plc {
    fn contents(&self) -> (&[u8], u32) {
        let (stored, generation) = self.ethernet.stored();
        (stored, generation)
    }

    fn store(&mut self) {
        self.ethernet.keep();
    }
}

impl Faulty for Plc {
    fn fire(&mut self, now: u64, _: Target, effect: &fault::Effect) -> Option<Hit> {
        match *effect.get()? {
            Effect::Trip(fault) => {
                (self.board.has_supply() && self.baps.trip(now, fault)).then_some(Hit::Plain)
            }
            Effect::Silent | Effect::Slow(_) => None,
        }
    }
}
