//! Errors in an object dictionary.

use super::{edited, error_of};
use std::fs;

/// Checks the error for a device with this object dictionary.
#[track_caller]
fn with(objects: &str, expected: &str) {
    let dir = edited("device.toml", "structures = [", "objects = \"objects.toml\"\nstructures = [");
    fs::write(dir.path().join("objects.toml"), format!("object = [\n{objects}\n]\n")).unwrap();
    assert_eq!(error_of(dir.path()), format!("objects.toml:{expected}"));
}

fn row(sub: u8, rest: &str) -> String {
    format!("{{ index = 0x1000, sub = {sub}, name = \"it\", page = \"1\", doc = \"It\", {rest} }},")
}

#[test]
fn invalid_objects() {
    let right = "type = \"u8\", access = \"ro\"";
    let twice = format!("{}\n{}", row(1, right), row(1, right));
    with(
        &twice,
        "3:1: object 16#1000 sub 1: objects are listed in the order of index and sub-index, each once",
    );
    for wrong in ["access = \"rw\"", "type = \"u8\", access = \"none\""] {
        with(&row(0, wrong), "2:1: object 16#1000 sub 0 has a `type` unless its `access` is \"none\"");
    }
    let default = "2:1: `default` of object 16#1000 sub 0 is a number that fits its type, \"node\" or \"0x... + node\"; a \
                   string's is a text, a domain has none";
    for wrong in [
        "type = \"u8\", access = \"ro\", default = 256",
        "type = \"u32\", access = \"ro\", default = \"0x180 + Node\"",
        "type = \"string\", access = \"ro\"",
        "type = \"domain\", access = \"rw\", default = 0",
    ] {
        with(&row(0, wrong), default);
    }
}
