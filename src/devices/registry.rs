//! Registry of devices. It has the devices of commram, and the devices that a program adds before the first
//! lookup.

use super::{bm4_o_can_06, can_dp2, cr201x, cs0015, omega_drive_line_2};
#[cfg(feature = "emulator")]
use super::{emulation::Emulation, emulation::catalogue, folder};
use crate::layout::DeviceLayout as Layout;
#[cfg(feature = "emulator")]
use crate::memory::InstanceLock;
use crate::memory::{AttachMode, Attached, Image, MemoryError, header};
#[cfg(feature = "plc")]
use crate::plc::{BlockKind, StPart};
use std::sync::{Mutex, OnceLock, PoisonError};

/// A device that is registered with commram.
#[derive(Clone, Copy, Debug)]
pub struct Registered {
    /// Areas, registers, ports and times of the device.
    pub layout: &'static Layout,
    /// Names of the elements of the device's board, from [`BoardWords::NAMES`](header::BoardWords::NAMES).
    /// Every list contains `power` and `restarts`.
    pub board: &'static [&'static str],
    /// The function blocks that its programs use.
    #[cfg(feature = "plc")]
    pub blocks: &'static [BlockKind],
    /// The structures in IEC Structured Text, in the order that a compiler needs. Empty if the device has no
    /// such text.
    #[cfg(feature = "plc")]
    pub st: &'static [StPart],
    /// Firmware of the device, with its section of plant files, journal records, rules and faults.
    #[cfg(feature = "emulator")]
    pub emulation: Emulation,
}

impl Registered {
    /// Returns a device that has only registers. Use it as the base of a struct update to set other
    /// properties: `Registered { blocks: BLOCKS, ..Registered::new(&DEVICE) }`.
    #[must_use]
    pub const fn new(layout: &'static Layout) -> Self {
        Registered {
            layout,
            board: &["power", "restarts"],
            #[cfg(feature = "plc")]
            blocks: &[],
            #[cfg(feature = "plc")]
            st: &[],
            #[cfg(feature = "emulator")]
            emulation: Emulation::NONE,
        }
    }
}

/// The devices of commram itself. The first one is the default. Each device folder has its entry here.
static BUILT_IN: &[&Registered] = &[
    &omega_drive_line_2::REGISTERED,
    &bm4_o_can_06::REGISTERED,
    &cs0015::REGISTERED,
    &cr201x::REGISTERED,
    &can_dp2::REGISTERED,
];

/// The reason why a device cannot be added.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum RegisterError {
    /// A device has already been looked up.
    #[error("device '{name}' comes too late: add devices before their first use")]
    TooLate {
        /// Name of the device that was added too late.
        name: &'static str,
    },
    /// The name, number or hash already belongs to another device.
    #[error("device '{name}' has {what} {taken} of '{other}'; each belongs to one device or family")]
    Taken {
        /// Name of the device that cannot be added.
        name: &'static str,
        /// Text that names the duplicate part: "the name", "the layout hash", "the number of record" ...
        what: &'static str,
        /// Name or number that another device or family already has.
        taken: String,
        /// Device or family that already has the name or number.
        other: &'static str,
    },
}

/// Devices in the order of their registration. The first lookup ends the registration.
struct Registry {
    added: Mutex<Vec<&'static Registered>>,
    all: OnceLock<Vec<&'static Registered>>,
}

/// The registry of this process.
static REGISTRY: Registry = Registry::new();

impl Registry {
    const fn new() -> Self {
        Registry { added: Mutex::new(Vec::new()), all: OnceLock::new() }
    }

    fn all(&self) -> &[&'static Registered] {
        self.all.get_or_init(|| {
            let added = self.added.lock().unwrap_or_else(PoisonError::into_inner);
            BUILT_IN.iter().copied().chain(added.iter().copied()).collect()
        })
    }

    fn register(&self, device: &'static Registered) -> Result<(), RegisterError> {
        // As long as this lock is held, a first lookup in another thread waits.
        let mut added = self.added.lock().unwrap_or_else(PoisonError::into_inner);
        let name = device.layout.name;
        if self.all.get().is_some() {
            return Err(RegisterError::TooLate { name });
        }
        let mut taken = generic_claims();
        BUILT_IN.iter().copied().chain(added.iter().copied()).for_each(|known| taken.extend(claims(known)));
        for claim in claims(device) {
            if let Some(other) = taken.iter().find(|other| other.collides(&claim)) {
                let Claim { what, value, .. } = claim;
                return Err(RegisterError::Taken { name, what, taken: value, other: other.owner });
            }
            taken.push(claim);
        }
        added.push(device);
        Ok(())
    }
}

/// A unique name or number.
struct Claim {
    owner: &'static str,
    what: &'static str,
    value: String,
    /// Identifies the owner of a claim that several devices may share, for example the devices of a family.
    shared: Option<*const ()>,
}

impl Claim {
    fn new(owner: &'static str, what: &'static str, value: impl ToString) -> Self {
        Claim { owner, what, value: value.to_string(), shared: None }
    }

    #[cfg(feature = "emulator")]
    fn of<T>(self, thing: &'static T) -> Self {
        Claim { shared: Some(core::ptr::from_ref(thing).cast()), ..self }
    }

    fn collides(&self, other: &Claim) -> bool {
        let is_shared = self.shared.is_some() && self.shared == other.shared;
        self.what == other.what && self.value == other.value && !is_shared
    }
}

