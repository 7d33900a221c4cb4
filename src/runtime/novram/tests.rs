mod killed;

use super::file::{VERSION, decode, encode};
use super::*;
use crate::format_samples::{sample, samples};
use crate::plant::PlantConfig;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::time::{Duration, Instant};

/// Size in bytes of the registers that the device of the built-in plant has in NOVRAM. The next two constants are two
/// of these registers.
const REGISTERS: usize = 16;
const ROUTER: u32 = 180_016 + 12;
const ADDRESS: u32 = 180_016 + 4;
const FLAG: u32 = 8192;
/// Size of the device's retain flags in bytes, and the maximum.
const FLAGS: usize = 20_000;
const SIZE: Size = Size { registers: REGISTERS, flags: 57_344 };
const LAST_FLAG: u32 = FLAG + FLAGS as u32 - 1;

fn content(byte: u8) -> Content {
    Content::new(&[byte; REGISTERS], &[byte; FLAGS])
}

/// Opens the directory as an emulator does.
fn open(directory: &tempfile::TempDir) -> Directory {
    Directory::open(directory.path()).unwrap()
}

fn segment() -> Segment {
    Segment::of(PlantConfig::built_in().unwrap().devices[0].layout())
}

/// Restores the NOVRAM of a device of a plant.
fn restored(
    directory: &Directory,
    plant: &str,
    segment: &Segment,
) -> Result<(Novram, RestoreOutcome), NovramError> {
    let plant = PlantConfig::parse("novram", plant).unwrap();
    Ok(Novram::power_on(directory, &*plant.devices[0], segment)?.expect("it has one"))
}

/// Restores PLC `line`, with the default number of retain flags.
fn power_on(
    directory: &tempfile::TempDir,
    segment: &Segment,
) -> Result<(Novram, RestoreOutcome), NovramError> {
    restored(&open(directory), "[[plc]]\nname = 'line'\n", segment)
}

/// Returns names of the files in the directory, without its lock file.
fn names(directory: &tempfile::TempDir) -> Vec<String> {
    let entries = fs::read_dir(directory.path()).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name != ".lock").collect()
}

/// If a file is accepted, writing its content again gives the same bytes. Any correct content can be restored.
#[test]
fn fuzz_novram() {
    crate::fuzz("novram", |bytes| {
        let mut behind_a_right_checksum = bytes.to_vec();
        behind_a_right_checksum.extend(crc32fast::hash(bytes).to_le_bytes());
        for bytes in [bytes, &behind_a_right_checksum] {
            if let Ok(content) = decode(bytes, SIZE) {
                assert_eq!(encode(&content), bytes);
            }
        }
        if let Some((registers, retain)) = bytes.split_at_checked(REGISTERS) {
            let content = Content::new(registers, retain);
            assert_eq!(decode(&encode(&content), SIZE), Ok(content));
        }
    });
}

/// A plant with fewer retain flags does not remove flags of a plant with more.
#[test]
fn flags_beyond_those_of_the_plant_stay_in_the_file() {
    let directory = tempfile::tempdir().unwrap();
    let on = |segment: &Segment, bytes: u32| {
        let plant = format!("[[plc]]\nname = 'line'\nretain_bytes = {bytes}\n");
        restored(&open(&directory), &plant, segment).unwrap().0
    };
    let save = |novram: &mut Novram| {
        let content = novram.changed((&[0; REGISTERS], 0), true).unwrap();
        file::store(&mut open(&directory), &novram.name, &content).unwrap();
    };
    let (many, few) = (segment(), segment());
    let (last, first) = (65_532, FLAG);
    many.store(last, Width::Dword, 7).unwrap();
    save(&mut on(&many, 57_344));
    let mut novram = on(&few, 8);
    assert_eq!(few.load(last, Width::Dword).unwrap(), 0, "this plant has no such flag");
    assert_eq!(novram.changed((&[0; REGISTERS], 0), true), None);
    few.store(first, Width::Dword, 5).unwrap();
    save(&mut novram);
    let again = segment();
    on(&again, 57_344);
    let held = [first, last].map(|flag| again.load(flag, Width::Dword).unwrap());
    assert_eq!(held, [5, 7]);
}

