//! PROFIBUS telegrams over a stream of bytes. Each telegram consists of the number of octets (16 bits), the bit time of
//! the first bit (64 bits), and the octets. The low byte of each number comes first. A telegram without octets from a
//! guest requests emulated time until the given bit time. A telegram without octets to a guest is the answer. This
//! module only converts bytes; the bus interprets the octets.

use super::protocol::{GuestSession, Protocol, TrafficKind};
use super::serial;
use super::spec::Carrier;
use super::wire::{Adapter, BadLength, BusMessage};
use crate::profibus::{Burst, MAX_OCTETS};

/// Number of bytes before the octets.
const HEAD: usize = 10;

/// The protocol of doors to PROFIBUS over TCP.
pub(super) struct Telegrams;

impl Protocol for Telegrams {
    fn name(&self) -> &'static str {
        "profibus"
    }

    fn traffic_kind(&self) -> TrafficKind {
        TrafficKind::Telegrams
    }

    fn tcp_number(&self) -> u16 {
        3
    }

    fn pty_number(&self) -> Option<u16> {
        Some(4)
    }

    /// The guest takes part at once. A pseudo-terminal is a serial line.
    fn begin(&self, carrier: Carrier, adapter: &mut dyn Adapter) -> Box<dyn GuestSession> {
        adapter.open(false);
        match carrier {
            Carrier::Tcp(_) => Box::new(Session::default()),
            Carrier::Pty(_) => Box::new(serial::Session::default()),
        }
    }
}

impl GuestSession for Session {
    fn hear(&mut self, bytes: &[u8], adapter: &mut dyn Adapter, _: &mut Vec<u8>) -> Result<(), BadLength> {
        self.hear(bytes, adapter)
    }

    fn grant(&self, _: u64, bit: u64, to: &mut Vec<u8>) {
        encode(&Burst { begin: bit, octets: Vec::new() }, to);
    }

    fn encode(&self, _: u64, message: &BusMessage, to: &mut Vec<u8>) {
        if let BusMessage::Burst(burst) = message {
            encode(burst, to);
        }
    }
}

/// The emulator's side of the protocol for a guest.
#[derive(Debug, Default)]
pub(super) struct Session {
    /// Bytes of a telegram that is not complete yet.
    begun: Vec<u8>,
}

impl Session {
    /// Interprets bytes from the guest.
    ///
    /// # Errors
    /// [`BadLength`], if a telegram has an impossible length.
    pub(super) fn hear(&mut self, bytes: &[u8], adapter: &mut dyn Adapter) -> Result<(), BadLength> {
        self.begun.extend_from_slice(bytes);
        let mut rest = self.begun.as_slice();
        while let Some((head, following)) = rest.split_first_chunk::<HEAD>() {
            let (length, begin) = head_of(*head);
            if usize::from(length) > MAX_OCTETS {
                return Err(BadLength(length));
            }
            let Some((octets, following)) = following.split_at_checked(usize::from(length)) else { break };
            if octets.is_empty() {
                // The result is ignored: it is false if the guest already has a request, and both requests then get one
                // answer.
                adapter.ask_until(begin);
            } else {
                // If there is no room for the telegram, it is counted as refused.
                adapter.send(BusMessage::Burst(Burst { begin, octets: octets.to_vec() }));
            }
            rest = following;
        }
        let done = self.begun.len() - rest.len();
        drop(self.begun.drain(..done));
        Ok(())
    }
}

/// Decodes the number of octets and the bit time.
fn head_of(head: [u8; HEAD]) -> (u16, u64) {
    let [a, b, begin @ ..] = head;
    (u16::from_le_bytes([a, b]), u64::from_le_bytes(begin))
}

