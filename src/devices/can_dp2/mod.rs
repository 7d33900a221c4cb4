//! esd CAN-DP/2: a gateway between PROFIBUS-DP, where it is a slave, and a CAN bus (Software-Handbuch CAN-DP/2,
//! revision 1.1).

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod emulation;
#[cfg(any(feature = "emulator", feature = "plc"))]
mod page;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use emulation::{CanDp2Config, rules};

/// Areas, structures and front panel, generated from `layouts/can-dp2`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/can_dp2.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    #[cfg(feature = "plc")]
    blocks: blocks::BLOCKS,
    #[cfg(feature = "emulator")]
    emulation: emulation::EMULATION,
    ..Registered::new(&registers::DEVICE)
};
