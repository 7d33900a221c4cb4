//! Output on a terminal: colours, a pager, progress, the prompt of the shell.

use crate::common::{Emulator, commram};
use std::fs::File;
use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Time after which a test counts as hanging.
const WATCHDOG: Duration = Duration::from_secs(60);

/// Runs a command at a separate terminal of `columns` and 24 rows, types `input`, and returns all that the terminal
/// shows until `end` accepts it, or until the command ends.
fn at_terminal(
    columns: u16,
    command: &mut Command,
    input: impl AsRef<[u8]>,
    end: impl Fn(&str) -> bool,
) -> String {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&terminal).unwrap();
    unlockpt(&terminal).unwrap();
    let name = ptsname(&terminal, Vec::new()).unwrap();
    let size = rustix::termios::Winsize { ws_col: columns, ws_row: 24, ws_xpixel: 0, ws_ypixel: 0 };
    rustix::termios::tcsetwinsize(&terminal, size).unwrap();
    let place = || File::options().read(true).write(true).open(name.to_str().unwrap()).unwrap();
    command.env("TERM", "xterm").stdin(place()).stdout(place()).stderr(place());
    let mut child = command.spawn().unwrap();
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut terminal = File::from(terminal);
    terminal.write_all(input.as_ref()).unwrap();
    let (mut shown, mut part, start) = (Vec::new(), [0; 4096], Instant::now());
    loop {
        assert!(start.elapsed() < WATCHDOG, "{}", String::from_utf8_lossy(&shown));
        match terminal.read(&mut part) {
            // The loop ends when the program has closed its end of the terminal.
            Ok(0) | Err(_) => break,
            Ok(len) => shown.extend_from_slice(&part[..len]),
        }
        if end(&String::from_utf8_lossy(&shown)) {
            break;
        }
    }
    let _ = child.kill();
    child.wait().unwrap();
    String::from_utf8_lossy(&shown).into_owned()
}

fn to_its_end(command: &mut Command) -> String {
    at_terminal(100, command, "", |_| false)
}

#[test]
fn a_long_table_goes_to_the_pager_on_a_terminal() {
    let shown = to_its_end(commram().args(["map", "node2"]).env("PAGER", "sed s/^/P:/"));
    assert!(shown.contains("P:node2.w_CPU_CONTROL"), "{shown}");
    for pager in ["", "no-such-pager-exists"] {
        let shown = to_its_end(commram().args(["map", "node2"]).env("PAGER", pager));
        assert!(shown.contains("\nnode2.w_CPU_CONTROL"), "{shown}");
    }
    let short = to_its_end(commram().args(["find", "bus-off"]).env("PAGER", "sed s/^/P:/"));
    assert!(short.contains("w_CANsync_STATUS") != short.contains("P:"), "{short}");
    let piped = crate::common::finish(commram().args(["map", "node2"]).env("PAGER", "sed s/^/P:/"));
    assert!(piped.ok().contains("\nnode2.w_CPU_CONTROL"), "{}", piped.out);
}

#[test]
fn a_long_journal_goes_to_the_pager_on_a_terminal() {
    let emulator = Emulator::stepped();
    let writes: Vec<_> = (0..30).map(|number| format!("node2.a_SL_TYP[{number}]=1")).collect();
    emulator.poke(&writes.iter().map(String::as_str).collect::<Vec<_>>());
    let shown = |args: &[&str]| to_its_end(emulator.command("trace", args).env("PAGER", "sed s/^/P:/"));
    let all = shown(&[]);
    assert!(all.lines().count() >= 30 && all.lines().all(|line| line.starts_with("P:")), "{all}");
    assert!(shown(&["--format", "csv"]).starts_with("P:"));
    let short = shown(&["--last", "3"]);
    assert!(short.lines().count() == 3 && !short.contains("P:"), "{short}");
    let piped = crate::common::finish(emulator.command("trace", &[]).env("PAGER", "sed s/^/P:/"));
    assert!(!piped.ok().contains("P:"), "{}", piped.out);
}

#[test]
fn passed_is_green_and_failed_is_red() {
    let directory = tempfile::tempdir().unwrap();
    let file = |name: &str, value: u8| {
        let text = format!("expect(\"node2.w_CPU_CONTROL\", {value});\n");
        std::fs::write(directory.path().join(name), text).unwrap();
    };
    file("good.rhai", 0);
    file("wrong.rhai", 1);
    let shown = to_its_end(commram().arg("test").arg(directory.path()).env_remove("NO_COLOR"));
    for part in [
        "\x1b[32mpassed\x1b[0m",
        "\x1b[31mfailed\x1b[0m",
        "\x1b[32m1 passed\x1b[0m, \x1b[31m1 failed\x1b[0m, 0 broken",
    ] {
        assert!(shown.contains(part), "{part:?}: {shown:?}");
    }
    let plain = to_its_end(commram().arg("test").arg(directory.path()).env("NO_COLOR", "1"));
    assert!(!plain.contains("\x1b[32m"), "{plain:?}");
}