/// Appends the bytes of a telegram to `to`.
pub(super) fn encode(burst: &Burst, to: &mut Vec<u8>) {
    // No telegram is longer than MAX_OCTETS.
    to.extend((burst.octets.len() as u16).to_le_bytes());
    to.extend(burst.begin.to_le_bytes());
    to.extend_from_slice(&burst.octets);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::door::slcan::{Rate, Status};
    use proptest::prelude::*;

    #[derive(Default)]
    struct Noted(Vec<Burst>, Vec<u64>);

    impl Adapter for Noted {
        fn set_rate(&mut self, _: Option<Rate>) -> bool {
            false
        }

        fn open(&mut self, _: bool) {}

        fn close(&mut self) {}

        fn send(&mut self, message: BusMessage) -> bool {
            if let BusMessage::Burst(burst) = message {
                self.0.push(burst);
            }
            true
        }

        fn ask(&mut self, _: u64) -> bool {
            false
        }

        fn ask_until(&mut self, bit: u64) -> bool {
            self.1.push(bit);
            true
        }

        fn take_status(&mut self) -> Status {
            Status::default()
        }
    }

    fn burst() -> impl Strategy<Value = Burst> {
        let octets = prop::collection::vec(any::<u8>(), 1..=MAX_OCTETS);
        (any::<u64>(), octets).prop_map(|(begin, octets)| Burst { begin, octets })
    }

    #[test]
    fn numbers_have_their_low_byte_first() {
        let mut bytes = Vec::new();
        encode(&Burst { begin: 0x0102_0304_0506_0708, octets: vec![0xDC, 2, 2] }, &mut bytes);
        assert_eq!(bytes, [3, 0, 8, 7, 6, 5, 4, 3, 2, 1, 0xDC, 2, 2]);
    }

    #[test]
    fn a_length_that_no_telegram_has_ends_it() {
        for length in [256u16, 65_535] {
            let (mut session, mut noted) = (Session::default(), Noted::default());
            let mut bytes = vec![1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xE5];
            bytes.extend(length.to_le_bytes());
            bytes.extend([0; 7]);
            assert_eq!(session.hear(&bytes, &mut noted), Ok(()), "the head is not whole");
            assert_eq!(session.hear(&[0], &mut noted), Err(BadLength(length)));
            assert_eq!(noted.0, [Burst { begin: 0, octets: vec![0xE5] }], "what came before it counts");
        }
    }

    #[test]
    fn without_octets_it_asks_for_time() {
        let (mut session, mut noted) = (Session::default(), Noted::default());
        let mut bytes = Vec::new();
        encode(&Burst { begin: 1500, octets: vec![0xE5] }, &mut bytes);
        encode(&Burst { begin: 3000, octets: Vec::new() }, &mut bytes);
        assert_eq!(session.hear(&bytes, &mut noted), Ok(()));
        assert_eq!((noted.0.len(), noted.1), (1, vec![3000]));
    }

    /// For any input, the decoder does not panic, passes on no invalid telegram, and gives the same result in one piece
    /// and in several pieces.
    #[test]
    fn fuzz_door_telegrams() {
        crate::fuzz("door_telegrams", |bytes| {
            let Some((piece, bytes)) = bytes.split_first() else { return };
            let hear = |piece: usize| {
                let (mut session, mut noted) = (Session::default(), Noted::default());
                let ended = bytes.chunks(piece).find_map(|piece| session.hear(piece, &mut noted).err());
                (ended, noted.0, noted.1)
            };
            let heard = hear(bytes.len().max(1));
            assert!(heard.1.iter().all(|burst| (1..=MAX_OCTETS).contains(&burst.octets.len())));
            assert_eq!(heard, hear(usize::from(*piece).max(1)));
        });
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        /// Telegrams in pieces of any size are read correctly.
        #[test]
        fn telegrams_come_in_pieces(bursts in prop::collection::vec(burst(), 0..8), piece in 1..40usize) {
            let (mut session, mut noted, mut bytes) = (Session::default(), Noted::default(), Vec::new());
            bursts.iter().for_each(|burst| encode(burst, &mut bytes));
            for piece in bytes.chunks(piece) {
                prop_assert_eq!(session.hear(piece, &mut noted), Ok(()));
            }
            prop_assert_eq!(noted.0, bursts);
            prop_assert!(session.begun.is_empty());
        }
    }
}
