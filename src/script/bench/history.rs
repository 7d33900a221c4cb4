//! Verbs for the history of registers.

use super::ask::Spot;
use super::{Bench, Recorded};
use crate::journal::{By, Changed, Journal, Keep, Record, Ring};
use crate::request::{Op, ranges};
use crate::script::{ScenarioError, Value};
use core::panic::Location;

/// A change of a recorded register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PastChange {
    /// Emulated time of the change in microseconds.
    pub time_us: u64,
    /// Value before the change, as a number of the register's type.
    pub from: i64,
    /// Value after the change.
    pub to: i64,
    /// Originator of the change.
    pub by: By,
}

impl Bench {
    /// From now on, records every change of a register, or of all registers of an area, in the journal. This does not
    /// influence the plant.
    ///
    /// # Errors
    /// There is no such register or area, the name means a single bit, or too many registers are recorded.
    pub fn record(&mut self, text: &str) -> Result<(), ScenarioError> {
        let (plc, offset, len) = match self.area(text) {
            Ok((plc, area)) => {
                (plc, area.first, area.structures.iter().map(|it| it.structure.bytes).max().unwrap_or(0))
            }
            Err(_) => {
                let Spot { plc, offset, width } = self.whole_register(text)?.spot;
                (plc, offset, width.bytes())
            }
        };
        let from = self.journal_end()?;
        self.recorded.push(Recorded { plc, bytes: offset..offset.saturating_add(len), from });
        for (offset, len) in ranges(offset, len) {
            self.ask(Op::Follow { plc, offset, len, keep: Keep::InJournal })?.written()?;
        }
        Ok(())
    }

    /// Returns the changes of a register since the first call of [`Bench::record`].
    ///
    /// # Errors
    /// There is no such register, it is a single bit, it is not recorded, or the journal no longer has all changes.
    pub fn history(&mut self, text: &str) -> Result<Vec<PastChange>, ScenarioError> {
        let register = self.whole_register(text)?;
        let past = |(time_us, change): (u64, Changed)| {
            let [from, to] = [change.from, change.to].map(|value| register.number(change.how.live, value));
            PastChange { time_us, from, to, by: change.how.by }
        };
        Ok(self.changes_of(text, register.spot)?.into_iter().map(past).collect())
    }

    /// Returns the changes of a register with their times. `text` is the name in the scenario.
    fn changes_of(
        &mut self,
        text: &str,
        Spot { plc, offset, width }: Spot,
    ) -> Result<Vec<(u64, Changed)>, ScenarioError> {
        let (records, _) = self.records(0)?;
        // Another program may have recorded the register before.
        let covers = |it: &&Recorded| it.plc == plc && it.bytes.contains(&offset);
        let from = self.recorded.iter().filter(covers).map(|it| it.from).min().unwrap_or(0);
        let kept = || records.iter().filter(|record| record.event.kind().ring() == Ring::History);
        let begin = self.journal_begin()?;
        if is_cut_off(&records, from, begin) {
            let right = "the journal may no longer have all changes since `record`, because it begins with a later snapshot, or \
                         because the plant has gone back over more records than it keeps";
            return Err(ScenarioError::Argument { text: text.to_owned(), right: right.to_owned() });
        }
        if kept().count() >= Journal::MOST_CHANGES && kept().next().is_some_and(|oldest| oldest.seq > from) {
            let right = format!(
                "the journal no longer has all changes since `record`, because it keeps {} changes of all recorded registers; \
                 record fewer registers",
                Journal::MOST_CHANGES
            );
            return Err(ScenarioError::Argument { text: text.to_owned(), right });
        }
        let change = |record: &Record| {
            Some((record.time_us, record.event.get::<Changed>()?.part(plc, offset, width)?))
        };
        let since = records.iter().filter(|record| record.seq >= from);
        let changes: Vec<_> = since.filter_map(change).collect();
        // Without a recording, an empty list would say that the register has not changed.
        if changes.is_empty() && self.ask(Op::IsRecorded { plc, offset })?.value()? == 0 {
            let right = "this register is not recorded; call `record` before the changes, and again after `back_to` a moment \
                         before the call";
            return Err(ScenarioError::Argument { text: text.to_owned(), right: right.to_owned() });
        }
        Ok(changes)
    }

    /// Expects that a register has had exactly these values, in this order, since [`Bench::record`]. The value at the
    /// call of `record` is not part of the list.
    ///
    /// # Errors
    /// The register has held other values; there is no such register, it is a single bit, it is not recorded, it cannot
    /// hold one of the values, or the journal no longer has all changes.
    #[track_caller]
    pub fn expect_history<V: Into<Value>>(
        &mut self,
        text: &str,
        values: impl IntoIterator<Item = V>,
    ) -> Result<(), ScenarioError> {
        let at = Location::caller();
        let register = self.whole_register(text)?;
        let live = self.live(&register)?;
        let bits = |value: V| value.into().bits(&register.place);
        let wanted = values.into_iter().map(bits).collect::<Result<Vec<_>, _>>()?;
        // The bits are compared: structures that overlay each other may have different types at one address.
        let held: Vec<_> =
            self.changes_of(text, register.spot)?.into_iter().map(|(_, change)| change.to).collect();
        if held == wanted {
            return Ok(());
        }
        let mut failure = self.failure(format!("{} has another history", register.name(live)), at)?;
        let list = |values: &mut dyn Iterator<Item = u32>| {
            let values: Vec<_> = values.map(|value| register.place.format(live, value)).collect();
            if values.is_empty() { "no change".to_owned() } else { values.join(", ") }
        };
        failure.register = Some(register.name(live));
        failure.address = Some(register.place.address().to_string());
        failure.expected = Some(list(&mut wanted.into_iter()));
        failure.actual = Some(list(&mut held.into_iter()));
        Err(failure.into())
    }
}

/// True if changes since record `from` may be missing after a return to an earlier moment, with record `begin` as the next one: a
/// record before the first change that the journal keeps is missing. After a return the ring of changes is not full, so its
/// length does not show that it has dropped changes.
fn is_cut_off(records: &[Record], from: u64, begin: u64) -> bool {
    let mut next = from;
    for record in records.iter().filter(|record| record.seq >= from && !record.is_pending()) {
        if next >= begin || record.seq > next {
            break;
        }
        if record.event.kind().ring() == Ring::History {
            return false;
        }
        next = record.seq.saturating_add(1);
    }
    next < begin
}
