//! Tests faults of the hardware, and the operating states that they cause.

use super::*;
use crate::devices::cs0015::emulation::records::{CommandRefused, RefusalReason, Watchdog};
use crate::devices::cs0015::registers::FRONT_OUTPUTS;
use crate::journal::Record;
use crate::memory::Width;

/// Writes %QW0, and waits until a cycle of the program has ended.
fn put(bench: &mut Bench, outputs: u16) {
    bench.registers.outputs.Q0.store(outputs);
    bench.run(12 * MS);
}

fn driven(bench: &Bench) -> u32 {
    bench.registers.shown(FRONT_OUTPUTS).load()
}

/// Reads the error register by SDO.
fn error_register(bench: &mut Bench) -> u8 {
    bench.exchange(0x620, &[0x40, 0x01, 0x10, 0, 0, 0, 0, 0])[0].1[4]
}

fn emergency(data: [u8; 8]) -> (u16, Vec<u8>) {
    (0xA0, data.to_vec())
}

/// Manual p. 44; D-460, D-461.
#[test]
fn an_output_with_a_short_circuit_switches_itself_off() {
    let mut bench = Bench::operational("");
    put(&mut bench, 0x0101);
    let short = bench.fault("short_circuit", &["output=9"]);
    bench.run(20 * MS);
    assert_eq!((bench.heard(), driven(&bench)), (vec![], 0x0101), "the output is off");
    put(&mut bench, 0x0301);
    assert_eq!(
        bench.heard(),
        [emergency([0, 0x23, 0x02, 0, 2, 0, 0, 0]), emergency([0, 0x10, 0x03, 0, 0, 0, 0, 0])]
    );
    assert_eq!((driven(&bench), bench.stat()), (0, "red 2 Hz".to_owned()), "ERROR switches all off");
    assert_eq!((bench.registers.flags.ERROR.load(), error_register(&mut bench)), (1, 0x03));
    bench.registers.flags.ERROR.store(0);
    bench.run(50 * MS);
    assert_eq!((driven(&bench), bench.stat()), (0x0101, "green 2 Hz".to_owned()));
    assert_eq!(bench.heard(), [emergency([0, 0, 0x02, 0, 0, 0, 0, 0])], "the general error has gone");
    let other = bench.fault("short_circuit", &["output=0"]);
    bench.run(MS);
    assert_eq!(bench.heard()[0], emergency([0, 0x23, 0x02, 1, 2, 0, 0, 0]), "another error is reported");
    bench.registers.flags.ERROR.store(0);
    bench.clear_fault(other);
    bench.run(10 * MS);
    bench.heard();
    assert_eq!(driven(&bench), 0x0101);
    bench.clear_fault(short);
    bench.run(5 * MS);
    assert_eq!((bench.heard(), driven(&bench)), (vec![emergency([0; 8])], 0x0301));
}

#[test]
fn a_broken_wire_is_reported_with_its_output() {
    let mut bench = Bench::operational("");
    put(&mut bench, 0x8000);
    let broken = bench.fault("wire_break", &["output=15"]);
    bench.run(MS);
    assert_eq!(bench.heard()[0], emergency([0, 0x21, 0x02, 0, 0x80, 0, 0, 0]));
    bench.registers.flags.ERROR.store(0);
    bench.run(MS);
    assert_eq!(driven(&bench), 0x8000, "the output is on without a load");
    bench.heard();
    bench.clear_fault(broken);
    bench.run(MS);
    assert_eq!(bench.heard(), [emergency([0; 8])]);
}

/// Manual p. 44: bits 1 to 3 of the error register are also in 1001h, although p. 156 lists only bits 0, 4
/// and 7 (D-414).
#[test]
fn supply_and_temperature_have_separate_bits() {
    let mut bench = Bench::operational("");
    for (what, word) in [("supply", Some("what=under")), ("supply", Some("what=over")), ("temperature", None)]
    {
        let words: Vec<_> = word.into_iter().collect();
        let (code, bit) = if what == "supply" { (0x32, 0x04) } else { (0x40, 0x08) };
        let fault = bench.fault(what, &words);
        bench.run(MS);
        assert_eq!(
            bench.heard(),
            [emergency([0, code, bit, 0, 0, 0, 0, 0]), emergency([0, 0x10, bit | 1, 0, 0, 0, 0, 0])]
        );
        assert_eq!(error_register(&mut bench), bit | 1);
        bench.clear_fault(fault);
        assert_eq!(bench.heard(), [emergency([0, 0, 1, 0, 0, 0, 0, 0])], "the program resets ERROR");
        bench.registers.flags.ERROR.store(0);
        bench.run(MS);
        assert_eq!(bench.heard(), [emergency([0; 8])]);
    }
}

/// Manual p. 107.
#[test]
fn when_the_supply_drops_retain_flags_are_saved() {
    let mut bench = Bench::operational("");
    bench.segment.store(8192, Width::Word, 0x1234).unwrap();
    bench.segment.store(8192 + 256, Width::Word, 0x5678).unwrap();
    bench.fault("supply", &["what=drop", "duration=50ms"]);
    bench.run(MS);
    assert_eq!((bench.state(), bench.stat(), driven(&bench)), ("off".to_owned(), "dark".to_owned(), 0));
    bench.run(30 * MS);
    assert_eq!(bench.state(), "off");
    bench.run(30 * MS);
    assert_eq!((bench.state(), bench.stat()), ("reset".to_owned(), "green and red".to_owned()));
    bench.run(250 * MS);
    assert_eq!((bench.state(), bench.stat()), ("run".to_owned(), "green 0.5 Hz".to_owned()));
    let words = [8192, 8192 + 256].map(|at| bench.segment.load(at, Width::Word).unwrap());
    assert_eq!(words, [0x1234, 0]);
}

