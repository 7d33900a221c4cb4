//! The verbs of function blocks.

use super::arguments::span;
use super::blocks::{KINDS, Kind, Placed};
use super::wires::{ServiceData, Wires};
use super::{Fallible, Verbs, int, thrown};
use crate::devices::omega_drive_line_2::registers::DEVICE;
use crate::layout::Area;
use crate::script::{Bench, ScenarioError};
use core::cell::RefCell;
use core::fmt::Write;
use core::panic::Location;
use rhai::{Dynamic, INT};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Time from one call to the next while a scenario waits for a block, in microseconds.
const CYCLE_US: u64 = 500;

/// A function block, as scripts hold it.
#[derive(Clone)]
pub(super) struct Block {
    kind: &'static Kind,
    /// Where its registers are, as given.
    place: String,
    instance: Placed,
}

impl Block {
    fn new(
        bench: &mut Bench,
        service_data: &mut BTreeMap<u16, ServiceData>,
        name: &str,
        place: &str,
    ) -> Result<Self, ScenarioError> {
        let kind = KINDS.iter().find(|kind| kind.name == name).ok_or_else(|| {
            let known: Vec<_> = KINDS.iter().map(|kind| kind.name).collect();
            ScenarioError::Unknown { what: "function block", name: name.to_owned(), known: known.join(", ") }
        })?;
        let (plc, offset) = match kind.base {
            Some(structure) => {
                let (plc, area) = bench.area(place)?;
                check_area(kind, structure, area, place)?;
                (plc, area.first as usize)
            }
            None => (bench.only_plc(place)?, 0),
        };
        let ram = bench.ram_of(plc)?;
        let service_data = Rc::clone(service_data.entry(plc).or_default());
        let instance = (kind.make)(&Wires { ram: &ram, offset, service_data: &service_data })?;
        Ok(Self { kind, place: place.to_owned(), instance })
    }

    fn get(&self, pin: &str) -> Result<Dynamic, ScenarioError> {
        self.instance.borrow().get(pin).ok_or_else(|| self.no_pin(pin))
    }

    fn set(&self, pin: &str, value: &Dynamic) -> Result<(), ScenarioError> {
        let taken = self.instance.borrow_mut().set(pin, value).ok_or_else(|| self.no_pin(pin))?;
        taken.map_err(|error| match error {
            ScenarioError::Argument { text, right } => {
                ScenarioError::argument(&text, &format!("{} of {} is {right}", pin, self.kind.name))
            }
            other => other,
        })
    }

    fn no_pin(&self, pin: &str) -> ScenarioError {
        let known = self.kind.pins.join(", ");
        let right = format!("{} has no such input or output; it has {known}", self.kind.name);
        ScenarioError::argument(pin, &right)
    }

    /// A BOOL output.
    fn is(&self, pin: &str) -> Result<bool, ScenarioError> {
        let not_bool = |_| ScenarioError::argument(pin, "this output is no BOOL");
        self.get(pin)?.as_bool().map_err(not_bool)
    }

    /// One PLC cycle. What it asks of the board is answered at once.
    fn call(&self, bench: &mut Bench) -> Result<(), ScenarioError> {
        self.instance.borrow_mut().call();
        bench.answer_boards()
    }

    /// Calls it in every processor cycle until an output is TRUE.
    fn until(
        &self,
        bench: &mut Bench,
        output: &str,
        within_us: u64,
        at: &Location<'_>,
    ) -> Result<u64, ScenarioError> {
        let start = bench.now()?;
        let has_error = self.kind.pins.contains(&"x_ERR") && output != "x_ERR";
        loop {
            self.call(bench)?;
            if self.is(output)? {
                return Ok(bench.now()? - start);
            }
            let late = bench.now()? >= start.saturating_add(within_us);
            if late || has_error && self.is("x_ERR")? {
                let what = format!("{} at {}: {output} did not become TRUE", self.kind.name, self.place);
                let mut failure = bench.failure(what, at)?;
                failure.expected = Some(format!("{output} TRUE within {}", crate::time::short(within_us)));
                failure.actual = Some(self.outputs());
                return Err(failure.into());
            }
            bench.step(CYCLE_US)?;
        }
    }

