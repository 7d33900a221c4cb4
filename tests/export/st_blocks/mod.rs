//! Function blocks in Structured Text: the documented pins, and only existing registers. With matiec, also the same
//! behaviour as the Rust blocks.

mod pins;
mod program;
pub(crate) mod serial;

use crate::common::{Emulator, eventually, run, skipped};
use crate::matiec::{Plc, compile_program, exported};
use commram::devices::omega_drive_line_2::blocks::{INTR_SET, Ram};
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use commram::memory::{AttachMode, Image, MemoryError};
use program::Main;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

/// PLC `line` is the master of a bus, PLC `station` its slave 4, a drive its slave 1.
const PLANT: &str = "\
[[plc]]
name = 'line'
node2 = 'drives'
[plc.drive]
lock_time_us = 50000
[[plc]]
name = 'station'
dip = 4
node1 = 'drives'
lock_time_us = 30000
[[bus]]
name = 'drives'
[[bus.drive]]
name = 'drive1'
slave_number = 1
lock_time_us = 30000
[[bus.drive.parameters]]
number = 1000
format = 'word'
initial = 100
min = 0
max = 500
";
const PLCS: [&str; 2] = ["line", "station"];
/// Every answer arrives within this time, even on a slow machine.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

fn emulator(directory: &Path) -> Emulator {
    let plant = directory.join("plant.toml");
    fs::write(&plant, PLANT).unwrap();
    let emulator = Emulator::start(&["--clock", "stepped", plant.to_str().unwrap()]);
    // The first attempt to initialize the master has an invalid bit timing. The drive's SYNC slot keeps its value.
    emulator.breaks(&["baps-sync-slot", "init-baud-rate"]);
    emulator
}

/// Runs the two programs. Returns the sums over the blocks' outputs, and the journal.
fn played(emulator: &Emulator) -> (Vec<String>, String) {
    emulator.poke(&["station:%MB10000036=1"]);
    // The clock advances in short steps, so that the client does not time out on a slow machine.
    for _ in 0..30 {
        emulator.step(&["100ms"]);
    }
    let sums = PLCS.map(|plc| {
        let flags = (0..9).map(|number| format!("{plc}:%MD{}", 10_000_000 + 4 * number));
        emulator.peek(&flags.collect::<Vec<_>>().iter().map(String::as_str).collect::<Vec<_>>())
    });
    let trace = emulator.run("trace", &[]);
    // The start times of the programs depend on the machine. If both have their turn at the same time, the order of
    // their requests depends on it, too, because the board processes a request at once.
    let asked = |line: &&str| line.contains("  event ") || line.contains("OPT_INIT");
    let lines = trace.ok().lines().filter(|line| !line.contains("0.000000 s") && !asked(line));
    (sums.to_vec(), lines.collect::<Vec<_>>().join("\n"))
}

