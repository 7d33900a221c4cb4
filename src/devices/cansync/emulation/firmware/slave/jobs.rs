//! The slave's side of the command and response channel. Parameter and up-/download jobs arrive with the same
//! identifier; bit 7 of the first byte distinguishes them (manual 5.00005.03a p. 138-141).

use super::parameter::ParameterServer;
use super::updown::UpDownServer;
use crate::can::Payload;
use crate::devices::Context;
use crate::devices::cansync::firmware::polling::STATUS_WORD;
use crate::devices::cansync::frames::Frame;
use crate::devices::cansync::frames::codec::{
    Access, CodecError, ParameterJob, ParameterResult, UpDownJob, UpDownResult, UpDownStep, is_up_download,
};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{par_error, updown_error};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// The part of the node that answers the last job.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum AnswerSource {
    /// The firmware answers with this frame.
    Firmware(Frame),
    Parameter,
    UpDownload,
}

/// All jobs of a slave node.
#[derive(Clone, Debug)]
pub(super) struct Jobs {
    /// Slave number in the answers.
    number: u8,
    parameter: ParameterServer,
    updown: UpDownServer,
    /// The source of the answer to the last job. The answer must still be sent.
    due: Option<AnswerSource>,
    /// The source of the answer on the wire.
    sending: Option<AnswerSource>,
}

snapshot_fields!(Jobs { values: number, parameter, due, sending; parts: updown });

impl Jobs {
    pub(super) fn new(number: u8, has_single_frame_area: bool) -> Self {
        Jobs {
            number,
            parameter: ParameterServer::default(),
            updown: UpDownServer::new(has_single_frame_area),
            due: None,
            sending: None,
        }
    }

    /// Handles a job in active operation. A job without a valid format gets no answer. A read job on the
    /// status word never reaches the application, because the application cannot know whether the node is
    /// synchronized (decision D-06). Such a job does not affect a job of the application in progress.
    pub(super) fn arrive(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        payload: &Payload,
        status_word: u16,
    ) {
        self.due = if is_up_download(payload) {
            match UpDownJob::decode(payload) {
                Ok(job) => {
                    self.updown.job(ctx, regs, &job);
                    Some(AnswerSource::UpDownload)
                }
                Err(error) => self.reserved_mode(payload, error),
            }
        } else {
            ParameterJob::decode(payload).ok().map(|job| match ParameterServer::refusal(&job) {
                Some(error) => self.parameter_answer(&job, ParameterResult::Error(error)),
                None if asks_for_status_word(&job) => {
                    self.parameter_answer(&job, ParameterResult::Word(status_word))
                }
                None => {
                    self.parameter.job(ctx, regs, &job);
                    AnswerSource::Parameter
                }
            })
        };
    }

    /// Handles a job in set-up mode. The firmware answers a job on the status word and refuses every other job
    /// (decisions D-06, D-36, D-63).
    pub(super) fn arrive_early(&mut self, payload: &Payload, status_word: u16) {
        self.due = if is_up_download(payload) {
            match UpDownJob::decode(payload) {
                Ok(job) => Some(self.updown_answer(
                    &job,
                    match job.step() {
                        _ if job.is_cancel() => UpDownResult::Done,
                        UpDownStep::Init { .. } => UpDownResult::Error(updown_error::NOT_POSSIBLE),
                        _ => UpDownResult::Error(updown_error::SLAVE_CANCELS),
                    },
                )),
                Err(error) => self.reserved_mode(payload, error),
            }
        } else {
            ParameterJob::decode(payload).ok().map(|job| {
                let result = if asks_for_status_word(&job) {
                    ParameterResult::Word(status_word)
                } else {
                    ParameterResult::Error(par_error::NOT_AVAILABLE_NOW)
                };
                self.parameter_answer(&job, result)
            })
        };
    }

    fn parameter_answer(&self, job: &ParameterJob, result: ParameterResult) -> AnswerSource {
        AnswerSource::Firmware(job.answer(result).frame(self.number))
    }

    fn updown_answer(&self, job: &UpDownJob, result: UpDownResult) -> AnswerSource {
        AnswerSource::Firmware(job.answer(result).frame(self.number))
    }

    /// Returns the answer to a job with MODE 00. This value is not a mode, so it is not permitted in any
    /// phase. The answer carries the job's offset (decision D-68).
    fn reserved_mode(&self, payload: &Payload, error: CodecError) -> Option<AnswerSource> {
        let [high, low, ..] = payload.padded();
        let offset = u16::from_le_bytes([low, high & 0x0F]);
        let job = UpDownJob::new(offset, UpDownStep::Upload { last: false }).ok()?;
        (error == CodecError::ReservedMode)
            .then(|| self.updown_answer(&job, UpDownResult::Error(updown_error::MODE)))
    }

    /// Runs one processor cycle.
    pub(super) fn poll(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        self.parameter.poll(ctx, regs);
        self.updown.poll(ctx, regs);
    }

    /// Returns true if processor cycles must poll the registers of a job.
    #[inline]
    pub(super) fn are_watched(&self) -> bool {
        self.parameter.waits_for_reset() || self.updown.is_under_way()
    }

    /// Returns the answer to the last job, at the start of the response slot.
    pub(super) fn response(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) -> Option<Frame> {
        self.sending = self.due.take();
        match self.sending? {
            AnswerSource::Firmware(frame) => Some(frame),
            AnswerSource::Parameter => {
                self.parameter.response(ctx, regs).map(|answer| answer.frame(self.number))
            }
            AnswerSource::UpDownload => {
                self.updown.response(ctx, regs).map(|answer| answer.frame(self.number))
            }
        }
    }

    /// Ends the answer, because it was sent completely.
    pub(super) fn response_sent(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        match self.sending.take() {
            Some(AnswerSource::Parameter) => self.parameter.response_sent(ctx, regs),
            Some(AnswerSource::UpDownload) => self.updown.response_sent(ctx, regs),
            Some(AnswerSource::Firmware(_)) | None => {}
        }
    }

    /// Drops all jobs, because the node leaves active operation.
    pub(super) fn drop_all(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        self.due = None;
        self.sending = None;
        self.parameter.drop_job(ctx, regs);
        self.updown.drop_transfer(ctx, regs);
    }
}

fn asks_for_status_word(job: &ParameterJob) -> bool {
    matches!(job.access(), Access::Read) && job.number() == STATUS_WORD && job.sub_slave() == 0
}

#[cfg(test)]
#[path = "jobs_tests.rs"]
mod tests;
