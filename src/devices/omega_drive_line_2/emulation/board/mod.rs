//! The board around the communication RAM: interrupt events, timers, triggers, front panel and power (manual
//! 5.00005.03a p. 38-60).
//!
//! The board uses the header page of the image. On the device, the function blocks `INTR_SET` and `OPT_INIT`
//! call the firmware and have no registers. So in the emulator a soft-PLC writes the inputs of these blocks
//! to the header page (decision D-180).

use crate::snapshot_fields;

mod flags;
mod front;
mod interrupts;
mod project;
#[cfg(test)]
mod tests;
mod timers;
mod triggers;

pub(crate) use interrupts::level;

use crate::devices::Events;
use crate::devices::records::{BoardEvent, OnBoard};
use crate::devices::{CardPulses, Context, ControllerPulses, FrontAction, Power};
use crate::memory::header;
use crate::memory::{FirmwareHeader, MemoryError, Segment};
use flags::Flags;
use front::Front;
use timers::{Timer, Timers};
use triggers::{Source, Triggers};

/// The board of a PLC.
pub(crate) struct Board {
    face: FirmwareHeader,
    events: Events,
    timers: Timers,
    triggers: Triggers,
    front: Front,
    /// Value of [`board_requests`](crate::memory::Header::board_requests) at the last poll.
    requests: u32,
    /// Period of the SYNC signal of a simulated option card, in us.
    option_sync_us: Option<u32>,
    /// True if the SYNC signal of the network had an edge since the last call of [`Board::take_card_pulses`].
    sync_net: bool,
}

snapshot_fields!(Board { values: requests, triggers, timers; parts: events, front; built: face, option_sync_us, sync_net });

impl Board {
    /// Creates the board with its header page in `segment`. `project` is the project of the first power-on.
    /// `option_sync_us` is the period of the SYNC signal of an option card, if there is such a card.
    ///
    /// # Errors
    /// The memory segment is read-only.
    pub(crate) fn new(
        segment: &Segment,
        option_sync_us: Option<u32>,
        project: header::Project,
    ) -> Result<Self, MemoryError> {
        let face = segment.firmware_header()?;
        Ok(Board {
            requests: face.requested().board_requests.load(),
            front: Front::new(&face, Flags::new(segment)?, project),
            face,
            events: Events::default(),
            timers: Timers::default(),
            triggers: Triggers::default(),
            option_sync_us,
            sync_net: false,
        })
    }

    /// Called at power-on or at the end of a reset. From then on no event is enabled and no trigger is
    /// routed. Reads the DIP switches and returns their number.
    pub(crate) fn start(&mut self, ctx: &mut Context) -> u8 {
        self.stop();
        self.face.both(|page| {
            page.interrupts.iter().for_each(|interrupt| interrupt.clear());
            page.opt_init.clear();
        });
        if let Some(period) = self.option_sync_us {
            self.timers.start(Timer::OptionSync, ctx.now, u64::from(period) * timers::PER_US);
        }
        let dip = self.front.start(ctx, &self.face);
        self.events.held = !self.front.runs_events();
        dip
    }

    /// Called at power-off, or when RESET becomes active.
    pub(crate) fn stop(&mut self) {
        self.events.disable_all();
        self.triggers = Triggers::default();
        self.timers = Timers::default();
        self.front.stop(&self.face);
    }

    /// True if the board has power and is not held in RESET.
    pub(crate) fn is_up(&self) -> bool {
        self.front.is_up()
    }

    /// True if the board has supply, even if it is held in RESET.
    pub(crate) fn has_supply(&self) -> bool {
        self.front.has_supply()
    }

    /// Switches the supply or RESET from outside, as [`Board::look`] does when a client has turned a switch.
    pub(crate) fn set_power(&mut self, power: Power) -> FrontAction {
        self.front.set_power(&self.face, power)
    }

    /// Returns the number that the DIP switches had at the last power-on or reset.
    pub(crate) fn dip(&self) -> u8 {
        self.front.dip()
    }

    /// True if a client has turned a switch or made a request since the last poll.
    #[inline]
    pub(crate) fn has_changed(&self) -> bool {
        self.face.requested().board_requests.load() != self.requests || self.front.has_changed(&self.face)
    }

    /// Polls switches and requests once. If nothing has changed, this costs only a few loads.
    #[inline]
    pub(crate) fn look(&mut self, ctx: &mut Context) -> FrontAction {
        if self.has_changed() { self.look_closely(ctx) } else { FrontAction::Nothing }
    }

