//! A serial line as the plant file describes it.

use super::drive_config::SerialDriveConfig;
use super::drives::BusDrive;
use super::{FAMILY, SerialBus};
use crate::devices::emulation::settings::keys::plant_keys;
use crate::devices::emulation::settings::refused_at;
use crate::devices::{BuildError, Bus, BusSection};
use crate::door::DoorSpec;
use crate::identity::BusIndex;
use crate::serial::{BAUD_RATES, CharacterFormat, Parity, Wires};
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A serial line of the plant file.
#[derive(Clone, Debug)]
pub(crate) struct SerialConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Format of the characters that the participants other than ports send and expect.
    pub format: CharacterFormat,
    /// Number of wires.
    pub wires: Wires,
    /// Number of terminating resistors on the line, without those of ports.
    pub terminators: u8,
    /// True if a participant other than the ports has pull-up and pull-down resistors.
    pub has_pull: bool,
    /// Doors to the line that are open from the start.
    pub doors: Vec<DoorSpec>,
    /// Drives on the line.
    drives: Vec<SerialDriveConfig>,
}

/// Settings without their keys: a partner at the other end of the line that is terminated, and sends as 3964R and USS
/// require.
const DEFAULT_BAUD_RATE: u32 = 9600;
const DEFAULT_DATA_BITS: u8 = 8;
const DEFAULT_STOP_BITS: u8 = 1;
const DEFAULT_TERMINATORS: u8 = 1;
const MOST_TERMINATORS: u8 = 8;

plant_keys! {
    /// A serial line
    Section, "a serial line: a table with its settings" {
        /// Number of wires without ground: 2 or 4
        wires: Spanned<u8> = { "enum": [2, 4] }, "2", "2 or 4 wires without ground; required";
        /// Baud rate in bit/s
        baud_rate: Option<Spanned<u32>> = { "enum": BAUD_RATES, "default": DEFAULT_BAUD_RATE },
            "9600", rates_text().replace(" 9600,", " 9600 (default),").replace(" or ", ", ");
        /// Data bits of a character
        data_bits: Option<Spanned<u8>> = { "enum": [7, 8], "default": DEFAULT_DATA_BITS }, "8", "7 or 8 (default)";
        /// Parity of a character
        parity: Option<Parity> = { "enum": ["none", "odd", "even"], "default": "even" },
            r#""even""#, "\"none\", \"odd\" or \"even\" (default)";
        /// Stop bits of a character
        stop_bits: Option<Spanned<u8>> = { "enum": [1, 2], "default": DEFAULT_STOP_BITS }, "1", "1 (default) or 2";
        /// Terminating resistors on the line, without those of PLC ports
        terminators: Option<Spanned<u8>> = {
            "type": "integer", "minimum": 0, "maximum": MOST_TERMINATORS, "default": DEFAULT_TERMINATORS,
        }, "1", "terminating resistors without those of PLC ports, 0 to 8 (default 1)";
        /// True if a participant other than the PLC ports has pull-up and pull-down resistors
        pull_resistors: Option<bool> = { "type": "boolean", "default": false },
            "false", "true if a participant other than the PLC ports has pull-up and pull-down resistors";
        /// Doors for foreign programs that are open from the start
        doors: Option<Vec<DoorSpec>> = {
            "type": "array",
            "items": { "type": "string", "pattern": "^serial-(pty|tcp(-anybody)?:[0-9.]+:[0-9]+)$" },
        }, r#"["serial-pty"]"#, "doors for foreign programs, see serial.md (default: none)";
        /// Drives on the line: slaves of the protocol USS
        drive: Option<Vec<SerialDriveConfig>> = { "type": "array", "items": SerialDriveConfig::schema() },
            r#"[{ name = "pump", address = 3 }]"#, "drives, see \"Drives on a serial line\" (default: none)";
    }
}

/// `300, 600 or 1200`
#[cfg(test)]
fn rates_text() -> String {
    let rates = BAUD_RATES.map(|rate| rate.to_string());
    let [others @ .., last] = &rates;
    format!("{} or {last}", others.join(", "))
}

