//! Tests of creating, taking over, refusing and removing images.

use super::*;
use crate::devices::samples::tables::SLOTS;
use crate::identity::PortNumber;
use crate::layout::{DeviceFit, DeviceLayout, Fit, Role};
use crate::memory::{
    AttachMode, Width,
    header::{ABI_VERSION, name},
    list::{Condition, list},
    testing::{Emulator, HASH, Instance, PLC, SEGMENT_SIZE, spec, test_device},
};
use rustix::fs::{CWD, Mode};
use std::{
    fs,
    os::unix::fs::{MetadataExt, PermissionsExt, symlink},
    sync::{
        Barrier,
        atomic::{AtomicU32, Ordering},
    },
};
use zerocopy::FromZeros;

/// A register with a value that identifies its writer.
pub(crate) const MARK: u32 = 200_000;

fn create(instance: &Instance) -> Result<Image, MemoryError> {
    Image::create(instance, PLC, &spec())
}

#[test]
fn a_new_image_is_private_allocated_and_filled() {
    let instance = Instance::new();
    let image = instance.create();
    let file = fs::metadata(image.path()).unwrap();
    assert_eq!(file.permissions().mode() & 0o7777, 0o600);
    assert_eq!(file.len(), SEGMENT_SIZE as u64);
    assert!(file.blocks() * 512 >= SEGMENT_SIZE as u64, "{} blocks", file.blocks());
    let flags = rustix::io::fcntl_getfd(&image.file.file).unwrap();
    assert!(flags.contains(rustix::io::FdFlags::CLOEXEC));

    let header = image.header();
    assert_eq!(State::from_code(header.state.load()), Some(State::Starting));
    assert_eq!(header.layout_hash.load(), HASH);
    assert_eq!(header.header_size.load(), 4096);
    assert_eq!(header.segment_size.load(), 3_262_144);
    assert_eq!(header.firmware_pid.load(), std::process::id());
    assert_eq!(name(&header.instance), *instance);
    assert_eq!(name(&header.plc), PLC);
    assert_eq!(name(&header.device), "Test Device");
    assert_eq!((image.generation(), image.taken_over()), (1, None));
}

#[test]
fn dropping_an_image_removes_it() {
    let instance = Instance::new();
    let path = instance.create_ready().path().to_owned();
    assert!(!path.exists());
}

#[test]
fn dropping_an_image_leaves_a_foreign_file_of_its_name_alone() {
    let instance = Instance::new();
    let image = instance.create();
    fs::remove_file(image.path()).unwrap();
    fs::write(image.path(), "mine").unwrap();
    drop(image);
    assert_eq!(fs::read_to_string(instance.path()).unwrap(), "mine");
}

#[test]
fn a_running_emulator_is_not_disturbed() {
    let instance = Instance::new();
    let emulator = Emulator::start(&instance);
    assert_eq!(
        create(&instance).unwrap_err().to_string(),
        format!(
            "instance '{}' is already running (process {}), it serves the image of PLC 'plc'; stop it first or \
             choose another instance name",
            &*instance,
            emulator.pid()
        )
    );
    assert!(matches!(Image::remove_dead(&instance, PLC), Err(MemoryError::AlreadyRunning { .. })));
    let client = Image::attach(&instance, PLC, AttachMode::ReadWrite, Some(HASH)).unwrap();
    assert_eq!(client.segment().load(MARK, Width::Dword).unwrap(), emulator.pid());
}

