//! Whoever goes on from a snapshot goes on as whoever did not stop, whatever the plant is and whatever happens to it.

use crate::rig::bring_up::{Mode, Node};
use crate::rig::{RATES, Rate, plant_of};
use commram::can::{Frame, Payload};
use commram::devices::can_dp2::registers::values::mst_control;
use commram::devices::can_dp2::registers::{CAN_DP2_MST, MST};
use commram::devices::cansync::records::InitRefused;
use commram::devices::{Device, all, fault_kinds};
use commram::door::Said;
use commram::fault::FaultSpec;
use commram::journal::{Keep, Record};
use commram::layout::{Role, Width};
use commram::memory::header::{BoardSetting, Start};
use commram::plant::{Forced, Plant, PlantConfig};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

const OMEGA: &str = "[[plc]]\nname = 'a'\nnode2 = 'drives'\noption_sync_us = 1000\n\
                     [[plc]]\nname = 'b'\nnode1 = 'drives'\nnode2 = 'lower'\n\
                     [[bus]]\nname = 'drives'\nkbit_s = 500\n\
                     [[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 8000\nramp_per_second = 100000\n\
                     [[bus]]\nname = 'lower'\nkbit_s = 250\n\
                     [[fault]]\nkind = 'lose_sync'\nbus = 'drives'\nat_us = 90000\ncount = 2\n";

/// With a drive that hands its reference values over two intervals later.
const BM4: &str = "[[device]]\nkind = 'bm4-plc'\nname = 'a'\n\
                   [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'drives'\n\
                   [[device.module]]\nslot = 'H'\nkind = 'can-05'\nbus = 'upper'\n\
                   [[device.module]]\nslot = 'J'\nkind = 'can-06'\nbus = 'lower'\nsync_in_from = 'H'\n\
                   [[bus]]\nname = 'drives'\nkbit_s = 500\n\
                   [[bus.drive]]\nname = 'd1'\nslave_number = 1\ncard_function = 0\nlock_time_us = 8000\n\
                   [bus.drive.zk]\nzk_0 = 0x12C\nzk_4 = 0x41\nzk_16 = 0x12D\nzk_20 = 0x41\nzk_24 = 2\n\
                   [[bus]]\nname = 'upper'\nkbit_s = 500\n[[bus]]\nname = 'lower'\nkbit_s = 500\n";

/// A master with a slave and modules that it finds and guards, and a controller whose orders come from the job block.
const CANOPEN: &str = "[[device]]\nkind = 'cs0015'\nname = 'master'\nbus = 'open'\nnode_id = 1\nprogram = 'master'\n\
                       nodes = [5]\nguard_ms = 20\nlife = 3\nsync_ms = 10\n\
                       pdo_tx = [{ pdo = 3, id = 0x3A0 }]\npdo_rx = [{ pdo = 3, id = 0x3B0 }]\n\
                       [[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'open'\nnode_id = 5\n\
                       guarding = { guard_time_ms = 100, life_time = 3, cycle_period_ms = 30 }\n\
                       pdo_tx = [{ pdo = 3, id = 0x3B0 }]\npdo_rx = [{ pdo = 3, id = 0x3A0 }]\n\
                       [[device]]\nkind = 'cs0015'\nname = 'free'\nbus = 'open'\nnode_id = 7\nprogram = 'attached'\n\
                       [[device]]\nkind = 'cr201x'\nname = 'io'\nbus = 'open'\nnode_id = 9\nmodule = 'cr2011'\n\
                       [[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";

const GATEWAY: &str = "[[device]]\nkind = 'can-dp2'\nname = 'gw'\nprofibus = 'dp'\ncan = 'open'\nswitches = 5\n\
                       [[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'open'\n\
                       [[bus]]\nname = 'dp'\nkind = 'profibus'\nkbit_s = 500\n\
                       [[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";

const PLANTS: [&str; 4] = [OMEGA, BM4, CANOPEN, GATEWAY];

