//! Guests at a segment: foreign programs that say octets and hear those of others.
//!
//! A guest is told at the end of a telegram, and answers by a program that takes its time; so unless it gives a bit time of its
//! own, what it says waits until the line has been idle for as long as the standard has it (decision D-357).

use crate::devices::GuestRefusal;
use crate::door::{BusMessage, Guest};
use crate::journal::Origin;
use crate::profibus::{Burst, BusRate, FunctionCode, MIN_TSDR_BITS, SYN_BITS, Sending, Telegram};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;

/// Telegrams of a guest that wait at most; the others wait at its door.
const ROOM: usize = 64;

/// Microseconds by which the time of a telegram may lie ahead at most: a longer wait would keep back everything that the guest says
/// after it (decision D-677).
const MOST_AHEAD_US: u64 = 60_000_000;

/// From here on senders on the line are guests.
const FIRST: usize = 1 << 16;

/// Whose it is, if it is a guest's.
pub(super) fn guest_of(sender: usize) -> Option<u8> {
    sender.checked_sub(FIRST).and_then(|number| u8::try_from(number).ok())
}

/// Guest number `number` as a sender on the line.
pub(super) fn sender_of(number: u8) -> usize {
    FIRST + usize::from(number)
}

/// What lets a guest's telegram begin.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Turn {
    /// Its bit time, whatever is on the line.
    Time,
    /// A line that has been idle for the shortest T_SDR: an answer, for which the line is kept.
    Answer,
    /// A line that has been idle for T_SYN and is kept for nobody else.
    Request,
}

/// Something that a guest has to say.
#[derive(Serialize, Deserialize)]
struct Waiting {
    /// Not before this bit time.
    from: u64,
    turn: Turn,
    octets: Vec<u8>,
}

impl Waiting {
    /// When it begins on a line that is idle since `since` and kept for others until `kept`; none if the line does not matter.
    fn begin(&self, since: u64, kept: u64) -> Option<u64> {
        match self.turn {
            Turn::Time => None,
            Turn::Answer => Some(self.from.max(since + MIN_TSDR_BITS)),
            Turn::Request => Some(self.from.max(since + SYN_BITS).max(kept)),
        }
    }
}

/// A guest that takes part.
struct Visitor {
    number: u8,
    /// The address that it last sent from.
    address: Option<u8>,
    ear: Option<Arc<Guest>>,
    /// It has gone; what it has said before is still to be heard.
    is_leaving: bool,
    to_say: VecDeque<Waiting>,
}

/// The guests of a segment.
#[derive(Default)]
pub(super) struct Visitors(Vec<Visitor>);

impl SnapshotFields for Visitors {
    fn save(&self, to: &mut Saving) {
        let kept = self.0.iter().map(|Visitor { number, address, ear: _, is_leaving, to_say }| {
            (number, address, is_leaving, to_say)
        });
        to.value(&kept.collect::<Vec<_>>());
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let visitors: Vec<(u8, Option<u8>, bool, VecDeque<Waiting>)> = from.value()?;
        let visitor = |(number, address, is_leaving, to_say)| Visitor {
            number,
            address,
            ear: None,
            is_leaving,
            to_say,
        };
        self.0 = visitors.into_iter().map(visitor).collect();
        Ok(())
    }
}

impl Visitors {
    fn get(&mut self, number: u8) -> Option<&mut Visitor> {
        self.0.iter_mut().find(|it| it.number == number && !it.is_leaving)
    }

    /// One takes part from now on; `false` if it does so already.
    pub(super) fn join(&mut self, number: u8) -> bool {
        let is_new = self.get(number).is_none();
        if is_new {
            let to_say = VecDeque::new();
            self.0.push(Visitor { number, address: None, ear: None, is_leaving: false, to_say });
        }
        is_new
    }

    /// What it hears goes here.
    pub(super) fn listen(&mut self, number: u8, ear: Arc<Guest>) {
        if let Some(visitor) = self.get(number) {
            visitor.ear = Some(ear);
        }
    }

    /// It takes part no longer. What it wanted to say later than at bit time `now` it does not say.
    pub(super) fn leave(&mut self, number: u8, now: u64) {
        self.give_up_later(number, now);
        if let Some(visitor) = self.get(number) {
            (visitor.is_leaving, visitor.ear) = (true, None);
        }
        self.0.retain(|it| !it.is_leaving || !it.to_say.is_empty());
    }

