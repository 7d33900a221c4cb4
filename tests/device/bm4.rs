//! The b maXX PLC: its modules on buses, at its own rates.

mod vectors;

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::plant_of;
use commram::devices::bm4_o_can_06::Leds;
use commram::devices::bm4_o_can_06::blocks::{CANsync_INIT, INTR_SET, Ram};
use commram::devices::bm4_o_can_06::registers::*;
use commram::devices::cansync::frames::Frame;
use commram::devices::cansync::records::Transmitted;
use commram::devices::cansync::{BaudRate, registers as family, rules};
use commram::devices::fault_kinds;
use commram::devices::omega_drive_line_2::registers as omega;
use commram::devices::records::{BoardEvent, OnBoard};
use commram::devices::{Led, Switch};
use commram::fault::FaultSpec;
use commram::identity::{DeviceIndex, PortNumber};
use commram::journal::Format;
use commram::journal::text::Text;
use commram::memory::header::BoardSetting;
use commram::memory::{Segment, View};
use commram::plant::{Plant, PlantConfig, Power};
use std::ops::RangeBounds;

type Master = View<family::CANsync_MA_CTRL_BMSTRUCT>;
type Slave = View<family::CANsync_SL_CTRL_BMSTRUCT>;

pub(crate) struct Bm4 {
    pub plant: Plant,
}

impl Bm4 {
    fn new(text: &str) -> Self {
        Bm4 { plant: plant_of(text) }
    }

    fn segment(&self, device: usize) -> Segment {
        self.plant.devices()[device].segment().clone()
    }

    fn step(&mut self, us: u64) {
        self.plant.advance_to(self.plant.now() + us);
    }

    fn node(&self, device: usize, base: u32, timing: &'static BaudRate, mode: Mode) -> Node {
        Node::at(&self.segment(device), base, timing, mode).expecting(match mode {
            Mode::Slave => 0..0,
            _ => 0..8,
        })
    }

    #[track_caller]
    fn bring_up(&mut self, nodes: &[&Node], stages: impl RangeBounds<Stage>) {
        bring_up_in(&mut self.plant, nodes, stages);
    }

    fn run_to_sync(&mut self, device: usize, port: PortNumber) {
        let edge = self.plant.next_sync(DeviceIndex::at(device), port).expect("there is a SYNC signal");
        self.plant.advance_to(edge);
    }

    /// Returns all frames so far with the time of their end.
    fn frames(&self) -> Vec<(u64, Frame)> {
        let records = self.plant.journal().records();
        records.filter_map(|it| Some((it.time_us, it.event.get::<Transmitted>()?.frame))).collect()
    }

    fn last_frame(&self, ids: core::ops::RangeInclusive<u16>) -> Option<(u64, Frame)> {
        self.frames().into_iter().rfind(|(_, frame)| ids.contains(&frame.id()))
    }
}

fn rate(kbit_s: u16) -> &'static BaudRate {
    BAUD_RATES.iter().find(|rate| rate.kbit_per_s == kbit_s).unwrap()
}

/// Returns a plant file: a master in slot G with a drive at its bus, and a slave in slot H at the bus of another b maXX
/// PLC.
fn plant_text(kbit_s: u16) -> String {
    format!(
        "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n\
         [[device.module]]\nslot = 'H'\nkind = 'can-05'\nbus = 'upper'\ndip = 6\nlock_time_us = 20000\n\
         [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'fast'\n\
         [[device]]\nkind = 'bm4-plc'\nname = 'top'\n\
         [[device.module]]\nslot = 'M'\nkind = 'can-06'\nbus = 'upper'\n\
         [[bus]]\nname = 'fast'\nkbit_s = {kbit_s}\n\
         [[bus.drive]]\nname = 'winder'\nslave_number = 3\nlock_time_us = 20000\ncard_function = 0\n\
         [[bus]]\nname = 'upper'\nkbit_s = {kbit_s}\n"
    )
}

/// Manual 5.02066.01a p. 18, 47-55, 62-71: a master with a drive, at every rate of this device.
#[test]
fn a_master_reaches_active_operation_and_exchanges_values_with_a_drive() {
    for rate in &BAUD_RATES {
        let mut bm4 = Bm4::new(&plant_text(rate.kbit_per_s));
        let master: Master = bm4.segment(0).view(SLOTG).unwrap();
        let node = bm4.node(0, SLOTG, rate, Mode::Master);
        bm4.bring_up(&[&node], ..=Stage::SetUp);
        bm4.step(200_000);
        assert_eq!(master.a_STAT_SL[3].load(), 0x03, "{} kbit/s", rate.kbit_per_s);
        bm4.bring_up(&[&node], Stage::Active..);
        master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x0D);
        master.a_WR_VALUE[3].store(0x1234_5678);
        master.b_CTRLREG_RD_ORDER_RDC1.store(3);
        bm4.run_to_sync(0, PortNumber(1));
        let edge = bm4.plant.now();
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(0, PortNumber(1));
        assert_eq!(bm4.plant.now() - edge, u64::from(rate.b_TIME_PATTERN) * 1000);
        assert_eq!(master.b_CTRLREG_WRC1.load(), 0x04);
        let (_, frame) = bm4.last_frame(0x100..=0x17F).expect("WRC1 went out");
        assert_eq!((frame.id(), &frame.data()[..2]), (0x103, &[0x78, 0x56][..]));
        assert_eq!(master.b_STATREG_RDC1.load(), 3, "the drive has answered");
        let findings = bm4.plant.journal().findings();
        assert!(findings.errors().is_empty(), "{:?}", findings.errors());
    }
}

