//! Errors for calls of verbs with a wrong number or wrong types of arguments.

use super::{Fallible, Verbs};
use crate::script::ScenarioError;
use crate::script::caught::Caught;
use crate::script::complaint::kind;
use crate::script::verb::{self, Verb};
use rhai::{Dynamic, Engine, FLOAT, INT};
use std::collections::BTreeSet;

/// Registers functions with the name of a verb for each number of arguments. They accept any types and report the
/// correct call. Registers nothing for a number of arguments with which the verb itself accepts all types.
macro_rules! refuse {
    ($verbs:ident, $name:ident, $of:ident: $($count:literal ($($argument:ident)*))*) => {$(
        if !takes_all(&$of, $count) {
            $verbs.engine.register_fn($name, move |$($argument: Dynamic),*| -> Fallible<()> {
                Err(Caught::thrown(wrong_call($name, &[$($argument),*])))
            });
        }
    )*};
}

impl Verbs {
    /// Registers functions that report the right call if a verb is called with wrong arguments. The engine prefers the
    /// verb itself if its parameters fit.
    pub(super) fn refuse_others(&mut self) {
        let names: BTreeSet<_> = self.names.iter().map(|(name, _)| *name).collect();
        for name in names {
            let of = verb::called(name);
            refuse!(self, name, of: 0 () 1 (a) 2 (a b) 3 (a b c) 4 (a b c d) 5 (a b c d e) 6 (a b c d e f));
        }
        refuse_sleep(&mut self.engine);
    }
}

/// Replaces the engine's own `sleep`, which waits in real time: the plant does not advance during this time, and the
/// script cannot be ended.
pub(in crate::script) fn refuse_sleep(engine: &mut Engine) {
    engine.register_fn("sleep", |_: INT| no_sleep());
    engine.register_fn("sleep", |_: FLOAT| no_sleep());
}

fn no_sleep() -> Fallible<()> {
    let right = "a scenario has emulated time only; write step(\"1ms\")";
    Err(Caught::thrown(ScenarioError::argument("sleep", right)))
}

/// True if there is a verb with `count` arguments that accepts all types.
fn takes_all(verbs: &[&Verb], count: usize) -> bool {
    let any = |verb: &Verb| verb.parameters.iter().all(|(_, ty)| *ty == "?");
    verbs.iter().any(|verb| verb.parameters.len() == count && any(verb))
}

/// Error with the right call.
fn wrong_call(name: &str, given: &[Dynamic]) -> ScenarioError {
    let verbs = verb::called(name);
    let signatures = signatures(&verbs);
    let of_so_many = verbs.iter().filter(|verb| verb.parameters.len() == given.len());
    // If several verbs have the given number of arguments, the message names the verb with the most fitting arguments.
    let misfits = of_so_many.filter_map(|verb| {
        let mut pairs = verb.parameters.iter().zip(given).enumerate();
        pairs.find(|(_, ((_, ty), given))| !fits(ty, given))
    });
    let right = match misfits.max_by_key(|(index, _)| *index) {
        Some((_, ((parameter, ty), given))) => {
            let (given, wanted) = (kind(short_name(given)), wanted(ty));
            format!("`{parameter}` is {wanted}, here it is {given}; write {signatures}")
        }
        None => return wrong_count(&verbs, name, given.len()),
    };
    ScenarioError::argument(name, &right)
}

fn signatures(verbs: &[&Verb]) -> String {
    verbs.iter().map(|verb| verb.signature()).collect::<Vec<_>>().join(" or ")
}

/// Returns the error that no verb of this name has the given number of arguments.
pub(in crate::script) fn wrong_count(verbs: &[&Verb], name: &str, count: usize) -> ScenarioError {
    let signatures = signatures(verbs);
    ScenarioError::argument(name, &format!("{count} arguments are given; write {signatures}"))
}

fn short_name(given: &Dynamic) -> &'static str {
    match given.type_name() {
        name if name.ends_with("::Block") => "Block",
        name if name.ends_with("::MemoryCopy") => "Snapshot",
        name if name.ends_with("::Caught") => "an error",
        name => name,
    }
}

/// True if an argument has the type `ty` of the definition file.
fn fits(ty: &str, given: &Dynamic) -> bool {
    match ty {
        "String" => given.is_string(),
        "int" => given.is_int(),
        "bool" => given.is_bool(),
        "Array" => given.is_array(),
        "FnPtr" => given.is_fnptr(),
        "Block" | "Snapshot" => short_name(given) == ty,
        _ => true,
    }
}

fn wanted(ty: &str) -> &str {
    match ty {
        "String" => "a text",
        "int" => "an integer",
        "bool" => "a bool",
        "Array" => "an array",
        "FnPtr" => "a function such as `|| now() > 5`",
        other => kind(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_names_the_right_call() {
        let message = |name, given: &[Dynamic]| wrong_call(name, given).to_string();
        assert_eq!(
            message("wait", &["node2.b_BT_0".into(), 2_i64.into()]),
            "`wait`: 2 arguments are given; write wait(register, value, within)"
        );
        assert_eq!(
            message("wait", &[5_i64.into(), 2_i64.into(), "1ms".into()]),
            "`wait`: `register` is a text, here it is an integer; write wait(register, value, within)"
        );
        let five = ["open".into(), 1_i64.into(), "*".into(), "1ms".into(), 1_i64.into()];
        assert!(
            message("expect_frame", &five)
                .contains("`extended` is a bool, here it is an integer; write expect_frame(")
        );
        assert!(takes_all(&verb::called("step"), 1) && takes_all(&verb::called("now"), 0));
        assert!(!takes_all(&verb::called("step"), 2) && !takes_all(&verb::called("poke"), 2));
    }
}
