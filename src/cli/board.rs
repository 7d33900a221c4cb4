//! `commram board`: front panel, supply and program start of a PLC.

use super::Instance;
use super::complete;
use super::error::CliError;
use super::table::{self, FormatArg, Row};
use crate::devices;
use crate::devices::{Led, ModuleFront, Switch};
use crate::identity::DeviceIndex;
use crate::layout::{FrontWord, shown_text};
use crate::memory::header::{BoardAssignment, BoardSetting, BoardWords};
use clap::Subcommand;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

/// Show the board of a PLC, set its switches, reset it, switch it off and on.
///
/// A new DIP switch setting takes effect at the next power-on or reset. A PLC in RESET or without supply leaves its
/// buses; other PLCs continue.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram board get
  commram board get line2 --format json
  commram board set dip=5 switch=stop
  commram board set line2:power=off
  commram board set maxx:slotH.dip=7
  commram board set panel:s1=unlock panel:program=stop
  commram board set start=cold
  commram board set project=sent
  commram board reset
  commram board power-cycle line2")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Show the board of each PLC, or of one
    Get {
        /// Name of the PLC
        #[arg(add = complete::plcs())]
        plc: Option<String>,
        #[command(flatten)]
        format: FormatArg,
        #[command(flatten)]
        instance: Instance,
    },
    /// Set switches: dip (0 to 31), leds (0 to 15), switch (run, stop, reset), power (on, off), start (cold, warm,
    /// hot, stop), project (none, boot, sent); of a module: slotH.dip; and the other switches that the front panel of a
    /// device has
    Set {
        /// Switches and their new values, with the PLC in front if there are several
        #[arg(add = complete::settings(), value_name = "NAME=VALUE", required = true)]
        settings: Vec<String>,
        #[command(flatten)]
        instance: Instance,
    },
    /// Press RESET and release it, which leaves the switch at STOP
    Reset {
        /// Name of the PLC
        #[arg(add = complete::plcs())]
        plc: Option<String>,
        #[command(flatten)]
        instance: Instance,
    },
    /// Switch the supply off and on
    PowerCycle {
        /// Name of the PLC
        #[arg(add = complete::plcs())]
        plc: Option<String>,
        #[command(flatten)]
        instance: Instance,
    },
}

/// The board of one PLC. A field is empty if the PLC does not have this element.
#[derive(Serialize)]
pub(crate) struct Entry {
    plc: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    display: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    leds: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    switch: Option<String>,
    power: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    dip: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dip_latched: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    program: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<String>,
    restarts: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    project: Option<String>,
    #[serde(flatten)]
    front: Front,
    #[serde(flatten)]
    modules: Modules,
}

/// Switches and displays that only this type of device has.
struct Front(Vec<(&'static FrontWord, u32)>);

impl Serialize for Front {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.words().map(|(word, value)| {
            // A value without a name is shown as a number.
            let called = word.called(*value);
            let number = word.ty.number(*value);
            let value = if called == number.to_string() { Value::from(number) } else { called.into() };
            (word.name, value)
        }))
    }
}

impl Front {
    /// Returns the words of the front panel that have named values, without the words of the display text.
    fn words(&self) -> impl Iterator<Item = &(&'static FrontWord, u32)> {
        self.0.iter().filter(|(word, _)| !word.is_text)
    }
}

/// Returns the front panels as lines of text for the terminal.
fn front_lines(entries: &[Entry]) -> String {
    let line = |entry: &Entry| {
        let words = entry.front.words().map(|(word, value)| format!("{} {}", word.name, word.called(*value)));
        vec![entry.plc.clone(), words.collect::<Vec<_>>().join(", ")]
    };
    let mut lines: Vec<_> = entries.iter().filter(|entry| !entry.front.0.is_empty()).map(line).collect();
    if lines.is_empty() {
        return String::new();
    }
    lines.insert(0, ["FRONT", "SHOWS"].map(str::to_owned).to_vec());
    format!("\n{}", table::columns(&lines))
}