/// Manual 5.02066.01a p. 71-87.
#[test]
fn a_slave_module_is_slave_of_another_plc() {
    for rate in &BAUD_RATES {
        let mut bm4 = Bm4::new(&plant_text(rate.kbit_per_s));
        let slave: Slave = bm4.segment(0).view(SLOTH).unwrap();
        let master: Master = bm4.segment(1).view(SLOTM).unwrap();
        assert_eq!(slave.w_OMEGA_NR.load(), 6, "w_SLAVE_NUMBER");
        let nodes = [bm4.node(0, SLOTH, rate, Mode::Slave), bm4.node(1, SLOTM, rate, Mode::Master)];
        bm4.bring_up(&nodes.each_ref(), ..=Stage::SetUp);
        bm4.step(60_000);
        bm4.bring_up(&nodes.each_ref(), Stage::Active..);
        master._CFG_WRC_WORD.b_CFG_WRC2_WORD1.store(0x03);
        slave._CFG_WRC_WORD.b_CFG_WRC2_WORD1.store(0x03);
        slave._CFG_RDC_WORD.b_CFG_RDC2_WORD0.store(0x01);
        master.a_CFG_RDC_WORD[6].b_CFG_RDC2_WORD0.store(0x01);
        master.a_WR_VALUE[0].store(0xABCD_0000);
        slave.a_RD_VALUE_SEND[0].store(0x7777);
        master.b_CTRLREG_RD_ORDER_RDC2.store(6);
        bm4.run_to_sync(1, PortNumber(6));
        slave.b_CTRLREG_RD_RDC2.store(0x05);
        master.b_CTRLREG_WRC2.store(0x05);
        bm4.run_to_sync(1, PortNumber(6));
        assert_eq!((slave.b_CTRLREG_RD_RDC2.load(), slave.b_CTRLREG_WRC2.load()), (0x04, 0x02));
        assert_eq!(slave.a_WR_VALUE_RECEIVE[0].load(), 0xABCD_0000);
        assert_eq!(master.a_RD_BMARRAY[6][0].load(), 0x7777);
        assert_eq!(master.a_STATREG_RDC[6].b_STATREG_RDC2.load(), 0x02);
    }
}

/// T35; manual 5.02066.01a p. 54, 86-87.
#[test]
fn values_must_be_released_by_the_deadlines_of_this_device() {
    let rate = rate(1000);
    for (at, in_time) in [(199, true), (200, false)] {
        let mut bm4 = Bm4::new(&plant_text(rate.kbit_per_s));
        let master: Master = bm4.segment(0).view(SLOTG).unwrap();
        bm4.bring_up(&[&bm4.node(0, SLOTG, rate, Mode::Master)], ..);
        bm4.run_to_sync(0, PortNumber(1));
        bm4.step(at);
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(0, PortNumber(1));
        assert_eq!(bm4.last_frame(0x100..=0x17F).is_some(), in_time, "{at} us");
    }
}

/// Manual 5.02066.01a p. 25, 28-31: the module that `sync_source` names raises event 11; LEDs of master and slave.
#[test]
fn the_chosen_module_raises_event_11_and_each_has_its_leds() {
    let text = plant_text(1000).replace("name = 'maxx'\n", "name = 'maxx'\nsync_source = 'G'\n");
    let mut bm4 = Bm4::new(&text);
    let rate = rate(1000);
    let header = bm4.segment(0).header().unwrap();
    let leds = |slot: usize| Leds::of_code(header.ports[slot].leds.load()).h;
    assert_eq!(leds(0), [Led::On, Led::Off, Led::Off, Led::Off], "waits for the program");
    assert_eq!(header.ports[1].dip.load(), 6);
    let request = header.interrupts[11].ask(0, true);
    header.submit_request();
    let refused = header.interrupts[12].ask(0, true);
    header.submit_request();
    bm4.step(500);
    assert_eq!(header.interrupts[11].outcome(request), Some(0));
    assert_eq!(header.interrupts[12].outcome(refused), Some(1), "there is one event only");
    let master = bm4.node(0, SLOTG, rate, Mode::Master);
    bm4.bring_up(&[&bm4.node(0, SLOTH, rate, Mode::Slave)], ..=Stage::SetUp);
    bm4.bring_up(&[&master], ..=Stage::WaitingForStart);
    bm4.step(500);
    assert_eq!(leds(0)[0], Led::Off, "configured, no frames yet");
    assert_eq!(leds(1)[1], Led::On, "no SYNC signal on the upper bus");
    assert_eq!(header.events[11].bell.rings(), 0);
    bm4.bring_up(&[&master], Stage::SetUp..=Stage::SetUp);
    bm4.run_to_sync(0, PortNumber(1));
    let rings = header.events[11].bell.rings();
    bm4.step(10_000);
    assert_eq!(header.events[11].bell.rings() - rings, 10, "every ms");
    assert_eq!(header.events[11].time_us.load(), bm4.plant.now());
    assert_eq!(header.sync_counter[0].load(), header.events[11].bell.rings());
    assert_eq!(leds(0), [Led::Flashes(1), Led::Off, Led::Off, Led::Off]);
    bm4.bring_up(&[&bm4.node(1, SLOTM, rate, Mode::Master)], ..=Stage::SetUp);
    bm4.step(5_000);
    assert_eq!(leds(1), [Led::Flashes(1), Led::Off, Led::Flashes(1), Led::Off], "an interval of 1 ms");
    let spec: FaultSpec = toml::from_str("kind = 'bus_off'\nplc = 'maxx'\nnode = 'slotG'").unwrap();
    bm4.plant.add_fault(spec.resolve(fault_kinds(), &bm4.plant.names()).unwrap()).unwrap();
    bm4.step(5_000);
    assert_eq!(leds(0), [Led::Off, Led::Flashes(1), Led::Off, Led::Off], "BUS-off: a fault, and no frames");
}

