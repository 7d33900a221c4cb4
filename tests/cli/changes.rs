//! `watch` and `diff` on a running emulator.

use crate::common::{Emulator, Follower, run};
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Saves a dump and returns its path.
fn save(emulator: &Emulator, directory: &TempDir, name: &str, args: &[&str]) -> PathBuf {
    let path = directory.path().join(name);
    let dump = emulator.run("dump", &[args, &["--format", "json"]].concat());
    fs::write(&path, dump.ok()).unwrap();
    path
}

/// Runs `diff` on the instance of the emulator, checks the exit code `code` and returns the output.
#[track_caller]
fn diff(emulator: &Emulator, args: &[&str], code: i32) -> String {
    let outcome = emulator.run("diff", args);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(code), ""));
    outcome.out
}

/// Restarts the slave up to "waiting for initialization data": two registers change.
fn handshake(emulator: &Emulator) {
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
}

#[test]
fn diff_compares_two_dumps_or_a_dump_with_the_instance() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let before = save(&emulator, &directory, "before.json", &["--all"]);
    let before = before.to_str().unwrap();
    assert_eq!(diff(&emulator, &[before], 0), "no differences\n");
    handshake(&emulator);
    let expected = "\
node2.w_CPU_CONTROL    %MW3.200000  16#0000 -> 16#0001  handshake
node2.w_OPTION_STATUS  %MW3.200002  16#0001 -> 16#0002  waiting for \"take over initialization data\"
";
    assert_eq!(diff(&emulator, &[before], 1), expected);
    let after = save(&emulator, &directory, "after.json", &["--all"]);
    let after = after.to_str().unwrap();
    assert_eq!(diff(&emulator, &[before, after], 1), expected);
    assert_eq!(diff(&emulator, &[after, after], 0), "no differences\n");

    let json: Value = serde_json::from_str(&diff(&emulator, &[before, "--format", "json"], 1)).unwrap();
    assert_eq!((&json[1]["before"], &json[1]["after"]), (&"16#0001".into(), &"16#0002".into()));
    let csv = diff(&emulator, &[before, after, "--format", "csv"], 1);
    assert!(csv.starts_with("plc,register,address,before,after,meaning\n"), "{csv}");
}

/// A file that lacks a register has no old value for it.
#[test]
fn diff_invents_no_old_value_for_a_missing_register() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    handshake(&emulator);
    let before = save(&emulator, &directory, "before.json", &["node2"]);
    emulator.poke(&["node2.b_AC=16#FF", "node1.b_AC=16#FF"]);
    let printed = diff(&emulator, &[before.to_str().unwrap()], 1);
    assert!(printed.starts_with("node2.b_AC  %MB3.200013  - -> 16#FF"), "{printed}");
    assert_eq!(printed.lines().count(), 1, "the file has only registers of node2: {printed}");
    let after = save(&emulator, &directory, "after.json", &["node1"]);
    let printed = diff(&emulator, &[before.to_str().unwrap(), after.to_str().unwrap()], 1);
    assert!(printed.contains("node2.w_OPTION_STATUS  %MW3.200002  16#0002 -> -\n"), "{printed}");
}

/// The cyclic structure replaces the structure of the initialization data; the file does not contain its registers.
#[test]
fn diff_prints_only_the_count_of_registers_that_are_no_longer_live() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let before = save(&emulator, &directory, "before.json", &["node2", "--all"]);
    emulator.set_up(&["node2.b_MAX_SL_NR=3"]);
    let outcome = emulator.run("diff", &[before.to_str().unwrap()]);
    assert_eq!(outcome.code, Some(1));
    assert!(
        outcome.out.contains("node2.b_MAX_SL_NR  ") && !outcome.out.contains("a_SL_TYP"),
        "{}",
        outcome.out
    );
    let note = outcome.err.strip_prefix("commram: note: ").unwrap();
    assert!(
        note.contains(" registers of ")
            && note.ends_with(
                " not compared: another structure is valid at their addresses now, see w_OPTION_STATUS\n"
            ),
        "{note}"
    );
}

#[test]
fn diff_names_a_plc_that_the_instance_does_not_have() {
    let directory = TempDir::new().unwrap();
    let of = |names: [&str; 2]| {
        let plant = directory.path().join(format!("{}.toml", names[1]));
        fs::write(&plant, names.map(|name| format!("[[plc]]\nname = '{name}'\n")).concat()).unwrap();
        Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"])
    };
    let [earlier, later] = [["line", "winder"], ["line", "press"]].map(of);
    earlier.poke(&["winder:node2.b_AC=16#FF", "winder:node2.b_AM=16#FF"]);
    let dump = earlier.run("dump", &["winder:node2", "--format", "json"]);
    let path = directory.path().join("before.json");
    fs::write(&path, dump.ok()).unwrap();
    let outcome = later.run("diff", &[path.to_str().unwrap()]);
    let expected = format!("instance '{}' has no PLC 'winder'; its PLCs are: line, press", later.name);
    assert!(outcome.err.contains(" registers of ") && outcome.err.contains(&expected), "{}", outcome.err);
    assert!(!outcome.err.contains("another structure"), "{}", outcome.err);
}