#[test]
fn a_long_step_shows_its_target_and_its_rate() {
    let emulator = Emulator::stepped();
    // The emulator advances an idle plant so fast that it would reach its target before the first progress text.
    emulator.set_up(&["node2.b_MAX_SL_NR=3"]);
    let now: f64 = emulator.step(&["1ms"]).trim_end_matches(" s").parse().unwrap();
    let target = format!(" of {:.6} s, ", now + 86_400.0);
    let shown =
        at_terminal(100, &mut emulator.command("step", &["24h"]), "", |shown| shown.contains("real time;"));
    assert!(shown.contains(&target) && shown.contains(" times real time; Ctrl-C ends"), "{shown}");
}

#[test]
fn the_prompt_of_the_shell_has_the_emulated_time() {
    let emulator = Emulator::stepped();
    let mut shell = emulator.command("shell", &[]);
    let shown = at_terminal(100, &mut shell, "step 2ms\r", |shown| shown.contains("0.002000 s> "));
    assert!(shown.contains(&format!("{} 0.000000 s> ", emulator.name)), "{shown}");
}

#[test]
fn a_wide_view_has_two_panes() {
    let emulator = Emulator::stepped();
    let view = |columns: u16, end: fn(&str) -> bool| {
        at_terminal(columns, &mut emulator.command("view", &["node2.w_CPU_CONTROL"]), "", end)
    };
    let changes = "changes of the ";
    let wide = view(130, |shown| shown.contains("changes of the ") && shown.contains("n SYNC"));
    assert!(wide.contains("registers") && wide.contains("b/B back"), "{wide}");
    let narrow = view(100, |shown| shown.contains("n SYNC"));
    assert!(!narrow.contains(changes), "{narrow}");
}

/// A pasted text in Latin-1. Neither its part before the byte nor its part after it may be executed.
#[test]
fn the_shell_refuses_a_line_that_is_no_text_and_goes_on() {
    let emulator = Emulator::stepped();
    let shown = at_terminal(100, &mut emulator.command("shell", &[]), b"step 1ms\xe9\rstep 5ms\r", |shown| {
        shown.split_once("it was not executed").is_some_and(|(_, rest)| rest.contains("0.000000 s> "))
    });
    assert!(shown.contains("no text in UTF-8; it was not executed"), "{shown}");
    assert!(!shown.contains("0.005000 s") && !shown.contains("cannot write"), "{shown}");
}

/// Nested `eval` does not count as a nested call.
#[test]
fn the_shell_refuses_its_own_input_as_a_file() {
    let emulator = Emulator::stepped();
    for command in ["test -", "diff -", "plant check -", "bus play -", "restore -"] {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, "{command}").unwrap();
        let outcome = crate::common::finish(emulator.command("shell", &[]).stdin(file.reopen().unwrap()));
        assert!(
            outcome.err.contains("the shell reads its commands from the standard input"),
            "{}",
            outcome.err
        );
    }
}

#[test]
fn the_shell_survives_a_text_that_evaluates_itself() {
    let emulator = Emulator::stepped();
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(b"let s = \"eval(s)\"; eval(s)\n").unwrap();
    let outcome = crate::common::finish(emulator.command("shell", &[]).stdin(file.reopen().unwrap()));
    assert!(outcome.fails(2).contains("nested too deep"), "{}", outcome.err);
}

#[test]
fn a_comment_or_text_of_the_shell_can_have_several_lines() {
    let emulator = Emulator::stepped();
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(b"/* a (\nb */ print(1)\nprint(`x\ny`)\nstep 1us\n/* open\nprint(2)\n").unwrap();
    let outcome = crate::common::finish(emulator.command("shell", &[]).stdin(file.reopen().unwrap()));
    let is_explained = ["Expecting '*/' to end this comment", "line 6 failed"];
    assert!(is_explained.iter().all(|text| outcome.err.contains(text)), "{}", outcome.err);
    assert_eq!((outcome.code, outcome.out.as_str()), (Some(2), "1\nx\ny\n0.000001 s\n"));
}

#[test]
fn the_shell_lists_its_commands_and_verbs() {
    let emulator = Emulator::stepped();
    let shown = |line: &str| {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), line).unwrap();
        crate::common::finish(emulator.command("shell", &[]).stdin(file.reopen().unwrap())).ok().to_owned()
    };
    for line in ["help", "?"] {
        let help = shown(line);
        for part in ["  step  speed  snapshot", "wait(register, value, within)", "Ends: exit, quit"] {
            assert!(help.contains(part), "{line}: {part}: {help}");
        }
    }
    assert_eq!(shown("? peek"), shown("help peek"));
}

#[test]
fn a_terminal_counts_cyclic_traffic_and_a_file_has_every_record() {
    let emulator = Emulator::stepped();
    let trace = |args: &[&str]| to_its_end(emulator.command("trace", args).env("PAGER", ""));
    emulator.set_up(&["node2.b_MAX_SL_NR=3"]);
    emulator.step(&["1s"]);
    let (folded, full) = (trace(&[]), trace(&["--full"]));
    assert!(folded.contains("CC to slave 1") && folded.contains(" times until "), "{folded}");
    assert!(full.contains("CC to slave 1") && !full.contains(" times until "), "{full}");
    assert!(10 * folded.lines().count() < full.lines().count(), "{folded}");
    let same = |args: &[&str]| assert!(!trace(args).contains(" times until "), "{args:?}");
    same(&["--kind", "frame"]);
    same(&["--last", "50"]);
    let piped = crate::common::finish(&mut emulator.command("trace", &[]));
    let piped = piped.ok();
    assert_eq!(piped.lines().count(), full.lines().count(), "{piped}");
}