#[test]
fn a_device_switched_off_stays_off_when_the_supply_is_back() {
    let mut bench = Bench::operational("");
    let drop = bench.fault("supply", &["what=drop"]);
    bench.run(10 * MS);
    bench.device.set_power(Power::Off);
    bench.clear_fault(drop);
    bench.run(10 * MS);
    assert_eq!(bench.state(), "off");
}

/// Manual p. 18-19; D-462.
#[test]
fn an_error_in_the_memory_has_a_separate_flag() {
    let mut bench = Bench::operational("");
    bench.fault("memory", &["count=2"]);
    bench.run(20 * MS);
    let flags =
        |bench: &Bench| (bench.registers.flags.ERROR_MEMORY.load(), bench.registers.flags.ERROR.load());
    assert_eq!((flags(&bench), bench.faults.list().count()), ((1, 0), 1));
    assert_eq!((bench.heard(), bench.stat()), (vec![], "green 2 Hz".to_owned()));
    bench.registers.flags.ERROR_MEMORY.store(0);
    bench.run(MS);
    assert_eq!((flags(&bench), bench.faults.list().count()), ((1, 0), 0), "it has happened twice");
}

/// Manual p. 13; D-463.
#[test]
fn only_a_reset_ends_a_fatal_error() {
    let mut bench = Bench::operational("boot_up = '700'");
    put(&mut bench, 0xFFFF);
    bench.fault("fatal", &["count=2"]);
    let is_fatal = |bench: &Bench| {
        assert_eq!((bench.state(), bench.stat()), ("fatal error".to_owned(), "red".to_owned()));
        assert_eq!(driven(bench), 0);
    };
    is_fatal(&bench);
    bench.command(1);
    bench.send(0, &[1, 0]);
    bench.ask(0x720);
    assert_eq!(bench.exchange(0x620, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]), [], "no answer");
    bench.run(500 * MS);
    is_fatal(&bench);
    assert_eq!(bench.faults.list().count(), 1, "once per fault");
    bench.power_cycle();
    is_fatal(&bench);
    assert_eq!(bench.faults.list().count(), 0);
    bench.power_cycle();
    assert_eq!((bench.state(), bench.stat()), ("run".to_owned(), "green 0.5 Hz".to_owned()));
}

/// Manual p. 13-16; D-464.
#[test]
fn without_an_operating_system_only_a_download_helps() {
    let mut bench = Bench::operational("");
    let is_empty = |bench: &Bench| {
        assert_eq!(
            (bench.state(), bench.stat()),
            ("no operating system".to_owned(), "green 5 Hz".to_owned())
        );
    };
    bench.set(FRONT_PROGRAM, 3);
    assert_eq!(bench.state(), "run", "S1 is at LOCK");
    bench.command(3);
    is_empty(&bench);
    bench.command(4);
    is_empty(&bench);
    bench.power_cycle();
    is_empty(&bench);
    bench.command(1);
    bench.send(0, &[1, 0]);
    assert_eq!(bench.exchange(0x620, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]), []);
    is_empty(&bench);
    bench.command(4);
    bench.run(250 * MS);
    assert_eq!((bench.state(), bench.stat()), ("run".to_owned(), "green 0.5 Hz".to_owned()));
    let why = |record: Record| record.event.get::<CommandRefused>().map(|it| it.why);
    let reasons: Vec<_> = bench.journal.records().filter_map(why).collect();
    let expected = [RefusalReason::Locked, RefusalReason::NeedsReset, RefusalReason::State];
    assert_eq!(reasons, expected.map(|why| why as u8));
}

/// Guarding was active when the supply was switched off. When the supply is switched on again, the device
/// must not report a missing master.
#[test]
fn no_master_is_missed_during_the_reset() {
    let mut bench = Bench::running("guarding = { guard_time_ms = 100, life_time = 1 }");
    bench.ask(0x720);
    bench.run(5 * MS);
    bench.power_cycle();
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 0);
}

/// Manual p. 7: the watchdog resets the device if the program does not end its cycle within 200 ms. D-664.
#[test]
fn a_program_that_hangs_trips_the_watchdog() {
    let mut bench = Bench::operational("");
    bench.registers.outputs.Q0.store(1);
    bench.run(20 * MS);
    let is_reset = |record: &Record| record.event.get::<Watchdog>().is_some();
    let resets = |bench: &Bench| bench.journal.records().filter(|record| is_reset(record)).count();
    let id = bench.fault("hang", &[]);
    bench.registers.outputs.Q0.store(2);
    bench.run(185 * MS);
    assert_eq!((resets(&bench), driven(&bench)), (0, 1), "nothing is done for the program");
    bench.clear_fault(id);
    bench.run(10 * MS);
    assert_eq!((resets(&bench), driven(&bench)), (0, 2), "the cycle has ended in time");
    let id = bench.fault("hang", &[]);
    bench.run(205 * MS);
    assert_eq!((resets(&bench), bench.state(), driven(&bench)), (1, "reset".to_owned(), 0));
    bench.run(420 * MS);
    assert_eq!(resets(&bench), 2, "while the program hangs");
    bench.clear_fault(id);
    bench.run(450 * MS);
    assert_eq!(
        (resets(&bench), bench.state(), bench.stat()),
        (2, "run".to_owned(), "green 0.5 Hz".to_owned())
    );
}
