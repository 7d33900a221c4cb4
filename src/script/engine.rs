//! The verbs of scenario scripts: the functions that a Rhai script may call.

mod arguments;
mod block;
mod board;
mod drive;
mod fields;
mod history;
mod plot;
mod shown;
mod stage;
mod traffic;
mod wrong;

use super::caught::{self, Caught};
use super::complaint::name_types;
use super::run::{LONGEST_TEXTS, MOST_ENTRIES};
use super::{Bench, MemoryCopy, ScenarioError, ScriptLocation};
use crate::journal::text::Text;
use crate::journal::{Entry, Format, Record};
use arguments::{names, number, span, value};
use core::cell::RefCell;
use core::panic::Location;
use rhai::{
    Array, Dynamic, Engine, EvalAltResult, FnPtr, INT, ImmutableString, Map, NativeCallContext,
    RhaiNativeFunc,
};
use std::rc::Rc;

pub(super) use shown::value_text;
pub(super) use stage::Stage;
#[cfg(feature = "cli")]
pub(crate) use stage::is_plant_text;
pub(super) use wrong::refuse_sleep;
#[cfg(feature = "cli")]
pub(super) use wrong::wrong_count;

type Fallible<T> = Result<T, Box<EvalAltResult>>;

/// Returns an engine with verbs that act on the stage (the plant and the log of the running script).
pub(super) fn engine(stage: &Rc<RefCell<Stage>>) -> Engine {
    let mut verbs = Verbs { engine: Engine::new(), stage: Shared(Rc::clone(stage)), names: Vec::new() };
    verbs.all();
    verbs.refuse_others();
    caught::register(&mut verbs.engine);
    shown::register(&mut verbs.engine);
    name_types(&mut verbs.engine);
    verbs.engine
}

/// An engine whose verbs only read the stage, for expressions of a debugger.
#[cfg(feature = "cli")]
pub(super) fn reader(stage: &Rc<RefCell<Stage>>) -> Engine {
    let mut verbs = Verbs { engine: Engine::new(), stage: Shared(Rc::clone(stage)), names: Vec::new() };
    verbs.on("peek", |stage| move |register: &str| stage.preview(|bench| bench.peek(register)));
    verbs.on("describe", |stage| move |register: &str| stage.preview(|bench| bench.describe(register)));
    verbs.on("now", |stage| move || stage.preview(|bench| Ok(int(bench.now()?))));
    refuse_sleep(&mut verbs.engine);
    caught::register(&mut verbs.engine);
    shown::register(&mut verbs.engine);
    name_types(&mut verbs.engine);
    // An expression prints nothing: the standard output belongs to the protocol of the debugger.
    verbs.engine.on_print(|_| {});
    verbs.engine.on_debug(|_, _, _| {});
    verbs.engine
}

/// The reason that a script has given to its verb `skip`. It ends the script, and the script cannot catch it.
#[derive(Clone)]
pub(super) struct Skipped(pub(super) String);

/// The plant and the log of the running script, shared by all verbs.
#[derive(Clone)]
struct Shared(Rc<RefCell<Stage>>);

impl Shared {
    fn with<T>(&self, act: impl FnOnce(&mut Stage) -> Result<T, ScenarioError>) -> Fallible<T> {
        let mut stage = self.0.try_borrow_mut().map_err(|_| "a verb cannot be used inside another one")?;
        act(&mut stage).map_err(Caught::thrown)
    }

    fn act<T>(&self, act: impl FnOnce(&mut Bench) -> Result<T, ScenarioError>) -> Fallible<T> {
        self.with(|stage| stage.bench().and_then(act))
    }

    /// Does the same as [`Shared::act`] for a debugger. This does not count as a verb, so the script can still call
    /// `plant` as its first verb.
    #[cfg(feature = "cli")]
    fn preview<T>(&self, act: impl FnOnce(&mut Bench) -> Result<T, ScenarioError>) -> Fallible<T> {
        self.with(|stage| stage.bench_of_debugger().and_then(act))
    }

