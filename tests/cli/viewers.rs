//! `commram view` and `commram shell` as programs: without a terminal, and from a pipe.

use crate::common::{Emulator, Outcome, finish, wait_for};
use crate::option_cards::place_with_encoder;
use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn a_view_needs_a_terminal() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("view", &[]);
    assert!(outcome.fails(2).contains("needs a terminal"), "{}", outcome.err);
}

/// Starts `commram view` at a separate terminal. Returns the terminal, and the program after its first output.
fn view(emulator: &Emulator) -> (File, Child) {
    view_with(emulator, true)
}

/// Sets the size of a terminal: columns and rows.
fn resize(terminal: &File, (ws_col, ws_row): (u16, u16)) {
    let size = rustix::termios::Winsize { ws_col, ws_row, ws_xpixel: 0, ws_ypixel: 0 };
    rustix::termios::tcsetwinsize(terminal, size).unwrap();
}

/// Starts a view like [`view`]. Without a separate error output, errors go to the terminal.
fn view_with(emulator: &Emulator, has_error_output: bool) -> (File, Child) {
    view_of(emulator, "node2.w_CPU_CONTROL", has_error_output)
}

/// Starts a view like [`view_with`], with another pinned register.
fn view_of(emulator: &Emulator, register: &str, has_error_output: bool) -> (File, Child) {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&terminal).unwrap();
    unlockpt(&terminal).unwrap();
    let name = ptsname(&terminal, Vec::new()).unwrap();
    let end = || File::options().read(true).write(true).open(name.to_str().unwrap()).unwrap();
    let terminal = File::from(terminal);
    resize(&terminal, (80, 24));
    let mut command = emulator.command("view", &[register]);
    let errors = if has_error_output { Stdio::piped() } else { end().into() };
    let child = command.stdin(end()).stdout(end()).stderr(errors).spawn().unwrap();
    let mut terminal = terminal;
    let (mut shown, mut part) = (Vec::new(), [0; 4096]);
    let wanted = register.split_once('.').map_or(register, |(_, name)| name);
    while !String::from_utf8_lossy(&shown).contains(wanted) {
        let len = terminal.read(&mut part).unwrap();
        shown.extend_from_slice(&part[..len]);
    }
    (terminal, child)
}

#[test]
fn a_view_ends_with_its_terminal_or_on_request() {
    let emulator = Emulator::stepped();
    let (mut terminal, mut quits) = view(&emulator);
    terminal.write_all(b"q").unwrap();
    assert_eq!(wait_for(&mut quits, "a view after q").code(), Some(0));
    let (mut terminal, mut interrupted) = view(&emulator);
    terminal.write_all(b"\x03").unwrap();
    assert_eq!(wait_for(&mut interrupted, "a view after Ctrl+C").code(), Some(130));
    let (terminal, mut left) = view(&emulator);
    drop(terminal);
    assert_eq!(wait_for(&mut left, "a view without terminal").code(), Some(130));
}

/// The view pins a register of an option card.
#[test]
fn a_view_shows_the_registers_of_an_option_card() {
    let place = place_with_encoder();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    let (mut terminal, mut quits) = view_of(&emulator, "line:encoder1.di_SYNC_LATCH", true);
    terminal.write_all(b"q").unwrap();
    assert_eq!(wait_for(&mut quits, "a view after q").code(), Some(0));
}

/// The error output of the view is the terminal, which is closed. So the view cannot write a message.
#[test]
fn a_view_with_a_closed_terminal_ends_as_if_interrupted() {
    let emulator = Emulator::stepped();
    for _ in 0..3 {
        let (terminal, mut left) = view_with(&emulator, false);
        drop(terminal);
        assert_eq!(wait_for(&mut left, "a view without terminal").code(), Some(130));
    }
}

