//! Finds imported scripts, and refuses imports that never end.

use super::ScenarioError;
use super::caught::Caught;
use crate::input_file;
use crate::namesakes::Namesakes;
use crate::whole_script;
use core::cell::RefCell;
use rhai::{Engine, EvalAltResult, Module, ModuleResolver, Position, Scope};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Maximum depth of nested imports.
const DEEPEST: usize = 32;

/// Imports of files. Relative paths begin at the directory of the scenario.
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
    fn module(&self, engine: &Engine, path: &str, text: &str) -> Result<Rc<Module>, Box<EvalAltResult>> {
        let text = match text.strip_prefix("#!") {
            Some(rest) => rest.find('\n').map_or("", |end| &rest[end..]),
            None => text,
        };
        let mut script = whole_script::compile(engine, text)?;
        script.set_source(path);
        let added = self.namesakes.borrow_mut().add(path, &script);
        added.map_err(|why| at(ScenarioError::argument(path, &why), Position::new(1, 1)))?;
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
        let to = self.directory.join(path).with_extension("rhai");
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
            Ok(text) => self.module(engine, path, &text).map_err(|error| within(path, error, position)),
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
