//! The b maXX PLC on the command line: a module is addressed like a node of an Omega Drive-Line II.

use crate::common::{Emulator, commram, finish, run, unique_name};
use std::path::Path;

/// A plant in which `maxx` has a master with a drive in slot G and a slave at the bus of `top` in slot H.
const PLANT: &str = "\
[[device]]
kind = 'bm4-plc'
name = 'maxx'

[[device.module]]
slot = 'G'
kind = 'can-06'
bus = 'fast'

[[device.module]]
slot = 'H'
kind = 'can-05'
bus = 'upper'
dip = 6
lock_time_us = 20000

[[device]]
kind = 'bm4-plc'
name = 'top'

[[device.module]]
slot = 'M'
kind = 'can-06'
bus = 'upper'

[[bus]]
name = 'fast'
kbit_s = 1000

[[bus.drive]]
name = 'winder'
slave_number = 1
card_function = 0
lock_time_us = 20000

[[bus]]
name = 'upper'
kbit_s = 1000
";

fn plant_file(directory: &Path, text: &str) -> String {
    let path = directory.join("plant.toml");
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn start() -> Emulator {
    let directory = tempfile::tempdir().unwrap();
    Emulator::start(&[&plant_file(directory.path(), PLANT), "--clock", "stepped"])
}

/// Starts one b maXX PLC with a master. Commands may omit the PLC's name.
fn start_alone() -> Emulator {
    let directory = tempfile::tempdir().unwrap();
    let module = "[[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'b'\n";
    let text = format!("[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n{module}[[bus]]\nname = 'b'\n");
    Emulator::start(&[&plant_file(directory.path(), &text), "--clock", "stepped"])
}

/// Brings a module from restart to set-up mode at 1 Mbit/s (manual 5.02066.01a p. 49-51, 126-127), and 16#0043 or
/// 16#0013.
fn set_up(emulator: &Emulator, module: &str, mode: u8, status: &str) {
    let write = |name: &str, value: &str| format!("{module}.{name}={value}");
    let command = |value: &str, status: &str| {
        emulator.poke(&[&write("w_CPU_CONTROL", value)]);
        let condition = format!("{module}.w_OPTION_STATUS=={status}");
        emulator.run("wait", &[&condition, "--within", "10ms"]).ok();
    };
    command("16#0000", "16#0001");
    command("16#0001", "16#0002");
    let mut init: Vec<_> = [
        ("b_AC", "16#FF"),
        ("b_AM", "16#FF"),
        ("b_BT_0", "16#40"),
        ("b_BT_1", "16#34"),
        ("b_OUTPUT_CONTROL", "16#FA"),
        ("b_CLOCK_DIVIDER", "16#07"),
        ("b_TIME_PATTERN", "1"),
    ]
    .map(|(name, value)| write(name, value))
    .to_vec();
    init.push(write("b_MA_SL_MODE", &mode.to_string()));
    if mode == 0 {
        init.extend([write("a_SL_TYP[1]", "1"), write("a_SL_TYP[6]", "1")]);
    }
    emulator.poke(&init.iter().map(String::as_str).collect::<Vec<_>>());
    command("16#0002", "16#0003");
    command("16#0020", status);
}

fn modules(emulator: &Emulator) -> serde_json::Value {
    let outcome = emulator.run("board", &["get", "maxx", "--format", "json"]);
    let rows: serde_json::Value = serde_json::from_str(outcome.ok()).unwrap();
    rows[0]["modules"].clone()
}

#[test]
fn a_board_shows_its_modules_and_their_dip_switches_are_set() {
    let mut emulator = start();
    let off = serde_json::json!({ "H1": "on", "H2": "off" });
    assert_eq!(modules(&emulator)["slotG"], serde_json::json!({ "kind": "can-06", "leds": off }));
    let slave = modules(&emulator)["slotH"].clone();
    let leds = serde_json::json!({ "H1": "on", "H2": "off", "H3": "off", "H4": "off" });
    assert_eq!(slave, serde_json::json!({ "kind": "can-05", "dip": 6, "dip9": true, "leds": leds }));
    let table = emulator.run("board", &["get"]);
    let line = |begin: &str| table.ok().lines().find(|line| line.starts_with(begin)).unwrap_or_default();
    assert_eq!(line("MODULE"), "MODULE      KIND    DIP SWITCHES    LEDS");
    // The output has no values for parts that this device does not have (decision D-366).
    let cells: Vec<_> = line("maxx ").split_whitespace().collect();
    assert_eq!(cells, ["maxx", "-", "-", "-", "on", "-", "-", "none", "none", "1", "-"]);
    assert_eq!(line("maxx:slotG"), "maxx:slotG  can-06                  H1 on, H2 off");
    assert_eq!(line("maxx:slotH"), "maxx:slotH  can-05  dip 6, dip9 on  H1 on, H2 off, H3 off, H4 off");
    emulator.run("board", &["set", "maxx:slotH.dip=7"]).ok();
    assert_eq!(modules(&emulator)["slotH"]["dip"], 7);
    assert_eq!(emulator.peek(&["maxx:slotH.w_SLAVE_NUMBER"]), "16#0006", "not before the next power-on");
    emulator.run("board", &["power-cycle", "maxx"]).ok();
    assert_eq!(emulator.peek(&["maxx:slotH.w_SLAVE_NUMBER"]), "16#0007");
    for (setting, text) in [
        ("maxx:slotG.dip=7", "PLC 'maxx': there is no module with DIP switches in slotG"),
        ("maxx:slotJ.dip=7", "there is no module with DIP switches in slotJ"),
        ("maxx:slotI.dip=7", "the ports are slotG, slotH, slotJ, slotK, slotL, slotM"),
        ("maxx:slotH.dip=32", "dip is a number from 0 to 31"),
        ("maxx:dip=3", "PLC 'maxx' has no 'dip' to be set, it is a b maXX PLC"),
        ("maxx:switch=stop", "PLC 'maxx' has no 'switch' to be set"),
    ] {
        let outcome = emulator.run("board", &["set", setting]);
        assert!(outcome.fails(2).contains(text), "{setting}: {}", outcome.err);
    }
    // `board get` can also read the state of a killed emulator.
    emulator.kill();
    let outcome = emulator.run("board", &["get", "maxx", "--format", "json"]);
    let rows: serde_json::Value = serde_json::from_str(&outcome.out).unwrap();
    assert_eq!(rows[0]["modules"]["slotH"]["dip"], 7);
}

#[test]
fn an_omega_has_no_modules() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("board", &["get", "--format", "json"]);
    let rows: serde_json::Value = serde_json::from_str(outcome.ok()).unwrap();
    assert!(rows[0].get("modules").is_none(), "{rows}");
    assert!(!emulator.run("board", &["get"]).ok().contains("MODULE"));
    let outcome = emulator.run("board", &["set", "node1.dip=3"]);
    assert!(outcome.fails(2).contains("there is no module with DIP switches in node1"), "{}", outcome.err);
}

