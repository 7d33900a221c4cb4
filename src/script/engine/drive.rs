//! The verb about drives.

use super::{Verbs, int};
use crate::devices::{DriveDetails, DriveState};
use rhai::{INT, Map};

impl Verbs {
    pub(super) fn drives(&mut self) {
        self.on("drive", |stage| move |name: &str| stage.act(|bench| Ok(drive_map(bench.drive(name)?))));
    }
}

/// Creates the map of a drive: `#{state, synchronized, reference, speed, fault, status_word, lost_references, stopped,
/// parameters: #{P167: 2000, ...}}`.
fn drive_map(details: DriveDetails) -> Map {
    let DriveDetails { state: shown, parameters, .. } = details;
    let DriveState { status_word, speed_reference, speed_actual, fault, lost_references, .. } = shown;
    let values =
        parameters.into_iter().map(|it| (format!("P{}", it.number).into(), INT::from(it.value).into()));
    Map::from([
        ("state".into(), shown.state.into()),
        ("synchronized".into(), shown.is_synchronized.into()),
        ("reference".into(), INT::from(speed_reference).into()),
        ("speed".into(), INT::from(speed_actual).into()),
        ("fault".into(), INT::from(fault).into()),
        ("status_word".into(), INT::from(status_word).into()),
        ("lost_references".into(), int(lost_references).into()),
        ("stopped".into(), shown.is_stopped.into()),
        ("parameters".into(), Map::from_iter(values).into()),
    ])
}
