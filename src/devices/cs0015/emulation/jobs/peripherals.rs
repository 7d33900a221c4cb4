//! Functions of PWM, fast inputs, display, memory, RS 232 and timers (p. 86-119).

use crate::devices::cs0015::emulation::board::eeprom::Access;
use crate::devices::cs0015::emulation::board::fast_inputs::{ENCODERS, EncoderCount, INPUTS};
use crate::devices::cs0015::emulation::board::lcd::{DIGITS, LETTERS, Lcd, PLACES};
use crate::devices::cs0015::emulation::board::peripherals::Peripherals;
use crate::devices::cs0015::emulation::board::pwm::{CHANNELS, Misuse, Pwm};
use crate::devices::cs0015::emulation::board::serial::SerialByte;
use crate::devices::cs0015::emulation::jobs::{Answer, Job, JobContext, OutOfRange, Outcome, Refusal};
use crate::devices::cs0015::emulation::port::Firmware;
use crate::devices::cs0015::emulation::rules;
use crate::devices::cs0015::registers::values::{bool, job};
use crate::devices::cs0015::registers::{CS0015_FLAGS, FLAGS, OUTPUTS};

/// Range of the time that `TIMER_READ` returns, in ms. `STEP_MS` is the step of this time (p. 115).
const TIMER_MS: u64 = 655_360;
const STEP_MS: u64 = 10;

pub(crate) fn carry_out(job_context: JobContext, job: &Job) -> Outcome {
    match job.function {
        job::PWM => pwm(job_context, job),
        job::PWM100 => pwm_100(job_context, job),
        job::FREQUENCY => frequency(job_context, job),
        job::CYCLE => cycle(job_context, job),
        job::INC_ENCODER => inc_encoder(job_context, job),
        job::LCD_SEGMENTS => lcd_segments(job_context, job),
        job::LCD_TEXT => lcd_text(job_context, job),
        job::SOFTRESET => {
            job_context.firmware.shared.restart();
            Ok(Answer::default())
        }
        job::E2WRITE => eeprom(job_context, job, Access::Write),
        job::E2READ => eeprom(job_context, job, Access::Read),
        job::SERIAL_TX => serial_tx(job_context, job),
        job::SERIAL_RX => serial_rx(job_context, job),
        job::SERIAL_PENDING => Ok(of([job_context.firmware.peripherals.serial.pending().into()])),
        job::TIMER_READ => {
            let ms = (job_context.now - job_context.firmware.peripherals.on_since) / 1000 / STEP_MS * STEP_MS;
            Ok(of([(ms % TIMER_MS) as u32]))
        }
        // The time wraps (p. 116).
        job::TIMER_US_READ => Ok(of([(job_context.now - job_context.firmware.peripherals.on_since) as u32])),
        job::SET_INTERRUPT_1MS => {
            job_context.firmware.interrupt.set(flag(job, 0)?, job_context.now);
            Ok(Answer::default())
        }
        _ => Err(Refusal::Function),
    }
}

/// Returns an answer with these results.
fn of<const N: usize>(results: [u32; N]) -> Answer {
    let mut answer = Answer::default();
    answer.results.iter_mut().zip(results).for_each(|(to, from)| *to = from);
    answer
}

/// Returns a BOOL argument.
fn flag(job: &Job, argument: usize) -> Result<bool, OutOfRange> {
    Ok(job.argument(argument, 0..=1)? != 0)
}

fn byte(job: &Job, argument: usize) -> Result<u8, OutOfRange> {
    job.argument(argument, 0..=u32::from(u8::MAX)).map(|value| value as u8)
}

fn word(job: &Job, argument: usize) -> Result<u16, OutOfRange> {
    job.argument(argument, 0..=u32::from(u16::MAX)).map(|value| value as u16)
}

/// Returns a channel argument below `count`.
fn channel(job: &Job, argument: usize, count: usize) -> Result<u8, OutOfRange> {
    job.argument(argument, 0..=count as u32 - 1).map(|channel| channel as u8)
}

/// Common last part of `PWM` and `PWM100`. `value` takes effect if CHANGE is TRUE.
fn put(
    job_context: JobContext,
    channel: u8,
    start: Option<impl FnOnce(&mut Pwm) -> Misuse>,
    value: Option<impl FnOnce(&mut Pwm)>,
) -> Outcome {
    let Peripherals { pwm, findings, .. } = &mut job_context.firmware.peripherals;
    if let Some(start) = start {
        let misuse = start(pwm);
        let found = [
            (misuse.is_mixed, &rules::PWM_MIXED),
            (misuse.has_other_frequency, &rules::PWM_FREQUENCY),
            (misuse.is_too_fast, &rules::PWM_TOO_FAST),
        ];
        let found = found.into_iter().filter(|(is_so, _)| *is_so);
        findings.extend(found.map(|(_, rule)| (rule, OUTPUTS, u32::from(channel))));
    }
    if let Some(value) = value {
        value(pwm);
    }
    Ok(Answer::default())
}

/// Runs `PWM` (p. 92). Dither varies the value slightly (p. 91). The emulator does not show this variation at
/// the terminals.
fn pwm(job_context: JobContext, job: &Job) -> Outcome {
    let (is_init, reload, is_divided) = (flag(job, 0)?, word(job, 1)?, flag(job, 2)?);
    let (channel, value, is_new) = (channel(job, 3, CHANNELS)?, word(job, 4)?, flag(job, 5)?);
    word(job, 6)?;
    word(job, 7)?;
    let start = is_init.then_some(|pwm: &mut Pwm| pwm.init(channel, reload, is_divided));
    let value = is_new.then_some(|pwm: &mut Pwm| pwm.set(channel, value));
    put(job_context, channel, start, value)
}

