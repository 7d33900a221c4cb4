//! Telegrams as octets.

use super::OCTET_BITS;
use serde::{Deserialize, Serialize};

/// Maximum number of data octets of a telegram, including service access points.
pub const MAX_DATA: usize = 246;

/// Number of octets of the longest telegram.
pub const MAX_OCTETS: usize = 255;

/// Consecutive octets on the line. They need not be a valid telegram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Burst {
    /// Bit time of the first bit.
    pub begin: u64,
    /// Octets of the telegram, at most [`MAX_OCTETS`].
    pub octets: Vec<u8>,
}

const SD1: u8 = 0x10;
const SD2: u8 = 0x68;
const SD3: u8 = 0xA2;
const SD4: u8 = 0xDC;
const ED: u8 = 0x16;
const SC: u8 = 0xE5;

/// Bit of an address octet that announces a service access point.
const EXTENDED: u8 = 0x80;

/// A telegram on the line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Telegram {
    /// A request or an answer.
    Frame(Frame),
    /// The token is passed on.
    Token {
        /// Destination address, 0 to 127.
        da: u8,
        /// Source address, 0 to 127.
        sa: u8,
    },
    /// A receipt of one octet.
    ShortAck,
}

/// A request or an answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frame {
    /// Destination address, 0 to 127.
    pub da: u8,
    /// Source address, 0 to 127.
    pub sa: u8,
    /// Function code of the telegram: [`FunctionCode`](super::FunctionCode).
    pub fc: u8,
    /// Service access point of the destination; `None` for the default service access point, which every station has.
    pub dsap: Option<u8>,
    /// Service access point of the source.
    pub ssap: Option<u8>,
    /// Data of the telegram, at most [`MAX_DATA`] octets including the service access points.
    pub data: Vec<u8>,
}

/// The reason why octets are not a telegram, or why a telegram cannot be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TelegramError {
    /// No telegram begins with this octet.
    #[error("no telegram begins with 16#{0:02X}; it is 10, 68, A2, DC or E5")]
    Start(u8),
    /// There are no octets.
    #[error("there are no octets")]
    Empty,
    /// The number of octets does not match the start delimiter or the length.
    #[error("{found} octets where there must be {expected}")]
    Length {
        /// Number of octets of the telegram or of its part.
        found: usize,
        /// Number of octets that would be correct.
        expected: usize,
    },
    /// The two copies of the length differ, or the length is invalid.
    #[error("lengths are {0} and {1}; both must be the same, 4 to 249")]
    Lengths(u8, u8),
    /// The check sum is wrong.
    #[error("the check sum is 16#{found:02X}; it must be 16#{expected:02X}")]
    Sum {
        /// Check sum of the telegram.
        found: u8,
        /// Check sum that the octets of the telegram require.
        expected: u8,
    },
    /// The telegram has a wrong end delimiter.
    #[error("it ends with 16#{0:02X}; telegrams end with 16#16")]
    End(u8),
    /// The telegram has too many data octets.
    #[error("{0} octets of data; a telegram carries 246 with its service access points")]
    TooLong(usize),
}

impl Frame {
    /// Returns the octets after the function code.
    fn unit(&self) -> impl Iterator<Item = u8> {
        self.dsap.into_iter().chain(self.ssap).chain(self.data.iter().copied())
    }

    fn head(&self) -> [u8; 3] {
        let flag = |sap: Option<u8>| if sap.is_some() { EXTENDED } else { 0 };
        [self.da & 0x7F | flag(self.dsap), self.sa & 0x7F | flag(self.ssap), self.fc]
    }

    /// Parses the octets from the destination address up to the check sum, exclusive.
    fn parse(octets: &[u8]) -> Option<Self> {
        let (&[da, sa, fc], mut data) = octets.split_first_chunk()?;
        let mut sap = |address: u8| {
            if address & EXTENDED == 0 {
                return Some(None);
            }
            let (&sap, rest) = data.split_first()?;
            data = rest;
            Some(Some(sap))
        };
        let (dsap, ssap) = (sap(da)?, sap(sa)?);
        Some(Frame { da: da & 0x7F, sa: sa & 0x7F, fc, dsap, ssap, data: data.to_vec() })
    }
}

fn sum(octets: &[u8]) -> u8 {
    octets.iter().fold(0, |sum, octet| sum.wrapping_add(*octet))
}

