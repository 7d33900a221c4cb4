//! The list of all kinds of buses.

use super::{BusKind, can_faults};
use crate::devices::{can_bus, cansync, profibus_bus, serial_bus};
use crate::door::TrafficKind;

/// Returns the messages that a kind of bus carries.
#[cfg(feature = "cli")]
pub(crate) fn traffic_kind_of(kind: &str) -> Option<TrafficKind> {
    BUS_KINDS.iter().find(|it| it.name == kind).map(|it| it.traffic_kind)
}

/// Every kind of bus. The first one is the default.
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
