//! Functions with one name in several scripts that run together.
//!
//! Each script of a run has its own functions. The engine remembers the function that a name has meant, but not the
//! script in which this was so (Rhai 1.27, `FnResolutionCache`): a script could call the function of another one. So
//! scripts are refused if this could happen.

use crate::plural::plural;
use crate::whole_script::call_of;
use rhai::{AST, ASTNode};
use std::collections::{BTreeMap, BTreeSet};

/// Name of a function, and number of its parameters.
type Signature = (String, usize);

/// The functions of the scripts that run together.
#[derive(Debug, Default)]
pub(crate) struct Namesakes {
    /// The scripts that define a function.
    defined: BTreeMap<Signature, BTreeSet<String>>,
    /// The scripts that call a function without the name of a module.
    called: BTreeMap<Signature, BTreeSet<String>>,
}

impl Namesakes {
    /// Returns the functions of the first script, which has no namesakes.
    pub(crate) fn of(script: &str, ast: &AST) -> Self {
        let mut own = Self::default();
        own.note(script, ast);
        own
    }

    /// Adds a script with this name. Adding a script again has no effect.
    ///
    /// # Errors
    /// Describes a function that two scripts define, and that two scripts call without the name of a module.
    pub(crate) fn add(&mut self, script: &str, ast: &AST) -> Result<(), String> {
        self.note(script, ast);
        let is_mixed = |(signature, scripts): &(&Signature, &BTreeSet<String>)| {
            scripts.len() > 1 && self.called.get(*signature).is_some_and(|callers| callers.len() > 1)
        };
        let Some(((name, count), scripts)) = self.defined.iter().find(is_mixed) else { return Ok(()) };
        let scripts: Vec<_> = scripts.iter().map(String::as_str).collect();
        Err(format!(
            "there are functions `{name}` with {} in {}, and the scripts would call each other's functions; rename them",
            plural(*count as u64, "parameter"),
            scripts.join(" and ")
        ))
    }

    fn note(&mut self, script: &str, ast: &AST) {
        for function in ast.iter_functions() {
            let signature = (function.name.to_owned(), function.params.len());
            self.defined.entry(signature).or_default().insert(script.to_owned());
        }
        ast.walk(&mut |path: &[ASTNode<'_>]| {
            if let Some(call) = path.last().and_then(call_of).filter(|call| !call.is_qualified()) {
                let signature = (call.name.to_string(), call.args.len());
                self.called.entry(signature).or_default().insert(script.to_owned());
            }
            true
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rhai::Engine;

    fn refusal(scripts: &[(&str, &str)]) -> Option<String> {
        let mut namesakes = Namesakes::default();
        let engine = Engine::new();
        scripts.iter().find_map(|(name, text)| namesakes.add(name, &engine.compile(text).unwrap()).err())
    }

    #[test]
    fn functions_that_the_engine_would_mix_up_are_named() {
        let own = "fn helper() { 1 } fn run() { [1, run_with(helper())] } fn run_with(x) { x }";
        let text = "there are functions `helper` with 0 parameters in a and b, and the scripts would call each other's functions; rename them";
        assert_eq!(refusal(&[("a", own), ("b", own)]).as_deref(), Some(text));
        assert_eq!(refusal(&[("a", own), ("a", own)]), None, "the same script");
        for other in [
            "fn helper() { 2 } 1",
            "fn helper(x) { x } helper(2)",
            "import \"a\" as a; fn run() { a::run() }",
            "import \"a\" as a; fn helper() { a::helper() }",
        ] {
            assert_eq!(refusal(&[("a", own), ("b", other)]), None, "{other}");
        }
        let by_method = "fn run_with(x) { x } let x = 1; if true { while helper(x.run_with()) { } }";
        assert_eq!(refusal(&[("a", own), ("b", by_method)]), None, "a method has no parameter here");
        assert!(
            refusal(&[("a", own), ("b", "fn run_with(x) { x } switch 1 { 1 => `${run_with(2)}` }")])
                .is_some()
        );
    }
}
