//! What injected faults do to the traffic of a bus. Nothing of this runs while there is no fault, but for a look
//! at the marks in [`Disturbance`].

use super::{OnWire, Run, Sender, SimBus, Station};
use crate::bus::codec::updown::{BLOCK, MAX_OFFSET};
use crate::bus::codec::{
    ParameterJob, ParameterResult, UpDownJob, UpDownResponse, UpDownResult, UpDownStep, is_up_download,
};
use crate::bus::{Frame, FrameKind};
use crate::fault::{Effect, FrameEffect, NodeEffect, OffsetAt, SlaveEffect, SyncEffect};
use crate::journal::Origin;
use crate::plant::agenda::Slot;

/// What faults have done to a bus.
#[derive(Default)]
pub(super) struct Disturbance {
    /// Slaves that are off, bit n for slave n.
    off: u32,
    /// Frames under way that nobody receives at all, by place on the wire.
    lost: u8,
    /// Frames under way that end later than regularly, by place on the wire.
    late: u8,
    /// Frames that arrive outside of their slots.
    strays: Vec<Stray>,
    /// How far the present SYNC edge lies behind its regular time, in us.
    shift: i64,
    /// The job under way, while there are faults.
    job: Option<Frame>,
    /// The answer that a fault gives to it in place of the slave.
    answer: Option<Frame>,
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// Its receivers have it.
    Arrives,
    /// Nobody ever has it; its sender does not notice.
    Lost,
    /// It is still on its way.
    Late,
}

/// A frame that arrives outside of its slot.
struct Stray {
    end: u64,
    frame: Frame,
    /// Whether it comes a second time.
    copy: bool,
}

impl Disturbance {
    #[inline]
    pub(super) fn is_off(&self, slave: u8) -> bool {
        self.off.checked_shr(slave.into()).unwrap_or(0) & 1 != 0
    }

    /// What becomes of the frame at this place on the wire, whose regular end is now.
    #[inline]
    pub(super) fn take_fate(&mut self, place: usize) -> Fate {
        let bit = 1 << place;
        let fate = match (self.lost & bit != 0, self.late & bit != 0) {
            (true, _) => Fate::Lost,
            (false, true) => Fate::Late,
            (false, false) => Fate::Arrives,
        };
        self.lost &= !bit;
        self.late &= !bit;
        fate
    }

    /// The bus stands still.
    pub(super) fn forget_frames(&mut self) {
        self.lost = 0;
        self.late = 0;
        self.strays.clear();
        self.shift = 0;
        self.job = None;
        self.answer = None;
    }

    #[inline]
    pub(super) fn take_answer(&mut self) -> Option<Frame> {
        self.answer.take()
    }

    /// The next edge comes at its regular time.
    #[inline]
    pub(super) fn end_jitter(&mut self) {
        self.shift = 0;
    }

    /// How far the present edge lies behind its regular time, in us.
    #[inline]
    pub(super) fn shift(&self) -> i64 {
        self.shift
    }
}

impl SimBus {
    /// Slaves that are off from now on, bit n for slave n. Drives that go off are as at power-on when they come
    /// back; a PLC's node has its plug pulled (decision D-123).
    pub(in crate::plant) fn set_off(&mut self, off: u32) {
        let changed = self.disturbance.off ^ off;
        self.disturbance.off = off;
        for number in (0..32u8).filter(|number| changed >> number & 1 != 0) {
            if let Some(Station::Drive(index)) = self.stations.get(usize::from(number))
                && let (Some(drive), Some(fresh)) = (self.drives.get_mut(*index), self.fresh.get(*index))
            {
                drive.clone_from(fresh);
            }
            self.destroy_frames_of(Sender::Slave(number));
        }
    }

    /// Brings a fault upon the drive with this slave number. Tells whether there is one, with power and without a
    /// fault.
    pub(in crate::plant) fn trip_drive(&mut self, slave: u8, fault: u16) -> bool {
        let Some(Station::Drive(index)) = self.stations.get(usize::from(slave)) else { return false };
        let drive = self.drives.get_mut(*index).filter(|_| !self.disturbance.is_off(slave));
        drive.is_some_and(|drive| drive.trip(fault))
    }

    /// The slaves of this bus, bit n for slave n.
    pub(in crate::plant) fn slaves(&self) -> u32 {
        let present = self.stations.iter().enumerate().filter(|(_, station)| **station != Station::Nobody);
        present.fold(0, |mask, (number, _)| mask | 1 << number)
    }

