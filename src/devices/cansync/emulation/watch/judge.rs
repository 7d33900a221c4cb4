//! Rules that are checked for each write.

use super::Facts;
use super::node::Registers;
use super::registers::{RegisterUse, ValueLimit, WatchedRegister};
use crate::check;
use crate::devices::cansync::frames::LAST_SLAVE;
use crate::devices::cansync::registers::values::{
    cfg_word, par_job_master, par_job_slave, request, send, updown_master, updown_slave,
};
use crate::devices::cansync::registers::{
    CANsync_MA_CTRL_BMSTRUCT as Master, CTRLREG_PAR_CMD_SL, DATA_PARAMETER,
};
use crate::devices::cansync::rules;
use crate::identity::DeviceIndex;
use crate::journal::{Finding, Journal, Rule};
use crate::layout::RegisterPhase;
use core::mem::offset_of;

/// Largest number of a value in a mapping.
const LAST_VALUE: u32 = 7;

/// Bit 0 of the control register of every job.
const ACTIVE: u8 = par_job_master::ACTIVE;
/// Bit 7 of the control register of a job. Not every kind of job has it.
const RESET: u8 = updown_master::CANCEL;
/// Bits of a parameter job that select the access.
const PARAMETER_COMMAND: u8 = par_job_master::READ | par_job_master::WRITE | par_job_master::DOUBLEWORD;

/// Location of the checked node.
pub(super) struct CheckedNode {
    pub plc: DeviceIndex,
    /// First byte of the node.
    pub base: u32,
    /// Phase, which selects the valid structure.
    pub live: RegisterPhase,
}

/// Checks the writes to a node's registers.
pub(super) struct Judge<'a> {
    pub node: CheckedNode,
    pub now: u64,
    pub facts: &'a Facts,
    pub registers: &'a Registers,
    pub journal: &'a mut Journal,
    /// The judge sets this to true when a write changes the mapping.
    pub unsettled: &'a mut bool,
}

