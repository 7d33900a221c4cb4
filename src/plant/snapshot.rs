//! Snapshots: the state of a whole plant at a moment, and its restoration.
//!
//! A plant that continues from a snapshot writes the same journal as a plant that did not stop. The snapshot does not
//! contain the records of the journal, nor data of outside processes: waiting clients, lockstep participants, bells and
//! their counters.

mod file;
#[cfg(test)]
mod tests;

pub use file::{SnapshotFile, SnapshotFileError};

use super::history::phase_in;
use super::{LATEST_US, Plant};
use crate::devices::{self, Device};
use crate::identity::DeviceIndex;
use crate::journal::{Origin, PortPhase, Rings};
use crate::layout::place::status_of;
use crate::layout::{Area, DeviceLayout as Layout};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::borrow::Borrow;
use core::ops::Range;
use std::sync::Arc;

/// The state of a plant at a moment. It can be restored in that plant, or in a plant that was built from the same plant
/// file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    time_us: u64,
    layouts: Vec<(String, u64)>,
    buses: Vec<String>,
    settings: Arc<[u64]>,
    state: Vec<u8>,
}

/// A search for a moment in the past of the plant. The search returns to several snapshots; this value keeps
/// the journal's records in the meantime.
pub(crate) struct Search(Rings);

/// Reason for which a plant cannot restore a snapshot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotError {
    /// The snapshot has other devices or buses.
    #[error("it is of another plant: it has {theirs}, here there are {ours}")]
    OtherPlant {
        /// Devices and buses of the snapshot.
        theirs: String,
        /// Devices and buses of this plant.
        ours: String,
    },
    /// The snapshot has other addresses for the registers of a device.
    #[error(
        "the registers of PLC '{plc}' lie elsewhere in it: its layout is 16#{found:016X}, here it is 16#{expected:016X}; \
         take it back to the version of commram and of the layout that it was made with"
    )]
    OtherLayout {
        /// Name of the PLC with different layouts.
        plc: String,
        /// Hash of the device's layout in the snapshot.
        found: u64,
        /// Hash of the device's layout in this plant.
        expected: u64,
    },
    /// A PLC of the snapshot is another device than in this plant.
    #[error(
        "PLC '{plc}' is another device in it, {theirs}, here {ours}; start its plant by `commram run --from`"
    )]
    OtherDevice {
        /// Name of the PLC, which is another device in the snapshot.
        plc: String,
        /// The vendor's name for the device in the snapshot.
        theirs: &'static str,
        /// Name of the device in this plant.
        ours: &'static str,
    },
    /// The devices and buses of the snapshot have other settings.
    #[error("its plant file has another setting of {what}; start its plant by `commram run --from`")]
    OtherSettings {
        /// The parts of the plant with different settings, for example "PLC 'line'".
        what: String,
    },
    /// A file in the folder of a device has changed since the snapshot. All other settings agree.
    #[error("a file of {what} has changed since the snapshot, in {folders}; restore it")]
    ChangedFolder {
        /// The devices with a changed folder.
        what: String,
        /// The folders of the plant's devices.
        folders: String,
    },
    /// All settings agree, but the state is different.
    #[error("its state differs: its plant file has other faults, or it does not begin at the same moment")]
    OtherState,
    /// The bytes of the snapshot are not a state of this plant.
    #[error("it is damaged, or was made by another build of commram: {0}")]
    Damaged(#[from] Damaged),
}

impl SnapshotError {
    /// If a snapshot from the same plant file has other settings, returns the error that names the cause: a changed file
    /// in one of these folders, which are those of the plant's devices. Returns any other error unchanged.
    pub(crate) fn caused_by(self, folders: String) -> Self {
        match self {
            Self::OtherSettings { what } if !folders.is_empty() => Self::ChangedFolder { what, folders },
            other => other,
        }
    }
}

impl Snapshot {
    /// Emulated time of the snapshot, in microseconds since power-on.
    #[must_use]
    pub fn time_us(&self) -> u64 {
        self.time_us
    }

