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
use super::weight;
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
    count_accesses(&mut engine, meter);
    let meter = Rc::clone(meter);
    engine.on_progress(move |_| meter.step().map(Dynamic::from));
    engine
}

/// Lets each access to a variable count steps in proportion to the weight of its value. An operation with a value takes
/// the value from a variable, so it costs steps in proportion to its work.
#[expect(deprecated, reason = "the engine calls its hooks for variables volatile")]
fn count_accesses(engine: &mut Engine, meter: &Rc<Meter>) {
    let meter = Rc::clone(meter);
    engine.on_var(move |name, _, context| {
        if let Some(value) = context.scope().get(name) {
            meter.access(weight::of(value));
        }
        if let Some(this) = context.this_ptr()
            && meter.is_weighing_due()
        {
            meter.weigh(weight::of(this));
        }
        Ok(None)
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Version of the engine whose functions [`COSTLY`] covers. With another version, measure the time of each new function
    /// with the largest values, and add the function if a step takes more than some microseconds.
    const VERSION: &str = "name = \"rhai\"\nversion = \"1.27.0\"";

    /// Operations whose work grows with the size of their values. The list has no operation whose result would exceed a
    /// limit, for example the text of a large array, because this error stops the script.
    const COSTLY: &str = "
        let x = a; | a == b; | a != b; | a + []; | [] + a; | a += []; | [a]; | #{ k: a }; | for x in a { break; }
        switch a { 3 => 1, _ => 2 } | one(a); | 5 in a; | a.contains(9); | a.index_of(9); | a.sort(); | a.sort_desc()
        a.order(); | a.order_desc(); | a.dedup(); | a.reverse(); | a.extract(0); | a.extract(0, 9); | a.extract(0..9)
        a.split(0); | a.splice(0, 0, []); | a.splice(0..0, []); | a.drain(0, 0); | a.drain(0..0); | a.retain(0, 2000)
        a.retain(0..2000); | a.append([]); | a.pad(2000, 1); | a.truncate(2000); | a.chop(2000); | a.len(); | a.get(1)
        a.set(1, 1); | a[1]; | a[1] = 1; | a[1] += 1; | a.map(one); | a.filter(one); | a.reduce(two); | a.for_each(one)
        a.all(yes); | a.some(no); | a.find(no); | a.find_map(none); | a.sort(two); | a.zip(b, two)
        let x = m; | m == m; | m + #{}; | m += #{}; | m.keys(); | m.values(); | m.mixin(#{}); | m.fill_with(#{})
        m.filter(yes_of_two); | m.contains(\"a\"); | m.get(\"a\"); | m.k3; | m.k3 = 1;
        let x = s; | s == s; | s < s; | s + \"\"; | \"\" + s; | s += \"\"; | s - \"x\"; | s - 'x'; | \"x\" in s; | `${s}`
        s.len(); | s.bytes(); | s.remove(\"x\"); | s.trim(); | s.truncate(4000); | s.sub_string(0); | s.crop(0)
        s.replace(\"x\", \"y\"); | s.replace('x', 'y'); | s.index_of(\"x\"); | s.index_of('x'); | s.contains(\"x\")
        s.starts_with(s); | s.ends_with(s); | s.to_upper(); | s.to_lower(); | s.make_upper(); | s.make_lower()
        s.split(); | s.split(\"x\"); | s.split('x'); | s.split_rev(\"x\"); | s.split(\"x\", 5); | s.chars(); | s[1]
        s.get(1); | s.pad(10, \"x\"); | s.to_string(); | s.pop(0); | print(s)
        try { parse_int(s); } catch {} | try { parse_float(s); } catch {}
        let x = d; | d == d; | d.to_array(); | d.as_string(); | d.reverse(); | d.contains(9); | d.extract(0)";

    fn costly() -> impl Iterator<Item = &'static str> {
        COSTLY.lines().flat_map(|line| line.split(" | ")).map(str::trim).filter(|line| !line.is_empty())
    }

    #[test]
    fn each_operation_costs_steps_for_large_values() {
        assert!(include_str!("../../../../Cargo.lock").contains(VERSION), "another version of the engine");
        let steps = |size: usize, operation: &str| {
            let script = format!(
                "fn one(x) {{ x }} fn two(x, y) {{ 0 }} fn yes(x) {{ true }} fn no(x) {{ false }} fn none(x) {{ }}
                 fn yes_of_two(x, y) {{ true }}
                 let a = []; a.pad({size}, 7); let b = a; let s = \"\"; s.pad(2 * {size}, \"b\");
                 let m = #{{}}; for i in 0..{size} / 4 {{ m[\"k\" + i] = i; }} let d = blob(8 * {size} / 8, 5);
                 before(); {operation}"
            );
            let (meter, mut engine) = (Rc::new(Meter::default()), Engine::new());
            engine.set_max_string_size(LONGEST_TEXT);
            engine.set_max_array_size(LARGEST_ARRAY);
            engine.set_max_map_size(LARGEST_MAP);
            engine.on_print(|_| {}).on_debug(|_, _, _| {});
            count_accesses(&mut engine, &meter);
            let progress = Rc::clone(&meter);
            engine.on_progress(move |_| progress.step().map(Dynamic::from));
            let begin = Rc::clone(&meter);
            engine.register_fn("before", move || begin.begin_unlimited());
            meter.begin_unlimited();
            let result = engine.run(&script).map_err(|error| format!("{operation}: {error}"));
            result.map(|()| meter.operations())
        };
        let (mut names, mut wrong) = (BTreeSet::new(), Vec::new());
        for operation in costly() {
            // Bytes weigh less than other elements.
            let of_bytes = ["d", "let x = d"].iter().any(|start| operation.starts_with(start));
            let least = if of_bytes { 3 } else { 20 };
            match (steps(16, operation), steps(2000, operation)) {
                (Ok(small), Ok(large)) if large >= small + least => {}
                found => wrong.push(format!("{operation}: {found:?}")),
            }
            assert!(names.insert(operation), "{operation} is listed twice");
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
}
