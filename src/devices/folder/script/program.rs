//! A compiled script of this thread.

use super::budget::{Budget, Meter};
use super::check::WRITTEN;
use super::engine::engine;
use super::functions::Functions;
use super::mistake::Mistake;
use super::state::{LiveStates, State};
use super::verb_context::{Acting, VerbContext};
use super::{Files, Script};
use crate::layout::DeviceLayout;
use crate::whole_script;
use core::cell::RefCell;
use rhai::{AST, CallFnOptions, Dynamic, Engine, Scope, Stmt};
use std::rc::Rc;

thread_local! {
    /// The scripts that this thread has compiled, each with its number and layout. A process has only few
    /// different scripts.
    static COMPILED: RefCell<Vec<(u64, *const DeviceLayout, Rc<Program>)>> = const { RefCell::new(Vec::new()) };
}

/// True for the constant `WRITTEN`. Functions do not need it as a variable, because they can only use it as
/// `global::WRITTEN`.
fn is_selection(statement: &Stmt) -> bool {
    matches!(statement, Stmt::Var(variable, ..) if variable.0.name.as_str() == WRITTEN)
}

/// A compiled script with its engine.
pub(super) struct Program {
    engine: Engine,
    ast: AST,
    files: Files,
    /// True if the script has constants or imports outside of functions. `WRITTEN` does not count.
    has_statements: bool,
    context: Rc<RefCell<VerbContext>>,
    meter: Rc<Meter>,
    live: RefCell<LiveStates>,
    /// Weight of the heaviest constant of the script.
    constants: u64,
}

/// Result of a call.
pub(super) struct Outcome {
    /// Error of the call. The state is then unchanged.
    pub(super) result: Result<(), Mistake>,
    /// The device after the call; always `Some`.
    pub(super) acting: Option<Acting>,
}

impl Program {
    /// Returns the script of this thread.
    ///
    /// # Errors
    /// The text is not a script.
    pub(super) fn of(script: &'static Script, layout: &'static DeviceLayout) -> Result<Rc<Self>, Mistake> {
        let key = (script.id, core::ptr::from_ref(layout));
        let known = COMPILED.with_borrow(|all| {
            all.iter().find(|(id, layout, _)| (*id, *layout) == key).map(|(.., program)| Rc::clone(program))
        });
        if let Some(known) = known {
            return Ok(known);
        }
        let program = Rc::new(Program::compile(script, layout)?);
        COMPILED.with_borrow_mut(|all| all.push((key.0, key.1, Rc::clone(&program))));
        Ok(program)
    }

    /// Compiles the files.
    ///
    /// # Errors
    /// The main file is not a script.
    fn compile(script: &Script, layout: &'static DeviceLayout) -> Result<Self, Mistake> {
        let Script { files, records, constants, .. } = script;
        let context = Rc::new(RefCell::new(VerbContext::new(layout, records)));
        let meter = Rc::new(Meter::default());
        let engine = engine(&context, &meter, files);
        let text = files.first().map_or("", |(_, text)| text);
        let ast = whole_script::compile(&engine, text)
            .map_err(|error| Mistake::misread(super::MAIN, text, layout, &error))?;
        context.borrow_mut().functions = Functions::of(&ast);
        let has_statements =
            !ast.statements().iter().all(is_selection) || text.contains(&format!("global::{WRITTEN}"));
        Ok(Program {
            engine,
            ast,
            files: Files::clone(files),
            has_statements,
            context,
            meter,
            live: RefCell::default(),
            constants: *constants,
        })
    }

    /// Calls a function with `state` as `this`, and takes over the changes of `this`. Counts its steps and time in `budget`.
    pub(super) fn call(
        &self,
        acting: Acting,
        budget: &mut Budget,
        state: &mut State,
        function: &str,
        arguments: Vec<Dynamic>,
    ) -> Outcome {
        let mut this = self.live.borrow_mut().take(state);
        let now = acting.now;
        self.context.borrow_mut().acting = Some(acting);
        budget.begin(&self.meter, now, state.weight().max(self.constants));
        // After the call, the state is compared and saved.
        self.meter.access(state.weight());
        let options = CallFnOptions::new().eval_ast(self.has_statements).bind_this_ptr(&mut this);
        let (mut scope, given) = (Scope::new(), arguments.len());
        let result =
            self.engine.call_fn_with_options::<Dynamic>(options, &mut scope, &self.ast, function, arguments);
        budget.end(&self.meter);
        let acting = self.context.borrow_mut().acting.take();
        let result = match result {
            Ok(_) => self.live.borrow_mut().put_back(this, state).map_err(|what| {
                self.placed(Mistake::new(format!("`this` after {function}: {what}")), function)
            }),
            Err(error) => Err(self.placed(Mistake::ran(&error, &self.engine, &self.files, given), function)),
        };
        Outcome { result, acting }
    }

    /// Adds a line to an error. If the engine reports no line, for example in an empty loop, adds the line of
    /// the function.
    fn placed(&self, mistake: Mistake, function: &str) -> Mistake {
        if mistake.line.is_some() || mistake.file != super::MAIN {
            return mistake;
        }
        let head = |line: &str| {
            let name = line
                .trim_start()
                .strip_prefix("fn ")
                .and_then(|rest| rest.trim_start().strip_prefix(function));
            name.is_some_and(|rest| rest.trim_start().starts_with('('))
        };
        let text = self.files.first().map_or("", |(_, text)| text);
        let line = text.lines().position(head).map(|index| index + 1);
        Mistake { line, ..mistake }
    }
}
