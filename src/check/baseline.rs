//! The words that the firmware wrote last, for comparison with the cells of the image.

use crate::memory::{Block, Cell64, LINE, LineMarks, Segment};

/// Number of words of a line.
const LINE_WORDS: usize = LINE / size_of::<u64>();

/// Contents of consecutive words after the last run of the firmware.
///
/// If stores mark the lines of the memory segment, a word outside the marked lines is equal to its cell. So
/// [`Baseline::copy_marked`], which clears the marks, and [`Baseline::compare_marked`] access only the marked lines.
pub(crate) struct Baseline {
    blocks: Box<[Block]>,
    marks: Option<LineMarks>,
    /// Number of words before the first line with a mark. Lines that are only partly in the range have none, because the
    /// rest of the line may have another reader.
    unmarked: usize,
}

impl Baseline {
    /// Creates `words` words for the registers of a memory segment from `offset` on, all 0. `offset` is a multiple of the
    /// size of a word.
    pub(crate) fn new(segment: &Segment, offset: u32, words: usize) -> Self {
        let (first, end) = (offset as usize, offset as usize + words * size_of::<u64>());
        let first_line = first.next_multiple_of(LINE);
        Baseline {
            blocks: vec![Block::new([0; Block::WORDS]); words.div_ceil(Block::WORDS)].into(),
            marks: segment.line_marks(first_line..end / LINE * LINE),
            unmarked: (first_line - first) / size_of::<u64>(),
        }
    }

    /// Word number `index`; 0 after the last one.
    #[inline]
    pub(crate) fn word(&self, index: usize) -> u64 {
        self.blocks.get(index / Block::WORDS).map_or(0, |block| block.words()[index % Block::WORDS])
    }

    /// Returns the stored word, for changing it.
    #[inline]
    pub(crate) fn word_mut(&mut self, index: usize) -> Option<&mut u64> {
        Some(&mut self.blocks.get_mut(index / Block::WORDS)?.words_mut()[index % Block::WORDS])
    }

    /// Returns all words in the order of the block, followed by zeros up to its end.
    pub(crate) fn words(&self) -> impl Iterator<Item = &u64> {
        self.blocks.iter().flat_map(|block| block.words())
    }

    /// Returns all words, for changes to values that may differ from the cells.
    pub(crate) fn words_mut(&mut self) -> impl Iterator<Item = &mut u64> {
        self.marks.iter().for_each(LineMarks::mark_all);
        self.blocks.iter_mut().flat_map(|block| block.words_mut())
    }

    /// Stores the first words as they are now, one for each cell.
    #[inline]
    pub(crate) fn copy(&mut self, now: &[Cell64]) {
        let (now, rest) = now.as_chunks();
        let (left, last_block) = self.blocks.split_at_mut(now.len().min(self.blocks.len()));
        Block::load(left, now);
        for (left, now) in last_block.iter_mut().flat_map(|block| block.words_mut()).zip(rest) {
            *left = now.load();
        }
    }

    /// Does the same as [`Baseline::copy`], but reads only marked lines, and clears their marks.
    #[inline]
    pub(crate) fn copy_marked(&mut self, now: &[Cell64]) {
        let Some(marks) = LineMarks::complete(&self.marks) else { return self.copy(now) };
        let left = Block::words_of_mut(&mut self.blocks);
        let (before, left) = left.split_at_mut(self.unmarked.min(left.len()));
        let (lines, after) = left.as_chunks_mut::<LINE_WORDS>();
        let now = Lines::of(now, self.unmarked);
        load(before, now.before);
        marks.take(now.lines.len(), |line| load(&mut lines[line], &now.lines[line]));
        load(lines.get_mut(now.lines.len()).map_or(after, |line| line), now.after);
    }

    /// Collects the words that differ, with their present values; compares one word for each cell.
    #[inline]
    pub(crate) fn compare(&self, now: &[Cell64], changed: &mut Vec<(usize, u64)>) {
        let (now, rest) = now.as_chunks();
        let (left, last_block) = self.blocks.split_at(now.len().min(self.blocks.len()));
        let mut from = 0;
        while let Some(index) = Block::first_unlike(left, now, from) {
            collect(index * Block::WORDS, left[index].words(), &now[index], changed);
            from = index + 1;
        }
        if let Some(left) = last_block.first() {
            collect(now.len() * Block::WORDS, left.words(), rest, changed);
        }
    }

    /// Does the same as [`Baseline::compare`], but compares only marked lines.
    #[inline]
    pub(crate) fn compare_marked(&self, now: &[Cell64], changed: &mut Vec<(usize, u64)>) {
        let Some(marks) = LineMarks::complete(&self.marks) else { return self.compare(now, changed) };
        let left = Lines::of(Block::words_of(&self.blocks), self.unmarked);
        let cells = Lines::of(now, self.unmarked);
        collect(0, left.before, cells.before, changed);
        marks.each_marked(cells.lines.len(), |line| {
            let (left, now) = (&left.lines[line], &cells.lines[line]);
            if differing(left, now, &[u64::MAX; LINE_WORDS]) != 0 {
                collect(self.unmarked + line * LINE_WORDS, left, now, changed);
            }
        });
        let first = now.len() - cells.after.len();
        collect(first, left.following(&cells), cells.after, changed);
        #[cfg(test)]
        {
            let mut all = Vec::new();
            self.compare(now, &mut all);
            assert_eq!(*changed, all, "a store has no mark");
        }
    }