    /// The frames that this sender has on the wire or about to be are lost: it has stopped in the middle.
    fn destroy_frames_of(&mut self, sender: Sender) {
        for (place, wire) in self.on_wire.iter_mut().enumerate() {
            if matches!(wire, Some(OnWire { sender: from, .. }) if *from == sender) {
                self.disturbance.lost |= 1 << place;
                *wire = None;
            }
        }
        self.disturbance.strays.retain(|stray| !stray.is_of(sender));
    }

    /// The master's CAN controller, or that of the slave with this number, goes BUS-off.
    pub(in crate::plant) fn node_went_off(&mut self, slave: Option<u8>) {
        self.destroy_frames_of(slave.map_or(Sender::Master, Sender::Slave));
    }
}

impl Stray {
    fn is_of(&self, sender: Sender) -> bool {
        match (self.frame.kind(), sender) {
            (Some(FrameKind::ActualValue(_, number) | FrameKind::Response(number)), Sender::Slave(slave)) => {
                number == slave
            }
            (Some(FrameKind::ReferenceValue(..) | FrameKind::Action | FrameKind::Job(_)), Sender::Master) => {
                true
            }
            _ => false,
        }
    }
}

impl Run<'_> {
    /// What faults do to a frame that is to begin at `from`. Returns when it begins; `None` if it is lost.
    #[cold]
    pub(super) fn disturb(&mut self, place: usize, frame: &Frame, from: u64, duration: u64) -> Option<u64> {
        let (mut lost, mut delay, mut copies) = (false, 0, Vec::new());
        let index = self.bus.index;
        self.faults.strike(self.now, self.journal, |effect, _| {
            match *effect {
                _ if lost => return None,
                Effect::Frame { bus, frames, what } if bus == index && frames.include(frame) => match what {
                    FrameEffect::Lose => lost = true,
                    FrameEffect::Delay(us) => delay += u64::from(us),
                    FrameEffect::Duplicate(us) => copies.push(u64::from(us)),
                },
                Effect::Slave { bus, slave, what: SlaveEffect::Late(us) }
                    if bus == index && frame.kind() == Some(FrameKind::Response(slave)) =>
                {
                    delay += u64::from(us);
                }
                _ => return None,
            }
            Some(frame.id().into())
        });
        if lost {
            self.bus.disturbance.lost |= 1 << place;
            return None;
        }
        let end = from + delay + duration;
        if delay > 0 {
            self.bus.disturbance.late |= 1 << place;
            self.add_stray(Stray { end, frame: *frame, copy: false });
        }
        for gap in copies {
            self.add_stray(Stray { end: end + gap + duration, frame: *frame, copy: true });
        }
        Some(from + delay)
    }

    fn add_stray(&mut self, stray: Stray) {
        self.bus.disturbance.strays.push(stray);
        self.schedule_strays();
    }

    fn schedule_strays(&mut self) {
        match self.bus.disturbance.strays.iter().map(|stray| stray.end).min() {
            Some(end) => self.bus.agenda.set(Slot::Stray, end),
            None => self.bus.agenda.cancel(Slot::Stray),
        }
    }

    /// Frames outside of their slots arrive, in the order in which they were sent.
    pub(super) fn stray_frames(&mut self) {
        let now = self.now;
        for Stray { frame, copy, .. } in
            self.bus.disturbance.strays.extract_if(.., |s| s.end <= now).collect::<Vec<_>>()
        {
            self.note_frame(frame);
            if let (Some(FrameKind::Response(number)), false) = (frame.kind(), copy) {
                self.answer_has_left(number);
            }
            self.deliver(&frame, copy);
        }
        self.schedule_strays();
    }

    /// Hands a frame over to everybody who receives it. Nodes with an overrun do not; the sender is not asked.
    pub(super) fn deliver(&mut self, frame: &Frame, copy: bool) {
        if self.faults.is_empty() {
            return self.deliver_to_all(frame, copy);
        }
        let deaf = self.overruns(frame);
        self.deliver_to_all(frame, copy);
        for origin in deaf {
            let Some(plc) = self.plcs.get_mut(usize::from(origin.plc)) else { continue };
            if origin.node == 1 { plc.slave.frame_is_past() } else { plc.master.frame_is_past() }
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

    /// Nodes of this bus that lose `frame` to an overrun.
    fn overruns(&mut self, frame: &Frame) -> Vec<Origin> {
        let mut deaf = Vec::new();
        let (bus, plcs) = (usize::from(self.bus.index), &mut *self.plcs);
        let stations = &self.bus.stations;
        let sender = match frame.kind() {
            Some(FrameKind::ActualValue(_, number) | FrameKind::Response(number)) => {
                stations.get(usize::from(number)).copied().unwrap_or(Station::Nobody)
            }
            _ => Station::Nobody,
        };
        let from_master = !matches!(frame.kind(), Some(FrameKind::ActualValue(..) | FrameKind::Response(_)));
        self.faults.strike(self.now, self.journal, |effect, _| {
            let Effect::Node { plc, node, what: NodeEffect::Overrun } = *effect else { return None };
            let index = usize::from(plc);
            let station = plcs.get_mut(index).filter(|plc| plc.bus_of(node) == Some(bus))?;
            let lost = match node {
                1 => sender != Station::Node(index) && station.slave.overrun(),
                _ => !from_master && station.master.overrun(),
            };
            lost.then(|| {
                deaf.push(Origin { plc, node });
                frame.id().into()
            })
        });
        deaf
    }

    /// Whether the SYNC edge that is due now is lost on the line.
    #[cold]
    pub(super) fn edge_is_lost(&mut self) -> bool {
        let (mut lost, index) = (false, self.bus.index);
        self.faults.strike(self.now, self.journal, |effect, _| match *effect {
            Effect::Sync { bus, what: SyncEffect::Lose } if bus == index && !lost => {
                lost = true;
                Some(0)
            }
            _ => None,
        });
        lost
    }

    /// How far faults move the next edge of this bus's own SYNC signal, in us: late and early in turn, beginning
    /// with late (decision D-125).
    #[cold]
    pub(super) fn move_next_edge(&mut self) {
        let (mut shift, index) = (0, self.bus.index);
        let most = i64::from(self.timing.b_TIME_PATTERN) * 1000 / 4;
        self.faults.strike(self.now, self.journal, |effect, hits| match *effect {
            Effect::Sync { bus, what: SyncEffect::Jitter(us) } if bus == index => {
                let us = i64::from(us).min(most);
                let own = if hits.is_multiple_of(2) { us } else { -us };
                shift = (shift + own).clamp(-most, most);
                i32::try_from(own).ok()
            }
            _ => None,
        });
        self.bus.disturbance.shift = shift;
    }

    /// The job as it arrives: with a wrong offset, if a fault says so.
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

    /// The answer as it arrives: with a wrong offset, if a fault says so.
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
        let (mut wrong, index) = (None, self.bus.index);
        self.faults.strike(self.now, self.journal, |effect, _| match *effect {
            Effect::Slave { bus, slave, what: SlaveEffect::WrongOffset { at, offset } }
                if (bus, slave, at) == (index, number, wanted) && wrong.is_none() =>
            {
                wrong = Some(offset.unwrap_or((right + BLOCK as u16) & MAX_OFFSET));
                Some(id.into())
            }
            _ => None,
        });
        wrong
    }

    /// Whether a fault answers this job in place of slave `number`, which then does not see it.
    #[cold]
    pub(super) fn answer_in_place(&mut self, number: u8, frame: &Frame) -> bool {
        self.bus.disturbance.job = Some(*frame);
        let (mut answer, index) = (None, self.bus.index);
        self.faults.strike(self.now, self.journal, |effect, _| match *effect {
            Effect::Slave { bus, slave, what } if (bus, slave) == (index, number) && answer.is_none() => {
                answer = match what {
                    SlaveEffect::Busy => busy_or_error(frame, number, None),
                    SlaveEffect::Error(error) => busy_or_error(frame, number, Some(error)),
                    SlaveEffect::Off
                    | SlaveEffect::Late(_)
                    | SlaveEffect::WrongOffset { .. }
                    | SlaveEffect::Trip(_) => None,
                };
                answer.map(|answer| answer.id().into())
            }
            _ => None,
        });
        self.bus.disturbance.answer = answer;
        answer.is_some()
    }
}

/// The answer BUSY, or an error number, to a job; `None` if it is no job that could be answered.
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
