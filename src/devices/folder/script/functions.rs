//! Functions that a script can call, with the numbers of their parameters.

use super::DEFINITIONS;
use crate::layout::did_you_mean;
use crate::plural::plural;
use rhai::AST;
use std::collections::{BTreeMap, BTreeSet};

/// The functions of a file, or the verbs. A name may have several functions with different numbers of parameters.
#[derive(Debug, Default)]
pub(super) struct Functions(BTreeMap<String, BTreeSet<usize>>);

impl Functions {
    /// Returns the functions of a file.
    pub(super) fn of(ast: &AST) -> Self {
        Self::from_pairs(ast.iter_functions().map(|function| (function.name, function.params.len())))
    }

    /// Returns the verbs.
    pub(super) fn verbs() -> Self {
        let heads = DEFINITIONS.lines().filter_map(|line| line.strip_prefix("fn "));
        let verbs = heads.filter_map(|head| {
            let (name, rest) = head.split_once('(')?;
            let (parameters, _) = rest.split_once(')')?;
            Some((name, parameters.split(',').filter(|parameter| !parameter.is_empty()).count()))
        });
        Self::from_pairs(verbs)
    }

    fn from_pairs<'a>(pairs: impl Iterator<Item = (&'a str, usize)>) -> Self {
        let mut all = BTreeMap::<String, BTreeSet<usize>>::new();
        for (name, count) in pairs {
            all.entry(name.to_owned()).or_default().insert(count);
        }
        Functions(all)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    pub(super) fn contains(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// Checks the number of arguments of a call. A function with another name is not checked.
    ///
    /// # Errors
    /// The function has another number of parameters.
    pub(super) fn check_arguments(&self, name: &str, given: usize) -> Result<(), String> {
        let Some(counts) = self.0.get(name).filter(|counts| !counts.contains(&given)) else { return Ok(()) };
        let numbers: Vec<_> = counts.iter().map(usize::to_string).collect();
        let parameters = match (numbers.as_slice(), counts.first()) {
            ([_], Some(count)) => plural(*count as u64, "parameter"),
            _ => format!("{} parameters", numbers.join(" or ")),
        };
        Err(format!("`{name}` has {parameters}, and is called with {}", plural(given as u64, "argument")))
    }

    /// Checks a function that `after` or `at` calls. These functions are those of the main file. `given` is the number of
    /// arguments, if it is known.
    ///
    /// # Errors
    /// There is no such function, or it has another number of parameters.
    pub(super) fn check_later(&self, name: &str, given: Option<usize>) -> Result<(), String> {
        if !self.contains(name) {
            let near = did_you_mean(name, self.names());
            return Err(format!("there is no function `{name}` to call later{near}"));
        }
        given.map_or(Ok(()), |given| self.check_arguments(name, given))
    }
}
