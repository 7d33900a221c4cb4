//! commram with a device of another crate: tests all features, from the map to a scenario, with the
//! program of the device's crate.

#![allow(unexpected_cfgs, reason = "the modules shared with commram's tests check its features")]

#[path = "../../common/mod.rs"]
mod common;

use common::{Emulator, Follower, finish, run};
use commram::devices::{self, RegisterError};
use commram::memory::AttachMode;
use commram_invented::GATE;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Two gates at one bus.
const PLANT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/two-gates.toml");

fn start() -> Emulator {
    Emulator::start(&[PLANT, "--clock", "stepped"])
}

/// The purpose of this crate is to show that a device needs little code.
#[test]
fn a_device_takes_at_most_150_lines() {
    fn lines(directory: &Path) -> usize {
        let entries = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
        let count = |path: std::path::PathBuf| match path.is_dir() {
            true => lines(&path),
            false => fs::read_to_string(path).unwrap().lines().count(),
        };
        entries.filter(|path| !path.ends_with("tests")).map(count).sum()
    }
    let lines = lines(Path::new(env!("CARGO_MANIFEST_DIR")));
    assert!((100..=150).contains(&lines), "{lines} lines");
}

#[test]
fn it_is_registered_once_and_before_anything_else() {
    devices::register(&GATE).unwrap();
    let again = devices::register(&GATE);
    assert!(matches!(again, Err(RegisterError::Taken { name: "gate", other: "gate", .. })), "{again:?}");
    assert!(devices::find("gate").is_some_and(|found| std::ptr::eq(found, &GATE)));
    assert_eq!(devices::register(&GATE), Err(RegisterError::TooLate { name: "gate" }));
    let catalogue = devices::catalogue();
    assert!(catalogue.kind("passed").is_some() && catalogue.rule_called("gate-nothing").is_some());

    // A program that has registered the device attaches to it as to any other, and finds the words of its front panel.
    let emulator = start();
    emulator.poke(&["left:out.w_VALUE=1", "left:out.w_SEND=16#05"]);
    emulator.step(&["10ms"]);
    let (image, layout) = devices::attach(&emulator.name, "right", AttachMode::ReadOnly).unwrap();
    let passed = layout.register("front.passed").unwrap();
    assert_eq!((layout.name, passed.address().to_string().as_str()), ("gate", "%FD0"));
    let value = image.segment().load(passed.offset(), passed.address().width()).unwrap();
    assert_eq!((value, image.header_snapshot().front[0].load()), (1, 1));
}

/// The words of a device's front panel are read by name like a register, and only the firmware writes them.
#[test]
fn its_front_is_read_by_name() {
    let map = run(&["map", "front", "--device", "gate"]);
    for word in ["front.passed", "%FD0", "firmware", "Counts values"] {
        assert!(map.ok().contains(word), "{}", map.out);
    }
    let emulator = start();
    let before = emulator.run("dump", &["--all", "--format", "json"]);
    emulator.poke(&["left:out.w_VALUE=1", "left:out.w_SEND=16#05"]);
    emulator.step(&["10ms"]);
    assert_eq!(
        emulator.peek(&["right:front.passed", "right:%FD0", "left:front.passed"]),
        "16#00000001 16#00000001 16#00000000"
    );
    assert!(emulator.run("wait", &["right:front.passed==1", "--within", "1ms"]).ok().contains('1'));
    let dump = emulator.run("dump", &["right:"]);
    assert!(dump.ok().contains("right:front.passed"), "{}", dump.out);
    let path = std::env::temp_dir().join(format!("{}.json", emulator.name));
    fs::write(&path, before.ok()).unwrap();
    let diff = emulator.run("diff", &[path.to_str().unwrap()]);
    fs::remove_file(&path).unwrap();
    assert!(diff.out.contains("right:front.passed"), "{}", diff.out);
    for command in ["poke", "force"] {
        let refused = emulator.run(command, &["right:front.passed=7"]);
        assert!(
            refused.fails(2).contains("front.passed (%FD0) is set by the firmware; it can only be read"),
            "{}",
            refused.err
        );
    }
    let part = emulator.run("poke", &["right:%FB1=7"]);
    assert!(part.fails(2).contains("only the whole word can be written"), "{}", part.err);
    let unknown = emulator.run("peek", &["right:front.passes"]);
    assert!(unknown.fails(2).contains("has no register `passes`"), "{}", unknown.err);
}

