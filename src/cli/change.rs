//! Registers that hold something else than before: what `watch` and `diff` show.

use super::error::CliError;
use super::peek::Holding;
use super::table::{self, Row};
use crate::journal::Changed;
use crate::layout::{DeviceFit, RegisterRef};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The register of a change that an emulator tells, with the name that it had then; `None` if none of this width begins there.
pub(super) fn register(fitted: &DeviceFit, what: &Changed) -> Option<RegisterRef> {
    let address = fitted.device().at(what.how.width, what.offset);
    let found = fitted.registers_at(address, Some(what.how.live)).ok()?;
    found.into_iter().find(|register| register.address() == address)
}

/// What is compared of a register; also how a dump in JSON is read back.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
pub(crate) struct Held {
    /// The PLC.
    pub plc: String,
    /// Name of the register with the PLC if need be, else the address.
    pub register: String,
    /// The address.
    pub address: String,
    /// The bit pattern in IEC notation.
    pub hex: String,
    /// The meaning.
    pub meaning: String,
}

impl From<Holding> for Held {
    fn from(holding: Holding) -> Self {
        let Holding { plc, register, address, hex, meaning, .. } = holding;
        Held { plc, register, address, hex, meaning }
    }
}

/// A register that differs.
#[derive(Debug, Serialize, PartialEq, Eq)]
pub(crate) struct Change {
    /// The PLC.
    pub plc: String,
    /// Name of the register with the PLC if need be, else the address.
    pub register: String,
    /// The address.
    pub address: String,
    /// What it held, in IEC notation; nothing if it was not there.
    pub before: Option<String>,
    /// What it holds; nothing if it is no longer there.
    pub after: Option<String>,
    /// What this means.
    pub meaning: String,
}

/// Stands for a value that is not there.
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

/// Lines for people: `node2.w_OPTION_STATUS  %MW3.200002  16#0001 -> 16#0002  waiting for ...`.
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

/// Registers by PLC and name.
pub(crate) struct Known(BTreeMap<(String, String), Held>);

impl Known {
    /// Of registers with one name the last one counts.
    pub(crate) fn new(registers: impl IntoIterator<Item = Held>) -> Self {
        Known(registers.into_iter().map(|held| ((held.plc.clone(), held.register.clone()), held)).collect())
    }

    /// Whether the register is among them.
    pub(crate) fn has(&self, held: &Held) -> bool {
        self.0.contains_key(&(held.plc.clone(), held.register.clone()))
    }

    /// Those of `after` that are new or hold something else, in their order.
    pub(crate) fn changed<'a>(&self, after: impl IntoIterator<Item = &'a Held>) -> Vec<Change> {
        let change = |now: &Held| {
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

    /// Those of `before` that are not among them, in their order.
    pub(crate) fn missing(&self, before: &[Held]) -> Vec<Change> {
        let change = |held: &Held| Change {
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

/// The registers of a dump in JSON.
///
/// # Errors
/// `text` is none; `name` is what it is called.
pub(crate) fn parse(name: &str, text: &str) -> Result<Vec<Held>, CliError> {
    serde_json::from_str(text)
        .map_err(|error| CliError::NoDump { name: name.to_owned(), reason: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(register: &str, hex: &str) -> Held {
        let [plc, address, meaning] = ["line", "%MB3.0", ""].map(str::to_owned);
        Held { plc, register: register.to_owned(), address, hex: hex.to_owned(), meaning }
    }

    fn told(changes: &[Change]) -> Vec<(&str, Option<&str>, Option<&str>)> {
        changes.iter().map(|it| (&*it.register, it.before.as_deref(), it.after.as_deref())).collect()
    }

    #[test]
    fn new_and_changed_registers_are_told_in_their_order_and_equal_ones_are_not() {
        let before = Known::new([held("a", "16#01"), held("b", "16#02")]);
        let after = [held("c", "16#03"), held("b", "16#04"), held("a", "16#01")];
        let changes = before.changed(&after);
        assert_eq!(told(&changes), [("c", None, Some("16#03")), ("b", Some("16#02"), Some("16#04"))]);
        assert_eq!(text(&changes), "c  %MB3.0  - -> 16#03\nb  %MB3.0  16#02 -> 16#04\n");
    }

    #[test]
    fn missing_registers_are_told() {
        let missing = Known::new([held("b", "16#09")]).missing(&[
            held("c", "16#03"),
            held("b", "16#02"),
            held("a", "16#01"),
        ]);
        assert_eq!(told(&missing), [("c", Some("16#03"), None), ("a", Some("16#01"), None)]);
    }

    #[test]
    fn one_name_at_two_plcs_is_two_registers() {
        let other = Held { plc: "other".to_owned(), ..held("a", "16#02") };
        assert_eq!(Known::new([held("a", "16#01")]).changed([&other]).len(), 1);
    }

    #[test]
    fn what_is_no_dump_is_refused() {
        let refused = parse("x.json", "[{}]").unwrap_err().to_string();
        assert!(refused.contains("x.json") && refused.contains("missing field"), "{refused}");
    }
}
