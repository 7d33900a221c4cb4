//! Configuration of a drive in the plant file.

use super::card_function::CardFunction;
use super::drivecom::Enable;
use super::monitoring::CardMonitoring;
use super::parameters::{ParamFormat, ParameterError, ParameterSpec};
use super::zk::{ActualMapping, MappingError, ReferenceMapping, Source, ZkParameters};
use crate::devices::BuildError;
use crate::devices::cansync::frames::Channel;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;

/// A drive with CANsync card.
///
/// Only name and slave number are required. All other settings have defaults with which the drive moves:
///
/// ```
/// let drive: commram::devices::cansync::drive::DriveConfig = toml::from_str(r#"
///     name = "unwinder"
///     slave_number = 3
///     enable = "by_control_word"
///     ramp_per_second = 1000000
///     parameters = [{ number = 400, format = "word", initial = 7, max = 100 }]
///     [zk]
///     zk_0 = 300       # reference value 1 goes to P300 ...
///     zk_4 = 0x0041    # ... and comes from WRC1, words 0 and 1
///     zk_16 = 301      # actual value 1 is P301 ...
///     zk_20 = 0x0041   # ... in RDC1, words 0 and 1
///     zk_25 = 0x0005   # status word in RDC1, word 2
/// "#)?;
/// assert!(commram::devices::cansync::drive::Drive::new(&drive, 500).is_ok());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a slave: a table with its settings")]
pub struct DriveConfig {
    /// Name in reports and traces.
    pub name: String,
    /// DIP switches S20, 6 to 10: slave number on the bus, 0 to 31.
    pub slave_number: u8,
    /// DIP switches S20, 1 and 2: baud rate in kbit/s, 1000, 500, 250 or 125 (manual 5.01010.01 p. 13). If it is
    /// omitted, the drive uses the rate of its bus in the plant file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kbit_s: Option<u16>,
    /// Function of the CANsync card, 0 or 1 (default).
    #[serde(default)]
    pub card_function: CardFunction,
    /// Parameters of the CANsync card. If they are omitted, the card has [`DriveConfig::standard_mapping`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zk: Option<ZkParameters>,
    /// Time of uninterrupted SYNC until the drive is synchronized, in us (decision D-07).
    #[serde(default = "default_lock_time_us")]
    pub lock_time_us: u64,
    /// Time without SYNC until the drive is no longer synchronized, in us (manual 5.00005.03a p. 135). Left
    /// out: two and a half intervals; see [`SyncLock`](crate::devices::cansync::frames::SyncLock).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sync_loss_us: Option<u64>,
    /// Reaction of the drive if the SYNC signal or reference values are missing.
    #[serde(default)]
    pub monitoring: CardMonitoring,
    /// State after power-on.
    #[serde(default)]
    pub enable: Enable,
    /// Largest change of the speed per second, in increments of the speed format, 1 to 4294967295. If it is omitted,
    /// the speed takes the value of its reference at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ramp_per_second: Option<NonZeroU32>,
    /// Numbers of built-in parameters for which the available manuals give no number.
    #[serde(default)]
    pub numbers: ParameterNumbers,
    /// Further parameters.
    #[serde(default)]
    pub parameters: Vec<ParameterSpec>,
}

/// Numbers of the built-in doubleword parameters. The numbers are inferred, because the drive's own manual (5.95036) is
/// not available.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with the numbers of parameters")]
pub struct ParameterNumbers {
    /// Speed reference value, signed, in increments of the drive's own speed format.
    pub speed_reference: u16,
    /// Number of the parameter with the actual value of the speed, in the unit of the speed reference value; read only.
    pub speed_actual: u16,
    /// Additional reference value. The drive stores it, but it has no other effect.
    pub additional_reference: u16,
}

impl Default for ParameterNumbers {
    fn default() -> Self {
        ParameterNumbers { speed_reference: 300, speed_actual: 301, additional_reference: 302 }
    }
}

