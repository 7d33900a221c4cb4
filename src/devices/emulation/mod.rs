//! The parts that the emulation of every device uses: the traits of devices and buses, sections of plant files, boards,
//! and the catalogue of all records, rules and faults.

mod bus_kinds;
pub(in crate::devices) mod can_faults;
pub(crate) mod catalogue;
mod config;
pub(crate) mod demo;
pub(in crate::devices) mod dissectors;
#[cfg(all(test, feature = "channel"))]
mod event_text_tests;
mod exercise;
#[cfg(test)]
mod fault_tests;
#[cfg(all(test, feature = "channel"))]
mod fields_tests;
mod first_exchange;
mod module;
mod plain;
pub(in crate::devices) mod program;
pub(in crate::devices) mod recorded_register;
pub mod records;
mod registration;
pub(crate) mod settings;
pub(in crate::devices) mod supply;
pub(in crate::devices) mod traffic_receivers;
mod traits;

pub use bus_kinds::BUS_KINDS;
#[cfg(feature = "cli")]
pub(crate) use bus_kinds::traffic_kind_of;
pub use config::{
    BusKind, BusSection, CardMemory, CardPlace, DeviceConfig, Doubt, MasterConfig, PortConfig, Read,
    settings_number,
};
pub use exercise::{Exercise, Move, Wrong};
pub use first_exchange::FirstExchange;
pub use module::{Led, ModuleFront, ReadModule, Switch, modules};
pub use plain::{Firmware, Plain};
pub use registration::{Emulation, OptionInterface};
pub use settings::{BuildError, SettingError};
pub use traits::{
    AddressWrites, Attendance, Bus, BusGuests, BusView, CardPulses, Context, ControllerPulses, Device,
    DevicePorts, DeviceView, DriveDetails, DriveState, Drives, Events, Faulty, FileChanges, Front,
    FrontAction, GuestNews, GuestRefusal, Interval, NovramContents, OptionCard, OptionSlots,
    ParameterRefusal, ParameterState, ParticipantId, Plug, PortWatch, Power, RateMismatch, Shaft, Slot,
    StationState, SyncLine, SyncOrigin, SyncSignal, World,
};
