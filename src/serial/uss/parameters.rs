//! The parameters of a simulated drive, and the answers to requests for them.

use super::pkw::{Pkw, Refusal, ReplyCode, words};
use std::collections::BTreeMap;

/// Type of the values of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterType {
    /// A word with sign.
    Integer16,
    /// A word.
    Unsigned16,
    /// A double word with sign.
    Integer32,
    /// A double word.
    Unsigned32,
    /// A double word: a number of IEEE 754.
    Real,
}

impl ParameterType {
    const fn is_double(self) -> bool {
        !matches!(self, ParameterType::Integer16 | ParameterType::Unsigned16)
    }

    /// Returns the smallest and the largest value.
    const fn range(self) -> (f64, f64) {
        match self {
            ParameterType::Integer16 => (i16::MIN as f64, i16::MAX as f64),
            ParameterType::Unsigned16 => (0.0, u16::MAX as f64),
            ParameterType::Integer32 => (i32::MIN as f64, i32::MAX as f64),
            ParameterType::Unsigned32 => (0.0, u32::MAX as f64),
            ParameterType::Real => (f32::MIN as f64, f32::MAX as f64),
        }
    }

    /// Returns the number of the type in the identifier of the description.
    const fn number(self) -> u16 {
        match self {
            ParameterType::Integer16 => 3,
            ParameterType::Integer32 => 4,
            ParameterType::Unsigned16 => 6,
            ParameterType::Unsigned32 => 7,
            ParameterType::Real => 8,
        }
    }

    /// Returns the words of a value in the range of the type.
    fn words(self, value: f64) -> Vec<u16> {
        match self {
            ParameterType::Integer16 => vec![value as i16 as u16],
            ParameterType::Unsigned16 => vec![value as u16],
            ParameterType::Integer32 => words(value as i32 as u32),
            ParameterType::Unsigned32 => words(value as u32),
            ParameterType::Real => words((value as f32).to_bits()),
        }
    }

    /// Returns the value in a request.
    fn value(self, pkw: &Pkw) -> f64 {
        match self {
            ParameterType::Integer16 => f64::from(pkw.word() as i16),
            ParameterType::Unsigned16 => f64::from(pkw.word()),
            ParameterType::Integer32 => f64::from(pkw.double() as i32),
            ParameterType::Unsigned32 => f64::from(pkw.double()),
            ParameterType::Real => f64::from(f32::from_bits(pkw.double())),
        }
    }
}

/// Parameters behind a slave.
pub trait ParameterAccess {
    /// Executes a request of the master, and returns the answer. `has_room` is true if the channel has room for a whole
    /// array.
    fn execute(&mut self, request: &Pkw, has_room: bool) -> Pkw;
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    number: u16,
    kind: ParameterType,
    values: Vec<f64>,
    stored: Vec<f64>,
    is_array: bool,
    minimum: f64,
    maximum: f64,
    is_read_only: bool,
}

impl Parameter {
    /// Returns a parameter with one value. Its limits are those of its type.
    #[must_use]
    pub fn new(number: u16, kind: ParameterType, value: f64) -> Self {
        let (minimum, maximum) = kind.range();
        let values = vec![value];
        Parameter {
            number,
            kind,
            stored: values.clone(),
            values,
            is_array: false,
            minimum,
            maximum,
            is_read_only: false,
        }
    }

    /// Returns an array with these elements, at most 255.
    #[must_use]
    pub fn array(number: u16, kind: ParameterType, values: &[f64]) -> Self {
        let (values, stored) = (values.to_vec(), values.to_vec());
        Parameter { values, stored, is_array: true, ..Parameter::new(number, kind, 0.0) }
    }

    /// Sets the limits.
    #[must_use]
    pub const fn within(mut self, minimum: f64, maximum: f64) -> Self {
        (self.minimum, self.maximum) = (minimum, maximum);
        self
    }

    /// Refuses changes by the master.
    #[must_use]
    pub const fn read_only(mut self) -> Self {
        self.is_read_only = true;
        self
    }

    /// Returns the value, or the first element of an array.
    #[cfg(feature = "emulator")]
    pub(crate) fn value(&self) -> f64 {
        self.values.first().copied().unwrap_or_default()
    }

    /// Executes a request for this parameter, and returns the answer.
    pub(crate) fn execute(&mut self, request: &Pkw, has_room: bool) -> Pkw {
        let (code, values) = answer(self, request, has_room).unwrap_or_else(refused);
        request.answer(code, values)
    }

