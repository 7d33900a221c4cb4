//! What programs outside have stored into the images, for other plants that are to go the same way.

use super::Plant;
use super::snapshot::registers_of;
use crate::devices::Device;
use crate::memory::{RegisterCopy, StoredBytes};
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// What stood in the registers and on the boards of all devices when they were looked at last.
pub(crate) struct Outside(Vec<Seen>);

struct Seen {
    ranges: Vec<Range<usize>>,
    registers: RegisterCopy,
    asked: Vec<u32>,
}

/// A store by somebody outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stored {
    plc: u16,
    what: What,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum What {
    Registers(StoredBytes),
    /// To the header page: which of the cells by which boards are asked, and the value.
    Board(u16, u32),
}

impl Seen {
    fn of(device: &dyn Device) -> Self {
        let ranges = registers_of(device);
        let registers = device.segment().copy_registers(&ranges);
        Seen { ranges, registers, asked: device.header().copy_asked() }
    }

    fn stored(&mut self, device: &dyn Device) -> impl Iterator<Item = What> {
        let registers = device.segment().stored_since(&self.ranges, &mut self.registers);
        let before = core::mem::replace(&mut self.asked, device.header().copy_asked());
        let asked = (0..).zip(before.into_iter().zip(self.asked.clone()));
        let asked = asked.filter(|(_, (before, now))| before != now);
        let registers = registers.into_iter().map(What::Registers);
        registers.chain(asked.map(|(index, (_, now))| What::Board(index, now)))
    }

    fn renew(&mut self, device: &dyn Device) {
        device.segment().renew_copy(&self.ranges, &mut self.registers);
        self.asked = device.header().copy_asked();
    }
}

impl Outside {
    /// What stands there now.
    pub(crate) fn of(plant: &Plant) -> Self {
        Outside(plant.devices().iter().map(|device| Seen::of(&**device)).collect())
    }

    /// What differs from the last look.
    pub(crate) fn stored(&mut self, plant: &Plant) -> Vec<Stored> {
        let devices = (0..).zip(plant.devices().iter().zip(&mut self.0));
        let stored = devices
            .flat_map(|(plc, (device, seen))| seen.stored(&**device).map(move |what| Stored { plc, what }));
        stored.collect()
    }

    /// What stands there now is no news.
    pub(crate) fn renew(&mut self, plant: &Plant) {
        let devices = plant.devices().iter().zip(&mut self.0);
        devices.for_each(|(device, seen)| seen.renew(&**device));
    }
}

impl Plant {
    /// Stores what a program has stored into the image of another plant like this one, as a program here would.
    pub(crate) fn store_as_outside(&self, stored: &Stored) {
        let Some(device) = self.devices().get(usize::from(stored.plc)) else { return };
        match stored.what {
            What::Registers(bytes) => device.segment().store_bytes(&bytes),
            What::Board(index, value) => device.header().store_asked(index.into(), value),
        }
    }
}
