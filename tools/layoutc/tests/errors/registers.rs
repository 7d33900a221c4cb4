//! Errors of single registers and their places.

use crate::{check, edited, error_of};

#[test]
fn name_that_is_no_name() {
    check(
        "CTRL.toml",
        "\"b_CONTROL\"",
        "\"b CONTROL\"",
        "CTRL.toml:13:24: `b CONTROL` is not a name (letters, digits and `_`, not starting with a digit)",
    );
}

#[test]
fn variable_that_is_no_name() {
    check(
        "device.toml",
        "live = \"init\" }",
        "live = \"init\", variable = \"_INIT-1\" }",
        "device.toml:18:46: `_INIT-1` is not a name (letters, digits and `_`, not starting with a digit)",
    );
}

#[test]
fn duplicate_register() {
    check(
        "CTRL.toml",
        "\"d_VALUE\"",
        "\"w_STATUS\"",
        "CTRL.toml:15:24: `w_STATUS` starts like another type, but its type is DWORD (`d_`)",
    );
    check(
        "CTRL.toml",
        "name = \"d_VALUE\", type = \"DWORD\"",
        "name = \"w_STATUS\", type = \"WORD\"",
        "CTRL.toml:15:24: `w_STATUS` is already in use here; names must be unique",
    );
    check(
        "CTRL.toml",
        "name = \"d_VALUE\", type = \"DWORD\"",
        "name = \"w_Status\", type = \"WORD\"",
        "CTRL.toml:15:24: `w_Status` differs from `w_STATUS` only in upper and lower case, which not all languages \
         distinguish; rename it",
    );
}

#[test]
fn register_without_a_key() {
    check("CTRL.toml", "name = \"d_VALUE\", ", "", "CTRL.toml:15:3: register without `name`");
    check("CTRL.toml", "type = \"DWORD\", ", "", "CTRL.toml:15:3: register without `type`");
    check("CTRL.toml", "owner = \"plc\", ", "", "CTRL.toml:15:3: register without `owner`");
    check("CTRL.toml", ", doc = \"Value\"", "", "CTRL.toml:15:3: register without `doc`");
}

#[test]
fn padding_with_a_name() {
    check(
        "CTRL.toml",
        "padding = 2",
        "padding = 2, name = \"b_X\"",
        "CTRL.toml:17:3: padding takes no `name`, `type` or `array`",
    );
}

#[test]
fn value_that_is_reserved_and_has_a_text() {
    let expected = "parts.toml:5:3: a value has either a `text` or is `reserved`";
    check("parts.toml", "is = 0, text = \"off\"", "is = 0, text = \"off\", reserved = true", expected);
    check("parts.toml", "is = 0, text = \"off\"", "is = 0", expected);
}

#[test]
fn type_of_an_array_without_one() {
    check(
        "CTRL.toml",
        "name = \"d_VALUE\", ",
        "name = \"d_VALUE\", array_type = \"VALUES\", ",
        "CTRL.toml:15:48: `d_VALUE` has an `array_type` but is no array",
    );
}

#[test]
fn unknown_type() {
    check(
        "CTRL.toml",
        "\"DWORD\"",
        "\"LWORD\"",
        "CTRL.toml:15:42: unknown type `LWORD`; known are BYTE, WORD, DWORD, SINT, INT, DINT, USINT, UINT, UDINT, \
         PAIR",
    );
}

#[test]
fn prefix_that_contradicts_the_type() {
    check(
        "CTRL.toml",
        "\"i_TEMPERATURE\"",
        "\"w_TEMPERATURE\"",
        "CTRL.toml:16:25: `w_TEMPERATURE` starts like another type, but its type is INT (`i_`)",
    );
    check(
        "CTRL.toml",
        "\"d_VALUE\"",
        "\"_VALUE\"",
        "CTRL.toml:15:24: `_VALUE` starts like a sub-structure, but its type is DWORD (`d_`)",
    );
}

#[test]
fn overlap() {
    check(
        "CTRL.toml",
        "offset = 8",
        "offset = 4",
        "CTRL.toml:15:3: `d_VALUE` at offset 4 overlaps `b_CONTROL`, which ends at 5; the first free offset is 5",
    );
    check(
        "CTRL.toml",
        "offset = 4",
        "offset = 3",
        "CTRL.toml:13:3: `b_CONTROL` at offset 3 overlaps `w_STATUS`, which ends at 4; the first free offset is 4",
    );
}

#[test]
fn hidden_gap() {
    check(
        "CTRL.toml",
        "  { offset = 14, padding = 2 },\n",
        "",
        "CTRL.toml:17:3: 2 byte(s) before `a_PAIRS` are not described; write { offset = 14, padding = 2 } if that is \
         meant",
    );
    check(
        "CTRL.toml",
        "size = 40",
        "size = 44",
        "CTRL.toml:8:8: 4 byte(s) before the end of `CTRL` are not described; write { offset = 40, padding = 4 } if \
         that is meant",
    );
}

