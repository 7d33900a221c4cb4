//! `CANsync_INIT`: from restart to "waiting for start" or set-up mode (p. 211-215).

use crate::devices::omega_drive_line_2::registers::{BAUD_RATES, CANsync_INIT_BMSTRUCT};
use crate::plc::{Base, Like, Viewed, Watch, function_block};
use core::time::Duration;

/// How long each answer of the CANsync node may take. The manual names no time (decision D-203).
const HANDSHAKE_TIME: Duration = Duration::from_secs(1);

/// Bit 0 of `w_ERR`.
const TIMEOUT: u16 = 1 << 0;
/// Bit 1.
const BIT_TIMING: u16 = 1 << 1;
/// Bit 11.
const NOT_FINISHED: u16 = 1 << 11;

function_block! {
    /// Initializes a CANsync node as master (node 2) or slave (node 1) (manual p. 211-215).
    ///
    /// The first call begins; call on, at least once per processor cycle, until `x_OK` or `x_ERR`
    /// (decision D-201). A call after that begins anew.
    pub struct CANsync_INIT(_BASE: Base<CANsync_INIT_BMSTRUCT>) {
        in {
            /// Slave; default: master.
            x_SL: bool;
            /// Master: takes over the SYNC signal of node 1 (cluster); default: makes its own.
            x_SYNC_IN: bool;
            /// Sets up synchronous operation as well; default: only takes over the initialization data.
            x_SYNC_MODE: bool;
            /// Reserved.
            x_ASYNC_MODE0: bool;
            /// Reserved.
            x_ASYNC_MODE1: bool;
            /// Master: 0 no slave of that number, 1 a slave.
            a_SL_TYP: [u8; 32];
            /// Acceptance code; 16#FF.
            b_ACCEPT_CODE: u8 = 0xFF;
            /// Acceptance mask; 16#FF: everything is received.
            b_ACCEPT_MASK: u8 = 0xFF;
            /// Bus timing 0, if `us_BAUDRATE` is 0.
            b_BIT_TIMING0: u8;
            /// Bus timing 1, if `us_BAUDRATE` is 0.
            b_BIT_TIMING1: u8;
            /// 3: 125 kbit/s, 4: 250, 5: 500, 0 (default): what the bus timing inputs say.
            us_BAUDRATE: u8;
            /// CANsync interval in ms: 8, 4, 2 for the baud rates 3, 4, 5.
            us_SYNC_INTERVAL: u8;
        }
        out {
            /// Bit 0: no answer to the handshake, 1: baud rate or bus timing not among the documented ones,
            /// 11: initialization not finished.
            w_ERR: u16;
            /// `w_ERR` is not 0.
            x_ERR: bool;
            /// The node is initialized.
            x_OK: bool;
        }
        internal: Step;
    }
}

/// What the block waits for.
#[derive(Clone, Copy, Debug, Default)]
pub enum Step {
    #[default]
    Begin,
    Restarted(Watch),
    HandshakeAnswered(Watch),
    DataTakenOver(Watch),
    ModeSet(Watch),
}

impl CANsync_INIT {
    /// One PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_INIT_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        // One call goes as far as the node's answers allow.
        while let Some(next) = self.next(_BASE) {
            self.internal = next;
        }
    }

    /// The next step, if its time has come.
    fn next(&mut self, base: &Viewed<'_, CANsync_INIT_BMSTRUCT>) -> Option<Step> {
        let state = base.w_OPTION_STATUS.load();
        let command = |value| {
            base.w_CPU_CONTROL.store(value);
            Some(base.ram().watch(HANDSHAKE_TIME))
        };
        match self.internal {
            Step::Begin => {
                (self.w_ERR, self.x_ERR, self.x_OK) = (0, false, false);
                let restarted = command(0x0000).map(Step::Restarted);
                base.tell_restart();
                restarted
            }
            Step::Restarted(_) if state == 0x0001 => command(0x0001).map(Step::HandshakeAnswered),
            Step::HandshakeAnswered(_) if state == 0x0002 => {
                self.write_data(base);
                command(0x0002).map(Step::DataTakenOver)
            }
            Step::DataTakenOver(_) if state == 0x0003 && self.x_SYNC_MODE => {
                command(0x0020).map(Step::ModeSet)
            }
            Step::DataTakenOver(_) if state == 0x0003 => self.end(0),
            Step::ModeSet(_) if matches!(state, 0x0013 | 0x0043) => self.end(0),
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
        self.w_ERR |= error;
        self.x_ERR = self.w_ERR != 0;
        self.x_OK = !self.x_ERR;
        self.internal = Step::Begin;
        None
    }

    fn write_data(&mut self, base: &Viewed<'_, CANsync_INIT_BMSTRUCT>) {
        let [timing_0, timing_1] = self.bit_timing();
        let mode = match (self.x_SL, self.x_SYNC_IN) {
            (true, _) => 0x01,
            (false, false) => 0x00,
            (false, true) => 0x02,
        };
        for (register, value) in [
            (&base.b_MA_SL_MODE, mode),
            (&base.b_AC, self.b_ACCEPT_CODE),
            (&base.b_AM, self.b_ACCEPT_MASK),
            (&base.b_BT_0, timing_0),
            (&base.b_BT_1, timing_1),
            (&base.b_OUTPUT_CONTROL, 0xFA),
            (&base.b_CLOCK_DIVIDER, 0x07),
            (&base.b_TIME_PATTERN, self.us_SYNC_INTERVAL),
        ] {
            register.store(value);
        }
        if !self.x_SL {
            for (register, slave_type) in base.a_SL_TYP.iter().zip(self.a_SL_TYP) {
                register.store(slave_type);
            }
        }
    }

    /// `b_BT_0` and `b_BT_1` by the inputs; sets bit 1 if they are not as documented.
    fn bit_timing(&mut self) -> [u8; 2] {
        let documented =
            |rate: &&crate::devices::omega_drive_line_2::registers::BaudRate| match self.us_BAUDRATE {
                0 => (rate.b_BT_0, rate.b_BT_1) == (self.b_BIT_TIMING0, self.b_BIT_TIMING1),
                number => rate.us_BAUDRATE == number,
            };
        let found = BAUD_RATES.iter().find(documented).map(|rate| [rate.b_BT_0, rate.b_BT_1]);
        found.unwrap_or_else(|| {
            self.w_ERR |= BIT_TIMING;
            match self.us_BAUDRATE {
                0 => [self.b_BIT_TIMING0, self.b_BIT_TIMING1],
                // 125 kbit/s (p. 214).
                _ => [0x03, 0x1C],
            }
        })
    }
}
