//! Function blocks in IEC Structured Text. Several devices share one text. Marked words in the text are
//! replaced by the words of each device.

/// A part of a device's function blocks in Structured Text.
#[derive(Clone, Copy, Debug)]
pub struct StPart {
    /// Source text of the block. `@WORD@` marks a part that differs between devices or blocks.
    pub text: &'static str,
    /// The replacement of each word.
    pub words: &'static [(&'static str, &'static str)],
}

impl StPart {
    /// Returns the text with all words replaced.
    #[must_use]
    pub fn written_out(&self) -> String {
        let put_in =
            |text: String, (word, meaning): &(&str, &str)| text.replace(&format!("@{word}@"), meaning);
        self.words.iter().fold(self.text.to_owned(), put_in)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_put_in() {
        let part = StPart { text: "A_@ROLE@ : @BASE@; B_@ROLE@", words: &[("ROLE", "MA"), ("BASE", "NODE")] };
        assert_eq!(part.written_out(), "A_MA : NODE; B_MA");
    }
}
