//! The devices, each in a separate folder, and the registry of all devices. [`cansync`] has the common parts of the
//! CANsync devices.

pub mod bm4_o_can_06;
#[cfg(feature = "emulator")]
pub mod can_bus;
pub mod can_dp2;
#[cfg(feature = "emulator")]
mod can_faults;
#[cfg(feature = "emulator")]
pub(crate) mod canopen;
pub mod cansync;
#[cfg(feature = "emulator")]
mod catalogue;
#[cfg(feature = "emulator")]
mod config;
pub mod cr201x;
pub mod cs0015;
#[cfg(feature = "emulator")]
pub(crate) mod demo;
#[cfg(feature = "emulator")]
mod dissectors;
#[cfg(all(test, feature = "channel"))]
mod event_text_tests;
#[cfg(feature = "emulator")]
mod exercise;
#[cfg(all(test, feature = "emulator"))]
mod fault_tests;
#[cfg(all(test, feature = "channel"))]
mod fields_tests;
#[cfg(feature = "emulator")]
mod first_exchange;
#[cfg(feature = "emulator")]
pub mod folder;
#[cfg(feature = "plc")]
mod intr_set;
#[cfg(feature = "emulator")]
mod module;
#[cfg(test)]
mod names_tests;
pub mod omega_drive_line_2;
#[cfg(feature = "cli")]
pub(crate) mod pages;
#[cfg(feature = "emulator")]
mod plain;
#[cfg(feature = "emulator")]
pub(crate) mod profibus_bus;
#[cfg(feature = "emulator")]
mod program;
#[cfg(test)]
mod provenance_tests;
#[cfg(feature = "emulator")]
mod recorded_register;
#[cfg(feature = "emulator")]
pub mod records;
mod registry;
#[cfg(test)]
pub(crate) mod samples;
#[cfg(feature = "emulator")]
pub(crate) mod serial_bus;
#[cfg(feature = "emulator")]
pub(crate) mod settings;
#[cfg(feature = "emulator")]
mod supply;
#[cfg(feature = "emulator")]
mod traffic_receivers;
#[cfg(feature = "emulator")]
mod traits;

#[cfg(feature = "emulator")]
pub use canopen::node_sends;
#[cfg(feature = "channel")]
pub(crate) use catalogue::declared_fault_kinds;
#[cfg(feature = "cli")]
pub(crate) use catalogue::fault_kinds_of;
#[cfg(feature = "emulator")]
pub(crate) use catalogue::known_fault_kinds;
#[cfg(feature = "emulator")]
pub use catalogue::{bus_site, catalogue, door_fits, fault_kinds, faults_of_device};
#[cfg(feature = "emulator")]
pub use config::{
    BusKind, BusSection, CardMemory, CardPlace, DeviceConfig, Doubt, MasterConfig, PortConfig, Read,
    settings_number,
};
#[cfg(feature = "emulator")]
pub use dissectors::dissectors;
#[cfg(feature = "emulator")]
pub use exercise::{Exercise, Move, Wrong};
#[cfg(feature = "emulator")]
pub use first_exchange::FirstExchange;
#[cfg(feature = "emulator")]
pub use module::{Led, ModuleFront, ReadModule, Switch, modules};
#[cfg(feature = "emulator")]
pub use plain::{Firmware, Plain};
#[cfg(feature = "emulator")]
pub use registry::{Emulation, OptionInterface};
pub use registry::{RegisterError, Registered, all, attach, board_of, default, find, of_hash, register};
#[cfg(feature = "emulator")]
pub use settings::{BuildError, SettingError};
#[cfg(feature = "emulator")]
pub use traits::{
    AddressWrites, Attendance, Bus, BusGuests, BusView, CardPulses, Context, ControllerPulses, Device,
    DevicePorts, DeviceView, DriveDetails, DriveState, Drives, Events, Faulty, FileChanges, Front,
    FrontAction, GuestNews, GuestRefusal, Interval, NovramContents, OptionCard, OptionSlots,
    ParameterRefusal, ParameterState, ParticipantId, Plug, PortWatch, Power, RateMismatch, Shaft, Slot,
    StationState, SyncLine, SyncOrigin, SyncSignal, World,
};

#[cfg(feature = "emulator")]
use crate::door::TrafficKind;

/// Returns the messages that a kind of bus carries.
#[cfg(feature = "cli")]
pub(crate) fn traffic_kind_of(kind: &str) -> Option<TrafficKind> {
    BUS_KINDS.iter().find(|it| it.name == kind).map(|it| it.traffic_kind)
}

/// Every kind of bus. The first one is the default.
#[cfg(feature = "emulator")]
pub static BUS_KINDS: &[BusKind] = &[
    BusKind {
        name: cansync::bus::FAMILY,
        read: cansync::bus::BusConfig::read,
        schema: cansync::bus::BusConfig::schema,
        records: cansync::records::KINDS,
        rules: cansync::rules::ALL,
        faults: cansync::faults::KINDS,
        fits: can_faults::fits_cansync,
        traffic_kind: TrafficKind::Frames,
        describe: cansync::records::describe,
        unplugged: || Box::new(cansync::bus::SimBus::unplugged()),
        runs_alone: cansync::bus::runs_alone,
    },
    BusKind {
        name: can_bus::FAMILY,
        read: can_bus::CanBusConfig::read,
        schema: can_bus::CanBusConfig::schema,
        records: can_bus::records::KINDS,
        rules: &[],
        faults: can_faults::OF_CAN,
        fits: can_faults::fits_can,
        traffic_kind: TrafficKind::Frames,
        describe: |_| String::new(),
        unplugged: || Box::new(can_bus::CanBus::unplugged()),
        runs_alone: |_| false,
    },
    BusKind {
        name: profibus_bus::FAMILY,
        read: profibus_bus::ProfibusConfig::read,
        schema: profibus_bus::ProfibusConfig::schema,
        records: profibus_bus::records::KINDS,
        rules: &[],
        faults: profibus_bus::faults::KINDS,
        fits: |_| Ok(()),
        traffic_kind: TrafficKind::Telegrams,
        describe: |_| String::new(),
        unplugged: || Box::new(profibus_bus::ProfibusBus::unplugged()),
        runs_alone: |_| false,
    },
    BusKind {
        name: serial_bus::FAMILY,
        read: serial_bus::SerialConfig::read,
        schema: serial_bus::SerialConfig::schema,
        records: serial_bus::records::KINDS,
        rules: serial_bus::rules::ALL,
        faults: serial_bus::faults::KINDS,
        fits: |_| Ok(()),
        traffic_kind: TrafficKind::Octets,
        describe: |_| String::new(),
        unplugged: || Box::new(serial_bus::SerialBus::unplugged()),
        runs_alone: |_| false,
    },
];
