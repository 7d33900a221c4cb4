//! The verbs of boards.

use super::arguments::{number, value};
use super::{Verbs, int};
use crate::devices::{Led, ModuleFront, Switch};
use crate::layout::shown_text;
use crate::memory::header::{BoardState, BoardWords};
use crate::script::{Bench, ScenarioError};
use rhai::{Dynamic, INT, Map};

impl Verbs {
    pub(super) fn board(&mut self) {
        self.on("board", |stage| move || stage.act(|bench| board_map(bench, "")));
        self.on("board", |stage| move |plc: &str| stage.act(|bench| board_map(bench, plc)));
        self.on("set_board", |stage| move |words: &str| stage.act(|bench| bench.set_board(words)));
        self.on("reset", |stage| move || stage.act(|bench| bench.reset("")));
        self.on("reset", |stage| move |plc: &str| stage.act(|bench| bench.reset(plc)));
        self.on("power_cycle", |stage| move || stage.act(|bench| bench.power_cycle("")));
        self.on("power_cycle", |stage| move |plc: &str| stage.act(|bench| bench.power_cycle(plc)));
        self.on("initial_flag", |stage| {
            move |flag: &str, initial: Dynamic| stage.act(|bench| bench.initial_flag(flag, value(&initial)?))
        });
        self.on("event_count", |stage| {
            move |event: INT| stage.act(|bench| bench.event_count("", number(event, "event")?).map(INT::from))
        });
        self.on("event_count", |stage| {
            move |event: INT, plc: &str| {
                stage.act(|bench| bench.event_count(plc, number(event, "event")?).map(INT::from))
            }
        });
        self.on("trigger_count", |stage| {
            move |trigger: INT| {
                stage.act(|bench| bench.trigger_count("", number(trigger, "trigger")?).map(INT::from))
            }
        });
        self.on("trigger_count", |stage| {
            move |trigger: INT, plc: &str| {
                stage.act(|bench| bench.trigger_count(plc, number(trigger, "trigger")?).map(INT::from))
            }
        });
    }
}

/// Returns `#{display, leds, run_switch, power, dip, dip_latched, program, start, restarts, project}` as far as the
/// device has these elements, further elements of this device's front panel, and `modules` if the PLC is modular.
fn board_map(bench: &mut Bench, plc: &str) -> Result<Map, ScenarioError> {
    let (BoardState { leds: lit, .. }, words) = bench.board(plc)?;
    let BoardWords { display, leds, switch, power, dip, dip_latched, program, start, restarts, project } =
        words;
    let numbers = [
        ("leds", leds.map(|_| lit)),
        ("dip", dip),
        ("dip_latched", dip_latched),
        ("restarts", Some(restarts)),
    ];
    // The map has `run_switch`, because `switch` is a keyword of the language.
    let texts = [
        ("display", display),
        ("run_switch", switch),
        ("power", Some(power)),
        ("program", program),
        ("start", start),
        ("project", project),
    ];
    let numbers =
        numbers.into_iter().filter_map(|(name, number)| Some((name.into(), int(number?.into()).into())));
    let texts = texts.into_iter().filter_map(|(name, text)| Some((name.into(), text?.into())));
    let mut map = Map::from_iter(numbers.chain(texts));
    let front = bench.front(plc)?;
    if let Some(text) = shown_text(&front) {
        map.insert("display".into(), text.into());
    }
    for (word, value) in front.into_iter().filter(|(word, _)| !word.is_text) {
        let called = word.called(value);
        let number = word.ty.number(value);
        let shown_value = if called == number.to_string() { number.into() } else { called.into() };
        map.insert(word.name.into(), shown_value);
    }
    if let Some(modules) = bench.modules(plc)? {
        let modules = modules.into_iter().map(|(port, front)| (port.into(), module_map(front).into()));
        map.insert("modules".into(), Map::from_iter(modules).into());
    }
    Ok(map)
}

/// Creates the map of a module, with its switches: `#{kind, leds: #{H1: "on", H2: 1 ...}}`.
fn module_map(front: ModuleFront) -> Map {
    let leds = front.leds.into_iter().map(|(name, led)| {
        let shown = match led {
            Led::Off => "off".into(),
            Led::On => "on".into(),
            Led::Flashes(count) => int(count.into()).into(),
            Led::InTurn => "in_turn".into(),
        };
        (name.into(), shown)
    });
    let switches = front.switches.into_iter().map(|(name, switch)| {
        let position = match switch {
            Switch::Number(number) => int(number.into()).into(),
            Switch::Is(on) => on.into(),
        };
        (name.into(), position)
    });
    let kind = [("kind".into(), front.kind.into()), ("leds".into(), Map::from_iter(leds).into())];
    Map::from_iter(kind.into_iter().chain(switches))
}
