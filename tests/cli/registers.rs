//! `peek`, `poke`, `wait`, `step`, `dump` on a running emulator.

use crate::common::{Emulator, run};
use commram::memory::{AttachMode, Image};

/// Enters set-up mode with two values mapped in each direction of drive 1.
fn set_up(emulator: &Emulator) {
    emulator.set_up(&[
        "node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0=16#01",
        "node2._CFG_WRC_WORD.b_CFG_WRC1_WORD1=16#03",
        "node2.a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD0=16#01",
        "node2.a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD1=16#03",
        "node2.b_MAX_SL_NR=3",
        "node2.b_CTRLREG_RD_ORDER_RDC1=16#80",
    ]);
}

/// The manual's start sequence up to the first exchanged process data.
#[test]
fn a_reference_value_comes_back_as_actual_value_of_a_drive() {
    let emulator = Emulator::stepped();
    set_up(&emulator);
    emulator.run("wait", &["node2.a_STAT_SL[1]==3", "--within", "2s"]).ok();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0040"]);
    emulator.run("wait", &["node2.w_OPTION_STATUS==16#0080", "--within", "10ms"]).ok();

    emulator.poke(&["node2.a_WR_VALUE[0]=16#11223344"]);
    for _ in 0..16 {
        emulator.step(&["--to-sync"]);
        emulator.poke(&["node2.b_CTRLREG_WRC1=16#05"]);
    }
    emulator.step(&["--to-sync"]);
    assert_eq!(emulator.peek(&["node2.b_CTRLREG_WRC1"]), "16#04", "the firmware has taken the frame over");
    assert_eq!(emulator.peek(&["node2.a_RD_BMARRAY[1][0]"]), "16#11223344");
}

/// Returns the number of replies that an emulator sends during `action`. Each reply of the channel rings a bell of the
/// header page.
fn replies_during(emulator: &Emulator, plc: &str, action: impl FnOnce()) -> u32 {
    let replies = || {
        let image = Image::attach(&emulator.name, plc, AttachMode::HeaderOnly, None).unwrap();
        image.header_snapshot().channel_reply.rings()
    };
    let before = replies();
    action();
    replies().wrapping_sub(before)
}

/// A client reads the names of a single PLC from the header page, without a request.
#[test]
fn a_command_is_one_exchange_for_any_number_of_registers() {
    let emulator = Emulator::stepped();
    emulator.run("force", &["node2.b_AM=1"]).ok();
    let registers: Vec<_> = (0..9).map(|index| format!("node2.a_WR_VALUE[{index}]")).collect();
    let writes: Vec<_> = registers.iter().map(|register| format!("{register}=7")).collect();
    let texts = |list: &[String]| list.to_vec();
    let words = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
    let commands = [
        ("peek", texts(&registers[..1])),
        ("peek", texts(&registers)),
        ("peek", words(&["node2.*STATUS*", "node2.w_CPU_CONTROL.7"])),
        ("poke", texts(&writes[..1])),
        ("poke", texts(&writes)),
        // The note about the owner needs the status of the structures, which comes with the reply.
        ("poke", words(&["node2.w_OPTION_STATUS=1"])),
        ("force", texts(&writes[..1])),
        ("force", texts(&writes)),
        ("force", vec![]),
        ("unforce", texts(&registers)),
        ("wait", words(&["node2.w_CPU_CONTROL==0", "--within", "1ms"])),
        ("step", words(&["1ms"])),
        ("status", vec![]),
        ("dump", words(&["node2"])),
    ];
    for (command, args) in commands {
        let args: Vec<_> = args.iter().map(String::as_str).collect();
        let exchanges = replies_during(&emulator, "line", || {
            let outcome = emulator.run(command, &args);
            assert_eq!(outcome.code, Some(0), "{command} {args:?}: {}", outcome.err);
        });
        assert_eq!(exchanges, 1, "{command} {args:?}");
    }
    // The names of registers are in the program.
    let found = replies_during(&emulator, "line", || {
        run(&["find", "status", "-i", &emulator.name]).ok();
    });
    assert_eq!(found, 0);
    // The write of a register of the firmware is a finding.
    emulator.run("check", &["--clear"]);
}

