//! Runs scenario statements one at a time, in the order in which a user types them.

use super::Bench;
use super::complaint::misread;
use super::engine::{Stage, engine, value_text};
use super::imports::Imports;
use super::printed::Printed;
use super::report::Outcome;
use super::run::{Limits, broken, ended, limit, place};
use crate::namesakes::Namesakes;
use crate::whole_script;
use core::cell::RefCell;
use rhai::{AST, Dynamic, Engine, ParseError, Scope};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Runs pieces of a script one after the other on one bench. Later pieces can use the declarations of earlier pieces.
pub struct Lines {
    engine: Engine,
    stage: Rc<RefCell<Stage>>,
    scope: Scope<'static>,
    functions: AST,
    limits: Limits,
    directory: PathBuf,
}

impl Lines {
    /// Creates an executor of lines for this bench. Relative paths begin at `directory`. Printed lines go to `print`.
    pub fn new(bench: Bench, directory: &Path, print: impl FnMut(&str) + 'static) -> Self {
        // No limits are needed: a user at a terminal can press Ctrl-C.
        let limits = Limits { operations: 0, time_us: u64::MAX, real: Duration::MAX };
        let stage = Rc::new(RefCell::new(Stage::new(Some(bench), directory.to_owned(), limits.time_us)));
        let mut engine = engine(&stage);
        limit(&mut engine, limits, Instant::now());
        engine.set_module_resolver(Imports::new(
            Path::new("shell"),
            directory,
            Rc::default(),
            Namesakes::default(),
        ));
        let printed = Rc::new(RefCell::new(Printed::new(print)));
        let printing = Rc::clone(&printed);
        engine.on_print(move |line| {
            let mut printed = printing.borrow_mut();
            printed.line(line);
            // The printed lines are not needed later.
            printed.take();
        });
        engine.on_debug(move |line, _, _| printed.borrow_mut().line(line));
        let mut scope = Scope::new();
        scope.push_constant("extended", true);
        Self { engine, stage, scope, functions: AST::empty(), limits, directory: directory.to_owned() }
    }

    /// False if the plant belongs to a running instance whose emulator has ended, or was replaced by another one.
    #[cfg(feature = "cli")]
    pub(crate) fn is_there(&self) -> bool {
        self.stage.borrow().is_there()
    }

    /// Runs a piece; returns its value, if it has one.
    ///
    /// # Errors
    /// An expectation failed, or the piece is wrong: [`Outcome::Failed`], [`Outcome::Broken`].
    pub fn run(&mut self, text: &str) -> Result<Option<String>, Box<Outcome>> {
        let file = Path::new("shell");
        let piece = whole_script::compile(&self.engine, text)
            .map_err(|ParseError(reason, _)| Box::new(broken(&misread(&reason, text), place(file, None))))?;
        let known = self.functions.merge(&piece);
        self.functions = known.clone_functions_only();
        let value = self.engine.eval_ast_with_scope::<Dynamic>(&mut self.scope, &known);
        match value {
            Ok(value) if value.is_unit() => Ok(None),
            Ok(value) => Ok(Some(value_text(&value))),
            Err(error) => Err(Box::new(ended(&error, file, &self.directory, &self.stage, self.limits))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines() -> (Lines, Rc<RefCell<String>>) {
        let printed = Rc::new(RefCell::new(String::new()));
        let out = Rc::clone(&printed);
        let lines = Lines::new(Bench::built_in().unwrap(), Path::new("."), move |line| {
            out.borrow_mut().push_str(line)
        });
        (lines, printed)
    }

    #[test]
    fn declarations_are_known_to_later_pieces() {
        let (mut lines, printed) = lines();
        assert!(matches!(
            lines.run("let status = \"node2.w_OPTION_STATUS\"; fn twice(x) { 2 * x }"),
            Ok(None)
        ));
        lines.run("poke(\"node2.w_CPU_CONTROL\", 1); wait(status, 2, \"10ms\");").unwrap();
        assert_eq!(lines.run("twice(peek(status))").unwrap().as_deref(), Some("4"));
        lines.run("print(now())").unwrap();
        assert_eq!(printed.borrow().trim(), "500");
    }

    #[test]
    fn an_error_is_reported_and_the_next_piece_runs() {
        let (mut lines, _) = lines();
        let failed = *lines.run("expect(\"node2.w_CPU_CONTROL\", 9)").unwrap_err();
        assert!(matches!(failed, Outcome::Failed(_)), "{failed:?}");
        for wrong in ["let x = ", "pek(\"node2.w_CPU_CONTROL\")", "peek(\"node2.nothing\")"] {
            let broken = *lines.run(wrong).unwrap_err();
            assert!(matches!(broken, Outcome::Broken(_)), "{wrong}: {broken:?}");
        }
        assert_eq!(lines.run("peek(\"node2.w_CPU_CONTROL\")").unwrap().as_deref(), Some("0"));
    }
}
