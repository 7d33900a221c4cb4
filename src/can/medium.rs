//! A CAN medium: one frame at a time, the one with the dominant identifier first.
//!
//! It is minimal: every frame that is on the wire to its end arrives at everybody. Error frames and counters are not here,
//! so whatever else would end in one is told by what does not happen: a frame without anybody to acknowledge it does not
//! arrive and remains with its sender (decision D-350).

use super::{BitRate, Frame, wire};

/// Whoever sits at a medium, in the order of attachment: the first has number 0.
///
/// The medium asks and tells them one after the other in this order, so the same frames at the same times always give the
/// same traffic.
pub trait Participants {
    /// How many they are.
    fn count(&self) -> usize;

    /// Whether this one takes part: it has power, is connected and runs at the medium's rate. Who does not neither sends nor
    /// hears nor acknowledges.
    fn is_on(&self, who: usize) -> bool;

    /// The frame that this one's controller sends when the medium is idle; of several the one that the controller sends
    /// first. It stays the same until [`sent`](Self::sent), unless the participant gives it up.
    fn offer(&self, who: usize) -> Option<Frame>;

    /// This one's frame has reached the others at `now_ns`, the end of its end-of-frame field.
    fn sent(&mut self, who: usize, now_ns: u64, frame: &Frame);

    /// A frame of somebody else has arrived at this one.
    fn received(&mut self, who: usize, now_ns: u64, frame: &Frame);
}

/// A frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OnWire {
    /// Who sends it.
    pub sender: usize,
    /// The frame; its content is fixed from its start on.
    pub frame: Frame,
    /// The beginning of its start bit, in ns.
    pub begin_ns: u64,
    /// The end of its end-of-frame field: its receivers have it.
    pub delivery_ns: u64,
    /// The end of the intermission: the next frame may begin.
    pub free_ns: u64,
}

/// What happened on a medium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame has won the arbitration and begins.
    Begun(OnWire),
    /// A frame is at its end and has arrived.
    Delivered(OnWire),
    /// A frame is at its end and has not arrived: its sender, or everybody else, is off.
    Lost(OnWire),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    Busy(OnWire),
    Intermission { until_ns: u64 },
}

/// A medium, what is on it and when it goes on.
#[derive(Clone, Debug)]
pub struct Medium {
    rate: BitRate,
    state: State,
}

impl Medium {
    /// An idle medium at this rate.
    pub const fn new(rate: BitRate) -> Self {
        Medium { rate, state: State::Idle }
    }

    /// The bit rate.
    pub const fn rate(&self) -> BitRate {
        self.rate
    }

    /// What is on the wire.
    pub const fn on_wire(&self) -> Option<&OnWire> {
        match &self.state {
            State::Busy(frame) => Some(frame),
            State::Idle | State::Intermission { .. } => None,
        }
    }

    /// When the medium has something to do by itself, in ns. `None`: it is idle until a participant has a frame to send,
    /// which whoever runs it tells by calling [`Medium::advance`].
    pub const fn next_ns(&self) -> Option<u64> {
        match &self.state {
            State::Idle => None,
            State::Busy(frame) => Some(frame.delivery_ns),
            State::Intermission { until_ns } => Some(*until_ns),
        }
    }

    /// Does one thing that is due at `now_ns` and tells it; to be called until there is none, at the times of
    /// [`Medium::next_ns`] and whenever a participant has a frame to send.
    pub fn advance(&mut self, now_ns: u64, participants: &mut impl Participants) -> Option<Event> {
        match self.state {
            State::Busy(frame) if frame.delivery_ns <= now_ns => {
                self.state = State::Intermission { until_ns: frame.free_ns };
                Some(end(&frame, participants))
            }
            State::Intermission { until_ns } if until_ns <= now_ns => {
                self.state = State::Idle;
                self.arbitrate(now_ns, participants)
            }
            State::Idle => self.arbitrate(now_ns, participants),
            State::Busy(_) | State::Intermission { .. } => None,
        }
    }

    /// Everybody with a frame begins, and the dominant one goes on. Of several with one arbitration field the first does
    /// (decision D-349).
    fn arbitrate(&mut self, now_ns: u64, participants: &impl Participants) -> Option<Event> {
        let (mut on, mut winner) = (0, None::<(usize, Frame)>);
        for who in (0..participants.count()).filter(|&who| participants.is_on(who)) {
            on += 1;
            if let Some(frame) = participants.offer(who)
                && winner.is_none_or(|(_, best)| frame.arbitration() < best.arbitration())
            {
                winner = Some((who, frame));
            }
        }
        let (sender, frame) = winner.filter(|_| on > 1)?;
        let airtime = wire::airtime(&frame, self.rate);
        let delivery_ns = now_ns.saturating_add(airtime.delivery_ns);
        let free_ns = now_ns.saturating_add(airtime.occupation_ns);
        let on_wire = OnWire { sender, frame, begin_ns: now_ns, delivery_ns, free_ns };
        self.state = State::Busy(on_wire);
        Some(Event::Begun(on_wire))
    }
}

/// The frame is at its end: it arrives, if its sender is still there and somebody acknowledges it.
fn end(on_wire: &OnWire, participants: &mut impl Participants) -> Event {
    let OnWire { sender, ref frame, delivery_ns, .. } = *on_wire;
    let all = 0..participants.count();
    let acknowledged = all.clone().any(|who| who != sender && participants.is_on(who));
    if !acknowledged || !all.contains(&sender) || !participants.is_on(sender) {
        return Event::Lost(*on_wire);
    }
    for who in all {
        if who == sender {
            participants.sent(who, delivery_ns, frame);
        } else if participants.is_on(who) {
            participants.received(who, delivery_ns, frame);
        }
    }
    Event::Delivered(*on_wire)
}

#[cfg(test)]
mod tests;