#[test]
fn the_same_start_sequence_takes_the_same_emulated_time() {
    let time = || {
        let emulator = Emulator::stepped();
        set_up(&emulator);
        emulator.run("wait", &["node2.a_STAT_SL[3]==3", "--within", "2s"]).ok();
        emulator.step(&["1ms"])
    };
    assert_eq!(time(), time());
}

/// Manual p. 42: the flags have separate addresses, and the plant file sets their number.
#[test]
fn retain_flags_are_read_and_written_by_their_addresses() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    std::fs::write(&plant, "[[plc]]\nname = 'line'\nretain_bytes = 64\n").unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    emulator.poke(&["%MD10000000=16#11223344", "%MW10000006=16#5566", "%MB10000063=7"]);
    assert_eq!(emulator.peek(&["%MB10000001", "%MD10000004", "%MX10000063.2"]), "16#33 16#55660000 1");
    let dump = emulator.run("dump", &["retain"]);
    let lines: Vec<_> =
        dump.ok().lines().skip(1).map(|line| line.split_whitespace().collect::<Vec<_>>()).collect();
    let flags: Vec<_> = lines.iter().map(|line| (line[0], line[2])).collect();
    let wanted =
        [("%MD10000000", "16#11223344"), ("%MD10000004", "16#55660000"), ("%MD10000060", "16#07000000")];
    assert_eq!(flags, wanted, "{}", dump.out);
    let one = emulator.run("dump", &["%MW10000006"]);
    assert!(
        one.ok()
            .lines()
            .nth(1)
            .unwrap()
            .starts_with("%MW10000006  %MW10000006  16#5566  plain RAM of retain"),
        "{}",
        one.out
    );
    let message = "this PLC has fewer retain flags than this BYTE needs; `retain_bytes` in the plant file gives it more";
    for (command, access) in [("peek", "%MB10000064"), ("poke", "%MB10000064=1"), ("force", "%MB10000064=1")]
    {
        let outcome = emulator.run(command, &[access]);
        assert_eq!(outcome.fails(2), format!("commram: %MB10000064: {message}\n"), "{command}");
    }
    assert_eq!(
        emulator.run("dump", &["%MB10000064"]).fails(2),
        "commram: %MB10000064, 1 bytes: no register area covers %MB10000064; read each area for itself\n"
    );
    assert!(emulator.run("peek", &["%MB3.8192"]).fails(2).contains("is not in any area"));
    emulator.run("force", &["%MB10000063=1"]).ok();
    emulator.run("force", &["%MD10000004=5"]).ok();
    emulator.run("board", &["set", "project=boot"]).ok();
    assert_eq!(emulator.peek(&["%MD10000000", "%MD10000004"]), "16#00000000 16#00000005", "cold, but forced");
}

/// Decision D-29: a write of an equal value leaves no trace in the RAM. A write by `poke` goes through the channel, so
/// the emulator knows of it.
#[test]
fn a_restart_written_over_the_value_of_bit_7_restarts() {
    let emulator = Emulator::stepped();
    set_up(&emulator);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0080"]);
    emulator.step(&["2ms"]);
    assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS"]), "16#0000 16#0043");
    emulator.poke(&["node2.w_CPU_CONTROL=0"]);
    emulator.step(&["2ms"]);
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
}

