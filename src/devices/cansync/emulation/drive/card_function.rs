//! Function of the CANsync card and its baud rates (manual 5.01010.01 p. 10, 13).

use serde::{Deserialize, Serialize};

/// Baud rates in kbit/s, fastest first, each with its SYNC slot (P167) in us (p. 13).
const RATES: [(u16, u16); 4] = [(1000, 1000), (500, 2000), (250, 4000), (125, 8000)];

/// "Function option card 1" in the type key of a drive (p. 10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
#[serde(expecting = "the number of a function of the card")]
pub enum CardFunction {
    /// Code 00, not for new applications: for 125 to 1000 kbit/s. ZK 26 has no effect. If a reference value
    /// comes from another slave's actual value frame, the master must request that frame in every interval.
    Old,
    /// Code 01: 125 to 500 kbit/s; monitors the loss of reference values (ZK 26).
    #[default]
    Current,
}

/// An invalid function number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("card_function is {0}; it must be 0 or 1")]
pub struct UnknownFunction(u8);

impl TryFrom<u8> for CardFunction {
    type Error = UnknownFunction;

    fn try_from(number: u8) -> Result<Self, UnknownFunction> {
        match number {
            0 => Ok(CardFunction::Old),
            1 => Ok(CardFunction::Current),
            _ => Err(UnknownFunction(number)),
        }
    }
}

impl From<CardFunction> for u8 {
    fn from(function: CardFunction) -> u8 {
        function as u8
    }
}

impl CardFunction {
    /// Returns the SYNC slot (P167) in us for a bus of `kbit_s`; `None` if the card does not support that rate.
    pub fn sync_slot_us(self, kbit_s: u16) -> Option<u16> {
        let runs = self == CardFunction::Old || kbit_s <= 500;
        RATES.into_iter().find(|(rate, _)| runs && *rate == kbit_s).map(|(_, slot)| slot)
    }

    /// Returns true if ZK 26 has an effect (p. 17).
    pub(super) const fn counts_losses(self) -> bool {
        matches!(self, CardFunction::Current)
    }

    /// Returns true if the card needs another slave's frame in every interval to use its reference value.
    pub(super) const fn needs_every_frame(self) -> bool {
        matches!(self, CardFunction::Old)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_sync_slots_are_those_of_pages_10_and_13() {
        for (kbit_s, slots) in [
            (1000, [Some(1000), None]),
            (500, [Some(2000); 2]),
            (250, [Some(4000); 2]),
            (125, [Some(8000); 2]),
            (800, [None; 2]),
        ] {
            let own =
                [CardFunction::Old, CardFunction::Current].map(|function| function.sync_slot_us(kbit_s));
            assert_eq!(own, slots, "{kbit_s} kbit/s");
        }
    }

    #[test]
    fn functions_have_their_numbers() {
        assert_eq!([0, 1].map(|n| CardFunction::try_from(n).map(u8::from)), [Ok(0), Ok(1)]);
        let message = CardFunction::try_from(2).unwrap_err().to_string();
        assert_eq!(message, "card_function is 2; it must be 0 or 1");
    }
}
