//! Errors in address spaces, in the areas in them, and in the front panel.

use super::{check, edited};

const END: &str = "doc = \"Shared memory\"\n";

/// Checks the error for a device.toml with `more` at its end.
#[track_caller]
fn with(more: &str, expected: &str) {
    check("device.toml", END, &format!("{END}\n{more}"), expected);
}

#[test]
fn invalid_spaces() {
    let message = |key: &str, value: u32, by: u32| {
        format!(
            "`{key}` of space `memory` is {value}; it must be divisible by {by}, so that data aligned in the space \
             are aligned in the image"
        )
    };
    check(
        "device.toml",
        "offset = 4096",
        "offset = 4092",
        "device.toml:62:10: space `memory` begins at byte 4092 of the image; the first 4096 bytes are the header page",
    );
    check(
        "device.toml",
        "offset = 4096",
        "offset = 4098",
        &format!("device.toml:62:10: {}", message("offset", 4098, 4)),
    );
    check(
        "device.toml",
        "first = 0\noffset",
        "first = 2\noffset",
        &format!("device.toml:61:9: {}", message("first", 2, 4)),
    );
    check(
        "device.toml",
        "unit = \"byte\"",
        "unit = \"bit\"",
        "device.toml:60:8: unknown variant `bit`, expected `byte` or `word`",
    );
    check(
        "device.toml",
        "letter = \"M\"",
        "letter = \"R\"",
        "device.toml:58:10: unknown variant `R`, expected one of `I`, `Q`, `M`",
    );
}

#[test]
fn spaces_that_overlap() {
    let second = |letter: &str, segment: &str, first: u32, offset: u32| {
        format!(
            "[[space]]\nname = \"more\"\nletter = \"{letter}\"\n{segment}unit = \"byte\"\nfirst = {first}\noffset = {offset}\n\
             bytes = 100\npage = \"1\"\ndoc = \"More\"\n"
        )
    };
    with(
        &second("I", "", 0, 6096),
        "device.toml:67:8: space `more` has bytes 6096 to 6195 of the image, which space `memory` has, too",
    );
    with(
        &second("M", "segment = 3\n", 1000, 8192),
        "device.toml:67:8: addresses of space `more` are written like those of `memory`, which has the same numbers",
    );
    assert!(
        commram_layoutc::compile(
            edited("device.toml", END, &(END.to_owned() + &second("M", "", 0, 8192))).path()
        )
        .is_ok()
    );
    with(
        &second("M", "", 0, 8192).replace("bytes = 100\n", ""),
        "device.toml:67:8: space `more` has no area that defines its end; give its `bytes`",
    );
    with(
        &second("M", "", 0, 8192).replace("\"more\"", "\"memory\""),
        "device.toml:67:8: `memory` is already in use here; names must be unique",
    );
    with(
        &second("M", "", 4_294_967_292, 8192),
        "device.toml:67:8: space `more` does not end within the 4 GiB that an address can name",
    );
}

#[test]
fn areas_outside_of_spaces() {
    check(
        "device.toml",
        "offset = 4096",
        "offset = 4096\nbytes = 2000",
        "device.toml:24:9: area `ram` (2000 to 2003) does not lie in space `memory`, which has 0 to 1999",
    );
    check(
        "device.toml",
        "first = 2000",
        "space = \"flags\"\nfirst = 2000",
        "device.toml:24:9: unknown space `flags`; spaces are defined under [[space]] of device.toml",
    );
    check(
        "device.toml",
        "unit = \"byte\"\nfirst = 0",
        "unit = \"word\"\nfirst = 2001",
        "device.toml:61:9: `first` of space `memory` is 2001; it must be divisible by 2, so that data aligned in the \
         space are aligned in the image",
    );
}

#[test]
fn invalid_retain_areas() {
    let most = "takes no structures, and a `retain` of 4 to";
    for (bytes, area) in [(0, 4), (8, 4), (3, 4)] {
        let edit = format!("retain = {bytes}\nfirst = 2000");
        let expected = format!("device.toml:24:10: retain area `ram` {most} {area} bytes, divisible by 4");
        check("device.toml", "first = 2000", &edit, &expected);
    }
    check(
        "device.toml",
        "first = 1000",
        "retain = 4\nfirst = 1000",
        &format!("device.toml:11:10: retain area `node` {most} 64 bytes, divisible by 4"),
    );
    let other =
        "[[area]]\nname = \"more\"\nfirst = 3000\nlast = 3003\nretain = 4\npage = \"1\"\ndoc = \"More\"";
    check(
        "device.toml",
        "doc = \"Plain RAM\"",
        &format!("doc = \"Plain RAM\"\nretain = 4\n\n{other}"),
        "device.toml:36:10: `ram` is the retain area already; a device has one",
    );
}

#[test]
fn cpu_addresses_have_two_ends() {
    check(
        "device.toml",
        "cpu_last = 0x103F\n",
        "",
        "device.toml:10:8: `cpu_first` and `cpu_last` are given together or not at all",
    );
}

#[test]
fn words_of_the_front() {
    let word = |name: &str, ty: &str, offset: u32| {
        format!(
            "[[front]]\nname = \"{name}\"\ntype = \"{ty}\"\noffset = {offset}\nowner = \"plc\"\nsource = \"manual\"\npage = \"1\"\n\
             doc = \"A word\"\n"
        )
    };
    with(
        &word("d_LAMP", "WORD", 0),
        "device.toml:68:8: `d_LAMP` is WORD; the front has words of 32 bits: DWORD, DINT, UDINT",
    );
    for offset in [2, 256] {
        with(
            &word("d_LAMP", "DWORD", offset),
            &format!(
                "device.toml:69:10: `d_LAMP` at offset {offset}: offsets in the front are 0 to 252, divisible by 4"
            ),
        );
    }
    let twice = word("d_LAMP", "DWORD", 8) + &word("d_KEYS", "DWORD", 8);
    with(&twice, "device.toml:77:10: `d_KEYS` at offset 8 lies over `d_LAMP`");
    let meaning = word("d_LAMP", "DWORD", 8) + "meaning = \"lamps\"\n";
    with(
        &meaning,
        "device.toml:74:11: unknown meaning `lamps`; meanings are defined in the files that `parts` of device.toml lists",
    );
    let whole = END.to_owned() + "\n" + &word("d_LAMP", "UDINT", 252);
    let rust = commram_layoutc::compile(edited("device.toml", END, &whole).path()).unwrap().rust;
    assert!(rust.contains("pub const FRONT_D_LAMP: usize = 63;"));
}
