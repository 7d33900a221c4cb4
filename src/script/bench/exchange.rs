//! Selects the exchanges between program, firmware and bus that may have led to a failure. The report draws them as a
//! picture.
//!
//! The last steps often show only the time after the error. So the picture has one line for repeated steps. It also
//! contains the steps before the first finding, and the last two repetitions of each handshake.

use super::{Bench, line};
use crate::devices;
use crate::identity::DeviceIndex;
use crate::journal::text::Text;
use crate::journal::{Changed, ChannelWrite, Event, Format, Found, Record};
use crate::plural::plural;
use crate::script::ScenarioError;
use crate::script::failure::{ExchangeKind, ExchangeStep, JournalLine};
use crate::time::seconds;
use core::ops::Range;
use std::collections::{HashMap, HashSet};

/// Number of journal records that are searched.
const LOOK_BACK: u64 = 4096;
/// Number of lines at the end that are always in the picture.
const LAST: usize = 24;
/// Maximum count of lines in the picture.
const MOST: usize = 72;
/// Number of steps that are shown before and after each selected step.
const BESIDE: usize = 2;
/// Number of steps before the first finding.
const BEFORE_FINDING: usize = 8;
/// Number of repetitions that are shown of each handshake.
const REPETITIONS: usize = 2;
/// Maximum length, in steps, of a pattern that can be shown once for several repetitions.
const LONGEST: usize = 24;
/// Minimum number of repetitions that become one line.
const OFTEN: usize = 3;

/// A register: number of the PLC, and offset.
type RegisterKey = (DeviceIndex, u32);

/// A line of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PictureLine {
    /// The step with this index.
    Step(usize),
    /// The preceding lines are repeated: number of further repetitions, and index of their last step.
    Again(usize, usize),
}

impl Bench {
    /// Returns the exchanges of program, firmware and bus that may have led to the present state, oldest first.
    pub(super) fn last_exchanges(&mut self) -> Result<Vec<ExchangeStep>, ScenarioError> {
        let from = self.journal_end()?.saturating_sub(LOOK_BACK);
        let (records, _) = self.records(from)?;
        let mut text = Text::new(self.names.clone(), devices::catalogue());
        let changed = records.iter().filter_map(|record| record.event.get::<Changed>());
        let recorded: HashSet<_> = changed.map(|change| (change.plc, change.offset)).collect();
        // If a register is recorded, its changes already show the request and the answer. The record of the handshake
        // is then left out.
        let is_repeated = |record: &Record| {
            !record.event.is::<Changed>() && register(&record.event).is_some_and(|it| recorded.contains(&it))
        };
        let mut steps = Vec::new();
        for record in &records {
            match ExchangeKind::of(record).filter(|_| !is_repeated(record)) {
                Some(kind) => {
                    steps.push((record.event, ExchangeStep { kind, line: line(record, &mut text) }))
                }
                None => text.skip(record),
            }
        }
        // The journal returns a counted record when its count has ended, so steps are sorted by time.
        steps.sort_by_key(|(_, step)| step.line.time_us);
        Ok(picture(&steps))
    }
}

/// Returns the register to which an event refers.
fn register(event: &Event) -> Option<RegisterKey> {
    let changed = event.get().map(|Changed { plc, offset, .. }| (plc, offset));
    let written = || event.get().map(|ChannelWrite { plc, offset, .. }| (plc, offset));
    let found = || event.get().map(|Found { plc, offset, .. }| (plc, offset));
    let stored = || event.stored().map(|stored| (stored.plc, stored.offset));
    changed.or_else(written).or_else(found).or_else(stored)
}

/// Returns the lines of the picture.
fn picture(steps: &[(Event, ExchangeStep)]) -> Vec<ExchangeStep> {
    let keys: Vec<_> = steps.iter().map(|(event, _)| *event).collect();
    let pieces = folded(&keys);
    let of = |piece: &PictureLine| match piece {
        PictureLine::Step(step) => Some((steps[*step].1.kind, register(&steps[*step].0))),
        PictureLine::Again(..) => None,
    };
    let line_steps: Vec<_> = pieces.iter().map(of).collect();
    let is_finding =
        |piece: &PictureLine| matches!(piece, PictureLine::Step(step) if steps[*step].0.is::<Found>());
    let shown = chosen(&line_steps, pieces.iter().position(is_finding));
    let (mut lines, mut left_out) = (Vec::new(), 0);
    for (number, piece) in pieces.iter().enumerate() {
        if !shown[number] {
            left_out += 1;
            continue;
        }
        let (PictureLine::Step(step) | PictureLine::Again(_, step)) = piece;
        let at_us = steps[*step].1.line.time_us;
        if core::mem::take(&mut left_out) > 0 {
            lines.push(note_line(at_us, "...".to_owned()));
        }
        lines.push(match piece {
            PictureLine::Step(_) => steps[*step].1.clone(),
            PictureLine::Again(times, _) => {
                note_line(at_us, format!("the same {} more, up to here", plural(*times as u64, "time")))
            }
        });
    }
    lines
}

/// Returns a line in place of steps that are omitted.
fn note_line(time_us: u64, what: String) -> ExchangeStep {
    let line = JournalLine { time_us, kind: String::new(), text: format!("{}  {what}", seconds(time_us)) };
    ExchangeStep { kind: ExchangeKind::More, line }
}

