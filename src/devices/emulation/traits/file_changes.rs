//! Files that describe a device and can change while the plant runs.

use super::Context;
use std::path::Path;

/// The part of a device that takes over changes of its files.
pub trait FileChanges {
    /// Takes over the changes of the files since the last call, and records them in the journal. Returns the
    /// new number for the settings of the device in snapshots, as computed by `settings_number`. `None` if
    /// the device has not changed.
    fn take_over(&mut self, ctx: &mut Context) -> Option<u64>;

    /// True if the device has refused the present files, and continues with earlier ones.
    fn has_refused(&self) -> bool {
        false
    }

    /// Returns the folder with the files.
    fn folder(&self) -> &Path;
}
