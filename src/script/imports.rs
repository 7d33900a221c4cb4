//! Finds imported scripts, and refuses imports that never end.
//!
//! The name of an imported script is its path relative to the directory of the scenario, without `.` and `..` inside.

use super::ScenarioError;
use super::caught::Caught;
use crate::input_file;
use crate::namesakes::Namesakes;
use crate::whole_script;
use core::cell::RefCell;
use rhai::{Engine, EvalAltResult, Module, ModuleResolver, Position, Scope};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Maximum depth of nested imports.
const DEEPEST: usize = 32;

/// Imports of files. Relative paths begin at the directory of the importing script, or else at that of the scenario.
pub(super) struct Imports {
    /// Modules that were imported before.
    modules: RefCell<BTreeMap<PathBuf, Rc<Module>>>,
    directory: PathBuf,
    scenario: PathBuf,
    /// Imports in progress, whose scripts are running, the outermost first.
    under_way: RefCell<Vec<Import>>,
    /// All requested files, without repetitions.
    imported: Rc<RefCell<Vec<PathBuf>>>,
    /// The functions of all scripts.
    namesakes: RefCell<Namesakes>,
}

/// `start.rhai:3 imports common.rhai`
struct Import {
    /// File with the `import` statement.
    from: PathBuf,
    line: Option<usize>,
    /// Imported file.
    to: PathBuf,
}

impl core::fmt::Display for Import {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}", self.from.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, " imports {}", self.to.display())
    }
}

impl Imports {
    /// Creates the imports of the scenario in file `scenario`, which has the functions `own`. They append requested files to
    /// `imported`.
    pub(crate) fn new(
        scenario: &Path,
        directory: &Path,
        imported: Rc<RefCell<Vec<PathBuf>>>,
        own: Namesakes,
    ) -> Self {
        Self {
            modules: RefCell::default(),
            directory: directory.to_owned(),
            scenario: scenario.to_owned(),
            under_way: RefCell::default(),
            imported,
            namesakes: own.into(),
        }
    }

    /// Begins an import. Refuses it if the script is already running, because the import would be circular.
    fn begin(&self, import: Import, path: &str) -> Result<(), ScenarioError> {
        let mut under_way = self.under_way.borrow_mut();
        let goes_round = [&self.scenario]
            .into_iter()
            .chain(under_way.iter().map(|import| &import.to))
            .position(|file| same_file(file, &import.to));
        if let Some(start) = goes_round {
            let circle = under_way.iter().skip(start).chain([&import]).map(Import::to_string);
            let circle: Vec<_> = circle.collect();
            let right = format!("this import is circular: {}", circle.join(", "));
            return Err(ScenarioError::argument(path, &right));
        }
        if under_way.len() >= DEEPEST {
            let right = format!("imports may be nested {DEEPEST} deep");
            return Err(ScenarioError::argument(path, &right));
        }
        under_way.push(import);
        Ok(())
    }

    /// Compiles and runs the script of a module. Ignores a first line that begins with `#!`, which is for the operating
    /// system.
    fn module(&self, engine: &Engine, name: &str, text: &str) -> Result<Rc<Module>, Box<EvalAltResult>> {
        let mut script = whole_script::compile(engine, without_first_line(text))?;
        script.set_source(name);
        let added = self.namesakes.borrow_mut().add(name, &script);
        added.map_err(|why| at(ScenarioError::argument(name, &why), Position::new(1, 1)))?;
        Ok(Module::eval_ast_as_new(Scope::new(), &script, engine)?.into())
    }
}

impl ModuleResolver for Imports {
    fn resolve(
        &self,
        engine: &Engine,
        source: Option<&str>,
        path: &str,
        position: Position,
    ) -> Result<Rc<Module>, Box<EvalAltResult>> {
        let from =
            source.map_or_else(|| self.scenario.clone(), |source| module_file(source, &self.directory));
        if Path::new(path).file_name().is_none() {
            return Err(at(ScenarioError::argument(path, "name the file of a script"), position));
        }
        let name = imported_name(source, path, &self.directory);
        let to = file_of(&name, &self.directory);
        if let Some(module) = self.modules.borrow().get(&to) {
            return Ok(Rc::clone(module));
        }
        let mut imported = self.imported.borrow_mut();
        if !imported.contains(&to) {
            imported.push(to.clone());
        }
        drop(imported);
        self.begin(Import { from, line: position.line(), to: to.clone() }, path)
            .map_err(|error| at(error, position))?;
        let module = match input_file::read(&to, input_file::LONGEST_SCRIPT) {
            Ok(text) => self.module(engine, &name, &text).map_err(|error| within(&name, error, position)),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                Err(EvalAltResult::ErrorModuleNotFound(path.to_owned(), position).into())
            }
            Err(error) => Err(unreadable(path, &error, position)),
        };
        self.under_way.borrow_mut().pop();
        self.modules.borrow_mut().extend(module.iter().map(|module| (to.clone(), Rc::clone(module))));
        module
    }
}

