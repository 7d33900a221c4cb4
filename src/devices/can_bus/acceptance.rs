//! Who takes a frame, so that the filters of all stations are asked once for each kind of frame, and not for each frame.

use crate::can::Frame;

/// How many kinds of frames are remembered at a time; a power of two.
const KINDS: usize = 4096;
/// How many takers are, at most, before all is forgotten.
const ROOM: usize = 1 << 16;

/// Those that take frames of one arbitration field, as a piece of the list of takers.
#[derive(Clone, Copy, Default)]
struct Known {
    field: u32,
    first: u32,
    count: u32,
    /// In which generation of filters this was so.
    generation: u64,
}

/// What has been found out about filters since they were last set.
pub(super) struct Acceptance {
    known: Vec<Known>,
    takers: Vec<u16>,
    generation: u64,
}

impl Acceptance {
    pub(super) fn new() -> Self {
        Acceptance { known: Vec::new(), takers: Vec::new(), generation: 1 }
    }

    /// Filters have changed, or stations have come.
    pub(super) fn forget(&mut self) {
        self.generation += 1;
        self.takers.clear();
    }

    /// Who takes this frame, in their order; `accepting` tells it if it is not known.
    pub(super) fn takers<I: Iterator<Item = u16>>(
        &mut self,
        frame: &Frame,
        accepting: impl FnOnce() -> I,
    ) -> &[u16] {
        if self.known.is_empty() {
            self.known = vec![Known::default(); KINDS];
        }
        let (field, ..) = frame.numbers();
        let place = field.wrapping_mul(0x9E37_79B1) as usize / (1 << 20) % KINDS;
        if self.known[place].generation != self.generation || self.known[place].field != field {
            if self.takers.len() > ROOM {
                self.forget();
            }
            let first = self.takers.len();
            self.takers.extend(accepting());
            let count = (self.takers.len() - first) as u32;
            self.known[place] = Known { field, first: first as u32, count, generation: self.generation };
        }
        let Known { first, count, .. } = self.known[place];
        &self.takers[first as usize..][..count as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::Payload;

    #[test]
    fn it_asks_once_and_again_when_filters_have_changed() {
        let mut acceptance = Acceptance::new();
        let mut asked = 0;
        let mut takers = |acceptance: &mut Acceptance, id: u16| {
            let found = acceptance.takers(&Frame::standard(id, Payload::EMPTY), || {
                asked += 1;
                [id, id + 1].into_iter()
            });
            let found = found.to_vec();
            (found, asked)
        };
        assert_eq!(takers(&mut acceptance, 5), (vec![5, 6], 1));
        assert_eq!(takers(&mut acceptance, 5), (vec![5, 6], 1));
        assert_eq!(takers(&mut acceptance, 7), (vec![7, 8], 2));
        acceptance.forget();
        assert_eq!(takers(&mut acceptance, 5), (vec![5, 6], 3));
        // As many kinds as there are, and more takers than it remembers.
        for _ in 0..40 {
            for id in 0..0x7FE {
                assert_eq!(takers(&mut acceptance, id).0, [id, id + 1]);
            }
            acceptance.takers.resize(ROOM + 1, 0);
        }
    }
}
