//! Advances the clock for operations: in parts, so that the emulator keeps answering.

use super::{Execution, plc_name};
use crate::identity::{DeviceIndex, PortNumber};
use crate::layout::Test;
use crate::request::register::Register;
use crate::request::{Code, Host, MAX_ADVANCE_US, MAX_CONDITIONS, Refused, Waited, travel};
use crate::time;

/// Maximum advance between two calls of [`Host::should_stop`]: 100 ms of emulated time.
const SLICE_US: u64 = 100_000;
/// Maximum advance while nothing changes: a minute of emulated time. It takes no more real time than `SLICE_US` with
/// events.
const REST_US: u64 = 60_000_000;
/// Number of events that a wait handles between two calls of [`Host::should_pause`]. Such a call may take as long as an
/// event.
const EVENTS: u32 = 32;

impl Execution {
    /// Advances to time `part`, at which the present part ends. Returns `false` if the operation pauses before this
    /// time, or if the host must stop.
    pub(super) fn go_to(&mut self, host: &mut dyn Host, part: u64) -> bool {
        if self.part.is_none() {
            travel::set_out(host, !core::mem::replace(&mut self.has_set_out, true));
        }
        let has_arrived = host.advance_to(part);
        self.part = (!has_arrived).then_some(part);
        if has_arrived {
            travel::arrived(host);
        }
        has_arrived
    }

    /// Advances to time `end` in parts, so that the emulator answers other clients during a long advance. Returns
    /// `false` if the operation pauses.
    pub(super) fn advance(&mut self, host: &mut dyn Host, end: u64) -> Result<bool, Refused> {
        self.end = Some(end);
        loop {
            let now = host.plant().now();
            if now >= end && self.part.is_none() {
                self.end = None;
                return Ok(true);
            }
            if host.should_stop() {
                return Err(Refused::ending(host));
            }
            if host.should_pause() {
                return Ok(false);
            }
            let [least, most] = [SLICE_US, REST_US].map(|us| now.saturating_add(us));
            let part = self.part.unwrap_or_else(|| host.next_change().clamp(least, most).min(end));
            if !self.go_to(host, part) {
                return Ok(false);
            }
        }
    }

    pub(super) fn wait_for(
        &mut self,
        host: &mut dyn Host,
        any: bool,
        within_us: u64,
    ) -> Result<Option<Waited>, Refused> {
        if self.conditions.is_empty() {
            return Err(no_conditions());
        }
        let conditions = core::mem::take(&mut self.conditions);
        let look = |host: &dyn Host| look_at(host, any, &conditions);
        let not_in_time = |_: &dyn Host, waited: Waited| {
            let (count, held, time_us) = (conditions.len(), waited.value.count_ones(), waited.time_us);
            let text = format_args!(
                "the conditions did not become true in time; at {time_us} us {held} of {count} hold"
            );
            Refused { waited: Some(waited), ..Refused::new(Code::NOT_IN_TIME, text) }
        };
        let outcome = self.wait(host, within_us, look, not_in_time);
        if let Ok(None) = outcome {
            self.conditions = conditions;
        }
        outcome
    }

    /// Waits until `look` returns true. `look` also returns a value for the answer.
    pub(super) fn wait(
        &mut self,
        host: &mut dyn Host,
        within_us: u64,
        look: impl Fn(&dyn Host) -> Result<(bool, u32), Refused>,
        not_in_time: impl FnOnce(&dyn Host, Waited) -> Refused,
    ) -> Result<Option<Waited>, Refused> {
        let begin = host.plant().now();
        let deadline = *self.end.get_or_insert(begin.saturating_add(within_us));
        loop {
            // The condition is not checked at a pause within a part, only between two parts. So pauses do not change
            // the result.
            if let Some(part) = self.part
                && !host.should_stop()
                && !self.go_to(host, part)
            {
                return Ok(None);
            }
            let (is_met, value) = look(host)?;
            let waited = Waited { time_us: host.plant().now(), value };
            if is_met {
                self.end = None;
                return Ok(Some(waited));
            }
            if waited.time_us >= deadline {
                return Err(not_in_time(host, waited));
            }
            if host.should_stop() {
                return Err(Refused::ending(host));
            }
            if !host.is_stepped() {
                return Ok(None);
            }
            let latest = deadline.min(waited.time_us.saturating_add(REST_US));
            let event = host.next_change().max(waited.time_us).min(latest);
            self.events = self.events.wrapping_add(1);
            if !self.go_to(host, event) || self.events.is_multiple_of(EVENTS) && host.should_pause() {
                return Ok(None);
            }
        }
    }
}

/// Checks the conditions. Returns true if enough of them hold (any or all), and a value in which bit n is set if
/// condition n holds.
pub(super) fn look_at(
    host: &dyn Host,
    any: bool,
    conditions: &[(Register, Test)],
) -> Result<(bool, u32), Refused> {
    let all = u32::MAX >> (MAX_CONDITIONS - conditions.len());
    let mut held = 0;
    for (bit, (register, test)) in conditions.iter().enumerate() {
        held |= u32::from(test.holds(register.address.width(), register.load(host)?)) << bit;
    }
    Ok((if any { held != 0 } else { held == all }, held))
}

pub(super) fn no_conditions() -> Refused {
    Refused::new(Code::CONDITIONS, "it needs conditions in front of it")
}

pub(super) fn no_sync(host: &dyn Host, plc: DeviceIndex, node: PortNumber) -> Refused {
    let ports = host.plant().devices().get(plc.index()).map(|device| device.layout().ports);
    let port = ports.unwrap_or_default().iter().find(|port| port.number == node);
    let name = port.map_or("this port", |port| port.name);
    let why = host.plant().why_no_sync(plc, node);
    let text = format_args!("PLC '{}': there is no SYNC signal at {name}; {why}", plc_name(host, plc));
    Refused::new(Code::NO_SYNC, text)
}

pub(super) fn stepped(host: &dyn Host) -> Result<(), Refused> {
    if host.is_stepped() {
        return Ok(());
    }
    let text = "the clock runs in real time; time can be advanced in stepped mode only (use a wait, or start the \
                instance stepped)";
    Err(Refused::new(Code::CLOCK_IS_REAL_TIME, text))
}

/// Checks the limit of an advance that ends at an event of the plant.
pub(super) fn limit(us: u64) -> Result<(), Refused> {
    if us <= MAX_ADVANCE_US {
        return Ok(());
    }
    let text = format_args!(
        "{} are too long: one operation takes at most {} of emulated time",
        time::long(us),
        time::long(MAX_ADVANCE_US)
    );
    Err(Refused::new(Code::ADVANCE_TOO_LONG, text))
}
