//! The exit codes of all commands: docs/reference/command-line.md.

use crate::common::{Emulator, commram, finish, finish_on_a_full_disk, run, unique_name, wait_for};
use crate::scenarios::Scripts;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// Commands that need an instance, each with valid arguments. DUMP is a file with an empty dump.
const AT_AN_INSTANCE: &[&[&str]] = &[
    &["stop"],
    &["stop", "--clean"],
    &["peek", "node2.w_CPU_CONTROL"],
    &["poke", "node2.w_CPU_CONTROL=0"],
    &["force"],
    &["force", "node2.w_CPU_CONTROL=0"],
    &["unforce", "--all"],
    &["wait", "node2.w_CPU_CONTROL==0"],
    &["step", "1ms"],
    &["step", "--to-sync"],
    &["step", "--back", "1ms"],
    &["step", "--back-to", "node2.w_CPU_CONTROL==0"],
    &["snapshot", "DUMP"],
    &["restore", "DUMP"],
    &["dump"],
    &["diff", "DUMP"],
    &["watch"],
    &["fault", "list"],
    &["fault", "add", "crc_error", "bus=drives"],
    &["fault", "clear", "1"],
    &["trace"],
    &["trace", "--follow"],
    &["check"],
    &["board", "get"],
    &["board", "set", "start=cold"],
    &["bus", "list"],
    &["bus", "open", "drives", "slcan-pty"],
    &["bus", "close", "drives"],
    &["drive", "list"],
    &["drive", "show", "drive1"],
    &["drive", "set", "drive1", "P300=1"],
    &["status"],
    &["speed", "0"],
    &["plot", "node2.w_CPU_CONTROL", "-o", "never.svg"],
    &["shell"],
    &["web", "--listen", "127.0.0.1:0"],
];

/// Commands with names and addresses that no device of the program has, but that a device in a folder can have.
const OF_A_FOLDER: &[&[&str]] = &[
    &["peek", "box.w_X"],
    &["peek", "box.*"],
    &["peek", "w_X"],
    &["peek", "%QB7"],
    &["poke", "box.w_X=0"],
    &["force", "box.w_X=0"],
    &["unforce", "box.w_X"],
    &["wait", "box.w_X==0"],
    &["step", "--to-sync", "box"],
    &["step", "--back-to", "box.w_X==0"],
    &["dump", "box"],
    &["watch", "box.w_X"],
    &["plot", "box.w_X", "-o", "never.svg"],
];

/// Returns the commands that `commram help` lists.
fn commands() -> Vec<String> {
    let help = run(&["help"]);
    let list = help.ok().split("Usage: ").nth(1).unwrap().split("Options:\n").next().unwrap();
    let names = list.lines().filter_map(|line| line.strip_prefix("  ")?.split_ascii_whitespace().next());
    let names: Vec<_> = names.filter(|name| *name != "help").map(str::to_owned).collect();
    assert!(names.len() > 20, "{names:?}");
    names
}

#[test]
fn every_command_exits_with_2_on_wrong_use() {
    for command in commands() {
        let outcome = run(&[&command, "--no-such-option"]);
        assert!(outcome.fails(2).contains("--no-such-option"), "{command}: {}", outcome.err);
    }
}

