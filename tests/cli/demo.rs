//! `commram demo`: the first session of a new user. It leaves no files or processes, even if it fails.

use crate::common::{Emulator, commram, eventually, files_of, finish, wait_for};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::Duration;

/// A running process of `commram demo`.
struct Demo {
    child: Child,
    lines: Receiver<String>,
    emulator: u32,
    soft_plc: u32,
    instance: String,
}

impl Demo {
    /// Starts the demonstration and reads its output up to a line that begins with `text`.
    fn start_until(text: &str) -> Self {
        let mut child = commram().arg("demo").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let out = BufReader::new(child.stdout.take().unwrap());
        let (send, lines) = mpsc::channel();
        std::thread::spawn(move || out.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        let instance = format!("demo-{}", child.id());
        let mut this = Self { child, lines, emulator: 0, soft_plc: 0, instance };
        this.emulator = number(&this.line("emulator: process "));
        this.soft_plc = number(&this.line("soft-PLC: process "));
        this.line(text);
        this
    }

    fn line(&mut self, start: &str) -> String {
        loop {
            match self.lines.recv_timeout(Duration::from_secs(60)) {
                Ok(line) if line.starts_with(start) => return line,
                Ok(_) => {}
                Err(error) => {
                    let _ = self.child.kill();
                    panic!("no line `{start}`: {error}");
                }
            }
        }
    }

    /// Waits for the end. Returns the exit code and the text on stderr.
    fn end(&mut self) -> (Option<i32>, String) {
        let status = wait_for(&mut self.child, "the demonstration");
        let mut text = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        (status.code(), text)
    }

    #[track_caller]
    fn has_left_nothing(&self) {
        let gone = |pid: u32| eventually(|| !runs(pid));
        assert!(gone(self.emulator), "the emulator still runs");
        assert!(gone(self.soft_plc), "the soft-PLC still runs");
        assert_eq!(files_of(&self.instance), Vec::<std::path::PathBuf>::new());
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        crate::common::remove_remains(&self.instance);
    }
}

fn number(line: &str) -> u32 {
    let digits = line.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit);
    digits.collect::<String>().parse().unwrap()
}

/// Returns whether the process exists and is no zombie.
fn runs(pid: u32) -> bool {
    let stat = std::fs::read_to_string(Path::new("/proc").join(pid.to_string()).join("stat"));
    stat.is_ok_and(|stat| !stat.rsplit(") ").next().unwrap_or("").starts_with('Z'))
}

fn signal(pid: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &pid.to_string()]).status().unwrap().success());
}

/// Returns the demonstration's output about the registers in `area`, from the first command to the dump.
#[track_caller]
fn shows_every_handshake(arguments: &[&str], area: &str) -> String {
    let mut demo = commram();
    let outcome = finish(demo.arg("demo").args(arguments));
    let out = outcome.ok();
    // The output contains in this order: command and answer of each step, process data, the dump.
    let mut rest = out;
    for (originator, register, value) in [
        ("PLC", "w_CPU_CONTROL ", "16#0000"),
        ("firmware", "w_OPTION_STATUS ", "16#0001"),
        ("PLC", "w_CPU_CONTROL ", "16#0001"),
        ("firmware", "w_OPTION_STATUS ", "16#0002"),
        ("PLC", "a_SL_TYP[3] ", "16#01"),
        ("PLC", "w_CPU_CONTROL ", "16#0002"),
        ("firmware", "w_OPTION_STATUS ", "16#0003"),
        ("PLC", "_CFG_WRC_WORD.b_CFG_WRC1_WORD1 ", "16#03"),
        ("PLC", "w_CPU_CONTROL ", "16#0020"),
        ("firmware", "w_OPTION_STATUS ", "16#0043"),
        ("firmware", "a_STAT_SL[1] ", "16#03"),
        ("PLC", "w_CPU_CONTROL ", "16#0040"),
        ("firmware", "w_OPTION_STATUS ", "16#0080"),
        ("PLC", "b_CTRLREG_WRC1 ", "16#05"),
        ("firmware", "b_CTRLREG_WRC1 ", "16#04"),
        ("PLC", "a_WR_VALUE[0] ", "16#11223344"),
        ("firmware", "a_RD_BMARRAY[1][0] ", "16#11223344"),
        ("firmware", "a_RD_BMARRAY[2][0] ", "16#11223344"),
        ("firmware", "a_RD_BMARRAY[3][0] ", "16#11223344"),
        ("", "w_OPTION_STATUS ", "16#0080"),
        ("", "a_STAT_SL[3] ", "16#03"),
    ] {
        let register = format!("{area}.{register}");
        let found = rest.lines().find(|line| {
            line.contains(originator)
                && line.contains(&register)
                && line.contains(value)
                && line.contains("%M")
        });
        let line =
            found.unwrap_or_else(|| panic!("no `{originator} {register} {value}` in\n{rest}\nof\n{out}"));
        let at = line.as_ptr().addr() - rest.as_ptr().addr();
        rest = &rest[at + line.len()..];
    }
    assert!(files_of(&format!("demo-{}", number(out))).is_empty());
    out.to_owned()
}

