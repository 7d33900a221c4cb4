//! Drives (V-Regler). A drive with a CANsync interface card is a slave on the bus. A built-in drive is
//! connected to the BAPS of its PLC.
//!
//! Both kinds of drives contain a `VRegler`, with the parameters of `layouts/v-regler`. The rest of this text
//! describes the drive with a card.
//!
//! The drive has no clock and no bus. The bus calls [`Drive::sync_edge`] once per interval and passes frames
//! to the drive, which answers at once. An interval has these steps:
//!
//! 1. At the SYNC edge the card samples actual values and status word. They are sent when the master requests them in
//!    this interval.
//! 2. For 750 us the drive moves as before.
//! 3. Then the drive processes the data that the card passes on: the control word, and the reference values received in
//!    the previous interval (manual 5.01010.01 p. 14 and 20; decision D-34).
//! 4. The drive moves for the rest of the interval.
//!
//! All steps are calculated at the edge. Therefore a drive that is read between two edges already shows its
//! state at the end of the interval.
//!
//! So a reference value of interval k moves the drive in interval k+1 and is visible in the actual value of
//! interval k+2. Card and drive exchange no data if there is no SYNC signal, or if lost reference values have
//! stopped the exchange (ZK 26). In this case reference values are lost, the control word waits in the card,
//! and parameter jobs are answered with BUSY (p. 17 and 22; decision D-615). A drive that is not synchronized
//! yet takes all reference values except position reference values (5.00005.03a p. 135; decision D-82).
//! Actual values are sampled at every edge, so that a master can observe the drive.

pub(crate) mod angle;
mod built_in;
mod card;
mod card_function;
mod catch_up;
mod config;
mod cruise;
mod drivecom;
mod inspection;
mod monitoring;
mod motion;
mod parameters;
mod regler;
mod table;
#[cfg(test)]
mod tests;
mod zk;

pub use built_in::{BuiltInDrive, BuiltInDriveConfig};
pub use card_function::{CardFunction, UnknownFunction};
pub(crate) use catch_up::{BusEvent, EventLog};
pub use config::{DriveConfig, DriveError, ParameterNumbers, ZkError};
pub use drivecom::{DrivecomState, Enable};
pub use monitoring::{BapsMonitoring, CardMonitoring, MonitorSettings, Reaction};
pub use parameters::{ParamFormat, ParameterError, ParameterSpec};
pub(crate) use table::parameter_provenance;
pub use table::{PARAMETERS, ParameterRow, number};
pub use zk::{ActualMapping, MappingError, ReferenceMapping, Source, ZkParameters};

use crate::can::Payload;
use crate::devices::cansync::frames::codec::parameter::VALUE_ELEMENT;
use crate::devices::cansync::frames::codec::{
    Access, Action, ActionCommand, ParameterJob, ParameterResponse, ParameterResult, UpDownJob, UpDownResult,
};
use crate::devices::cansync::frames::{Channel, Frame, SyncLock};
use crate::devices::cansync::registers::values::{drive_status, par_error, updown_error};
use crate::snapshot_fields;
use card::Card;
use monitoring::{Monitor, fault};
use regler::{Setup, VRegler};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Time after the SYNC edge at which the drive processes the card's data, in us (manual 5.01010.01 p. 20).
const ACTS_AFTER_US: u32 = 750;

/// Returns the part of an interval before the drive processes the card's data and the part after it, in us.
#[inline]
fn parts_of(interval_us: u32) -> [u32; 2] {
    let before = ACTS_AFTER_US.min(interval_us);
    [before, interval_us - before]
}

/// Parameters that must match each other and the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Settings {
    slot_us: u32,
    offset_us: u32,
    pwm_khz: u32,
    interval_us: u32,
}

/// A wrong setting of a drive's parameters. The field is the present value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Objection {
    /// P167 is not the SYNC slot of the bus's baud rate (manual 5.01010.01 p. 13).
    SyncSlot(u32),
    /// P168 is not 0 (manual 5.01010.01 p. 13).
    SyncOffset(u32),
    /// The manual's table of masks for the angle reference value (P258) does not contain the PWM frequency
    /// (P103), but only 4 and 8 kHz (5.00005.03a p. 74).
    Pwm(u32),
}

