//! Operations on snapshots, and operations that return to an earlier moment.

use super::Work;
use super::time::{look_at, no_conditions};
use crate::request::{FilePart, Host, MAX_RANGE, Refused, Reply, Waited, travel};

impl Work<'_> {
    pub(super) fn save(&mut self) -> Result<Reply, Refused> {
        Ok(Reply::Value(travel::save(self.host, self.execution.client)?))
    }

    pub(super) fn forget(&mut self, number: u32) -> Result<Reply, Refused> {
        travel::forget(self.host, number)?;
        Ok(Reply::Written)
    }

    pub(super) fn read_saved(&mut self, number: u32, from: u32) -> Result<Reply, Refused> {
        Ok(Reply::Bytes(travel::read(self.host, number, from, MAX_RANGE as usize)?))
    }

    pub(super) fn bring_saved(&mut self, at: u32, part: FilePart) -> Result<Reply, Refused> {
        travel::take_in(self.host, self.execution.client, at, part.bytes())?;
        Ok(Reply::Written)
    }

    pub(super) fn restore(&mut self, detached: bool) -> Result<Reply, Refused> {
        travel::restore(self.host, self.execution.client, detached)?;
        Ok(self.now())
    }

    pub(super) fn back_to(&mut self, number: u32, detached: bool) -> Result<Reply, Refused> {
        travel::back_to(self.host, number, detached)?;
        Ok(self.now())
    }

    pub(super) fn back(&mut self, us: u64, detached: bool) -> Result<Reply, Refused> {
        travel::back(self.host, us, detached, self.is_awaited)?;
        Ok(self.now())
    }

    pub(super) fn back_to_start(&mut self, detached: bool) -> Result<Reply, Refused> {
        travel::back_to_start(self.host, detached)?;
        Ok(self.now())
    }

    pub(super) fn back_until(&mut self, any: bool, detached: bool) -> Result<Reply, Refused> {
        let conditions = core::mem::take(&mut self.execution.conditions);
        if conditions.is_empty() {
            return Err(no_conditions());
        }
        let look = |host: &dyn Host| {
            let (is_met, held) = look_at(host, any, &conditions)?;
            Ok(is_met.then_some(held))
        };
        let value = travel::back_until(self.host, detached, look, self.is_awaited)?;
        Ok(Reply::Waited(Waited { time_us: self.host.plant().now(), value }))
    }
}
