//! A CAN line: one frame at a time, the one with the dominant identifier first, each acknowledged, or destroyed by error
//! frames and repeated.
//!
//! The position of an error in a frame decides its duration. Here errors lie where one bit signals them to all
//! stations (decision D-331), so an error frame is a flag of six bits and its delimiter of eight.

use super::wire::{self, ERROR_DELIMITER, ERROR_FLAG, INTERMISSION, SUSPENSION};
use super::{BitRate, Frame};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// The stations at a line, in the order of attachment: the first has number 0.
pub trait Participants {
    /// The winner of the arbitration, and its frame, among the stations except `but` that take part and have had a
    /// frame to send at `at_ns`. Of several with one arbitration field it is the first (decision D-349).
    fn first(&self, at_ns: u64, but: Option<usize>) -> Option<(usize, Frame)>;

    /// True if any station except `sender` takes part and has done so since `begin_ns`: a station that receives the
    /// complete frame acknowledges it.
    fn is_heard(&self, sender: usize, begin_ns: u64) -> bool;

    /// True if this one is error-passive.
    fn is_passive(&self, participant: usize) -> bool;
}

/// The result of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Fate {
    /// The frame arrives.
    Arrives,
    /// No station acknowledges it.
    NotAcknowledged,
    /// The frame is disturbed, and all stations see it.
    Disturbed,
    /// The sender takes its own start bit for the start bit of another station and withdraws, and no station
    /// continues the frame.
    Withdrawn,
    /// The sender leaves before the frame is complete.
    SenderGone,
}

/// A frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OnWire {
    /// The sender.
    pub sender: usize,
    /// The frame; its content is fixed from its start on.
    pub frame: Frame,
    /// The beginning of its start bit, in ns.
    pub begin_ns: u64,
    /// The end of its end-of-frame field, when its receivers have it; or the beginning of the error flag that destroys it.
    pub end_ns: u64,
    /// The end of the intermission: the next frame may begin.
    pub free_ns: u64,
    /// The result of the frame, as far as it is known now.
    pub fate: Fate,
}

/// An event on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame has won the arbitration and begins.
    Begun(OnWire),
    /// A frame is at its end and has arrived.
    Delivered(OnWire),
    /// A frame ends in an error frame, which begins now; its sender, if it is still there, will send it again.
    Failed(OnWire),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum LinePhase {
    /// The bus is free. A passive station that has sent the last frame may not begin before a time.
    Idle { suspended: Option<(usize, u64)> },
    /// A frame.
    Busy(OnWire),
    /// The time after a frame: an error frame, the intermission; and the sender, if a station has sent the frame to
    /// its end.
    Closing { sender: Option<usize>, free_ns: u64 },
}

/// A line, its present phase and its next event.
#[derive(Clone, Debug)]
pub struct Line {
    rate: BitRate,
    state: LinePhase,
    /// Since when it is recessive, while no frame is on it.
    quiet_ns: u64,
}

snapshot_fields!(Line { values: state, quiet_ns; built: rate });

impl Line {
    /// True if all station numbers in it are below `count`.
    pub(crate) fn is_among(&self, count: usize) -> bool {
        let participant = match self.state {
            LinePhase::Idle { suspended } => suspended.map(|(participant, _)| participant),
            LinePhase::Busy(frame) => Some(frame.sender),
            LinePhase::Closing { sender, .. } => sender,
        };
        participant.is_none_or(|participant| participant < count)
    }

    /// An idle line at this rate.
    pub const fn new(rate: BitRate) -> Self {
        Line { rate, state: LinePhase::Idle { suspended: None }, quiet_ns: 0 }
    }

    /// The bit rate.
    pub const fn rate(&self) -> BitRate {
        self.rate
    }

    /// The frame on the wire.
    pub const fn on_wire(&self) -> Option<&OnWire> {
        match &self.state {
            LinePhase::Busy(frame) => Some(frame),
            LinePhase::Idle { .. } | LinePhase::Closing { .. } => None,
        }
    }

    /// Time since which the bus is recessive, in ns; after an error flag it may be in the future. `None`: a frame is
    /// on the bus.
    pub const fn quiet_ns(&self) -> Option<u64> {
        match self.state {
            LinePhase::Busy(_) => None,
            LinePhase::Idle { .. } | LinePhase::Closing { .. } => Some(self.quiet_ns),
        }
    }

    /// Time of the next event of the line itself, in ns. `None`: it is idle until a participant has a frame to send.
    pub const fn next_ns(&self) -> Option<u64> {
        match &self.state {
            LinePhase::Idle { suspended: None } => None,
            LinePhase::Idle { suspended: Some((_, until_ns)) } => Some(*until_ns),
            LinePhase::Busy(frame) => Some(frame.end_ns),
            LinePhase::Closing { free_ns, .. } => Some(*free_ns),
        }
    }

    /// True if the bus is idle and a station could begin a frame at `now_ns`: then the caller must call
    /// [`Line::advance`].
    pub fn can_begin(&self, now_ns: u64, participants: &impl Participants) -> bool {
        matches!(self.state, LinePhase::Idle { .. }) && self.next_sender(now_ns, participants).is_some()
    }

    /// The sender whose frame [`Line::advance`] would start at `now_ns`, and the frame.
    pub fn next_sender(&self, now_ns: u64, participants: &impl Participants) -> Option<(usize, Frame)> {
        let suspended = self.arbitration(now_ns, participants)?;
        participants.first(now_ns, suspended.map(|(participant, _)| participant))
    }

