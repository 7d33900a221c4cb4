//! Finds out, without a plant, whether a script is only imported by other scripts, and which files a script needs.

use super::engine::refuse_sleep;
use super::imports::{file_of, imported_name};
use super::run::stack_guard;
use crate::input_file;
use crate::whole_script;
use rhai::{Dynamic, Engine, EvalAltResult, Module, ModuleResolver, Position, Scope};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Maximum number of steps for this check: enough to compute constants, and too few to cause a noticeable delay.
const OPERATIONS: u64 = 1_000;
/// Maximum size of texts, arrays and maps that these steps may create.
const SIZE: usize = 1 << 12;

/// True if a script only defines functions and constants for other scripts, and calls no verb itself.
pub fn is_part(text: &str) -> bool {
    let mut engine = Engine::new();
    engine.set_max_operations(OPERATIONS);
    engine.set_max_call_levels(8);
    engine.set_max_expr_depths(64, 64);
    engine.set_max_string_size(SIZE);
    engine.set_max_array_size(SIZE);
    engine.set_max_map_size(SIZE);
    let is_too_deep = stack_guard();
    engine.on_progress(move |_| is_too_deep().then_some(Dynamic::UNIT));
    engine.set_module_resolver(Nothing);
    engine.on_print(|_| {});
    engine.on_debug(|_, _, _| {});
    refuse_sleep(&mut engine);
    let Ok(script) = whole_script::compile(&engine, text) else { return false };
    // This engine has no verbs, so a script that calls one ends with an error.
    script.has_functions() && engine.run_ast_with_scope(&mut Scope::new(), &script).is_ok()
}

/// Resolves every import to an empty module.
struct Nothing;

impl ModuleResolver for Nothing {
    fn resolve(
        &self,
        _: &Engine,
        _: Option<&str>,
        _: &str,
        _: Position,
    ) -> Result<Rc<Module>, Box<EvalAltResult>> {
        Ok(Rc::new(Module::new()))
    }
}

/// Returns the files that a scenario imports, directly or through other imports, as far as their names are literal
/// texts.
pub fn needs(scenario: &Path) -> Vec<PathBuf> {
    let directory = scenario.parent().unwrap_or(Path::new(""));
    let mut found: Vec<(PathBuf, String)> = Vec::new();
    let (mut next, mut looked_at) = (Some((scenario.to_owned(), None)), 0);
    while let Some((file, source)) = next {
        let text = input_file::read(&file, input_file::LONGEST_SCRIPT).unwrap_or_default();
        for name in imports(&text).map(|path| imported_name(source.as_deref(), path, directory)) {
            let file = file_of(&name, directory);
            if found.iter().all(|(known, _)| *known != file) {
                found.push((file, name));
            }
        }
        next = found.get(looked_at).map(|(file, name)| (file.clone(), Some(name.clone())));
        looked_at += 1;
    }
    found.into_iter().map(|(file, _)| file).collect()
}

/// Returns the quoted texts after the word `import`, even in comments.
fn imports(text: &str) -> impl Iterator<Item = &str> {
    text.split("import").skip(1).filter_map(|rest| {
        let rest = rest.trim_start().strip_prefix(['"', '`'])?;
        rest.split_once(['"', '`', '\n']).map(|(name, _)| name)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_that_only_defines_is_a_part() {
        for part in [
            "fn start() { poke(\"node2.b_BT_0\", 1); }",
            "import \"other\" as other;\nconst FIRST = 16;\nfn start() { other::start(FIRST); }",
        ] {
            assert!(is_part(part), "{part}");
        }
        for scenario in [
            "",
            "print(1)",
            "fn start() { } expect(\"node2.b_BT_0\", 1);",
            "import \"common\" as c; fn own() { } c::start();",
            "fn start() { poke(\"node2.b_BT_0\", 1); } start();",
            "fn wrong( {",
            "fn endless() { } loop { }",
            "fn own() { } throw 1",
            "fn own() { } sleep(100000)",
        ] {
            assert!(!is_part(scenario), "{scenario}");
        }
    }

    #[test]
    fn imports_are_followed_beside_the_script_or_the_scenario() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        std::fs::create_dir(at("common")).unwrap();
        std::fs::write(at("main.rhai"), "import \"common/a\" as a;\n// nothing\nimport `missing` as m;")
            .unwrap();
        std::fs::write(at("common/a.rhai"), "fn a() { import \"common/b\" as b; }").unwrap();
        std::fs::write(at("common/b.rhai"), "import \"a\" as a; import \"../c\" as c;").unwrap();
        std::fs::write(at("c.rhai"), "import \"common/./b\" as b;").unwrap();
        std::fs::write(at("a.rhai"), "").unwrap();
        let files = ["common/a.rhai", "missing.rhai", "common/b.rhai", "c.rhai"].map(at);
        assert_eq!(needs(&at("main.rhai")), files);
    }
}