const fn default_lock_time_us() -> u64 {
    1_000_000
}

impl DriveConfig {
    /// Returns the drive of the built-in plant: standard mapping, enabled at power-on, no ramp.
    pub fn demo(name: impl Into<String>, slave_number: u8) -> Self {
        DriveConfig {
            name: name.into(),
            slave_number,
            kbit_s: None,
            card_function: CardFunction::default(),
            zk: None,
            lock_time_us: default_lock_time_us(),
            sync_loss_us: None,
            monitoring: CardMonitoring::default(),
            enable: Enable::default(),
            ramp_per_second: None,
            numbers: ParameterNumbers::default(),
            parameters: Vec::new(),
        }
    }

    /// Returns the mapping of a drive without `zk`:
    ///
    /// | frame | words 0-1 | word 2 |
    /// |---|---|---|
    /// | WRC1 | speed reference value | |
    /// | RDC1 | speed actual value | status word |
    /// | WRC2 | additional reference value | |
    /// | RDC2 | additional reference value | |
    pub fn standard_mapping(&self) -> ZkParameters {
        let format = ParamFormat::Doubleword;
        let reference =
            |channel| ReferenceMapping { word: 0, channel, format, source: Source::Master }.to_zk();
        let actual = |channel| ActualMapping { word: 0, channel, format }.to_zk();
        let status = ActualMapping { word: 2, channel: Channel::One, format: ParamFormat::Word };
        ZkParameters {
            zk_0: self.numbers.speed_reference,
            zk_1: self.numbers.additional_reference,
            zk_4: reference(Channel::One),
            zk_5: reference(Channel::Two),
            zk_16: self.numbers.speed_actual,
            zk_17: self.numbers.additional_reference,
            zk_20: actual(Channel::One),
            zk_21: actual(Channel::Two),
            zk_24: 0,
            zk_25: status.to_zk(),
            zk_26: 0,
        }
    }

    /// Returns the effective mapping.
    pub fn mapping(&self) -> ZkParameters {
        self.zk.unwrap_or_else(|| self.standard_mapping())
    }
}

/// A drive in the plant file that cannot be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DriveError {
    /// Slave number above 31.
    #[error("drive {drive}: slave number {number} is above 31")]
    SlaveNumber {
        /// Name of the drive with the invalid slave number.
        drive: String,
        /// Slave number above 31.
        number: u8,
    },
    /// The card does not run at the bus's baud rate (manual 5.01010.01 p. 10).
    #[error(
        "drive {drive}: card_function {} does not run at {kbit_s} kbit/s; 0 runs at 125, 250, 500 and 1000, 1 at 125, 250 and 500",
        u8::from(*.function)
    )]
    Rate {
        /// Name of the drive with the invalid baud rate.
        drive: String,
        /// Function of the drive's card.
        function: CardFunction,
        /// Baud rate that its switches are set to.
        kbit_s: u16,
    },
    /// A parameter definition is wrong.
    #[error("drive {drive}: parameter {number}: {reason}")]
    Parameter {
        /// Name of the drive with the invalid parameter.
        drive: String,
        /// Number of the invalid parameter.
        number: u16,
        /// Reason why the drive cannot have the parameter.
        reason: ParameterError,
    },
    /// A card parameter has a wrong value.
    #[error("drive {drive}: ZK {zk} = 16#{value:04X}: {reason}")]
    Zk {
        /// Name of the drive with the invalid card parameter.
        drive: String,
        /// Number of the card parameter.
        zk: u8,
        /// Value of the card parameter.
        value: u16,
        /// Reason why the card parameter cannot have the value.
        reason: ZkError,
    },
}