/// Runs `PWM100` (p. 94).
fn pwm_100(job_context: JobContext, job: &Job) -> Outcome {
    let (is_init, hz, channel) = (flag(job, 0)?, word(job, 1)?, channel(job, 2, CHANNELS)?);
    let (percent, is_new) = (byte(job, 3)?, flag(job, 4)?);
    byte(job, 5)?;
    word(job, 6)?;
    let start = is_init.then_some(|pwm: &mut Pwm| pwm.init_hz(channel, hz));
    let value = is_new.then_some(|pwm: &mut Pwm| pwm.set_percent(channel, percent));
    put(job_context, channel, start, value)
}

/// Runs `FREQUENCY` (p. 97).
fn frequency(job_context: JobContext, job: &Job) -> Outcome {
    let (is_init, input) = (flag(job, 0)?, channel(job, 1, INPUTS)?);
    let base_us = u64::from(job.argument(2, 1..=u32::MAX)?) * 1000;
    Ok(of([job_context
        .firmware
        .peripherals
        .fast_inputs
        .frequency(input, is_init, base_us, job_context.now)
        .into()]))
}

/// Runs `CYCLE` (p. 98).
fn cycle(job_context: JobContext, job: &Job) -> Outcome {
    let (is_init, input) = (flag(job, 0)?, channel(job, 1, INPUTS)?);
    Ok(of([job_context.firmware.peripherals.fast_inputs.cycle(input, is_init, job_context.now).into()]))
}

/// Runs `INC_ENCODER` (p. 99).
fn inc_encoder(job_context: JobContext, job: &Job) -> Outcome {
    let (is_init, encoder) = (flag(job, 0)?, channel(job, 1, ENCODERS)?);
    let preset = job.argument(2, 0..=u32::MAX)?.cast_signed();
    let preset = flag(job, 3)?.then_some(preset);
    let EncoderCount { counter, is_up, is_down } =
        job_context.firmware.peripherals.fast_inputs.encoder(encoder, is_init, preset, job_context.now);
    Ok(of([counter.cast_unsigned(), is_up.into(), is_down.into()]))
}

/// Adds BLINK, STATES and POINTS, which are arguments 1 to 3, to `lcd`. If `is_new`, the display shows the
/// result.
fn shown(job_context: JobContext, job: &Job, is_new: bool, lcd: Lcd) -> Outcome {
    let lcd = lcd.with(byte(job, 1)?, byte(job, 2)?, byte(job, 3)?);
    if is_new {
        job_context.firmware.peripherals.lcd = lcd;
    }
    Ok(Answer::default())
}

/// Runs `LCD_SEGMENTS` (p. 101). In DIGITS each digit has a byte. In LETTERS each letter has a word with the
/// low byte first.
fn lcd_segments(job_context: JobContext, job: &Job) -> Outcome {
    let Some((digits, letters)) = job.data.split_first_chunk::<DIGITS>() else {
        return Err(Refusal::Arguments);
    };
    let Ok(letters) = <&[u8; 2 * LETTERS]>::try_from(letters) else { return Err(Refusal::Arguments) };
    let [one, two, three] = [0, 2, 4].map(|at| u16::from_le_bytes([letters[at], letters[at + 1]]));
    shown(job_context, job, flag(job, 0)?, Lcd::segments(*digits, [one, two, three]))
}

/// Runs `LCD_TEXT` (p. 103).
fn lcd_text(job_context: JobContext, job: &Job) -> Outcome {
    if job.data.len() > PLACES {
        return Err(Refusal::Arguments);
    }
    shown(job_context, job, flag(job, 0)?, Lcd::text(&job.data))
}

/// Runs `E2WRITE` and `E2READ` (p. 109-110).
fn eeprom(job_context: JobContext, job: &Job, access: Access) -> Outcome {
    let is_enabled = flag(job, 0)?;
    let Firmware { peripherals, node, .. } = job_context.firmware;
    Ok(of([peripherals.eeprom.call(access, is_enabled, &node.registers, job_context.now)]))
}

/// True if the program uses RS 232 (p. 112-114). If not, reports a finding.
fn has_serial(job_context: &mut JobContext) -> bool {
    let Firmware { peripherals, node, .. } = &mut *job_context.firmware;
    let flag = &node.registers.flags.SERIAL_MODE;
    let is_programs = flag.load() != bool::FALSE;
    if !is_programs {
        let at = FLAGS + core::mem::offset_of!(CS0015_FLAGS, SERIAL_MODE) as u32;
        peripherals.findings.push((&rules::SERIAL_MODE, at, flag.load().into()));
    }
    is_programs
}

/// Runs `SERIAL_TX` (p. 112).
fn serial_tx(mut job_context: JobContext, job: &Job) -> Outcome {
    let byte = byte(job, 0)?;
    if has_serial(&mut job_context) {
        job_context.firmware.peripherals.serial.send(byte);
    }
    Ok(Answer::default())
}

/// Runs `SERIAL_RX` (p. 113).
fn serial_rx(mut job_context: JobContext, job: &Job) -> Outcome {
    let is_clear = flag(job, 0)?;
    has_serial(&mut job_context);
    let SerialByte { byte, available, has_overflowed } =
        job_context.firmware.peripherals.serial.take(is_clear);
    Ok(of([byte.into(), available.into(), has_overflowed.into()]))
}