    #[cold]
    fn look_closely(&mut self, ctx: &mut Context) -> FrontAction {
        let look = self.look_at_all(ctx);
        self.events.held = !self.front.runs_events();
        look
    }

    fn look_at_all(&mut self, ctx: &mut Context) -> FrontAction {
        let requests = self.face.requested().board_requests.load();
        let asked = requests != self.requests;
        self.requests = requests;
        if asked && self.is_up() {
            // Initial values and projects are handled before a start, because a start uses them.
            self.front.look_at_flags(&self.face);
            self.front.look_at_project_request(ctx, &self.face);
        }
        let look = self.front.look(ctx, &self.face);
        if look != FrontAction::Nothing || !self.is_up() {
            return look;
        }
        if asked {
            self.front.look_at_start_request(ctx, &self.face);
        }
        if self.front.take_order() {
            self.events.note_order();
        }
        if self.front.take_start() {
            self.triggers.permit();
        }
        if !asked {
            return FrontAction::Answered;
        }
        interrupts::look(&mut self.events, ctx, &self.face, &mut self.timers);
        if let Some(result) = self.triggers.look(ctx.now, &self.face, &mut self.timers) {
            let modes = [0, 1, 2].map(|n| self.face.requested().opt_init.triggers[n].load() as u8);
            report(ctx, BoardEvent::Triggers { modes, result });
        }
        FrontAction::Answered
    }

    /// Returns the time at which the next timer is due; `u64::MAX` if no timer runs.
    #[inline]
    pub(crate) fn next_time(&self) -> u64 {
        self.timers.next_time()
    }

    /// Handles all timers that are due at `now`: first the triggers, then the events in the order of their
    /// levels (p. 44).
    pub(crate) fn timers_due(&mut self, now: u64) {
        let due = self.timers.take_due(now);
        for (timer, slot) in [(Timer::A, 0), (Timer::B, 1)] {
            if due.has(timer) {
                self.face.timers[slot].fire(now);
            }
        }
        for (timer, source) in [(Timer::A, Source::TimerA), (Timer::OptionSync, Source::SyncOption)] {
            if due.has(timer) {
                self.triggers.pulse(&self.face, source, now);
            }
        }
        for (timer, event) in
            [(Timer::Cpu1, 0), (Timer::A, 5), (Timer::OptionSync, 11), (Timer::Cpu2, 2), (Timer::A, 6)]
        {
            if due.has(timer) {
                self.events.fire(&self.face, event, now);
            }
        }
    }

    /// Called at an edge of the SYNC signal of the CANsync network. Passes the edge to the triggers, then
    /// raises event 12.
    #[inline]
    pub(crate) fn sync_net(&mut self, now: u64) {
        self.sync_net = true;
        self.triggers.pulse(&self.face, Source::SyncNet, now);
        self.events.fire(&self.face, 12, now);
    }

    /// Called when the drive has process data for the BAPS. Raises event 4 or 8. At most one of these events
    /// is enabled.
    #[inline]
    pub(crate) fn baps(&mut self, now: u64) {
        self.events.fire(&self.face, 8, now);
        self.events.fire(&self.face, 4, now);
    }

    /// Handles pulses of the option card in slot 1 or 2. First pulses the triggers, then raises event 11.
    pub(crate) fn option_card(&mut self, slot: u8, pulses: CardPulses, now: u64) {
        if pulses.interrupt {
            let source = if slot == 1 { Source::InterruptOption1 } else { Source::InterruptOption2 };
            self.triggers.pulse(&self.face, source, now);
        }
        if pulses.sync {
            self.triggers.pulse(&self.face, Source::SyncOption, now);
            self.events.fire(&self.face, 11, now);
        }
    }

    /// Returns the pulses for option cards since the last call.
    pub(crate) fn take_card_pulses(&mut self) -> ControllerPulses {
        ControllerPulses {
            triggers: core::mem::take(&mut self.triggers.card_pulsed),
            sync_net: core::mem::take(&mut self.sync_net),
        }
    }

    /// True if the trigger controller of the drive was pulsed since the last call.
    #[inline]
    pub(crate) fn take_controller_pulse(&mut self) -> bool {
        core::mem::take(&mut self.triggers.controller_pulsed)
    }

    /// Returns the interrupt events.
    #[inline]
    pub(crate) fn events(&mut self) -> &mut Events {
        &mut self.events
    }
}

fn report(ctx: &mut Context, what: BoardEvent) {
    let plc = ctx.origin.plc;
    ctx.report(OnBoard { plc, what });
}
