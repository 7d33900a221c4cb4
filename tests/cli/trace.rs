//! `commram trace` on a running emulator, and its candump format in the tools that read it.

use crate::common::{Emulator, Follower, eventually, finish, is_there, python, run, wait_for};
use serde_json::Value;
use std::fs;
use std::process::Command;

/// Starts an emulator and runs node 2 in set-up mode for `time`, so that it exchanges frames.
fn with_frames(time: &str) -> Emulator {
    let emulator = Emulator::stepped();
    for (writes, time) in [
        (&["node2.w_CPU_CONTROL=16#0001"][..], "1ms"),
        (
            &[
                "node2.b_BT_1=16#1C",
                "node2.b_TIME_PATTERN=2",
                "node2.b_AC=16#FF",
                "node2.b_AM=16#FF",
                "node2.a_SL_TYP[1]=1",
                "node2.a_SL_TYP[3]=1",
                "node2.w_CPU_CONTROL=16#0002",
            ],
            "1ms",
        ),
        (&["node2.w_CPU_CONTROL=16#0020"], time),
    ] {
        emulator.poke(writes);
        emulator.step(&[time]);
    }
    emulator
}

/// Starts a plant in active operation, with one reference value sent.
fn in_operation() -> Emulator {
    let emulator = with_frames("1.1s");
    emulator.poke(&["node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0=16#01", "node2.w_CPU_CONTROL=16#0040"]);
    emulator.step(&["--to-sync"]);
    emulator.breaks(&["command"]);
    emulator.poke(&["node2.b_CTRLREG_WRC1=16#05", "node2.w_CPU_CONTROL=16#0002"]);
    emulator.step(&["10ms"]);
    emulator
}

fn jsonl(emulator: &Emulator, args: &[&str]) -> Vec<Value> {
    let outcome = emulator.run("trace", &[args, &["--format", "jsonl"]].concat());
    outcome.ok().lines().map(|line| serde_json::from_str(line).expect(line)).collect()
}

fn number(line: &Value, field: &str) -> u64 {
    line[field].as_u64().unwrap_or_else(|| panic!("{field} in {line}"))
}

#[test]
fn the_text_format_describes_each_event() {
    let emulator = in_operation();
    let outcome = emulator.run("trace", &[]);
    let text = outcome.ok();
    for line in [
        "     0.000000 s  line        w_CPU_CONTROL (%MW3.200000) := 16#0001 (handshake)",
        "     0.000500 s  line:node2  w_OPTION_STATUS (%MW3.200002) 16#0001 -> 16#0002, \
         waiting for \"take over initialization data\", answered after 500 us",
        "     0.004634 s  drives      16#010 CC to all slaves: SYNC mode on",
    ] {
        assert!(text.lines().any(|other| other == line), "{line}\nis not in\n{text}");
    }
    for part in [
        "b_CTRLREG_WRC1 (%MB3.200012) 16#05 -> 16#04, answered after",
        "SYNC, 500 times every 2000 us since 0.006500 s\n",
        "missed: WRC1",
        "w_CPU_CONTROL (%MW3.200000) 16#0002 ignored: not possible in this state",
        ", going on\n",
    ] {
        assert!(text.contains(part), "{part}\nis not in\n{text}");
    }
}

/// A record of repetitions is written after they have ended, and after other events.
#[test]
fn lines_for_people_are_in_the_order_of_their_times() {
    let emulator = in_operation();
    let times = |args: &[&str]| -> Vec<f64> {
        let text = emulator.run("trace", args).ok().to_owned();
        text.lines().map(|line| line.split(" s ").next().unwrap().trim().parse().expect(line)).collect()
    };
    let all = times(&[]);
    assert!(all.is_sorted(), "{all:?}");
    assert_eq!(times(&["-n", "5"]), all[all.len() - 5..]);
    let by_number: Vec<_> = jsonl(&emulator, &[]).iter().map(|line| number(line, "time_us")).collect();
    assert!(!by_number.is_sorted(), "{by_number:?}");
}

