//! PWM, fast inputs, display, EEPROM, RS 232, timers and the interrupt program: p. 86-119.

use super::*;
use crate::devices::cs0015::emulation::board::events::INTERRUPT;
use crate::devices::cs0015::registers::values::{job, job_error};
use crate::devices::cs0015::registers::{
    FRONT_DISPLAY_1, FRONT_INPUTS, FRONT_MHZ_0, FRONT_MHZ_1, FRONT_OUTPUTS, FRONT_TURN_0,
};
use crate::layout::{Width, shown_text};

/// Calls a function with valid arguments and returns its results.
fn ask(bench: &mut Bench, function: u16, arguments: &[u32]) -> Vec<u32> {
    let (error, results) = bench.job(function, arguments);
    assert_eq!(error, job_error::NONE, "{function:04X} {arguments:?}");
    results
}

fn outputs(bench: &mut Bench, wanted: u16) -> u32 {
    bench.registers.outputs.Q0.store(wanted);
    bench.run(12 * MS);
    bench.registers.shown(FRONT_OUTPUTS).load()
}

/// Returns the names of the broken rules.
fn broken(bench: &mut Bench) -> Vec<&'static str> {
    let broken = bench.journal.findings().iter().map(|entry| entry.last.rule.id()).collect();
    bench.journal.clear_findings();
    broken
}

/// Manual p. 91.
#[test]
fn pwm_takes_a_whole_group_of_outputs() {
    let mut bench = Bench::operational("");
    assert_eq!(outputs(&mut bench, 0x0107), 0x0107);
    ask(&mut bench, job::PWM, &[1, 50_000, 0, 0, 0x61A8, 1, 0, 0]);
    let shown = |bench: &Bench| {
        let registers = &bench.registers.peripherals;
        (registers.a_PWM_DUTY[0].load(), registers.a_PWM_HZ[0].load(), registers.a_PWM_HZ[1].load())
    };
    assert_eq!((shown(&bench), bench.registers.shown(FRONT_OUTPUTS).load()), ((5_000, 200, 0), 0x0101));
    assert_eq!(broken(&mut bench), [""; 0], "nothing has been changed since");
    assert_eq!(outputs(&mut bench, 0x0105), 0x0101, "they are PWM outputs");
    assert_eq!(broken(&mut bench), ["pwm-output"]);
    bench.registers.flags.ERROR.store(1);
    bench.run(MS);
    assert_eq!((shown(&bench), outputs(&mut bench, 0x0105)), ((0, 200, 0), 0));
    bench.registers.flags.ERROR.store(0);
    ask(&mut bench, job::PWM, &[0, 0, 0, 0, 50_000, 0, 0, 0]);
    assert_eq!(shown(&bench).0, 5_000, "without CHANGE it stays");
    bench.power_cycle();
    assert_eq!((shown(&bench), outputs(&mut bench, 0x0007)), ((0, 0, 0), 0x0007));
    assert_eq!(broken(&mut bench), [""; 0]);
}

/// Manual p. 90-94.
#[test]
fn violations_of_the_pwm_rules_are_reported() {
    let mut bench = Bench::operational("");
    for channel in 4..8 {
        ask(&mut bench, job::PWM100, &[1, 200, channel, 50, 1, 0, 0]);
        ask(&mut bench, job::PWM, &[1, 50_000 - channel, 0, channel - 4, 0, 0, 0, 0]);
    }
    assert_eq!(broken(&mut bench), [""; 0]);
    ask(&mut bench, job::PWM100, &[1, 100, 5, 50, 1, 0, 0]);
    assert_eq!(broken(&mut bench), ["pwm-frequency"]);
    ask(&mut bench, job::PWM, &[1, 0x9E58, 0, 4, 0, 0, 0, 0]);
    assert_eq!(broken(&mut bench), ["pwm-mixed"]);
    ask(&mut bench, job::PWM100, &[1, 201, 0, 0, 0, 0, 0]);
    assert_eq!(broken(&mut bench), ["pwm-too-fast"]);
    for (function, wrong) in [
        (job::PWM, &[1, 50_000, 0, 8, 0, 0, 0, 0][..]),
        (job::PWM, &[2, 50_000, 0, 0, 0, 0, 0, 0]),
        (job::PWM100, &[1, 200, 0, 256, 1, 0, 0]),
    ] {
        assert_eq!(bench.job(function, wrong).0, job_error::ARGUMENTS, "{wrong:?}");
    }
    // The nearest limit of the range is used (D-472).
    ask(&mut bench, job::PWM100, &[0, 200, 0, 255, 1, 255, 0]);
    assert_eq!(bench.registers.peripherals.a_PWM_DUTY[0].load(), 10_000);
}

