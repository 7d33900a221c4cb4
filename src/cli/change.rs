//! Registers that changed their value: shown by `watch` and `diff`.

use super::error::CliError;
use super::peek::RegisterReading;
use super::table::{self, Row};
use crate::journal::Changed;
use crate::layout::{DeviceFit, RegisterRef};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Returns the register of a reported change, with the name that was valid at the time of the change. `None` if no
/// register of this width begins at the address.
pub(super) fn register(fitted: &DeviceFit, what: &Changed) -> Option<RegisterRef> {
    let address = fitted.device().at(what.how.width, what.offset);
    let found = fitted.registers_at(address, Some(what.how.live)).ok()?;
    found.into_iter().find(|register| register.address() == address)
}

/// Value of a register for comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
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
    /// Value after the change; `None` if the register no longer exists.
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

/// Formats the values of a change: `16#0001 -> 16#0002`.
pub(crate) fn values(change: &Change) -> String {
    let value = |value: &Option<String>| value.clone().unwrap_or_else(|| ABSENT.to_owned());
    format!("{} -> {}", value(&change.before), value(&change.after))
}

/// Register values by PLC and name.
pub(crate) struct RegisterValues(BTreeMap<(String, String), RegisterValue>);

impl RegisterValues {
    pub(crate) fn new(registers: impl IntoIterator<Item = RegisterValue>) -> Self {
        RegisterValues(
            registers.into_iter().map(|held| ((held.plc.clone(), held.register.clone()), held)).collect(),
        )
    }

    /// True if the values contain this register.
    pub(crate) fn has(&self, held: &RegisterValue) -> bool {
        self.0.contains_key(&(held.plc.clone(), held.register.clone()))
    }

    /// Returns the registers of `after` that are new or have another value, in the order of `after`.
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

    /// Returns the registers of `before` that these values do not contain, in the order of `before`.
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

/// The compared fields of an entry of a dump in JSON.
#[derive(Deserialize)]
struct DumpEntry {
    plc: String,
    register: String,
    address: String,
    /// The value as a number. `None` if another program has written the dump and omitted the number.
    value: Option<i64>,
    hex: String,
    meaning: String,
}

impl DumpEntry {
    /// Converts the entry.
    ///
    /// # Errors
    /// The bit pattern is malformed, or differs from `value`.
    fn checked(self) -> Result<RegisterValue, String> {
        let DumpEntry { plc, register, address, value, hex, meaning } = self;
        let digits = hex.strip_prefix("16#").filter(|digits| [2, 4, 8].contains(&digits.len()));
        let bits = digits.and_then(|digits| Some((4 * digits.len(), i64::from_str_radix(digits, 16).ok()?)));
        let Some((width, bits)) = bits.filter(|(_, bits)| *bits >= 0) else {
            return Err(format!("{register}: hex `{hex}`: write 16# and 2, 4 or 8 digits, such as 16#0043"));
        };
        // The number of a signed register is negative if the highest bit is set. So both forms of the bit pattern are
        // accepted.
        if value.is_some_and(|value| value != bits && value != bits - (1 << width)) {
            let value = value.unwrap_or_default();
            return Err(format!("{register}: value {value} and hex {hex} are different values"));
        }
        Ok(RegisterValue { plc, register, address, hex: hex.to_ascii_uppercase(), meaning })
    }
}

/// Parses a dump in JSON.
///
/// # Errors
/// `text` is not a dump, or contradicts itself; `name` identifies it in the message.
pub(crate) fn parse(name: &str, text: &str) -> Result<Vec<RegisterValue>, CliError> {
    let refuse = |reason| CliError::NoDump { name: name.to_owned(), reason };
    let entries: Vec<DumpEntry> = serde_json::from_str(text).map_err(|error| refuse(error.to_string()))?;
    let entries = entries.into_iter().map(DumpEntry::checked).collect::<Result<Vec<_>, _>>();
    let entries = entries.map_err(refuse)?;
    check_consistency(&entries).map_err(refuse)?;
    Ok(entries)
}

/// Refuses a register with two values or addresses, and an address with two values.
fn check_consistency(entries: &[RegisterValue]) -> Result<(), String> {
    let mut seen: BTreeMap<(&str, &str), &RegisterValue> = BTreeMap::new();
    for entry in entries {
        for key in [&entry.register, &entry.address] {
            let earlier = match seen.entry((&entry.plc, key)) {
                Entry::Vacant(place) => *place.insert(entry),
                Entry::Occupied(place) => *place.get(),
            };
            if earlier.hex != entry.hex {
                let (first, second) = (&earlier.hex, &entry.hex);
                return Err(format!("{key} has two values, {first} and {second}"));
            }
            if earlier.register == entry.register && earlier.address != entry.address {
                let (first, second) = (&earlier.address, &entry.address);
                return Err(format!("{key} has two addresses, {first} and {second}"));
            }
        }
    }
    Ok(())
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
    fn contradictory_entries_are_refused() {
        let entry = |register: &str, address: &str, value: &str, hex: &str| {
            format!(
                r#"{{"plc":"line","register":"{register}","address":"{address}",{value}"hex":"{hex}","meaning":""}}"#
            )
        };
        let parsed =
            |entries: &[String]| parse("x.json", &format!("[{}]", entries.join(","))).map(|it| it.len());
        let one = entry("a", "%MB3.1", "\"value\":67,", "16#43");
        let same = entry("b", "%MB3.1", "", "16#43");
        assert_eq!(parsed(&[one.clone(), one.clone(), same.clone()]).unwrap(), 3);
        assert!(parsed(&[entry("a", "%MW3.2", "\"value\":-2,", "16#fffe")]).is_ok());
        assert!(parsed(&[entry("a", "%MW3.2", "\"value\":65534,", "16#FFFE")]).is_ok());
        for (entries, reason) in [
            (
                &[entry("a", "%MB3.1", "\"value\":68,", "16#43")][..],
                "a: value 68 and hex 16#43 are different values",
            ),
            (
                &[entry("a", "%MB3.1", "\"value\":323,", "16#43")],
                "a: value 323 and hex 16#43 are different values",
            ),
            (&[entry("a", "%MB3.1", "", "43")], "a: hex `43`: write 16# and 2, 4 or 8 digits"),
            (&[entry("a", "%MB3.1", "", "16#-1")], "a: hex `16#-1`: write 16#"),
            (&[one.clone(), entry("a", "%MB3.1", "", "16#44")], "a has two values, 16#43 and 16#44"),
            (&[one.clone(), entry("b", "%MB3.1", "", "16#44")], "%MB3.1 has two values, 16#43 and 16#44"),
            (&[one.clone(), entry("a", "%MB3.2", "", "16#43")], "a has two addresses, %MB3.1 and %MB3.2"),
        ] {
            let refused = parsed(entries).unwrap_err().to_string();
            assert!(refused.contains("x.json") && refused.contains(reason), "{refused}");
        }
    }

    #[test]
    fn a_text_that_is_not_a_dump_is_refused() {
        let refused = parse("x.json", "[{}]").unwrap_err().to_string();
        assert!(refused.contains("x.json") && refused.contains("missing field"), "{refused}");
    }
}
