//! `CANsync_INIT`: from restart to "waiting for start" or set-up mode (p. 211-215, in 5.02066.01a p. 122-127). Each
//! device has its own baud rates.

use crate::devices::cansync::BaudRate;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::values::{
    clock_divider, cpu_control, ma_sl_mode, option_status, output_control,
};
use crate::plc::{Viewed, Watch};
use core::time::Duration;

/// Time limit for each answer of the CANsync node. The manual names no time (decision D-203).
const HANDSHAKE_TIME: Duration = Duration::from_secs(1);

/// Bit 0 of `w_ERR`.
const TIMEOUT: u16 = 1 << 0;
/// Bit 1 of `w_ERR`: invalid bit timing.
const BIT_TIMING: u16 = 1 << 1;
/// Bit 11 of `w_ERR`: the initialization did not finish.
const NOT_FINISHED: u16 = 1 << 11;
/// `us_BAUDRATE` for 125 kbit/s. The block also uses this rate for every undefined number.
const SLOWEST: u8 = 3;

/// The inputs of the block, and the baud rates of the device.
pub(crate) struct Inputs<'a> {
    pub slave: bool,
    pub sync_in: bool,
    /// True if the block also sets up synchronous operation.
    pub set_up: bool,
    pub slave_types: &'a [u8; 32],
    /// Acceptance code and mask.
    pub acceptance: [u8; 2],
    /// Bus timing bytes, used if `baud_rate` is 0.
    pub bit_timing: [u8; 2],
    pub baud_rate: u8,
    pub interval_ms: u8,
    pub rates: &'a [BaudRate],
}

/// An initialization, in progress or finished.
#[derive(Clone, Copy, Debug, Default)]
pub struct Initialization {
    step: Step,
    /// Value of the output `w_ERR`.
    error: u16,
    has_ended: bool,
}

/// The step for which the block waits.
#[derive(Clone, Copy, Debug, Default)]
enum Step {
    #[default]
    Begin,
    Restarted(Watch),
    HandshakeAnswered(Watch),
    DataTakenOver(Watch),
    ModeSet(Watch),
}

impl Initialization {
    /// Runs one PLC cycle and returns `w_ERR` and `x_OK`.
    pub(crate) fn call(
        &mut self,
        base: &Viewed<'_, CANsync_INIT_BMSTRUCT>,
        inputs: &Inputs<'_>,
    ) -> (u16, bool) {
        // In one call the block makes all steps that the node's answers permit.
        while let Some(next) = self.next(base, inputs) {
            self.step = next;
        }
        (self.error, self.has_ended && self.error == 0)
    }

    /// Value of the output `x_ERR`.
    pub(crate) fn has_failed(&self) -> bool {
        self.has_ended && self.error != 0
    }

    /// Returns the next step if the condition for it is met.
    fn next(&mut self, base: &Viewed<'_, CANsync_INIT_BMSTRUCT>, inputs: &Inputs<'_>) -> Option<Step> {
        let state = base.w_OPTION_STATUS.load();
        let command = |value| {
            base.w_CPU_CONTROL.store(value);
            Some(base.ram().watch(HANDSHAKE_TIME))
        };
        match self.step {
            Step::Begin => {
                (self.error, self.has_ended) = (0, false);
                let restarted = command(cpu_control::RESTART).map(Step::Restarted);
                base.notify_restart();
                restarted
            }
            Step::Restarted(_) if state == option_status::START_UP => {
                command(cpu_control::HANDSHAKE).map(Step::HandshakeAnswered)
            }
            Step::HandshakeAnswered(_) if state == option_status::WAITING_FOR_INIT => {
                self.write_data(base, inputs);
                command(cpu_control::TAKE_OVER_INIT_DATA).map(Step::DataTakenOver)
            }
            Step::DataTakenOver(_) if state == option_status::WAITING_FOR_START && inputs.set_up => {
                command(cpu_control::START_SYNCHRONOUS).map(Step::ModeSet)
            }
            Step::DataTakenOver(_) if state == option_status::WAITING_FOR_START => self.end(0),
            Step::ModeSet(_)
                if matches!(state, option_status::SLAVE_SET_UP | option_status::MASTER_SET_UP) =>
            {
                self.end(0)
            }
            Step::Restarted(watch) | Step::HandshakeAnswered(watch) if watch.is_over(base.ram()) => {
                self.end(TIMEOUT | NOT_FINISHED)
            }
            Step::DataTakenOver(watch) | Step::ModeSet(watch) if watch.is_over(base.ram()) => {
                self.end(NOT_FINISHED)
            }
            _ => None,
        }
    }

    fn end(&mut self, error: u16) -> Option<Step> {
        self.error |= error;
        (self.step, self.has_ended) = (Step::Begin, true);
        None
    }