    /// Returns the size of the snapshot in memory, in bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        let names = self.layouts.iter().map(|(name, _)| name).chain(&self.buses);
        size_of::<Self>() + self.state.capacity() + names.map(String::capacity).sum::<usize>()
    }

    /// Returns the memory of the snapshot, so that another snapshot can use it.
    pub(crate) fn into_state(self) -> Vec<u8> {
        self.state
    }

    /// Writes the fields of the file format.
    fn save(&self, to: &mut Saving) {
        let Snapshot { time_us, layouts, buses, settings, state } = self;
        to.value(&(time_us, layouts, buses, settings.as_ref(), state));
    }

    fn of_saved(from: &mut Saved<'_>) -> Result<Self, Damaged> {
        let (time_us, layouts, buses, settings, state): (_, _, _, Vec<u64>, _) = from.value()?;
        Ok(Snapshot { time_us, layouts, buses, settings: settings.into(), state })
    }
}

impl Plant {
    /// Completes the work that the parts of the plant have postponed. The results do not change, but
    /// snapshots become faster.
    pub(crate) fn settle(&mut self) {
        self.buses.iter_mut().filter_map(|bus| bus.drives_mut()).for_each(|drives| drives.settle());
    }

    /// Returns the present state of the plant. Taking it changes nothing.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        self.snapshot_reusing(Vec::new())
    }

    /// Returns the snapshot as a file that contains the text of the plant file.
    #[must_use]
    pub fn snapshot_file(&self) -> SnapshotFile {
        self.file_of(self.snapshot())
    }

    /// Returns a snapshot of this plant as a file.
    pub(crate) fn file_of(&self, snapshot: Snapshot) -> SnapshotFile {
        SnapshotFile { plant: self.text.as_ref().to_owned(), snapshot }
    }

    /// Takes a snapshot like [`Plant::snapshot`], but reuses the memory of `bytes`.
    pub(crate) fn snapshot_reusing(&self, bytes: Vec<u8>) -> Snapshot {
        let mut to = Saving::reusing(bytes);
        self.save(&mut to);
        let (layouts, buses) = self.shape();
        Snapshot {
            time_us: self.now,
            layouts,
            buses,
            settings: Arc::clone(&self.settings),
            state: to.into_bytes(),
        }
    }

    /// Restores a snapshot of this plant, or of a plant with the same plant file. The snapshot does not contain records
    /// of the journal: all records are dropped, and [`Journal::history_id`](crate::journal::Journal::history_id)
    /// changes for its readers.
    ///
    /// # Errors
    /// [`SnapshotError`]; the plant is then unchanged.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        self.fits(snapshot)?;
        self.take_over(snapshot, false)
    }

    /// Restores the snapshot in a file like [`Plant::restore`]. If the file contains the text of this plant's
    /// plant file and the settings still differ, the error names the cause: a changed file in the folder of a
    /// device. A device that has refused such a file does not continue from a snapshot.
    pub(crate) fn restore_file(&mut self, file: &SnapshotFile) -> Result<(), SnapshotError> {
        let fits = self.fits(&file.snapshot).and_then(|()| self.has_present_files());
        let restored = fits.and_then(|()| self.take_over(&file.snapshot, false));
        if file.plant == *self.text {
            restored.map_err(|error| self.name_changed_folder(error))
        } else {
            restored
        }
    }

    /// Checks that all devices use the present files of their folders.
    ///
    /// # Errors
    /// [`SnapshotError::ChangedFolder`]
    fn has_present_files(&mut self) -> Result<(), SnapshotError> {
        let refusing = self.devices.iter_mut().filter_map(|device| {
            device.file_changes()?.has_refused().then(|| format!("PLC '{}'", device.name()))
        });
        let refusing: Vec<_> = refusing.collect();
        match refusing.is_empty() {
            true => Ok(()),
            false => Err(self.name_changed_folder(SnapshotError::OtherSettings { what: listed(refusing) })),
        }
    }

    /// Adds the folders of the devices to an error ([`SnapshotError::caused_by`]).
    pub(crate) fn name_changed_folder(&mut self, error: SnapshotError) -> SnapshotError {
        // The plant file is not read again for the folders, because a file in a folder may be wrong now.
        let devices = self.devices.iter_mut();
        let folders: Vec<_> = devices
            .filter_map(|device| Some(device.file_changes()?.folder().display().to_string()))
            .collect();
        error.caused_by(folders.join(", "))
    }

    /// Returns to a snapshot from this plant's own past. The journal keeps its records up to the time of the
    /// snapshot.
    ///
    /// # Errors
    /// Returns the errors of [`Plant::restore`].
    pub fn go_back(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        self.fits(snapshot)?;
        self.take_over(snapshot, true)
    }

    /// Begins a search that visits several moments in the past and ends at one of them. The journal then
    /// contains its records up to that moment.
    pub(crate) fn search(&mut self) -> Search {
        Search(self.journal.lay_aside())
    }

    /// Ends a search in the past of the plant.
    pub(crate) fn end_search(&mut self, search: Search) {
        self.journal.put_back(search.0);
        self.arrive();
    }

    /// Reads a snapshot that [fits](Self::fits) this plant.
    ///
    /// # Errors
    /// The state makes no sense; the plant is then unchanged.
    fn take_over(&mut self, snapshot: &Snapshot, goes_back: bool) -> Result<(), SnapshotError> {
        let mut before = Saving::default();
        self.save(&mut before);
        let mut from = Saved::new(&snapshot.state);
        let taken = self.read(&mut from, goes_back).and_then(|()| from.end());
        if taken.is_err() {
            // This plant has just saved the bytes, so reading them cannot fail.
            let _ = self.read(&mut Saved::new(before.bytes()), true);
        }
        let watches = self.buses.iter_mut().filter_map(|bus| bus.watch());
        let phases = watches.flat_map(|watch| watch.phases()).chain(phases_of_devices(&self.devices));
        self.journal.continue_phases(goes_back || taken.is_err(), phases);
        self.arrive();
        taken.map_err(SnapshotError::from)
    }

    fn fits(&self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        let (layouts, buses) = self.shape();
        let names = |layouts: &[(String, u64)], buses: &[String]| {
            let plcs: Vec<_> = layouts.iter().map(|(name, _)| name.as_str()).collect();
            format!("PLCs {} and buses {}", listed(plcs), listed(buses.iter().map(String::as_str).collect()))
        };
        let (theirs, ours) = (names(&snapshot.layouts, &snapshot.buses), names(&layouts, &buses));
        if theirs != ours {
            return Err(SnapshotError::OtherPlant { theirs, ours });
        }
        let layouts = snapshot.layouts.iter().zip(&layouts);
        match layouts.into_iter().find(|((_, found), (_, expected))| found != expected) {
            None if snapshot.settings != self.settings => {
                Err(SnapshotError::OtherSettings { what: self.describe_differences(&snapshot.settings) })
            }
            None => Ok(()),
            Some(((plc, found), (_, expected))) => {
                let (plc, found, expected) = (plc.clone(), *found, *expected);
                let title = |hash| devices::of_hash(hash).map(|known| known.layout.title);
                match (title(found), title(expected)) {
                    (Some(theirs), Some(ours)) => Err(SnapshotError::OtherDevice { plc, theirs, ours }),
                    _ => Err(SnapshotError::OtherLayout { plc, found, expected }),
                }
            }
        }
    }

    /// Describes the settings that differ in another plant with the same devices and buses.
    fn describe_differences(&self, theirs: &[u64]) -> String {
        let devices = self.devices.iter().map(|device| format!("PLC '{}'", device.name()));
        let buses = self.buses.iter().map(|bus| format!("bus '{}' or its participants", bus.name()));
        let names = ["the processor cycle".to_owned()].into_iter().chain(devices).chain(buses);
        let differs =
            names.zip(theirs.iter().zip(self.settings.iter())).filter(|(_, (one, other))| one != other);
        listed(differs.map(|(name, _)| name).collect())
    }

    /// Returns the names and layouts of the devices, and the names and kinds of the buses.
    fn shape(&self) -> (Vec<(String, u64)>, Vec<String>) {
        let devices = self.devices.iter();
        let layouts = devices.map(|device| (device.name().to_owned(), device.layout().layout_hash));
        let buses = self.buses().iter().map(|bus| format!("{} ({})", bus.name(), bus.family()));
        (layouts.collect(), buses.collect())
    }

    fn save(&self, to: &mut Saving) {
        let Plant {
            now,
            next_cycle,
            next_device,
            cycle_us: _,
            // After a restoration, the plant first polls all devices.
            has_looked: _,
            is_seen: _,
            // A client outside the plant sets this field while it waits for an event.
            watching: _,
            devices,
            buses,
            named_buses: _,
            // The schedule is rebuilt from the buses before the clock advances.
            schedule: _,
            is_rescheduled: _,
            ports,
            journal,
            // Empty between events.
            drafts: _,
            workers: _,
            forces,
            faults,
            watches,
            // Empty between events.
            edges: _,
            cards: _,
            widths: _,
            text: _,
            settings: _,
            folders: _,
            is_ending: _,
        } = self;
        to.value(&(now, next_cycle, next_device));
        for device in devices {
            device.segment().save_registers(&registers_of(&**device), to);
            device.header().save(to);
        }
        devices.save(to);
        buses.save(to);
        ports.save(to);
        forces.save(to);
        faults.save(to);
        journal.save(to);
        watches.save(to);
    }

    fn read(&mut self, from: &mut Saved<'_>, goes_back: bool) -> Result<(), Damaged> {
        (self.now, self.next_cycle, self.next_device) = from.value()?;
        (self.has_looked, self.is_seen) = (false, false);
        let is_next = self.next_cycle > self.now && self.next_cycle - self.now <= self.cycle_us;
        from.check(is_next && self.now <= LATEST_US, "time of the plant and of its next processor cycle")?;
        for device in &self.devices {
            device.segment().restore_registers(&registers_of(&**device), from)?;
            device.header().restore(from)?;
            #[cfg(feature = "channel")]
            device.segment().copy_requests(device.layout().front);
            device.show_time(self.now);
        }
        self.devices.restore(from)?;
        self.buses.restore(from)?;
        self.ports.restore(from)?;
        self.forces.restore(from)?;
        let forces = self.forces.list();
        let is_right = |forced: &super::Forced| {
            let device = self.devices.get(forced.plc.index());
            device.is_some_and(|device| forced.check(device.layout()).is_ok())
        };
        from.check(forces.iter().all(is_right), "register that can be forced")?;
        let sites = self.sites();
        self.faults.restore(from, devices::fault_kinds(), &sites)?;
        self.journal.restore(from, devices::catalogue(), goes_back)?;
        if !goes_back {
            self.journal.continue_from(self.now);
        }
        self.watches.restore(from)?;
        from.check(self.next_event() >= self.now, "time of the next event")
    }
}

