//! The functions that a script may call to act on its device.

use super::budget::Meter;
use super::data::Data;
use super::engine::MOST_ARGUMENTS;
use super::frames;
use super::verb_context::{Acting, Found, Report, VerbContext};
use crate::can::ErrorState;
use crate::devices::folder::card::Place;
use crate::devices::folder::own_records::OwnRecord;
use crate::devices::folder::records::LONGEST_NOTE;
use crate::devices::folder::state_word::may_change;
use crate::layout::RegType;
use crate::layout::value;
use crate::plural::{plural, plural_of};
use crate::time;
use core::cell::RefCell;
use rhai::{Array, Dynamic, Engine, EvalAltResult, FnPtr, INT, ImmutableString, Map, RhaiNativeFunc};
use std::rc::Rc;
use std::sync::Arc;

type Fallible<T> = Result<T, Box<EvalAltResult>>;

/// Names of the verbs, for suggestions.
pub(super) const NAMES: [&str; 23] = [
    "accept",
    "after",
    "at",
    "bus_state",
    "cancel",
    "clear_bits",
    "copy",
    "event",
    "exchange",
    "interrupt",
    "journal",
    "now",
    "output",
    "output_all",
    "read",
    "read_all",
    "record",
    "reset",
    "send",
    "set_bits",
    "sync_pulse",
    "violation",
    "write",
];

/// Verbs of devices with a port.
pub(super) const OF_PORT: [&str; 3] = ["accept", "bus_state", "send"];

/// Verbs with the name of one register, or of several registers, as their first argument.
pub(super) const OF_REGISTERS: [(&str, bool); 11] = [
    ("clear_bits", true),
    ("copy", false),
    ("exchange", true),
    ("output", true),
    ("output_all", false),
    ("read", true),
    ("read_all", false),
    ("reset", false),
    ("set_bits", true),
    ("violation", true),
    ("write", true),
];

/// Verbs that change the registers of their first argument.
pub(super) const CHANGING: [&str; 6] =
    ["clear_bits", "exchange", "output", "output_all", "set_bits", "write"];

/// Registers all verbs. They act on the device in `context`.
pub(super) fn register(engine: &mut Engine, context: &Rc<RefCell<VerbContext>>, meter: &Rc<Meter>) {
    let mut verbs = Verbs { engine, context: SharedContext(Rc::clone(context)) };
    verbs.registers();
    verbs.blocks(meter);
    verbs.bits_and_answers();
    verbs.times();
    verbs.reports();
    verbs.bus();
}

/// Access of a verb to the objects on which verbs act.
#[derive(Clone)]
struct SharedContext(Rc<RefCell<VerbContext>>);

impl SharedContext {
    fn with<T>(&self, act: impl FnOnce(&mut VerbContext) -> Result<T, String>) -> Fallible<T> {
        let mut context = self.0.try_borrow_mut().map_err(|_| "a verb cannot be used inside another one")?;
        Ok(act(&mut context)?)
    }

    fn device<T>(&self, act: impl FnOnce(&mut Acting) -> Result<T, String>) -> Fallible<T> {
        self.with(|context| act(context.device()?))
    }

    /// Changes a register of the device by `f`.
    fn change(
        &self,
        name: &str,
        is_recorded: bool,
        f: impl FnOnce(Found) -> Result<Change, String>,
    ) -> Fallible<()> {
        self.with(|context| {
            let found = own(context.register(name)?)?;
            let Change { clear, set } = f(found)?;
            context.device()?.write(found, is_recorded, |before| before & !clear | set);
            Ok(())
        })
    }
}

/// Bits of a register to clear, then bits to set.
struct Change {
    clear: u32,
    set: u32,
}

struct Verbs<'a> {
    engine: &'a mut Engine,
    context: SharedContext,
}

