//! The exported matiec glue with a program in the form that matiec generates.
//!
//! matiec itself is in no package registry. `tests/matiec` therefore has what it would make of `program.st`, and
//! stand-ins for the two files of its runtime library that such a program includes.

use crate::common::{Emulator, Outcome, finish, run};
use std::fs;
use std::path::Path;
use std::process::Command;

const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/matiec");

/// Compiles one file of `tests/matiec`; headers in `directory` go before those beside the source.
fn compile(directory: &Path, file: &str, flags: &[&str]) -> Outcome {
    let glue = directory.join("commram_matiec.h");
    run(&["export", "matiec", "--output", glue.to_str().unwrap()]).ok();
    // As the located variables of a test must win, its sources stand beside them.
    for name in ["accessor.h", "iec_std_lib.h", "program.h", file] {
        fs::copy(Path::new(SOURCES).join(name), directory.join(name)).unwrap();
    }
    let located = directory.join("LOCATED_VARIABLES.h");
    if !located.exists() {
        fs::copy(Path::new(SOURCES).join("LOCATED_VARIABLES.h"), located).unwrap();
    }
    let mut command = Command::new("cc");
    command.current_dir(directory).args(["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror"]);
    finish(command.args(flags).args(["-c", file]))
}

const ACCESS: [&str; 3] = ["-DCOMMRAM_MATIEC_ACCESS", "-include", "commram_matiec.h"];

#[test]
fn located_variables_are_the_registers() {
    let directory = tempfile::tempdir().unwrap();
    compile(directory.path(), "runtime.c", &ACCESS).ok();
    compile(directory.path(), "program.c", &ACCESS).ok();
    let mut link = Command::new("cc");
    finish(link.current_dir(directory.path()).args(["-o", "plc", "runtime.o", "program.o"])).ok();
    let emulator = Emulator::start(&[]);
    let image = format!("/dev/shm/commram.{}.line", emulator.name);
    let outcome = finish(Command::new(directory.path().join("plc")).arg(&image));
    // The initial values have not reached the registers; 16#0001 became 16#0002 by the two commands.
    assert_eq!(
        outcome.ok(),
        "initial values: AA 4711\nregisters: 00 0\nstatus 0002, lamp 1, cycles counted 1\ndetached: 0000\n"
    );
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS", "node2.a_WR_VALUE[0]"]), "16#0002 16#00000000");
    drop(emulator);
    let gone = finish(Command::new(directory.path().join("plc")).arg(&image));
    assert_eq!((gone.code, gone.err), (Some(2), format!("{image}: there is no image of that name\n")));
}

#[test]
fn addresses_that_are_no_registers_are_refused_by_the_compiler() {
    for (located, why) in [
        ("WORD,__MW3_200001,M,W,3,200001", "__MW3_200001: the address is not divisible by the width"),
        ("WORD,__MW3_200012,M,W,3,200012", "__MW3_200012: the register there has another width"),
        ("BYTE,__MB3_200000,M,B,3,200000", "__MB3_200000: the register there has another width"),
        ("WORD,__MB3_200012,M,B,3,200012", "__MB3_200012: the type has another width than the address"),
        ("WORD,__MW3_128,M,W,3,128", "__MW3_128: the address lies in no area of the device"),
        ("BOOL,__MX3_200012_7,M,X,3,200012,7", "__MX3_200012_7: a single bit has no address of its own"),
    ] {
        let directory = tempfile::tempdir().unwrap();
        let located = format!("__LOCATED_VAR({located})\n");
        fs::write(directory.path().join("LOCATED_VARIABLES.h"), located).unwrap();
        let glue = "#include \"iec_std_lib.h\"\n#include \"commram_matiec.h\"\nCOMMRAM_MATIEC_STORAGE\n\
                    #include \"LOCATED_VARIABLES.h\"\n";
        fs::write(directory.path().join("located.c"), glue).unwrap();
        let refused = compile_own(directory.path(), "located.c");
        assert!(refused.code != Some(0) && refused.err.contains(why), "{why}: {}", refused.err);
    }
}

/// As [`compile`], for a source that the test has written itself.
fn compile_own(directory: &Path, file: &str) -> Outcome {
    let source = fs::read(directory.join(file)).unwrap();
    let prepared = compile(directory, "program.c", &["-fsyntax-only"]);
    prepared.ok();
    fs::write(directory.join(file), source).unwrap();
    let mut command = Command::new("cc");
    finish(command.current_dir(directory).args(["-std=gnu11", "-Wall", "-Wextra", "-c", file]))
}
