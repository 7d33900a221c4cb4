//! The emulated RAM: cells, segments, header page, image files.
//!
//! [`Segment`] is segment 3 of one PLC, on the heap or in a mapped file. The firmware and Rust clients
//! access it through typed [`View`]s of register cells. Tools that only know addresses use its raw
//! accesses at a given [`Width`].

mod access;
#[cfg(feature = "channel")]
mod asked;
mod attach;
pub mod bell;
pub mod cell;
pub mod contract;
#[cfg(feature = "channel")]
mod copied;
pub(crate) mod directory;
mod emulator_process;
mod error;
#[cfg(feature = "emulator")]
mod face;
mod file;
mod guard;
pub mod header;
mod image;
mod instance;
#[cfg(feature = "emulator")]
mod kept;
pub(crate) mod limits;
mod list;
mod locks;
#[cfg(feature = "emulator")]
mod mapped;
pub mod names;
#[cfg(feature = "emulator")]
mod onlookers;
pub(crate) mod private;
pub(crate) mod process;
mod published;
pub(crate) mod room;
mod running;
mod segment;
mod view;
mod widths;

pub use crate::layout::{Address, Width};
#[cfg(feature = "emulator")]
pub(crate) use access::Block;
pub use attach::{AttachMode, Attached, LockstepTask};
pub use bell::Bell;
pub use cell::{Cell8, Cell16, Cell32, Cell64, SharedRegs};
#[cfg(feature = "channel")]
pub(crate) use copied::{RegisterCopy, StoredBytes};
pub use emulator_process::EmulatorProcess;
pub use error::MemoryError;
#[cfg(feature = "emulator")]
pub use face::Face;
#[cfg(feature = "channel")]
pub(crate) use guard::channel_has_gaps;
pub use guard::{end_on_shortened_files, survive_shortened_files};
pub use header::{Board, ClockMode, EventSlot, HEADER_SIZE, Header, RunSwitch, State};
pub use image::{FileState, Image, ImageFileWatch, ImageSpec};
pub use instance::InstanceLock;
pub use list::{Condition, ImageInfo, ImageSummary, instances, list};
#[cfg(feature = "emulator")]
pub(crate) use onlookers::{Onlookers, Woken, end as end_of_wait};
pub use running::RunningInstance;
pub use segment::Segment;
pub use view::View;
pub use widths::{RegisterWidths, Unmapped};

#[cfg(test)]
mod testing;
