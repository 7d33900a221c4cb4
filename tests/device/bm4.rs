//! The b maXX PLC: its modules on buses, at its own rates.

mod vectors;

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::plant_of;
use commram::devices::Led;
use commram::devices::bm4_o_can_06::Leds;
use commram::devices::bm4_o_can_06::blocks::{CANsync_INIT, INTR_SET, Ram};
use commram::devices::bm4_o_can_06::registers::*;
use commram::devices::cansync::bus::Frame;
use commram::devices::cansync::records::Transmitted;
use commram::devices::cansync::{BaudRate, registers as family, rules};
use commram::devices::fault_kinds;
use commram::devices::omega_drive_line_2::registers as omega;
use commram::devices::records::{BoardEvent, OnBoard};
use commram::fault::FaultSpec;
use commram::journal::Format;
use commram::journal::text::Text;
use commram::memory::header::BoardSetting;
use commram::memory::{Segment, View};
use commram::plant::{Plant, Power};
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

    fn node(&self, device: usize, base: usize, timing: &'static BaudRate, mode: Mode) -> Node {
        Node::at(&self.segment(device), base, timing, mode).expecting(match mode {
            Mode::Slave => 0..0,
            _ => 0..8,
        })
    }

    #[track_caller]
    fn bring_up(&mut self, nodes: &[&Node], stages: impl RangeBounds<Stage>) {
        bring_up_in(&mut self.plant, nodes, stages);
    }

    fn run_to_sync(&mut self, device: usize, port: u8) {
        let edge = self.plant.next_sync(device, port).expect("there is a SYNC signal");
        self.plant.advance_to(edge);
    }

    /// All frames so far with the time of their end.
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

/// A master in slot G with a drive at its bus, and a slave in slot H at the bus of another b maXX PLC.
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
        bm4.run_to_sync(0, 1);
        let edge = bm4.plant.now();
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(0, 1);
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
        bm4.run_to_sync(1, 6);
        slave.b_CTRLREG_RD_RDC2.store(0x05);
        master.b_CTRLREG_WRC2.store(0x05);
        bm4.run_to_sync(1, 6);
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
        bm4.run_to_sync(0, 1);
        bm4.step(at);
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(0, 1);
        assert_eq!(bm4.last_frame(0x100..=0x17F).is_some(), in_time, "{at} us");
    }
}

/// Manual 5.02066.01a p. 25, 28-31: event 11 is that of the module that `sync_source` names; LEDs of master and slave.
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
    bm4.run_to_sync(0, 1);
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

/// An Omega Drive-Line II and a b maXX PLC on one bus, each in turn the master, at the rates that both have.
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
        let port = if bmaxx_is_master { 4 } else { 2 };
        bm4.run_to_sync(master_at.0, port);
        master.b_CTRLREG_WRC1.store(0x05);
        bm4.run_to_sync(master_at.0, port);
        assert_eq!(slave.a_WR_VALUE_RECEIVE[0].load(), 0x4321, "{kbit_s} kbit/s, {bmaxx_is_master}");
        assert_eq!(slave.b_CTRLREG_WRC1.load(), 0x02);
    }
}

/// SYNC from outside: the master in slot G passes on what the slave in slot H receives (D-12).
#[test]
fn a_master_passes_the_sync_signal_of_another_slot_on() {
    let text = plant_text(500).replace("bus = 'fast'\n", "bus = 'fast'\nsync_in_from = 'H'\n");
    let mut bm4 = Bm4::new(&text);
    let rate = rate(500);
    let header = bm4.segment(0).header().unwrap();
    bm4.bring_up(&[&bm4.node(0, SLOTG, rate, Mode::SyncIn)], ..=Stage::SetUp);
    bm4.step(10_000);
    assert_eq!(header.sync_counter[0].load(), 0, "nobody makes a SYNC signal");
    bm4.bring_up(&[&bm4.node(1, SLOTM, rate, Mode::Master)], ..=Stage::SetUp);
    bm4.run_to_sync(1, 6);
    let before = header.sync_counter[0].load();
    bm4.step(10_000);
    assert_eq!(header.sync_counter[0].load() - before, 5);
}

/// D-29: where 16#0000 stood before, the RAM does not show a restart; the block tells of it, for its own slot.
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
    let told = || header.ports.iter().map(|port| port.restarts_written.load()).take(6).collect::<Vec<_>>();
    let before = told();
    let ram = Ram::of(&bm4.segment(1)).unwrap();
    let base = ram.at::<CANsync_PLC_INIT_BMSTRUCT>(SLOTM).unwrap();
    CANsync_INIT { us_BAUDRATE: 6, us_SYNC_INTERVAL: 1, ..Default::default() }.call(&base);
    assert_eq!(told(), [&before[..5], &[before[5] + 1]].concat());
    bm4.step(500);
    assert_eq!(init.w_OPTION_STATUS.load(), 0x0001);
}

/// P. 25: event 11 by the block, every other one is refused.
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

/// P. 27: DIP switches give a slave its number; a master has none, and an empty slot has no switches.
#[test]
fn slave_modules_alone_have_switches_that_can_be_set() {
    let mut bm4 = Bm4::new(&plant_text(1000));
    let dips = |bm4: &Bm4| {
        let header = bm4.segment(0).header().unwrap();
        header.ports.iter().take(6).map(|port| port.dip.load()).collect::<Vec<_>>()
    };
    for port in 1..=6 {
        let (before, dip) = (dips(&bm4), 8 + port);
        let is_set = bm4.plant.set_board(0, BoardSetting::ModuleDip { port, dip });
        let mut expected = before;
        if is_set {
            expected[usize::from(port) - 1] = dip.into();
        }
        assert_eq!((is_set, dips(&bm4)), (port == 2, expected), "port {port}");
    }
}

/// P. 27: a slave number that somebody else has.
#[test]
fn a_number_that_is_taken_is_told_with_its_slot() {
    let text =
        format!("{}[[bus.drive]]\nname = 'other'\nslave_number = 7\ncard_function = 0\n", plant_text(1000));
    let mut bm4 = Bm4::new(&text);
    bm4.segment(0).header().unwrap().ports[1].dip.store(7);
    bm4.plant.set_power(0, Power::Off);
    bm4.plant.set_power(0, Power::On);
    let taken = OnBoard { plc: 0, what: BoardEvent::NumberTaken { port: 2, number: 7 } };
    let record = bm4.plant.journal().records().find(|record| record.event == taken.into()).unwrap();
    let mut text = String::new();
    Text::new(bm4.plant.names(), commram::devices::catalogue()).record(record, &mut text);
    assert!(text.contains("nobody can address slotH"), "{text}");
}

/// An Omega Drive-Line II knows no 1 Mbit/s: it hears nothing there.
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
