//! Operation on the present activity of the buses.

use super::Work;
use crate::devices::Bus;
use crate::journal::Source;
use crate::request::{BusScene, Refused, Reply};

impl Work<'_> {
    pub(super) fn scene(&mut self) -> Result<Reply, Refused> {
        let names = self.host.plant().names();
        let scene = |bus: &dyn Bus| BusScene {
            name: bus.name().to_owned(),
            kind: bus.family().to_owned(),
            bit_s: bus.bit_s(),
            interval: bus.interval(),
            ports: bus.ports().into_iter().map(|origin| names.source(Source::Node(origin))).collect(),
        };
        Ok(Reply::Scene(self.host.plant().buses().iter().map(|bus| scene(&**bus)).collect()))
    }
}
