//! Guests on a PROFIBUS segment. They are foreign programs that send octets, and receive the octets of other
//! stations.
//!
//! A guest receives a telegram at its end, and its program needs time to answer. A guest can give a bit time for its
//! telegram. Otherwise the telegram waits until the line has been idle for the time that the standard requires
//! (decision D-357).

use crate::devices::GuestRefusal;
use crate::door::BusMessage;
use crate::journal::Origin;
use crate::profibus::{Burst, BusRate, FunctionCode, MIN_TSDR_BITS, SYN_BITS, Telegram};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Maximum number of telegrams of a guest that wait here. Further telegrams wait at the guest's door.
const ROOM: usize = 64;

/// Maximum time in microseconds by which the bit time of a telegram may be in the future. A longer wait would
/// delay all later telegrams of the guest (decision D-677).
const MOST_AHEAD_US: u64 = 60_000_000;

/// Senders on the line with this number or a higher number are guests.
const FIRST: usize = 1 << 16;

/// Returns the guest number of a sender, if the sender is a guest.
pub(super) fn guest_of(sender: usize) -> Option<u8> {
    sender.checked_sub(FIRST).and_then(|number| u8::try_from(number).ok())
}

/// Returns the sender number of guest `number`.
pub(super) fn sender_of(number: u8) -> usize {
    FIRST + usize::from(number)
}

/// Condition under which a guest's telegram begins.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum BeginCondition {
    /// The telegram begins at its bit time, even if the line is busy.
    Time,
    /// The telegram begins as an answer: the line is reserved for it, and has been idle for the shortest
    /// T_SDR.
    Answer,
    /// The telegram begins as a request: the line has been idle for T_SYN and is not reserved for another
    /// sender.
    Request,
}

/// A telegram that a guest has to send.
#[derive(Serialize, Deserialize)]
struct WaitingTelegram {
    /// Earliest bit time at which the telegram may begin.
    from: u64,
    turn: BeginCondition,
    octets: Vec<u8>,
}

impl WaitingTelegram {
    /// Returns the start of the telegram on a line that has been idle since `since` and is reserved for other
    /// senders until `kept`. `None` if the telegram has a fixed time.
    fn begin(&self, since: u64, kept: u64) -> Option<u64> {
        match self.turn {
            BeginCondition::Time => None,
            BeginCondition::Answer => Some(self.from.max(since + MIN_TSDR_BITS)),
            BeginCondition::Request => Some(self.from.max(since + SYN_BITS).max(kept)),
        }
    }
}

/// A guest that takes part.
struct BusGuest {
    number: u8,
    /// Source address of the guest's last telegram.
    address: Option<u8>,
    /// True if the guest has disconnected. Its waiting telegrams are still sent.
    is_leaving: bool,
    queue: VecDeque<WaitingTelegram>,
}

/// The guests of a PROFIBUS segment.
#[derive(Default)]
pub(super) struct Guests(Vec<BusGuest>);

impl SnapshotFields for Guests {
    fn save(&self, to: &mut Saving) {
        let kept = self
            .0
            .iter()
            .map(|BusGuest { number, address, is_leaving, queue }| (number, address, is_leaving, queue));
        to.value(&kept.collect::<Vec<_>>());
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let guests: Vec<(u8, Option<u8>, bool, VecDeque<WaitingTelegram>)> = from.value()?;
        let guest = |(number, address, is_leaving, queue)| BusGuest { number, address, is_leaving, queue };
        self.0 = guests.into_iter().map(guest).collect();
        Ok(())
    }
}

impl Guests {
    fn get(&mut self, number: u8) -> Option<&mut BusGuest> {
        self.0.iter_mut().find(|it| it.number == number && !it.is_leaving)
    }

    /// Adds a guest; returns `false` if it takes part already.
    pub(super) fn join(&mut self, number: u8) -> bool {
        let is_new = self.get(number).is_none();
        if is_new {
            let queue = VecDeque::new();
            self.0.push(BusGuest { number, address: None, is_leaving: false, queue });
        }
        is_new
    }

    /// Removes a guest, and those of its telegrams that have a bit time later than `now`.
    pub(super) fn leave(&mut self, number: u8, now: u64) {
        self.give_up_later(number, now);
        if let Some(guest) = self.get(number) {
            guest.is_leaving = true;
        }
        self.0.retain(|it| !it.is_leaving || !it.queue.is_empty());
    }

