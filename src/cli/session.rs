//! Access to an instance: through the channel while its emulator runs, otherwise through the images that the emulator
//! has left.

mod by_channel;

pub(crate) use by_channel::{continues, send};

use super::Instance;
use super::error::CliError;
use super::output;
use super::place::NamedLocation;
use crate::devices;
use crate::devices::ModuleFront;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::layout::{DeviceFit, DeviceLayout, FrontWord, RegisterRef, plc_prefix, split_plc};
use crate::memory::header::BoardState;
use crate::memory::{
    AttachMode, Attached, Condition, EmulatorProcess, Header, Image, ImageInfo, ImageSummary, MemoryError,
    RunningInstance, Width,
};
use crate::plant::Forced;
use std::time::{Duration, Instant};

/// Longest time for which an emulator that starts or ends has its lock and no images.
const WITHOUT_IMAGES: Duration = Duration::from_millis(500);
/// Pause between two searches for the images of such an emulator.
const RETRY: Duration = Duration::from_millis(2);

#[derive(Clone, Copy, Debug)]
pub(crate) enum Read {
    /// One register, by its location.
    Register {
        /// Number of the PLC.
        plc: DeviceIndex,
        /// Offset in the image, in bytes.
        offset: u32,
        /// Width of the access.
        width: Width,
    },
    /// A block of bytes.
    Block {
        /// Number of the PLC.
        plc: DeviceIndex,
        /// Offset in the image, in bytes.
        offset: u32,
        /// Length of the range in bytes.
        len: u32,
    },
}

impl Read {
    /// Reads a register of PLC `plc`.
    pub(crate) fn register(plc: DeviceIndex, register: &RegisterRef) -> Self {
        Self::Register { plc, offset: register.offset(), width: Width::of(register.ty()) }
    }

    /// Reads `place` in PLC `plc`.
    pub(crate) fn place(plc: DeviceIndex, place: &NamedLocation) -> Self {
        Self::Register { plc, offset: place.offset(), width: place.width() }
    }
}

/// Values read at one moment of emulated time, if the emulator is running.
#[derive(Debug)]
pub(crate) struct Snapshot {
    /// Emulated time of the read, in microseconds.
    pub time_us: u64,
    /// Bytes that were read, one item for each read. Registers are in little-endian order.
    pub data: Vec<Vec<u8>>,
    /// The registers that were forced at that moment; empty if the emulator is dead.
    pub forces: Vec<Forced>,
}

impl Snapshot {
    /// True if one of the `len` bytes at `offset` of PLC `plc` was forced.
    pub(crate) fn is_forced(&self, plc: DeviceIndex, offset: u32, len: u32) -> bool {
        self.forces.iter().any(|forced| {
            forced.plc == plc && forced.offset < offset + len && offset < forced.offset + forced.width.bytes()
        })
    }
}

/// Open access to an instance.
pub(crate) struct Session {
    instance: String,
    plcs: Vec<String>,
    /// Device and options of each PLC.
    fitted: Vec<DeviceFit>,
    door: Access,
    /// Seconds of real time for a second of emulated time.
    slowed: f64,
}

enum Access {
    Channel(Box<crate::channel::Client>),
    /// The images in the order of `plcs`.
    Images(Vec<Attached>),
}

impl Session {
    /// Opens an instance for reading, even if its emulator is dead.
    ///
    /// # Errors
    /// No instance has this name, or the instance cannot be used.
    pub(crate) fn open_for_reading(instance: &Instance) -> Result<Self, CliError> {
        instance.reach(|| Self::try_to_read(instance))
    }

    fn try_to_read(place: &Instance) -> Result<Self, CliError> {
        let instance = place.name();
        let images = images_of(instance)?;
        if let Some(pid) = dead(&images) {
            if place.is_being_taken_over()? {
                return Err(CliError::Dead { instance: instance.to_owned(), pid });
            }
            output::note(&format!(
                "instance '{instance}' is dead, its emulator (process {pid}) was killed; these are its last values"
            ));
            return Self::map(instance, &images);
        }
        Self::open_live_for_reading(instance, &images)
    }

