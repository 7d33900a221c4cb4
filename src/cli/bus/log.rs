//! `commram bus play` and `commram bus compare`: logs of frames and telegrams.

mod compare;
mod foreign;
mod message;
mod play;
mod restarts;
mod select;

pub(super) use compare::{Compare, compare};
pub(super) use play::{Play, play};

use super::super::error::CliError;
use super::super::output;
use super::super::session::{Session, number_of_bus};
use crate::can::{Frame, wire};
use crate::devices;
use crate::door::TrafficKind;
use crate::identity::BusIndex;
use crate::input_file;
use crate::journal::candump::Candump;
use crate::journal::pcapng;
use crate::journal::recording::{self, Logged, Recording};
use crate::plural::plural;
use crate::profibus::Telegram;
use crate::request::{BusState, InstanceInfo, Op};
use message::{Message, Senders};
use restarts::Entry;
use select::Select;
use std::collections::BTreeMap;
use std::path::Path;

/// Maximum number of positions of skipped entries in a note.
const SHOWN_PLACES: usize = 20;
/// Maximum number of interfaces without a bus that have their own note. A log can have an interface for each frame.
const SHOWN_INTERFACES: usize = 20;

/// A log file after reading.
struct Log {
    recording: Recording,
    /// Unit of [`Logged::at`]: line or byte.
    unit: &'static str,
}

/// A message of the log, with the index of its bus.
struct AddressedMessage {
    at: usize,
    time_us: u64,
    bus: BusIndex,
    message: Message,
}

/// The buses of an instance.
struct Buses {
    info: InstanceInfo,
    states: Vec<BusState>,
}

impl Buses {
    fn of(session: &Session) -> Result<Self, CliError> {
        Ok(Buses { info: session.ask(Op::Info)?.info()?, states: session.ask(Op::Buses)?.buses()? })
    }

    /// Returns the bit rate of a bus, at least 1 bit/s.
    fn bit_s(&self, bus: BusIndex) -> u64 {
        self.states.get(bus.index()).map_or(0, |state| state.bit_s).max(1).into()
    }

    /// True if a bus carries messages of the same kind as `message`.
    fn carries(&self, bus: usize, message: &Message) -> bool {
        let traffic_kind =
            self.states.get(bus).and_then(|state| devices::emulation::traffic_kind_of(&state.kind));
        let carries_octets = matches!(traffic_kind, Some(TrafficKind::Telegrams | TrafficKind::Octets));
        carries_octets == matches!(message, Message::Telegram(_))
    }
}

/// Returns the time in microseconds from the begin of a frame to its end, at which the receivers have the frame.
fn frame_us(frame: &Frame, bit_s: u64) -> u64 {
    (u64::from(wire::bits_to_end_of_frame(frame)) * 1_000_000).div_ceil(bit_s)
}

/// Returns the time in microseconds that the octets of a telegram take at `bit_s`.
fn telegram_us(octets: &[u8], bit_s: u64) -> u64 {
    Telegram::bits(octets.len()) * 1_000_000 / bit_s
}

/// Reads the log of a bus from a file.
fn read(path: &Path) -> Result<Log, CliError> {
    let wrong = |right: String| CliError::Argument { text: path.display().to_string(), right };
    let bytes =
        input_file::read_bytes(path, input_file::LONGEST).map_err(|reason| wrong(reason.to_string()))?;
    if pcapng::is_one(&bytes) {
        let recording = pcapng::read(&bytes).map_err(|error| wrong(error.to_string()))?;
        return Ok(Log { recording, unit: "byte" });
    }
    let conversion = foreign::conversion(path, &bytes);
    let text = input_file::text(bytes).map_err(|_| {
        wrong(conversion.clone().unwrap_or_else(|| {
            "it is neither a text (of candump, GVRET or commram) nor a pcapng file (of Wireshark)".to_owned()
        }))
    })?;
    let recording = recording::read_text(&text).map_err(|error| {
        wrong(conversion.map_or_else(|| error.to_string(), |how| format!("{error}; {how}")))
    })?;
    Ok(Log { recording, unit: "line" })
}

impl Log {
    /// Selects messages and assigns each to a bus. After a restart of the logger's clock, changes the times so that
    /// they continue. Prints notes for skipped messages and for restarts.
    ///
    /// # Errors
    /// The instance has no bus `only`.
    fn aim(
        mut self,
        select: &Select,
        only: Option<&str>,
        buses: &Buses,
    ) -> Result<Vec<AddressedMessage>, CliError> {
        self.note_skipped();
        let names = &buses.info.names.buses;
        let in_candump = Candump::interfaces(names);
        // Only a bus with a long name has another name in a log of candump, and no other bus has this name.
        let number = |name: &str| {
            let place = |names: &[String]| names.iter().position(|bus| bus == name);
            place(names).or_else(|| place(&in_candump))
        };
        let for_all = only.map(|name| number_of_bus(&buses.info.name, names, name)).transpose()?;
        let for_all = for_all.map(BusIndex::index).or((names.len() == 1).then_some(0));
        let mut entries = self.take_messages(select);
        restarts::continue_times(&mut entries, self.unit);
        let mut aimed = Vec::new();
        let mut passed = PassedOver::default();
        for Entry { interface, is_selected, at, time_us, message } in entries {
            let bus = for_all.or_else(|| number(&interface));
            match bus {
                _ if !is_selected => passed.not_selected += 1,
                None => *passed.without_bus.entry(interface).or_default() += 1,
                Some(bus) if !buses.carries(bus, &message) => {
                    *passed.of_other_kind.entry(names[bus].clone()).or_default() += 1;
                }
                Some(bus) => aimed.push(AddressedMessage { at, time_us, bus: BusIndex::at(bus), message }),
            }
        }
        passed.note(names);
        Ok(aimed)
    }

