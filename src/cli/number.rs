//! Whole numbers as arguments.

use core::num::NonZero;
use core::ops::RangeInclusive;
use thiserror::Error;

/// The text is not a number of the range.
#[derive(Debug, PartialEq, Eq, Error)]
pub(crate) enum NumberError {
    /// The range has no upper limit for the user.
    #[error("write a whole number, {0} or more")]
    AtLeast(u64),
    #[error("write a whole number from {0} to {1}")]
    Within(u64, u64),
}

/// Returns a parser of whole numbers in a range. If the range ends at the largest number of 64 bits, the messages do
/// not mention an upper limit.
pub(crate) fn within<N: TryFrom<u64>>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<N, NumberError> + Clone + Send + Sync + 'static {
    let (least, most) = range.into_inner();
    move |text| {
        let number = text.trim().parse().ok().filter(|number| (least..=most).contains(number));
        number.and_then(|number| N::try_from(number).ok()).ok_or(match most {
            u64::MAX => NumberError::AtLeast(least),
            most => NumberError::Within(least, most),
        })
    }
}

/// Returns a parser of whole numbers that are not negative.
pub(crate) fn any<N: TryFrom<u64>>() -> impl Fn(&str) -> Result<N, NumberError> + Clone + Send + Sync + 'static
{
    within(0..=u64::MAX)
}

/// Returns a parser of whole numbers above 0.
pub(crate) fn positive<N: TryFrom<u64>>()
-> impl Fn(&str) -> Result<N, NumberError> + Clone + Send + Sync + 'static {
    within(1..=u64::MAX)
}

/// Parses the number of tasks that run at the same time.
///
/// # Errors
/// The text is not a number above 0.
pub(crate) fn jobs(text: &str) -> Result<NonZero<usize>, NumberError> {
    NonZero::new(any()(text)?).ok_or(NumberError::AtLeast(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_outside_its_range_is_refused_with_the_range() {
        let small = within::<u8>(1..=64);
        assert_eq!((small("1"), small("64")), (Ok(1), Ok(64)));
        for text in ["", "x", "0", "65", "-1", "1.5", "99999999999999999999"] {
            assert_eq!(small(text).unwrap_err().to_string(), "write a whole number from 1 to 64", "{text}");
        }
        let many = positive::<u64>();
        assert_eq!((many("7"), jobs("7").map(NonZero::get)), (Ok(7), Ok(7)));
        assert_eq!(jobs("0"), Err(NumberError::AtLeast(1)));
        assert_eq!(many("0").unwrap_err().to_string(), "write a whole number, 1 or more");
        assert_eq!(any::<usize>()("0"), Ok(0));
    }
}