/// The located variables of a program that matiec compiles have the addresses of the device's registers.
#[test]
fn located_variables_are_its_registers() {
    const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../matiec");
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("located");
    fs::create_dir_all(&directory).unwrap();
    let file = |name: &str| directory.join(name);
    let glue = file("commram_matiec.h");
    run(&["export", "matiec", "--device", "gate", "--output", glue.to_str().unwrap()]).ok();
    let compile = |located: &str| {
        let program = format!(
            "#include \"iec_std_lib.h\"\n#include \"commram_matiec.h\"\nCOMMRAM_MATIEC_STORAGE\n{located}\n\
             int main(void) {{ return !((unsigned char *)value == commram_matiec_ram + 4096 && \
             (unsigned char *)send == commram_matiec_ram + 8194 && own != value); }}\n"
        );
        fs::write(file("program.c"), program).unwrap();
        let mut cc = Command::new("cc");
        cc.current_dir(&directory).args(["-std=gnu11", "-Wall", "-Wextra", "-Werror", "-I", SOURCES]);
        finish(cc.args(["-o", "program", "program.c"]))
    };
    let good =
        "__LOCATED_VAR(WORD,value,I,W,0)\n__LOCATED_VAR(WORD,send,Q,W,1)\n__LOCATED_VAR(WORD,own,M,W,0)\n";
    compile(good).ok();
    assert_eq!(finish(&mut Command::new(file("program"))).code, Some(0));
    // Inputs and outputs belong to the program, so it may read a part of them (D-772).
    compile(&format!("{good}__LOCATED_VAR(BYTE,part,I,B,1)")).ok();
    let refused = compile(&format!("{good}__LOCATED_VAR(BOOL,bit,Q,X,1,15)"));
    let why = "bit: a single bit has no separate address";
    assert!(refused.code != Some(0) && refused.err.contains(why), "{}", refused.err);
}

#[test]
fn its_map_has_names_addresses_and_pages() {
    let map = run(&["map", "--device", "gate", "--format", "csv"]);
    for (name, address) in [("in.w_VALUE", "%IW0"), ("out.w_VALUE", "%QW0"), ("out.w_SEND", "%QW1")] {
        let line = map.ok().lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("{}", map.out));
        assert!(line.contains(address), "{line}");
    }
    let unknown = run(&["map", "--device", "gat"]);
    assert!(unknown.fails(2).contains("gate"), "{}", unknown.err);
}

#[test]
fn a_value_passes_from_gate_to_gate() {
    let emulator = start();
    emulator.poke(&["left:%QW0=16#1234", "left:out.w_SEND=16#05"]);
    emulator.step(&["500us"]);
    assert_eq!(emulator.peek(&["left:out.w_SEND", "right:in.w_VALUE"]), "16#0004 16#0000");
    emulator.step(&["5ms"]);
    assert_eq!(emulator.peek(&["right:%IW0", "right:%IX0.09", "left:in.w_VALUE"]), "16#1234 1 16#0000");
    let dump = emulator.run("dump", &["right:in"]);
    for word in ["w_VALUE", "%IW0", "16#1234"] {
        assert!(dump.ok().contains(word), "{}", dump.out);
    }

    let trace = emulator.run("trace", &["--format", "jsonl"]);
    let records: Vec<serde_json::Value> =
        trace.ok().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let found: Vec<_> = records.iter().filter_map(|record| record["kind"].as_str()).collect();
    let kinds = ["channel_write", "channel_write", "handshake", "can_frame", "passed"];
    assert_eq!(found, kinds, "{}", trace.out);
    let (handshake, frame, passed) = (&records[2], &records[3], &records[4]);
    assert_eq!(
        (&handshake["plc"], &handshake["request"], &handshake["answer"]),
        (&"left".into(), &5.into(), &4.into())
    );
    assert_eq!(
        (&frame["bus"], &frame["id"], &frame["data"]),
        (&"open".into(), &0x123.into(), &"3412".into())
    );
    assert_eq!(frame["from"], "left:can1");
    assert_eq!((&passed["plc"], &passed["value"]), (&"right".into(), &0x1234.into()));
    // At 33.3 kbit/s, a bit does not last a whole number of microseconds. Only the end of a frame is rounded.
    let (begin, end) = (handshake["time_us"].as_u64().unwrap(), frame["time_us"].as_u64().unwrap());
    assert_eq!((end - begin, &passed["time_us"]), (airtime_us(), &frame["time_us"]));
}

