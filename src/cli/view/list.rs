//! A list on the screen: the chosen line and the visible lines.

/// The chosen line and the topmost visible line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct List {
    /// Index of the chosen line.
    pub chosen: usize,
    /// The topmost line on the screen.
    pub top: usize,
    /// Number of lines that were visible when the list was last drawn.
    pub height: usize,
    /// True if the last line is selected and stays selected: when lines are added, the selection moves to the new last
    /// line.
    pub stays: bool,
}

impl List {
    /// Moves the selection by a number of lines in a list of `len` lines.
    pub(super) fn go(&mut self, by: isize, len: usize) {
        self.stays = false;
        self.choose(self.chosen.saturating_add_signed(by), len);
    }

    /// Moves the selection a page up (-1) or down (1).
    pub(super) fn page(&mut self, pages: isize, len: usize) {
        let lines = self.height.saturating_sub(1).max(1) as isize;
        self.go(pages * lines, len);
    }

    /// Selects a line; a number beyond the last line selects the last line.
    pub(super) fn choose(&mut self, line: usize, len: usize) {
        self.chosen = line.min(len.saturating_sub(1));
    }

    /// Selects the last line, and keeps the selection at the end of the list.
    pub(super) fn last(&mut self, len: usize) {
        self.choose(usize::MAX, len);
        self.stays = true;
    }

    /// Sets the height and returns the range of visible lines.
    pub(super) fn fit(&mut self, height: usize, len: usize) -> core::ops::Range<usize> {
        self.height = height;
        let line = if self.stays { usize::MAX } else { self.chosen };
        self.choose(line, len);
        if height == 0 {
            return 0..0;
        }
        let lowest = (self.chosen + 1).saturating_sub(height);
        self.top = self.top.clamp(lowest, self.chosen.max(lowest)).min(len.saturating_sub(height));
        self.top..(self.top + height).min(len)
    }

    /// Returns the range of lines that were visible when the list was last drawn.
    pub(super) fn seen(&self, len: usize) -> core::ops::Range<usize> {
        let end = (self.top + self.height).min(len);
        self.top.min(end)..end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chosen_line_is_visible() {
        let mut list = List::default();
        assert_eq!(list.fit(3, 10), 0..3);
        list.go(4, 10);
        assert_eq!(list.fit(3, 10), 2..5);
        list.go(-1, 10);
        assert_eq!(list.fit(3, 10), 2..5);
        list.page(-1, 10);
        assert_eq!((list.fit(3, 10), list.chosen), (1..4, 1));
        list.go(99, 10);
        assert_eq!((list.fit(3, 10), list.chosen), (7..10, 9));
        assert_eq!((list.fit(3, 2), list.chosen), (0..2, 1));
        assert_eq!((list.fit(3, 0), list.chosen), (0..0, 0));
        assert_eq!(list.fit(0, 5), 0..0);
    }

    #[test]
    fn the_list_stays_at_its_end_after_choosing_the_last_line() {
        let mut list = List::default();
        list.last(5);
        assert_eq!(list.fit(3, 8), 5..8);
        list.go(-1, 8);
        assert_eq!((list.fit(3, 20), list.chosen), (5..8, 6));
    }
}