/// Runs the Rust blocks in lockstep with event 0 until the emulator ends. Returns the final state of the program.
fn rust_program(instance: &str, plc: &str, ready: &mpsc::Sender<()>) -> Result<Main, MemoryError> {
    let attached = Image::attach(instance, plc, AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
    let ram = Ram::of(attached.segment())?;
    let mut task = attached.join_lockstep(0, PATIENCE, PATIENCE)?;
    let mut event = INTR_SET { i_PAR1: 20, x_EN: true, ..Default::default() };
    attached.wait_until("INTR_SET", PATIENCE, |_| {
        event.call(&ram);
        attached.ring().ok()?;
        event.is_answered().then_some(())
    })?;
    let mut main = Main::new(&ram)?;
    ready.send(()).unwrap();
    while task.next_event(PATIENCE).is_ok() {
        main.scan();
        attached.ring()?;
    }
    Ok(main)
}

#[test]
fn blocks_in_structured_text_behave_like_the_rust_blocks() {
    let Some(matiec) = std::env::var_os("COMMRAM_MATIEC").map(PathBuf::from) else {
        skipped("matiec", "COMMRAM_MATIEC names no directory with iec2c and lib");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    let mut rust = emulator(directory);
    let (ready, is_ready) = mpsc::channel();
    let programs = PLCS.map(|plc| {
        let (instance, ready) = (rust.name.clone(), ready.clone());
        let program = thread::spawn(move || rust_program(&instance, plc, &ready));
        // Starts the programs one after the other, so that the journal has this order.
        is_ready.recv_timeout(PATIENCE).unwrap();
        program
    });
    let expected = played(&rust);
    rust.run("stop", &[]).ok();
    rust.wait();
    let [master, slave] = programs.map(|program| program.join().unwrap().unwrap());
    // The scenario has reached all of its intended states.
    assert_eq!((slave.down_sl[79], master.up_ma[0]), (79 * 7, -1), "{:?}", master.own.load_ma);
    assert_eq!((master.own.par_read.ud_PAR_VALUE, master.own.par_read.i_ERR), (70_000, -5));
    assert_eq!(
        (master.own.par_write.b_ERR, master.own.par_write.i_ERR, master.own.par_lost.b_ERR),
        (1, -3, 2)
    );
    // Manual p. 189-190, 227: after an answer that was never fetched, the next job is still done, and the slave's block
    // shows that a job was withdrawn. P. 263, 266: a transfer is cancelled when the master no longer polls its slave;
    // the drive still answers the next transfer.
    assert_eq!((master.own.par_gone.ud_PAR_VALUE, slave.own.job_was_reset), (70_000, true));
    assert_eq!(master.own.load_lost.w_ERR_SL, 0x0104, "{:?}", master.own.load_lost);
    assert!(master.own.b_four.x_RE_INIT_OK && master.own.b_four.b_ERR == 0, "{:?}", master.own.b_four);

    exported(directory);
    let file = directory.join("commram.st");
    run(&["export", "st", "--blocks", "--output", file.to_str().unwrap()]).ok();
    fs::copy(Path::new(crate::matiec::SOURCES).join("blocks.st"), directory.join("program.st")).unwrap();
    for level in ["-O0", "-O2"] {
        compile_program(&matiec, directory, level);
        let emulator = emulator(directory);
        let programs = PLCS.map(|plc| Plc::start_at(&directory.join("plc"), &emulator, plc, &["0", "20"]));
        let is_cyclic = |plc: &str| {
            let board = emulator.run("board", &["get", plc]);
            board.ok().contains("cyclic")
        };
        assert!(eventually(|| PLCS.iter().all(|plc| is_cyclic(plc))));
        let (sums, journal) = played(&emulator);
        assert_eq!(sums, expected.0, "{level}");
        for (ours, theirs) in expected.1.lines().zip(journal.lines()) {
            assert_eq!(ours, theirs, "{level}");
        }
        assert_eq!(journal.lines().count(), expected.1.lines().count(), "{level}");
        programs.into_iter().for_each(|program| assert_eq!(program.end(), Some(0)));
    }
}

/// matiec does not accept the name of a block for anything else, not even for a variable of a program.
#[test]
fn blocks_can_be_left_out() {
    let export = |args: &[&str]| run(&[&["export", "st", "--blocks"], args].concat());
    let whole = export(&[]).ok().to_owned();
    let (before, block) = whole.split_once("(* LED: ").unwrap();
    let (_, behind) = block.split_once("END_FUNCTION_BLOCK\n\n").unwrap();
    assert_eq!(export(&["--without", "led"]).ok(), format!("{before}{behind}"));
    let both = export(&["--without", "LED", "--without", "OPT_INIT"]);
    assert!(!both.ok().contains("FUNCTION_BLOCK LED\n") && !both.ok().contains("FUNCTION_BLOCK OPT_INIT\n"));
    let unknown = export(&["--without", "LAMP"]);
    assert!(
        unknown.fails(2).contains("the blocks are: CANsync_SL_TYP_INIT, CANsync_INIT, "),
        "{}",
        unknown.err
    );
    let used = export(&["--without", "COMMRAM_WATCH"]);
    assert!(
        used.fails(2).contains("other blocks use it; rename the variable of the program"),
        "{}",
        used.err
    );
}
