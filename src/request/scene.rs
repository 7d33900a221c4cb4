//! Present activity of the buses.

use super::Host;
use super::{BusScene, Reply};
use crate::devices::Bus;
use crate::journal::Source;

/// The buses with their intervals and ports.
pub(super) fn scene(host: &dyn Host) -> Reply {
    let names = host.plant().names();
    let bus = |medium: &dyn Bus| BusScene {
        name: medium.name().to_owned(),
        kind: medium.family().to_owned(),
        bit_s: medium.bit_s(),
        interval: medium.interval(),
        ports: medium.ports().into_iter().map(|origin| names.source(Source::Node(origin))).collect(),
    };
    Reply::Scene(host.plant().media().iter().map(|medium| bus(&**medium)).collect())
}