/// The image is shortened while its retain flags are read. The file then keeps the last known flags.
#[test]
fn registers_lost_during_the_read_are_not_written() {
    let directory = tempfile::tempdir().unwrap();
    let kept = |is_lost: bool| {
        let (segment, opened) = (segment(), open(&directory));
        let (novram, _) = restored(&opened, "[[plc]]\nname = 'line'\n", &segment).unwrap();
        let mut keeper = Keeper::new(Some(opened), vec![Some(novram)]).unwrap();
        segment.store(FLAG, Width::Dword, if is_lost { 0 } else { 7 }).unwrap();
        let looks = std::cell::Cell::new(0);
        let registers = [0; REGISTERS];
        let stored = |_, _| {
            looks.set(looks.get() + 1);
            (!is_lost || looks.get() == 1).then_some((&registers[..], 0))
        };
        keeper.save(stored, true);
        keeper.close().unwrap();
        fs::read(directory.path().join("line.novram")).unwrap()
    };
    let last_known = kept(false);
    assert_eq!(kept(true), last_known);
}

#[test]
fn content_survives_power_off() {
    let directory = tempfile::tempdir().unwrap();
    let first = segment();
    let (mut novram, found) = power_on(&directory, &first).unwrap();
    assert_eq!(found, RestoreOutcome::Nothing);
    let mut config = [0; REGISTERS];
    assert_eq!(novram.changed((&config, 0), true), None, "nothing to save");
    config[4] = 192;
    config[12..].copy_from_slice(&0x4E6F_5F52_u32.to_le_bytes());
    assert_eq!(novram.changed((&config, 0), true), None, "not stored");
    first.store(FLAG, Width::Byte, 1).unwrap();
    first.store(LAST_FLAG, Width::Byte, 2).unwrap();
    let changed = novram.changed((&config, 1), false).unwrap();
    file::store(&mut open(&directory), &novram.name, &changed).unwrap();
    assert_eq!(novram.changed((&config, 1), true), None, "saved already");

    let second = segment();
    let (_, found) = power_on(&directory, &second).unwrap();
    assert_eq!(found, RestoreOutcome::Content { retain: true });
    for (offset, width, value) in
        [(ROUTER, Width::Dword, 0x4E6F_5F52), (ADDRESS, Width::Byte, 192), (FLAG, Width::Byte, 1)]
    {
        assert_eq!(second.load(offset, width).unwrap(), value);
    }
    assert_eq!(second.load(LAST_FLAG, Width::Byte).unwrap(), 2);
    assert_eq!(names(&directory), ["line.novram"], "no temporary file stays");
}

/// Neither registers nor retain flags: no file.
#[test]
fn a_device_without_novram_has_no_file() {
    let directory = tempfile::tempdir().unwrap();
    let none = |known: &&&'static crate::devices::Registered| {
        let text = format!("[[device]]\nkind = '{}'\nname = 'line'\n", known.layout.name);
        let Ok(plant) = PlantConfig::parse("novram", &text) else { return false };
        let device = &*plant.devices[0];
        let restored = Novram::power_on(&open(&directory), device, &Segment::of(device.layout())).unwrap();
        assert_eq!(restored.is_some(), device.retain_bytes() > 0 || device.novram().is_some());
        restored.is_none()
    };
    assert!(crate::devices::all().iter().filter(none).count() > 0, "there are such devices");
    assert_eq!(names(&directory), [""; 0]);
}

#[test]
fn retain_flags_are_checked_once_a_second() {
    let directory = tempfile::tempdir().unwrap();
    let segment = segment();
    let (mut novram, _) = power_on(&directory, &segment).unwrap();
    segment.store(FLAG, Width::Dword, 7).unwrap();
    let config = [0; REGISTERS];
    assert_eq!(novram.changed((&config, 0), false), None);
    let mut flags = [0; FLAGS];
    flags[0] = 7;
    assert_eq!(novram.changed((&config, 0), true), Some(Content::new(&config, &flags)));
}

