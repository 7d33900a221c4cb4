//! Coupling of an emulator with other simulators. Exchanges take place in the turns of its federate.

use super::emulator::Emulator;
use crate::coupling::{Coupling, Progress};
use crate::federation::FederationError;

impl Emulator {
    /// Couples the emulator with other simulators: exchanges values with them from now on. This federate must have
    /// [joined](Emulator::join) with the period of the coupling.
    pub fn couple(&mut self, coupling: Coupling) {
        self.membership.coupling = Some(coupling);
    }

    /// True if input may enter the plant on this host now.
    pub(super) fn may_act_now(&self) -> bool {
        self.membership.may_act(self.plant.now())
    }

    /// Exchanges values with other simulators if it is time for an exchange and this federate has the turn. Returns
    /// true if an exchange took place. If all other simulators have disconnected, stops the emulator.
    pub(super) fn exchange(&mut self) -> Result<bool, FederationError> {
        if !self.membership.has_turn() {
            return Ok(false);
        }
        // The exchange needs the whole emulator as its host. So the coupling is taken out of the emulator for the call.
        let Some(mut coupling) = self.membership.coupling.take() else { return Ok(false) };
        let progress = coupling.take(self);
        let was_one = matches!(progress, Ok(Progress::Exchanged(_)));
        match &progress {
            Ok(Progress::Exchanged(turned)) => {
                for (drive, speed) in turned {
                    self.plant.turn_shaft(*drive, *speed);
                    if let Some(federation) = &mut self.membership.federation {
                        federation.note_shaft(*drive, *speed);
                    }
                }
                coupling.give(&self.plant);
                self.announce();
            }
            Ok(Progress::HaveGone) => {
                tracing::warn!("the other simulators have ended; the plant ends here as well");
                self.stop.make(Some("the other simulators have ended".to_owned()));
            }
            Ok(Progress::Nothing | Progress::Waits) | Err(_) => {}
        }
        self.membership.coupling = Some(coupling);
        progress?;
        Ok(was_one)
    }
}
