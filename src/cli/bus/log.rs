//! `commram bus play` and `commram bus compare`: logs of frames.

mod compare;
mod play;
mod select;

pub(super) use compare::{Compare, compare};
pub(super) use play::{Play, play};

use super::super::error::CliError;
use super::super::output;
use crate::can::Frame;
use crate::identity::BusIndex;
use crate::input_file;
use crate::journal::pcapng;
use crate::journal::recording::{self, Logged, Recording};
use crate::plural::plural;
use crate::request::InstanceInfo;
use select::Select;
use std::collections::BTreeMap;
use std::path::Path;

/// How many positions of skipped entries a note names.
const SHOWN_PLACES: usize = 20;

/// A log file after reading.
struct Log {
    recording: Recording,
    /// Unit of [`Logged::at`]: line or byte.
    unit: &'static str,
}

/// A frame of the log, with the number of its bus.
struct AddressedFrame {
    at: usize,
    time_us: u64,
    bus: BusIndex,
    frame: Frame,
}

/// Reads a log.
fn read(path: &Path) -> Result<Log, CliError> {
    let wrong = |right: String| CliError::Argument { text: path.display().to_string(), right };
    let bytes =
        input_file::read_bytes(path, input_file::LONGEST).map_err(|reason| wrong(reason.to_string()))?;
    if pcapng::is_one(&bytes) {
        let recording = pcapng::read(&bytes).map_err(|error| wrong(error.to_string()))?;
        return Ok(Log { recording, unit: "byte" });
    }
    let text = input_file::text(bytes).map_err(|_| {
        wrong("it is neither a text (of candump or GVRET) nor a pcapng file (of Wireshark)".to_owned())
    })?;
    let recording = recording::read_text(&text).map_err(|error| wrong(error.to_string()))?;
    Ok(Log { recording, unit: "line" })
}

impl Log {
    /// Selects frames and assigns each to a bus. Prints a note for everything that is passed over.
    ///
    /// # Errors
    /// The instance has no bus `only`.
    fn aim(
        self,
        select: &Select,
        only: Option<&str>,
        info: &InstanceInfo,
    ) -> Result<Vec<AddressedFrame>, CliError> {
        self.note_skipped();
        let buses = &info.names.buses;
        let number = |name: &str| buses.iter().position(|bus| bus == name);
        let unknown = |bus: &str| CliError::UnknownBus {
            bus: bus.to_owned(),
            instance: info.name.clone(),
            buses: buses.join(", "),
        };
        let for_all = only.map(|name| number(name).ok_or_else(|| unknown(name))).transpose()?;
        let for_all = for_all.or((buses.len() == 1).then_some(0));
        let (mut aimed, mut not_selected) = (Vec::new(), 0_u64);
        let mut without_bus: BTreeMap<String, u64> = BTreeMap::new();
        for Logged { at, time_us, interface, direction, frame } in self.recording.frames {
            if !select.takes(&interface, direction, &frame) {
                not_selected += 1;
            } else if let Some(bus) = for_all.or_else(|| number(&interface)) {
                aimed.push(AddressedFrame { at, time_us, bus: BusIndex::at(bus), frame });
            } else {
                *without_bus.entry(interface).or_default() += 1;
            }
        }
        for (interface, count) in without_bus {
            output::note(&format!(
                "{} of interface '{interface}' passed over: no bus has this name (the buses are {}); --bus NAME takes \
                 them for a bus",
                plural(count, "frame"),
                buses.join(", ")
            ));
        }
        if not_selected > 0 {
            output::note(&format!("{} not selected", plural(not_selected, "frame")));
        }
        Ok(aimed)
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

/// The error for a log in which nothing applies.
fn nothing(path: &Path, right: &str) -> CliError {
    CliError::Argument { text: path.display().to_string(), right: right.to_owned() }
}
