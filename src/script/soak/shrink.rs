//! Reduces a list of items to the few items that are needed for a failure.

/// Returns a short list of these items, in their order, for which `fails` is still true. Calls `fails` at most `tries`
/// times.
///
/// Removes parts of half, a quarter and so on of the items, as long as the remaining items still fail (Zeller and
/// Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002).
pub(crate) fn shrink<T: Clone>(items: &[T], tries: usize, mut fails: impl FnMut(&[T]) -> bool) -> Vec<T> {
    let mut kept = items.to_vec();
    let mut part = kept.len().div_ceil(2);
    let mut tries = tries;
    while part > 0 && !kept.is_empty() {
        let before = kept.len();
        let mut at = 0;
        while at < kept.len() && tries > 0 {
            tries -= 1;
            let rest: Vec<T> = kept.iter().take(at).chain(kept.iter().skip(at + part)).cloned().collect();
            if fails(&rest) {
                kept = rest;
            } else {
                at += part;
            }
        }
        if tries == 0 {
            break;
        }
        // When the parts are single items, the loop runs again until it removes nothing: an item may have been
        // necessary only for another item that is now removed.
        part = if part == 1 && kept.len() == before { 0 } else { (part / 2).max(1) };
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::property_tests())]
        #[test]
        fn only_needed_items_are_kept(many in 1..60usize, first in 0..60usize, second in 0..60usize) {
            let (first, second) = (first % many, second % many);
            let items: Vec<usize> = (0..many).collect();
            let kept = shrink(&items, usize::MAX, |some| some.contains(&first) && some.contains(&second));
            let mut wanted = vec![first.min(second), first.max(second)];
            wanted.dedup();
            prop_assert_eq!(kept, wanted);
        }
    }

    #[test]
    fn it_gives_up_after_so_many_tries() {
        let mut asked = 0;
        let kept = shrink(&[0; 100], 7, |_| {
            asked += 1;
            false
        });
        assert_eq!((kept.len(), asked), (100, 7));
    }

    #[test]
    fn a_failure_without_items_shrinks_to_nothing() {
        assert_eq!(shrink(&[1, 2, 3], 100, |_| true), [0; 0]);
    }
}
