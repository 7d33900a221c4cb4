//! Targets of faults, and the targets that an installation has.

use super::{Fault, FaultKind, Refusal, TargetKind};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::layout::DeviceLayout;

/// Target of a fault. Buses and PLCs are numbered as in the plant file, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// A bus.
    Bus(BusIndex),
    /// A participant of a bus.
    Participant {
        /// Number of the bus.
        bus: BusIndex,
        /// Number of the participant on the bus.
        number: u8,
    },
    /// A port of a PLC.
    Port {
        /// Number of the device (PLC).
        device: DeviceIndex,
        /// The port's number in the PLC's layout.
        port: PortNumber,
    },
    /// A PLC itself.
    Device(DeviceIndex),
}

/// Device or bus that applies a fault. It is the target of the fault, or the bus or device to which the target belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// A bus.
    Bus(BusIndex),
    /// A PLC.
    Device(DeviceIndex),
}

impl Target {
    /// Returns the kind of this target.
    #[must_use]
    pub const fn place(self) -> TargetKind {
        match self {
            Target::Bus(_) => TargetKind::Bus,
            Target::Participant { .. } => TargetKind::Participant,
            Target::Port { .. } => TargetKind::Port,
            Target::Device(_) => TargetKind::Device,
        }
    }

    /// Returns the index of the bus or PLC, and number of the participant or port; [`Target::of_numbers`] converts them
    /// back.
    #[must_use]
    pub const fn numbers(self) -> (u16, u8) {
        match self {
            Target::Bus(bus) => (bus.number(), 0),
            Target::Device(device) => (device.0, 0),
            Target::Participant { bus, number } => (bus.number(), number),
            Target::Port { device, port } => (device.0, port.0),
        }
    }

    /// Converts the result of [`Target::numbers`] back to a target.
    #[must_use]
    pub const fn of_numbers(place: TargetKind, index: u16, number: u8) -> Self {
        match place {
            TargetKind::Bus => Target::Bus(BusIndex::of_number(index)),
            TargetKind::Participant => Target::Participant { bus: BusIndex::of_number(index), number },
            TargetKind::Port => Target::Port { device: DeviceIndex(index), port: PortNumber(number) },
            TargetKind::Device => Target::Device(DeviceIndex(index)),
        }
    }
}

/// The targets in an installation that a fault can name.
#[derive(Clone, Debug, Default)]
pub struct Sites {
    /// The buses in the order of the plant file.
    pub buses: Vec<BusSite>,
    /// The PLCs in the order of the plant file.
    pub devices: Vec<DeviceSite>,
}

/// A bus as a target of faults.
#[derive(Clone, Copy, Debug)]
pub struct BusSite {
    /// The kinds of faults that the bus can have.
    pub faults: &'static [&'static FaultKind],
    /// Checks a fault of one of these kinds. If the bus cannot have it, the error contains the reason.
    pub fits: fn(&Fault) -> Result<(), String>,
    /// Participants of the bus, bit n for number n.
    pub participants: u32,
}

/// A PLC as a target of faults.
#[derive(Clone, Debug)]
pub struct DeviceSite {
    /// Device of the PLC.
    pub layout: &'static DeviceLayout,
    /// The kinds of faults that the PLC or its ports can have.
    pub faults: &'static [&'static FaultKind],
    /// The ports that are on a bus, each with its number and its bus.
    pub plugged: Vec<(PortNumber, BusIndex)>,
    /// The ports that are drives of their bus. A fault of such a port names the bus and the number of the drive on the
    /// bus.
    pub drives: Vec<PortNumber>,
}

impl Sites {
    /// Checks that the target of the fault exists and can have the fault. Returns the owner that applies the fault.
    ///
    /// # Errors
    /// [`Refusal`] describes the error and a correct value.
    pub fn owner(&self, fault: &Fault) -> Result<Owner, Refusal> {
        match fault.target() {
            Target::Bus(bus) => self.bus(bus, fault).map(|_| Owner::Bus(bus)),
            Target::Participant { bus, number } => {
                let present = self.bus(bus, fault)?.participants;
                if present.checked_shr(number.into()).unwrap_or(0) & 1 == 0 {
                    return Err(Refusal::NoSlave { bus, slave: number, present });
                }
                Ok(Owner::Bus(bus))
            }
            Target::Port { device, port } => {
                let site = self.device(device)?;
                let Some(known) = site.layout.port_numbered(port) else {
                    return Err(Refusal::NoPort { plc: device, port, layout: site.layout });
                };
                let Some(&(_, bus)) = site.plugged.iter().find(|(number, _)| *number == port) else {
                    let name =
                        |(number, _): &(PortNumber, BusIndex)| Some(site.layout.port_numbered(*number)?.name);
                    let plugged = site.plugged.iter().filter_map(name).collect();
                    return Err(Refusal::NotPlugged { plc: device, port: known.name, plugged });
                };
                if site.drives.contains(&port) {
                    return Err(Refusal::Disagree(format!(
                        "{} is a drive of its bus, and its CAN controller has no faults; name the bus and the slave number, for \
                         instance with slave_off",
                        known.name
                    )));
                }
                // The firmware of the port applies the kinds of faults that its device declares. The bus must apply all
                // other kinds.
                if !site.faults.contains(&fault.kind()) {
                    self.bus(bus, fault)?;
                }
                Ok(Owner::Bus(bus))
            }
            Target::Device(plc) => {
                let known = self.device(plc)?.faults;
                if !known.contains(&fault.kind()) {
                    return Err(Refusal::NotOfPlc { plc, known });
                }
                Ok(Owner::Device(plc))
            }
        }
    }

    /// Returns the kinds that the device with this index, a device in a folder, declares.
    pub(super) fn declared(&self, index: u16) -> impl Iterator<Item = &'static &'static FaultKind> {
        let kinds = self.devices.get(usize::from(index)).map_or(&[][..], |site| site.faults);
        kinds.iter().filter(|kind| kind.declaration().is_some())
    }

    fn bus(&self, bus: BusIndex, fault: &Fault) -> Result<&BusSite, Refusal> {
        let count = self.buses.len() as u16; // the plant file's indices are 16 bits wide
        let site = self.buses.get(bus.index()).ok_or(Refusal::UnknownBus { bus, count })?;
        if !site.faults.contains(&fault.kind()) {
            return Err(Refusal::NotOfBus { bus, known: site.faults });
        }
        (site.fits)(fault).map_err(Refusal::Disagree)?;
        Ok(site)
    }

    fn device(&self, plc: DeviceIndex) -> Result<&DeviceSite, Refusal> {
        let count = self.devices.len() as u16; // as above
        self.devices.get(plc.index()).ok_or(Refusal::UnknownPlc { plc, count })
    }
}
