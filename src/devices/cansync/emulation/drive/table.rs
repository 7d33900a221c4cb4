//! The parameters of every drive, compiled from `layouts/v-regler/parameters.toml`.

use super::parameters::{ParamFormat, ParameterSpec};
use crate::layout::Provenance;

/// One parameter of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterRow {
    /// Parameter number, 1 to 4095.
    pub number: u16,
    /// Name of the parameter.
    pub name: &'static str,
    /// Width of the parameter: word or doubleword.
    pub format: ParamFormat,
    /// Lowest value. If it is negative, the parameter is signed.
    pub min: i64,
    /// Largest permitted value of the parameter.
    pub max: i64,
    /// Value of the parameter after power-on.
    pub default: u32,
    /// True if only the drive itself writes the parameter.
    pub read_only: bool,
    /// Unit of the value; empty if it has none.
    pub unit: &'static str,
    /// Source of the parameter: its number, name and access.
    pub source: Provenance,
    /// Source of the unit.
    pub unit_from: Provenance,
    /// Source of width, limits and default.
    pub values_from: Provenance,
    /// Duration of the recalculation after a write, in us. The parameter is not available during this time.
    pub settle_us: u32,
}

include!(concat!(env!("OUT_DIR"), "/v_regler.rs"));

impl ParameterRow {
    /// Returns the facts of the parameter with their sources.
    #[must_use]
    pub const fn facts(&self) -> [(&'static str, Provenance); 3] {
        [("parameter", self.source), ("unit", self.unit_from), ("values", self.values_from)]
    }

    /// Returns the manual that names the parameter, and the inferred facts with their decisions.
    fn provenance(&self) -> String {
        let manual = self.source.decision().is_none().then(|| self.source.to_string());
        let inferred = Provenance::inferred(&self.facts()).map(|facts| format!("inferred: {facts}"));
        manual.into_iter().chain(inferred).collect::<Vec<_>>().join("; ")
    }
}

/// Returns the sources of the facts of parameter `name`; `None` if the plant file has added the parameter.
pub(crate) fn parameter_provenance(name: &str) -> Option<String> {
    PARAMETERS.iter().find(|row| row.name == name).map(ParameterRow::provenance)
}

impl From<&ParameterRow> for ParameterSpec {
    fn from(row: &ParameterRow) -> Self {
        ParameterSpec {
            number: row.number,
            format: row.format,
            initial: row.default,
            min: Some(row.min),
            max: Some(row.max),
            read_only: row.read_only,
            settle_us: row.settle_us,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_parameters_are_unique() {
        for row in &PARAMETERS {
            assert_eq!(parameter_provenance(row.name), Some(row.provenance()), "P{}", row.number);
        }
    }

    #[test]
    fn inferred_facts_are_never_shown_as_documented() {
        for (name, provenance) in [
            ("SYNC slot", Some("manual: 5.00005.03a p. 74; inferred: values D-863")),
            (
                "angle reference value (Phi)",
                Some("manual: 5.00005.03a p. 74; inferred: unit D-162, values D-863"),
            ),
            ("speed reference value", Some("inferred: parameter D-27, unit D-162, values D-863")),
            ("", None),
        ] {
            assert_eq!(parameter_provenance(name).as_deref(), provenance, "{name}");
        }
    }
}