    fn check(&self) -> Result<(), ParametersError> {
        let number = self.number;
        let (minimum, maximum) = self.kind.range();
        if number >= 32_000 {
            return Err(ParametersError::Number(number));
        }
        if self.values.is_empty() || self.values.len() > 255 {
            return Err(ParametersError::Elements { number, found: self.values.len() });
        }
        let in_type = minimum <= self.minimum && self.minimum <= self.maximum && self.maximum <= maximum;
        if !in_type {
            return Err(ParametersError::Limits { number, minimum: self.minimum, maximum: self.maximum });
        }
        match self.values.iter().find(|value| !self.permits(**value)) {
            Some(value) => Err(ParametersError::Value { number, value: *value }),
            None => Ok(()),
        }
    }

    fn permits(&self, value: f64) -> bool {
        (self.minimum..=self.maximum).contains(&value)
    }

    /// Returns the element of the description with this number.
    fn description(&self, element: u8) -> Result<Vec<u16>, Refusal> {
        const ARRAY: u16 = 1 << 14;
        const READ_ONLY: u16 = 1 << 9;
        let flag = |is_set: bool, bit: u16| if is_set { bit } else { 0 };
        match element {
            1 => {
                Ok(vec![flag(self.is_array, ARRAY) | flag(self.is_read_only, READ_ONLY) | self.kind.number()])
            }
            2 => Ok(vec![self.count()]),
            7 => Ok(self.kind.words(self.minimum)),
            8 => Ok(self.kind.words(self.maximum)),
            _ => Err(Refusal::NoDescription),
        }
    }

    /// Number of elements of an array; 0 for other parameters.
    fn count(&self) -> u16 {
        if self.is_array { self.values.len() as u16 } else { 0 }
    }

    fn element(&self, index: u8) -> Result<usize, Refusal> {
        let index = usize::from(index);
        if !self.is_array {
            Err(Refusal::NoArray)
        } else if index < self.values.len() {
            Ok(index)
        } else {
            Err(Refusal::Index)
        }
    }

    /// Code of the answer with a value.
    const fn code(&self, is_element: bool) -> ReplyCode {
        match (is_element, self.kind.is_double()) {
            (false, false) => ReplyCode::Word,
            (false, true) => ReplyCode::Double,
            (true, false) => ReplyCode::ElementWord,
            (true, true) => ReplyCode::ElementDouble,
        }
    }

    fn change(&mut self, request: &Pkw, write: Write) -> Result<Vec<u16>, Refusal> {
        if self.is_read_only {
            return Err(Refusal::ReadOnly);
        }
        // A channel of four words has two words for each value.
        let has_value =
            if write.is_double { request.values.len() == 2 } else { matches!(request.values.len(), 1 | 2) };
        if write.is_double != self.kind.is_double() || !has_value {
            return Err(Refusal::Type);
        }
        let element = if write.is_element { self.element(request.index)? } else { 0 };
        let value = self.kind.value(request);
        if !self.permits(value) {
            return Err(Refusal::Limit);
        }
        self.values[element] = value;
        if write.is_stored {
            self.stored[element] = value;
        }
        Ok(self.kind.words(value))
    }
}

/// A request that changes a value.
#[derive(Clone, Copy)]
struct Write {
    is_double: bool,
    is_element: bool,
    is_stored: bool,
}

impl Write {
    const fn of(code: u8) -> Option<Self> {
        let (is_double, is_element, is_stored) = match code {
            2 => (false, false, false),
            3 => (true, false, false),
            7 => (false, true, false),
            8 => (true, true, false),
            11 => (true, true, true),
            12 => (false, true, true),
            13 => (true, false, true),
            14 => (false, false, true),
            _ => return None,
        };
        Some(Write { is_double, is_element, is_stored })
    }
}

