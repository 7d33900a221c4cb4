//! The verbs of function blocks.

use super::arguments::span;
use super::shown::value_text;
use super::{Fallible, Verbs, int};
use crate::devices::{self, Registered};
use crate::identity::DeviceIndex;
use crate::layout::{Area, did_you_mean};
use crate::plc::{BlockContext, BlockInstance, BlockKind, PinError, PinValue, Variables};
use crate::script::caught::Caught;
use crate::script::{Bench, ScenarioError};
use core::cell::RefCell;
use core::fmt::Write;
use core::panic::Location;
use rhai::{Array, Dynamic, INT};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Interval of the calls of a block while a scenario waits for one of its outputs, in microseconds.
const CYCLE_US: u64 = 500;

/// A function block as a value of scripts. Several variables may refer to the same block.
#[derive(Clone)]
pub(super) struct Block {
    kind: &'static BlockKind,
    /// Place of the block's registers, as the script has given it.
    place: String,
    instance: Rc<RefCell<Box<dyn BlockInstance>>>,
}

fn find(blocks: &'static [BlockKind], name: &str) -> Option<&'static BlockKind> {
    blocks.iter().find(|kind| kind.name == name)
}

fn unknown(name: &str, device: &Registered) -> ScenarioError {
    let names = || device.blocks.iter().map(|kind| kind.name);
    let title = device.layout.title;
    let known = match device.blocks {
        [] => "no function blocks".to_owned(),
        _ => names().collect::<Vec<_>>().join(", "),
    };
    // A suggestion, or an empty text.
    let near = did_you_mean(name, names());
    let end = if near.is_empty() { ";" } else { "" };
    ScenarioError::argument(name, &format!("no such function block{near}{end} {title} has {known}"))
}

/// Returns the device of a PLC.
fn device_of(bench: &mut Bench, plc: DeviceIndex) -> Result<&'static Registered, ScenarioError> {
    let hash = bench.ram_of(plc)?.header().layout_hash.load();
    Ok(devices::of_hash(hash).unwrap_or(devices::default()))
}

impl Block {
    fn new(
        bench: &mut Bench,
        variables: &mut BTreeMap<DeviceIndex, Variables>,
        name: &str,
        place: &str,
    ) -> Result<Self, ScenarioError> {
        // The device is not known before the place is looked up. A block that needs an area needs it on every device,
        // so any device that has the block gives the answer.
        let of_any = devices::all().iter().find_map(|device| find(device.blocks, name));
        let Some(of_any) = of_any else {
            let plc = bench.area(place).map(|(plc, _)| plc).or_else(|_| bench.only_plc(place))?;
            return Err(unknown(name, device_of(bench, plc)?));
        };
        let (plc, area) = match of_any.structure {
            Some(_) => bench.area(place).map(|(plc, area)| (plc, Some(area)))?,
            None => (bench.only_plc(place)?, None),
        };
        let device = device_of(bench, plc)?;
        let ram = bench.ram_of(plc)?;
        let kind = find(device.blocks, name).ok_or_else(|| unknown(name, device))?;
        if let (Some(structure), Some(area)) = (kind.structure, area) {
            check_area(device, kind, structure, area, place)?;
        }
        let variables = variables.entry(plc).or_default();
        let offset = area.map_or(0, |area| area.first);
        let instance = kind.make(&BlockContext { ram: &ram, offset, variables })?;
        Ok(Self { kind, place: place.to_owned(), instance: Rc::new(RefCell::new(instance)) })
    }

    fn get(&self, pin: &str) -> Result<Dynamic, ScenarioError> {
        self.instance.borrow().get(pin).map(shown).ok_or_else(|| self.no_pin(pin))
    }

    fn set(&self, pin: &str, value: &Dynamic) -> Result<(), ScenarioError> {
        let taken = self.instance.borrow_mut().set(pin, &given(value)).ok_or_else(|| self.no_pin(pin))?;
        taken.map_err(|error| match error {
            PinError::Wrong { given, right } => {
                ScenarioError::argument(&given, &format!("{} of {} is {right}", pin, self.kind.name))
            }
            PinError::Time { text, source } => ScenarioError::Time { text, source },
        })
    }

    fn no_pin(&self, pin: &str) -> ScenarioError {
        let known = self.kind.pins.iter().map(|pin| pin.name).collect::<Vec<_>>().join(", ");
        let right = format!("{} has no such input or output; it has {known}", self.kind.name);
        ScenarioError::argument(pin, &right)
    }

    /// Returns the value of a BOOL output.
    fn is(&self, pin: &str) -> Result<bool, ScenarioError> {
        let not_bool = |_| ScenarioError::argument(pin, "this output is no BOOL");
        self.get(pin)?.as_bool().map_err(not_bool)
    }

    /// Runs one PLC cycle of the block. The board answers requests of the block immediately.
    fn call(&self, bench: &mut Bench) -> Result<(), ScenarioError> {
        self.instance.borrow_mut().cycle();
        bench.answer_boards()
    }