#[test]
fn jsonl_has_the_documented_fields() {
    let emulator = in_operation();
    let lines = jsonl(&emulator, &[]);
    let mut expected = 0;
    for line in &lines {
        assert_eq!(line["v"], 1, "{line}");
        number(line, "time_us");
        if line["seq"].is_null() {
            continue;
        }
        assert_eq!(number(line, "seq"), expected, "without gaps");
        expected += 1;
    }
    let fields = |kind: &str| {
        let line = lines.iter().find(|line| line["kind"] == kind).unwrap_or_else(|| panic!("no {kind}"));
        let own = line.as_object().unwrap().keys().map(String::as_str);
        own.filter(|key| !["v", "seq", "time_us", "kind"].contains(key)).collect::<Vec<_>>().join(" ")
    };
    for (kind, expected) in [
        ("sync", "bus"),
        ("frame", "bus data id text"),
        ("state", "address from latency_us node plc register text to"),
        ("handshake", "address answer latency_us node plc register request"),
        ("missed", "frame node plc"),
        ("ignored", "command node plc why"),
        ("slave_status", "node plc slave status text"),
        ("channel_write", "address plc register text value width"),
    ] {
        assert_eq!(fields(kind), expected, "{kind}");
    }
    let counted = lines.iter().find(|line| line["count"] == 500).expect("counted SYNC edges");
    assert_eq!((number(counted, "first_us"), number(counted, "period_us")), (6_500, 2_000));
    assert_eq!(number(counted, "time_us"), 6_500 + 499 * 2_000);
    assert_eq!(jsonl(&emulator, &["--kind", "state"]), {
        let states = lines.iter().filter(|line| line["kind"] == "state");
        states.cloned().collect::<Vec<_>>()
    });
    let json = emulator.run("trace", &["--format", "json", "--last", "1"]);
    assert!(json.ok().starts_with("{\"v\":1,"), "the name of the other commands is understood");
}

#[test]
fn options_select_parts_of_the_journal() {
    let emulator = in_operation();
    let all = jsonl(&emulator, &[]);
    let seqs =
        |args: &[&str]| jsonl(&emulator, args).iter().map(|line| line["seq"].as_u64()).collect::<Vec<_>>();
    let of = |wanted: &dyn Fn(&Value) -> bool| {
        all.iter().filter(|line| wanted(line)).map(|line| line["seq"].as_u64()).collect::<Vec<_>>()
    };
    assert_eq!(seqs(&["--from", "7"]), of(&|line| line["seq"].as_u64().is_none_or(|seq| seq >= 7)));
    assert_eq!(seqs(&["--since", "500ms"]), of(&|line| number(line, "time_us") >= 500_000));
    assert_eq!(seqs(&["--bus", "drives"]), of(&|line| line["bus"] == "drives"));
    assert_eq!(seqs(&["--plc", "line"]), of(&|line| line["plc"] == "line"));
    assert_eq!(seqs(&["--bus", "drives", "--plc", "line"]), of(&|_| true));
    let rare = |line: &Value| line["kind"] == "state" || line["kind"] == "channel_write";
    assert_eq!(seqs(&["-k", "state,channel_write"]), of(&rare));
    assert_eq!(seqs(&["-k", "state", "-k", "channel_write", "-n", "3"]), of(&rare)[of(&rare).len() - 3..]);

    let mistake = |args: &[&str]| emulator.run("trace", args).fails(2).to_owned();
    assert!(mistake(&["--bus", "lower"]).contains("has no bus 'lower'; its buses are: drives"));
    assert!(mistake(&["--plc", "press"]).contains("has no PLC 'press'"));
    assert!(mistake(&["--kind", "frames"]).contains("possible values: sync, frame"));
    assert!(mistake(&["--format", "candump", "--kind", "state"]).contains("only frames"));
    run(&["trace", "-i", "nobody-has-this-name"]).fails(3);
}

#[test]
fn lost_records_are_reported() {
    // There are more frames than the ring can hold; the states and registers are complete.
    let emulator = with_frames("90s");
    let lines = jsonl(&emulator, &[]);
    let (gaps, records): (Vec<_>, Vec<_>) = lines.iter().partition(|line| line["kind"] == "gap");
    let lost: u64 = gaps.iter().map(|gap| number(gap, "lost")).sum();
    assert!(lost > 0 && !gaps.is_empty());
    let mut numbers = records.iter().filter_map(|line| line["seq"].as_u64());
    let last = numbers.next_back().unwrap();
    assert_eq!(lost + numbers.count() as u64, last, "shown and lost are all");

    let text = emulator.run("trace", &["--kind", "frame"]);
    assert!(text.ok().starts_with("-- "), "before the first remaining frame");
    let candump = emulator.run("trace", &["--format", "candump", "--last", "1"]);
    assert_eq!((candump.code, candump.out.lines().count()), (Some(0), 1));
    assert!(candump.err.starts_with("commram: note: ") && candump.err.contains(" records lost before "));
    assert_eq!(candump.err.lines().count(), 1, "{}", candump.err);
    emulator.run("trace", &["--format", "candump", "--since", "80s"]).ok();
    assert!(!emulator.run("trace", &["--kind", "state"]).ok().contains("lost"), "no state is lost");
}

