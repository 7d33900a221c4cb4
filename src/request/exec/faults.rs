//! Operations on faults.

use super::Work;
use crate::fault::{Fault, FaultError};
use crate::request::{Refused, Reply};
use core::num::NonZeroU16;

impl Work<'_> {
    pub(super) fn fault_add(&mut self, fault: Fault) -> Result<Reply, Refused> {
        let id = self.host.plant_mut().add_fault(fault).map_err(|refusal| {
            let names = self.host.plant().names();
            let text = FaultError::refused(fault.kind(), refusal.clone(), &names);
            Refused::fault(&refusal, text)
        })?;
        Ok(Reply::FaultAdded { id })
    }

    pub(super) fn fault_list(&mut self) -> Result<Reply, Refused> {
        Ok(Reply::Faults(self.host.plant().faults().collect()))
    }

    pub(super) fn fault_has_acted(&mut self, id: u16) -> Result<Reply, Refused> {
        Ok(Reply::Value(self.host.plant().fault_has_acted(id).into()))
    }

    pub(super) fn fault_clear(&mut self, id: Option<NonZeroU16>) -> Result<Reply, Refused> {
        let plant = self.host.plant_mut();
        let count = match id {
            Some(id) => plant.clear_fault(id.get()).map(|()| 1)?,
            None => plant.clear_faults(),
        };
        Ok(Reply::FaultsCleared { count })
    }
}
