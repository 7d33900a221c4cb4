//! Executes operations: the only place that defines the effect of each of them.

mod range;
mod time;

use super::doors;
use super::drives;
use super::register::{Register, device_of, known_plc};
use super::scene;
use super::travel;
use super::travel::Store;
use super::{Code, Host, MAX_CONDITIONS, MAX_RANGE, MAX_RECORDS, Op, Refused, Reply, Waited};
use crate::fault::FaultError;
use crate::layout::{Compare, Test, Width};
use crate::memory::header::BoardSetting;
use crate::plant::Forced;
use range::{not_followed, ranged, read_range};
use time::{limit, look_at, no_conditions, no_sync, stepped};

/// An operation in progress.
///
/// With a stepped clock an operation advances the clock where needed, and has no reply while it pauses
/// ([`Host::should_pause`]); the caller continues it soon. In real time a wait cannot advance the clock: it has no
/// reply yet, and the caller tries again after every firmware step.
#[derive(Debug, Default)]
pub struct Execution {
    /// Time at which the operation in progress ends at the latest, in emulated microseconds.
    end: Option<u64>,
    /// End of its present part: the parts are the same for any pauses of the operation.
    part: Option<u64>,
    /// The operation has advanced the clock.
    has_set_out: bool,
    /// Events that a wait has passed.
    events: u32,
    /// Conditions of the next wait.
    conditions: Vec<(Register, Test)>,
}

