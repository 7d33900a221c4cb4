//! The interrupt program of 1 ms (p. 118): event 2, and the inputs and outputs that it has each time.

use super::events::{INTERRUPT, Pulses};
use super::peripherals::Peripherals;
use super::ram::Registers;
use serde::{Deserialize, Serialize};

/// Its period in us.
const PERIOD_US: u64 = 1_000;
/// Inputs %IX0.00 to %IX0.07 and outputs %QX0.00 to %QX0.07, the only ones that it has.
const OWN: u16 = 0x00FF;

/// When it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Interrupt {
    next: Option<u64>,
}

impl Interrupt {
    /// `SET_INTERRUPT_1MS`: it runs from `now` on, or no longer.
    pub(super) fn set(&mut self, is_on: bool, now: u64) {
        self.next = is_on.then_some(now + PERIOD_US);
    }

    /// When it runs next; `u64::MAX` if it does not.
    pub(super) fn next_time(&self) -> u64 {
        self.next.unwrap_or(u64::MAX)
    }

    /// What the last run has left goes to the outputs, and the next one is given its inputs, if it is due.
    pub(super) fn due(
        &mut self,
        registers: &Registers,
        peripherals: &Peripherals,
        pulses: &Pulses,
        outputs: &mut u16,
        now: u64,
    ) {
        if self.next.is_none_or(|next| next > now) {
            return;
        }
        self.next = Some(now + PERIOD_US);
        *outputs = *outputs & !OWN | registers.outputs.Q0.load() & OWN;
        let inputs = &registers.inputs.I0;
        inputs.store(inputs.load() & !OWN | peripherals.inputs(registers, now) & OWN);
        registers.tell_event(INTERRUPT, now);
        pulses.add(INTERRUPT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_runs_a_period_after_it_was_set() {
        let mut interrupt = Interrupt::default();
        assert_eq!(interrupt.next_time(), u64::MAX);
        interrupt.set(true, 5_400);
        assert_eq!(interrupt.next_time(), 6_400);
        interrupt.set(false, 5_500);
        assert_eq!(interrupt.next_time(), u64::MAX);
    }
}