/// Returns the octets between the start delimiter and the check sum, if check sum and end delimiter are correct.
fn checked(octets: &[u8], head: usize, expected: usize) -> Result<&[u8], TelegramError> {
    let wrong = TelegramError::Length { found: octets.len(), expected };
    if octets.len() != expected {
        return Err(wrong);
    }
    let Some((inner, &[found, end])) = octets.get(head..).and_then(<[u8]>::split_last_chunk) else {
        return Err(wrong);
    };
    if end != ED {
        return Err(TelegramError::End(end));
    }
    match sum(inner) {
        expected if expected != found => Err(TelegramError::Sum { found, expected }),
        _ => Ok(inner),
    }
}

impl Telegram {
    /// Parses octets that are exactly one telegram.
    ///
    /// # Errors
    /// [`TelegramError`] describes the error. A station does not answer such octets.
    pub fn parse(octets: &[u8]) -> Result<Self, TelegramError> {
        let (start, found) = (*octets.first().ok_or(TelegramError::Empty)?, octets.len());
        let frame = |inner: &[u8]| {
            let expected = inner.len() + 1;
            Frame::parse(inner)
                .map(Telegram::Frame)
                .ok_or(TelegramError::Length { found: inner.len(), expected })
        };
        match start {
            SD1 => frame(checked(octets, 1, 6)?),
            SD3 => frame(checked(octets, 1, 14)?),
            SD2 => {
                let &[_, one, other, again] =
                    octets.first_chunk().ok_or(TelegramError::Length { found, expected: 9 })?;
                if one != other || !(4..=249).contains(&one) {
                    return Err(TelegramError::Lengths(one, other));
                }
                if again != SD2 {
                    return Err(TelegramError::Start(again));
                }
                frame(checked(octets, 4, usize::from(one) + 6)?)
            }
            SD4 => match *octets {
                [_, da, sa] => Ok(Telegram::Token { da: da & 0x7F, sa: sa & 0x7F }),
                _ => Err(TelegramError::Length { found, expected: 3 }),
            },
            SC if found == 1 => Ok(Telegram::ShortAck),
            SC => Err(TelegramError::Length { found, expected: 1 }),
            other => Err(TelegramError::Start(other)),
        }
    }

    /// Returns the octets of the telegram.
    ///
    /// # Errors
    /// [`TelegramError::TooLong`].
    pub fn octets(&self) -> Result<Vec<u8>, TelegramError> {
        let frame = match self {
            Telegram::Token { da, sa } => return Ok(vec![SD4, *da, *sa]),
            Telegram::ShortAck => return Ok(vec![SC]),
            Telegram::Frame(frame) => frame,
        };
        let inner: Vec<u8> = frame.head().into_iter().chain(frame.unit()).collect();
        let length = match inner.len() - 3 {
            0 => {
                let [da, sa, fc] = frame.head();
                return Ok(vec![SD1, da, sa, fc, sum(&inner), ED]);
            }
            data if data > MAX_DATA => return Err(TelegramError::TooLong(data)),
            _ => inner.len() as u8,
        };
        let mut octets = vec![SD2, length, length, SD2];
        octets.extend_from_slice(&inner);
        octets.extend([sum(&inner), ED]);
        Ok(octets)
    }

    /// Returns the duration of `octets` octets on the line, in bit times.
    #[must_use]
    pub const fn bits(octets: usize) -> u64 {
        octets as u64 * OCTET_BITS
    }
}