/// Each with its place, which are filled in.
const FAULTS: [&str; 9] = [
    "kind = 'lose_frame'\nbus = '{bus}'\ncount = 3",
    "kind = 'delay_frame'\nbus = '{bus}'\ndelay_us = 1500\ncount = 2",
    "kind = 'duplicate_frame'\nbus = '{bus}'\ndelay_us = 900\nduration_us = 5000",
    "kind = 'jitter_sync'\nbus = '{bus}'\namplitude_us = 400\nduration_us = 9000",
    "kind = 'slave_off'\nbus = '{bus}'\nslave = 1\nduration_us = 7000",
    "kind = 'bus_off'\nplc = '{plc}'\nnode = '{port}'",
    "kind = 'overrun'\nplc = '{plc}'\nnode = '{port}'\ncount = 3",
    "kind = 'error_frame'\nbus = '{bus}'\ncount = 4",
    "kind = 'drive_fault'\nbus = '{bus}'\nslave = 1\nfault = 5",
];

/// Telegrams to the gateway's slave: Set_Prm, Chk_Cfg, data exchange, diagnosis.
const TELEGRAMS: [(u8, &[u8]); 5] = [
    (61, &[0x80, 0, 0, 11, 0x04, 0xA4, 0, 0, 6, 0, 5, 0, 0, 0, 0, 0]),
    (62, &[0x83, 1, 2, 3, 0, 0x43, 1, 2, 0x89, 0]),
    (255, &[0x12, 0x34]),
    (255, &[0x56, 0x78]),
    (60, &[]),
];

#[derive(Clone, Debug)]
enum Act {
    /// A register of a device, by its number, through the map or through the channel.
    Store {
        device: usize,
        register: usize,
        value: u32,
        through_channel: bool,
    },
    /// All nodes of CANsync are brought a step further.
    Command(u16),
    InitData,
    /// Masters release this reference value.
    Reference(u32),
    Board {
        device: usize,
        setting: BoardSetting,
    },
    Event {
        device: usize,
        event: usize,
        factor: u16,
    },
    Fault {
        kind: usize,
        device: usize,
        bus: usize,
    },
    ClearFaults,
    Force {
        device: usize,
        register: usize,
        value: u32,
    },
    Guest {
        bus: usize,
        id: u16,
    },
    Telegram(usize),
    Follow {
        device: usize,
        register: usize,
    },
    ClearFindings,
    Pass(u64),
}

fn act() -> impl Strategy<Value = Act> {
    let value = prop_oneof![
        any::<u32>(),
        prop::sample::select(vec![0, 1, 2, 3, 4, 5, 0x15, 0x20, 0x40, 0x80, 0x85, 0xC0])
    ];
    let setting = prop::sample::select(vec![
        BoardSetting::Dip(7),
        BoardSetting::Power(commram::memory::header::Power::Off),
        BoardSetting::Power(commram::memory::header::Power::On),
        BoardSetting::Project(commram::memory::header::Project::Sent),
        BoardSetting::Start(Start::Cold),
        BoardSetting::Switch(commram::memory::header::RunSwitch::Stop),
        BoardSetting::Switch(commram::memory::header::RunSwitch::Run),
        BoardSetting::Front { word: 4, value: 0x55 },
    ]);
    let (device, register) = (0..4usize, any::<usize>());
    prop_oneof![
        6 => (device.clone(), register, value.clone(), any::<bool>())
            .prop_map(|(device, register, value, through_channel)| Act::Store { device, register, value, through_channel }),
        4 => prop::sample::select(vec![0u16, 1, 2, 0x20, 0x40, 0x80]).prop_map(Act::Command),
        2 => Just(Act::InitData),
        4 => any::<u32>().prop_map(Act::Reference),
        1 => (device.clone(), setting).prop_map(|(device, setting)| Act::Board { device, setting }),
        1 => (device.clone(), 0..16usize, 1..9u16).prop_map(|(device, event, factor)| Act::Event { device, event, factor }),
        2 => (0..FAULTS.len(), device.clone(), 0..3usize).prop_map(|(kind, device, bus)| Act::Fault { kind, device, bus }),
        1 => Just(Act::ClearFaults),
        1 => (device.clone(), any::<usize>(), value).prop_map(|(device, register, value)| Act::Force { device, register, value }),
        2 => (0..3usize, 0..0x7FFu16).prop_map(|(bus, id)| Act::Guest { bus, id }),
        4 => (0..TELEGRAMS.len()).prop_map(Act::Telegram),
        1 => (device, any::<usize>()).prop_map(|(device, register)| Act::Follow { device, register }),
        1 => Just(Act::ClearFindings),
        8 => (1..9000u64).prop_map(Act::Pass),
    ]
}

