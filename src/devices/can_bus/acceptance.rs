//! A cache of the receivers of frames. The filters of all stations are evaluated once for each arbitration field, not
//! for each frame.

use crate::can::Frame;

/// Maximum number of arbitration fields in the cache. It must be a power of two.
const KINDS: usize = 4096;
/// Maximum number of receivers in the cache. If it is exceeded, the cache is cleared.
const ROOM: usize = 1 << 16;

/// The receivers of frames with one arbitration field: a range in the cache's list of receivers.
#[derive(Clone, Copy, Default)]
struct KnownReceivers {
    field: u32,
    first: u32,
    count: u32,
    /// The generation of filters for which the entry is valid.
    generation: u64,
}

/// Results of filters since the filters last changed.
pub(super) struct Acceptance {
    known: Vec<KnownReceivers>,
    receivers: Vec<u16>,
    generation: u64,
}

impl Acceptance {
    pub(super) fn new() -> Self {
        Acceptance { known: Vec::new(), receivers: Vec::new(), generation: 1 }
    }

    /// Clears the cache, because filters have changed or stations were added.
    pub(super) fn forget(&mut self) {
        self.generation += 1;
        self.receivers.clear();
    }

    /// Returns the stations that receive this frame, in ascending order. If they are not in the cache, calls
    /// `accepting`.
    pub(super) fn receivers<I: Iterator<Item = u16>>(
        &mut self,
        frame: &Frame,
        accepting: impl FnOnce() -> I,
    ) -> &[u16] {
        if self.known.is_empty() {
            self.known = vec![KnownReceivers::default(); KINDS];
        }
        let (field, ..) = frame.numbers();
        let place = field.wrapping_mul(0x9E37_79B1) as usize / (1 << 20) % KINDS;
        if self.known[place].generation != self.generation || self.known[place].field != field {
            if self.receivers.len() > ROOM {
                self.forget();
            }
            let first = self.receivers.len();
            self.receivers.extend(accepting());
            let count = (self.receivers.len() - first) as u32;
            self.known[place] =
                KnownReceivers { field, first: first as u32, count, generation: self.generation };
        }
        let KnownReceivers { first, count, .. } = self.known[place];
        &self.receivers[first as usize..][..count as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::Payload;

    #[test]
    fn filters_are_evaluated_once_and_again_after_a_change() {
        let mut acceptance = Acceptance::new();
        let mut asked = 0;
        let mut receivers = |acceptance: &mut Acceptance, id: u16| {
            let found = acceptance.receivers(&Frame::standard(id, Payload::EMPTY), || {
                asked += 1;
                [id, id + 1].into_iter()
            });
            let found = found.to_vec();
            (found, asked)
        };
        assert_eq!(receivers(&mut acceptance, 5), (vec![5, 6], 1));
        assert_eq!(receivers(&mut acceptance, 5), (vec![5, 6], 1));
        assert_eq!(receivers(&mut acceptance, 7), (vec![7, 8], 2));
        acceptance.forget();
        assert_eq!(receivers(&mut acceptance, 5), (vec![5, 6], 3));
        // Fills the cache with the maximum number of arbitration fields, and with more receivers than the
        // maximum.
        for _ in 0..40 {
            for id in 0..0x7FE {
                assert_eq!(receivers(&mut acceptance, id).0, [id, id + 1]);
            }
            acceptance.receivers.resize(ROOM + 1, 0);
        }
    }
}