/// Manual p. 96-99.
#[test]
fn fast_inputs_measure_their_signals() {
    let mut bench = Bench::operational("");
    bench.registers.shown(FRONT_INPUTS).store(0x0003);
    bench.set(FRONT_MHZ_0, 100_000);
    ask(&mut bench, job::FREQUENCY, &[1, 0, 100]);
    ask(&mut bench, job::CYCLE, &[1, 0]);
    ask(&mut bench, job::INC_ENCODER, &[1, 0, 0, 0]);
    bench.run(200 * MS);
    assert_eq!(ask(&mut bench, job::FREQUENCY, &[0, 0, 100])[0], 100);
    assert_eq!(ask(&mut bench, job::CYCLE, &[0, 0])[0], 10);
    let counted = ask(&mut bench, job::INC_ENCODER, &[0, 0, 0, 0]);
    assert_eq!((counted[0], counted[1], counted[2]), (20, 1, 0));
    bench.set(FRONT_TURN_0, 1);
    bench.run(100 * MS);
    let counted = ask(&mut bench, job::INC_ENCODER, &[0, 0, 0, 0]);
    assert_eq!((counted[0], counted[1], counted[2]), (10, 0, 1));
    let preset = (-5_i32).cast_unsigned();
    assert_eq!(ask(&mut bench, job::INC_ENCODER, &[0, 0, preset, 1])[0], preset);
    // The signal has a period of 20 ms. So samples every 10 ms see the two halves of the period alternately.
    bench.set(FRONT_MHZ_1, 50_000);
    let mut seen = Vec::new();
    for _ in 0..4 {
        bench.run(10 * MS);
        seen.push(bench.registers.inputs.I0.load() & 2);
    }
    assert!(seen == [0, 2, 0, 2] || seen == [2, 0, 2, 0], "{seen:?}");
    bench.set(FRONT_MHZ_1, 0);
    bench.run(12 * MS);
    assert_eq!(bench.registers.inputs.I0.load() & 2, 2, "the terminal counts again");
    for wrong in [&[1, 4, 100][..], &[1, 0, 0]] {
        assert_eq!(bench.job(job::FREQUENCY, wrong).0, job_error::ARGUMENTS);
    }
}

fn display(bench: &Bench) -> String {
    let front: Vec<_> =
        DEVICE.front.iter().map(|word| (word, bench.registers.shown(word.index()).load())).collect();
    shown_text(&front).unwrap()
}

fn with_data(bench: &mut Bench, function: u16, arguments: &[u32], data: &[u8]) -> u8 {
    let jobs = &bench.registers.jobs;
    jobs.a_DATA[0].iter().zip(data).for_each(|(cell, byte)| cell.store(*byte));
    jobs.a_LENGTH[0].store(data.len() as u16);
    bench.job(function, arguments).0
}