/// An Omega Drive-Line II and a b maXX PLC on one bus, with each of them as the master once, at the rates that both
/// have.
#[test]
fn both_devices_meet_on_one_bus() {
    for (kbit_s, bmaxx_is_master) in [(500, true), (500, false), (250, true), (125, false)] {
        let module = match bmaxx_is_master {
            true => "kind = 'can-06'",
            false => "kind = 'can-05'\ndip = 5\nlock_time_us = 20000",
        };
        let node = if bmaxx_is_master { "node1" } else { "node2" };
        let mut bm4 = Bm4::new(&format!(
            "[[plc]]\nname = 'omega'\ndip = 5\n{node} = 'b'\nlock_time_us = 20000\n\
             [[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n[[device.module]]\nslot = 'K'\nbus = 'b'\n{module}\n\
             [[bus]]\nname = 'b'\n"
        ));
        let ours = (1, SLOTK, rate(kbit_s));
        let base = if bmaxx_is_master { omega::NODE1 } else { omega::NODE2 };
        let omegas = omega::BAUD_RATES.iter().find(|rate| rate.kbit_per_s == kbit_s).unwrap();
        let theirs = (0, base, omegas);
        let (master_at, slave_at) = if bmaxx_is_master { (ours, theirs) } else { (theirs, ours) };
        let master: Master = bm4.segment(master_at.0).view(master_at.1).unwrap();
        let slave: Slave = bm4.segment(slave_at.0).view(slave_at.1).unwrap();
        let nodes = [(slave_at, Mode::Slave), (master_at, Mode::Master)]
            .map(|((device, base, rate), mode)| bm4.node(device, base, rate, mode));
        bm4.bring_up(&nodes.each_ref(), ..=Stage::SetUp);
        bm4.step(400_000);
        assert_eq!(master.a_STAT_SL[5].load(), 0x03, "{kbit_s} kbit/s, {bmaxx_is_master}");
        bm4.bring_up(&nodes.each_ref(), Stage::Active..);
        master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
        slave._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
        master.a_WR_VALUE[0].store(0x4321);
        let port = PortNumber(if bmaxx_is_master { 4 } else { 2 });
        bm4.run_to_sync(master_at.0, port);
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(master_at.0, port);
        assert_eq!(slave.a_WR_VALUE_RECEIVE[0].load(), 0x4321, "{kbit_s} kbit/s, {bmaxx_is_master}");
        assert_eq!(slave.b_CTRLREG_WRC1.load(), 0x02);
    }
}

/// SYNC from another PLC: the slave in slot H receives the signal, and the master in slot G passes it on (D-12).
#[test]
fn a_master_passes_the_sync_signal_of_another_slot_on() {
    let text = plant_text(500).replace("bus = 'fast'\n", "bus = 'fast'\nsync_in_from = 'H'\n");
    let mut bm4 = Bm4::new(&text);
    let rate = rate(500);
    let header = bm4.segment(0).header().unwrap();
    bm4.bring_up(&[&bm4.node(0, SLOTG, rate, Mode::SyncIn)], ..=Stage::SetUp);
    bm4.step(10_000);
    assert_eq!(header.sync_counter[0].load(), 0, "no node makes a SYNC signal");
    bm4.bring_up(&[&bm4.node(1, SLOTM, rate, Mode::Master)], ..=Stage::SetUp);
    bm4.run_to_sync(1, PortNumber(6));
    let before = header.sync_counter[0].load();
    bm4.step(10_000);
    assert_eq!(header.sync_counter[0].load() - before, 5);
}

/// Decision D-29: if the register held 16#0000 before, the RAM does not show a restart. So the block reports the
/// restart, for its own slot.
#[test]
fn the_blocks_restart_the_module_of_their_slot_after_a_controller_reset() {
    let mut bm4 = Bm4::new(&plant_text(1000));
    let node = bm4.node(1, SLOTM, rate(1000), Mode::Master);
    bm4.bring_up(&[&node], ..=Stage::SetUp);
    let init = node.init;
    init.w_CPU_CONTROL.store(0x0080);
    bm4.step(500);
    assert_eq!((init.w_CPU_CONTROL.load(), init.w_OPTION_STATUS.load()), (0x0000, 0x0043));
    let header = bm4.segment(1).header().unwrap();
    let restarts =
        || header.ports.iter().map(|port| port.restarts_written.load()).take(6).collect::<Vec<_>>();
    let before = restarts();
    let ram = Ram::of(&bm4.segment(1)).unwrap();
    let base = ram.at::<CANsync_PLC_INIT_BMSTRUCT>(SLOTM).unwrap();
    CANsync_INIT { us_BAUDRATE: 6, us_SYNC_INTERVAL: 1, ..Default::default() }.call(&base);
    assert_eq!(restarts(), [&before[..5], &[before[5] + 1]].concat());
    bm4.step(500);
    assert_eq!(init.w_OPTION_STATUS.load(), 0x0001);
}

/// Manual p. 25: the block enables event 11 and refuses every other event.
#[test]
fn intr_set_knows_event_11_only() {
    let mut bm4 = Bm4::new(&plant_text(1000));
    let ram = Ram::of(&bm4.segment(0)).unwrap();
    for event in 0..16 {
        let mut block = INTR_SET { i_EVENT: event, x_EN: true, ..Default::default() };
        block.call(&ram);
        bm4.step(500);
        block.call(&ram);
        assert_eq!((block.is_answered(), block.x_ERR), (true, event != 11), "event {event}");
    }
}

/// Manual p. 27: DIP switches give a slave its number; a master has none, and an empty slot has no switches.
#[test]
fn slave_modules_alone_have_switches_that_can_be_set() {
    let mut bm4 = Bm4::new(&plant_text(1000));
    let dips = |bm4: &Bm4| {
        let header = bm4.segment(0).header().unwrap();
        header.ports.iter().take(6).map(|port| port.dip.load()).collect::<Vec<_>>()
    };
    for port in 1..=6 {
        let (before, dip) = (dips(&bm4), 8 + port);
        let is_set =
            bm4.plant.set_board(DeviceIndex(0), BoardSetting::ModuleDip { port: PortNumber(port), dip });
        let mut expected = before;
        if is_set {
            expected[usize::from(port) - 1] = dip.into();
        }
        assert_eq!((is_set, dips(&bm4)), (port == 2, expected), "port {port}");
    }
}

