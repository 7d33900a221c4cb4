//! Programs of another version at today's emulator, and today's programs at an emulator that shows another version:
//! each of them ends with a clear message and an exit code, and none hangs.
#![cfg(feature = "channel")]

use crate::common::{Emulator, Outcome, finish, promised, python, run};
use commram::memory::header::ABI_VERSION;
use std::fs;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Offsets in the header page.
const VERSION: u64 = 8;
const LAYOUT_HASH: u64 = 16;

/// Commands that need the image or the channel, with their arguments.
const COMMANDS: [(&str, &[&str]); 15] = [
    ("status", &[]),
    ("peek", &["node2.w_OPTION_STATUS"]),
    ("poke", &["node2.w_CPU_CONTROL=1"]),
    ("wait", &["node2.w_OPTION_STATUS==2", "--within", "1s"]),
    ("step", &["1ms"]),
    ("watch", &["node2.w_OPTION_STATUS"]),
    ("trace", &[]),
    ("check", &[]),
    ("dump", &["node2"]),
    ("force", &["node2.w_CPU_CONTROL=1"]),
    ("bus", &["list"]),
    ("drive", &["list"]),
    ("fault", &["list"]),
    ("find", &["w_CPU"]),
    ("map", &["node2"]),
];

fn image(emulator: &Emulator) -> PathBuf {
    format!("/dev/shm/commram.{}.line", emulator.name).into()
}

fn write(image: &Path, at: u64, bytes: &[u8]) {
    fs::File::options().write(true).open(image).unwrap().write_all_at(bytes, at).unwrap();
}

/// Changes the header page of a running emulator: each command refuses with these words, and `stop` still ends the emulator.
fn shows(at: u64, bytes: &[u8], words: &[&str]) {
    let mut emulator = Emulator::stepped();
    write(&image(&emulator), at, bytes);
    for (command, args) in COMMANDS {
        let outcome = promised(Duration::from_secs(1), || emulator.run(command, args));
        let text = outcome.fails(3);
        assert!(words.iter().all(|word| text.contains(word)), "{command}: {text}");
    }
    let outcome = promised(Duration::from_secs(2), || emulator.run("stop", &[]));
    assert_eq!(
        (outcome.code, outcome.out),
        (Some(0), format!("instance '{}' has stopped\n", emulator.name)),
        "{}",
        outcome.err
    );
    assert_eq!(emulator.wait().code(), Some(0));
    assert!(emulator.files().is_empty());
}

#[test]
fn commands_refuse_an_emulator_of_another_abi_version() {
    for version in [ABI_VERSION - 1, ABI_VERSION + 1] {
        let words = format!(
            "has ABI version {version}, this program knows {ABI_VERSION}; use programs of one commram version"
        );
        shows(VERSION, &version.to_le_bytes(), &[&words]);
    }
}

#[test]
fn commands_refuse_an_emulator_with_unknown_registers() {
    shows(LAYOUT_HASH, &7_u64.to_le_bytes(), &["16#0000000000000007"]);
}

#[test]
fn list_shows_the_different_version_of_an_emulator() {
    let emulator = Emulator::stepped();
    write(&image(&emulator), VERSION, &(ABI_VERSION + 1).to_le_bytes());
    let listed = run(&["list"]);
    let words = format!("has ABI version {}, this program knows {ABI_VERSION}", ABI_VERSION + 1);
    assert!(listed.code == Some(0) && listed.out.contains(&words), "{listed:?}");
    // Restores the version, because the end of the test needs a usable image.
    write(&image(&emulator), VERSION, &ABI_VERSION.to_le_bytes());
}

/// Compiles the soft-PLC with an exported header in which one constant has the value of another version.
fn c_client(directory: &Path, define: &str, value: &str) -> PathBuf {
    let header = directory.join("commram.h");
    run(&["export", "c", "--output", header.to_str().unwrap()]).ok();
    let text = fs::read_to_string(&header).unwrap();
    let changed: Vec<String> = text
        .lines()
        .map(|line| match line.starts_with(&format!("#define {define} ")) {
            true => format!("#define {define} {value}"),
            false => line.to_owned(),
        })
        .collect();
    assert_ne!(changed.join("\n"), text.trim_end());
    fs::write(&header, changed.join("\n") + "\n").unwrap();
    let program = directory.join("soft_plc");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/c/soft_plc.c");
    finish(Command::new("cc").args(["-std=c11", "-I"]).arg(directory).arg(source).arg("-o").arg(&program))
        .ok();
    program
}