/// Manual p. 100-103.
#[test]
fn the_display_shows_text_and_segments_of_the_program() {
    let mut bench = Bench::operational("");
    assert_eq!(display(&bench), "");
    assert_eq!(with_data(&mut bench, job::LCD_TEXT, &[1, 0, 0x10, 0x02], b"12345ON"), job_error::NONE);
    assert_eq!(display(&bench), "12.345ON");
    assert_eq!(bench.registers.peripherals.b_LCD_STATES.load(), 0x10);
    assert_eq!(with_data(&mut bench, job::LCD_TEXT, &[0, 0, 0, 0], b"OTHER"), job_error::NONE);
    assert_eq!(display(&bench), "12.345ON", "without CHANGE it stays");
    assert_eq!(with_data(&mut bench, job::LCD_TEXT, &[1, 0, 0, 0], b"123456789"), job_error::ARGUMENTS);
    assert_eq!(
        with_data(&mut bench, job::LCD_TEXT, &[1, 0, 0, 0], b"12345678"),
        job_error::NONE,
        "the buffer is full"
    );
    assert_eq!(display(&bench), "12345678");
    assert_eq!(with_data(&mut bench, job::LCD_TEXT, &[1, 0, 0x10, 0x02], b"12345ON"), job_error::NONE);
    let segments = [0xC0, 0xDF, 0, 0, 0xD7, 0, 0, 0x55, 0x40, 0, 0];
    assert_eq!(with_data(&mut bench, job::LCD_SEGMENTS, &[1, 0x80, 0, 0x1F], &segments), job_error::NONE);
    assert_eq!(display(&bench), "1.8. . .0. *");
    let registers = &bench.registers.peripherals;
    assert_eq!((registers.a_LCD_DIGITS[1].load(), registers.a_LCD_LETTERS[1].load()), (0xDF, 0x4055));
    assert_eq!(registers.b_LCD_BLINK.load(), 0x80);
    for length in [10, 12] {
        let data = vec![0; length];
        assert_eq!(with_data(&mut bench, job::LCD_SEGMENTS, &[1, 0, 0, 0], &data), job_error::ARGUMENTS);
    }
    bench.fault("supply", &["what=drop"]);
    bench.run(2 * MS);
    assert_eq!((display(&bench), bench.registers.shown(FRONT_DISPLAY_1).load()), (String::new(), 0));
}

/// Manual p. 107-110.
#[test]
fn the_eeprom_keeps_a_block_of_flags() {
    let mut bench = Bench::operational("");
    let flag = |bench: &Bench| bench.registers.function.a_FUNCTION[383].load();
    bench.registers.function.a_FUNCTION[383].store(0x1234);
    assert_eq!(ask(&mut bench, job::E2WRITE, &[1])[0], 2);
    bench.registers.function.a_FUNCTION[383].store(0x5678);
    bench.run(470 * MS);
    assert_eq!((ask(&mut bench, job::E2WRITE, &[1])[0], ask(&mut bench, job::E2READ, &[1])[0]), (2, 2));
    assert_eq!(bench.registers.parameters.d_EEPROM_WRITES.load(), 0);
    bench.run(10 * MS);
    assert_eq!(ask(&mut bench, job::E2WRITE, &[1])[0], 1);
    assert_eq!((ask(&mut bench, job::E2WRITE, &[0])[0], flag(&bench)), (0, 0x5678));
    let stored = bench.device.novram().unwrap().contents().0.to_vec();
    assert!(stored.ends_with(&[0x34, 0x12]), "as it was when the function began");
    bench.power_cycle();
    assert_eq!(flag(&bench), 0);
    assert_eq!(ask(&mut bench, job::E2READ, &[1])[0], 2);
    bench.run(20 * MS);
    assert_eq!((ask(&mut bench, job::E2READ, &[1])[0], flag(&bench)), (1, 0x1234));
    assert_eq!((ask(&mut bench, job::E2READ, &[0])[0], ask(&mut bench, job::E2READ, &[1])[0]), (0, 2));
    // An unfinished write has no effect.
    bench.run(30 * MS);
    bench.registers.function.a_FUNCTION[383].store(0x9999);
    assert_eq!(ask(&mut bench, job::E2WRITE, &[1])[0], 2);
    bench.power_cycle();
    bench.run(1000 * MS);
    assert_eq!(bench.registers.parameters.a_EEPROM[383].load(), 0x1234);
}