/// Manual p. 27: tests a slave whose number another station already has.
#[test]
fn a_taken_number_is_reported_with_its_slot() {
    let text =
        format!("{}[[bus.drive]]\nname = 'other'\nslave_number = 7\ncard_function = 0\n", plant_text(1000));
    let mut bm4 = Bm4::new(&text);
    bm4.segment(0).header().unwrap().ports[1].dip.store(7);
    bm4.plant.set_power(DeviceIndex(0), Power::Off);
    bm4.plant.set_power(DeviceIndex(0), Power::On);
    let taken =
        OnBoard { plc: DeviceIndex(0), what: BoardEvent::NumberTaken { port: PortNumber(2), number: 7 } };
    let record = bm4.plant.journal().records().find(|record| record.event == taken.into()).unwrap();
    let mut text = String::new();
    Text::new(bm4.plant.names(), commram::devices::catalogue()).record(&record, &mut text);
    assert!(text.contains("no station can address slotH"), "{text}");
    let findings = bm4.plant.journal().findings();
    let [entry] = findings.iter().collect::<Vec<_>>()[..] else { panic!("one finding") };
    let name = entry.last.name(bm4.plant.names().fitted(DeviceIndex(0)));
    assert_eq!((entry.last.rule, entry.last.value), (&rules::NUMBER_TAKEN, 7));
    assert_eq!(name.as_deref(), Some("slotH.w_SLAVE_NUMBER"));
}

/// Manual p. 15, 26: slaves of a bus must differ in their numbers, and the manual requires nothing else. The modules of
/// a PLC are switched on together. So two modules that have swapped their numbers differ, and no module is compared
/// with an earlier number (D-184).
#[test]
fn modules_of_a_plc_swap_their_numbers() {
    let module = |slot: &str, rest: &str| format!("[[device.module]]\nslot = '{slot}'\nbus = 'b'\n{rest}\n");
    let slave = |dip: u8| format!("kind = 'can-05'\ndip = {dip}\nlock_time_us = 20000");
    let text = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n".to_owned()
        + &module("H", &slave(4))
        + &module("J", &slave(5))
        + "[[device]]\nkind = 'bm4-plc'\nname = 'top'\n"
        + &module("M", "kind = 'can-06'")
        + "[[bus]]\nname = 'b'\n";
    let mut bm4 = Bm4::new(&text);
    for (port, dip) in [(2, 5), (3, 4)] {
        assert!(bm4.plant.set_board(DeviceIndex(0), BoardSetting::ModuleDip { port: PortNumber(port), dip }));
    }
    bm4.plant.set_power(DeviceIndex(0), Power::Off);
    bm4.plant.set_power(DeviceIndex(0), Power::On);
    let slaves: [Slave; 2] = [SLOTH, SLOTJ].map(|slot| bm4.segment(0).view(slot).unwrap());
    assert_eq!(slaves.each_ref().map(|slave| slave.w_OMEGA_NR.load()), [5, 4]);
    let nodes = [(0, SLOTH, Mode::Slave), (0, SLOTJ, Mode::Slave), (1, SLOTM, Mode::Master)]
        .map(|(device, slot, mode)| bm4.node(device, slot, rate(500), mode));
    bm4.bring_up(&nodes.each_ref(), ..=Stage::SetUp);
    bm4.step(400_000);
    let master: Master = bm4.segment(1).view(SLOTM).unwrap();
    assert_eq!([master.a_STAT_SL[4].load(), master.a_STAT_SL[5].load()], [0x03; 2]);
    let findings = bm4.plant.journal().findings();
    assert!(findings.errors().is_empty(), "{:?}", findings.errors());
}

/// The PLC itself has no DIP switches (p. 26 describes the switches of a slave module), so the journal record of its
/// power-on names no number.
#[test]
fn the_power_on_of_a_plc_without_dip_switches_names_no_number() {
    let mut bm4 = Bm4::new(&plant_text(1000));
    bm4.plant.set_power(DeviceIndex(0), Power::Off);
    bm4.plant.set_power(DeviceIndex(0), Power::On);
    let up = OnBoard { plc: DeviceIndex(0), what: BoardEvent::Up { dip: None } };
    let record = bm4.plant.journal().records().find(|record| record.event == up.into()).unwrap();
    let mut text = String::new();
    Text::new(bm4.plant.names(), commram::devices::catalogue()).record(&record, &mut text);
    assert!(text.trim_end().ends_with("  on"), "{text}");
}

/// Manual p. 15 and 26: slaves of a bus must differ in their numbers, and the manual requires nothing else. A master
/// and two slaves of one PLC make a test bench.
#[test]
fn a_master_and_slaves_of_one_plc_share_a_bus() {
    let module = |slot: &str, rest: &str| format!("[[device.module]]\nslot = '{slot}'\nbus = 'b'\n{rest}\n");
    let slave = |dip: u8| format!("kind = 'can-05'\ndip = {dip}\nlock_time_us = 20000");
    let text = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n".to_owned()
        + &module("G", "kind = 'can-06'")
        + &module("H", &slave(1))
        + &module("M", &slave(2))
        + "[[bus]]\nname = 'b'\n";
    for rate in &BAUD_RATES {
        let mut bm4 = Bm4::new(&text);
        let master: Master = bm4.segment(0).view(SLOTG).unwrap();
        let slaves: [Slave; 2] = [SLOTH, SLOTM].map(|slot| bm4.segment(0).view(slot).unwrap());
        let nodes = [(SLOTH, Mode::Slave), (SLOTM, Mode::Slave), (SLOTG, Mode::Master)]
            .map(|(slot, mode)| bm4.node(0, slot, rate, mode));
        bm4.bring_up(&nodes.each_ref(), ..=Stage::SetUp);
        bm4.step(400_000);
        assert_eq!(
            [master.a_STAT_SL[1].load(), master.a_STAT_SL[2].load()],
            [0x03; 2],
            "{}",
            rate.kbit_per_s
        );
        bm4.bring_up(&nodes.each_ref(), Stage::Active..);
        master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
        master.a_CFG_RDC_WORD[2].b_CFG_RDC1_WORD0.store(0x01);
        for (number, slave) in slaves.iter().enumerate() {
            slave._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
            slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
            slave.a_RD_VALUE_SEND[0].store(0x10 + number as u32);
        }
        master.a_WR_VALUE[0].store(0x4321);
        master.b_CTRLREG_RD_ORDER_RDC1.store(2);
        bm4.run_to_sync(0, PortNumber(1));
        slaves.iter().for_each(|slave| slave.b_CTRLREG_RD_RDC1.store(0x05));
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(0, PortNumber(1));
        assert_eq!(slaves.each_ref().map(|slave| slave.a_WR_VALUE_RECEIVE[0].load()), [0x4321; 2]);
        assert_eq!((master.b_STATREG_RDC1.load(), master.a_RD_BMARRAY[2][0].load()), (2, 0x11));
        let findings = bm4.plant.journal().findings();
        assert!(findings.errors().is_empty(), "{:?}", findings.errors());
    }
}

