//! Samples for tests of other modules. Through these names, such tests need not name a device.

#[cfg(feature = "emulator")]
mod events;
#[cfg(feature = "emulator")]
pub(crate) mod master;
#[cfg(feature = "emulator")]
mod station;
pub(crate) mod tables;

/// A function block of the device in the built-in plant. It has an input `us_BAUDRATE`.
#[cfg(feature = "cli")]
pub(crate) const BLOCK: &str = "CANsync_INIT";

#[cfg(feature = "channel")]
pub(crate) use events::{event, event_at};

/// Copies the files of one of the project's device folders into a new directory.
#[cfg(feature = "emulator")]
pub(crate) fn copy_folder(name: &str, to: &std::path::Path) {
    let source = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices").join(name);
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(source).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_file() {
            std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
    }
}
