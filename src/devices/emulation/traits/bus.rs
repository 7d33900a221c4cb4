//! Interface between a plant and a bus. A bus has ports of devices and other participants.

use crate::devices::{
    BuildError, BusGuests, BusView, Context, Drives, Faulty, PortWatch, SyncLine, SyncSignal,
};
use crate::fault::Faults;
use crate::identity::PortNumber;
use crate::journal::{Journal, Origin};
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;

/// The objects that the handler of an event can access, in addition to its own device or bus.
pub struct World<'a> {
    /// Emulated time in microseconds.
    pub now: u64,
    /// Journal of the plant, which records the traffic.
    pub journal: &'a mut Journal,
    /// The faults that wait or act.
    pub faults: &'a mut Faults,
    /// Ports at which this event is a SYNC edge. After the event, the plant notifies their devices in this
    /// order.
    pub edges: &'a mut Vec<Origin>,
}

/// A port of a device before it is attached to a bus. The device creates the plug.
pub struct Plug {
    /// Number of the port in the device's layout.
    pub number: PortNumber,
    /// Family of buses to which the port can be attached, one of [`BUS_KINDS`](crate::devices::BUS_KINDS).
    pub family: &'static str,
    /// Name of the bus in the plant; `None` if the port is not connected.
    pub bus: Option<String>,
    /// Data that the family of buses needs to run the port's firmware.
    pub socket: Box<dyn Any + Send>,
}

/// A bus of a plant. It runs the firmware of the ports that are attached to it. So an event reaches all
/// affected ports without calls to their devices. Functions for features that only some buses have return
/// `None` by default: a watch over the ports, guests, a SYNC signal, drives, faults.
pub trait Bus: BusView + Any + Send + SnapshotFields {
    /// Attaches a port by the [`Plug::socket`] of a device. Returns the port's place, which identifies the
    /// port from then on.
    ///
    /// # Errors
    /// The port belongs to another family, or its registers are not accessible.
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError>;

    /// Sets the length of the processor cycle of all devices, in microseconds. Called once, before any other function
    /// except [`Bus::attach`].
    fn set_processor_cycle(&mut self, us: u32) {
        let _ = us;
    }

    /// Called when the device at `place` starts. `address` is the number at its switches. Returns `false` if another
    /// station has this number; the port is then not connected.
    fn power_on(&mut self, place: usize, address: u8, now: u64, journal: &mut Journal) -> bool;

    /// Called when the device of the port stops: the port leaves the bus and loses its state.
    fn power_off(&mut self, place: usize, now: u64, journal: &mut Journal);

    /// Makes the port's firmware poll its control registers. Returns true if the port takes part in the
    /// traffic after this poll.
    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool;

    /// True if the firmware of the port is quiescent, as defined by
    /// [`Device::is_quiescent`](crate::devices::Device::is_quiescent): its processor cycles change nothing
    /// until another event occurs, for example [`Bus::event`].
    fn is_quiescent(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// True if polling this port at `now` would change nothing except the live traffic bits. If `is_seen`, no
    /// register was written since the last poll, so only events on the bus matter. Otherwise a client may
    /// have written registers. A later event on the bus may give a poll something to do, but must not change
    /// whether the port takes part in the traffic. When in doubt, returns false.
    fn poll_changes_nothing(&self, place: usize, now: u64, is_seen: bool) -> bool {
        let _ = (place, now, is_seen);
        false
    }

    /// True if a program has written a control register of a port, and the firmware has not polled this
    /// register yet.
    fn control_changed(&self) -> bool {
        false
    }

    /// Returns the time of the next event; `u64::MAX` if there is none. Only calls of the bus change this time.
    fn next_time(&self) -> u64;

    /// Returns the time until which the events of the bus are independent of all other buses and devices.
    /// Until then they may run on another core. 0 if the events are never independent.
    fn apart_until(&self) -> u64 {
        0
    }

    /// Handles one event at `world.now`. If the event was a SYNC edge that was sent on the line, returns the
    /// SYNC signal.
    fn event(&mut self, world: &mut World) -> Option<SyncSignal>;

    /// Handles the event at `world.now` like [`Bus::event`], and the following events before `until`, up to a SYNC edge.
    /// `world.now` is then the time of the last event.
    fn events(&mut self, world: &mut World, until: u64) -> Option<SyncSignal> {
        loop {
            let signal = self.event(world);
            let next = self.next_time();
            if signal.is_some() || !world.edges.is_empty() || next >= until {
                return signal;
            }
            world.now = next;
        }
    }

    /// Returns the time of the last frame that a port has sent or received since it joined the bus, in
    /// emulated microseconds. `None` if there was no frame, or if the bus does not record this time.
    fn last_frame(&self, place: usize) -> Option<u64> {
        let _ = place;
        None
    }

    /// Returns the access checker for the registers of the bus's ports; `None` if no port has registers.
    fn watch(&mut self) -> Option<&mut dyn PortWatch> {
        None
    }

    /// Returns the guests of the bus; `None` if foreign programs cannot take part in it.
    fn guests(&mut self) -> Option<&mut dyn BusGuests> {
        None
    }

    /// Returns the SYNC signal of the bus; `None` if buses of this kind have no SYNC signal.
    fn sync(&self) -> Option<&dyn SyncLine> {
        None
    }

    /// Returns the same as [`Bus::sync`], mutable. It is used to handle an edge that another bus forwards.
    fn sync_mut(&mut self) -> Option<&mut dyn SyncLine> {
        None
    }

    /// Returns the drives on the bus; `None` if buses of this kind have no drives.
    fn drives(&self) -> Option<&dyn Drives> {
        None
    }

    /// Returns the same as [`Bus::drives`], mutable. It is used to change a drive.
    fn drives_mut(&mut self) -> Option<&mut dyn Drives> {
        None
    }

    /// Returns the part that applies the faults of the bus, its participants and its ports. `None` if the bus
    /// can have no faults.
    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        None
    }
}

impl dyn Bus {
    /// Returns the bus as a `T`; `None` if it has another type.
    pub fn as_a<T: Bus>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

impl World<'_> {
    /// Returns the context for firmware of `origin`. The area of this firmware begins at `base`.
    pub fn context(&mut self, origin: Origin, base: u32) -> Context<'_> {
        Context { now: self.now, journal: self.journal, origin, base }
    }
}
