//! What the connectors of a module are (p. 77, 81), and which of its PDOs carry what (D-451).

use super::registers::values::channel;
use serde::{Deserialize, Serialize};

/// Connectors of a module.
pub const CHANNELS: usize = 8;
/// PWM frequencies in Hz (p. 77, 81).
const PWM_HZ: core::ops::RangeInclusive<u8> = 20..=200;

/// Which module it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Model {
    /// Inputs at connectors 1, 3, 5 and 7, inputs or outputs at the others.
    Cr2010,
    /// Outputs in four pairs.
    Cr2011,
}

impl Model {
    /// Its name, as its object dictionary has it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Model::Cr2010 => "CR2010",
            Model::Cr2011 => "CR2011",
        }
    }

    /// How many of its configuration values there are: one for each connector, or pair.
    #[must_use]
    pub const fn values(self) -> usize {
        match self {
            Model::Cr2010 => CHANNELS,
            Model::Cr2011 => CHANNELS / 2,
        }
    }

    /// What configuration value number `index`, from 0, can be.
    #[must_use]
    pub fn allowed(self, index: usize) -> &'static [u8] {
        match self {
            Model::Cr2010 if index.is_multiple_of(2) => &[channel::OFF, channel::DIGITAL_INPUT],
            Model::Cr2010 => {
                &[channel::OFF, channel::DIGITAL_OUTPUT, channel::ANALOG_INPUT, channel::ANALOG_OUTPUT]
            }
            Model::Cr2011 if index < self.values() => {
                &[channel::OFF, channel::DIGITAL_OUTPUT, channel::ANALOG_OUTPUT, channel::CURRENT_OUTPUT]
            }
            Model::Cr2011 => &[channel::OFF],
        }
    }
}

/// What the connectors are, and how fast PWM is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channels {
    /// Which module it is.
    pub model: Model,
    /// Of each connector, or pair.
    pub kinds: [u8; CHANNELS],
    /// PWM_FRQ in Hz.
    pub pwm_hz: u8,
}

/// What a connector does, wherever its configuration stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Nothing.
    Off,
    /// A bit that is read.
    DigitalInput,
    /// A bit that is written.
    DigitalOutput,
    /// A word that is read: this of the four.
    AnalogInput(usize),
    /// A word that is written: this of the four.
    AnalogOutput(usize),
    /// Driven when the word of its pair is positive, or negative: this of the four, and which.
    Signed(usize, bool),
}

impl Channels {
    /// All off, with the PWM frequency of the object dictionary.
    #[must_use]
    pub const fn new(model: Model) -> Self {
        Channels { model, kinds: [channel::OFF; CHANNELS], pwm_hz: 100 }
    }

    /// Sets a configuration value, from 0; `false`: it cannot be that.
    pub fn set(&mut self, index: usize, kind: u8) -> bool {
        let is_right = self.model.allowed(index).contains(&kind);
        if let (true, Some(it)) = (is_right, self.kinds.get_mut(index)) {
            *it = kind;
        }
        is_right
    }

    /// Sets the PWM frequency; `false`: it cannot be that.
    pub fn set_pwm(&mut self, hz: u8) -> bool {
        let is_right = PWM_HZ.contains(&hz);
        if is_right {
            self.pwm_hz = hz;
        }
        is_right
    }

    /// What a connector, from 0, does.
    #[must_use]
    pub fn role(&self, connector: usize) -> Role {
        let pair = connector / 2;
        let index = if self.model == Model::Cr2010 { connector } else { pair };
        match (self.model, self.kinds.get(index).copied().unwrap_or(channel::OFF)) {
            (_, channel::DIGITAL_INPUT) => Role::DigitalInput,
            (_, channel::DIGITAL_OUTPUT) => Role::DigitalOutput,
            (_, channel::ANALOG_INPUT) => Role::AnalogInput(pair),
            (Model::Cr2010, channel::ANALOG_OUTPUT) => Role::AnalogOutput(pair),
            (Model::Cr2011, channel::ANALOG_OUTPUT | channel::CURRENT_OUTPUT) => {
                Role::Signed(pair, connector.is_multiple_of(2))
            }
            _ => Role::Off,
        }
    }

    /// Whether a pair of a CR2011, from 0, tells its current.
    #[must_use]
    pub fn tells_current(&self, pair: usize) -> bool {
        self.model == Model::Cr2011 && self.kinds.get(pair) == Some(&channel::CURRENT_OUTPUT)
    }

    /// Whether there is anything in the words that it sends.
    #[must_use]
    pub fn has_words(&self) -> bool {
        (0..CHANNELS).any(|it| matches!(self.role(it), Role::AnalogInput(_)) || self.tells_current(it))
    }

    /// What a connector is driven with by a byte of bits and four words.
    #[must_use]
    pub fn driven(&self, connector: usize, bits: u8, words: [u16; 4]) -> u16 {
        let word = |index: usize| words.get(index).copied().unwrap_or(0);
        match self.role(connector) {
            Role::DigitalOutput => u16::from(bits >> connector & 1),
            Role::AnalogOutput(index) => word(index),
            Role::Signed(index, is_positive) => {
                let value = word(index).cast_signed();
                if (value > 0) == is_positive { value.unsigned_abs() } else { 0 }
            }
            Role::Off | Role::DigitalInput | Role::AnalogInput(_) => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P. 77, 81.
    #[test]
    fn each_connector_takes_what_the_manual_lists() {
        for (model, index, right) in [
            (Model::Cr2010, 0, &[0, 1][..]),
            (Model::Cr2010, 7, &[0, 2, 3, 4]),
            (Model::Cr2011, 0, &[0, 2, 4, 5]),
            (Model::Cr2011, 3, &[0, 2, 4, 5]),
            (Model::Cr2011, 4, &[0]),
        ] {
            let mut channels = Channels::new(model);
            let taken: Vec<u8> = (0..=u8::MAX).filter(|kind| channels.set(index, *kind)).collect();
            assert_eq!(taken, right, "{model:?} {index}");
        }
        let mut channels = Channels::new(Model::Cr2010);
        let taken: Vec<u8> = (0..=u8::MAX).filter(|hz| channels.set_pwm(*hz)).collect();
        assert_eq!((taken.first(), taken.last(), channels.pwm_hz), (Some(&20), Some(&200), 200));
    }

    /// Vector T35.
    #[test]
    fn the_sign_of_a_pair_says_which_connector_is_driven() {
        let mut channels = Channels::new(Model::Cr2011);
        assert!(channels.set(0, 4) && channels.set(1, 2));
        let driven = |word: i16, bits: u8| {
            [0, 1, 2, 3].map(|it| channels.driven(it, bits, [word.cast_unsigned(), 0, 0, 0]))
        };
        assert_eq!(driven(100, 0), [100, 0, 0, 0]);
        assert_eq!(driven(-100, 0b1000), [0, 100, 0, 1]);
        assert_eq!(driven(0, 0b0111), [0, 0, 1, 0]);
        assert_eq!(driven(i16::MIN, 0), [0, 32_768, 0, 0]);
    }
}
