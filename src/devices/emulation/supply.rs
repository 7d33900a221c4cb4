//! The supply of a device. Its switch is in the header page. A reset has the effect of switching the supply
//! off and on.

use super::records::{BoardEvent, OnBoard};
use super::{Context, FrontAction, Power};
use crate::memory::FirmwareHeader;
use crate::memory::header;
use crate::snapshot_fields;

/// State of the supply and of the device.
pub(in crate::devices) struct Supply {
    is_powered: bool,
    /// True if the supply has power while the switch is on.
    is_fed: bool,
    is_up: bool,
    /// True if the device was up before. The journal has no record of the first power-on.
    is_used: bool,
    /// Position of the switch at the last poll.
    seen: u32,
}

snapshot_fields!(Supply { values: is_powered, is_fed, is_up, is_used, seen });

impl Supply {
    /// Creates a supply that is switched on. The device has not started yet.
    pub(in crate::devices) fn new(face: &FirmwareHeader) -> Self {
        Supply {
            is_powered: true,
            is_fed: true,
            is_up: false,
            is_used: false,
            seen: face.requested().program.power.load(),
        }
    }

    pub(in crate::devices) fn is_up(&self) -> bool {
        self.is_up
    }

    /// True if the supply had power at the last call of `feed`.
    pub(in crate::devices) fn is_fed(&self) -> bool {
        self.is_fed
    }

    /// Called when the power that reaches the switch fails or returns.
    pub(in crate::devices) fn feed(&mut self, face: &FirmwareHeader, is_fed: bool) -> FrontAction {
        self.is_fed = is_fed;
        self.look(face)
    }

    /// True if a client has turned the switch since the last poll.
    #[inline]
    pub(in crate::devices) fn has_changed(&self, face: &FirmwareHeader) -> bool {
        face.requested().program.power.load() != self.seen
    }

    /// Switches the supply, as if a client had turned the switch.
    pub(in crate::devices) fn set(&mut self, face: &FirmwareHeader, power: Power) -> FrontAction {
        let on = matches!(power, Power::On | Power::ReleaseReset);
        self.seen = if on { header::Power::On } else { header::Power::Off }.code();
        face.put(|page| &page.program.power, self.seen);
        self.switch(on)
    }

    /// Polls the switch once.
    pub(in crate::devices) fn look(&mut self, face: &FirmwareHeader) -> FrontAction {
        self.seen = face.requested().program.power.load();
        self.switch(self.seen != header::Power::Off.code())
    }

    fn switch(&mut self, on: bool) -> FrontAction {
        let on = on && self.is_fed;
        if core::mem::replace(&mut self.is_powered, on) == on {
            return FrontAction::Nothing;
        }
        if on { FrontAction::Up } else { FrontAction::Off }
    }

    /// Called when the device starts. The journal records every start except the first.
    pub(in crate::devices) fn start(&mut self, ctx: &mut Context, face: &FirmwareHeader) {
        self.is_up = true;
        face.program.restarts.increment();
        if core::mem::replace(&mut self.is_used, true) {
            ctx.report(OnBoard { plc: ctx.origin.plc, what: BoardEvent::Up { dip: None } });
        }
    }

    /// Called when the device stops.
    pub(in crate::devices) fn stop(&mut self, ctx: &mut Context) {
        self.is_up = false;
        ctx.report(OnBoard { plc: ctx.origin.plc, what: BoardEvent::Down });
    }
}