/// Manual p. 112-114.
#[test]
fn rs_232_belongs_to_the_program_with_serial_mode() {
    let mut bench = Bench::operational("");
    let give = |bench: &mut Bench, count: u32| {
        let registers = &bench.registers.peripherals;
        let from = registers.d_RS232_GIVEN.load();
        for n in from..from + count {
            registers.a_RS232_GIVEN[n as usize % 1024].store(n as u8);
        }
        registers.d_RS232_GIVEN.store(from + count);
    };
    give(&mut bench, 2);
    bench.run(10 * MS);
    assert_eq!((ask(&mut bench, job::SERIAL_PENDING, &[])[0], broken(&mut bench)), (0, vec![]));
    ask(&mut bench, job::SERIAL_TX, &[0x55]);
    assert_eq!(broken(&mut bench), ["serial-mode"]);
    bench.registers.flags.SERIAL_MODE.store(1);
    give(&mut bench, 3);
    bench.run(4 * MS);
    assert_eq!(ask(&mut bench, job::SERIAL_PENDING, &[])[0], 3, "a byte takes 1.04 ms");
    for expected in [[2, 2, 0], [3, 1, 0], [4, 0, 0], [0, 0, 0]] {
        assert_eq!(ask(&mut bench, job::SERIAL_RX, &[0])[..3], expected);
    }
    give(&mut bench, 1000);
    bench.run(1050 * MS);
    give(&mut bench, 1);
    bench.run(2 * MS);
    assert_eq!(ask(&mut bench, job::SERIAL_RX, &[0])[..3], [5, 999, 1]);
    assert_eq!(ask(&mut bench, job::SERIAL_RX, &[1])[..3], [0, 0, 0]);
    ask(&mut bench, job::SERIAL_TX, &[0x41]);
    ask(&mut bench, job::SERIAL_TX, &[0x42]);
    bench.run(3 * MS);
    let registers = &bench.registers.peripherals;
    let sent = [0, 1].map(|n| registers.a_RS232_SENT[n].load());
    assert_eq!((registers.d_RS232_SENT.load(), sent), (2, [0x41, 0x42]));
    assert_eq!(broken(&mut bench), [""; 0]);
}

/// Manual p. 106, 115-116.
#[test]
fn timers_begin_with_the_supply_and_after_a_soft_reset() {
    let mut bench = Bench::operational("");
    bench.registers.outputs.Q0.store(0xFF);
    let timers = |bench: &mut Bench| {
        let ms = ask(bench, job::TIMER_READ, &[])[0];
        let us = ask(bench, job::TIMER_US_READ, &[])[0];
        assert_eq!((ms % 10, u64::from(us) / (10 * MS)), (0, u64::from(ms) / 10));
        us
    };
    let before = u64::from(timers(&mut bench));
    assert!((255 * MS..265 * MS).contains(&before), "{before}");
    assert_eq!(bench.job(job::SOFTRESET, &[]).0, job_error::NONE);
    bench.run(2 * MS);
    assert_eq!(bench.state(), "reset");
    bench.run(250 * MS);
    assert_eq!((bench.state(), bench.registers.outputs.Q0.load()), ("run".to_owned(), 0));
    let after = u64::from(timers(&mut bench));
    assert!((250 * MS..260 * MS).contains(&after), "{after}");
}

