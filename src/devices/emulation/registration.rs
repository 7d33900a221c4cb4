//! The part of a device's registration that only the emulator uses.

use crate::devices::Exercise;
use crate::devices::emulation::demo::Demo;
use crate::devices::{DeviceConfig, FirstExchange, Read, ReadModule};
use crate::fault;
use crate::journal::{EventKind, Rule};

/// Firmware of a device, with its journal records, rules and faults. Use [`Emulation::of`] as the base of a struct
/// update to set other properties: `Emulation { rules: ALL, ..Emulation::of(read) }`.
#[derive(Clone, Copy, Debug)]
pub struct Emulation {
    /// Reads the section of the device in a plant file; `None` if the device has only registers.
    pub read: Option<Read<dyn DeviceConfig>>,
    /// JSON schema of the keys of the device's section, except `kind`. `#/definitions/name` is the schema of
    /// names.
    pub schema: Option<&'static str>,
    /// A template of a plant file with the device. The first device in it shows every key.
    pub template: Option<&'static str>,
    /// First exchange of a program with the device in the template, for `commram new`; `None` if there is none.
    pub first_exchange: Option<FirstExchange>,
    /// Kinds of journal records that only the firmware of this device writes.
    pub records: &'static [&'static EventKind],
    /// Rules of the access checker that only apply to this device.
    pub rules: &'static [&'static Rule],
    /// Kinds of faults of the device itself, or of its ports on any bus.
    pub faults: &'static [&'static fault::FaultKind],
    /// Reads the front panel of a module; `None` if the device has no modules.
    pub module: Option<ReadModule>,
    /// Demonstration for `commram demo`; `None` if there is none.
    pub demo: Option<&'static Demo>,
    /// Exercises for `commram soak`.
    pub exercises: &'static [&'static Exercise],
    /// Interfaces for the registers of option cards; empty if cards have their registers in their own images.
    pub option_interfaces: &'static [OptionInterface],
}

/// A part of the memory of a controller that contains the registers of an option card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OptionInterface {
    /// Number of the interface.
    pub number: u8,
    /// Slot of the card, from 1. The first interface of a slot is the default.
    pub slot: u8,
    /// First byte of the area in the image.
    pub first: u32,
}

impl Emulation {
    /// Returns a device with firmware. `read` reads its section of a plant file.
    #[must_use]
    pub const fn of(read: Read<dyn DeviceConfig>) -> Self {
        Emulation { read: Some(read), ..Self::NONE }
    }

    /// A device without firmware: only its registers are known.
    pub const NONE: Self = Emulation {
        read: None,
        schema: None,
        template: None,
        first_exchange: None,
        records: &[],
        rules: &[],
        faults: &[],
        module: None,
        demo: None,
        exercises: &[],
        option_interfaces: &[],
    };
}
