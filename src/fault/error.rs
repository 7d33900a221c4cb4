//! Errors in the description of a fault.

use super::{FaultKind, Field, MAX_FAULTS, TargetKind};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::Names;
use crate::layout::{DeviceLayout, did_you_mean};
use thiserror::Error;

/// Reason for which a fault is impossible. Here, buses and PLCs have their numbers from 0; [`FaultError::refused`]
/// replaces the numbers by names.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// A number outside its range.
    #[error("{field} is {}; it must be {} to {}", .field.show_with_unit(*.value), .field.show_with_unit(*.least), .field.show_with_unit(*.most))]
    Range {
        /// Field of the fault with the value.
        field: &'static Field,
        /// Value outside the range, in the unit of the field.
        value: u64,
        /// Smallest permitted value, in the unit of the field.
        least: u64,
        /// Largest permitted value, in the unit of the field.
        most: u64,
    },
    /// The description does not have a field that the fault needs.
    #[error("{field} is missing; {right}")]
    Missing {
        /// Field that the fault needs.
        field: &'static Field,
        /// Description of a correct value.
        right: String,
    },
    /// Values that are valid separately, but not in combination; the text describes the error.
    #[error("{0}")]
    Disagree(String),
    /// The kind acts on another kind of target.
    #[error("it acts on {}", acts_on(*.place))]
    OtherPlace {
        /// Kind of target on which the kind acts.
        place: TargetKind,
    },
    /// A count for a fault that has no hits.
    #[error("count has no meaning for {}; give duration_us, or clear the fault", .kind.name())]
    NotCounted {
        /// Kind of the fault, which has no hits to count.
        kind: &'static FaultKind,
    },
    /// The fault has a count and a duration.
    #[error("count and duration_us exclude each other; give one of them")]
    TwoLimits,
    /// There is no such bus.
    #[error("bus {bus} does not exist; the plant has {count}, numbered from 0")]
    UnknownBus {
        /// Number of the bus that does not exist, from 0.
        bus: BusIndex,
        /// Number of buses in the plant.
        count: u16,
    },
    /// There is no such PLC.
    #[error("PLC {plc} does not exist; the plant has {count}, numbered from 0")]
    UnknownPlc {
        /// Number of the PLC that does not exist, from 0.
        plc: DeviceIndex,
        /// Number of PLCs in the plant.
        count: u16,
    },
    /// There is no such slave.
    #[error("bus {bus} has no slave {slave}; its slaves are: {}", slave_list(*.present))]
    NoSlave {
        /// Number of the bus on which the fault should act, from 0.
        bus: BusIndex,
        /// Slave number that no slave of the bus has.
        slave: u8,
        /// The slaves of the bus, bit n for slave n.
        present: u32,
    },
    /// There is no such port.
    #[error("PLC {plc} has no port {port}; its ports are: {}", port_list(.layout))]
    NoPort {
        /// Number of the PLC on which the fault should act, from 0.
        plc: DeviceIndex,
        /// Number of the port that the PLC does not have.
        port: PortNumber,
        /// Layout of the PLC, which has the list of its ports.
        layout: &'static DeviceLayout,
    },
    /// The port is not on a bus.
    #[error("{port} of PLC {plc} is not on a bus; ports on a bus: {}", list(.plugged))]
    NotPlugged {
        /// Number of the PLC on which the fault should act, from 0.
        plc: DeviceIndex,
        /// Name of the port without a bus.
        port: &'static str,
        /// The ports of the PLC that are on a bus.
        plugged: Vec<&'static str>,
    },
    /// The bus cannot have such a fault.
    #[error("bus {bus} cannot have it; its faults are: {}", kind_list(.known))]
    NotOfBus {
        /// Number of the bus on which the fault should act, from 0.
        bus: BusIndex,
        /// The faults that buses of this family can have.
        known: &'static [&'static FaultKind],
    },
    /// The PLC cannot have such a fault.
    #[error("PLC {plc} cannot have it; its faults are: {}", kind_list(.known))]
    NotOfPlc {
        /// Number of the PLC on which the fault should act, from 0.
        plc: DeviceIndex,
        /// The faults that the PLC can have.
        known: &'static [&'static FaultKind],
    },
    /// There are too many faults.
    #[error("there are {MAX_FAULTS} faults already; clear one first")]
    TooMany,
    /// There is no fault of that number.
    #[error("there is no fault {id}; it may have ended")]
    UnknownFault {
        /// Number of a fault that the plant does not have.
        id: u16,
    },
}