/// Manual p. 15-16, 25: the module itself makes the SYNC signal, so it raises event 11 and answers its handshakes
/// without a bus. The journal has no frames and no edges of this module, because it has no bus. A slave without a bus
/// has no signal.
#[test]
fn a_master_without_a_bus_makes_its_sync_signal_for_the_plc() {
    let mut bm4 = Bm4::new(
        "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n[[device.module]]\nslot = 'G'\nkind = 'can-06'\n\
         [[device.module]]\nslot = 'H'\nkind = 'can-05'\n[[device.module]]\nslot = 'J'\nkind = 'can-06'\n\
         sync_in_from = 'G'\nbus = 'b'\n[[bus]]\nname = 'b'\n[[bus.drive]]\nname = 'd'\nslave_number = 1\n\
         lock_time_us = 20000\n",
    );
    let (rate, header) = (rate(500), bm4.segment(0).header().unwrap());
    let master: Master = bm4.segment(0).view(SLOTG).unwrap();
    let passed_on: Master = bm4.segment(0).view(SLOTJ).unwrap();
    let nodes = [(SLOTH, Mode::Slave), (SLOTG, Mode::Master), (SLOTJ, Mode::SyncIn)]
        .map(|(slot, mode)| bm4.node(0, slot, rate, mode));
    let request = header.interrupts[11].ask(0, true);
    header.submit_request();
    bm4.bring_up(&nodes[..2].iter().collect::<Vec<_>>(), ..);
    bm4.run_to_sync(0, PortNumber(1));
    assert_eq!(header.interrupts[11].outcome(request), Some(0));
    let rings = header.events[11].bell.rings();
    master.b_CTRLREG_WRC1.store(0x05);
    bm4.step(20_000);
    assert_eq!(header.events[11].bell.rings() - rings, 10, "every 2 ms");
    assert_eq!(master.b_CTRLREG_WRC1.load(), 0x04, "the firmware has sent it");
    assert_eq!(bm4.frames(), [], "there is no bus that it could be on");
    assert_eq!(header.sync_counter[1].load(), 0, "no signal at the slave");
    assert_eq!(bm4.plant.next_sync(DeviceIndex(0), PortNumber(2)), None);
    assert_eq!(bm4.plant.why_no_sync(DeviceIndex(0), PortNumber(2)), "maxx:slotH is at no bus");
    // A second master, in another slot, passes on the signal of the master without a bus.
    bm4.bring_up(&[&nodes[2]], ..=Stage::SetUp);
    bm4.step(100_000);
    assert_eq!(passed_on.a_STAT_SL[1].load(), 0x03, "the drive there is synchronized");
    assert_eq!(
        bm4.plant.next_sync(DeviceIndex(0), PortNumber(3)),
        bm4.plant.next_sync(DeviceIndex(0), PortNumber(1))
    );
    // The slave without a bus waits without end; the checker reports this at its start.
    assert_eq!(bm4.plant.journal().findings().errors(), [&rules::NO_MASTER]);
}

/// Manual p. 15-16, 50-51: a slave on a bus without a master never has a SYNC signal. A master that passes on the
/// signal of this slave has none either. The check of the plant warns of the bus, and the checker reports the start of
/// the slave.
#[test]
fn a_bus_without_a_master_gives_a_warning_and_a_finding() {
    let text = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n[[device.module]]\nslot = 'G'\nkind = 'can-06'\n\
                sync_in_from = 'H'\nbus = 'lower'\n[[device.module]]\nslot = 'H'\nkind = 'can-05'\nbus = 'upper'\n\
                [[bus]]\nname = 'lower'\n[[bus]]\nname = 'upper'\n";
    let doubts = PlantConfig::parse("p.toml", text).unwrap().doubts(text);
    let doubts: Vec<_> = doubts.iter().map(|(line, doubt)| (*line, doubt.text.as_str())).collect();
    assert_eq!(doubts, [(Some(16), "bus 'upper' has no master, so its stations wait without end")]);
    let mut bm4 = Bm4::new(text);
    let nodes =
        [(SLOTH, Mode::Slave), (SLOTG, Mode::SyncIn)].map(|(slot, mode)| bm4.node(0, slot, rate(500), mode));
    bm4.bring_up(&nodes.iter().collect::<Vec<_>>(), ..=Stage::SetUp);
    bm4.step(100_000);
    assert_eq!(bm4.plant.next_sync(DeviceIndex(0), PortNumber(1)), None);
    let findings = bm4.plant.journal().findings();
    let [found] = findings.iter().collect::<Vec<_>>()[..] else { panic!("one finding") };
    let name = found.last.name(bm4.plant.names().fitted(DeviceIndex(0)));
    assert_eq!((found.last.rule, name.as_deref()), (&rules::NO_MASTER, Some("slotH.b_MA_SL_MODE")));
}