#[test]
fn peek_prints_register_value_and_meaning() {
    let emulator = Emulator::stepped();
    let line = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
    assert_eq!(line.ok(), "node2.w_OPTION_STATUS = 16#0001  start-up\n");
    let lines = emulator.run("peek", &["%MW3.200002", "%MB3.200003", "%MX3.200002.0", "%MD3.1000000"]);
    assert_eq!(
        lines.ok(),
        "node2.w_OPTION_STATUS = 16#0001  start-up\n\
         %MB3.200003 = 16#00  part of node2.w_OPTION_STATUS\n\
         %MX3.200002.0 = 1  bit 0 of node2.w_OPTION_STATUS\n\
         %MD3.1000000 = 16#00000000  no register\n"
    );
    let raw = emulator.run("peek", &["--raw", "node2.w_OPTION_STATUS", "node2.a_RD_BMARRAY[3][0]"]);
    assert_eq!(raw.ok(), "16#0001\n16#00000000\n");
}

#[test]
fn peek_in_the_formats_of_programs() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.a_WR_VALUE[1]=-2"]);
    emulator.step(&["2ms"]);
    let json = emulator.run("peek", &["line:node2.a_WR_VALUE[1]", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(json.ok()).unwrap();
    assert_eq!(
        json,
        serde_json::json!([{
            "time_us": 2000, "plc": "line", "register": "node2.a_WR_VALUE[1]", "address": "%MD3.200056",
            "type": "DINT", "value": -2, "hex": "16#FFFFFFFE",
            "meaning": "-2 (CANsync_MA_CTRL_BMSTRUCT, not live)", "forced": false,
        }])
    );
    let csv = emulator.run("peek", &["node2.w_OPTION_STATUS", "--format", "csv"]);
    assert_eq!(
        csv.ok(),
        "time_us,plc,register,address,type,value,hex,meaning,forced\n\
         2000,line,node2.w_OPTION_STATUS,%MW3.200002,WORD,1,16#0001,start-up,false\n"
    );
    let markdown = emulator.run("peek", &["node2.w_OPTION_STATUS", "--format", "md"]);
    assert_eq!(
        markdown.ok(),
        "| time_us | plc | register | address | type | value | hex | meaning | forced |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n\
         | 2000 | line | node2.w_OPTION_STATUS | %MW3.200002 | WORD | 1 | 16#0001 | start-up | false |\n"
    );
}

#[test]
fn pokes_are_done_in_order() {
    let emulator = Emulator::stepped();
    emulator.poke(&["%MD3.1000000=16#AABBCCDD", "%MB3.1000001=0", "%MW3.1000002=0x1234"]);
    assert_eq!(emulator.peek(&["%MD3.1000000"]), "16#123400DD");
    emulator.poke(&["%MB3.1000000=1", "%MB3.1000000=2", "%MB3.1000000=3"]);
    assert_eq!(emulator.peek(&["%MB3.1000000"]), "16#03");
}

#[test]
fn one_invalid_poke_prevents_all_pokes() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("poke", &["%MB3.1000000=7", "node2.w_CPU_CONTROL=65536"]);
    assert!(outcome.fails(2).contains("node2.w_CPU_CONTROL (%MW3.200000): `65536` is out of range"));
    assert_eq!(emulator.peek(&["%MB3.1000000"]), "16#00");
}

#[test]
fn time_advances_only_on_request() {
    let emulator = Emulator::stepped();
    assert_eq!(emulator.step(&["2ms"]), "0.002000 s");
    assert_eq!(emulator.step(&["500us"]), "0.002500 s");
    assert_eq!(emulator.step(&["1.5s"]), "1.502500 s");
    assert_eq!(emulator.step(&["0s"]), "1.502500 s");
    let outcome = emulator.run("step", &["--to-sync"]);
    assert_eq!(
        outcome.fails(1),
        "commram: PLC 'line': there is no SYNC signal at node2; the master of bus 'drives', line:node2, has not started: \
         w_OPTION_STATUS is 16#0001; initialize it first\n"
    );
}

#[test]
fn stepping_to_sync_meets_each_interval() {
    let emulator = Emulator::stepped();
    set_up(&emulator);
    let micros = |text: String| text.trim_end_matches(" s").replace('.', "").parse::<u64>().unwrap();
    let first = micros(emulator.step(&["--to-sync"]));
    let second = micros(emulator.step(&["--to-sync", "node2"]));
    let third = micros(emulator.step(&["--to-sync", "line:node2"]));
    assert_eq!((second - first, third - second), (2_000, 2_000));
}

