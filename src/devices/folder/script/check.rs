//! Checks of the text of a script before it runs.

use super::budget::{Budget, Meter};
use super::engine::{MISSING, MOST_ARGUMENTS, engine};
use super::functions::Functions;
use super::mistake::Mistake;
use super::verb_context::VerbContext;
use super::verbs::{CHANGING, OF_PORT, OF_REGISTERS};
use super::{Hooks, MAIN, Script, weight};
use crate::devices::can_bus;
use crate::devices::folder::own_records::OwnRecord;
use crate::devices::folder::state_word::may_change;
use crate::layout::{DeviceLayout, Owner, did_you_mean};
use crate::namesakes::Namesakes;
use crate::whole_script::{self, call_of};
use core::cell::RefCell;
use rhai::{AST, ASTNode, Array, Dynamic, Expr, FnCallExpr, Position, Scope, Stmt};
use std::collections::BTreeSet;
use std::rc::Rc;

/// The parts of a script.
pub(super) struct Found {
    pub(super) hooks: Hooks,
    /// Names of the registers of the hook `written`, if the script selects them.
    pub(super) written: Option<Vec<String>>,
    /// Names of the imported files.
    pub(super) imports: Vec<String>,
    /// Weight of the heaviest constant.
    pub(super) constants: u64,
}

/// A line and its error.
type Wrong = (Position, String);

/// The correction for a script that needs a port.
const DECLARE_PORT: &str = "declare it in device.toml: \
    port = [{ name = \"can\", number = 1, medium = \"can\", roles = [\"peer\"] }]";

/// Name of the constant that selects the registers of the hook `written` (D-822).
pub(super) const WRITTEN: &str = "WRITTEN";

/// Checks all files of a script. Finds the hooks in the main file, the registers of the hook `written`, and the names
/// of the imported files.
///
/// # Errors
/// [`Mistake`] with file and line.
pub(super) fn check(script: &Script, layout: &'static DeviceLayout) -> Result<Found, Mistake> {
    let (context, meter) =
        (Rc::new(RefCell::new(VerbContext::new(layout, &script.records))), Rc::new(Meter::default()));
    let engine = engine(&context, &meter, &script.files);
    let (mut hooks, mut written, mut named, mut later) = (Hooks::default(), None, Named::default(), None);
    let (mut namesakes, mut constants, mut budget) = (Namesakes::default(), 0, Budget::default());
    for (file, text) in script.files.iter() {
        let compiled = whole_script::compile(&engine, text);
        let mut ast = compiled.map_err(|error| Mistake::misread(file, text, layout, &error))?;
        ast.set_source(file.as_str());
        let at = |(position, what): Wrong| Mistake { file: file.clone(), line: position.line(), what };
        let records = &script.records;
        let functions = Functions::of(&ast);
        // The main file is the first one.
        let later = later.get_or_insert_with(|| Functions::of(&ast));
        Calls { layout, records, functions, later }.check(&ast).map_err(at)?;
        named.collect(&ast);
        constants = weight::of_constants(&ast).max(constants);
        let added = namesakes.add(file, &ast);
        added.map_err(|what| Mistake { file: file.clone(), ..Mistake::new(what) })?;
        if file == MAIN {
            hooks = hooks_of(&ast)?;
            check_port(script, hooks, layout)?;
        }
        // Runs the statements outside of functions. They may be constants and imports; a verb causes an error
        // here. All files together may take the steps of one millisecond.
        budget.begin(&meter, 0, constants);
        let mut scope = Scope::new();
        let ran = engine.run_ast_with_scope(&mut scope, &ast);
        budget.end(&meter);
        constants = scope.iter_raw().map(|(.., value)| weight::of(value)).fold(constants, u64::max);
        ran.map_err(|error| {
            let mistake = Mistake::ran(&error, &engine, &script.files, 0);
            // For an error in the statements outside of functions, the engine names no file. So the name is
            // added here.
            if mistake.file == MAIN { Mistake { file: file.clone(), ..mistake } } else { mistake }
        })?;
        if file == MAIN && scope.contains(WRITTEN) {
            written = Some(written_registers(&scope, layout, hooks)?);
        }
    }
    named.check_hooks(script)?;
    let imports = match named.imports_any {
        true => script.files.iter().map(|(file, _)| file.clone()).collect(),
        false => named.imports,
    };
    Ok(Found { hooks, written, imports, constants })
}

