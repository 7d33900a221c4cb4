//! Errors in the properties of a PROFIBUS-DP slave that masters need.

use super::{edited, error_of};
use std::fs;

const RIGHT: &str = "page = \"1\"\nkey = [\n{ name = \"A\", is = 1 },\n]\n[parameters]\narea = \"node\"\nfirst = \"b_CONTROL\"\n\
                     constants = [0, 0, 0, 0, 0]\nparameter = [\n{ register = \"d_VALUE\", bit = 7 },\n]\n";

/// Checks the error after one part of a correct file is replaced.
#[track_caller]
fn with(from: &str, to: &str, expected: &str) {
    let dir = edited("device.toml", "structures = [", "gsd = \"gsd.toml\"\nstructures = [");
    assert_eq!(RIGHT.matches(from).count(), 1);
    fs::write(dir.path().join("gsd.toml"), RIGHT.replace(from, to)).unwrap();
    assert_eq!(error_of(dir.path()), format!("gsd.toml:{expected}"));
}

#[test]
fn a_correct_file_is_compiled() {
    let dir = edited("device.toml", "structures = [", "gsd = \"gsd.toml\"\nstructures = [");
    fs::write(dir.path().join("gsd.toml"), RIGHT.replace("bit = 7", "bit = 7, default = 1")).unwrap();
    let rust = commram_layoutc::compile(dir.path()).unwrap().rust;
    for part in [
        "pub const A: u16 = 1;",
        "DEFAULTS: [u8; 5] = [0, 0, 0, 0, 128];",
        "register: &CTRL.registers[",
        "octet: 4, octets: 1, name: \"\"",
    ] {
        assert!(rust.contains(part), "{part}");
    }
}

#[test]
fn invalid_descriptions() {
    let keyword = "4:1: `A` is no keyword (letters, digits, `_` and `.`), or occurs twice";
    with("is = 1 },", "is = 1 },\n{ name = \"A\", is = 2 },", keyword);
    with("\"A\"", "\"A=\"", "3:1: `A=` is no keyword (letters, digits, `_` and `.`), or occurs twice");
    with(
        "\"node\"",
        "\"nodes\"",
        "6:8: unknown area `nodes`; areas are defined under [[area]] of device.toml",
    );
    with("\"d_VALUE\"", "\"d_NONE\"", "10:14: area `node` has no register `d_NONE`");
    with(
        "\"b_CONTROL\"",
        "\"i_TEMPERATURE\"",
        "10:1: register `d_VALUE` lies before the first octet that counts",
    );
    with(
        "[0, 0, 0, 0, 0]",
        "[0, 0]",
        "10:1: the octets of parameter `d_VALUE` are past the end of the constants",
    );
    let parameter = "10:1: a parameter of a device description file has either a `bit`, 0 to 7, or a `name`, and `from`, `default`, \
                     `to` in ascending order";
    for wrong in [
        "bit = 8",
        "to = 9",
        "bit = 1, to = 2",
        "name = \"it\", inverted = true",
        "name = \"it\", default = 2",
    ] {
        with("bit = 7", wrong, parameter);
    }
}