/// Manual p. 49-51: a master that must pass on a SYNC signal and receives none waits; a finding and the refusal of a
/// step to the next edge name the reason.
#[test]
fn a_master_without_a_signal_to_pass_on_is_found() {
    for (sync_in, why) in [
        (
            "",
            "maxx:slotG is to pass a SYNC signal on (b_MA_SL_MODE 16#02), and no other port passes one to it",
        ),
        (
            "sync_in_from = 'H'\n",
            "maxx:slotG passes on the SYNC signal at maxx:slotH: the master of bus 'upper', top:slotM, has not \
             started: w_OPTION_STATUS is 16#0001; initialize it first",
        ),
    ] {
        let text = plant_text(500).replace("bus = 'fast'\n", &format!("bus = 'fast'\n{sync_in}"));
        let mut bm4 = Bm4::new(&text);
        bm4.bring_up(&[&bm4.node(0, SLOTG, rate(500), Mode::SyncIn)], ..=Stage::SetUp);
        bm4.step(100_000);
        assert_eq!(bm4.plant.next_sync(DeviceIndex(0), PortNumber(1)), None);
        assert_eq!(bm4.plant.why_no_sync(DeviceIndex(0), PortNumber(1)), why);
        let expected: &[_] = if sync_in.is_empty() { &[&rules::NO_SYNC_IN] } else { &[] };
        assert_eq!(bm4.plant.journal().findings().errors(), expected);
    }
    let mut bm4 = Bm4::new(&plant_text(500));
    assert_eq!(
        bm4.plant.why_no_sync(DeviceIndex(0), PortNumber(2)),
        "the master of bus 'upper', top:slotM, has not started: w_OPTION_STATUS is 16#0001; initialize it first"
    );
    bm4.plant.set_power(DeviceIndex(1), Power::Off);
    assert_eq!(
        bm4.plant.why_no_sync(DeviceIndex(0), PortNumber(2)),
        "the master of bus 'upper', top:slotM, has no power or is held in RESET"
    );
}

/// Manual p. 29-30: H1 shows frames that are sent and received, independently of the SYNC signal.
#[test]
fn the_first_led_shows_frames_and_not_the_sync_signal() {
    let mut bm4 = Bm4::new(&plant_text(500));
    let led = |bm4: &Bm4, device: usize, slot: usize| {
        Leds::of_code(bm4.segment(device).header().unwrap().ports[slot].leds.load()).h[0]
    };
    let (wrong, right) = (rate(1000), rate(500));
    let slave = bm4.node(0, SLOTH, wrong, Mode::Slave);
    let master = bm4.node(1, SLOTM, right, Mode::Master);
    bm4.bring_up(&[&slave, &master], ..=Stage::SetUp);
    bm4.step(50_000);
    let h3 = Leds::of_code(bm4.segment(0).header().unwrap().ports[1].leds.load()).h[2];
    assert_eq!((led(&bm4, 0, 1), h3), (Led::Off, Led::Flashes(2)), "SYNC comes, frames do not");
    assert_eq!(led(&bm4, 1, 5), Led::Flashes(1), "the master asks for status words");
    // A master without input data sends nothing in active operation.
    bm4.bring_up(&[&master], Stage::Active..);
    bm4.step(1_000_000);
    assert_eq!(led(&bm4, 1, 5), Led::Off);
    let registers: Master = bm4.segment(1).view(SLOTM).unwrap();
    bm4.run_to_sync(1, PortNumber(6));
    registers.b_CTRLREG_WRC1.store(0x05);
    bm4.step(10_000);
    assert_eq!(led(&bm4, 1, 5), Led::Flashes(1));
    // A slave at the right rate receives these frames.
    bm4.bring_up(&[&bm4.node(0, SLOTH, right, Mode::Slave)], ..=Stage::SetUp);
    assert_eq!(led(&bm4, 0, 1), Led::Off);
    bm4.run_to_sync(1, PortNumber(6));
    registers.b_CTRLREG_WRC1.store(0x05);
    bm4.step(10_000);
    assert_eq!(led(&bm4, 0, 1), Led::Flashes(1));
    bm4.step(200_000);
    assert_eq!((led(&bm4, 0, 1), led(&bm4, 1, 5)), (Led::Off, Led::Off), "nothing since");
}

/// Manual p. 76-77: `sync_loss_us` sets when a slave module loses its lock, as at every other slave (D-124).
#[test]
fn a_module_keeps_its_lock_for_the_time_that_the_plant_file_gives() {
    for (setting, is_locked) in [("", false), ("sync_loss_us = 60000\n", true)] {
        let text = plant_text(500).replace("dip = 6\n", &format!("dip = 6\n{setting}"));
        let mut bm4 = Bm4::new(&text);
        let nodes = [bm4.node(0, SLOTH, rate(500), Mode::Slave), bm4.node(1, SLOTM, rate(500), Mode::Master)];
        bm4.bring_up(&nodes.each_ref(), ..=Stage::SetUp);
        bm4.step(60_000);
        let master: Master = bm4.segment(1).view(SLOTM).unwrap();
        assert_eq!(master.a_STAT_SL[6].load(), 0x03);
        let spec = "kind = 'lose_sync'\nbus = 'upper'\nduration_us = 30000";
        let spec: FaultSpec = toml::from_str(spec).unwrap();
        bm4.plant.add_fault(spec.resolve(fault_kinds(), &bm4.plant.names()).unwrap()).unwrap();
        bm4.step(38_000);
        assert_eq!(master.a_STAT_SL[6].load() & 0x02 != 0, is_locked, "{setting}");
    }
}

/// Returns two PLCs: the master in the first PLC has slave 4, which is a slave of the controller in slot H of the
/// second PLC.
fn with_controllers_slave(switches: &str) -> Bm4 {
    Bm4::new(&format!(
        "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n[[device.module]]\nslot = 'H'\nkind = 'can-05'\nbus = 'b'\n\
         dip = 4\nlock_time_us = 20000\n{switches}\n[[device]]\nkind = 'bm4-plc'\nname = 'top'\n\
         [[device.module]]\nslot = 'M'\nkind = 'can-06'\nbus = 'b'\n[[bus]]\nname = 'b'\n"
    ))
}

/// Returns the LEDs of the module in slot H.
fn leds_of_slot_h(bm4: &Bm4) -> [Led; 4] {
    Leds::of_code(bm4.segment(0).header().unwrap().ports[1].leds.load()).h
}

