//! The command channel and its answers: the frame at t_CC, the response at t_RC of the next interval.

use super::{Run, Sender, Station};
use crate::bus::codec::action::ActionCommand;
use crate::bus::{Frame, FrameKind};
use crate::plant::agenda::Slot;

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
        self.note_frame(frame);
        match frame.kind() {
            Some(FrameKind::Action) => self.deliver_action(&frame),
            Some(FrameKind::Job(number)) => {
                self.bus.asked = Some(number);
                let due = self.now + u64::from(self.timing.t_RSPTO);
                self.bus.agenda.set(Slot::ResponseTimeout, due);
                self.deliver_job(number, &frame);
            }
            _ => {}
        }
    }

    fn deliver_action(&mut self, frame: &Frame) {
        let Ok(command) = ActionCommand::decode(frame.payload()) else { return };
        for drive in self.drives() {
            drive.action_command(&command);
        }
        self.each_node(|slave, ctx| slave.action(ctx, frame, &command));
    }

    fn deliver_job(&mut self, number: u8, frame: &Frame) {
        match self.station(number) {
            Station::Nobody => {}
            Station::Drive(index) => {
                self.bus.drive_answer =
                    self.drives().get_mut(index).and_then(|drive| drive.job(frame.payload()));
            }
            Station::Node(index) => {
                self.node(index, |slave, ctx| slave.job(ctx, frame));
            }
        }
    }

    pub(super) fn response_start(&mut self) {
        let Some(number) = self.bus.asked else { return };
        let answer = match self.station(number) {
            Station::Nobody => None,
            Station::Drive(_) => self.bus.drive_answer.take(),
            Station::Node(index) => self.node(index, |slave, ctx| slave.response(ctx)).flatten(),
        };
        if let Some(frame) = answer {
            self.bus.response = Some(frame);
            self.bus.agenda.cancel(Slot::ResponseTimeout);
            self.transmit(Slot::ResponseEnd, &frame, self.now, Sender::Slave(number));
        }
    }

    pub(super) fn response_end(&mut self) {
        let Some(frame) = self.bus.response.take() else { return };
        self.note_frame(frame);
        let Some(number) = self.bus.asked.take() else { return };
        if let Station::Node(index) = self.station(number) {
            self.node(index, |slave, ctx| slave.response_sent(ctx));
        }
        self.master(|master, ctx| master.response(ctx, number, &frame));
    }

    pub(super) fn response_timeout(&mut self) {
        self.bus.asked = None;
        self.master(|master, ctx| master.response_timeout(ctx));
    }
}
