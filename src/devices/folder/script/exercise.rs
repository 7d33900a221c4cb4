//! Reads `exercise.rhai`: actions of a correct program that uses the device, for `commram soak`.
//!
//! The file is a scenario without a plant. It defines `start()`, `recover()` and a function for each move.
//! Two constants declare the moves and the warnings that a correct program may cause.

use crate::devices::folder::{FolderError, plant_alone};
use crate::devices::{Exercise, Move};
use crate::layout::DeviceLayout;
use crate::whole_script;
use core::ops::RangeInclusive;
use rhai::{AST, Array, Dynamic, Engine, INT, Map, Scope};
use std::path::Path;

/// Maximum number of moves of an exercise.
const MOST_MOVES: usize = 64;
/// Maximum number of parameters of a move, without the first parameter.
const MOST_PARAMETERS: usize = 8;
/// Maximum number of steps for evaluating the constants of the file.
const MOST_OPERATIONS: u64 = 10_000;
/// Maximum length of the file in bytes, as for every scenario.
const LONGEST: usize = 64 << 10;

/// Reads the exercise of the device with this layout in the folder `dir`. `text` is the text of the file. The
/// exercise is never freed.
///
/// # Errors
/// [`FolderError::Script`]: the file is not a script, or its declarations are wrong.
pub(super) fn read(
    dir: &Path,
    layout: &'static DeviceLayout,
    text: &str,
) -> Result<&'static Exercise, FolderError> {
    let wrong = |line: Option<usize>, what: String| {
        Err(FolderError::Script { path: dir.join(super::EXERCISE), line: line.unwrap_or(1), what })
    };
    if text.len() > LONGEST {
        return wrong(None, format!("it has more than {} KiB", LONGEST >> 10));
    }
    let engine = engine();
    let ast = match whole_script::compile(&engine, text) {
        Ok(ast) => ast,
        Err(error) => return wrong(error.position().line(), error.err_type().to_string()),
    };
    let mut scope = Scope::new();
    if let Err(error) = engine.run_ast_with_scope(&mut scope, &ast) {
        return wrong(error.position().line(), format!("its constants: {error}"));
    }
    let declared = match declared(&scope, &ast) {
        Ok(declared) => declared,
        Err(what) => return wrong(None, what),
    };
    let (moves, allowed) = declared;
    Ok(Box::leak(Box::new(Exercise {
        name: layout.name,
        plant: lasting(plant_alone(dir, layout)),
        settings: &[],
        script: lasting(text.to_owned()),
        moves: Vec::leak(moves),
        wrongs: &[],
        allowed: Vec::leak(allowed),
    })))
}

fn lasting(text: String) -> &'static str {
    String::leak(text)
}

/// Returns an engine without the verbs of scenarios. It needs no verbs, because outside of functions the file
/// has only constants.
fn engine() -> Engine {
    let mut engine = Engine::new();
    engine.set_max_operations(MOST_OPERATIONS);
    engine.set_max_expr_depths(64, 64);
    engine.set_max_string_size(4096);
    engine.set_max_array_size(1024);
    engine.set_max_map_size(256);
    engine.set_module_resolver(rhai::module_resolvers::DummyModuleResolver::new());
    engine.on_print(|_| {});
    engine.on_debug(|_, _, _| {});
    for name in ["eval", "sleep"] {
        engine.disable_symbol(name);
    }
    engine
}

type Declared = (Vec<Move>, Vec<&'static str>);

/// Returns the moves and the allowed rules.
fn declared(scope: &Scope, ast: &AST) -> Result<Declared, String> {
    let parameters = |name: &str| {
        ast.iter_functions().find(|function| function.name == name).map(|function| function.params.len())
    };
    for name in ["start", "recover"] {
        if parameters(name) != Some(0) {
            return Err(format!("an exercise has a function {name}()"));
        }
    }
    let right =
        "write `const MOVES = #{ name: [[0, 10]] };` with the ranges of the parameters after the first one";
    let moves: Map = scope.get_value("MOVES").ok_or(right)?;
    if moves.is_empty() || moves.len() > MOST_MOVES {
        return Err(format!("{} moves; an exercise has 1 to {MOST_MOVES}", moves.len()));
    }
    let mut found = Vec::new();
    for (name, ranges) in moves {
        let ranges = ranges.into_typed_array::<Dynamic>().map_err(|_| right)?;
        let ranges: Option<Vec<_>> = ranges.into_iter().map(range).collect();
        let ranges = ranges.filter(|ranges| ranges.len() <= MOST_PARAMETERS).ok_or(right)?;
        if parameters(&name) != Some(1 + ranges.len()) {
            return Err(format!(
                "the move {name} has {} ranges, so it is a function of {} parameters; the first one is true if nothing is disturbed",
                ranges.len(),
                1 + ranges.len()
            ));
        }
        found.push(Move::new(lasting(name.to_string()), Vec::leak(ranges)));
    }
    let allowed = scope.get_value::<Array>("ALLOWED").unwrap_or_default();
    let allowed =
        allowed.into_iter().map(|rule| rule.into_string().map(lasting)).collect::<Result<Vec<_>, _>>();
    Ok((found, allowed.map_err(|_| "`ALLOWED` is an array of names of rules")?))
}

/// `[least, most]`
fn range(pair: Dynamic) -> Option<RangeInclusive<i64>> {
    match pair.into_typed_array::<INT>().ok()?[..] {
        [least, most] if least <= most => Some(least..=most),
        _ => None,
    }
}