/// Manual p. 16-19, 27, 30-32: DIP switch 9 at OFF makes a module a slave of the controller, for which the PLC has no
/// registers (D-649).
#[test]
fn a_slave_of_the_controller_is_a_drive_of_its_bus() {
    let mut bm4 = with_controllers_slave("dip9 = false");
    let rate = rate(500);
    assert_eq!(leds_of_slot_h(&bm4), [Led::Off, Led::On, Led::Off, Led::On], "waits for the master");
    let names: Vec<_> = bm4.plant.drives().into_iter().map(|drive| drive.name).collect();
    assert_eq!(names, ["maxx:slotH"]);
    let master: Master = bm4.segment(1).view(SLOTM).unwrap();
    let node = bm4.node(1, SLOTM, rate, Mode::Master);
    bm4.bring_up(&[&node], ..=Stage::SetUp);
    bm4.step(200_000);
    assert_eq!(master.a_STAT_SL[4].load(), 0x03, "bit 15 of its status word (p. 32)");
    assert_eq!(leds_of_slot_h(&bm4), [Led::Flashes(1), Led::Off, Led::Flashes(2), Led::Off]);
    bm4.bring_up(&[&node], Stage::Active..);
    master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
    master._CFG_WRC_WORD.b_CFG_WRC1_WORD1.store(0x03);
    master.a_CFG_RDC_WORD[4].b_CFG_RDC1_WORD0.store(0x01);
    master.a_CFG_RDC_WORD[4].b_CFG_RDC1_WORD1.store(0x03);
    master.a_WR_VALUE[0].store(4711);
    master.b_CTRLREG_RD_ORDER_RDC1.store(4);
    for _ in 0..4 {
        bm4.run_to_sync(1, PortNumber(6));
        master.b_CTRLREG_WRC1.store(0x05);
    }
    assert_eq!((master.b_STATREG_RDC1.load(), master.a_RD_BMARRAY[4][0].load()), (4, 4711), "its speed");
    // The slave and its PLC are in one unit and share its supply.
    bm4.plant.set_power(DeviceIndex(0), Power::Off);
    master.b_STATREG_RDC1.store(0x7F);
    for _ in 0..3 {
        bm4.run_to_sync(1, PortNumber(6));
        master.b_CTRLREG_WRC1.store(0x05);
    }
    assert_eq!((master.b_STATREG_RDC1.load(), leds_of_slot_h(&bm4)), (0x7F, [Led::Off; 4]));
    bm4.plant.set_power(DeviceIndex(0), Power::On);
    bm4.step(200_000);
    assert_eq!(
        leds_of_slot_h(&bm4)[..2],
        [Led::Off, Led::Off],
        "SYNC is there, frames were last seen before"
    );
    let findings = bm4.plant.journal().findings();
    assert!(findings.errors().is_empty(), "{:?}", findings.errors());
}

/// Manual p. 27: without `dip_baud` DIP switches 1 to 3 are set to the rate of the bus (D-649). The plant file defines
/// the number of a slave of the controller, and the error message mentions it.
#[test]
fn the_switches_of_a_controller_slave_default_to_the_rate_of_its_bus() {
    for (kbit_s, baud) in [(125, 0b011), (250, 0b100), (500, 0b101), (1000, 0b110)] {
        for (more, shown) in [("", baud), ("dip_baud = 0b011\n", 0b011)] {
            let bm4 = Bm4::new(&format!(
                "[[device]]\nkind = 'bm4-plc'\nname = 'm'\n[[device.module]]\nslot = 'J'\nkind = 'can-05'\nbus = 'b'\n\
                 dip = 5\ndip9 = false\n{more}[[bus]]\nname = 'b'\nkbit_s = {kbit_s}\n"
            ));
            let device = &bm4.plant.devices()[0];
            let modules = commram::devices::modules(device.header(), device.layout()).unwrap();
            let [(slot, front)] = &modules[..] else { panic!("{modules:?}") };
            let numbers = [("dip", Switch::Number(5)), ("dip_baud", Switch::Number(shown))];
            assert!(numbers.iter().all(|number| front.switches.contains(number)), "{kbit_s}: {front:?}");
            assert_eq!(*slot, "slotJ");
            let why = device.refusal(BoardSetting::ModuleDip { port: PortNumber(3), dip: 6 }).unwrap();
            assert!(why.contains("is set in the plant file"), "{why}");
        }
    }
}

/// Manual p. 31: H4 of a slave of the controller flashes during a fault, which is BUS-off (D-367). A drive has no
/// BUS-off, so commram refuses the fault, which would otherwise wait without effect (D-649). commram also refuses an
/// overrun, because a drive has no overrun.
#[test]
fn a_slave_of_the_controller_has_the_faults_of_a_drive() {
    let mut bm4 = with_controllers_slave("dip9 = false");
    let names = bm4.plant.names();
    let mut add = |text: &str| {
        let spec: FaultSpec = toml::from_str(text).unwrap();
        let fault = spec.resolve(fault_kinds(), &names).unwrap();
        bm4.plant.add_fault(fault).map(drop).map_err(|refusal| refusal.to_string())
    };
    for kind in ["bus_off", "overrun"] {
        let refused = add(&format!("kind = '{kind}'\nplc = 'maxx'\nnode = 'slotH'")).unwrap_err();
        assert!(
            refused.contains("slotH is a drive of its bus") && refused.contains("slave_off"),
            "{refused}"
        );
        assert_eq!(add(&format!("kind = '{kind}'\nplc = 'top'\nnode = 'slotM'")), Ok(()));
    }
    assert_eq!(add("kind = 'slave_off'\nbus = 'b'\nslave = 4"), Ok(()));
    let in_file = "[[device]]\nkind = 'bm4-plc'\nname = 'm'\n[[device.module]]\nslot = 'J'\nkind = 'can-05'\nbus = 'b'\n\
                   dip9 = false\n[[bus]]\nname = 'b'\n[[fault]]\nkind = 'bus_off'\nplc = 'm'\nnode = 'slotJ'\n";
    let refused = PlantConfig::parse("p.toml", in_file).unwrap_err().to_string();
    assert!(refused.contains("bus_off: slotJ is a drive of its bus"), "{refused}");
}

