//! The drive's parameters: numbers 0 to 4095, word or doubleword, with limits.

use crate::devices::cansync::frames::codec::parameter::MAX_NUMBER;
use crate::devices::cansync::registers::values::par_error;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Width of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[serde(expecting = "the format of a parameter, as a word")]
pub enum ParamFormat {
    /// The parameter has 16 bits.
    Word,
    /// The parameter has 32 bits.
    Doubleword,
}

impl ParamFormat {
    /// Returns the number of bytes, 2 or 4.
    pub const fn bytes(self) -> usize {
        match self {
            ParamFormat::Word => 2,
            ParamFormat::Doubleword => 4,
        }
    }

    /// Returns the highest unsigned value.
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
#[serde(expecting = "a parameter: a table with its settings")]
pub struct ParameterSpec {
    /// Parameter number, 0 to 4095.
    pub number: u16,
    /// Width of the parameter: word or doubleword.
    pub format: ParamFormat,
    /// Value of the parameter after power-on.
    #[serde(default)]
    pub initial: u32,
    /// Lowest value that can be written from outside. If it is negative, the parameter is signed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<i64>,
    /// Highest value that can be written from outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<i64>,
    /// True if only the drive writes the parameter.
    #[serde(default)]
    pub read_only: bool,
    /// Duration of the recalculation after a write from outside, in us. During this time, parameter jobs
    /// cannot access the parameter.
    #[serde(default)]
    pub settle_us: u32,
}

impl ParameterSpec {
    /// Returns a parameter with value 0 and without limits.
    pub const fn new(number: u16, format: ParamFormat) -> Self {
        ParameterSpec { number, format, initial: 0, min: None, max: None, read_only: false, settle_us: 0 }
    }

    /// Returns the parameter with write access for the drive only.
    pub const fn read_only(self) -> Self {
        ParameterSpec { read_only: true, ..self }
    }

    /// Returns true if this entry only sets the value of the drive's own parameter `own` after power-on, and
    /// `own` is writable.
    pub(super) fn is_value_of(&self, own: &ParameterSpec) -> bool {
        !own.read_only
            && *self == ParameterSpec { initial: self.initial, ..ParameterSpec::new(own.number, own.format) }
    }

    /// Returns the lowest and highest value of the format.
    fn format_limits(&self) -> (u32, u32) {
        match (self.is_signed(), self.format) {
            (false, format) => (0, format.mask()),
            (true, ParamFormat::Word) => (0x8000, 0x7FFF),
            (true, ParamFormat::Doubleword) => (0x8000_0000, 0x7FFF_FFFF),
        }
    }

    /// Lowest and highest value.
    fn limits(&self) -> (u32, u32) {
        let (lowest, highest) = self.format_limits();
        let bits = |limit: i64| limit as u32 & self.format.mask();
        (self.min.map_or(lowest, bits), self.max.map_or(highest, bits))
    }

    /// Lowest and highest value as numbers.
    pub(super) fn range(&self) -> (i64, i64) {
        let (lowest, highest) = self.limits();
        (self.number_of(lowest), self.number_of(highest))
    }

    /// Returns the number with these bits.
    pub(super) fn number_of(&self, bits: u32) -> i64 {
        match (self.is_signed(), self.format) {
            (false, _) => i64::from(bits),
            (true, ParamFormat::Word) => i64::from(bits as u16 as i16),
            (true, ParamFormat::Doubleword) => i64::from(bits as i32),
        }
    }

    fn is_signed(&self) -> bool {
        self.min.is_some_and(|min| min < 0)
    }

    /// Checks a value. The error is the error number of the manual: 16#FFFE or 16#FFFD.
    fn check(&self, value: u32) -> Result<(), u16> {
        let value = self.number_of(value);
        if self.min.is_some_and(|min| value < min) {
            return Err(par_error::BELOW_MINIMUM);
        }
        if self.max.is_some_and(|max| value > max) {
            return Err(par_error::ABOVE_MAXIMUM);
        }
        Ok(())
    }
}

/// Reason why a parameter of the plant file is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParameterError {
    /// The parameter number is above 4095.
    #[error("the number is above 4095")]
    Number,
    /// Another parameter already has the number.
    #[error("the number is used twice")]
    Twice,
    /// An entry of the plant file defines one of the drive's own parameters again.
    #[error(
        "the drive has this parameter itself (layouts/v-regler); an entry may only set `initial` with the same format, and only for a writable parameter except the control word"
    )]
    Own,
    /// The initial value needs more bits.
    #[error("initial value 16#{0:X} does not fit a word")]
    Width(u32),
    /// The initial value violates the limits.
    #[error("initial value 16#{0:X} is outside the limits of the parameter")]
    Limits(u32),
}

