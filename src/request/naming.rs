//! [`Names`] on their way between processes: of a device goes the hash of its layout, which the registry finds again.

use crate::devices;
use crate::journal::Names;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
struct Sent {
    plcs: Vec<String>,
    buses: Vec<String>,
    layouts: Vec<u64>,
}

pub(super) fn serialize<S: Serializer>(names: &Names, serializer: S) -> Result<S::Ok, S::Error> {
    let Names { plcs, buses, devices } = names.clone();
    Sent { plcs, buses, layouts: devices.iter().map(|device| device.layout_hash).collect() }
        .serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Names, D::Error> {
    let Sent { plcs, buses, layouts } = Sent::deserialize(deserializer)?;
    let device = |hash: u64| {
        let known = devices::of_hash(hash).map(|known| known.layout);
        known.ok_or_else(|| D::Error::custom(format_args!("no device has layout 16#{hash:016X}")))
    };
    Ok(Names { plcs, buses, devices: layouts.into_iter().map(device).collect::<Result<_, _>>()? })
}
