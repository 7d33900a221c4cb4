//! What a build without the channel can do: read what is mapped, and say what it cannot do.
#![cfg(not(feature = "channel"))]

use crate::common::Emulator;

#[test]
fn registers_are_read_from_the_image() {
    let emulator = Emulator::stepped();
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS", "node1.w_OPTION_STATUS"]), "16#0001 16#0001");
    assert!(emulator.run("dump", &["node2", "--all"]).ok().contains("node2.w_OPTION_STATUS"));
}

#[test]
fn everything_else_says_that_there_is_no_channel() {
    let mut emulator = Emulator::stepped();
    for args in [
        &["poke", "node2.w_CPU_CONTROL=1"][..],
        &["wait", "node2.w_CPU_CONTROL==1"],
        &["step", "1ms"],
        &["watch"],
        &["fault", "list"],
    ] {
        let outcome = emulator.run(args[0], &args[1..]);
        let message = format!(
            "commram: this build of commram has no channel (cargo feature `channel`), which `{}` needs\n",
            args[0]
        );
        assert_eq!(outcome.fails(3), message);
    }
    assert!(emulator.run("poke", &["node2.w_CPU_CONTROL"]).fails(2).contains("write REG=VALUE"));
    // A signal needs no channel.
    emulator.run("stop", &[]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}
