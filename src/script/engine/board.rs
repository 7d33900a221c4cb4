//! The verbs of boards.

use super::arguments::{number, value};
use super::{Verbs, int};
use crate::memory::header::{BoardState, BoardWords};
use rhai::{Dynamic, INT, Map};

impl Verbs {
    pub(super) fn board(&mut self) {
        self.on("board", |stage| move || stage.act(|bench| bench.board("").map(|board| board_map(&board))));
        self.on("board", |stage| {
            move |plc: &str| stage.act(|bench| bench.board(plc).map(|board| board_map(&board)))
        });
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

/// `#{display, leds, run_switch, power, dip, dip_latched, program, start, restarts, project}`
fn board_map(state: &BoardState) -> Map {
    let words = state.words();
    let BoardWords { display, switch, power, program, start, project, .. } = words;
    let numbers = [
        ("leds", state.leds),
        ("dip", state.dip),
        ("dip_latched", state.dip_latched),
        ("restarts", state.restarts),
    ];
    // `switch` is a keyword of the language.
    let texts = [
        ("display", display),
        ("run_switch", switch),
        ("power", power),
        ("program", program),
        ("start", start),
        ("project", project),
    ];
    let numbers = numbers.map(|(name, number)| (name.into(), int(number.into()).into()));
    let texts = texts.map(|(name, text)| (name.into(), text.into()));
    Map::from_iter(numbers.into_iter().chain(texts))
}
