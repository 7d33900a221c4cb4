//! The blocks of the RS485 port in Structured Text, compiled by matiec. `SERIAL_3964R` in Rust is the partner of
//! `SERIAL_3964R` in Structured Text, and `SERIAL_USS` drives slaves of the plant.

use super::PATIENCE;
use crate::common::{Emulator, run, skipped};
use crate::matiec::{Plc, SOURCES, compile_program, exported};
use crate::serial_partner::{Partner, port_of, start_timer};
use commram::devices::omega_drive_line_2::blocks::SERIAL_OCTETS;
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use commram::memory::{AttachMode, Image, MemoryError};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;

/// The Rust program runs on PLC `line`, the program in Structured Text on PLC `station`.
const PLANT: &str = "\
[[plc]]
name = 'line'
serial = 'rs485'
[[plc]]
name = 'station'
serial = 'rs485'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 4
baud_rate = 38400
terminators = 2
";

/// Blocks with all octets, the control characters, and the longest length.
fn blocks() -> Vec<Vec<u8>> {
    let all: Vec<u8> = (0..=255).collect();
    let longest = all.iter().copied().cycle().take(SERIAL_OCTETS).collect();
    vec![vec![0x41], vec![0x10], vec![0x02, 0x03, 0x10, 0x10, 0x15, 0x10], vec![0; 5], all, longest]
}

