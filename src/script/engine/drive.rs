//! The verb about drives.

use super::Verbs;
use super::fields::map;

impl Verbs {
    pub(super) fn drives(&mut self) {
        self.on("drive", |stage| move |name: &str| stage.act(|bench| bench.drive_fields(name).map(map)));
    }
}
