//! Membership of an emulator in a federation: several emulators share a plant, and their stepped clocks wait for each
//! other.
//!
//! Input on this host enters the plant only in the turn of this federate: requests of clients, stores of programs that
//! map an image, actions of tasks in lockstep. The turn ends when a client of this host requests to advance the clock.
//! The turn of a federate that only follows ends immediately.

use super::emulator::{Emulator, LONGEST_SLEEP};
use super::error::RuntimeError;
use super::lockstep::Witness;
use crate::coupling::Coupling;
use crate::federation::{Exchange, FederateConfig, Federation, FederationError, FederationEvent};
use crate::identity::DeviceIndex;
use crate::memory::header::SeatState;
use crate::plant::Plant;
use crate::request::Travel;

/// Longest emulated time between two turns in a plant with devices in folders. Their scripts may take long, and the
/// federates answer their clients only between turns.
const FOLDERS_US: u64 = 10_000;

/// Result of a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TurnOutcome {
    /// A task is still running.
    Continues,
    /// The turn has ended.
    Ended,
    /// The clock has reached the requested time.
    Arrived,
}

/// The membership of this emulator in a federation.
#[derive(Default)]
pub(super) struct Membership {
    pub(super) federation: Option<Federation>,
    /// Exchange of values with other simulators.
    pub(super) coupling: Option<Coupling>,
    /// An error that occurred in a function without an error result. The main loop reports it.
    error: Option<FederationError>,
}

impl Membership {
    /// True if input may enter the plant in this process at this emulated time. If an exchange with other simulators is
    /// due, it comes first.
    pub(super) fn may_act(&self, now: u64) -> bool {
        self.has_turn() && !self.is_exchange_due(now)
    }

    pub(super) fn has_turn(&self) -> bool {
        self.federation.as_ref().is_none_or(Federation::is_own_turn)
    }

    fn is_exchange_due(&self, now: u64) -> bool {
        self.coupling.as_ref().is_some_and(|coupling| coupling.is_due(now))
    }

    /// Description of the participant that the clock waits for.
    pub(super) fn waits_for(&self, now: u64) -> Option<String> {
        let others = self.federation.as_ref()?.waits_for();
        others.or_else(|| self.is_exchange_due(now).then(|| "the other simulators".to_owned()))
    }

    /// Returns the time of the next exchange with other simulators, which may change registers.
    pub(super) fn next_exchange(&self, now: u64) -> u64 {
        self.federation.as_ref().map_or(u64::MAX, |federation| federation.next_exchange(now))
    }
}

impl Witness for Federation {
    fn boards(&mut self, plant: &mut Plant) -> bool {
        self.look_at_boards(plant)
    }

    fn task(&mut self, plc: DeviceIndex, event: usize, state: SeatState) {
        self.note_task(plc, event, state);
    }
}

impl Emulator {
    /// Shares the plant with other emulators from now on. The clock must be stepped,
    /// [`is_federate`](super::Options::is_federate) must be set, and no input may have entered the plant yet.
    ///
    /// # Errors
    /// The emulator was not started to share its plant, or the message to the others cannot be sent.
    pub fn join(&mut self, part: FederateConfig, exchange: Box<dyn Exchange>) -> Result<(), RuntimeError> {
        if !self.options.is_federate {
            return Err(FederationError::Unprepared.into());
        }
        // A federate cannot go back in time alone, so it keeps no history.
        self.travel = Travel::new(0);
        self.membership.federation = Some(Federation::join(part, &self.plant, exchange)?);
        Ok(())
    }

    /// Returns a function that makes the emulator check for messages. Any thread may call it.
    pub fn waker(&self) -> impl Fn() + Send + Sync + use<> {
        let handle = self.stop_handle();
        move || handle.wake()
    }

