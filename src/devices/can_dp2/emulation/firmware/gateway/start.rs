//! Start of the gateway on CAN as CANopen master, slave or neither, and SYNC (p. 29, 42-44, 87).

use super::{Gateway, SYNC, Setup, frame};
use crate::can::{Frame, Payload};
use crate::devices::can_dp2::emulation::firmware::modules::ModuleFunction;
use crate::devices::can_dp2::emulation::firmware::parameters::Role;
use crate::devices::can_dp2::registers::values::can_state;
use crate::devices::canopen::nmt::Command;

impl Gateway {
    /// Sets the SYNC time by command 20 and restarts the time (p. 42, 44). A gateway in layer 2 ignores the
    /// command (p. 29; D-720).
    pub(super) fn set_sync_time(&mut self, time: u16) {
        let is_canopen = self.setup.as_ref().is_some_and(|setup| setup.parameters.role() != Role::Layer2);
        if is_canopen && self.registers.set_sync_time(time) {
            self.sync_at = None;
        }
    }

    /// Sets the SYNC time from the comment of a window. A configuration that is already in force also sets
    /// the time again, because the most recent setting of the SYNC time is valid (p. 30, 44).
    pub(in crate::devices::can_dp2::emulation) fn set_sync_time_of_comment(&mut self, time: u16) {
        if self.registers.stored.stored_sync_time.load() != time {
            self.set_sync_time(time);
        }
    }

    /// Sends all outputs if the gateway already has outputs, then remote frames for all inputs (p. 29).
    pub(super) fn send_all(&mut self, now: u64) {
        if self.has_outputs {
            self.send_outputs(now);
        }
        if self.is_configured {
            self.request_inputs();
        }
    }

    /// Sends all outputs and begins their cycles.
    pub(super) fn send_outputs(&mut self, now: u64) {
        let Some(Setup { parameters, configuration, outputs, .. }) = &self.setup else { return };
        let of_outputs = configuration.modules.iter().filter_map(|module| match module.kind {
            ModuleFunction::Output { id, .. } => {
                frame(id, module, outputs.get(module.range())?, parameters.has_tx_counter())
            }
            _ => None,
        });
        let frames: Vec<Frame> = of_outputs.collect();
        frames.into_iter().for_each(|frame| self.push(frame));
        self.start_cycles(now);
    }

    /// Sends remote frames for the inputs of modules and pages.
    fn request_inputs(&mut self) {
        let Some(Setup { parameters, configuration, .. }) = &self.setup else { return };
        let counter = usize::from(parameters.has_rx_counter());
        let of_inputs = configuration.modules.iter().filter_map(|module| match module.kind {
            ModuleFunction::Input { id, is_frozen: false } if parameters.has_rtr() => {
                Frame::remote(id, module.length - counter)
            }
            _ => None,
        });
        let frames: Vec<Frame> = of_inputs.chain(self.page_requests()).collect();
        frames.into_iter().for_each(|frame| self.push(frame));
    }

    /// Handles the end of the wake-up time.
    pub(super) fn wake_up(&mut self, now: u64) {
        let Some(setup) = &self.setup else { return };
        match setup.parameters.role() {
            Role::Slave(number) => {
                self.push(Frame::standard(SYNC + u16::from(number), Payload::EMPTY));
                self.state = can_state::PRE_OPERATIONAL;
            }
            Role::Master | Role::Layer2 => {
                if setup.parameters.has_start_frame() {
                    let start = Payload::new(&[Command::Start.code(), 0]).unwrap_or(Payload::EMPTY);
                    self.push(Frame::standard(0, start));
                }
                self.state = can_state::WORKING;
                self.send_all(now);
            }
        }
        self.show();
    }

    /// Handles a network management command for a slave (p. 29, 87; D-384).
    pub(super) fn command(&mut self, command: Command, now: u64) {
        match command {
            Command::Start if self.state == can_state::PRE_OPERATIONAL => {
                self.state = can_state::WORKING;
                self.send_all(now);
            }
            Command::Start => {}
            Command::Stop | Command::EnterPreOperational => self.state = can_state::PRE_OPERATIONAL,
            Command::ResetNode | Command::ResetCommunication => self.wake_up(now),
        }
        self.show();
    }

    /// Returns the time between SYNC objects in us. `None` unless the gateway works as a master and has
    /// outputs (D-385).
    fn sync_us(&self) -> Option<u64> {
        let is_master = self.setup.as_ref().is_some_and(|setup| setup.parameters.role() == Role::Master);
        let time = self.registers.stored.stored_sync_time.load();
        let runs = is_master && self.has_outputs && self.state == can_state::WORKING && time != 0;
        runs.then(|| u64::from(time) * 1000)
    }

    /// Plans the next SYNC object, if SYNC is on and no earlier SYNC object still waits.
    pub(in crate::devices::can_dp2::emulation) fn plan_sync(&mut self, now: u64) {
        match (self.sync_us(), self.sync_at) {
            (Some(time), None) if !self.sync_waits => self.sync_at = Some(now + time),
            (None, Some(_)) => self.sync_at = None,
            _ => {}
        }
    }

    /// Sends a due SYNC object after the frames of the previous data exchange (p. 44). While a SYNC object
    /// waits for these frames, no second one is added. The SYNC time restarts when the waiting object has
    /// been sent (D-676).
    pub(super) fn sync(&mut self, now: u64) {
        let Some(at) = self.sync_at.filter(|at| *at <= now) else { return };
        if self.sync_waits {
            self.sync_at = None;
            return;
        }
        self.sync_waits = self.has_room();
        self.push(Frame::standard(SYNC, Payload::EMPTY));
        self.sync_at = self.sync_us().map(|time| at + time);
    }

    /// Notes that a frame was sent.
    pub(in crate::devices::can_dp2::emulation) fn sent(&mut self, sent: &Frame) {
        self.sync_waits &= *sent != Frame::standard(SYNC, Payload::EMPTY);
    }
}