impl Execution {
    /// Executes or continues the operation; `None` while it waits or pauses.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn run(&mut self, host: &mut dyn Host, op: &Op) -> Result<Option<Reply>, Refused> {
        host.permit(op)?;
        // Stores are recorded separately.
        if op.acts() && !op.stores() {
            host.plant_and_travel().1.touch();
        }
        let reply = match *op {
            Op::Peek { plc, offset, width } => {
                let register = Register::check(host, plc, offset, width)?;
                Reply::Value(register.load(host)?)
            }
            Op::Poke { plc, offset, width, value } => {
                let register = Register::check(host, plc, offset, width)?;
                register.writable()?;
                register.fits(host, value)?;
                let stored = host.plant_mut().store(register.plc, offset, width, value);
                stored.map_err(|_| register.unmapped())?;
                has_stored(host, register.plc, offset, width, value);
                Reply::Written
            }
            Op::CompareExchange { plc, offset, width, current, new } => {
                let register = Register::check(host, plc, offset, width)?;
                register.writable()?;
                register.fits(host, current)?;
                register.fits(host, new)?;
                let outcome = host.plant_mut().compare_exchange(register.plc, offset, width, current, new);
                let outcome = outcome.map_err(|_| register.unmapped())?;
                if outcome.is_ok() {
                    has_stored(host, register.plc, offset, width, new);
                }
                Reply::Exchanged { ok: outcome.is_ok(), found: outcome.unwrap_or_else(|found| found) }
            }
            Op::ReadRange { plc, offset, len } => Reply::Bytes(read_range(host, plc, offset, len)?),
            Op::Wait { plc, offset, width, mask, value, within_us } => {
                let register = Register::check(host, plc, offset, width)?;
                let test = Test { mask, compare: Compare::Equal, is_signed: false, value };
                register.can_match(host, test)?;
                let look = |host: &dyn Host| {
                    let value = register.load(host)?;
                    Ok((test.holds(width, value), value))
                };
                match self.wait(host, within_us, look, |host, waited| register.not_in_time(host, waited))? {
                    Some(waited) => Reply::Waited(waited),
                    None => return Ok(None),
                }
            }
            Op::Condition { plc, offset, width, test } => {
                let register = Register::check(host, plc, offset, width)?;
                register.can_match(host, test)?;
                register.load(host)?;
                if self.conditions.len() == MAX_CONDITIONS {
                    let text = format_args!("one wait can have {MAX_CONDITIONS} conditions at most");
                    return Err(Refused::new(Code::CONDITIONS, text));
                }
                self.conditions.push((register, test));
                Reply::Written
            }
            Op::WaitFor { any, within_us } => match self.wait_for(host, any, within_us)? {
                Some(waited) => Reply::Waited(waited),
                None => return Ok(None),
            },
            Op::Advance { us } => {
                stepped(host)?;
                limit(us)?;
                let end = self.end.unwrap_or_else(|| host.plant().now().saturating_add(us));
                if !self.advance(host, end)? {
                    return Ok(None);
                }
                Reply::Time(host.plant().now())
            }
            Op::AdvanceToSync { plc, node } => {
                stepped(host)?;
                let number = known_plc(host, plc)?;
                let sync = match self.end {
                    Some(sync) => sync,
                    None => host.plant().next_sync(number, node).ok_or_else(|| no_sync(host, plc, node))?,
                };
                limit(sync.saturating_sub(host.plant().now()))?;
                if !self.advance(host, sync)? {
                    return Ok(None);
                }
                Reply::Time(host.plant().now())
            }
            Op::AdvanceToEvent { within_us } => {
                stepped(host)?;
                limit(within_us)?;
                let now = host.plant().now();
                let event = || host.next_event().max(now).min(now.saturating_add(within_us));
                let event = self.end.unwrap_or_else(event);
                self.end = Some(event);
                if !self.go_to(host, event) {
                    return Ok(None);
                }
                self.end = None;
                Reply::Time(host.plant().now())
            }
            Op::Time => Reply::Time(host.plant().now()),
            Op::Journal { from, max } => journal(host, from, max.min(MAX_RECORDS) as usize),
            Op::Follow { plc, offset, len, keep } => {
                let plc = ranged(host, plc, offset, len)?;
                let followed = host.plant_mut().follow_registers(plc, offset, len, keep);
                followed.map_err(|error| not_followed(host, plc, offset, len, error))?;
                Reply::Written
            }
            Op::IsRecorded { plc, offset } => {
                let plc = known_plc(host, plc)?;
                Reply::Value(host.plant().journal().is_recorded(plc as u16, offset).into())
            }
            Op::Changes { from, max } => {
                let (changes, end) = host.plant_mut().changes(from, max.min(MAX_RECORDS) as usize);
                Reply::Changes { changes, end, turn: host.plant().journal().turn() }
            }
            Op::Force { plc, offset, width, value } => {
                let register = Register::check(host, plc, offset, width)?;
                register.writable()?;
                let forced = Forced { plc, offset, width, value };
                host.plant_mut().force(forced).map_err(|error| register.not_forcible(&error))?;
                Reply::Written
            }
            Op::Unforce { plc, offset, width } => {
                let register = Register::check(host, plc, offset, width)?;
                if !host.plant_mut().unforce(plc, offset) {
                    let text = format_args!("{} is not forced", register.label(host));
                    return Err(Refused::new(Code::NOT_FORCED, text));
                }
                Reply::Written
            }
            Op::Forces => Reply::Forces(host.plant().forces().to_vec()),
            Op::FaultAdd { fault } => {
                let id = host.plant_mut().add_fault(fault).map_err(|refusal| {
                    let names = host.plant().names();
                    let text = FaultError::refused(fault.kind(), refusal.clone(), &names);
                    Refused::fault(&refusal, text)
                })?;
                Reply::FaultAdded { id }
            }
            Op::FaultList => Reply::Faults(host.plant().faults().collect()),
            Op::FaultClear { id: Some(id) } => {
                host.plant_mut().clear_fault(id.get())?;
                Reply::FaultsCleared { count: 1 }
            }
            Op::FaultClear { id: None } => Reply::FaultsCleared { count: host.plant_mut().clear_faults() },
            Op::Board { plc } => {
                let plc = known_plc(host, plc)?;
                Reply::Board(host.plant().devices().get(plc).map(|device| device.board()).unwrap_or_default())
            }
            Op::SetBoard { plc, setting } => {
                set_board(host, plc, setting)?;
                Reply::Written
            }
            Op::Findings => Reply::Findings(host.plant().journal().findings().iter().copied().collect()),
            Op::ClearFindings => {
                host.plant_mut().clear_findings();
                Reply::Cleared
            }
            Op::Buses => doors::buses(host),
            Op::Scene => scene::scene(host),
            Op::Drives => drives::drives(host),
            Op::Drive { drive } => drives::drive(host, drive)?,
            Op::SetParameter { drive, number, value } => drives::set(host, drive, number, value)?,
            Op::DoorOpen { bus, door } => doors::open(host, bus, door)?,
            Op::DoorClose { bus, door } => doors::close(host, bus, door)?,
            Op::BusSend { bus, frame } => doors::send(host, bus, frame)?,
            Op::Save => Reply::Value(travel::save(host)?),
            Op::Forget { number } => {
                travel::forget(host, number)?;
                Reply::Written
            }
            Op::ReadSaved { number, from } => {
                Reply::Bytes(travel::read(host, number, from, MAX_RANGE as usize)?)
            }
            Op::BringSaved { at, count, bytes } => {
                travel::take_in(host, at, bytes.get(..count.into()).unwrap_or(&bytes))?;
                Reply::Written
            }
            Op::Restore { detached } => {
                travel::restore(host, detached)?;
                Reply::Time(host.plant().now())
            }
            Op::BackTo { number, detached } => {
                travel::back_to(host, number, detached)?;
                Reply::Time(host.plant().now())
            }
            Op::Back { us, detached } => {
                travel::back(host, us, detached)?;
                Reply::Time(host.plant().now())
            }
            Op::BackUntil { any, detached } => {
                let conditions = core::mem::take(&mut self.conditions);
                let look = |host: &dyn Host| {
                    let (is_met, held) = look_at(host, any, &conditions)?;
                    Ok(is_met.then_some(held))
                };
                if conditions.is_empty() {
                    return Err(no_conditions());
                }
                let value = travel::back_until(host, detached, look)?;
                Reply::Waited(Waited { time_us: host.plant().now(), value })
            }
            Op::Info => Reply::Info(Box::new(host.info())),
            Op::Stop => {
                host.request_stop();
                Reply::Stopping
            }
        };
        self.has_set_out = false;
        Ok(Some(reply))
    }

    /// Whether the operation has begun and waits or pauses.
    pub fn is_under_way(&self) -> bool {
        self.end.is_some()
    }
}