#[test]
fn a_damaged_or_foreign_file_is_set_aside() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("line.novram");
    let good = encode(&content(7));
    assert_eq!(decode(&good, SIZE), Ok(content(7)));
    let mut flipped = good.clone();
    flipped[20] ^= 1;
    let mut older = good.clone();
    older[8] = 1;
    let truncated = good[..good.len() - 1].to_vec();
    let bad = [flipped, older, truncated, b"something else".to_vec(), Vec::new()];
    for (n, bytes) in bad.into_iter().enumerate() {
        fs::write(&path, &bytes).unwrap();
        let segment = segment();
        let (_, found) = power_on(&directory, &segment).unwrap();
        let aside = directory.path().join(format!("line.novram.bad-{}", n + 1));
        assert_eq!(found, RestoreOutcome::SetAside { path: aside.clone(), removed: Vec::new() });
        assert_eq!(fs::read(aside).unwrap(), bytes, "kept as it was");
        assert_eq!(segment.load(ROUTER, Width::Dword).unwrap(), 0);
    }
}

/// A change of the format needs a new version.
#[test]
fn a_sample_of_the_format_can_be_read() {
    let kept = Content::new(&core::array::from_fn::<u8, REGISTERS, _>(|n| n as u8), &[0xA5; 40]);
    let bytes = sample(&format!("novram-{VERSION}"), || encode(&kept));
    assert_eq!(decode(&bytes, SIZE), Ok(kept), "count VERSION up");
}

/// A file of another version is not changed, because the commram of that version can use it.
#[test]
fn a_file_of_another_version_is_refused_and_left_alone() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("line.novram");
    let good = encode(&content(7));
    let of_version = |version: u32, length: usize| {
        let mut bytes = good[..good.len() - 4].to_vec();
        bytes[8..12].copy_from_slice(&version.to_le_bytes());
        bytes.resize(length, 7);
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    };
    let mut others = vec![
        (1, of_version(1, 32)),
        (1, of_version(1, 40_000)),
        (VERSION + 1, of_version(VERSION + 1, 500_000)),
    ];
    for (name, bytes) in samples("novram-") {
        let version = name["novram-".len()..].parse().unwrap();
        if version != VERSION {
            others.push((version, bytes));
        }
    }
    for (version, bytes) in others {
        fs::write(&path, &bytes).unwrap();
        let error = power_on(&directory, &segment()).unwrap_err();
        assert!(matches!(error, NovramError::OtherVersion { .. }), "{error:?}");
        let text = format!(
            "NOVRAM {}: the file has version {version}, this commram ({}) reads version {VERSION}; use the commram that has \
             written it, or move the file away for the delivery state",
            path.display(),
            env!("CARGO_PKG_VERSION")
        );
        assert_eq!(error.to_string(), text);
        assert_eq!((names(&directory), fs::read(&path).unwrap()), (vec!["line.novram".to_owned()], bytes));
    }
}

#[test]
fn a_directory_that_cannot_be_used_is_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let error = Directory::open(file.path()).unwrap_err().to_string();
    let path = file.path().to_str().unwrap();
    assert!(error.contains(path) && error.contains("--novram needs"), "{error}");
}

#[test]
fn the_keeper_has_written_everything_when_it_ends() {
    let directory = tempfile::tempdir().unwrap();
    let segments = [segment(), segment()];
    let opened = open(&directory);
    let power_on = |name, segment| {
        restored(&opened, &format!("[[plc]]\nname = '{name}'\n"), segment).map(|(novram, _)| novram).ok()
    };
    let novram = vec![power_on("a", &segments[0]), None, power_on("b", &segments[1])];
    let mut keeper = Keeper::new(Some(opened), novram).unwrap();
    let configs = [1, 0, 2].map(|byte| [byte; REGISTERS]);
    for generation in 1..50 {
        keeper.save(|plc, _| Some((&configs[plc.index()][..], generation)), false);
    }
    segments[1].store(FLAG, Width::Byte, 9).unwrap();
    keeper.save(|plc, _| Some((&configs[plc.index()][..], 50)), true);
    drop(keeper);
    for (name, byte, flag) in [("a", 1, 0), ("b", 2, 9)] {
        let bytes = fs::read(directory.path().join(format!("{name}.novram"))).unwrap();
        let content = decode(&bytes, SIZE).unwrap();
        assert_eq!((content.registers()[0], content.retain()[0]), (byte, flag));
    }
}

/// Returns the NOVRAM of a PLC with its keeper, which has not written yet.
fn keeper(directory: &tempfile::TempDir) -> Keeper {
    let opened = open(directory);
    let (novram, _) = restored(&opened, "[[plc]]\nname = 'line'\n", &segment()).unwrap();
    Keeper::new(Some(opened), vec![Some(novram)]).unwrap()
}

