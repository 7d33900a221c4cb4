//! The host of a plant: the interface through which operations reach the plant and its clock.

use super::travel::Travel;
use super::{InstanceInfo, Op, Refused};
use crate::door::Doors;
use crate::plant::Plant;

/// A plant with its clock. Operations are executed through this trait. Times are emulated time in microseconds.
///
/// The effects of operations on the plant are not defined here: [`super::Execution`] applies them, equally for all
/// hosts.
pub trait Host {
    /// Returns the plant that the requests act on.
    fn plant(&self) -> &Plant;

    /// Returns the plant, for changes.
    fn plant_mut(&mut self) -> &mut Plant;

    /// True if the clock advances only on request.
    fn is_stepped(&self) -> bool;

    /// Called before an operation is executed. The default permits all operations.
    ///
    /// # Errors
    /// [`Refused`]: this host does not support the operation.
    fn permit(&mut self, op: &Op) -> Result<(), Refused> {
        let _ = op;
        Ok(())
    }

    /// True if operations that change the plant may be executed now. Otherwise they wait.
    fn may_act(&self) -> bool {
        true
    }

    /// Called when a request has come and no other request is in progress. The host first takes over the inputs of
    /// guests at doors. With a stepped clock it also answers the pending requests in the header pages. So a client that
    /// makes a request in the header page, and then one through the channel, always gets the same result.
    fn begin_request(&mut self);

    /// Returns the time of the next event; `u64::MAX` if there is none. After [`Host::advance_to`] has reached this
    /// time, the function returns a later time.
    fn next_event(&self) -> u64;

    /// Returns a time like [`Host::next_event`], but ignores polls of the firmware that change nothing. Until this
    /// time, only outside programs change registers.
    fn next_change(&self) -> u64 {
        self.next_event()
    }

    /// Handles all events up to and including time `t`. Used only with a stepped clock. Several calls have the same
    /// effect as a single call. Returns `false` if the host must stop, or if the clock waits for a participant that has
    /// a turn. In the second case the caller calls again with the same `t`.
    fn advance_to(&mut self, t: u64) -> bool;

    /// Begins a change of the clock's speed from the present time on. Used only with a real-time clock. `permille` is
    /// emulated time per real time x 1000; 0 pauses the clock. Returns `false` while an earlier change is in progress;
    /// the caller then calls again later.
    fn set_speed(&mut self, permille: u32) -> bool {
        let _ = permille;
        true
    }

    /// True while a change of the speed is in progress: the plant has not reached the time at which the change applies.
    fn is_changing_speed(&self) -> bool {
        false
    }

    /// Called between the parts of an operation that advances the clock. Returns true if the operation must pause, so
    /// that the host can serve other clients. The caller continues the operation afterwards. A pause has no influence
    /// on the plant.
    fn should_pause(&self) -> bool {
        false
    }

    /// Returns the doors to the plant's buses, for changes; `None` if this host has no doors.
    fn doors(&mut self) -> Option<&mut Doors> {
        None
    }

    /// Returns the doors to the plant's buses, for reading.
    fn doors_seen(&self) -> Option<&Doors> {
        None
    }

    /// Returns the plant, and the history by which it can return to an earlier moment.
    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel);

    /// Returns names of outside participants, which cannot go back in time with the plant; `None` if there are none.
    fn outsiders(&mut self) -> Option<String> {
        None
    }

    /// Called when an operation is about to advance the stepped clock, to take a snapshot or to restore one. A host that
    /// runs an instance with its own clock then lets the devices take over files that users have changed.
    fn take_over_files(&mut self) {}

    /// Called when the plant has moved to another moment of its history.
    fn has_travelled(&mut self) {}

    /// Description of the instance.
    fn info(&self) -> InstanceInfo;

    /// Requests the host to end. `by` is the process that requests it, if known. [`Host::should_stop`] is true from
    /// then on.
    fn request_stop(&mut self, by: Option<u32>);

    /// Returns the reason why the host ends, as text, if it is known.
    fn end_reason(&self) -> Option<&str> {
        None
    }

    /// True if the host must end, because of a signal or the request of a client. Called during long advances.
    fn should_stop(&self) -> bool;
}