    /// Whether there is an arbitration at `now_ns`; and the station that must not take part, until when.
    fn arbitration(&self, now_ns: u64, participants: &impl Participants) -> Option<Option<(usize, u64)>> {
        match self.state {
            LinePhase::Idle { suspended } => Some(suspended.filter(|(_, until_ns)| *until_ns > now_ns)),
            LinePhase::Closing { sender, free_ns } if free_ns <= now_ns => {
                let until_ns = free_ns.saturating_add(self.rate.time_ns(SUSPENSION));
                let passive = sender.filter(|sender| participants.is_passive(*sender));
                Some(passive.map(|sender| (sender, until_ns)).filter(|(_, until_ns)| *until_ns > now_ns))
            }
            LinePhase::Busy(_) | LinePhase::Closing { .. } => None,
        }
    }

    /// Performs one action that is pending at `now_ns` and returns it. The caller repeats the call until the result
    /// is `None`, at the times of [`Line::next_ns`] and whenever a participant has a frame to send.
    pub fn advance(&mut self, now_ns: u64, participants: &impl Participants) -> Option<Event> {
        if let LinePhase::Busy(it) = self.state {
            return (it.end_ns <= now_ns).then(|| self.close(it));
        }
        let suspended = self.arbitration(now_ns, participants)?;
        self.arbitrate(now_ns, suspended, participants)
    }

    /// Each station with a frame begins, and the dominant frame continues.
    fn arbitrate(
        &mut self,
        now_ns: u64,
        suspended: Option<(usize, u64)>,
        participants: &impl Participants,
    ) -> Option<Event> {
        self.state = LinePhase::Idle { suspended };
        let (sender, frame) = participants.first(now_ns, suspended.map(|(participant, _)| participant))?;
        let mut it = self.begin(now_ns, sender, frame);
        if !participants.is_heard(sender, now_ns) {
            self.destroy(&mut it, wire::bits_to_acknowledgement(&frame) + 1, Fate::NotAcknowledged);
        }
        self.state = LinePhase::Busy(it);
        Some(Event::Begun(it))
    }

    fn begin(&self, now_ns: u64, sender: usize, frame: Frame) -> OnWire {
        let airtime = wire::airtime(&frame, self.rate);
        let end_ns = now_ns.saturating_add(airtime.delivery_ns);
        let free_ns = now_ns.saturating_add(airtime.occupation_ns);
        OnWire { sender, frame, begin_ns: now_ns, end_ns, free_ns, fate: Fate::Arrives }
    }

    /// In an arbitration without other stations, `sender` withdraws after its start bit: six recessive bits later all
    /// stations find an error (decision D-333).
    pub fn withdraw(&mut self, now_ns: u64, sender: usize, frame: Frame) -> Event {
        let mut it = self.begin(now_ns, sender, frame);
        self.destroy(&mut it, 1 + ERROR_FLAG, Fate::Withdrawn);
        self.state = LinePhase::Busy(it);
        Event::Begun(it)
    }

    /// Ends the frame in an error flag, `bits` bits after its beginning.
    fn destroy(&self, it: &mut OnWire, bits: u32, fate: Fate) {
        it.fate = fate;
        it.end_ns = it.begin_ns.saturating_add(self.rate.time_ns(bits));
        let bits = bits + ERROR_FLAG + ERROR_DELIMITER + INTERMISSION;
        it.free_ns = it.begin_ns.saturating_add(self.rate.time_ns(bits));
    }

    /// Changes the result of a frame that was going to arrive. `bits` returns the start of its error flag, from the
    /// count of bits that are over at `now_ns` and the count of bits before its acknowledge slot.
    fn spoil(&mut self, now_ns: u64, fate: Fate, bits: impl FnOnce(u32, u32) -> Option<u32>) {
        let LinePhase::Busy(mut it) = self.state else { return };
        let over = self.rate.bits_begun(now_ns.saturating_sub(it.begin_ns));
        if it.fate == Fate::Arrives
            && let Some(bits) = bits(over, wire::bits_to_acknowledgement(&it.frame))
        {
            self.destroy(&mut it, bits, fate);
            self.state = LinePhase::Busy(it);
        }
    }

    /// The sender of the frame on the wire has left: six recessive bits later all others find an error, at the latest
    /// after the acknowledge delimiter, as the checksum is wrong. A frame with a complete checksum arrives.
    pub fn sender_gone(&mut self, now_ns: u64) {
        self.spoil(now_ns, Fate::SenderGone, |over, to_acknowledgement| {
            (over < to_acknowledgement).then(|| (over + ERROR_FLAG).min(to_acknowledgement + 2))
        });
    }

    /// The last station that would acknowledge the frame on the wire has left.
    pub fn nobody_left(&mut self, now_ns: u64) {
        self.spoil(now_ns, Fate::NotAcknowledged, |over, to_acknowledgement| {
            (over <= to_acknowledgement).then_some(to_acknowledgement + 1)
        });
    }

    /// The frame on the wire, which has just begun, will be disturbed: its CRC delimiter is dominant (decision D-331).
    pub fn disturb(&mut self) {
        self.spoil(0, Fate::Disturbed, |_, to_acknowledgement| Some(to_acknowledgement));
    }

    fn close(&mut self, it: OnWire) -> Event {
        let sender = (it.fate != Fate::Withdrawn).then_some(it.sender);
        self.state = LinePhase::Closing { sender, free_ns: it.free_ns };
        if it.fate == Fate::Arrives {
            // Acknowledge delimiter and end of frame are recessive.
            self.quiet_ns = it.end_ns.saturating_sub(self.rate.time_ns(wire::RECESSIVE_END));
            Event::Delivered(it)
        } else {
            self.quiet_ns = it.end_ns.saturating_add(self.rate.time_ns(ERROR_FLAG));
            Event::Failed(it)
        }
    }
}

#[cfg(test)]
mod tests;