#[test]
fn a_plant_without_a_master_has_no_sync_to_step_to() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/mailbox");
    let plant = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
    std::fs::write(plant.path(), format!("[[device]]\nname = 'card'\nkind = '{folder}'\n")).unwrap();
    let emulator = Emulator::start(&[plant.path().to_str().unwrap(), "--clock", "stepped"]);
    let unnamed = emulator.run("step", &["--to-sync"]);
    assert!(unnamed.fails(2).contains("no port that is a master of a bus"), "{}", unnamed.err);
    let named = emulator.run("step", &["--to-sync", "node2"]);
    assert!(named.fails(2).contains("unknown port `node2`; the device has no ports"), "{}", named.err);
}

#[test]
fn a_wait_that_is_not_met_says_what_the_register_held() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("wait", &["node2.w_OPTION_STATUS==16#0002", "--within", "10ms"]);
    assert_eq!(
        outcome.fails(1),
        "commram: node2.w_OPTION_STATUS (%MW3.200002) did not become 16#0002 within 10 ms; \
         at 0.010000 s it holds 16#0001, start-up\n"
    );
    let outcome = emulator.run("wait", &["node2.w_OPTION_STATUS&16#0080==16#0080", "--within", "1ms"]);
    assert!(
        outcome.fails(1).contains("did not become 16#0080 under mask 16#0080 within 1 ms; at 0.011000 s")
    );
}

#[test]
fn a_wait_that_is_met_stops_the_time_at_the_match() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    let outcome = emulator.run("wait", &["node2.w_OPTION_STATUS&3==2", "--within", "1h"]);
    let expected =
        "node2.w_OPTION_STATUS = 16#0002  waiting for \"take over initialization data\"  at 0.000500 s\n";
    assert_eq!(outcome.ok(), expected);
    assert_eq!(emulator.step(&["0us"]), "0.000500 s");
}

#[test]
fn a_dump_shows_changed_registers_of_the_live_structure() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    emulator.poke(&["node2.b_BT_1=16#1C", "node2.a_SL_TYP[3]=1"]);
    let name = &emulator.name;
    assert_eq!(
        emulator.run("dump", &["node2"]).ok(),
        format!(
            "instance '{name}' at 0.001000 s\n\
             node2.w_CPU_CONTROL    %MW3.200000  16#0001  handshake\n\
             node2.w_OPTION_STATUS  %MW3.200002  16#0002  waiting for \"take over initialization data\"\n\
             node2.b_BT_1           %MB3.200016  16#1C    as required for every baud rate\n\
             node2.a_SL_TYP[3]      %MB3.200023  16#01    expected\n"
        )
    );
    set_up(&emulator);
    let dump = emulator.run("dump", &["node2"]);
    assert!(dump.ok().contains("node2.a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD1"), "{}", dump.out);
    assert!(!dump.out.contains("b_BT_1") && !dump.out.contains("a_SL_TYP"), "{}", dump.out);
}

#[test]
fn a_dump_changes_nothing() {
    let emulator = Emulator::stepped();
    set_up(&emulator);
    let first = emulator.run("dump", &["--all", "--format", "csv"]);
    let second = emulator.run("dump", &["--all", "--format", "csv"]);
    assert_eq!(first.ok(), second.ok());
}

#[test]
fn a_dump_without_changed_registers_prints_a_note() {
    let emulator = Emulator::stepped();
    let name = &emulator.name;
    let empty = format!("instance '{name}' at 0.000000 s\nall registers have their reset values\n");
    assert_eq!(emulator.run("dump", &["node2.a_SL_TYP"]).ok(), empty);
    assert_eq!(emulator.run("dump", &["option1"]).ok(), empty);
    assert_eq!(emulator.run("dump", &["node2.a_SL_TYP", "--format", "json"]).ok(), "[]\n");
}