#[test]
fn misalignment() {
    check(
        "CTRL.toml",
        "offset = 12",
        "offset = 13",
        "CTRL.toml:16:3: `i_TEMPERATURE` (INT) at offset 13 needs an offset divisible by 2",
    );
}

#[test]
fn past_the_end_of_the_structure() {
    check(
        "CTRL.toml",
        "size = 40",
        "size = 36",
        "CTRL.toml:19:3: `a_GRID` ends at 40, past the end of `CTRL` (36 bytes)",
    );
}

#[test]
fn bad_array_bounds() {
    for bounds in ["[0]", "[]", "[1, 2, 3]", "[70000]"] {
        let dir = edited("CTRL.toml", "[2, 2]", bounds);
        let expected = format!(
            "CTRL.toml:19:58: an array has one or two dimensions of 1 to 65535 elements, this one is {bounds}"
        );
        assert_eq!(error_of(dir.path()), expected);
    }
    check(
        "CTRL.toml",
        "used = [2]",
        "used = [4]",
        "CTRL.toml:14:70: `used` is [4] but `array` is [3]: as many numbers, none of them greater",
    );
    check(
        "CTRL.toml",
        "used = [2]",
        "used = [2, 2]",
        "CTRL.toml:14:70: `used` is [2, 2] but `array` is [3]: as many numbers, none of them greater",
    );
}

#[test]
fn sub_structures_that_nest() {
    check(
        "CTRL.toml",
        "array = [2], doc = \"Pairs\"",
        "array = [2, 1], doc = \"Pairs\"",
        "CTRL.toml:18:59: `a_PAIRS`: arrays of sub-structures have one dimension, and so have arrays inside of them",
    );
    check(
        "parts.toml",
        "name = \"w_SECOND\", type = \"WORD\"",
        "name = \"a_SECOND\", type = \"BYTE\", array = [1, 2]",
        "parts.toml:14:8: `a_SECOND`: arrays of sub-structures have one dimension, and so have arrays inside of them",
    );
    let second = "[[substructure]]\nname = \"OUTER\"\nsize = 4\npage = \"2\"\ndoc = \"x\"\nname_from = \"manual\"\noffsets = \"manual\"\n\
                  names = \"manual\"\ntypes = \"manual\"\nowners = \"manual\"\nresets = \"manual\"\n\
                  register = [{ offset = 0, name = \"_INNER\", type = \"PAIR\", doc = \"x\" }]\n\n[[block]]";
    check(
        "parts.toml",
        "[[block]]",
        second,
        "parts.toml:40:51: unknown type `PAIR`; known are BYTE, WORD, DWORD, SINT, INT, DINT, USINT, UINT, UDINT",
    );
}

#[test]
fn sizes_beyond_all_bounds() {
    check(
        "CTRL.toml",
        "[2, 2]",
        "[65535, 65535]",
        "CTRL.toml:19:3: `a_GRID` ends at 4294967295, past the end of `CTRL` (40 bytes)",
    );
}

#[test]
fn array_without_the_prefix_of_arrays() {
    check(
        "CTRL.toml",
        "\"a_GRID\"",
        "\"di_GRID\"",
        "CTRL.toml:19:59: an array needs a name that starts with `a_`, and `a_` needs `array`; this is `di_GRID`",
    );
    check(
        "CTRL.toml",
        "array = [2, 2], ",
        "",
        "CTRL.toml:19:25: an array needs a name that starts with `a_`, and `a_` needs `array`; this is `a_GRID`",
    );
}

#[test]
fn reset_value_that_does_not_fit() {
    check(
        "CTRL.toml",
        "reset = -40",
        "reset = 0x8000",
        "CTRL.toml:16:84: reset value 16#8000 does not fit `i_TEMPERATURE` (INT, 16 bits)",
    );
    check(
        "parts.toml",
        "reset = 1",
        "reset = -1",
        "parts.toml:41:79: reset value -1 does not fit `w_STATUS` (WORD, 16 bits)",
    );
    check(
        "CTRL.toml",
        "type = \"PAIR\"",
        "type = \"PAIR\", reset = 1",
        "CTRL.toml:18:59: a `reset` makes no sense for sub-structure `a_PAIRS`; its registers carry their own",
    );
    check(
        "CTRL.toml",
        "type = \"PAIR\"",
        "type = \"PAIR\", also = \"a_COUPLES\"",
        "CTRL.toml:18:58: a second name, `also`, makes no sense for sub-structure `a_PAIRS`; its registers carry their own",
    );
}
