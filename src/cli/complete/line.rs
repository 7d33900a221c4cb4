//! The words of the command line that precede the word to complete.
//!
//! The words come from the arguments of this process, because a shell calls it as `commram -- WORDS`. Bash splits words
//! at `:` and `=`, other shells do not. [`whole`] joins the parts again.

use core::cell::RefCell;
use std::ffi::{OsStr, OsString};

/// True if the word is a character at which bash splits.
fn is_sign(word: &OsStr) -> bool {
    word.to_str().is_some_and(|word| !word.is_empty() && word.bytes().all(|byte| matches!(byte, b'=' | b':')))
}

/// Returns the words of a command line as they were typed. Bash splits words at `=` and `:` and makes the
/// separators separate words.
pub(crate) fn whole(words: &[OsString]) -> Vec<OsString> {
    let mut all: Vec<OsString> = Vec::new();
    let mut follows_sign = false;
    for word in words {
        match all.last_mut() {
            Some(last) if follows_sign || is_sign(word) => last.push(word),
            _ => all.push(word.clone()),
        }
        follows_sign = is_sign(word);
    }
    all
}

/// Returns the beginning of the last word that bash does not replace: the text before the part under the cursor.
pub(crate) fn front_of_last(words: &[OsString]) -> OsString {
    let end = match words.split_last() {
        Some((last, rest)) if !is_sign(last) && rest.last().is_some_and(|word| is_sign(word)) => rest,
        Some((last, _)) if is_sign(last) => words,
        _ => return OsString::new(),
    };
    whole(end).pop().unwrap_or_default()
}

thread_local! {
    /// The words of a line that this program has read itself, for example in its shell. The last word is the one to
    /// complete.
    static LINE: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Runs `complete` for the last of these words of a command line; the first word is the name of this program.
pub(crate) fn within<T>(words: &[String], complete: impl FnOnce() -> T) -> T {
    LINE.set(Some(words.to_vec()));
    let found = complete();
    LINE.set(None);
    found
}

/// Returns the words of the command line.
pub(super) fn words() -> Vec<String> {
    if let Some(words) = LINE.with_borrow(Clone::clone) {
        return words;
    }
    let words: Vec<_> = std::env::args_os().skip_while(|word| word != "--").skip(1).collect();
    whole(&words).into_iter().map(|word| word.to_string_lossy().into_owned()).collect()
}

/// Returns the value of an option that has one of these names on the command line.
pub(super) fn option(names: &[&str]) -> Option<String> {
    let words = words();
    let mut words = words.iter().map(String::as_str);
    while let Some(word) = words.next() {
        for name in names {
            let given = match word.strip_prefix(name) {
                Some("") => words.next(),
                Some(value) if name.starts_with("--") => value.strip_prefix('='),
                other => other,
            };
            if let Some(given) = given {
                return Some(given.to_owned());
            }
        }
    }
    None
}

/// Returns the instance that the command line names, otherwise the default instance.
pub(super) fn instance() -> String {
    option(&["-i", "--instance"]).unwrap_or_else(crate::cli::InstanceName::usual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_bash_has_split_are_joined_again() {
        let of = |words: &[&str]| words.iter().map(OsString::from).collect::<Vec<_>>();
        for (broken, typed, front) in [
            (&["poke", "a.b", "=", "re"][..], &["poke", "a.b=re"][..], "a.b="),
            (&["poke", "a.b", "="], &["poke", "a.b="], "a.b="),
            (&["wait", "line", ":", "a.b", "==", "7"], &["wait", "line:a.b==7"], "line:a.b=="),
            (&["poke", "line", ":"], &["poke", "line:"], "line:"),
            (&["poke", "a=1", ""], &["poke", "a=1", ""], ""),
            (&["poke", "a", "=", "1", "b"], &["poke", "a=1", "b"], ""),
            (&["poke", "a.b=re"], &["poke", "a.b=re"], ""),
        ] {
            assert_eq!(whole(&of(broken)), of(typed), "{broken:?}");
            assert_eq!(front_of_last(&of(broken)), front, "{broken:?}");
        }
    }
}