#[test]
fn a_killed_emulator_is_recognized_and_taken_over_in_place() {
    let instance = Instance::new();
    let emulator = Emulator::start(&instance);
    let killed = emulator.pid();
    let client = Image::attach(&instance, PLC, AttachMode::ReadWrite, Some(HASH)).unwrap();
    client.segment().store(MARK + 4, Width::Dword, 0x4711).unwrap();
    client.check().unwrap();
    let inode = fs::metadata(instance.path()).unwrap().ino();
    emulator.kill();

    assert!(!client.is_alive());
    assert!(matches!(client.check(), Err(MemoryError::EmulatorDied { pid, .. }) if pid == killed));
    let refused = Image::attach(&instance, PLC, AttachMode::ReadWrite, Some(HASH)).unwrap_err();
    assert!(matches!(refused, MemoryError::EmulatorDied { pid, .. } if pid == killed), "{refused}");
    let observer = Image::attach(&instance, PLC, AttachMode::ReadOnly, Some(HASH)).unwrap();
    assert!(!observer.is_alive());
    assert_eq!(observer.segment().load(MARK + 4, Width::Dword).unwrap(), 0x4711);
    let listed = list().unwrap().into_iter().find(|image| image.instance == *instance).unwrap();
    assert!(matches!(listed.condition, Condition::Dead(summary) if summary.pid == killed));

    let image = instance.create();
    assert_eq!((image.taken_over(), image.generation()), (Some(killed), 2));
    assert_eq!(fs::metadata(instance.path()).unwrap().ino(), inode);
    assert_eq!(client.segment().load(MARK, Width::Dword).unwrap(), 0);
    assert_eq!(client.segment().load(MARK + 4, Width::Dword).unwrap(), 0);
    image.segment().store(MARK, Width::Dword, 1).unwrap();
    assert_eq!(client.segment().load(MARK, Width::Dword).unwrap(), 1);
    assert!(client.is_alive());
    assert!(matches!(client.check(), Err(MemoryError::EmulatorRestarted { attached: 1, found: 2, .. })));
}

#[test]
fn a_takeover_resets_the_registers_but_keeps_the_ring_counts() {
    let instance = Instance::new();
    instance.leave(SEGMENT_SIZE, |header| {
        header.board.dip.store(31);
        header.virtual_time_us.store(1);
        header.sync_counter[1].store(2);
        header.events[12].fire(3);
        header.answer.ring();
    });
    let image = instance.create();
    assert_eq!((image.taken_over(), image.generation()), (Some(u32::MAX), 8));
    let header = image.header();
    assert_eq!(header.board.dip.load(), 0);
    assert_eq!(header.virtual_time_us.load(), 0);
    assert_eq!(header.sync_counter[1].load(), 0);
    assert_eq!(header.events[12].time_us.load(), 0);
    // The answer bell has two rings: one of the previous run, and one that announces the takeover.
    assert_eq!(header.answer.rings(), 2);
    assert_eq!(header.events[12].bell.rings(), 1);
}

/// Clients that still map such an image expect its register map, so it must not change.
#[test]
fn a_dead_image_of_another_register_map_is_left_alone() {
    let instance = Instance::new();
    instance.leave(SEGMENT_SIZE, |header| header.layout_hash.store(HASH + 1));
    let before = fs::read(instance.path()).unwrap();
    let refused = create(&instance).unwrap_err();
    assert!(
        matches!(refused, MemoryError::LeftByOther { found, expected: HASH, .. } if found == HASH + 1),
        "{refused}"
    );
    assert_eq!(fs::read(instance.path()).unwrap(), before);
    static OTHER: DeviceLayout = DeviceLayout { layout_hash: HASH + 1, ..test_device() };
    let spec = ImageSpec { device: &OTHER, ..spec() };
    assert!(Image::create(&instance, PLC, &spec).is_ok());
}

#[test]
fn a_dead_image_of_another_shape_is_replaced() {
    for damage in [0, 1] {
        let instance = Instance::new();
        match damage {
            0 => instance.leave(SEGMENT_SIZE, |header| header.abi_version.store(ABI_VERSION + 1)),
            _ => instance.leave(8192, |_| ()),
        }
        // While this handle is open, the number of the old inode is not used again, so the numbers can be compared.
        let old = fs::File::open(instance.path()).unwrap();
        let image = instance.create();
        assert_eq!((image.taken_over(), image.generation()), (None, 1));
        assert_ne!(fs::metadata(image.path()).unwrap().ino(), old.metadata().unwrap().ino());
    }
}

#[test]
fn foreign_contents_are_refused_and_left_alone() {
    for contents in ["x", "something else entirely"] {
        let instance = Instance::new();
        fs::write(instance.path(), contents).unwrap();
        let refused = create(&instance).unwrap_err();
        assert!(matches!(refused, MemoryError::WrongMagic { .. }), "{refused}");
        assert!(refused.to_string().contains("is no commram image"), "{refused}");
        assert!(matches!(Image::remove_dead(&instance, PLC), Err(MemoryError::WrongMagic { .. })));
        assert_eq!(fs::read_to_string(instance.path()).unwrap(), contents);
    }
}

