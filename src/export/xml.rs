//! A writer for indented XML.

use crate::xml_text;
use std::fmt::{Display, Write};

/// A document under construction.
pub(crate) struct Xml {
    text: String,
    depth: usize,
}

impl Xml {
    /// Begins an XML document with its declaration.
    pub(crate) fn new() -> Self {
        Self { text: "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n".to_owned(), depth: 0 }
    }

    /// Writes an element with text.
    pub(crate) fn leaf(&mut self, name: &str, text: impl Display) {
        let text = escape(&text.to_string());
        self.line(&format!("<{name}>{text}</{name}>"));
    }

    /// Writes an element with the content that `inside` writes. `attributes` are written unchanged.
    pub(crate) fn node(&mut self, name: &str, attributes: &str, inside: impl FnOnce(&mut Self)) {
        let blank = if attributes.is_empty() { "" } else { " " };
        self.line(&format!("<{name}{blank}{attributes}>"));
        self.depth += 1;
        inside(self);
        self.depth -= 1;
        self.line(&format!("</{name}>"));
    }

    /// Writes an XML comment.
    pub(crate) fn comment(&mut self, text: &str) {
        // An XML comment must not contain `--`. The first replacement changes only one pair in `---`, so a second one
        // follows.
        let text = text.replace("--", "- -").replace("--", "- -");
        self.line(&format!("<!-- {text} -->"));
    }

    /// Returns the text of the finished document.
    pub(crate) fn finish(self) -> String {
        xml_text::allowed(self.text)
    }

    fn line(&mut self, line: &str) {
        let _ = writeln!(self.text, "{:width$}{line}", "", width = 2 * self.depth);
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_ends_only_at_its_end() {
        for count in 2..9 {
            let mut xml = Xml::new();
            xml.comment(&format!("a{}> b", "-".repeat(count)));
            let text = xml.finish();
            assert_eq!(text.matches("--").count(), 2, "{text}");
            assert_eq!(text.matches("- ").count(), count, "{text}");
        }
    }

    #[test]
    fn elements_are_nested_and_text_is_escaped() {
        let mut xml = Xml::new();
        xml.node("a", "b=\"c\"", |xml| xml.leaf("d", "1 < 2 & 3\u{ffff}"));
        let lines: Vec<_> = xml.finish().lines().skip(1).map(str::to_owned).collect();
        assert_eq!(lines, ["<a b=\"c\">", "  <d>1 &lt; 2 &amp; 3\u{fffd}</d>", "</a>"]);
    }
}