#[test]
fn every_command_exits_with_3_without_its_instance() {
    for command in commands() {
        let needs = run(&[&command, "--help"]).ok().contains("--connect-timeout");
        let known = AT_AN_INSTANCE.iter().any(|args| args[0] == command);
        // A view cannot run without a terminal. tests/cli/viewers.rs tests its exit codes.
        assert!(
            known || !needs || command == "view",
            "add `{command}` with valid arguments to AT_AN_INSTANCE of tests/cli/exit_codes.rs, as \
             docs/internals/architecture.md, section \"An operation\", says"
        );
    }
    let outcome = run(&["diff", "no-such-file.json"]);
    assert!(outcome.fails(2).contains("`no-such-file.json`: No such file"), "{}", outcome.err);
    let dump = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(dump.path(), "[]").unwrap();
    let mut killed = Emulator::stepped();
    killed.kill();
    for args in AT_AN_INSTANCE {
        let args: Vec<_> =
            args.iter().map(|arg| if *arg == "DUMP" { dump.path().to_str().unwrap() } else { arg }).collect();
        let nobody = unique_name();
        let outcome = run(&[&args[..], &["-i", &nobody]].concat());
        assert!(outcome.fails(3).contains(&nobody), "{args:?}: {}", outcome.err);
        let reads = ["peek", "dump", "diff"].contains(&args[0]) || args[..] == ["board", "get"];
        if !reads && args[..] != ["stop", "--clean"] {
            let outcome = run(&[&args[..], &["-i", &killed.name]].concat());
            assert!(outcome.fails(3).contains("was killed"), "{args:?}: {}", outcome.err);
        }
    }
    for args in OF_A_FOLDER {
        let outcome = run(&[args, &["-i", "nobody-has-this-name", "--connect-timeout", "0s"][..]].concat());
        assert!(outcome.fails(3).contains("nobody-has-this-name"), "{args:?}: {}", outcome.err);
    }
    assert!(run(&["map", "-i", "nobody-has-this-name"]).fails(3).contains("nobody-has-this-name"));
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenarios/28-one-answer.rhai");
    run(&["test", scenario, "--attach", "nobody-has-this-name"]).fails(3);
}

#[test]
fn a_failing_expectation_exits_with_1() {
    let emulator = Emulator::stepped();
    let fails = |command: &str, args: &[&str]| emulator.run(command, args).code;
    assert_eq!(fails("wait", &["node2.w_OPTION_STATUS==7", "--within", "1ms"]), Some(1));
    assert_eq!(fails("step", &["--to-sync"]), Some(1), "nobody sends SYNC");
    assert_eq!(fails("board", &["set", "start=cold"]), Some(1), "there is no program");
    assert_eq!(fails("check", &[]), Some(0));
    let before = emulator.run("dump", &["--all", "--format", "json"]);
    let dump = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(dump.path(), before.ok()).unwrap();
    assert_eq!(fails("diff", &[dump.path().to_str().unwrap()]), Some(0));
    emulator.poke(&["node2.w_OPTION_STATUS=7"]);
    assert_eq!(fails("diff", &[dump.path().to_str().unwrap()]), Some(1));
    emulator.step(&["1ms"]);
    assert_eq!(fails("check", &[]), Some(1), "the status belongs to the firmware");
    emulator.breaks(&["owner"]);
}

#[test]
fn continuous_commands_exit_with_130_on_ctrl_c() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    for (args, is_silent) in [
        (&["run", "--clock", "stepped"][..], false),
        (&["trace", "--follow", "-i", &emulator.name], false),
        (&["watch", "node2.w_OPTION_STATUS", "-i", &emulator.name], true),
    ] {
        let mut command = commram();
        command.args(args).stdout(Stdio::piped()).stderr(Stdio::piped());
        let own = unique_name();
        if args[0] == "run" {
            command.args(["-i", &own]);
        }
        let mut child = command.spawn().unwrap();
        // After its first output, a command has installed its signal handler. `watch` prints its first output on
        // stderr.
        let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        let (mut out, mut err) = (BufReader::new(out), BufReader::new(err));
        let mut line = String::new();
        let read = if is_silent { err.read_line(&mut line) } else { out.read_line(&mut line) };
        assert!(read.unwrap() > 0, "{args:?}");
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let status = wait_for(&mut child, args[0]);
        assert_eq!(status.code(), Some(130), "{args:?}: {status}");
    }
}

