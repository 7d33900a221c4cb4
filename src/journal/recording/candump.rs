//! Reads lines of can-utils and python-can.
//!
//! `candump -L` and python-can: `(1436509052.249713) can0 583#7900210000000000 R`. `candump` with a time:
//! `(1436509052.249713)  can0  583   [8]  79 00 21 00 00 00 00 00`, with `-x` also the direction: `can0  RX - -  583`.

use super::{Direction, Entry, Logged};
use crate::can::Frame;
use crate::journal::candump::frame;

const NO_LINE: &str = "a line of a candump log is for example (0000000002.001234) can0 583#7900210000000000";
const NO_TIME: &str = "the line has no time in front; `candump -L` writes a log, `candump -ta` shows times";
const ERROR: &str = "an error message of the interface";
const FD: &str = "a frame of CAN FD or CAN XL; these buses carry classical CAN only";
/// Flag of an error message in an identifier (SocketCAN).
const ERROR_FLAG: u32 = 1 << 29;

/// Reads a line without white space at its ends.
pub(super) fn entry(at: usize, line: &str) -> Result<Entry, &'static str> {
    let Some((time, rest)) = line.strip_prefix('(').and_then(|line| line.split_once(')')) else {
        // A line with a length in brackets is a line of `candump`. Here it has no time, so the error says so.
        return Err(if line.contains('[') { NO_TIME } else { NO_LINE });
    };
    let time_us = time_of(time).ok_or(NO_LINE)?;
    let mut words = rest.split_whitespace();
    let interface = words.next().ok_or(NO_LINE)?.to_owned();
    let first = words.next().ok_or(NO_LINE)?;
    let of = |direction, frame| Entry::Frame(Logged { at, time_us, interface, direction, frame });
    if !first.contains('#') {
        return Ok(match shown(first, words)? {
            Shown::Frame(direction, frame) => of(direction, frame),
            Shown::Skipped(reason) => Entry::Skipped(reason.to_owned()),
        });
    }
    let direction = match (words.next(), words.next()) {
        (None, None) => None,
        (Some("R" | "Rx"), None) => Some(Direction::Received),
        (Some("T" | "Tx"), None) => Some(Direction::Transmitted),
        _ => return Err(NO_LINE),
    };
    let (id, data) = first.split_once('#').ok_or(NO_LINE)?;
    if is_error(id) {
        return Ok(Entry::Skipped(ERROR.to_owned()));
    }
    if data.starts_with('#') {
        return Ok(Entry::Skipped(FD.to_owned()));
    }
    // `candump -8` appends the length code of a frame with eight bytes, 9 to F.
    let whole = match data.split_once('_') {
        Some((data, code)) if data.len() == 16 && matches!(code.as_bytes(), [b'9' | b'A'..=b'F']) => {
            first[..id.len() + 1].to_owned() + data
        }
        _ => first.to_owned(),
    };
    Ok(of(direction, frame(&whole)?))
}

/// True if an identifier has the flag of an error message.
fn is_error(id: &str) -> bool {
    id.len() == 8 && u32::from_str_radix(id, 16).is_ok_and(|raw| raw & ERROR_FLAG != 0)
}

/// The part of a line after the interface, as `candump` shows it on a terminal.
enum Shown {
    Frame(Option<Direction>, Frame),
    Skipped(&'static str),
}

/// Reads identifier, length and data as `candump` shows them; `first` may be the direction.
fn shown<'a>(first: &'a str, words: impl Iterator<Item = &'a str>) -> Result<Shown, &'static str> {
    let mut words = words.peekable();
    let direction = match first {
        "RX" => Some(Direction::Received),
        "TX" => Some(Direction::Transmitted),
        _ => None,
    };
    let mut id = first;
    if direction.is_some() {
        // Two flags follow: bit rate switch and error state indicator of CAN FD.
        id = words.nth(2).ok_or(NO_LINE)?;
    }
    let length = words.next().and_then(|word| word.strip_prefix('[')?.strip_suffix(']')).ok_or(NO_LINE)?;
    if is_error(id) {
        return Ok(Shown::Skipped(ERROR));
    }
    // Lengths of CAN FD have two digits.
    if length.len() != 1 {
        return Ok(Shown::Skipped(FD));
    }
    let length: usize = length.parse().map_err(|_| NO_LINE)?;
    let data = if words.peek() == Some(&"remote") {
        format!("R{length}")
    } else {
        let bytes: Vec<_> = words.take(length).collect();
        if bytes.iter().any(|byte| byte.len() != 2) {
            return Err("each byte must have two hexadecimal digits; use `candump` without -i");
        }
        if bytes.len() != length {
            return Err("the line has fewer bytes than its length says");
        }
        bytes.concat()
    };
    Ok(Shown::Frame(direction, frame(&format!("{id}#{data}"))?))
}

/// Reads a time in seconds, `1436509052.249713`, with any number of decimals; or a date with a time of day as
/// `candump -tA` shows it, `2026-11-25 10:11:12.123456`. Digits below a microsecond are cut off.
fn time_of(text: &str) -> Option<u64> {
    let (seconds, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number(fraction) {
        return None;
    }
    let seconds = match seconds.trim().split_once(' ') {
        Some((date, time)) => seconds_of(date, time)?,
        None if is_number(seconds.trim()) => seconds.trim().parse().ok()?,
        None => return None,
    };
    let us = fraction.bytes().chain(core::iter::repeat(b'0')).take(6);
    let us = us.fold(0, |us, digit| us * 10 + u64::from(digit - b'0'));
    u64::checked_mul(seconds, 1_000_000)?.checked_add(us)
}

/// Returns the number of seconds from the beginning of 1970 to a date and a time of day, for example `2026-11-25` and
/// `10:11:12`.
fn seconds_of(date: &str, time: &str) -> Option<u64> {
    let three = |text: &str, mark| -> Option<[u64; 3]> {
        let parts: Option<Vec<u64>> = text.split(mark).map(|part| part.parse().ok()).collect();
        parts?.try_into().ok()
    };
    let ([year, month, day], [hours, minutes, seconds]) = (three(date, '-')?, three(time, ':')?);
    let is_date = (1970..=9999).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    if !is_date || hours > 23 || minutes > 59 || seconds > 60 {
        return None;
    }
    // In this calculation a year begins in March, so that the leap day is the last day of a year.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year / 4 - year / 100 + year / 400;
    // `(153 * month + 2) / 5` is the number of days before this month in a year that begins in March. 719468 days are
    // between 1 March of year 0 and 1 January 1970.
    let days = 365 * year + leap_days + (153 * month + 2) / 5 + day - 1 - 719_468;
    Some(((days * 24 + hours) * 60 + minutes) * 60 + seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_as_loggers_write_them() {
        for (text, time_us) in [
            ("1436509052.249713", 1_436_509_052_249_713),
            ("0000000002.001234", 2_001_234),
            ("0.5", 500_000),
            ("12", 12_000_000),
            ("12.123456789", 12_123_456),
            ("1970-01-01 00:00:00.000001", 1),
            ("2024-02-29 12:00:00.0", 1_709_208_000_000_000),
            ("2026-11-25 10:11:12.123456", 1_795_601_472_123_456),
        ] {
            assert_eq!(time_of(text), Some(time_us), "{text}");
        }
        for wrong in
            ["", ".", "1.", "-1.0", "1.5e3", "1,5", "2026-13-01 00:00:00.0", "99999999999999999999.0"]
        {
            assert_eq!(time_of(wrong), None, "{wrong}");
        }
    }
}