    /// Removes the messages and returns them in the order of the log.
    fn take_messages(&mut self, select: &Select) -> Vec<Entry> {
        let frames = core::mem::take(&mut self.recording.frames).into_iter().map(|it| {
            let Logged { at, time_us, interface, direction, frame } = it;
            let is_selected = select.takes(&interface, direction, &frame);
            Entry { interface, is_selected, at, time_us, message: Message::Frame(frame) }
        });
        let mut senders: BTreeMap<String, Senders> = BTreeMap::new();
        let telegrams = core::mem::take(&mut self.recording.telegrams).into_iter().map(|it| {
            let Logged { at, time_us, interface, direction, frame } = it;
            let sender = senders.entry(interface.clone()).or_default().of_next(&frame);
            let is_selected = select.takes_telegram(&interface, direction, sender);
            Entry { interface, is_selected, at, time_us, message: Message::Telegram(frame) }
        });
        let mut messages: Vec<_> = frames.chain(telegrams).collect();
        messages.sort_by_key(|entry| entry.at);
        messages
    }

    /// Prints a note for each reason to skip entries, with the positions of the entries.
    fn note_skipped(&self) {
        let mut reasons: Vec<(&str, Vec<usize>)> = Vec::new();
        for it in &self.recording.skipped {
            match reasons.iter_mut().find(|(reason, _)| *reason == it.reason) {
                Some((_, places)) => places.push(it.at),
                None => reasons.push((&it.reason, vec![it.at])),
            }
        }
        for (reason, places) in reasons {
            let shown: Vec<_> = places.iter().take(SHOWN_PLACES).map(usize::to_string).collect();
            let unit = if places.len() == 1 { self.unit.to_owned() } else { format!("{}s", self.unit) };
            let more = places.len() - shown.len();
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            output::note(&format!("{unit} {}{more}: skipped: {reason}", shown.join(", ")));
        }
    }
}

/// Numbers of messages that are not played, by reason.
#[derive(Default)]
struct PassedOver {
    not_selected: u64,
    /// Number of messages without a bus, by interface.
    without_bus: BTreeMap<String, u64>,
    /// Number of messages that the bus cannot carry, by bus.
    of_other_kind: BTreeMap<String, u64>,
}

impl PassedOver {
    /// Prints a note for each reason.
    fn note(self, buses: &[String]) {
        let others = self.without_bus.values().skip(SHOWN_INTERFACES);
        let (more, frames) = (self.without_bus.len().saturating_sub(SHOWN_INTERFACES), others.sum::<u64>());
        for (interface, count) in self.without_bus.into_iter().take(SHOWN_INTERFACES) {
            output::note(&format!(
                "{} of interface '{interface}' passed over: no bus has this name (the buses are {}); --bus NAME takes \
                 them for a bus",
                plural(count, "frame"),
                buses.join(", ")
            ));
        }
        if more > 0 {
            output::note(&format!(
                "{} of {} passed over: no bus has their names",
                plural(frames, "frame"),
                plural(more as u64, "more interface")
            ));
        }
        for (bus, count) in self.of_other_kind {
            output::note(&format!(
                "{} passed over: bus '{bus}' carries no messages of this kind",
                plural(count, "message")
            ));
        }
        if self.not_selected > 0 {
            output::note(&format!("{} not selected", plural(self.not_selected, "frame")));
        }
    }
}

/// If the time of a message is earlier than that of a preceding message of its bus, sets it to the time of the
/// preceding message. Returns the positions of these messages.
fn put_in_order(log: &mut [AddressedMessage]) -> Vec<usize> {
    let mut latest: BTreeMap<BusIndex, u64> = BTreeMap::new();
    let mut earlier = Vec::new();
    for it in log {
        let latest_us = latest.entry(it.bus).or_default();
        if it.time_us < *latest_us {
            earlier.push(it.at);
        }
        it.time_us = it.time_us.max(*latest_us);
        *latest_us = it.time_us;
    }
    earlier
}

/// Returns the error for a log without a selected message.
fn nothing(path: &Path, right: &str) -> CliError {
    CliError::Argument { text: path.display().to_string(), right: right.to_owned() }
}