/// Returns the value of a key, or the default; refuses a value that is not one of `right`.
fn one_of<T: Copy + PartialEq + core::fmt::Display>(
    key: &str,
    name: &str,
    value: Option<Spanned<T>>,
    default: T,
    right: &[T],
) -> Result<T, Error> {
    let Some(value) = value else { return Ok(default) };
    let given = *value.get_ref();
    if right.contains(&given) {
        return Ok(given);
    }
    let right: Vec<_> = right.iter().map(ToString::to_string).collect();
    let right = right
        .split_last()
        .map_or_else(String::new, |(last, others)| format!("{} or {last}", others.join(", ")));
    Err(refused_at(value.span(), format!("{key} of '{name}' is {given}; it must be {right}")))
}

impl SerialConfig {
    /// Returns the JSON Schema of the section.
    pub(crate) fn schema() -> serde_json::Value {
        Section::schema()
    }

    /// Reads a `[[bus]]` section of kind `serial`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn BusSection>, Error> {
        let section = Section::deserialize(value)?;
        let name = section.name;
        let wires_span = section.wires.span();
        let wires = one_of("wires", &name, Some(section.wires), 2, &[2, 4])?;
        let rates = BAUD_RATES.map(u32::from);
        let baud_rate = one_of("baud_rate", &name, section.baud_rate, DEFAULT_BAUD_RATE, &rates)?;
        let data_bits = one_of("data_bits", &name, section.data_bits, DEFAULT_DATA_BITS, &[7, 8])?;
        let stop_bits = one_of("stop_bits", &name, section.stop_bits, DEFAULT_STOP_BITS, &[1, 2])?;
        let counts: Vec<u8> = (0..=MOST_TERMINATORS).collect();
        let terminators = one_of("terminators", &name, section.terminators, DEFAULT_TERMINATORS, &counts)?;
        let format =
            CharacterFormat::new(baud_rate, data_bits, section.parity.unwrap_or_default(), stop_bits);
        let (Some(format), Some(wires)) = (format, Wires::of_count(wires)) else {
            return Err(refused_at(wires_span, format!("the settings of '{name}' do not fit together")));
        };
        let has_pull = section.pull_resistors.unwrap_or_default();
        let doors = section.doors.unwrap_or_default();
        let drives = section.drive.unwrap_or_default();
        Ok(Arc::new(SerialConfig { name, format, wires, terminators, has_pull, doors, drives }))
    }

    /// Builds the drives on the line.
    pub(super) fn drives(&self) -> impl Iterator<Item = Result<BusDrive, BuildError>> {
        self.drives.iter().map(|drive| BusDrive::new(drive, self.format))
    }
}

impl BusSection for SerialConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn check(&self) -> Result<(), BuildError> {
        self.drives().try_for_each(|drive| drive.map(|_| ()))
    }

    fn participants(&self) -> Vec<(&str, u8)> {
        self.drives.iter().map(|drive| (drive.name.as_str(), drive.address)).collect()
    }

    fn doors(&self) -> &[DoorSpec] {
        &self.doors
    }

    fn build(&self, index: BusIndex) -> Result<Box<dyn Bus>, BuildError> {
        Ok(Box::new(SerialBus::new(index, self)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_the_keys() {
        let page = include_str!("../../../docs/reference/plant.md");
        assert!(page.contains(&Section::lines()), "{}", Section::lines());
    }

    #[test]
    fn wrong_settings_are_refused() {
        let read = |section: &str| {
            let read = SerialConfig::read(ValueDeserializer::parse(section).unwrap());
            read.map(|config| config.name().to_owned()).map_err(|error| error.to_string())
        };
        assert_eq!(read("{ name = 'rs485', wires = 4 }").as_deref(), Ok("rs485"));
        for (settings, right) in [
            ("", "missing field `wires`"),
            (", wires = 3", "wires of 'x' is 3; it must be 2 or 4"),
            (", wires = 2, baud_rate = 57600", "it must be 300, 600, 1200, 2400, 4800, 9600, 19200 or 38400"),
            (", wires = 2, data_bits = 9", "data_bits of 'x' is 9; it must be 7 or 8"),
            (", wires = 2, stop_bits = 0", "stop_bits of 'x' is 0; it must be 1 or 2"),
            (", wires = 2, terminators = 9", "terminators of 'x' is 9"),
            (", wires = 2, parity = 'mark'", "unknown variant `mark`"),
            (", wires = 2, kbit_s = 9", "unknown field `kbit_s`"),
        ] {
            let error = read(&format!("{{ name = 'x'{settings} }}")).unwrap_err();
            assert!(error.contains(right), "{error}");
        }
    }
}
