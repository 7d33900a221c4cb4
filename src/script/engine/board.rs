//! The verbs of boards.

use super::Verbs;
use super::arguments::{number, value};
use super::fields::map;
use rhai::{Dynamic, INT};

impl Verbs {
    pub(super) fn board(&mut self) {
        self.on("board", |stage| move || stage.act(|bench| bench.board_fields("").map(map)));
        self.on("board", |stage| move |plc: &str| stage.act(|bench| bench.board_fields(plc).map(map)));
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
