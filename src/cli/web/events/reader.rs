//! The events of one reader.

use super::feed::{StateKind, Wish, overlaps};
use super::round::{Counts, Round};
use crate::cli::peek::RegisterReading;
use crate::journal::{By, Change};
use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::sync::Arc;

/// The data that a reader already has. The reader receives only new data.
pub(super) struct Reader {
    wish: Wish,
    clock: String,
    states: BTreeMap<StateKind, Arc<str>>,
    /// The values by the names of the wish.
    values: HashMap<String, Vec<Shown>>,
    /// Number of changes and records that the reader has received, or that it did not request.
    seen: Option<Counts>,
    /// Number of rounds that the reader has missed since its last event.
    missed: u64,
    is_at_end: bool,
}

/// The parts of a register's value that a page shows. The last part is the time of its last change, for registers
/// whose changes the reader does not get.
type Shown = (String, String, String, bool, Option<u64>);

fn shown(reading: &RegisterReading, changed_us: Option<u64>) -> Shown {
    (reading.register.clone(), reading.hex.clone(), reading.meaning.clone(), reading.forced, changed_us)
}

/// A reading as an event.
#[derive(Serialize)]
struct Value<'a> {
    #[serde(flatten)]
    reading: &'a RegisterReading,
    /// Emulated time of the last change in this round.
    #[serde(skip_serializing_if = "Option::is_none")]
    changed_us: Option<u64>,
}

/// Returns the time of the last change of a register in a round.
fn changed_us(round: &Round, reading: &RegisterReading) -> Option<u64> {
    // When the plant has gone back, the emulator also reports the differences as changes, although no program has
    // stored them.
    let is_stored = |change: &&Change| {
        !(round.is_turned() && change.what.how.by == By::Channel && change.time_us == round.time_us)
    };
    let changes = round.last_changes.values().filter(|change| overlaps(&change.what, &reading.stretch));
    changes.filter(is_stored).map(|change| change.time_us).max()
}

impl Reader {
    pub(super) fn new(wish: Wish) -> Self {
        let (clock, states, values) = (String::new(), BTreeMap::new(), HashMap::new());
        Self { wish, clock, states, values, seen: None, missed: 0, is_at_end: false }
    }

    /// Notes that the reader was too slow and has missed this number of rounds.
    pub(super) fn miss(&mut self, rounds: u64) {
        self.missed += rounds;
    }

    /// True after the last event.
    pub(super) fn is_at_end(&self) -> bool {
        self.is_at_end
    }

    /// Formats the events of a round as server-sent events.
    pub(super) fn events(&mut self, round: &Round) -> String {
        let mut text = String::new();
        self.add_lost(&mut text, round);
        if let Some(end) = &round.end {
            self.is_at_end = true;
            let form = json!({ "reason": end.reason, "complete": end.is_complete });
            add(&mut text, "ended", &form.to_string());
            return text;
        }
        if let Some(begin) = round.turn_begin {
            add(&mut text, "turned", &json!({ "time_us": round.time_us, "begin": begin }).to_string());
        }
        if self.wish.clock && self.clock != round.clock {
            self.clock.clone_from(&round.clock);
            add(&mut text, "clock", &round.clock);
        }
        for kind in &self.wish.states {
            let Some(new) = round.states.get(kind) else { continue };
            if self.states.get(kind) != Some(new) {
                self.states.insert(*kind, Arc::clone(new));
                add(&mut text, kind.name(), new);
            }
        }
        self.add_values(&mut text, round);
        let changes = round.changes.iter().filter(|(change, _)| self.wish.follows(&change.what));
        add_list(&mut text, "changes", "changes", changes.map(|(_, form)| form));
        if let Some(kinds) = &self.wish.journal {
            let records = round.records.iter().filter(|(kind, _)| kinds.is_empty() || kinds.contains(*kind));
            add_list(&mut text, "journal", "records", records.map(|(_, form)| form));
        }
        text
    }

    fn add_lost(&mut self, text: &mut String, round: &Round) {
        let (changes, records) = (round.changes.len() as u64, round.records.len() as u64);
        let end = Counts { changes: round.before.changes + changes, records: round.before.records + records };
        let seen = self.seen.replace(end).unwrap_or(round.before);
        let rounds = core::mem::take(&mut self.missed);
        let mut lost = round.lost;
        lost.changes += round.before.changes.saturating_sub(seen.changes);
        lost.records += round.before.records.saturating_sub(seen.records);
        if self.wish.followed.is_empty() {
            lost.changes = 0;
        }
        if self.wish.journal.is_none() {
            lost.records = 0;
        }
        if rounds > 0 || lost != Counts::default() {
            let form = json!({"rounds": rounds, "changes": lost.changes, "records": lost.records});
            add(text, "lost", &form.to_string());
        }
    }

