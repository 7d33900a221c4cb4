//! Numbers with nouns in singular or plural.

use core::fmt::Display;

/// Formats a number with a noun: `1 finding`, `2 findings`, `0 findings`.
pub(crate) fn plural(count: impl Into<u64>, what: impl Display) -> String {
    match count.into() {
        1 => format!("1 {what}"),
        count => format!("{count} {what}s"),
    }
}

/// Formats the length of a list with a noun: `1 device`, `3 devices`.
pub(crate) fn plural_of<T>(list: &[T], what: impl Display) -> String {
    plural(list.len() as u64, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_item_is_singular() {
        assert_eq!([0_u32, 1, 2].map(|count| plural(count, "hit")), ["0 hits", "1 hit", "2 hits"]);
        assert_eq!(plural_of(&["a"], "device"), "1 device");
    }
}