/// The registers of a device, as offsets and widths.
fn registers(plant: &Plant, device: usize) -> Vec<(u32, Width)> {
    let Some(device) = plant.devices().get(device) else { return Vec::new() };
    let (fitted, areas) = (device.fitted(), device.layout().areas);
    let registers = areas.iter().flat_map(|area| fitted.used_registers(area));
    let places: BTreeMap<_, _> =
        registers.map(|register| (register.offset(), register.address().width())).collect();
    places.into_iter().collect()
}

/// The nodes of CANsync: the segment of each and where its area begins.
fn nodes(plant: &Plant) -> Vec<(usize, u32)> {
    let devices = plant.devices().iter().enumerate();
    let nodes = devices.flat_map(|(index, device)| {
        let ports = device.layout().ports.iter().filter(|port| port.medium == "cansync");
        ports.map(move |port| (index, port.area.first))
    });
    nodes.collect()
}

/// A node of CANsync that is a master.
struct Master<'a> {
    device: &'a dyn Device,
    node: &'static str,
}

impl Master<'_> {
    fn place(&self, register: &str) -> (u32, Width) {
        let register = self.device.fitted().register(&format!("{}.{register}", self.node)).unwrap();
        (register.offset(), register.address().width())
    }

    fn store(&self, register: &str, value: u32) {
        let (offset, width) = self.place(register);
        self.device.segment().store(offset, width, value).unwrap();
    }

    fn load(&self, register: &str) -> u32 {
        let (offset, width) = self.place(register);
        self.device.segment().load(offset, width).unwrap()
    }
}

fn masters(plant: &Plant) -> impl Iterator<Item = Master<'_>> {
    plant.devices().iter().flat_map(|device| {
        let nodes = device.layout().ports.iter().filter(|port| port.medium == "cansync");
        let is_master = |number| device.fitted().port(number).role() == Some(Role::Master);
        let masters = nodes.filter(move |port| port.role() == Some(Role::Master) || is_master(port.number));
        masters.map(move |port| Master { device: device.as_ref(), node: port.name })
    })
}

