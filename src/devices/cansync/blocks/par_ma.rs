//! `CANsync_PAR_READ_MA`, `CANsync_PAR_WRITE_MA`: parameter jobs of a master (p. 222-224, 230-232).

use super::registers::{Job, slave_index};
use crate::devices::cansync::registers::values::par_job_master::{ACTIVE, DOUBLEWORD, ERROR, READ, WRITE};
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, DATA_PARAMETER};
use crate::plc::{Base, Like, Viewed, Watch, function_block};
use core::time::Duration;

/// Bit 0 of `b_ERR`.
const COMMUNICATION: u8 = 1 << 0;
/// Bit 1.
const TIMEOUT: u8 = 1 << 1;
/// Bit 4.
const SLAVE_NUMBER: u8 = 1 << 4;

/// Preset of `t_TIME`.
pub(crate) const PRESET_TIME: Duration = Duration::from_secs(3);

/// Progress of a job.
#[derive(Clone, Copy, Debug, Default)]
enum JobPhase {
    #[default]
    Idle,
    /// Waits for the end of another block's job for the same slave.
    Waiting(Watch),
    Running(Watch),
    /// Finished; waits until `x_EN` falls.
    Done,
    /// Failed or cancelled; waits for `x_RESET`.
    Locked,
}

/// Result of a call for the outputs.
#[derive(Clone, Copy, Default)]
pub(crate) struct CallResult {
    pub busy: bool,
    /// Value of the output `b_ERR`.
    pub error: u8,
    /// Value of the output `i_ERR`.
    pub number: i16,
    /// Answer of the slave; set when the job is done.
    pub answer: Option<Answer>,
}

/// Answer of the slave.
#[derive(Clone, Copy)]
pub(crate) struct Answer {
    pub value: u32,
    pub doubleword: bool,
}

/// The inputs of a block.
pub(crate) struct Inputs {
    pub slave: i8,
    pub number: u16,
    pub doubleword: bool,
    /// The value to write; `None` for a read access.
    pub write: Option<u32>,
    pub time: Duration,
    pub enable: bool,
    pub reset: bool,
}

impl Inputs {
    fn command(&self) -> u8 {
        let command = if self.write.is_some() { WRITE } else { READ };
        ACTIVE | command | if self.doubleword { DOUBLEWORD } else { 0 }
    }
}

/// Returns the registers of one slave's job.
fn registers(base: &CANsync_MA_CTRL_BMSTRUCT, slave: i8) -> Option<(Job<'_>, &DATA_PARAMETER)> {
    let index = slave_index(slave)?;
    let job = base.a_CTRLREG_PAR_CMD_SL.get(index)?;
    let job = Job { control: &job.b_STEUREG_PAR_CMD, status: &job.b_STATREG_PAR_CMD };
    Some((job, base.a_DATA_PARAMETER.get(index)?))
}

/// State of a block between calls.
#[derive(Clone, Copy, Debug, Default)]
pub struct JobState {
    phase: JobPhase,
    /// The slave of the job in progress. Later values of the input do not change it.
    slave: i8,
}

impl JobState {
    /// Runs one PLC cycle. Returns `None` if the outputs must keep their values.
    pub(crate) fn step(
        &mut self,
        base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>,
        inputs: &Inputs,
    ) -> Option<CallResult> {
        if inputs.reset {
            self.withdraw(base);
            self.phase = JobPhase::Idle;
            return Some(CallResult::default());
        }
        match (self.phase, inputs.enable) {
            (JobPhase::Waiting(_) | JobPhase::Running(_), false) => {
                self.withdraw(base);
                self.phase = JobPhase::Locked;
                return Some(CallResult::default());
            }
            (JobPhase::Done, false) => self.phase = JobPhase::Idle,
            (JobPhase::Idle, true) => {
                if slave_index(inputs.slave).is_none() {
                    return Some(self.fail(SLAVE_NUMBER, 0));
                }
                self.slave = inputs.slave;
                self.phase = JobPhase::Waiting(base.ram().watch(inputs.time));
            }
            _ => {}
        }
        self.proceed(base, inputs)
    }

    fn proceed(
        &mut self,
        base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>,
        inputs: &Inputs,
    ) -> Option<CallResult> {
        let (JobPhase::Waiting(watch) | JobPhase::Running(watch)) = self.phase else { return None };
        let (job, data) = registers(base, self.slave)?;
        let control = job.control();
        if control & ACTIVE == 0 {
            if matches!(self.phase, JobPhase::Running(_)) {
                return Some(self.end(control, data.d_PAR_VALUE.load()));
            }
            data.w_PAR_NR.store(inputs.number);
            if let Some(value) = inputs.write {
                data.d_PAR_VALUE.store(value);
            }
            job.enter(inputs.command());
            self.phase = JobPhase::Running(watch);
        } else if watch.is_over(base.ram()) {
            self.withdraw(base);
            return Some(self.fail(TIMEOUT, 0));
        }
        Some(CallResult { busy: true, ..CallResult::default() })
    }

    fn end(&mut self, control: u8, value: u32) -> CallResult {
        if control & ERROR != 0 {
            return self.fail(COMMUNICATION, value as i16);
        }
        self.phase = JobPhase::Done;
        let answer = Answer { value, doubleword: control & DOUBLEWORD != 0 };
        CallResult { answer: Some(answer), ..CallResult::default() }
    }

    /// Locks the block because the job has failed.
    pub(crate) fn fail(&mut self, error: u8, number: i16) -> CallResult {
        self.phase = JobPhase::Locked;
        CallResult { error, number, ..CallResult::default() }
    }

    /// Removes the block's job from the registers. If the job stayed there and the slave never answered, the
    /// master would repeat it without end.
    fn withdraw(&self, base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>) {
        if let JobPhase::Running(_) = self.phase
            && let Some((job, _)) = registers(base, self.slave)
        {
            job.enter(0);
        }
    }
}