/// Blocks the new file with a directory, so even root cannot write it.
fn block(directory: &tempfile::TempDir) -> std::path::PathBuf {
    let new = directory.path().join("line.novram.new");
    fs::create_dir(&new).unwrap();
    new
}

fn saved(directory: &tempfile::TempDir) -> Option<Content> {
    match fs::read(directory.path().join("line.novram")) {
        Ok(bytes) => Some(decode(&bytes, SIZE).expect("whole")),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => panic!("{error}"),
    }
}

fn wait_until_saved(directory: &tempfile::TempDir) {
    let start = Instant::now();
    while saved(directory).is_none() {
        assert!(start.elapsed() < Duration::from_secs(60), "never written");
        std::thread::yield_now();
    }
}

#[test]
fn failed_writes_are_repeated_until_they_succeed() {
    let directory = tempfile::tempdir().unwrap();
    let mut keeper = keeper(&directory);
    let in_the_way = block(&directory);
    keeper.save(|_, _| Some((&[5; REGISTERS][..], 1)), false);
    // No value has changed since the failed write, but the keeper retries it.
    keeper.save(|_, _| Some((&[5; REGISTERS][..], 1)), true);
    assert_eq!(saved(&directory), None);
    fs::remove_dir(in_the_way).unwrap();
    wait_until_saved(&directory);
    assert_eq!(saved(&directory).unwrap().registers(), [5; REGISTERS]);
    keeper.close().unwrap();
    assert_eq!(names(&directory), ["line.novram"]);
}

#[test]
fn a_failed_last_write_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let mut keeper = keeper(&directory);
    let _in_the_way = block(&directory);
    keeper.save(|_, _| Some((&[5; REGISTERS][..], 1)), true);
    let error = keeper.close().unwrap_err();
    assert!(matches!(error, NovramError::Lost { .. }), "{error:?}");
    let error = error.to_string();
    assert!(error.contains("lost") && error.contains("line.novram"), "{error}");
}

/// An unused directory disappears with its new parents, also while its emulator still has it open.
#[cfg(feature = "cli")]
#[test]
fn unused_directories_are_removed_with_the_parents_that_were_made_for_them() {
    let place = tempfile::tempdir().unwrap();
    let inner = place.path().join("a/b/c");
    drop(Directory::open(&inner).unwrap());
    assert_eq!(names(&place), [""; 0]);
    let open = Directory::open(&inner).unwrap();
    fs::write(inner.join("line.novram.new"), "cut off").unwrap();
    Directory::remove_unfinished();
    assert_eq!(names(&place), [""; 0]);
    drop(open);
    let mut open = Directory::open(&inner).unwrap();
    open.replace("line.novram", b"content").unwrap();
    Directory::remove_unfinished();
    drop(open);
    assert_eq!(fs::read(inner.join("line.novram")).unwrap(), b"content");
    // The lock file is not new now.
    fs::remove_file(inner.join("line.novram")).unwrap();
    drop(Directory::open(&inner).unwrap());
    assert!(inner.join(".lock").exists());
}

/// The new directory is locked at once, so no other emulator can take it.
#[test]
fn a_missing_directory_is_created_again() {
    let directory = tempfile::tempdir().unwrap();
    let mut keeper = keeper(&directory);
    fs::remove_dir_all(directory.path()).unwrap();
    keeper.save(|_, _| Some((&[5; REGISTERS][..], 1)), true);
    keeper.close().unwrap();
    assert_eq!(saved(&directory).unwrap().registers(), [5; REGISTERS]);
}

#[test]
fn an_unwritable_directory_is_detected_at_power_on() {
    let directory = tempfile::tempdir().unwrap();
    let _in_the_way = block(&directory);
    let error = power_on(&directory, &segment()).unwrap_err().to_string();
    assert!(error.contains("line.novram: cannot write it"), "{error}");
}

