//! A CAN line. It has one frame at a time. If several stations want to send, the frame with the dominant identifier is
//! sent first. A frame is acknowledged, or an error frame destroys it and it is repeated.
//!
//! The duration of a disturbed frame depends on the position of the error. Here, an error is always at a bit that
//! signals it to all stations (decision D-331). So an error frame consists of a flag of six bits and a delimiter of
//! eight bits.

use super::wire::{self, ERROR_DELIMITER, ERROR_FLAG, INTERMISSION, SUSPENSION};
use super::{BitRate, Frame};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// The stations at a line, numbered from 0 in the order of attachment.
pub trait Participants {
    /// Returns the winner of the arbitration and its frame. All stations that are on the bus and had a frame to send at
    /// `at_ns`, except `but`, take part in the arbitration. If the frames of several stations have equal arbitration
    /// fields, the station with the lowest index wins (decision D-349).
    fn first(&self, at_ns: u64, but: Option<usize>) -> Option<(usize, Frame)>;

    /// True if any station except `sender` has taken part since `begin_ns` without interruption. Such a station
    /// receives the complete frame and acknowledges it.
    fn is_heard(&self, sender: usize, begin_ns: u64) -> bool;

    /// True if this station is error-passive.
    fn is_passive(&self, participant: usize) -> bool;
}

/// The result of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Fate {
    /// The frame arrives at all other stations without an error.
    Arrives,
    /// No station acknowledges the frame.
    NotAcknowledged,
    /// The frame is disturbed, and all stations see it.
    Disturbed,
    /// The sender mistakes its own start bit for the start bit of another station and withdraws, so no station
    /// continues the frame.
    Withdrawn,
    /// The sender leaves before the frame is complete.
    SenderGone,
}

/// A frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OnWire {
    /// Number of the station that sends the frame.
    pub sender: usize,
    /// Frame on the wire. Its content does not change after its start.
    pub frame: Frame,
    /// The beginning of the frame's start bit, in ns.
    pub begin_ns: u64,
    /// End of the end-of-frame field, at which the receivers have the frame. If the frame is destroyed, the beginning
    /// of the error flag.
    pub end_ns: u64,
    /// The end of the intermission. The next frame may then begin.
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
    /// A frame ends in an error frame, which begins now. If the sender is still on the bus, it will send the frame
    /// again.
    Failed(OnWire),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum LinePhase {
    /// The bus is free. If an error-passive station has sent the last frame, it must not begin a frame before a given
    /// time.
    Idle { suspended: Option<(usize, u64)> },
    /// A frame is on the line.
    Busy(OnWire),
    /// The time after a frame: an error frame or the intermission. `sender` is the station that has sent the
    /// frame to its end; `None` if no station has.
    Closing { sender: Option<usize>, free_ns: u64 },
}

/// A line, its present phase and its next event.
#[derive(Clone, Debug)]
pub struct Line {
    rate: BitRate,
    state: LinePhase,
    /// Time since which the line has been recessive. Valid only while no frame is on the line.
    quiet_ns: u64,
}

snapshot_fields!(Line { values: state, quiet_ns; built: rate });

impl Line {
    /// True if all station numbers in this value are below `count`.
    pub(crate) fn is_among(&self, count: usize) -> bool {
        let participant = match self.state {
            LinePhase::Idle { suspended } => suspended.map(|(participant, _)| participant),
            LinePhase::Busy(frame) => Some(frame.sender),
            LinePhase::Closing { sender, .. } => sender,
        };
        participant.is_none_or(|participant| participant < count)
    }

    /// Returns an idle line at this rate.
    pub const fn new(rate: BitRate) -> Self {
        Line { rate, state: LinePhase::Idle { suspended: None }, quiet_ns: 0 }
    }

    /// Returns the bit rate.
    pub const fn rate(&self) -> BitRate {
        self.rate
    }

    /// Returns the frame on the wire.
    pub const fn on_wire(&self) -> Option<&OnWire> {
        match &self.state {
            LinePhase::Busy(frame) => Some(frame),
            LinePhase::Idle { .. } | LinePhase::Closing { .. } => None,
        }
    }

    /// Returns the time since which the bus is recessive, in ns. If an error flag has just begun, the time is
    /// in the future: the end of the flag. `None` while a frame is on the bus.
    pub const fn quiet_ns(&self) -> Option<u64> {
        match self.state {
            LinePhase::Busy(_) => None,
            LinePhase::Idle { .. } | LinePhase::Closing { .. } => Some(self.quiet_ns),
        }
    }