/// Reason for which a table of parameters is not valid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ParametersError {
    /// The number is too large.
    #[error("parameter {0}: the number must be 0 to 31999")]
    Number(u16),
    /// Two parameters have one number.
    #[error("parameter {0} is defined twice")]
    Twice(u16),
    /// The number of elements is wrong.
    #[error("parameter {number} has {found} elements; an array has 1 to 255")]
    Elements {
        /// Number of the parameter.
        number: u16,
        /// Number of elements.
        found: usize,
    },
    /// The limits are in the wrong order, or outside the range of the type.
    #[error(
        "parameter {number}: the limits {minimum} and {maximum} are in the wrong order or outside its type"
    )]
    Limits {
        /// Number of the parameter.
        number: u16,
        /// Lower limit.
        minimum: f64,
        /// Upper limit.
        maximum: f64,
    },
    /// A value is outside the limits.
    #[error("parameter {number}: the value {value} is outside the limits")]
    Value {
        /// Number of the parameter.
        number: u16,
        /// The value.
        value: f64,
    },
    /// There is no such parameter or element.
    #[error("parameter {number} has no element {index}, or is not defined")]
    NotDefined {
        /// Number of the parameter.
        number: u16,
        /// Number of the element.
        index: u8,
    },
}

/// The parameters of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    by_number: BTreeMap<u16, Parameter>,
    is_locked: bool,
}

impl Parameters {
    /// Returns a table.
    ///
    /// # Errors
    /// A number is too large or defined twice, or values and limits of a parameter do not match its type.
    pub fn new(parameters: impl IntoIterator<Item = Parameter>) -> Result<Self, ParametersError> {
        let mut by_number = BTreeMap::new();
        for parameter in parameters {
            parameter.check()?;
            let number = parameter.number;
            if by_number.insert(number, parameter).is_some() {
                return Err(ParametersError::Twice(number));
            }
        }
        Ok(Parameters { by_number, is_locked: false })
    }

    /// Returns a value. `index` is the element of an array, and 0 for other parameters.
    #[must_use]
    pub fn value(&self, number: u16, index: u8) -> Option<f64> {
        self.by_number.get(&number)?.values.get(usize::from(index)).copied()
    }

    /// Changes a value from the side of the drive. The drive may also change parameters that the master only reads.
    ///
    /// # Errors
    /// There is no such parameter or element, or the value is outside the limits.
    pub fn set(&mut self, number: u16, index: u8, value: f64) -> Result<(), ParametersError> {
        let parameter =
            self.by_number.get_mut(&number).ok_or(ParametersError::NotDefined { number, index })?;
        if !parameter.permits(value) {
            return Err(ParametersError::Value { number, value });
        }
        let element = parameter.values.get_mut(usize::from(index));
        *element.ok_or(ParametersError::NotDefined { number, index })? = value;
        Ok(())
    }

    /// Takes the right to change parameters from the master, or returns it.
    pub const fn lock(&mut self, is_locked: bool) {
        self.is_locked = is_locked;
    }

    /// Restores the values that were stored permanently, as a drive does when its supply returns.
    pub fn restart(&mut self) {
        for parameter in self.by_number.values_mut() {
            parameter.values.clone_from(&parameter.stored);
        }
    }
}

impl ParameterAccess for Parameters {
    fn execute(&mut self, request: &Pkw, has_room: bool) -> Pkw {
        match self.by_number.get_mut(&request.number) {
            None => request.refused(Refusal::Number),
            Some(_) if self.is_locked && request.is_change() => {
                request.answer(ReplyCode::NoRights, Vec::new())
            }
            Some(parameter) => parameter.execute(request, has_room),
        }
    }
}

fn refused(refusal: Refusal) -> (ReplyCode, Vec<u16>) {
    (ReplyCode::Refused, vec![refusal as u16])
}

fn answer(
    parameter: &mut Parameter,
    request: &Pkw,
    has_room: bool,
) -> Result<(ReplyCode, Vec<u16>), Refusal> {
    /// The index for all elements of an array.
    const ALL: u8 = 255;
    if let Some(write) = Write::of(request.code) {
        let values = parameter.change(request, write)?;
        return Ok((parameter.code(write.is_element), values));
    }
    let kind = parameter.kind;
    match request.code {
        1 => Ok((parameter.code(false), kind.words(parameter.values[0]))),
        4 => Ok((ReplyCode::Description, parameter.description(request.index)?)),
        5 => Err(Refusal::Description),
        6 if request.index == ALL && has_room && parameter.is_array => {
            let values = parameter.values.iter().flat_map(|value| kind.words(*value)).collect();
            Ok((parameter.code(true), values))
        }
        6 => {
            let element = parameter.element(request.index)?;
            Ok((parameter.code(true), kind.words(parameter.values[element])))
        }
        9 if parameter.is_array => Ok((ReplyCode::Count, vec![parameter.count()])),
        9 => Err(Refusal::NoArray),
        15 => Err(Refusal::NoText),
        _ => Err(Refusal::Other),
    }
}
