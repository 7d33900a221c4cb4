//! Values of scripts as text, for messages and for the shell.

use super::block::Block;
use crate::script::MemoryCopy;
use crate::script::caught::Caught;
use rhai::{Dynamic, Engine, FnPtr};

/// Deepest nesting of arrays and maps that is shown.
const DEEPEST: usize = 8;

/// Returns the text of a value, as `print` shows it. Types of commram have their own text, in place of a name in Rust.
pub(in crate::script) fn value_text(value: &Dynamic) -> String {
    nested(value, 0)
}

fn nested(value: &Dynamic, depth: usize) -> String {
    if let Ok(array) = value.as_array_ref() {
        return listed("[", array.iter().map(|item| item_text(item, depth)), depth);
    }
    if let Ok(map) = value.as_map_ref() {
        return listed(
            "#{",
            map.iter().map(|(key, item)| format!("{key:?}: {}", item_text(item, depth))),
            depth,
        );
    }
    if let Some(block) = value.read_lock::<Block>() {
        return block.text();
    }
    if let Some(copy) = value.read_lock::<MemoryCopy>() {
        return snapshot(&copy);
    }
    if let Some(error) = value.read_lock::<Caught>() {
        return error.message();
    }
    if value.is::<FnPtr>() {
        return "a function".to_owned();
    }
    value.to_string()
}

/// Returns an item of an array or a map: texts are quoted.
fn item_text(item: &Dynamic, depth: usize) -> String {
    match item.is_string() || item.is_char() {
        true => format!("{item:?}"),
        false => nested(item, depth + 1),
    }
}

fn listed(open: &str, items: impl Iterator<Item = String>, depth: usize) -> String {
    let close = if open == "[" { "]" } else { "}" };
    match depth < DEEPEST {
        true => format!("{open}{}{close}", items.collect::<Vec<_>>().join(", ")),
        false => format!("{open}...{close}"),
    }
}

fn snapshot(copy: &MemoryCopy) -> String {
    format!("snapshot of {}", copy.area())
}

/// Gives `print`, `to_string` and texts with `${...}` the same text for the types of commram.
pub(super) fn register(engine: &mut Engine) {
    engine
        .register_fn("to_string", |block: &mut Block| block.text())
        .register_fn("to_debug", |block: &mut Block| block.text())
        .register_fn("to_string", |copy: &mut MemoryCopy| snapshot(copy))
        .register_fn("to_debug", |copy: &mut MemoryCopy| snapshot(copy));
}

#[cfg(test)]
mod tests {
    use super::super::Stage;
    use super::*;
    use crate::layout::Area;
    use crate::plc::BlockKind;
    use crate::script::Bench;
    use crate::script::engine::engine;
    use core::cell::RefCell;
    use rhai::{Scope, Shared};
    use std::path::PathBuf;
    use std::rc::Rc;

    /// Returns the value of an expression after these statements, as the engine and as messages show it.
    fn texts(script: &str) -> [String; 2] {
        let bench = Bench::built_in().unwrap();
        let stage = Rc::new(RefCell::new(Stage::new(Some(bench), PathBuf::new(), Bench::LIMIT_US)));
        let printed = Shared::new(RefCell::new(String::new()));
        let mut engine = engine(&stage);
        let line = Rc::clone(&printed);
        engine.on_print(move |text| text.clone_into(&mut line.borrow_mut()));
        let value: Dynamic =
            engine.eval_with_scope(&mut Scope::new(), &format!("{script}; print(it); it")).unwrap();
        let printed = printed.borrow().clone();
        [printed, value_text(&value)]
    }

    #[test]
    fn blocks_and_snapshots_have_a_text_without_types_of_rust() {
        let same = |script: &str, wanted: &str| assert_eq!(texts(script), [wanted; 2], "{script}");
        let device = crate::devices::default();
        let place_of = |kind: &BlockKind| {
            let has =
                |area: &&Area| area.structures.iter().any(|it| Some(it.structure.name) == kind.structure);
            Some((kind.name, device.layout.areas.iter().find(has).filter(|_| kind.has("x_EN"))?.name))
        };
        let (name, place) = device.blocks.iter().find_map(place_of).unwrap();
        let block = &format!("let it = block(\"{name}\", \"{place}\")");
        let [shown, _] = texts(block);
        assert!(shown.starts_with(&format!("{name} at {place}: ")), "{shown}");
        assert!(shown.contains("x_EN FALSE"), "{shown}");
        same(block, &shown);
        same(&format!("{block}; it = [it, \"a\"]"), &format!("[{shown}, \"a\"]"));
        same(&format!("{block}; it = `${{it}}`"), &shown);
        same("let it = snapshot(\"node2\")", "snapshot of node2");
        same("let it = #{\"a\": snapshot(\"node2\")}", "#{\"a\": snapshot of node2}");
        same("let it = (); try { peek(\"node2.x\") } catch (error) { it = error }", &{
            let [shown, _] = texts("let it = (); try { peek(\"node2.x\") } catch (error) { it = error }");
            assert!(shown.contains("`node2`") && !shown.contains("::"), "{shown}");
            shown
        });
    }

    #[test]
    fn deep_nesting_is_cut() {
        let [_, text] = texts("let it = []; for i in 0..30 { it = [it] }");
        assert_eq!(text, format!("{}[...]{}", "[".repeat(DEEPEST), "]".repeat(DEEPEST)));
    }
}