/// The comparison with the plants of other hosts.
#[cfg(feature = "channel")]
impl Plant {
    /// Returns a fingerprint of this plant at this moment for [`Plant::is_like`]: the parts of the plant, and
    /// a number for its state.
    pub(crate) fn likeness(&self) -> Vec<u8> {
        let snapshot = self.snapshot();
        let state = twox_hash::XxHash3_64::oneshot(&snapshot.state).to_le_bytes().to_vec();
        let mut to = Saving::default();
        Snapshot { state, ..snapshot }.save(&mut to);
        to.into_bytes()
    }

    /// Compares two results of [`Plant::likeness`]: `ours` of this plant and `theirs` of another plant. They are equal
    /// if both plants have the same parts and had the same state.
    ///
    /// # Errors
    /// The difference between the plants.
    pub(crate) fn is_like(&self, ours: &[u8], theirs: &[u8]) -> Result<(), SnapshotError> {
        self.fits(&Snapshot::of_saved(&mut Saved::new(theirs))?)?;
        if ours == theirs { Ok(()) } else { Err(SnapshotError::OtherState) }
    }
}

/// Returns the phases of areas that belong to no port.
fn phases_of_devices(devices: &[Box<dyn Device>]) -> impl Iterator<Item = PortPhase> {
    let of_device = |(index, device): (usize, &dyn Device)| {
        let layout: &'static Layout = device.layout();
        let is_free = |area: &&Area| layout.ports.iter().all(|port| port.area.first != area.first);
        let area = layout.areas.iter().filter(is_free).find(|area| status_of(area).is_some())?;
        Some(PortPhase { port: Origin::of_device(DeviceIndex::at(index)), live: phase_in(device, area) })
    };
    devices.iter().map(|device| &**device).enumerate().filter_map(of_device)
}

/// Returns the ranges of the image that contain registers, in ascending order.
pub(super) fn registers_of(device: &dyn Device) -> Vec<Range<usize>> {
    let layout: &'static Layout = device.layout();
    let areas = layout.areas.iter().map(|area| area.first as usize..area.last() as usize + 1);
    let retain = layout.retain.map(|retain| {
        let first = retain.area.first as usize;
        first..first + device.header().retain_size.load() as usize
    });
    let mut ranges: Vec<_> = areas.chain(retain).collect();
    ranges.sort_by_key(|range| range.start);
    ranges
}

fn listed<T: Borrow<str>>(names: Vec<T>) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
