//! Operations on the records of the plant: journal, changes of registers, findings.

use super::Work;
use super::range::not_followed;
use crate::identity::DeviceIndex;
use crate::journal::{Keep, Record};
use crate::request::register::known_plc;
use crate::request::{MAX_RECORDS, Refused, Reply};

/// Maximum number of bytes of telegrams and phases in a reply: half of the maximum for all replies of a request.
const MAX_OCTETS: usize = 131_072;

impl Work<'_> {
    /// If the records reach the end of the journal, those that are still being counted follow.
    pub(super) fn journal(&mut self, from: u64, max: u32) -> Result<Reply, Refused> {
        let (journal, max) = (self.host.plant().journal(), max.min(MAX_RECORDS) as usize);
        let mut octets = 0;
        let fits = |record: &Record| {
            octets += record.octets.as_ref().map_or(0, |octets| octets.len());
            octets += record.phases.as_ref().map_or(0, |phases| size_of_val(&**phases));
            octets <= MAX_OCTETS
        };
        let (left, records) =
            (journal.read(from).len(), journal.read_with_phases(from).take(max).take_while(fits));
        let records: Vec<Record> = records.collect();
        let mut pending = if records.len() == left { journal.pending() } else { Vec::new() };
        if let (Some(first), []) = (pending.first_mut(), records.as_slice()) {
            first.phases = Some(journal.phases_before(journal.end()));
        }
        let pending = pending.into_iter().map(|record| record.judged_at(self.host.plant().now()));
        let records = records.into_iter().chain(pending).collect();
        Ok(Reply::Journal { records, end: journal.end(), turn: journal.history_from(from) })
    }

    pub(super) fn follow(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        len: u32,
        keep: Keep,
    ) -> Result<Reply, Refused> {
        let plc = known_plc(self.host, plc)?;
        let followed =
            self.host.plant_mut().follow_registers_for(self.execution.client, plc, offset, len, keep);
        followed.map_err(|error| not_followed(self.host, plc, offset, len, error))?;
        Ok(Reply::Written)
    }

    pub(super) fn is_recorded(&mut self, plc: DeviceIndex, offset: u32) -> Result<Reply, Refused> {
        let plc = known_plc(self.host, plc)?;
        Ok(Reply::Value(self.host.plant().journal().is_recorded(plc, offset).into()))
    }

    pub(super) fn changes(&mut self, from: u64, max: u32) -> Result<Reply, Refused> {
        let (client, max) = (self.execution.client, max.min(MAX_RECORDS) as usize);
        let (changes, end) = self.host.plant_mut().changes_for(client, from, max);
        Ok(Reply::Changes { changes, end, turn: self.host.plant().journal().history_id() })
    }

    pub(super) fn findings(&mut self) -> Result<Reply, Refused> {
        Ok(Reply::Findings(self.host.plant().journal().findings().iter().cloned().collect()))
    }

    pub(super) fn clear_findings(&mut self) -> Result<Reply, Refused> {
        self.host.plant_mut().clear_findings();
        Ok(Reply::Cleared)
    }
}
