//! The drives of a plant, for all kinds of connections.

use super::Plant;
use crate::devices::{DriveDetails, DriveState, ParameterRefusal, Shaft};

/// Location of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DriveLocation {
    /// Index of the bus, and index in its [`Drives::list`](crate::devices::Drives::list).
    Bus(usize, usize),
    /// The drive in a device.
    Device(usize),
}

/// A drive of the plant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlantDrive {
    /// Name of the drive: `winder`; or `line:drive` for the drive that contains PLC `line`.
    pub name: String,
    /// Bus of the drive, if it is on a bus.
    pub bus: Option<String>,
    /// State of the drive.
    pub state: DriveState,
}

impl Plant {
    /// Returns the drives: first the drives on buses in the order of the plant file, then the drives of devices. The
    /// number of a drive is its index in this list.
    pub fn drives(&self) -> Vec<PlantDrive> {
        let on_bus = self.buses().iter().flat_map(|bus| {
            let drive = |(name, state): (&str, _)| PlantDrive {
                name: name.to_owned(),
                bus: Some(bus.name().to_owned()),
                state,
            };
            bus.drives().map_or_else(Vec::new, |drives| drives.list().into_iter().map(drive).collect())
        });
        let own = self.devices.iter().filter_map(|device| {
            let (name, state) = device.drives()?.list().into_iter().next()?;
            Some(PlantDrive { name: format!("{}:{name}", device.name()), bus: None, state })
        });
        on_bus.chain(own).collect()
    }

    fn drive_at(&self, number: usize) -> Option<DriveLocation> {
        let buses = self.buses().iter().enumerate();
        let on_bus = buses.flat_map(|(index, bus)| {
            (0..bus.drives().map_or(0, |drives| drives.list().len()))
                .map(move |drive| DriveLocation::Bus(index, drive))
        });
        let devices = self.devices.iter().enumerate();
        let own = devices
            .filter(|(_, device)| device.drives().is_some())
            .map(|(index, _)| DriveLocation::Device(index));
        on_bus.chain(own).nth(number)
    }

    /// Returns all details of drive `number`; `None` if there is no such drive.
    pub fn drive(&self, number: usize) -> Option<DriveDetails> {
        match self.drive_at(number)? {
            DriveLocation::Bus(bus, drive) => self.buses().get(bus)?.drives()?.details(drive),
            DriveLocation::Device(index) => self.devices.get(index)?.drives()?.details(0),
        }
    }

    /// Sets a parameter of drive `number`, as a user does at the drive itself; `None` if there is no such drive.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    pub fn set_parameter(
        &mut self,
        number: usize,
        parameter: u16,
        value: i64,
    ) -> Option<Result<(), ParameterRefusal>> {
        let at = self.drive_at(number)?;
        let Plant { now, buses, devices, journal, .. } = self;
        let done = match at {
            DriveLocation::Bus(bus, drive) => {
                buses.get_mut(bus)?.drives_mut()?.set_parameter(drive, parameter, value, *now, journal)
            }
            DriveLocation::Device(index) => {
                devices.get_mut(index)?.drives_mut()?.set_parameter(0, parameter, value, *now, journal)
            }
        };
        self.find_next_device();
        Some(done)
    }

    /// Returns the reference and actual motion of the motor of drive `number`; `None` if there is no such
    /// drive.
    pub fn shaft(&self, number: usize) -> Option<Shaft> {
        match self.drive_at(number)? {
            DriveLocation::Bus(bus, drive) => self.buses().get(bus)?.drives()?.shaft(drive),
            DriveLocation::Device(index) => self.devices.get(index)?.drives()?.shaft(0),
        }
    }

    /// Sets the speed of the motor of drive `number`, from the next control task of the drive on. From then
    /// on, the speed does not depend on the drive's set value, so that a client can simulate the coupled
    /// load. With `None` the motor follows the drive again. Returns `false` if there is no such drive.
    pub fn turn_shaft(&mut self, number: usize, speed: Option<i32>) -> bool {
        let Some(at) = self.drive_at(number) else { return false };
        let Plant { now, buses, devices, .. } = self;
        let (drives, drive) = match at {
            DriveLocation::Bus(bus, drive) => (buses[bus].drives_mut(), drive),
            DriveLocation::Device(index) => (devices[index].drives_mut(), 0),
        };
        if let Some(drives) = drives {
            drives.turn_shaft(drive, speed, *now);
        }
        self.find_next_device();
        true
    }
}