/// Manual p. 118.
#[test]
fn the_interrupt_program_has_its_own_inputs_and_outputs() {
    let mut bench = Bench::operational("program = 'attached', cycle_us = 100000");
    let runs = |bench: &Bench| bench.segment.header().unwrap().events[INTERRUPT].bell.rings();
    bench.registers.flags.CAN_OPEN.store(1);
    assert_eq!(runs(&bench), 0);
    ask(&mut bench, job::SET_INTERRUPT_1MS, &[1]);
    let before = runs(&bench);
    bench.registers.shown(FRONT_INPUTS).store(0x0303);
    bench.registers.outputs.Q0.store(0x0505);
    bench.run(10 * MS);
    assert_eq!(runs(&bench), before + 10);
    let seen =
        |bench: &Bench| (bench.registers.inputs.I0.load(), bench.registers.shown(FRONT_OUTPUTS).load());
    assert_eq!(seen(&bench), (0x0003, 0x0005));
    bench.run(100 * MS);
    assert_eq!(seen(&bench), (0x0303, 0x0505), "the others once in each cycle");
    assert_eq!(bench.device.event_level(INTERRUPT), Some(2));
    bench.command(2);
    let stopped = runs(&bench);
    bench.run(10 * MS);
    assert_eq!(runs(&bench), stopped);
    bench.command(1);
    bench.run(10 * MS);
    assert!(runs(&bench) > stopped);
    ask(&mut bench, job::SET_INTERRUPT_1MS, &[0]);
    let ended = runs(&bench);
    bench.run(10 * MS);
    assert_eq!(runs(&bench), ended);
}

/// Manual p. 154.
#[test]
fn flags_of_the_operating_system_are_not_written() {
    let mut bench = Bench::operational("");
    bench.registers.flags.ERROR.store(0);
    bench.segment.store(8192 + 2 * 3967, Width::Word, 7).unwrap();
    bench.run(MS);
    assert_eq!(broken(&mut bench), [""; 0]);
    bench.segment.store(8192 + 2 * 4000, Width::Word, 0x1234).unwrap();
    bench.run(MS);
    let last = bench.journal.findings().iter().next().unwrap().last;
    assert_eq!((last.offset, last.value), (8192 + 2 * 4000, 0x1234));
    assert_eq!(broken(&mut bench), ["system-area"]);
    bench.run(10 * MS);
    assert_eq!(broken(&mut bench), [""; 0], "once");
}

/// Manual p. 48, 50, 53.
#[test]
fn pdos_are_configured_before_there_is_a_master() {
    let mut bench = Bench::running("program = 'attached'");
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(20 * MS);
    ask(&mut bench, job::PDO_TX_CONFIG, &[3, 0x390, 255, 0]);
    ask(&mut bench, job::NMM_SET_NMT_MASTER, &[]);
    assert_eq!(broken(&mut bench), [""; 0]);
    ask(&mut bench, job::PDO_RX_CONFIG, &[3, 0x3A0, 255]);
    assert_eq!(broken(&mut bench), ["pdo-after-master"]);
}

/// Manual p. 47, 49, 155.
#[test]
fn a_slave_configures_its_pdos_before_it_is_started() {
    let mut bench = Bench::running("program = 'attached'");
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(20 * MS);
    bench.send(0, &[1, 0]);
    bench.run(5 * MS);
    ask(&mut bench, job::PDO_TX_CONFIG, &[3, 0x390, 255, 0]);
    assert_eq!((broken(&mut bench), bench.stat()), (vec!["pdo-late"], "green 0.5 Hz".to_owned()));
    ask(&mut bench, job::PDO_RX_CONFIG, &[3, 0x3A0, 255]);
    assert_eq!(broken(&mut bench), [""; 0]);
}