    /// Removes those of the guest's telegrams that have a bit time later than `now`.
    pub(super) fn give_up_later(&mut self, number: u8, now: u64) {
        if let Some(guest) = self.get(number) {
            guest.queue.retain(|waiting| waiting.from <= now);
        }
    }

    /// Queues a telegram of a guest. The telegram begins at bit time `now` or later, on a line of this rate.
    pub(super) fn enqueue(
        &mut self,
        number: u8,
        message: &BusMessage,
        now: u64,
        rate: BusRate,
    ) -> Result<(), GuestRefusal> {
        let BusMessage::Burst(Burst { begin, octets }) = message else { return Err(GuestRefusal::NotHere) };
        let guest = self.get(number).ok_or(GuestRefusal::NotHere)?;
        let ahead_us = rate.us_at(begin.saturating_sub(now));
        if ahead_us > MOST_AHEAD_US {
            return Err(GuestRefusal::TooFarAhead { seconds: ahead_us / 1_000_000 });
        }
        if guest.queue.len() >= ROOM {
            return Err(GuestRefusal::Full);
        }
        let turn = if *begin == 0 { begin_condition(octets) } else { BeginCondition::Time };
        guest.queue.push_back(WaitingTelegram { from: (*begin).max(now), turn, octets: octets.clone() });
        Ok(())
    }

    /// Records the source address of a guest's telegram.
    pub(super) fn note_address(&mut self, sender: usize, address: u8) {
        if let Some(guest) = guest_of(sender).and_then(|number| self.get(number)) {
            guest.address = Some(address);
        }
    }

    /// Returns the guests that take part: number, and source address of the last telegram.
    pub(super) fn present(&self) -> impl Iterator<Item = (u8, Option<u8>)> {
        self.0.iter().filter(|it| !it.is_leaving).map(|it| (it.number, it.address))
    }

    /// Returns the bit time and the sender of the next telegram with a fixed bit time.
    pub(super) fn next_exact(&self) -> Option<(u64, usize)> {
        let exact = |it: &BusGuest| {
            it.queue
                .front()
                .filter(|waiting| waiting.turn == BeginCondition::Time)
                .map(|waiting| waiting.from)
        };
        self.0.iter().filter_map(|it| Some((exact(it)?, sender_of(it.number)))).min()
    }

    /// Returns the bit time and the sender of the next telegram that would begin if the line stays idle from
    /// bit time `since` on. `kept` returns the bit time until which the line is reserved for senders other
    /// than the given one.
    pub(super) fn next_idle(&self, since: u64, kept: impl Fn(usize) -> u64) -> Option<(u64, usize)> {
        let of = |it: &BusGuest| {
            let (waiting, sender) = (it.queue.front()?, sender_of(it.number));
            Some((waiting.begin(since, kept(sender))?, sender))
        };
        self.0.iter().filter_map(of).min()
    }

    /// Removes and returns the octets that this guest sends now.
    pub(super) fn take(&mut self, sender: usize) -> Option<Vec<u8>> {
        let number = guest_of(sender)?;
        // If two guests have this number, the first one has disconnected and still has telegrams to send.
        let guest = self.0.iter_mut().find(|it| it.number == number && !it.queue.is_empty())?;
        let telegram = guest.queue.pop_front();
        self.0.retain(|it| !it.is_leaving || !it.queue.is_empty());
        telegram.map(|waiting| waiting.octets)
    }
}

/// Returns the condition under which these octets begin. Octets that are not a telegram have the condition of
/// a request.
fn begin_condition(octets: &[u8]) -> BeginCondition {
    let is_answer = match Telegram::parse(octets) {
        Ok(Telegram::ShortAck) => true,
        Ok(Telegram::Frame(frame)) => FunctionCode::is_answer(frame.fc),
        _ => false,
    };
    if is_answer { BeginCondition::Answer } else { BeginCondition::Request }
}

/// Returns the guest of a sender, for the journal.
pub(super) fn origin_of(sender: usize) -> Option<Origin> {
    guest_of(sender).map(Origin::of_guest)
}