/// Returns the number of octets of the first telegram in a stream of octets; `None` if more octets are needed. If the
/// stream does not begin with a telegram, returns the number of all its octets.
#[must_use]
pub fn octets_of_first(stream: &[u8]) -> Option<usize> {
    let expected = match *stream.first()? {
        SD1 => 6,
        SD2 => match *stream {
            [_, one, other, ..] if one == other && (4..=249).contains(&one) => usize::from(one) + 6,
            [_, one, ..] if stream.len() == 2 && (4..=249).contains(&one) => return None,
            [_] => return None,
            _ => stream.len(),
        },
        SD3 => 14,
        SD4 => 3,
        SC => 1,
        _ => stream.len(),
    };
    (expected <= stream.len()).then_some(expected.min(MAX_OCTETS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn diagnosis() -> Frame {
        Frame { da: 5, sa: 2, fc: 0x6D, dsap: Some(60), ssap: Some(62), data: Vec::new() }
    }

    #[test]
    fn telegrams_of_each_form() {
        let request = Telegram::Frame(diagnosis());
        let octets = [0x68, 5, 5, 0x68, 0x85, 0x82, 0x6D, 0x3C, 0x3E, 0xEE, 0x16];
        assert_eq!((request.octets().unwrap(), Telegram::parse(&octets)), (octets.to_vec(), Ok(request)));
        let status = Frame { da: 5, sa: 2, fc: 0x49, dsap: None, ssap: None, data: Vec::new() };
        let octets = [0x10, 5, 2, 0x49, 0x50, 0x16];
        assert_eq!(Telegram::Frame(status.clone()).octets().unwrap(), octets);
        let fixed = [0xA2, 5, 2, 0x5D, 1, 2, 3, 4, 5, 6, 7, 8, 0x88, 0x16];
        let data = vec![1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(Telegram::parse(&fixed), Ok(Telegram::Frame(Frame { fc: 0x5D, data, ..status })));
        assert_eq!(Telegram::parse(&[0xDC, 3, 2]), Ok(Telegram::Token { da: 3, sa: 2 }));
        assert_eq!(Telegram::parse(&[0xE5]), Ok(Telegram::ShortAck));
    }

    #[test]
    fn a_stream_is_divided_into_telegrams() {
        let telegrams = [
            Telegram::Frame(diagnosis()).octets().unwrap(),
            vec![SC],
            vec![SD4, 3, 2],
            vec![0x10, 5, 2, 0x49, 0x50, 0x16],
            vec![0xA2, 5, 2, 0x5D, 1, 2, 3, 4, 5, 6, 7, 8, 0x88, 0x16],
        ];
        let stream = telegrams.concat();
        let mut rest = stream.as_slice();
        for telegram in &telegrams {
            for cut in 0..telegram.len() {
                assert_eq!(octets_of_first(&rest[..cut]), None, "{telegram:02X?} {cut}");
            }
            assert_eq!(octets_of_first(rest), Some(telegram.len()));
            rest = &rest[telegram.len()..];
        }
        // Octets that are not a telegram.
        assert_eq!(octets_of_first(&[0x17, 1, 2]), Some(3));
        assert_eq!(octets_of_first(&[0x68, 5, 6]), Some(3));
        assert_eq!(octets_of_first(&[0x68, 3]), Some(2));
        assert_eq!(octets_of_first(&[0; 600]), Some(MAX_OCTETS));
    }

    #[test]
    fn the_error_of_an_invalid_telegram_is_named() {
        let right = Telegram::Frame(diagnosis()).octets().unwrap();
        let with = |place: usize, octet: u8| {
            let mut octets = right.clone();
            octets[place] = octet;
            Telegram::parse(&octets).unwrap_err()
        };
        assert_eq!(Telegram::parse(&[]), Err(TelegramError::Empty));
        assert_eq!(with(0, 0x17), TelegramError::Start(0x17));
        assert_eq!(with(1, 6), TelegramError::Lengths(6, 5));
        assert_eq!(with(3, 0), TelegramError::Start(0));
        assert_eq!(with(9, 0xEF), TelegramError::Sum { found: 0xEF, expected: 0xEE });
        assert_eq!(with(10, 0), TelegramError::End(0));
        assert_eq!(Telegram::parse(&right[..10]), Err(TelegramError::Length { found: 10, expected: 11 }));
        let long = Frame { data: vec![0; 245], ..diagnosis() };
        assert_eq!(Telegram::Frame(long).octets(), Err(TelegramError::TooLong(247)));
        // The address announces a service access point, but the telegram contains none.
        let none = [0x10, 0x85, 2, 0x49, 0xD0, 0x16];
        assert_eq!(Telegram::parse(&none), Err(TelegramError::Length { found: 3, expected: 4 }));
    }

    /// Fails unless the octets are refused, or are a telegram that does not change when it is written and
    /// parsed again.
    fn telegram_or_refused(octets: &[u8]) {
        if let Ok(telegram) = Telegram::parse(octets) {
            assert_eq!(Telegram::parse(&telegram.octets().unwrap()), Ok(telegram));
        }
    }

    #[test]
    fn fuzz_profibus_telegram() {
        crate::fuzz("profibus_telegram", telegram_or_refused);
    }

    proptest! {
    #![proptest_config(crate::property_tests())]

        #[test]
        fn a_frame_is_unchanged_after_a_round_trip(
            da in 0..128u8,
            sa in 0..128u8,
            fc: u8,
            dsap: Option<u8>,
            ssap: Option<u8>,
            data in prop::collection::vec(any::<u8>(), 0..=244),
        ) {
            let telegram = Telegram::Frame(Frame { da, sa, fc, dsap, ssap, data });
            prop_assert_eq!(Telegram::parse(&telegram.octets().unwrap()), Ok(telegram));
        }

        #[test]
        fn octets_are_a_telegram_or_refused(octets in prop::collection::vec(any::<u8>(), 0..300)) {
            telegram_or_refused(&octets);
        }
    }
}