/// Sends the blocks and returns the blocks that came back. `count` is their number so far.
fn partner(
    instance: &str,
    ready: &mpsc::Sender<()>,
    count: &AtomicUsize,
    has_check_sum: bool,
) -> Result<Vec<Vec<u8>>, MemoryError> {
    let attached = Image::attach(instance, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
    let mut task = attached.join_lockstep(0, PATIENCE, PATIENCE)?;
    start_timer(&attached)?;
    let port = port_of(&attached, 4)?;
    ready.send(()).unwrap();
    let mut partner = Partner::new(blocks(), has_check_sum);
    while task.next_event(PATIENCE).is_ok() {
        partner.call(&port);
        count.store(partner.back.len(), Ordering::Release);
        attached.ring()?;
    }
    Ok(partner.back)
}

/// The program in Structured Text is the master of two drives.
const DRIVES: &str = "\
[[plc]]
name = 'station'
serial = 'rs485'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 2
baud_rate = 38400
[[bus.drive]]
name = 'pump'
address = 3
pzd_words = 3
parameters = [{ number = 2400, format = 'word', initial = 7, max = 100 }, { number = 450, format = 'word' }]
[[bus.drive]]
name = 'store'
address = 4
pzd_words = 3
parameters = [
    { number = 402, format = 'doubleword' },
    { number = 403, format = 'doubleword' },
    { number = 404, format = 'doubleword' },
    { number = 405, format = 'doubleword' },
    { number = 406, format = 'doubleword' },
    { number = 407, format = 'doubleword' },
    { number = 408, format = 'doubleword' },
    { number = 450, format = 'word' },
]
";

/// Compiles a program of `tests/matiec`, with the pins `more` of its first block, together with the function blocks.
pub(crate) fn compiled(matiec: &Path, directory: &Path, program: &str, more: &str) {
    exported(directory);
    let file = directory.join("commram.st");
    run(&["export", "st", "--blocks", "--output", file.to_str().unwrap()]).ok();
    let source = fs::read_to_string(PathBuf::from(SOURCES).join(program)).unwrap();
    let source = source.replacen("x_EN := TRUE,", &format!("x_EN := TRUE,{more}"), 1);
    fs::write(directory.join("program.st"), source).unwrap();
    compile_program(matiec, directory, "-O2");
}

/// Returns the value of a parameter of a drive.
fn parameter(emulator: &Emulator, drive: &str, number: u64) -> i64 {
    let shown = emulator.run("drive", &["show", drive, "--format", "json"]).ok().to_owned();
    let shown: Value = serde_json::from_str(&shown).unwrap();
    let parameters = shown[0]["parameters"].as_array().or_else(|| shown["parameters"].as_array()).unwrap();
    let found = parameters.iter().find(|it| it["number"] == number);
    found.unwrap_or_else(|| panic!("{number}: {shown}"))["value"].as_i64().unwrap()
}

/// Each result is the value, the code of the answer from bit 20 on, the error from bit 24 on, and bit 31: done.
#[test]
fn a_master_in_structured_text_drives_slaves_by_uss() {
    let Some(matiec) = std::env::var_os("COMMRAM_MATIEC").map(PathBuf::from) else {
        skipped("matiec", "COMMRAM_MATIEC names no directory with iec2c and lib");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    compiled(&matiec, directory, "serial_uss.st", "");
    let plant = directory.join("plant.toml");
    fs::write(&plant, DRIVES).unwrap();
    let mut emulator = Emulator::start(&["--clock", "stepped", plant.to_str().unwrap()]);
    // The lost character makes one exchange fail, and the master repeats the request.
    emulator.run("fault", &["add", "lose_character", "bus=rs485", "sender=partner", "at=1s", "count=1"]).ok();
    let plc = Plc::start_at(&directory.join("plc"), &emulator, "station", &["0", "20"]);
    for _ in 0..50 {
        emulator.step(&["100ms"]);
        if parameter(&emulator, "store", 408) != 0 {
            break;
        }
    }
    let stored = [402, 403, 404, 405, 406, 407, 408].map(|number| parameter(&emulator, "store", number));
    let done = |code: i64, value: i64| 0x8000_0000 | code << 20 | value;
    let expected = [
        done(1, 7),        // the value of P2400
        done(7, 2),        // 101 is outside the limits of P2400
        done(0, 0),        // the mirror telegram has returned
        done(0, 0),        // the broadcast was sent
        0x0100_0000,       // 9 is no slave
        done(3, 100),      // the upper limit of P2400
        done(2, 0x1_2345), // the actual speed
    ];
    assert_eq!(stored, expected, "{}", emulator.run("trace", &["--last", "40"]).out);
    assert_eq!([parameter(&emulator, "pump", 450), parameter(&emulator, "store", 450)], [77; 2]);
    assert_eq!(plc.end(), Some(0));
    emulator.run("stop", &[]).ok();
    emulator.wait();
}

#[test]
fn partners_in_rust_and_structured_text_exchange_blocks() {
    exchange(true);
}

#[test]
fn partners_exchange_blocks_without_check_sum() {
    exchange(false);
}

fn exchange(has_check_sum: bool) {
    let Some(matiec) = std::env::var_os("COMMRAM_MATIEC").map(PathBuf::from) else {
        skipped("matiec", "COMMRAM_MATIEC names no directory with iec2c and lib");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    compiled(
        &matiec,
        directory,
        "serial.st",
        if has_check_sum { " x_BCC := NOT HAS_RUN," } else { " x_BCC := HAS_RUN," },
    );

    let plant = directory.join("plant.toml");
    fs::write(&plant, PLANT).unwrap();
    let mut emulator = Emulator::start(&["--clock", "stepped", plant.to_str().unwrap()]);
    // The octet is in a block and is also NAK. The receiver notices the change by the parity, so blocks are repeated.
    let words = ["add", "garble_character", "bus=rs485", "octet=16#15", "count=4"];
    emulator.run("fault", &words).ok();
    let count = Arc::new(AtomicUsize::new(0));
    let (ready, is_ready) = mpsc::channel();
    let program = {
        let (instance, count) = (emulator.name.clone(), Arc::clone(&count));
        thread::spawn(move || partner(&instance, &ready, &count, has_check_sum))
    };
    is_ready.recv_timeout(PATIENCE).unwrap();
    let plc = Plc::start_at(&directory.join("plc"), &emulator, "station", &["0", "20"]);
    // The blocks with their repetitions take three seconds.
    for _ in 0..100 {
        if count.load(Ordering::Acquire) == blocks().len() {
            break;
        }
        emulator.step(&["100ms"]);
    }
    let trace = emulator.run("trace", &[]).ok().to_owned();
    assert_eq!(plc.end(), Some(0));
    emulator.run("stop", &[]).ok();
    emulator.wait();
    assert_eq!(program.join().unwrap().unwrap(), blocks(), "{trace}");
    assert_eq!(trace.matches("garbled character").count(), 4, "{trace}");
}
