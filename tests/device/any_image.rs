//! Another program writes random data into the images at any time, including the header page: nothing panics or hangs.
//! After the devices are switched off and on, a handshake is answered as usual.

use crate::rig::{Memory, RigError, segment};
use crate::snapshots::bring_up;
use commram::identity::DeviceIndex;
use commram::layout::{DeviceFit, DeviceLayout};
use commram::memory::header::{BoardSetting, Power, RunSwitch};
use commram::memory::{Image, Width};
use commram::plant::{Plant, PlantConfig};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;

const PLANT: &str = "\
    [[plc]]\nname = 'line'\nnode1 = 'upper'\nnode2 = 'lower'\nlock_time_us = 20000\n\
    [[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n\
    [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'upper'\nsync_in_from = 'K'\n\
    [[device.module]]\nslot = 'K'\nkind = 'can-05'\nbus = 'lower'\ndip = 5\nlock_time_us = 20000\n\
    [[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'open'\nnode_id = 32\nkbit_s = 125\n\
    [[bus]]\nname = 'upper'\n[[bus.drive]]\nname = 'd'\nslave_number = 1\nlock_time_us = 20000\n\
    [[bus]]\nname = 'lower'\n[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";
const DEVICES: usize = 3;
const HEADER: u64 = 4096;

#[derive(Clone, Debug)]
enum Act {
    /// A register, by its relative position in the list of all registers of the device.
    Register {
        device: usize,
        place: prop::sample::Index,
        value: u32,
    },
    /// A valid command: `w_CPU_CONTROL` of a CANsync node.
    Command {
        device: usize,
        node: prop::sample::Index,
        value: u16,
    },
    Header {
        device: usize,
        offset: u64,
        value: u32,
    },
    /// Bytes at any offset of the image.
    Bytes {
        device: usize,
        place: prop::sample::Index,
        bytes: Vec<u8>,
    },
    Pass(u64),
}

fn act() -> impl Strategy<Value = Act> {
    let (device, place) = (0..DEVICES, any::<prop::sample::Index>());
    let value = prop_oneof![any::<u32>(), 0..8u32, Just(0x05), Just(0x80), Just(u32::MAX)];
    let command = prop::sample::select(vec![0x0000u16, 0x0001, 0x0002, 0x0020, 0x0040, 0x0080, 0x00C0]);
    let bytes = prop::collection::vec(any::<u8>(), 1..64);
    prop_oneof![
        4 => (device.clone(), place.clone(), value.clone())
            .prop_map(|(device, place, value)| Act::Register { device, place, value }),
        2 => (0..2usize, place.clone(), command)
            .prop_map(|(device, node, value)| Act::Command { device, node, value }),
        3 => (device.clone(), 0..HEADER / 4, value)
            .prop_map(|(device, word, value)| Act::Header { device, offset: 4 * word, value }),
        1 => (device, place, bytes).prop_map(|(device, place, bytes)| Act::Bytes { device, place, bytes }),
        3 => prop_oneof![1..3_000u64, Just(50_000)].prop_map(Act::Pass),
    ]
}

/// Returns the registers of a device with their sizes in bytes.
fn registers(device: &'static DeviceLayout) -> Vec<(u64, usize)> {
    let fitted = DeviceFit::unknown(device);
    let all = device.areas.iter().flat_map(|area| fitted.used_registers(area));
    all.map(|found| (found.offset().into(), Width::of(found.ty()).bytes() as usize)).collect()
}

fn write(file: &File, offset: u64, bytes: &[u8]) {
    let size = file.metadata().unwrap().len();
    let room = size.saturating_sub(offset).min(bytes.len() as u64) as usize;
    file.write_all_at(&bytes[..room], offset).unwrap();
}

/// The plant with its image files.
struct Rig {
    plant: Plant,
    files: Vec<File>,
    layouts: Vec<&'static DeviceLayout>,
    registers: Vec<Vec<(u64, usize)>>,
    _images: Vec<Image>,
}

fn rig() -> Rig {
    let (mut images, config) = (Vec::new(), PlantConfig::parse("any", PLANT).unwrap());
    let image =
        |plc: &str, device| -> Result<_, RigError> { segment(Memory::Mapped, plc, device, &mut images) };
    let plant = Plant::new(&config, image).unwrap();
    let open = |path| OpenOptions::new().read(true).write(true).open(path).unwrap();
    let files: Vec<File> = images.iter().map(|image| open(image.path())).collect();
    let layouts: Vec<&'static DeviceLayout> = plant.devices().iter().map(|device| device.layout()).collect();
    let registers: Vec<_> = layouts.iter().map(|layout| registers(layout)).collect();
    Rig { plant, files, layouts, registers, _images: images }
}