fn take(plant: &mut Plant, act: &Act) {
    let count = plant.devices().len();
    let place = |plant: &Plant, device: usize, register: usize| {
        let registers = registers(plant, device % count);
        (!registers.is_empty()).then(|| registers[register % registers.len()])
    };
    match *act {
        Act::Store { device, register, value, through_channel } => {
            let Some((offset, width)) = place(plant, device, register) else { return };
            let value = value & width.max_value();
            if through_channel {
                plant.store(device % count, offset, width, value).unwrap();
            } else {
                plant.devices()[device % count].segment().store(offset, width, value).unwrap();
            }
        }
        Act::Command(value) => {
            for (device, base) in nodes(plant) {
                plant.store(device, base, Width::Word, value.into()).unwrap();
            }
        }
        Act::InitData => init_data(plant),
        Act::Reference(value) => {
            for master in masters(plant) {
                master.store("a_WR_VALUE[0]", value);
                master.store("b_CTRLREG_WRC1", 0x05);
            }
        }
        Act::Board { device, setting } => {
            plant.set_board(device % count, setting);
        }
        Act::Event { device, event, factor } => {
            let header = plant.devices()[device % count].header();
            let request = u32::from(factor) << 16 | 1;
            header.interrupts[event].request.store(request);
            header.submit_request();
        }
        Act::Fault { kind, device, bus } => {
            let names = plant.names();
            let device = plant.devices()[device % count].layout();
            let text = FAULTS[kind]
                .replace("{bus}", &names.buses[bus % names.buses.len()])
                .replace("{plc}", &names.plcs[kind % names.plcs.len()])
                .replace("{port}", device.ports[0].name);
            let spec: FaultSpec = toml::from_str(&text).unwrap();
            // Not every bus can have every fault.
            if let Ok(fault) = spec.resolve(fault_kinds(), &names) {
                let _ = plant.add_fault(fault);
            }
        }
        Act::ClearFaults => {
            plant.clear_faults();
        }
        Act::Force { device, register, value } => {
            let Some((offset, width)) = place(plant, device, register) else { return };
            let plc = (device % count) as u16;
            if !plant.unforce(plc, offset) {
                // Where structures of other widths overlay each other nothing can be forced.
                let _ = plant.force(Forced { plc, offset, width, value: value & width.max_value() });
            }
        }
        Act::Guest { bus, id } => {
            let bus = (bus % plant.media().len()) as u16;
            plant.guest_joins(bus, 3, true);
            let frame = Frame::standard(id, Payload::new(&id.to_le_bytes()).unwrap());
            let _ = plant.guest_sends(bus, 3, &Said::Frame(frame));
            plant.guest_leaves(bus, 3);
        }
        Act::Telegram(which) => {
            let mut devices = plant.devices().iter();
            let Some(gateway) = devices.find(|device| device.layout().name == "can-dp2") else { return };
            let mst = gateway.segment().view::<CAN_DP2_MST>(MST).unwrap();
            let (dsap, octets) = TELEGRAMS[which];
            mst.mst_dsap.store(dsap);
            mst.mst_request_len.store(octets.len() as u8);
            mst.mst_request.iter().zip(octets).for_each(|(cell, octet)| cell.store(*octet));
            mst.mst_control.store(mst_control::SEND);
        }
        Act::Follow { device, register } => {
            let Some((offset, width)) = place(plant, device, register) else { return };
            plant.follow_registers(device % count, offset, width.bytes(), Keep::InJournal).unwrap();
        }
        Act::ClearFindings => plant.clear_findings(),
        Act::Pass(us) => plant.advance_to(plant.now() + us),
    }
}

/// Initialization data for all nodes of CANsync, at 500 kbit/s.
fn init_data(plant: &Plant) {
    for (device, base) in nodes(plant) {
        let device = &plant.devices()[device];
        let layout = device.layout();
        let Some(port) = layout.ports.iter().find(|port| port.area.first == base) else { continue };
        let mode = match port.role().or(device.fitted().port(port.number).role()) {
            Some(Role::Master) => Mode::Master,
            Some(_) => Mode::Slave,
            None => continue,
        };
        let at_500 = |rate: &&Rate| rate.kind.layout == layout && rate.timing.kbit_per_s == 500;
        let rate = RATES.iter().find(at_500).unwrap();
        Node::at(device.segment(), base as usize, rate.timing, mode).write_init_data();
    }
}

/// All nodes of CANsync into active operation, the gateway into data exchange.
pub(crate) fn bring_up(plant: &mut Plant) {
    let up = [
        Act::Command(0),
        Act::Command(1),
        Act::InitData,
        Act::Command(2),
        Act::Command(0x20),
        Act::Command(0x40),
    ];
    let telegrams = [0, 0, 1, 4, 2].map(Act::Telegram);
    for act in up.iter().chain(&telegrams) {
        // What the time slots hold counts from the start of the network on.
        for master in masters(plant) {
            master.store("_CFG_WRC_WORD.b_CFG_WRC1_WORD0", 0x01);
            master.store("_CFG_WRC_WORD.b_CFG_WRC1_WORD1", 0x03);
        }
        take(plant, act);
        plant.advance_to(plant.now() + 4_000);
    }
}