/// Starts `commram trace --follow`.
fn follow(emulator: &Emulator, args: &[&str]) -> Follower {
    Follower::start(emulator, "trace", &[&["--follow"], args].concat())
}

#[test]
fn following_prints_new_records_and_ends_with_the_emulator() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    let mut follower = follow(&emulator, &[]);
    assert!(follower.line().contains(":= 16#0001 (handshake)"), "what was there");
    emulator.step(&["1ms"]);
    assert!(follower.line().contains("16#0001 -> 16#0002"), "what comes");
    emulator.poke(&["node2.b_AC=16#FF"]);
    assert!(follower.line().contains("b_AC (%MB3.200013) := 16#FF"), "also while the clock is stopped");
    emulator.run("stop", &[]);
    let (code, rest, err) = follower.end();
    // The client may have a request in progress when the emulator ends, and then gets the reason. Otherwise its next
    // request finds no emulator.
    let ended = format!("commram: note: instance '{}' ", emulator.name);
    assert_eq!((code, rest.as_slice()), (Some(0), &[][..]));
    assert!(err.starts_with(&ended) && err.lines().count() == 1, "{err}");
}

#[test]
fn following_a_killed_emulator_ends_as_well() {
    let mut emulator = Emulator::stepped();
    emulator.poke(&["node2.b_AC=16#FF"]);
    let mut follower = follow(&emulator, &["--last", "1"]);
    follower.line();
    emulator.kill();
    assert_eq!(follower.end().0, Some(0));
}

#[test]
fn following_prints_the_pending_count_when_a_signal_ends_it() {
    for signal in ["-INT", "-TERM"] {
        let emulator = with_frames("100ms");
        let mut follower = follow(&emulator, &["--kind", "sync"]);
        follower.line();
        follower.line();
        let pid = follower.child.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        let (code, rest, err) = follower.end();
        assert_eq!((code, err.as_str()), (Some(130), ""));
        assert_eq!(
            rest,
            ["     0.100500 s  drives      SYNC, 48 times every 2000 us since 0.006500 s, going on"]
        );
    }
}

#[test]
fn following_ends_when_its_reader_closes_without_new_records() {
    let emulator = with_frames("10ms");
    let mut follower = follow(&emulator, &[]);
    follower.line();
    drop(follower.lines);
    assert_eq!(wait_for(&mut follower.child, "commram trace").code(), Some(0));
}

/// Returns a file with the frames in candump's format, and the same frames from jsonl: identifier and data.
fn candump_file(emulator: &Emulator) -> (tempfile::NamedTempFile, Vec<(u64, String)>) {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(&file, emulator.run("trace", &["--format", "candump"]).ok()).unwrap();
    let frames = jsonl(emulator, &["--kind", "frame"]);
    let frame = |line: &Value| (number(line, "id"), line["data"].as_str().unwrap().to_owned());
    (file, frames.iter().map(frame).collect())
}

/// Returns the output of a tool that must succeed.
fn output_of(command: &mut Command) -> String {
    let outcome = finish(command);
    assert_eq!(outcome.code, Some(0), "{command:?}: {}", outcome.err);
    outcome.out
}

#[test]
fn candump_lines_match_those_of_the_original() {
    let emulator = in_operation();
    let (file, frames) = candump_file(&emulator);
    let text = fs::read_to_string(&file).unwrap();
    assert_eq!(text.lines().next(), Some("(0000000000.004634) drives 010#FFFFFFFF02010000"));
    let read = text.lines().map(|line| {
        let (id, data) = line.split(' ').nth(2).unwrap().split_once('#').unwrap();
        (u64::from_str_radix(id, 16).unwrap(), data.to_owned())
    });
    assert_eq!(read.collect::<Vec<_>>(), frames);
}

