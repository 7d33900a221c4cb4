//! The file that describes which values and buses a plant exchanges with other simulators.

use super::CouplingError;
use crate::input_file;
use crate::request::MAX_ADVANCE_US;
use crate::time;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

/// Content of the file. The names in it are not yet looked up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CouplingConfig {
    /// Emulated time from one exchange to the next, in microseconds: 1 us to 24 h.
    pub period_us: u64,
    /// Name of the plant among the simulators.
    pub name: String,
    /// Values that the plant publishes.
    pub publish: Vec<ValueEntry>,
    /// Values that the plant subscribes to.
    pub subscribe: Vec<ValueEntry>,
    /// Buses that exchange frames with the other simulators.
    pub buses: Vec<BusEntry>,
}

/// A value and its key: an entry of `[[publish]]` or `[[subscribe]]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValueEntry {
    /// Name of a register, a pattern, or a value at the shaft of a drive.
    pub value: String,
    /// Name of the value among the simulators. Default: the name of the plant, followed by `value`.
    pub key: Option<String>,
}

/// One entry of `[[bus]]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusEntry {
    /// Name of the bus in the plant.
    pub name: String,
    /// Endpoint to which the other simulators send frames for the bus. Default: the name of the plant, followed by the
    /// name of the bus.
    pub endpoint: Option<String>,
    /// Endpoints of other simulators that receive the frames of the bus.
    #[serde(default)]
    pub to: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    period: String,
    #[serde(default = "plant")]
    name: String,
    #[serde(default)]
    publish: Vec<ValueEntry>,
    #[serde(default)]
    subscribe: Vec<ValueEntry>,
    #[serde(default)]
    bus: Vec<BusEntry>,
}

impl File {
    /// Returns the first name that HELICS does not accept.
    fn bad_name(&self) -> Option<&str> {
        let keys = self.publish.iter().chain(&self.subscribe).filter_map(|it| it.key.as_ref());
        let endpoints = self.bus.iter().flat_map(|it| it.to.iter().chain(&it.endpoint));
        let mut names = [&self.name].into_iter().chain(keys).chain(endpoints).map(String::as_str);
        names.find(|name| name.is_empty() || name.chars().any(char::is_control))
    }
}

fn plant() -> String {
    "plant".to_owned()
}

impl CouplingConfig {
    /// Reads the file.
    ///
    /// # Errors
    /// [`CouplingError::File`].
    pub fn load(path: &Path) -> Result<Self, CouplingError> {
        let file = path.display().to_string();
        let text = input_file::read(path, input_file::LONGEST_EXCHANGE)
            .map_err(|reason| CouplingError::File { file: file.clone(), what: reason.to_string() })?;
        Self::parse(&file, &text)
    }

    /// Parses the text of a file called `file`.
    ///
    /// # Errors
    /// [`CouplingError::File`].
    pub fn parse(file: &str, text: &str) -> Result<Self, CouplingError> {
        let wrong = |what: String| CouplingError::File { file: file.to_owned(), what };
        let read: File = toml::from_str(text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = before.map(|before| before.matches('\n').count() + 1);
            let line = line.map(|line| format!("line {line}: ")).unwrap_or_default();
            wrong(format!("{line}{}", error.message().replace('\n', " ")))
        })?;
        let period_us = time::parse(&read.period).map_err(|error| wrong(format!("period: {error}")))?;
        if !(1..=MAX_ADVANCE_US).contains(&period_us) {
            return Err(wrong(format!("period: {} is not 1us to 24h", read.period)));
        }
        if read.publish.is_empty() && read.subscribe.is_empty() && read.bus.is_empty() {
            return Err(wrong(
                "nothing is exchanged; add [[publish]], [[subscribe]] or [[bus]] sections".to_owned(),
            ));
        }
        if let Some(bad) = read.bad_name() {
            return Err(wrong(format!("{bad:?} is not a name for HELICS")));
        }
        let mut buses = BTreeSet::new();
        if let Some(twice) = read.bus.iter().find(|bus| !buses.insert(&bus.name)) {
            return Err(wrong(format!("bus '{}' is listed twice", twice.name)));
        }
        let File { name, publish, subscribe, bus: buses, .. } = read;
        Ok(CouplingConfig { period_us, name, publish, subscribe, buses })
    }
}