/// Unprinted results are lost when the reader closes the pipe, but the command does not fail.
#[test]
fn a_closed_reader_is_no_error() {
    let script = format!("'{}' map --all | head -1", env!("CARGO_BIN_EXE_commram"));
    let outcome = finish(Command::new("bash").args(["-c", &format!("set -o pipefail; {script}")]));
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(0), ""));
}

/// Runs a command without a reader of its output, and returns its exit code.
fn code_without_a_reader(command: &mut Command) -> Option<i32> {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut child = command.stdout(writer).stderr(Stdio::null()).spawn().unwrap();
    wait_for(&mut child, "a command without a reader").code()
}

/// `commram test wrong.rhai | head -1` in a script with `pipefail` must not succeed.
#[test]
fn a_verdict_is_not_lost_if_the_reader_closes_the_output() {
    let files = Scripts::new(&[
        ("fails.rhai", "expect(\"node2.w_OPTION_STATUS\", 7);"),
        ("broken.rhai", "nothing("),
        ("good.rhai", "step(\"1ms\");"),
        ("wrong.toml", "[[plc]]\nname = 'a b'\n"),
        ("log", "(0.000001) can0 123#00\n"),
    ]);
    let report = files.run(&["fails.rhai", "--shard", "1/1", "--junit", "report.xml"]);
    assert_eq!(report.code, Some(1), "{}", report.err);
    let emulator = Emulator::stepped();
    emulator.breaks(&["owner"]);
    let before = emulator.run("dump", &["--all", "--format", "json"]);
    std::fs::write(files.0.path().join("dump"), before.ok()).unwrap();
    emulator.poke(&["node2.w_OPTION_STATUS=7"]);
    emulator.step(&["1ms"]);
    for (args, code) in [
        (&["test", "fails.rhai", "good.rhai", "--allow-empty"][..], 1),
        (&["test", "good.rhai", "broken.rhai", "--allow-empty"], 2),
        (&["test", "good.rhai", "--allow-empty"], 0),
        (&["test", "fails.rhai", "--format", "json"], 1),
        (&["test", "merge", "report.xml"], 1),
        (&["run", "--check", "wrong.toml", "--format", "json"], 2),
        (&["plant", "check", "wrong.toml", "--format", "csv"], 2),
        (&["layout", "check", "none"], 2),
        (&["check", "-i", &emulator.name], 1),
        (&["diff", "dump", "-i", &emulator.name], 1),
        (&["bus", "compare", "log", "-i", &emulator.name], 1),
        (&["status", "-i", &emulator.name], 0),
        (&["dump", "-i", &emulator.name], 0),
        (&["trace", "-i", &emulator.name], 0),
    ] {
        let mut command = commram();
        let found = code_without_a_reader(command.args(args).current_dir(files.0.path()));
        assert_eq!(found, Some(code), "{args:?}");
    }
}

/// The exit code reports that the output failed; the operation itself was done.
#[test]
fn operations_are_done_although_their_output_cannot_be_written() {
    let name = unique_name();
    let full = |args: &[&str]| {
        let outcome = finish_on_a_full_disk(commram().args(args).args(["-i", &name]));
        assert_eq!(outcome.code, Some(4), "{args:?}: {}", outcome.err);
        let message = "commram: cannot write the output: ";
        assert!(
            outcome.err.contains(message) && outcome.err.contains("is done"),
            "{args:?}: {}",
            outcome.err
        );
        outcome.err
    };
    let message = full(&["run", "--detach", "--clock", "stepped"]);
    assert!(message.contains("continues in the background"), "{message}");
    full(&["step", "1ms"]);
    let time = run(&["step", "1ms", "-i", &name]);
    assert_eq!(time.ok(), "0.002000 s\n");
    // A file with the name `-` is the standard output.
    full(&["snapshot", "-"]);
    full(&["plot", "node2.w_CPU_CONTROL", "--output", "-"]);
    full(&["stop"]);
    assert!(run(&["peek", "node2.w_CPU_CONTROL", "-i", &name]).fails(3).contains("is not running"));
}
