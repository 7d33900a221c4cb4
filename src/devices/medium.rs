//! What a plant knows of a medium: a bus with the ports of devices at it, and whoever else takes part.

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

/// What an event may touch besides the device or medium that it is due at.
pub struct World<'a> {
    /// Emulated time in microseconds.
    pub now: u64,
    /// The journal.
    pub journal: &'a mut Journal,
    /// The faults that wait or act.
    pub faults: &'a mut Faults,
    /// Ports whose devices are to be told of a SYNC edge, in this order, after the event.
    pub edges: &'a mut Vec<Origin>,
}

/// A SYNC signal, as far as those must know it who take it over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SyncSignal {
    /// Time from one edge to the next in us.
    pub interval_us: u32,
    /// Rate of the medium whose master makes it, in kbit/s.
    pub kbit_s: u16,
}

/// Where the SYNC signal of a medium comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncOrigin {
    /// The medium has no such signal.
    Unknown,
    /// There is no master that could make one.
    NoMaster,
    /// The master has not started.
    Idle {
        /// Its port.
        port: Origin,
        /// What its status register shows.
        state: u16,
    },
    /// The master makes the signal itself.
    Own(Origin),
    /// The master passes on the signal of another port of its device.
    Forwarded(Origin),
}

/// A port of a device, as the device hands it over to be attached to a medium.
pub struct Plug {
    /// Its number in the device's layout.
    pub number: u8,
    /// The family of media that it fits, one of [`MEDIA`](super::MEDIA).
    pub family: &'static str,
    /// Name of the medium in the plant; none is plugged in if it is left out.
    pub medium: Option<String>,
    /// What the family of media needs to run the port's firmware.
    pub socket: Box<dyn Any + Send>,
}

/// A station of a medium whose stations are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationState {
    /// The port, or the guest.
    pub origin: Origin,
    /// Its address, where stations have one and it is known.
    pub address: Option<u8>,
    /// What it does, in one word; none: the state of its error counters says that.
    pub does: Option<&'static str>,
    /// Its error counters, 0 where stations count no errors.
    pub errors: ErrorCounters,
}

/// Somebody on a medium whose rate is another, so that it does not take part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stranger {
    /// Who it is.
    pub whose: Whose,
    /// The rate that it is set to, in bit/s.
    pub bit_s: u32,
}

/// Who on a medium is meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Whose {
    /// A port of a device.
    Port(Origin),
    /// A participant of the medium's own, by its name.
    Own(String),
}

/// A medium of a plant. It runs the firmware of the ports that are attached to it, so that an event meets everybody whom
/// it concerns without asking a device.
pub trait Medium: Any + Send + SnapshotFields {
    /// Its name in the plant.
    fn name(&self) -> &str;

    /// Its kind, one of [`MEDIA`](super::MEDIA).
    fn family(&self) -> &'static str;

    /// Attaches a port: the [`Plug::socket`] of a device. Returns the port's place, by which it is named from now on.
    ///
    /// # Errors
    /// If the port belongs to another family, or its registers cannot be had.
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError>;

    /// Length of the processor cycle of all devices of the plant in microseconds. Called once, before any other function but
    /// [`Medium::attach`].
    fn set_processor_cycle(&mut self, us: u32) {
        let _ = us;
    }

    /// Its device starts, with this number at its switches; `false` if somebody else has it and the port is therefore not
    /// connected.
    fn power_on(&mut self, place: usize, address: u8, now: u64, journal: &mut Journal) -> bool;

    /// Its device stops: the port leaves the medium and forgets everything.
    fn power_off(&mut self, place: usize, now: u64, journal: &mut Journal);

    /// The port's firmware looks at its control registers. Tells whether it takes part in the traffic now.
    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool;

    /// Whether the firmware of the port rests, as a device does ([`Device::is_quiescent`]): its processor cycles find nothing to do
    /// before something else happens, be it [`Medium::event`].
    fn is_quiescent(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// Whether a look of the port's firmware at `now` finds nothing to do, and shows nothing but what another look shortly
    /// after it shows anew: the traffic of the moment. `is_seen`: nobody has written since registers were looked at, so
    /// that only what has happened on the medium can matter; else the registers are those of anybody. Where looks were in vain,
    /// what happens on the medium by itself may give one something to do, but not whether the port takes part in the traffic.
    /// Whoever is not sure does not look in vain.
    fn poll_changes_nothing(&self, place: usize, now: u64, is_seen: bool) -> bool {
        let _ = (place, now, is_seen);
        false
    }

    /// Whether any port's program has written a control register that the firmware has not looked at yet.
    fn control_changed(&self) -> bool {
        false
    }

    /// Before firmware runs: judges what others have written to the registers of a port since [`Medium::leave`]. The medium
    /// has the watch over them, since its family has the rules and the firmware.
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal) {
        let _ = (place, now, journal);
    }

    /// After firmware has run: notes what it leaves in the registers of a port.
    fn leave(&mut self, place: usize) {
        let _ = place;
    }