/// The modules of a PLC by slot; `None` if the PLC is not modular.
struct Modules(Option<Vec<(&'static str, ModuleFront)>>);

impl Serialize for Modules {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let modules = self.0.iter().map(|modules| {
            let module = |(port, front): &(&str, ModuleFront)| ((*port).to_owned(), module_json(front));
            ("modules", modules.iter().map(module).collect::<Map<_, _>>())
        });
        serializer.collect_map(modules)
    }
}

fn module_json(front: &ModuleFront) -> Value {
    let led = |(name, led): &(&str, Led)| {
        let shown = match led {
            Led::Off => "off".into(),
            Led::On => "on".into(),
            Led::Flashes(count) => Value::from(*count),
            Led::InTurn => "in_turn".into(),
        };
        ((*name).to_owned(), shown)
    };
    let switch = |(name, switch): &(&str, Switch)| {
        let position = match switch {
            Switch::Number(number) => Value::from(*number),
            Switch::Is(on) => Value::from(*on),
        };
        ((*name).to_owned(), position)
    };
    let mut module = Map::from_iter([("kind".to_owned(), front.kind.into())]);
    module.extend(front.switches.iter().map(switch));
    module.insert("leds".to_owned(), front.leds.iter().map(led).collect::<Map<_, _>>().into());
    module.into()
}

/// Returns the modules as lines of text for the terminal.
fn module_lines(entries: &[Entry]) -> String {
    let mut lines = Vec::new();
    for Entry { plc, modules: Modules(modules), .. } in entries {
        for (port, front) in modules.iter().flatten() {
            let switches = front.switches.iter().map(|(name, switch)| match switch {
                Switch::Number(number) => format!("{name} {number}"),
                Switch::Is(true) => format!("{name} on"),
                Switch::Is(false) => format!("{name} off"),
            });
            let leds = front.leds.iter().map(|(name, led)| match led {
                Led::Off => format!("{name} off"),
                Led::On => format!("{name} on"),
                Led::Flashes(1) => format!("{name} flashes once"),
                Led::Flashes(count) => format!("{name} flashes {count} times"),
                Led::InTurn => format!("{name} flashes in turn"),
            });
            let join = |texts: Vec<String>| texts.join(", ");
            lines.push(vec![
                format!("{plc}:{port}"),
                front.kind.to_owned(),
                join(switches.collect()),
                join(leds.collect()),
            ]);
        }
    }
    if lines.is_empty() {
        return String::new();
    }
    lines.insert(0, ["MODULE", "KIND", "DIP SWITCHES", "LEDS"].map(str::to_owned).to_vec());
    format!("\n{}", table::columns(&lines))
}

impl Row for Entry {
    const COLUMNS: &'static [&'static str] = &[
        "plc",
        "display",
        "leds",
        "switch",
        "power",
        "dip",
        "dip_latched",
        "program",
        "start",
        "restarts",
        "project",
    ];

    fn cells(&self) -> Vec<String> {
        let text = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
        let number = |number: Option<u32>| number.map_or_else(|| "-".to_owned(), |it| it.to_string());
        let is_dark = self.display.as_ref().is_some_and(|shown| shown.trim().is_empty());
        vec![
            self.plc.clone(),
            if is_dark { "dark".to_owned() } else { text(&self.display) },
            text(&self.leds),
            text(&self.switch),
            self.power.clone(),
            number(self.dip),
            number(self.dip_latched),
            text(&self.program),
            text(&self.start),
            self.restarts.to_string(),
            text(&self.project),
        ]
    }
}

impl Entry {
    fn new(plc: &str, words: BoardWords, front: Front, modules: Modules) -> Self {
        let BoardWords { display, leds, switch, power, dip, dip_latched, program, start, restarts, project } =
            words;
        let plc = plc.to_owned();
        let display = shown_text(&front.0).or(display);
        Entry {
            plc,
            display,
            leds,
            switch,
            power,
            dip,
            dip_latched,
            program,
            start,
            restarts,
            project,
            front,
            modules,
        }
    }
}

/// Runs `commram board`.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Get { plc, format, instance } => get(plc.as_deref(), format, instance),
        Command::Set { settings, instance } => {
            let words = settings.iter().map(|text| BoardAssignment::parse(text));
            set(instance, &words.collect::<Result<Vec<_>, _>>()?)
        }
        Command::Reset { plc, instance } => one("reset", plc.as_deref(), BoardSetting::Reset, instance),
        Command::PowerCycle { plc, instance } => {
            one("power-cycle", plc.as_deref(), BoardSetting::PowerCycle, instance)
        }
    }
}

