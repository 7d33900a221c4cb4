//! Refusal of an operation: a code for programs, a text for people.

use super::{Host, Waited};
use crate::fault;
use crate::layout::DeviceLayout;
use crate::memory::header::BoardSetting;
use core::fmt;
use serde::Serialize;

/// Code of a refusal. `docs/reference/channel.md` lists all codes. An emulator of a later version may have other codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Code(pub u16);

impl Code {
    /// No register area covers the register.
    pub const UNMAPPED: Self = Self(1);
    /// A range contains addresses outside the register areas.
    pub const RANGE_UNMAPPED: Self = Self(2);
    /// The address does not suit the width.
    pub const MISALIGNED: Self = Self(3);
    /// A range is longer than one operation may read.
    pub const RANGE_TOO_LONG: Self = Self(4);
    /// The replies of one request together are too long.
    pub const REPLY_TOO_LONG: Self = Self(5);
    /// The value, mask or comparison value has more bits than the register.
    pub const VALUE_TOO_WIDE: Self = Self(6);
    /// The awaited value has bits outside the mask.
    pub const NEVER_MATCHES: Self = Self(7);
    /// The instance has no PLC of that number.
    pub const UNKNOWN_PLC: Self = Self(8);
    /// The clock runs in real time, so a client cannot advance it.
    pub const CLOCK_IS_REAL_TIME: Self = Self(9);
    /// The clock is stepped, and a stepped clock has no speed.
    pub const CLOCK_IS_STEPPED: Self = Self(16);
    /// The speed of the clock is too high.
    pub const SPEED_TOO_HIGH: Self = Self(17);
    /// The register did not match in time; [`Refused::waited`] contains its value.
    pub const NOT_IN_TIME: Self = Self(10);
    /// No station sends SYNC on that bus, or the bus does not exist.
    pub const NO_SYNC: Self = Self(11);
    /// The request has too many operations.
    pub const TOO_MANY_OPERATIONS: Self = Self(12);
    /// The bytes of the operation are invalid.
    pub const MALFORMED: Self = Self(13);
    /// The advance of the clock is too long.
    pub const ADVANCE_TOO_LONG: Self = Self(14);
    /// The emulator is ending.
    pub const SHUTTING_DOWN: Self = Self(15);
    /// A fault that the plant cannot have.
    pub const FAULT: Self = Self(20);
    /// There is no room for another fault.
    pub const TOO_MANY_FAULTS: Self = Self(27);
    /// No fault has that number.
    pub const UNKNOWN_FAULT: Self = Self(28);
    /// A force must concern exactly one whole register.
    pub const NOT_WHOLE: Self = Self(30);
    /// Too many registers are forced.
    pub const TOO_MANY_FORCES: Self = Self(31);
    /// Too many registers are followed.
    pub const TOO_MANY_FOLLOWED: Self = Self(41);
    /// The register is not forced.
    pub const NOT_FORCED: Self = Self(32);
    /// No program can be started or stopped on that PLC now.
    pub const START_REFUSED: Self = Self(33);
    /// The PLC or its module has no such switch.
    pub const NO_SUCH_SWITCH: Self = Self(34);
    /// Only the firmware writes this word of a device's front panel.
    pub const READ_ONLY: Self = Self(39);

    /// The host has no doors.
    pub const NO_DOORS: Self = Self(35);
    /// The instance has no bus of that number.
    pub const UNKNOWN_BUS: Self = Self(36);
    /// The door does not exist, or the bus cannot have this door.
    pub const DOOR: Self = Self(37);
    /// The bus refuses the frame.
    pub const FRAME: Self = Self(38);
    /// The queue of frames to be sent is full; try again later.
    pub const QUEUE_FULL: Self = Self(45);

    /// A wait for conditions has too many of them, or none.
    pub const CONDITIONS: Self = Self(40);
    /// A snapshot cannot be kept, read or restored.
    pub const SNAPSHOT: Self = Self(50);
    /// An outside participant cannot go back with the plant, or its actions cannot be repeated.
    pub const NOT_ALONE: Self = Self(51);
    /// The time is before the kept history, or the condition did not occur within the kept history.
    pub const NOT_SO_FAR: Self = Self(52);