    fn open_live_for_reading(instance: &str, images: &[ImageInfo]) -> Result<Self, CliError> {
        use crate::channel::ClientError;
        match Self::connect(instance, images, 0) {
            // The emulator runs, but has no channel. So the images are read directly.
            Err(CliError::NoChannel { .. } | CliError::Client(ClientError::NotRunning { .. }))
                if images_of(instance).is_ok() =>
            {
                output::note(&format!(
                    "instance '{instance}' has no channel; registers are read one after the other"
                ));
                Self::map(instance, images)
            }
            other => other,
        }
    }

    /// Opens an instance in any state for a quick read, without messages to the user.
    pub(crate) fn glance(instance: &str) -> Option<Self> {
        Self::map(instance, &images_of(instance).ok()?).ok()
    }

    /// Returns the name of the instance.
    pub(crate) fn instance(&self) -> &str {
        &self.instance
    }

    /// Returns the names of the PLCs of the instance.
    pub(crate) fn plcs(&self) -> &[String] {
        &self.plcs
    }

    /// Returns the index of the PLC `plc`, which the user wrote before `text`.
    ///
    /// # Errors
    /// The instance has no such PLC, or it has several and the user named none.
    pub(crate) fn plc(&self, plc: Option<&str>, text: &str) -> Result<DeviceIndex, CliError> {
        number_of_plc(&self.instance, &self.plcs, plc, text).map_err(|error| match error {
            CliError::WhichPlc { text, instance, plcs, example } => {
                // The example in the message names a PLC that has the register or address.
                let fits = self.fitted.iter().map(|fitted| NamedLocation::parse(fitted, &text).is_ok());
                let first = self.plcs.iter().zip(fits).find_map(|(plc, fits)| fits.then(|| plc.clone()));
                CliError::WhichPlc { text, instance, plcs, example: first.unwrap_or(example) }
            }
            other => other,
        })
    }

    /// Device type of PLC `plc`.
    pub(crate) fn device(&self, plc: DeviceIndex) -> &'static DeviceLayout {
        self.fitted(plc).device()
    }

    /// Device type and options of all PLCs.
    pub(crate) fn all_fitted(&self) -> &[DeviceFit] {
        &self.fitted
    }

    /// Device type and options of PLC `plc`.
    pub(crate) fn fitted(&self, plc: DeviceIndex) -> DeviceFit {
        let known = self.fitted.get(plc.index()).copied();
        known.unwrap_or_else(|| DeviceFit::unknown(&DeviceLayout::UNKNOWN))
    }

    /// Finds the register or address in `text`.
    ///
    /// # Errors
    /// Returns the errors of [`Session::plc`]. Also fails if the device has no such register or address.
    pub(crate) fn place(&self, text: &str) -> Result<NamedLocation, CliError> {
        let (plc, name) = split_plc(text);
        Ok(NamedLocation::parse(&self.fitted(self.plc(plc, name)?), text)?)
    }

    /// Finds the indices of the PLC and of the port in `text`. Without the name of a port, returns the first
    /// master of the PLC.
    ///
    /// # Errors
    /// Returns the errors of [`Session::plc`]. Also fails if the device has no such port.
    pub(crate) fn port(&self, text: &str) -> Result<(DeviceIndex, PortNumber), CliError> {
        let (plc, name) = split_plc(text);
        // The user has not named a PLC, so the message shows a port of the first PLC as an example.
        let example = self.fitted(DeviceIndex(0)).port_or_master(name).map_or(name, |port| port.name);
        let plc = self.plc(plc, example)?;
        Ok((plc, self.fitted(plc).port_or_master(name)?.number))
    }

    /// Returns the index of the PLC of `place`.
    ///
    /// # Errors
    /// Returns the errors of [`Session::plc`].
    pub(crate) fn plc_of(&self, place: &NamedLocation) -> Result<DeviceIndex, CliError> {
        self.plc(place.plc.as_deref(), place.text())
    }

    /// Prefix of register names: the PLC, if the instance has several.
    pub(crate) fn prefix(&self, plc: DeviceIndex) -> String {
        plc_prefix(&self.plcs, plc)
    }

    /// Returns the size of the retain flags of PLC `plc`, in bytes.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn retain_bytes(&self, plc: DeviceIndex) -> Result<u32, CliError> {
        Ok(self.header(plc)?.retain_size.load())
    }

    /// Returns the modules of the PLC with index `plc`, each with the name of its port; `None` if the PLC is not
    /// modular.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn modules(
        &self,
        plc: DeviceIndex,
    ) -> Result<Option<Vec<(&'static str, ModuleFront)>>, CliError> {
        Ok(devices::modules(&*self.header(plc)?, self.device(plc)))
    }

    /// Switches and displays that only the device type of PLC `plc` has.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn front(&self, plc: DeviceIndex) -> Result<Vec<(&'static FrontWord, u32)>, CliError> {
        Ok(self.header(plc)?.front_words(self.device(plc)).collect())
    }

    /// Returns a copy of the header page of PLC `plc`.
    fn header(&self, plc: DeviceIndex) -> Result<Box<Header>, CliError> {
        match &self.door {
            Access::Images(images) if let Some(image) = images.get(plc.index()) => {
                Ok(image.header_snapshot())
            }
            _ => {
                let name = self.plcs.get(plc.index()).map_or("", String::as_str);
                Ok(Image::attach(&self.instance, name, AttachMode::ReadOnly, None)?.header_snapshot())
            }
        }
    }

    /// Reads all values in one request.
    ///
    /// # Errors
    /// The emulator has ended, or refuses the request.
    pub(crate) fn read(&self, reads: &[Read]) -> Result<Snapshot, CliError> {
        match &self.door {
            Access::Channel(_) => self.read_by_channel(reads),
            Access::Images(images) => read_images(images, reads),
        }
    }

    /// Returns the boards of all PLCs with the names of the PLCs.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn boards(&self) -> Result<Vec<(String, BoardState)>, CliError> {
        let states: Vec<BoardState> = match &self.door {
            Access::Channel(_) => self.boards_by_channel()?,
            Access::Images(images) => images.iter().map(board_of).collect(),
        };
        Ok(self.plcs.iter().cloned().zip(states).collect())
    }

    /// Opens the images of an instance without the channel.
    fn map(instance: &str, images: &[ImageInfo]) -> Result<Self, CliError> {
        // Some images may be from an earlier emulator that had more PLCs. If any image has a living emulator, such
        // images are left out.
        let any_alive = images.iter().any(is_alive);
        let images: Vec<_> = images.iter().filter(|image| !any_alive || is_alive(image)).collect();
        let attach = |image: &ImageInfo| devices::attach(instance, &image.plc, AttachMode::ReadOnly);
        let attached = images.iter().copied().map(attach).collect::<Result<Vec<_>, _>>()?;
        let fitted = attached.iter().map(|(image, device)| image.header_snapshot().fitted(device)).collect();
        let attached = attached.into_iter().map(|(image, _)| image).collect();
        let plcs = images.iter().map(|image| image.plc.clone()).collect();
        Ok(Self { instance: instance.to_owned(), plcs, fitted, door: Access::Images(attached), slowed: 1.0 })
    }
}