/// Returns the names in the constant `WRITTEN`.
fn written_registers(
    scope: &Scope<'_>,
    layout: &'static DeviceLayout,
    hooks: Hooks,
) -> Result<Vec<String>, Mistake> {
    let wrong = |what: String| Mistake::new(format!("{WRITTEN}: {what}"));
    if !hooks.written {
        return Err(wrong("there is no hook written(register, old, value) for these registers".to_owned()));
    }
    let right = || wrong("write an array of names of registers, as [\"card.w_COMMAND\"]".to_owned());
    let names: Array = scope.get_value(WRITTEN).ok_or_else(right)?;
    let names = names.into_iter().map(Dynamic::into_string).collect::<Result<Vec<_>, _>>();
    let names = names.map_err(|_| right())?;
    for name in &names {
        let registers = layout.registers(name).map_err(|error| wrong(error.to_string()))?;
        if registers.iter().all(|register| register.register.owner == Owner::Firmware) {
            return Err(wrong(format!(
                "the program does not write `{name}`, which has the owner \"firmware\""
            )));
        }
    }
    Ok(names)
}

/// Returns the hooks of the main file.
fn hooks_of(ast: &AST) -> Result<Hooks, Mistake> {
    let mut hooks = Hooks::default();
    for function in ast.iter_functions() {
        let Some(flag) = hooks.flag(function.name) else { continue };
        let known = Hooks::ALL.iter().find(|(name, _)| *name == function.name);
        let parameters = known.map_or(&[][..], |(_, parameters)| parameters);
        if function.params.len() != parameters.len() {
            let (name, right) = (function.name, parameters.join(", "));
            return Err(Mistake::new(format!("the hook {name} is a function {name}({right})")));
        }
        *flag = true;
    }
    Ok(hooks)
}

/// True if the device has a CAN port, the port whose frames the script handles.
fn has_can_port(layout: &DeviceLayout) -> bool {
    layout.ports.iter().any(|port| port.medium == can_bus::FAMILY)
}

/// If the device has no CAN port, refuses hooks for events of a port.
fn check_port(script: &Script, mut hooks: Hooks, layout: &'static DeviceLayout) -> Result<(), Mistake> {
    let has = |name: &&&str| hooks.flag(name).is_some_and(|flag| *flag);
    match Hooks::OF_PORT.iter().find(has) {
        Some(name) if !has_can_port(layout) => Err(Mistake {
            line: line_of(script, name),
            ..Mistake::new(format!("the hook {name} needs a port; {DECLARE_PORT}"))
        }),
        _ => Ok(()),
    }
}

/// The names that the files of a script use.
#[derive(Default)]
struct Named {
    /// Functions that are called, and all texts. A text counts because it may be the name of a function that
    /// is called later.
    used: BTreeSet<String>,
    /// Functions of the main file.
    functions: Functions,
    /// Names of imported files.
    imports: Vec<String>,
    /// True if an import computes the name of its file.
    imports_any: bool,
}

impl Named {
    fn collect(&mut self, ast: &AST) {
        if ast.source() == Some(MAIN) {
            self.functions = Functions::of(ast);
        }
        ast.walk(&mut |path: &[ASTNode<'_>]| {
            if let Some(call) = path.last().and_then(call_of) {
                self.used.insert(call.name.to_string());
                // The walk through the syntax tree does not visit all arguments of a call, so they are
                // visited here.
                let texts = (0..call.args.len()).filter_map(|argument| text(call, argument));
                self.used.extend(texts.map(str::to_owned));
            }
            match path.last() {
                Some(ASTNode::Expr(Expr::StringConstant(text, _))) => {
                    self.used.insert(text.to_string());
                }
                Some(ASTNode::Stmt(Stmt::Import(import, _))) => {
                    match &import.0 {
                        Expr::StringConstant(name, _) => {
                            self.imports.push(format!("{}.rhai", name.trim_end_matches(".rhai")));
                        }
                        // The script computes the name, so it may import any file.
                        _ => self.imports_any = true,
                    }
                }
                _ => {}
            }
            true
        });
    }

    /// Refuses a function that is never called if its name is similar to that of a hook.
    fn check_hooks(&self, script: &Script) -> Result<(), Mistake> {
        let hooks = || Hooks::ALL.iter().map(|(name, _)| *name);
        let is_unused = |name: &str| !self.used.contains(name) && hooks().all(|hook| hook != name);
        for name in self.functions.names().filter(|name| is_unused(name)) {
            let hint = did_you_mean(name, hooks());
            if !hint.is_empty() {
                let what = format!("nothing calls the function `{name}`{hint}");
                return Err(Mistake { line: line_of(script, name), ..Mistake::new(what) });
            }
        }
        Ok(())
    }
}