/// What comes up is at work: reference values go out.
#[test]
fn masters_that_have_come_up_send_reference_values() {
    for text in [OMEGA, BM4] {
        let mut plant = plant_of(text);
        bring_up(&mut plant);
        take(&mut plant, &Act::Reference(7));
        plant.advance_to(plant.now() + 10_000);
        let sent: Vec<_> = masters(&plant).map(|master| master.load("b_CTRLREG_WRC1")).collect();
        assert_eq!(sent, [0x04; 2], "{text}");
    }
}

fn records_from(plant: &Plant, from: u64) -> Vec<Record> {
    plant.journal().read(from).copied().collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn going_on_from_a_snapshot_is_going_on(
        which in 0..PLANTS.len(),
        comes_up in prop::bool::weighted(0.7),
        before in prop::collection::vec(act(), 0..60),
        behind in prop::collection::vec(act(), 1..25),
    ) {
        let mut plant = plant_of(PLANTS[which]);
        if comes_up {
            bring_up(&mut plant);
        }
        for act in &before {
            take(&mut plant, act);
        }
        let snapshot = plant.snapshot();
        let position = plant.journal().end();
        let mut other = plant_of(PLANTS[which]);
        prop_assert_eq!(other.restore(&snapshot), Ok(()));
        prop_assert!(other.snapshot() == snapshot, "what is restored is what was saved");
        for act in &behind {
            take(&mut plant, act);
            take(&mut other, act);
        }
        plant.advance_to(plant.now() + 3_000);
        other.advance_to(other.now() + 3_000);
        let journals = [&plant, &other].map(|plant| {
            let journal = plant.journal();
            let findings: Vec<_> = journal.findings().iter().copied().collect();
            (journal.written(), journal.hash(), records_from(plant, position), journal.pending(), findings)
        });
        prop_assert_eq!(&journals[0], &journals[1]);
        prop_assert!(plant.snapshot() == other.snapshot(), "all registers and all firmware");
        // And back to where it was, with the records up to there.
        let records = records_from(&plant, 0).into_iter().filter(|record| record.seq < position).collect::<Vec<_>>();
        prop_assert_eq!(plant.go_back(&snapshot), Ok(()));
        prop_assert_eq!(records_from(&plant, 0), records);
        prop_assert!(plant.snapshot() == snapshot);
        for act in &behind {
            take(&mut plant, act);
        }
        plant.advance_to(plant.now() + 3_000);
        prop_assert_eq!(plant.journal().hash(), journals[0].1);
        prop_assert!(plant.snapshot() == other.snapshot());
    }
}

/// Initialization data that mean nothing are told once, on this side of a snapshot or on that.
#[test]
fn what_was_told_is_not_told_again_behind_a_snapshot() {
    for text in [OMEGA, BM4] {
        let mut plant = plant_of(text);
        for command in [0, 1, 2] {
            take(&mut plant, &Act::Command(command));
            plant.advance_to(plant.now() + 2_000);
        }
        let told =
            plant.journal().records().filter(|record| record.event.get::<InitRefused>().is_some()).count();
        assert!(told > 0, "nothing is refused");
        let mut other = plant_of(text);
        other.restore(&plant.snapshot()).unwrap();
        for plant in [&mut plant, &mut other] {
            take(plant, &Act::Store { device: 0, register: 3, value: 0, through_channel: true });
            plant.advance_to(plant.now() + 5_000);
        }
        assert_eq!(plant.journal().hash(), other.journal().hash());
    }
}

#[test]
fn every_device_of_the_registry_is_in_one_of_these_plants() {
    let plants: Vec<Plant> = PLANTS.iter().map(|text| plant_of(text)).collect();
    let devices = plants.iter().flat_map(|plant| plant.devices());
    let tried: BTreeSet<_> = devices.map(|device| device.layout().name).collect();
    assert_eq!(tried, all().iter().map(|device| device.layout.name).collect());
}