    /// Returns the time of the next event of the line itself, in ns. `None` while the line is idle, until a participant
    /// has a frame to send.
    pub const fn next_ns(&self) -> Option<u64> {
        match &self.state {
            LinePhase::Idle { suspended: None } => None,
            LinePhase::Idle { suspended: Some((_, until_ns)) } => Some(*until_ns),
            LinePhase::Busy(frame) => Some(frame.end_ns),
            LinePhase::Closing { free_ns, .. } => Some(*free_ns),
        }
    }

    /// True if the bus is idle and a station can begin a frame at `now_ns`. The caller must then call
    /// [`Line::advance`].
    pub fn can_begin(&self, now_ns: u64, participants: &impl Participants) -> bool {
        matches!(self.state, LinePhase::Idle { .. }) && self.next_sender(now_ns, participants).is_some()
    }

    /// Returns the sender whose frame [`Line::advance`] would start at `now_ns`, and the frame.
    pub fn next_sender(&self, now_ns: u64, participants: &impl Participants) -> Option<(usize, Frame)> {
        let suspended = self.arbitration(now_ns, participants)?;
        participants.first(now_ns, suspended.map(|(participant, _)| participant))
    }

    /// Returns `None` if no arbitration is possible at `now_ns`. Otherwise returns the station that must
    /// still wait, if there is one, and the time from which this station may take part.
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

    /// Performs one action that is pending at `now_ns` and returns it. The caller repeats the call until the result is
    /// `None`. It must do so at the times of [`Line::next_ns`], and whenever a participant has a frame to send.
    pub fn advance(&mut self, now_ns: u64, participants: &impl Participants) -> Option<Event> {
        if let LinePhase::Busy(it) = self.state {
            return (it.end_ns <= now_ns).then(|| self.close(it));
        }
        let suspended = self.arbitration(now_ns, participants)?;
        self.arbitrate(now_ns, suspended, participants)
    }

    /// Lets each station with a frame begin to send; the sender of the dominant frame continues.
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

    /// Makes `sender` withdraw after its start bit in an arbitration without other stations: six recessive bits later
    /// all stations find an error (decision D-333).
    pub fn withdraw(&mut self, now_ns: u64, sender: usize, frame: Frame) -> Event {
        let mut it = self.begin(now_ns, sender, frame);
        self.destroy(&mut it, 1 + ERROR_FLAG, Fate::Withdrawn);
        self.state = LinePhase::Busy(it);
        Event::Begun(it)
    }

    /// Ends the frame with an error flag, `bits` bits after its beginning.
    fn destroy(&self, it: &mut OnWire, bits: u32, fate: Fate) {
        it.fate = fate;
        it.end_ns = it.begin_ns.saturating_add(self.rate.time_ns(bits));
        let bits = bits + ERROR_FLAG + ERROR_DELIMITER + INTERMISSION;
        it.free_ns = it.begin_ns.saturating_add(self.rate.time_ns(bits));
    }

    /// Changes the result of a frame that would have arrived. `bits` computes the start of the error flag
    /// from two numbers: the bits that have passed at `now_ns`, and the bits before the acknowledge slot.
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

    /// Called when the sender of the frame on the wire has disconnected from the bus. All other stations find an error
    /// six recessive bits later, or after the acknowledge delimiter because of the wrong checksum, if this is earlier.
    /// A frame with a complete checksum arrives.
    pub fn sender_gone(&mut self, now_ns: u64) {
        self.spoil(now_ns, Fate::SenderGone, |over, to_acknowledgement| {
            (over < to_acknowledgement).then(|| (over + ERROR_FLAG).min(to_acknowledgement + 2))
        });
    }

    /// Called when the sender of the frame on the wire has gone BUS-off, which means that the bit on the wire was an
    /// error. Before the checksum is complete, the others find the error as in [`Line::sender_gone`]. After it, they find
    /// the error in the same bit. In the last bit of the end of frame, receivers ignore an error: they have the frame,
    /// and its sender does not know (D-881).
    pub(crate) fn sender_is_off(&mut self, now_ns: u64) {
        self.sender_gone(now_ns);
        self.spoil(now_ns, Fate::SenderGone, |over, to_acknowledgement| {
            let last = to_acknowledgement + 1 + wire::RECESSIVE_END;
            (over < last).then_some(over)
        });
    }

    /// Called when the last station that could acknowledge the frame on the wire has disconnected from the bus.
    pub fn nobody_left(&mut self, now_ns: u64) {
        self.spoil(now_ns, Fate::NotAcknowledged, |over, to_acknowledgement| {
            (over <= to_acknowledgement).then_some(to_acknowledgement + 1)
        });
    }

    /// Disturbs the frame on the wire, which has just begun: its CRC delimiter becomes dominant (decision D-331).
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
