//! What the journal can tell.

use crate::bus::Frame;
use core::fmt;

/// Where a record comes from: a CANsync node of a PLC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Index of the PLC in the plant.
    pub plc: u16,
    /// CANsync node, 1 (slave) or 2 (master).
    pub node: u8,
}

/// A command in `w_CPU_CONTROL` that had no effect, and why it is worth a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// The command does not exist or is reserved.
    Unknown,
    /// The command exists but not in the node's present state.
    NotNow,
}

/// A deadline of the process data that was missed, so that a frame is left out in this interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missed {
    /// Reference value frame 1 or 2 was not released by 16#05 in time.
    ReferenceValue(u8),
    /// Own actual value frame 1 or 2 was asked for but had not been released by 16#05 in time.
    ActualValue(u8),
}

/// One thing that happened. Register offsets are absolute `%MB3` byte numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Falling edge of the SYNC signal on a bus: an interval begins.
    SyncEdge {
        /// Index of the bus in the plant.
        bus: u16,
    },
    /// A frame was transmitted; the time is the end of the frame, when its receivers have it.
    Frame {
        /// Index of the bus in the plant.
        bus: u16,
        /// The frame itself.
        frame: Frame,
    },
    /// `w_OPTION_STATUS` of a node changed.
    State {
        /// The node.
        origin: Origin,
        /// Value before.
        from: u16,
        /// Value now.
        to: u16,
    },
    /// The firmware answered a handshake register.
    Handshake {
        /// The node.
        origin: Origin,
        /// Absolute `%MB3` offset of the register.
        offset: u32,
        /// What the PLC had written.
        request: u16,
        /// What the firmware wrote instead.
        answer: u16,
    },
    /// A deadline was missed.
    Missed {
        /// The node.
        origin: Origin,
        /// Which one.
        what: Missed,
    },
    /// A value in `w_CPU_CONTROL` was ignored.
    CommandIgnored {
        /// The node.
        origin: Origin,
        /// The value.
        value: u16,
        /// Why.
        why: Command,
    },
    /// Initialization data was refused; `reason` is the number of an
    /// [`InitFault`](crate::firmware::cansync::InitFault).
    InitRefused {
        /// The node.
        origin: Origin,
        /// Number of the fault.
        reason: u8,
    },
    /// The master's picture of a slave (`a_STAT_SL[slave]`) changed.
    SlaveStatus {
        /// The master.
        origin: Origin,
        /// Slave number.
        slave: u8,
        /// New value: bit 0 responds, bit 1 synchronized.
        status: u8,
    },
    /// A node is set to another baud rate than its bus and hears nothing.
    BaudRateMismatch {
        /// The node.
        origin: Origin,
        /// The node's baud rate in kbit/s.
        node_kbit_s: u16,
        /// The bus's baud rate in kbit/s.
        bus_kbit_s: u16,
    },
    /// A register was written through the channel.
    ChannelWrite {
        /// Index of the PLC in the plant.
        plc: u16,
        /// Absolute `%MB3` offset.
        offset: u32,
        /// Width in bytes: 1, 2 or 4.
        width: u8,
        /// The value written.
        value: u32,
    },
}

impl Event {
    /// The event as three words, for the running hash: equal events give equal words, different
    /// events different ones.
    #[inline]
    pub(super) fn words(&self) -> [u64; 3] {
        let node = |o: &Origin| u64::from(o.plc) << 16 | u64::from(o.node) << 8;
        match self {
            Event::SyncEdge { bus } => [1 | u64::from(*bus) << 8, 0, 0],
            Event::Frame { bus, frame } => {
                let head = 2 | u64::from(*bus) << 8 | u64::from(frame.id()) << 24;
                [head, u64::from_le_bytes(frame.padded()), frame.data().len() as u64]
            }
            Event::State { origin, from, to } => [3 | node(origin) << 8, u64::from(*from), u64::from(*to)],
            Event::Handshake { origin, offset, request, answer } => {
                [4 | node(origin) << 8, u64::from(*offset), u64::from(*request) << 16 | u64::from(*answer)]
            }
            Event::Missed { origin, what } => {
                let (kind, channel) = match what {
                    Missed::ReferenceValue(channel) => (0, *channel),
                    Missed::ActualValue(channel) => (1, *channel),
                };
                [5 | node(origin) << 8, kind, u64::from(channel)]
            }
            Event::CommandIgnored { origin, value, why } => {
                [6 | node(origin) << 8, u64::from(*value), u64::from(*why == Command::NotNow)]
            }
            Event::InitRefused { origin, reason } => [7 | node(origin) << 8, u64::from(*reason), 0],
            Event::SlaveStatus { origin, slave, status } => {
                [8 | node(origin) << 8, u64::from(*slave), u64::from(*status)]
            }
            Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s } => {
                [9 | node(origin) << 8, u64::from(*node_kbit_s), u64::from(*bus_kbit_s)]
            }
            Event::ChannelWrite { plc, offset, width, value } => {
                [10 | u64::from(*plc) << 8, u64::from(*offset) << 8 | u64::from(*width), u64::from(*value)]
            }
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PLC {} node{}", self.plc, self.node)
    }
}
