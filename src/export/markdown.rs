//! Escapes texts for Markdown, so that a reader sees each character as it is (D-799).

/// Converts a text so that Markdown shows its characters. Code between single backquotes stays code. The result has no HTML, no link, no
/// emphasis, and no command of a program that expands templates in Markdown, such as mdbook, Jekyll or pandoc.
pub(crate) fn text(text: &str) -> String {
    let parts: Vec<_> = text.split('`').collect();
    // The text is split at backquotes, so the parts with odd numbers are code. A part with a backslash or brace cannot
    // be code, because Markdown has no escapes within code.
    let is_code = |part: &&str| !part.is_empty() && !part.contains(['\\', '{', '\n']);
    let has_code = parts.len() % 2 == 1 && parts.iter().skip(1).step_by(2).all(is_code);
    // In Markdown, two adjacent backquotes begin another form of code.
    let has_adjacent = text.contains("``");
    if !has_code || has_adjacent {
        return plain(text);
    }
    let converted = |(number, part): (usize, &&str)| {
        if number % 2 == 1 { format!("`{part}`") } else { plain(part) }
    };
    parts.iter().enumerate().map(converted).collect()
}

/// Converts a text at the beginning of a paragraph. There, more characters are markup than in the middle of a
/// paragraph.
pub(crate) fn paragraph(of: &str) -> String {
    let text = text(of.trim_start());
    let digits = text.trim_start_matches(|sign: char| sign.is_ascii_digit());
    if text.starts_with(['#', '>', '+', '-', '=', ':', '|', '[']) {
        format!("\\{text}")
    } else if digits.len() < text.len() && is_number_of_list(digits) {
        format!("{}\\{digits}", &text[..text.len() - digits.len()])
    } else {
        text
    }
}

/// True if the text after a number makes this number the number of a list item.
fn is_number_of_list(rest: &str) -> bool {
    rest.strip_prefix(['.', ')']).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
}

/// Converts a text without code. Entities are safer than backslashes where a program reads the page before Markdown does.
fn plain(text: &str) -> String {
    let mut out = String::new();
    let mut last = ' ';
    let mut signs = text.chars().peekable();
    while let Some(sign) = signs.next() {
        let next = signs.peek().copied().unwrap_or(' ');
        match sign {
            '<' => out.push_str("&lt;"),
            '`' => out.push_str("&#96;"),
            '{' => out.push_str("&#123;"),
            '&' if next.is_ascii_alphanumeric() || next == '#' => out.push_str("&amp;"),
            '\\' if next.is_ascii_punctuation() || next == ' ' => out.push_str("&#92;"),
            ']' if matches!(next, '(' | ':') => out.push_str("\\]"),
            '*' | '~' => out.extend(['\\', sign]),
            // An underscore within a word is no markup.
            '_' if !(last.is_alphanumeric() && next.is_alphanumeric()) => out.push_str("\\_"),
            _ => out.push(sign),
        }
        last = sign;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulldown_cmark::{Event, Options, Parser};

    /// Returns the text that a reader sees, and panics at markup other than code.
    fn shown(markdown: &str) -> String {
        let extensions = Options::ENABLE_TABLES | Options::ENABLE_STRIKETHROUGH | Options::ENABLE_FOOTNOTES;
        let parser = Parser::new_ext(markdown, extensions | Options::ENABLE_HEADING_ATTRIBUTES);
        let mut shown = String::new();
        for event in parser {
            match event {
                Event::Text(text) | Event::Code(text) => shown.push_str(&text),
                Event::Start(pulldown_cmark::Tag::Paragraph) | Event::End(_) => {}
                other => panic!("{markdown}: {other:?}"),
            }
        }
        shown
    }

    const HOSTILE: [&str; 23] = [
        "<script>alert(1)</script>",
        "<img src=x onerror=alert(1)>",
        "<!-- a",
        "<https://a.b>",
        "[a](javascript:alert(1))",
        "![a](https://a.b/c.png)",
        "[a]: javascript:alert(1)",
        "[a][a]",
        "[`a]: b` c",
        "&lt;b&gt; &#60; R&D",
        "*a* **b** _c_ __d__ ~~e~~ a_b_c _NODE_INIT",
        "a \\<b> \\` c \\",
        "`<b>",
        "``<b>``",
        "`a``<b>`",
        "`a` <b> `",
        "`a\\` <b> `c`",
        "a | b",
        "# a",
        "- a",
        "12. a",
        "> a",
        "{{#include /etc/passwd}} {{{#include a}}} {% include a %} `{{#include a}}`",
    ];

    #[test]
    fn readers_see_the_characters_of_the_text() {
        for hostile in HOSTILE {
            let markdown = paragraph(hostile);
            let hostile = if markdown.contains('`') { hostile.replace('`', "") } else { hostile.to_owned() };
            assert_eq!(shown(&markdown), hostile, "{markdown}");
            // Programs that expand templates do not read Markdown.
            assert!(!markdown.contains("{{") && !markdown.contains("{%"), "{markdown}");
        }
    }

    #[test]
    fn code_stays_code() {
        for (plain, markdown) in
            [("`a < b` counts", "`a < b` counts"), ("see `a`, `b_`, <c>", "see `a`, `b_`, &lt;c>")]
        {
            assert_eq!(text(plain), markdown);
            assert_eq!(shown(&text(plain)), plain.replace('`', ""));
        }
    }

    proptest::proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn any_text_is_shown_as_it_is(text in "[a-c<>`\\\\*_~{}&;#!\\[\\]():|=+0-9.-]([a-c <>`\\\\*_~{}&;#!\\[\\]():|=+0-9.-]{0,12}[a-c<>`_])?") {
            let markdown = paragraph(&text);
            // Code has no backquotes, and no blanks beside them.
            let without_code = |text: &str| text.replace(['`', ' '], "");
            proptest::prop_assert_eq!(without_code(&shown(&markdown)), without_code(&text), "{}", markdown);
        }
    }
}
