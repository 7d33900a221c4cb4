//! `CANsync_PAR_READ_MA`, `CANsync_PAR_WRITE_MA`: parameter jobs of a master (p. 222-224, 230-232).

use super::registers::{ACTIVE, ERROR, Job, slave_index};
use crate::devices::omega_drive_line_2::registers::{CANsync_MA_CTRL_BMSTRUCT, DATA_PARAMETER};
use crate::plc::Base;
use crate::plc::Watch;
use core::time::Duration;

/// Bit 0 of `b_ERR`.
const COMMUNICATION: u8 = 1 << 0;
/// Bit 1.
const TIMEOUT: u8 = 1 << 1;
/// Bit 4.
const SLAVE_NUMBER: u8 = 1 << 4;

/// Bits 1 and 2 of the control register, with bit 0.
const READ: u8 = 0x03;
const WRITE: u8 = 0x05;
/// Bit 4.
const DOUBLEWORD: u8 = 1 << 4;

/// Preset of `t_TIME`.
const PRESET_TIME: Duration = Duration::from_secs(3);

/// How far a job is.
#[derive(Clone, Copy, Debug, Default)]
enum Phase {
    #[default]
    Idle,
    /// Another block's job for the same slave is under way.
    Waiting(Watch),
    Running(Watch),
    /// Ends when `x_EN` falls.
    Done,
    /// Failed or cancelled: only `x_RESET` helps.
    Locked,
}

/// What a call means for the outputs.
enum Outcome {
    Unchanged,
    Cleared,
    Busy,
    Cancelled,
    /// Control register and value at a good end.
    Done(u8, u32),
    /// `b_ERR` and `i_ERR`.
    Failed(u8, i16),
}

/// The inputs of both blocks.
struct Inputs {
    slave: i8,
    number: u16,
    command: u8,
    value: Option<u32>,
    time: Duration,
    enable: bool,
    reset: bool,
}

/// The registers of one slave's job.
fn registers(base: &CANsync_MA_CTRL_BMSTRUCT, slave: i8) -> Option<(Job<'_>, &DATA_PARAMETER)> {
    let index = slave_index(slave)?;
    let job = base.a_CTRLREG_PAR_CMD_SL.get(index)?;
    let job = Job { control: &job.b_STEUREG_PAR_CMD, status: &job.b_STATREG_PAR_CMD };
    Some((job, base.a_DATA_PARAMETER.get(index)?))
}

/// The state that a block keeps from call to call.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    phase: Phase,
    /// The slave of the job under way, whatever the input shows meanwhile.
    slave: i8,
}

impl State {
    fn step(&mut self, base: &Base<CANsync_MA_CTRL_BMSTRUCT>, inputs: &Inputs) -> Outcome {
        if inputs.reset {
            self.withdraw(base);
            self.phase = Phase::Idle;
            return Outcome::Cleared;
        }
        match (self.phase, inputs.enable) {
            (Phase::Waiting(_) | Phase::Running(_), false) => {
                self.withdraw(base);
                self.phase = Phase::Locked;
                return Outcome::Cancelled;
            }
            (Phase::Done, false) => self.phase = Phase::Idle,
            (Phase::Idle, true) => {
                if slave_index(inputs.slave).is_none() {
                    self.phase = Phase::Locked;
                    return Outcome::Failed(SLAVE_NUMBER, 0);
                }
                self.slave = inputs.slave;
                self.phase = Phase::Waiting(base.watch(inputs.time));
            }
            _ => {}
        }
        self.proceed(base, inputs)
    }

    fn proceed(&mut self, base: &Base<CANsync_MA_CTRL_BMSTRUCT>, inputs: &Inputs) -> Outcome {
        let (Phase::Waiting(watch) | Phase::Running(watch)) = self.phase else { return Outcome::Unchanged };
        let Some((job, data)) = registers(base, self.slave) else { return Outcome::Unchanged };
        let control = job.control();
        if control & ACTIVE == 0 {
            if matches!(self.phase, Phase::Running(_)) {
                return self.end(control, data.d_PAR_VALUE.load());
            }
            data.w_PAR_NR.store(inputs.number);
            if let Some(value) = inputs.value {
                data.d_PAR_VALUE.store(value);
            }
            job.enter(inputs.command);
            self.phase = Phase::Running(watch);
        } else if watch.is_over(base) {
            self.withdraw(base);
            self.phase = Phase::Locked;
            return Outcome::Failed(TIMEOUT, 0);
        }
        Outcome::Busy
    }

    fn end(&mut self, control: u8, value: u32) -> Outcome {
        if control & ERROR != 0 {
            self.phase = Phase::Locked;
            return Outcome::Failed(COMMUNICATION, value as i16);
        }
        self.phase = Phase::Done;
        Outcome::Done(control, value)
    }

