//! `commram fault`: fault injection.

use super::Instance;
use super::error::CliError;
use super::number::{NumberError, within};
use super::table::FormatArg;
use crate::devices;
use crate::fault::FaultKind;
use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Args as ClapArgs, Subcommand};
use core::fmt::Write as _;
use std::ffi::OsStr;
use std::num::NonZeroU16;

/// Inject faults: lost frames, silent slaves, BUS-off ...
///
/// Faults act on the simulated bus, on slaves and on nodes. The registers show them as on the device. `commram
/// trace --kind fault` shows when each of them takes effect. docs/reference/faults.md describes every kind.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram fault add lose_frame slot=WRC1 count=3
  commram fault list
  commram fault clear --all")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Add(Add),
    List(List),
    Clear(Clear),
}

/// Add a fault and print its number.
///
/// A fault has a kind and fields, the same as in a `[[fault]]` of the plant file. Times can also be given with a
/// unit: duration=5ms for duration_us=5000. Without `at` the fault begins at once. Without `count` and `duration`
/// it lasts until it is cleared, unless its kind happens only once. The bus or PLC can be omitted if there is only
/// one.
#[derive(ClapArgs)]
#[command(after_help = kinds())]
struct Add {
    /// The kind of fault: lose_frame, slave_busy ...
    #[arg(value_parser = KindParser, hide_possible_values = true)]
    kind: String,
    /// Fields of the fault
    #[arg(add = super::complete::fault_fields(), value_name = "FIELD=VALUE")]
    fields: Vec<String>,
    #[command(flatten)]
    instance: Instance,
}

/// Help text: the fields that all kinds have, and an example of each kind.
fn kinds() -> String {
    let mut text = "\
Fields of all kinds:
  at=2s          begin, emulated time since power-on
  count=3        ends after this number of hits, if the kind has hits
  duration=5ms   ends after this emulated time

Examples, one of each kind:"
        .to_owned();
    for kind in devices::fault_kinds() {
        let (about, name, example) = (kind.about(), kind.name(), kind.example());
        let once = if kind.happens_once() { ", once" } else { "" };
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  # {about}{once}\n  commram fault add {name} {example}");
    }
    text
}

/// Accepts any text: an unknown kind is refused when the fields are checked. The parser exists so that shells can
/// complete the existing kinds.
#[derive(Clone)]
struct KindParser;

impl TypedValueParser for KindParser {
    type Value = String;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let value = |kind: &&FaultKind| PossibleValue::new(kind.name()).help(kind.about());
        Some(Box::new(devices::fault_kinds().iter().map(value)))
    }
}

/// List the pending and active faults.
///
/// Faults that have ended are not listed; `commram trace --kind fault` shows them.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram fault list
  commram fault list --format json")]
struct List {
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Clear faults by their numbers.
///
/// Clearing does not undo their effects: a PLC must reset a BUS-off node.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram fault clear 2
  commram fault clear 3 4
  commram fault clear --all")]
struct Clear {
    /// Numbers of the faults, as `add` and `list` print them
    #[arg(add = super::complete::fault_numbers(), value_name = "NUMBER", required_unless_present = "all", value_parser = number)]
    numbers: Vec<NonZeroU16>,
    /// All faults
    #[arg(long, conflicts_with = "numbers")]
    all: bool,
    #[command(flatten)]
    instance: Instance,
}

fn number(text: &str) -> Result<NonZeroU16, NumberError> {
    let number = within::<u16>(1..=u16::MAX.into())(text)?;
    NonZeroU16::new(number).ok_or(NumberError::AtLeast(1))
}

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Add(args) => {
            let name = args.kind.replace('-', "_");
            // Only an instance knows the kinds that its devices declare.
            let kinds = devices::fault_kinds();
            if kinds.iter().any(|kind| kind.name() == name) {
                by_channel::read(args, kinds)?;
            }
            by_channel::add(args)
        }
        Command::List(args) => by_channel::list(args.format.format, &args.instance),
        Command::Clear(args) => by_channel::clear(&args.numbers, &args.instance),
    }
}

mod by_channel {
    use super::super::session::Session;
    use super::super::table::{self, Format, Row};
    use super::super::{Instance, error::CliError, output};
    use super::Add;
    use crate::devices;
    use crate::fault::{FaultKind, FaultSpec, FaultStatus};
    use crate::journal::Names;
    use crate::request::Op;
    use crate::request::json::faults::FaultJson;
    use serde::Serialize;
    use std::num::NonZeroU16;

    /// A fault of the list.
    #[derive(Serialize)]
    struct Entry {
        #[serde(flatten)]
        fault: FaultJson,
        #[serde(skip)]
        text: String,
    }

    impl Row for Entry {
        const COLUMNS: &'static [&'static str] = &["number", "state", "hits", "fault"];

        fn cells(&self) -> Vec<String> {
            let Entry { fault: FaultJson { number, state, hits, .. }, text } = self;
            vec![number.to_string(), (*state).to_owned(), hits.to_string(), text.clone()]
        }
    }

    fn names(session: &Session) -> Result<Names, CliError> {
        Ok(session.ask(Op::Info)?.info()?.names)
    }

    /// Reads the description of a fault.
    pub(super) fn read(args: &Add, kinds: &[&'static FaultKind]) -> Result<FaultSpec, CliError> {
        let spec = FaultSpec::from_words(kinds, &args.kind, &args.fields)?;
        if spec.required {
            let right =
                "only a scenario can require that a fault takes effect: fault(\"... required\")".to_owned();
            return Err(CliError::Argument { text: "required".to_owned(), right });
        }
        Ok(spec)
    }

    pub(super) fn add(args: &Add) -> Result<(), CliError> {
        let session = Session::open(&args.instance, 0)?;
        let names = names(&session)?;
        let kinds = devices::emulation::catalogue::fault_kinds_of(&names);
        let fault = read(args, &kinds)?.resolve(&kinds, &names)?;
        let id = session.ask(Op::FaultAdd { fault })?.fault_added()?;
        output::print(&format!("{id}\n"))
    }

    pub(super) fn list(format: Format, instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let names = names(&session)?;
        let entry = |status: &FaultStatus| Entry {
            fault: FaultJson::new(status, &names),
            text: status.fault.text(&names),
        };
        let entries: Vec<_> = session.ask(Op::FaultList)?.faults()?.iter().map(entry).collect();
        table::print(format, &entries, |entries| match entries {
            [] => "no faults\n".to_owned(),
            entries => table::aligned(entries),
        })
    }

    pub(super) fn clear(numbers: &[NonZeroU16], instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let one = |id: &NonZeroU16| Op::FaultClear { id: Some(*id) };
        let ops: Vec<_> = if numbers.is_empty() {
            vec![Op::FaultClear { id: None }]
        } else {
            numbers.iter().map(one).collect()
        };
        session.request(&ops).map(|_| ())
    }
}
