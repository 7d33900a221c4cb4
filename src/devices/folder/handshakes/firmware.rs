//! The firmware that the tables describe.

use super::Row;
use super::rule::{Change, Rule};
use crate::devices::Context;
use crate::devices::folder::card::{Card, Place};
use crate::devices::folder::own_faults::FaultChange;
use crate::devices::folder::part::Part;
use crate::journal::Handshake;
use serde::{Deserialize, Serialize};

/// Firmware of a device in a folder: polls the registers of the tables, and acts at the times in them.
pub(crate) struct Handshakes {
    rows: &'static [Row],
    /// State of each row.
    steps: Vec<Step>,
    /// True if the last poll changed a register, because another row may read it.
    has_moved: bool,
}

crate::snapshot_fields!(Handshakes { values: steps, has_moved; built: rows });

/// State of a row.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Step {
    /// Time of the next action, in microseconds.
    due: Option<u64>,
    phase: Phase,
    /// Last value that the program wrote into the register of a watchdog.
    seen: u32,
    /// Bits of a toggle table that wait for their acknowledgement. Each has the time of its acknowledgement.
    bits: Vec<(u32, u64)>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    /// Waits for the program.
    #[default]
    Idle,
    /// For an answer: the firmware has seen the request. For a watchdog: the watchdog is running.
    Running,
    /// For an answer: the first value was written, and a second value will follow. For a watchdog: the
    /// watchdog has expired.
    Second,
}

impl Handshakes {
    pub(crate) fn new(rows: &'static [Row]) -> Self {
        Handshakes { rows, steps: vec![Step::default(); rows.len()], has_moved: true }
    }

    /// Applies `f` to each row and to the state of the row.
    fn each(&mut self, mut f: impl FnMut(&Row, &mut Step)) {
        for (row, step) in self.rows.iter().zip(&mut self.steps) {
            f(row, step);
        }
    }
}

impl Part for Handshakes {
    fn start(&mut self, ctx: &mut Context, card: &mut Card) {
        self.has_moved = true;
        self.each(|row, step| {
            *step = Step::default();
            match &row.rule {
                Rule::Ready { after_us, .. } => step.due = Some(ctx.now.saturating_add(*after_us)),
                Rule::Counter { every_us, .. } => step.due = Some(ctx.now.saturating_add(*every_us)),
                Rule::Watchdog { at, .. } => step.seen = card.load(*at),
                _ => {}
            }
        });
    }

    fn look(&mut self, ctx: &mut Context, card: &mut Card) {
        let mut has_moved = false;
        self.each(|row, step| {
            if is_disturbed(row, card) {
                suspend(&row.rule, step);
            } else {
                has_moved |= poll(&row.rule, step, card, ctx);
            }
            if step.due.is_some_and(|due| due <= ctx.now) {
                fire(row, step, card, ctx);
                has_moved = true;
            }
        });
        self.has_moved = has_moved;
    }

    fn is_quiescent(&self) -> bool {
        !self.has_moved
    }

    fn next_time(&self) -> u64 {
        self.steps.iter().filter_map(|step| step.due).min().unwrap_or(u64::MAX)
    }

    fn due(&mut self, ctx: &mut Context, card: &mut Card) {
        self.has_moved = true;
        self.each(|row, step| {
            if is_disturbed(row, card) {
                suspend(&row.rule, step);
            }
            if step.due.is_some_and(|due| due <= ctx.now) {
                fire(row, step, card, ctx);
            }
        });
    }

    fn fault(&mut self, _: &mut Context, _: &mut Card, _: &FaultChange) {
        self.has_moved = true;
    }
}

/// True if a fault acts that disturbs the behaviour of this row.
fn is_disturbed(row: &Row, card: &Card) -> bool {
    row.unless_fault().is_some_and(|fault| card.has_fault(fault))
}

/// Called while a fault disturbs the row: forgets what the program waits for. When the fault ends, the time
/// of an answer or acknowledgement starts again. A second value that follows an answer still comes as usual.
fn suspend(rule: &Rule, step: &mut Step) {
    match rule {
        Rule::Answer { .. } if step.phase != Phase::Second => step.due = None,
        Rule::Toggle { .. } => {
            step.bits.clear();
            step.due = None;
        }
        _ => {}
    }
}