fn within(path: &str, error: Box<EvalAltResult>, position: Position) -> Box<EvalAltResult> {
    EvalAltResult::ErrorInModule(path.to_owned(), error, position).into()
}

fn unreadable(path: &str, error: &std::io::Error, position: Position) -> Box<EvalAltResult> {
    at(ScenarioError::argument(path, &error.to_string()), position)
}

fn at(error: ScenarioError, position: Position) -> Box<EvalAltResult> {
    let mut error = Caught::thrown(error);
    error.set_position(position);
    error
}

/// True if two paths name the same file, even through different directories.
fn same_file(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    a == b || real(a) == real(b)
}

/// Removes a first line that begins with `#!`, but keeps its end.
pub(super) fn without_first_line(text: &str) -> &str {
    match text.strip_prefix("#!") {
        Some(rest) => rest.find('\n').map_or("", |end| &rest[end..]),
        None => text,
    }
}

/// Returns the name of the script that the script `source` imports as `path`; the scenario itself has no name. A script
/// beside `source` comes before one in the directory of the scenario.
pub(super) fn imported_name(source: Option<&str>, path: &str, directory: &Path) -> String {
    let name = |path: &Path| without_dots(path).display().to_string();
    let beside = source.and_then(|source| Path::new(source).parent()).map(|parent| name(&parent.join(path)));
    let beside = beside.filter(|beside| file_of(beside, directory).is_file());
    beside.unwrap_or_else(|| name(Path::new(path)))
}

/// Returns the file of the script with this name.
pub(super) fn file_of(name: &str, directory: &Path) -> PathBuf {
    directory.join(name).with_extension("rhai")
}

/// Removes `.` and `..` from a path. A `..` at its begin stays.
pub(crate) fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if plain.file_name().is_some() => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

/// A function of a script and one of the same name in a script that it imports, which a run refuses.
#[cfg(feature = "cli")]
pub(crate) struct Namesake {
    /// The path in the statement `import` of the first script that leads to the error.
    pub path: String,
    /// Description of the error.
    pub what: String,
}

/// Returns the functions that a run of the script `text` would refuse, because several scripts have them. `read` returns
/// the text of a file. Imports whose paths are not literal texts are left out.
#[cfg(feature = "cli")]
pub(super) fn namesakes(
    engine: &Engine,
    file: &Path,
    text: &str,
    read: &dyn Fn(&Path) -> Option<String>,
) -> Option<Namesake> {
    let directory = file.parent().unwrap_or(Path::new(""));
    let own = file.file_name().unwrap_or_default().to_string_lossy();
    let ast = whole_script::compile(engine, text).ok()?;
    let mut namesakes = Namesakes::of(&own, &ast);
    let mut seen = vec![file.to_owned()];
    for path in imported_paths(&ast) {
        // The scripts that wait for their imports, the next one last.
        let mut waiting = vec![imported_name(None, &path, directory)];
        while let Some(name) = waiting.pop() {
            let file = file_of(&name, directory);
            if seen.contains(&file) {
                continue;
            }
            let ast =
                read(&file).and_then(|text| whole_script::compile(engine, without_first_line(&text)).ok());
            seen.push(file);
            let Some(ast) = ast else { continue };
            if let Err(what) = namesakes.add(&name, &ast) {
                return Some(Namesake { path, what });
            }
            let more = imported_paths(&ast).into_iter().rev();
            waiting.extend(more.map(|path| imported_name(Some(&name), &path, directory)));
        }
    }
    None
}

/// Returns the literal paths of the imports of a script.
#[cfg(feature = "cli")]
fn imported_paths(ast: &rhai::AST) -> Vec<String> {
    let mut found = Vec::new();
    ast.walk(&mut |path| {
        if let Some(rhai::ASTNode::Stmt(rhai::Stmt::Import(import, _))) = path.last()
            && let rhai::Expr::StringConstant(path, _) = &import.0
        {
            found.push(path.to_string());
        }
        true
    });
    found
}

/// Returns the file of an imported script.
pub(super) fn module_file(source: &str, directory: &Path) -> PathBuf {
    let path = Path::new(source);
    let path = if path.is_absolute() || path.starts_with(directory) {
        path.to_owned()
    } else {
        directory.join(path)
    };
    if path.extension().is_some() { path } else { path.with_extension("rhai") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_in_paths_are_resolved() {
        for (path, plain) in
            [("/a/./b/../c", "/a/c"), ("../a", "../a"), ("../../a", "../../a"), ("./a", "a"), ("/a", "/a")]
        {
            assert_eq!(without_dots(Path::new(path)), Path::new(plain));
        }
    }
}