impl From<DriveError> for BuildError {
    fn from(error: DriveError) -> Self {
        let (DriveError::SlaveNumber { drive, .. }
        | DriveError::Rate { drive, .. }
        | DriveError::Parameter { drive, .. }
        | DriveError::Zk { drive, .. }) = &error;
        let at = match &error {
            DriveError::SlaveNumber { .. } => "slave_number".to_owned(),
            DriveError::Rate { .. } => "card_function".to_owned(),
            DriveError::Parameter { .. } => "parameters".to_owned(),
            DriveError::Zk { zk, .. } => format!("zk.zk_{zk}"),
        };
        BuildError::own(drive, &at, error.to_string())
    }
}

/// Reason why the value of a card parameter is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ZkError {
    /// A bit pattern outside the table.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// Control word or status word. They cannot be mapped, because they are transmitted in another way (p.
    /// 14).
    #[error("parameter {0} cannot be mapped: 120 is sent by action command, 121 is mapped by ZK 25")]
    ControlOrStatusWord(u16),
    /// The drive has no such parameter.
    #[error("the drive has no parameter {0}")]
    NoParameter(u16),
    /// A reference value for a parameter that only the drive writes.
    #[error("parameter {0} cannot be written")]
    ReadOnly(u16),
    /// Mapping and parameter differ in width.
    #[error("parameter {0} has the other format (bit 6: 0 word, 1 doubleword)")]
    Format(u16),
    /// A drive does not receive its own frames.
    #[error("reference value from the drive's own actual value frame")]
    OwnFrame,
    /// Two actual values use the same word.
    #[error("ZK {0} already uses the words")]
    Overlap(u8),
    /// The delay exceeds the table of p. 16.
    #[error("the delay is above 3 intervals")]
    Delay,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cansync::drive::Reaction;

    #[test]
    fn two_lines_make_the_demo_drive() {
        let config: DriveConfig = toml::from_str("name = \"a\"\nslave_number = 3").unwrap();
        assert_eq!(config, DriveConfig::demo("a", 3));
        let zk = config.mapping();
        assert_eq!((zk.zk_0, zk.zk_4, zk.zk_16, zk.zk_20, zk.zk_25), (300, 0x0041, 301, 0x0041, 0x0005));
        assert_eq!((zk.zk_1, zk.zk_5, zk.zk_17, zk.zk_21), (302, 0x0049, 302, 0x0049));
    }

    #[test]
    fn a_given_zk_table_replaces_the_standard_mapping() {
        let config: DriveConfig =
            toml::from_str("name = \"a\"\nslave_number = 3\nzk = { zk_26 = 1 }").unwrap();
        assert_eq!(config.mapping(), ZkParameters { zk_26: 1, ..ZkParameters::default() });
    }

    #[test]
    fn misspelt_keys_are_refused() {
        for text in [
            "lock_time = 3",
            "card_function = 2",
            "zk = { zk_2 = 1 }",
            "numbers = { speed = 1 }",
            "ramp_per_second = 0",
        ] {
            let text = format!("name = \"a\"\nslave_number = 3\n{text}");
            assert!(toml::from_str::<DriveConfig>(&text).is_err(), "{text}");
        }
    }

    #[test]
    fn survives_a_round_trip() {
        let mut config = DriveConfig::demo("a", 3);
        config.zk = Some(config.standard_mapping());
        config.ramp_per_second = NonZeroU32::new(5);
        config.enable = Enable::ByControlWord;
        config.monitoring.sync.reaction = Reaction::Inhibit;
        config.parameters = vec![ParameterSpec { min: Some(-5), ..ParameterSpec::new(9, ParamFormat::Word) }];
        let text = toml::to_string(&config).unwrap();
        assert_eq!(toml::from_str(&text), Ok(config), "{text}");
    }

    #[test]
    fn errors_name_drive_and_card_parameter() {
        let error = DriveError::Zk {
            drive: "winder".into(),
            zk: 0,
            value: 120,
            reason: ZkError::ControlOrStatusWord(120),
        };
        assert!(error.to_string().starts_with("drive winder: ZK 0 = 16#0078: parameter 120"), "{error}");
    }
}
