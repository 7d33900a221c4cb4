//! Errors in phases, in the structures that are valid in one of them, and in handshakes.

use super::{FIXTURE, check, edited, error_of};

#[test]
fn phases_ascend_from_zero_and_have_separate_names() {
    let order = "phases are listed in ascending order of `from`, and the first one begins at 0";
    let first = format!("device.toml:70:27: phase `init`: {order}");
    check("device.toml", "name = \"init\", from = 0", "name = \"init\", from = 1", &first);
    let second = format!("device.toml:71:29: phase `cyclic`: {order}");
    check("device.toml", "from = 3", "from = 0", &second);
    let twice = "device.toml:71:12: `init` is already in use here; names must be unique";
    check("device.toml", "name = \"cyclic\", from", "name = \"init\", from", twice);
    let always = "device.toml:71:12: `always` is already in use here; names must be unique";
    check("device.toml", "name = \"cyclic\", from", "name = \"always\", from", always);
}

#[test]
fn a_layout_has_phases() {
    let text = std::fs::read_to_string(format!("{FIXTURE}/device.toml")).unwrap();
    let (_, values) = text.split_once("values = ").unwrap();
    let expected = "device.toml:69:10: a layout has 1 to 255 phases";
    check("device.toml", &format!("values = {values}"), "values = []\n", expected);
}

#[test]
fn a_structure_names_a_declared_phase() {
    check(
        "device.toml",
        "live = \"init\"",
        "live = \"start\"",
        "device.toml:18:27: unknown phase `start`; known are `always`, `init`, `cyclic`; `[phase]` of device.toml or \
         family.toml declares phases",
    );
}

#[test]
fn structures_with_a_phase_have_the_register() {
    check(
        "device.toml",
        "register = \"w_STATUS\"",
        "register = \"b_MODE\"",
        "device.toml:19:27: `CTRL` has no register `b_MODE`, which shows the phase; a structure that is valid in one \
         phase has it, as a single register",
    );
    check(
        "device.toml",
        "register = \"w_STATUS\"",
        "register = \"a_TYPE\"",
        "device.toml:18:27: `INIT` has no register `a_TYPE`, which shows the phase; a structure that is valid in one \
         phase has it, as a single register",
    );
}

#[test]
fn structures_with_a_phase_have_the_register_at_one_offset() {
    let dir = edited("device.toml", "register = \"w_STATUS\"", "register = \"b_MODE\"");
    let path = dir.path().join("CTRL.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let row = "offset = 5, name = \"a_FLAGS\", type = \"BYTE\", array = [3], used = [2],";
    let moved = text.replace(row, "offset = 7, name = \"b_MODE\", type = \"BYTE\",");
    assert_ne!(text, moved);
    let padding = "  { offset = 5, padding = 2 },\n  { offset = 7,";
    std::fs::write(&path, moved.replace("  { offset = 7,", padding)).unwrap();
    assert_eq!(
        error_of(dir.path()),
        "device.toml:19:27: `b_MODE` shows the phase, and so has one offset in `CTRL` and in `INIT`, which lies over it"
    );
}

#[test]
fn the_register_holds_the_first_value_of_each_phase() {
    check(
        "device.toml",
        "from = 3",
        "from = 65536",
        "device.toml:71:29: `from` 65536 does not fit `w_STATUS` (WORD, 16 bits)",
    );
}

#[test]
fn a_handshake_has_two_single_values_of_the_meaning() {
    for (request, unknown) in [(5, "0x05"), (12, "0x0C")] {
        let given = format!(
            "page = \"2\"\nhandshake = {{ request = {request}, answer = 0 }}\nvalue = [\n  {{ is = 0"
        );
        check(
            "parts.toml",
            "page = \"2\"\nvalue = [\n  { is = 0",
            &given,
            &format!(
                "parts.toml:4:13: `handshake` has {unknown}, which is no single value (`is`) of the meaning"
            ),
        );
    }
}