/// Returns the objection to a PWM frequency, if it is wrong.
pub(crate) fn pwm_objection(khz: u32) -> Option<Objection> {
    (!matches!(khz, 4 | 8)).then_some(Objection::Pwm(khz))
}

/// A drive with its card.
#[derive(Clone, Debug)]
pub struct Drive {
    name: Arc<str>,
    slave_number: u8,
    kbit_s: u16,
    sync: SyncLock,
    /// True if the present interval began without a SYNC edge.
    edge_is_missing: bool,
    /// True if card and drive exchange data in the present interval, unless lost reference values have stopped the
    /// exchange.
    exchanges: bool,
    /// The settings of the last check for objections.
    objected: Option<Settings>,
    /// Monitors of SYNC and of reference values.
    monitors: [Monitor; 2],
    /// Parameters of the drive's option card (ZK).
    zk: ZkParameters,
    card: Card,
    regler: VRegler,
}

snapshot_fields!(Drive {
    values: edge_is_missing, exchanges, objected;
    parts: sync, monitors, card, regler;
    built: name, slave_number, kbit_s, zk
});

impl Drive {
    /// Creates the drive of the plant file, in its state after power-on. Its baud rate is that of the plant
    /// file, or `kbit_s` if the plant file has none.
    ///
    /// # Errors
    /// [`DriveError`] names the drive and the wrong parameter or card parameter.
    pub fn new(cfg: &DriveConfig, kbit_s: u16) -> Result<Drive, DriveError> {
        let drive = || cfg.name.clone();
        if cfg.slave_number > 31 {
            return Err(DriveError::SlaveNumber { drive: drive(), number: cfg.slave_number });
        }
        let function = cfg.card_function;
        let kbit_s = cfg.kbit_s.unwrap_or(kbit_s);
        let sync_slot_us = function.sync_slot_us(kbit_s).ok_or_else(|| DriveError::Rate {
            drive: drive(),
            function,
            kbit_s,
        })?;
        let regler = VRegler::new(&Setup {
            name: &cfg.name,
            enable: cfg.enable,
            ramp_per_second: cfg.ramp_per_second,
            numbers: &cfg.numbers,
            parameters: &cfg.parameters,
            software: None,
            sync_slot_us: Some(sync_slot_us),
        })?;
        let zk = cfg.mapping();
        let card = Card::new(&zk, function, cfg.slave_number, &regler.store)
            .map_err(|(zk, value, reason)| DriveError::Zk { drive: drive(), zk, value, reason })?;
        Ok(Drive {
            name: cfg.name.as_str().into(),
            slave_number: cfg.slave_number,
            kbit_s,
            sync: SyncLock::new(cfg.lock_time_us, cfg.sync_loss_us),
            edge_is_missing: false,
            exchanges: false,
            objected: None,
            monitors: [
                Monitor::new(&cfg.monitoring.sync, fault::SYNC),
                Monitor::new(&cfg.monitoring.reference_values, fault::REFERENCE_VALUES),
            ],
            zk,
            card,
            regler,
        })
    }

    /// Shares equal tables with another drive, to save memory.
    pub(crate) fn share(&mut self, other: &Drive) {
        self.regler.store.share(&other.regler.store);
    }

    /// Returns the name in the plant file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Slave number on the bus, 0 to 31.
    #[inline]
    pub fn slave_number(&self) -> u8 {
        self.slave_number
    }

    /// Baud rate set at the drive's switches, in kbit/s.
    #[inline]
    pub fn kbit_s(&self) -> u16 {
        self.kbit_s
    }

    /// Handles a falling SYNC edge at `now_us`: an interval of `interval_us` begins.
    #[inline]
    pub fn sync_edge(&mut self, now_us: u64, interval_us: u32) {
        self.edge(now_us, interval_us, true);
    }

