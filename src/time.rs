//! Emulated time as text.

use thiserror::Error;

/// The text is not a time.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum TimeError {
    /// The text is not a number with a unit.
    #[error("write a number with a unit (us, ms, s, min or h), for example 250us, 2ms or 1.5s")]
    Notation,
    /// The number has no unit.
    #[error("a time needs a unit: {0}us, {0}ms or {0}s")]
    NoUnit(String),
    /// The time has a fraction of a microsecond.
    #[error("emulated time has a resolution of 1us")]
    TooFine,
    /// The time is too long for 64 bits.
    #[error("too long: emulated time has at most 5124095576h")]
    TooLong,
}

/// Parses a time such as `250us`, `2ms` or `1.5s` into microseconds.
pub fn parse(text: &str) -> Result<u64, TimeError> {
    let text = text.trim();
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let is_number = |digits: &str| !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number(whole) || !is_number(fraction) {
        return Err(TimeError::Notation);
    }
    let unit_us = match unit.trim_start() {
        "us" | "µs" | "μs" => 1,
        "ms" => 1_000,
        "s" => 1_000_000,
        "min" => 60_000_000,
        "h" => 3_600_000_000,
        "" => return Err(TimeError::NoUnit(number.to_owned())),
        _ => return Err(TimeError::Notation),
    };
    let whole: u64 = whole.parse().map_err(|_| TimeError::TooLong)?;
    let fraction = fraction_us(fraction.trim_end_matches('0'), unit_us)?;
    whole.checked_mul(unit_us).and_then(|us| us.checked_add(fraction)).ok_or(TimeError::TooLong)
}

/// Converts the decimals `digits` of a unit of `unit_us` microseconds to microseconds.
fn fraction_us(digits: &str, unit_us: u64) -> Result<u64, TimeError> {
    let mut rest = unit_us;
    let mut us = 0;
    for digit in digits.bytes() {
        if !rest.is_multiple_of(10) {
            return Err(TimeError::TooFine);
        }
        rest /= 10;
        us += rest * u64::from(digit - b'0');
    }
    Ok(us)
}

/// Formats microseconds as seconds with all decimals: `0.002000 s`.
pub fn seconds(us: u64) -> String {
    format!("{}.{:06} s", us / 1_000_000, us % 1_000_000)
}

/// Formats microseconds in the largest unit that needs no decimals: `2 ms`, `1500 us`.
pub fn short(us: u64) -> String {
    match us {
        0 => "0 us".to_owned(),
        us if us.is_multiple_of(1_000_000) => format!("{} s", us / 1_000_000),
        us if us.is_multiple_of(1_000) => format!("{} ms", us / 1_000),
        us => format!("{us} us"),
    }
}

/// Formats microseconds like [`short`], but uses the units min and h for whole minutes and hours: `90 min`, `24 h`.
pub fn long(us: u64) -> String {
    match us {
        0 => short(us),
        us if us.is_multiple_of(3_600_000_000) => format!("{} h", us / 3_600_000_000),
        us if us.is_multiple_of(60_000_000) => format!("{} min", us / 60_000_000),
        us => short(us),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_with_units() {
        for (text, us) in [
            ("250us", 250),
            ("250µs", 250),
            ("2ms", 2_000),
            ("2 ms", 2_000),
            ("0.5ms", 500),
            ("1.000001s", 1_000_001),
            ("1.50s", 1_500_000),
            ("2min", 120_000_000),
            ("24h", 86_400_000_000),
            ("0s", 0),
            ("1.0us", 1),
        ] {
            assert_eq!(parse(text), Ok(us), "{text}");
        }
    }

    proptest::proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn printed_times_are_read_back_unchanged(us in proptest::num::u64::ANY) {
            proptest::prop_assert_eq!(parse(&seconds(us)), Ok(us));
            proptest::prop_assert_eq!(parse(&short(us)), Ok(us));
            proptest::prop_assert_eq!(parse(&long(us)), Ok(us));
            let hours = us - us % 3_600_000_000;
            proptest::prop_assert_eq!(parse(&long(hours)), Ok(hours));
            // Whole seconds are printed without decimals.
            let whole = us - us % 1_000_000;
            proptest::prop_assert_eq!(parse(&short(whole)), Ok(whole));
        }
    }

    #[test]
    fn everything_else_is_refused_with_a_reason() {
        assert_eq!(parse("5").unwrap_err().to_string(), "a time needs a unit: 5us, 5ms or 5s");
        assert_eq!(parse("1.5us"), Err(TimeError::TooFine));
        assert_eq!(parse("0.0001ms"), Err(TimeError::TooFine));
        assert_eq!(parse("99999999999999999999s"), Err(TimeError::TooLong));
        assert_eq!(parse("18446744073709551615ms"), Err(TimeError::TooLong));
        for text in ["", "ms", "-1ms", "1.ms", ".5ms", "1..5ms", "1.2.3s", "5 parsecs", "1s500ms", "+1s"] {
            assert_eq!(parse(text), Err(TimeError::Notation), "{text}");
        }
    }

    #[test]
    fn times_are_printed_exactly() {
        assert_eq!(seconds(2_000), "0.002000 s");
        assert_eq!(seconds(12_000_001), "12.000001 s");
        assert_eq!([0, 1_500, 2_000, 3_000_000].map(short), ["0 us", "1500 us", "2 ms", "3 s"]);
        assert_eq!([0, 90_000_000, 60_000_000, 86_400_000_000].map(long), ["0 us", "90 s", "1 min", "24 h"]);
    }
}