impl Verbs<'_> {
    /// Registers a verb. `make` creates the function of the verb. This function acts on the objects in
    /// `context`.
    fn on<A: 'static, const N: usize, const X: bool, R: Clone + 'static, const F: bool, V>(
        &mut self,
        name: &'static str,
        verb: impl FnOnce(SharedContext) -> V,
    ) where
        V: RhaiNativeFunc<A, N, X, R, F> + 'static,
    {
        self.engine.register_fn(name, verb(self.context.clone()));
    }

    fn registers(&mut self) {
        self.on("read", |context| {
            move |name: &str| {
                context.with(|context| {
                    let found = context.register(name)?;
                    Ok(number(found, context.device()?))
                })
            }
        });
        self.on("write", |context| {
            move |name: &str, new: Dynamic| context.change(name, true, |found| whole(found, &new))
        });
        self.on("output", |context| {
            move |name: &str, new: Dynamic| context.change(name, false, |found| whole(found, &new))
        });
        // The engine finds a verb faster if the types of all its arguments are declared.
        self.on("write", |context| {
            move |name: &str, new: INT| context.change(name, true, |found| whole(found, &new.into()))
        });
        self.on("output", |context| {
            move |name: &str, new: INT| context.change(name, false, |found| whole(found, &new.into()))
        });
    }

    /// Registers verbs that work on many registers. They count one step for each register or word.
    fn blocks(&mut self, meter: &Rc<Meter>) {
        let steps = Rc::clone(meter);
        self.on("read_all", |context| {
            move |name: &str| {
                context.with(|context| {
                    let all = context.registers(name)?;
                    steps.charge(all.len() as u64);
                    let device = context.device()?;
                    Ok(all.iter().map(|found| number(*found, device).into()).collect::<Array>())
                })
            }
        });
        let steps = Rc::clone(meter);
        self.on("output_all", |context| {
            move |name: &str, new: Array| {
                context.with(|context| {
                    let all = context.registers(name)?;
                    if all.len() != new.len() {
                        return Err(format!(
                            "`{name}` is {}, the array has {}",
                            plural_of(&all, "register"),
                            plural_of(&new, "value")
                        ));
                    }
                    steps.charge(all.len() as u64);
                    for (found, new) in all.iter().zip(&new) {
                        let (found, value) = (own(*found)?, bits(*found, new)?);
                        context.device()?.write(found, false, |_| value);
                    }
                    Ok(())
                })
            }
        });
        let steps = Rc::clone(meter);
        self.on("copy", |context| {
            move |from: &str, to: &str| {
                context.with(|context| {
                    let (source, target) = (context.block(from)?, context.block(to)?);
                    if source.bytes != target.bytes {
                        let (from_bytes, to_bytes) = (source.bytes, target.bytes);
                        return Err(format!(
                            "`{from}` has {}, `{to}` has {to_bytes}",
                            plural(from_bytes, "byte")
                        ));
                    }
                    target.first.iter().try_for_each(|found| own(*found).map(drop))?;
                    steps.charge(u64::from(source.bytes) / 4);
                    context.device()?.card.copy(source.offset, target.offset, source.bytes);
                    Ok(())
                })
            }
        });
        let steps = Rc::clone(meter);
        // The verb also resets registers that only the program writes (D-823).
        self.on("reset", |context| {
            move |name: &str| {
                context.with(|context| {
                    let all = context.layout.registers(name).map_err(|error| error.to_string())?;
                    steps.charge(all.len() as u64);
                    let device = context.device()?;
                    all.iter().for_each(|register| {
                        device.card.update(Place::of(register), |_| register.register.reset);
                    });
                    Ok(())
                })
            }
        });
    }

    fn bits_and_answers(&mut self) {
        self.on("set_bits", |context| {
            move |name: &str, mask: Dynamic| {
                context.change(name, true, |found| Ok(Change { clear: 0, set: bits(found, &mask)? }))
            }
        });
        self.on("clear_bits", |context| {
            move |name: &str, mask: Dynamic| {
                context.change(name, true, |found| Ok(Change { clear: bits(found, &mask)?, set: 0 }))
            }
        });
        self.on("exchange", |context| {
            move |name: &str, request: Dynamic, answer: Dynamic| exchange(&context, name, &request, &answer)
        });
        self.on("exchange", |context| {
            move |name: &str, request: INT, answer: INT| {
                exchange(&context, name, &request.into(), &answer.into())
            }
        });
    }

    fn times(&mut self) {
        self.on("now", |context| move || context.device(|device| Ok(int(device.now))));
        self.on("after", |context| {
            move |time: Dynamic, function: Dynamic| order(&context, &time, true, &function, &Array::new())
        });
        self.on("after", |context| {
            move |time: Dynamic, function: Dynamic, arguments: Array| {
                order(&context, &time, true, &function, &arguments)
            }
        });
        self.on("after", |context| {
            move |time: INT, function: ImmutableString, arguments: Array| {
                order(&context, &time.into(), true, &function.into(), &arguments)
            }
        });
        self.on("after", |context| {
            move |time: ImmutableString, function: ImmutableString, arguments: Array| {
                order(&context, &time.into(), true, &function.into(), &arguments)
            }
        });
        self.on("at", |context| {
            move |time: Dynamic, function: Dynamic| order(&context, &time, false, &function, &Array::new())
        });
        self.on("at", |context| {
            move |time: Dynamic, function: Dynamic, arguments: Array| {
                order(&context, &time, false, &function, &arguments)
            }
        });
        self.on("cancel", |context| {
            move |number: INT| {
                context.device(|device| {
                    Ok(u64::try_from(number).is_ok_and(|number| device.timers.cancel(number)))
                })
            }
        });
    }

    fn bus(&mut self) {
        self.on("send", |context| {
            move |id: INT, data: Dynamic| {
                context.device(|device| Ok(device.send(frames::data_frame(id, &data)?)))
            }
        });
        self.on("send", |context| {
            move |frame: Map| context.device(|device| Ok(device.send(frames::frame_of(&frame)?)))
        });
        self.on("accept", |context| {
            move |filters: Array| {
                context.device(|device| {
                    device.card.accept(frames::filters_of(&filters)?);
                    Ok(())
                })
            }
        });
        self.on("bus_state", |context| {
            move || {
                context.device(|device| {
                    let state = device.card.bus_state();
                    Ok(ImmutableString::from(state.map_or("no_bus", ErrorState::name)))
                })
            }
        });
    }

    fn reports(&mut self) {
        self.on("journal", |context| move |text: &str| note(&context, text));
        self.on("violation", |context| {
            move |name: &str, text: &str| {
                context.with(|context| {
                    let found = context.register(name)?;
                    context.device()?.violation(found, noted(text));
                    Ok(())
                })
            }
        });
        self.on("record", |context| move |name: &str| own_record(&context, name, &Map::new()));
        self.on("record", |context| move |name: &str, fields: Map| own_record(&context, name, &fields));
        self.on("event", |context| {
            move |event: INT| {
                context.device(|device| {
                    let is_one =
                        usize::try_from(event).is_ok_and(|event| device.card.raise(event, device.now));
                    is_one
                        .then_some(())
                        .ok_or_else(|| format!("a device has the events 0 to 15, not {event}"))
                })
            }
        });
        // Without a controller, the pulses have no effect.
        self.on("interrupt", |context| {
            move || {
                context.device(|device| {
                    device.card.pulses().interrupt = true;
                    Ok(())
                })
            }
        });
        self.on("sync_pulse", |context| {
            move || {
                context.device(|device| {
                    device.card.pulses().sync = true;
                    Ok(())
                })
            }
        });
        // The engine's own functions would print to the terminal.
        let context = self.context.clone();
        self.engine.on_print(move |text| drop(note(&context, text)));
        let context = self.context.clone();
        self.engine.on_debug(move |text, _, _| drop(note(&context, text)));
    }
}