    /// Does the same as [`Shared::act`], and counts an expectation.
    fn expect<T>(&self, act: impl FnOnce(&mut Bench) -> Result<T, ScenarioError>) -> Fallible<T> {
        self.with(|stage| {
            stage.expectations += 1;
            stage.bench().and_then(act)
        })
    }
}

struct Verbs {
    engine: Engine,
    stage: Shared,
    /// Names of the registered verbs with their numbers of arguments.
    names: Vec<(&'static str, usize)>,
}

impl Verbs {
    fn all(&mut self) {
        self.registers();
        self.time();
        self.expectations();
        self.history();
        self.plots();
        self.traffic();
        self.blocks();
        self.board();
        self.drives();
        self.faults();
        self.findings();
    }

    /// Registers a verb. `make` creates its function, which acts on the stage.
    fn on<A: 'static, const N: usize, const X: bool, R: Clone + 'static, const F: bool, V>(
        &mut self,
        name: &'static str,
        verb: impl FnOnce(Shared) -> V,
    ) where
        V: RhaiNativeFunc<A, N, X, R, F> + 'static,
    {
        self.names.push((name, N));
        self.engine.register_fn(name, verb(self.stage.clone()));
    }

    fn registers(&mut self) {
        self.on("plant", |stage| {
            move |context: NativeCallContext, text: &str| {
                let place = place_of(&context);
                stage.with(|stage| stage.plant(text, &place))
            }
        });
        self.on("peek", |stage| move |register: &str| stage.act(|bench| bench.peek(register)));
        self.on("describe", |stage| move |register: &str| stage.act(|bench| bench.describe(register)));
        self.on("poke", |stage| {
            move |register: &str, new: Dynamic| stage.act(|bench| bench.poke(register, value(&new)?))
        });
        self.on("compare_exchange", |stage| {
            move |register: &str, current: Dynamic, new: Dynamic| {
                stage.act(|bench| bench.compare_exchange(register, value(&current)?, value(&new)?))
            }
        });
        self.on("force", |stage| {
            move |register: &str, kept: Dynamic| stage.act(|bench| bench.force(register, value(&kept)?))
        });
        self.on("unforce", |stage| move |register: &str| stage.act(|bench| bench.unforce(register)));
        self.engine.register_type_with_name::<MemoryCopy>("Snapshot");
        self.on("snapshot", |stage| move |area: &str| stage.act(|bench| bench.snapshot(area)));
        self.on("changes", |stage| {
            move |since: MemoryCopy| {
                stage.act(|bench| {
                    let names = bench.changes(&since)?.into_iter().map(|change| change.register.into());
                    Ok(names.collect::<Array>())
                })
            }
        });
    }

