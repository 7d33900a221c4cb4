//! Receivers of a bus's traffic: the guests that hear it. A bus without guests has none, and its traffic costs nothing
//! more.

use crate::door::{BusMessage, Guest};
use std::sync::Arc;

/// The guests that hear the traffic of a bus. Snapshots contain none: a restored bus has no guests until they are
/// connected again.
#[derive(Default)]
pub(crate) struct TrafficReceivers(Vec<Arc<Guest>>);

impl TrafficReceivers {
    /// Sets or removes the receiver of the messages for guest number `guest`.
    pub(crate) fn set(&mut self, guest: u8, ear: Option<Arc<Guest>>) {
        self.0.retain(|known| known.number != guest);
        self.0.extend(ear);
    }

    /// Removes all receivers.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Sends a message that has arrived at `time_us` to all guests except its sender.
    #[inline]
    pub(crate) fn send(&self, time_us: u64, sender: Option<u8>, said: impl Fn() -> BusMessage) {
        if !self.0.is_empty() {
            self.send_to_others(time_us, sender, said);
        }
    }

    #[cold]
    fn send_to_others(&self, time_us: u64, sender: Option<u8>, said: impl Fn() -> BusMessage) {
        for ear in self.0.iter().filter(|ear| Some(ear.number) != sender) {
            ear.hear(time_us, said());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::BusIndex;

    #[test]
    fn a_guest_hears_others_while_it_has_an_ear() {
        let guests = [1, 2].map(|number| Guest::of_a_test(BusIndex(0), number));
        let mut ears = TrafficReceivers::default();
        let said = || BusMessage::burst(vec![0xE5]);
        ears.send(1, None, said);
        for guest in &guests {
            ears.set(guest.number, Some(Arc::clone(guest)));
            ears.set(guest.number, Some(Arc::clone(guest)));
        }
        ears.send(2, Some(1), said);
        ears.send(3, None, said);
        assert_eq!(guests.each_ref().map(|guest| guest.heard()), [1, 2]);
        ears.set(2, None);
        ears.send(4, None, said);
        ears.clear();
        ears.send(5, None, said);
        assert_eq!(guests.each_ref().map(|guest| guest.heard()), [2, 2]);
    }
}