/// Handles writes of the program. Returns true if a register has changed.
fn poll(rule: &Rule, step: &mut Step, card: &mut Card, ctx: &mut Context) -> bool {
    match rule {
        Rule::Ready { .. } | Rule::Counter { .. } | Rule::Image => {}
        Rule::Answer { at, answer, .. }
            if step.phase == Phase::Second && card.load(*at) == u32::from(*answer) => {}
        Rule::Answer { at, request, after_us, .. } => {
            // If the program has replaced the answer, no second value follows it.
            if step.phase == Phase::Second {
                *step = Step::default();
            }
            // If the program has withdrawn its request, the time starts again with the next request.
            let is_wanted = card.load(*at) == u32::from(*request);
            step.due = is_wanted.then(|| step.due.unwrap_or(ctx.now.saturating_add(*after_us)));
        }
        Rule::Toggle { from, to, bits, after_us } => {
            let pending = (card.load(*from) ^ card.load(*to)) & bits;
            // If the program has taken back a bit, this bit gets no acknowledgement.
            step.bits.retain(|(bit, _)| pending & bit != 0);
            let known = step.bits.iter().fold(0, |all, (bit, _)| all | bit);
            let due = ctx.now.saturating_add(*after_us);
            step.bits.extend(single_bits(pending & !known).map(|bit| (bit, due)));
            step.due = step.bits.iter().map(|(_, due)| *due).min();
        }
        Rule::Watchdog { at, within_us, recovered, .. } => {
            let value = card.load(*at);
            if value != step.seen {
                if step.phase == Phase::Second {
                    apply(recovered, ctx, card);
                }
                let due = Some(ctx.now.saturating_add(*within_us));
                *step = Step { due, phase: Phase::Running, seen: value, ..Step::default() };
                return true;
            }
        }
        Rule::Mirror { pairs } => {
            let mut copy = |(from, to): &(Place, Place)| {
                let value = card.load(*from);
                let (before, now) = card.update(*to, |_| value);
                before != now
            };
            return pairs.iter().fold(false, |any, pair| any | copy(pair));
        }
    }
    false
}

/// Carries out an action of a row, at its time.
fn fire(row: &Row, step: &mut Step, card: &mut Card, ctx: &mut Context) {
    let due = step.due.take();
    match &row.rule {
        Rule::Ready { state, .. } => apply(state, ctx, card),
        Rule::Answer { at, request, answer, then, state, .. } => {
            let (from, to) = match (step.phase, then) {
                (Phase::Second, Some((then, _))) => (*answer, *then),
                _ => (*request, *answer),
            };
            let is_second = step.phase == Phase::Second;
            step.phase = Phase::Idle;
            if card.load(*at) != u32::from(from) {
                return;
            }
            // The state is written before the answer. So a program that sees the answer also sees the new
            // state.
            if !is_second {
                apply(state, ctx, card);
            }
            if card.exchange(*at, from.into(), to.into()) {
                let more_answers_follow = !is_second && then.is_some();
                let (origin, offset) = card.located(*at, ctx.origin);
                ctx.report(Handshake { origin, offset, request: from, answer: to, more_answers_follow });
                if let Some((_, after_us)) = then.filter(|_| more_answers_follow) {
                    let due = Some(ctx.now.saturating_add(after_us));
                    *step = Step { due, phase: Phase::Second, ..Step::default() };
                }
            }
        }
        Rule::Toggle { from, to, .. } => {
            let is_due = |(_, due): &&(u32, u64)| *due <= ctx.now;
            let bits = step.bits.iter().filter(is_due).fold(0, |all, (bit, _)| all | bit);
            step.bits.retain(|(_, due)| *due > ctx.now);
            step.due = step.bits.iter().map(|(_, due)| *due).min();
            let wanted = card.load(*from) & bits;
            card.show(ctx, *to, |value| (value & !bits) | wanted);
        }
        Rule::Counter { at, every_us } => {
            if !is_disturbed(row, card) {
                card.update(*at, |value| value.wrapping_add(1));
            }
            step.due = due.map(|due| due.saturating_add(*every_us));
        }
        Rule::Watchdog { state, .. } => {
            step.phase = Phase::Second;
            apply(state, ctx, card);
        }
        Rule::Mirror { .. } | Rule::Image => {}
    }
}

/// Returns the bits of a mask, each as a mask.
fn single_bits(mask: u32) -> impl Iterator<Item = u32> {
    (0..u32::BITS).map(|bit| 1 << bit).filter(move |bit| mask & bit != 0)
}

fn apply(changes: &[Change], ctx: &mut Context, card: &mut Card) {
    changes.iter().for_each(|change| change.apply(ctx, card));
}
