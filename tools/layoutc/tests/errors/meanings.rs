//! Errors of values and bits.

use crate::check;

#[test]
fn value_with_a_meaning_that_does_not_fit() {
    check(
        "parts.toml",
        "to = 9",
        "to = 0x100",
        "parts.toml:6:3: value 16#100 does not fit `b_MODE` (BYTE, 8 bits)",
    );
}

#[test]
fn bit_outside_the_width() {
    check(
        "parts.toml",
        "to = 7",
        "to = 8",
        "parts.toml:10:3: bit 8 of meaning `state` does not fit `b_MODE` (BYTE, 8 bits)",
    );
}

#[test]
fn bits_and_values_described_twice() {
    check("parts.toml", "at = 4", "at = 6", "parts.toml:10:3: bit 6 is described twice");
    check("parts.toml", "is = 0", "is = 3", "parts.toml:6:3: value 16#1 has two meanings");
}

#[test]
fn invalid_ranges() {
    check(
        "parts.toml",
        "from = 1, to = 9",
        "from = 9, to = 1",
        "parts.toml:6:3: a value needs either `is`, or `from` and `to` in ascending order",
    );
    check(
        "parts.toml",
        "at = 4, ",
        "",
        "parts.toml:9:3: a bit needs either `at`, or `from` and `to` in ascending order",
    );
}