#[test]
fn a_view_draws_only_a_part_of_a_very_large_terminal() {
    let emulator = Emulator::stepped();
    let (mut terminal, mut view) = view(&emulator);
    for size in [(u16::MAX, u16::MAX), (1, u16::MAX), (u16::MAX, 1), (0, 0), (80, 24)] {
        resize(&terminal, size);
        Command::new("kill").args(["-WINCH", &view.id().to_string()]).status().unwrap();
        // Gives the view time to draw at this size.
        drain(&mut terminal, Duration::from_millis(200));
    }
    let mut reader = terminal.try_clone().unwrap();
    std::thread::spawn(move || io::copy(&mut reader, &mut io::sink()));
    // Crossterm can delay a key that arrives together with a change of the size until the next key.
    let end = Instant::now() + Duration::from_secs(30);
    while view.try_wait().unwrap().is_none() && Instant::now() < end {
        let _ = terminal.write(b"q").unwrap();
        std::thread::sleep(Duration::from_millis(100));
    }
    assert_eq!(wait_for(&mut view, "a view after q").code(), Some(0));
}

/// Reads and drops what the terminal shows, for this time.
fn drain(terminal: &mut File, time: Duration) {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let (end, mut part) = (Instant::now() + time, [0; 65_536]);
    loop {
        let left = Timespec::try_from(end.saturating_duration_since(Instant::now())).unwrap();
        if poll(&mut [PollFd::new(&*terminal, PollFlags::IN)], Some(&left)) != Ok(1) {
            return;
        }
        let _ = terminal.read(&mut part).unwrap();
    }
}

/// Runs these lines in the shell and returns the outcome.
fn shell(emulator: &Emulator, lines: &str) -> Outcome {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(lines.as_bytes()).unwrap();
    file.rewind().unwrap();
    finish(emulator.command("shell", &[]).stdin(file))
}

#[test]
fn a_shell_starts_emulators_in_the_background_with_the_options_of_the_line() {
    let emulator = Emulator::stepped();
    let other = format!("{}-other", emulator.name);
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/plants/cs0015.toml");
    let lines = format!(
        "run {plant} -i {other} --clock stepped --detach\nstatus -i {other}\nstop -i {other}\nstop\n\
         run {plant} --clock stepped --detach\nstatus\n"
    );
    let outcome = shell(&emulator, &lines);
    let own = format!("instance '{}' (process ", emulator.name);
    for begin in [format!("instance '{other}' (process "), own] {
        let line = outcome.ok().lines().find(|line| line.starts_with(&begin)).unwrap();
        assert!(line.ends_with("clock stepped"), "{}", outcome.out);
    }
    assert_eq!(outcome.out.matches("panel  cs0015").count(), 2, "{}", outcome.out);
    emulator.run("stop", &[]).ok();
}

#[test]
fn a_shell_runs_lines_from_a_pipe_until_one_fails() {
    let emulator = Emulator::stepped();
    let lines = "# bring-up\npoke node2.w_CPU_CONTROL=handshake\nlet at = wait(\"node2.w_OPTION_STATUS\", 2, \"10ms\");\n\
                 if at > 0 {\n  print(`at ${at}`);\n}\npeek --raw node2.w_OPTION_STATUS\n";
    assert_eq!(shell(&emulator, lines).ok(), "at 500\n16#0002\n");
    for (wrong, expected, exit) in [
        ("peek node2.nothing", "nothing", 2),
        ("expect(\"node2.w_OPTION_STATUS\", 9)", "16#0002", 1),
        ("pek(1)", "peek", 2),
        ("let x = 'a", "", 2),
        ("peak node2.w_OPTION_STATUS", "did you mean peek", 2),
    ] {
        let outcome = shell(&emulator, &format!("\n{wrong}\nprint(\"further\")\n"));
        let message = outcome.fails(exit);
        assert!(message.contains("line 2 failed") && message.contains(expected), "{wrong}: {message}");
    }
    for enough in ["exit", "quit"] {
        assert_eq!(shell(&emulator, &format!("print(1)\n{enough}\nprint(2)\n")).ok(), "1\n");
    }
}
