//! Findings of the access checker in JSON.

use super::InJson;
use crate::journal::{Entry, Names, Source};
use crate::layout::plc_prefix;
use serde::Serialize;

/// Findings of one rule at one register.
#[derive(Serialize)]
pub(crate) struct FindingJson {
    pub severity: &'static str,
    pub rule: &'static str,
    /// Name of the PLC; empty for a finding on a bus.
    pub plc: String,
    /// Name of the register. `None` if the entry counts several registers together, because the table had no room for
    /// more entries.
    pub register: Option<String>,
    pub address: Option<String>,
    pub value: i64,
    pub count: u64,
    pub first_us: u64,
    pub last_us: u64,
    pub late_us: Option<u32>,
    pub text: &'static str,
    pub source: &'static str,
    /// Text about this violation, if the rule alone does not describe it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

impl FindingJson {
    /// Converts `entry`, with these names of PLCs and buses.
    pub(crate) fn new(entry: &Entry, names: &Names) -> Self {
        let Entry { last, is_single, count, first_us, last_us, latest_us, ref note } = *entry;
        let (plcs, fitted) = (&names.plcs, names.fitted(last.plc));
        let (plc, prefix) = match last.source() {
            Source::Bus(bus) => {
                let bus = names.buses.get(bus.index()).cloned().unwrap_or_default();
                (String::new(), format!("{bus}:"))
            }
            _ => (plcs.get(last.plc.index()).cloned().unwrap_or_default(), plc_prefix(plcs, last.plc)),
        };
        FindingJson {
            severity: last.rule.severity().name(),
            rule: last.rule.id(),
            register: last.name(fitted).filter(|_| is_single).map(|name| prefix + &name),
            plc,
            address: last.address(fitted).filter(|_| is_single).map(|address| address.to_string()),
            value: last.number(fitted),
            count,
            first_us,
            last_us,
            late_us: Some(latest_us).filter(|late| *late > 0),
            text: last.rule.text(),
            source: last.rule.source(),
            note: note.as_deref().map(str::to_owned),
        }
    }
}

impl InJson for Vec<Entry> {
    fn form(&self, names: &Names) -> impl Serialize {
        self.iter().map(|entry| FindingJson::new(entry, names)).collect::<Vec<_>>()
    }
}
