//! Receivers of a bus's traffic: guests that listen to the bus. A bus without guests loses no time.

use crate::door::{BusMessage, Guest};
use std::sync::Arc;

/// The guests that receive the traffic of a bus. Snapshots do not contain them: a restored bus has no guests
/// until they connect again.
#[derive(Default)]
pub(crate) struct TrafficReceivers(Vec<Arc<Guest>>);

impl TrafficReceivers {
    /// Sets or removes the receiver of the messages for guest number `guest`.
    pub(crate) fn set(&mut self, guest: u8, receiver: Option<Arc<Guest>>) {
        self.0.retain(|known| known.number != guest);
        self.0.extend(receiver);
    }

    /// Removes all receivers of traffic.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Sends a message that has arrived at `time_us` to all guests except its sender.
    #[inline]
    pub(crate) fn send(&self, time_us: u64, sender: Option<u8>, message: impl Fn() -> BusMessage) {
        if !self.0.is_empty() {
            self.send_to_others(time_us, sender, message);
        }
    }

    #[cold]
    fn send_to_others(&self, time_us: u64, sender: Option<u8>, message: impl Fn() -> BusMessage) {
        for receiver in self.0.iter().filter(|receiver| Some(receiver.number) != sender) {
            receiver.hear(time_us, message());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::BusIndex;

    #[test]
    fn a_guest_receives_messages_of_others_while_it_is_a_receiver() {
        let guests = [1, 2].map(|number| Guest::of_a_test(BusIndex(0), number));
        let mut receivers = TrafficReceivers::default();
        let message = || BusMessage::burst(vec![0xE5]);
        receivers.send(1, None, message);
        for guest in &guests {
            receivers.set(guest.number, Some(Arc::clone(guest)));
            receivers.set(guest.number, Some(Arc::clone(guest)));
        }
        receivers.send(2, Some(1), message);
        receivers.send(3, None, message);
        assert_eq!(guests.each_ref().map(|guest| guest.heard()), [1, 2]);
        receivers.set(2, None);
        receivers.send(4, None, message);
        receivers.clear();
        receivers.send(5, None, message);
        assert_eq!(guests.each_ref().map(|guest| guest.heard()), [2, 2]);
    }
}
