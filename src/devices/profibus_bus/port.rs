//! What a device has at a PROFIBUS segment: a station, and the firmware behind it.

use crate::devices::Context;
use crate::fault::{Effect, Hit};
use crate::journal::Origin;
use crate::layout::Device;
use crate::memory::Segment;
use crate::profibus::{BusRate, Telegram};
use crate::snapshot_fields;
use crate::snapshot_fields::SnapshotFields;
use serde::{Deserialize, Serialize};

/// What is to be seen of a station from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Presence {
    /// Its address, 0 to 126.
    pub address: u8,
    /// What it does, in one word with underscores: `data_exchange`.
    pub does: &'static str,
    /// Whether it answers requests to that address, so that no other station may have it.
    pub answers: bool,
}

/// The firmware of a device's port at PROFIBUS. What happens on the line it is told at once, with the bit time in its
/// [`Station`]; its own times are microseconds of emulated time.
pub trait ProfibusPort: Send + SnapshotFields {
    /// The device starts.
    fn power_on(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// The device stops; the station forgets everything.
    fn power_off(&mut self) {}

    /// Returns what others can see of its station; none while it has no address.
    fn presence(&self) -> Option<Presence> {
        None
    }

    /// Another station that answers at the same address is at the segment, too.
    fn shares_address(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// The processor cycle: looks at its registers.
    fn look(&mut self, ctx: &mut Context, station: &mut Station);

    /// Whether the program has written a register that the firmware answers and has not looked at yet.
    fn has_changed(&self) -> bool {
        false
    }

    /// A telegram of somebody else has ended.
    fn heard(&mut self, ctx: &mut Context, station: &mut Station, telegram: &Telegram);

    /// One of its own has ended.
    fn sent(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// The bit time has come that it has set ([`Station::set_alarm`]).
    fn alarm(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// When the next of its own times is due, in microseconds; `u64::MAX` if none is.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles what is due at `ctx.now`; afterwards [`next_time`](ProfibusPort::next_time) lies behind that.
    fn due(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// A fault of the device acts on the port, at its begin or in a processor cycle: does it hit?
    fn fire(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
        let _ = (now, effect);
        None
    }
}

/// A PROFIBUS port, as a device hands it over.
pub struct ProfibusSocket {
    /// The device and the port's number.
    pub origin: Origin,
    /// The device's image.
    pub segment: Segment,
    /// The device's registers.
    pub layout: &'static Device,
    /// The port's firmware.
    pub port: Box<dyn ProfibusPort>,
}

/// What a station is about to send.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Intent {
    /// At this bit time, whatever is on the line.
    At(u64, Vec<u8>),
    /// From this bit time on, as soon as the line has been idle for T_SYN.
    WhenIdle(u64, Vec<u8>),
}

impl Intent {
    pub(super) fn octets(self) -> Vec<u8> {
        match self {
            Intent::At(_, octets) | Intent::WhenIdle(_, octets) => octets,
        }
    }
}

/// A station: what it is about to send, and an alarm clock in bit times.
#[derive(Debug)]
pub struct Station {
    rate: BusRate,
    slot_bits: u64,
    /// The present bit time, when firmware runs.
    pub(super) now: u64,
    pub(super) intent: Option<Intent>,
    pub(super) alarm: Option<u64>,
}

snapshot_fields!(Station { values: now, intent, alarm; built: rate, slot_bits });

impl Station {
    pub(super) fn new(rate: BusRate, slot_bits: u64) -> Self {
        Station { rate, slot_bits, now: 0, intent: None, alarm: None }
    }

    /// The rate of its segment.
    pub fn rate(&self) -> BusRate {
        self.rate
    }

    /// How long an answer may take to begin on its segment, in bit times.
    pub fn slot_bits(&self) -> u64 {
        self.slot_bits
    }

    /// The present bit time.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// Sends `telegram` so many bit times from now: an answer.
    pub fn answer(&mut self, after_bits: u64, telegram: &Telegram) {
        // Who answers with more than a telegram carries says nothing.
        self.intent =
            telegram.octets().ok().map(|octets| Intent::At(self.now.saturating_add(after_bits), octets));
    }

    /// Sends `telegram` as soon as the line has been idle for T_SYN: a request.
    pub fn request(&mut self, telegram: &Telegram) {
        self.intent = telegram.octets().ok().map(|octets| Intent::WhenIdle(self.now, octets));
    }

    /// Sends nothing of what it was about to.
    pub fn withdraw(&mut self) {
        self.intent = None;
    }

    /// Rings at this bit time; `None`: not at all.
    pub fn set_alarm(&mut self, at: Option<u64>) {
        self.alarm = at;
    }

    pub(super) fn clear(&mut self) {
        (self.intent, self.alarm) = (None, None);
    }
}

/// A station without a segment, for those who bring a line of their own.
#[cfg(test)]
impl Station {
    pub(crate) fn alone(rate: BusRate) -> Self {
        Self::new(rate, rate.slot_bits())
    }

    /// It is so late.
    pub(crate) fn at(&mut self, bits: u64) {
        self.now = bits;
    }

    /// The answer that it is about to send.
    pub(crate) fn intended(&mut self) -> Option<(u64, Vec<u8>)> {
        match self.intent.take()? {
            Intent::At(at, octets) => Some((at, octets)),
            Intent::WhenIdle(..) => None,
        }
    }
}