/// An empty file may be replaced, because nothing in it can be lost.
#[test]
fn an_empty_file_is_replaced_and_removed() {
    let instance = Instance::new();
    fs::write(instance.path(), "").unwrap();
    drop(instance.create_ready());
    assert!(!instance.path().exists());
    fs::write(instance.path(), "").unwrap();
    assert!(Image::remove_dead(&instance, PLC).unwrap());
    assert!(!instance.path().exists());
}

#[test]
fn a_symbolic_link_is_refused_and_left_alone() {
    let instance = Instance::new();
    let target = tempfile::NamedTempFile::new().unwrap();
    symlink(target.path(), instance.path()).unwrap();
    assert!(matches!(create(&instance), Err(MemoryError::Symlink { .. })));
    assert_eq!(fs::read_link(instance.path()).unwrap(), target.path());
    assert_eq!(target.as_file().metadata().unwrap().len(), 0);
}

#[test]
fn a_path_that_is_not_a_file_is_refused_without_waiting() {
    let instance = Instance::new();
    fs::create_dir(instance.path()).unwrap();
    assert!(matches!(create(&instance), Err(MemoryError::NotAFile { .. })));
    fs::remove_dir(instance.path()).unwrap();
    rustix::fs::mknodat(CWD, instance.path(), rustix::fs::FileType::Fifo, Mode::RUSR | Mode::WUSR, 0)
        .unwrap();
    assert!(matches!(create(&instance), Err(MemoryError::NotAFile { .. })));
    assert!(instance.path().exists());
}

#[test]
fn bad_names_are_refused() {
    assert!(matches!(Image::create("a.b", PLC, &spec()), Err(MemoryError::BadName { what: "instance", .. })));
    assert!(matches!(Image::create("a", "../b", &spec()), Err(MemoryError::BadName { what: "PLC", .. })));
}

#[test]
fn one_of_many_creators_wins() {
    for left_over in [false, true] {
        let instance = Instance::new();
        if left_over {
            instance.leave(SEGMENT_SIZE, |_| ());
        }
        let (start, end) = (Barrier::new(4), Barrier::new(4));
        let winners = AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    start.wait();
                    let created = create(&instance);
                    match &created {
                        Ok(_) => drop(winners.fetch_add(1, Ordering::Relaxed)),
                        Err(error) => {
                            assert!(matches!(error, MemoryError::AlreadyRunning { .. }), "{error}");
                        }
                    }
                    end.wait();
                });
            }
        });
        assert_eq!(winners.load(Ordering::Relaxed), 1);
        assert!(!instance.path().exists());
    }
}

/// A process may open the file just before the owner unlinks it. This process then locks a file without a name.
#[test]
fn a_file_that_has_lost_its_name_is_not_claimed() {
    let instance = Instance::new();
    let first = instance.create();
    let late = || ImageFile::open(&instance, PLC, true).unwrap().unwrap();
    let (one, other) = (late(), late());
    let place = ImageSite::new(&instance, PLC, ()).unwrap();
    drop(first);
    assert!(claim::claim(&place, one).unwrap().is_none(), "its path names nothing");
    let _second = instance.create();
    assert!(claim::claim(&place, other).unwrap().is_none(), "its path names another file");
}

#[test]
fn creators_that_race_with_the_end_of_another_never_meet() {
    let instance = Instance::new();
    let holders = AtomicU32::new(0);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let mut created = 0;
                while created < 100 {
                    match create(&instance) {
                        Ok(image) => {
                            created += 1;
                            assert_eq!(holders.fetch_add(1, Ordering::SeqCst), 0);
                            assert!(image.file.is_named().unwrap());
                            holders.fetch_sub(1, Ordering::SeqCst);
                        }
                        Err(error) => assert!(matches!(error, MemoryError::AlreadyRunning { .. }), "{error}"),
                    }
                }
            });
        }
    });
    assert!(!instance.path().exists());
}