fn run(acts: &[Act]) {
    let mut rig = rig();
    let Rig { plant, files, layouts, registers, .. } = &mut rig;
    for act in acts {
        match act {
            Act::Register { device, place, value } => {
                let (offset, bytes) = registers[*device][place.index(registers[*device].len())];
                write(&files[*device], offset, &value.to_le_bytes()[..bytes]);
            }
            Act::Command { device, node, value } => {
                let ports = layouts[*device].ports;
                let offset = ports[node.index(ports.len())].area.first;
                write(&files[*device], offset.into(), &value.to_le_bytes());
            }
            Act::Header { device, offset, value } => write(&files[*device], *offset, &value.to_le_bytes()),
            Act::Bytes { device, place, bytes } => {
                let size = files[*device].metadata().unwrap().len() as usize;
                write(&files[*device], place.index(size) as u64, bytes);
            }
            Act::Pass(us) => plant.advance_to(plant.now() + us),
        }
    }
    answers_after_power_on(&mut rig);
}

/// Sets the switches to valid positions, as a user would.
fn answers_after_power_on(rig: &mut Rig) {
    let Rig { plant, files, layouts, .. } = rig;
    for plc in 0..DEVICES {
        for setting in [BoardSetting::Switch(RunSwitch::Run), BoardSetting::Power(Power::On)] {
            plant.set_board(DeviceIndex::at(plc), setting);
        }
        plant.set_board(DeviceIndex::at(plc), BoardSetting::PowerCycle);
    }
    for (plc, area) in [(0, "node2"), (1, "slotG")] {
        let first = u64::from(layouts[plc].area(area).unwrap().first);
        write(&files[plc], first, &1u16.to_le_bytes());
        plant.advance_to(plant.now() + 20_000);
        assert_eq!(
            plant.load(DeviceIndex::at(plc), first as u32 + 2, Width::Word),
            Ok(2),
            "{area} answers the handshake"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_image_contents_never_stop_the_devices(acts in prop::collection::vec(act(), 1..150)) {
        run(&acts);
    }
}

/// Returns the registers of a device with their sizes in bytes, of each array the first and the last.
fn registers_by_name(device: &'static DeviceLayout) -> Vec<(u64, usize)> {
    let fitted = DeviceFit::unknown(device);
    let mut places = BTreeMap::<String, [(u64, usize); 2]>::new();
    for found in device.areas.iter().flat_map(|area| fitted.used_registers(area)) {
        let name = found.to_string().chars().filter(|letter| !letter.is_ascii_digit()).collect();
        let place = (found.offset().into(), Width::of(found.ty()).bytes() as usize);
        places.entry(name).or_insert([place; 2])[1] = place;
    }
    places.into_values().flatten().collect()
}

/// Random writes rarely hit a word that the firmware reads. So in this test each word of the header page, one after the
/// other, has an undefined value for a processor cycle, while all activities are in progress.
#[test]
fn each_word_may_hold_anything() {
    let mut rig = rig();
    bring_up(&mut rig.plant);
    let Rig { plant, files, layouts, .. } = &mut rig;
    let turn = |plant: &mut Plant, value: u32, places: &[Vec<(u64, usize)>]| {
        for number in 0..places.iter().map(Vec::len).max().unwrap() {
            let mut before = Vec::new();
            for (file, places) in files.iter().zip(places) {
                let Some(&(offset, bytes)) = places.get(number) else { continue };
                let mut word = [0; 4];
                file.read_exact_at(&mut word[..bytes], offset).unwrap();
                write(file, offset, &value.to_le_bytes()[..bytes]);
                before.push((file, offset, bytes, word));
            }
            plant.advance_to(plant.now() + 500);
            before.iter().for_each(|(file, offset, bytes, word)| write(file, *offset, &word[..*bytes]));
        }
        plant.advance_to(plant.now() + 1_000);
    };
    let words: Vec<_> = (0..HEADER).step_by(4).map(|offset| (offset, 4)).collect();
    turn(plant, u32::MAX, &vec![words; DEVICES]);
    let registers: Vec<_> = layouts.iter().map(|layout| registers_by_name(layout)).collect();
    turn(plant, u32::MAX, &registers);
    turn(plant, 0x0505_0505, &registers);
    answers_after_power_on(&mut rig);
}