/// Replaces a request by its answer if the register still contains the request.
fn exchange(context: &SharedContext, name: &str, request: &Dynamic, answer: &Dynamic) -> Fallible<bool> {
    context.with(|context| {
        let found = own(context.register(name)?)?;
        let (request, answer) = (bits(found, request)?, bits(found, answer)?);
        Ok(context.device()?.exchange(found, request, answer))
    })
}

/// Writes a record of a kind that the device declares, with a value for each of its fields.
fn own_record(context: &SharedContext, name: &str, fields: &Map) -> Fallible<()> {
    context.with(|context| {
        let records = Arc::clone(&context.records);
        let kind = OwnRecord::find(&records, name)?;
        if let Some(other) =
            fields.keys().find(|field| !kind.fields.iter().any(|known| known == field.as_str()))
        {
            return Err(format!(
                "the record `{name}` has no field `{other}`; its fields: {}",
                kind.fields.join(", ")
            ));
        }
        let value = |field: &str| {
            let given =
                fields.get(field).ok_or_else(|| format!("the record `{name}` needs its field `{field}`"))?;
            let number = given.as_int().or_else(|_| given.as_bool().map(INT::from));
            let fits = |number: &INT| (INT::from(i32::MIN)..=INT::from(u32::MAX)).contains(number);
            number
                .ok()
                .filter(fits)
                .ok_or_else(|| format!("the field `{field}` is a number of at most 32 bits, or a bool"))
        };
        let line = kind.line(value)?;
        context.device()?.reports.push(Report::Recorded(line));
        Ok(())
    })
}

/// Puts a text into the journal.
fn note(context: &SharedContext, text: &str) -> Fallible<()> {
    context.device(|device| {
        device.reports.push(Report::Note(noted(text)));
        Ok(())
    })
}

/// Returns the beginning of a text, limited to the length that the journal keeps.
fn noted(text: &str) -> String {
    text[..text.floor_char_boundary(LONGEST_NOTE)].to_owned()
}

