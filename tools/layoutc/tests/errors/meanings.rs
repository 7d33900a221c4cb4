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
fn names_of_meanings_are_identifiers() {
    check(
        "parts.toml",
        "[[meaning]]\nname = \"state\"",
        "[[meaning]]\nname = \"\u{72b6}\u{614b}\"",
        "parts.toml:2:8: `\u{72b6}\u{614b}` is not a name (letters, digits and `_`, not starting with a digit)",
    );
    check(
        "parts.toml",
        "[[substructure]]",
        "[[meaning]]\nname = \"STATE\"\n\n[[substructure]]",
        "parts.toml:14:8: `STATE` differs from `state` only in upper and lower case, which not all languages distinguish; \
         rename it",
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
