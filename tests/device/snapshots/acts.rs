//! Plants of all devices, and random events for them.

use crate::rig::bring_up::{Mode, Node};
use crate::rig::{RATES, Rate};
use commram::can::{Frame, Payload};
use commram::devices::can_dp2::registers::values::mst_control;
use commram::devices::can_dp2::registers::{CAN_DP2_MST, MST};
use commram::devices::{Device, fault_kinds};
use commram::door::BusMessage;
use commram::fault::FaultSpec;
use commram::identity::{BusIndex, DeviceIndex};
use commram::journal::Keep;
use commram::layout::{Port, Role, Width};
use commram::memory::header::{BoardSetting, Start};
use commram::plant::{Forced, Plant};
use proptest::prelude::*;
use std::collections::BTreeMap;

pub(super) const OMEGA: &str = "[[plc]]\nname = 'a'\nnode2 = 'drives'\noption_sync_us = 1000\n\
                     [[plc]]\nname = 'b'\nnode1 = 'drives'\nnode2 = 'lower'\n\
                     [[bus]]\nname = 'drives'\nkbit_s = 500\n\
                     [[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 8000\nramp_per_second = 100000\n\
                     [[bus]]\nname = 'lower'\nkbit_s = 250\n\
                     [[fault]]\nkind = 'lose_sync'\nbus = 'drives'\nat_us = 90000\ncount = 2\n";

/// A plant with a drive that applies its reference values two intervals later.
pub(super) const BM4: &str = "[[device]]\nkind = 'bm4-plc'\nname = 'a'\n\
                   [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'drives'\n\
                   [[device.module]]\nslot = 'H'\nkind = 'can-05'\nbus = 'upper'\n\
                   [[device.module]]\nslot = 'J'\nkind = 'can-06'\nbus = 'lower'\nsync_in_from = 'H'\n\
                   [[bus]]\nname = 'drives'\nkbit_s = 500\n\
                   [[bus.drive]]\nname = 'd1'\nslave_number = 1\ncard_function = 0\nlock_time_us = 8000\n\
                   [bus.drive.zk]\nzk_0 = 0x12C\nzk_4 = 0x41\nzk_16 = 0x12D\nzk_20 = 0x41\nzk_24 = 2\n\
                   [[bus]]\nname = 'upper'\nkbit_s = 500\n[[bus]]\nname = 'lower'\nkbit_s = 500\n";

/// A master with a slave and modules that it finds and guards, and a controller that gets its orders from the job block.
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

pub(super) const PLANTS: [&str; 4] = [OMEGA, BM4, CANOPEN, GATEWAY];

/// Faults, each with placeholders for its place.
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
pub(super) enum Act {
    /// A register of a device, by its number, through the map or through the channel.
    Store {
        device: usize,
        register: usize,
        value: u32,
        through_channel: bool,
    },
    /// All CANsync nodes get this command, which leads to the next stage.
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

pub(super) fn act() -> impl Strategy<Value = Act> {
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

/// Returns the registers of a device, as offsets and widths.
fn registers(plant: &Plant, device: usize) -> Vec<(u32, Width)> {
    let Some(device) = plant.devices().get(device) else { return Vec::new() };
    let (fitted, areas) = (device.fitted(), device.layout().areas);
    let registers = areas.iter().flat_map(|area| fitted.used_registers(area));
    let places: BTreeMap<_, _> =
        registers.map(|register| (register.offset(), register.address().width())).collect();
    places.into_iter().collect()
}

/// Returns the device index and the first byte of the area of each CANsync node.
pub(super) fn nodes(plant: &Plant) -> Vec<(usize, u32)> {
    let devices = plant.devices().iter().enumerate();
    let nodes = devices.flat_map(|(index, device)| {
        let ports = device.layout().ports.iter().filter(|port| port.medium == "cansync");
        ports.map(move |port| (index, port.area.first))
    });
    nodes.collect()
}

/// Returns the role of a port: by its place, or by its module.
fn role(device: &dyn Device, port: &Port) -> Option<Role> {
    port.role().or(device.fitted().port(port.number).role())
}

/// A CANsync master node.
pub(super) struct Master<'a> {
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

    pub(super) fn load(&self, register: &str) -> u32 {
        let (offset, width) = self.place(register);
        self.device.segment().load(offset, width).unwrap()
    }
}

pub(super) fn masters(plant: &Plant) -> impl Iterator<Item = Master<'_>> {
    plant.devices().iter().flat_map(|device| {
        let nodes = device.layout().ports.iter().filter(|port| port.medium == "cansync");
        let masters = nodes.filter(|port| role(device.as_ref(), port) == Some(Role::Master));
        masters.map(move |port| Master { device: device.as_ref(), node: port.name })
    })
}

pub(super) fn take(plant: &mut Plant, act: &Act) {
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
                plant.store(DeviceIndex::at(device % count), offset, width, value).unwrap();
            } else {
                plant.devices()[device % count].segment().store(offset, width, value).unwrap();
            }
        }
        Act::Command(value) => {
            for (device, base) in nodes(plant) {
                plant.store(DeviceIndex::at(device), base, Width::Word, value.into()).unwrap();
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
            plant.set_board(DeviceIndex::at(device % count), setting);
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
                .replace("{port}", device.ports.first().map_or("", |port| port.name));
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
            let plc = DeviceIndex::at(device % count);
            if !plant.unforce(plc, offset) {
                // An error is ignored: a register cannot be forced if an overlaid structure has another width there.
                let _ = plant.force(Forced { plc, offset, width, value: value & width.max_value() });
            }
        }
        Act::Guest { bus, id } => {
            let Some(bus) = bus.checked_rem(plant.buses().len()).map(BusIndex::at) else { return };
            plant.guest_joins(bus, 3, true);
            let frame = Frame::standard(id, Payload::new(&id.to_le_bytes()).unwrap());
            let _ = plant.guest_sends(bus, 3, &BusMessage::Frame(frame));
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
            plant
                .follow_registers(DeviceIndex::at(device % count), offset, width.bytes(), Keep::InJournal)
                .unwrap();
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
        let mode = match role(device.as_ref(), port) {
            Some(Role::Master) => Mode::Master,
            Some(_) => Mode::Slave,
            None => continue,
        };
        let at_500 = |rate: &&Rate| rate.kind.layout == layout && rate.timing.kbit_per_s == 500;
        let rate = RATES.iter().find(at_500).unwrap();
        Node::at(device.segment(), base, rate.timing, mode).write_init_data();
    }
}

/// Brings all nodes of CANsync into active operation, and the gateway into data exchange.
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
        // A master reads the contents of its time slots at the start of the network, so they are set before it.
        for master in masters(plant) {
            master.store("_CFG_WRC_WORD.b_CFG_WRC1_WORD0", 0x01);
            master.store("_CFG_WRC_WORD.b_CFG_WRC1_WORD1", 0x03);
        }
        take(plant, act);
        plant.advance_to(plant.now() + 4_000);
    }
}
