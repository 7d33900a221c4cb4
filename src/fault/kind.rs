//! Kinds of faults, the fields that describe them, and where they act.

use super::FrameSlot;

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    /// A frame is lost.
    LoseFrame = 1,
    /// A frame comes late.
    DelayFrame,
    /// A frame comes twice.
    DuplicateFrame,
    /// A SYNC edge is lost.
    LoseSync,
    /// SYNC edges come late and early in turn.
    JitterSync,
    /// A slave is off.
    SlaveOff,
    /// A slave answers late.
    SlaveLate,
    /// A slave answers BUSY.
    SlaveBusy,
    /// A slave answers with an error number.
    SlaveError,
    /// An up-/download block carries a wrong offset.
    WrongOffset,
    /// A CAN controller is BUS-off.
    BusOff,
    /// A CAN controller loses frames it receives.
    Overrun,
    /// A drive on a bus has a fault.
    DriveFault,
    /// The drive behind the BAPS of a PLC has a fault.
    BapsDriveFault,
    /// The drive does nothing at the BAPS.
    BapsSilent,
    /// The drive is late at the BAPS.
    BapsSlow,
}

/// A field of a fault's description, as plant files name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Field {
    /// Name of the bus.
    Bus = 1,
    /// Slot of the interval.
    Slot,
    /// Identifier of the frames.
    Id,
    /// The bits of the identifier that count.
    Mask,
    /// Delay in microseconds.
    DelayUs,
    /// Jitter in microseconds.
    AmplitudeUs,
    /// Slave number.
    Slave,
    /// Error number.
    Error,
    /// Offset of a block.
    Offset,
    /// Name of the PLC.
    Plc,
    /// CANsync node.
    Node,
    /// Begin in microseconds since power-on.
    AtUs,
    /// Number of hits.
    Count,
    /// Duration in microseconds.
    DurationUs,
}

/// Where a fault acts. Buses and PLCs are counted as in the plant file, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// A bus.
    Bus(u16),
    /// A slave of a bus.
    Slave {
        /// The bus.
        bus: u16,
        /// Slave number.
        slave: u8,
    },
    /// A CANsync node of a PLC, or its BAPS.
    Node {
        /// The PLC.
        plc: u16,
        /// 1 or 2; 0 is the BAPS.
        node: u8,
    },
}

