//! Guests at a segment: foreign programs that say octets and hear those of others.
//!
//! A guest is told at the end of a telegram, and answers by a program that takes its time; so unless it gives a bit time of its
//! own, what it says waits until the line has been idle for as long as the standard has it (decision D-357).

use crate::devices::GuestRefusal;
use crate::door::{Guest, Said};
use crate::journal::Origin;
use crate::profibus::{Burst, FunctionCode, MIN_TSDR_BITS, SYN_BITS, Sending, Telegram};
use crate::state::{Damaged, Saved, Saving, State};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;

/// Telegrams of a guest that wait at most; the others wait at its door.
const ROOM: usize = 64;

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

/// Something that a guest has to say.
#[derive(Serialize, Deserialize)]
struct Waiting {
    /// Not before this bit time.
    from: u64,
    /// How long the line must have been idle, in bits; none: then, whatever is on it.
    gap: Option<u64>,
    octets: Vec<u8>,
}

/// A guest that takes part.
struct Visitor {
    number: u8,
    ear: Option<Arc<Guest>>,
    /// It has gone; what it has said before is still to be heard.
    is_leaving: bool,
    to_say: VecDeque<Waiting>,
}

/// The guests of a segment.
#[derive(Default)]
pub(super) struct Visitors(Vec<Visitor>);

impl State for Visitors {
    fn save(&self, to: &mut Saving) {
        let visitors =
            self.0.iter().map(|Visitor { number, ear: _, is_leaving, to_say }| (number, is_leaving, to_say));
        to.value(&visitors.collect::<Vec<_>>());
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let visitors: Vec<(u8, bool, VecDeque<Waiting>)> = from.value()?;
        let visitor = |(number, is_leaving, to_say)| Visitor { number, ear: None, is_leaving, to_say };
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
            self.0.push(Visitor { number, ear: None, is_leaving: false, to_say: VecDeque::new() });
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

    /// It says something at bit time `now` or later.
    pub(super) fn say(&mut self, number: u8, said: &Said, now: u64) -> Result<(), GuestRefusal> {
        let Said::Burst(Burst { begin, octets }) = said else { return Err(GuestRefusal::NotHere) };
        let visitor = self.get(number).ok_or(GuestRefusal::NotHere)?;
        if visitor.to_say.len() >= ROOM {
            return Err(GuestRefusal::Full);
        }
        let gap = (*begin == 0).then(|| gap(octets));
        visitor.to_say.push_back(Waiting { from: (*begin).max(now), gap, octets: octets.clone() });
        Ok(())
    }

    /// Who says something at a time of its own next, and when.
    pub(super) fn next_exact(&self) -> Option<(u64, usize)> {
        let exact = |it: &Visitor| {
            it.to_say.front().filter(|waiting| waiting.gap.is_none()).map(|waiting| waiting.from)
        };
        self.0.iter().filter_map(|it| Some((exact(it)?, sender_of(it.number)))).min()
    }

    /// Who would say something next on a line that is idle since this bit time, and when.
    pub(super) fn next_idle(&self, since: u64, may: impl Fn(usize) -> u64) -> Option<(u64, usize)> {
        let of = |it: &Visitor| {
            let (waiting, sender) = (it.to_say.front()?, sender_of(it.number));
            Some((waiting.from.max(since + waiting.gap?).max(may(sender)), sender))
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
            ear.hear(time_us, Said::Burst(burst));
        }
    }
}

/// How long the line must have been idle before somebody says this, in bits.
fn gap(octets: &[u8]) -> u64 {
    let is_answer = match Telegram::parse(octets) {
        Ok(Telegram::ShortAck) => true,
        Ok(Telegram::Frame(frame)) => matches!(FunctionCode::parse(frame.fc), FunctionCode::Answer(_)),
        _ => false,
    };
    if is_answer { MIN_TSDR_BITS } else { SYN_BITS }
}

/// Whose a sending of a guest is, for the journal.
pub(super) fn origin_of(sender: usize) -> Option<Origin> {
    guest_of(sender).map(Origin::of_guest)
}
