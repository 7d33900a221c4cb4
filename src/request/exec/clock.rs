//! Operations that wait or advance the clock.

use super::Work;
use super::time::{limit, no_sync, stepped};
use crate::identity::{DeviceIndex, PortNumber};
use crate::layout::{Compare, Test, Width};
use crate::request::register::{Register, known_plc};
use crate::request::{Code, Host, MAX_CONDITIONS, Refused, Reply};

impl Work<'_> {
    pub(super) fn wait(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        mask: u32,
        value: u32,
        within_us: u64,
    ) -> Result<Option<Reply>, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        let test = Test { mask, compare: Compare::Equal, is_signed: false, value };
        register.can_match(self.host, test)?;
        let look = |host: &dyn Host| {
            let value = register.load(host)?;
            Ok((test.holds(width, value), value))
        };
        let not_in_time = |host: &dyn Host, waited| register.not_in_time(host, waited);
        Ok(self.execution.wait(self.host, within_us, look, not_in_time)?.map(Reply::Waited))
    }

    pub(super) fn condition(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        test: Test,
    ) -> Result<Reply, Refused> {
        let register = Register::check(self.host, plc, offset, width)?;
        register.can_match(self.host, test)?;
        register.load(self.host)?;
        if self.execution.conditions.len() == MAX_CONDITIONS {
            let text = format_args!("one wait can have {MAX_CONDITIONS} conditions at most");
            return Err(Refused::new(Code::CONDITIONS, text));
        }
        self.execution.conditions.push((register, test));
        Ok(Reply::Written)
    }

    pub(super) fn wait_for(&mut self, any: bool, within_us: u64) -> Result<Option<Reply>, Refused> {
        Ok(self.execution.wait_for(self.host, any, within_us)?.map(Reply::Waited))
    }

    pub(super) fn advance(&mut self, us: u64) -> Result<Option<Reply>, Refused> {
        stepped(self.host)?;
        let end = self.execution.end.unwrap_or_else(|| self.host.plant().now().saturating_add(us));
        self.advance_until(end)
    }

    pub(super) fn advance_to_sync(
        &mut self,
        plc: DeviceIndex,
        node: PortNumber,
    ) -> Result<Option<Reply>, Refused> {
        stepped(self.host)?;
        let number = known_plc(self.host, plc)?;
        let sync = match self.execution.end {
            Some(sync) => sync,
            None => {
                let sync = self.host.plant().next_sync(number, node);
                sync.ok_or_else(|| no_sync(self.host, plc, node))?
            }
        };
        limit(sync.saturating_sub(self.host.plant().now()))?;
        self.advance_until(sync)
    }

    fn advance_until(&mut self, end: u64) -> Result<Option<Reply>, Refused> {
        let has_arrived = self.execution.advance(self.host, end)?;
        Ok(has_arrived.then(|| self.now()))
    }

    pub(super) fn advance_to_event(&mut self, within_us: u64) -> Result<Option<Reply>, Refused> {
        stepped(self.host)?;
        let now = self.host.plant().now();
        let event = || self.host.next_event().max(now).min(now.saturating_add(within_us));
        let event = self.execution.end.unwrap_or_else(event);
        self.execution.end = Some(event);
        if !self.execution.go_to(self.host, event) {
            return Ok(None);
        }
        self.execution.end = None;
        Ok(Some(self.now()))
    }

    pub(super) fn set_speed(&mut self, permille: u32) -> Result<Option<Reply>, Refused> {
        if self.host.is_stepped() {
            let text = "the clock is stepped and has no speed: it advances only on request (`commram step`, `commram wait`)";
            return Err(Refused::new(Code::CLOCK_IS_STEPPED, text));
        }
        if self.execution.end.is_none() {
            if !self.host.set_speed(permille) {
                return Ok(None);
            }
            self.execution.end = Some(self.host.plant().now());
        }
        if self.host.is_changing_speed() {
            return Ok(None);
        }
        self.execution.end = None;
        Ok(Some(self.now()))
    }

    pub(super) fn time(&mut self) -> Result<Reply, Refused> {
        Ok(self.now())
    }

    /// Emulated time as a reply.
    pub(super) fn now(&self) -> Reply {
        Reply::Time(self.host.plant().now())
    }
}