    /// What it wanted to say later than at bit time `now` it does not say.
    pub(super) fn give_up_later(&mut self, number: u8, now: u64) {
        if let Some(visitor) = self.get(number) {
            visitor.to_say.retain(|waiting| waiting.from <= now);
        }
    }

    /// It says something at bit time `now` or later, on a line of this rate.
    pub(super) fn say(
        &mut self,
        number: u8,
        said: &BusMessage,
        now: u64,
        rate: BusRate,
    ) -> Result<(), GuestRefusal> {
        let BusMessage::Burst(Burst { begin, octets }) = said else { return Err(GuestRefusal::NotHere) };
        let visitor = self.get(number).ok_or(GuestRefusal::NotHere)?;
        let ahead_us = rate.us_at(begin.saturating_sub(now));
        if ahead_us > MOST_AHEAD_US {
            return Err(GuestRefusal::TooFarAhead { seconds: ahead_us / 1_000_000 });
        }
        if visitor.to_say.len() >= ROOM {
            return Err(GuestRefusal::Full);
        }
        let turn = if *begin == 0 { turn(octets) } else { Turn::Time };
        visitor.to_say.push_back(Waiting { from: (*begin).max(now), turn, octets: octets.clone() });
        Ok(())
    }

    /// A telegram of this guest has come from this address.
    pub(super) fn note_address(&mut self, sender: usize, address: u8) {
        if let Some(visitor) = guest_of(sender).and_then(|number| self.get(number)) {
            visitor.address = Some(address);
        }
    }

    /// The guests that take part: number, and the address that each last sent from.
    pub(super) fn present(&self) -> impl Iterator<Item = (u8, Option<u8>)> {
        self.0.iter().filter(|it| !it.is_leaving).map(|it| (it.number, it.address))
    }

    /// Who says something at a time of its own next, and when.
    pub(super) fn next_exact(&self) -> Option<(u64, usize)> {
        let exact = |it: &Visitor| {
            it.to_say.front().filter(|waiting| waiting.turn == Turn::Time).map(|waiting| waiting.from)
        };
        self.0.iter().filter_map(|it| Some((exact(it)?, sender_of(it.number)))).min()
    }

    /// Who would say something next on a line that is idle since this bit time, and when. `kept`: until when the line is kept for
    /// others than a sender.
    pub(super) fn next_idle(&self, since: u64, kept: impl Fn(usize) -> u64) -> Option<(u64, usize)> {
        let of = |it: &Visitor| {
            let (waiting, sender) = (it.to_say.front()?, sender_of(it.number));
            Some((waiting.begin(since, kept(sender))?, sender))
        };
        self.0.iter().filter_map(of).min()
    }

    /// What this one says now.
    pub(super) fn take(&mut self, sender: usize) -> Option<Vec<u8>> {
        let number = guest_of(sender)?;
        // Of two with this number the first one is about to go.
        let visitor = self.0.iter_mut().find(|it| it.number == number && !it.to_say.is_empty())?;
        let said = visitor.to_say.pop_front();
        self.0.retain(|it| !it.is_leaving || !it.to_say.is_empty());
        said.map(|waiting| waiting.octets)
    }

    /// Tells everybody but the one whose it is.
    pub(super) fn tell(&self, sending: &Sending, time_us: u64) {
        let others = self.0.iter().filter(|it| sender_of(it.number) != sending.sender);
        for ear in others.filter_map(|it| it.ear.as_ref()) {
            let burst = Burst { begin: sending.begin, octets: sending.octets.clone() };
            ear.hear(time_us, BusMessage::Burst(burst));
        }
    }
}

/// What lets these octets begin. What is no telegram waits as long as a request does.
fn turn(octets: &[u8]) -> Turn {
    let is_answer = match Telegram::parse(octets) {
        Ok(Telegram::ShortAck) => true,
        Ok(Telegram::Frame(frame)) => FunctionCode::is_answer(frame.fc),
        _ => false,
    };
    if is_answer { Turn::Answer } else { Turn::Request }
}

/// Whose a sending of a guest is, for the journal.
pub(super) fn origin_of(sender: usize) -> Option<Origin> {
    guest_of(sender).map(Origin::of_guest)
}