/// A PLC may have fewer retain flags than the PLC of the dump.
#[test]
fn diff_names_retain_flags_that_the_plc_does_not_have() {
    let directory = TempDir::new().unwrap();
    let of = |bytes: u32| {
        let plant = directory.path().join(format!("{bytes}.toml"));
        fs::write(&plant, format!("[[plc]]\nname = 'line'\nretain_bytes = {bytes}\n")).unwrap();
        Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"])
    };
    let (earlier, later) = (of(64), of(32));
    earlier.poke(&["%MD10000000=3", "%MD10000040=5", "%MW10000050=7"]);
    for dumped in [&["retain"][..], &["%MD10000000", "%MD10000040", "%MW10000050"]] {
        let path = save(&earlier, &directory, "before.json", dumped);
        let outcome = later.run("diff", &[path.to_str().unwrap()]);
        assert!(
            outcome.out.starts_with("%MD10000000  ") && outcome.out.lines().count() == 1,
            "{}",
            outcome.out
        );
        let note = format!(
            "commram: note: 2 registers of {} not compared: PLC 'line' has fewer retain flags; `retain_bytes` in the plant \
             file gives it more\n",
            path.display()
        );
        assert_eq!((outcome.code, outcome.err), (Some(1), note));
    }
}

/// Areas of several PLCs have the same names.
#[test]
fn diff_compares_only_the_plcs_of_a_dump() {
    let directory = TempDir::new().unwrap();
    let plant = directory.path().join("plant.toml");
    fs::write(&plant, "[[plc]]\nname = 'one'\n[[plc]]\nname = 'two'\n").unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    emulator.poke(&["one:node2.b_AC=16#FF", "two:node2.b_AC=16#FF"]);
    let path = save(&emulator, &directory, "one.json", &["one:node2", "--full"]);
    assert_eq!(diff(&emulator, &[path.to_str().unwrap()], 0), "no differences\n");
    emulator.poke(&["one:node2.b_AC=16#FE", "two:node2.b_AC=16#FE"]);
    let printed = diff(&emulator, &[path.to_str().unwrap()], 1);
    assert!(printed.starts_with("one:node2.b_AC") && printed.lines().count() == 1, "{printed}");
}

/// Plain RAM has no registers: retain flags, flags and the memory of option cards.
#[test]
fn diff_compares_plain_ram() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let whole = save(&emulator, &directory, "whole.json", &["retain", "--full"]);
    let one = save(&emulator, &directory, "one.json", &["%MW10000002"]);
    let [whole, one] = [&whole, &one].map(|path| path.to_str().unwrap());
    assert_eq!(diff(&emulator, &[whole], 0), "no differences\n");
    assert_eq!(diff(&emulator, &[one], 0), "no differences\n");
    emulator.poke(&["%MD10000000=5"]);
    let printed = diff(&emulator, &[whole], 1);
    assert!(printed.starts_with("%MD10000000  %MD10000000  16#00000000 -> 16#00000005"), "{printed}");
    assert_eq!(printed.lines().count(), 1, "{printed}");
    assert_eq!(diff(&emulator, &[one], 0), "no differences\n", "another word");
    emulator.poke(&["%MW10000002=7"]);
    let printed = diff(&emulator, &[one], 1);
    assert!(printed.starts_with("%MW10000002  %MW10000002  16#0000 -> 16#0007"), "{printed}");
}

#[test]
fn diff_refuses_a_file_that_is_no_dump() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("x.json");
    let path = path.to_str().unwrap();
    assert!(run(&["diff", path]).fails(2).contains("No such file"));
    fs::write(path, "{}").unwrap();
    assert!(run(&["diff", path]).fails(2).contains("`commram dump --format json` writes one"));
    fs::write(path, "[]").unwrap();
    assert!(run(&["diff", path, "-i", "no-such-instance"]).fails(3).contains("no-such-instance"));
}

