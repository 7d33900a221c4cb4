//! The table of verbs, read from their definition file. Editors, messages and the reference use the same file.

use std::sync::LazyLock;

/// The definition file, in Rhai's format for editors: names, parameters, types and descriptions of the verbs.
pub const DEFINITIONS: &str = include_str!("verbs.d.rhai");

/// A verb of scenarios. A verb that can have different numbers of arguments has one entry for each number.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Verb {
    /// Name of the verb.
    pub name: &'static str,
    /// Names and types of the parameters. The type `?` means several types: a value, a time or data.
    pub parameters: Vec<(&'static str, &'static str)>,
    /// Type of the verb's result, if it has one.
    pub result: Option<&'static str>,
    /// Description in a few sentences.
    pub about: &'static str,
}

impl Verb {
    /// Formats the signature: `wait(register, value, within)`.
    pub fn signature(&self) -> String {
        let names: Vec<_> = self.parameters.iter().map(|(name, _)| *name).collect();
        format!("{}({})", self.name, names.join(", "))
    }
}

/// The verbs of the definition file, which is parsed only once.
static VERBS: LazyLock<Vec<Verb>> = LazyLock::new(|| defined(DEFINITIONS));

/// Returns all verbs, in the order of the definition file.
pub fn verbs() -> Vec<Verb> {
    VERBS.clone()
}

/// Returns the verbs with this name.
pub(super) fn called(name: &str) -> Vec<&'static Verb> {
    VERBS.iter().filter(|verb| verb.name == name).collect()
}

/// Returns the verbs of a definition file. A verb without a description has that of the verb before it.
pub(crate) fn defined(definitions: &'static str) -> Vec<Verb> {
    let mut about = "";
    let mut found = Vec::new();
    for line in definitions.lines() {
        match line.strip_prefix("/// ") {
            Some(text) => about = text,
            None => found.extend(verb(line, about)),
        }
    }
    found
}

/// Parses a verb from a line such as `fn wait(register: String, value: ?, within: ?) -> int;`.
fn verb(line: &'static str, about: &'static str) -> Option<Verb> {
    let (name, rest) = line.strip_prefix("fn ")?.split_once('(')?;
    let (parameters, rest) = rest.split_once(')')?;
    let parameters = parameters.split(", ").filter_map(|parameter| parameter.split_once(": ")).collect();
    let result = rest.strip_prefix(" -> ").and_then(|result| result.strip_suffix(';'));
    Some(Verb { name, parameters, result, about })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_file_is_read_with_names_and_types() {
        let wait = called("wait");
        let parameters = vec![("register", "String"), ("value", "?"), ("within", "?")];
        assert_eq!((wait[0].name, &wait[0].parameters, wait.len()), ("wait", &parameters, 1));
        assert_eq!(wait[0].result, Some("int"));
        assert!(wait[0].about.starts_with("Advances the clock until the register"), "{}", wait[0].about);
        assert_eq!(called("poke")[0].result, None);
        assert_eq!(wait[0].signature(), "wait(register, value, within)");
        assert_eq!(called("now")[0].signature(), "now()");
        let definitions = DEFINITIONS.lines().filter(|line| line.starts_with("fn ")).count();
        assert_eq!(verbs().len(), definitions);
    }

    #[test]
    fn every_definition_has_a_description() {
        let lines: Vec<_> = DEFINITIONS.lines().collect();
        for pair in lines.windows(2).filter(|pair| pair[1].starts_with("fn ")) {
            assert!(pair[0].starts_with("/// ") && pair[0].ends_with(['.', '`']), "{pair:?}");
        }
    }
}
