//! What the journal can tell.
//!
//! A new event needs, in this order; the compiler or a test asks for each of them:
//!
//! 1. a variant of [`Event`], and its arms in [`Event::kind`] and [`Event::source`], all here;
//! 2. a line in `kind.rs`: number, name, ring;
//! 3. an arm in each of the two functions of `code.rs`, there and back again: hash, counting and channel use it;
//! 4. what it says: `text.rs` and `jsonl.rs`, and the same in `docs/journal.md`;
//! 5. a line in `samples.rs`, from which the tests draw events;
//! 6. if it may come in every interval: `Journal::push`, so that repetitions are counted.

use super::board::BoardEvent;
use super::kind::Kind;
use crate::check::Finding;
use crate::devices::cansync::bus::Frame;
use crate::fault::{self, Target};
use core::fmt;

/// [`Origin::node`] of the BAPS, which is no node.
pub const BAPS_NODE: u8 = 0;

/// Where a record comes from: a CANsync node of a PLC, or its BAPS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Index of the PLC in the plant.
    pub plc: u16,
    /// CANsync node, 1 (slave) or 2 (master); [`BAPS_NODE`] is the BAPS.
    pub node: u8,
}

/// A command in `w_CPU_CONTROL` that had no effect, and why it is worth a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// The command does not exist or is reserved.
    Unknown,
    /// The command exists but not in the node's present state.
    NotNow,
    /// 16#0000 that the firmware's clearing of bit 7 left; a restart stored over it in the RAM looks the same
    /// (decision D-29).
    LeftBehind,
}

/// A deadline of the process data that was missed, so that a frame is left out in this interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missed {
    /// Reference value frame 1 or 2 was not released by 16#05 in time.
    ReferenceValue(u8),
    /// Own actual value frame 1 or 2 was asked for but had not been released by 16#05 in time.
    ActualValue(u8),
}

/// What there is to tell about an injected fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultNews {
    /// It was added; it begins at its time.
    Added,
    /// It has hit. The number is the identifier of the frame concerned, the shift of a SYNC edge in
    /// microseconds, or else 0.
    Hit(i32),
    /// Its count or duration is over.
    Over,
    /// It was cleared.
    Cleared,
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
    /// The firmware changed a register that is no handshake.
    Register {
        /// The node.
        origin: Origin,
        /// Absolute `%MB3` offset of the register.
        offset: u32,
        /// Value before.
        from: u32,
        /// Value now.
        to: u32,
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
    /// [`InitFault`](crate::devices::cansync::firmware::InitFault).
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
    /// Something happened on the board of a PLC.
    Board {
        /// Index of the PLC in the plant.
        plc: u16,
        /// What.
        what: BoardEvent,
    },
    /// A register is forced from now on.
    Force {
        /// Index of the PLC in the plant.
        plc: u16,
        /// Absolute `%MB3` offset.
        offset: u32,
        /// Width in bytes: 1, 2 or 4.
        width: u8,
        /// The value it keeps.
        value: u32,
    },
    /// A register is no longer forced.
    Unforce {
        /// Index of the PLC in the plant.
        plc: u16,
        /// Absolute `%MB3` offset.
        offset: u32,
    },
    /// News of an injected fault.
    Fault {
        /// Its number in the plant.
        id: u16,
        /// What it is.
        kind: fault::Kind,
        /// Where it acts.
        target: Target,
        /// What happened.
        news: FaultNews,
    },
    /// The access checker has found something.
    Finding(Finding),
}

/// What an event happened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A bus, by its index in the plant.
    Bus(u16),
    /// A PLC, by its index in the plant.
    Plc(u16),
    /// A CANsync node of a PLC.
    Node(Origin),
}

impl Event {
    /// What kind of event it is.
    #[inline]
    pub fn kind(&self) -> Kind {
        match self {
            Event::SyncEdge { .. } => Kind::Sync,
            Event::Frame { .. } => Kind::Frame,
            Event::State { .. } => Kind::State,
            Event::Handshake { .. } => Kind::Handshake,
            Event::Register { .. } => Kind::Register,
            Event::Missed { .. } => Kind::Missed,
            Event::CommandIgnored { .. } => Kind::Ignored,
            Event::InitRefused { .. } => Kind::InitRefused,
            Event::SlaveStatus { .. } => Kind::SlaveStatus,
            Event::BaudRateMismatch { .. } => Kind::BaudRateMismatch,
            Event::ChannelWrite { .. } => Kind::ChannelWrite,
            Event::Board { .. } => Kind::Board,
            Event::Force { .. } => Kind::Force,
            Event::Unforce { .. } => Kind::Unforce,
            Event::Fault { .. } => Kind::Fault,
            Event::Finding(_) => Kind::Finding,
        }
    }

    /// What it happened to.
    pub fn source(&self) -> Source {
        match *self {
            Event::SyncEdge { bus } | Event::Frame { bus, .. } => Source::Bus(bus),
            Event::ChannelWrite { plc, .. }
            | Event::Force { plc, .. }
            | Event::Unforce { plc, .. }
            | Event::Board { plc, .. }
            | Event::Finding(Finding { plc, .. }) => Source::Plc(plc),
            Event::Fault { target: Target::Bus(bus) | Target::Slave { bus, .. }, .. } => Source::Bus(bus),
            Event::Fault { target: Target::Node { plc, node }, .. } => Source::Node(Origin { plc, node }),
            Event::State { origin, .. }
            | Event::Handshake { origin, .. }
            | Event::Register { origin, .. }
            | Event::Missed { origin, .. }
            | Event::CommandIgnored { origin, .. }
            | Event::InitRefused { origin, .. }
            | Event::SlaveStatus { origin, .. }
            | Event::BaudRateMismatch { origin, .. } => Source::Node(origin),
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PLC {} node{}", self.plc, self.node)
    }
}