/// Returns the index of the PLC `plc` of an instance. The user wrote the name before `text`.
///
/// # Errors
/// The instance has no such PLC, or it has several and the user named none.
pub(crate) fn number_of_plc(
    instance: &str,
    plcs: &[String],
    plc: Option<&str>,
    text: &str,
) -> Result<DeviceIndex, CliError> {
    let instance = || instance.to_owned();
    let Some(plc) = plc else {
        return match plcs {
            [_] => Ok(DeviceIndex(0)),
            several => Err(CliError::WhichPlc {
                text: text.to_owned(),
                instance: instance(),
                plcs: plcs.join(", "),
                example: several.first().cloned().unwrap_or_default(),
            }),
        };
    };
    let number = plcs.iter().position(|name| name == plc);
    number.map(DeviceIndex::at).ok_or_else(|| CliError::UnknownPlc {
        plc: plc.to_owned(),
        instance: instance(),
        plcs: plcs.join(", "),
    })
}

/// Returns the index of the bus `bus` of an instance with these buses.
///
/// # Errors
/// The instance has no such bus.
pub(crate) fn number_of_bus(instance: &str, buses: &[String], bus: &str) -> Result<BusIndex, CliError> {
    let number = buses.iter().position(|name| name == bus);
    number.map(BusIndex::at).ok_or_else(|| CliError::UnknownBus {
        bus: bus.to_owned(),
        instance: instance.to_owned(),
        buses: buses.join(", "),
    })
}

