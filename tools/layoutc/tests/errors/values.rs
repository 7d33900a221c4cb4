//! Errors of the ids of values and bits, and the constants of correct ids.

use crate::{FIXTURE, check};
use std::path::Path;

#[test]
fn ids_become_constants() {
    let rust = commram_layoutc::compile(Path::new(FIXTURE)).unwrap().rust;
    let constants = "    /// Meaning `kind`.
    pub mod kind {
        /// 16#0: off (manual 1.00 p. 5).
        pub const OFF: u8 = 0x00;
        /// 16#1 to 16#1F: step n (manual 1.00 p. 5).
        pub const STEPS: core::ops::RangeInclusive<u8> = 0x01..=0x1F;
        /// Bit 5: 0 none, 1 fault (manual 1.00 p. 5).
        pub const FAULT: u8 = 0x20;
        /// Bits 6 to 7: mood (manual 1.00 p. 5).
        pub const MOOD: u8 = 0xC0;
        /// Bits 6 to 7, mood 1: calm (inferred, D-06).
        pub const CALM: u8 = 0x40;
        /// Bits 6 to 7, mood 2: angry (manual 1.00 p. 5).
        pub const ANGRY: u8 = 0x80;
    }
";
    assert!(rust.contains(constants), "{rust}");
    assert!(!rust.contains("pub mod state"), "a meaning without ids");
}

#[test]
fn invalid_ids() {
    check(
        "values.toml",
        "\"OFF\"",
        "\"Off\"",
        "values.toml:6:10: `Off` is no id (capital letters, digits and `_`, starting with a letter)",
    );
    let again = "is already in use here; names must be unique";
    check("values.toml", "\"STEPS\"", "\"OFF\"", &format!("values.toml:7:10: `OFF` {again}"));
    check("values.toml", "\"FAULT\"", "\"OFF\"", &format!("values.toml:10:10: `OFF` {again}"));
    check("values.toml", "\"ANGRY\"", "\"FAULT\"", &format!("values.toml:14:12: `FAULT` {again}"));
    check(
        "values.toml",
        "is = 2, text",
        "from = 2, to = 3, text",
        "values.toml:14:5: a value of a field of bits that has an `id` is a single one (`is`)",
    );
}

#[test]
fn invalid_types_of_meanings() {
    check(
        "values.toml",
        "type = \"BYTE\"\n",
        "",
        "values.toml:5:10: meaning `kind` has an `id` and so needs the `type` of its registers",
    );
    check(
        "values.toml",
        "\"BYTE\"",
        "\"PAIR\"",
        "values.toml:4:8: unknown type `PAIR`; known are BYTE, WORD, DWORD, SINT, INT, DINT, USINT, UINT, UDINT",
    );
    check(
        "values.toml",
        "\"BYTE\"",
        "\"WORD\"",
        "CTRL.toml:14:116: `a_FLAGS` is BYTE, but meaning `kind` has the type WORD, which is of another width",
    );
}

#[test]
fn values_that_do_not_fit() {
    check("values.toml", "0x1F", "0x11F", "values.toml:7:3: value 16#11F does not fit `kind` (BYTE, 8 bits)");
    check("values.toml", "is = 2", "is = 4", "values.toml:14:5: value 16#4 does not fit bits 6 to 7");
}