    fn add_values(&mut self, text: &mut String, round: &Round) {
        let mut new = Vec::new();
        let is_followed = |text: &str| self.wish.followed.iter().any(|followed| followed.text == text);
        let followed = self.wish.followed.iter().map(|followed| (followed, true));
        let shown_only = self.wish.shown.iter().filter(|shown| !is_followed(&shown.text));
        for (register, is_followed) in followed.chain(shown_only.map(|shown| (shown, false))) {
            let Some(readings) = round.values.get(&register.text) else { continue };
            let before = self.values.entry(register.text.clone()).or_default();
            before.truncate(readings.len());
            for (index, reading) in readings.iter().enumerate() {
                let changed = if is_followed { None } else { changed_us(round, reading) };
                // Without a change in this round, the time of the last change stays valid.
                let last = before.get(index).and_then(|it| it.4).filter(|_| !round.is_turned());
                let now = shown(reading, changed.or(last));
                match before.get_mut(index) {
                    Some(known) if *known == now => continue,
                    Some(known) => *known = now,
                    None => before.push(now),
                }
                new.push(Value { reading, changed_us: changed });
            }
        }
        if !new.is_empty() {
            // Serializing to a string fails for no value.
            let values = serde_json::to_string(&new).unwrap_or_default();
            add(text, "values", &format!("{{\"time_us\":{},\"values\":{values}}}", round.time_us));
        }
    }
}

/// Adds an event. `data` is one line of JSON.
fn add(text: &mut String, event: &str, data: &str) {
    // Writing to a string cannot fail.
    let _ = write!(text, "event: {event}\ndata: {data}\n\n");
}

/// Adds an event with a list, unless the list is empty.
fn add_list<'a>(text: &mut String, event: &str, field: &str, items: impl Iterator<Item = &'a String>) {
    let items: Vec<_> = items.map(String::as_str).collect();
    if !items.is_empty() {
        add(text, event, &format!("{{\"{field}\":[{}]}}", items.join(",")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(before: u64, records: usize) -> Round {
        let records = (0..records).map(|number| ("frame", format!("{{\"n\":{number}}}"))).collect();
        let before = Counts { changes: 0, records: before };
        Round { clock: "{\"time_us\":1}".to_owned(), records, before, ..Round::default() }
    }

    fn reader() -> Reader {
        Reader::new(Wish { clock: true, journal: Some(Default::default()), ..Wish::default() })
    }

    #[test]
    fn a_reader_gets_only_what_is_new() {
        let mut reader = reader();
        let first = reader.events(&round(7, 1));
        assert!(first.contains("event: clock\n") && first.contains("{\"records\":[{\"n\":0}]}"), "{first}");
        assert_eq!(reader.events(&round(8, 0)), "");
    }

    #[test]
    fn a_slow_reader_learns_its_losses() {
        let mut reader = reader();
        reader.events(&round(0, 2));
        reader.miss(3);
        let text = reader.events(&round(12, 1));
        assert!(
            text.starts_with("event: lost\ndata: {\"changes\":0,\"records\":10,\"rounds\":3}\n\n"),
            "{text}"
        );
        assert!(text.contains("event: journal"), "{text}");
        let quiet = reader.events(&round(13, 1));
        assert!(!quiet.contains("lost"), "{quiet}");
    }

    #[test]
    fn the_end_is_the_last_event() {
        let mut reader = reader();
        reader.events(&round(0, 2));
        let sent = Counts { changes: 0, records: 2 };
        let text = reader.events(&Round::end("gone".to_owned(), true, sent));
        assert_eq!(text, "event: ended\ndata: {\"complete\":true,\"reason\":\"gone\"}\n\n");
        assert!(reader.is_at_end());
    }

    #[test]
    fn a_slow_reader_learns_at_the_end_what_it_has_lost() {
        let mut reader = reader();
        reader.events(&round(0, 2));
        reader.miss(1);
        let sent = Counts { changes: 0, records: 7 };
        let text = reader.events(&Round::end("gone".to_owned(), true, sent));
        let lost = "event: lost\ndata: {\"changes\":0,\"records\":5,\"rounds\":1}\n\nevent: ended\n";
        assert!(text.starts_with(lost), "{text}");
    }
}