    fn time(&mut self) {
        self.on("now", |stage| move || stage.act(|bench| Ok(int(bench.now()?))));
        self.on("step", |stage| move |time: Dynamic| stage.act(|bench| bench.step(span(&time)?)));
        self.on("save", |stage| move || stage.act(|bench| Ok(INT::from(bench.save()?))));
        let saved = |saved: INT| {
            let right = "it is a number that save() has returned";
            u32::try_from(saved).map_err(|_| ScenarioError::argument(&saved.to_string(), right))
        };
        self.on("back_to", |stage| move |number: INT| stage.act(|bench| bench.back_to(saved(number)?)));
        self.on("forget", |stage| move |number: INT| stage.act(|bench| bench.forget(saved(number)?)));
        self.on("step_to_sync", |stage| move || stage.act(|bench| bench.step_to_sync("")));
        self.on("step_to_sync", |stage| move |node: &str| stage.act(|bench| bench.step_to_sync(node)));
        self.on("wait", |stage| {
            move |register: &str, wanted: Dynamic, within: Dynamic| {
                stage.expect(|bench| Ok(int(bench.wait(register, value(&wanted)?, span(&within)?)?)))
            }
        });
        self.on("wait_bits", |stage| {
            move |register: &str, mask: Dynamic, wanted: Dynamic, within: Dynamic| {
                stage.expect(|bench| {
                    Ok(int(bench.wait_bits(register, value(&mask)?, value(&wanted)?, span(&within)?)?))
                })
            }
        });
        self.on("wait_until", |stage| {
            move |context: NativeCallContext, condition: FnPtr, within: Dynamic| -> Fallible<INT> {
                let within_us = stage.expect(|bench| bench.span(span(&within)?))?;
                let start = stage.act(Bench::now)?;
                // The condition is a function of the script and may use verbs, which borrow the stage. So the stage is
                // not borrowed during the call.
                while !condition.call_within_context::<bool>(&context, ())? {
                    stage.act(|bench| bench.pass_or_fail(start, within_us, Location::caller()))?;
                }
                stage.act(|bench| bench.time_since(start)).map(int)
            }
        });
    }
}

/// Verbs for expectations and sections.
impl Verbs {
    fn expectations(&mut self) {
        self.on("skip", |_| {
            move |reason: &str| -> Fallible<()> {
                let skipped = Dynamic::from(Skipped(reason.to_owned()));
                Err(EvalAltResult::ErrorTerminated(skipped, rhai::Position::NONE).into())
            }
        });
        self.on("section", |stage| move |text: &str| stage.with(|stage| stage.section(text)));
        self.on("expect", |stage| {
            move |register: &str, wanted: Dynamic| {
                stage.expect(|bench| bench.expect(register, value(&wanted)?))
            }
        });
        self.on("expect_near", |stage| {
            move |register: &str, wanted: Dynamic, tolerance: INT| {
                stage.expect(|bench| {
                    bench.expect_near(register, value(&wanted)?, number(tolerance, "tolerance")?)
                })
            }
        });
        self.on("expect_bits", |stage| {
            move |register: &str, mask: Dynamic, wanted: Dynamic| {
                stage.expect(|bench| bench.expect_bits(register, value(&mask)?, value(&wanted)?))
            }
        });
        self.on("expect_that", |stage| {
            move |holds: bool, text: &str| stage.expect(|bench| bench.expect_that(holds, text))
        });
        self.on("expect_changes", |stage| {
            move |since: MemoryCopy, registers: Array| {
                stage.expect(|bench| {
                    let names = names(&registers, "register")?;
                    bench.expect_changes(&since, &names.iter().map(String::as_str).collect::<Vec<_>>())
                })
            }
        });
    }

    fn faults(&mut self) {
        self.on("fault", |stage| {
            move |context: NativeCallContext, words: &str| {
                let place = place_of(&context);
                stage.act(|bench| bench.fault_at(words, Some(place)).map(INT::from))
            }
        });
        self.on("clear_fault", |stage| {
            move |fault: INT| stage.act(|bench| bench.clear_fault(number(fault, "fault's number")?))
        });
        self.on("clear_faults", |stage| move || stage.act(Bench::clear_faults));
    }

