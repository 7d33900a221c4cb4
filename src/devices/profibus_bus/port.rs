//! The PROFIBUS port of a device: a station and its firmware.

use crate::devices::Context;
use crate::fault::{Effect, Hit};
use crate::journal::Origin;
use crate::layout::DeviceLayout;
use crate::memory::Segment;
#[cfg(test)]
use crate::profibus::BusRate;
use crate::profibus::Telegram;
use crate::snapshot_fields;
use crate::snapshot_fields::SnapshotFields;
use serde::{Deserialize, Serialize};

/// Properties of a station that other stations and users can see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Presence {
    /// Address, 0 to 126.
    pub address: u8,
    /// Activity of the station, as a name with underscores: `data_exchange`.
    pub does: &'static str,
    /// True if the station answers requests to its address. Then no other station may have this address.
    pub answers: bool,
}

/// Firmware of a device's port on PROFIBUS. The bus notifies it of events on the line at once. Before each
/// call the bus sets the time of the [`Station`], which is in bit times. All other times of the firmware are
/// in microseconds of emulated time.
pub(crate) trait ProfibusPort: Send + SnapshotFields {
    /// Called when the device starts.
    fn power_on(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// Called when the device stops. The station is reset.
    fn power_off(&mut self) {}

    /// Returns the properties that other stations and users can see; `None` while the station has no address.
    fn presence(&self) -> Option<Presence> {
        None
    }

    /// Called when another station on the PROFIBUS segment answers at the same address.
    fn shares_address(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Runs a processor cycle: reads the registers.
    fn look(&mut self, ctx: &mut Context, station: &mut Station);

    /// True if the program has written a register that the firmware must answer, and the firmware has not
    /// polled this register yet.
    fn has_changed(&self) -> bool {
        false
    }

    /// Called when a telegram of another station has ended.
    fn heard(&mut self, ctx: &mut Context, station: &mut Station, telegram: &Telegram);

    /// Called when a telegram of this station has ended.
    fn sent(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// Called at the bit time of the alarm ([`Station::set_alarm`]).
    fn alarm(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// Returns the time of the next event of the firmware in microseconds, `u64::MAX` if there is none.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles the events that are due at `ctx.now`. After the call, [`next_time`](ProfibusPort::next_time)
    /// must be later.
    fn due(&mut self, ctx: &mut Context, station: &mut Station) {
        let _ = (ctx, station);
    }

    /// Applies a fault of the device to the port, at the start of the fault or in a processor cycle. If the
    /// fault has an effect, returns the hit.
    fn fire(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
        let _ = (now, effect);
        None
    }
}

/// A PROFIBUS port as a device provides it.
pub(crate) struct ProfibusSocket {
    /// Device and number of the port.
    pub origin: Origin,
    /// Image of the device.
    pub segment: Segment,
    /// Registers of the device.
    pub layout: &'static DeviceLayout,
    /// Firmware of the port.
    pub port: Box<dyn ProfibusPort>,
}

/// A telegram that a station is about to send.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Intent {
    /// The telegram begins at this bit time, even if the line is busy.
    At(u64, Vec<u8>),
    /// The telegram begins at this bit time or later, as soon as the line has been idle for T_SYN.
    WhenIdle(u64, Vec<u8>),
}

impl Intent {
    pub(super) fn octets(self) -> Vec<u8> {
        match self {
            Intent::At(_, octets) | Intent::WhenIdle(_, octets) => octets,
        }
    }
}

/// A station. It consists of the telegram that it will send next, and of an alarm in bit times.
#[derive(Debug)]
pub(crate) struct Station {
    slot_bits: u64,
    /// Present bit time while firmware runs.
    pub(super) now: u64,
    pub(super) intent: Option<Intent>,
    pub(super) alarm: Option<u64>,
}

snapshot_fields!(Station { values: now, intent, alarm; built: slot_bits });

impl Station {
    pub(super) fn new(slot_bits: u64) -> Self {
        Station { slot_bits, now: 0, intent: None, alarm: None }
    }

    /// Returns the slot time of the PROFIBUS segment: the time within which an answer must begin, in bit
    /// times.
    pub(crate) fn slot_bits(&self) -> u64 {
        self.slot_bits
    }

    /// Returns the present bit time.
    pub(crate) fn now(&self) -> u64 {
        self.now
    }

    /// Sends `telegram` as an answer, `after_bits` bit times from now.
    pub(crate) fn answer(&mut self, after_bits: u64, telegram: &Telegram) {
        // The port never sends a telegram above the maximum length, so there is always an intent.
        self.intent =
            telegram.octets().ok().map(|octets| Intent::At(self.now.saturating_add(after_bits), octets));
    }

    /// Sends `telegram` as a request, as soon as the line has been idle for T_SYN.
    pub(crate) fn request(&mut self, telegram: &Telegram) {
        self.intent = telegram.octets().ok().map(|octets| Intent::WhenIdle(self.now, octets));
    }

    /// Cancels the telegram that the station would send next.
    pub(crate) fn withdraw(&mut self) {
        self.intent = None;
    }

    /// Sets the alarm to this bit time; `None` clears it.
    pub(crate) fn set_alarm(&mut self, at: Option<u64>) {
        self.alarm = at;
    }

    pub(super) fn clear(&mut self) {
        (self.intent, self.alarm) = (None, None);
    }
}

/// A station that is not on a PROFIBUS segment, for tests with their own line.
#[cfg(test)]
impl Station {
    pub(crate) fn alone(rate: BusRate) -> Self {
        Self::new(rate.slot_bits())
    }

    /// Sets the present bit time.
    pub(crate) fn at(&mut self, bits: u64) {
        self.now = bits;
    }

    /// Removes and returns the answer that the station would send next.
    pub(crate) fn intended(&mut self) -> Option<(u64, Vec<u8>)> {
        match self.intent.take()? {
            Intent::At(at, octets) => Some((at, octets)),
            Intent::WhenIdle(..) => None,
        }
    }
}
