//! Registers that changed their value: shown by `watch` and `diff`.

use super::error::CliError;
use super::peek::RegisterReading;
use super::table::{self, Row};
use crate::journal::Changed;
use crate::layout::{DeviceFit, RegisterRef};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Returns the register of a reported change, with the name valid at that time; `None` if no register of this width
/// begins there.
pub(super) fn register(fitted: &DeviceFit, what: &Changed) -> Option<RegisterRef> {
    let address = fitted.device().at(what.how.width, what.offset);
    let found = fitted.registers_at(address, Some(what.how.live)).ok()?;
    found.into_iter().find(|register| register.address() == address)
}

/// Value of a register for comparison; also an entry of a dump in JSON.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
pub(crate) struct RegisterValue {
    pub plc: String,
    /// Name of the register, with the PLC if the instance has several; the address if there is no register.
    pub register: String,
    pub address: String,
    /// The bit pattern in IEC notation.
    pub hex: String,
    pub meaning: String,
}

impl From<RegisterReading> for RegisterValue {
    fn from(holding: RegisterReading) -> Self {
        let RegisterReading { plc, register, address, hex, meaning, .. } = holding;
        RegisterValue { plc, register, address, hex, meaning }
    }
}

/// A register with different values before and after.
#[derive(Debug, Serialize, PartialEq, Eq)]
pub(crate) struct Change {
    pub plc: String,
    /// Name of the register, with the PLC if the instance has several; the address if there is no register.
    pub register: String,
    pub address: String,
    /// The earlier value in IEC notation; `None` if the register was absent.
    pub before: Option<String>,
    /// The later value; `None` if the register is absent now.
    pub after: Option<String>,
    /// The meaning of the later value.
    pub meaning: String,
}

/// Placeholder for the value of an absent register.
const ABSENT: &str = "-";

impl Row for Change {
    const COLUMNS: &'static [&'static str] = &["plc", "register", "address", "before", "after", "meaning"];

    fn cells(&self) -> Vec<String> {
        let value = |value: &Option<String>| value.clone().unwrap_or_default();
        vec![
            self.plc.clone(),
            self.register.clone(),
            self.address.clone(),
            value(&self.before),
            value(&self.after),
            self.meaning.clone(),
        ]
    }
}

/// Formats changes as lines of text: `node2.w_OPTION_STATUS  %MW3.200002  16#0001 -> 16#0002  waiting for ...`.
pub(crate) fn text(changes: &[Change]) -> String {
    let cells = |change: &Change| {
        vec![change.register.clone(), change.address.clone(), values(change), change.meaning.clone()]
    };
    table::columns(&changes.iter().map(cells).collect::<Vec<_>>())
}

/// `16#0001 -> 16#0002`
pub(crate) fn values(change: &Change) -> String {
    let value = |value: &Option<String>| value.clone().unwrap_or_else(|| ABSENT.to_owned());
    format!("{} -> {}", value(&change.before), value(&change.after))
}

/// Register values by PLC and name.
pub(crate) struct RegisterValues(BTreeMap<(String, String), RegisterValue>);

impl RegisterValues {
    /// If several entries have the same name, the last one is kept.
    pub(crate) fn new(registers: impl IntoIterator<Item = RegisterValue>) -> Self {
        RegisterValues(
            registers.into_iter().map(|held| ((held.plc.clone(), held.register.clone()), held)).collect(),
        )
    }

    /// True if the values contain this register.
    pub(crate) fn has(&self, held: &RegisterValue) -> bool {
        self.0.contains_key(&(held.plc.clone(), held.register.clone()))
    }

    /// Returns the registers of `after` that are new or have another value, in their order.
    pub(crate) fn changed<'a>(&self, after: impl IntoIterator<Item = &'a RegisterValue>) -> Vec<Change> {
        let change = |now: &RegisterValue| {
            let before = self.0.get(&(now.plc.clone(), now.register.clone()));
            let differs = before.is_none_or(|before| before.hex != now.hex);
            differs.then(|| Change {
                plc: now.plc.clone(),
                register: now.register.clone(),
                address: now.address.clone(),
                before: before.map(|before| before.hex.clone()),
                after: Some(now.hex.clone()),
                meaning: now.meaning.clone(),
            })
        };
        after.into_iter().filter_map(change).collect()
    }

    /// Returns the registers of `before` that these values do not contain, in their order.
    pub(crate) fn missing(&self, before: &[RegisterValue]) -> Vec<Change> {
        let change = |held: &RegisterValue| Change {
            plc: held.plc.clone(),
            register: held.register.clone(),
            address: held.address.clone(),
            before: Some(held.hex.clone()),
            after: None,
            meaning: String::new(),
        };
        before.iter().filter(|held| !self.has(held)).map(change).collect()
    }
}

/// Parses a dump in JSON.
///
/// # Errors
/// `text` is not a dump; `name` identifies it in the message.
pub(crate) fn parse(name: &str, text: &str) -> Result<Vec<RegisterValue>, CliError> {
    serde_json::from_str(text)
        .map_err(|error| CliError::NoDump { name: name.to_owned(), reason: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(register: &str, hex: &str) -> RegisterValue {
        let [plc, address, meaning] = ["line", "%MB3.0", ""].map(str::to_owned);
        RegisterValue { plc, register: register.to_owned(), address, hex: hex.to_owned(), meaning }
    }

    fn summary(changes: &[Change]) -> Vec<(&str, Option<&str>, Option<&str>)> {
        changes.iter().map(|it| (&*it.register, it.before.as_deref(), it.after.as_deref())).collect()
    }

    #[test]
    fn new_and_changed_registers_are_reported_in_their_order() {
        let before = RegisterValues::new([held("a", "16#01"), held("b", "16#02")]);
        let after = [held("c", "16#03"), held("b", "16#04"), held("a", "16#01")];
        let changes = before.changed(&after);
        assert_eq!(summary(&changes), [("c", None, Some("16#03")), ("b", Some("16#02"), Some("16#04"))]);
        assert_eq!(text(&changes), "c  %MB3.0  - -> 16#03\nb  %MB3.0  16#02 -> 16#04\n");
    }

    #[test]
    fn missing_registers_are_reported() {
        let missing = RegisterValues::new([held("b", "16#09")]).missing(&[
            held("c", "16#03"),
            held("b", "16#02"),
            held("a", "16#01"),
        ]);
        assert_eq!(summary(&missing), [("c", Some("16#03"), None), ("a", Some("16#01"), None)]);
    }

    #[test]
    fn one_name_at_two_plcs_means_two_registers() {
        let other = RegisterValue { plc: "other".to_owned(), ..held("a", "16#02") };
        assert_eq!(RegisterValues::new([held("a", "16#01")]).changed([&other]).len(), 1);
    }

    #[test]
    fn a_text_that_is_not_a_dump_is_refused() {
        let refused = parse("x.json", "[{}]").unwrap_err().to_string();
        assert!(refused.contains("x.json") && refused.contains("missing field"), "{refused}");
    }
}