#[test]
fn watching_shows_changes_with_their_time_and_ends_with_the_emulator() {
    let emulator = Emulator::stepped();
    let mut watcher = Follower::start(&emulator, "watch", &["node2.w_OPTION_STATUS", "node1"]);
    assert!(watcher.note().starts_with("commram: note: "), "it has looked for the first time");
    handshake(&emulator);
    assert_eq!(
        watcher.line(),
        "0.000500 s  node2.w_OPTION_STATUS  %MW3.200002  16#0001 -> 16#0002  firmware  waiting for \"take over initialization data\""
    );
    emulator.poke(&["node1.b_AC=16#FF"]);
    assert!(watcher.line().contains("node1.b_AC"));
    emulator.run("stop", &[]);
    let (code, rest, err) = watcher.end();
    // The client may have a request in progress when the emulator ends, and then gets the reason. Otherwise its next
    // request finds no emulator.
    let ended = format!("commram: note: instance '{}' ", emulator.name);
    assert_eq!((code, rest.as_slice()), (Some(0), &[][..]));
    assert!(err.starts_with(&ended) && err.lines().count() == 1, "{err}");
}

#[test]
fn watching_ends_after_the_requested_number_of_changes() {
    let emulator = Emulator::stepped();
    let mut watcher = Follower::start(&emulator, "watch", &["--count", "1", "--format", "jsonl"]);
    watcher.note();
    handshake(&emulator);
    let (code, lines, _) = watcher.end();
    assert_eq!((code, lines.len()), (Some(0), 1));
    let line: Value = serde_json::from_str(&lines[0]).unwrap();
    assert_eq!(line["register"], "node2.w_CPU_CONTROL");
    assert_eq!((&line["before"], &line["after"]), (&"16#0000".into(), &"16#0001".into()));
    assert!(line["time_us"].is_u64());
    assert!(run(&["watch", "node2.no_such_register"]).fails(2).contains("no_such_register"));
}

/// A request and its answer occur within one request of a client, so polling would miss both.
#[test]
fn a_handshake_is_two_changes_however_quickly_the_answer_comes() {
    let emulator = Emulator::stepped();
    let mut watcher = Follower::start(&emulator, "watch", &["node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS"]);
    watcher.note();
    handshake(&emulator);
    let by = |line: String| {
        let words: Vec<_> = line.split_whitespace().map(str::to_owned).collect();
        [&words[2], &words[4], &words[6], &words[7]].map(Clone::clone)
    };
    assert_eq!(by(watcher.line()), ["node2.w_CPU_CONTROL", "16#0000", "16#0001", "channel"]);
    assert_eq!(by(watcher.line()), ["node2.w_OPTION_STATUS", "16#0001", "16#0002", "firmware"]);
}

#[test]
fn changes_have_the_register_names_of_their_time() {
    let emulator = Emulator::stepped();
    let mut watcher = Follower::start(&emulator, "watch", &["node2"]);
    watcher.note();
    emulator.set_up(&["node2.b_MAX_SL_NR=3"]);
    let mut line = watcher.line();
    while !line.contains(" node2.b_MAX_SL_NR ") {
        line = watcher.line();
    }
    let words: Vec<_> = line.split_whitespace().skip(2).collect();
    assert!(words.join(" ").contains("16#00 -> 16#03 channel"), "{line}");
}

#[test]
fn watching_does_not_change_the_journal() {
    let journal = |watched: bool| {
        let emulator = Emulator::stepped();
        let watcher = watched.then(|| {
            let mut watcher = Follower::start(&emulator, "watch", &[]);
            watcher.note();
            watcher
        });
        handshake(&emulator);
        let journal = emulator.run("trace", &["--format", "jsonl"]).ok().to_owned();
        emulator.run("stop", &[]);
        drop(watcher.map(Follower::end));
        journal
    };
    assert_eq!(journal(true), journal(false));
}

#[test]
fn the_journal_contains_changes_of_watched_registers() {
    let emulator = Emulator::start(&["--clock", "stepped", "--watch", "node2.w_CPU_CONTROL,node1"]);
    handshake(&emulator);
    let printed = emulator.run("trace", &["--kind", "changed"]);
    let printed = printed.ok();
    assert!(printed.contains("w_CPU_CONTROL (%MW3.200000) 16#0000 -> 16#0001 by the channel"), "{printed}");
    assert!(!printed.contains("w_OPTION_STATUS"), "only what was asked for: {printed}");
    let wrong = run(&["run", "-i", "changes-wrong-name", "--watch", "node2.w_CPU_KONTROL"]);
    assert!(wrong.fails(2).contains("w_CPU_KONTROL"));
}

/// The head of `watch` counts registers that are not live, if no named register is live.
#[test]
fn watching_counts_registers_that_are_not_live() {
    let emulator = Emulator::stepped();
    for (names, count) in [
        (&["node2.a_RD_BMARRAY[*][*]"][..], "watching 512 registers "),
        (&["node2.a_RD_BMARRAY[0][0]", "node2.w_CPU_CONTROL"], "watching 2 registers "),
    ] {
        let note = Follower::start(&emulator, "watch", names).note();
        assert!(note.contains(count), "{note}");
    }
}

