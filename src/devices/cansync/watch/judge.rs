//! What is wrong with a write: the rules that can be seen at the moment of writing.

use super::Facts;
use super::node::Registers;
use super::registers::{Kind, Limit, Watched};
use crate::check;
use crate::devices::cansync::bus::LAST_SLAVE;
use crate::devices::cansync::registers::values::{
    cfg_word, par_job_master, par_job_slave, request, send, updown_master, updown_slave,
};
use crate::devices::cansync::registers::{
    CANsync_MA_CTRL_BMSTRUCT as Master, CTRLREG_PAR_CMD_SL, DATA_PARAMETER,
};
use crate::devices::cansync::rules;
use crate::journal::{Finding, Journal, Rule};
use crate::layout::RegisterPhase;
use core::mem::offset_of;

/// Highest value number.
const LAST_VALUE: u32 = 7;

/// Bit 0 of every job's control register.
const ACTIVE: u8 = par_job_master::ACTIVE;
/// Bit 7 of every job's control register that has one.
const RESET: u8 = updown_master::CANCEL;
/// What a parameter job asks for.
const PARAMETER_COMMAND: u8 = par_job_master::READ | par_job_master::WRITE | par_job_master::DOUBLEWORD;

/// Where the judge is at work.
pub(super) struct Place {
    pub plc: u16,
    /// First byte of the node.
    pub base: usize,
    /// Which structure is valid.
    pub live: RegisterPhase,
}

/// Judges the writes to a node's registers.
pub(super) struct Judge<'a> {
    pub place: Place,
    pub now: u64,
    pub facts: &'a Facts,
    pub registers: &'a Registers,
    pub journal: &'a mut Journal,
    /// Set when the mapping was changed.
    pub unsettled: &'a mut bool,
}