/// Index of a parameter in the store of a drive. The index is valid only for that drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct ParameterSlot(u16);

impl ParameterSlot {
    /// A store has at most 4096 parameters.
    fn at(index: usize) -> Self {
        ParameterSlot(index as u16)
    }

    #[inline]
    fn index(self) -> usize {
        self.0.into()
    }
}

/// The parameters of one drive, in the order of their numbers.
#[derive(Clone, Debug)]
pub(super) struct ParameterStore {
    /// Definitions of the parameters. Drives with equal definitions share them.
    specs: Arc<[ParameterSpec]>,
    values: Box<[u32]>,
    changed: bool,
    /// The parameter with write detection, see [`ParameterStore::watch`].
    watched: Option<ParameterSlot>,
    written: bool,
    /// Parameters in recalculation, with the remaining time in us.
    settling: Vec<(ParameterSlot, u32)>,
}

impl SnapshotFields for ParameterStore {
    fn save(&self, to: &mut Saving) {
        let Self { specs: _, values, changed, watched: _, written, settling } = self;
        to.value(&(values, changed, written, settling));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        (self.values, self.changed, self.written, self.settling) = from.value()?;
        from.check(self.values.len() == self.specs.len(), "number of parameters")
    }
}

impl ParameterStore {
    /// Creates a store with the given parameters. The error names the wrong parameter.
    pub(crate) fn new(mut specs: Vec<ParameterSpec>) -> Result<Self, (u16, ParameterError)> {
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
        let (watched, settling) = (None, Vec::new());
        Ok(ParameterStore { specs: specs.into(), values, changed: true, watched, written: false, settling })
    }

    /// If the store of another drive has equal definitions, shares its definitions.
    pub(crate) fn share(&mut self, other: &ParameterStore) {
        if self.specs == other.specs {
            self.specs = Arc::clone(&other.specs);
        }
    }

    /// Switches on write detection for one parameter. A write that does not change the value counts, too.
    pub(crate) fn watch(&mut self, slot: ParameterSlot) {
        self.watched = Some(slot);
    }

    /// Returns true if the watched parameter was written since the last call.
    #[inline]
    pub(crate) fn take_written(&mut self) -> bool {
        std::mem::take(&mut self.written)
    }

    /// Advances the clock for recalculations.
    #[inline]
    pub(crate) fn pass(&mut self, us: u32) {
        if !self.settling.is_empty() {
            self.settling.retain_mut(|(_, left)| {
                *left = left.saturating_sub(us);
                *left > 0
            });
        }
    }

    /// Returns true if a parameter is in recalculation.
    pub(crate) fn is_settling(&self) -> bool {
        !self.settling.is_empty()
    }

    /// Returns true if the parameter is available, that is, not in recalculation.
    #[inline]
    pub(crate) fn is_available(&self, slot: ParameterSlot) -> bool {
        self.settling.iter().all(|(settling, _)| *settling != slot)
    }

    /// Returns the lowest and the highest value of a parameter, in its format.
    pub(crate) fn limits(&self, slot: ParameterSlot) -> (u32, u32) {
        self.specs[slot.index()].limits()
    }

    /// Returns the slot of parameter `number`.
    pub(crate) fn slot(&self, number: u16) -> Option<ParameterSlot> {
        self.specs.binary_search_by_key(&number, |spec| spec.number).ok().map(ParameterSlot::at)
    }

    /// Returns all parameters of the drive.
    pub(super) fn slots(&self) -> impl Iterator<Item = ParameterSlot> {
        (0..self.specs.len()).map(ParameterSlot::at)
    }

    /// Returns the definition of a parameter.
    pub(super) fn spec(&self, slot: ParameterSlot) -> &ParameterSpec {
        &self.specs[slot.index()]
    }

    /// Returns the width of a parameter.
    pub(crate) fn format(&self, slot: ParameterSlot) -> ParamFormat {
        self.specs[slot.index()].format
    }

    /// Returns true if only the drive may write the parameter.
    pub(crate) fn is_read_only(&self, slot: ParameterSlot) -> bool {
        self.specs[slot.index()].read_only
    }

    /// Returns the value of a parameter.
    #[inline]
    pub(crate) fn get(&self, slot: ParameterSlot) -> u32 {
        self.values[slot.index()]
    }