#[test]
fn can_utils_read_the_candump_format() {
    if !is_there("log2asc") || !is_there("log2long") {
        return;
    }
    let emulator = in_operation();
    let (file, frames) = candump_file(&emulator);

    let asc = output_of(Command::new("log2asc").arg("-I").arg(file.path()).arg("drives"));
    let read = asc.lines().filter(|line| line.contains(" Rx ")).map(|line| {
        let words: Vec<_> = line.split_whitespace().collect();
        (u64::from_str_radix(words[2], 16).unwrap(), words[6..].concat())
    });
    assert_eq!(read.collect::<Vec<_>>(), frames, "log2asc");

    let long = output_of(Command::new("log2long").stdin(file.reopen().unwrap()));
    let read = long.lines().map(|line| {
        let line = line.split('\'').next().unwrap();
        let words: Vec<_> = line.split_whitespace().collect();
        (u64::from_str_radix(words[2], 16).unwrap(), words[4..].concat())
    });
    assert_eq!(read.collect::<Vec<_>>(), frames, "log2long, which reads like canplayer");
}

#[test]
fn wireshark_reads_the_candump_format() {
    if !is_there("tshark") {
        return;
    }
    let emulator = in_operation();
    let (file, frames) = candump_file(&emulator);
    let fields = ["-T", "fields", "-e", "frame.time_epoch", "-e", "can.id", "-e", "data.data"];
    let text = output_of(Command::new("tshark").arg("-r").arg(file.path()).args(fields));
    let read = text.lines().map(|line| {
        let words: Vec<_> = line.split('\t').collect();
        (words[1].parse().unwrap(), words[2].to_uppercase())
    });
    assert_eq!(read.collect::<Vec<_>>(), frames);
    assert!(text.starts_with("0.004634000\t"), "emulated time");
}

#[test]
fn wireshark_reads_the_pcapng_format_and_writes_it_back() {
    if !is_there("tshark") {
        return;
    }
    let emulator = in_operation();
    let (_, frames) = candump_file(&emulator);
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (ours, theirs) = (path("ours.pcapng"), path("theirs.pcapng"));
    let mut command = emulator.command("trace", &["--format", "pcapng"]);
    assert!(command.stdout(fs::File::create(&ours).unwrap()).status().unwrap().success());
    let fields = [
        "-T",
        "fields",
        "-e",
        "frame.time_epoch",
        "-e",
        "frame.interface_name",
        "-e",
        "can.id",
        "-e",
        "data.data",
    ];
    let text = output_of(Command::new("tshark").args(["-r", &ours]).args(fields));
    let read = text.lines().map(|line| {
        let words: Vec<_> = line.split('\t').collect();
        assert_eq!(words[1], "drives");
        (words[2].parse().unwrap(), words[3].to_uppercase())
    });
    assert_eq!(read.collect::<Vec<_>>(), frames);
    assert!(text.starts_with("0.004634000\t"), "emulated time");
    output_of(Command::new("tshark").args(["-r", &ours, "-w", &theirs]));
    let compared = emulator.run("bus", &["compare", &theirs, "--tolerance", "0s"]);
    assert_eq!(compared.ok(), format!("{} frames, no difference\n", frames.len()));
    let none = emulator.run("trace", &["--format", "pcapng", "--kind", "state"]);
    assert!(none.fails(2).contains("--format pcapng"), "{}", none.err);
}

#[test]
fn following_frames_can_be_piped_into_the_tools() {
    let emulator = with_frames("10ms");
    let follower = follow(&emulator, &["--format", "candump", "--last", "0"]);
    // If the first poll of the client comes after the step, it returns no frame. So the test steps until a frame
    // appears.
    let Follower { child, mut lines, .. } = follower;
    let (send, receive) = std::sync::mpsc::channel();
    let reader = std::thread::spawn(move || {
        if let Some(Ok(line)) = lines.next() {
            let _ = send.send(line);
        }
        lines.map_while(Result::ok).count()
    });
    let mut first = None;
    assert!(eventually(|| {
        emulator.step(&["4ms"]);
        first = receive.try_recv().ok();
        first.is_some()
    }));
    let first = first.unwrap();
    let head: String = first.chars().skip(1).take(17).collect();
    assert!(head.parse::<f64>().is_ok_and(|time| time > 0.012), "{first}");
    drop(emulator);
    let mut follower = child;
    assert_eq!(wait_for(&mut follower, "commram trace").code(), Some(0));
    reader.join().unwrap();
}

