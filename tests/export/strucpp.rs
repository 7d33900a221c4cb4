//! The exports for STruC++, the compiler of OpenPLC 4, with a program in the form that STruC++ generates.
//!
//! STruC++ is in no package registry. `tests/strucpp` therefore has its output for one program, and stubs of the headers of
//! its runtime library. If `COMMRAM_STRUCPP` names its directory, the tests follow `docs/guide/openplc-4.md` word by word.

use crate::common::{Emulator, Outcome, devices, eventually, finish, is_there, run, skipped};
use crate::matiec::Plc;
use crate::openplc::{ARRIVED, block, type_in};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const STUBS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/strucpp");
const PAGE: &str = "guide/openplc-4.md";

/// Exports header and runner, and compiles the stub program in which `from` is replaced by `to`.
fn compile(directory: &Path, from: &str, to: &str) -> Outcome {
    let export = |args: &[&str], name: &str| {
        let path = directory.join(name);
        run(&[&["export", "strucpp"], args, &["--output", path.to_str().unwrap()]].concat()).ok();
    };
    export(&[], "commram_strucpp.h");
    export(&["--main"], "main.cpp");
    let program = fs::read_to_string(Path::new(STUBS).join("program.cpp")).unwrap();
    assert!(program.contains(from));
    fs::write(directory.join("program.cpp"), program.replace(from, to)).unwrap();
    let flags = format!("-std=c++17 -O1 -Wall -Wextra -Werror -Wno-invalid-offsetof -I {STUBS}");
    let mut command = Command::new("c++");
    command.current_dir(directory).args(flags.split(' ')).args(["-include", "commram_strucpp.h"]);
    finish(command.args(["main.cpp", "program.cpp", "-o", "plc"]))
}

#[test]
fn global_variables_of_strucpp_are_the_registers() {
    if !is_there("c++") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    compile(directory.path(), "", "").ok();
    let emulator = Emulator::stepped();
    let plc = Plc::start_at(&directory.path().join("plc"), &emulator, "line", &["0", "40"]);
    assert!(eventually(|| emulator.run("board", &["get"]).ok().contains("cyclic")));
    let after_scan = || {
        emulator.step(&["2ms"]);
        emulator.peek(&["%MB10000001", "%MB10000002"])
    };
    emulator.poke(&["%MB100=16#55"]);
    // A variable that begins with 5, and one that begins with 3 and is declared RETAIN; each scan increments both.
    assert_eq!(after_scan(), "16#06 16#04");
    assert_eq!(
        emulator.peek(&["node2.b_AC", "%MB100"]),
        "16#FE 16#5D",
        "one bit of a flag, by its second spelling a register"
    );
    assert_eq!(after_scan(), "16#07 16#05");
    for (start, found) in [("hot", "16#08 16#06"), ("warm", "16#06 16#07"), ("cold", "16#06 16#04")] {
        emulator.run("board", &["set", &format!("line:start={start}")]).ok();
        assert_eq!(after_scan(), found, "{start}");
    }
    assert!(eventually(|| {
        emulator.step(&["10ms"]);
        emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0002"
    }));
    assert_eq!(plc.end(), Some(0));
}

#[test]
fn addresses_that_are_no_registers_are_refused_at_the_start() {
    if !is_there("c++") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    for (from, to, why) in [
        ("Word, 3, 200002", "Word, 3, 200001", "%MW3.200001: the address is not divisible by the width"),
        ("Word, 3, 200002", "Word, 3, 200012", "%MW3.200012: the register there has another width"),
        ("Word, 3, 200002", "Word, 3, 128", "%MW3.128: the address is not in any area of the device"),
        ("STATUS.value.raw_ptr()", "nullptr", "%MW3.200002: a register needs a variable in VAR_GLOBAL"),
    ] {
        compile(directory.path(), from, to).ok();
        let refused = finish(Command::new(directory.path().join("plc")).arg("/dev/shm/commram.none.line"));
        assert!(refused.code == Some(2) && refused.err.contains(why), "{why}: {}", refused.err);
    }
}

#[test]
fn declarations_for_strucpp_have_each_address_once() {
    for device in devices() {
        let export = run(&["export", "st", "--strucpp", "--device", device]);
        let text = export.ok();
        assert!(!text.contains('{') && text.contains("\nCONFIGURATION Config0\nVAR_GLOBAL\n"), "{device}");
        let mut addresses = text.lines().filter_map(|line| line.split_once(" AT ")).map(|(_, rest)| {
            let address = rest.split(' ').next().unwrap();
            assert!(address.matches('.').count() <= 1, "{device}: {address}");
            address
        });
        let mut seen = std::collections::BTreeSet::new();
        assert!(addresses.all(|address| seen.insert(address)), "{device}");
    }
}

#[test]
fn the_page_on_openplc_4_works_with_strucpp() {
    let Some(strucpp) = std::env::var_os("COMMRAM_STRUCPP").map(PathBuf::from) else {
        skipped("strucpp", "COMMRAM_STRUCPP names no directory with strucpp and runtime/include");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    std::os::unix::fs::symlink(strucpp, directory.join("strucpp")).unwrap();
    fs::write(directory.join("program.st"), block(PAGE, "## The program")).unwrap();
    type_in(&block(PAGE, "## Build and run"), directory);
    let emulator = Emulator::start(&[]);
    let plc = Plc::start_at(&directory.join("plc"), &emulator, "line", &[]);
    assert!(eventually(|| emulator.peek(&["node2.a_RD_BMARRAY[1][0]"]) == ARRIVED));
    assert_eq!(plc.end(), Some(0));
    drop(emulator);
    // In lockstep, the program that ran in real time above meets every deadline.
    let emulator = Emulator::stepped();
    let _plc = Plc::start_at(&directory.join("plc"), &emulator, "line", &["0", "40"]);
    assert!(eventually(|| {
        emulator.step(&["100ms"]);
        emulator.peek(&["node2.a_RD_BMARRAY[1][0]"]) == ARRIVED
    }));
    assert!(emulator.run("check", &[]).ok().contains("no violations"));
}
