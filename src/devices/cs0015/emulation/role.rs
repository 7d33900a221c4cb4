//! Role of the device on its bus (not a CANopen node, a node, or the master), and the orders of its program.

use super::canopen::nmt::Nmt;
use super::jobs;
use super::port::Firmware;
use super::rules;
use crate::devices::Context;
use crate::devices::can_bus::Controller;
use crate::devices::canopen::nmt::State;
use crate::devices::cs0015::registers::values::{bool, state};
use crate::devices::cs0015::registers::{CS0015_JOBS, JOBS};

impl Firmware {
    /// Starts CANopen if the program has switched it on and it does not run yet (p. 28).
    pub(super) fn open(&mut self, now: u64) {
        let is_can_open = self.node.registers.flags.CAN_OPEN.load() != bool::FALSE;
        if is_can_open && self.node.state() == State::Initialising {
            self.node.restart(State::PreOperational, now);
        }
    }

    /// Initialises the CAN controller with the bit rate in force. A controller with a fault does not take
    /// part in the bus (D-452).
    pub(super) fn init_can(&mut self, controller: &mut Controller) {
        let flags = &self.node.registers.flags;
        if self.shared.defects().has_no_can {
            self.can_errors.not_initialised(flags);
            controller.set_bit_rate(0);
        } else {
            controller.set_bit_rate(u32::from(flags.CANBAUDRATE.load()) * 1000);
        }
    }

    /// Makes the device the master of the network (p. 53).
    pub(super) fn make_master(&mut self) -> &mut Nmt {
        self.node.set_open(true);
        self.nmt.get_or_insert_default()
    }

    /// Ends the role of master.
    pub(super) fn end_master(&mut self) {
        self.node.set_open(false);
        (self.nmt, self.master) = (None, None);
        self.node.registers.flags.COP_GUARDFAIL_NODEID.store(0);
    }

    /// Resets the communication if CANopen was started. The device then loses the role of master (p. 48).
    pub(super) fn reset_communication(&mut self, now: u64) {
        let at = JOBS + core::mem::offset_of!(CS0015_JOBS, a_FUNCTION) as u32;
        if self.nmt.is_some() || self.master.is_some() {
            self.peripherals.findings.push((&rules::PDO_AFTER_MASTER, at, 0));
        } else if self.node.state().has_pdo() {
            self.peripherals.findings.push((&rules::PDO_LATE, at, 0));
        }
        self.end_master();
        if self.node.state() != State::Initialising {
            self.node.restart(State::PreOperational, now);
        }
    }

    /// Carries out the orders of the program. This has an effect only in Run.
    pub(super) fn look_at_jobs(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if self.state == state::RUN {
            jobs::look(self, ctx, controller);
        }
    }

    /// Continues orders that have been started but are not finished.
    pub(super) fn continue_jobs(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if !self.under_way.is_empty() {
            self.look_at_jobs(ctx, controller);
        }
    }
}