/// Claims of a device.
fn claims(device: &'static Registered) -> Vec<Claim> {
    let layout = device.layout;
    let hash = format!("16#{:016X}", layout.layout_hash);
    let own =
        [Claim::new(layout.name, "the name", layout.name), Claim::new(layout.name, "the layout hash", hash)];
    let own = own.into_iter();
    #[cfg(feature = "emulator")]
    let own = {
        let Emulation { records, rules, faults, .. } = device.emulation;
        own.chain(claims_of(layout.name, records, rules, faults))
    };
    own.collect()
}

#[cfg(feature = "emulator")]
fn claims_of(
    owner: &'static str,
    records: &'static [&'static crate::journal::EventKind],
    rules: &'static [&'static crate::journal::Rule],
    faults: &'static [&'static crate::fault::FaultKind],
) -> impl Iterator<Item = Claim> {
    let of_records = records.iter().flat_map(move |&kind| {
        let number = Claim::new(owner, "the number of record", kind.number()).of(kind);
        [number, Claim::new(owner, "the name of record", kind.name()).of(kind)]
    });
    let of_rules = rules.iter().flat_map(move |&rule| {
        let number = Claim::new(owner, "the number of rule", rule.number()).of(rule);
        [number, Claim::new(owner, "the name of rule", rule.id()).of(rule)]
    });
    let of_faults = faults.iter().flat_map(move |&kind| {
        let number = Claim::new(owner, "the number of fault", kind.number()).of(kind);
        [number, Claim::new(owner, "the name of fault", kind.name()).of(kind)]
    });
    of_records.chain(of_rules).chain(of_faults)
}

/// Returns the claims that do not depend on a device, and the claims of buses.
fn generic_claims() -> Vec<Claim> {
    #[cfg(feature = "emulator")]
    let claims =
        catalogue::generic().flat_map(|it| claims_of(it.owner, it.records, it.rules, it.faults)).collect();
    #[cfg(not(feature = "emulator"))]
    let claims = Vec::new();
    claims
}

/// Adds a device of another crate. The program must call this before any other function of commram, so that
/// every lookup finds the device. The program then calls [`cli::main`](crate::cli::main), or uses parts of
/// the library.
///
/// # Errors
/// [`RegisterError`]: the name or the layout hash already belongs to another device, so does the number or
/// name of a record, rule or fault, or a lookup has already taken place.
pub fn register(device: &'static Registered) -> Result<(), RegisterError> {
    REGISTRY.register(device)
}

/// Returns all devices. The first one is the default. After this call, no device can be added.
#[must_use]
pub fn all() -> &'static [&'static Registered] {
    REGISTRY.all()
}

/// Returns the device that is used if no name is given.
#[must_use]
pub fn default() -> &'static Registered {
    BUILT_IN[0]
}

/// Returns the device with this name. `--device` and plant files use these names.
#[must_use]
pub fn find(name: &str) -> Option<&'static Registered> {
    all().iter().copied().find(|it| it.layout.name == name)
}

/// Returns the device with this layout hash, which the header of an image contains. The device belongs to the
/// program, or to a folder that this process has read.
#[must_use]
pub fn of_hash(hash: u64) -> Option<&'static Registered> {
    let known = all().iter().copied().find(|it| it.layout.layout_hash == hash);
    #[cfg(feature = "emulator")]
    let known = known.or_else(|| folder::of_hash(hash));
    known
}

/// Returns the elements of the device's board: [`Registered::board`], or all elements for an unknown device.
#[must_use]
pub fn board_of(layout: &Layout) -> &'static [&'static str] {
    of_hash(layout.layout_hash).map_or(&header::BoardWords::NAMES, |known| known.board)
}

/// Attaches to the image of a PLC. The PLC may be any device. Returns the image and the device.
///
/// # Errors
/// Returns the errors of [`Image::attach`]; [`MemoryError::OtherLayout`] if no device has the layout of the image.
pub fn attach(
    instance: &str,
    plc: &str,
    mode: AttachMode,
) -> Result<(Attached, &'static Layout), MemoryError> {
    let attached = Image::attach(instance, plc, mode, None)?;
    #[cfg(feature = "emulator")]
    folder::load_of_instance(instance);
    let header = attached.header_snapshot();
    match of_hash(header.layout_hash.load()) {
        Some(known) => Ok((attached, known.layout)),
        #[cfg(feature = "emulator")]
        None if !InstanceLock::device_folders(instance).is_empty() => {
            let (path, device) = (attached.path().to_owned(), header::name(&header.device));
            let changes = folder::differences(instance);
            Err(MemoryError::LostFolder { path, device, changes })
        }
        None => Err(MemoryError::OtherLayout {
            path: attached.path().to_owned(),
            device: header::name(&header.device),
            found: header.layout_hash.load(),
            expected: default().layout.layout_hash,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::header::{AREAS, PORTS, TABLE_NAME_LENGTH};

    #[test]
    fn every_device_is_found_by_name_and_hash() {
        for &known in all() {
            let layout = known.layout;
            assert!(find(layout.name).is_some_and(|found| core::ptr::eq(found, known)), "{layout:?}");
            assert!(
                of_hash(layout.layout_hash).is_some_and(|found| core::ptr::eq(found, known)),
                "{layout:?}"
            );
        }
        assert!(find("omega").is_none() && of_hash(0).is_none());
    }

    /// The header page has one more area than the layout: the retain flags.
    #[test]
    fn areas_and_ports_of_every_device_fit_into_the_header_page() {
        for layout in all().iter().map(|known| known.layout) {
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

#[cfg(all(test, feature = "emulator"))]
#[allow(unreachable_pub, reason = "the macros declare what families publish")]
mod register_tests;
