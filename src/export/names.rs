//! Names that differ from each other.

use std::collections::HashSet;

/// The names that an export has used.
#[derive(Default)]
pub(crate) struct UsedNames {
    used: HashSet<String>,
    ignores_case: bool,
}

impl UsedNames {
    /// These names are used already.
    pub(crate) fn of(names: impl IntoIterator<Item = String>) -> Self {
        Self { used: names.into_iter().collect(), ignores_case: false }
    }

    /// These names are used already, in a language that does not distinguish upper and lower case.
    pub(crate) fn without_case(names: impl IntoIterator<Item = String>) -> Self {
        let used = names.into_iter().map(|name| name.to_ascii_lowercase()).collect();
        Self { used, ignores_case: true }
    }

    /// Returns `name`. If it is used already, appends `_2`, `_3` and so on.
    pub(crate) fn add(&mut self, name: impl Into<String>) -> String {
        let name = name.into();
        let mut free = name.clone();
        let mut number = 2;
        while !self.used.insert(if self.ignores_case { free.to_ascii_lowercase() } else { free.clone() }) {
            free = format!("{name}_{number}");
            number += 1;
        }
        free
    }

    /// True if this name is used already.
    pub(crate) fn contains(&self, name: &str) -> bool {
        self.used.contains(name)
    }

    /// Changes `name` to a name that is not used yet.
    pub(crate) fn reserve(&mut self, name: &mut String) {
        *name = self.add(core::mem::take(name));
    }
}
