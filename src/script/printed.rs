//! The lines that a scenario prints.

use super::complaint::in_words;

/// Maximum count of bytes that are kept.
pub(super) const MOST: usize = 1 << 20;

/// The lines that a script has printed, up to [`MOST`] bytes. Each line is also passed on immediately.
pub(super) struct Printed {
    text: String,
    is_cut: bool,
    receiver: Box<dyn FnMut(&str)>,
}

impl Printed {
    /// Creates the receiver of printed lines; `receiver` gets each line with its line end.
    pub(crate) fn new(receiver: impl FnMut(&str) + 'static) -> Self {
        Self { text: String::new(), is_cut: false, receiver: Box::new(receiver) }
    }

    /// Takes a line, or the beginning of the first line that exceeds the limit.
    pub(crate) fn line(&mut self, line: &str) {
        if self.is_cut {
            return;
        }
        let line = &*in_words(line);
        let start = self.text.len();
        let space = MOST.saturating_sub(start);
        if line.len() < space {
            self.text.push_str(line);
        } else {
            self.is_cut = true;
            self.text.push_str(&line[..line.floor_char_boundary(space)]);
            self.text.push_str(&format!(
                "\n(cut here: the first {} MiB of a scenario's output are kept)",
                MOST >> 20
            ));
        }
        self.text.push('\n');
        (self.receiver)(&self.text[start..]);
    }

    /// Takes all kept lines.
    pub(crate) fn take(&mut self) -> String {
        core::mem::take(&mut self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::RefCell;
    use std::rc::Rc;

    #[test]
    fn endless_output_is_cut_and_says_so() {
        let handed_on = Rc::new(RefCell::new(String::new()));
        let copy = Rc::clone(&handed_on);
        let mut printed = Printed::new(move |line| copy.borrow_mut().push_str(line));
        // Each character has two bytes, and a line with its end has an odd number of bytes. So the limit is
        // within a character.
        let line = "ü".repeat(300_000);
        printed.line("first");
        for _ in 0..3 {
            printed.line(&line);
        }
        let text = printed.take();
        assert!(text.starts_with("first\nüü"));
        assert!(text.ends_with("üü\n(cut here: the first 1 MiB of a scenario's output are kept)\n"));
        assert!(text.len() < MOST + 100, "{}", text.len());
        assert_eq!(*handed_on.borrow(), text);
    }
}
