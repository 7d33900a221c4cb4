//! Stores of outside programs into the images of this host. The same stores are repeated in the images of the
//! other hosts, because the plants of all hosts must run identically.

use super::Plant;
use super::snapshot::registers_of;
use crate::devices::Device;
use crate::identity::DeviceIndex;
use crate::memory::{RegisterCopy, StoredBytes};
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Contents of the registers of all devices at the last poll. A comparison with the present contents shows
/// the stores since then. Requests to the boards need no copy, because the firmware reads them in separate
/// pages.
pub(crate) struct Outside(Vec<DeviceRegisters>);

struct DeviceRegisters {
    ranges: Vec<Range<usize>>,
    registers: RegisterCopy,
}

/// A store by an outside program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stored {
    plc: DeviceIndex,
    what: StoreTarget,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum StoreTarget {
    Registers(StoredBytes),
    /// A store to the header page: index of the cell in the list of the cells that programs write, and the value.
    Board(u16, u32),
}

impl DeviceRegisters {
    fn of(device: &dyn Device) -> Self {
        let ranges = registers_of(device);
        let registers = device.segment().copy_registers(&ranges);
        DeviceRegisters { ranges, registers }
    }
}

impl Outside {
    /// Copies the present contents of the registers.
    pub(crate) fn of(plant: &Plant) -> Self {
        Outside(plant.devices().iter().map(|device| DeviceRegisters::of(&**device)).collect())
    }

    /// Stores since the last poll: the registers with changed contents.
    pub(crate) fn stored(&mut self, plant: &Plant) -> Vec<Stored> {
        let devices = DeviceIndex::enumerate(plant.devices().iter().zip(&mut self.0));
        let stored = devices.flat_map(|(plc, (device, seen))| {
            let stored = device.segment().stored_since(&seen.ranges, &mut seen.registers);
            stored.into_iter().map(move |bytes| Stored { plc, what: StoreTarget::Registers(bytes) })
        });
        stored.collect()
    }

    /// Copies the present contents, so that the next `stored` does not return the stores up to now.
    pub(crate) fn renew(&mut self, plant: &Plant) {
        let devices = plant.devices().iter().zip(&mut self.0);
        devices.for_each(|(device, seen)| device.segment().renew_copy(&seen.ranges, &mut seen.registers));
    }
}

impl Plant {
    /// True if programs have made a request to a board that its firmware has not seen, or if a board must
    /// poll its header page.
    pub(crate) fn has_undelivered_requests(&self) -> bool {
        let is_asked = |device: &dyn Device| device.segment().has_new_requests(device.layout().front);
        self.is_asked() || self.devices().iter().any(|device| is_asked(&**device))
    }

    /// Passes the requests of programs in the header pages to the firmware of the boards.
    pub(crate) fn deliver_board_requests(&self) -> Vec<Stored> {
        let stores = DeviceIndex::enumerate(self.devices()).flat_map(|(plc, device)| {
            let requests = device.segment().deliver_requests(device.layout().front);
            requests
                .into_iter()
                .map(move |(index, value)| Stored { plc, what: StoreTarget::Board(index, value) })
        });
        stores.collect()
    }

    /// Repeats a store that a program has made into an image of an identical plant on another host. The
    /// effect is that of a store by a program on this host.
    pub(crate) fn store_as_outside(&self, stored: &Stored) {
        let Some(device) = self.devices().get(stored.plc.index()) else { return };
        match stored.what {
            StoreTarget::Registers(bytes) => device.segment().store_bytes(&bytes),
            StoreTarget::Board(index, value) => {
                device.segment().store_request(device.layout().front, index, value)
            }
        }
    }
}