#[test]
fn a_dump_of_plain_ram_shows_nonzero_registers() {
    let emulator = Emulator::stepped();
    emulator.poke(&["%MD3.1262140=16#DEADBEEF"]);
    let dump = emulator.run("dump", &["option1", "--format", "csv"]);
    let line = "0,line,%MD3.1262140,%MD3.1262140,DWORD,3735928559,16#DEADBEEF,plain RAM of option1,false\n";
    assert!(dump.ok().ends_with(line), "{}", dump.out);
    assert_eq!(dump.out.lines().count(), 2);
}

#[test]
fn a_dump_with_all_registers_has_the_reserved_ones_too() {
    let emulator = Emulator::stepped();
    set_up(&emulator);
    let lines = |args: &[&str]| emulator.run("dump", args).ok().lines().count() - 1;
    assert_eq!(lines(&["node2.a_RD_BMARRAY[3]", "--all"]), 16);
    assert_eq!(lines(&["node2.a_RD_BMARRAY[3][15]", "--all"]), 1);
    assert_eq!(lines(&["%MW3.200002"]), 1);
}

/// Where a structure is not live, its RAM contains the registers of another structure. So the registers of the first
/// one are shown only if none of the named registers is live, and have a mark.
#[test]
fn a_dump_marks_registers_that_are_not_live() {
    let emulator = Emulator::stepped();
    let dump = emulator.run("dump", &["node2.a_STAT_SL"]);
    assert!(dump.ok().ends_with("these registers are not live, see w_OPTION_STATUS\n"), "{}", dump.out);
    let marks = |args: &[&str]| {
        let dump = emulator.run("dump", args);
        (dump.ok().matches("(CANsync_MA_CTRL_BMSTRUCT, not live)").count(), dump.out)
    };
    assert_eq!(marks(&["node2.a_STAT_SL", "--full"]).0, 32);
    emulator.poke(&["node2.a_RD_BMARRAY[0][1]=5"]);
    let (count, out) = marks(&["node2.a_RD_BMARRAY[0][*]"]);
    assert!(count == 1 && out.contains("node2.a_RD_BMARRAY[0][1]"), "{out}");
    assert_eq!(marks(&["node2.a_RD_BMARRAY[0][*]", "--full", "--format", "json"]).0, 16);
    assert_eq!(marks(&["node2.*", "--full"]).0, 0);
}

#[test]
fn a_real_time_clock_is_not_stepped() {
    let emulator = Emulator::start(&[]);
    assert_eq!(
        emulator.run("step", &["1ms"]).fails(1),
        "commram: the clock runs in real time; time can be advanced in stepped mode only \
         (use a wait, or start the instance stepped)\n"
    );
}

#[test]
fn a_wait_in_real_time_is_met_by_the_running_clock() {
    let emulator = Emulator::start(&["--speed", "100"]);
    set_up(&emulator);
    emulator.run("wait", &["node2.a_STAT_SL[2]==3", "--within", "10s"]).ok();
}

#[test]
fn an_unknown_register_is_refused_without_an_emulator() {
    let fails = |args: &[&str]| run(args).fails(2).to_owned();
    assert!(fails(&["peek", "node2.w_CPU_CONTRL"]).contains("did you mean w_CPU_CONTROL?"));
    assert!(fails(&["peek", "node2.w_cpu_control"]).contains("is spelled `w_CPU_CONTROL`"));
    assert_eq!(fails(&["peek", "%MW3.200001"]), "commram: %MW3.200001: a WORD needs an even address\n");
    assert!(fails(&["peek", "%MB3.79999"]).contains("is not in any area"));
    assert!(fails(&["peek", "node2.a_RD_BMARRAY[32][0]"]).contains("index 32 is out of range"));
    assert!(fails(&["dump", "node2.w_CPU_CONTRL"]).contains("did you mean w_CPU_CONTROL?"));
    assert!(fails(&["dump", "%MB3.79999"]).contains("is not in any area"));
    assert!(fails(&["wait", "node2.w_CPU_CONTROL=1"]).contains("write REG==VALUE"));
    assert!(fails(&["wait", "node2.w_CPU_CONTROL==1", "--within", "5"]).contains("5us, 5ms or 5s"));
    assert!(fails(&["poke", "node2.w_CPU_CONTROL"]).contains("write REG=VALUE"));
    assert!(fails(&["step", "2 parsecs"]).contains("for example 250us, 2ms or 1.5s"));
    assert!(fails(&["step"]).contains("<TIME>"));
    assert!(fails(&["peek"]).contains("<REG>"));
}

