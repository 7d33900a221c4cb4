//! The drive's parameters: numbers 0 to 4095, word or doubleword, with limits.

use crate::bus::codec::parameter::{MAX_NUMBER, error_number};
use serde::{Deserialize, Serialize};

/// Width of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParamFormat {
    /// 16 bits.
    Word,
    /// 32 bits.
    Doubleword,
}

impl ParamFormat {
    /// Number of bytes, 2 or 4.
    pub const fn bytes(self) -> usize {
        match self {
            ParamFormat::Word => 2,
            ParamFormat::Doubleword => 4,
        }
    }

    /// The highest unsigned value.
    pub const fn mask(self) -> u32 {
        match self {
            ParamFormat::Word => 0xFFFF,
            ParamFormat::Doubleword => 0xFFFF_FFFF,
        }
    }
}

/// One parameter of a drive in the plant file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    /// Parameter number, 0 to 4095.
    pub number: u16,
    /// Word or doubleword.
    pub format: ParamFormat,
    /// Value after power-on.
    #[serde(default)]
    pub initial: u32,
    /// Lowest value that a parameter job may write; a negative one makes the parameter signed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<i64>,
    /// Highest value that a parameter job may write.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<i64>,
    /// Parameter jobs cannot change it.
    #[serde(default)]
    pub read_only: bool,
}

impl ParameterSpec {
    /// A parameter with value 0 and without limits.
    pub const fn new(number: u16, format: ParamFormat) -> Self {
        ParameterSpec { number, format, initial: 0, min: None, max: None, read_only: false }
    }

    /// The same, closed to parameter jobs.
    pub const fn read_only(self) -> Self {
        ParameterSpec { read_only: true, ..self }
    }

    /// Refusal of a value: its error number (16#FFFE or 16#FFFD).
    fn check(&self, value: u32) -> Result<(), u16> {
        let signed = self.min.is_some_and(|min| min < 0);
        let value = match (signed, self.format) {
            (false, _) => i64::from(value),
            (true, ParamFormat::Word) => i64::from(value as u16 as i16),
            (true, ParamFormat::Doubleword) => i64::from(value as i32),
        };
        if self.min.is_some_and(|min| value < min) {
            return Err(error_number::BELOW_MINIMUM);
        }
        if self.max.is_some_and(|max| value > max) {
            return Err(error_number::ABOVE_MAXIMUM);
        }
        Ok(())
    }
}

/// What is wrong with a parameter of the plant file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParameterError {
    /// Number above 4095.
    #[error("the number is above 4095")]
    Number,
    /// Number in use already.
    #[error("the number is there twice (120, 121 and the speed parameters are built in)")]
    Twice,
    /// The initial value needs more bits.
    #[error("initial value 16#{0:X} does not fit a word")]
    Width(u32),
    /// The initial value violates the limits.
    #[error("initial value 16#{0:X} lies outside its own limits")]
    Limits(u32),
}

/// Place of a parameter in the store of the drive that gave it away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slot(usize);

/// All parameters of one drive, in the order of their numbers.
#[derive(Clone, Debug)]
pub(super) struct ParameterStore {
    specs: Vec<ParameterSpec>,
    values: Vec<u32>,
    changed: bool,
}

impl ParameterStore {
    /// A store with the given parameters; the error names the parameter at fault.
    pub fn new(mut specs: Vec<ParameterSpec>) -> Result<Self, (u16, ParameterError)> {
        specs.sort_by_key(|spec| spec.number);
        for spec in &specs {
            let fault = if spec.number > MAX_NUMBER {
                ParameterError::Number
            } else if spec.initial > spec.format.mask() {
                ParameterError::Width(spec.initial)
            } else if spec.check(spec.initial).is_err() {
                ParameterError::Limits(spec.initial)
            } else {
                continue;
            };
            return Err((spec.number, fault));
        }
        if let Some(twice) = specs.windows(2).find(|pair| pair[0].number == pair[1].number) {
            return Err((twice[0].number, ParameterError::Twice));
        }
        let values = specs.iter().map(|spec| spec.initial).collect();
        Ok(ParameterStore { specs, values, changed: true })
    }

    /// Where parameter `number` is.
    pub fn slot(&self, number: u16) -> Option<Slot> {
        self.specs.binary_search_by_key(&number, |spec| spec.number).ok().map(Slot)
    }

    /// Width of a parameter.
    pub fn format(&self, slot: Slot) -> ParamFormat {
        self.specs[slot.0].format
    }

