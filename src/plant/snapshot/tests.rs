//! Any bytes of a file give a snapshot or an error. A plant that has restored a snapshot can continue.

use super::file::FORMAT;
use super::*;
use crate::format_samples::{sample, samples, with_header};
use crate::memory::Segment;
use crate::plant::PlantConfig;
use crate::snapshot_fields::seal;
use std::sync::{Mutex, PoisonError};

fn plant(text: &str) -> Plant {
    let config = PlantConfig::parse("plant", text).unwrap();
    Plant::new(&config, |_, device| Ok::<_, Box<dyn std::error::Error>>(Segment::of(device))).unwrap()
}

/// Returns a plant of each device.
fn templates() -> impl Iterator<Item = &'static str> {
    devices::all().iter().filter_map(|device| device.emulation.template)
}

#[test]
fn a_file_comes_back_and_anything_else_is_refused() {
    let mut plant = plant(templates().next().unwrap());
    plant.advance_to(3_000);
    let file = plant.snapshot_file();
    let bytes = file.to_bytes();
    assert_eq!(SnapshotFile::of_bytes(&bytes), Ok(file));
    assert_eq!(SnapshotFile::of_bytes(b"{}"), Err(SnapshotFileError::NoSnapshot));
    for len in 0..bytes.len() {
        assert!(SnapshotFile::of_bytes(&bytes[..len]).is_err(), "cut off at {len}");
    }
    // Tests each bit up to the state, and some bits of the state and after it.
    let header = bytes.len() - file_state(&bytes);
    for at in (0..header).chain((header..bytes.len()).step_by(7)) {
        for bit in (0..8).filter(|bit| at < header || *bit == at % 8) {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1 << bit;
            let wanted = if at < 8 { SnapshotFileError::NoSnapshot } else { SnapshotFileError::Checksum };
            assert_eq!(SnapshotFile::of_bytes(&bytes), Err(wanted), "bit {bit} of byte {at} flipped");
        }
    }
}

/// If the contents of a snapshot change for any device, the format needs a new number.
#[test]
fn a_sample_of_the_format_can_be_read() {
    for known in devices::all() {
        let Some(text) = known.emulation.template else { continue };
        let bytes = sample(&format!("snapshot-{FORMAT}-{}", known.layout.name), || {
            let mut plant = plant(text);
            plant.advance_to(20_000);
            plant.snapshot_file().to_bytes()
        });
        // A release has a new version number, but the same format.
        let bytes = with_header(&bytes, FORMAT, env!("CARGO_PKG_VERSION"));
        let file =
            SnapshotFile::of_bytes(&bytes).unwrap_or_else(|error| panic!("{}: {error}", known.layout.name));
        let mut plant = plant(&file.plant);
        let name = known.layout.name;
        match plant.restore(&file.snapshot) {
            // If the layout has moved registers since the sample was written, the sample belongs to another
            // plant.
            Err(SnapshotError::OtherLayout { .. }) => {
                panic!("{name}: the registers have moved: write a new sample")
            }
            restored => restored.unwrap_or_else(|error| panic!("{name}: {error}; count FORMAT up")),
        }
        assert!(plant.snapshot() == file.snapshot, "{name}: it was read as something else; count FORMAT up");
        plant.advance_to(plant.now() + 3_000);
    }
}

#[test]
fn other_formats_are_refused_by_number_and_version() {
    let ours = format!("this is commram {} (format {FORMAT}); use that version", env!("CARGO_PKG_VERSION"));
    let refused = |bytes: &[u8], by: &str| {
        let error = SnapshotFile::of_bytes(bytes).unwrap_err();
        assert!(matches!(error, SnapshotFileError::OtherVersion { .. }), "{error:?}");
        let error = error.to_string();
        assert!(error.starts_with(&format!("it was made by commram {by}, {ours}")), "{error}");
    };
    let kept = samples(&format!("snapshot-{FORMAT}-"));
    let (_, today) = kept.first().unwrap();
    for (format, version) in
        [(1, "0.0.1"), (2, "0.1.0"), (FORMAT + 1, "0.2.0"), (u16::MAX, "99.0.0"), (FORMAT, "0.0.9")]
    {
        refused(&with_header(today, format, version), &format!("{version} (format {format})"));
    }
    // A newer format may have any contents after the version.
    let mut newer = Saving::default();
    newer.raw(&today[..8]);
    newer.raw(&(FORMAT + 1).to_le_bytes());
    newer.value("0.2.0");
    refused(&seal(newer.into_bytes()), &format!("0.2.0 (format {})", FORMAT + 1));
    for (name, bytes) in samples("snapshot-") {
        if !name.starts_with(&format!("snapshot-{FORMAT}-")) {
            let error = SnapshotFile::of_bytes(&bytes).unwrap_err();
            assert!(matches!(error, SnapshotFileError::OtherVersion { .. }), "{name}: {error}");
        }
    }
}

