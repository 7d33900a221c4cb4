//! `commram plant check` and `commram run --check`: check a plant file without starting an emulator.

use super::error::CliError;
use super::output;
use super::table::{self, Format, Row};
use crate::input_file;
use crate::plant::{PlantConfig, PlantError};
use crate::plural::{plural, plural_of};
use serde::Serialize;
use std::path::Path;

/// Result of the check of a plant file.
#[derive(Serialize)]
struct PlantVerdict {
    file: String,
    fine: bool,
    /// Line of the error, if the error has one.
    line: Option<usize>,
    message: Option<String>,
    /// Entries that are allowed but probably not intended.
    warnings: Vec<Warning>,
    devices: Vec<Device>,
    buses: Vec<Bus>,
    faults: usize,
}

#[derive(Serialize)]
struct Warning {
    line: Option<usize>,
    message: String,
}

impl Warning {
    fn all(config: &PlantConfig, text: &str) -> Vec<Self> {
        let doubts = config.doubts(text).into_iter();
        doubts.map(|(line, doubt)| Self { line, message: doubt.text }).collect()
    }

    /// Formats the result: `plant.toml: line 7: warning: ...`.
    fn text(&self, file: &str) -> String {
        let line = self.line.map_or_else(String::new, |line| format!("line {line}: "));
        format!("{file}: {line}warning: {}", self.message)
    }
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

impl Row for PlantVerdict {
    const COLUMNS: &'static [&'static str] = &["file", "fine", "line", "message", "warnings"];

    fn cells(&self) -> Vec<String> {
        let line = self.line.map(|line| line.to_string());
        let message = self.message.clone();
        let warnings = self.warnings.iter().map(|warning| warning.text(&self.file));
        vec![
            self.file.clone(),
            self.fine.to_string(),
            line.unwrap_or_default(),
            message.unwrap_or_default(),
            warnings.collect::<Vec<_>>().join("\n"),
        ]
    }
}

/// Checks the file, or the built-in plant, and calls `then` with an accepted plant.
///
/// # Errors
/// The plant is refused, or `then` fails. The error is [`CliError::Reported`] if the printed table already contains the
/// message.
pub(crate) fn run(
    path: Option<&Path>,
    format: Format,
    then: impl FnOnce(&PlantConfig) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let read = path.map_or_else(PlantConfig::built_in, PlantConfig::load);
    let file = called(path);
    match read {
        Ok(config) => {
            then(&config)?;
            table::print(format, &[PlantVerdict::fine(file, &config, &written(path))], text)
        }
        Err(error) if format == Format::Text => Err(error.into()),
        Err(error) => {
            table::print(format, &[PlantVerdict::refused(file, &error)], text)?;
            Err(CliError::ReportedWrongUse)
        }
    }
}

/// Prints warnings about entries of a plant that are allowed but probably not intended.
pub(crate) fn warn(path: Option<&Path>, config: &PlantConfig) {
    for warning in Warning::all(config, &written(path)) {
        output::complain(&warning.text(&called(path)));
    }
}

fn called(path: Option<&Path>) -> String {
    path.map_or_else(|| "built-in plant".to_owned(), |path| path.display().to_string())
}

/// Returns the text of the file, in which line numbers are searched.
fn written(path: Option<&Path>) -> String {
    match path {
        Some(path) => input_file::read(path, input_file::LONGEST_PLANT).unwrap_or_default(),
        None => String::new(),
    }
}

/// Formats the results: `plant.toml: fine: 2 devices, 2 buses with 3 drives, 1 fault`.
fn text(rows: &[PlantVerdict]) -> String {
    let line = |judged: &PlantVerdict| {
        let drives: usize = judged.buses.iter().map(|bus| bus.drives.len()).sum();
        let buses = match judged.buses.len() {
            1 => "1 bus".to_owned(),
            count => format!("{count} buses"),
        };
        format!(
            "{}: fine: {}, {} with {}, {}\n",
            judged.file,
            plural_of(&judged.devices, "device"),
            buses,
            plural(drives as u64, "drive"),
            plural(judged.faults as u64, "fault")
        ) + &judged.warnings.iter().map(|it| it.text(&judged.file) + "\n").collect::<String>()
    };
    // Names of files and of the plant may have characters that a terminal interprets.
    output::harmless(&rows.iter().map(line).collect::<String>())
}

impl PlantVerdict {
    fn fine(file: String, config: &PlantConfig, text: &str) -> Self {
        let device = |device: &dyn crate::devices::DeviceConfig| Device {
            name: device.name().to_owned(),
            kind: device.layout().name,
            ports: device
                .ports()
                .iter()
                .map(|port| Port {
                    name: port.name.to_owned(),
                    bus: port.bus.map(str::to_owned),
                    number: port.address,
                })
                .collect(),
        };
        let drive = |(name, number): (&str, u8)| Drive { name: name.to_owned(), number };
        let bus = |bus: &dyn crate::devices::BusSection| Bus {
            name: bus.name().to_owned(),
            kind: bus.family(),
            drives: bus.participants().into_iter().map(drive).collect(),
        };
        Self {
            file,
            fine: true,
            line: None,
            message: None,
            warnings: Warning::all(config, text),
            devices: config.devices.iter().map(|it| device(&**it)).collect(),
            buses: config.buses.iter().map(|it| bus(&**it)).collect(),
            faults: config.faults.len(),
        }
    }

    fn refused(file: String, error: &PlantError) -> Self {
        Self {
            file,
            fine: false,
            line: error.line(),
            message: Some(error.message()),
            warnings: Vec::new(),
            devices: Vec::new(),
            buses: Vec::new(),
            faults: 0,
        }
    }
}
