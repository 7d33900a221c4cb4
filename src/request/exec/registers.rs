//! Operations on registers and forced registers.

use super::Work;
use super::range::read_range;
use crate::identity::DeviceIndex;
use crate::layout::Width;
use crate::plant::Forced;
use crate::request::register::Register;
use crate::request::travel::Store;
use crate::request::{Code, Refused, Reply};

impl Work<'_> {
    pub(super) fn peek(&mut self, plc: DeviceIndex, offset: u32, width: Width) -> Result<Reply, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        Ok(Reply::Value(register.load(self.host)?))
    }

    pub(super) fn poke(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        value: u32,
    ) -> Result<Reply, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        register.writable()?;
        register.fits(self.host, value)?;
        let stored = self.host.plant_mut().store(register.plc, offset, width, value);
        stored.map_err(|_| register.unmapped())?;
        self.has_stored(register.plc, offset, width, value);
        Ok(Reply::Written)
    }

    pub(super) fn compare_exchange(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        current: u32,
        new: u32,
    ) -> Result<Reply, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        register.writable()?;
        register.fits(self.host, current)?;
        register.fits(self.host, new)?;
        let outcome = self.host.plant_mut().compare_exchange(register.plc, offset, width, current, new);
        let outcome = outcome.map_err(|_| register.unmapped())?;
        if outcome.is_ok() {
            self.has_stored(register.plc, offset, width, new);
        }
        Ok(Reply::Exchanged { ok: outcome.is_ok(), found: outcome.unwrap_or_else(|found| found) })
    }

    /// Records in the history that an operation has stored a value.
    fn has_stored(&mut self, plc: DeviceIndex, offset: u32, width: Width, value: u32) {
        let (plant, travel) = self.host.plant_and_travel();
        travel.has_stored(Store { time_us: plant.now(), plc, offset, width, value });
    }

    pub(super) fn read_range(&mut self, plc: DeviceIndex, offset: u32, len: u32) -> Result<Reply, Refused> {
        Ok(Reply::Bytes(read_range(self.host, plc, offset, len)?))
    }

    pub(super) fn force(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        value: u32,
    ) -> Result<Reply, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        register.writable()?;
        let forced = Forced { plc, offset, width, value };
        self.host.plant_mut().force(forced).map_err(|error| register.not_forcible(&error))?;
        Ok(Reply::Written)
    }

    pub(super) fn unforce(&mut self, plc: DeviceIndex, offset: u32, width: Width) -> Result<Reply, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        if !self.host.plant_mut().unforce(plc, offset) {
            let text = format_args!("{} is not forced", register.label(self.host));
            return Err(Refused::new(Code::NOT_FORCED, text));
        }
        Ok(Reply::Written)
    }

    pub(super) fn forces(&mut self) -> Result<Reply, Refused> {
        Ok(Reply::Forces(self.host.plant().forces().to_vec()))
    }
}
