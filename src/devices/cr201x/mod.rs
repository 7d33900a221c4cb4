//! ifm's I/O modules CR2010 and CR2011, with the functions that a CS0015 uses (Systemhandbuch
//! Platinensteuerung CS0015, section 5.10). commram defines the internal behaviour of the modules (D-450,
//! D-451), so this emulation is not a reference for a real module.

#[cfg(feature = "emulator")]
mod emulation;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use emulation::{CHANNELS, Channels, Cr201xConfig, Model, Role};

/// Areas, structures, front panel and object dictionary, generated from `layouts/cr201x`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/cr201x.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    #[cfg(feature = "emulator")]
    emulation: emulation::EMULATION,
    ..Registered::new(&registers::DEVICE)
};
