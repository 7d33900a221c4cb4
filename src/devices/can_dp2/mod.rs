//! esd CAN-DP/2: a PROFIBUS-DP slave in front of a CAN bus (Software-Handbuch CAN-DP/2, revision 1.1).

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod can_port;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub(super) mod demo;
#[cfg(feature = "emulator")]
mod dp_port;
#[cfg(feature = "emulator")]
pub(super) mod exercise;
#[cfg(feature = "emulator")]
mod form;
#[cfg(feature = "emulator")]
mod gateway;
#[cfg(feature = "emulator")]
mod master;
#[cfg(feature = "emulator")]
mod modules;
#[cfg(any(feature = "emulator", feature = "plc"))]
mod page;
#[cfg(feature = "emulator")]
mod pages;
#[cfg(feature = "emulator")]
mod parameters;
#[cfg(feature = "emulator")]
mod ram;
#[cfg(feature = "emulator")]
pub mod records;
#[cfg(feature = "emulator")]
pub mod rules;
#[cfg(feature = "emulator")]
mod slave;
#[cfg(feature = "emulator")]
mod stored;
#[cfg(all(test, feature = "emulator"))]
mod tests;
#[cfg(feature = "emulator")]
mod window;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use config::CanDp2Config;
#[cfg(feature = "emulator")]
use gateway::Gateway;
#[cfg(feature = "emulator")]
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The CAN side, which both ports share. A plant runs the ports one after the other, so the lock is always free.
#[cfg(feature = "emulator")]
type Shared = Arc<Mutex<Gateway>>;

#[cfg(feature = "emulator")]
fn share(gateway: Gateway) -> Shared {
    Arc::new(Mutex::new(gateway))
}

#[cfg(feature = "emulator")]
fn lock(gateway: &Shared) -> MutexGuard<'_, Gateway> {
    gateway.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Areas, structures and front, generated from `layouts/can-dp2`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/can_dp2.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    #[cfg(feature = "plc")]
    blocks: blocks::BLOCKS,
    #[cfg(feature = "emulator")]
    read: Some(CanDp2Config::read),
    #[cfg(feature = "emulator")]
    schema: Some(include_str!("plant.schema.json")),
    #[cfg(feature = "emulator")]
    template: Some(include_str!("plant.toml")),
    #[cfg(feature = "emulator")]
    records: records::KINDS,
    #[cfg(feature = "emulator")]
    rules: rules::ALL,
    #[cfg(feature = "emulator")]
    demo: Some(&demo::DEMO),
    #[cfg(feature = "emulator")]
    exercises: &exercise::EXERCISES,
    ..Registered::new(&registers::DEVICE)
};
