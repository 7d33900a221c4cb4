//! Finds spellings of PLC languages in a line of a script, and the right spelling. Scenarios and the scripts
//! of devices use it.

/// Words of other languages, each with the correct word.
const WORDS: &[(&str, &str)] = &[
    ("TRUE", "true"),
    ("FALSE", "false"),
    ("AND", "&&"),
    ("OR", "||"),
    ("NOT", "!"),
    ("XOR", "^"),
    ("MOD", "%"),
    ("IF", "if condition { ... }"),
    ("THEN", "if condition { ... }"),
    ("ELSIF", "else if condition { ... }"),
    ("END_IF", "}"),
    ("FOR", "for n in 0..3 { ... }"),
    ("WHILE", "while condition { ... }"),
    ("END_FOR", "}"),
    ("END_WHILE", "}"),
    ("VAR", "let name = value;"),
];

/// The names that the scripts of a kind may use.
pub(crate) struct Dialect<'a> {
    /// The call that changes a register. The hint for `:=` names it.
    pub(crate) store: &'a str,
    /// True if a word is the name or the address of a register. Scripts write such a word as a text, in
    /// quotes.
    pub(crate) is_register: &'a dyn Fn(&str) -> bool,
    /// True if a word is a verb.
    pub(crate) is_verb: &'a dyn Fn(&str) -> bool,
}

impl Dialect<'_> {
    /// Finds the first spelling of another language in a line, and returns a text with the right spelling.
    /// `None` if the line has none.
    pub(crate) fn mistake(&self, line: &str) -> Option<String> {
        let code = code(line);
        let words = words(&code);
        let wrong = |word: &str, right: &str| Some(format!("`{word}`: write {right}"));
        for (at, word) in &words {
            let next = code[at + word.len()..].trim_start();
            if let Some(right) = number(word).or_else(|| time(word)) {
                return wrong(word, &right);
            }
            // A blank separates the number from its unit.
            let unit: String = next.chars().take_while(char::is_ascii_alphabetic).collect();
            if word.bytes().all(|digit| digit.is_ascii_digit() || digit == b'.') && is_unit(&unit) {
                return wrong(&format!("{word} {unit}"), &format!("a time as a text, \"{word}{unit}\""));
            }
            if let Some((_, right)) = WORDS.iter().find(|(known, _)| known == word) {
                return wrong(word, &format!("`{right}`"));
            }
            let begins = word.starts_with(|sign: char| sign == '%' || sign.is_ascii_alphabetic());
            let may_be_register = begins && word.len() > 3 && (word.contains('.') || word.contains('_'));
            if may_be_register && (self.is_register)(word) {
                return wrong(word, &format!("a register as a text, \"{word}\""));
            }
            if *at == code.len() - code.trim_start().len() && next.starts_with('"') && (self.is_verb)(word) {
                return wrong(word, &format!("the arguments in parentheses, {word}(...)"));
            }
        }
        if let Some(text) = single_quoted(&code) {
            return wrong(&format!("'{text}'"), &format!("a text in double quotes, \"{text}\""));
        }
        if code.contains(":=") {
            return wrong(":=", &format!("`=` for a variable, and {} for a register", self.store));
        }
        code.contains("<>").then(|| "`<>`: write `!=`".to_owned())
    }
}

/// Returns the line with blanks in place of its comment and of the content of its texts. The quotes stay.
fn code(line: &str) -> String {
    let (mut code, mut in_text, mut last) = (String::with_capacity(line.len()), false, ' ');
    for (at, sign) in line.char_indices() {
        let rest = &line[at..];
        if !in_text && (rest.starts_with("//") || rest.starts_with("/*") && !rest.contains("*/")) {
            break;
        }
        let is_quote = sign == '"' && last != '\\';
        in_text ^= is_quote;
        // Each character is replaced by as many blanks as it has bytes, so that positions in the result and
        // in the line agree.
        match in_text && !is_quote {
            true => code.extend(std::iter::repeat_n(' ', sign.len_utf8())),
            false => code.push(sign),
        }
        last = sign;
    }
    code
}

