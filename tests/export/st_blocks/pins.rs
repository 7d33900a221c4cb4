//! The interface of the exported blocks: their names and pins as in
//! docs/devices/omega-drive-line-2/function-blocks.md, which is also compared with the Rust blocks, and the registers
//! that they use.

use crate::common::{Outcome, finish, python, run};
use commram::devices::{self, Registered};
use commram::layout::Structure;
use commram::plc::Direction;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const DOCS: &str = include_str!("../../../docs/devices/omega-drive-line-2/function-blocks.md");

fn exported(device: &str) -> Outcome {
    run(&["export", "st", "--blocks", "--device", device])
}

/// A pin: direction, name, type, preset.
type Pin = (Direction, String, String, String);

fn with_blocks() -> impl Iterator<Item = &'static &'static Registered> {
    devices::all().iter().filter(|device| !device.st.is_empty())
}

/// Returns the text of each block by its name, without comments.
fn blocks(text: &str) -> BTreeMap<String, String> {
    let mut plain = String::new();
    for (index, part) in text.split("(*").enumerate() {
        plain += if index == 0 { part } else { part.split_once("*)").unwrap().1 };
    }
    let parts = plain.split("\nFUNCTION_BLOCK ").skip(1).map(|part| {
        let (body, _) = part.split_once("END_FUNCTION_BLOCK").unwrap();
        let (name, rest) = body.split_once('\n').unwrap();
        (name.trim().to_owned(), rest.to_owned())
    });
    parts.collect()
}

/// Returns the pins of a block as its text declares them, without `_BASE`.
fn pins(body: &str) -> Vec<Pin> {
    let mut pins = Vec::new();
    for (keyword, direction) in
        [("VAR_INPUT", Direction::In), ("VAR_OUTPUT", Direction::Out), ("VAR_IN_OUT", Direction::InOut)]
    {
        for section in body.split(keyword).skip(1) {
            let (section, _) = section.split_once("END_VAR").unwrap();
            for line in section.split(';').map(str::trim).filter(|line| !line.is_empty()) {
                let (name, rest) = line.split_once(" : ").unwrap();
                let (ty, preset) = rest.split_once(" := ").unwrap_or((rest, ""));
                if name != "_BASE" {
                    pins.push((direction, name.to_owned(), ty.to_owned(), preset.to_owned()));
                }
            }
        }
    }
    pins
}

fn quoted(text: &str) -> &str {
    text.split('`').nth(1).unwrap_or_default()
}

/// Returns the pins of a block as on the page.
fn documented(block: &str) -> Vec<Pin> {
    let mut sections = DOCS.split("\n### ").skip(1);
    let is_its = |title: &str| title.split(", ").any(|name| name == block);
    let section = sections.find(|section| is_its(section.lines().next().unwrap())).unwrap();
    let mut pins = Vec::new();
    for line in section.lines() {
        let direction = match line.get(..7) {
            Some("| in | ") => Direction::In,
            Some("| out |") => Direction::Out,
            _ => continue,
        };
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        let names = if cells[2].contains("` ... `") { 32 } else { 1 };
        for number in 0..names {
            let name = quoted(cells[2]);
            let name = if names == 1 { name.to_owned() } else { name.replace('0', &number.to_string()) };
            pins.push((direction, name, cells[3].to_owned(), cells[4].to_owned()));
        }
    }
    // `a_DOWNLOAD`, `a_UPLOAD` (`CANsync_UPDOWN_BMARRAY`, ...
    if let Some((names, rest)) = section.split("In/out: ").nth(1).and_then(|text| text.split_once(" (")) {
        let names = names.split(", ").map(quoted);
        pins.extend(
            names.map(|name| (Direction::InOut, name.to_owned(), quoted(rest).to_owned(), String::new())),
        );
    }
    pins
}

/// Returns a preset of the page in Structured Text; a preset of 0 is omitted.
fn preset(documented: &str) -> String {
    match documented {
        "0" | "FALSE" | "all 0" | "all FALSE" => String::new(),
        "all -1" => "[4(-1)]".to_owned(),
        time if time.ends_with(" s") => format!("T#{}", time.replace(' ', "")),
        other => other.to_owned(),
    }
}

