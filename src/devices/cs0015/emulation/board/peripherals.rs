//! All peripherals of the controller except CAN: PWM, fast inputs, display, RS 232, EEPROM (p. 86-114).

use super::eeprom::Eeprom;
use super::fast_inputs::{ENCODERS, FastInputs, INPUTS};
use super::lcd::{DIGITS, Lcd};
use super::pwm::{CHANNELS, Pwm};
use super::serial::Serial;
use super::slow_inputs::SlowInputs;
use super::watch::{Watch, WatchFinding};
use crate::devices::cs0015::emulation::ram::Registers;
use crate::devices::cs0015::registers::values::{bool, turn};
use crate::devices::cs0015::registers::{
    FRONT_DISPLAY_1, FRONT_DISPLAY_2, FRONT_DISPLAY_3, FRONT_DISPLAY_4, FRONT_INPUTS, FRONT_MHZ_0,
    FRONT_MHZ_1, FRONT_MHZ_2, FRONT_MHZ_3, FRONT_TURN_0, FRONT_TURN_1,
};
use crate::snapshot_fields;

const MHZ: [usize; INPUTS] = [FRONT_MHZ_0, FRONT_MHZ_1, FRONT_MHZ_2, FRONT_MHZ_3];
const TURN: [usize; ENCODERS] = [FRONT_TURN_0, FRONT_TURN_1];
const DISPLAY: [usize; 4] = [FRONT_DISPLAY_1, FRONT_DISPLAY_2, FRONT_DISPLAY_3, FRONT_DISPLAY_4];

/// Returns the terminals In 0 to In 15 from the front panel, bit n for input n.
fn terminals(registers: &Registers) -> u16 {
    registers.turned(FRONT_INPUTS) as u16
}

/// The peripherals that the program uses by the functions of chapters 6 to 9.
#[derive(Clone, Debug, Default)]
pub(crate) struct Peripherals {
    pub pwm: Pwm,
    pub fast_inputs: FastInputs,
    slow_inputs: SlowInputs,
    pub lcd: Lcd,
    pub serial: Serial,
    pub eeprom: Eeprom,
    /// Time in microseconds at which the supply was switched on, for the timers.
    pub on_since: u64,
    /// Violations of the manual by the program.
    pub findings: Vec<WatchFinding>,
    watch: Watch,
    /// State that registers and display show.
    shown: Option<(Pwm, Lcd, bool)>,
}

snapshot_fields!(Peripherals {
    values: pwm, fast_inputs, slow_inputs, lcd, serial, eeprom, on_since, shown;
    parts: watch;
    // The CAN port of the board removes and reports all findings at the end of each event. So the list is empty when
    // a snapshot is taken.
    built: findings
});

impl Peripherals {
    pub(crate) fn power_on(&mut self, registers: &Registers, now: u64) {
        self.fast_inputs.power_on();
        let fast_inputs = core::mem::take(&mut self.fast_inputs);
        let slow_inputs = SlowInputs::power_on(terminals(registers), now);
        *self = Peripherals { fast_inputs, slow_inputs, on_since: now, ..Self::default() };
        self.serial.power_on(&registers.peripherals);
    }

    /// Runs a processor cycle: reads the changes at the terminals.
    pub(crate) fn look(&mut self, registers: &Registers, now: u64) {
        for (signal, word) in self.fast_inputs.signals.iter_mut().zip(MHZ) {
            signal.set(registers.turned(word), now);
        }
        for (is_backwards, word) in self.fast_inputs.is_backwards.iter_mut().zip(TURN) {
            *is_backwards = registers.turned(word) == turn::BACKWARDS;
        }
        self.slow_inputs.look(terminals(registers), now);
        self.serial.look(&registers.peripherals, now);
        self.findings.extend(self.watch.look(registers));
    }

    /// Returns inputs 0 to 15 as the program reads them. If an input has a signal, its value is the level of
    /// the signal. Inputs from 4 on are filtered.
    pub(crate) fn inputs(&self, registers: &Registers, now: u64) -> u16 {
        let (levels, there) = self.fast_inputs.levels(now);
        self.slow_inputs.levels(terminals(registers)) & !there | levels
    }

    /// Returns the time of the next due event; `u64::MAX` if there is none.
    pub(crate) fn next_time(&self) -> u64 {
        self.serial.next_time().min(self.eeprom.next_time())
    }

    /// Handles the due events.
    pub(crate) fn due(&mut self, registers: &Registers, now: u64) {
        let is_programs = registers.flags.SERIAL_MODE.load() != bool::FALSE;
        self.serial.due(&registers.peripherals, is_programs, now);
        self.eeprom.due(registers, now);
    }

    /// Updates the registers of the display and of the PWM outputs. The PWM outputs are on if `is_driven`.
    pub(crate) fn show(&mut self, registers: &Registers, is_driven: bool) {
        let shown = Some((self.pwm, self.lcd, is_driven));
        if core::mem::replace(&mut self.shown, shown) == shown {
            return;
        }
        let shown = &registers.peripherals;
        for channel in 0..CHANNELS {
            let duty = if is_driven { self.pwm.duty(channel) as u16 } else { 0 };
            shown.a_PWM_DUTY[channel].store(duty);
            shown.a_PWM_HZ[channel].store(self.pwm.hz(channel) as u16);
        }
        let Lcd { text, digits, letters, blink, states, points } = self.lcd;
        shown.a_LCD_DIGITS.iter().zip(digits).for_each(|(cell, segments)| cell.store(segments));
        shown.a_LCD_LETTERS.iter().zip(letters).for_each(|(cell, segments)| cell.store(segments));
        shown.b_LCD_BLINK.store(blink);
        shown.b_LCD_STATES.store(states);
        shown.b_LCD_POINTS.store(points);
        let mut characters = [b' '; 4 * DISPLAY.len()];
        let places = text.iter().enumerate().flat_map(|(place, character)| {
            let has_point = place < DIGITS && points >> place & 1 != 0;
            let character = if matches!(character, b' '..=b'~') { *character } else { b' ' };
            [Some(character), has_point.then_some(b'.')].into_iter().flatten()
        });
        characters.iter_mut().zip(places).for_each(|(to, from)| *to = from);
        for (word, four) in DISPLAY.into_iter().zip(characters.as_chunks().0) {
            registers.shown(word).store(u32::from_le_bytes(*four));
        }
    }

    /// Switches the display off.
    pub(crate) fn power_off(&self, registers: &Registers) {
        DISPLAY.into_iter().for_each(|word| registers.shown(word).store(0));
    }
}