    /// Runs until this emulator is requested to end, or until another federate ends.
    pub(super) fn run_federated(&mut self) -> Result<(), RuntimeError> {
        let mut outcome = Ok(());
        while !self.is_stopping() && outcome.is_ok() {
            let has_rung = self.note_rings();
            let news = self.look_for_news();
            if !matches!(news, Ok(FederationEvent::Nothing)) {
                self.notify_events();
                self.announce();
            }
            if let Ok(FederationEvent::Left(federate)) = news {
                tracing::warn!("federate {federate} has left; the plant ends here as well");
                self.stop.make(Some(format!("federate {federate} has left")));
                break;
            }
            let mut has_news = matches!(news, Ok(FederationEvent::Moved));
            match self.exchange() {
                Ok(has_taken) => has_news |= has_taken,
                Err(error) => {
                    outcome = Err(error);
                    break;
                }
            }
            let had_turn = self.may_act_now();
            if has_rung {
                self.look_around();
            }
            let served = self.serve_channel();
            if served {
                self.announce();
            }
            let follows = self.membership.federation.as_ref().is_some_and(Federation::follows);
            let mut continues = self.is_time_passing() && self.may_act_now();
            let mut has_ended = false;
            if follows && !continues && self.may_act_now() {
                continues = self.take_turn(None) == TurnOutcome::Continues;
                has_ended = !continues;
            }
            // The federate must process messages of other federates before it acts in its next turn. This also holds
            // for a federate that is alone: it has its next turn immediately.
            has_ended |= had_turn && !self.may_act_now();
            outcome = news.map(drop).and_then(|()| self.membership.error.take().map_or(Ok(()), Err));
            if !has_news && !served && !has_ended && !continues && outcome.is_ok() {
                self.sleep(LONGEST_SLEEP);
            }
        }
        if let Err(error) = &outcome {
            // Clients that wait get this reason.
            self.stop.make(Some(error.to_string()));
        }
        if let Some(mut coupling) = self.membership.coupling.take() {
            coupling.leave();
        }
        if let Some(federation) = self.membership.federation.take() {
            federation.leave(outcome.as_ref().err());
        }
        outcome.map_err(RuntimeError::Federation)
    }

    fn look_for_news(&mut self) -> Result<FederationEvent, FederationError> {
        // The federation is taken out of the emulator for the call. The emulator then does not send the input of other
        // federates back to them.
        let Some(mut federation) = self.membership.federation.take() else {
            return Ok(FederationEvent::Nothing);
        };
        let news = federation.look(self);
        self.membership.federation = Some(federation);
        news
    }

    /// Called in this federate's turn. Lets boards answer and gives seats to tasks, without advancing the clock.
    pub(super) fn look_around(&mut self) {
        if !self.may_act_now() {
            return;
        }
        let Emulator { plant, lockstep, membership, .. } = self;
        let Some(federation) = &mut membership.federation else { return };
        let boards = federation.look_at_boards(plant);
        if lockstep.look(plant, federation) || boards {
            self.announce();
        }
    }

    /// Gives this federate's turn to its participants in lockstep, and ends it with the request to reach `target`.
    fn take_turn(&mut self, target: Option<u64>) -> TurnOutcome {
        let Emulator { plant, lockstep, membership, stop, .. } = self;
        let Some(federation) = &mut membership.federation else { return TurnOutcome::Continues };
        federation.look_at_boards(plant);
        let is_over = lockstep.take_turns(plant, || stop.is_made(), federation);
        if !is_over {
            return TurnOutcome::Continues;
        }
        if target.is_some_and(|target| federation.has_reached(target)) {
            return TurnOutcome::Arrived;
        }
        let want = lockstep.next_turn().min(target.unwrap_or(u64::MAX));
        let want = want.min(federation.next_exchange(plant.now()));
        let longest = if plant.has_folders() { FOLDERS_US } else { u64::MAX };
        let want = want.min(plant.now().saturating_add(longest));
        let ended = federation.end_turn(plant, target, want, lockstep.watched());
        membership.error = ended.err();
        TurnOutcome::Ended
    }

    /// Advances like [`Host::advance_to`](crate::request::Host::advance_to). Returns true when the clock has reached
    /// `target`.
    pub(super) fn ask_for(&mut self, target: u64) -> bool {
        self.may_act_now() && self.take_turn(Some(target)) == TurnOutcome::Arrived
    }
}
