//! What is asked of the user: a text, or whether something is really to be done.

use super::model::Model;
use super::pins::Pins;
use super::work::{Task, Work};
use crate::layout::{Condition, ConditionError, Place, RegisterPhase, split_plc, value};
use crate::memory::header::BoardWord;
use crate::request::Op;
use crate::time;

/// How long the wait for a condition lets the time pass at most: 10 s of emulated time.
const WITHIN_US: u64 = 10_000_000;

/// A question.
#[derive(Clone, Debug)]
pub(super) enum Prompt {
    /// A text, for this.
    Text(Asked),
    /// What to look for in the tree.
    Find,
    /// Whether this is to be done.
    Really(String, Task),
}

/// A text that is asked for.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    /// What for.
    pub aim: Aim,
    /// What stands in front of it.
    pub head: String,
    /// The text so far.
    pub text: String,
    /// What is typed takes the place of the text.
    pub is_selected: bool,
    /// What is wrong with it.
    pub wrong: Option<String>,
}

/// What a text is for.
#[derive(Clone, Debug)]
pub(super) enum Aim {
    /// The value that is written to a register of a PLC.
    Poke(u16, Place),
    /// The value that it is to keep.
    Force(u16, Place),
    /// How long time is to pass.
    Step,
    /// What is waited for.
    Until,
    /// How far to go back.
    Back,
    /// What is to hold there.
    BackUntil,
    /// How a switch of a front is to stand.
    Turn(Knob),
}

/// A switch at the front of a PLC, or what else `commram board set` sets there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Knob {
    /// Number of the PLC.
    pub plc: u16,
    /// Its name in `commram board set`.
    pub name: String,
    /// How it can stand, as far as that has names, else what it can be.
    pub choices: Vec<String>,
}

impl Asked {
    /// A text for this, which may stand there already.
    pub(super) fn new(aim: Aim, head: String, text: String) -> Self {
        let is_selected = !text.is_empty();
        Self { aim, head, text, is_selected, wrong: None }
    }

    /// What may be meant: what values are called that begin so, and as numbers.
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
    /// What is asked next once a text is given: nothing more, a question, or the same again.
    ///
    /// # Errors
    /// What is wrong with the text.
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

    /// Conditions as operations; what was asked for stands there when it is asked for again.
    fn conditions(&mut self, text: &str) -> Result<Vec<Op>, String> {
        let conditions = text.split(" and ").map(|part| self.condition(part)).collect::<Result<_, _>>()?;
        self.until = text.to_owned();
        Ok(conditions)
    }

    /// A condition as an operation.
    fn condition(&self, text: &str) -> Result<Op, String> {
        let names = self.names();
        let number = |plc: Option<&str>| match plc {
            Some(plc) => names.plcs.iter().position(|name| name == plc),
            None => Some(0).filter(|_| names.plcs.len() == 1),
        };
        let plc_of = |name: &str| {
            let number = number(split_plc(name).0).and_then(|number| u16::try_from(number).ok());
            number.ok_or_else(|| format!("name the PLC in front: {}:...", names.plcs.join(", ")))
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
