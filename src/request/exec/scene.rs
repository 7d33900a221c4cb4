//! Present activity of the buses.

use super::Work;
use crate::devices::Bus;
use crate::journal::Source;
use crate::request::{BusScene, Refused, Reply};

impl Work<'_> {
    pub(super) fn scene(&mut self) -> Result<Reply, Refused> {
        let names = self.host.plant().names();
        let bus = |medium: &dyn Bus| BusScene {
            name: medium.name().to_owned(),
            kind: medium.family().to_owned(),
            bit_s: medium.bit_s(),
            interval: medium.interval(),
            ports: medium.ports().into_iter().map(|origin| names.source(Source::Node(origin))).collect(),
        };
        Ok(Reply::Scene(self.host.plant().media().iter().map(|medium| bus(&**medium)).collect()))
    }
}
