//! A HELICS federate that sends and receives commands.

use super::HelicsError;
use super::library::{Functions, Object, text};
use core::ffi::{CStr, c_char};

/// A federate that only sends and receives commands. Its time is independent of the time of other federates.
pub(super) struct CommandFederate {
    functions: Functions,
    federate: Object,
}

// SAFETY: HELICS finds federates by their handles and uses thread-safe queues. Only the buffer of the last command is
// unguarded, and only the thread that waits for commands uses it.
unsafe impl Send for CommandFederate {}
// SAFETY: as above.
unsafe impl Sync for CommandFederate {}

impl CommandFederate {
    /// Joins a federation as `name`. Returns when all federates that the broker expects have joined, or when the core
    /// gives up.
    ///
    /// # Errors
    /// There is no broker, or the name is in use.
    pub(super) fn join(functions: Functions, name: &str, init: &str) -> Result<Self, HelicsError> {
        let failed = |reason| HelicsError::of_joining(name, reason);
        let made = functions.create(functions.create_plain, (name, init), |_| Ok(()));
        let federate = made.map_err(failed)?;
        // SAFETY: here and below: the objects are the library's own; texts live through the calls.
        functions.checked(|it, status| unsafe { (it.enter_executing)(federate, status) }).map_err(failed)?;
        Ok(CommandFederate { functions, federate })
    }

    /// Sends a command to a federate. If this federate is absent, the command is lost.
    pub(super) fn send(&self, to: &str, command: &str) -> Result<(), String> {
        let (to, command) = (text(to), text(command));
        self.functions.checked(|it, status| {
            // SAFETY: as above.
            unsafe { (it.send_command)(self.federate, to.as_ptr(), command.as_ptr(), status) }
        })
    }

    /// Waits for the next command; returns sender and text. Only one thread may call this.
    pub(super) fn wait(&self) -> Result<(String, String), String> {
        let functions = &self.functions;
        let copied = |at: *const c_char| {
            // SAFETY: HELICS does not change the command until the next wait, and it is copied now.
            let text = unsafe { (!at.is_null()).then(|| CStr::from_ptr(at)) };
            text.unwrap_or_default().to_string_lossy().into_owned()
        };
        let command = functions.checked(|it, status| {
            // SAFETY: as above.
            copied(unsafe { (it.wait_command)(self.federate, status) })
        })?;
        let source = functions.checked(|it, status| {
            // SAFETY: as above.
            copied(unsafe { (it.command_source)(self.federate, status) })
        })?;
        Ok((source, command))
    }

    /// Leaves the federation. Earlier commands arrive first.
    pub(super) fn leave(&self) {
        // SAFETY: as above. A leaving federate ignores the result.
        let _ = self.functions.checked(|it, status| unsafe { (it.disconnect)(self.federate, status) });
    }
}
