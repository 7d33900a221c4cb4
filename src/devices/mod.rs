//! The devices, a folder each, [`cansync`], what the CANsync devices share, and the registry of them all.

pub mod bm4_o_can_06;
pub mod cansync;
#[cfg(feature = "emulator")]
mod catalogue;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
mod context;
#[cfg(feature = "emulator")]
mod device;
#[cfg(feature = "emulator")]
mod events;
#[cfg(feature = "emulator")]
mod medium;
pub mod omega_drive_line_2;
#[cfg(test)]
mod provenance_tests;
#[cfg(test)]
pub(crate) mod samples;
#[cfg(feature = "emulator")]
pub mod settings;
#[cfg(feature = "emulator")]
mod shown;

#[cfg(feature = "emulator")]
pub use catalogue::catalogue;
#[cfg(feature = "emulator")]
pub use config::{DeviceConfig, MediumConfig, MediumKind, PortConfig, Read};
#[cfg(feature = "emulator")]
pub use context::Context;
#[cfg(feature = "emulator")]
pub use device::{Device, Look, Power};
#[cfg(feature = "emulator")]
pub use medium::{Medium, Plug, SyncSignal, World};
#[cfg(feature = "emulator")]
pub use settings::{BuildError, SettingError};

use crate::layout::Device as Layout;
use crate::memory::{AttachMode, Attached, Image, MemoryError, header};
#[cfg(feature = "plc")]
use crate::plc::BlockKind;

/// A device that commram knows.
#[derive(Debug)]
pub struct Registered {
    /// Its areas, registers, ports and times.
    pub layout: &'static Layout,
    /// The function blocks that its programs use.
    #[cfg(feature = "plc")]
    pub blocks: &'static [BlockKind],
    /// Reads its section of a plant file; none if only its registers are known.
    #[cfg(feature = "emulator")]
    pub read: Option<Read<dyn DeviceConfig>>,
}

/// Every device, the default one first.
pub static DEVICES: &[Registered] = &[
    Registered {
        layout: &omega_drive_line_2::registers::DEVICE,
        #[cfg(feature = "plc")]
        blocks: omega_drive_line_2::blocks::BLOCKS,
        #[cfg(feature = "emulator")]
        read: Some(omega_drive_line_2::PlcConfig::read),
    },
    Registered {
        layout: &bm4_o_can_06::registers::DEVICE,
        #[cfg(feature = "plc")]
        blocks: bm4_o_can_06::blocks::BLOCKS,
        #[cfg(feature = "emulator")]
        read: Some(bm4_o_can_06::Bm4Config::read),
    },
];

/// Every kind of media, the default one first.
#[cfg(feature = "emulator")]
pub static MEDIA: &[MediumKind] = &[MediumKind {
    name: "cansync",
    read: cansync::medium::BusConfig::read,
    unplugged: || Box::new(cansync::medium::SimBus::unplugged()),
}];

/// The device of this name, as `--device` and plant files give it.
#[must_use]
pub fn find(name: &str) -> Option<&'static Registered> {
    DEVICES.iter().find(|it| it.layout.name == name)
}

/// The device of an image whose header holds this layout hash.
#[must_use]
pub fn of_hash(hash: u64) -> Option<&'static Registered> {
    DEVICES.iter().find(|it| it.layout.layout_hash == hash)
}

/// Attaches to the image of a PLC, whatever it is, and tells what it is.
///
/// # Errors
/// As [`Image::attach`]; [`MemoryError::OtherLayout`] if no device has the layout of the image.
pub fn attach(
    instance: &str,
    plc: &str,
    mode: AttachMode,
) -> Result<(Attached, &'static Layout), MemoryError> {
    let attached = Image::attach(instance, plc, mode, None)?;
    let header = attached.header_snapshot();
    match of_hash(header.layout_hash.load()) {
        Some(known) => Ok((attached, known.layout)),
        None => Err(MemoryError::OtherLayout {
            path: attached.path().to_owned(),
            device: header::name(&header.device),
            found: header.layout_hash.load(),
            expected: DEVICES[0].layout.layout_hash,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::header::{AREAS, PORTS, TABLE_NAME_LENGTH};

    #[test]
    fn every_device_is_found_by_name_and_hash() {
        for known in DEVICES {
            let layout = known.layout;
            assert!(find(layout.name).is_some_and(|found| core::ptr::eq(found, known)), "{layout:?}");
            assert!(
                of_hash(layout.layout_hash).is_some_and(|found| core::ptr::eq(found, known)),
                "{layout:?}"
            );
        }
        assert!(find("omega").is_none() && of_hash(0).is_none());
    }

    /// The retain flags are one more area.
    #[test]
    fn areas_and_ports_of_every_device_fit_into_the_header_page() {
        for layout in DEVICES.iter().map(|known| known.layout) {
            assert!(layout.areas.len() < AREAS, "{layout:?}");
            for area in layout.areas {
                assert!(area.name.len() < TABLE_NAME_LENGTH, "{area:?}");
            }
            assert!(layout.ports.len() <= PORTS, "{layout:?}");
            for port in layout.ports {
                assert!(
                    port.name.len() < TABLE_NAME_LENGTH && port.medium.len() < TABLE_NAME_LENGTH,
                    "{port:?}"
                );
            }
        }
    }
}