    /// Takes the own job out of the registers; a slave that does not answer would be asked for ever.
    fn withdraw(&self, base: &Base<CANsync_MA_CTRL_BMSTRUCT>) {
        if let Phase::Running(_) = self.phase
            && let Some((job, _)) = registers(base, self.slave)
        {
            job.enter(0);
        }
    }
}

macro_rules! block {
    (
        $(#[$doc:meta])* $name:ident { $($(#[$fdoc:meta])* $field:ident: $type:ty,)* }
        errors { $($(#[$edoc:meta])* $error:ident: $etype:ty,)* }
        $command:expr; value $value:expr; done $done:expr
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug)]
        pub struct $name {
            /// The slave, 0 to 31.
            pub si_SL_NR: i8,
            /// Parameter number.
            pub u_PAR_NR: u16,
            /// Format of the parameter: FALSE word, TRUE doubleword.
            pub x_PAR_FORMAT: bool,
            /// Sub-slave address; reserved.
            pub i_SUB_SL: i16,
            /// Monitoring time in emulated time; preset 3 s.
            pub t_TIME: Duration,
            /// Starts the job; TRUE until `x_BUSY` falls. FALSE before: cancels, then `x_RESET` is needed.
            pub x_EN: bool,
            /// Resets the block; needed after an error or a cancelled job.
            pub x_RESET: bool,
            $($(#[$fdoc])* pub $field: $type,)*
            /// The job is under way.
            pub x_BUSY: bool,
            $($(#[$edoc])* pub $error: $etype,)*
            /// `b_ERR` is not 0.
            pub x_ERR: bool,
            /// The last job has been done.
            pub x_OK: bool,
            #[doc(hidden)]
            pub internal: State,
        }

        impl Default for $name {
            fn default() -> Self {
                $name {
                    si_SL_NR: 0,
                    u_PAR_NR: 0,
                    x_PAR_FORMAT: false,
                    i_SUB_SL: 0,
                    t_TIME: PRESET_TIME,
                    x_EN: false,
                    x_RESET: false,
                    $($field: Default::default(),)*
                    x_BUSY: false,
                    $($error: Default::default(),)*
                    x_ERR: false,
                    x_OK: false,
                    internal: State::default(),
                }
            }
        }

        impl $name {
            /// One PLC cycle.
            pub fn call(&mut self, _BASE: &Base<CANsync_MA_CTRL_BMSTRUCT>) {
                let value: fn(&Self) -> Option<u32> = $value;
                let done: fn(&mut Self, u8, u32) = $done;
                let inputs = Inputs {
                    slave: self.si_SL_NR,
                    number: self.u_PAR_NR,
                    command: $command | if self.x_PAR_FORMAT { DOUBLEWORD } else { 0 },
                    value: value(self),
                    time: self.t_TIME,
                    enable: self.x_EN,
                    reset: self.x_RESET,
                };
                let outcome = self.internal.step(_BASE, &inputs);
                if let Outcome::Unchanged = outcome {
                    return;
                }
                self.x_BUSY = matches!(outcome, Outcome::Busy);
                self.x_OK = matches!(outcome, Outcome::Done(..));
                (self.b_ERR, self.i_ERR) = match outcome {
                    Outcome::Failed(error, number) => (error, number),
                    _ => (0, 0),
                };
                self.x_ERR = self.b_ERR != 0;
                if let Outcome::Done(control, value) = outcome {
                    done(self, control, value);
                }
            }
        }
    };
}

block! {
    /// Reads a parameter of a slave (manual p. 222-224). Needs
    /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) first. Several instances may run at the
    /// same time, one per slave.
    CANsync_PAR_READ_MA {
        /// The value read.
        ud_PAR_VALUE: u32,
        /// Format of the value read: FALSE word, TRUE doubleword.
        x_PAR_FORMAT_READ: bool,
    }
    errors {
        /// Bit 0: the slave reports `i_ERR`, 1: timeout, 4: slave number not 0 to 31.
        b_ERR: u8,
        /// Error number of the slave.
        i_ERR: i16,
    }
    READ;
    value |_| None;
    done |this, control, value| {
        this.ud_PAR_VALUE = value;
        this.x_PAR_FORMAT_READ = control & DOUBLEWORD != 0;
    }
}

block! {
    /// Writes a parameter of a slave (manual p. 230-232). Needs
    /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) first. Several instances may run at the
    /// same time, one per slave.
    CANsync_PAR_WRITE_MA {
        /// The value to write.
        ud_PAR_VALUE: u32,
    }
    errors {
        /// Error number of the slave.
        i_ERR: i16,
        /// Bit 0: the slave reports `i_ERR`, 1: timeout, 4: slave number not 0 to 31.
        b_ERR: u8,
    }
    WRITE;
    value |this| Some(this.ud_PAR_VALUE);
    done |_, _, _| {}
}
