//! Faults in JSON.

use super::InJson;
use crate::fault::{FaultSpec, FaultStatus};
use crate::journal::Names;
use serde::Serialize;

/// A fault with its state; kind, place and values are those of a plant file.
#[derive(Serialize)]
pub(crate) struct FaultJson {
    pub number: u16,
    /// State of the fault: `waiting` or `acting`.
    pub state: &'static str,
    pub hits: u32,
    #[serde(flatten)]
    fault: FaultSpec,
}

impl FaultJson {
    /// Converts `status`, with these names of PLCs and buses.
    pub(crate) fn new(status: &FaultStatus, names: &Names) -> Self {
        FaultJson {
            number: status.id,
            state: if status.acting { "acting" } else { "waiting" },
            hits: status.hits,
            fault: FaultSpec::of(&status.fault, names),
        }
    }
}

impl InJson for Vec<FaultStatus> {
    fn form(&self, names: &Names) -> impl Serialize {
        self.iter().map(|status| FaultJson::new(status, names)).collect::<Vec<_>>()
    }
}