/// Returns the time from the start bit to the end of the frame, rounded up.
fn airtime_us() -> u64 {
    use commram::can::{BitRate, Frame, Payload, wire};
    let frame = Frame::standard(0x123, Payload::new(&[0x34, 0x12]).unwrap());
    wire::airtime(&frame, BitRate::new(33_300).unwrap()).delivery_ns.div_ceil(1000)
}

#[test]
fn a_program_that_reads_candump_reads_its_frames() {
    let emulator = start();
    let mut follower = Follower::start(&emulator, "trace", &["--format", "candump", "--follow"]);
    emulator.poke(&["right:out.w_VALUE=1", "right:out.w_SEND=16#05"]);
    emulator.step(&["10ms"]);
    let line = follower.line();
    assert!(line.ends_with(" open 123#0100"), "{line}");
    drop(emulator);
    follower.end();
}

#[test]
fn its_rules_and_those_of_every_device_are_checked() {
    let emulator = start();
    emulator.breaks(&["owner"]);
    emulator.poke(&["left:out.w_SEND=16#05", "left:in.w_VALUE=7"]);
    emulator.step(&["10ms"]);
    let check = emulator.run("check", &["--format", "csv"]);
    assert_eq!(check.code, Some(1), "{}", check.err);
    let row = |rule: &str| check.out.lines().find(|line| line.contains(rule)).map(str::to_owned);
    let nothing = row("gate-nothing").expect("its own rule");
    assert!(nothing.contains("out.w_VALUE") && nothing.contains("warning"), "{nothing}");
    let owner = row("owner").expect("a rule of every device");
    assert!(owner.contains("in.w_VALUE") && owner.contains("error"), "{owner}");
    assert!(run(&["check", "--rules"]).ok().contains("gate-nothing"));
}

#[test]
fn its_supply_can_be_switched_off() {
    let emulator = start();
    emulator.run("board", &["set", "right:power=off"]).ok();
    emulator.poke(&["left:out.w_VALUE=5", "left:out.w_SEND=16#05"]);
    emulator.step(&["100ms"]);
    assert_eq!(emulator.peek(&["left:out.w_SEND", "right:in.w_VALUE"]), "16#0004 16#0000");
    emulator.run("board", &["set", "right:power=on"]).ok();
    emulator.step(&["100ms"]);
    assert_eq!(
        emulator.peek(&["right:in.w_VALUE"]),
        "16#0005",
        "the frame has waited for a station that hears it"
    );
}

#[test]
fn a_scenario_uses_it_like_any_other_device() {
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/gates.rhai");
    let outcome = run(&["test", scenario]);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
}

#[test]
fn a_device_without_a_demonstration_is_refused() {
    let refused = run(&["demo", "--device", "gate"]);
    let err = refused.fails(2);
    assert!(err.contains("invalid value 'gate' for '--device <DEVICE>'"), "{err}");
    assert!(err.contains("[possible values: omega-drive-line-2, ") && !err.contains(", gate"), "{err}");
}

#[test]
fn it_is_exported() {
    let header = run(&["export", "c", "--device", "gate"]);
    for name in ["GATE_OUT", "w_SEND", "16#05 asks for a frame"] {
        assert!(header.ok().contains(name), "{}", header.out);
    }
    for format in ["python", "csv", "json", "md", "st", "svd", "systemrdl"] {
        let export = run(&["export", format, "--device", "gate"]);
        assert!(export.ok().contains("w_SEND"), "{format}: {}", export.out);
        let has_front = !["st", "svd"].contains(&format);
        assert_eq!(export.out.contains("Counts values"), has_front, "{format}: {}", export.out);
    }
    let front = run(&["export", "st", "--device", "gate", "--block", "front"]);
    assert!(front.fails(2).contains("`front` of gate is in the header page"), "{}", front.err);
}

#[test]
fn a_wrong_plant_is_refused_with_its_line() {
    let refused = |plant: &str| {
        run(&["run", &format!("{}/tests/{plant}", env!("CARGO_MANIFEST_DIR"))]).fails(2).to_owned()
    };
    let rate = refused("wrong-rate.toml");
    assert!(
        rate.contains("line 8") && rate.contains("kbit_s of 'open' is 5; it must be 10 to 1000"),
        "{rate}"
    );
    let medium = refused("wrong-medium.toml");
    let text = "line 4: can1 of PLC 'left' is on bus 'drives' of kind 'cansync'; it needs one of kind 'can'";
    assert!(medium.contains(text), "{medium}");
}
