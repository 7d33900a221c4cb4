//! `commram run --check`: judge a plant file, start nothing.

use super::error::CliError;
use super::table::{self, Format, Row};
use crate::handed_in;
use crate::plant::{PlantConfig, PlantError};
use serde::Serialize;
use std::path::Path;

/// What is to be said about a plant file.
#[derive(Serialize)]
struct Judged {
    file: String,
    fine: bool,
    /// Where something is wrong, as far as it stands in a line.
    line: Option<usize>,
    message: Option<String>,
    devices: Vec<Device>,
    buses: Vec<Bus>,
    faults: usize,
}

#[derive(Serialize)]
struct Device {
    name: String,
    kind: &'static str,
    ports: Vec<Port>,
}

#[derive(Serialize)]
struct Port {
    name: String,
    bus: Option<String>,
    number: Option<u8>,
}

#[derive(Serialize)]
struct Bus {
    name: String,
    kind: &'static str,
    drives: Vec<Drive>,
}

#[derive(Serialize)]
struct Drive {
    name: String,
    number: u8,
}

impl Row for Judged {
    const COLUMNS: &'static [&'static str] = &["file", "fine", "line", "message"];

    fn cells(&self) -> Vec<String> {
        let line = self.line.map(|line| line.to_string());
        let message = self.message.clone();
        vec![self.file.clone(), self.fine.to_string(), line.unwrap_or_default(), message.unwrap_or_default()]
    }
}

/// Judges the file, or the built-in plant.
///
/// # Errors
/// It is refused: the error itself, or, where a table has told it, that it was told.
pub(crate) fn run(path: Option<&Path>, format: Format) -> Result<(), CliError> {
    let read = path.map_or_else(PlantConfig::built_in, PlantConfig::load);
    let file = path.map_or_else(|| "built-in plant".to_owned(), |path| path.display().to_string());
    match read {
        Ok(config) => table::print(format, &[Judged::fine(file, &config)], text),
        Err(error) if format == Format::Text => Err(error.into()),
        Err(error) => {
            let read = path.and_then(|path| handed_in::read(path, handed_in::LONGEST_PLANT).ok());
            table::print(format, &[Judged::refused(file, &error, &read.unwrap_or_default())], text)?;
            Err(CliError::ReportedWrongUse)
        }
    }
}

/// `plant.toml: fine: 2 devices, 2 buses with 3 drives, 1 fault`
fn text(rows: &[Judged]) -> String {
    let count = |count: usize, what: &str, several: &str| match count {
        1 => format!("1 {what}"),
        count => format!("{count} {several}"),
    };
    let line = |judged: &Judged| {
        let drives = judged.buses.iter().map(|bus| bus.drives.len()).sum();
        format!(
            "{}: fine: {}, {} with {}, {}\n",
            judged.file,
            count(judged.devices.len(), "device", "devices"),
            count(judged.buses.len(), "bus", "buses"),
            count(drives, "drive", "drives"),
            count(judged.faults, "fault", "faults")
        )
    };
    rows.iter().map(line).collect()
}

impl Judged {
    fn fine(file: String, config: &PlantConfig) -> Self {
        let device = |device: &dyn crate::devices::DeviceConfig| Device {
            name: device.name().to_owned(),
            kind: device.layout().name,
            ports: device
                .ports()
                .iter()
                .map(|port| Port {
                    name: port.name.to_owned(),
                    bus: port.medium.map(str::to_owned),
                    number: port.address,
                })
                .collect(),
        };
        let drive = |(name, number): (&str, u8)| Drive { name: name.to_owned(), number };
        let bus = |bus: &dyn crate::devices::MediumConfig| Bus {
            name: bus.name().to_owned(),
            kind: bus.family(),
            drives: bus.participants().into_iter().map(drive).collect(),
        };
        Self {
            file,
            fine: true,
            line: None,
            message: None,
            devices: config.devices.iter().map(|it| device(&**it)).collect(),
            buses: config.media.iter().map(|it| bus(&**it)).collect(),
            faults: config.faults.len(),
        }
    }

    fn refused(file: String, error: &PlantError, text: &str) -> Self {
        Self {
            file,
            fine: false,
            line: error.line(text),
            message: Some(error.message()),
            devices: Vec::new(),
            buses: Vec::new(),
            faults: 0,
        }
    }
}
