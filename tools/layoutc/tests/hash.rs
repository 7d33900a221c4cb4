//! Tests that the layout hash depends on addresses and widths only.

use std::fs;
use std::path::Path;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixture");

fn hash_with(file: &str, from: &str, to: &str) -> u64 {
    let dir = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(FIXTURE).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let name = path.file_name().unwrap();
        let text = if name == file { text.replace(from, to) } else { text };
        fs::write(dir.path().join(name), text).unwrap();
    }
    commram_layoutc::compile(dir.path()).unwrap().layout_hash
}

fn original() -> u64 {
    commram_layoutc::compile(Path::new(FIXTURE)).unwrap().layout_hash
}

#[test]
fn the_hash_is_the_same_on_every_machine_and_in_every_build() {
    assert_eq!(original(), 0xB227D9F08CEB4F56);
}

#[test]
fn comments_texts_owners_and_reset_values_do_not_count() {
    for (file, from, to) in [
        ("CTRL.toml", "name = \"CTRL\"", "# a comment\nname = \"CTRL\""),
        ("CTRL.toml", "doc = \"Value\"", "doc = \"Something else\""),
        ("CTRL.toml", "owner = \"plc\"", "owner = \"firmware\""),
        ("CTRL.toml", "reset = -40", "reset = 7"),
        ("values.toml", "id = \"OFF\", ", ""),
        ("device.toml", "[\"INIT\", \"CTRL\"]", "[\"CTRL\", \"INIT\"]"),
    ] {
        assert_eq!(hash_with(file, from, to), original(), "{from} -> {to}");
    }
}

#[test]
fn names_types_addresses_and_bounds_count() {
    for (file, from, to) in [
        ("CTRL.toml", "\"d_VALUE\"", "\"d_VALUES\""),
        ("CTRL.toml", "type = \"DINT\"", "type = \"DWORD\""),
        ("CTRL.toml", "array = [2, 2]", "array = [1, 4]"),
        ("device.toml", "first = 2000", "first = 1996"),
        ("device.toml", "last = 1063", "last = 1067"),
        ("device.toml", "segment = 3", "segment = 4"),
        ("device.toml", "offset = 4096", "offset = 8192"),
    ] {
        let changed = hash_with(file, from, to);
        assert_ne!(changed, original(), "{from} -> {to}");
    }
}
