//! `commram fault` on a running emulator in stepped mode: add, see it in the registers, list, clear.

use crate::common::Emulator;

/// Brings the master of the built-in plant into set-up mode; its drives 1 to 3 respond.
fn set_up(emulator: &Emulator) {
    emulator.set_up(&[]);
    emulator.run("wait", &["node2.a_STAT_SL[3]==1", "--within", "100ms"]).ok();
}

/// Brings the master into set-up mode and then into active operation.
fn activate(emulator: &Emulator) {
    set_up(emulator);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0040"]);
    emulator.step(&["4ms"]);
    emulator.step(&["--to-sync"]);
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0080");
}

#[track_caller]
fn add(emulator: &Emulator, args: &[&str]) -> String {
    emulator.run("fault", &[&["add"], args].concat()).ok().trim_end().to_owned()
}

fn list(emulator: &Emulator) -> String {
    emulator.run("fault", &["list"]).ok().to_owned()
}

#[test]
fn a_slave_is_switched_off_and_on_again() {
    let emulator = Emulator::stepped();
    set_up(&emulator);
    assert_eq!(list(&emulator), "no faults\n");
    assert_eq!(add(&emulator, &["slave_off", "slave=2"]), "1");
    emulator.step(&["10ms"]);
    assert_eq!(emulator.peek(&["node2.a_STAT_SL[1]", "node2.a_STAT_SL[2]"]), "16#01 16#00");
    assert_eq!(
        list(&emulator),
        "NUMBER  STATE   HITS  FAULT\n1       acting  0     slave_off bus=drives slave=2\n"
    );
    assert_eq!(emulator.run("fault", &["clear", "1"]).ok(), "");
    emulator.step(&["10ms"]);
    assert_eq!(emulator.peek(&["node2.a_STAT_SL[2]"]), "16#01");
    assert_eq!(list(&emulator), "no faults\n");
}

#[test]
fn bus_off_shows_in_the_status_and_is_reset_by_bit_7() {
    let emulator = Emulator::stepped();
    activate(&emulator);
    add(&emulator, &["bus_off", "node=2"]);
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["node2.w_CANsync_STATUS"]), "16#00C0");
    assert_eq!(list(&emulator), "no faults\n", "it happens once");
    emulator.poke(&["node2.w_CPU_CONTROL=16#00C0"]);
    emulator.step(&["4ms"]);
    assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0040");
    emulator.run("wait", &["node2.w_CANsync_STATUS & 16#00C0 == 0", "--within", "1ms"]).ok();
}

#[test]
fn every_kind_of_fault_is_accepted_and_recorded_in_the_journal() {
    let emulator = Emulator::stepped();
    activate(&emulator);
    let kinds: [&[&str]; 16] = [
        &["lose_frame", "slot=WRC1", "count=1"],
        &["delay_frame", "id=16#101", "delay=300us", "count=1"],
        &["duplicate_frame", "slot=WRC2", "delay=50us"],
        &["lose_sync", "bus=drives", "at=1h"],
        &["jitter_sync", "amplitude=20us", "at=1h", "duration=1s"],
        &["slave_off", "slave=3", "at=1h"],
        &["slave_late", "slave=2", "delay=700us"],
        &["slave_busy", "slave=1", "count=2"],
        &["slave_error", "slave=1", "error=16#FFFB", "count=1"],
        &["wrong_offset", "slave=1", "slot=CC", "offset=12"],
        &["bus_off", "plc=line", "node=2", "at=1h"],
        &["overrun", "node=2", "count=2"],
        &["drive_fault", "slave=2", "error=17"],
        &["baps_drive_fault", "error=16#12"],
        &["baps_silent", "plc=line", "count=1"],
        &["baps_slow", "delay=3.5s"],
    ];
    for (index, fault) in kinds.iter().enumerate() {
        assert_eq!(add(&emulator, fault), (index + 1).to_string());
    }
    emulator.poke(&[
        "node2.a_DATA_PARAMETER[1].w_PAR_NR=121",
        "node2.b_SL_NR_PARAMETER=1",
        "node2.a_CTRLREG_PAR_CMD_SL[1].b_STATREG_PAR_CMD=16#03",
        "node2.a_CTRLREG_PAR_CMD_SL[1].b_STEUREG_PAR_CMD=16#03",
        "node2.b_CTRLREG_WRC1=16#05",
        "baps.b_COMMAND=16#01",
    ]);
    emulator.step(&["5ms"]);
    let job = ["node2.a_CTRLREG_PAR_CMD_SL[1].b_STEUREG_PAR_CMD", "node2.a_DATA_PARAMETER[1].d_PAR_VALUE"];
    assert_eq!(emulator.peek(&job), "16#0B 16#00000000", "the overruns lose both BUSY answers");
    emulator.step(&["4ms"]);
    assert_eq!(emulator.peek(&job), "16#22 16#0000FFFB", "then the slave refuses");
    let journal = emulator.run("trace", &["--kind", "fault"]).ok().to_owned();
    for expected in [
        "fault 1, lose_frame: added",
        "fault 1, lose_frame: hits frame 16#100",
        "fault 1, lose_frame: over",
        "fault 8, slave_busy of slave 1: hits frame 16#581",
        "fault 9, slave_error of slave 1: over",
        "fault 12, overrun: hits frame 16#581",
        "fault 13, drive_fault of slave 2: hits",
        "fault 14, baps_drive_fault: hits",
        "fault 15, baps_silent: over",
        "fault 16, baps_slow: hits",
    ] {
        assert!(journal.contains(expected), "{expected}\n{journal}");
    }
    let count = emulator.run("fault", &["list", "--format", "csv"]).ok().lines().count() - 1;
    emulator.run("fault", &["clear", "--all"]).ok();
    assert_eq!(list(&emulator), "no faults\n");
    let journal = emulator.run("trace", &["--kind", "fault", "--format", "jsonl"]).ok().to_owned();
    assert_eq!(journal.matches("\"news\":\"cleared\"").count(), count);
}

