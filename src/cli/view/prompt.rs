//! Questions to the user: input of a text, or confirmation of a task.

use super::model::Model;
use super::pins::Pins;
use super::poll::MemoryLocation;
use super::work::{Task, Work};
use crate::identity::DeviceIndex;
use crate::layout::{Condition, ConditionError, NamedLocation, split_plc, value};
use crate::memory::header::BoardAssignment;
use crate::request::Op;
use crate::time;

/// Longest wait for a condition: 10 s of emulated time.
const WITHIN_US: u64 = 10_000_000;

#[derive(Clone, Debug)]
pub(super) enum Prompt {
    /// Input of a text.
    Text(TextInput),
    /// Input of a search text for the tree.
    Find,
    /// Confirmation of a task.
    Really(String, Task),
}

/// An input line for a text, with a cursor.
#[derive(Clone, Debug)]
pub(super) struct TextInput {
    /// The task for which the text is used.
    pub purpose: InputPurpose,
    /// The label before the text.
    pub head: String,
    /// The text that the user has typed so far.
    pub text: String,
    /// True if the next typed character replaces the whole text.
    pub is_selected: bool,
    /// The text is invalid; the error is the reason.
    pub wrong: Option<String>,
}

/// The task for which the input text is used.
#[derive(Clone, Debug)]
pub(super) enum InputPurpose {
    /// Value to write to a register of a PLC.
    Poke(DeviceIndex, NamedLocation),
    /// Value to force a register to.
    Force(DeviceIndex, NamedLocation),
    /// Time to advance the clock by.
    Step,
    /// Conditions to wait for.
    Until,
    /// Time to go back by.
    Back,
    /// Conditions to go back to.
    BackUntil,
    /// New position of a switch.
    Turn(BoardSwitch),
}

/// A switch at the front panel of a PLC, or another setting of `commram board set`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BoardSwitch {
    /// Number of the PLC.
    pub plc: DeviceIndex,
    /// Name in `commram board set`.
    pub name: String,
    /// Names of the positions, or a description of the possible values.
    pub choices: Vec<String>,
}

impl TextInput {
    /// Creates a text input with an initial text, which can be empty.
    pub(super) fn new(purpose: InputPurpose, head: String, text: String) -> Self {
        let is_selected = !text.is_empty();
        Self { purpose, head, text, is_selected, wrong: None }
    }

    /// Suggestions: names of values that begin with the text, with their numbers.
    pub(super) fn hints(&self) -> Vec<String> {
        if let InputPurpose::Turn(knob) = &self.purpose {
            let fitting = knob.choices.iter().filter(|choice| choice.starts_with(self.text.trim()));
            return fitting.cloned().collect();
        }
        let (InputPurpose::Poke(_, place) | InputPurpose::Force(_, place)) = &self.purpose else {
            return Vec::new();
        };
        let Some(meaning) = place.exact(place.last_phase()).and_then(|register| register.register.meaning)
        else {
            return Vec::new();
        };
        let names = value::names(meaning).into_iter();
        let fitting = names.filter(|(name, _)| name.starts_with(self.text.trim()));
        fitting.map(|(name, value)| format!("{name}  {}", place.format(place.last_phase(), value))).collect()
    }
}

