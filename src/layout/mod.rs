//! Register maps: generated structs and descriptors, names and addresses of registers.
//!
//! The layout files in `layouts/` are the only source of names, offsets, types, owners, reset values and meanings. The
//! build compiles them into a module `registers` of each device. It contains typed views for the firmware, and
//! descriptors that all output for people uses:
//!
//! ```
//! let device = commram::devices::default().layout;
//! let status = device.register("node2.w_OPTION_STATUS")?;
//! assert_eq!(status.address().to_string(), "%MW3.200002");
//! assert_eq!(status.format_value(0x43), "16#0043");
//! assert_eq!(status.decode(0x43), "synchronous operation of the master is being set up");
//! # Ok::<(), commram::layout::LayoutError>(())
//! ```

mod address;
mod condition;
mod decode;
mod descriptor;
mod device_fit;
mod error;
mod front;
pub(crate) mod gsd;
mod iter;
mod lookup;
mod name;
mod nearest;
pub(crate) mod object;
mod pattern;
pub(crate) mod place;
mod register;
mod space;
#[cfg(all(test, feature = "export"))]
pub(crate) use space::samples;
pub(crate) mod value;
mod width;

pub use address::Address;
pub use condition::{Compare, Condition, ConditionError, Test};
pub use decode::format_value;
pub use descriptor::{
    Area, AreaStructure, BitField, DeviceLayout, Dim, Handshake, Meaning, Owner, Phase, Phases, Port,
    Provenance, RegType, Register, RegisterPhase, Role, Structure, ValueMeaning,
};
pub(crate) use device_fit::MOST_PORTS;
pub use device_fit::{DeviceFit, Fit};
pub use error::LayoutError;
pub use front::{FrontWord, shown_text};
pub use gsd::Gsd;
pub use iter::Registers;
pub use lookup::Target;
pub use name::{AreaOrRegisters, plc_prefix, split_plc};
pub use nearest::{did_you_mean, nearest};
pub use object::Object;
pub use pattern::is_pattern;
pub use place::{BitAccess, NamedLocation};
pub use register::RegisterRef;
pub use space::{Retain, Space, Unit};
pub use width::Width;