#[test]
fn another_plant_is_refused_by_name_and_the_plant_goes_on_as_it_was() {
    let mut plant = plant_of(OMEGA);
    plant.advance_to(5_000);
    let before = plant.snapshot();
    let error = plant.restore(&plant_of(BM4).snapshot()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "it is of another plant: it has PLCs a and buses drives (cansync), upper (cansync), lower (cansync), here \
         there are PLCs a, b and buses drives (cansync), lower (cansync)"
    );
    let other =
        plant_of(&OMEGA.replace("name = 'd1'", "name = 'd0'\nslave_number = 2\n[[bus.drive]]\nname = 'd1'"));
    let error = plant.restore(&other.snapshot()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the plant file that it is of sets bus 'drives' or what is at it otherwise; start its plant by `commram run --from`"
    );
    assert!(plant.snapshot() == before);
    plant.advance_to(10_000);
}

#[test]
fn a_snapshot_is_small() {
    let mut plant = Plant::new(&PlantConfig::built_in().unwrap(), |_, device| {
        Ok::<_, Box<dyn std::error::Error>>(commram::memory::Segment::of(device))
    })
    .unwrap();
    plant.advance_to(1_000_000);
    assert!(plant.snapshot().size() < 64 * 1024, "{}", plant.snapshot().size());
}

#[test]
fn bells_and_counters_of_events_never_go_back() {
    let mut plant = plant_of(OMEGA);
    let snapshot = plant.snapshot();
    let header = plant.devices()[0].header();
    header.doorbell.ring();
    header.events[3].fire(7);
    header.sync_counter[1].increment();
    let count = |plant: &Plant| {
        let header = plant.devices()[0].header();
        (header.doorbell.rings(), header.events[3].bell.rings(), header.sync_counter[1].load())
    };
    let counted = count(&plant);
    plant.advance_to(1_000);
    plant.go_back(&snapshot).unwrap();
    assert_eq!((count(&plant), plant.now()), (counted, 0));
    assert_eq!(plant.devices()[0].header().virtual_time_us.load(), 0);
}

/// Lets time pass from event to event: whoever asks for each processor cycle gets each.
fn pass_each(plant: &mut Plant, us: u64) {
    let end = plant.now() + us;
    while plant.next_event() <= end {
        plant.advance_to(plant.next_event());
    }
    plant.advance_to(end);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn looks_that_are_left_out_are_missed_by_nobody(
        which in 0..PLANTS.len(),
        comes_up in prop::bool::weighted(0.3),
        acts in prop::collection::vec(act(), 1..40),
    ) {
        let mut plants = [plant_of(PLANTS[which]), plant_of(PLANTS[which])];
        for plant in &mut plants {
            if comes_up {
                bring_up(plant);
            }
        }
        let [swift, thorough] = &mut plants;
        for act in &acts {
            if let Act::Pass(us) = act {
                // Long enough for counts of the journal to end.
                let us = us * 40;
                swift.advance_to(swift.now() + us);
                pass_each(thorough, us);
            } else {
                take(swift, act);
                take(thorough, act);
            }
            prop_assert!(swift.snapshot() == thorough.snapshot(), "{act:?}");
        }
        prop_assert_eq!(swift.journal().hash(), thorough.journal().hash());
        prop_assert_eq!(records_from(swift, 0), records_from(thorough, 0));
        prop_assert_eq!(swift.journal().pending(), thorough.journal().pending());
    }
}

#[test]
fn a_plant_that_nobody_has_started_rests() {
    for text in [OMEGA.split("[[fault]]").next().unwrap(), BM4] {
        let text = text.replace("option_sync_us = 1000", "");
        let mut plant = plant_of(&text);
        plant.advance_to(1_000);
        assert_eq!(plant.next_change(), u64::MAX);
        plant.store(0, nodes(&plant)[0].1, Width::Word, 1).unwrap();
        assert_eq!(plant.next_change(), plant.next_event(), "there is something to look at");
        plant.advance_to(plant.next_event());
    }
}
