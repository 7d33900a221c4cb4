//! The interrupt program of 1 ms (p. 118). Each run is event 2, and has separate inputs and outputs.

use super::events::{INTERRUPT, Pulses};
use super::peripherals::Peripherals;
use crate::devices::cs0015::emulation::ram::Registers;
use serde::{Deserialize, Serialize};

/// Period of the interrupt program in microseconds.
const PERIOD_US: u64 = 1_000;
/// The inputs and outputs of the interrupt program: %IX0.00 to %IX0.07 and %QX0.00 to %QX0.07.
const OWN: u16 = 0x00FF;

/// Schedule of the interrupt program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Interrupt {
    /// Emulated time of the next run of the interrupt program, in microseconds; `None` if it is off.
    next: Option<u64>,
}

impl Interrupt {
    /// Runs `SET_INTERRUPT_1MS`: starts the interrupt program at `now`, or stops it.
    pub(crate) fn set(&mut self, is_on: bool, now: u64) {
        self.next = is_on.then_some(now + PERIOD_US);
    }

    /// Returns the time of the next run; `u64::MAX` if the interrupt program is off.
    pub(crate) fn next_time(&self) -> u64 {
        self.next.unwrap_or(u64::MAX)
    }

    /// If the next run is due, writes the outputs of the previous run and reads the inputs for the next run.
    pub(crate) fn due(
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
        registers.fire_event(INTERRUPT, now);
        pulses.add(INTERRUPT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interrupt_program_runs_a_period_after_its_start() {
        let mut interrupt = Interrupt::default();
        assert_eq!(interrupt.next_time(), u64::MAX);
        interrupt.set(true, 5_400);
        assert_eq!(interrupt.next_time(), 6_400);
        interrupt.set(false, 5_500);
        assert_eq!(interrupt.next_time(), u64::MAX);
    }
}