/// Faults that both kinds of buses share accept different conditions on each.
#[test]
fn a_bus_refuses_conditions_that_its_frames_do_not_have() {
    let plant = "[[plc]]\nname = 'line'\n[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n[[bus]]\nname = 'drives'\n";
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), plant).unwrap();
    let emulator = Emulator::start(&[file.path().to_str().unwrap(), "--clock", "stepped"]);
    for (fault, why) in [
        (&["lose_frame", "bus=open", "slot=CC"][..], "slot is CC; a CAN bus has no slots"),
        (
            &["lose_frame", "bus=drives", "id=16#800"],
            "id is 16#800; on a CANsync bus it must be 16#000 to 16#7FF",
        ),
        (&["lose_frame", "bus=drives", "format=extended"], "a CANsync bus knows standard frames only"),
        (&["error_frame", "bus=drives"], "cannot have it; its faults are: lose_frame"),
        (&["lose_sync", "bus=open"], "cannot have it; its faults are: lose_frame"),
    ] {
        let refused = emulator.run("fault", &[&["add"], fault].concat());
        assert!(refused.err.contains(why), "{fault:?}: {}", refused.err);
    }
    let added: [&[&str]; 3] = [
        &["lose_frame", "bus=open", "id=16#1FFFFFFF", "mask=16#1FFFFFFF", "format=extended", "at=365000ms"],
        &["duplicate_frame", "bus=open", "id=16#101", "format=extended", "delay=1s", "count=3"],
        &["lost_arbitration", "bus=open", "duration=1h"],
    ];
    added.iter().for_each(|fault| drop(add(&emulator, fault)));
    assert!(
        list(&emulator)
            .contains("duplicate_frame bus=open id=16#101 format=extended delay_us=1000000 count=3")
    );
}

#[test]
fn the_list_is_json_with_the_fields_of_the_plant_file() {
    let emulator = Emulator::stepped();
    add(&emulator, &["lose_frame", "slot=rc", "id=16#580", "mask=16#780", "at=1s", "count=3"]);
    let json = emulator.run("fault", &["list", "--format", "json"]).ok().to_owned();
    let entries: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        entries,
        serde_json::json!([{
            "number": 1, "state": "waiting", "hits": 0,
            "kind": "lose_frame", "bus": "drives", "slot": "RC", "id": 0x580, "mask": 0x780,
            "at_us": 1_000_000, "count": 3
        }])
    );
    emulator.step(&["1s"]);
    assert!(list(&emulator).contains("1       acting  0     lose_frame bus=drives slot=RC"));
}

