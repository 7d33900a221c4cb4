//! The words that the firmware wrote last, for comparison with the cells of the image.

use crate::memory::{Block, Cell64};

/// Contents of consecutive words after the last run of the firmware.
pub(crate) struct Baseline(Box<[Block]>);

impl Baseline {
    /// Creates `words` words, all 0.
    pub(crate) fn new(words: usize) -> Self {
        Baseline(vec![Block::new([0; Block::WORDS]); words.div_ceil(Block::WORDS)].into())
    }

    /// Word number `index`; 0 after the last one.
    #[inline]
    pub(crate) fn word(&self, index: usize) -> u64 {
        self.0.get(index / Block::WORDS).map_or(0, |block| block.words()[index % Block::WORDS])
    }

    /// Returns the stored word, for changing it.
    #[inline]
    pub(crate) fn word_mut(&mut self, index: usize) -> Option<&mut u64> {
        Some(&mut self.0.get_mut(index / Block::WORDS)?.words_mut()[index % Block::WORDS])
    }

    /// Returns all words in the order of the block, followed by zeros up to its end.
    pub(crate) fn words(&self) -> impl Iterator<Item = &u64> {
        self.0.iter().flat_map(|block| block.words())
    }

    /// Returns all words, for changes.
    pub(crate) fn words_mut(&mut self) -> impl Iterator<Item = &mut u64> {
        self.0.iter_mut().flat_map(|block| block.words_mut())
    }

    /// Stores the first words as they are now, one for each cell.
    #[inline]
    pub(crate) fn copy(&mut self, now: &[Cell64]) {
        let (now, rest) = now.as_chunks();
        let (left, last_block) = self.0.split_at_mut(now.len().min(self.0.len()));
        Block::load(left, now);
        for (left, now) in last_block.iter_mut().flat_map(|block| block.words_mut()).zip(rest) {
            *left = now.load();
        }
    }

    /// Collects the words that differ, with their present values; compares one word for each cell.
    #[inline]
    pub(crate) fn compare(&self, now: &[Cell64], changed: &mut Vec<(usize, u64)>) {
        let (now, rest) = now.as_chunks();
        let (left, last_block) = self.0.split_at(now.len().min(self.0.len()));
        let mut from = 0;
        while let Some(index) = Block::first_unlike(left, now, from) {
            collect(index * Block::WORDS, left[index].words(), &now[index], changed);
            from = index + 1;
        }
        if let Some(left) = last_block.first() {
            collect(now.len() * Block::WORDS, left.words(), rest, changed);
        }
    }

    /// True if any word differs in one of these bits.
    #[inline]
    pub(crate) fn differs_in(&self, now: &[Cell64], watched: &[Block]) -> bool {
        let (now, _) = now.as_chunks();
        Block::differ_in(&self.0, now, watched)
    }
}

/// Adds the words that differ. `first` is the index of the first word.
#[inline]
fn collect(first: usize, left: &[u64], now: &[Cell64], changed: &mut Vec<(usize, u64)>) {
    let words = now.iter().map(Cell64::load).zip(left).enumerate();
    changed.extend(words.filter_map(|(index, (now, left))| (now != *left).then_some((first + index, now))));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::{HEADER_SIZE, Segment, Width};
    use zerocopy::FromZeros;

    #[test]
    fn every_word_is_compared_and_copied_for_any_length() {
        let cells = <[Cell64; 40]>::new_zeroed();
        for len in [0, 7, 16, 31, 32, 40] {
            let mut left = Baseline::new(40);
            left.copy(&cells);
            for place in 0..cells.len() {
                cells[place].store(cells[place].load() ^ 1 << (place % 64));
                let now = cells[place].load();
                let mut changed = Vec::new();
                left.compare(&cells[..len], &mut changed);
                assert_eq!(changed, if place < len { vec![(place, now)] } else { Vec::new() });
                left.copy(&cells[..len]);
                assert_eq!(left.word(place) == now, place < len);
                *left.word_mut(place).unwrap() = now;
            }
            assert!(left.words().zip(&cells).all(|(left, now)| *left == now.load()));
        }
    }
    /// Each word contains registers of several widths, and other threads write them during the test. Only whole
    /// registers are stored and reported.
    #[test]
    fn no_register_is_torn() {
        const TURNS: usize = 20_000;
        const AT: u32 = HEADER_SIZE as u32;
        let segment = Segment::heap(2 * HEADER_SIZE);
        let registers = [
            (0, Width::Dword, [0x1111_1111, 0xEEEE_EEEE_u32]),
            (4, Width::Word, [0x2222, 0xDDDD]),
            (6, Width::Byte, [0x33, 0xCC]),
            (7, Width::Byte, [0x44, 0xBB]),
        ];
        let is_whole = |word: u64| {
            registers.iter().all(|(offset, width, values)| {
                let held = word >> (8 * offset) & u64::from(u32::MAX >> (32 - 8 * width.bytes()));
                values.iter().any(|value| u64::from(*value) == held)
            })
        };
        let places: Vec<_> = (0..Block::WORDS as u32).map(|word| AT + 8 * word).collect();
        let store = |turn: usize, (offset, width, values): (u32, Width, [u32; 2])| {
            places.iter().for_each(|place| segment.store(place + offset, width, values[turn % 2]).unwrap());
        };
        registers.into_iter().for_each(|register| store(0, register));
        let cells = segment.view::<[Cell64; Block::WORDS]>(AT).unwrap();
        let (mut left, mut changed) = (Baseline::new(Block::WORDS), Vec::new());
        std::thread::scope(|scope| {
            let store = &store;
            let writers = registers.map(|register| {
                scope.spawn(move || (0..TURNS / Block::WORDS).for_each(|turn| store(turn, register)))
            });
            while !writers.iter().all(|writer| writer.is_finished()) {
                left.copy(&*cells);
                left.compare(&*cells, &mut changed);
                let seen = left.words().copied().chain(changed.drain(..).map(|(_, now)| now));
                seen.for_each(|word| assert!(is_whole(word), "{word:X}"));
            }
        });
    }
}