/// Returns the words of the code with their places; a word is a name, a number or an address with all its parts.
fn words(code: &str) -> Vec<(usize, &str)> {
    let is_part =
        |sign: char| sign.is_ascii_alphanumeric() || matches!(sign, '_' | '#' | '.' | '%' | '[' | ']');
    let mut words = Vec::new();
    let mut rest = code;
    while let Some(begin) = rest.find(is_part) {
        let word = &rest[begin..];
        let end = word.find(|sign| !is_part(sign)).unwrap_or(word.len());
        words.push((code.len() - word.len(), &word[..end]));
        rest = &word[end..];
    }
    words
}

/// Returns the correct spelling of a number that begins with its base, such as `16#43`.
fn number(word: &str) -> Option<String> {
    let (base, digits) = word.split_once('#')?;
    let prefix = match base {
        "16" => "0x",
        "8" => "0o",
        "2" => "0b",
        _ => return None,
    };
    Some(format!("{prefix}{digits}, or the text \"{word}\""))
}

/// Returns the right spelling of a time.
fn time(word: &str) -> Option<String> {
    let time = ["T#", "t#", "TIME#"].iter().find_map(|front| word.strip_prefix(front)).unwrap_or(word);
    let unit = time.trim_start_matches(|sign: char| sign.is_ascii_digit() || sign == '.');
    (unit.len() < time.len() && is_unit(unit)).then(|| format!("a time as a text, \"{time}\""))
}

fn is_unit(text: &str) -> bool {
    matches!(text, "us" | "ms" | "s" | "min" | "h")
}

/// Returns the first text of several characters between single quotes.
fn single_quoted(code: &str) -> Option<&str> {
    let mut parts = code.split('\'').skip(1).step_by(2);
    parts.find(|text| text.chars().count() > 1 && !text.starts_with('\\'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mistake(line: &str) -> Option<String> {
        let is_register = |word: &str| word.starts_with("node2.w_") || word.starts_with("%MW3");
        let store = "poke(\"register\", value)";
        Dialect { store, is_register: &is_register, is_verb: &|word| word == "poke" }.mistake(line)
    }

    #[test]
    fn spellings_of_plc_languages_are_named_with_the_right_ones() {
        for (line, expected) in [
            ("poke(\"node2.w_CPU_CONTROL\", 16#0001);", "`16#0001`: write 0x0001, or the text \"16#0001\""),
            ("let x = 2#1010;", "`2#1010`: write 0b1010, or the text \"2#1010\""),
            ("step(1ms);", "`1ms`: write a time as a text, \"1ms\""),
            ("step(1.5 s)", "`1.5 s`: write a time as a text, \"1.5s\""),
            ("step(T#10ms);", "`T#10ms`: write a time as a text, \"10ms\""),
            (
                "poke(node2.w_CPU_CONTROL, 1);",
                "`node2.w_CPU_CONTROL`: write a register as a text, \"node2.w_CPU_CONTROL\"",
            ),
            ("poke(%MW3.200000, 1);", "`%MW3.200000`: write a register as a text, \"%MW3.200000\""),
            ("poke('node2.x', 1);", "`'node2.x'`: write a text in double quotes, \"node2.x\""),
            ("x := 1;", "`:=`: write `=` for a variable, and poke(\"register\", value) for a register"),
            ("poke \"x\", 1;", "`poke`: write the arguments in parentheses, poke(...)"),
            ("if x <> y {", "`<>`: write `!=`"),
            ("if x AND y {", "`AND`: write `&&`"),
        ] {
            assert_eq!(mistake(line).as_deref(), Some(expected), "{line}");
        }
    }

    #[test]
    fn right_lines_have_none() {
        for line in [
            "poke(\"node2.w_CPU_CONTROL\", \"16#0001\"); // 16#1 in 1ms",
            "let c = 'x'; let d = '\\n';",
            "wait(\"node2.w_OPTION_STATUS\", 0x43, \"10ms\");",
            "let t = 1.5; frames[0].id",
            "print(\"größe := \\\"1ms\\\"\")",
        ] {
            assert_eq!(mistake(line), None, "{line}");
        }
    }
}
