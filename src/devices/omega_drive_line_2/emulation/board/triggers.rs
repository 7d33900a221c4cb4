//! Triggers: the connections from sources of pulses to the units that are triggered, and `OPT_INIT` (manual 5.00005.03a
//! p. 56-59).

use super::timers::{Timer, Timers};
use crate::memory::header::{OptInit, OptInitResult, TRIGGERS, TimerSetup, Trigger};
use crate::memory::{FirmwareHeader, Header};
use serde::{Deserialize, Serialize};

/// A source of trigger pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Source {
    /// SYNC signal of an option card.
    SyncOption,
    /// SYNC signal of the CANsync network.
    SyncNet,
    /// Timer A of the board.
    TimerA,
    /// Interrupt of the option card in slot 1.
    InterruptOption1,
    /// Interrupt of the option card in slot 2.
    InterruptOption2,
}

/// Divider for the shortest period of a board timer, 50 us. No PLC can follow a shorter period (decision
/// D-183).
const MIN_DIVIDER: u32 = 124;

/// The routes of a PLC.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Triggers {
    routes: [Option<Source>; TRIGGERS],
    /// True if `OPT_INIT` has been run.
    routed: bool,
    /// True if `OPT_INIT` has already run in this start of the program, so it must not run again.
    closed: bool,
    /// True if the trigger controller was pulsed.
    pub controller_pulsed: bool,
    /// Pulses of triggers 1 and 2: true if the trigger was pulsed. The plant takes the pulses at the moment
    /// at which they occur, so a snapshot does not contain them.
    #[serde(skip)]
    pub card_pulsed: [bool; 2],
}

impl Triggers {
    /// Passes a pulse of `source` to the units that are connected to it.
    #[inline]
    pub(crate) fn pulse(&mut self, header: &Header, source: Source, now: u64) {
        if !self.routed {
            return;
        }
        for (index, (route, slot)) in self.routes.iter().zip(&header.triggers).enumerate() {
            if *route == Some(source) {
                slot.fire(now);
                if let Some(pulsed) = self.card_pulsed.get_mut(index) {
                    *pulsed = true;
                }
            }
        }
        self.controller_pulsed |= self.routes[Trigger::Controller as usize] == Some(source);
    }

    /// Called when the program restarts. Its start task may then run `OPT_INIT` again (decision D-260).
    pub(crate) fn permit(&mut self) {
        self.closed = false;
    }

    /// Answers a pending `OPT_INIT`; returns its result.
    pub(crate) fn look(
        &mut self,
        now: u64,
        face: &FirmwareHeader,
        timers: &mut Timers,
    ) -> Option<OptInitResult> {
        let request = face.requested().opt_init.request.load();
        if request == face.opt_init.answer.load() {
            return None;
        }
        let result = self.set(now, &face.requested().opt_init, timers);
        face.opt_init.answer(request, result);
        Some(result)
    }

    fn set(&mut self, now: u64, asked: &OptInit, timers: &mut Timers) -> OptInitResult {
        if self.closed {
            return OptInitResult::AlreadyRun;
        }
        let [one, two, controller] = &asked.triggers;
        let (Some(one), Some(two), Some(controller)) =
            (option_mode(one.load()), option_mode(two.load()), controller_mode(controller.load()))
        else {
            return OptInitResult::BadTrigger;
        };
        let [Some(a), Some(b)] = [0, 1].map(|n| period(&asked.timers[n])) else {
            return OptInitResult::BadTimer;
        };
        for (timer, period) in [(Timer::A, a), (Timer::B, b)] {
            match period {
                Some(period) => timers.start(timer, now, period),
                None => timers.stop(timer),
            }
        }
        let routes = [one, two, controller];
        *self = Triggers { routes, routed: true, closed: true, controller_pulsed: false, ..*self };
        OptInitResult::Done
    }
}

/// Decodes the mode of trigger 1 or 2 (manual p. 58). 0 means that no source is connected: the inner `None`.
/// The outer `None` means a reserved mode.
fn option_mode(mode: u32) -> Option<Option<Source>> {
    match mode {
        0 => Some(None),
        2 => Some(Some(Source::SyncOption)),
        3 => Some(Some(Source::SyncNet)),
        4 => Some(Some(Source::TimerA)),
        6 => Some(Some(Source::InterruptOption1)),
        _ => None,
    }
}

/// Decodes the mode of the trigger controller (manual p. 58). The outer `None` means a reserved mode.
fn controller_mode(mode: u32) -> Option<Option<Source>> {
    match mode {
        0 => Some(Some(Source::SyncOption)),
        1 => Some(Some(Source::SyncNet)),
        2 => Some(Some(Source::TimerA)),
        4 => Some(Some(Source::InterruptOption1)),
        5 => Some(Some(Source::InterruptOption2)),
        _ => None,
    }
}

/// Returns the period of a board timer in ticks of 5 MHz: (divider + 1) x 2 (manual p. 50, 58). The inner
/// `None` means that the timer is not started. The outer `None` means that the inputs are refused.
fn period(setup: &TimerSetup) -> Option<Option<u64>> {
    let divider = setup.divider.load();
    match (setup.enable.load(), setup.cfg_mode.load()) {
        (0, _) => Some(None),
        (1, 0) if (MIN_DIVIDER..=0xFFFF).contains(&divider) => Some(Some((u64::from(divider) + 1) * 2)),
        _ => None,
    }
}
