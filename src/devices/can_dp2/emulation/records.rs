//! Journal events of a CAN-DP/2.

use crate::devices::can_dp2::registers::DEVICE;
use crate::event_kinds;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Reader};
use crate::layout::RegisterPhase;

/// All event kinds of this module.
pub(crate) static KINDS: &[&EventKind] = &[DpState::KIND, Refused::KIND, WatchdogOut::KIND, CanState::KIND];

event_kinds! {
    /// The state of the DP slave has changed (p. 15).
    DpState = 73, "dp_state", Rare, at plc {
        /// State as in register `dp_state`.
        to: u8,
    }
    /// The DP slave refuses parameters or a configuration (p. 20-21).
    Refused = 74, "dp_refused", Rare, at plc {
        /// Octet 8 of the diagnosis.
        cause: u8,
        /// Octet 9 of the diagnosis.
        number: u8,
        /// Octet 10 of the diagnosis.
        detail: u8,
    }
    /// The master has sent no request within the watchdog time.
    WatchdogOut = 75, "dp_watchdog", Missed, at plc {}
    /// The state of the gateway on CAN has changed.
    CanState = 76, "gateway_state", Rare, at plc {
        /// State as in register `can_state`.
        to: u8,
    }
}

/// Returns the meaning of a register value.
fn meaning(register: &str, value: u8) -> String {
    let place = crate::layout::NamedLocation::parse(&crate::layout::DeviceFit::unknown(&DEVICE), register);
    place.map_or_else(|_| value.to_string(), |place| place.meaning(RegisterPhase::ALWAYS, value.into()))
}

impl EventText for DpState {
    fn text(&self, _: &mut Reader) -> String {
        format!("DP slave: {}", meaning("diag.dp_state", self.to))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("to", self.to)
    }
}

impl EventText for Refused {
    fn text(&self, _: &mut Reader) -> String {
        let cause = meaning("diag.ext_cause", self.cause);
        format!("{cause}: number {}, 16#{:02X}", self.number, self.detail)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("cause", self.cause).with("number", self.number).with("detail", self.detail)
    }
}

impl EventText for WatchdogOut {
    fn text(&self, _: &mut Reader) -> String {
        "watchdog: no request of the master".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

impl EventText for CanState {
    fn text(&self, _: &mut Reader) -> String {
        format!("CAN: {}", meaning("can.can_state", self.to))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("to", self.to)
    }
}