    /// Handles a SYNC edge like [`Drive::sync_edge`]. If `is_looked_at` is false, no samples of the card are
    /// read before the next edge, so the card takes none.
    #[inline]
    fn edge(&mut self, now_us: u64, interval_us: u32, is_looked_at: bool) {
        let was_synchronized = self.is_synchronized();
        // The control task can only synchronize to a signal that comes once in its SYNC slot (decision
        // D-291).
        if self.regler.sync_times().0 == interval_us {
            self.sync.edge(now_us, interval_us, interval_us / 4);
        } else {
            self.sync.unlock();
        }
        (self.edge_is_missing, self.exchanges) = (false, true);
        self.notice_lock(was_synchronized, now_us);
        self.show_synchronized();
        if is_looked_at || self.card.may_stop() {
            let status_word = self.status_word();
            self.card.sample(&mut self.regler.store, status_word);
        }
        // In position mode, the reference value of an interval without lock is lost, even if the drive
        // becomes locked at the end of this interval.
        self.go_on(was_synchronized && self.is_synchronized(), now_us, interval_us);
    }

    /// Starts an interval of `interval_us` at `now_us` by the drive's own clock, because the SYNC edge is
    /// missing. In the first interval without an edge the drive continues as usual (manual 5.00005.03a p.
    /// 135). In later intervals without an edge, card and drive exchange no data (5.01010.01 p. 22). The
    /// motion continues in all these intervals. The drive does not send its actual value frames in them; p.
    /// 135 permits this (decision D-124).
    pub fn interval_without_edge(&mut self, now_us: u64, interval_us: u32) {
        let runs_through = self.sync.runs_through(now_us);
        self.pass(now_us);
        (self.edge_is_missing, self.exchanges) = (true, runs_through);
        self.go_on(runs_through, now_us, interval_us);
    }

    /// Runs through the interval that begins at `now_us`. `is_synchronized`: the drive is synchronized now
    /// and was synchronized in the previous interval.
    #[inline]
    fn go_on(&mut self, is_synchronized: bool, now_us: u64, interval_us: u32) {
        if self.exchanges {
            self.card.count_losses();
        } else {
            self.card.discard();
        }
        if self.card.is_stopped() {
            self.monitors[1].mark_missing(now_us);
        } else {
            self.monitors[1].mark_present();
        }
        self.monitor(now_us);
        if !self.exchanges {
            return self.regler.step(interval_us);
        }
        let [before_us, after_us] = parts_of(interval_us);
        self.regler.step(before_us);
        self.card.hand_over(&mut self.regler, is_synchronized);
        self.regler.step(after_us);
    }

    /// Updates bit 15 of the status word. The card overwrites this bit with the SYNC state (manual 5.01010.01
    /// p. 30).
    #[inline]
    fn show_synchronized(&mut self) {
        self.regler.show_synchronized(self.sync.is_locked());
    }

    /// Advances the drive's time to `now_us` without a SYNC edge. If the signal has been missing for too
    /// long, the lock ends.
    pub fn pass(&mut self, now_us: u64) {
        let was_synchronized = self.is_synchronized();
        self.sync.pass(now_us);
        self.notice_lock(was_synchronized, now_us);
        self.show_synchronized();
        self.monitor(now_us);
    }

    #[inline]
    fn monitor(&mut self, now_us: u64) {
        if self.regler.reports_error() || self.monitors.iter().any(Monitor::is_missing) {
            self.regler.monitor(now_us, self.monitors.iter_mut());
        }
    }

    /// Updates the SYNC monitor. If a lock ends because SYNC is missing, this is an error until the drive is
    /// synchronized again (p. 135).
    #[inline]
    fn notice_lock(&mut self, was_synchronized: bool, now_us: u64) {
        match (was_synchronized, self.is_synchronized()) {
            (true, false) => self.monitors[0].mark_missing(now_us),
            (_, true) => self.monitors[0].mark_present(),
            (false, false) => {}
        }
    }

