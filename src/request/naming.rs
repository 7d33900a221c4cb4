//! Serializes [`Names`] for other processes. A device is sent as the hash of its layout and a list of its ports. The
//! receiver finds the device in its registry by the hash.

use crate::devices;
use crate::journal::Names;
use crate::layout::{DeviceFit, Fit, Role};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
struct Sent {
    plcs: Vec<String>,
    buses: Vec<String>,
    devices: Vec<SentDevice>,
}

/// A device: hash of its layout, its ports in their order, and the number of its declarations.
#[derive(Serialize, Deserialize)]
struct SentDevice(u64, Vec<SentFit>, u64);

#[derive(Serialize, Deserialize)]
enum SentFit {
    Unknown,
    Empty,
    Master,
    Slave,
    Peer,
}

impl From<Fit> for SentFit {
    fn from(fit: Fit) -> Self {
        match fit {
            Fit::Unknown => SentFit::Unknown,
            Fit::Empty => SentFit::Empty,
            Fit::As(Role::Master) => SentFit::Master,
            Fit::As(Role::Slave) => SentFit::Slave,
            Fit::As(Role::Peer) => SentFit::Peer,
        }
    }
}

impl From<SentFit> for Fit {
    fn from(sent: SentFit) -> Self {
        match sent {
            SentFit::Unknown => Fit::Unknown,
            SentFit::Empty => Fit::Empty,
            SentFit::Master => Fit::As(Role::Master),
            SentFit::Slave => Fit::As(Role::Slave),
            SentFit::Peer => Fit::As(Role::Peer),
        }
    }
}

pub(super) fn serialize<S: Serializer>(names: &Names, serializer: S) -> Result<S::Ok, S::Error> {
    let Names { plcs, buses, devices } = names.clone();
    let device = |fitted: &DeviceFit| {
        let layout = fitted.device();
        let ports = layout.ports.iter().map(|port| fitted.port(port.number).into());
        SentDevice(layout.layout_hash, ports.collect(), fitted.declarations())
    };
    Sent { plcs, buses, devices: devices.iter().map(device).collect() }.serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Names, D::Error> {
    let Sent { plcs, buses, devices } = Sent::deserialize(deserializer)?;
    let device = |SentDevice(hash, fits, declarations): SentDevice| {
        let known = devices::of_hash(hash).map(|known| known.layout);
        let layout =
            known.ok_or_else(|| D::Error::custom(format_args!("no device has layout 16#{hash:016X}")))?;
        let ports = layout.ports.iter().zip(fits);
        let device = DeviceFit::unknown(layout).declaring(declarations);
        Ok(ports.fold(device, |known, (port, fit)| known.with(port.number, fit.into())))
    };
    Ok(Names { plcs, buses, devices: devices.into_iter().map(device).collect::<Result<_, _>>()? })
}
