//! Questions to the user: input of a text, or confirmation of a task.

use super::model::Model;
use super::pins::Pins;
use super::work::{Task, Work};
use crate::layout::{Condition, ConditionError, Place, RegisterPhase, split_plc, value};
use crate::memory::header::BoardWord;
use crate::request::Op;
use crate::time;

/// Longest wait for a condition: 10 s of emulated time.
const WITHIN_US: u64 = 10_000_000;

#[derive(Clone, Debug)]
pub(super) enum Prompt {
    /// Input of a text.
    Text(Asked),
    /// Input of a search text for the tree.
    Find,
    /// Confirmation of a task.
    Really(String, Task),
}

/// A text input.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    /// Use of the text.
    pub aim: Aim,
    /// The label before the text.
    pub head: String,
    /// The current text.
    pub text: String,
    /// True if typing replaces the text.
    pub is_selected: bool,
    /// The error in the text.
    pub wrong: Option<String>,
}

/// Use of a text input.
#[derive(Clone, Debug)]
pub(super) enum Aim {
    /// Value to write to a register of a PLC.
    Poke(u16, Place),
    /// Value to force a register to.
    Force(u16, Place),
    /// Time to advance the clock by.
    Step,
    /// Conditions to wait for.
    Until,
    /// Time to go back by.
    Back,
    /// Conditions to go back to.
    BackUntil,
    /// New position of a switch.
    Turn(Knob),
}

/// A switch at the front of a PLC, or another setting of `commram board set`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Knob {
    /// Number of the PLC.
    pub plc: u16,
    /// Name in `commram board set`.
    pub name: String,
    /// Names of the positions, or a description of the possible values.
    pub choices: Vec<String>,
}

impl Asked {
    /// A text input, which can contain an initial text.
    pub(super) fn new(aim: Aim, head: String, text: String) -> Self {
        let is_selected = !text.is_empty();
        Self { aim, head, text, is_selected, wrong: None }
    }

    /// Suggestions: names of values that begin with the text, with their numbers.
    pub(super) fn hints(&self) -> Vec<String> {
        if let Aim::Turn(knob) = &self.aim {
            let fitting = knob.choices.iter().filter(|choice| choice.starts_with(self.text.trim()));
            return fitting.cloned().collect();
        }
        let (Aim::Poke(_, place) | Aim::Force(_, place)) = &self.aim else { return Vec::new() };
        let Some(meaning) = place.exact(RegisterPhase::Cyclic).and_then(|register| register.register.meaning)
        else {
            return Vec::new();
        };
        let names = value::names(meaning).into_iter();
        let fitting = names.filter(|(name, _)| name.starts_with(self.text.trim()));
        fitting
            .map(|(name, value)| format!("{name}  {}", place.format(RegisterPhase::Cyclic, value)))
            .collect()
    }
}

impl Model {
    /// Handles the completed input; returns the confirmation that follows, if any.
    ///
    /// # Errors
    /// The error in the text.
    pub(super) fn given(&mut self, asked: &Asked) -> Result<Option<Prompt>, String> {
        let text = asked.text.trim();
        match &asked.aim {
            Aim::Poke(plc, place) | Aim::Force(plc, place) => {
                let value = place.parse_value(text).map_err(|error| error.source.to_string())?;
                let (plc, offset, width) = (*plc, place.offset(), place.width());
                let (what, op) = match asked.aim {
                    Aim::Force(..) => ("force", Op::Force { plc, offset, width, value }),
                    _ => ("poke", Op::Poke { plc, offset, width, value }),
                };
                let name = Pins::prefix(self.names(), plc) + &place.label(RegisterPhase::Cyclic);
                let (shown, meaning) =
                    (place.format(RegisterPhase::Cyclic, value), place.meaning(RegisterPhase::Cyclic, value));
                let told = format!("{what} {name} = {shown}");
                let question = format!("{told}, {meaning}");
                Ok(Some(Prompt::Really(question, Task { told, work: Work::Ops(vec![op]) })))
            }
            Aim::Step => {
                let us = time::parse(text).map_err(|error| error.to_string())?;
                self.step = text.to_owned();
                let told = format!("{} passed", time::short(us));
                self.order(Task { told, work: Work::Advance { us, left_us: us } });
                Ok(None)
            }
            Aim::Until => {
                let conditions = self.conditions(text)?;
                let work = Work::Until { conditions, us: WITHIN_US, left_us: WITHIN_US };
                self.order(Task { told: text.to_owned(), work });
                Ok(None)
            }
            Aim::Back => {
                let us = time::parse(text).map_err(|error| error.to_string())?;
                self.step = text.to_owned();
                let work = Work::Ops(vec![Op::Back { us, detached: false }]);
                self.order(Task { told: format!("{} back", time::short(us)), work });
                Ok(None)
            }
            Aim::BackUntil => {
                let mut ops = self.conditions(text)?;
                ops.push(Op::BackUntil { any: false, detached: false });
                self.order(Task { told: format!("back to {text}"), work: Work::Ops(ops) });
                Ok(None)
            }
            Aim::Turn(Knob { plc, name, .. }) => {
                let word = format!("{name}={text}");
                let setting = BoardWord::parse(&word).and_then(|word| word.at(self.names().device(*plc)));
                let setting = setting.map_err(|error| error.right)?;
                let told = format!("set {}{word}", Pins::prefix(self.names(), *plc));
                let work = Work::Ops(vec![Op::SetBoard { plc: *plc, setting }]);
                Ok(Some(Prompt::Really(told.clone(), Task { told, work })))
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
            let number = number(split_plc(name).0).and_then(|number| u16::try_from(number).ok());
            number.ok_or_else(|| format!("write the PLC in front: {}:...", names.plcs.join(", ")))
        };
        let place =
            |name: &str| Place::parse(&names.fitted(plc_of(name)?), name).map_err(|error| error.to_string());
        let condition = Condition::parse(text, place).map_err(|error| match error {
            ConditionError::Register(why) => why,
            ConditionError::Value(why) => why.to_string(),
            ConditionError::Notation { right, .. } => right.to_owned(),
        })?;
        let plc = number(condition.place.plc.as_deref()).and_then(|number| u16::try_from(number).ok());
        let (offset, width) = (condition.place.offset(), condition.place.width());
        Ok(Op::Condition { plc: plc.unwrap_or(0), offset, width, test: condition.test })
    }
}
