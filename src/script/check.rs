//! Checks a scenario for editors without running it. Uses the engine and the messages of a run.

pub(crate) use super::engine::is_plant_text;

use super::bench::Bench;
use super::complaint::{misread, no_function_among};
use super::engine::{Stage, engine, wrong_count};
use super::imports::{Namesake, namesakes};
use super::run::{Limits, limit};
use super::{ScenarioError, Span, Value, Verb};
use crate::layout::NamedLocation;
use crate::whole_script;
use core::cell::RefCell;
use rhai::{Engine, ParseError};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::Instant;

/// Functions of the language itself, which the engine does not list.
const OF_LANGUAGE: [&str; 12] = [
    "Fn",
    "call",
    "curry",
    "debug",
    "eval",
    "import",
    "is_def_fn",
    "is_def_var",
    "is_shared",
    "print",
    "switch",
    "type_of",
];

/// A text that is no script.
pub(crate) struct Misreading {
    /// Line of the mistake, counted from 1; `None` at the end of the text.
    pub line: Option<usize>,
    /// Column of the mistake, counted from 1, in characters.
    pub column: Option<usize>,
    /// Description of the error.
    pub what: String,
}

/// The engine of scenarios, which compiles scripts and runs none. Only [`super::with_stack`] gives a thread enough stack for it.
pub(crate) struct Checker {
    engine: Engine,
    functions: BTreeSet<String>,
}

impl Checker {
    /// Returns an engine with the verbs and limits of scenarios.
    pub(crate) fn new() -> Self {
        let stage = Rc::new(RefCell::new(Stage::new(None, PathBuf::new(), Bench::LIMIT_US)));
        let mut engine = engine(&stage);
        limit(&mut engine, Limits::default(), Instant::now());
        let names =
            engine.collect_fn_metadata(None, |function| Some(function.metadata.name.to_string()), true);
        let functions = names.into_iter().chain(OF_LANGUAGE.map(str::to_owned)).collect();
        Self { engine, functions }
    }

    /// Returns the first error of the parser.
    pub(crate) fn misreading(&self, text: &str) -> Option<Misreading> {
        let ParseError(reason, position) = whole_script::compile(&self.engine, text).err()?;
        let line = position.line();
        let source = line.and_then(|line| text.split('\n').nth(line.checked_sub(1)?));
        let what = misread(&reason, source.unwrap_or_default());
        Some(Misreading { line, column: position.position(), what })
    }

    /// Returns the functions that a run of the script `text` in this file would refuse, because an imported script has
    /// them, too. `read` returns the text of a file.
    pub(crate) fn namesakes(
        &self,
        file: &Path,
        text: &str,
        read: &dyn Fn(&Path) -> Option<String>,
    ) -> Option<Namesake> {
        namesakes(&self.engine, file, text, read)
    }

    /// True if a script can call a function of this name without defining it.
    pub(crate) fn knows(&self, name: &str) -> bool {
        self.functions.contains(name)
    }
}

/// True if this is a function of the language itself.
pub(crate) fn is_of_language(name: &str) -> bool {
    OF_LANGUAGE.contains(&name)
}

/// Returns the message for a call of a function that does not exist, in a script with these verbs.
pub(crate) fn unknown_function(name: &str, verbs: &[Verb]) -> String {
    no_function_among(name, &[], verbs)
}

/// Returns the message for a call of a verb with the wrong number of arguments; `None` if one of `verbs` has this
/// number.
pub(crate) fn argument_count(verbs: &[Verb], name: &str, count: usize) -> Option<String> {
    let fits = verbs.iter().any(|verb| verb.parameters.len() == count);
    (!fits).then(|| wrong_count(&verbs.iter().collect::<Vec<_>>(), name, count).to_string())
}

/// Returns the message for a value that the register cannot hold. `is_pattern` is true for a mask, and for a value under a
/// mask.
pub(crate) fn refused_value(place: &NamedLocation, value: &Value, is_pattern: bool) -> Option<String> {
    let bits = if is_pattern { value.pattern(place) } else { value.bits(place) };
    bits.err().map(|error| error.to_string())
}

/// The kind of object that the text of an argument names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ArgumentKind {
    Register,
    /// A register or an area.
    RegisterOrArea,
    /// An array of registers.
    Registers,
    Area,
    Port,
    Bus,
    Plc,
    Drive,
    /// The name of a function block.
    Block,
    /// The place of a function block.
    Place,
    /// A plant file, or its text.
    Plant,
    /// A fault with its fields.
    Fault,
    /// Settings of a board.
    Board,
    /// A value of the register that another argument names.
    Value,
    /// A time with a unit.
    Time,
    /// An array of rules of the access checker.
    Rules,
}

impl ArgumentKind {
    /// Returns the kind of a verb's parameter; `None` if any text is right.
    pub(crate) fn of(verb: &str, parameter: &str) -> Option<Self> {
        Some(match (verb, parameter) {
            (_, "register" | "address") => Self::Register,
            (_, "registers") => Self::Registers,
            ("record", "what") => Self::RegisterOrArea,
            (_, "area") => Self::Area,
            (_, "node") => Self::Port,
            (_, "bus") => Self::Bus,
            (_, "plc") => Self::Plc,
            ("drive", "name") => Self::Drive,
            ("block", "name") => Self::Block,
            ("block", "place") => Self::Place,
            ("plant", _) => Self::Plant,
            ("fault", "words") => Self::Fault,
            ("set_board", "words") => Self::Board,
            (_, "value" | "expected" | "new" | "mask" | "values" | "request" | "answer") => Self::Value,
            (_, "within" | "time") => Self::Time,
            (_, "rules") => Self::Rules,
            _ => return None,
        })
    }
}

/// Checks the text of an argument as a verb would check it. `bench` has a plant for this purpose only.
///
/// # Errors
/// The error that the verb would report.
pub(crate) fn argument(bench: &mut Bench, kind: ArgumentKind, text: &str) -> Result<(), ScenarioError> {
    match kind {
        ArgumentKind::Register | ArgumentKind::Registers => bench.find(text).map(drop),
        ArgumentKind::RegisterOrArea => bench.area(text).map(drop).or_else(|_| bench.find(text).map(drop)),
        ArgumentKind::Area => bench.area(text).map(drop),
        ArgumentKind::Bus => bench.bus(text).map(drop),
        ArgumentKind::Plc => bench.only_plc(text).map(drop),
        ArgumentKind::Drive => bench.drive(text).map(drop),
        ArgumentKind::Fault => {
            let added = bench.fault(text).map(drop);
            // Faults of earlier lines are cleared, so that each fault is checked in a plant without faults.
            bench.clear_faults()?;
            added
        }
        ArgumentKind::Time => Span::Text(text.to_owned()).us().map(drop),
        // These texts are not checked: the verb would change the plant, or another argument decides the meaning of the
        // text.
        ArgumentKind::Block
        | ArgumentKind::Place
        | ArgumentKind::Port
        | ArgumentKind::Plant
        | ArgumentKind::Board
        | ArgumentKind::Value
        | ArgumentKind::Rules => Ok(()),
    }
}