/// Declares the read block of a device: its pages, its text about formats, and a function that checks the
/// formats. This function compares `x_PAR_FORMAT` with the format of the answer and returns the device's
/// additional bits of `b_ERR`.
macro_rules! par_read_ma {
    ($page:literal, $formats:literal, $check:expr) => {
        $crate::plc::function_block! {
            #[doc = concat!("Reads a parameter of a slave (manual p. ", $page, "). Needs")]
            /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) first. Several instances may run at the
            /// same time, one per slave.
            pub struct CANsync_PAR_READ_MA(_BASE: $crate::plc::Base<$crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT>) {
                in {
                    /// Number of the slave, 0 to 31.
                    si_SL_NR: i8;
                    /// Number of the parameter in the drive.
                    u_PAR_NR: u16;
                    /// Format of the parameter: FALSE word, TRUE doubleword.
                    x_PAR_FORMAT: bool;
                    /// Address of a sub-slave; reserved by the manual.
                    i_SUB_SL: i16;
                    /// Monitoring time in emulated time; preset 3 s.
                    t_TIME: core::time::Duration = $crate::devices::cansync::blocks::par_ma::PRESET_TIME;
                    /// Starts the job. The input must stay TRUE until `x_BUSY` becomes FALSE. If it becomes
                    /// FALSE earlier, the job is cancelled, and the block needs `x_RESET`.
                    x_EN: bool;
                    /// Resets the block; needed after an error or a cancelled job.
                    x_RESET: bool;
                }
                out {
                    /// Value of the parameter that the slave has answered.
                    ud_PAR_VALUE: u32;
                    /// Format of the value read: FALSE word, TRUE doubleword.
                    x_PAR_FORMAT_READ: bool;
                    /// The job is in progress.
                    x_BUSY: bool;
                    #[doc = concat!("Bit 0: the slave reports `i_ERR`, 1: timeout, ", $formats, "4: slave number not 0 to 31.")]
                    b_ERR: u8;
                    /// Error number of the slave.
                    i_ERR: i16;
                    /// `b_ERR` is not 0.
                    x_ERR: bool;
                    /// The last job has been done.
                    x_OK: bool;
                }
                internal: $crate::devices::cansync::blocks::par_ma::JobState;
            }
        }

        impl CANsync_PAR_READ_MA {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &$crate::plc::Base<impl $crate::plc::Like<$crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT>>) {
                let _BASE = &_BASE.viewed();
                let inputs = $crate::devices::cansync::blocks::par_ma::Inputs {
                    slave: self.si_SL_NR,
                    number: self.u_PAR_NR,
                    doubleword: self.x_PAR_FORMAT,
                    write: None,
                    time: self.t_TIME,
                    enable: self.x_EN,
                    reset: self.x_RESET,
                };
                let Some(mut shown) = self.internal.step(_BASE, &inputs) else { return };
                if let Some(answer) = shown.answer {
                    (self.ud_PAR_VALUE, self.x_PAR_FORMAT_READ) = (answer.value, answer.doubleword);
                    let error: u8 = $check(self.x_PAR_FORMAT, answer.doubleword);
                    if error != 0 {
                        shown = self.internal.fail(error, 0);
                    }
                }
                (self.x_BUSY, self.x_OK) = (shown.busy, shown.answer.is_some());
                (self.b_ERR, self.i_ERR, self.x_ERR) = (shown.error, shown.number, shown.error != 0);
            }
        }
    };
}

pub(crate) use par_read_ma;

function_block! {
    /// Writes a parameter of a slave (manual p. 230-232). Needs
    /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) first. Several instances may run at the
    /// same time, one per slave.
    pub struct CANsync_PAR_WRITE_MA(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
        in {
            /// Number of the slave, 0 to 31.
            si_SL_NR: i8;
            /// Number of the parameter in the drive.
            u_PAR_NR: u16;
            /// Format of the parameter: FALSE word, TRUE doubleword.
            x_PAR_FORMAT: bool;
            /// Address of a sub-slave; reserved by the manual.
            i_SUB_SL: i16;
            /// The value to write.
            ud_PAR_VALUE: u32;
            /// Monitoring time in emulated time; preset 3 s.
            t_TIME: Duration = PRESET_TIME;
            /// Starts the job. The input must stay TRUE until `x_BUSY` becomes FALSE. If it becomes FALSE
            /// earlier, the job is cancelled, and the block needs `x_RESET`.
            x_EN: bool;
            /// Resets the block; needed after an error or a cancelled job.
            x_RESET: bool;
        }
        out {
            /// The job is in progress.
            x_BUSY: bool;
            /// Error number of the slave.
            i_ERR: i16;
            /// Bit 0: the slave reports `i_ERR`; bit 1: timeout; bit 4: the slave number is not 0 to 31.
            b_ERR: u8;
            /// `b_ERR` is not 0.
            x_ERR: bool;
            /// The last job has been done.
            x_OK: bool;
        }
        internal: JobState;
    }
}

impl CANsync_PAR_WRITE_MA {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        let inputs = Inputs {
            slave: self.si_SL_NR,
            number: self.u_PAR_NR,
            doubleword: self.x_PAR_FORMAT,
            write: Some(self.ud_PAR_VALUE),
            time: self.t_TIME,
            enable: self.x_EN,
            reset: self.x_RESET,
        };
        let Some(shown) = self.internal.step(_BASE, &inputs) else { return };
        (self.x_BUSY, self.x_OK) = (shown.busy, shown.answer.is_some());
        (self.b_ERR, self.i_ERR, self.x_ERR) = (shown.error, shown.number, shown.error != 0);
    }
}
