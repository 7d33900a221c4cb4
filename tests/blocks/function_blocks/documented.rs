//! `docs/devices/omega-drive-line-2/function-blocks.md`, `docs/devices/cs0015/function-blocks.md` and
//! `docs/devices/can-dp2/function-blocks.md` name every input and output with its preset, and the presets are those of
//! the manual.

use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::{self, Registered};
use commram::memory::Segment;
use commram::plc::{BlockContext, BlockKind, Direction, PinValue, Variables};
use std::collections::BTreeSet;
use std::time::Duration;

const DOCS: &str = include_str!("../../../docs/devices/omega-drive-line-2/function-blocks.md");
const CS0015: &str = include_str!("../../../docs/devices/cs0015/function-blocks.md");
const CAN_DP2: &str = include_str!("../../../docs/devices/can-dp2/function-blocks.md");

/// Returns a preset as the documentation prints it.
fn shown(preset: &PinValue) -> String {
    match preset {
        PinValue::Bool(value) => value.to_string().to_uppercase(),
        PinValue::Time(time) => format!("{} s", time.as_secs()),
        PinValue::Array(items) => {
            assert!(items.iter().all(|item| *item == items[0]));
            format!("all {}", shown(&items[0]))
        }
        other => other.to_string(),
    }
}

/// Returns the type that the manual's prefix of a pin denotes; without a prefix, the types that its value can have.
fn type_of(block: &str, pin: &str, preset: &PinValue) -> &'static str {
    // The pins of FB1 have small letters and no prefixes.
    if block == "FB1" || pin.starts_with(|first: char| first.is_ascii_uppercase()) {
        return match preset {
            PinValue::Bool(_) => "BOOL",
            PinValue::Time(_) => "TIME",
            // The documents write presets of BYTE, WORD and DWORD in one notation, so a preset does not show the type.
            _ => "",
        };
    }
    match pin.split('_').next().unwrap() {
        "x" => "BOOL",
        "b" => "BYTE",
        "si" => "SINT",
        "us" => "USINT",
        "w" => "WORD",
        "i" => "INT",
        "u" => "UINT",
        "d" => "DWORD",
        "ud" => "UDINT",
        "t" => "TIME",
        "a" => "_BMARRAY",
        prefix => panic!("{prefix}_ of {pin} is no prefix of the manual"),
    }
}

/// Returns the section that describes a block; one section may describe several blocks.
fn section(block: &str) -> &'static str {
    [DOCS, CS0015, CAN_DP2]
        .into_iter()
        .flat_map(|page| page.split("\n### ").skip(1))
        .find(|section| {
            section.lines().next().is_some_and(|title| title.split(", ").any(|name| name == block))
        })
        .unwrap_or_else(|| panic!("{block} is not documented"))
}

/// Returns the value of each pin of a new block.
fn presets(device: &Registered, kind: &BlockKind) -> Vec<PinValue> {
    let has = |area: &&commram::layout::Area| {
        area.structures.iter().any(|placed| Some(placed.structure.name) == kind.structure)
    };
    let area = device.layout.areas.iter().find(has);
    assert_eq!(area.is_some(), kind.structure.is_some(), "{} works on {:?}", kind.name, kind.structure);
    let ram = Ram::of(&Segment::of(device.layout)).unwrap();
    let offset = area.map_or(0, |area| area.first);
    let block = kind.make(&BlockContext { ram: &ram, offset, variables: &Variables::default() }).unwrap();
    assert_eq!(block.get("x_UNHEARD_OF"), None);
    kind.pins.iter().map(|pin| block.get(pin.name).unwrap()).collect()
}

/// Returns the text between the backquotes at the beginning of `text`.
fn quoted(text: &str) -> &str {
    text.split('`').nth(1).unwrap_or_default()
}

