//! Tests every kind of layout error. Each test makes one edit in a correct layout, and checks the place and the text of
//! the error.

mod families;
mod folders;
mod gsd;
mod meanings;
mod objects;
mod phases;
mod ports;
mod provenance;
mod registers;
mod spaces;
mod values;

use std::fs;
use std::path::Path;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixture");

/// Returns a copy of the fixture in which `from` of `file` is replaced by `to`.
fn edited(file: &str, from: &str, to: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(FIXTURE).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, dir.path().join(path.file_name().unwrap())).unwrap();
    }
    let path = dir.path().join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text.matches(from).count(), 1, "`{from}` must occur once in {file}");
    fs::write(&path, text.replace(from, to)).unwrap();
    dir
}

/// Returns the error of a layout, with paths relative to its directory.
fn error_of(dir: &Path) -> String {
    let error = commram_layoutc::compile(dir).expect_err("the layout should be refused");
    error.to_string().replace(&format!("{}/", dir.display()), "")
}

#[track_caller]
fn check(file: &str, from: &str, to: &str, expected: &str) {
    assert_eq!(error_of(edited(file, from, to).path()), expected);
}

#[test]
fn the_fixture_itself_is_correct() {
    let compiled = commram_layoutc::compile(Path::new(FIXTURE)).unwrap();
    assert_eq!(compiled.inputs.len(), 5);
    assert!(compiled.rust.contains("assert!(core::mem::offset_of!(CTRL, a_GRID) == 24);"));
}

#[test]
fn missing_device_file() {
    let dir = tempfile::tempdir().unwrap();
    let error = error_of(dir.path());
    assert_eq!(error, "device.toml:1:1: cannot read this file: No such file or directory (os error 2)");
}

#[test]
fn missing_structure_file() {
    let dir = edited("device.toml", "structures = [\"INIT\", \"CTRL\"]", "structures = [\"INIT\", \"GONE\"]");
    assert_eq!(
        error_of(dir.path()),
        "device.toml:7:23: cannot read this file: GONE.toml: No such file or directory (os error 2)"
    );
}

#[test]
fn missing_parts_file() {
    check(
        "device.toml",
        "\"parts.toml\"",
        "\"gone.toml\"",
        "device.toml:6:10: cannot read this file: gone.toml: No such file or directory (os error 2)",
    );
}

#[test]
fn broken_toml() {
    let dir = edited("CTRL.toml", "size = 40", "size = = 40");
    let error = error_of(dir.path());
    assert!(error.starts_with("CTRL.toml:8:"), "{error}");
}

#[test]
fn unknown_key() {
    let dir = edited(
        "CTRL.toml",
        "owner = \"plc\", doc = \"Value\"",
        "owner = \"plc\", colour = 1, doc = \"Value\"",
    );
    let error = error_of(dir.path());
    assert!(
        error.starts_with("CTRL.toml:15:66: unknown field `colour`, expected one of `offset`"),
        "{error}"
    );
}

#[test]
fn unknown_owner() {
    let dir = edited("CTRL.toml", "owner = \"plc\"", "owner = \"nobody\"");
    let error = error_of(dir.path());
    assert_eq!(error, "CTRL.toml:15:59: unknown variant `nobody`, expected one of `plc`, `firmware`, `both`");
}

/// Exported declarations contain the names of all variables.
#[test]
fn names_of_variables_are_identifiers_and_differ() {
    let (placed, ending) = ("{ name = \"INIT\", live = \"init\" }", "variable = \"_INIT\"");
    check(
        "device.toml",
        placed,
        "{ name = \"INIT\", live = \"init\", variable = \"_NODE_ctrl\" }",
        "device.toml:19:12: the variable `_node_CTRL` is at another structure, too; give each structure its own `variable`",
    );
    check(
        "device.toml",
        ending,
        "variable = \" 1\"",
        "device.toml:18:12: `_node 1` is not a name (letters, digits and `_`, not starting with a digit)",
    );
}

