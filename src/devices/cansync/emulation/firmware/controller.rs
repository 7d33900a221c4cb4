//! The CAN controller of a node and its possible failures (manual 5.00005.03a p. 147-149, 173-174).

use serde::{Deserialize, Serialize};

/// Recessive bits required for recovery from BUS-off: 128 times 11 (ISO 11898-1).
const RECOVERY_BITS: u64 = 128 * 11;

/// Reasons why the node neither receives nor sends frames, as bits.
mod cut {
    /// The controller is BUS-off.
    pub(crate) const BUS_OFF: u8 = 1 << 0;
    /// An overrun loses the arriving frame.
    pub(crate) const FRAME: u8 = 1 << 1;
}

/// State of a CAN controller.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Controller {
    /// Bits of [`cut`].
    cut: u8,
    overrun: bool,
    /// Time in microseconds at which the recovery from BUS-off ends. A reset starts the recovery.
    back_at: Option<u64>,
}

impl Controller {
    #[inline]
    pub(super) fn is_connected(&self) -> bool {
        self.cut == 0
    }

    fn set(&mut self, bit: u8, on: bool) {
        self.cut = if on { self.cut | bit } else { self.cut & !bit };
    }

    /// Switches to BUS-off. Returns true if the controller was working before.
    pub(super) fn go_off(&mut self) -> bool {
        let goes = !self.is_off();
        self.set(cut::BUS_OFF, true);
        goes
    }

    pub(super) fn is_off(&self) -> bool {
        self.cut & cut::BUS_OFF != 0
    }

    /// Handles bit 7 of `w_CPU_CONTROL`: clears an overrun and starts the recovery from BUS-off (decision D-121).
    pub(super) fn reset(&mut self, now: u64, kbit_per_s: u16) {
        self.overrun = false;
        if self.is_off() {
            let recovery_us = (RECOVERY_BITS * 1000).div_ceil(u64::from(kbit_per_s.max(1)));
            self.back_at.get_or_insert(now + recovery_us);
        }
    }

    /// Returns true during the recovery from BUS-off.
    pub(super) fn recovers(&self) -> bool {
        self.back_at.is_some()
    }

    /// Ends the recovery if its time has passed at `now`.
    pub(super) fn recover(&mut self, now: u64) {
        if self.back_at.is_some_and(|at| at <= now) {
            self.back_at = None;
            self.set(cut::BUS_OFF, false);
        }
    }

    /// Makes the controller lose the arriving frame. Returns true if the controller could have received it.
    pub(super) fn overrun(&mut self) -> bool {
        let connected = self.is_connected();
        if connected {
            self.overrun = true;
            self.set(cut::FRAME, true);
        }
        connected
    }

    /// Ends the overrun, because the lost frame has ended.
    pub(super) fn frame_is_past(&mut self) {
        self.set(cut::FRAME, false);
    }

    pub(super) fn has_overrun(&self) -> bool {
        self.overrun
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comes_back_from_bus_off_after_128_times_11_bits() {
        for (kbit_per_s, us) in [(500, 2816), (250, 5632), (125, 11_264)] {
            let mut controller = Controller::default();
            assert!(controller.go_off() && !controller.go_off());
            controller.recover(u64::MAX);
            assert!(controller.is_off(), "not without a reset");
            controller.reset(1000, kbit_per_s);
            controller.reset(1500, kbit_per_s);
            controller.recover(999 + us);
            assert!(controller.is_off() && !controller.is_connected());
            controller.recover(1000 + us);
            assert!(controller.is_connected(), "the first reset counts");
        }
    }

    #[test]
    fn an_overrun_stays_until_it_is_reset() {
        let mut controller = Controller::default();
        assert!(controller.overrun() && !controller.is_connected());
        controller.frame_is_past();
        assert!(controller.is_connected() && controller.has_overrun());
        controller.reset(0, 500);
        assert!(!controller.has_overrun());
        controller.go_off();
        assert!(!controller.overrun() && !controller.has_overrun(), "nothing is received anyway");
    }
}