#[test]
fn every_block_is_exported_with_its_documented_pins() {
    for device in with_blocks() {
        let export = exported(device.layout.name);
        let blocks = blocks(export.ok());
        for kind in device.blocks {
            let body =
                blocks.get(kind.name).unwrap_or_else(|| panic!("{}: no {}", device.layout.name, kind.name));
            let documented: Vec<_> = documented(kind.name)
                .into_iter()
                .map(|(direction, name, ty, shown)| (direction, name, ty, preset(&shown)))
                .collect();
            // The manual may leave out presets of outputs.
            let ours = pins(body).into_iter().map(|(direction, name, ty, preset)| {
                let preset = if direction == Direction::Out { String::new() } else { preset };
                (direction, name, ty, preset)
            });
            assert_eq!(ours.collect::<Vec<_>>(), documented, "{}", kind.name);
            let names: Vec<_> = kind.pins.iter().map(|pin| (pin.direction, pin.name)).collect();
            let same: Vec<_> =
                documented.iter().map(|(direction, name, ..)| (*direction, name.as_str())).collect();
            if !kind.name.starts_with("BAPS_PAR_") && kind.name != "BAPS_SD_CONTROL" {
                assert_eq!(names, same, "{}", kind.name);
            }
            // The structure that `_BASE` refers to.
            let base = body.split("_BASE : REF_TO ").nth(1).map(|rest| rest.split(';').next().unwrap());
            assert!(base.is_none() || base == kind.structure, "{}: {base:?}", kind.name);
        }
        let helpers = blocks.keys().filter(|name| !name.starts_with("COMMRAM_")).count();
        assert_eq!(helpers, device.blocks.len(), "{}", device.layout.name);
    }
}

/// Returns the name at the beginning, without indices.
fn path(text: &str) -> String {
    let mut depth = 0;
    let of_name = text.chars().take_while(|c| {
        depth += i32::from(*c == '[') - i32::from(*c == ']');
        depth > 0 || c.is_alphanumeric() || "_.]".contains(*c)
    });
    let name: String = of_name.collect();
    name.split('[').map(|part| part.split_once(']').map_or(part, |(_, following)| following)).collect()
}

/// A compiler also finds these errors, but not every machine has a compiler.
#[test]
fn every_register_of_a_block_is_in_its_structure() {
    let mut seen = 0;
    for device in with_blocks() {
        let export = exported(device.layout.name);
        for (name, body) in blocks(export.ok()) {
            let Some(base) = body.split("_BASE : REF_TO ").nth(1) else { continue };
            let base = base.split(';').next().unwrap();
            let structures = device.layout.areas.iter().flat_map(|area| area.structures);
            let structure: &Structure =
                structures.map(|placed| placed.structure).find(|it| it.name == base).unwrap();
            let known: BTreeSet<_> = structure.registers.iter().map(|register| register.name).collect();
            let groups: BTreeSet<_> = structure.registers.iter().map(|register| register.group).collect();
            for used in body.split("_BASE^.").skip(1) {
                let path = path(used);
                match path.split_once('.') {
                    Some((group, member)) => {
                        assert!(groups.contains(group) && known.contains(member), "{name}: {path}");
                    }
                    None => assert!(known.contains(path.as_str()), "{name}: {path}"),
                }
                seen += 1;
            }
        }
    }
    assert!(seen > 500, "{seen}");
}

#[test]
fn the_blocks_are_structured_text() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("blocks.st");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_st.py");
    let export = exported("omega-drive-line-2");
    // Another test parses the types. The parser is slow, so each part of the text is parsed alone.
    let (_, mut rest) = export.ok().split_once("(* A monitoring time").unwrap();
    let begins =
        ["CANsync_PD_CFG_MA", "INTR_SET, with", "BAPS_INIT:", "The data of a block of the procedure"];
    let mut parts = Vec::new();
    for begin in begins {
        let (part, others) = rest.split_once(&format!("(* {begin}")).unwrap();
        parts.push(part);
        rest = others;
    }
    parts.push(rest);
    for part in parts.iter().map(|part| format!("(* {part}")) {
        let Some(mut python) = python(&["blark"]) else { return };
        std::fs::write(&path, part).unwrap();
        let outcome = finish(python.arg(&script).arg(&path));
        assert!(outcome.ok().starts_with("parsed "), "{}", outcome.out);
    }
}

#[test]
fn the_error_for_a_device_without_blocks_lists_devices_with_blocks() {
    let refused = run(&["export", "st", "--blocks", "--device", "cs0015"]);
    assert!(refused.fails(2).contains("omega-drive-line-2, bm4-plc"), "{}", refused.err);
    for args in
        [&["st", "--blocks", "--elementary"][..], &["st", "--blocks", "--block", "node2"], &["c", "--blocks"]]
    {
        run(&[&["export"], args].concat()).fails(2);
    }
}