/// Returns the bytes of the state in a file, and the bytes after the state.
fn file_state(bytes: &[u8]) -> usize {
    SnapshotFile::of_bytes(bytes).unwrap().snapshot.state.len() + size_of::<u64>()
}

/// A damaged part is described in words, not by a type of the program.
#[test]
fn messages_name_no_types() {
    let error = Saved::new(&[0xFF; 3]).value::<(u64, Vec<String>)>().unwrap_err().to_string();
    assert_eq!(error, "there is no readable value at byte 0 of the state");
}

/// Tries to restore a snapshot that may be bad; returns true if the plant has accepted it.
fn runs_or_is_refused(plant: &mut Plant, good: &Snapshot, bad: &Snapshot) -> bool {
    let is_taken = plant.restore(bad).is_ok();
    if is_taken {
        plant.advance_to(plant.now().saturating_add(3_000));
    } else {
        assert!(plant.snapshot() == *good, "a refused snapshot changes nothing");
    }
    assert!(plant.restore(good).is_ok());
    is_taken
}

/// Writes bytes into the state of a plant of any device, with a correct checksum. Also uses the bytes as a whole file.
#[test]
fn fuzz_snapshot() {
    let plants: Vec<_> = templates()
        .map(|text| {
            let mut plant = plant(text);
            plant.advance_to(400_000);
            let good = plant.snapshot();
            Mutex::new((plant, good))
        })
        .collect();
    crate::fuzz("snapshot", |bytes| {
        let _ = SnapshotFile::of_bytes(bytes);
        let Some((which, changes)) = bytes.split_first() else { return };
        let mut plant =
            plants[usize::from(*which) % plants.len()].lock().unwrap_or_else(PoisonError::into_inner);
        let (plant, good) = &mut *plant;
        let mut bad = good.clone();
        for [low, middle, byte] in changes.as_chunks::<3>().0 {
            let at = usize::from(u16::from_le_bytes([*low, *middle])) % bad.state.len();
            bad.state[at] = *byte;
        }
        runs_or_is_refused(plant, good, &bad);
    });
}

/// The checksum is correct.
#[test]
fn a_state_that_makes_no_sense_is_refused_or_runs() {
    let mut random = fastrand::Rng::with_seed(16);
    for text in templates() {
        let mut plant = plant(text);
        plant.advance_to(400_000);
        let good = plant.snapshot();
        let mut refused = 0;
        for _ in 0..80 {
            let mut bad = good.clone();
            for _ in 0..random.usize(1..4) {
                let at = random.usize(..bad.state.len());
                bad.state[at] = random.u8(..);
            }
            if random.u8(..8) == 0 {
                bad.state.truncate(random.usize(..bad.state.len()));
            }
            refused += usize::from(!runs_or_is_refused(&mut plant, &good, &bad));
        }
        assert!(refused > 0);
        plant.restore(&good).unwrap();
        assert!(plant.snapshot() == good);
    }
}

/// The checksum is correct, and only the time of the plant is wrong.
#[test]
fn a_state_that_is_too_late_is_refused() {
    let mut plant = plant(templates().next().unwrap());
    plant.advance_to(1_000);
    let good = plant.snapshot();
    let head = |now: u64, next_device: u64| {
        let mut head = Saving::default();
        head.value(&(now, now + 500, next_device));
        head.into_bytes()
    };
    let begin = head(1_000, plant.next_device);
    assert!(good.state.starts_with(&begin));
    for (now, is_right) in [(LATEST_US, true), (LATEST_US + 1, false), (u64::MAX - 500, false)] {
        let mut bad = good.clone();
        bad.state.splice(..begin.len(), head(now, u64::MAX));
        assert_eq!(runs_or_is_refused(&mut plant, &good, &bad), is_right, "{now}");
    }
}