/// Node 1 of a slave has a doubleword where a master has bytes. A write to one of these bytes also changes the recorded
/// doubleword.
#[test]
fn a_part_of_a_recorded_register_has_its_changes() {
    let emulator = Emulator::start(&["--clock", "stepped", "--record", "node1"]);
    let name = "node1.a_SL_TYP[29]";
    let mut watch = Follower::start(&emulator, "watch", &[name]);
    assert!(watch.note().contains("watching 1 register "));
    emulator.poke(&[&format!("{name}=1")]);
    emulator.poke(&["node1.a_SL_TYP[28]=7"]);
    emulator.poke(&[&format!("{name}=2")]);
    let lines = [watch.line(), watch.line()].concat();
    assert!(lines.contains("16#00 -> 16#01") && lines.contains("16#01 -> 16#02"), "{lines}");
    // The record of the doubleword has its name, although its structure is not valid now.
    let trace = emulator.run("trace", &[]).ok().to_owned();
    assert!(trace.contains("a_WR_VALUE_RECEIVE[4] (%MD3.100048) 16#00000000 -> 16#00000100"), "{trace}");
    let directory = TempDir::new().unwrap();
    let picture = directory.path().join("a.svg");
    emulator.step(&["1ms"]);
    assert_eq!(emulator.run("plot", &[name, "-o", picture.to_str().unwrap()]).err, "");
    let script = directory.path().join("a.rhai");
    let text = format!(
        "record(\"{name}\"); poke(\"{name}\", 1); poke(\"node1.a_SL_TYP[28]\", 7); poke(\"{name}\", 2); \
         expect_history(\"{name}\", [1, 2]);"
    );
    fs::write(&script, text).unwrap();
    let outcome = run(&["test", script.to_str().unwrap()]);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
}

/// The plant decides how many retain flags there are.
#[test]
fn the_retain_flags_of_a_plc_are_recorded() {
    let emulator = Emulator::start(&["--clock", "stepped", "--record", "retain"]);
    emulator.poke(&["%MD10000000=5", "%MD10019996=7"]);
    emulator.step(&["1ms"]);
    let trace = emulator.run("trace", &["--kind", "changed", "--format", "jsonl"]);
    let changed: Vec<_> =
        trace.ok().lines().map(|line| serde_json::from_str::<Value>(line).unwrap()).collect();
    let flags: Vec<_> = changed.iter().map(|change| change["address"].as_str().unwrap()).collect();
    assert_eq!(flags, ["%MD10000000", "%MD10019996"], "{}", trace.out);
    let beyond = run(&["run", "--check", "--record", "%MD10020000"]);
    assert_eq!(
        beyond.fails(2),
        "commram: `--record %MD10020000`: this PLC has fewer retain flags than this BYTE needs; `retain_bytes` in the plant \
         file gives it more\n"
    );
}

/// The commands that show registers and their changes take whole registers, and elements of sub-structures.
#[test]
fn whole_registers_are_dumped_watched_and_recorded() {
    let emulator = Emulator::start(&["--clock", "stepped", "--record", "node2.a_DATA_PARAMETER[1]"]);
    let dump = emulator.run("dump", &["node2.a_DATA_PARAMETER[1]", "--full", "--format", "json"]);
    let rows: Vec<Value> = serde_json::from_str(dump.ok()).unwrap();
    let names: Vec<_> = rows.iter().map(|row| row["register"].as_str().unwrap()).collect();
    let element =
        ["d_PAR_VALUE", "w_PAR_NR", "w_SUBSL_ADR"].map(|own| format!("node2.a_DATA_PARAMETER[1].{own}"));
    assert_eq!(names, element);
    for (bit, whole) in [
        ("node2.w_CANsync_STATUS.2", "node2.w_CANsync_STATUS"),
        ("%MX3.200004.2", "node2.w_CANsync_STATUS"),
        ("%MX10000003.1", "%MB10000003"),
    ] {
        let right = format!("{bit}: a single bit is not possible here; name the whole register: {whole}");
        for command in ["dump", "watch"] {
            assert_eq!(emulator.run(command, &[bit]).fails(2), format!("commram: {right}\n"), "{command}");
        }
        let recorded = run(&["run", "--check", "--record", bit]);
        assert!(recorded.fails(2).contains(&right), "{}", recorded.err);
    }
    assert!(
        emulator.run("dump", &["node2.w_CANsync_STATUS.16"]).fails(2).contains("has bits 0 to 15, not 16")
    );
}
