//! The verbs for the history of registers.

use super::arguments::value;
use super::{Verbs, held, int};
use crate::script::PastChange;
use rhai::{Array, Map};

impl Verbs {
    pub(super) fn history(&mut self) {
        self.on("record", |stage| move |what: &str| stage.act(|bench| bench.record(what)));
        self.on("history", |stage| {
            move |register: &str| {
                stage.act(|bench| {
                    let past = bench.history(register)?;
                    let maps = past.iter().map(past_map).collect();
                    held(maps, &format!("history(\"{register}\")"), "use `journal` with a later `since`")
                })
            }
        });
        self.on("expect_history", |stage| {
            move |register: &str, values: Array| {
                stage.expect(|bench| {
                    let values = values.iter().map(value).collect::<Result<Vec<_>, _>>()?;
                    bench.expect_history(register, values)
                })
            }
        });
    }
}

/// Creates the map of a past change: `#{time, from, to, by}`.
fn past_map(&PastChange { time_us, from, to, by }: &PastChange) -> Map {
    Map::from([
        ("time".into(), int(time_us).into()),
        ("from".into(), from.into()),
        ("to".into(), to.into()),
        ("by".into(), by.name().into()),
    ])
}