    /// Calls the block in every processor cycle until an output is TRUE.
    fn until(
        &self,
        bench: &mut Bench,
        output: &str,
        within_us: u64,
        at: &Location<'_>,
    ) -> Result<u64, ScenarioError> {
        let start = bench.now()?;
        let has_error = self.kind.has("x_ERR") && output != "x_ERR";
        loop {
            self.call(bench)?;
            if self.is(output)? {
                return bench.time_since(start);
            }
            let late = bench.now()? >= start.saturating_add(within_us);
            if late || has_error && self.is("x_ERR")? {
                let what = format!("{} at {}: {output} did not become TRUE", self.kind.name, self.place);
                let mut failure = bench.failure(what, at)?;
                failure.expected = Some(format!("{output} TRUE within {}", crate::time::short(within_us)));
                failure.actual = Some(self.pins());
                return Err(failure.into());
            }
            bench.step(CYCLE_US)?;
        }
    }

    /// Returns the block as text: `NAME at node2: x_EN FALSE, w_ERR 16#0000`.
    pub(super) fn text(&self) -> String {
        let Self { kind, place, .. } = self;
        let at = if place.is_empty() { String::new() } else { format!(" at {place}") };
        format!("{}{at}: {}", kind.name, self.pins())
    }

    /// Returns values of all pins that are not arrays: `x_OK FALSE, w_ERR 16#0801`.
    fn pins(&self) -> String {
        let mut text = String::new();
        for pin in self.kind.pins.iter().map(|pin| pin.name) {
            let shown = match self.instance.borrow().get(pin) {
                Some(PinValue::Bool(value)) => if value { "TRUE" } else { "FALSE" }.to_owned(),
                Some(PinValue::Int(value)) if pin.starts_with("w_") => format!("16#{value:04X}"),
                Some(PinValue::Int(value)) if pin.starts_with("b_") => format!("16#{value:02X}"),
                Some(value @ (PinValue::Int(_) | PinValue::Time(_))) => value.to_string(),
                _ => continue,
            };
            // Writing to a String cannot fail.
            let _ = write!(text, "{}{pin} {shown}", if text.is_empty() { "" } else { ", " });
        }
        text
    }
}

/// Converts the value of a pin for scripts. A time becomes a number of microseconds.
fn shown(value: PinValue) -> Dynamic {
    match value {
        PinValue::Bool(value) => value.into(),
        PinValue::Int(value) => value.into(),
        PinValue::Time(time) => INT::try_from(time.as_micros()).unwrap_or(INT::MAX).into(),
        PinValue::Text(text) => text.into(),
        PinValue::Array(items) => items.into_iter().map(shown).collect::<Array>().into(),
    }
}

/// Converts a value of the script to a pin value.
fn given(value: &Dynamic) -> PinValue {
    if let Ok(items) = value.as_array_ref() {
        return PinValue::Array(items.iter().map(given).collect());
    }
    match (value.as_bool(), value.as_int()) {
        (Ok(value), _) => PinValue::Bool(value),
        (_, Ok(value)) => PinValue::Int(value),
        // A value of another type becomes a text that no pin accepts. The error of the pin then shows this text.
        _ => PinValue::Text(value_text(value)),
    }
}

/// Checks that the area has the registers that the block needs.
fn check_area(
    device: &Registered,
    kind: &BlockKind,
    structure: &str,
    area: &Area,
    place: &str,
) -> Result<(), ScenarioError> {
    let fits = |area: &Area| area.structures.iter().any(|placed| placed.structure.name == structure);
    if fits(area) {
        return Ok(());
    }
    let areas: Vec<_> = device.layout.areas.iter().filter(|area| fits(area)).map(|area| area.name).collect();
    let right = format!("{} needs {structure}, which is in {}", kind.name, areas.join(", "));
    Err(ScenarioError::argument(place, &right))
}

impl Verbs {
    pub(super) fn blocks(&mut self) {
        // For each PLC, the variables through which blocks exchange data.
        let variables = RefCell::<BTreeMap<DeviceIndex, Variables>>::default();
        self.on("block", |stage| {
            move |name: &str, place: &str| {
                stage.act(|bench| Block::new(bench, &mut variables.borrow_mut(), name, place))
            }
        });
        self.on("cycle", |stage| move |block: &mut Block| stage.act(|bench| block.call(bench)));
        self.on("cycle_until", |stage| {
            move |block: &mut Block, output: &str, within: Dynamic| -> Fallible<INT> {
                stage.expect(|bench| {
                    let within_us = bench.span(span(&within)?)?;
                    block.until(bench, output, within_us, Location::caller()).map(int)
                })
            }
        });
        let get = |block: &mut Block, pin: &str| block.get(pin).map_err(Caught::thrown);
        let set =
            |block: &mut Block, pin: &str, value: Dynamic| block.set(pin, &value).map_err(Caught::thrown);
        self.engine
            .register_type_with_name::<Block>("Block")
            .register_indexer_get(get)
            .register_indexer_set(set);
    }
}