/// Returns the line of a function of the main file.
fn line_of(script: &Script, function: &str) -> Option<usize> {
    let (_, text) = script.files.first()?;
    let head = format!("fn {function}(");
    text.lines().position(|line| line.contains(&head)).map(|index| index + 1)
}

/// Checks of the calls in a file.
struct Calls<'a> {
    layout: &'static DeviceLayout,
    records: &'a [OwnRecord],
    /// Functions of this file.
    functions: Functions,
    /// Functions that `after` and `at` call.
    later: &'a Functions,
}

impl Calls<'_> {
    /// Returns the first mistake of the file. The engine visits the functions in any order.
    fn check(&self, ast: &AST) -> Result<(), Wrong> {
        let mut first: Option<Wrong> = None;
        ast.walk(&mut |path: &[ASTNode<'_>]| {
            let found = match path.last() {
                Some(ASTNode::Expr(Expr::FnCall(call, at)) | ASTNode::Stmt(Stmt::FnCall(call, at))) => {
                    self.call(call, *at)
                }
                Some(ASTNode::Expr(Expr::MethodCall(call, at))) => any_call(call, *at),
                Some(ASTNode::Expr(Expr::Variable(variable, _, at))) => spelling(&variable.1, *at),
                _ => Ok(()),
            };
            if let Err(wrong) = found
                && first.as_ref().is_none_or(|first| wrong.0 < first.0)
            {
                first = Some(wrong);
            }
            true
        });
        first.map_or(Ok(()), Err)
    }

    /// Checks the texts in a call that are names of registers or functions.
    fn call(&self, call: &FnCallExpr, at: Position) -> Result<(), Wrong> {
        any_call(call, at)?;
        let name = call.name.as_str();
        if self.functions.contains(name) {
            return Ok(());
        }
        if let (Some((_, is_single)), Some(register)) =
            (OF_REGISTERS.iter().find(|(verb, _)| *verb == name), text(call, 0))
        {
            let found = match is_single {
                true => self.layout.register(register).map(|register| vec![register]),
                false => self.layout.registers(register),
            };
            let found = found.map_err(|error| (at, error.to_string()))?;
            if CHANGING.contains(&name) {
                found.iter().try_for_each(may_change).map_err(|what| (at, what))?;
            }
            return Ok(());
        }
        if OF_PORT.contains(&name) && !has_can_port(self.layout) {
            return Err((at, format!("`{name}` needs a port; {DECLARE_PORT}")));
        }
        if name == "record"
            && let Some(kind) = text(call, 0)
        {
            return OwnRecord::find(self.records, kind).map(drop).map_err(|what| (at, what));
        }
        if ["after", "at"].contains(&name)
            && let Some(function) = text(call, 1)
        {
            return self.later.check_later(function, array_length(call, 2)).map_err(|what| (at, what));
        }
        Ok(())
    }
}

/// Refuses a truth value in the spelling of PLC languages. Otherwise the engine would search for a variable
/// of this name only when the script runs. Other words of these languages are syntax errors.
fn spelling(variable: &str, at: Position) -> Result<(), Wrong> {
    match variable {
        "TRUE" | "FALSE" => Err((at, format!("`{variable}`: write `{}`", variable.to_ascii_lowercase()))),
        _ => Ok(()),
    }
}

/// Checks the rules that apply to calls of both functions and methods.
fn any_call(call: &FnCallExpr, at: Position) -> Result<(), Wrong> {
    if MISSING.contains(&call.name.as_str()) {
        return Err((at, format!("scripts of devices have no `{}`", call.name)));
    }
    if call.args.len() > MOST_ARGUMENTS {
        let count = call.args.len();
        return Err((at, format!("a call with {count} arguments; it has at most {MOST_ARGUMENTS}")));
    }
    Ok(())
}

/// Returns the number of elements of the argument, if it is an array in the text of the script. An argument that is
/// left out is empty.
fn array_length(call: &FnCallExpr, argument: usize) -> Option<usize> {
    match call.args.get(argument) {
        None => Some(0),
        Some(Expr::Array(elements, _)) => Some(elements.len()),
        Some(Expr::DynamicConstant(value, _)) => value.read_lock::<Array>().map(|array| array.len()),
        Some(_) => None,
    }
}

/// Returns the argument, if it is a text.
fn text(call: &FnCallExpr, argument: usize) -> Option<&str> {
    match call.args.get(argument)? {
        Expr::StringConstant(text, _) => Some(text),
        _ => None,
    }
}
