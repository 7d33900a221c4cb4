//! Files that describe a device and can change while the plant runs.

use super::Context;

/// The part of a device that takes over changes of its files.
pub trait FileChanges {
    /// Takes over what has changed in the files since the last call, and records it in the journal. Returns the new number
    /// for the settings of the device in snapshots, as `settings_number` gives it; `None` if the device stays as it is.
    fn take_over(&mut self, ctx: &mut Context) -> Option<u64>;
}
