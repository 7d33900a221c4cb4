//! Errors of the hardware that the operating system finds, and their reports (p. 18-19, 44).

use crate::devices::canopen::emergency::Cause;
use crate::devices::cs0015::emulation::board::hardware::Defects;
use serde::{Deserialize, Serialize};

/// Errors of the hardware, each with its bits of the error register (p. 44).
const WIRE_BREAK: Cause = Cause { code: 0x2100, register: 1 << 1 };
const SHORT_CIRCUIT: Cause = Cause { code: 0x2300, register: 1 << 1 };
const VOLTAGE: Cause = Cause { code: 0x3200, register: 1 << 2 };
const TEMPERATURE: Cause = Cause { code: 0x4000, register: 1 << 3 };

/// Errors of the hardware that the device has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Diagnosis {
    /// Outputs that have switched themselves off, bit n for output n.
    pub short_circuits: u16,
    wire_breaks: u16,
    has_wrong_voltage: bool,
    is_hot: bool,
}

impl Diagnosis {
    /// Returns the errors that the operating system of the device can find while the program has switched the
    /// outputs `wanted` on. An output that is off cannot be checked (D-460).
    pub(crate) fn of(defects: &Defects, wanted: u16) -> Self {
        Diagnosis {
            short_circuits: defects.short_circuits & wanted,
            wire_breaks: defects.wire_breaks & wanted,
            has_wrong_voltage: defects.has_wrong_voltage,
            is_hot: defects.is_hot,
        }
    }

    /// True if at least one error is present that `before` does not contain.
    pub(crate) fn has_more_than(&self, before: &Diagnosis) -> bool {
        self.short_circuits & !before.short_circuits != 0
            || self.wire_breaks & !before.wire_breaks != 0
            || self.has_wrong_voltage && !before.has_wrong_voltage
            || self.is_hot && !before.is_hot
    }

    /// Returns every possible error, with bytes 3 to 7 of its emergency if it is present.
    pub(crate) fn errors(&self) -> [(Cause, Option<[u8; 5]>); 4] {
        let of_outputs = |outputs: u16| {
            let [low, high] = outputs.to_le_bytes();
            (outputs != 0).then_some([low, high, 0, 0, 0])
        };
        let plain = |is_there: bool| is_there.then_some([0; 5]);
        [
            (WIRE_BREAK, of_outputs(self.wire_breaks)),
            (SHORT_CIRCUIT, of_outputs(self.short_circuits)),
            (VOLTAGE, plain(self.has_wrong_voltage)),
            (TEMPERATURE, plain(self.is_hot)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_an_output_that_is_off_are_not_found() {
        let defects = Defects { short_circuits: 0x8000, wire_breaks: 0x0001, ..Defects::default() };
        assert_eq!(Diagnosis::of(&defects, 0x7FF6), Diagnosis::default());
        let found = Diagnosis::of(&defects, 0x8001);
        assert!(found.has_more_than(&Diagnosis::default()) && !Diagnosis::default().has_more_than(&found));
        let [broken, short, voltage, hot] = found.errors().map(|(_, data)| data);
        assert_eq!((broken, short), (Some([1, 0, 0, 0, 0]), Some([0, 0x80, 0, 0, 0])));
        assert_eq!((voltage, hot), (None, None));
    }
}
