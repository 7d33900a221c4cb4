//! Who runs a plant.

use super::travel::Travel;
use super::{InstanceInfo, Op, Refused};
use crate::door::Doors;
use crate::plant::Plant;

/// A plant with its clock, as operations need it. Times are emulated time in microseconds.
///
/// What an operation does to the plant is not here: [`super::Execution`] does it, for all hosts alike.
pub trait Host {
    /// The plant.
    fn plant(&self) -> &Plant;

    /// The plant, to do something to it.
    fn plant_mut(&mut self) -> &mut Plant;

    /// Whether the time only passes on request.
    fn is_stepped(&self) -> bool;

    /// An operation is about to be executed.
    ///
    /// # Errors
    /// [`Refused`]: this host cannot have that.
    fn permit(&mut self, op: &Op) -> Result<(), Refused> {
        let _ = op;
        Ok(())
    }

    /// Whether operations may be executed now that do more than look; if not, they wait.
    fn may_act(&self) -> bool {
        true
    }

    /// A request has come, and nothing else is under way. What guests at doors want is learned first; with a stepped clock, what
    /// the boards were asked for before it is answered, too: whoever asks of them and then sends a request always sees the same.
    fn begin_request(&mut self);

    /// Time of the next event; `u64::MAX` if there is none. Once [`Host::advance_to`] has gone there it is later.
    fn next_event(&self) -> u64;

    /// As [`Host::next_event`], but for looks at registers that find nothing to do: until then no register changes but by
    /// somebody outside.
    fn next_change(&self) -> u64 {
        self.next_event()
    }

    /// Stepped mode: runs everything up to and including time `t`. Going there in several calls has the
    /// same outcome as going there in one. `false`: the host is to stop, or somebody has a turn for whom the time waits;
    /// then it is called again with the same `t`.
    fn advance_to(&mut self, t: u64) -> bool;

    /// Asked between the parts of an operation that lets time pass: whether it is to pause, so that others are heard
    /// meanwhile. Whoever executes it goes on with it then. Where it pauses makes no difference to the plant.
    fn should_pause(&self) -> bool {
        false
    }

    /// The doors to its buses, to do something to them; `None` if there cannot be any.
    fn doors(&mut self) -> Option<&mut Doors> {
        None
    }

    /// The doors as they are.
    fn doors_seen(&self) -> Option<&Doors> {
        None
    }

    /// The plant, and what is kept for going back with it.
    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel);

    /// Who takes part from outside, if anybody does: he cannot go back when the plant does.
    fn outsiders(&mut self) -> Option<String> {
        None
    }

    /// The plant is somewhere else on its way.
    fn has_travelled(&mut self) {}

    /// What the instance says about itself.
    fn info(&self) -> InstanceInfo;

    /// Asks the host to end; [`Host::should_stop`] is true from then on.
    fn request_stop(&mut self);

    /// Whether the host is to end (a signal came in, or a client asked). Asked during long advances.
    fn should_stop(&self) -> bool;
}