    /// Judges a write of `bytes` bytes at byte `offset` of the image, which came through the channel, if it hit registers of
    /// a port.
    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        let _ = (place, offset, bytes, now, journal);
    }

    /// Judges what is taken over at a SYNC edge. Called when all who are told of an edge that [`Medium::event`] returned have
    /// been told.
    fn judge_edge(&mut self, now: u64, journal: &mut Journal) {
        let _ = (now, journal);
    }

    /// The rate that it runs at now, in bit/s.
    fn bit_s(&self) -> u32;

    /// Who is set to another rate than that and takes no part for that reason.
    fn strangers(&self) -> Vec<Stranger> {
        Vec::new()
    }

    /// Returns the stations that have power; none where they are not known.
    fn stations(&self) -> Vec<StationState> {
        Vec::new()
    }

    /// The ports that are attached, in the order in which they were.
    fn ports(&self) -> Vec<Origin>;

    /// The interval that comes again and again, while it does.
    fn interval(&self) -> Option<Interval> {
        None
    }

    /// Does what has been put off because nobody could tell. Whoever only looks finds it done in any case; it saves him the way.
    fn settle(&mut self) {}

    /// The drives on it, in the order of the plant file: names and how they stand.
    fn drives(&self) -> Vec<(&str, DriveState)> {
        Vec::new()
    }

    /// All that is to be seen of the drive at this place in [`Medium::drives`].
    fn drive(&self, drive: usize) -> Option<DriveDetails> {
        let _ = drive;
        None
    }

    /// Sets a parameter of such a drive, as somebody does who stands in front of it.
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

    /// What the motor of such a drive is to do, and does.
    fn shaft(&self, drive: usize) -> Option<Shaft> {
        let _ = drive;
        None
    }

    /// The motor of such a drive turns with this speed, whatever the drive demands of it; `None`: it does what the drive
    /// demands.
    fn turn_shaft(&mut self, drive: usize, speed: Option<i32>, now: u64) {
        let _ = (drive, speed, now);
    }

    /// How long something that the journal tells of this medium has kept the wire busy, in nanoseconds: a frame.
    fn busy_ns(&self, event: &Event) -> u64 {
        let rate = BitRate::new(self.bit_s());
        let taken = event.frame().zip(rate).map(|(carried, rate)| can::wire::airtime(&carried.frame, rate));
        taken.map_or(0, |airtime| airtime.occupation_ns)
    }

    /// A guest takes part from now on. Guests have numbers, one each; number 0 is whoever asks by requests. Tells whether that
    /// makes a difference here.
    fn guest_joins(&mut self, guest: u8, now: u64) -> bool {
        let _ = (guest, now);
        false
    }

    /// It does so no longer. What it has given to its controller is still sent.
    fn guest_leaves(&mut self, guest: u8, now: u64) {
        let _ = (guest, now);
    }

    /// It has gone for ever, and has more to send than there was room for. What would keep that waiting for ever it sends no longer:
    /// what it wanted to send later than now, and all if nobody is there to hear it.
    fn guest_has_gone(&mut self, guest: u8, now: u64) {
        let _ = (guest, now);
    }

    /// The error state of a guest's controller, where there is such a thing.
    fn guest_errors(&self, guest: u8) -> ErrorState {
        let _ = guest;
        ErrorState::Active
    }

    /// What a guest that takes part is to hear and the journal does not keep whole goes to this ear.
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

    /// When the next event is due; `u64::MAX` if none is. It changes only in calls to the medium.
    fn next_time(&self) -> u64;

    /// Until when its events touch nothing that anybody else touches before, and ask for nobody: they then may happen on another
    /// core than those of others. 0: they never do.
    fn apart_until(&self) -> u64 {
        0
    }

    /// Handles one event that is due at `world.now`. Returns the SYNC signal if that was an edge that went out on the line.
    fn event(&mut self, world: &mut World) -> Option<SyncSignal>;

    /// Whether the port takes its SYNC signal from another port of its device.
    fn takes_sync(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// An edge of such a signal.
    fn forwarded_edge(&mut self, place: usize, now: u64, signal: SyncSignal, journal: &mut Journal) {
        let _ = (place, now, signal, journal);
    }

    /// The next SYNC edge, if the signal is made here.
    fn next_sync(&self) -> Option<u64> {
        None
    }

    /// Where its SYNC signal comes from.
    fn sync_origin(&self) -> SyncOrigin {
        SyncOrigin::Unknown
    }

    /// When a port last sent or received a frame since it takes part, in emulated microseconds; `None` if it has not, or the
    /// medium does not tell.
    fn last_frame(&self, place: usize) -> Option<u64> {
        let _ = place;
        None
    }

    /// Participants that faults can concern, bit n for number n.
    fn participants(&self) -> u32 {
        0
    }

    /// Which of the faults that the medium lets act do so has changed.
    fn faults_changed(&mut self, now: u64, faults: &Faults) {
        let _ = (now, faults);
    }

    /// A fault acts on the medium, a participant or a port: does it hit by itself, at its begin or in a processor cycle? What
    /// hits at an event the medium finds out then ([`World::faults`]).
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let _ = (now, target, effect);
        None
    }
}

impl dyn Device {
    /// The device as what it is, if that is a `T`.
    pub fn as_a<T: Device>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

impl dyn Medium {
    /// The medium as what it is, if that is a `T`.
    pub fn as_a<T: Medium>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

impl World<'_> {
    /// What firmware of `origin`, whose area begins at `base`, is given.
    pub fn context(&mut self, origin: Origin, base: usize) -> Context<'_> {
        Context { now: self.now, journal: self.journal, origin, base }
    }
}
