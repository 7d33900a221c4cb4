//! Drives in JSON.

use super::InJson;
use crate::devices::{DriveDetails, DriveState, ParameterState, parameter_provenance};
use crate::journal::Names;
use crate::request::DriveEntry;
use serde::Serialize;
use std::collections::BTreeMap;

/// State of a drive.
#[derive(Serialize)]
pub(crate) struct StateJson {
    pub number: Option<u8>,
    pub state: String,
    pub synchronized: bool,
    pub reference: i32,
    pub speed: i32,
    pub fault: u32,
    pub status_word: u16,
    pub kbit_s: Option<u16>,
    pub lost_references: u64,
    pub stopped: bool,
}

impl From<DriveState> for StateJson {
    fn from(state: DriveState) -> Self {
        StateJson {
            number: state.number,
            kbit_s: state.kbit_s,
            state: state.state,
            status_word: state.status_word,
            synchronized: state.is_synchronized,
            reference: state.speed_reference,
            speed: state.speed_actual,
            fault: state.fault,
            lost_references: state.lost_references,
            stopped: state.is_stopped,
        }
    }
}

/// A drive of the list.
#[derive(Serialize)]
pub(crate) struct DriveLine {
    pub drive: String,
    pub bus: Option<String>,
    #[serde(flatten)]
    pub state: StateJson,
}

impl From<DriveEntry> for DriveLine {
    fn from(DriveEntry { name, bus, state }: DriveEntry) -> Self {
        DriveLine { drive: name, bus, state: state.into() }
    }
}

/// All details of a drive.
#[derive(Serialize)]
pub(crate) struct DriveJson {
    #[serde(flatten)]
    pub state: StateJson,
    /// Parameters of the drive's interface card, by their numbers.
    pub zk: BTreeMap<u8, u16>,
    pub parameters: Vec<ParameterJson>,
}

/// A parameter of a drive, with the sources of its facts.
#[derive(Serialize)]
pub(crate) struct ParameterJson {
    #[serde(flatten)]
    pub state: ParameterState,
    /// `None` for a parameter that the plant file has added.
    pub provenance: Option<String>,
}

impl From<ParameterState> for ParameterJson {
    fn from(state: ParameterState) -> Self {
        ParameterJson { provenance: parameter_provenance(&state.name), state }
    }
}

impl From<DriveDetails> for DriveJson {
    fn from(DriveDetails { state, parameters, card }: DriveDetails) -> Self {
        let parameters = parameters.into_iter().map(ParameterJson::from).collect();
        DriveJson { state: state.into(), zk: card.into_iter().collect(), parameters }
    }
}

impl InJson for Vec<DriveEntry> {
    fn form(&self, _: &Names) -> impl Serialize {
        self.iter().cloned().map(DriveLine::from).collect::<Vec<_>>()
    }
}

impl InJson for Box<DriveDetails> {
    fn form(&self, _: &Names) -> impl Serialize {
        DriveJson::from(DriveDetails::clone(self))
    }
}