#[test]
fn a_partial_file_of_a_killed_emulator_is_removed() {
    let directory = tempfile::tempdir().unwrap();
    let (new, other) = (directory.path().join("line.novram.new"), directory.path().join("other"));
    fs::write(&new, "half").unwrap();
    power_on(&directory, &segment()).unwrap();
    assert_eq!(names(&directory), [""; 0]);
    // A link is not written to, either.
    fs::write(&other, "mine").unwrap();
    std::os::unix::fs::symlink(&other, &new).unwrap();
    power_on(&directory, &segment()).unwrap();
    assert_eq!((names(&directory), fs::read(&other).unwrap()), (vec!["other".to_owned()], b"mine".to_vec()));
}

#[test]
fn two_emulators_do_not_share_a_directory() {
    let directory = tempfile::tempdir().unwrap();
    let first = open(&directory);
    let error = Directory::open(directory.path()).unwrap_err();
    assert!(matches!(&error, NovramError::InUse { path } if path == directory.path()), "{error:?}");
    drop(first);
    open(&directory);
}

/// An emulator that has written nothing removes its new directory at its end.
#[test]
fn a_start_makes_a_directory_again_that_another_emulator_removes() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("novram");
    let until_there = |round: usize| {
        let opened = (0..100).find_map(|_| match Directory::open(&path) {
            Err(NovramError::InUse { .. }) => None,
            opened => Some(opened),
        });
        let directory = opened.expect("the directory becomes free").unwrap();
        assert!(path.join(".lock").exists(), "{round}");
        drop(directory);
    };
    std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(|| (0..100).for_each(until_there)))));
    // The directory itself may remain if two emulators remove and use it at the same time.
    assert!(fs::read_dir(&path).map_or(true, |mut entries| entries.next().is_none()));
}

#[test]
fn only_regular_files_are_read_and_no_links_are_followed() {
    type Make = fn(&Path) -> std::io::Result<()>;
    let makers: [(&str, Make); 4] = [
        ("a pipe", |path| Ok(rustix::fs::mkfifoat(rustix::fs::CWD, path, rustix::fs::Mode::RWXU)?)),
        ("a symbolic link", |path| std::os::unix::fs::symlink("/dev/zero", path)),
        ("a directory", |path| fs::create_dir(path)),
        ("something else", |path| std::os::unix::net::UnixListener::bind(path).map(drop)),
    ];
    for (found, make) in makers {
        let directory = tempfile::tempdir().unwrap();
        make(&directory.path().join("line.novram")).unwrap();
        let error = power_on(&directory, &segment()).unwrap_err().to_string();
        assert!(error.contains(&format!("line.novram: this is {found}")), "{error}");
        assert_eq!(names(&directory), ["line.novram"], "it is left alone");
    }
}

/// Such a file is refused without reading it, because reading would take too much memory and time.
#[test]
fn a_huge_file_is_set_aside_unread() {
    let directory = tempfile::tempdir().unwrap();
    let file = fs::File::create(directory.path().join("line.novram")).unwrap();
    file.set_len(1 << 40).unwrap();
    let (_, found) = power_on(&directory, &segment()).unwrap();
    let path = directory.path().join("line.novram.bad-1");
    assert_eq!(found, RestoreOutcome::SetAside { path, removed: Vec::new() });
}

#[test]
fn the_last_eight_damaged_files_are_kept() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(format!("line.novram{name}"));
    let other_files = [".bad-01", ".bad-x", ".bad-"].map(path);
    other_files.iter().for_each(|other| fs::write(other, "kept").unwrap());
    let bad = |number: usize| path(&format!(".bad-{number}"));
    for number in 1..=11_usize {
        fs::write(path(""), format!("damaged {number}")).unwrap();
        let (_, found) = power_on(&directory, &segment()).unwrap();
        let removed = number.checked_sub(8).filter(|old| *old > 0).map(bad).into_iter().collect();
        assert_eq!(found, RestoreOutcome::SetAside { path: bad(number), removed });
    }
    for number in 1..=11 {
        let kept = (number > 3).then(|| format!("damaged {number}"));
        assert_eq!(fs::read_to_string(bad(number)).ok(), kept);
    }
    assert!(other_files.iter().all(|other| other.exists()));
}

#[test]
fn other_users_cannot_read_the_files() {
    use std::os::unix::fs::MetadataExt;
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("a/b");
    let mut directory = Directory::open(&path).unwrap();
    file::store(&mut directory, "line.novram", &content(1)).unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().mode() & 0o777;
    assert_eq!([&path, &path.join("line.novram")].map(|path| mode(path)), [0o700, 0o600]);
}
