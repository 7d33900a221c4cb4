//! ifm's I/O modules CR2010 and CR2011, with the functions that a CS0015 uses (Systemhandbuch
//! Platinensteuerung CS0015, section 5.10). commram defines the internal behaviour of the modules (D-450,
//! D-451), so this emulation is not a reference for a real module.

#[cfg(feature = "emulator")]
mod channels;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
mod dictionary;
#[cfg(feature = "emulator")]
mod module;
#[cfg(all(test, feature = "emulator"))]
mod tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use channels::{CHANNELS, Channels, Model, Role};
#[cfg(feature = "emulator")]
pub use config::Cr201xConfig;

/// Areas, structures, front panel and object dictionary, generated from `layouts/cr201x`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/cr201x.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    #[cfg(feature = "emulator")]
    emulation: crate::devices::Emulation {
        schema: Some(include_str!("plant.schema.json")),
        template: Some(include_str!("plant.toml")),
        first_exchange: Some(crate::devices::FirstExchange {
            writes: &[("front.inputs", 0x0001)],
            answer: ("channels.a_INPUT[0]", 0x0001),
            within: "500ms",
        }),
        records: crate::devices::canopen::records::KINDS,
        ..crate::devices::Emulation::of(Cr201xConfig::read)
    },
    ..Registered::new(&registers::DEVICE)
};