/// Refuses a register that the device itself does not write.
fn own(found: Found) -> Result<Found, String> {
    may_change(&found.register).map(|()| found)
}

/// Returns the register's value as a number of its type.
fn number(found: Found, device: &Acting) -> INT {
    found.register.ty().number(device.card.load(found.place))
}

/// Replaces all bits by the value.
fn whole(found: Found, new: &Dynamic) -> Result<Change, String> {
    Ok(Change { clear: u32::MAX, set: bits(found, new)? })
}

/// Converts a value to the bits of a register. The value is a number of the register's type, the bit pattern
/// of such a number, a bool, or a text as on the command line.
fn bits(found: Found, new: &Dynamic) -> Result<u32, String> {
    let ty: RegType = found.register.ty();
    let pattern = |number: INT| u32::try_from(number).ok().filter(|bits| *bits <= ty.mask());
    if let Ok(number) = new.as_int() {
        if ty.number(number as u32) == number {
            return Ok(number as u32 & ty.mask());
        }
        let refused = || format!("{number} (16#{number:X}) does not fit {} of type {ty}", found.register);
        return pattern(number).ok_or_else(refused);
    }
    if let Ok(is_set) = new.as_bool() {
        return Ok(is_set.into());
    }
    let Ok(text) = new.as_immutable_string_ref() else {
        return Err(format!("the value of {} is a number or a text", found.register));
    };
    let named = |error| value::named(&text, found.register.register.meaning, error);
    value::parse(&text, ty).or_else(named).map_err(|error| format!("{}: {error}", found.register))
}

/// Schedules a function for a later time.
fn order(
    context: &SharedContext,
    time: &Dynamic,
    is_after: bool,
    function: &Dynamic,
    arguments: &Array,
) -> Fallible<INT> {
    let us = span(time)?;
    let function = called(function)?;
    if arguments.len() > MOST_ARGUMENTS {
        let count = arguments.len();
        return Err(format!("{count} arguments for `{function}`; a call has at most {MOST_ARGUMENTS}").into());
    }
    let given = arguments.len();
    let arguments = Data::of(&arguments.clone().into())?;
    context.with(|context| {
        let checked = context.functions.check_later(&function, Some(given));
        let device = context.device()?;
        checked?;
        let due = if is_after { device.now.saturating_add(us) } else { us.max(device.now) };
        device.timers.add(due, function, arguments).map(int)
    })
}

/// Returns a time in microseconds.
fn span(time: &Dynamic) -> Result<u64, String> {
    if let Ok(us) = time.as_int() {
        return u64::try_from(us).map_err(|_| format!("{us} us is no time; a time is at least 0"));
    }
    let Ok(text) = time.as_immutable_string_ref() else {
        return Err("a time is a text such as \"1ms\", or a number of microseconds".to_owned());
    };
    time::parse(&text).map_err(|reason| format!("`{}` is no time: {reason}", &*text))
}

/// Returns the name of the function to call later.
fn called(function: &Dynamic) -> Result<String, String> {
    let name = match function.read_lock::<FnPtr>() {
        Some(pointer) => pointer.fn_name().to_owned(),
        None => match function.as_immutable_string_ref() {
            Ok(name) => ImmutableString::clone(&name).to_string(),
            Err(_) => {
                return Err("name a function of the script, as in after(\"1ms\", \"answer\", [5])".to_owned());
            }
        },
    };
    let is_name =
        name.len() <= 63 && name.chars().all(|letter| letter == '_' || letter.is_ascii_alphanumeric());
    if is_name { Ok(name) } else { Err(format!("`{}` is no name of a function", noted(&name))) }
}

fn int(number: u64) -> INT {
    INT::try_from(number).unwrap_or(INT::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_definitions_are_exactly_the_verbs() {
        let defined = super::super::DEFINITIONS.lines().filter_map(|line| line.strip_prefix("fn "));
        let defined: BTreeSet<_> = defined.filter_map(|line| line.split('(').next()).collect();
        assert_eq!(defined, NAMES.into_iter().collect());
        assert!(OF_REGISTERS.iter().all(|(name, _)| NAMES.contains(name)));
        let page = include_str!("../../../../docs/reference/device-folders.md");
        let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
        let named: BTreeSet<_> = rows.filter_map(|row| row.split('(').next()).collect();
        let missing: Vec<_> = NAMES
            .iter()
            .filter(|name| !named.contains(*name) && !page.contains(&format!("`{name}(")))
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    }
}