/// Returns the images of an instance: at least one, and all of them usable. Ignores files of other users.
///
/// # Errors
/// This user has no image of the instance, or one of the images cannot be used.
pub(crate) fn images_of(instance: &str) -> Result<Vec<ImageInfo>, CliError> {
    let start = Instant::now();
    let (foreign, own, others) = loop {
        let all = crate::memory::list()?;
        let (own, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|image| image.instance == instance);
        let (foreign, own): (Vec<_>, Vec<_>) = own.into_iter().partition(is_foreign);
        // A process that removes the files of a killed emulator holds the locks of the instance, but is not an
        // emulator.
        let running = if own.is_empty() { RunningInstance::find(instance)? } else { None };
        let Some(running) = running else { break (foreign, own, others) };
        // An emulator that starts has its lock before its images, and one that ends still has its lock after it has
        // removed them.
        if start.elapsed() > WITHOUT_IMAGES {
            let pid = running.process().map(EmulatorProcess::pid);
            return Err(CliError::NoImages { instance: instance.to_owned(), pid });
        }
        std::thread::sleep(RETRY);
    };
    if own.is_empty() {
        if let Some(Condition::Unusable(reason)) = foreign.into_iter().next().map(|image| image.condition) {
            return Err(reason.into());
        }
        let mut running: Vec<_> = others.into_iter().filter(is_alive).map(|image| image.instance).collect();
        running.dedup();
        let running = match running.as_slice() {
            [] => String::new(),
            names => format!(" (running: {})", names.join(", ")),
        };
        return Err(CliError::NotRunning { instance: instance.to_owned(), running });
    }
    own.into_iter()
        .map(|image| match image.condition {
            Condition::Unusable(reason) => Err(reason.into()),
            _ => Ok(image),
        })
        .collect()
}

/// True if the file belongs to another user. Any user can create a file with the name of an image.
fn is_foreign(image: &ImageInfo) -> bool {
    matches!(image.condition, Condition::Unusable(MemoryError::ForeignOwner { .. }))
}

/// True if an emulator serves the image.
pub(crate) fn is_alive(image: &ImageInfo) -> bool {
    matches!(image.condition, Condition::Alive(_))
}

/// Returns the process id of the emulator that serves the images.
pub(crate) fn alive(images: &[ImageInfo]) -> Option<u32> {
    images.iter().find_map(|image| match &image.condition {
        Condition::Alive(ImageSummary { pid, .. }) => Some(*pid),
        _ => None,
    })
}

/// Returns the process id of the killed emulator that owned the images, if no emulator serves any of them.
pub(crate) fn dead(images: &[ImageInfo]) -> Option<u32> {
    let pid = |image: &ImageInfo| match &image.condition {
        Condition::Dead(ImageSummary { pid, .. }) => Some(*pid),
        _ => None,
    };
    images.iter().map(pid).collect::<Option<Vec<_>>>()?.first().copied()
}

fn board_of(image: &Attached) -> BoardState {
    let header = image.header_snapshot();
    BoardState::of(&header)
}

fn read_images(images: &[Attached], reads: &[Read]) -> Result<Snapshot, CliError> {
    let mut data = Vec::with_capacity(reads.len());
    for read in reads {
        let (Read::Register { plc, .. } | Read::Block { plc, .. }) = *read;
        // The index comes from this session, so there is an image with this index; `else` never happens.
        let Some(image) = images.get(plc.index()) else { continue };
        data.push(match *read {
            Read::Register { offset, width, .. } => {
                image.segment().load(offset, width)?.to_le_bytes().to_vec()
            }
            Read::Block { offset, len, .. } => {
                let mut bytes = vec![0; len as usize];
                image.segment().read_range(offset, &mut bytes)?;
                bytes
            }
        });
    }
    let time_us = images.first().map_or(0, |image| image.header_snapshot().virtual_time_us.load());
    Ok(Snapshot { time_us, data, forces: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::InstanceLock;

    #[test]
    fn an_emulator_that_ends_is_not_one_without_images() {
        let name = format!("images-of-{}", std::process::id());
        let lock = InstanceLock::take(&name).unwrap();
        let outcome = std::thread::scope(|scope| {
            let images = scope.spawn(|| images_of(&name));
            std::thread::sleep(Duration::from_millis(50));
            drop(lock);
            images.join().unwrap()
        });
        assert!(matches!(outcome, Err(CliError::NotRunning { .. })), "{outcome:?}");
        let lock = InstanceLock::take(&name).unwrap();
        let outcome = images_of(&name);
        drop(lock);
        assert!(matches!(outcome, Err(CliError::NoImages { .. })), "{outcome:?}");
    }
}