/// The function blocks give the same orders as the functions. Their inputs and outputs are those of the
/// manual.
#[cfg(feature = "plc")]
#[test]
fn blocks_give_the_orders_of_the_functions() {
    use crate::devices::cs0015::blocks::*;
    use core::time::Duration;
    let mut bench = Bench::running("program = 'attached'");
    let ram = Ram::of(&bench.segment).unwrap();
    let jobs = Jobs::of(&ram).unwrap();
    bench.registers.flags.SERIAL_MODE.store(1);
    bench.set(FRONT_MHZ_0, 100_000);
    bench.registers.function.a_FUNCTION[0].store(0xABCD);
    let mut pwm = PWM { INIT: true, RELOAD: 50_000, VALUE: 25_000, CHANGE: true, ..Default::default() };
    let mut percent =
        PWM100 { INIT: true, FREQUENCY: 100, CHANNEL: 4, VALUE: 25, CHANGE: true, ..Default::default() };
    let mut frequency = FREQUENCY { INIT: true, TIMEBASE: Duration::from_millis(100), ..Default::default() };
    let mut cycle = CYCLE { INIT: true, ..Default::default() };
    let mut encoder = INC_ENCODER { INIT: true, ..Default::default() };
    let mut text = LCD_TEXT { CHANGE: true, TEXT: *b"12345ON\0", POINTS: 2, ..Default::default() };
    let mut save = E2WRITE { ENABLE: true, ..Default::default() };
    let mut send = SERIAL_TX { ENABLE: true, DATA: 0x41, ..Default::default() };
    let (mut fetch, mut pending) = (SERIAL_RX::default(), SERIAL_PENDING::default());
    let (mut time, mut us) = (TIMER_READ::default(), TIMER_US_READ::default());
    let mut interrupt = SET_INTERRUPT_1MS { ENABLE: true, ..Default::default() };
    for _ in 0..60 {
        pwm.call(&jobs);
        percent.call(&jobs);
        frequency.call(&jobs);
        cycle.call(&jobs);
        encoder.call(&jobs);
        text.call(&jobs);
        save.call(&jobs);
        send.call(&jobs);
        bench.run(MS);
        fetch.call(&jobs);
        pending.call(&jobs);
        time.call(&jobs);
        us.call(&jobs);
        interrupt.call(&jobs);
        bench.run(9 * MS);
        (pwm.INIT, pwm.CHANGE, percent.INIT, percent.CHANGE) = (false, false, false, false);
        (frequency.INIT, cycle.INIT, encoder.INIT) = (false, false, false);
        (text.CHANGE, send.ENABLE) = (false, false);
    }
    let shown = &bench.registers.peripherals;
    assert_eq!((shown.a_PWM_DUTY[0].load(), shown.a_PWM_DUTY[4].load()), (5_000, 2_499));
    assert_eq!((frequency.F, cycle.C), (100, 10));
    assert!(encoder.UP && !encoder.DOWN && encoder.COUNTER > 50, "{encoder:?}");
    assert_eq!((display(&bench).as_str(), save.RESULT, shown.d_RS232_SENT.load()), ("12.345ON", 1, 1));
    assert_eq!((fetch.AVAILABLE, pending.NUMBER), (0, 0));
    assert_eq!(time.T.as_millis() as u32 / 10, us.TIME_US / 10_000);
    assert!(bench.segment.header().unwrap().events[INTERRUPT].bell.rings() > 500);
    save.ENABLE = false;
    let mut segments = LCD_SEGMENTS { CHANGE: true, DIGITS: [0xC0, 0, 0, 0, 0], ..Default::default() };
    let (mut restart, mut errors) =
        (CAN_RESTART { ENABLE: true, ..Default::default() }, CAN_ERRORHANDLER::default());
    let mut load = E2READ { ENABLE: true, ..Default::default() };
    bench.registers.function.a_FUNCTION[0].store(0);
    for _ in 0..4 {
        save.call(&jobs);
        segments.call(&jobs);
        restart.call(&jobs);
        errors.call(&jobs);
        load.call(&jobs);
        bench.run(10 * MS);
    }
    assert_eq!((save.RESULT, load.RESULT, display(&bench)), (0, 1, "1".to_owned()));
    assert_eq!(bench.registers.function.a_FUNCTION[0].load(), 0xABCD);
    assert!(restart.ANSWERED && errors.ANSWERED && errors.ERRORCOUNT == 0);
    let mut norm = NORM { X: 50, XH: 0, XL: 100, YH: 0, YL: 2000, ..Default::default() };
    norm.call();
    assert_eq!(norm.Y, 1000);
    (norm.YH, norm.YL, norm.X) = (2000, 0, 25);
    norm.call();
    assert_eq!(norm.Y, 1500, "inverted");
    let mut reset = SOFTRESET { ENABLE: true, ..Default::default() };
    reset.call(&jobs);
    bench.run(3 * MS);
    assert_eq!(bench.state(), "reset");
}