#[test]
fn the_demonstration_shows_every_handshake_and_ends_with_a_dump() {
    let out = shows_every_handshake(&[], "node2");
    for text in [
        "\nStart (manual 5.00005.03a p. 149-150)\n",
        "\nInitialization data: master at 500 kbit/s, slaves 1, 2 and 3 expected\n",
        "\nProcess data: the first 6 of 500 intervals\n",
        "\nNode 2 now, as `commram dump node2` shows it:\n",
    ] {
        assert!(out.contains(text), "no `{text}` in\n{out}");
    }
}

/// At 1 Mbit/s an interval is a millisecond long.
#[test]
fn the_demonstration_shows_another_device_at_its_bit_rate() {
    let out = shows_every_handshake(&["--device", "bm4-plc"], "slotG");
    for text in [
        "\nStart (manual 5.02066.01a p. 49-50)\n",
        "\nInitialization data: master at 1 Mbit/s, slaves 1, 2 and 3 expected (p. 49-51, 126-127)\n",
        "\nProcess data: the first 6 of 1000 intervals\n",
        "\nThe module in slot G now, as `commram dump slotG` shows it:\n",
    ] {
        assert!(out.contains(text), "no `{text}` in\n{out}");
    }
    for (register, value) in [("b_BT_0 ", "16#40"), ("b_BT_1 ", "16#34"), ("b_TIME_PATTERN ", "16#01")] {
        let register = format!("slotG.{register}");
        let is_shown = out.lines().any(|line| line.contains(&register) && line.contains(value));
        assert!(is_shown, "no `{register} {value}` in\n{out}");
    }
}

#[test]
fn ctrl_c_ends_everything() {
    for name in ["-INT", "-TERM", "-HUP"] {
        let mut demo = Demo::start_until("Set-up mode");
        signal(demo.child.id(), name);
        assert_eq!(demo.end(), (Some(130), "commram: interrupted\n".to_owned()));
        demo.has_left_nothing();
    }
}

#[test]
fn an_emulator_that_dies_is_noticed() {
    let mut demo = Demo::start_until("Set-up mode");
    signal(demo.emulator, "-KILL");
    let (code, message) = demo.end();
    assert_eq!(code, Some(1), "{message}");
    assert!(message.starts_with("commram: ") && message.contains("has died"), "{message}");
    demo.has_left_nothing();
}

#[test]
fn the_demonstration_notices_that_another_process_stopped_its_emulator() {
    let mut demo = Demo::start_until("Set-up mode");
    signal(demo.emulator, "-TERM");
    let (code, message) = demo.end();
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("the emulator has stopped"), "{message}");
    demo.has_left_nothing();
}

#[test]
fn a_soft_plc_that_dies_is_noticed() {
    let mut demo = Demo::start_until("Set-up mode");
    signal(demo.soft_plc, "-KILL");
    let (code, message) = demo.end();
    assert_eq!(code, Some(1));
    assert!(message.starts_with("commram: the soft-PLC has ended unexpectedly"), "{message}");
    demo.has_left_nothing();
}

#[test]
fn a_killed_demonstration_leaves_no_files() {
    let mut demo = Demo::start_until("Set-up mode");
    demo.child.kill().unwrap();
    demo.child.wait().unwrap();
    demo.has_left_nothing();
}

#[test]
fn a_closed_output_of_the_demonstration_is_no_error() {
    let mut child = commram().arg("demo").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let status = wait_for(&mut child, "the demonstration");
    let mut message = String::new();
    child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
    assert_eq!((status.code(), message.as_str()), (Some(0), ""));
    assert!(eventually(|| !runs(number(&line))));
    assert!(files_of(&format!("demo-{}", child.id())).is_empty());
}

/// The demonstration's soft-PLC is the first program that new users see. It must not violate the manual, and must not
/// cause a warning. Findings about its response time do not count.
#[track_caller]
fn checker_finds_nothing(emulator: &Emulator, plc: &str) {
    finish(commram().args(["demo-plc", &emulator.name, plc])).ok();
    let findings = emulator.run("check", &["--format", "json"]).out;
    let findings: Vec<serde_json::Value> = serde_json::from_str(&findings).unwrap();
    let others: Vec<_> = findings.iter().filter(|finding| finding["rule"] != "late-reference").collect();
    assert_eq!(others, Vec::<&serde_json::Value>::new());
    let journal = emulator.run("trace", &["--kind", "state", "--format", "jsonl"]).out;
    assert!(journal.contains("128"), "it was in active operation: {journal}");
}

#[test]
fn the_access_checker_finds_nothing() {
    checker_finds_nothing(&Emulator::start(&[]), "line");
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/src/devices/bm4_o_can_06/emulation/demo.toml");
    checker_finds_nothing(&Emulator::start(&[plant]), "maxx");
}

/// The emulator is in stepped mode and no client advances the clock. So the firmware does not answer the demonstration.
#[test]
fn a_handshake_that_is_not_answered_ends_with_a_message() {
    let emulator = Emulator::stepped();
    let outcome = finish(commram().args(["demo-plc", &emulator.name, "line"]));
    assert_eq!(outcome.code, Some(1), "{}", outcome.out);
    assert!(
        outcome
            .err
            .starts_with("commram: the state after command 16#0001: node2.w_OPTION_STATUS (%MW3.200002)"),
        "{}",
        outcome.err
    );
    assert!(outcome.err.contains("did not become 16#0002 within 5 s, it holds 16#0001, start-up"));
}
