//! Emergency messages: each error is reported once when it appears, and once when it has gone.

use serde::{Deserialize, Serialize};

/// An error that a device can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Cause {
    /// Emergency error code of the error.
    pub code: u16,
    /// Bits of the error register (1001h) while the error is present.
    pub register: u8,
}

/// An error that is still present.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct ActiveError {
    cause: Cause,
    data: [u8; 5],
}

/// Errors of a device, and the emergency messages that it still has to send.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Errors {
    present: Vec<ActiveError>,
    /// Errors that were reported, in the order of the reports.
    reported: Vec<ActiveError>,
}

impl Errors {
    /// Sets or clears an error. `data` has five bytes of detail. If these bytes change, the error is reported
    /// again.
    pub(crate) fn set(&mut self, cause: Cause, data: Option<[u8; 5]>) {
        let known = self.present.iter_mut().find(|known| known.cause == cause);
        match (known, data) {
            (Some(known), Some(data)) => known.data = data,
            (None, Some(data)) => self.present.push(ActiveError { cause, data }),
            (Some(_), None) => self.present.retain(|known| known.cause != cause),
            (None, None) => {}
        }
    }

    /// Returns the error register (1001h).
    #[must_use]
    pub(crate) fn register(&self) -> u8 {
        self.present.iter().fold(0, |bits, known| bits | known.cause.register)
    }

    /// Returns the next message to be sent: a code, the error register and five bytes. When an error has
    /// disappeared, the code of its message is 0, and the register shows the remaining errors.
    pub(crate) fn message(&mut self) -> Option<[u8; 8]> {
        let is = |list: &[ActiveError], cause| list.iter().any(|known| known.cause == cause);
        if let Some(gone) = self.reported.iter().position(|reported| !is(&self.present, reported.cause)) {
            self.reported.remove(gone);
            return Some([0, 0, self.register(), 0, 0, 0, 0, 0]);
        }
        let new = *self.present.iter().find(|known| !self.reported.contains(known))?;
        self.reported.retain(|reported| reported.cause != new.cause);
        self.reported.push(new);
        let [low, high] = new.cause.code.to_le_bytes();
        let [a, b, c, d, e] = new.data;
        Some([low, high, self.register(), a, b, c, d, e])
    }

    /// Clears all errors and the list of errors that were reported.
    pub(crate) fn clear(&mut self) {
        self.present.clear();
        self.reported.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: Cause = Cause { code: 0x8100, register: 0x10 };
    const OTHER: Cause = Cause { code: 0x1000, register: 0x01 };

    #[test]
    fn an_error_is_reported_when_it_appears_and_when_it_has_gone() {
        let mut errors = Errors::default();
        errors.set(ONE, Some([1, 2, 3, 4, 5]));
        errors.set(ONE, Some([1, 2, 3, 4, 5]));
        assert_eq!(errors.message(), Some([0x00, 0x81, 0x10, 1, 2, 3, 4, 5]));
        assert_eq!(errors.message(), None);
        errors.set(OTHER, Some([0; 5]));
        assert_eq!((errors.register(), errors.message()), (0x11, Some([0x00, 0x10, 0x11, 0, 0, 0, 0, 0])));
        errors.set(ONE, None);
        assert_eq!((errors.message(), errors.message()), (Some([0, 0, 0x01, 0, 0, 0, 0, 0]), None));
        errors.set(OTHER, None);
        assert_eq!((errors.message(), errors.register()), (Some([0; 8]), 0));
    }

    #[test]
    fn an_error_with_new_data_is_reported_again() {
        let mut errors = Errors::default();
        errors.set(ONE, Some([1, 0, 0, 0, 0]));
        errors.message();
        errors.set(ONE, Some([3, 0, 0, 0, 0]));
        assert_eq!((errors.message(), errors.message()), (Some([0x00, 0x81, 0x10, 3, 0, 0, 0, 0]), None));
        errors.set(ONE, None);
        assert_eq!((errors.message(), errors.message()), (Some([0; 8]), None));
    }

    #[test]
    fn an_unreported_error_is_not_reported_as_gone() {
        let mut errors = Errors::default();
        errors.set(ONE, Some([0; 5]));
        errors.set(ONE, None);
        assert_eq!(errors.message(), None);
    }
}
