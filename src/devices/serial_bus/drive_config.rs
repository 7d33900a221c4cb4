//! A drive on a serial line as the plant file describes it: a slave of the protocol USS.

use crate::devices::BuildError;
use crate::devices::cansync::drive::{
    BapsMonitoring, BuiltInDriveConfig, Enable, MonitorSettings, ParameterNumbers, ParameterSpec, number,
};
use crate::devices::emulation::settings::{range, time};
use crate::serial::uss::{Layout, LayoutError, PkwWidth};
use crate::serial::{CharacterFormat, Parity};
use serde::Deserialize;
use serde_json::{Value, json};
use std::num::NonZeroU32;

/// Number of words of a parameter channel of variable width, as in parameter P2013 of a MICROMASTER.
const VARIABLE: u8 = 127;

/// A drive, section `[[bus.drive]]` of a serial line.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a drive: a table with its settings")]
pub(crate) struct SerialDriveConfig {
    /// Name, unique among all drives.
    pub name: String,
    /// Address, 0 to 31.
    pub address: u8,
    /// PPO type, 1 to 5, instead of the numbers of words.
    #[serde(default)]
    ppo: Option<u8>,
    /// Number of words of the parameter channel: 0, 3, 4 or 127 for a variable number.
    #[serde(default)]
    pkw_words: Option<u8>,
    /// Number of words of process data, 0 to 16.
    #[serde(default)]
    pzd_words: Option<u8>,
    /// Time from the end of a request to the begin of the answer, in us. The start delay if it is omitted.
    #[serde(default)]
    pub response_delay_us: Option<u64>,
    /// Parameters that the process data of the master are written to.
    #[serde(default = "default_setpoints")]
    pub setpoints: Vec<u16>,
    /// Parameters with the process data for the master.
    #[serde(default = "default_actual_values")]
    pub actual_values: Vec<u16>,
    /// Reaction of the drive if the process data of the master are missing.
    #[serde(default)]
    telegram_monitoring: Option<MonitorSettings>,
    /// State after power-on.
    #[serde(default = "by_control_word")]
    enable: Enable,
    /// Largest change of the speed per second.
    #[serde(default)]
    ramp_per_second: Option<NonZeroU32>,
    /// Numbers of built-in parameters for which the available manuals give no number.
    #[serde(default)]
    numbers: ParameterNumbers,
    /// Further parameters.
    #[serde(default)]
    parameters: Vec<ParameterSpec>,
}

fn default_setpoints() -> Vec<u16> {
    vec![number::CONTROL_WORD, number::SPEED_REFERENCE]
}

fn default_actual_values() -> Vec<u16> {
    vec![number::STATUS_WORD, number::SPEED_ACTUAL]
}

fn by_control_word() -> Enable {
    Enable::ByControlWord
}

impl SerialDriveConfig {
    /// Returns the JSON Schema of the drives of a line.
    pub(super) fn schema() -> Value {
        let numbers = |text: &str, default: &[u16]| {
            let number = json!({ "type": "integer", "minimum": 0, "maximum": 4095 });
            json!({ "type": "array", "description": text, "items": number, "maxItems": 16, "default": default })
        };
        json!({
            "type": "object",
            "description": "A drive: a slave of the protocol USS",
            "additionalProperties": false,
            "required": ["name", "address"],
            "properties": {
                "name": { "$ref": "#/definitions/name" },
                "address": {
                    "type": "integer", "minimum": 0, "maximum": 31,
                    "description": "USS address, unique on its line",
                },
                "ppo": {
                    "enum": [1, 2, 3, 4, 5],
                    "description": "PPO type, instead of pkw_words and pzd_words",
                },
                "pkw_words": {
                    "enum": [0, 3, 4, VARIABLE], "default": 4,
                    "description": "Words of the parameter channel; 127: a variable number",
                },
                "pzd_words": {
                    "type": "integer", "minimum": 0, "maximum": 16, "default": 2,
                    "description": "Words of process data",
                },
                "response_delay_us": {
                    "type": "integer", "minimum": 0, "maximum": 3_600_000_000_u64,
                    "description": "Time from a request to the answer in us; left out: two characters",
                },
                "setpoints": numbers(
                    "Parameters that the process data of the master are written to, in this order",
                    &default_setpoints(),
                ),
                "actual_values": numbers(
                    "Parameters with the process data for the master, in this order",
                    &default_actual_values(),
                ),
                "telegram_monitoring": { "$ref": "#/definitions/watch" },
                "enable": {
                    "enum": ["at_power_on", "by_control_word"], "default": "by_control_word",
                    "description": "When the drive switches its power stage on",
                },
                "ramp_per_second": {
                    "type": "integer", "minimum": 1, "maximum": u32::MAX,
                    "description": "Largest change of the speed per second; left out: no ramp",
                },
                "numbers": { "$ref": "#/definitions/numbers" },
                "parameters": {
                    "type": "array",
                    "description": "Further parameters",
                    "items": { "$ref": "#/definitions/parameter" },
                },
            },
        })
    }