    fn findings(&mut self) {
        self.on("expect_no_findings", |stage| move || stage.expect(|bench| bench.expect_no_findings(&[])));
        self.on("expect_no_findings", |stage| {
            move |allowed: Array| {
                stage.expect(|bench| {
                    let rules = names(&allowed, "rule")?;
                    bench.expect_no_findings(&rules.iter().map(String::as_str).collect::<Vec<_>>())
                })
            }
        });
        self.on("findings", |stage| {
            move || {
                stage.act(|bench| {
                    let found = bench.findings()?;
                    Ok(found.iter().map(|entry| finding_map(bench, entry).into()).collect::<Array>())
                })
            }
        });
        self.on("clear_findings", |stage| move || stage.act(Bench::clear_findings));
    }
}

/// Returns the line that calls a verb. The file is the name that the engine has for the script; it is empty for the
/// scenario itself.
fn place_of(context: &NativeCallContext) -> ScriptLocation {
    let line = context.call_position().line().and_then(|line| u32::try_from(line).ok());
    ScriptLocation {
        file: context.call_source().unwrap_or_default().to_owned(),
        line,
        column: None,
        source: None,
    }
}

/// Creates the map of a finding: `#{severity, rule, register, value, count, time, text}`.
fn finding_map(bench: &Bench, entry: &Entry) -> Map {
    let rule = entry.last.rule;
    Map::from([
        ("severity".into(), rule.severity().name().into()),
        ("rule".into(), rule.id().into()),
        ("register".into(), bench.finding_place(entry).into()),
        ("value".into(), bench.finding_value(entry).into()),
        ("count".into(), int(entry.count).into()),
        ("time".into(), int(entry.first_us).into()),
        ("text".into(), entry.text().into()),
    ])
}

/// Creates the map of a record: `#{time, kind, count, text}`.
fn record_map(record: &Record, text: &mut Text) -> Map {
    let mut line = String::new();
    text.record(record, &mut line);
    Map::from([
        ("time".into(), int(record.time_us).into()),
        ("kind".into(), record.event.kind().name().into()),
        ("count".into(), INT::from(record.count).into()),
        ("text".into(), line.trim().into()),
    ])
}

/// Returns the result of a verb as an array. The engine would end a script with a larger value without a reason.
///
/// # Errors
/// The maps have too many entries, or too long texts. The error names the verb and the `remedy`.
fn held(maps: Vec<Map>, verb: &str, remedy: &str) -> Result<Array, ScenarioError> {
    let (mut entries, mut bytes) = (0, 0);
    for value in maps.iter().flat_map(Map::values) {
        entries += 1;
        bytes += value.read_lock::<ImmutableString>().map_or(0, |text| text.len());
    }
    if entries <= MOST_ENTRIES && bytes <= LONGEST_TEXTS {
        return Ok(maps.into_iter().map(Dynamic::from).collect());
    }
    let of_each = maps.first().map_or(1, Map::len).max(1);
    let right = format!(
        "a script can hold {} such records, with texts of {LONGEST_TEXTS} bytes together, and here are {} with \
         {bytes} bytes; {remedy}",
        MOST_ENTRIES / of_each,
        maps.len()
    );
    Err(ScenarioError::argument(verb, &right))
}

fn int(number: u64) -> INT {
    INT::try_from(number).unwrap_or(INT::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::verb::{Verb, verbs};
    use std::path::PathBuf;

    /// Signatures of verbs: the first column of the tables in the reference.
    fn documented() -> Vec<String> {
        let rows = include_str!("../../docs/reference/scenarios.md")
            .lines()
            .filter_map(|line| line.strip_prefix("| `"));
        let cells = rows.filter_map(|row| row.split_once(" | ")).map(|(cell, _)| cell);
        let calls = cells.flat_map(|cell| cell.split("`, `")).filter(|call| call.contains('('));
        let mut all: Vec<_> = calls.map(|call| call.trim_end_matches(['`', ' ']).to_owned()).collect();
        all.sort();
        all
    }

    #[test]
    fn the_reference_lists_exactly_the_verbs() {
        let mut defined: Vec<_> = verbs().iter().map(Verb::signature).collect();
        defined.sort();
        assert_eq!(documented(), defined);
    }

    #[test]
    fn the_definition_file_defines_exactly_the_verbs() {
        let stage = Rc::new(RefCell::new(Stage::new(None, PathBuf::new(), Bench::LIMIT_US)));
        let mut all = Verbs { engine: Engine::new(), stage: Shared(stage), names: Vec::new() };
        all.all();
        all.names.sort_unstable();
        let mut defined: Vec<_> = verbs().iter().map(|verb| (verb.name, verb.parameters.len())).collect();
        defined.sort_unstable();
        assert_eq!(all.names, defined);
    }
}
