//! `SERIAL_3964R` in Structured Text, compiled by matiec, and in Rust: each is the other one's partner on a serial line.

use super::PATIENCE;
use crate::common::{Emulator, run, skipped};
use crate::matiec::{Plc, SOURCES, compile_program, exported};
use commram::devices::omega_drive_line_2::blocks::{
    INTR_SET, Ram, SERIAL_3964R, SERIAL_BMARRAY, SERIAL_OCTETS,
};
use commram::devices::omega_drive_line_2::registers::values::{serial_control, serial_parity};
use commram::devices::omega_drive_line_2::registers::{LAYOUT_HASH, SERIAL, SERIAL_BMSTRUCT};
use commram::memory::{AttachMode, Image, MemoryError};
use std::fs;
use std::path::PathBuf;
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
) -> Result<Vec<Vec<u8>>, MemoryError> {
    let attached = Image::attach(instance, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
    let ram = Ram::of(attached.segment())?;
    let mut task = attached.join_lockstep(0, PATIENCE, PATIENCE)?;
    let mut event = INTR_SET { i_PAR1: 20, x_EN: true, ..Default::default() };
    attached.wait_until("INTR_SET", PATIENCE, |_| {
        event.call(&ram);
        attached.ring().ok()?;
        event.is_answered().then_some(())
    })?;
    let base = ram.at::<SERIAL_BMSTRUCT>(SERIAL)?;
    base.u_BAUD_RATE.store(38_400);
    base.us_DATA_BITS.store(8);
    base.b_PARITY.store(serial_parity::EVEN);
    base.us_STOP_BITS.store(1);
    base.us_WIRES.store(4);
    base.w_CONTROL.store(serial_control::ON);
    ready.send(()).unwrap();
    let mut block = SERIAL_3964R { x_EN: true, x_HIGH: true, ..Default::default() };
    let (mut send, mut received): (Box<SERIAL_BMARRAY>, Box<SERIAL_BMARRAY>) =
        (Box::new([0; SERIAL_OCTETS]), Box::new([0; SERIAL_OCTETS]));
    let (mut left, mut sent, mut back) = (blocks().into_iter(), 0, Vec::new());
    while task.next_event(PATIENCE).is_ok() {
        if block.x_SEND {
            block.x_SEND = false;
        } else if !block.x_BUSY
            && back.len() == sent
            && let Some(octets) = left.next()
        {
            send[..octets.len()].copy_from_slice(&octets);
            (block.u_SEND, block.x_SEND) = (octets.len() as u16, true);
            sent += 1;
        }
        block.x_TAKEN = block.x_RECEIVED;
        block.call(&base, &send, &mut received);
        if block.x_RECEIVED {
            back.push(received[..usize::from(block.u_RECEIVED)].to_vec());
            count.store(back.len(), Ordering::Release);
        }
        attached.ring()?;
    }
    Ok(back)
}

#[test]
fn partners_in_rust_and_structured_text_exchange_blocks() {
    let Some(matiec) = std::env::var_os("COMMRAM_MATIEC").map(PathBuf::from) else {
        skipped("matiec", "COMMRAM_MATIEC names no directory with iec2c and lib");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    exported(directory);
    let file = directory.join("commram.st");
    run(&["export", "st", "--blocks", "--output", file.to_str().unwrap()]).ok();
    fs::copy(PathBuf::from(SOURCES).join("serial.st"), directory.join("program.st")).unwrap();
    compile_program(&matiec, directory, "-O2");

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
        thread::spawn(move || partner(&instance, &ready, &count))
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
