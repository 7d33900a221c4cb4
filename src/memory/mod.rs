//! The emulated RAM: cells, segments, header page, image files.
//!
//! [`Segment`] is the RAM of one device, on the heap or in a mapped file. The firmware and Rust clients
//! access it through typed [`View`]s of register cells. Tools that only know addresses use its raw
//! accesses at a given [`Width`].

mod access;
mod attach;
pub(crate) mod bell;
pub mod cell;
pub mod contract;
pub(crate) mod directory;
mod emulator_process;
mod error;
mod file;
#[cfg(feature = "emulator")]
mod firmware_header;
mod guard;
pub mod header;
mod image;
mod instance;
pub(crate) mod limits;
mod list;
mod locks;
#[cfg(feature = "emulator")]
mod marks;
pub mod names;
#[cfg(feature = "emulator")]
mod onlookers;
pub(crate) mod private;
pub(crate) mod process;
#[cfg(feature = "channel")]
mod register_copy;
#[cfg(feature = "channel")]
mod requests;
pub(crate) mod room;
mod running;
#[cfg(feature = "emulator")]
mod saved_registers;
mod segment;
mod struct_tables;
mod view;
mod widths;
#[cfg(feature = "emulator")]
mod writers;

pub use crate::layout::{Address, Width};
#[cfg(feature = "emulator")]
pub(crate) use access::Block;
pub use attach::{AttachMode, Attached, LockstepTask};
pub use bell::Bell;
pub use cell::{Cell8, Cell16, Cell32, Cell64, SharedRegs};
pub use emulator_process::EmulatorProcess;
#[cfg(feature = "cli")]
pub(crate) use emulator_process::{is_from_stop, sender_of};
pub use error::MemoryError;
#[cfg(feature = "emulator")]
pub use firmware_header::FirmwareHeader;
#[cfg(feature = "channel")]
pub(crate) use guard::channel_has_gaps;
pub use guard::{end_on_shortened_files, survive_shortened_files};
#[cfg(feature = "web")]
pub(crate) use guard::{page_size, survive_lost_channels, take_gap_of_thread};
pub use header::{Board, ClockMode, EventSlot, HEADER_SIZE, Header, RunSwitch, State};
pub use image::{FileState, Image, ImageFileWatch, ImageSpec};
#[cfg(feature = "emulator")]
pub(crate) use instance::DeviceFolder;
pub use instance::InstanceLock;
pub use list::{Condition, ImageInfo, ImageSummary, instances, list};
#[cfg(feature = "emulator")]
pub(crate) use marks::{LINE, LineMarks};
#[cfg(feature = "emulator")]
pub(crate) use onlookers::{Onlookers, WakeReason, end as end_of_wait};
#[cfg(feature = "channel")]
pub(crate) use register_copy::{RegisterCopy, StoredBytes};
pub use running::RunningInstance;
pub use segment::Segment;
pub use view::View;
pub use widths::{RegisterWidths, Unmapped};
#[cfg(feature = "emulator")]
pub(crate) use writers::describe_process;

#[cfg(test)]
mod testing;
