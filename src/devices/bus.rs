//! Interface between a plant and a medium: a bus with the ports of devices and other participants.

use super::{
    BuildError, Context, Device, DriveDetails, DriveState, GuestRefusal, Interval, ParameterRefusal, Shaft,
};
use crate::can::{self, BitRate, ErrorCounters, ErrorState};
use crate::door::{BusMessage, Guest};
use crate::fault::{Effect, Faults, Hit, Target};
use crate::journal::{Event, Journal, Origin};
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Access of an event to other objects than its own device or medium.
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

/// A SYNC signal, as far as the masters that take it over need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SyncSignal {
    /// Time between two edges in us.
    pub interval_us: u32,
    /// Rate of the medium of the master that generates it, in kbit/s.
    pub kbit_s: u16,
}

/// Source of the SYNC signal of a medium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncOrigin {
    /// The medium has no such signal.
    Unknown,
    /// There is no master that could generate the signal.
    NoMaster,
    /// The master has not started.
    Idle {
        /// Its port.
        port: Origin,
        /// Value of its status register.
        state: u16,
    },
    /// The master of the medium generates the signal.
    Own(Origin),
    /// The master passes on the signal of another port of its device.
    Forwarded(Origin),
}

/// A port of a device, as the device hands it over to be attached to a medium.
pub struct Plug {
    /// Its number in the device's layout.
    pub number: u8,
    /// Family of media that the plug fits, one of [`BUS_KINDS`](super::BUS_KINDS).
    pub family: &'static str,
    /// Name of the medium in the plant; `None` if the port is not plugged in.
    pub medium: Option<String>,
    /// Data that the family of media needs to run the port's firmware.
    pub socket: Box<dyn Any + Send>,
}

/// A station of a medium with known stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationState {
    /// The port, or the guest.
    pub origin: Origin,
    /// Address of the station, if it has one and it is known.
    pub address: Option<u8>,
    /// Activity of the station in one word; `None`: the state of its error counters describes it.
    pub does: Option<&'static str>,
    /// Its error counters, 0 where stations count no errors.
    pub errors: ErrorCounters,
}

/// A station with another rate than its medium, which therefore does not take part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stranger {
    /// Identity of the station.
    pub participant: ParticipantId,
    /// Rate of the station, in bit/s.
    pub bit_s: u32,
}

/// Participant of a medium.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ParticipantId {
    /// A port of a device.
    Port(Origin),
    /// A participant of the medium's own, by its name.
    Own(String),
}

/// A medium of a plant. It runs the firmware of the ports that are attached to it, so an event reaches all affected
/// ports without a call of their devices.
pub trait Bus: Any + Send + SnapshotFields {
    /// Its name in the plant.
    fn name(&self) -> &str;

    /// Kind of the medium, one of [`BUS_KINDS`](super::BUS_KINDS).
    fn family(&self) -> &'static str;

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

    /// The device of the port stops: the port leaves the medium and loses its state.
    fn power_off(&mut self, place: usize, now: u64, journal: &mut Journal);

    /// The port's firmware polls its control registers. Returns whether the port now takes part in the traffic.
    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool;

    /// Whether the firmware of the port is quiescent, as a device can be ([`Device::is_quiescent`]): its processor
    /// cycles change nothing before another event occurs, for example [`Bus::event`].
    fn is_quiescent(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// True if polling this port at `now` would change nothing except the live traffic bits. `is_seen`: no register was
    /// written since the last poll, so only events on the medium matter; otherwise a client may have written the
    /// registers. Events on the medium itself may give a later poll something to do, but must not change whether the
    /// port takes part in the traffic. When in doubt, returns false.
    fn poll_changes_nothing(&self, place: usize, now: u64, is_seen: bool) -> bool {
        let _ = (place, now, is_seen);
        false
    }

    /// Whether a program has written a control register of any port that the firmware has not polled yet.
    fn control_changed(&self) -> bool {
        false
    }

    /// Before firmware runs: checks the writes of clients to the registers of a port since [`Bus::leave`]. The
    /// medium owns the watch over them, since its family has the rules and the firmware.
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal) {
        let _ = (place, now, journal);
    }

    /// After firmware has run: stores the registers of a port as the baseline.
    fn leave(&mut self, place: usize) {
        let _ = place;
    }

