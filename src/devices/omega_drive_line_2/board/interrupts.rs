//! Interrupt events: which are enabled, and `INTR_SET` (manual 5.00005.03a p. 43, 47-50).

use super::report;
use super::timers::{CPU_STEP, Timer, Timers};
use crate::devices::Context;
use crate::devices::omega_drive_line_2::records::BoardEvent;
use crate::memory::Header;
use crate::memory::header::InterruptResult;

/// Interrupt level of an event number, 14 before 13; `None`: reserved (manual p. 43, 48).
pub fn level(event: usize) -> Option<u8> {
    match event {
        0 | 5 | 8 | 11 | 12 => Some(14),
        2 | 4 | 6 => Some(13),
        _ => None,
    }
}

/// The event that must not be enabled together with `event` (manual p. 48).
fn excluded_by(event: usize) -> Option<usize> {
    match event {
        4 => Some(8),
        8 => Some(4),
        11 => Some(12),
        12 => Some(11),
        _ => None,
    }
}

/// Enabled events and what has become of them. Bit n stands for event n.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interrupts {
    enabled: u16,
    /// No event occurs: switch or program stand at STOP (decision D-300).
    pub held: bool,
    /// Events since somebody asked last.
    pub fired: u16,
    /// Events that stop the plant for lockstep.
    pub watched: u16,
    /// Whether a watched one has occurred.
    pub stop: bool,
}

impl Interrupts {
    /// One occurrence of an event, if it is enabled and the program may run.
    #[inline]
    pub fn fire(&mut self, header: &Header, event: usize, now: u64) {
        let bit = 1u16 << event;
        if self.enabled & bit == 0 || self.held {
            return;
        }
        if let Some(slot) = header.events.get(event) {
            slot.fire(now);
        }
        self.fired |= bit;
        self.stop |= self.watched & bit != 0;
    }

    /// As after power-on. Who watches and what has occurred stays.
    pub fn disable_all(&mut self) {
        self.enabled = 0;
    }

    /// Answers the requests that have come in, by ascending event number.
    pub fn look(&mut self, ctx: &mut Context, header: &Header, timers: &mut Timers) {
        for (event, slot) in header.interrupts.iter().enumerate() {
            let request = slot.request.load();
            if request == slot.answer.load() {
                continue;
            }
            let (factor, enable) = ((request >> 16) as u16 as i16, request & 1 != 0);
            let result = self.set(event, factor, enable, ctx.now, timers);
            slot.result.store(result.code());
            slot.answer.store(request);
            report(ctx, BoardEvent::Interrupt { event: event as u8, factor, enable, result });
        }
    }

    fn set(
        &mut self,
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
            self.enabled &= !bit;
            timer.into_iter().for_each(|timer| timers.stop(timer));
            return InterruptResult::Done;
        }
        if excluded_by(event).is_some_and(|other| self.enabled & 1 << other != 0) {
            return InterruptResult::Excluded;
        }
        if let Some(timer) = timer {
            if factor < 1 {
                return InterruptResult::BadFactor;
            }
            timers.start(timer, now, u64::from(factor.unsigned_abs()) * CPU_STEP);
        }
        self.enabled |= bit;
        InterruptResult::Done
    }
}
