//! The verbs of buses and of the journal.

use super::arguments::{data_bytes, identifier, number, span};
use super::{Verbs, held, int, record_map};
use crate::devices;
use crate::journal::text::Text;
use crate::script::{Bench, ScenarioError, SeenFrame};
use rhai::{Array, Dynamic, INT, Map};

/// All bits of an identifier.
const ALL_BITS: u16 = 0x7FF;

/// Advice if a verb returns too many records.
const LATER: &str = "give a later `since`";

impl Verbs {
    pub(super) fn traffic(&mut self) {
        self.on("expect_frame", |stage| {
            move |bus: &str, id: INT, data: Dynamic, within: Dynamic| {
                stage.expect(|bench| {
                    let (id, data) = (identifier(id)?, data_bytes(&data)?);
                    bench.expect_frame(bus, id, &data, span(&within)?).map(|seen| seen_map(&seen))
                })
            }
        });
        self.on("expect_frame", |stage| {
            move |bus: &str, id: INT, mask: INT, data: Dynamic, within: Dynamic| {
                stage.expect(|bench| {
                    let (id, mask, data) = (identifier(id)?, identifier(mask)?, data_bytes(&data)?);
                    bench
                        .expect_masked_frame(bus, id, mask, &data, span(&within)?)
                        .map(|seen| seen_map(&seen))
                })
            }
        });
        self.on("expect_frame", |stage| {
            move |bus: &str, id: INT, data: Dynamic, within: Dynamic, extended: bool| {
                stage.expect(|bench| {
                    let data = data_bytes(&data)?;
                    let seen = if extended {
                        bench.expect_extended_frame(bus, number(id, "identifier")?, &data, span(&within)?)
                    } else {
                        bench.expect_frame(bus, identifier(id)?, &data, span(&within)?)
                    };
                    seen.map(|seen| seen_map(&seen))
                })
            }
        });
        self.on("expect_no_frame", |stage| {
            move |bus: &str, id: INT, within: Dynamic| {
                stage.expect(|bench| bench.expect_no_frame(bus, identifier(id)?, ALL_BITS, span(&within)?))
            }
        });
        self.on("expect_no_frame", |stage| {
            move |bus: &str, id: INT, within: Dynamic, extended: bool| {
                stage.expect(|bench| expect_no_frame(bench, bus, id, &within, extended))
            }
        });
        self.on("send_frame", |stage| {
            move |bus: &str, id: INT, data: Dynamic| {
                stage
                    .act(|bench| bench.send_frame(bus, number(id, "identifier")?, false, &data_bytes(&data)?))
            }
        });
        self.on("send_frame", |stage| {
            move |bus: &str, id: INT, data: Dynamic, extended: bool| {
                stage.act(|bench| {
                    bench.send_frame(bus, number(id, "identifier")?, extended, &data_bytes(&data)?)
                })
            }
        });
        self.on("rtr", |stage| {
            move |bus: &str, id: INT| stage.act(|bench| bench.rtr(bus, number(id, "identifier")?, false))
        });
        self.on("rtr", |stage| {
            move |bus: &str, id: INT, extended: bool| {
                stage.act(|bench| bench.rtr(bus, number(id, "identifier")?, extended))
            }
        });
        self.on("expect_no_frame", |stage| {
            move |bus: &str, id: INT, mask: INT, within: Dynamic| {
                stage.expect(|bench| match within.as_bool() {
                    // The engine prefers this function if the time is a number: `(bus, identifier, within, extended)`.
                    Ok(extended) => expect_no_frame(bench, bus, id, &mask.into(), extended),
                    Err(_) => bench.expect_no_frame(bus, identifier(id)?, identifier(mask)?, span(&within)?),
                })
            }
        });
        self.on("frames", |stage| {
            move |bus: &str, since: INT| {
                stage.act(|bench| {
                    let since = number(since, "time")?;
                    let seen = bench.frames(bus, since)?;
                    let verb = format!("frames(\"{bus}\", {since})");
                    held(seen.iter().map(seen_map).collect(), &verb, LATER)
                })
            }
        });
        self.on("journal", |stage| {
            move |since: INT| {
                stage.act(|bench| {
                    let since = number(since, "time")?;
                    let records = bench.journal(since)?;
                    let mut text = Text::new(bench.names().clone(), devices::catalogue());
                    let maps: Vec<_> = records.iter().map(|record| record_map(record, &mut text)).collect();
                    held(maps, &format!("journal({since})"), LATER)
                })
            }
        });
    }
}

/// Expects no frame with an identifier of 11 or 29 bits.
#[track_caller]
fn expect_no_frame(
    bench: &mut Bench,
    bus: &str,
    id: INT,
    within: &Dynamic,
    extended: bool,
) -> Result<(), ScenarioError> {
    if extended {
        bench.expect_no_extended_frame(bus, number(id, "identifier")?, span(within)?)
    } else {
        bench.expect_no_frame(bus, identifier(id)?, ALL_BITS, span(within)?)
    }
}

/// Creates the map of a frame: `#{time, id, extended, remote, data}`.
fn seen_map(seen: &SeenFrame) -> Map {
    let payload = seen.frame.payload();
    let data: Array = payload.data().iter().map(|byte| INT::from(*byte).into()).collect();
    let field = seen.frame.arbitration();
    Map::from([
        ("time".into(), int(seen.time_us).into()),
        ("id".into(), INT::from(field.number()).into()),
        ("extended".into(), field.is_extended().into()),
        ("remote".into(), field.is_remote().into()),
        ("data".into(), data.into()),
    ])
}