fn one(command: &str, plc: Option<&str>, setting: BoardSetting, instance: &Instance) -> Result<(), CliError> {
    set(instance, &[BoardAssignment::of(command, plc, setting)])
        .map_err(|error| error.with_command(|plc| format!("commram board {command} {plc}")))
}

fn get(plc: Option<&str>, format: &FormatArg, instance: &Instance) -> Result<(), CliError> {
    use super::session::Session;
    let rows = entries(&Session::open_for_reading(instance)?, plc)?;
    table::print(format.format, &rows, |rows| table::aligned(rows) + &front_lines(rows) + &module_lines(rows))
}

/// Returns the boards of all PLCs, or of PLC `plc`.
///
/// # Errors
/// The instance has no such PLC, or the emulator has ended.
pub(crate) fn entries(session: &super::session::Session, plc: Option<&str>) -> Result<Vec<Entry>, CliError> {
    let only = plc.map(|plc| session.plc(Some(plc), plc)).transpose()?;
    let boards = session.boards()?;
    let mut rows = Vec::with_capacity(boards.len());
    for (number, (plc, state)) in DeviceIndex::enumerate(&boards) {
        if only.is_none_or(|only| only == number) {
            let front = Front(session.front(number)?);
            let words = state.words(devices::board_of(session.device(number)));
            rows.push(Entry::new(plc, words, front, Modules(session.modules(number)?)));
        }
    }
    Ok(rows)
}

/// Sends all settings in one message.
fn set(instance: &Instance, words: &[BoardAssignment<'_>]) -> Result<(), CliError> {
    use super::session::Session;
    use crate::channel::ClientError;
    use crate::request::Reply;
    let session = Session::open(instance, 0)?;
    // Checks all settings before the first one is set.
    let ops = words.iter().map(|word| operation(&session, word)).collect::<Result<Vec<_>, CliError>>()?;
    // A setting can depend on an earlier one, so the emulator checks it only when the earlier ones have taken effect.
    // An error therefore names the settings that were made.
    for (done, reply) in session.replies(&ops)?.into_iter().enumerate() {
        let Reply::Error(refused) = reply else { continue };
        if done > 0 {
            let done: Vec<_> = words.iter().take(done).map(|word| word.text).collect();
            super::output::note(&format!("set before the error: {}", done.join(" ")));
        }
        return Err(ClientError::Refused(refused).into());
    }
    Ok(())
}

/// Returns the operation for a setting.
///
/// # Errors
/// The instance has no such PLC, or the PLC has no such switch.
pub(crate) fn operation(
    session: &super::session::Session,
    word: &BoardAssignment<'_>,
) -> Result<crate::request::Op, CliError> {
    let plc = session.plc(word.plc, word.text)?;
    let setting = word.at(session.device(plc))?;
    has_switch(session, plc, setting)?;
    Ok(crate::request::Op::SetBoard { plc, setting })
}

/// Refuses a switch that the PLC does not have, or that the module in the slot does not have.
fn has_switch(
    session: &super::session::Session,
    plc: DeviceIndex,
    setting: BoardSetting,
) -> Result<(), CliError> {
    use crate::channel::ClientError;
    use crate::request::Refused;
    let device = session.device(plc);
    let has = match setting {
        BoardSetting::ModuleDip { port, .. } => {
            let named = device.port_numbered(port).map_or("", |port| port.name);
            let modules = session.modules(plc)?.unwrap_or_default();
            modules
                .iter()
                .any(|(slot, front)| *slot == named && front.switches.iter().any(|(name, _)| *name == "dip"))
        }
        BoardSetting::Front { .. }
        | BoardSetting::Power(_)
        | BoardSetting::Reset
        | BoardSetting::PowerCycle => true,
        _ => devices::board_of(device).contains(&setting.name()),
    };
    if has {
        return Ok(());
    }
    let name = session.plcs().get(plc.index()).map_or("", String::as_str);
    Err(ClientError::Refused(Refused::no_such_switch(name, device, setting)).into())
}
