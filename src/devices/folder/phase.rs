//! The phase of a device in a folder: which of the structures that overlay each other is valid (D-885).
//!
//! Readers of the journal name registers by the phase. Therefore the device writes a record when the phase changes. The
//! record is written before the next record of the device, so a script that enters a phase and then writes a register of
//! this phase gets the name of this register in the journal.

use super::card::Place;
use crate::identity::DeviceIndex;
use crate::journal::{Origin, State};
use crate::layout::place::status_of;
use crate::layout::{Area, DeviceLayout, RegisterRef};

/// The area with overlaid structures, and the register that shows its phase.
#[derive(Clone, Copy, Debug)]
struct Status {
    place: Place,
    area: &'static Area,
}

/// The phase that the journal knows.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownPhase {
    /// `None` if no structures overlay each other.
    status: Option<Status>,
    /// Value of the register at the last comparison. In the first phase it is 0.
    pub(super) last: u32,
}

impl KnownPhase {
    /// The device is in its first phase.
    pub(super) fn first(layout: &'static DeviceLayout) -> Self {
        let status = overlaid(layout).next().map(|(area, status)| Status { place: Place::of(&status), area });
        KnownPhase { status, last: 0 }
    }

    /// The register that shows the phase.
    pub(super) fn place(&self) -> Option<Place> {
        self.status.map(|status| status.place)
    }

    /// Takes the present value of the register. Returns the record for the journal if the phase has changed.
    pub(super) fn entered(&mut self, plc: DeviceIndex, now: u32) -> Option<State> {
        let Status { place, area } = self.status?;
        let before = core::mem::replace(&mut self.last, now);
        let [was, live] = [before, now].map(|value| area.phase(Some(value)));
        let record = State {
            origin: Origin::of_device(plc),
            offset: place.offset,
            command: place.offset,
            // The layout of a folder has no wider register here.
            from: before as u16,
            to: now as u16,
            live,
        };
        (was != live).then_some(record)
    }
}

/// Returns the areas with structures that overlay each other, each with the register that shows its phase.
pub(super) fn overlaid(layout: &'static DeviceLayout) -> impl Iterator<Item = (&'static Area, RegisterRef)> {
    layout.areas.iter().filter_map(|area| Some((area, status_of(area)?)))
}
