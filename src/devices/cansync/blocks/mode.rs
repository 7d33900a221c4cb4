//! `CANsync_MODE_MA`, `CANsync_MODE_SL`: commands to a node, and its state (p. 216-221).

use crate::devices::cansync::registers::values::{
    cpu_control::{ENABLE_ACTIVE, RESET_CONTROLLER, RESTART, START_SYNCHRONOUS, TAKE_OVER_INIT_DATA},
    option_status,
};
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::memory::{Cell16, SharedRegs};
use crate::plc::{Base, Like, Viewed, function_block};

macro_rules! mode {
    ($name:ident, $base:ident, $role:literal, $page:literal) => {
        function_block! {
            #[doc = concat!("Sets the operating mode of a CANsync ", $role, " (manual p. ", $page, ").")]
            ///
            /// Inputs are commands. Outputs show the node's state at the time of the call, so the answer to a
            /// command is visible at a later call. If no input is TRUE, the block sends no command. If
            /// `x_SYNC_MODE` and `x_CANsync_RUN` are both TRUE, the block first sets the synchronous mode up,
            /// and enables it at a later call. When the mode is active, the block sends no further command
            /// (decision D-204).
            pub struct $name(_BASE: Base<$base>) {
                in {
                    /// TRUE restarts the node.
                    x_RESET_SOFTWARE: bool;
                    /// Takes over initialization data.
                    x_SET_INIT_DATA: bool;
                    /// TRUE enables active operation.
                    x_CANsync_RUN: bool;
                    /// Resets the CAN controller; ends BUS-off.
                    x_RESET_CANsync_CONTROLLER: bool;
                    /// Sets up synchronous operation.
                    x_SYNC_MODE: bool;
                    /// Reserved by the manual; without effect.
                    x_ASYNC_MODE0: bool;
                    /// Reserved by the manual; without effect.
                    x_ASYNC_MODE1: bool;
                }
                out {
                    /// TRUE while the handshake is active (`w_OPTION_STATUS` is 16#0001).
                    x_HS_ACTIV: bool;
                    /// Waits for initialization data (16#0002).
                    x_INIT_POSSIBLE: bool;
                    /// Waits for the command that sets the mode (16#0003).
                    x_WAIT: bool;
                    /// A mode is being set up (16#0013, 16#0043).
                    x_PREPARE_ACTIV: bool;
                    /// A mode is active (16#0020, 16#0080).
                    x_CANsync_ACTIV: bool;
                    /// The mode is synchronous operation.
                    x_SYNC_MODE_ACTIV: bool;
                    /// Asynchronous operation; reserved, always FALSE.
                    x_ASYNC_MODE_ACTIV: bool;
                    /// TRUE if the node runs as slave.
                    x_SL: bool;
                    /// TRUE if the node runs as master.
                    x_MA: bool;
                }
            }
        }

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &Base<impl Like<$base>>) {
                let _BASE = &_BASE.viewed();
                let state = _BASE.w_OPTION_STATUS.load();
                let commands = Commands {
                    restart: self.x_RESET_SOFTWARE,
                    take_over: self.x_SET_INIT_DATA,
                    synchronous: self.x_SYNC_MODE,
                    run: self.x_CANsync_RUN,
                    reset_controller: self.x_RESET_CANsync_CONTROLLER,
                };
                commands.give(_BASE, &_BASE.w_CPU_CONTROL, state);
                self.x_HS_ACTIV = state == option_status::START_UP;
                self.x_INIT_POSSIBLE = state == option_status::WAITING_FOR_INIT;
                self.x_WAIT = state == option_status::WAITING_FOR_START;
                self.x_PREPARE_ACTIV = is_set_up(state);
                self.x_CANsync_ACTIV = is_active(state);
                self.x_SYNC_MODE_ACTIV = is_set_up(state) || is_active(state);
                self.x_ASYNC_MODE_ACTIV = false;
                self.x_SL = matches!(state, option_status::SLAVE_SET_UP | option_status::SLAVE_ACTIVE);
                self.x_MA = matches!(state, option_status::MASTER_SET_UP | option_status::MASTER_ACTIVE);
            }
        }
    };
}

mode!(CANsync_MODE_MA, CANsync_MA_CTRL_BMSTRUCT, "master", "216-218");
mode!(CANsync_MODE_SL, CANsync_SL_CTRL_BMSTRUCT, "slave", "219-221");

fn is_set_up(state: u16) -> bool {
    matches!(state, option_status::SLAVE_SET_UP | option_status::MASTER_SET_UP)
}

fn is_active(state: u16) -> bool {
    matches!(state, option_status::SLAVE_ACTIVE | option_status::MASTER_ACTIVE)
}

struct Commands {
    restart: bool,
    take_over: bool,
    synchronous: bool,
    run: bool,
    reset_controller: bool,
}

impl Commands {
    /// Writes the command. If several inputs are TRUE, writes the command that comes first in the sequence of
    /// a start.
    fn give<T: SharedRegs>(&self, base: &Viewed<'_, T>, control: &Cell16, state: u16) {
        let command = match self {
            Commands { restart: true, .. } => {
                // A restart also resets the controller.
                control.store(RESTART);
                base.notify_restart();
                return;
            }
            Commands { take_over: true, .. } => Some(TAKE_OVER_INIT_DATA),
            Commands { synchronous: true, run: true, .. } if is_active(state) => None,
            Commands { synchronous: true, run: true, .. } if is_set_up(state) => Some(ENABLE_ACTIVE),
            Commands { synchronous: true, .. } => Some(START_SYNCHRONOUS),
            Commands { run: true, .. } => Some(ENABLE_ACTIVE),
            _ => None,
        };
        match (command, self.reset_controller) {
            (Some(command), false) => control.store(command),
            (Some(command), true) => control.store(command | RESET_CONTROLLER),
            (None, true) => {
                control.update(|value| value | RESET_CONTROLLER);
            }
            (None, false) => {}
        }
    }
}