#[test]
fn a_c_program_of_another_version_learns_both_versions() {
    let directory = tempfile::tempdir().unwrap();
    let emulator = Emulator::stepped();
    let refused = |program: &Path, words: &str| {
        let image = image(&emulator);
        let outcome =
            promised(Duration::from_secs(1), || finish(Command::new(program).arg(&image).arg("4711")));
        assert_eq!((outcome.code, outcome.err), (Some(2), format!("{}: {words}\n", image.display())));
    };
    for version in [ABI_VERSION - 1, ABI_VERSION + 1] {
        let program = c_client(directory.path(), "COMMRAM_ABI_VERSION", &format!("{version}u"));
        let words = format!(
            "the image has ABI version {ABI_VERSION}, this program was built for {version}: build it with the header that \
             `commram export c` of that emulator's version writes"
        );
        refused(&program, &words);
    }
    let program = c_client(directory.path(), "COMMRAM_LAYOUT_HASH", "UINT64_C(0x7)");
    let map = commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
    let words = format!(
        "the image has register map 16#{map:016X}, this program was built for 16#0000000000000007: build it with the \
         header that `commram export c` writes for that device"
    );
    refused(&program, &words);
}

/// Runs a program that attaches by the exported module, in which one constant has the value of another version.
fn python_client(interpreter: &Path, emulator: &Emulator, constant: &str, value: &str) -> Outcome {
    let directory = tempfile::tempdir().unwrap();
    let module = directory.path().join("commram.py");
    run(&["export", "python", "--output", module.to_str().unwrap()]).ok();
    let text = fs::read_to_string(&module).unwrap();
    let line = text.lines().find(|line| line.starts_with(&format!("{constant} = "))).unwrap();
    fs::write(&module, text.replacen(line, &format!("{constant} = {value}"), 1)).unwrap();
    let program = "import commram, sys\ntry:\n    commram.attach(sys.argv[1], 'line')\nexcept commram.NotAttached as error:\n    sys.exit(str(error))\n";
    let mut command = Command::new(interpreter);
    command.args(["-c", program, &emulator.name]).env("PYTHONPATH", directory.path());
    promised(Duration::from_secs(2), || finish(command.env("PYTHONDONTWRITEBYTECODE", "1")))
}

#[test]
fn a_python_program_of_another_version_learns_both_versions() {
    let Some(interpreter) = python(&[]) else { return };
    let interpreter = Path::new(interpreter.get_program());
    let emulator = Emulator::stepped();
    let path = image(&emulator);
    for version in [ABI_VERSION - 1, ABI_VERSION + 1] {
        let outcome = python_client(interpreter, &emulator, "ABI_VERSION", &version.to_string());
        let words = format!(
            "{}: the image has ABI version {ABI_VERSION}, this module knows {version}; write it with `commram export python` \
             of that emulator's version\n",
            path.display()
        );
        assert_eq!((outcome.code, outcome.err), (Some(1), words));
    }
    let outcome = python_client(interpreter, &emulator, "LAYOUT_HASH", "7");
    assert!(
        outcome.code == Some(1) && outcome.err.contains("this module knows 16#0000000000000007"),
        "{outcome:?}"
    );
}

/// `run --from` with snapshots of other formats. Their checksums are valid, so only the format is wrong.
#[test]
fn a_snapshot_of_another_format_is_refused_by_its_versions() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("plant.snapshot");
    for (format, version) in [(1_u16, "0.0.1"), (2, "0.0.9"), (3, "0.1.0"), (5, "0.2.0")] {
        let mut bytes = b"cmrmsnap".to_vec();
        bytes.extend(format.to_le_bytes());
        bytes.push(version.len() as u8);
        bytes.extend(version.bytes());
        bytes.extend([7; 40]);
        fs::write(&file, commram::snapshot_fields::seal(bytes)).unwrap();
        let outcome = run(&[
            "run",
            "--from",
            file.to_str().unwrap(),
            "--clock",
            "stepped",
            "-i",
            &crate::common::unique_name(),
        ]);
        let words = format!(
            "it was made by commram {version} (format {format}), this is commram {} (format 8); use that version",
            env!("CARGO_PKG_VERSION")
        );
        assert!(outcome.fails(2).contains(&words), "{}", outcome.err);
    }
}

/// The emulator keeps the file for the version that wrote it, and refuses to start instead of starting in delivery
/// state.
#[test]
fn an_emulator_does_not_start_on_a_novram_file_of_another_version() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("line.novram");
    for version in [1_u32, 3] {
        let mut bytes = b"commramN".to_vec();
        bytes.extend(version.to_le_bytes());
        bytes.extend([0; 64]);
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        fs::write(&file, &bytes).unwrap();
        let name = crate::common::unique_name();
        let outcome =
            run(&["run", "--clock", "stepped", "--novram", directory.path().to_str().unwrap(), "-i", &name]);
        let words = format!(
            "the file has version {version}, this commram ({}) reads version 2; use ",
            env!("CARGO_PKG_VERSION")
        );
        assert!(outcome.fails(1).contains(&words), "{}", outcome.err);
        assert_eq!(fs::read(&file).unwrap(), bytes);
        assert!(crate::common::files_of(&name).is_empty());
    }
}