#[test]
fn a_step_beyond_a_day_is_refused() {
    let emulator = Emulator::stepped();
    assert!(emulator.run("step", &["25h"]).fails(2).contains("24 h"));
}

/// A command that names more registers than a request can carry reads them in several requests. While the clock stands
/// still, all values are from the same moment.
#[test]
fn any_number_of_registers_is_read() {
    let emulator = Emulator::stepped();
    emulator.poke(&["%MB3.1000299=16#2A"]);
    let registers: Vec<_> = (0..600).map(|byte| format!("%MB3.{}", 1_000_000 + byte)).collect();
    let mut peeked = vec!["--raw"];
    peeked.extend(registers.iter().map(String::as_str));
    let outcome = emulator.run("peek", &peeked);
    let values: Vec<_> = outcome.ok().lines().collect();
    assert_eq!((values.len(), values[299], values[599]), (600, "16#2A", "16#00"));
}

/// Bits are named by their names and by the addresses of the manual. The test writes several bits of one register, and
/// a bit of a register that only the firmware writes.
#[test]
fn single_bits_are_written_and_forced() {
    let emulator = Emulator::stepped();
    emulator.poke(&[
        "node2.a_WR_VALUE[0]=16#0100",
        "%MX3.200052.1=1",
        "node2.a_WR_VALUE[0].9=TRUE",
        "%MX3.200053.0=0",
    ]);
    assert_eq!(emulator.peek(&["node2.a_WR_VALUE[0]"]), "16#00000202");
    let forced = emulator.run("force", &["node2.b_BT_0.3=1"]);
    assert_eq!(forced.code, Some(0));
    assert!(forced.err.contains("node2.b_BT_0 is forced as a whole"), "{}", forced.err);
    assert_eq!(emulator.peek(&["node2.b_BT_0"]), "16#08");
    emulator.run("unforce", &["node2.b_BT_0.3"]).ok();
    assert_eq!(emulator.run("force", &[]).ok(), "no register is forced\n");
    assert!(emulator.run("poke", &["node2.b_BT_0.3=2"]).fails(2).contains("is no value of a single bit"));
}

#[test]
fn a_poke_of_a_forced_register_says_that_it_keeps_its_value() {
    let emulator = Emulator::stepped();
    emulator.run("force", &["node2.w_CPU_CONTROL=0"]).ok();
    for write in ["node2.w_CPU_CONTROL=1", "node2.w_CPU_CONTROL.3=1", "%MB3.200001=1"] {
        let poked = emulator.run("poke", &[write, "node2.b_BT_0=1"]);
        assert_eq!(poked.code, Some(0), "{}", poked.err);
        let notes: Vec<_> = poked.err.lines().filter(|line| line.contains("is forced and keeps")).collect();
        assert_eq!(notes.len(), 1, "{write}: {}", poked.err);
        assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0000");
    }
}

#[test]
fn pokes_beyond_the_message_size_are_refused() {
    let emulator = Emulator::stepped();
    emulator.run("poke", &["node2.a_WR_VALUE[0]=1"; 256]).ok();
    let writes = ["%MB3.1000000=1"; 257];
    assert!(emulator.run("poke", &writes).fails(2).contains("at most 256"));
    assert_eq!(emulator.peek(&["%MB3.1000000"]), "16#00");
}
