//! The BAPS by name on the command line, as in `docs/devices/omega-drive-line-2/baps.md`.

use crate::common::{Emulator, run};

/// Writes the command and waits for the answer.
fn command(emulator: &Emulator, pokes: &[&str]) -> String {
    emulator.poke(pokes);
    emulator.run("wait", &["baps.b_COMMAND==16#00", "--within", "2ms"]).ok();
    emulator.peek(&["baps.b_SL_QUIT"])
}

#[test]
fn the_drive_is_configured_enabled_and_moved() {
    let emulator = Emulator::stepped();
    assert_eq!(command(&emulator, &["baps.b_COMMAND=16#01"]), "16#81");
    let configuration = [
        "baps.w_COMMAND_REG=16#0014",
        "baps.a_WR_PAR_NR[0]=300",
        "baps.a_RD_PAR_NR[0]=301",
        "baps.b_COMMAND=16#02",
    ];
    assert_eq!(command(&emulator, &configuration), "16#02");
    for word in ["16#0006", "16#0007", "16#000F"] {
        let control_word = format!("baps.w_CONTROLWORD={word}");
        assert_eq!(
            command(&emulator, &[&control_word, "baps.a_WR_VALUE[0]=1234", "baps.b_COMMAND=16#01"]),
            "16#01"
        );
    }
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["baps.w_STATUSWORD", "baps.a_RD_VALUE[0]"]), "16#0037 16#000004D2");
    let dump = emulator.run("dump", &["baps"]).ok().to_owned();
    for line in ["reference values read, actual values written", "two reference and two (four) actual values"]
    {
        assert!(dump.contains(line), "{line}\n{dump}");
    }
}

#[test]
fn a_parameter_is_read_by_the_semaphore_handshake() {
    let emulator = Emulator::stepped();
    emulator.poke(&["baps.b_JOB=1", "baps.u_PAR_NR=167", "baps.us_PAR_ELEMENT=7", "baps.b_MA_SEMAPHORE=1"]);
    emulator.run("wait", &["baps.b_SL_SEMAPHORE==16#01", "--within", "3ms"]).ok();
    assert_eq!(emulator.peek(&["baps.i_ERR_DETAIL", "baps.ud_PAR_VALUE"]), "16#0000 16#000007D0");
    emulator.poke(&["baps.b_MA_SEMAPHORE=0"]);
    emulator.run("wait", &["baps.b_SL_SEMAPHORE==16#00", "--within", "1ms"]).ok();
}

#[test]
fn the_map_says_that_names_and_offsets_are_inferred() {
    let map = run(&["map", "baps.b_SL_QUIT"]).ok().to_owned();
    for text in ["%MB3.80005", "D-150", "re-initialization active"] {
        assert!(map.contains(text), "{text}\n{map}");
    }
}

#[test]
fn control_and_status_word_are_printed_as_text() {
    let map = run(&["map", "baps.w_COMMAND_REG"]).ok().to_owned();
    assert!(map.contains("4-7   number      n") && !map.contains("{}"), "{map}");
    let emulator = Emulator::stepped();
    let words = |register: &str| emulator.run("peek", &[register]).ok().to_owned();
    command(&emulator, &["baps.w_COMMAND_REG=16#0014", "baps.b_COMMAND=16#02"]);
    command(&emulator, &["baps.w_CONTROLWORD=16#0006", "baps.b_COMMAND=16#01"]);
    emulator.step(&["1ms"]);
    let control = words("baps.w_CONTROLWORD");
    assert!(control.contains("16#0006  enable voltage, no quick stop (D-87)"), "{control}");
    let status = words("baps.w_STATUSWORD");
    assert!(
        status.contains("16#0031  ready to switch on, voltage on, no quick stop (D-87), not synchronized"),
        "{status}"
    );
}
