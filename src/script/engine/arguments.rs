//! Converts arguments that scripts pass to verbs.

use super::shown::value_text;
use crate::script::{ScenarioError, Span, Value};
use rhai::{Dynamic, INT};

/// Returns a value for a register: a number, a text such as `16#0040`, or true and false for 1 and 0.
pub(crate) fn value(given: &Dynamic) -> Result<Value, ScenarioError> {
    if let Ok(number) = given.as_int() {
        return Ok(Value::Number(number));
    }
    if let Ok(bit) = given.as_bool() {
        return Ok(bit.into());
    }
    let text = given.as_immutable_string_ref().map(|text| Value::from(text.as_str()));
    text.map_err(|_| {
        wrong(given, "a value is an integer such as 0x0040, a text such as \"16#0040\", or a bool")
    })
}

/// Returns a time: a text with a unit, or a number of microseconds.
pub(crate) fn span(given: &Dynamic) -> Result<Span, ScenarioError> {
    if let Ok(number) = given.as_int() {
        return number_us(number);
    }
    let text = given.as_immutable_string_ref().map(|text| Span::from(text.as_str()));
    text.map_err(|_| {
        wrong(given, "a time is a text with a unit such as \"2ms\", or a number of microseconds")
    })
}

fn number_us(us: INT) -> Result<Span, ScenarioError> {
    number::<u64>(us, "time").map(Span::Us)
}

/// A number that must fit its type.
pub(crate) fn number<T: TryFrom<INT>>(given: INT, what: &str) -> Result<T, ScenarioError> {
    let right = format!("the {what} must not be negative or that large");
    T::try_from(given).map_err(|_| ScenarioError::argument(&given.to_string(), &right))
}

/// Returns an identifier of a frame, or a mask for it.
pub(crate) fn identifier(given: INT) -> Result<u16, ScenarioError> {
    u16::try_from(given)
        .map_err(|_| ScenarioError::argument(&given.to_string(), "identifiers have 11 bits, 0 to 16#7FF"))
}

/// Returns the data of a frame: `44 33 ..`, or an array of bytes.
pub(crate) fn data_bytes(given: &Dynamic) -> Result<String, ScenarioError> {
    if let Ok(text) = given.as_immutable_string_ref() {
        return Ok(text.to_string());
    }
    let right = "data are an array of bytes, 0 to 255, or a text such as \"44 33 .. 11\"";
    let bytes = given.as_array_ref().map_err(|_| wrong(given, right))?;
    let byte = |byte: &Dynamic| byte.as_int().ok().and_then(|byte| u8::try_from(byte).ok());
    let hex = |item| byte(item).map(|byte| format!("{byte:02X}")).ok_or_else(|| wrong(item, right));
    Ok(bytes.iter().map(hex).collect::<Result<Vec<_>, _>>()?.join(" "))
}

/// Returns an array of names, for example of registers. `what` is the kind of names for messages.
pub(crate) fn names(given: &[Dynamic], what: &str) -> Result<Vec<String>, ScenarioError> {
    let right = format!("this is no {what}'s name");
    let name = |item: &Dynamic| item.clone().into_string().map_err(|_| wrong(item, &right));
    given.iter().map(name).collect()
}

fn wrong(given: &Dynamic, right: &str) -> ScenarioError {
    ScenarioError::argument(&value_text(given), right)
}