    /// Returns the time of the drive's next change without a SYNC edge. Motion is not such a change.
    pub fn next_time(&self) -> Option<u64> {
        let reports = self.monitors.iter().filter_map(Monitor::next_time);
        self.sync.lost_at().into_iter().chain(reports).min()
    }

    /// Returns true if the drive has no work while no SYNC edge comes.
    pub fn is_quiescent(&self) -> bool {
        // A running exchange ends when the next edge does not come, so there is still work.
        self.regler.is_quiescent() && !self.exchanges
    }

    /// Handles the master's reference value frame of `channel`. If the frame carries only a part of a mapped
    /// value, the value does not change.
    #[inline]
    pub fn reference_frame(&mut self, channel: Channel, payload: &Payload) {
        self.card.receive(Source::Master, channel, payload);
    }

    /// Handles the actual value frame of `channel` from slave `from` (ZK 4 and 5, bit 7).
    #[inline]
    pub fn overheard_frame(&mut self, from: u8, channel: Channel, payload: &Payload) {
        self.card.receive(Source::Slave(from), channel, payload);
    }

    /// Returns the slaves with actual value frames that the drive evaluates, bit n for slave n.
    pub fn wants_overheard(&self) -> u32 {
        self.card.wants_overheard()
    }

    /// Returns true if the drive evaluates the master's reference value frames of `channel`.
    #[inline]
    pub fn wants_reference(&self, channel: Channel) -> bool {
        self.card.wants_reference(channel)
    }

    /// Returns the drive's actual value frame of `channel` in this interval. `None` if no value is mapped
    /// into the frame. Also `None` in an interval without a SYNC edge, because the drive does not answer in
    /// it. Words without a value are 0.
    #[inline]
    pub fn actual_value_frame(&self, channel: Channel) -> Option<Payload> {
        if self.edge_is_missing { None } else { self.card.frame(channel) }
    }

    /// Handles an action command. The drive ignores commands for other drives (SLAVE_GROUP).
    ///
    /// A control word waits for the next exchange between card and drive (decision D-81). Action command "SYNC mode:
    /// on" resumes an exchange that reference value losses have stopped (ZK 26). "SYNC mode: off" ends the synchronized
    /// state. Other commands have no effect.
    pub fn action_command(&mut self, command: &ActionCommand) {
        if !command.concerns(self.slave_number) {
            return;
        }
        match command.action() {
            Action::ControlWord(word) => self.card.receive_control_word(word),
            Action::SyncMode(on) => {
                self.sync.set_mode(on);
                self.show_synchronized();
                if on {
                    self.card.resume();
                }
            }
            Action::Other => {}
        }
    }

    /// Handles a parameter or up-/download job for this drive. Returns the answer frame; `None` if the data field is
    /// not a job.
    ///
    /// The card's manual describes no area for up- and downloads. The drive refuses each up- and download with 16#0104
    /// "not possible" (decision D-47).
    pub fn job(&mut self, payload: &Payload) -> Option<Frame> {
        if let Ok(job) = ParameterJob::decode(payload) {
            return Some(self.parameter_job(&job).frame(self.slave_number));
        }
        let job = UpDownJob::decode(payload).ok()?;
        let refusal = job.answer(UpDownResult::Error(updown_error::NOT_POSSIBLE));
        Some(refusal.frame(self.slave_number))
    }

    /// Answers a parameter job at once. While card and drive exchange no data, the card answers with BUSY, so
    /// that the master repeats the job (5.01010.01 p. 22, 26-27; decision D-615). In this case only the
    /// status word can be read.
    ///
    /// The element selection of a read job is ignored, as the manual permits (5.01010.01 p. 26). Only element
    /// 7 can be written; for other elements the error is 16#FFFC "not changeable". The drive has no
    /// sub-slaves: each sub-slave address except 0 gives 16#FFFB "not present".
    pub fn parameter_job(&mut self, job: &ParameterJob) -> ParameterResponse {
        job.answer(self.service(job).unwrap_or_else(ParameterResult::Error))
    }

