//! The end of a bus at a device. It consists of the firmware of a node and of the node's counters in the
//! header page.

use crate::devices::Context;
use crate::devices::cansync::drive::DriveConfig;
use crate::devices::cansync::emulation::watch::NodeWatch;
use crate::devices::cansync::firmware::{Master, NodeLocation, Slave};
use crate::devices::cansync::frames::SyncLock;
use crate::journal::{Journal, Origin};
use crate::layout::{Area, Role};
use crate::memory::{Header, MemoryError, Segment, View};
use crate::snapshot_fields;
use crate::snapshot_fields::SnapshotFields;

/// A CANsync port, as a device passes it to the bus.
pub struct Socket {
    /// The device and the port's number.
    pub origin: Origin,
    /// Memory segment of the device, with its image.
    pub segment: Segment,
    /// Location of the node's registers in the image.
    pub location: NodeLocation,
    /// Register area of the node.
    pub area: &'static Area,
    /// Role of the node on its bus.
    pub role: SocketRole,
}

/// Role of a node on its bus.
#[derive(Clone, Debug)]
pub enum SocketRole {
    /// The node is the master of the bus.
    Master {
        /// True if the device can pass the SYNC signal of another port to this master, for `b_MA_SL_MODE` 16#02
        /// (decision D-12).
        has_sync_in: bool,
    },
    /// The node is a slave of the bus.
    Slave {
        /// Slave number. It is valid until the device starts with another number at its switches.
        number: u8,
        /// Rules for locking to the SYNC signal.
        lock: SyncLock,
    },
    /// A slave without registers. It is the built-in drive of the device, which is on the bus with the
    /// device's slave number.
    Drive(Box<DriveConfig>),
}

/// A node with its firmware.
pub(super) struct End<F> {
    pub(super) firmware: F,
    pub(super) watch: NodeWatch,
    pub(super) origin: Origin,
    /// True if the node's device has power and is not held in RESET.
    pub(super) is_on: bool,
    /// Time at which the node last sent or received a frame, in emulated microseconds. `None` if the node has
    /// neither sent nor received a frame since it was connected.
    pub(super) last_frame: Option<u64>,
    header: View<Header>,
    segment: Segment,
    location: NodeLocation,
    role: SocketRole,
}

/// Reference to a port: its list in `SimBus`, and the index in that list.
#[derive(Clone, Copy, Debug)]
pub(super) enum PortRef {
    Master(usize),
    Slave(usize),
    Drive(usize),
}

/// The connection of a device with a drive to a bus.
#[derive(Clone, Debug)]
pub(super) struct DriveEnd {
    pub(super) origin: Origin,
    pub(super) number: u8,
    pub(super) kbit_s: u16,
    /// Time at which the drive last sent or received a frame, in microseconds.
    pub(super) last_frame: Option<u64>,
}

snapshot_fields!(DriveEnd { values: last_frame; built: origin, number, kbit_s });

snapshot_fields!(where [F: SnapshotFields] End<F> { values: is_on, last_frame; parts: firmware, watch; built: origin, header, segment, location, role });

impl<F> End<F> {
    fn new(socket: &Socket, firmware: F) -> Result<Self, MemoryError> {
        let role = match socket.role {
            SocketRole::Master { .. } => Role::Master,
            SocketRole::Slave { .. } | SocketRole::Drive(_) => Role::Slave,
        };
        Ok(End {
            firmware,
            watch: NodeWatch::new(socket.origin.plc, socket.area, role, &socket.segment)?,
            origin: socket.origin,
            is_on: false,
            last_frame: None,
            header: socket.segment.header()?,
            segment: socket.segment.clone(),
            location: socket.location,
            role: socket.role.clone(),
        })
    }

    /// Returns true if the device can pass the SYNC signal of another port to this master.
    pub(super) fn has_sync_in(&self) -> bool {
        matches!(self.role, SocketRole::Master { has_sync_in: true })
    }

    /// Runs `f` on the firmware.
    #[inline]
    pub(super) fn run<R>(
        &mut self,
        now: u64,
        journal: &mut Journal,
        f: impl FnOnce(&mut F, &mut Context) -> R,
    ) -> R {
        let mut ctx = Context { now, journal, origin: self.origin, base: self.location.base };
        f(&mut self.firmware, &mut ctx)
    }

    /// Counts a SYNC edge in the header page.
    #[inline]
    pub(super) fn count_sync(&self) {
        if let Some(counter) = self.header.sync_counter.get(self.location.place) {
            counter.increment();
        }
    }
}

impl End<Master> {
    pub(super) fn master(socket: &Socket) -> Result<Self, MemoryError> {
        End::new(socket, Master::new(&socket.segment, socket.location)?)
    }

    /// Resets the firmware: its RAM and all its state are lost.
    pub(super) fn forget(&mut self) {
        // A structure was at this address before, so the memory segment is large enough, and this cannot
        // fail.
        if let Ok(master) = Master::new(&self.segment, self.location) {
            self.firmware = master;
        }
    }
}

impl End<Slave> {
    pub(super) fn slave(socket: &Socket, number: u8, lock: SyncLock) -> Result<Self, MemoryError> {
        End::new(socket, Slave::new(&socket.segment, socket.location, number, lock)?)
    }

    /// Resets the firmware, as [`End::forget`] does for a master. From then on the slave has this number.
    pub(super) fn begin_as(&mut self, number: u8) {
        let SocketRole::Slave { lock, .. } = &self.role else { return };
        if let Ok(slave) = Slave::new(&self.segment, self.location, number, *lock) {
            self.firmware = slave;
        }
    }
}
