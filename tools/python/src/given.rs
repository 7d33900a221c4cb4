//! Arguments of calls from Python.

use crate::errors::wrong_type;
use commram::script::{Span, Value};
use core::time::Duration;
use pyo3::exceptions::{PyOverflowError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyString};
use std::path::PathBuf;

/// Converts an integer. Refuses values that Python would convert to an integer, such as a bool or a float.
fn integer(given: &Bound<'_, PyAny>, right: &str) -> PyResult<i64> {
    if given.is_instance_of::<PyBool>() {
        return Err(wrong_type(given, right));
    }
    given.extract().map_err(|error: PyErr| match error.is_instance_of::<PyOverflowError>(given.py()) {
        true => PyValueError::new_err(format!("{given} is out of range, {right}")),
        false => wrong_type(given, right),
    })
}

/// A number that is not negative.
pub(crate) struct Number<T>(pub T);

impl<'py, T: TryFrom<u64> + Unsigned> FromPyObject<'_, 'py> for Number<T> {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let out_of_range = || PyValueError::new_err(format!("{}: a number from 0 to {}", &*given, T::MOST));
        let number: u64 = given.extract().map_err(|error: PyErr| {
            if error.is_instance_of::<PyOverflowError>(given.py()) { out_of_range() } else { error }
        })?;
        T::try_from(number).map(Number).map_err(|_| out_of_range())
    }
}

/// An unsigned type of Rust.
pub(crate) trait Unsigned {
    /// The largest number of the type.
    const MOST: u64;
}

impl Unsigned for u16 {
    const MOST: u64 = u16::MAX as u64;
}

impl Unsigned for u32 {
    const MOST: u64 = u32::MAX as u64;
}

impl Unsigned for u64 {
    const MOST: u64 = u64::MAX;
}

impl Unsigned for usize {
    const MOST: u64 = usize::MAX as u64;
}

/// A value for a register: an integer or a text such as `16#0040`.
pub(crate) struct ValueArgument(pub Value);

impl<'py> FromPyObject<'_, 'py> for ValueArgument {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(text) = given.cast::<PyString>() {
            return Ok(ValueArgument(Value::Text(text.to_str()?.to_owned())));
        }
        let right = "a register takes an integer such as 0x0040 or a text such as \"16#0040\"";
        integer(&given, right).map(|number| ValueArgument(Value::Number(number)))
    }
}

/// A time: a text with a unit, or an integer of microseconds.
pub(crate) struct Time(pub Span);

impl<'py> FromPyObject<'_, 'py> for Time {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(text) = given.cast::<PyString>() {
            return Ok(Time(Span::Text(text.to_str()?.to_owned())));
        }
        let right = "a time is a text with a unit such as \"2ms\", or an integer of microseconds";
        let us = integer(&given, right)?;
        match u64::try_from(us) {
            Ok(us) => Ok(Time(Span::Us(us))),
            Err(_) => Err(PyValueError::new_err(format!("{us}: a time is not negative"))),
        }
    }
}

/// Converts a number of seconds of real time to a timeout. An infinite number becomes the longest timeout.
///
/// # Errors
/// The number is negative or is not a number.
pub(crate) fn timeout(seconds: f64) -> PyResult<Duration> {
    if seconds >= 0.0 {
        return Ok(Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
    }
    Err(PyValueError::new_err(format!("{seconds}: a timeout is a number of seconds, 0 or greater")))
}

/// Data of a frame: `44 33 .. 11`, or bytes.
pub(crate) struct Data(pub String);

impl<'py> FromPyObject<'_, 'py> for Data {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(text) = given.cast::<PyString>() {
            return Ok(Data(text.to_str()?.to_owned()));
        }
        if let Ok(bytes) = given.cast::<PyBytes>() {
            let hex: Vec<_> = bytes.as_bytes().iter().map(|byte| format!("{byte:02X}")).collect();
            return Ok(Data(hex.join(" ")));
        }
        let right = "data are bytes or a text such as \"44 33 .. 11\"";
        match given.extract::<Vec<u8>>() {
            Ok(bytes) => {
                Ok(Data(bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")))
            }
            Err(_) => Err(wrong_type(&given, right)),
        }
    }
}

/// A plant: the built-in one, the text of a plant file, or its path.
pub(crate) enum Plant {
    BuiltIn,
    Text(String),
    File(PathBuf),
}

impl<'py> FromPyObject<'_, 'py> for Plant {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(text) = given.cast::<PyString>() {
            let readable = text.to_string_lossy();
            // Distinguishes a path from a text like scenarios do.
            let is_path = !readable.contains(['\n', '=', '[']);
            if is_path {
                // The name of a file can contain bytes that are not UTF-8. Python has them as surrogates.
                let refused = |_| {
                    let shown = text.repr().unwrap_or_else(|_| text.to_owned());
                    PyValueError::new_err(format!(
                        "{shown}: no file name contains this surrogate; use os.fsdecode"
                    ))
                };
                return given.extract().map(Plant::File).map_err(refused);
            }
            let right = "the text of a plant contains a surrogate; it must be valid Unicode";
            let text = text.to_str().map_err(|_| PyValueError::new_err(right))?;
            return Ok(Plant::Text(text.to_owned()));
        }
        let right = "a plant is the path of a plant file, its text, or None for the built-in one";
        given.extract().map(Plant::File).map_err(|_| wrong_type(&given, right))
    }
}
