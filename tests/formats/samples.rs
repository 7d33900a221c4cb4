//! Samples of the formats that commram reads back, in `tests/formats`: a file for each format number.
//!
//! A test reads today's sample. If it cannot, the format has changed: the change increments the number of the format
//! and adds a sample of the new number. The samples of older numbers stay, and tests check that commram refuses them
//! with a clear message.

use crate::snapshot_fields::{Saved, Saving, read_format, save_header, seal, unseal};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

/// Environment variable: if it is set, a missing sample is written.
const RENEW: &str = "COMMRAM_NEW_SAMPLES";

fn path(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "formats", name].iter().collect()
}

/// Returns the sample of this name. `today` makes one, which is written only if there is none and [`RENEW`] is set.
pub(crate) fn sample(name: &str, today: impl FnOnce() -> Vec<u8>) -> Vec<u8> {
    let path = path(name);
    if !path.exists() && std::env::var_os(RENEW).is_some() {
        fs::write(&path, today()).unwrap();
    }
    fs::read(&path).unwrap_or_else(|error| {
        panic!(
            "{}: {error}; a new format number needs a sample: run this test with {RENEW}=1",
            path.display()
        )
    })
}

/// Compares the lines that describe a format with its sample, from which none may be missing. Lines may be added: they are
/// written if [`RENEW`] is set. `number` names the constant that a change increments.
pub(crate) fn assert_only_added(name: &str, number: &str, today: &str) {
    let kept = String::from_utf8(sample(name, || today.as_bytes().to_vec())).unwrap();
    let missing_in = |there: &str, of: &str| -> Vec<String> {
        let there: BTreeSet<&str> = there.lines().collect();
        of.lines().filter(|line| !there.contains(line)).map(str::to_owned).collect()
    };
    let changed = missing_in(today, &kept);
    assert!(
        changed.is_empty(),
        "the format differs from tests/formats/{name}: count {number} up and run this test with {RENEW}=1\n{}",
        changed.join("\n")
    );
    let added = missing_in(&kept, today);
    if !added.is_empty() && std::env::var_os(RENEW).is_some() {
        return fs::write(path(name), today).unwrap();
    }
    assert!(
        added.is_empty(),
        "tests/formats/{name} lacks (run this test with {RENEW}=1):\n{}",
        added.join("\n")
    );
}

/// Returns the same file or state with the header of another format and version, and with a correct checksum.
pub(crate) fn with_header(bytes: &[u8], format: u16, version: &str) -> Vec<u8> {
    let written = unseal(bytes).unwrap();
    let mut from = Saved::new(written);
    let magic = from.raw(8).unwrap();
    let (_, found) = read_format(&mut from).unwrap();
    let mut to = Saving::default();
    save_header(&mut to, magic, format, version);
    to.raw(&written[10 + 1 + found.len()..]);
    seal(to.into_bytes())
}

/// Returns the names and contents of all samples with a name that begins with `begin`.
pub(crate) fn samples(begin: &str) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(path("")).unwrap().map(|entry| entry.unwrap());
    let named = entries.map(|entry| (entry.file_name().into_string().unwrap(), entry.path()));
    named
        .filter(|(name, _)| name.starts_with(begin))
        .map(|(name, path)| (name, fs::read(path).unwrap()))
        .collect()
}
