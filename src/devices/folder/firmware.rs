//! The firmware of a device in a folder.

use super::card::Card;
use super::own_faults::OwnFaults;
use super::part::Part;
use super::port::BusLink;
use super::records::Reload;
use super::source::Source;
use crate::devices::{
    AddressWrites, CardPulses, Context, DevicePorts, Events, FileChanges, Firmware, OptionCard,
};
use crate::fault::{FaultKind, Faults, Owner};
use crate::memory::header::Start;
use crate::snapshot_fields;
use std::path::Path;

/// Firmware of a device in a folder. It consists of parts, which run one after the other on the same
/// registers.
pub(super) struct FolderFirmware {
    parts: Vec<Box<dyn Part>>,
    card: Card,
    faults: OwnFaults,
    source: Source,
    /// True if a port exchanges a process image. The port writes registers that the parts read.
    has_image: bool,
}

snapshot_fields!(FolderFirmware { parts: parts, card, faults; built: source, has_image });

impl FolderFirmware {
    pub(super) fn new(
        parts: Vec<Box<dyn Part>>,
        card: Card,
        faults: OwnFaults,
        source: Source,
        has_image: bool,
    ) -> Self {
        FolderFirmware { parts, card, faults, source, has_image }
    }

    /// Switches the port on or off together with the device. At power-off the script can no longer send
    /// frames.
    fn switch_port(&self, is_on: bool) {
        if let Some(link) = self.card.link() {
            link.switch(is_on);
        }
    }

    /// Notifies the parts of faults that have begun or ended.
    fn report_faults(&mut self, ctx: &mut Context) {
        let changes = self.faults.take_changes();
        if !changes.is_empty() {
            self.card.set_faults(self.faults.mask());
            changes.iter().for_each(|change| self.each(ctx, |part, ctx, card| part.fault(ctx, card, change)));
        }
    }

    /// Calls each part with the registers. Reports changes of the phase by programs and by the parts.
    fn each(&mut self, ctx: &mut Context, mut f: impl FnMut(&mut dyn Part, &mut Context, &mut Card)) {
        self.card.report_phase(ctx);
        self.parts.iter_mut().for_each(|part| f(part.as_mut(), ctx, &mut self.card));
        self.card.report_phase(ctx);
    }
}

impl Firmware for FolderFirmware {
    fn start(&mut self, ctx: &mut Context) {
        self.card.start();
        self.switch_port(true);
        self.faults.restart();
        self.card.set_faults(0);
        self.each(ctx, |part, ctx, card| part.start(ctx, card));
        self.report_faults(ctx);
    }

    fn stop(&mut self, ctx: &mut Context) {
        self.switch_port(false);
        self.each(ctx, |part, ctx, card| part.stop(ctx, card));
    }

    fn look(&mut self, ctx: &mut Context) {
        self.report_faults(ctx);
        self.card.answer_requests(ctx);
        self.each(ctx, |part, ctx, card| part.look(ctx, card));
    }

    fn is_quiescent(&self) -> bool {
        !self.has_image
            && self.faults.next_time() == u64::MAX
            && self.parts.iter().all(|part| part.is_quiescent())
    }

    /// A part may have changed a register that another part reads. In this case the next cycle is needed.
    fn needs_each_cycle(&self) -> bool {
        !self.is_quiescent()
    }

    fn next_time(&self) -> u64 {
        let of_port = self.card.link().map_or(u64::MAX, BusLink::next_time);
        let first = of_port.min(self.faults.next_time());
        self.parts.iter().map(|part| part.next_time()).fold(first, u64::min)
    }

    fn due(&mut self, ctx: &mut Context) {
        self.report_faults(ctx);
        self.each(ctx, |part, ctx, card| part.due(ctx, card));
    }

    fn faults_changed(&mut self, now: u64, faults: &Faults, owner: Owner) {
        self.faults.changed(now, faults, owner);
    }

    fn fault_kinds(&self) -> Option<&'static [&'static FaultKind]> {
        Some(self.faults.kinds())
    }

    fn event_level(&self, event: usize) -> Option<u8> {
        self.card.event_level(event)
    }

    fn events(&mut self) -> Option<&mut Events> {
        self.card.events()
    }

    fn file_changes(&mut self) -> Option<&mut dyn FileChanges> {
        Some(self)
    }

    fn option_card(&mut self) -> Option<&mut dyn OptionCard> {
        Some(self)
    }

    fn address_writes(&mut self) -> Option<&mut dyn AddressWrites> {
        self.card.has_phases().then_some(self)
    }

    fn ports(&mut self) -> Option<&mut dyn DevicePorts> {
        self.card.link_mut().map(|link| link as &mut dyn DevicePorts)
    }

    /// Carries out an order of the board. No event occurs while the program is stopped (D-300).
    fn ordered(&mut self, ctx: &mut Context, order: Start) {
        if let Some(events) = self.card.events() {
            events.held = order == Start::Stop;
        }
        self.each(ctx, |part, ctx, card| part.ordered(ctx, card, order));
    }
}

/// A write of the register that shows the phase is reported at once, before the next write of a client.
impl AddressWrites for FolderFirmware {
    fn written_by_address(&self, _: u32, _: u32) {}

    fn answers_write(&self, offset: u32) -> bool {
        self.card.shows_phase(offset)
    }

    fn answer_write(&mut self, ctx: &mut Context) {
        self.card.report_phase(ctx);
    }
}

impl OptionCard for FolderFirmware {
    fn take_pulses(&mut self) -> CardPulses {
        self.card.take_pulses()
    }

    fn sync_edge(&mut self, ctx: &mut Context) {
        self.each(ctx, |part, ctx, card| part.sync_edge(ctx, card));
    }

    fn trigger(&mut self, ctx: &mut Context) {
        self.each(ctx, |part, ctx, card| part.trigger(ctx, card));
    }
}

/// A changed script continues with the state and the waiting functions of the script before the change
/// (D-807).
impl FileChanges for FolderFirmware {
    fn take_over(&mut self, ctx: &mut Context) -> Option<u64> {
        let read = self.source.read_again();
        let script = match &read {
            Ok(None) => return None,
            Ok(Some(folder)) => folder.script.as_ref(),
            Err(what) => {
                Reload::write(ctx.journal, ctx.now, ctx.origin.plc, &format!("files not read again: {what}"));
                return None;
            }
        };
        if let Some(script) = script {
            Reload::write(ctx.journal, ctx.now, ctx.origin.plc, "script read again");
            self.each(ctx, |part, ctx, card| part.take_over(ctx, card, script));
        }
        Some(self.source.settings())
    }

    fn has_refused(&self) -> bool {
        self.source.has_refused()
    }

    fn folder(&self) -> &Path {
        self.source.folder()
    }
}
