//! Suggestions for misspelt names.

/// Up to three of `names` that differ least from `wanted`; none that differ in more than a third.
pub(super) fn nearest<'a>(wanted: &str, names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let limit = (wanted.len() / 3).max(2);
    let mut near: Vec<_> =
        names.map(|name| (distance(wanted, name), name)).filter(|(d, _)| *d <= limit).collect();
    near.sort();
    near.into_iter().take(3).map(|(_, name)| name).collect()
}

/// Edits (insert, delete, replace) that turn `a` into `b`; case does not count.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<u8> = b.bytes().map(|c| c.to_ascii_lowercase()).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, a) in a.bytes().map(|c| c.to_ascii_lowercase()).enumerate() {
        let mut left_above = i;
        let mut left = i + 1;
        for (above, b) in row.iter_mut().skip(1).zip(&b) {
            let here = (left_above + usize::from(a != *b)).min(left + 1).min(*above + 1);
            left_above = *above;
            *above = here;
            left = here;
        }
        if let Some(first) = row.first_mut() {
            *first = i + 1;
        }
    }
    row.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_counts_edits() {
        assert_eq!(distance("w_CPU_CONTROL", "w_cpu_control"), 0);
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("abc", ""), 3);
    }

    #[test]
    fn only_similar_names_are_suggested() {
        let names = ["w_CPU_CONTROL", "w_CONTROLWORD", "b_AC"];
        assert_eq!(nearest("w_CPU_CONTRL", names.into_iter()), ["w_CPU_CONTROL"]);
        assert!(nearest("zzzz", names.into_iter()).is_empty());
    }
}