    /// True if any word differs in one of these bits. Compares only marked lines.
    #[inline]
    pub(crate) fn differs_in(&self, now: &[Cell64], watched: &[Block]) -> bool {
        let Some(marks) = LineMarks::complete(&self.marks) else {
            let (now, _) = now.as_chunks();
            return Block::differ_in(&self.blocks, now, watched);
        };
        let [left, watched] =
            [&self.blocks, watched].map(|blocks| Lines::of(Block::words_of(blocks), self.unmarked));
        let now = Lines::of(now, self.unmarked);
        let mut all = differing(left.before, now.before, watched.before);
        marks.each_marked(now.lines.len().min(watched.lines.len()), |line| {
            all |= differing(&left.lines[line], &now.lines[line], &watched.lines[line]);
        });
        (all | differing(left.following(&now), now.after, watched.following(&now))) != 0
    }
}

/// Consecutive words, divided into lines.
struct Lines<'a, T> {
    /// Words before the first line with a mark.
    before: &'a [T],
    lines: &'a [[T; LINE_WORDS]],
    /// Words after the last whole line.
    after: &'a [T],
}

impl<'a, T> Lines<'a, T> {
    /// Divides words. `unmarked` words are before the first line with a mark.
    #[inline]
    fn of(words: &'a [T], unmarked: usize) -> Self {
        let (before, words) = words.split_at(unmarked.min(words.len()));
        let (lines, after) = words.as_chunks();
        Lines { before, lines, after }
    }

    /// Returns the words in the place of `shorter.after`.
    #[inline]
    fn following<U>(&self, shorter: &Lines<'_, U>) -> &'a [T] {
        self.lines.get(shorter.lines.len()).map_or(self.after, |line| line)
    }
}

/// Loads the values of the cells, until the shorter slice ends.
#[inline]
fn load(left: &mut [u64], now: &[Cell64]) {
    left.iter_mut().zip(now).for_each(|(left, now)| *left = now.load());
}

/// Returns the differing bits of all words, of the bits in `watched`.
#[inline]
fn differing(left: &[u64], now: &[Cell64], watched: &[u64]) -> u64 {
    let words = left.iter().zip(now).zip(watched);
    words.fold(0, |all, ((left, now), watched)| all | (left ^ now.load()) & watched)
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
    use crate::memory::{HEADER_SIZE, View, Width};
    use proptest::collection::vec;
    use proptest::prelude::*;

    const AT: u32 = HEADER_SIZE as u32;
    const WORDS: usize = 40;

    /// Returns 40 cells, and two baselines of them: with marks and without. The cells begin in the middle of a line.
    fn baselines(shift: u32) -> (View<[Cell64; WORDS]>, [Baseline; 2]) {
        let segment = Segment::heap(2 * HEADER_SIZE);
        let cells = segment.view(AT + shift).unwrap();
        let marked = Baseline::new(&segment, AT + shift, WORDS);
        let other = Baseline::new(&segment, AT + shift, WORDS);
        assert!(cfg!(miri) || marked.marks.is_some() && other.marks.is_none());
        (cells, [marked, other])
    }

    #[test]
    fn every_word_is_compared_and_copied_for_any_length() {
        for (shift, of) in [(0, 0), (8, 0), (32, 0), (56, 0), (0, 1)] {
            for len in [0, 7, 16, 31, 32, 40] {
                let (cells, mut baselines) = baselines(shift);
                let left = &mut baselines[of];
                left.copy(&*cells);
                for place in 0..cells.len() {
                    cells[place].store(cells[place].load() ^ 1 << (place % 64));
                    let now = cells[place].load();
                    let mut changed = [Vec::new(), Vec::new()];
                    left.compare(&cells[..len], &mut changed[0]);
                    left.compare_marked(&cells[..len], &mut changed[1]);
                    let expected = if place < len { vec![(place, now)] } else { Vec::new() };
                    assert_eq!(changed, [expected.clone(), expected]);
                    if place % 2 == 0 {
                        left.copy(&cells[..len])
                    } else {
                        left.copy_marked(&cells[..len])
                    }
                    assert_eq!(left.word(place) == now, place < len);
                    *left.word_mut(place).unwrap() = now;
                }
                assert!(left.words().zip(&*cells).all(|(left, now)| *left == now.load()));
            }
        }
    }

    proptest! {
        #![proptest_config(crate::property_tests())]
        /// Random stores, comparisons and copies: a baseline with marks always equals one without them.
        #[test]
        fn marks_change_no_result(
            shift in (0..8_u32).prop_map(|words| 8 * words),
            acts in vec((0..6_u8, 0..WORDS, any::<u64>()), 1..200),
        ) {
            let (cells, mut both) = baselines(shift);
            let watched = [Block::new([0xFF00; Block::WORDS]); 3];
            for (act, place, value) in acts {
                let of = |baseline: &Baseline| {
                    let mut changed = Vec::new();
                    baseline.compare_marked(&cells[..place], &mut changed);
                    (changed, baseline.differs_in(&cells[..32], &watched), baseline.words().copied().collect::<Vec<_>>())
                };
                match act {
                    0 => both.iter_mut().for_each(|it| it.copy_marked(&cells[..place])),
                    1 => both.iter_mut().for_each(|it| it.copy(&cells[..place])),
                    2 => both.iter_mut().for_each(|it| it.words_mut().nth(place).into_iter().for_each(|left| *left = value)),
                    _ => cells[place].store(value),
                }
                let [marked, other] = both.each_ref().map(of);
                prop_assert_eq!(marked, other);
            }
        }
    }

    /// Each word contains registers of several widths, and other threads write them during the test. Only whole
    /// registers are stored and reported.
    #[test]
    fn no_register_is_torn() {
        const TURNS: usize = 20_000;
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
        let (mut left, mut changed) = (Baseline::new(&segment, AT, Block::WORDS), Vec::new());
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