#[test]
fn the_image_of_a_killed_emulator_can_be_removed() {
    let instance = Instance::new();
    assert!(!Image::remove_dead(&instance, PLC).unwrap());
    instance.leave(SEGMENT_SIZE, |_| ());
    assert!(Image::remove_dead(&instance, PLC).unwrap());
    assert!(!instance.path().exists());
}

#[test]
fn the_list_distinguishes_running_emulators() {
    let (living, dead, foreign) = (Instance::new(), Instance::new(), Instance::new());
    let image = living.create_ready();
    image.header().virtual_time_us.store(62_500);
    dead.leave(SEGMENT_SIZE, |_| ());
    fs::write(foreign.path(), "something else").unwrap();
    let images = list().unwrap();
    let find = |name: &Instance| &images.iter().find(|image| image.instance == **name).unwrap().condition;
    assert!(matches!(find(&living), Condition::Alive(summary)
        if summary.virtual_time_us == 62_500 && summary.state == Some(State::Ready)));
    assert!(matches!(find(&dead), Condition::Dead(summary) if summary.generation == 7));
    assert!(matches!(find(&foreign), Condition::Unusable(MemoryError::WrongMagic { .. })));
}

/// A reader of the header page alone finds every area and port of the device in the file.
#[test]
fn the_header_page_lists_areas_and_ports() {
    let instance = Instance::new();
    let image = instance.create();
    let listed = |entry: &header::AreaEntry| {
        let numbers = [&entry.first, &entry.unit, &entry.file_offset, &entry.size].map(|cell| cell.load());
        (header::name(&entry.name), header::name(&entry.space), numbers)
    };
    let [ram, retain, none, ..] = &image.header().areas;
    assert_eq!(listed(ram), ("ram".to_owned(), "M3.".to_owned(), [80_000, 1, 80_000, 3_182_144]));
    assert_eq!(listed(retain), ("retain".to_owned(), "M".to_owned(), [10_000_000, 1, 8_192, 71_808]));
    assert_eq!(listed(none), (String::new(), String::new(), [0; 4]));
    let listed = |entry: &header::PortEntry| {
        let numbers = [&entry.number, &entry.file_offset].map(|cell| cell.load());
        (header::name(&entry.name), header::name(&entry.medium), numbers)
    };
    let [end, none, ..] = &image.header().ports;
    assert_eq!(listed(end), ("end".to_owned(), "wire".to_owned(), [1, 80_000]));
    assert_eq!(listed(none), (String::new(), String::new(), [0; 2]));
    assert_eq!((end.role.load(), none.role.load()), (3, 0), "a layout that leaves no choice says the role");
}

/// The modules of a modular device determine the contents of its areas.
#[test]
fn the_header_page_lists_the_roles_of_the_ports() {
    let header = Header::new_box_zeroed().unwrap();
    let known = DeviceFit::unknown(&SLOTS)
        .with(PortNumber(1), Fit::As(Role::Master))
        .with(PortNumber(2), Fit::As(Role::Slave));
    header.describe(&SLOTS);
    header.set_fitted(&known);
    let listed = header.fitted(&SLOTS);
    assert_eq!(
        [1, 2, 3].map(|port| listed.port(PortNumber(port))),
        [Fit::As(Role::Master), Fit::As(Role::Slave), Fit::Empty]
    );
    header.ports[2].role.store(99);
    assert_eq!(header.fitted(&SLOTS).port(PortNumber(3)), Fit::Unknown);
}

/// A new emulator does not inherit the port state of its predecessor.
#[test]
fn a_takeover_resets_the_ports() {
    let instance = Instance::new();
    instance.leave(SEGMENT_SIZE, |header| {
        let [end, .., last] = &header.ports;
        header::set_name(&last.name, "of another one");
        [&end.restarts_written, &end.dip, &end.leds].iter().for_each(|cell| cell.store(7));
    });
    let image = instance.create();
    let [end, .., last] = &image.header().ports;
    assert_eq!([&end.restarts_written, &end.dip, &end.leds].map(|cell| cell.load()), [0; 3]);
    assert_eq!(header::name(&last.name), "");
}