    /// Sets a parameter from inside the drive, without a check of limits. [`ParameterStore::write`] is for
    /// values from outside.
    #[inline]
    pub(crate) fn set(&mut self, slot: ParameterSlot, value: u32) {
        let place = &mut self.values[slot.index()];
        self.changed |= *place != value;
        *place = value;
        self.written |= self.watched == Some(slot);
    }

    /// Returns true if a value has changed since the last call.
    #[inline]
    pub(crate) fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    /// Returns true if [`ParameterStore::write`] accepts every value of the parameter's format at any time.
    pub(crate) fn takes_every_value(&self, slot: ParameterSlot) -> bool {
        let spec = &self.specs[slot.index()];
        !spec.read_only && spec.settle_us == 0 && spec.limits() == spec.format_limits()
    }

    /// Writes a parameter with a value from outside. The error is an error number of the manual (5.00005.03a
    /// p. 166).
    pub(crate) fn write(&mut self, slot: ParameterSlot, format: ParamFormat, value: u32) -> Result<(), u16> {
        let spec = &self.specs[slot.index()];
        if spec.read_only {
            return Err(par_error::NOT_CHANGEABLE);
        }
        if spec.format != format {
            return Err(par_error::DATA_FORMAT);
        }
        let settle_us = spec.settle_us;
        if !self.is_available(slot) {
            return Err(par_error::NOT_AVAILABLE_NOW);
        }
        spec.check(value)?;
        self.set(slot, value);
        if settle_us > 0 {
            self.settling.push((slot, settle_us));
        }
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
    fn limits_have_the_width_of_the_format() {
        let word = ParameterSpec::new(1, Word);
        for (spec, limits) in [
            (word, (0, 0xFFFF)),
            (ParameterSpec { min: Some(-10), ..word }, (0xFFF6, 0x7FFF)),
            (ParameterSpec { min: Some(3), max: Some(4), ..word }, (3, 4)),
            (ParameterSpec { min: Some(-1), format: Doubleword, ..word }, (0xFFFF_FFFF, 0x7FFF_FFFF)),
        ] {
            assert_eq!(spec.limits(), limits, "{spec:?}");
        }
    }

    #[test]
    fn a_parameter_with_the_limits_of_its_format_takes_every_value() {
        let word = ParameterSpec::new(1, Word);
        let wide = ParameterSpec::new(1, Doubleword);
        let signed = ParameterSpec { min: Some(i32::MIN.into()), max: Some(i32::MAX.into()), ..wide };
        for (spec, takes) in [
            (word, true),
            (wide, true),
            (signed, true),
            (ParameterSpec { max: None, ..signed }, true),
            (ParameterSpec { min: Some(0), max: Some(0xFFFF), ..word }, true),
            (ParameterSpec { max: Some(5), ..word }, false),
            (ParameterSpec { min: Some(-5), ..wide }, false),
            (ParameterSpec { settle_us: 1, ..word }, false),
            (word.read_only(), false),
        ] {
            let store = store(&[ParameterSpec { initial: 0, ..spec }]).unwrap();
            assert_eq!(store.takes_every_value(store.slot(1).unwrap()), takes, "{spec:?}");
        }
    }

    #[test]
    fn a_parameter_in_recalculation_cannot_be_written() {
        let mut store = store(&[ParameterSpec { settle_us: 1000, ..ParameterSpec::new(1, Word) }]).unwrap();
        let slot = store.slot(1).unwrap();
        assert_eq!(store.write(slot, Word, 5), Ok(()));
        assert_eq!(store.write(slot, Word, 6), Err(par_error::NOT_AVAILABLE_NOW));
        store.pass(999);
        assert!(store.is_settling() && !store.is_available(slot));
        store.pass(1);
        assert!(!store.is_settling());
        assert_eq!((store.write(slot, Word, 6), store.get(slot)), (Ok(()), 6));
    }

    #[test]
    fn watched_parameter_counts_as_written_also_with_the_same_value() {
        let mut store = store(&[ParameterSpec::new(1, Word), ParameterSpec::new(2, Word)]).unwrap();
        let (watched, other) = (store.slot(1).unwrap(), store.slot(2).unwrap());
        store.watch(watched);
        store.set(other, 1);
        assert!(!store.take_written());
        store.set(watched, 0);
        assert!(store.take_written() && !store.take_written());
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
        assert_eq!(store.write(limited, Word, 6), Err(par_error::ABOVE_MAXIMUM));
        assert_eq!(store.write(limited, Doubleword, 1), Err(par_error::DATA_FORMAT));
        assert_eq!(store.write(closed, Word, 1), Err(par_error::NOT_CHANGEABLE));
        assert_eq!((store.get(limited), store.get(closed)), (5, 0));
    }
}