/// An operation has stored a value.
fn has_stored(host: &mut dyn Host, plc: usize, offset: u32, width: Width, value: u32) {
    let (plant, travel) = host.plant_and_travel();
    travel.has_stored(Store { time_us: plant.now(), plc, offset, width, value });
}

fn plc_name(host: &dyn Host, plc: u16) -> &str {
    host.plant().devices().get(usize::from(plc)).map_or("", |device| device.name())
}

/// Returns `max` records at most. If they reach the end, the records that are still being counted follow.
fn journal(host: &dyn Host, from: u64, max: usize) -> Reply {
    let journal = host.plant().journal();
    let records = journal.read(from);
    let pending = if records.len() <= max { journal.pending() } else { Vec::new() };
    let pending = pending.into_iter().map(|record| record.judged_at(host.plant().now()));
    let records = records.take(max).copied().chain(pending).collect();
    Reply::Journal { records, end: journal.end(), turn: journal.turn() }
}

fn set_board(host: &mut dyn Host, plc: u16, setting: BoardSetting) -> Result<(), Refused> {
    let number = known_plc(host, plc)?;
    let device = host.plant().devices().get(number);
    if let Some(why) = device.and_then(|device| device.refusal(setting)) {
        return Err(Refused::setting(plc_name(host, plc), device_of(host, number), setting, why));
    }
    if !host.plant_mut().set_board(number, setting) {
        return Err(Refused::no_such_switch(plc_name(host, plc), device_of(host, number), setting));
    }
    let takes_starts =
        || host.plant().devices().get(number).is_some_and(|device| device.board().takes_starts());
    if !matches!(setting, BoardSetting::Start(_)) || takes_starts() {
        return Ok(());
    }
    let text = format_args!(
        "PLC '{}': a start or stop needs a loaded program, the switch at RUN and the supply on",
        plc_name(host, plc)
    );
    Err(Refused::new(Code::START_REFUSED, text))
}

#[cfg(test)]
mod tests;