#[test]
fn an_external_reader_finds_registers_frames_and_sync_in_waveforms() {
    let emulator = in_operation();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run.vcd");
    let mut command = emulator.command("trace", &["--format", "vcd"]);
    assert!(command.stdout(fs::File::create(&path).unwrap()).status().unwrap().success());
    let refused = emulator.run("trace", &["--format", "vcd", "--follow"]);
    assert!(refused.fails(2).contains("omit --follow"));
    let Some(mut python) = python(&["pywellen"]) else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_waves.py");
    let (status, text) = ("line.node2.w_OPTION_STATUS", "line.node2.w_OPTION_STATUS_text");
    let output = output_of(python.arg(script).arg(&path).args([
        "line.node2.w_CPU_CONTROL",
        status,
        text,
        "line.node2.b_CTRLREG_WRC1",
        "drives.sync",
        "drives.id",
        "drives.data",
        "drives.slot",
        "drives.frame_end",
    ]));
    let lines: Vec<_> = output.lines().collect();
    assert_eq!(lines[0], "timescale 1 us");
    assert!(lines[1].starts_with("line.node2.w_CPU_CONTROL Reg 0:"), "{}", lines[1]);
    assert!(lines[2].contains(" 500:2 "), "{}", lines[2]);
    assert!(lines[3].contains(" 500:waiting_for_"), "{}", lines[3]);
    assert!(lines[4].ends_with(":4"), "16#05 is answered by 16#04: {}", lines[4]);
    // Compares every edge and every frame, including those that were counted in one record.
    let edges = |line: &str| line.split_whitespace().skip(2).map(str::to_owned).collect::<Vec<_>>();
    let syncs = edges(lines[5]);
    assert!(syncs.len() > 500, "{}", syncs.len());
    let (_, frames) = candump_file(&emulator);
    let ids: Vec<_> = edges(lines[6])
        .into_iter()
        .filter(|id| id.starts_with(|c: char| c.is_ascii_digit()) && !id.contains('x'))
        .collect();
    assert!(!ids.is_empty() && ids.len() <= frames.len(), "an identifier that comes again is no change");
    let (first, data) = candump_file(&emulator).1.remove(0);
    assert_eq!((first, data.len()), (0x010, 16));
    let bits = u64::from_str_radix(&data, 16).unwrap();
    assert!(
        lines[7].starts_with("drives.data Reg ") && lines[7].contains(&format!(":{bits} ")),
        "{}",
        lines[7]
    );
    for slot in ["CC", "RC", "WRC1"] {
        assert!(lines[8].contains(&format!(":{slot}")), "{}", lines[8]);
    }
    assert_eq!(edges(lines[9]).len(), frames.len(), "each frame, be it like the one before");
    {
        let same = directory.path().join("run.fst");
        let mut command = emulator.command("trace", &["--format", "fst"]);
        assert!(command.stdout(fs::File::create(&same).unwrap()).status().unwrap().success());
        let output =
            output_of(Command::new(python.get_program()).arg(script).arg(&path).arg("--same").arg(&same));
        let signals: usize = output.lines().last().unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!(signals > 20 && output.ends_with(" signals are the same\n"), "{output}");
        assert!(fs::metadata(&same).unwrap().len() < fs::metadata(&path).unwrap().len() / 2);
    }
}

/// Two registers share an address: `b_AC` of the initialization data, which is live after power-on, and
/// `b_CTRLREG_WRC2`, which the reset changes.
#[test]
fn a_waveform_shows_the_memory_of_registers_that_were_not_live() {
    let emulator = Emulator::start(&["--clock", "stepped", "--record", "node2"]);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
    emulator.set_up(&["node2.b_AC=16#FF"]);
    for power in ["power=off", "power=on"] {
        emulator.run("board", &["set", power]).ok();
        emulator.step(&["1ms"]);
    }
    assert!(emulator.run("peek", &["node2.b_AC"]).ok().starts_with("node2.b_AC = 16#00"));
    let waves = emulator.run("trace", &["--format", "vcd"]).ok().to_owned();
    let declared = waves.lines().find(|line| line.ends_with(" b_AC $end")).expect("the signal");
    let code = declared.split(' ').nth(3).unwrap();
    let values: Vec<_> = waves.lines().filter(|line| line.ends_with(&format!(" {code}"))).collect();
    assert!(values.iter().any(|value| value.starts_with("b11111111 ")), "{values:?}");
    assert!(values.last().unwrap().starts_with("b00000000 "), "{values:?}");
}
