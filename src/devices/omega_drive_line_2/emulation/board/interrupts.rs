//! Interrupt events: the enabled events, and `INTR_SET` (manual 5.00005.03a p. 43, 47-50).

use super::timers::{CPU_STEP, Timer, Timers};
use crate::devices::Context;
use crate::devices::Events;
use crate::memory::FirmwareHeader;
use crate::memory::header::InterruptResult;

/// Returns the interrupt level of an event; level 14 has priority over level 13. `None` if the event number
/// is reserved (manual p. 43, 48).
pub(crate) fn level(event: usize) -> Option<u8> {
    match event {
        0 | 5 | 8 | 11 | 12 => Some(14),
        2 | 4 | 6 => Some(13),
        _ => None,
    }
}

/// Returns the event that must not be enabled together with `event` (manual p. 48).
fn excluded_by(event: usize) -> Option<usize> {
    match event {
        4 => Some(8),
        8 => Some(4),
        11 => Some(12),
        12 => Some(11),
        _ => None,
    }
}

/// Answers the pending requests.
pub(super) fn look(events: &mut Events, ctx: &mut Context, face: &FirmwareHeader, timers: &mut Timers) {
    let now = ctx.now;
    events.answer(ctx, face, |events, event, factor, enable| set(events, event, factor, enable, now, timers));
}

fn set(
    events: &mut Events,
    event: usize,
    factor: i16,
    enable: bool,
    now: u64,
    timers: &mut Timers,
) -> InterruptResult {
    if level(event).is_none() {
        return InterruptResult::NoSuchEvent;
    }
    let timer = match event {
        0 => Some(Timer::Cpu1),
        2 => Some(Timer::Cpu2),
        _ => None,
    };
    let bit = 1u16 << event;
    if !enable {
        events.enabled &= !bit;
        timer.into_iter().for_each(|timer| timers.stop(timer));
        return InterruptResult::Done;
    }
    if excluded_by(event).is_some_and(|other| events.enabled & 1 << other != 0) {
        return InterruptResult::Excluded;
    }
    if let Some(timer) = timer {
        if factor < 1 {
            return InterruptResult::BadFactor;
        }
        timers.start(timer, now, u64::from(factor.unsigned_abs()) * CPU_STEP);
    }
    events.enabled |= bit;
    InterruptResult::Done
}