impl Judge<'_> {
    /// Reports a finding at the register at `offset` in the node.
    pub(crate) fn find(&mut self, rule: &'static Rule, offset: usize, value: u32) {
        self.find_late(rule, offset, value, 0);
    }

    fn find_late(&mut self, rule: &'static Rule, offset: usize, value: u32, late_us: u32) {
        let Place { plc, base, live } = self.place;
        let finding = Finding { rule, plc, offset: (base + offset) as u32, live, value, late_us };
        self.journal.find(self.now, finding);
    }

    /// A register that held `before` was given `after`, which is different, or through the channel the same.
    pub(crate) fn write(&mut self, register: &Watched, before: u32, after: u32) {
        let offset = usize::from(register.offset);
        match register.kind {
            Kind::Owned => return self.find(&check::rules::OWNER, offset, after),
            Kind::Reserved => return self.find(&check::rules::RESERVED_REGISTER, offset, after),
            // While the node waits for its start, a program can still believe that it initializes it.
            Kind::ReservedUnderInit if !self.facts.is_on_bus => {
                return self.find(&rules::AFTER_INIT, offset, after);
            }
            Kind::ReservedUnderInit => return self.find(&check::rules::RESERVED_REGISTER, offset, after),
            _ => {}
        }
        if after & register.reserved_bits != 0 {
            self.find(&check::rules::RESERVED_BIT, offset, after);
        }
        self.limits(register, after);
        let [was, is] = [before, after].map(|value| value as u8);
        match register.kind {
            Kind::Mapping => self.mapping(register, after),
            Kind::Request => *self.unsettled = true,
            Kind::Release(frame) => self.release(frame, offset, after),
            Kind::ControlWord(slave) if after == u32::from(send::RELEASED) => {
                self.polled(offset_of!(Master, b_SL_NR_CONTROLWORD), slave, offset);
            }
            Kind::Parameter(slave) => self.parameter(slave, offset, was, is),
            Kind::ParameterData(slave, is_value) => self.parameter_data(slave, is_value, offset, after),
            Kind::Block => self.block(offset, was, is),
            Kind::BlockData(is_data) => self.block_data(is_data, offset, after),
            Kind::SlaveJob => {
                // The application ends the job or confirms a change.
                let acted = was & ACTIVE & !is | is & RESET & !was;
                if acted != 0 && (is ^ self.status_of(offset)) & (ACTIVE | RESET) != 0 {
                    self.find(&rules::ORDER, offset, after);
                }
            }
            _ => {}
        }
    }

    fn limits(&mut self, register: &Watched, after: u32) {
        let offset = usize::from(register.offset);
        let is_slave = after <= LAST_SLAVE.into();
        match register.limit {
            Limit::Slave if !is_slave => self.find(&rules::SLAVE_NUMBER, offset, after),
            Limit::SlaveOrAutomatic
                if !is_slave && ![request::AUTOMATIC, request::NOBODY].map(u32::from).contains(&after) =>
            {
                self.find(&rules::SLAVE_NUMBER, offset, after);
            }
            Limit::NotReserved(meaning) if meaning.value(after).is_some_and(|value| value.reserved) => {
                self.find(&check::rules::RESERVED_VALUE, offset, after);
            }
            _ => {}
        }
    }

    fn mapping(&mut self, register: &Watched, after: u32) {
        let offset = usize::from(register.offset);
        *self.unsettled = true;
        let used = after & !register.reserved_bits;
        if used & u32::from(cfg_word::ASSIGNED) == 0 && used != 0 {
            self.find(&rules::WORD_UNASSIGNED, offset, after);
        } else if used >> cfg_word::NUMBER.trailing_zeros() > LAST_VALUE {
            self.find(&rules::VALUE_NUMBER, offset, after);
        }
    }

    fn release(&mut self, frame: usize, offset: usize, after: u32) {
        if let Some(Some(deadline)) = self.facts.missed.get(frame)
            && after == u32::from(send::RELEASED)
        {
            let rule = if self.facts.is_master { &rules::LATE_REFERENCE } else { &rules::LATE_ACTUAL };
            self.find_late(rule, offset, after, u32::try_from(self.now - deadline).unwrap_or(u32::MAX));
        }
    }

    /// The status register of a job lies behind its control register.
    fn status_of(&self, control: usize) -> u8 {
        self.registers.now(control + 1)
    }

    /// A job for `slave` was entered; `polling` is the register that says whose turn it is.
    fn polled(&mut self, polling: usize, slave: u8, offset: usize) {
        let max = self.registers.now(offset_of!(Master, b_MAX_SL_NR));
        if self.facts.is_active && self.registers.now(polling) == request::AUTOMATIC && slave > max {
            self.find(&rules::NEVER_POLLED, offset, self.registers.now(offset).into());
        }
    }

    fn parameter(&mut self, slave: u8, offset: usize, was: u8, is: u8) {
        const UNDER_WAY: u8 = ACTIVE | par_job_master::SENT;
        self.entered(offset, was, is, par_job_master::SENT);
        if is & UNDER_WAY == ACTIVE {
            self.polled(offset_of!(Master, b_SL_NR_PARAMETER), slave, offset);
        }
        if was & is & UNDER_WAY == UNDER_WAY && (was ^ is) & PARAMETER_COMMAND != 0 {
            self.find(&rules::JOB_CHANGED, offset, is.into());
        }
    }

    /// A new job: bit 0 set and the Send bit, which the firmware sets, not.
    fn entered(&mut self, offset: usize, was: u8, is: u8, sent: u8) {
        if is & (ACTIVE | sent) != ACTIVE {
            return;
        }
        if self.status_of(offset) != is {
            self.find(&rules::ORDER, offset, is.into());
        }
        if was & ACTIVE != 0 && was & sent != 0 {
            self.find(&rules::JOB_REPLACED, offset, is.into());
        }
    }

    /// Whether a job is under way whose control register the PLC has left alone.
    fn is_untouched(&self, control: usize, sent: u8) -> bool {
        let now = self.registers.now(control);
        now == self.registers.left(control) && now & (ACTIVE | sent) == ACTIVE | sent
    }

    fn parameter_data(&mut self, slave: u8, is_value: bool, offset: usize, after: u32) {
        let control = offset_of!(Master, a_CTRLREG_PAR_CMD_SL)
            + usize::from(slave) * size_of::<CTRLREG_PAR_CMD_SL>()
            + offset_of!(CTRLREG_PAR_CMD_SL, b_STEUREG_PAR_CMD);
        // The value of a read job is the firmware's to fill in.
        let matters = !is_value || self.registers.now(control) & par_job_master::WRITE != 0;
        if matters && self.is_untouched(control, par_job_master::SENT) {
            self.find(&rules::JOB_CHANGED, offset, after);
        }
    }

    fn block(&mut self, offset: usize, was: u8, is: u8) {
        if is & RESET != 0 {
            return;
        }
        self.entered(offset, was, is, updown_master::SENT);
        if is & (ACTIVE | updown_master::SENT) == ACTIVE {
            let slave = self.registers.now(offset_of!(Master, b_SL_NR_UPDOWNBLK1));
            self.polled(offset_of!(Master, b_SL_NR_UPDOWN), slave, offset);
        }
        if was & is & (ACTIVE | updown_master::SENT) == ACTIVE | updown_master::SENT
            && (was ^ is) & updown_master::DOWNLOAD != 0
        {
            self.find(&rules::JOB_CHANGED, offset, is.into());
        }
    }

    fn block_data(&mut self, is_data: bool, offset: usize, after: u32) {
        let control = offset_of!(Master, b_STEUREG_UPDOWNBLK1);
        // The data of an upload are the firmware's to fill in.
        let matters = !is_data || self.registers.now(control) & updown_master::DOWNLOAD != 0;
        if matters && self.is_untouched(control, updown_master::SENT) {
            self.find(&rules::JOB_CHANGED, offset, after);
        }
    }
}

// The rules rely on it: these bits are the same in all jobs.
const _: () = assert!(
    updown_master::ACTIVE == ACTIVE && par_job_slave::ACTIVE == ACTIVE && updown_slave::ACTIVE == ACTIVE
);
const _: () = assert!(par_job_slave::RESET == RESET && updown_slave::RESET == RESET);
// And this: a status register lies right behind its control register, in the same word.
const _: () =
    assert!(offset_of!(CTRLREG_PAR_CMD_SL, b_STATREG_PAR_CMD) == 1 && size_of::<DATA_PARAMETER>() == 8);