    /// Whether only the drive itself may write the parameter.
    pub fn is_read_only(&self, slot: Slot) -> bool {
        self.specs[slot.0].read_only
    }

    /// Value of a parameter.
    #[inline]
    pub fn get(&self, slot: Slot) -> u32 {
        self.values[slot.0]
    }

    /// Sets a parameter from inside the drive; limits do not apply.
    #[inline]
    pub fn set(&mut self, slot: Slot, value: u32) {
        let place = &mut self.values[slot.0];
        self.changed |= *place != value;
        *place = value;
    }

    /// Whether any value has changed since the last call.
    #[inline]
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    /// Writes a parameter for a parameter job; the error is an error number of the manual.
    pub fn write(&mut self, slot: Slot, format: ParamFormat, value: u32) -> Result<(), u16> {
        let spec = &self.specs[slot.0];
        if spec.read_only {
            return Err(error_number::NOT_CHANGEABLE);
        }
        if spec.format != format {
            return Err(error_number::DATA_FORMAT);
        }
        spec.check(value)?;
        self.set(slot, value);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ParamFormat::{Doubleword, Word};

    fn store(specs: &[ParameterSpec]) -> Result<ParameterStore, (u16, ParameterError)> {
        ParameterStore::new(specs.to_vec())
    }

    #[test]
    fn finds_parameters_in_any_order() {
        let specs =
            [7, 4095, 0, 300].map(|n| ParameterSpec { initial: u32::from(n), ..ParameterSpec::new(n, Word) });
        let store = store(&specs).unwrap();
        for number in [0, 7, 300, 4095] {
            assert_eq!(store.slot(number).map(|slot| store.get(slot)), Some(u32::from(number)));
        }
        assert_eq!(store.slot(8), None);
    }

    #[test]
    fn refuses_faulty_definitions() {
        let word = ParameterSpec::new(5, Word);
        for (specs, fault) in [
            (vec![ParameterSpec { number: 4096, ..word }], (4096, ParameterError::Number)),
            (vec![word, ParameterSpec::new(5, Doubleword)], (5, ParameterError::Twice)),
            (vec![ParameterSpec { initial: 0x1_0000, ..word }], (5, ParameterError::Width(0x1_0000))),
            (vec![ParameterSpec { initial: 1, max: Some(0), ..word }], (5, ParameterError::Limits(1))),
        ] {
            assert_eq!(store(&specs).err(), Some(fault));
        }
    }

    #[test]
    fn limits_are_signed_if_the_minimum_is_negative() {
        let signed = ParameterSpec { min: Some(-10), max: Some(10), ..ParameterSpec::new(1, Word) };
        let unsigned = ParameterSpec { min: Some(10), max: Some(0xFFF0), ..ParameterSpec::new(2, Word) };
        let wide = ParameterSpec { min: Some(-10), max: None, ..ParameterSpec::new(3, Doubleword) };
        for (spec, value, result) in [
            (signed, 0xFFF6, Ok(())),
            (signed, 0xFFF5, Err(0xFFFE)),
            (signed, 10, Ok(())),
            (signed, 11, Err(0xFFFD)),
            (unsigned, 9, Err(0xFFFE)),
            (unsigned, 0xFFF0, Ok(())),
            (unsigned, 0xFFF1, Err(0xFFFD)),
            (wide, 0xFFFF_FFF6, Ok(())),
            (wide, 0xFFFF_FFF5, Err(0xFFFE)),
            (wide, 0x7FFF_FFFF, Ok(())),
        ] {
            assert_eq!(spec.check(value), result, "{spec:?} 16#{value:X}");
        }
    }

    #[test]
    fn a_refused_write_changes_nothing() {
        let mut store = store(&[
            ParameterSpec { max: Some(5), ..ParameterSpec::new(1, Word) },
            ParameterSpec::new(2, Word).read_only(),
        ])
        .unwrap();
        let (limited, closed) = (store.slot(1).unwrap(), store.slot(2).unwrap());
        assert_eq!(store.write(limited, Word, 5), Ok(()));
        assert_eq!(store.write(limited, Word, 6), Err(error_number::ABOVE_MAXIMUM));
        assert_eq!(store.write(limited, Doubleword, 1), Err(error_number::DATA_FORMAT));
        assert_eq!(store.write(closed, Word, 1), Err(error_number::NOT_CHANGEABLE));
        assert_eq!((store.get(limited), store.get(closed)), (5, 0));
    }
}
