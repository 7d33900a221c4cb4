//! Checks the texts of a folder, because exports contain them in comments and strings of other languages.
//!
//! The author of a folder may be unknown, and users compile or run the exported files. A text must therefore
//! not end the comment or string that contains it, in any of these languages (D-821).

use super::FolderError;
use crate::plain_text::is_interpreted;
use std::path::Path;
use toml::Value;

/// Character sequences that are refused, because they begin or end comments and strings.
const REFUSED: [&str; 6] = ["*/", "/*", "*)", "(*", "\"", "\\"];

/// Checks all texts in a file of a folder. A file that is not TOML is refused by its reader.
///
/// # Errors
/// [`FolderError::Table`] with the line of the text.
pub(super) fn check(path: &Path, text: &str) -> Result<(), FolderError> {
    let Ok(table) = toml::from_str::<toml::Table>(text) else { return Ok(()) };
    let Some((found, why)) =
        table.iter().find_map(|(name, value)| refused(name).or_else(|| refused_in(value)))
    else {
        return Ok(());
    };
    Err(FolderError::Table { path: path.to_owned(), line: line_of(text, &found), what: why })
}

/// Returns the first text in a value that must be refused, and the reason.
fn refused_in(value: &Value) -> Option<(String, String)> {
    match value {
        Value::String(text) => refused(text),
        Value::Array(items) => items.iter().find_map(refused_in),
        Value::Table(table) => {
            table.iter().find_map(|(name, value)| refused(name).or_else(|| refused_in(value)))
        }
        _ => None,
    }
}

fn refused(text: &str) -> Option<(String, String)> {
    let what = match REFUSED.iter().find(|part| text.contains(**part)) {
        Some(part) => format!("a text contains `{part}`"),
        None if text.contains(is_interpreted) => "a text contains a control character".to_owned(),
        None => return None,
    };
    let why = format!(
        "{what}; texts of a folder are in comments and strings of exports, so they have no control characters and none of {}",
        REFUSED.join(" ")
    );
    Some((text.to_owned(), why))
}

/// Returns the number, from 1, of the line that contains the longest part of the text. Only parts without
/// escape sequences are searched, because the file contains them unchanged.
fn line_of(file: &str, text: &str) -> usize {
    let parts = text.split(|sign: char| sign.is_control() || matches!(sign, '"' | '\\'));
    let longest = parts.max_by_key(|part| part.len()).unwrap_or_default();
    file.lines().position(|line| line.contains(longest)).map_or(1, |line| line + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_cannot_leave_comments_and_strings() {
        let check = |text: &str| check(Path::new("f.toml"), text).map_err(|error| error.to_string());
        assert_eq!(check("title = 'a * b, (c) / d: 100 % {e} [f]'\n[[x]]\ny = ['\u{e4}']"), Ok(()));
        assert_eq!(check("no toml"), Ok(()));
        for text in [
            "'a */ b'",
            "'/* a'",
            "'a *)'",
            "'(* a'",
            "'\"\"\"'",
            "'a\\'",
            "\"a\\nb\"",
            "\"a\\u202Eb\"",
            "\"a\\u2028b\"",
            "\"\"\"a\nb\"\"\"",
        ] {
            for place in [format!("x = {text}"), format!("[[x]]\ny = [{{ z = {text} }}]")] {
                let refused = check(&place).unwrap_err();
                assert!(refused.contains("comments and strings of exports"), "{place}: {refused}");
            }
        }
        let refused = check("a = 1\nb = 'c d*/'\n").unwrap_err();
        assert!(refused.starts_with("f.toml:2: a text contains `*/`"), "{refused}");
        let refused = check("x = 1\nb = \"x\\\"\\nimport os\"\n").unwrap_err();
        assert!(refused.starts_with("f.toml:2: "), "{refused}");
        assert!(check("'a*/b' = 1").is_err());
    }
}