impl Model {
    /// Handles the completed input; returns the confirmation that follows, if any.
    ///
    /// # Errors
    /// The text is invalid; the error is the reason.
    pub(super) fn given(&mut self, asked: &TextInput) -> Result<Option<Prompt>, String> {
        let text = asked.text.trim();
        match &asked.purpose {
            InputPurpose::Poke(plc, place) | InputPurpose::Force(plc, place) => {
                let value = place.parse_value(text).map_err(|error| error.source.to_string())?;
                let (plc, offset, width) = (*plc, place.offset(), place.width());
                let (what, op) = match asked.purpose {
                    InputPurpose::Force(..) => ("force", Op::Force { plc, offset, width, value }),
                    _ => ("poke", Op::Poke { plc, offset, width, value }),
                };
                let name = Pins::prefix(self.names(), plc) + &place.label(place.last_phase());
                let (shown, meaning) =
                    (place.format(place.last_phase(), value), place.meaning(place.last_phase(), value));
                let description = format!("{what} {name} = {shown}");
                let is_kept = what == "poke" && self.is_forced(MemoryLocation { plc, offset, width });
                let description =
                    if is_kept { description + ", which is forced and keeps its value" } else { description };
                let question = format!("{description}, {meaning}");
                let work = match place.bit_access() {
                    None => Work::Ops(vec![op]),
                    Some(access) => Work::Bit { plc, access, state: value, is_forced: what == "force" },
                };
                Ok(Some(Prompt::Really(question, Task { description, work })))
            }
            InputPurpose::Step => {
                let us = time::parse(text).map_err(|error| error.to_string())?;
                self.step = text.to_owned();
                let description = format!("{} passed", time::short(us));
                self.order(Task { description, work: Work::Advance { us, left_us: us } });
                Ok(None)
            }
            InputPurpose::Until => {
                let conditions = self.conditions(text)?;
                let work = Work::Until { conditions, us: WITHIN_US, left_us: WITHIN_US };
                self.order(Task { description: text.to_owned(), work });
                Ok(None)
            }
            InputPurpose::Back => {
                let us = time::parse(text).map_err(|error| error.to_string())?;
                self.step = text.to_owned();
                let work = Work::Ops(vec![Op::Back { us, detached: false }]);
                self.order(Task { description: format!("{} back", time::short(us)), work });
                Ok(None)
            }
            InputPurpose::BackUntil => {
                let mut ops = self.conditions(text)?;
                ops.push(Op::BackUntil { any: false, detached: false });
                self.order(Task { description: format!("back to {text}"), work: Work::Ops(ops) });
                Ok(None)
            }
            InputPurpose::Turn(BoardSwitch { plc, name, .. }) => {
                let word = format!("{name}={text}");
                let setting =
                    BoardAssignment::parse(&word).and_then(|word| word.at(self.names().device(*plc)));
                let setting = setting.map_err(|error| error.expected)?;
                let description = format!("set {}{word}", Pins::prefix(self.names(), *plc));
                let work = Work::Ops(vec![Op::SetBoard { plc: *plc, setting }]);
                Ok(Some(Prompt::Really(description.clone(), Task { description, work })))
            }
        }
    }

    /// Parses conditions into operations, and keeps the text for the next prompt.
    fn conditions(&mut self, text: &str) -> Result<Vec<Op>, String> {
        let conditions = text.split(" and ").map(|part| self.condition(part)).collect::<Result<_, _>>()?;
        self.until = text.to_owned();
        Ok(conditions)
    }

    /// Parses a condition into an operation.
    fn condition(&self, text: &str) -> Result<Op, String> {
        let names = self.names();
        let number = |plc: Option<&str>| match plc {
            Some(plc) => names.plcs.iter().position(|name| name == plc),
            None => Some(0).filter(|_| names.plcs.len() == 1),
        };
        let plc_of = |name: &str| {
            let number = number(split_plc(name).0).map(DeviceIndex::at);
            number.ok_or_else(|| format!("write the PLC in front: {}:...", names.plcs.join(", ")))
        };
        let place = |name: &str| {
            NamedLocation::parse(&names.fitted(plc_of(name)?), name).map_err(|error| error.to_string())
        };
        let condition = Condition::parse(text, place).map_err(|error| match error {
            ConditionError::Register(why) => why,
            ConditionError::Value(why) => why.to_string(),
            ConditionError::Notation { right, .. } => right.to_owned(),
        })?;
        let plc = number(condition.place.plc.as_deref()).map(DeviceIndex::at);
        let (offset, width) = (condition.place.offset(), condition.place.width());
        Ok(Op::Condition { plc: plc.unwrap_or_default(), offset, width, test: condition.test })
    }
}
