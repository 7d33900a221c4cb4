//! The command channel and its answers: the frame at t_CC, the response at t_RC of the next interval.

use super::disturbance::Fate;
use super::schedule::{Schedule, Slot};
use super::{Run, Sender, Station};
use crate::devices::cansync;
use crate::devices::cansync::drive::Objection;
use crate::devices::cansync::frames::codec::action::{Action, ActionCommand};
use crate::devices::cansync::frames::{Frame, FrameKind};
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, DATA_PARAMETER};
use core::mem::{offset_of, size_of};

impl Run<'_> {
    pub(super) fn command_start(&mut self) {
        self.bus.asked = None;
        self.bus.drive_answer = None;
        self.bus.command = self.master(|master, ctx| master.command(ctx)).flatten();
        if let Some(frame) = self.bus.command {
            self.transmit(Slot::CommandEnd, &frame, self.now, Sender::Master);
        }
    }

    pub(super) fn command_end(&mut self) {
        let Some(frame) = self.bus.command.take() else { return };
        match (self.arrives(Slot::CommandEnd, &frame), frame.kind()) {
            (Fate::Arrives, _) => self.deliver(&frame, false),
            // The master does not notice that its job frame was lost, so it waits for the answer until the
            // timeout.
            (Fate::Lost, Some(FrameKind::Job(_))) => self.start_timeout(),
            (Fate::Lost | Fate::Late, _) => {}
        }
    }

    fn start_timeout(&mut self) {
        self.bus.schedule.set(Slot::ResponseTimeout, self.now + u64::from(self.timing.t_RSPTO));
    }

    pub(super) fn deliver_action(&mut self, frame: &Frame) {
        let Ok(command) = ActionCommand::decode(frame.payload()) else { return };
        for drive in self.drives() {
            drive.action_command(&command);
        }
        self.each_node(|slave, ctx| slave.action(ctx, frame, &command));
        if command.action() == Action::SyncMode(true) {
            for index in 0..self.bus.drives.len() {
                self.find_wrong_settings(index);
            }
        }
    }

    /// Reports a finding for each parameter of a drive with a value that does not suit the bus. The finding
    /// names the register through which the master's PLC sets the parameter.
    fn find_wrong_settings(&mut self, index: usize) {
        let interval_us = u32::from(self.timing.b_TIME_PATTERN) * 1000;
        let Some(drive) = self.drive(index) else { return };
        let (number, objections) = (drive.slave_number(), drive.take_objections(interval_us));
        for objection in objections {
            let (rule, value) = match objection {
                Objection::SyncSlot(us) => (&cansync::rules::DRIVE_SYNC_SLOT, us),
                Objection::SyncOffset(us) => (&cansync::rules::DRIVE_SYNC_OFFSET, us),
                Objection::Pwm(khz) => (&cansync::rules::DRIVE_PWM, khz),
            };
            let data = offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_DATA_PARAMETER)
                + usize::from(number) * size_of::<DATA_PARAMETER>();
            let offset = data + offset_of!(DATA_PARAMETER, d_PAR_VALUE);
            self.master(|_, ctx| ctx.find(rule, phases::CYCLIC, offset, value));
        }
    }

    pub(super) fn deliver_job(&mut self, number: u8, frame: &Frame) {
        self.bus.asked = Some(number);
        self.start_timeout();
        let frame = if self.faults.is_empty() { *frame } else { self.wrong_job(number, *frame) };
        match self.station(number) {
            Station::Vacant => {}
            Station::Drive(index) => {
                let hears = self.drive(index).is_some();
                if hears && !self.faults.is_empty() && self.answer_in_place(number, &frame) {
                    return;
                }
                self.bus.drive_answer = self.drive(index).and_then(|drive| drive.job(frame.payload()));
                self.find_wrong_settings(index);
            }
            Station::Node(index) => {
                let hears = self.node(index, |_, _| ()).is_some();
                if hears && !self.faults.is_empty() && self.answer_in_place(number, &frame) {
                    return;
                }
                self.node(index, |slave, ctx| slave.job(ctx, &frame));
            }
        }
    }

    pub(super) fn response_start(&mut self) {
        let Some(number) = self.bus.asked else { return };
        let answer = match (self.bus.disturbance.take_answer(), self.station(number)) {
            (_, Station::Vacant) => None,
            (Some(answer), _) => Some(answer),
            (None, Station::Drive(_)) => self.bus.drive_answer.take(),
            (None, Station::Node(index)) => self.node(index, |slave, ctx| slave.response(ctx)).flatten(),
        };
        let Some(frame) = answer else { return };
        let frame = if self.faults.is_empty() { frame } else { self.wrong_answer(number, frame) };
        self.bus.response = Some(frame);
        let begin = self.transmit(Slot::ResponseEnd, &frame, self.now, Sender::Slave(number));
        let timeout = self.bus.schedule.at(Slot::ResponseTimeout).unwrap_or(Schedule::NEVER);
        if begin.is_some_and(|begin| begin <= timeout) {
            self.bus.schedule.cancel(Slot::ResponseTimeout);
        }
    }

    pub(super) fn response_end(&mut self) {
        let Some(frame) = self.bus.response.take() else { return };
        let fate = self.arrives(Slot::ResponseEnd, &frame);
        let Some(number) = self.bus.asked.take() else { return };
        if fate != Fate::Late {
            self.answer_has_left(number);
        }
        if fate == Fate::Arrives {
            self.deliver(&frame, false);
        }
    }

    /// Notifies the slave with this number that its answer was sent.
    pub(super) fn answer_has_left(&mut self, number: u8) {
        if let Station::Node(index) = self.station(number) {
            self.node(index, |slave, ctx| slave.response_sent(ctx));
        }
    }

    pub(super) fn response_timeout(&mut self) {
        self.bus.asked = None;
        self.master(|master, ctx| master.response_timeout(ctx));
    }
}
