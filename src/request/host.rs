//! Host of a plant.

use super::travel::Travel;
use super::{InstanceInfo, Op, Refused};
use crate::door::Doors;
use crate::plant::Plant;

/// A plant with its clock, as operations need it. Times are emulated time in microseconds.
///
/// The effects of operations on the plant are not defined here: [`super::Execution`] applies them, equally for all
/// hosts.
pub trait Host {
    /// The plant.
    fn plant(&self) -> &Plant;

    /// The plant, for changes.
    fn plant_mut(&mut self) -> &mut Plant;

    /// Whether the time only passes on request.
    fn is_stepped(&self) -> bool;

    /// An operation is about to be executed.
    ///
    /// # Errors
    /// [`Refused`]: this host does not support the operation.
    fn permit(&mut self, op: &Op) -> Result<(), Refused> {
        let _ = op;
        Ok(())
    }

    /// Whether operations that change the plant may be executed now; if not, they wait.
    fn may_act(&self) -> bool {
        true
    }

    /// A request has come, and no other request is in progress. The host first takes the inputs of guests at doors.
    /// With a stepped clock it also answers the pending requests to the boards, so that a client with a board request
    /// followed by a channel request always sees the same result.
    fn begin_request(&mut self);

    /// Time of the next event; `u64::MAX` if there is none. The time is later after [`Host::advance_to`] has reached
    /// it.
    fn next_event(&self) -> u64;

    /// Same as [`Host::next_event`], but without polls that change nothing: until then only outside programs change
    /// registers.
    fn next_change(&self) -> u64 {
        self.next_event()
    }

    /// Stepped mode: runs everything up to and including time `t`. Several calls have the same outcome as a single
    /// call. `false`: the host is to stop, or the time waits for a participant that has a turn; the caller then calls
    /// again with the same `t`.
    fn advance_to(&mut self, t: u64) -> bool;

    /// Real time only: changes the speed of the clock from the present time on; `permille` is emulated time per real
    /// time x 1000, 0 pauses the clock.
    fn set_speed(&mut self, permille: u32) {
        let _ = permille;
    }

    /// Called between the parts of an operation that advances the clock: whether it is to pause so that other clients
    /// can be served. The caller continues the operation afterwards. A pause makes no difference to the plant.
    fn should_pause(&self) -> bool {
        false
    }

    /// The doors to its buses, for changes; `None` if there cannot be any.
    fn doors(&mut self) -> Option<&mut Doors> {
        None
    }

    /// The doors to its buses, for reading.
    fn doors_seen(&self) -> Option<&Doors> {
        None
    }

    /// The plant, and the history for going back.
    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel);

    /// Outside participants, if there are any: they cannot go back with the plant.
    fn outsiders(&mut self) -> Option<String> {
        None
    }

    /// The plant has gone to another moment of its history.
    fn has_travelled(&mut self) {}

    /// Description of the instance.
    fn info(&self) -> InstanceInfo;

    /// Asks the host to end, for the process of this number if it is known; [`Host::should_stop`] is true from then on.
    fn request_stop(&mut self, by: Option<u32>);

    /// The reason why the host ends, in words, if it is known.
    fn end_reason(&self) -> Option<&str> {
        None
    }

    /// Whether the host is to end (a signal came in, or a client asked). Called during long advances.
    fn should_stop(&self) -> bool;
}
