//! The devices, each in a separate folder, and the registry of all devices. [`cansync`] has the common parts of the
//! CANsync devices. A folder has three parts: the registers, `blocks` with the function blocks (feature `plc`), and
//! `emulation` with the firmware, its configuration, records, rules and faults (feature `emulator`). The folder
//! `emulation` beside the devices has the same parts of all devices.

pub mod bm4_o_can_06;
#[cfg(feature = "emulator")]
pub mod can_bus;
pub mod can_dp2;
#[cfg(feature = "emulator")]
pub(crate) mod canopen;
pub mod cansync;
pub mod cr201x;
pub mod cs0015;
#[cfg(feature = "emulator")]
pub(crate) mod emulation;
#[cfg(feature = "emulator")]
pub mod folder;
#[cfg(feature = "plc")]
mod intr_set;
#[cfg(test)]
mod names_tests;
pub mod omega_drive_line_2;
#[cfg(feature = "cli")]
pub(crate) mod pages;
#[cfg(feature = "emulator")]
pub(crate) mod profibus_bus;
#[cfg(test)]
mod provenance_tests;
mod registry;
#[cfg(test)]
pub(crate) mod samples;
#[cfg(feature = "emulator")]
pub(crate) mod serial_bus;

pub use registry::{RegisterError, Registered, all, attach, board_of, default, find, of_hash, register};

#[cfg(feature = "emulator")]
pub(crate) use cansync::drive::parameter_provenance;

#[cfg(feature = "emulator")]
pub use self::{
    canopen::node_sends,
    emulation::catalogue::{bus_site, catalogue, door_fits, fault_kinds, faults_of_device},
    emulation::dissectors::dissectors,
    emulation::{
        AddressWrites, Attendance, BUS_KINDS, BuildError, Bus, BusGuests, BusKind, BusSection, BusView,
        CardMemory, CardPlace, CardPulses, Context, ControllerPulses, Device, DeviceConfig, DevicePorts,
        DeviceView, Doubt, DriveDetails, DriveState, Drives, Emulation, Events, Exercise, Faulty,
        FileChanges, Firmware, FirstExchange, Front, FrontAction, GuestNews, GuestRefusal, Interval, Led,
        MasterConfig, ModuleFront, Move, NovramContents, OptionCard, OptionInterface, OptionSlots,
        ParameterRefusal, ParameterState, ParticipantId, Plain, Plug, PortConfig, PortWatch, Power,
        RateMismatch, Read, ReadModule, SettingError, Shaft, Slot, StationState, Switch, SyncLine,
        SyncOrigin, SyncSignal, World, Wrong, modules, records, settings_number,
    },
};
