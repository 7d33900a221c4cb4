//! Buses, their doors and guests in JSON.

use super::InJson;
use crate::door::GuestState;
use crate::journal::Names;
use crate::request::{BusState, RateMismatch, Station};
use serde::Serialize;

/// A rate in kbit/s; serialized as an integer if it is a whole number.
#[derive(Clone, Copy, Serialize)]
#[serde(untagged)]
pub(crate) enum Rate {
    Whole(u32),
    Broken(f64),
}

impl Rate {
    pub(crate) fn of(bit_s: u32) -> Self {
        if bit_s.is_multiple_of(1000) {
            Rate::Whole(bit_s / 1000)
        } else {
            Rate::Broken(f64::from(bit_s) / 1000.0)
        }
    }
}

/// A station with another bit rate.
#[derive(Serialize)]
pub(crate) struct StrangerEntry {
    pub name: String,
    pub kbit_s: Rate,
}

impl From<&RateMismatch> for StrangerEntry {
    fn from(state: &RateMismatch) -> Self {
        StrangerEntry { name: state.name.clone(), kbit_s: Rate::of(state.bit_s) }
    }
}

/// A guest at a door.
#[derive(Serialize)]
pub(crate) struct GuestEntry {
    pub guest: u8,
    door: String,
    open: bool,
    kbit_s: Option<Rate>,
    pub seat: bool,
    pub dropped: u64,
    pub refused: u64,
}

impl From<&GuestState> for GuestEntry {
    fn from(state: &GuestState) -> Self {
        GuestEntry {
            guest: state.guest,
            door: state.door.to_string(),
            open: state.open,
            kbit_s: state.bit_s.map(Rate::of),
            seat: state.seat,
            dropped: state.dropped,
            refused: state.refused,
        }
    }
}

/// A bus with its doors, guests and stations.
#[derive(Serialize)]
pub(crate) struct BusEntry {
    pub bus: String,
    pub kind: String,
    pub kbit_s: Rate,
    pub doors: Vec<String>,
    pub sent_away: u64,
    pub guests: Vec<GuestEntry>,
    pub stations: Vec<Station>,
    pub other_rates: Vec<StrangerEntry>,
}

impl From<&BusState> for BusEntry {
    fn from(state: &BusState) -> Self {
        BusEntry {
            bus: state.name.clone(),
            kind: state.kind.clone(),
            kbit_s: Rate::of(state.bit_s),
            doors: state.doors.iter().map(|door| door.door.to_string()).collect(),
            sent_away: state.doors.iter().map(|door| door.refused).sum(),
            guests: state.doors.iter().flat_map(|door| &door.guests).map(GuestEntry::from).collect(),
            stations: state.stations.clone(),
            other_rates: state.strangers.iter().map(StrangerEntry::from).collect(),
        }
    }
}

/// A bus with its doors, guests, stations, load and ports.
#[derive(Serialize)]
struct BusJson<'a> {
    #[serde(flatten)]
    entry: BusEntry,
    load_percent: Option<f64>,
    ports: &'a [String],
}

impl<'a> From<&'a BusState> for BusJson<'a> {
    fn from(state: &'a BusState) -> Self {
        BusJson {
            entry: BusEntry::from(state),
            load_percent: state.load_permille.map(|load| f64::from(load) / 10.0),
            ports: &state.ports,
        }
    }
}

impl InJson for Vec<BusState> {
    fn form(&self, _: &Names) -> impl Serialize {
        self.iter().map(BusJson::from).collect::<Vec<_>>()
    }
}