    fn write_data(&mut self, base: &CANsync_INIT_BMSTRUCT, inputs: &Inputs<'_>) {
        let [timing_0, timing_1] = self.bit_timing(inputs);
        let mode = match (inputs.slave, inputs.sync_in) {
            (true, _) => ma_sl_mode::SLAVE,
            (false, false) => ma_sl_mode::MASTER,
            (false, true) => ma_sl_mode::MASTER_SYNC_IN,
        };
        for (register, value) in [
            (&base.b_MA_SL_MODE, mode),
            (&base.b_AC, inputs.acceptance[0]),
            (&base.b_AM, inputs.acceptance[1]),
            (&base.b_BT_0, timing_0),
            (&base.b_BT_1, timing_1),
            (&base.b_OUTPUT_CONTROL, output_control::REQUIRED),
            (&base.b_CLOCK_DIVIDER, clock_divider::REQUIRED),
            (&base.b_TIME_PATTERN, inputs.interval_ms),
        ] {
            register.store(value);
        }
        if !inputs.slave {
            for (register, slave_type) in base.a_SL_TYP.iter().zip(inputs.slave_types) {
                register.store(*slave_type);
            }
        }
    }

    /// Returns `b_BT_0` and `b_BT_1` for the inputs. If the inputs are not documented, sets bit 1 of `w_ERR`.
    fn bit_timing(&mut self, inputs: &Inputs<'_>) -> [u8; 2] {
        let timing = |rate: &BaudRate| [rate.b_BT_0, rate.b_BT_1];
        let of_number = |number| inputs.rates.iter().find(|rate| rate.us_BAUDRATE == number).map(timing);
        let documented = match inputs.baud_rate {
            0 => inputs.rates.iter().map(timing).find(|timing| *timing == inputs.bit_timing),
            number => of_number(number),
        };
        documented.unwrap_or_else(|| {
            self.error |= BIT_TIMING;
            let slowest = if inputs.baud_rate == 0 { None } else { of_number(SLOWEST) };
            slowest.unwrap_or(inputs.bit_timing)
        })
    }
}

/// Declares the block for a device: its pages, its table of baud rates, and the texts that depend on the device.
macro_rules! init {
    ($page:literal, $rates:expr, $sync:literal, $more:literal, $intervals:literal) => {
        $crate::plc::function_block! {
            #[doc = concat!("Initializes a CANsync node as master or slave (manual p. ", $page, ").")]
            ///
            /// The first call begins the initialization. The program must call the block at least once per
            /// processor cycle, until `x_OK` or `x_ERR` is TRUE (decision D-201). The call after that begins
            /// a new initialization.
            pub struct CANsync_INIT(_BASE: $crate::plc::Base<$crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT>) {
                in {
                    /// TRUE initializes a slave; FALSE (default) initializes a master.
                    x_SL: bool;
                    #[doc = concat!("Master: takes over the SYNC signal ", $sync, "; default: generates its own.")]
                    x_SYNC_IN: bool;
                    /// Also sets up synchronous operation. By default, the block only takes over the
                    /// initialization data.
                    x_SYNC_MODE: bool;
                    /// Reserved by the manual; without effect.
                    x_ASYNC_MODE0: bool;
                    /// Reserved by the manual; without effect.
                    x_ASYNC_MODE1: bool;
                    /// For a master: 0 if no slave has this number, 1 if a slave has it.
                    a_SL_TYP: [u8; 32];
                    /// Acceptance code of the CAN controller; the default is 16#FF.
                    b_ACCEPT_CODE: u8 = 0xFF;
                    /// Acceptance mask; 16#FF: everything is received.
                    b_ACCEPT_MASK: u8 = 0xFF;
                    /// Bus timing 0, if `us_BAUDRATE` is 0.
                    b_BIT_TIMING0: u8;
                    /// Bus timing 1, if `us_BAUDRATE` is 0.
                    b_BIT_TIMING1: u8;
                    #[doc = concat!("3: 125 kbit/s, 4: 250, 5: 500, ", $more, "0 (default): the bus timing inputs.")]
                    us_BAUDRATE: u8;
                    #[doc = concat!("CANsync interval in ms: ", $intervals, ".")]
                    us_SYNC_INTERVAL: u8;
                }
                out {
                    /// Bit 0: no answer to the handshake; bit 1: baud rate or bus timing not among the
                    /// documented ones; bit 11: initialization not finished.
                    w_ERR: u16;
                    /// `w_ERR` is not 0.
                    x_ERR: bool;
                    /// The node is initialized.
                    x_OK: bool;
                }
                internal: $crate::devices::cansync::blocks::init::Initialization;
            }
        }

        impl CANsync_INIT {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &$crate::plc::Base<impl $crate::plc::Like<$crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT>>) {
                let inputs = $crate::devices::cansync::blocks::init::Inputs {
                    slave: self.x_SL,
                    sync_in: self.x_SYNC_IN,
                    set_up: self.x_SYNC_MODE,
                    slave_types: &self.a_SL_TYP,
                    acceptance: [self.b_ACCEPT_CODE, self.b_ACCEPT_MASK],
                    bit_timing: [self.b_BIT_TIMING0, self.b_BIT_TIMING1],
                    baud_rate: self.us_BAUDRATE,
                    interval_ms: self.us_SYNC_INTERVAL,
                    rates: $rates,
                };
                (self.w_ERR, self.x_OK) = self.internal.call(&_BASE.viewed(), &inputs);
                self.x_ERR = self.internal.has_failed();
            }
        }
    };
}

pub(crate) use init;