/// Accepts the names of the plant file and those of the manuals (5.02066.01a p. 43-45, 5.00005.03a p. 130).
#[test]
fn a_register_has_many_names() {
    let emulator = start();
    emulator.poke(&["maxx:slotG.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    for name in [
        "maxx:slotG.w_OPTION_STATUS",
        "maxx:_CANsyncMaster_Ctrl_Slot_G.w_OPTION_STATUS",
        "maxx:_CANsyncMaster_Init_Slot_G.w_OPTION_STATUS",
        "maxx:%MW3.2001794",
    ] {
        assert_eq!(emulator.peek(&[name]), "16#0002", "{name}");
        emulator.run("wait", &[&format!("{name}==2"), "--within", "0us"]).ok();
    }
    // The slot has a module, so the registers that depend on its type are known.
    assert_eq!(emulator.peek(&["maxx:slotG.b_STATREG_RDC1", "maxx:slotH.b_STATREG_RDC1"]), "16#00 16#00");
    let outcome = emulator.run("peek", &["maxx:slotG.b_STATREG_RDC1", "--format", "json"]);
    assert!(outcome.ok().contains("%MB3.2001977"), "{}", outcome.out);
    let outcome = emulator.run("peek", &["maxx:_CANsyncSlave_Ctrl_Slot_G.w_OPTION_STATUS"]);
    let text = "slotG";
    assert!(outcome.fails(2).contains(text) && outcome.err.contains("master"), "{}", outcome.err);
    // The error names the PLC that the user addressed and no other device.
    for (command, name) in [("peek", "maxx:slotI.w_CPU_CONTROL"), ("poke", "maxx:slotI.w_CPU_CONTROL=1")] {
        let outcome = emulator.run(command, &[name]);
        let text = "unknown area `slotI`; the areas are slotG, slotH, slotJ, slotK, slotL, slotM";
        assert!(outcome.fails(2).contains(text), "{}", outcome.err);
    }
    let outcome = emulator.run("peek", &["maxx:slotJ.w_CPU_CONTROL"]);
    assert!(outcome.ok().ends_with("= 16#0000  nothing is plugged in\n"), "{}", outcome.out);
    let alone = start_alone();
    for name in ["slotG.w_OPTION_STATUS", "_CANsyncMaster_Ctrl_Slot_G.w_OPTION_STATUS"] {
        assert_eq!(alone.peek(&[name]), "16#0001", "{name}");
    }
}

#[test]
fn every_command_knows_the_modules() {
    let emulator = start();
    set_up(&emulator, "maxx:slotH", 1, "16#0013");
    set_up(&emulator, "top:slotM", 0, "16#0043");
    set_up(&emulator, "maxx:slotG", 0, "16#0043");
    emulator.run("wait", &["maxx:slotG.a_STAT_SL[1]==3", "--within", "1s"]).ok();
    let at = |text: String| -> f64 { text.trim_end_matches(" s").parse().unwrap() };
    let first = at(emulator.step(&["--to-sync", "maxx:slotG"]));
    emulator.step(&["1us"]);
    let second = at(emulator.step(&["--to-sync", "maxx:slotG"]));
    assert_eq!(((second - first) * 1e6).round(), 1_000.0, "an interval of 1 ms");
    // Without a port, `step` uses the first master of the named PLC. It is in another slot than the first master of the
    // first PLC.
    emulator.step(&["--to-sync", "top:"]);
    // A dump of the module contains each register once.
    let dump = emulator.run("dump", &["maxx:slotG", "--all", "--format", "csv"]);
    let mut names: Vec<_> = dump.ok().lines().skip(1).map(|line| line.split(',').nth(2).unwrap()).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
    assert!(names.contains(&"maxx:slotG.a_STAT_SL[1]") && !names.iter().any(|name| name.contains("_Slot_")));
    let dump = emulator.run("dump", &["maxx:slotH"]);
    assert!(dump.ok().contains("maxx:slotH.w_SLAVE_NUMBER"), "{}", dump.out);
    let empty = emulator.run("dump", &["maxx:slotJ"]);
    assert!(empty.fails(2).contains("nothing is plugged in"), "{}", empty.err);
    // Forcing a register and ending the force.
    emulator.run("force", &["maxx:slotG.b_MAX_SL_NR=5"]).ok();
    assert!(emulator.run("force", &[]).ok().contains("maxx:slotG.b_MAX_SL_NR"));
    emulator.run("unforce", &["maxx:slotG.b_MAX_SL_NR"]).ok();
    let trace = emulator.run("trace", &[]);
    assert!(trace.ok().contains("maxx:slotG"), "{}", trace.out);
    assert!(emulator.run("check", &[]).code == Some(0));
    // Two dumps and the changes between them.
    let directory = tempfile::tempdir().unwrap();
    let before = directory.path().join("before.json");
    std::fs::write(&before, emulator.run("dump", &["maxx:slotG", "--all", "--format", "json"]).ok()).unwrap();
    emulator.poke(&["maxx:slotG.w_CPU_CONTROL=16#0040"]);
    emulator.step(&["1ms"]);
    let diff = emulator.run("diff", &[before.to_str().unwrap()]);
    assert_eq!(diff.code, Some(1));
    let status = diff.out.lines().find(|line| line.starts_with("maxx:slotG.w_OPTION_STATUS "));
    assert!(status.is_some_and(|line| line.contains("16#0043 -> 16#0080")), "{}", diff.out);
}

/// The registers of a slot depend on the module in it.
#[test]
fn the_map_of_an_instance_shows_the_fitted_modules() {
    let emulator = start();
    let map = emulator.run("map", &["maxx:slotG"]);
    assert!(map.ok().contains("slotG.b_STATREG_RDC1") && !map.out.contains("_Slot_G"), "{}", map.out);
    assert!(map.out.contains("CANsync_PLC_MA_BMSTRUCT") && !map.out.contains("CANsync_PLC_SL_BMSTRUCT"));
    let map = emulator.run("map", &["maxx:slotH"]);
    assert!(map.ok().contains("CANsync_PLC_SL_BMSTRUCT") && !map.out.contains("CANsync_PLC_MA_BMSTRUCT"));
    let map = emulator.run("map", &["maxx:"]);
    assert!(map.ok().contains("slotH.w_CPU_CONTROL") && !map.out.contains("slotJ"), "{}", map.out);
    assert!(emulator.run("map", &["maxx:slotJ"]).fails(2).contains("nothing is plugged in"));
    let without = run(&["map", "slotG", "--device", "bm4-plc"]);
    for role in ["As master: CANsync_PLC_MA_BMSTRUCT", "As slave: CANsync_PLC_SL_BMSTRUCT"] {
        assert!(without.ok().contains(role), "{}", without.out);
    }
    assert!(without.out.contains("slot G. CANsync_PLC_INIT_BMSTRUCT"), "{}", without.out);
}

/// Each mistake that a plant file can make with this device is named, and no emulator starts.
#[test]
fn plant_file_errors_name_the_wrong_line() {
    let directory = tempfile::tempdir().unwrap();
    let refused = |text: &str| {
        let path = plant_file(directory.path(), text);
        let outcome = finish(commram().args(["run", &path, "-i", &unique_name()]));
        outcome.fails(2).to_owned()
    };
    let device =
        |name: &str, modules: &str| format!("[[device]]\nkind = 'bm4-plc'\nname = '{name}'\n{modules}");
    let module = |slot: &str, rest: &str| format!("[[device.module]]\nslot = '{slot}'\n{rest}\n");
    let (master, bus) = ("kind = 'can-06'\nbus = 'b'", "[[bus]]\nname = 'b'\n");
    let slave = |dip: u8| format!("kind = 'can-05'\nbus = 'b'\ndip = {dip}");
    for (modules, line, expected) in [
        (module("I", master), 5, "there is no slot 'I'; slots are: G, H, J, K, L, M"),
        (module("G", master) + &module("G", master), 9, "two modules in slot 'G'"),
        (module("G", &slave(32)), 8, "dip of 'maxx:slotG' is 32; it must be 0 to 31"),
        (module("G", "kind = 'can-06'\nsync_in_from = 'H'"), 7, "sync_in_from names slot 'H'"),
        (module("G", "kind = 'can-06'\ndip = 1"), 7, "a BM4-O-CAN-06 has no DIP switches"),
        (format!("sync_source = 'K'\n{}", module("G", master)), 4, "sync_source names slot 'K'"),
    ] {
        let message = refused(&(device("maxx", &modules) + bus));
        assert!(
            message.contains(expected) && message.contains(&format!("line {line}")),
            "{modules}: {message}"
        );
        assert!(message.contains("plant.toml"), "{message}");
    }
    // An error that concerns the whole plant names the device at fault and the line of the later entry.
    let drive = "[[bus.drive]]\nname = 'winder'\nslave_number = 6\n";
    let (g, m) = (module("G", master), module("M", master));
    for (text, line, expected) in [
        (
            device("maxx", &g) + &device("top", &m) + bus,
            14,
            "bus 'b' has two masters, slotG of 'maxx' and slotM of 'top'; a bus of its kind has one",
        ),
        (
            device("maxx", &(g.clone() + &m)) + bus,
            11,
            "bus 'b' has two masters, slotG of 'maxx' and slotM of 'maxx'; a bus of its kind has one",
        ),
        (
            device("maxx", &(module("G", &slave(6)) + &module("H", &slave(6)))) + bus,
            13,
            "slave number 6 is used twice on bus 'b', by 'maxx:slotG' and 'maxx:slotH'",
        ),
        (
            device("maxx", &module("G", &slave(6))) + bus + drive,
            13,
            "slave number 6 is used twice on bus 'b', by 'maxx' and 'winder'",
        ),
        (
            device("maxx", &module("G", &slave(6))) + &device("top", &module("H", &slave(6))) + bus,
            16,
            "slave number 6 is used twice on bus 'b', by 'maxx' and 'top'",
        ),
        (
            device("maxx", &g) + bus + "kbit_s = 800\n",
            10,
            "kbit_s of 'b' is 800; it must be 1000, 500, 250 or 125",
        ),
    ] {
        let message = refused(&text);
        assert!(message.contains(&format!("plant.toml: line {line}: {expected}")), "{text}\n{message}");
    }
}
