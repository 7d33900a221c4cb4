//! The content of `handshakes.toml`. Its values are not checked here.

use crate::time;
use commram_layoutc::model::Provenance;
use serde::Deserialize;
use toml::Spanned;

/// The file: lists of tables, each for one kind of behaviour.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    #[serde(default)]
    pub(super) ready: Vec<Ready>,
    #[serde(default)]
    pub(super) answer: Vec<Answer>,
    #[serde(default)]
    pub(super) toggle: Vec<Toggle>,
    #[serde(default)]
    pub(super) counter: Vec<Counter>,
    #[serde(default)]
    pub(super) watchdog: Vec<Watchdog>,
    #[serde(default)]
    pub(super) mirror: Vec<Mirror>,
    pub(super) process_image: Option<Image>,
    #[serde(default)]
    pub(super) record: Vec<Spanned<Record>>,
    #[serde(default)]
    pub(super) fault: Vec<Spanned<Fault>>,
}

/// A ready flag: registers that change at a given time after power-on.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ready {
    #[serde(default)]
    pub(super) after: Time,
    pub(super) state: Vec<Spanned<Change>>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// Answer to a value of a register.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Answer {
    pub(super) register: Spanned<String>,
    pub(super) request: Spanned<u32>,
    pub(super) answer: Spanned<u32>,
    #[serde(default)]
    pub(super) after: Time,
    /// Value that follows the answer.
    pub(super) then: Option<Spanned<u32>>,
    pub(super) then_after: Option<Spanned<Time>>,
    #[serde(default)]
    pub(super) state: Vec<Spanned<Change>>,
    /// Fault that disturbs this behaviour while it acts.
    pub(super) unless_fault: Option<Spanned<String>>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// Bits of the register `acknowledge` that the device makes equal to the bits of `register` at the same
/// positions, after a time.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Toggle {
    pub(super) register: Spanned<String>,
    pub(super) acknowledge: Spanned<String>,
    pub(super) bits: Spanned<u32>,
    #[serde(default)]
    pub(super) after: Time,
    /// Fault that disturbs this behaviour while it acts.
    pub(super) unless_fault: Option<Spanned<String>>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// A register that counts time.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Counter {
    pub(super) register: Spanned<String>,
    pub(super) every: Spanned<Time>,
    /// Fault that disturbs this behaviour while it acts.
    pub(super) unless_fault: Option<Spanned<String>>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// A register that the program must change.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Watchdog {
    pub(super) register: Spanned<String>,
    pub(super) within: Spanned<Time>,
    pub(super) state: Vec<Spanned<Change>>,
    #[serde(default)]
    pub(super) recovered: Vec<Spanned<Change>>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// Registers that always get the values of other registers.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mirror {
    pub(super) from: Spanned<String>,
    pub(super) to: Spanned<String>,
    /// Fault that disturbs this behaviour while it acts.
    pub(super) unless_fault: Option<Spanned<String>>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// Registers that the master at the PROFIBUS port exchanges with its slaves.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Image {
    pub(super) outputs: Spanned<String>,
    pub(super) inputs: Spanned<String>,
    pub(super) run: Spanned<String>,
    pub(super) slaves: Spanned<String>,
    pub(super) active: Spanned<String>,
    pub(super) page: String,
    pub(super) source: Provenance,
}

/// A kind of journal record that the script writes.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Record {
    pub(super) name: String,
    pub(super) text: String,
    #[serde(default)]
    pub(super) fields: Vec<String>,
    pub(super) page: String,
}

/// A kind of fault that the device can have.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Fault {
    pub(super) name: String,
    pub(super) text: String,
    #[serde(default)]
    pub(super) fields: Vec<FaultField>,
    pub(super) page: String,
}

/// A number in the description of a fault.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaultField {
    pub(super) name: String,
    pub(super) text: String,
    #[serde(default)]
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) default: Option<u32>,
}

/// A change of a register: a value, or bits to set and to clear.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Change {
    pub(super) register: String,
    pub(super) value: Option<u32>,
    #[serde(default)]
    pub(super) set: u32,
    #[serde(default)]
    pub(super) clear: u32,
}

/// An emulated time in microseconds, written as `500us`.
#[derive(Deserialize, Clone, Copy, Default)]
#[serde(try_from = "String")]
pub(super) struct Time(pub(super) u64);

impl TryFrom<String> for Time {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        time::parse(&text).map(Time).map_err(|reason| format!("`{text}` is no time: {reason}"))
    }
}

/// Returns the known keys of a table. The reader lists them in its error about an unknown key.
#[cfg(feature = "cli")]
pub(in crate::devices::folder) fn keys(table: &str) -> Vec<String> {
    fn of<T: serde::de::DeserializeOwned>() -> Vec<String> {
        let error = toml::from_str::<T>("no_such_key = 1").err();
        let message = error.as_ref().map_or("", toml::de::Error::message);
        let known = message.split_once("`no_such_key`, expected ").map_or("", |(_, known)| known);
        known.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    }
    match table {
        "" => of::<File>(),
        "ready" => of::<Ready>(),
        "answer" => of::<Answer>(),
        "toggle" => of::<Toggle>(),
        "counter" => of::<Counter>(),
        "watchdog" => of::<Watchdog>(),
        "mirror" => of::<Mirror>(),
        "process_image" => of::<Image>(),
        "record" => of::<Record>(),
        "fault" => of::<Fault>(),
        "fields" => of::<FaultField>(),
        "state" | "recovered" => of::<Change>(),
        _ => Vec::new(),
    }
}