impl Target {
    /// The numbers from which [`Kind::target`] makes it again.
    pub const fn numbers(self) -> (u16, u8) {
        match self {
            Target::Bus(bus) => (bus, 0),
            Target::Slave { bus, slave } => (bus, slave),
            Target::Node { plc, node } => (plc, node),
        }
    }
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 16] = [
        Kind::LoseFrame,
        Kind::DelayFrame,
        Kind::DuplicateFrame,
        Kind::LoseSync,
        Kind::JitterSync,
        Kind::SlaveOff,
        Kind::SlaveLate,
        Kind::SlaveBusy,
        Kind::SlaveError,
        Kind::WrongOffset,
        Kind::BusOff,
        Kind::Overrun,
        Kind::DriveFault,
        Kind::BapsDriveFault,
        Kind::BapsSilent,
        Kind::BapsSlow,
    ];

    /// Its name in plant files, on the command line and in the journal.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::LoseFrame => "lose_frame",
            Kind::DelayFrame => "delay_frame",
            Kind::DuplicateFrame => "duplicate_frame",
            Kind::LoseSync => "lose_sync",
            Kind::JitterSync => "jitter_sync",
            Kind::SlaveOff => "slave_off",
            Kind::SlaveLate => "slave_late",
            Kind::SlaveBusy => "slave_busy",
            Kind::SlaveError => "slave_error",
            Kind::WrongOffset => "wrong_offset",
            Kind::BusOff => "bus_off",
            Kind::Overrun => "overrun",
            Kind::DriveFault => "drive_fault",
            Kind::BapsDriveFault => "baps_drive_fault",
            Kind::BapsSilent => "baps_silent",
            Kind::BapsSlow => "baps_slow",
        }
    }

    /// The kind of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The kind of a number.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == code)
    }

    /// Where a fault of this kind acts: `index` counts buses or PLCs, `number` is a slave or node.
    pub const fn target(self, index: u16, number: u8) -> Target {
        match self {
            Kind::LoseFrame | Kind::DelayFrame | Kind::DuplicateFrame | Kind::LoseSync | Kind::JitterSync => {
                Target::Bus(index)
            }
            Kind::SlaveOff
            | Kind::SlaveLate
            | Kind::SlaveBusy
            | Kind::SlaveError
            | Kind::WrongOffset
            | Kind::DriveFault => Target::Slave { bus: index, slave: number },
            Kind::BusOff | Kind::Overrun | Kind::BapsDriveFault | Kind::BapsSilent | Kind::BapsSlow => {
                Target::Node { plc: index, node: number }
            }
        }
    }

    /// Fields that describe it, besides when it begins and ends.
    pub const fn fields(self) -> &'static [Field] {
        use Field::{AmplitudeUs, Bus, DelayUs, Error, Id, Mask, Node, Offset, Plc, Slave, Slot};
        match self {
            Kind::LoseFrame => &[Bus, Slot, Id, Mask],
            Kind::DelayFrame | Kind::DuplicateFrame => &[Bus, Slot, Id, Mask, DelayUs],
            Kind::LoseSync => &[Bus],
            Kind::JitterSync => &[Bus, AmplitudeUs],
            Kind::SlaveOff | Kind::SlaveBusy => &[Bus, Slave],
            Kind::SlaveLate => &[Bus, Slave, DelayUs],
            Kind::SlaveError | Kind::DriveFault => &[Bus, Slave, Error],
            Kind::WrongOffset => &[Bus, Slave, Slot, Offset],
            Kind::BusOff | Kind::Overrun => &[Plc, Node],
            Kind::BapsDriveFault => &[Plc, Error],
            Kind::BapsSilent => &[Plc],
            Kind::BapsSlow => &[Plc, DelayUs],
        }
    }

    /// Slots that it can name.
    pub const fn slots(self) -> &'static [FrameSlot] {
        match self {
            Kind::WrongOffset => &[FrameSlot::Cc, FrameSlot::Rc],
            _ => &FrameSlot::ALL,
        }
    }

    /// Whether it happens once if nobody says how often. All others last until they are cleared.
    pub const fn happens_once(self) -> bool {
        matches!(self, Kind::BusOff | Kind::Overrun | Kind::DriveFault | Kind::BapsDriveFault)
    }
}

impl Field {
    /// All fields, in the order in which descriptions are written.
    pub const ALL: [Field; 14] = [
        Field::Bus,
        Field::Plc,
        Field::Node,
        Field::Slave,
        Field::Slot,
        Field::Id,
        Field::Mask,
        Field::DelayUs,
        Field::AmplitudeUs,
        Field::Error,
        Field::Offset,
        Field::AtUs,
        Field::Count,
        Field::DurationUs,
    ];

    /// Another name that is understood wherever [`Field::name`] is.
    pub const fn other_name(self) -> Option<&'static str> {
        match self {
            Field::DelayUs => Some("us"),
            Field::DurationUs => Some("for_us"),
            _ => None,
        }
    }

    /// Its name in plant files.
    pub const fn name(self) -> &'static str {
        match self {
            Field::Bus => "bus",
            Field::Slot => "slot",
            Field::Id => "id",
            Field::Mask => "mask",
            Field::DelayUs => "delay_us",
            Field::AmplitudeUs => "amplitude_us",
            Field::Slave => "slave",
            Field::Error => "error",
            Field::Offset => "offset",
            Field::Plc => "plc",
            Field::Node => "node",
            Field::AtUs => "at_us",
            Field::Count => "count",
            Field::DurationUs => "duration_us",
        }
    }

    /// The field of a number.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|field| *field as u8 == code)
    }

    /// Whether a value is written as a hexadecimal number.
    pub(super) const fn is_hexadecimal(self) -> bool {
        matches!(self, Field::Id | Field::Mask | Field::Error)
    }
}