    /// Returns the layout of the net data.
    ///
    /// # Errors
    /// The sizes are wrong, or the drive has a PPO type and sizes.
    pub(super) fn layout(&self) -> Result<Layout, BuildError> {
        let wrong = |key: &str, reason: String| BuildError::own(&self.name, key, reason);
        let of_layout = |key: &str, error: LayoutError| wrong(key, format!("drive {}: {error}", self.name));
        if let Some(ppo) = self.ppo {
            if self.pkw_words.is_some() || self.pzd_words.is_some() {
                let text = format!(
                    "drive {}: a PPO type has its own numbers of words; leave pkw_words and pzd_words out",
                    self.name
                );
                return Err(wrong("ppo", text));
            }
            return Layout::ppo(ppo).map_err(|error| of_layout("ppo", error));
        }
        let pkw = match self.pkw_words {
            Some(0) => PkwWidth::None,
            Some(3) => PkwWidth::Three,
            None | Some(4) => PkwWidth::Four,
            Some(VARIABLE) => PkwWidth::Variable,
            Some(other) => {
                let name = &self.name;
                let text = format!("pkw_words of '{name}' is {other}; it must be 0, 3, 4 or 127");
                return Err(wrong("pkw_words", text));
            }
        };
        Layout::new(pkw, self.pzd_words.unwrap_or(2)).map_err(|error| of_layout("pzd_words", error))
    }

    /// Returns the settings of the drive behind the slave.
    pub(super) fn drive(&self) -> BuiltInDriveConfig {
        BuiltInDriveConfig {
            enable: self.enable,
            ramp_per_second: self.ramp_per_second,
            numbers: self.numbers,
            parameters: self.parameters.clone(),
            monitoring: BapsMonitoring { cyclic_data: self.telegram_monitoring, ..BapsMonitoring::default() },
            ..BuiltInDriveConfig::default()
        }
    }

    /// Checks the settings that need neither the drive nor its slave.
    ///
    /// # Errors
    /// [`BuildError`] names the key and a correct value.
    pub(super) fn check(&self, format: CharacterFormat) -> Result<(), BuildError> {
        let name = &self.name;
        range("address", name, self.address.into(), 0..=31, "0 to 31")?;
        time("response_delay_us", name, self.response_delay_us.unwrap_or(0))?;
        let monitoring = self.telegram_monitoring.unwrap_or_default();
        time("telegram_monitoring.time_us", name, monitoring.time_us)?;
        if (format.data_bits(), format.parity(), format.stop_bits()) != (8, Parity::Even, 1) {
            let text = format!(
                "drive {name}: USS needs characters with 8 data bits, even parity and 1 stop bit, which are the defaults \
                 of the line"
            );
            return Err(BuildError::own(name, "name", text));
        }
        self.layout().map(|_| ())
    }
}