    /// Checks a write of `bytes` bytes at byte `offset` of the image, which came through the channel, if it hit
    /// registers of a port.
    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        let _ = (place, offset, bytes, now, journal);
    }

    /// Checks the values that are taken over at a SYNC edge. Called after all devices were notified of an edge that
    /// [`Bus::event`] returned.
    fn judge_edge(&mut self, now: u64, journal: &mut Journal) {
        let _ = (now, journal);
    }

    /// The rate that it runs at now, in bit/s.
    fn bit_s(&self) -> u32;

    /// Stations that are set to another rate and therefore do not take part.
    fn strangers(&self) -> Vec<Stranger> {
        Vec::new()
    }

    /// Returns the stations that have power; none where they are not known.
    fn stations(&self) -> Vec<StationState> {
        Vec::new()
    }

    /// The attached ports, in the order of attachment.
    fn ports(&self) -> Vec<Origin>;

    /// The interval that repeats on the medium, as long as it does.
    fn interval(&self) -> Option<Interval> {
        None
    }

    /// Does work that was postponed because its result was not visible. Readers see the same result without this call;
    /// it only saves time.
    fn settle(&mut self) {}

    /// The drives on the medium, in the order of the plant file: names and states.
    fn drives(&self) -> Vec<(&str, DriveState)> {
        Vec::new()
    }

    /// All details of the drive at this place in [`Bus::drives`].
    fn drive(&self, drive: usize) -> Option<DriveDetails> {
        let _ = drive;
        None
    }

    /// Sets a parameter of such a drive, as a user does at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    fn set_parameter(
        &mut self,
        drive: usize,
        number: u16,
        value: i64,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), ParameterRefusal> {
        let _ = (drive, number, value, now, journal);
        Err(ParameterRefusal::NotThere)
    }

    /// Demanded and actual motion of the motor of such a drive.
    fn shaft(&self, drive: usize) -> Option<Shaft> {
        let _ = drive;
        None
    }

    /// Sets the speed of the motor of such a drive independently of the drive's demand; `None`: the motor follows the
    /// drive.
    fn turn_shaft(&mut self, drive: usize, speed: Option<i32>, now: u64) {
        let _ = (drive, speed, now);
    }

    /// Time for which a journal event of this medium, a frame, has kept the wire busy, in nanoseconds.
    fn busy_ns(&self, event: &Event) -> u64 {
        let rate = BitRate::new(self.bit_s());
        let taken = event.frame().zip(rate).map(|(carried, rate)| can::wire::airtime(&carried.frame, rate));
        taken.map_or(0, |airtime| airtime.occupation_ns)
    }

    /// A guest takes part from now on. Each guest has a number; number 0 is the guest that acts by requests. Returns
    /// whether this changes anything here.
    fn guest_joins(&mut self, guest: u8, now: u64) -> bool {
        let _ = (guest, now);
        false
    }

    /// The guest stops taking part. Frames that it has passed to its controller are still sent.
    fn guest_leaves(&mut self, guest: u8, now: u64) {
        let _ = (guest, now);
    }

    /// The guest has disconnected, with more frames to send than there was room for. Frames that would wait without a
    /// limit are dropped: the frames for a later time than now, and all frames if no station receives them.
    fn guest_has_gone(&mut self, guest: u8, now: u64) {
        let _ = (guest, now);
    }

    /// The error state of a guest's controller, on media with error states.
    fn guest_errors(&self, guest: u8) -> ErrorState {
        let _ = guest;
        ErrorState::Active
    }

    /// Frames for a guest that takes part go to `ear` if the journal does not keep them whole.
    fn guest_hears(&mut self, guest: u8, ear: Arc<Guest>) {
        let _ = (guest, ear);
    }

    /// A guest that takes part sends a frame, or a telegram.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    fn guest_sends(
        &mut self,
        guest: u8,
        said: &BusMessage,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), GuestRefusal>;

    /// Time of the next event; `u64::MAX` if there is none. It changes only in calls to the medium.
    fn next_time(&self) -> u64;

    /// Time up to which the medium's events are independent of all other participants, so they may run on another core.
    /// 0: never.
    fn apart_until(&self) -> u64 {
        0
    }

    /// Handles one event at `world.now`. Returns the SYNC signal if the event was an edge that went out on the line.
    fn event(&mut self, world: &mut World) -> Option<SyncSignal>;

    /// Whether the port takes its SYNC signal from another port of its device.
    fn takes_sync(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// An edge of a forwarded SYNC signal.
    fn forwarded_edge(&mut self, place: usize, now: u64, signal: SyncSignal, journal: &mut Journal) {
        let _ = (place, now, signal, journal);
    }

    /// Time of the next SYNC edge, if this medium generates the signal.
    fn next_sync(&self) -> Option<u64> {
        None
    }

    /// Source of its SYNC signal.
    fn sync_origin(&self) -> SyncOrigin {
        SyncOrigin::Unknown
    }

    /// Time of the last frame that a port sent or received since it joined, in emulated microseconds; `None` if there
    /// was none, or the medium does not record it.
    fn last_frame(&self, place: usize) -> Option<u64> {
        let _ = place;
        None
    }

    /// Participants that faults can concern, bit n for number n.
    fn participants(&self) -> u32 {
        0
    }

    /// Called when the set of active faults of the medium has changed.
    fn faults_changed(&mut self, now: u64, faults: &Faults) {
        let _ = (now, faults);
    }

    /// Called when a fault of the medium, a participant or a port is active, at its begin or in a processor cycle:
    /// returns a hit if the fault fires by itself. Faults that fire at an event are found during the event
    /// ([`World::faults`]).
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let _ = (now, target, effect);
        None
    }
}

impl dyn Device {
    /// Returns the device as a `T`, if it has that type.
    pub fn as_a<T: Device>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

impl dyn Bus {
    /// Returns the medium as a `T`, if it has that type.
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