/// Error in a [`FaultSpec`](super::FaultSpec).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FaultError {
    /// The kind does not exist.
    #[error("kind = \"{kind}\": there is no such fault{hint}; the kinds are: {known}")]
    UnknownKind {
        /// Name of the kind that the description gives.
        kind: String,
        /// Kind that may be meant.
        hint: String,
        /// Names of all kinds of fault, separated by commas.
        known: String,
    },
    /// A field that no kind has.
    #[error("{}: unknown field `{field}`{}; its fields are: {}", .kind.name(), did_you_mean(.field, .kind.usable_fields().map(Field::name)), field_list(.kind))]
    UnknownField {
        /// Kind of the fault, which has a list of valid fields.
        kind: &'static FaultKind,
        /// Name of the field that the description gives.
        field: String,
    },
    /// The kind does not have the field.
    #[error("{}: {field} has no meaning; its fields are: {}", .kind.name(), field_list(.kind))]
    NotForKind {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Field that this kind of fault does not have.
        field: &'static Field,
    },
    /// The description has a field twice, under both of its names.
    #[error("{}: {field} is given twice", .kind.name())]
    Twice {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Field that the description has twice.
        field: &'static Field,
    },
    /// The description has a text for a number, or a number for a text.
    #[error("{}: {field} = {given}; it must be {right}", .kind.name())]
    Form {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Field that has a value of the wrong type.
        field: &'static Field,
        /// The value in the description. A text has quotation marks.
        given: String,
        /// Description of a correct value.
        right: String,
    },
    /// The bus does not exist.
    #[error("{}: bus \"{bus}\" does not exist; buses are: {known}", .kind.name())]
    UnknownBus {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the bus that the description gives.
        bus: String,
        /// Names of all buses of the plant, separated by commas.
        known: String,
    },
    /// The PLC does not exist.
    #[error("{}: PLC \"{plc}\" does not exist; PLCs are: {known}", .kind.name())]
    UnknownPlc {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the PLC that the description gives.
        plc: String,
        /// Names of all PLCs of the plant, separated by commas.
        known: String,
    },
    /// The PLC does not have the port.
    #[error("{}: PLC \"{plc}\" has no port {port}; its ports are: {known}", .kind.name())]
    NoPort {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the PLC on which the fault should act.
        plc: String,
        /// Name of the port that the description gives.
        port: String,
        /// The ports of the PLC.
        known: String,
    },
    /// The bus does not have the slave.
    #[error("{}: bus \"{bus}\" has no slave {slave}; its slaves are: {}", .kind.name(), slave_list(*.present))]
    NoSlave {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the bus on which the fault should act.
        bus: String,
        /// Slave number that no slave of the bus has.
        slave: u8,
        /// The slaves of the bus, bit n for slave n.
        present: u32,
    },
    /// The port is not on a bus.
    #[error("{}: {port} of PLC \"{plc}\" is not on a bus; ports on a bus: {}", .kind.name(), list(.plugged))]
    NotPlugged {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the PLC on which the fault should act.
        plc: String,
        /// Name of the port without a bus.
        port: &'static str,
        /// The ports of the PLC that are on a bus.
        plugged: Vec<&'static str>,
    },
    /// The bus cannot have such a fault.
    #[error("{}: bus \"{bus}\" cannot have it; its faults are: {}", .kind.name(), kind_list(.known))]
    NotOfBus {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the bus on which the fault should act.
        bus: String,
        /// The faults that buses of this family can have.
        known: &'static [&'static FaultKind],
    },
    /// The PLC cannot have such a fault.
    #[error("{}: PLC \"{plc}\" cannot have it; its faults are: {}", .kind.name(), kind_list(.known))]
    NotOfPlc {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Name of the PLC on which the fault should act.
        plc: String,
        /// The faults that the PLC can have.
        known: &'static [&'static FaultKind],
    },
    /// The description could be read, but the fault is impossible.
    #[error("{}: {refusal}", .kind.name())]
    Refused {
        /// Kind of the fault.
        kind: &'static FaultKind,
        /// Reason why the fault is impossible.
        refusal: Refusal,
    },
}

impl FaultError {
    /// Adds the names of buses and PLCs to the refusal of a fault.
    pub fn refused(kind: &'static FaultKind, refusal: Refusal, names: &Names) -> Self {
        let (bus_name, plc_name) = (|bus| names.bus(bus).into_owned(), |plc| names.plc(plc).into_owned());
        match refusal {
            Refusal::NoSlave { bus, slave, present } => {
                FaultError::NoSlave { kind, bus: bus_name(bus), slave, present }
            }
            Refusal::NoPort { plc, port, layout } => FaultError::NoPort {
                kind,
                plc: plc_name(plc),
                port: port.to_string(),
                known: port_list(layout),
            },
            Refusal::NotPlugged { plc, port, plugged } => {
                FaultError::NotPlugged { kind, plc: plc_name(plc), port, plugged }
            }
            Refusal::NotOfBus { bus, known } => FaultError::NotOfBus { kind, bus: bus_name(bus), known },
            Refusal::NotOfPlc { plc, known } => FaultError::NotOfPlc { kind, plc: plc_name(plc), known },
            refusal => FaultError::Refused { kind, refusal },
        }
    }
}

/// Describes a kind of target in messages.
const fn acts_on(place: TargetKind) -> &'static str {
    match place {
        TargetKind::Bus => "a bus",
        TargetKind::Participant => "a participant of a bus",
        TargetKind::Port => "a port of a PLC",
        TargetKind::Device => "a PLC",
    }
}

/// Returns the names with commas between them, or "none".
pub(super) fn list<T: AsRef<str>>(names: &[T]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Returns names of kinds.
pub(super) fn kind_list(kinds: &[&FaultKind]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for kind in kinds {
        // Several devices may declare kinds of one name.
        if !names.contains(&kind.name()) {
            names.push(kind.name());
        }
    }
    list(&names)
}

/// Returns names of a device's ports.
pub(super) fn port_list(device: &DeviceLayout) -> String {
    list(&device.ports.iter().map(|port| port.name).collect::<Vec<_>>())
}

fn field_list(kind: &'static FaultKind) -> String {
    list(&kind.usable_fields().map(Field::name).collect::<Vec<_>>())
}

/// Slave numbers as text, bit n of `mask` for slave n.
pub fn slave_list(mask: u32) -> String {
    let numbers: Vec<_> = (0..32).filter(|n| mask >> n & 1 != 0).map(|n: u32| n.to_string()).collect();
    list(&numbers)
}