impl Judge<'_> {
    /// Reports a rule violation at the register at `offset` in the node.
    pub(crate) fn report_violation(&mut self, rule: &'static Rule, offset: usize, value: u32) {
        self.report_late(rule, offset, value, 0);
    }

    fn report_late(&mut self, rule: &'static Rule, offset: usize, value: u32, late_us: u32) {
        let CheckedNode { plc, base, live } = self.node;
        let finding = Finding { rule, plc, offset: base + offset as u32, live, value, late_us };
        self.journal.find(self.now, finding);
    }

    /// Checks a write that changed a register from `before` to `after`. The two values are equal if the write
    /// came through the channel and changed no value.
    pub(crate) fn write(&mut self, register: &WatchedRegister, before: u32, after: u32) {
        let offset = usize::from(register.offset);
        match register.kind {
            RegisterUse::Owned => return self.report_violation(&check::rules::OWNER, offset, after),
            RegisterUse::Reserved => {
                return self.report_violation(&check::rules::RESERVED_REGISTER, offset, after);
            }
            // While the node waits for its start, a program may write these addresses because it still tries
            // to initialize the node.
            RegisterUse::ReservedUnderInit if !self.facts.is_on_bus => {
                return self.report_violation(&rules::AFTER_INIT, offset, after);
            }
            RegisterUse::ReservedUnderInit => {
                return self.report_violation(&check::rules::RESERVED_REGISTER, offset, after);
            }
            _ => {}
        }
        if after & register.reserved_bits != 0 {
            self.report_violation(&check::rules::RESERVED_BIT, offset, after);
        }
        self.limits(register, after);
        let [was, is] = [before, after].map(|value| value as u8);
        match register.kind {
            RegisterUse::Mapping => self.mapping(register, after),
            RegisterUse::Request => *self.unsettled = true,
            RegisterUse::Release(frame) => self.release(frame, offset, after),
            RegisterUse::ControlWord(slave) if after == u32::from(send::RELEASED) => {
                self.polled(offset_of!(Master, b_SL_NR_CONTROLWORD), slave, offset);
            }
            RegisterUse::RequestData(control) => self.request_data(control.into(), offset, after),
            RegisterUse::Parameter(slave) => self.parameter(slave, offset, was, is),
            RegisterUse::ParameterData(slave, is_value) => {
                self.parameter_data(slave, is_value, offset, after)
            }
            RegisterUse::Block => self.block(offset, was, is),
            RegisterUse::BlockData(is_data) => self.block_data(is_data, offset, after),
            RegisterUse::SlaveJob => {
                // The application has ended the job, or has confirmed a change.
                let acted = was & ACTIVE & !is | is & RESET & !was;
                if acted != 0 && (is ^ self.status_of(offset)) & (ACTIVE | RESET) != 0 {
                    self.report_violation(&rules::ORDER, offset, after);
                }
            }
            _ => {}
        }
    }

    fn limits(&mut self, register: &WatchedRegister, after: u32) {
        let offset = usize::from(register.offset);
        let is_slave = after <= LAST_SLAVE.into();
        match register.limit {
            ValueLimit::Slave if !is_slave => self.report_violation(&rules::SLAVE_NUMBER, offset, after),
            ValueLimit::SlaveOrAutomatic
                if !is_slave && ![request::AUTOMATIC, request::NO_SLAVE].map(u32::from).contains(&after) =>
            {
                self.report_violation(&rules::SLAVE_NUMBER, offset, after);
            }
            ValueLimit::NotReserved(meaning) if meaning.value(after).is_some_and(|value| value.reserved) => {
                self.report_violation(&check::rules::RESERVED_VALUE, offset, after);
            }
            _ => {}
        }
    }

    fn mapping(&mut self, register: &WatchedRegister, after: u32) {
        let offset = usize::from(register.offset);
        *self.unsettled = true;
        let used = after & !register.reserved_bits;
        if used & u32::from(cfg_word::ASSIGNED) == 0 && used != 0 {
            self.report_violation(&rules::WORD_UNASSIGNED, offset, after);
        } else if used >> cfg_word::NUMBER.trailing_zeros() > LAST_VALUE {
            self.report_violation(&rules::VALUE_NUMBER, offset, after);
        }
    }

    fn release(&mut self, frame: usize, offset: usize, after: u32) {
        if let Some(Some(deadline)) = self.facts.missed.get(frame)
            && after == u32::from(send::RELEASED)
        {
            let rule = if self.facts.is_master { &rules::LATE_REFERENCE } else { &rules::LATE_ACTUAL };
            self.report_late(rule, offset, after, u32::try_from(self.now - deadline).unwrap_or(u32::MAX));
        }
    }

    /// Returns the status register of a job. Its address follows that of the control register.
    fn status_of(&self, control: usize) -> u8 {
        self.registers.now(control + 1)
    }

    /// Checks that the master polls `slave`, so that a job for this slave is sent. `polling` is the register
    /// that selects the slave.
    fn polled(&mut self, polling: usize, slave: u8, offset: usize) {
        if !self.facts.is_active {
            return;
        }
        let max = self.registers.now(offset_of!(Master, b_MAX_SL_NR));
        let rule = match self.registers.now(polling) {
            request::AUTOMATIC if slave > max => &rules::NEVER_POLLED,
            request::AUTOMATIC => return,
            polled if polled == slave => return,
            _ => &rules::NOT_POLLED,
        };
        self.report_violation(rule, offset, self.registers.now(offset).into());
    }

    /// Checks a write to the data of a frame. A program may write them only while no request for the frame is
    /// pending. `control` is the control register with the request. If it contains a request now, the program
    /// has written it before the data.
    fn request_data(&mut self, control: usize, offset: usize, after: u32) {
        let waits = |value: u8| value == send::RELEASED;
        if self.facts.is_active
            && waits(self.registers.baseline(control))
            && waits(self.registers.now(control))
        {
            self.report_violation(&rules::REQUEST_DATA_CHANGED, offset, after);
        }
    }

    fn parameter(&mut self, slave: u8, offset: usize, was: u8, is: u8) {
        const UNDER_WAY: u8 = ACTIVE | par_job_master::SENT;
        self.entered(offset, was, is, par_job_master::SENT);
        if is & UNDER_WAY == ACTIVE {
            self.polled(offset_of!(Master, b_SL_NR_PARAMETER), slave, offset);
        }
        if was & is & UNDER_WAY == UNDER_WAY && (was ^ is) & PARAMETER_COMMAND != 0 {
            self.report_violation(&rules::JOB_CHANGED, offset, is.into());
        }
    }

    /// Checks a new job: bit 0 is set, and the firmware has not yet set the bit `sent`.
    fn entered(&mut self, offset: usize, was: u8, is: u8, sent: u8) {
        if is & (ACTIVE | sent) != ACTIVE {
            return;
        }
        if self.status_of(offset) != is {
            self.report_violation(&rules::ORDER, offset, is.into());
        }
        if was & ACTIVE != 0 && was & sent != 0 {
            self.report_violation(&rules::JOB_REPLACED, offset, is.into());
        }
    }

    /// Returns true if a job is in progress and the PLC has not changed its control register.
    fn is_untouched(&self, control: usize, sent: u8) -> bool {
        let now = self.registers.now(control);
        now == self.registers.baseline(control) && now & (ACTIVE | sent) == ACTIVE | sent
    }

    fn parameter_data(&mut self, slave: u8, is_value: bool, offset: usize, after: u32) {
        let control = offset_of!(Master, a_CTRLREG_PAR_CMD_SL)
            + usize::from(slave) * size_of::<CTRLREG_PAR_CMD_SL>()
            + offset_of!(CTRLREG_PAR_CMD_SL, b_STEUREG_PAR_CMD);
        // In a read job, only the firmware writes the value. So a change by the program matters only in a
        // write job.
        let matters = !is_value || self.registers.now(control) & par_job_master::WRITE != 0;
        if matters && self.is_untouched(control, par_job_master::SENT) {
            self.report_violation(&rules::JOB_CHANGED, offset, after);
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
            self.report_violation(&rules::JOB_CHANGED, offset, is.into());
        }
    }

    fn block_data(&mut self, is_data: bool, offset: usize, after: u32) {
        let control = offset_of!(Master, b_STEUREG_UPDOWNBLK1);
        // In an upload, only the firmware writes the data. So a change by the program matters only in a
        // download.
        let matters = !is_data || self.registers.now(control) & updown_master::DOWNLOAD != 0;
        if matters && self.is_untouched(control, updown_master::SENT) {
            self.report_violation(&rules::JOB_CHANGED, offset, after);
        }
    }
}

// The rules for jobs use these constants for all kinds of jobs. So the bits must have equal meanings in all
// of them.
const _: () = assert!(
    updown_master::ACTIVE == ACTIVE && par_job_slave::ACTIVE == ACTIVE && updown_slave::ACTIVE == ACTIVE
);
const _: () = assert!(par_job_slave::RESET == RESET && updown_slave::RESET == RESET);
// The rules require that a status register directly follows its control register within one word.
const _: () =
    assert!(offset_of!(CTRLREG_PAR_CMD_SL, b_STATREG_PAR_CMD) == 1 && size_of::<DATA_PARAMETER>() == 8);
