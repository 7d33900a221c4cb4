//! The exported C header and the soft-PLC of `tools/c`, compiled by the installed compilers, with a live emulator.

use crate::common::{Emulator, Outcome, finish, is_there, run};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const SOFT_PLC: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/c/soft_plc.c");
const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];

/// Compiles the soft-PLC with the exported header into `directory`.
fn compile(compiler: &str, flags: &[&str], directory: &Path) -> PathBuf {
    let header = directory.join("commram.h");
    run(&["export", "c", "--output", header.to_str().unwrap()]).ok();
    let program = directory.join("soft_plc");
    let mut command = Command::new(compiler);
    command.args(STRICT).args(flags).arg("-I").arg(directory).arg(SOFT_PLC).arg("-o").arg(&program);
    finish(&mut command).ok();
    program
}

fn image(emulator: &Emulator) -> PathBuf {
    format!("/dev/shm/commram.{}.line", emulator.name).into()
}

fn start(program: &Path, image: &Path) -> Outcome {
    finish(Command::new(program).arg(image).arg("4711"))
}

#[test]
fn a_c_program_brings_up_a_master() {
    let directory = tempfile::tempdir().unwrap();
    let program = compile("cc", &["-std=c11", "-O2"], directory.path());
    let emulator = Emulator::start(&[]);
    let outcome = start(&program, &image(&emulator));
    assert_eq!(
        outcome.ok(),
        "\
w_CPU_CONTROL 16#0000 -> w_OPTION_STATUS 16#0001
w_CPU_CONTROL 16#0001 -> w_OPTION_STATUS 16#0002
w_CPU_CONTROL 16#0002 -> w_OPTION_STATUS 16#0003
w_CPU_CONTROL 16#0020 -> w_OPTION_STATUS 16#0043
w_CPU_CONTROL 16#0040 -> w_OPTION_STATUS 16#0080
a_RD_BMARRAY[1][0] = 4711
"
    );
    assert_eq!(emulator.peek(&["node2.a_RD_BMARRAY[1][0]"]), "16#00001267");
}

#[test]
fn a_cpp_program_brings_up_a_master() {
    if !is_there("c++") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let program = compile("c++", &["-std=c++17", "-O2", "-x", "c++"], directory.path());
    let emulator = Emulator::start(&[]);
    assert!(start(&program, &image(&emulator)).ok().ends_with("a_RD_BMARRAY[1][0] = 4711\n"));
}

/// The header is compiled in every language mode, after system headers that were included without the macros for their
/// full content.
#[test]
fn the_header_compiles_after_any_other() {
    let directory = tempfile::tempdir().unwrap();
    let header = directory.path().join("commram.h");
    run(&["export", "c", "--output", header.to_str().unwrap()]).ok();
    let source = directory.path().join("behind.c");
    let others =
        ["stdio", "stdlib", "string", "time", "fcntl", "unistd", "sys/types", "sys/stat", "sys/mman"];
    let others = others.map(|name| format!("#include <{name}.h>\n")).concat();
    let text =
        format!("{others}#include \"commram.h\"\nint main(void) {{ return commram_now_ms() == 0; }}\n");
    fs::write(&source, text).unwrap();
    let mut modes = ["c99", "c11", "c17", "gnu99", "gnu11", "gnu17"].map(|mode| ("cc", "c", mode)).to_vec();
    if is_there("c++") {
        let standards = ["c++11", "c++14", "c++17", "c++20", "gnu++11"];
        modes.extend(standards.map(|mode| ("c++", "c++", mode)));
    }
    for (compiler, language, mode) in modes {
        let mut command = Command::new(compiler);
        command.args(STRICT).args(["-Wno-unused-function", "-x", language, &format!("-std={mode}")]);
        let outcome = finish(
            command
                .arg("-I")
                .arg(directory.path())
                .arg(&source)
                .arg("-o")
                .arg(directory.path().join("behind")),
        );
        assert_eq!(outcome.code, Some(0), "{mode}: {}", outcome.err);
        assert_eq!(finish(&mut Command::new(directory.path().join("behind"))).code, Some(0), "{mode}");
    }
}

#[test]
fn the_header_of_another_device_compiles_and_asserts_where_registers_lie() {
    let directory = tempfile::tempdir().unwrap();
    let header = directory.path().join("commram.h");
    run(&["export", "c", "--device", "bm4-plc", "--output", header.to_str().unwrap()]).ok();
    let source = directory.path().join("empty.c");
    fs::write(&source, "#include \"commram.h\"\n_Static_assert(COMMRAM_SLOTM == 7001792u, \"slot M\");\n")
        .unwrap();
    finish(
        Command::new("cc")
            .args(STRICT)
            .args(["-std=c11", "-Wno-unused-function", "-fsyntax-only"])
            .arg(&source),
    )
    .ok();
}

/// Attaches to images with mistakes.
#[test]
fn an_invalid_image_is_refused_with_its_mistake() {
    let directory = tempfile::tempdir().unwrap();
    let program = compile("cc", &["-std=c11"], directory.path());
    let emulator = Emulator::stepped();
    let good = fs::read(image(&emulator)).unwrap();
    let path = directory.path().join("image");
    let refused = |bytes: &[u8], why: &str| {
        fs::write(&path, bytes).unwrap();
        let outcome = start(&program, &path);
        assert_eq!((outcome.code, outcome.err), (Some(2), format!("{}: {why}\n", path.display())));
    };
    let changed = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 0xFF;
        bytes
    };
    refused(&good[..20], "the image is too short");
    refused(&good[..4096], "the image is too short");
    refused(&changed(0), "the file is no image of a communication RAM");
    refused(
        &changed(8),
        "the image has ABI version 252, this program was built for 3: build it with the header that `commram export c` of \
         that emulator's version writes",
    );
    let map = u64::from_le_bytes(good[16..24].try_into().unwrap());
    // A program accepts the map of the image, or the map without option cards (`base_layout_hash`).
    let mut other_map = changed(16);
    other_map[776] ^= 0xFF;
    refused(
        &other_map,
        &format!(
            "the image has register map 16#{:016X}, this program was built for 16#{map:016X}: build it with the header \
             that `commram export c` writes for that device",
            map ^ 0xFF
        ),
    );
    refused(&changed(48), "the emulator is gone");
    // State 1, then 4.
    let mut state = good.clone();
    state[32] = 1;
    refused(&state, "the emulator is not ready yet");
    state[32] = 4;
    refused(&state, "the emulator is gone");
    let nothing = start(&program, Path::new("/dev/shm"));
    assert!(
        nothing.err.ends_with("there is no image of that name\n") && nothing.code == Some(2),
        "{nothing:?}"
    );
}

/// At this speed of the clock, the drive needs minutes to lock. The program waits for the drive until the emulator is
/// killed.
#[test]
fn a_c_program_notices_that_the_emulator_was_killed() {
    let directory = tempfile::tempdir().unwrap();
    let program = compile("cc", &["-std=c11"], directory.path());
    let mut emulator = Emulator::start(&["--speed", "0.01"]);
    let mut command = Command::new(&program);
    command.arg(image(&emulator)).arg("1");
    let waiting = std::thread::spawn(move || finish(&mut command));
    assert!(crate::common::eventually(|| emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0043"));
    emulator.kill();
    let outcome = waiting.join().unwrap();
    assert_eq!(
        (outcome.code, outcome.err.as_str()),
        (Some(1), "a_STAT_SL[1]: the emulator is gone (16#0000)\n")
    );
}
