//! A station on a CAN bus, without registers.

use crate::identity::PortNumber;
use crate::layout::{Area, DeviceLayout, Port, Provenance, Role, Space, Unit};
use crate::memory::HEADER_SIZE;

static SPACE: Space = Space {
    name: "can",
    letter: 'M',
    segment: "",
    unit: Unit::Byte,
    first: 0,
    offset: 0,
    bytes: HEADER_SIZE as u32,
    page: "",
    doc: "",
};
static AREA: Area = Area {
    name: "can",
    name_from: Provenance::Manual,
    space: &SPACE,
    first: 0,
    bytes: HEADER_SIZE as u32,
    cpu: None,
    doc: "",
    page: "",
    phases: None,
    structures: &[],
};
static PORTS: [Port; 1] =
    [Port { name: "can", number: PortNumber(1), medium: "can", roles: &[Role::Peer], area: &AREA }];

/// A station on a CAN bus, without registers.
pub(crate) static STATION: DeviceLayout = DeviceLayout { ports: &PORTS, ..DeviceLayout::UNKNOWN };