    fn service(&mut self, job: &ParameterJob) -> Result<ParameterResult, u16> {
        if job.sub_slave() != 0 {
            return Err(par_error::NOT_PRESENT);
        }
        if !self.exchanges || self.is_exchange_stopped() {
            return Ok(self.answer_of_the_card(job));
        }
        let (format, value) = match job.access() {
            Access::Read => {
                return Ok(match self.regler.read_element(job.number(), VALUE_ELEMENT)? {
                    (ParamFormat::Word, value) => ParameterResult::Word(value as u16),
                    (ParamFormat::Doubleword, value) => ParameterResult::Doubleword(value),
                });
            }
            Access::WriteWord(value) => (ParamFormat::Word, u32::from(value)),
            Access::WriteDoubleword(value) => (ParamFormat::Doubleword, value),
        };
        self.regler.write_element(job.number(), job.element(), format, value)?;
        Ok(ParameterResult::Done)
    }

    /// Answers a job while card and drive exchange no data. The card can answer a read of the status word: it
    /// has the last status word of the drive, and it sets bit 15 itself (5.01010.01 p. 30). All other jobs
    /// must wait.
    fn answer_of_the_card(&self, job: &ParameterJob) -> ParameterResult {
        match (job.number(), job.access(), self.card.sampled_status()) {
            (number::STATUS_WORD, Access::Read, Some(word)) => {
                let sync_state = self.status_word() & drive_status::SYNCHRONIZED;
                ParameterResult::Word(word & !drive_status::SYNCHRONIZED | sync_state)
            }
            _ => ParameterResult::Busy,
        }
    }

    /// Returns the settings of the drive's parameters that are wrong on a bus with this interval. Each
    /// combination of values is returned only once.
    pub(crate) fn take_objections(&mut self, interval_us: u32) -> impl Iterator<Item = Objection> + use<> {
        let ((slot_us, offset_us), pwm_khz) = (self.regler.sync_times(), self.regler.pwm_khz());
        let settings = Settings { slot_us, offset_us, pwm_khz, interval_us };
        let is_new = self.objected.replace(settings) != Some(settings);
        let slot = (is_new && slot_us != interval_us).then_some(Objection::SyncSlot(slot_us));
        let offset = (is_new && offset_us != 0).then_some(Objection::SyncOffset(offset_us));
        let pwm = is_new.then(|| pwm_objection(pwm_khz)).flatten();
        slot.into_iter().chain(offset).chain(pwm)
    }

    /// Returns the value of parameter `number`, if the drive has it.
    pub fn parameter(&self, number: u16) -> Option<u32> {
        self.regler.parameter(number)
    }

    /// Returns the status word (parameter 121) with the SYNC state in bit 15.
    #[inline]
    pub fn status_word(&self) -> u16 {
        self.regler.status_word()
    }

    /// Returns true if the drive is synchronized to the SYNC signal.
    #[inline]
    pub fn is_synchronized(&self) -> bool {
        self.sync.is_locked()
    }

    /// Returns the state of the drive's state machine.
    pub fn state(&self) -> DrivecomState {
        self.regler.state()
    }

    /// Returns the number of missed reference value frames. The card counts them while card and drive exchange data,
    /// from the first frame on.
    pub fn reference_losses(&self) -> u64 {
        self.card.total_losses()
    }

    /// Returns true if more reference values were lost in direct succession than ZK 26 permits. Card and drive exchange
    /// no data until SYNC mode is switched on again.
    pub fn is_exchange_stopped(&self) -> bool {
        self.card.is_stopped()
    }

    /// Trips the drive: it brakes and waits for a fault reset (control word, bit 7). Until the reset,
    /// parameter 308 has the number of the first fault. Returns false if the drive already has a fault.
    pub fn trip(&mut self, fault: u16) -> bool {
        self.regler.trip(fault)
    }

    /// Sets or clears the warning bit of the status word.
    pub fn set_warning(&mut self, on: bool) {
        self.regler.set_warning(on);
    }
}
