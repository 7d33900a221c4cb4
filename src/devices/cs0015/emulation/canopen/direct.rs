//! Direct use of CAN by a program: a queue for each identifier that the program has registered (p. 22-23,
//! 33-34).

use crate::can::{Frame, StandardId};
use embedded_can::{Frame as _, Id};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Maximum number of messages in a queue (p. 22).
const DEPTH: usize = 30;

/// The messages of an identifier.
#[derive(Serialize, Deserialize)]
struct Queue {
    #[serde(with = "crate::can::kept")]
    id: StandardId,
    messages: VecDeque<Vec<u8>>,
    /// True if at least one message was lost.
    has_overflown: bool,
}

/// Result of a call of `CAN_RECEIVE`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ReceivedMessage {
    /// Number of waiting messages, including this one.
    pub available: u8,
    /// True if at least one message was lost.
    pub has_overflown: bool,
    /// Data of the oldest message; empty if there is no message.
    pub data: Vec<u8>,
}

/// All queues of received messages.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct Direct {
    queues: Vec<Queue>,
}

impl Direct {
    /// Registers an identifier, so that its messages are kept. Returns `false` if it was already registered.
    pub(crate) fn configure(&mut self, id: StandardId) -> bool {
        let is_new = self.queues.iter().all(|queue| queue.id != id);
        if is_new {
            self.queues.push(Queue { id, messages: VecDeque::new(), has_overflown: false });
        }
        is_new
    }

    /// Removes all identifiers and their queues.
    pub(crate) fn clear(&mut self) {
        self.queues.clear();
    }

    /// Returns the registered identifiers.
    pub(crate) fn ids(&self) -> impl Iterator<Item = StandardId> {
        self.queues.iter().map(|queue| queue.id)
    }

    /// Puts a received frame into the queue of its identifier, if the identifier is registered. Returns `false` if the
    /// queue is full and the frame is lost.
    pub(crate) fn received(&mut self, frame: &Frame) -> bool {
        let queue = self.queues.iter_mut().find(|queue| frame.id() == Id::Standard(queue.id));
        let Some(queue) = queue.filter(|_| frame.is_data_frame()) else { return true };
        let has_room = queue.messages.len() < DEPTH;
        if has_room {
            queue.messages.push_back(frame.data().to_vec());
        } else {
            queue.has_overflown = true;
        }
        has_room
    }

    /// Takes the oldest message of an identifier, or discards all its messages if `is_to_clear`. Returns
    /// `None` if the identifier is not registered.
    pub(crate) fn take(&mut self, id: StandardId, is_to_clear: bool) -> Option<ReceivedMessage> {
        let queue = self.queues.iter_mut().find(|queue| queue.id == id)?;
        if is_to_clear {
            queue.messages.clear();
            queue.has_overflown = false;
        }
        let (available, has_overflown) = (queue.messages.len() as u8, queue.has_overflown);
        let data = queue.messages.pop_front().unwrap_or_default();
        if queue.messages.is_empty() {
            queue.has_overflown = false;
        }
        Some(ReceivedMessage { available, has_overflown, data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::Payload;

    fn id(id: u16) -> StandardId {
        StandardId::new(id).unwrap()
    }

    fn message(number: u8) -> Frame {
        Frame::new(id(0x111), Payload::new(&[number]).unwrap())
    }

    fn found(available: u8, has_overflown: bool, data: &[u8]) -> Option<ReceivedMessage> {
        Some(ReceivedMessage { available, has_overflown, data: data.to_vec() })
    }

    #[test]
    fn thirty_messages_wait_and_the_oldest_comes_first() {
        let mut direct = Direct::default();
        assert_eq!(direct.take(id(0x111), false), None);
        direct.received(&message(99));
        assert!(direct.configure(id(0x111)) && !direct.configure(id(0x111)));
        assert_eq!(direct.take(id(0x111), false), found(0, false, &[]), "before its registration");
        assert!((0..30).all(|number| direct.received(&message(number))));
        assert_eq!(direct.take(id(0x111), false), found(30, false, &[0]));
        assert_eq!(direct.take(id(0x111), false), found(29, false, &[1]));
        assert_eq!([30, 31, 32].map(|number| direct.received(&message(number))), [true, true, false]);
        assert_eq!(direct.take(id(0x111), false), found(30, true, &[2]), "the last one is lost");
        for number in 3..31 {
            assert_eq!(direct.take(id(0x111), false), found(32 - number, true, &[number]));
        }
        assert_eq!(direct.take(id(0x111), false), found(1, true, &[31]));
        assert_eq!(direct.take(id(0x111), false), found(0, false, &[]));
    }

    #[test]
    fn other_frames_are_not_kept_and_all_can_be_discarded() {
        let mut direct = Direct::default();
        direct.configure(id(0x111));
        direct.received(&Frame::standard(0x112, Payload::new(&[1]).unwrap()));
        direct.received(&Frame::remote(id(0x111), 1).unwrap());
        assert_eq!(direct.take(id(0x111), false), found(0, false, &[]));
        (0..31).for_each(|number| assert_eq!(direct.received(&message(number)), number < 30));
        assert_eq!(direct.take(id(0x111), true), found(0, false, &[]));
        assert_eq!(direct.ids().collect::<Vec<_>>(), [id(0x111)]);
        direct.clear();
        assert_eq!(direct.take(id(0x111), false), None);
    }
}