#[test]
fn duplicate_structure_area_meaning_and_block() {
    check(
        "CTRL.toml",
        "name = \"CTRL\"",
        "name = \"INIT\"",
        "CTRL.toml:1:8: `INIT` is already in use here; names must be unique",
    );
    check(
        "device.toml",
        "name = \"ram\"",
        "name = \"node\"",
        "device.toml:23:8: `node` is already in use here; names must be unique",
    );
    check(
        "device.toml",
        "name = \"ram\"",
        "name = \"NODE\"",
        "device.toml:23:8: `NODE` differs from `node` only in upper and lower case, which not all languages distinguish; \
         rename it",
    );
    let again = "[[meaning]]\nname = \"state\"\n\n[[substructure]]";
    check(
        "parts.toml",
        "[[substructure]]",
        again,
        "parts.toml:14:8: `state` is already in use here; names must be unique",
    );
}

#[test]
fn unknown_structure_block_and_meaning() {
    check(
        "device.toml",
        "{ name = \"CTRL\"",
        "{ name = \"OTHER\"",
        "device.toml:19:12: unknown structure `OTHER`; `structures` of device.toml lists the known ones",
    );
    check(
        "CTRL.toml",
        "\"GENERAL\"",
        "\"SPECIAL\"",
        "CTRL.toml:11:11: unknown block `SPECIAL`; blocks are defined in the files that `parts` of device.toml lists",
    );
    check(
        "INIT.toml",
        "\"state\"",
        "\"mode\"",
        "INIT.toml:13:74: unknown meaning `mode`; meanings are defined in the files that `parts` of device.toml lists",
    );
}

#[test]
fn past_the_end_of_the_area() {
    check(
        "device.toml",
        "last = 1063",
        "last = 1031",
        "device.toml:19:12: `CTRL` has 40 bytes, but `node` ends after 32",
    );
}

#[test]
fn size_that_is_no_multiple() {
    check(
        "parts.toml",
        "size = 4\npage = \"2\"\ndoc = \"Two words\"\nregister = [",
        "size = 5\npage = \"2\"\ndoc = \"Two words\"\nregister = [\n  \
         { offset = 4, padding = 1 },",
        "parts.toml:21:8: the size of `PAIR` is 5; it must be a multiple of 2",
    );
    check(
        "INIT.toml",
        "size = 8\npage = \"3\"\ndoc = \"Before\"\nblocks = [\"GENERAL\"]\nregister = [",
        "size = 10\npage = \"3\"\ndoc = \"Before\"\nblocks = [\"GENERAL\"]\nregister = [\n  \
         { offset = 8, padding = 2 },",
        "device.toml:18:12: the size of `INIT` is 10; it must be a multiple of 4",
    );
}

#[test]
fn invalid_areas() {
    check(
        "device.toml",
        "first = 1000",
        "first = 1001",
        "device.toml:11:9: area `node` starts at 1001; it must be divisible by 4",
    );
    check(
        "device.toml",
        "last = 2003",
        "last = 1999",
        "device.toml:25:8: area `ram` ends at 1999, before its first byte 2000",
    );
    check(
        "device.toml",
        "first = 2000",
        "first = 1060",
        "device.toml:24:9: area `ram` (1060 to 2003) overlaps area `node`, which ends at 1063",
    );
}

#[test]
fn overlaid_registers_of_different_width() {
    check(
        "INIT.toml",
        "  { offset = 4, name = \"b_MODE\", type = \"BYTE\", owner = \"plc\", meaning = \"state\", doc = \"Mode\" },\n  \
         { offset = 5, name = \"a_TYPE\", type = \"BYTE\", array = [2], owner = \"plc\", doc = \"Types\" },\n  \
         { offset = 7, padding = 1 },",
        "  { offset = 4, name = \"d_MODE\", type = \"DWORD\", owner = \"plc\", doc = \"Mode\" },",
        "device.toml:19:12: `CTRL` has a register of 1 bytes at offset 4 where `INIT`, which lies over it in area \
         `node`, has one of 4: a byte of the RAM must always be accessed at one width; list the unused one in `unused`",
    );
}

#[test]
fn unused_registers() {
    check(
        "device.toml",
        "live = \"init\" }",
        "live = \"init\", unused = [\"a_TYPES\"] }",
        "device.toml:18:45: `INIT` has no register `a_TYPES` that could be unused",
    );
}
