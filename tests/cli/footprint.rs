//! Memory use of an emulator, and a check that it does not grow.

use crate::common::{Emulator, run};
use commram::request::Travel;
use std::fmt::Write;

/// A scenario that starts the master with drives and mapped process data.
const START: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenarios/03-process-data-of-a-drive.rhai");

/// Upper limit for a snapshot of the built-in plant.
const SNAPSHOT_KB: u64 = 8;

/// Memory of a process in KB: private memory without images, private memory with images, and all resident memory.
struct Resident {
    alone: u64,
    own: u64,
    all: u64,
}

impl Resident {
    fn of(emulator: &Emulator) -> Self {
        let status = std::fs::read_to_string(format!("/proc/{}/status", emulator.pid())).unwrap();
        let kilobytes = |name: &str| -> u64 {
            let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap();
            line.trim_end_matches("kB").trim().parse().unwrap()
        };
        Resident {
            alone: kilobytes("RssAnon:"),
            own: kilobytes("RssAnon:") + kilobytes("RssShmem:"),
            all: kilobytes("VmRSS:"),
        }
    }
}

/// `COMMRAM_FOOTPRINT_S` is the emulated time in seconds during which the memory must not grow.
#[test]
fn an_emulator_stays_small_and_does_not_grow() {
    let emulator = Emulator::stepped();
    run(&["test", START, "--attach", &emulator.name]).ok();
    // From now on each interval has two frames: the reference values of the master, which its program always releases,
    // and the answer of a drive.
    emulator.run("force", &["node2.b_CTRLREG_WRC1=16#05"]).ok();
    emulator.step(&["70s"]);
    let kept = emulator.run("trace", &["--kind", "frame", "--format", "jsonl"]);
    assert!(kept.ok().lines().count() >= 65_536, "the ring is not full");
    // The allocator does not return the memory of this large answer to the system at once.
    let before = Resident::of(&emulator);
    assert!(before.own < 32_000, "{} KB", before.own);
    if !cfg!(debug_assertions) {
        assert!(before.all < 32_000, "{} KB", before.all);
    }
    let more: u64 = std::env::var("COMMRAM_FOOTPRINT_S").map_or(120, |seconds| seconds.parse().unwrap());
    // Each command steps one hour, so that no command takes longer than its watchdog allows.
    for begin in (0..more).step_by(3600) {
        emulator.step(&[&format!("{}s", (more - begin).min(3600))]);
    }
    let after = Resident::of(&emulator);
    // Each of the journal's other rings grows by one record per second, and the snapshots for stepping back grow by at
    // most one in ten seconds.
    let records = more.min(65_536) * 4 * 64 / 1000;
    let way = (more / 10 * SNAPSHOT_KB).min(Travel::DEFAULT_BYTES as u64 / 1000);
    let most = before.own + records + way + 256;
    assert!(after.own <= most, "{} KB, then {} KB, at most {most}", before.own, after.own);
    assert!(after.own < 32_000, "{} KB", after.own);
}

/// Compares PLCs with full buses to an empty PLC. docs/internals/promises.md has the limits for a PLC and for a
/// drive, without the image.
#[test]
fn one_more_plc_or_drive_takes_little_memory() {
    const PLCS: u64 = 8;
    const DRIVES: u64 = 32;
    let plant = |plcs: u64, drives: u64| {
        let mut text = String::new();
        for plc in 0..plcs {
            write!(text, "[[plc]]\nname='p{plc}'\nnode2='b{plc}'\n[[bus]]\nname='b{plc}'\n").unwrap();
            for drive in 0..drives {
                write!(text, "[[bus.drive]]\nname='d{plc}_{drive}'\nslave_number={drive}\n").unwrap();
            }
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let emulator = Emulator::start(&[file.path().to_str().unwrap(), "--clock", "stepped"]);
        emulator.step(&["1s"]);
        Resident::of(&emulator).alone
    };
    let (one, plcs, drives) = (plant(1, 0), plant(PLCS, 0), plant(PLCS, DRIVES));
    assert!(plcs <= one + (PLCS - 1) * 1_000, "{PLCS} PLCs take {plcs} KB, one takes {one} KB");
    assert!(
        drives <= plcs + PLCS * DRIVES * 2,
        "{drives} KB with {} drives, {plcs} KB without",
        PLCS * DRIVES
    );
}
