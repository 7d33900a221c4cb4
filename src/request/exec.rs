//! Executes operations. This module is the only place that defines the effects of operations.

mod buses;
mod clock;
mod drives;
mod faults;
mod instance;
mod range;
mod records;
mod registers;
mod scene;
mod snapshots;
mod time;

use super::op::Class;
use super::ops::ops;
use super::register::Register;
use super::{Host, Op, Refused, Reply, travel};
use crate::identity::DeviceIndex;
use crate::layout::Test;

/// An operation in progress.
///
/// With a stepped clock an operation advances the clock where needed. While the operation pauses
/// ([`Host::should_pause`]), it has no reply, and the caller continues it soon. In real time a wait cannot advance the
/// clock: [`Execution::run`] returns no reply yet, and the caller calls it again after every firmware step.
#[derive(Debug, Default)]
pub struct Execution {
    /// Latest end of the operation in progress, in emulated microseconds.
    end: Option<u64>,
    /// An operation advances the clock in parts. This is the emulated time at which the present part ends, in
    /// microseconds. A pause within a part does not change its end.
    part: Option<u64>,
    /// True if the operation has advanced the clock.
    has_set_out: bool,
    /// Number of events that a wait has handled.
    events: u32,
    /// Conditions of the next wait.
    conditions: Vec<(Register, Test)>,
    /// Octets of the telegram that the request is sending.
    octets: Vec<u8>,
    /// Number of the client. It connects the several requests in which a client sends a file. 0 for operations of the
    /// emulator's own process.
    client: u128,
    /// Process id of a client that requests the host to end, if it is known.
    process: Option<u32>,
}

impl Execution {
    /// Prepares for the operations of the client with this number.
    #[cfg(feature = "channel")]
    pub(crate) fn of_client(client: u128) -> Self {
        Execution { client, ..Self::default() }
    }

    /// Sets the process that requests the host to end.
    #[cfg(feature = "channel")]
    pub(crate) fn set_process(&mut self, process: Option<u32>) {
        self.process = process;
    }

    /// Executes or continues the operation; `None` while it waits or pauses.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn run(&mut self, host: &mut dyn Host, op: &Op) -> Result<Option<Reply>, Refused> {
        self.run_while(host, op, &mut || true)
    }

    /// Does the same as [`Execution::run`]. Gives up an operation that would take long without a pause, and leaves the
    /// plant unchanged, if `is_awaited` returns false: the client no longer waits for the reply.
    ///
    /// # Errors
    /// [`Refused`].
    pub(crate) fn run_while(
        &mut self,
        host: &mut dyn Host,
        op: &Op,
        is_awaited: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Reply>, Refused> {
        op.check_ranges()?;
        host.permit(op)?;
        if op.acts() {
            travel::is_about_to_act(host);
            // The history records stores separately.
            if op.class() != Class::Stores {
                host.plant_and_travel().1.touch();
            }
        }
        let reply = Work { execution: self, host, is_awaited }.execute(*op)?;
        if reply.is_some() {
            self.has_set_out = false;
        }
        Ok(reply)
    }

    /// True if the operation has begun and waits or pauses.
    pub fn is_under_way(&self) -> bool {
        self.end.is_some()
    }
}

/// An execution and its host. For each operation it has a function with the name of the operation.
struct Work<'a> {
    execution: &'a mut Execution,
    host: &'a mut dyn Host,
    /// Returns false when the client no longer waits for the reply.
    is_awaited: &'a mut dyn FnMut() -> bool,
}

/// Declares the call of the function of each operation.
macro_rules! dispatch {
    ($(
        $(#[$doc:meta])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $type:ty $([..=$most:ident, $code:ident])? => $($column:ident)+
        ),+ $(,)?})?
    ),+ $(,)?) => {
        impl Work<'_> {
            /// Executes or continues the operation; `None` while it waits or pauses.
            fn execute(&mut self, op: Op) -> Result<Option<Reply>, Refused> {
                Ok(match op {
                    $(Op::$op $({ $($field),+ })? => self.$name($($($field),+)?)?.into(),)+
                })
            }
        }
    };
}

ops!(dispatch);

fn plc_name(host: &dyn Host, plc: DeviceIndex) -> &str {
    host.plant().devices().get(plc.index()).map_or("", |device| device.name())
}

#[cfg(test)]
mod tests;
