//! Suggestions for misspelt names.

/// Maximum number of suggested names.
const MOST: usize = 3;
/// Longest text that can be a misspelt name.
const LONGEST: usize = 120;

/// Returns up to three of `names` that the user may have meant by `wanted`. Names that contain `wanted` come first,
/// then names that differ from it in at most a third of the letters. Case is ignored, and `-` equals `_`.
#[must_use]
pub fn nearest<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    if wanted.len() > LONGEST {
        return Vec::new();
    }
    let wanted = folded(wanted);
    let limit = (wanted.len() / 3).max(2);
    let rated = names.into_iter().filter_map(|name| {
        let folded = folded(name);
        if wanted.len() > 2 && folded.contains(&wanted) {
            return Some(((false, folded.len() - wanted.len()), name));
        }
        let distance = strsim::osa_distance(&wanted, &folded);
        (distance <= limit).then_some(((true, distance), name))
    });
    let mut rated: Vec<_> = rated.collect();
    rated.sort();
    rated.dedup();
    rated.into_iter().take(MOST).map(|(_, name)| name).collect()
}

/// Returns the end of an error message: `; did you mean w_CPU_CONTROL?`. It is empty if no name is similar.
#[must_use]
pub fn did_you_mean<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    match nearest(wanted, names).as_slice() {
        [] => String::new(),
        [all @ .., last] if !all.is_empty() => format!("; did you mean {} or {last}?", all.join(", ")),
        [one, ..] => format!("; did you mean {one}?"),
    }
}

fn folded(name: &str) -> String {
    name.to_ascii_lowercase().replace('-', "_")
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 3] = ["w_CPU_CONTROL", "w_CONTROLWORD", "b_AC"];

    #[test]
    fn only_similar_names_are_suggested() {
        assert_eq!(nearest("w_CPU_CONTRL", NAMES), ["w_CPU_CONTROL"]);
        assert_eq!(nearest("w-cpu-cotnrol", NAMES), ["w_CPU_CONTROL"]);
        assert!(nearest("zzzz", NAMES).is_empty());
    }

    #[test]
    fn a_part_of_a_name_suggests_it_the_shortest_first() {
        assert_eq!(nearest("control", NAMES), ["w_CONTROLWORD", "w_CPU_CONTROL"]);
        assert_eq!(
            nearest("control", ["w_CONTROLWORD_OLD", "w_CONTROL"]),
            ["w_CONTROL", "w_CONTROLWORD_OLD"]
        );
        assert!(nearest("ro", NAMES).is_empty(), "two letters are a part of too much");
    }

    #[test]
    fn a_complaint_ends_with_a_question_or_with_nothing() {
        assert_eq!(did_you_mean("w_CPU_CONTRL", NAMES), "; did you mean w_CPU_CONTROL?");
        assert_eq!(did_you_mean("control", NAMES), "; did you mean w_CONTROLWORD or w_CPU_CONTROL?");
        assert_eq!(did_you_mean("zzzz", NAMES), "");
        assert_eq!(did_you_mean(&"w_CPU_CONTROL".repeat(1_000_000), NAMES), "");
    }
}
