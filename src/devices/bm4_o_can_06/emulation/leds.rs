//! LEDs H1 to H4 of the modules (manual 5.02066.01a section 3.1.4, p. 28-30).

use crate::devices::Led;
use crate::devices::cansync::registers::values::{cansync_status, option_status};
use crate::memory::Cell16;

/// The LEDs of a module; a BM4-O-CAN-06 has H1 and H2 only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leds {
    /// The LEDs H1 to H4 of the module.
    pub h: [Led; 4],
}

/// Code in the header page for an LED that flashes alternately with another LED.
const IN_TURN: u8 = 0xFE;

/// Conditions that the LEDs show.
#[derive(Clone, Copy, Debug)]
pub(super) struct LedConditions {
    /// True if the module is in set-up mode or active operation.
    pub takes_part: bool,
    /// Interval of the SYNC signal in us; `None` while there is none.
    pub interval_us: Option<u64>,
    /// True if the module has just sent or received a frame.
    pub has_traffic: bool,
}

impl Leds {
    /// Returns the LEDs of a master.
    pub(super) fn of_master(option: &Cell16, can: &Cell16, seen: LedConditions) -> Self {
        let LedConditions { takes_part, has_traffic, .. } = seen;
        let h1 = green(option, can, takes_part && has_traffic);
        Leds { h: [h1, fault(can, takes_part), Led::Off, Led::Off] }
    }

    /// Returns the LEDs of a slave.
    pub(super) fn of_slave(option: &Cell16, can: &Cell16, seen: LedConditions) -> Self {
        let LedConditions { takes_part, interval_us, has_traffic } = seen;
        let h1 = green(option, can, takes_part && has_traffic);
        let h2 = if takes_part && interval_us.is_none() { Led::On } else { Led::Off };
        let h3 = interval(interval_us.filter(|_| takes_part));
        Leds { h: [h1, h2, h3, fault(can, takes_part)] }
    }

    /// Returns the LEDs of a slave for the controller (p. 30-31). The slave waits for the master until it has
    /// received SYNC for the first time; from then on, `has_sync` is true.
    pub(super) fn of_controllers_slave(has_sync: bool, seen: LedConditions) -> Self {
        let LedConditions { interval_us, has_traffic, .. } = seen;
        if !has_sync {
            return Leds { h: [Led::Off, Led::On, Led::Off, Led::On] };
        }
        let h1 = if has_traffic { Led::Flashes(1) } else { Led::Off };
        let h2 = if interval_us.is_none() { Led::On } else { Led::Off };
        Leds { h: [h1, h2, interval(interval_us), Led::Off] }
    }

    /// Returns the LEDs after an initialization that has ended with an error (p. 29-30). On a slave for the
    /// PLC, H2 and H4 flash together; on a slave for the controller, only H2 flashes.
    pub(super) fn of_init_error(is_for_plc: bool) -> Self {
        let h4 = if is_for_plc { Led::Flashes(1) } else { Led::Off };
        Leds { h: [Led::Off, Led::Flashes(1), Led::Off, h4] }
    }

    /// Returns the LEDs of a slave for the controller if DIP switches 1 to 3 have a combination without a
    /// baud rate (p. 31).
    pub(super) fn of_unknown_baud_rate() -> Self {
        Leds { h: [Led::Off, Led::InTurn, Led::Off, Led::InTurn] }
    }

    /// Returns the code in the header page: eight bits for each LED, H1 lowest.
    pub(super) fn code(self) -> u32 {
        let code = |led| match led {
            Led::Off => 0,
            Led::On => 0xFF,
            Led::InTurn => IN_TURN,
            Led::Flashes(count) => count,
        };
        u32::from_le_bytes(self.h.map(code))
    }

    /// Converts a code of the header page to the LEDs.
    pub fn of_code(code: u32) -> Self {
        let led = |byte| match byte {
            0 => Led::Off,
            0xFF => Led::On,
            IN_TURN => Led::InTurn,
            count => Led::Flashes(count),
        };
        Leds { h: code.to_le_bytes().map(led) }
    }
}

/// Returns the state of H3: 1, 2, 4 or 8 flashes for an interval of 1, 2, 4 or 8 ms.
fn interval(interval_us: Option<u64>) -> Led {
    interval_us.map_or(Led::Off, |us| Led::Flashes(((us + 500) / 1000).clamp(1, 8) as u8)) // at most 8
}

/// Returns the state of H1. The LED is lit while the module waits for the program. From then on it flashes
/// while frames pass. In BUS-off it is dark.
fn green(option: &Cell16, can: &Cell16, has_traffic: bool) -> Led {
    if option.load() <= option_status::WAITING_FOR_INIT {
        Led::On
    } else if has_traffic && !is_bus_off(can) {
        Led::Flashes(1)
    } else {
        Led::Off
    }
}

/// Returns the state of H2 of a master, or of H4 of a slave. The LED flashes in the case of a fault. The
/// emulator treats only BUS-off as a fault (decision D-367).
fn fault(can: &Cell16, takes_part: bool) -> Led {
    if takes_part && is_bus_off(can) { Led::Flashes(1) } else { Led::Off }
}

fn is_bus_off(can: &Cell16) -> bool {
    can.load() & cansync_status::BUS_OFF != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerocopy::FromZeros;

    /// Manual p. 28-30: the LEDs of each module while it waits, takes part with SYNC and without, and is in BUS-off.
    #[test]
    fn leds_show_the_state_of_the_module() {
        use Led::{Flashes, Off, On};
        let (option, can) = (Cell16::new_zeroed(), Cell16::new_zeroed());
        let seen =
            |takes_part, interval_us, has_traffic| LedConditions { takes_part, interval_us, has_traffic };
        let both = |seen| (Leds::of_master(&option, &can, seen).h, Leds::of_slave(&option, &can, seen).h);
        assert_eq!(both(seen(false, None, false)), ([On, Off, Off, Off], [On, Off, Off, Off]));
        option.store(option_status::WAITING_FOR_INIT + 1);
        assert_eq!(both(seen(false, Some(2000), false)), ([Off; 4], [Off; 4]));
        assert_eq!(both(seen(true, None, false)), ([Off; 4], [Off, On, Off, Off]));
        assert_eq!(
            both(seen(true, Some(2000), false)),
            ([Off; 4], [Off, Off, Flashes(2), Off]),
            "SYNC alone"
        );
        assert_eq!(
            both(seen(true, Some(2000), true)),
            ([Flashes(1), Off, Off, Off], [Flashes(1), Off, Flashes(2), Off])
        );
        can.store(cansync_status::BUS_OFF);
        assert_eq!(
            both(seen(true, Some(2000), true)),
            ([Off, Flashes(1), Off, Off], [Off, Off, Flashes(2), Flashes(1)])
        );
    }
}
