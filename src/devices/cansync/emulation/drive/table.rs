//! The parameters of every drive, compiled from `layouts/v-regler/parameters.toml`.

use super::parameters::{ParamFormat, ParameterSpec};

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
    /// Page of the manual that names the parameter, or the decision from which it is `inferred`.
    pub source: &'static str,
    /// Duration of the recalculation after a write, in us. The parameter is not available during this time.
    pub settle_us: u32,
}

include!(concat!(env!("OUT_DIR"), "/v_regler.rs"));

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
