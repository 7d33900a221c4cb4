//! The engine of a script, with its limits.
//!
//! The limits restrict the memory of a running script to some tens of megabytes: the number of calls, times
//! the number of variables, times the size of the largest value. Elements of the language for which no limit
//! exists are switched off. For example, functions as values (closures, `curry`) can contain each other, and
//! the engine does not count them.

use super::Files;
use super::budget::Meter;
use super::imports::Imports;
use super::verb_context::VerbContext;
use super::verbs;
use core::cell::RefCell;
use rhai::{Dynamic, Engine};
use std::rc::Rc;

/// Deepest nesting of function calls.
const MOST_CALLS: usize = 16;
/// Deepest nesting of levels of the parser. A pair of brackets has two levels, an array, a map or a block three. The deepest
/// script needs less than 768 KiB of the stack in a debug build.
const DEEPEST_LEVEL: usize = 64;
/// Maximum number of bytes of all texts in a value. A value is a text, or an array or a map with all its contents. The
/// keys of maps do not count. A longer text could make `replace` use too much memory.
pub(super) const LONGEST_TEXT: usize = 4096;
/// Maximum number of elements of all arrays in a value. Arrays can be nested as deep as this, and the engine counts and
/// frees them recursively, so the number must be safe for the stack.
pub(super) const LARGEST_ARRAY: usize = 2048;
/// Maximum number of entries of all maps in a value.
pub(super) const LARGEST_MAP: usize = 512;
/// Maximum number of variables of a function.
const MOST_VARIABLES: usize = 64;
/// Maximum number of arguments of a call. This limit is needed because the arguments are evaluated before the
/// limit of variables applies.
pub(super) const MOST_ARGUMENTS: usize = 16;
/// Maximum number of functions in a file.
const MOST_FUNCTIONS: usize = 512;

/// Describes the limit [`LONGEST_TEXT`].
pub(super) fn most_texts() -> String {
    format!("a value has at most {LONGEST_TEXT} bytes in all its texts")
}

/// Describes the limit [`LARGEST_ARRAY`].
pub(super) fn most_elements() -> String {
    format!("a value has at most {LARGEST_ARRAY} elements in all its arrays")
}

/// Describes the limit [`LARGEST_MAP`].
pub(super) fn most_entries() -> String {
    format!("a value has at most {LARGEST_MAP} entries in all its maps")
}

/// Describes the limit [`DEEPEST_LEVEL`].
pub(super) fn too_deep() -> String {
    format!(
        "expressions and blocks are nested too deep here: more than {DEEPEST_LEVEL} levels, of which brackets have 2, and an array or a block has 3"
    )
}

/// Names that a script cannot use. Functions of these names evaluate texts, create functions, or wait in real
/// time.
pub(super) const MISSING: [&str; 8] =
    ["eval", "Fn", "call", "curry", "is_shared", "sleep", "parse_json", "timestamp"];

/// Returns an engine. Its verbs act on the objects of `context`, and the meter counts its steps.
pub(super) fn engine(context: &Rc<RefCell<VerbContext>>, meter: &Rc<Meter>, files: &Files) -> Engine {
    let mut engine = Engine::new();
    engine.set_max_call_levels(MOST_CALLS);
    engine.set_max_expr_depths(DEEPEST_LEVEL, DEEPEST_LEVEL);
    engine.set_max_string_size(LONGEST_TEXT);
    engine.set_max_array_size(LARGEST_ARRAY);
    engine.set_max_map_size(LARGEST_MAP);
    engine.set_max_variables(MOST_VARIABLES);
    engine.set_max_functions(MOST_FUNCTIONS);
    engine.set_max_modules(super::MOST_FILES);
    engine.set_allow_anonymous_fn(false);
    engine.set_fail_on_invalid_map_property(true);
    for name in MISSING {
        engine.disable_symbol(name);
    }
    engine.set_module_resolver(Imports::new(files));
    verbs::register(&mut engine, context, meter);
    let meter = Rc::clone(meter);
    engine.on_progress(move |_| meter.step().map(Dynamic::from));
    engine
}