    /// The instance has no drive of that number.
    pub const UNKNOWN_DRIVE: Self = Self(42);
    /// The drive refuses the parameter, or this value of the parameter.
    pub const PARAMETER: Self = Self(43);
    /// The operation is not possible now: the drive has no supply or is recalculating the parameter, other clients keep all
    /// snapshots, or no place for a guest is free.
    pub const NOT_NOW: Self = Self(44);
    /// The operating system refuses a resource, such as a file descriptor or an address.
    pub const NO_RESOURCE: Self = Self(46);

    /// True if no state of the plant permits the operation. False if another state may permit it.
    pub fn is_wrong_use(self) -> bool {
        const STATES: [Code; 14] = [
            Code::QUEUE_FULL,
            Code::TOO_MANY_FAULTS,
            Code::TOO_MANY_FOLLOWED,
            Code::TOO_MANY_FORCES,
            Code::NOT_IN_TIME,
            Code::NO_SYNC,
            Code::START_REFUSED,
            Code::NOT_NOW,
            Code::NO_RESOURCE,
            Code::NOT_SO_FAR,
            Code::NOT_ALONE,
            Code::CLOCK_IS_REAL_TIME,
            Code::CLOCK_IS_STEPPED,
            Code::SHUTTING_DOWN,
        ];
        !STATES.contains(&self)
    }
}

/// Reason for a refusal. The text names the error, its place, and a correct value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("{text}")]
pub struct Refused {
    /// Code by which a client can distinguish the reasons.
    pub code: Code,
    /// The reason in words, for people.
    pub text: String,
    /// For a wait that has ended ([`Code::NOT_IN_TIME`]): the time, and the value of the register.
    pub waited: Option<Waited>,
}

impl Refused {
    /// Returns a refusal with its text.
    pub(crate) fn new(code: Code, text: impl fmt::Display) -> Self {
        Self { code, text: text.to_string(), waited: None }
    }

    /// Returns the refusal of a setting because the device `device` of the PLC `plc` has no such switch.
    pub(crate) fn no_such_switch(plc: &str, device: &DeviceLayout, setting: BoardSetting) -> Self {
        let text = match setting {
            BoardSetting::ModuleDip { port, .. } => {
                let port = device.port_numbered(port).map_or("that port", |port| port.name);
                format!("PLC '{plc}': there is no module with DIP switches in {port}")
            }
            _ => format!("PLC '{plc}' has no '{}' to be set, it is a {}", setting.name(), device.title),
        };
        Self::new(Code::NO_SUCH_SWITCH, text)
    }

    /// Returns the refusal of a setting that the device `device` of the PLC `plc` cannot execute in its present state.
    pub(crate) fn setting(plc: &str, device: &DeviceLayout, setting: BoardSetting, why: &str) -> Self {
        let word = match setting {
            BoardSetting::Front { word, value } => {
                let known = device.front.iter().find(|known| known.index() == usize::from(word));
                known.map_or_else(String::new, |known| format!("{}={}", known.name, known.called(value)))
            }
            other => other.name().to_owned(),
        };
        Self::new(Code::START_REFUSED, format_args!("PLC '{plc}' refuses {word}: {why}"))
    }

    /// Returns the refusal of an operation because the emulator ends before the operation is done.
    pub(crate) fn ending(host: &dyn Host) -> Self {
        let instance = host.info().name;
        let reason = host.end_reason().map_or_else(String::new, |reason| format!(": {reason}"));
        Self::new(Code::SHUTTING_DOWN, format_args!("instance '{instance}' is ending{reason}"))
    }

    /// Returns the refusal of a fault, with this text.
    pub(super) fn fault(refusal: &fault::Refusal, text: impl fmt::Display) -> Self {
        let code = match refusal {
            fault::Refusal::TooMany => Code::TOO_MANY_FAULTS,
            fault::Refusal::UnknownFault { .. } => Code::UNKNOWN_FAULT,
            _ => Code::FAULT,
        };
        Self::new(code, text)
    }
}

impl From<fault::Refusal> for Refused {
    fn from(refusal: fault::Refusal) -> Self {
        Self::fault(&refusal, &refusal)
    }
}