#[test]
fn mistakes_are_named_and_change_nothing() {
    let emulator = Emulator::stepped();
    for (args, expected) in [
        (&["add", "explode"][..], "there is no such fault; the kinds are: lose_frame, delay_frame"),
        (&["add", "lose_frame", "slot=WRC9"], "slot = \"WRC9\"; it must be WRC1, RDC1, WRC2, RDC2, CC, RC"),
        (&["add", "lose_frame", "bus=upper"], "bus \"upper\" does not exist; buses are: drives"),
        (&["add", "bus_off", "plc=saw", "node=2"], "PLC \"saw\" does not exist; PLCs are: line"),
        (&["add", "bus_off", "node=1"], "bus_off: node1 of PLC \"line\" is not on a bus"),
        (&["add", "slave_busy", "slave=7"], "bus \"drives\" has no slave 7; its slaves are: 1, 2, 3"),
        (&["add", "slave_busy"], "slave is missing; give the slave number, 0 to 31"),
        (&["add", "slave_busy", "slave=1", "colour=2"], "there is no field `colour`; the fields are: bus,"),
        (
            &["add", "slave_busy", "slave=1", "delay=5us"],
            "delay_us has no meaning; its fields are: bus, slave",
        ),
        (&["add", "slave_late", "slave=1", "delay=5"], "a time needs a unit: 5us, 5ms or 5s"),
        (
            &["add", "slave_late", "slave=1", "delay=5s"],
            "delay_us is 5000000 (5 s); it must be 1 to 1000000 (1 s)",
        ),
        (&["clear", "3"], "there is no fault 3; it may have ended"),
        (&["clear"], "NUMBER"),
        (&["clear", "0"], "invalid value '0'"),
        (&["clear", "--all", "3"], "cannot be used with"),
    ] {
        let outcome = emulator.run("fault", args);
        let message = outcome.fails(2);
        assert!(message.contains(expected), "{message}\n{expected}");
    }
    assert_eq!(list(&emulator), "no faults\n");
}

#[test]
fn faults_of_the_plant_file_are_there_from_the_start() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("plant.toml");
    let plant = "[[plc]]\nname = 'p'\nnode2 = 'b'\n[[bus]]\nname = 'b'\n[[bus.drive]]\nname = 'd'\nslave_number = 3\n\
                 [[fault]]\nkind = 'slave_off'\nslave = 3\nat_us = 2000\nduration_us = 1000\n";
    std::fs::write(&path, plant).unwrap();
    let emulator = Emulator::start(&[path.to_str().unwrap(), "--clock", "stepped"]);
    assert!(list(&emulator).ends_with("slave_off bus=b slave=3 at_us=2000 duration_us=1000\n"));
    emulator.step(&["3ms"]);
    assert_eq!(list(&emulator), "no faults\n");

    std::fs::write(&path, plant.replace("slave = 3", "slave = 4")).unwrap();
    let outcome = crate::common::run(&["run", path.to_str().unwrap()]);
    let expected = "[[fault]] 1: slave_off: bus \"b\" has no slave 4; its slaves are: 3";
    assert!(outcome.fails(2).contains(expected), "{}", outcome.err);
}

#[test]
fn faults_of_another_device_are_refused_with_a_list_of_valid_ones() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("plant.toml");
    let plant = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n\
                 [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'b'\n[[bus]]\nname = 'b'\n";
    std::fs::write(&path, plant).unwrap();
    let emulator = Emulator::start(&[path.to_str().unwrap(), "--clock", "stepped"]);
    for (args, expected) in [
        (&["baps_silent"][..], "baps_silent: PLC \"maxx\" cannot have it; its faults are: none"),
        (&["bus_off", "node=slotH"], "slotH of PLC \"maxx\" is not on a bus; ports on a bus: slotG"),
        (&["bus_off", "node=node1"], "its ports are: slotG, slotH, slotJ, slotK, slotL, slotM"),
        (&["overrun"], "node is missing; give slotG, slotH, slotJ, slotK, slotL or slotM"),
    ] {
        let outcome = emulator.run("fault", &[&["add"], args].concat());
        let message = outcome.fails(2);
        assert!(message.contains(expected), "{message}\n{expected}");
    }
    assert_eq!(add(&emulator, &["bus_off", "plc=maxx", "node=slotG", "at=1s"]), "1");
    assert!(list(&emulator).ends_with("bus_off plc=maxx node=slotG at_us=1000000 count=1\n"));

    std::fs::write(&path, format!("{plant}[[fault]]\nkind = 'baps_silent'\n")).unwrap();
    let outcome = crate::common::run(&["run", path.to_str().unwrap()]);
    let expected = "plant.toml: line 10: [[fault]] 1: baps_silent: PLC \"maxx\" cannot have it";
    assert!(outcome.fails(2).contains(expected), "{}", outcome.err);
}

#[test]
fn help_describes_every_kind_of_fault() {
    let help = crate::common::run(&["fault", "add", "--help"]);
    for kind in commram::devices::fault_kinds() {
        let command = format!("\n  commram fault add {} {}", kind.name(), kind.example());
        assert!(help.ok().contains(&command), "{command}\n{}", help.out);
    }
}
