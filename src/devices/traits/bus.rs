//! Interface between a plant and a bus with the ports of devices and other participants.

use crate::devices::{
    BuildError, BusGuests, BusView, Context, Drives, Faulty, PortWatch, SyncLine, SyncSignal,
};
use crate::fault::Faults;
use crate::journal::{Journal, Origin};
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;

/// The objects outside its own device or bus that an event can access.
pub struct World<'a> {
    /// Emulated time in microseconds.
    pub now: u64,
    /// The journal.
    pub journal: &'a mut Journal,
    /// The faults that wait or act.
    pub faults: &'a mut Faults,
    /// Ports of devices that are to be notified of a SYNC edge, in this order, after the event.
    pub edges: &'a mut Vec<Origin>,
}

/// A port of a device, as the device hands it over to be attached to a bus.
pub struct Plug {
    /// Number of the port in the device's layout.
    pub number: u8,
    /// Family of buses that the plug fits, one of [`BUS_KINDS`](crate::devices::BUS_KINDS).
    pub family: &'static str,
    /// Name of the bus in the plant; `None` if the port is not plugged in.
    pub bus: Option<String>,
    /// Data that the family of buses needs to run the port's firmware.
    pub socket: Box<dyn Any + Send>,
}

/// A bus of a plant. A bus runs the firmware of the ports that are attached to it, so an event reaches all affected
/// ports without calls to their devices. Features that only some buses have are optional methods: a watch over the
/// ports, guests, a SYNC signal, drives, faults.
pub trait Bus: BusView + Any + Send + SnapshotFields {
    /// Attaches a port: the [`Plug::socket`] of a device. Returns the port's place, which identifies it from now on.
    ///
    /// # Errors
    /// If the port belongs to another family, or its registers are not accessible.
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError>;

    /// Length of the processor cycle of all devices of the plant in microseconds. Called once, before any other
    /// function except [`Bus::attach`].
    fn set_processor_cycle(&mut self, us: u32) {
        let _ = us;
    }

    /// The device at `place` starts with this number at its switches. Returns `false` if another station has the number
    /// and the port is therefore not connected.
    fn power_on(&mut self, place: usize, address: u8, now: u64, journal: &mut Journal) -> bool;

    /// The device of the port stops: the port leaves the bus and loses its state.
    fn power_off(&mut self, place: usize, now: u64, journal: &mut Journal);

    /// The port's firmware polls its control registers. Returns whether the port now takes part in the traffic.
    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool;

    /// Whether the firmware of the port is quiescent, as a device can be
    /// ([`Device::is_quiescent`](crate::devices::Device::is_quiescent)): its processor cycles change nothing before another event
    /// occurs, for example [`Bus::event`].
    fn is_quiescent(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// True if polling this port at `now` would change nothing except the live traffic bits. `is_seen`: no register was
    /// written since the last poll, so only events on the bus matter; otherwise a client may have written the
    /// registers. Events on the bus itself may give a later poll something to do, but must not change whether the
    /// port takes part in the traffic. When in doubt, returns false.
    fn poll_changes_nothing(&self, place: usize, now: u64, is_seen: bool) -> bool {
        let _ = (place, now, is_seen);
        false
    }

    /// Whether a program has written a control register of any port that the firmware has not polled yet.
    fn control_changed(&self) -> bool {
        false
    }

    /// Time of the next event; `u64::MAX` if there is none. This time changes only in calls to the bus.
    fn next_time(&self) -> u64;

    /// Time up to which the bus's events are independent of all other participants, so they may run on another core.
    /// 0: never.
    fn apart_until(&self) -> u64 {
        0
    }

    /// Handles one event at `world.now`. Returns the SYNC signal if the event was an edge that went out on the line.
    fn event(&mut self, world: &mut World) -> Option<SyncSignal>;

    /// Time of the last frame that a port sent or received since it joined, in emulated microseconds; `None` if there
    /// was none, or the bus does not record it.
    fn last_frame(&self, place: usize) -> Option<u64> {
        let _ = place;
        None
    }

    /// The access checker over its ports, if it has any with registers.
    fn watch(&mut self) -> Option<&mut dyn PortWatch> {
        None
    }

    /// Guests of the bus, if foreign programs can take part.
    fn guests(&mut self) -> Option<&mut dyn BusGuests> {
        None
    }

    /// SYNC signal of the bus, if buses of its kind have one.
    fn sync(&self) -> Option<&dyn SyncLine> {
        None
    }

    /// Same as [`Bus::sync`], for an edge that another bus forwards.
    fn sync_mut(&mut self) -> Option<&mut dyn SyncLine> {
        None
    }

    /// The drives on it, if buses of its kind have drives.
    fn drives(&self) -> Option<&dyn Drives> {
        None
    }

    /// Same as [`Bus::drives`], for actions at a drive.
    fn drives_mut(&mut self) -> Option<&mut dyn Drives> {
        None
    }

    /// The part that applies faults of the bus, its participants and its ports, if it can have any.
    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        None
    }
}

impl dyn Bus {
    /// Returns the bus as a `T`, if it has that type.
    pub fn as_a<T: Bus>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

impl World<'_> {
    /// Returns the context for firmware of `origin` with an area that begins at `base`.
    pub fn context(&mut self, origin: Origin, base: usize) -> Context<'_> {
        Context { now: self.now, journal: self.journal, origin, base }
    }
}
