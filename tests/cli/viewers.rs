//! `commram view` and `commram shell` as programs: without a terminal, and from a pipe.
#![cfg(feature = "studio")]

use crate::common::{Emulator, Outcome, finish};
use std::io::{Seek, Write};

#[test]
fn a_view_needs_a_terminal() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("view", &[]);
    assert!(outcome.fails(2).contains("needs a terminal"), "{}", outcome.err);
}

/// What the shell says to these lines from a file.
fn shell(emulator: &Emulator, lines: &str) -> Outcome {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(lines.as_bytes()).unwrap();
    file.rewind().unwrap();
    finish(emulator.command("shell", &[]).stdin(file))
}

#[test]
fn a_shell_does_lines_from_a_pipe_until_one_fails() {
    let emulator = Emulator::stepped();
    let lines = "# bring-up\npoke node2.w_CPU_CONTROL=handshake\nlet at = wait(\"node2.w_OPTION_STATUS\", 2, \"10ms\");\n\
                 if at > 0 {\n  print(`at ${at}`);\n}\npeek --raw node2.w_OPTION_STATUS\n";
    assert_eq!(shell(&emulator, lines).ok(), "at 500\n16#0002\n");
    for (wrong, said, exit) in [
        ("peek node2.nothing", "nothing", 2),
        ("expect(\"node2.w_OPTION_STATUS\", 9)", "16#0002", 1),
        ("pek(1)", "peek", 2),
        ("let x = 'a", "", 2),
    ] {
        let outcome = shell(&emulator, &format!("\n{wrong}\nprint(\"further\")\n"));
        let told = outcome.fails(exit);
        assert!(told.contains("line 2 failed") && told.contains(said), "{wrong}: {told}");
    }
}