/// Replaces repetitions of a pattern of steps by one line.
fn folded<K: PartialEq>(keys: &[K]) -> Vec<PictureLine> {
    let (mut pieces, mut at) = (Vec::new(), 0);
    while at < keys.len() {
        let rest = &keys[at..];
        let times = |len: &usize| rest.chunks(*len).take_while(|chunk| *chunk == &rest[..*len]).count();
        let patterns = (1..=LONGEST.min(rest.len())).map(|len| (len, times(&len)));
        // If several patterns save the same number of lines, the shortest one is used.
        let best =
            patterns.filter(|(_, times)| *times >= OFTEN).rev().max_by_key(|(len, times)| len * (times - 1));
        let (len, times) = best.unwrap_or((1, 1));
        pieces.extend((at..at + len).map(PictureLine::Step));
        at += len * times;
        if times > 1 {
            pieces.push(PictureLine::Again(times - 1, at - 1));
        }
    }
    pieces
}

/// Chooses the lines to show. `line_steps` has the kind and the register of each line. `finding` is the index of the
/// first finding.
fn chosen(line_steps: &[Option<(ExchangeKind, Option<RegisterKey>)>], finding: Option<usize>) -> Vec<bool> {
    let mut shown = vec![false; line_steps.len()];
    shown.iter_mut().rev().take(LAST).for_each(|shown| *shown = true);
    let handshakes = handshakes(line_steps);
    let mut wanted: Vec<Range<usize>> = Vec::new();
    if let Some(finding) = finding {
        wanted.push(finding.saturating_sub(BEFORE_FINDING)..finding + 1);
        let register = line_steps[finding].and_then(|(_, register)| register);
        let before = register.and_then(|register| handshakes.get(&register));
        let before = before.and_then(|all| all.iter().rfind(|range| range.end <= finding));
        wanted.extend(before.cloned());
    }
    let mut last: Vec<_> =
        handshakes.into_values().flat_map(|all| all.into_iter().rev().take(REPETITIONS)).collect();
    last.sort_by_key(|range| core::cmp::Reverse(range.end));
    wanted.extend(last);
    for range in wanted {
        let range = range.start.saturating_sub(BESIDE)..(range.end + BESIDE).min(line_steps.len());
        let new = shown[range.clone()].iter().filter(|shown| !**shown).count();
        if shown.iter().filter(|shown| **shown).count() + new <= MOST {
            shown[range].fill(true);
        }
    }
    shown
}

/// Returns the handshakes by register: ranges from the program's request to the firmware's answer.
fn handshakes(
    line_steps: &[Option<(ExchangeKind, Option<RegisterKey>)>],
) -> HashMap<RegisterKey, Vec<Range<usize>>> {
    let (mut asked, mut all) = (HashMap::new(), HashMap::<_, Vec<_>>::new());
    for (number, line_step) in line_steps.iter().enumerate() {
        match line_step {
            Some((ExchangeKind::Program, Some(register))) => {
                asked.insert(*register, number);
            }
            Some((ExchangeKind::Firmware, Some(register))) => {
                if let Some(begin) = asked.remove(register) {
                    all.entry(*register).or_default().push(begin..number + 1);
                }
            }
            _ => {}
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repetitions_are_shown_once() {
        use PictureLine::{Again, Step};
        assert_eq!(folded(&[1, 2, 1, 2, 1, 2, 3]), [Step(0), Step(1), Again(2, 5), Step(6)]);
        assert_eq!(folded(&[1, 1, 2, 2]), [Step(0), Step(1), Step(2), Step(3)]);
        assert_eq!(folded(&[7; 9]), [Step(0), Again(8, 8)]);
        assert_eq!(folded::<u8>(&[]), []);
    }

    fn program(register: u32) -> Option<(ExchangeKind, Option<RegisterKey>)> {
        Some((ExchangeKind::Program, Some((DeviceIndex(0), register))))
    }

    fn firmware(register: u32) -> Option<(ExchangeKind, Option<RegisterKey>)> {
        Some((ExchangeKind::Firmware, Some((DeviceIndex(0), register))))
    }

    #[test]
    fn the_last_repetitions_of_a_handshake_are_shown_despite_later_steps() {
        let mut line_steps = Vec::new();
        for _ in 0..4 {
            line_steps.extend([Some((ExchangeKind::Bus, None)); 5]);
            line_steps.extend([program(9), firmware(9)]);
        }
        line_steps.extend([Some((ExchangeKind::Bus, None)); 60]);
        let shown = chosen(&line_steps, None);
        let at = |number: usize| 7 * number + 5;
        assert!(!shown[at(1)] && shown[at(2)] && shown[at(2) + 1] && shown[at(3)] && shown[at(3) + 1]);
        assert!(!shown[50] && shown[line_steps.len() - LAST] && shown[line_steps.len() - 1]);
    }

    #[test]
    fn a_finding_is_shown_with_preceding_steps_and_the_last_good_handshake() {
        let mut line_steps = vec![program(1), firmware(1)];
        line_steps.extend([Some((ExchangeKind::Bus, None)); 30]);
        line_steps.extend([program(1), Some((ExchangeKind::Wrong, Some((DeviceIndex(0), 1)))), firmware(1)]);
        line_steps.extend([Some((ExchangeKind::Bus, None)); 100]);
        let shown = chosen(&line_steps, Some(33));
        assert!(shown[0] && shown[1] && shown[32] && shown[33] && shown[33 - BEFORE_FINDING]);
        assert!(!shown[15] && !shown[60]);
    }

    #[test]
    fn a_picture_has_an_end() {
        let line_steps: Vec<_> =
            (0..500).flat_map(|register| [program(register), firmware(register)]).collect();
        let shown = chosen(&line_steps, Some(3)).into_iter().filter(|shown| *shown).count();
        assert!((LAST..=MOST).contains(&shown), "{shown}");
    }
}