    /// All pins that are no arrays: `x_OK FALSE, w_ERR 16#0801`.
    fn outputs(&self) -> String {
        let mut text = String::new();
        for pin in self.kind.pins {
            let Some(value) = self.instance.borrow().get(pin) else { continue };
            let shown = match (value.as_bool(), value.as_int()) {
                (Ok(value), _) => if value { "TRUE" } else { "FALSE" }.to_owned(),
                (_, Ok(value)) if pin.starts_with("w_") => format!("16#{value:04X}"),
                (_, Ok(value)) if pin.starts_with("b_") => format!("16#{value:02X}"),
                (_, Ok(value)) => value.to_string(),
                _ => continue,
            };
            // Writing to a String cannot fail.
            let _ = write!(text, "{}{pin} {shown}", if text.is_empty() { "" } else { ", " });
        }
        text
    }
}

/// Checks that the area has the registers that the block needs.
fn check_area(kind: &Kind, structure: &str, area: &Area, place: &str) -> Result<(), ScenarioError> {
    let fits = |area: &Area| area.structures.iter().any(|placed| placed.structure.name == structure);
    if fits(area) {
        return Ok(());
    }
    let areas: Vec<_> = DEVICE.areas.iter().filter(|area| fits(area)).map(|area| area.name).collect();
    let right = format!("{} needs {structure}, which is in {}", kind.name, areas.join(", "));
    Err(ScenarioError::argument(place, &right))
}

impl Verbs {
    pub(super) fn blocks(&mut self) {
        // Of each PLC, what connects the blocks of its service data.
        let service_data = RefCell::<BTreeMap<u16, ServiceData>>::default();
        self.on("block", |stage| {
            move |name: &str, place: &str| {
                stage.act(|bench| Block::new(bench, &mut service_data.borrow_mut(), name, place))
            }
        });
        self.on("cycle", |stage| move |block: &mut Block| stage.act(|bench| block.call(bench)));
        self.on("cycle_until", |stage| {
            move |block: &mut Block, output: &str, within: Dynamic| -> Fallible<INT> {
                stage.act(|bench| {
                    let within_us = bench.span(span(&within)?)?;
                    block.until(bench, output, within_us, Location::caller()).map(int)
                })
            }
        });
        let get = |block: &mut Block, pin: &str| block.get(pin).map_err(thrown);
        let set = |block: &mut Block, pin: &str, value: Dynamic| block.set(pin, &value).map_err(thrown);
        self.engine
            .register_type_with_name::<Block>("Block")
            .register_indexer_get(get)
            .register_indexer_set(set);
    }
}

#[cfg(test)]
mod tests {
    use super::KINDS;

    /// Pins as `docs/function-blocks.md` has them in its tables, in their order, and then the in/out data.
    fn documented(block: &str) -> Vec<String> {
        let text = include_str!("../../../docs/function-blocks.md");
        let section = text.split("\n### ").find(|section| {
            section.lines().next().is_some_and(|title| title.split(", ").any(|name| name == block))
        });
        let section = section.unwrap_or_default();
        // What connects blocks to each other is no pin of a script.
        let name =
            |text: &str| text.split('`').nth(1).filter(|name| !name.starts_with('_')).map(str::to_owned);
        let rows = section.lines().filter(|row| row.starts_with("| in |") || row.starts_with("| out |"));
        // `us_SL_TYP0` ... `us_SL_TYP31`
        let pins = |row: &str| -> Vec<String> {
            let Some(name) = name(row) else { return Vec::new() };
            let stem = name.trim_end_matches('0');
            if row.contains("0` ... `") {
                (0..32).map(|number| format!("{stem}{number}")).collect()
            } else {
                vec![name]
            }
        };
        let in_out = section.split("In/out: ").nth(1).and_then(|text| text.split(" (").next());
        rows.flat_map(pins).chain(in_out.unwrap_or_default().split(", ").filter_map(name)).collect()
    }

    #[test]
    fn all_documented_pins_can_be_used_and_are_told_in_their_order() {
        for kind in KINDS {
            assert_eq!(kind.pins, documented(kind.name), "{}", kind.name);
        }
    }
}
