//! Finds imported scripts, and refuses imports that never end.

use super::ScenarioError;
use super::caught::Caught;
use crate::input_file;
use core::cell::RefCell;
use rhai::module_resolvers::FileModuleResolver;
use rhai::{Engine, EvalAltResult, Module, ModuleResolver, Position};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Deepest nesting of imports.
const DEEPEST: usize = 32;

/// Imports from files, named from the directory of the scenario.
pub(super) struct Imports {
    files: FileModuleResolver,
    directory: PathBuf,
    scenario: PathBuf,
    /// Imports with scripts that are being run, the outermost first.
    under_way: RefCell<Vec<Import>>,
    /// All requested files, once each.
    imported: Rc<RefCell<Vec<PathBuf>>>,
}

/// `start.rhai:3 imports common.rhai`
struct Import {
    from: PathBuf,
    line: Option<usize>,
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
    /// For the scenario in file `scenario`; requested files are noted in `imported`.
    pub(crate) fn new(scenario: &Path, directory: &Path, imported: Rc<RefCell<Vec<PathBuf>>>) -> Self {
        Self {
            files: FileModuleResolver::new_with_path(directory),
            directory: directory.to_owned(),
            scenario: scenario.to_owned(),
            under_way: RefCell::default(),
            imported,
        }
    }

    /// Notes an import, unless it leads back to a running script.
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
        let to = self.files.get_file_path(path, None);
        let mut imported = self.imported.borrow_mut();
        if !imported.contains(&to) {
            imported.push(to.clone());
        }
        drop(imported);
        self.begin(Import { from, line: position.line(), to: to.clone() }, path)
            .map_err(|error| at(error, position))?;
        // The resolver would read a file to its end, which some special files do not have.
        let module = match input_file::read(&to, input_file::LONGEST_SCRIPT) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(unreadable(path, &error, position)),
            _ => self.files.resolve(engine, source, path, position),
        };
        self.under_way.borrow_mut().pop();
        module
    }
}

fn unreadable(path: &str, error: &std::io::Error, position: Position) -> Box<EvalAltResult> {
    at(ScenarioError::argument(path, &error.to_string()), position)
}

fn at(error: ScenarioError, position: Position) -> Box<EvalAltResult> {
    let mut error = Caught::thrown(error);
    error.set_position(position);
    error
}

/// Whether two paths name the same file, also by different routes.
fn same_file(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    a == b || real(a) == real(b)
}

/// The file of an imported script.
pub(super) fn module_file(source: &str, directory: &Path) -> PathBuf {
    let path = Path::new(source);
    let path = if path.is_absolute() || path.starts_with(directory) {
        path.to_owned()
    } else {
        directory.join(path)
    };
    if path.extension().is_some() { path } else { path.with_extension("rhai") }
}