#[test]
fn every_input_and_output_is_documented_with_its_type_and_preset() {
    for (device, kind) in
        devices::all().iter().flat_map(|device| device.blocks.iter().map(move |kind| (device, kind)))
    {
        let section = section(kind.name);
        let rows = section.lines().filter(|line| line.starts_with("| in |") || line.starts_with("| out |"));
        let rows = rows.map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
        // One row documents `us_SL_TYP0` ... `us_SL_TYP31`.
        let mut rows = rows.flat_map(|row| {
            let first = quoted(row[2]).to_owned();
            let count = if row[2].contains("` ... `") { 32 } else { 1 };
            (0..count).map(move |number| {
                let name = if count == 1 { first.clone() } else { first.replace('0', &number.to_string()) };
                (row[1], name, row[3], row[4])
            })
        });
        let data = section.split("In/out: ").nth(1).and_then(|text| text.split(" (").next());
        let mut data = data.unwrap_or_default().split(", ").map(quoted);
        for (pin, preset) in kind.pins.iter().zip(presets(device, kind)) {
            let place = format!("{}.{}", kind.name, pin.name);
            let side = match pin.direction {
                Direction::In => "in",
                Direction::Out => "out",
                Direction::InOut => {
                    assert_eq!(data.next(), Some(pin.name), "{place}");
                    continue;
                }
            };
            let right_type = type_of(kind.name, pin.name, &preset);
            let preset = shown(&preset);
            let (way, name, pin_type, documented) =
                rows.next().unwrap_or_else(|| panic!("{place} has no row"));
            assert_eq!((way, name.as_str()), (side, pin.name), "{place}");
            assert!(pin_type.ends_with(right_type), "{place}: {pin_type}");
            let hex = preset.parse().map(|value: u8| format!("16#{value:02X}"));
            let fits = documented == preset || hex.is_ok_and(|hex| documented == hex);
            assert!(fits || side == "out" && documented.is_empty(), "{place}: {preset}");
        }
        assert_eq!(rows.next(), None, "{}", kind.name);
        assert!(data.all(|name| name.is_empty() || name.starts_with('_')), "{}", kind.name);
    }
}

/// A test calls every block with live firmware. A separate test checks this for the blocks of the CS0015.
#[test]
fn every_block_is_tested() {
    let tests = [
        include_str!("baps.rs"),
        include_str!("../cansync/bench.rs"),
        include_str!("board.rs"),
        include_str!("../cansync/command_channel.rs"),
        include_str!("../cansync/parameter.rs"),
        include_str!("../cansync/process_data.rs"),
        include_str!("../serial.rs"),
        include_str!("../serial_uss.rs"),
        include_str!("service_data.rs"),
        include_str!("../cansync/start.rs"),
        include_str!("../cansync/updownload.rs"),
    ];
    let titles = DOCS.lines().filter_map(|line| line.strip_prefix("### "));
    let blocks: Vec<_> = titles.flat_map(|title| title.split(", ")).collect();
    assert_eq!(blocks.len(), 24 + 8 + 5 + 2, "{blocks:?}");
    let words: BTreeSet<_> =
        tests.iter().flat_map(|test| test.split(|c: char| !c.is_alphanumeric() && c != '_')).collect();
    for block in blocks {
        assert!(words.contains(block), "{block}");
    }
}

/// Tests every preset of these blocks that the manual names.
#[test]
fn presets_are_the_manuals() {
    let init = BAPS_INIT::default();
    assert_eq!((init.us_HW_TYPE, init.i_EVENT, init.x_EN), (0, 0, true), "p. 87, 91");
    assert_eq!(init.t_TIME, Duration::from_secs(3), "p. 91");
    assert_eq!(BAPS_PAR_READ::default().us_PAR_ELEMENT, 7, "p. 94");
    assert!(BAPS_PAR_WRITE::default().x_EN_ERR_FORMAT, "p. 97");
    let [two, eight] = [
        (
            BAPS_PD_COMM2::default().us_HW_TYPE,
            BAPS_PD_COMM2::default().us_MODE,
            BAPS_PD_COMM2::default().x_EN,
        ),
        (
            BAPS_PD_COMM8::default().us_HW_TYPE,
            BAPS_PD_COMM8::default().us_MODE,
            BAPS_PD_COMM8::default().x_EN,
        ),
    ];
    assert_eq!([two, eight], [(0, 0, true); 2], "p. 99-102, 112-115");
    let comm = BAPS_PD_COMM24::default();
    assert_eq!((comm.us_HW_TYPE, comm.us_MODE, comm.x_EN), (0, 0, true), "p. 104-107");
    assert_eq!(comm.t_RE_INIT_TIME, Duration::from_secs(1), "p. 109");
    assert_eq!(BAPS_PD_CONTROL::default().t_TIME, Duration::from_secs(3), "p. 117");
    assert_eq!(BAPS_SD_CONTROL::default().t_TIME, Duration::from_secs(3), "p. 119");
}
