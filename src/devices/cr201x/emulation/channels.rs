//! Functions of a module's connectors (p. 77, 81), and the content of its PDOs (D-451).

use crate::devices::cr201x::registers::values::channel;
use serde::{Deserialize, Serialize};

/// Number of connectors of a module.
pub const CHANNELS: usize = 8;
/// PWM frequencies in Hz (p. 77, 81).
const PWM_HZ: core::ops::RangeInclusive<u8> = 20..=200;

/// Type of the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Model {
    /// CR2010: inputs at connectors 1, 3, 5 and 7; inputs or outputs at the other connectors.
    Cr2010,
    /// Outputs in four pairs.
    Cr2011,
}

impl Model {
    /// Returns the name in the object dictionary.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Model::Cr2010 => "CR2010",
            Model::Cr2011 => "CR2011",
        }
    }

    /// Returns the number of configuration values: one for each connector, or one for each pair of
    /// connectors.
    #[must_use]
    pub const fn values(self) -> usize {
        match self {
            Model::Cr2010 => CHANNELS,
            Model::Cr2011 => CHANNELS / 2,
        }
    }

    /// Returns the permitted values of configuration value `index`, counted from 0.
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

/// Configuration of the connectors, and PWM frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channels {
    /// Type of the module.
    pub model: Model,
    /// Configuration value of each connector, or pair.
    pub kinds: [u8; CHANNELS],
    /// Frequency of the PWM outputs in Hz (PWM_FRQ).
    pub pwm_hz: u8,
}

/// Function of a connector, for both types of module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The connector has no function.
    Off,
    /// The connector carries an input bit.
    DigitalInput,
    /// The connector carries an output bit.
    DigitalOutput,
    /// Number of the input word, 0 to 3.
    AnalogInput(usize),
    /// Number of the output word, 0 to 3.
    AnalogOutput(usize),
    /// The connector is driven by a signed word. The first field is the number of the word. The second field
    /// is true if positive values drive this connector, and false if negative values do.
    Signed(usize, bool),
}

impl Channels {
    /// All connectors off, with the default PWM frequency of the object dictionary.
    #[must_use]
    pub const fn new(model: Model) -> Self {
        Channels { model, kinds: [channel::OFF; CHANNELS], pwm_hz: 100 }
    }

    /// Sets configuration value `index`, counted from 0; returns `false` if the value is not permitted.
    pub fn set(&mut self, index: usize, kind: u8) -> bool {
        let is_right = self.model.allowed(index).contains(&kind);
        if let (true, Some(it)) = (is_right, self.kinds.get_mut(index)) {
            *it = kind;
        }
        is_right
    }

    /// Sets the PWM frequency; returns `false` if the value is not permitted.
    pub fn set_pwm(&mut self, hz: u8) -> bool {
        let is_right = PWM_HZ.contains(&hz);
        if is_right {
            self.pwm_hz = hz;
        }
        is_right
    }

    /// Returns the function of a connector, counted from 0.
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

    /// True if a pair of a CR2011, counted from 0, reports its current.
    #[must_use]
    pub fn reports_current(&self, pair: usize) -> bool {
        self.model == Model::Cr2011 && self.kinds.get(pair) == Some(&channel::CURRENT_OUTPUT)
    }

    /// True if the module has at least one analog value to send.
    #[must_use]
    pub fn has_words(&self) -> bool {
        (0..CHANNELS).any(|it| matches!(self.role(it), Role::AnalogInput(_)) || self.reports_current(it))
    }

    /// Returns the value that drives a connector. `bits` contains the digital outputs, `words` the analog
    /// outputs.
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

    /// Manual p. 77, 81.
    #[test]
    fn each_connector_accepts_the_values_in_the_manual() {
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