/// Manual p. 27 and 29-31: the LEDs show an error at initialization, and a position of DIP switches 1 to 3 that has no
/// baud rate.
#[test]
fn modules_with_wrong_switches_show_it_and_take_no_part() {
    let (together, alone) = (
        [Led::Off, Led::Flashes(1), Led::Off, Led::Flashes(1)],
        [Led::Off, Led::Flashes(1), Led::Off, Led::Off],
    );
    let in_turn = [Led::Off, Led::InTurn, Led::Off, Led::InTurn];
    for (switches, leds) in [
        ("dip10 = true", together),
        ("dip9 = false\ndip10 = true", alone),
        ("dip9 = false\ndip_baud = 0b111", in_turn),
        ("dip9 = false\ndip_baud = 0b010", in_turn),
    ] {
        let mut bm4 = with_controllers_slave(switches);
        assert_eq!(leds_of_slot_h(&bm4), leds, "{switches}");
        let slave: Slave = bm4.segment(0).view(SLOTH).unwrap();
        slave.w_CPU_CONTROL.store(0x0001);
        bm4.bring_up(&[&bm4.node(1, SLOTM, rate(500), Mode::Master)], ..=Stage::SetUp);
        bm4.step(200_000);
        let master: Master = bm4.segment(1).view(SLOTM).unwrap();
        assert_eq!((master.a_STAT_SL[4].load(), leds_of_slot_h(&bm4)), (0, leds), "{switches}");
        let shown = if switches == "dip10 = true" { 0x0001 } else { 0 };
        assert_eq!(slave.w_OPTION_STATUS.load(), shown, "{switches}: start up, or no register");
    }
}

/// 5.02066.01a p. 15-16, 26, 49-51: a configuration that keeps a module from working is allowed, and a warning names its line.
#[test]
fn modules_without_a_signal_give_a_warning() {
    let plant = |modules: &str| {
        let text = format!(
            "[[device]]\nkind = 'bm4-plc'\nname = 'm'\n{modules}[[bus]]\nname = 'b'\n[[bus]]\nname = 'c'\n"
        );
        let doubts = PlantConfig::parse("p.toml", &text).unwrap().doubts(&text);
        doubts.into_iter().map(|(line, doubt)| (line, doubt.text)).collect::<Vec<_>>()
    };
    let module = |slot: &str, rest: &str| format!("[[device.module]]\nslot = '{slot}'\n{rest}\n");
    let slave = module("H", "kind = 'can-05'\nbus = 'b'");
    let passes_on = "kind = 'can-06'\nsync_in_from = 'H'\nbus = ";
    let of_c = slave.clone() + &module("G", &format!("{passes_on}'c'"));
    let of_b = "[[device]]\nkind = 'bm4-plc'\nname = 'top'\n[[device.module]]\nslot = 'M'\nkind = 'can-06'\nbus = 'b'\n";
    assert_eq!(plant(&(of_c.clone() + of_b)), []);
    assert_eq!(
        plant(&of_c),
        [(Some(14), "bus 'b' has no master, so its stations wait without end".to_owned())]
    );
    for (modules, line, text) in [
        (module("G", "kind = 'can-06'"), 5, "module 'm:slotG' has no bus: its PLC has a SYNC signal"),
        (module("G", "kind = 'can-05'"), 5, "module 'm:slotG' has no bus: no SYNC signal"),
        (
            module("G", "kind = 'can-05'\nbus = 'b'\ndip10 = true"),
            8,
            "DIP switch 10 of module 'm:slotG' must be OFF",
        ),
        (
            module("G", "kind = 'can-05'\nbus = 'b'\ndip9 = false\ndip_baud = 7"),
            9,
            "DIP switches 3, 2 and 1 of module 'm:slotG' name no baud rate",
        ),
        (
            slave + &module("G", &format!("{passes_on}'b'")),
            11,
            "'m:slotG' can pass on the SYNC signal at slotH, and none can come from there: that module is on the same bus",
        ),
    ] {
        let doubts = plant(&modules);
        let [(at, found)] = &doubts[..] else { panic!("{doubts:?}") };
        assert!(*at == Some(line) && found.starts_with(text), "{doubts:?}");
    }
}

/// Manual p. 46 and 75: the example of the manual uses another name for an array than the tables on p. 59 and 90. Both
/// names are accepted.
#[test]
fn the_name_of_the_manuals_example_leads_to_the_register() {
    let bm4 = Bm4::new(&plant_text(500));
    let fitted = bm4.plant.names().fitted(DeviceIndex(0));
    for front in ["slotG", "_CANsyncMaster_Ctrl_Slot_G", "slotH", "_CANsyncSlave_Ctrl_Slot_H"] {
        let found = fitted.register(&format!("{front}.a_RD_VALUE[5][7]")).unwrap();
        let named = fitted.register(&format!("{front}.a_RD_BMARRAY[5][7]")).unwrap();
        assert_eq!((found.offset(), found.to_string()), (named.offset(), named.to_string()));
        assert_eq!(fitted.registers(&format!("{front}.a_RD_VALUE[5]")).unwrap().len(), 16);
    }
    let last = fitted.register("slotG.a_RD_VALUE[5][16]").unwrap_err().to_string();
    assert!(last.contains("a_RD_VALUE[5][16]"), "{last}");
}

/// An Omega Drive-Line II does not support 1 Mbit/s, so it receives nothing on such a bus.
#[test]
fn an_omega_hears_nothing_on_a_bus_of_1_mbit() {
    let mut bm4 = Bm4::new(
        "[[plc]]\nname = 'omega'\ndip = 5\nnode1 = 'b'\nlock_time_us = 20000\n\
         [[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n[[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'b'\n\
         [[bus]]\nname = 'b'\nkbit_s = 1000\n",
    );
    bm4.bring_up(&[&bm4.node(1, SLOTG, rate(1000), Mode::Master)], ..=Stage::SetUp);
    bm4.bring_up(&[&bm4.node(0, omega::NODE1, &omega::BAUD_RATES[0], Mode::Slave)], ..=Stage::SetUp);
    bm4.step(100_000);
    let polled: Master = bm4.segment(1).view(SLOTG).unwrap();
    assert_eq!(polled.a_STAT_SL[5].load(), 0, "it does not answer");
    let findings = bm4.plant.journal().findings();
    assert_eq!(findings.errors(), [&rules::BUS_BAUD_RATE]);
}
