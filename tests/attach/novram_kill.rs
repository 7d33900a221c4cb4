//! Emulators are killed at random moments while a PLC stores IP addresses. The next emulator on the same image finds
//! the NOVRAM as it was before or after the last store.

use crate::common::{Emulator, unique_name};
use commram::devices::omega_drive_line_2::registers::{
    ETHERNET, ETHERNET_CONFIG, ETHERNET_CONFIG_BMSTRUCT, ETHERNET_DIAGNOSE_BMSTRUCT, LAYOUT_HASH, RETAIN,
};
use commram::memory::{AttachMode, Attached, Image, MemoryError, Width};
use std::time::{Duration, Instant};

const KILLS: u64 = 100;
/// Maximum time for which the PLC stores before the emulator is killed.
const LONGEST_US: u64 = 30_000;
/// Time after which the PLC detects that no emulator answers.
const SHORT: Duration = Duration::from_millis(5);
/// Number of retain flags (words) that are stored together with the address.
const FLAGS: u32 = 64;
/// The two values that select a user-defined address. With DIP number 0 both have the same effect.
const CHOICES: [u32; 2] = [0x1234_5678, 0x1234_5600];

fn attach(emulator: &Emulator) -> Attached {
    Image::attach(&emulator.name, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap()
}

fn flag(n: u32) -> u32 {
    RETAIN + 2 * n
}

/// Returns the address, mask and choice for number `n`.
fn content(n: u16) -> ([u8; 4], [u8; 4], u32) {
    let [low, high] = n.to_le_bytes();
    ([10, high, low, low % 250 + 1], [255, 255, high, low], CHOICES[usize::from(n % 2)])
}

/// Stores one address after the other until the emulator has ended.
fn store_on(image: &Attached, first: u16) -> MemoryError {
    let config = image.segment().view::<ETHERNET_CONFIG_BMSTRUCT>(ETHERNET_CONFIG).unwrap();
    let shown = image.segment().view::<ETHERNET_DIAGNOSE_BMSTRUCT>(ETHERNET).unwrap();
    for n in first.. {
        let (address, mask, choice) = content(n);
        for at in 0..FLAGS {
            image.segment().store(flag(at), Width::Word, n.into()).unwrap();
        }
        config.a_IP_ADDRESS.iter().zip(address).for_each(|(cell, byte)| cell.store(byte));
        config.a_IP_MASK.iter().zip(mask).for_each(|(cell, byte)| cell.store(byte));
        config.d_IP_CONFIG.store(choice);
        let counts = |_: &_| (shown.a_IP_MASK.each_ref().map(|cell| cell.load()) == mask).then_some(());
        image.ring().unwrap();
        loop {
            match image.wait_until("the address", SHORT, counts) {
                Ok(()) => break,
                Err(MemoryError::Timeout { .. }) => {}
                Err(error) => return error,
            }
        }
    }
    unreachable!("the emulator is killed before 65536 addresses are stored")
}

/// Returns the number of the last address that NOVRAM has stored; 0: delivery state.
fn restored(image: &Attached) -> u16 {
    let config = image.segment().view::<ETHERNET_CONFIG_BMSTRUCT>(ETHERNET_CONFIG).unwrap();
    let address = config.a_IP_ADDRESS.each_ref().map(|cell| cell.load());
    let mask = config.a_IP_MASK.each_ref().map(|cell| cell.load());
    let choice = config.d_IP_CONFIG.load();
    let n = u16::from_le_bytes([mask[3], mask[2]]);
    if (address, mask, choice) != ([0; 4], [0; 4], 0) {
        assert_eq!((address, mask, choice), content(n), "a mixture");
    }
    // When the file was written, the PLC may already have written flags of the next number.
    for at in 0..FLAGS {
        let flag = image.segment().load(flag(at), Width::Word).unwrap();
        assert!(flag == u32::from(n) || flag == u32::from(n) + 1, "flag {at} is {flag}, address {n}");
    }
    n
}

#[test]
fn the_next_emulator_finds_the_old_or_the_new_content() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let name = unique_name();
    // The random generator has a fixed seed, so that every run has equal numbers.
    let mut numbers = fastrand::Rng::with_seed(815);
    let mut last = 0;
    let mut contents = std::collections::BTreeSet::new();
    for _ in 0..KILLS {
        let mut emulator = Emulator::start_as(&name, &["--novram", path]);
        let image = attach(&emulator);
        let found = restored(&image);
        assert!(found >= last, "{found} after {last}");
        last = found;
        contents.insert(found);
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| store_on(&image, found + 1));
            let (start, moment) = (Instant::now(), Duration::from_micros(numbers.u64(..LONGEST_US)));
            while start.elapsed() < moment {
                std::hint::spin_loop();
            }
            emulator.kill();
            let error = writer.join().unwrap();
            assert!(matches!(error, MemoryError::EmulatorDied { .. }), "{error}");
        });
    }
    assert!(contents.len() > 10, "the kills meet different contents: {contents:?}");
    drop(Emulator::start_as(&name, &["--novram", path]));
    let mut names: Vec<_> =
        std::fs::read_dir(directory.path()).unwrap().map(|it| it.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, [".lock", "line.novram"], "the next emulator cleans up");
}
