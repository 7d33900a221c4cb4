//! Effects of injected faults on the traffic of a bus. Without faults, the bus only tests the flags in
//! `Disturbance`.

use super::disturbance::Stray;
use super::end::PortRef;
use super::{Run, Station};
use crate::devices::cansync::faults::{Effect, OffsetAt, includes};
use crate::devices::cansync::frames::codec::updown::{BLOCK, MAX_OFFSET};
use crate::devices::cansync::frames::codec::{
    ParameterJob, ParameterResult, UpDownJob, UpDownResponse, UpDownResult, UpDownStep, is_up_download,
};
use crate::devices::cansync::frames::wire::Airtime;
use crate::devices::cansync::frames::{Frame, FrameKind};
use crate::devices::cansync::records::ForeignFrame;
use crate::devices::emulation::can_faults::{self, FrameEffect};
use crate::door::BusMessage;
use crate::fault::{Hit, Target};
use crate::journal::Origin;

impl Run<'_> {
    /// Applies faults to a frame with the planned start `from`. Returns the start time of the frame, or
    /// `None` if a fault loses the frame.
    #[cold]
    pub(super) fn disturb(
        &mut self,
        place: usize,
        frame: &Frame,
        from: u64,
        airtime: Airtime,
    ) -> Option<u64> {
        let [delivery, occupation] = [airtime.delivery_us, airtime.occupation_us].map(u64::from);
        let (mut lost, mut delay, mut copies) = (false, 0, Vec::new());
        let owner = self.bus.owner();
        self.faults.fire(self.now, owner, self.journal, |_, effect: &can_faults::Effect, _| {
            match *effect {
                can_faults::Effect::Frame(frames, what) if !lost && includes(&frames, frame) => match what {
                    FrameEffect::Lose => lost = true,
                    FrameEffect::Delay(us) => delay += u64::from(us),
                    FrameEffect::Duplicate(us) => copies.push(u64::from(us)),
                    FrameEffect::Disturb | FrameEffect::LoseArbitration => return None,
                },
                _ => return None,
            }
            Some(Hit::Frame(frame.id().into()))
        });
        self.faults.fire(self.now, owner, self.journal, |target, effect: &Effect, _| {
            match (*effect, target) {
                (Effect::SlaveLate(us), Target::Participant { number, .. })
                    if !lost && frame.kind() == Some(FrameKind::Response(number)) =>
                {
                    delay += u64::from(us);
                }
                _ => return None,
            }
            Some(Hit::Frame(frame.id().into()))
        });
        if lost {
            self.bus.disturbance.lost |= 1 << place;
            return None;
        }
        let begin = from + delay;
        if delay > 0 {
            self.bus.disturbance.late |= 1 << place;
            self.add_stray(Stray { end: begin + delivery, frame: *frame, copy: false, guest: None });
        }
        for gap in copies {
            let end = begin + occupation + gap + delivery;
            self.add_stray(Stray { end, frame: *frame, copy: true, guest: None });
        }
        Some(begin)
    }

    fn add_stray(&mut self, stray: Stray) {
        self.bus.disturbance.strays.push(stray);
        self.bus.schedule_strays();
    }

    /// Delivers frames that arrive outside of their slots, in the order in which they were sent.
    pub(super) fn stray_frames(&mut self) {
        let now = self.now;
        for Stray { frame, copy, guest, .. } in
            self.bus.disturbance.strays.extract_if(.., |s| s.end <= now).collect::<Vec<_>>()
        {
            match guest {
                None => self.note_frame(frame),
                Some(guest) => {
                    let bus = self.bus.index;
                    self.bus.receivers_of_traffic.send(now, Some(guest), || BusMessage::Frame(frame.into()));
                    self.journal.push(now, ForeignFrame { bus, guest, frame });
                }
            }
            if let (Some(FrameKind::Response(number)), false) = (frame.kind(), copy) {
                self.answer_has_left(number);
            }
            self.deliver(&frame, copy);
        }
        self.bus.schedule_strays();
    }

    /// Delivers a frame to all its receivers. A node with an overrun of its controller does not receive it.
    /// The sender is not affected.
    pub(super) fn deliver(&mut self, frame: &Frame, copy: bool) {
        if self.faults.is_empty() {
            return self.deliver_to_all(frame, copy);
        }
        let overrun_nodes = self.overruns(frame);
        self.deliver_to_all(frame, copy);
        for place in overrun_nodes {
            match place {
                PortRef::Master(index) => self.bus.masters[index].firmware.frame_is_past(),
                PortRef::Slave(index) => self.bus.slaves[index].firmware.frame_is_past(),
                PortRef::Drive(_) => {}
            }
        }
    }

    fn deliver_to_all(&mut self, frame: &Frame, copy: bool) {
        match frame.kind() {
            Some(FrameKind::ReferenceValue(channel, number)) => {
                self.deliver_reference(channel, frame);
                if !copy {
                    self.request_actual(channel, number);
                }
            }
            Some(FrameKind::ActualValue(channel, number)) => self.deliver_actual(channel, number, frame),
            Some(FrameKind::Action) => self.deliver_action(frame),
            Some(FrameKind::Job(number)) => self.deliver_job(number, frame),
            Some(FrameKind::Response(number)) => {
                self.master(|master, ctx| master.response(ctx, number, frame));
            }
            None => {}
        }
    }

    /// Returns the nodes of this bus that lose `frame` because of an overrun.
    fn overruns(&mut self, frame: &Frame) -> Vec<PortRef> {
        let mut overrun_nodes = Vec::new();
        let bus = &mut *self.bus;
        let sender = match frame.kind() {
            Some(FrameKind::ActualValue(_, number) | FrameKind::Response(number)) => {
                bus.stations.get(usize::from(number)).copied().unwrap_or(Station::Vacant)
            }
            _ => Station::Vacant,
        };
        let from_master = !matches!(frame.kind(), Some(FrameKind::ActualValue(..) | FrameKind::Response(_)));
        self.faults.fire(self.now, bus.owner(), self.journal, |target, effect, _| {
            let (Target::Port { device, port }, can_faults::Effect::Overrun) = (target, effect) else {
                return None;
            };
            let place = bus.place_of(Origin { plc: device, node: port })?;
            let lost = match place {
                PortRef::Slave(index) => {
                    sender != Station::Node(index) && bus.slaves[index].firmware.overrun()
                }
                PortRef::Master(index) => !from_master && bus.masters[index].firmware.overrun(),
                PortRef::Drive(_) => false,
            };
            lost.then(|| {
                overrun_nodes.push(place);
                Hit::Frame(frame.id().into())
            })
        });
        overrun_nodes
    }

    /// Returns true if a fault loses the present SYNC edge on the line.
    #[cold]
    pub(super) fn edge_is_lost(&mut self) -> bool {
        let mut lost = false;
        self.faults.fire(self.now, self.bus.owner(), self.journal, |_, effect, _| match effect {
            Effect::LoseSync if !lost => {
                lost = true;
                Some(Hit::Plain)
            }
            _ => None,
        });
        lost
    }

    /// Calculates by how many microseconds faults shift the next edge of this bus's own SYNC signal. The
    /// edges are late and early alternately; the first is late (decision D-125).
    #[cold]
    pub(super) fn move_next_edge(&mut self) {
        let mut shift = 0;
        let most = i64::from(self.timing.b_TIME_PATTERN) * 1000 / 4;
        self.faults.fire(self.now, self.bus.owner(), self.journal, |_, effect, hits| match *effect {
            Effect::JitterSync(us) => {
                let us = i64::from(us).min(most);
                let own = if hits.is_multiple_of(2) { us } else { -us };
                shift = (shift + own).clamp(-most, most);
                Some(Hit::Edge(own as i32))
            }
            _ => None,
        });
        self.bus.disturbance.shift = shift;
    }

    /// Returns the job that arrives at the slave. A fault may have changed the offset in the job.
    #[cold]
    pub(super) fn wrong_job(&mut self, number: u8, frame: Frame) -> Frame {
        let Ok(job) = UpDownJob::decode(frame.payload()) else { return frame };
        if matches!(job.step(), UpDownStep::Init { .. }) {
            return frame;
        }
        match self.wrong_offset(number, OffsetAt::Job, job.offset(), frame.id()) {
            Some(offset) => UpDownJob::new(offset, job.step()).map_or(frame, |job| job.frame(number)),
            None => frame,
        }
    }

    /// Returns the answer that arrives at the master. A fault may have changed the offset in the answer.
    #[cold]
    pub(super) fn wrong_answer(&mut self, number: u8, frame: Frame) -> Frame {
        let job = self.bus.disturbance.job.and_then(|job| UpDownJob::decode(job.payload()).ok());
        let Some(job) = job.filter(|job| !matches!(job.step(), UpDownStep::Init { .. })) else {
            return frame;
        };
        let Ok(answer) = UpDownResponse::decode(&job, frame.payload()) else { return frame };
        if !matches!(answer.result(), UpDownResult::Done | UpDownResult::Data(_)) {
            return frame;
        }
        match self.wrong_offset(number, OffsetAt::Answer, job.offset(), frame.id()) {
            Some(offset) => UpDownJob::new(offset, job.step())
                .map_or(frame, |job| job.answer(answer.result()).frame(number)),
            None => frame,
        }
    }

    fn wrong_offset(&mut self, number: u8, wanted: OffsetAt, right: u16, id: u16) -> Option<u16> {
        let mut wrong = None;
        self.faults.fire(self.now, self.bus.owner(), self.journal, |target, effect, _| match *effect {
            Effect::WrongOffset { at, offset }
                if is_slave(target, number) && at == wanted && wrong.is_none() =>
            {
                wrong = Some(offset.unwrap_or((right + BLOCK as u16) & MAX_OFFSET));
                Some(Hit::Frame(id.into()))
            }
            _ => None,
        });
        wrong
    }

    /// Returns true if a fault answers this job in place of slave `number`. The slave then does not receive the job.
    #[cold]
    pub(super) fn answer_in_place(&mut self, number: u8, frame: &Frame) -> bool {
        self.bus.disturbance.job = Some(*frame);
        let mut answer = None;
        self.faults.fire(self.now, self.bus.owner(), self.journal, |target, effect, _| {
            if answer.is_some() || !is_slave(target, number) {
                return None;
            }
            answer = match *effect {
                Effect::SlaveBusy => busy_or_error(frame, number, None),
                Effect::SlaveError(error) => busy_or_error(frame, number, Some(error)),
                _ => None,
            };
            answer.map(|answer| Hit::Frame(answer.id().into()))
        });
        self.bus.disturbance.answer = answer;
        answer.is_some()
    }
}

/// Returns true if `target` is slave `number`.
fn is_slave(target: Target, number: u8) -> bool {
    matches!(target, Target::Participant { number: slave, .. } if slave == number)
}

/// Returns the answer to a job: BUSY, or the error number if one is given. `None` if the frame is not a job
/// with an answer.
fn busy_or_error(job: &Frame, slave: u8, error: Option<u16>) -> Option<Frame> {
    let payload = job.payload();
    if is_up_download(payload) {
        let job = UpDownJob::decode(payload).ok()?;
        Some(job.answer(error.map_or(UpDownResult::Busy, UpDownResult::Error)).frame(slave))
    } else {
        let job = ParameterJob::decode(payload).ok()?;
        Some(job.answer(error.map_or(ParameterResult::Busy, ParameterResult::Error)).frame(slave))
    }
}
