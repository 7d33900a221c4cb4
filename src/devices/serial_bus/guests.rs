//! Guests on a serial line: foreign programs that send and receive octets.

use crate::devices::GuestRefusal;
use crate::journal::Origin;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// If so many octets of a guest wait, further octets wait at its door.
const ROOM: usize = crate::door::OCTETS_TO_PLANT;

/// Sender numbers on the line from this number on are guests.
const FIRST: usize = 1 << 16;

/// Returns the guest number of a sender, if the sender is a guest.
pub(super) fn guest_of(sender: usize) -> Option<u8> {
    sender.checked_sub(FIRST).and_then(|number| u8::try_from(number).ok())
}

/// Returns the guest of a sender, for the journal.
pub(super) fn origin_of(sender: usize) -> Option<Origin> {
    guest_of(sender).map(Origin::of_guest)
}

/// A guest that takes part.
#[derive(Serialize, Deserialize)]
pub(super) struct BusGuest {
    number: u8,
    /// True if the guest has disconnected. Its waiting octets are still sent.
    is_leaving: bool,
    queue: VecDeque<u8>,
    /// Octets that were sent without a pause and are not in the journal yet.
    pub(super) burst: Vec<u8>,
    /// Tick at which the guest's last character has ended.
    pub(super) free_from: u64,
}

impl BusGuest {
    /// Returns the guest's number as a sender on the line.
    pub(super) fn sender(&self) -> usize {
        FIRST + usize::from(self.number)
    }

    /// True if the guest has something to send.
    pub(super) fn has_to_send(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Takes the octet that the guest sends next.
    pub(super) fn take_to_send(&mut self) -> Option<u8> {
        self.queue.pop_front()
    }
}

/// The guests of a serial line.
#[derive(Default)]
pub(super) struct Guests(Vec<BusGuest>);

impl SnapshotFields for Guests {
    fn save(&self, to: &mut Saving) {
        to.value(&self.0);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.0 = from.value()?;
        Ok(())
    }
}

impl Guests {
    fn get(&mut self, number: u8) -> Option<&mut BusGuest> {
        self.0.iter_mut().find(|it| it.number == number && !it.is_leaving)
    }

    /// Returns a guest, which may be about to leave, by its number as a sender.
    pub(super) fn of_sender(&mut self, sender: usize) -> Option<&mut BusGuest> {
        self.0.iter_mut().find(|it| it.sender() == sender)
    }

    /// Returns all guests, including those that are about to leave.
    pub(super) fn all(&self) -> impl Iterator<Item = &BusGuest> {
        self.0.iter()
    }

    /// Returns the numbers of the guests that take part.
    pub(super) fn present(&self) -> impl Iterator<Item = u8> {
        self.0.iter().filter(|it| !it.is_leaving).map(|it| it.number)
    }

    /// Adds a guest; returns `false` if it takes part already. A guest of this number that is about to leave loses the
    /// octets that it has not sent.
    pub(super) fn join(&mut self, number: u8) -> bool {
        let is_new = self.get(number).is_none();
        if is_new {
            self.0.retain(|it| it.number != number);
            self.0.push(BusGuest {
                number,
                is_leaving: false,
                queue: VecDeque::new(),
                burst: Vec::new(),
                free_from: 0,
            });
        }
        is_new
    }

    /// Lets a guest leave as soon as it has sent its octets.
    pub(super) fn leave(&mut self, number: u8) {
        if let Some(guest) = self.get(number) {
            guest.is_leaving = true;
        }
    }

    /// Removes the guests that are leaving and have nothing to send. `is_sending` is true for senders on the line.
    pub(super) fn remove_left(&mut self, is_sending: impl Fn(usize) -> bool) {
        self.0.retain(|it| !it.is_leaving || it.has_to_send() || is_sending(it.sender()));
    }

    /// Queues octets of a guest.
    pub(super) fn enqueue(&mut self, number: u8, octets: &[u8]) -> Result<(), GuestRefusal> {
        let guest = self.get(number).ok_or(GuestRefusal::NotHere)?;
        // The last message may exceed the room, so that every octet up to the limit enters, whatever the sizes of the
        // messages are.
        if guest.queue.len() >= ROOM {
            return Err(GuestRefusal::Full);
        }
        guest.queue.extend(octets);
        Ok(())
    }
}
