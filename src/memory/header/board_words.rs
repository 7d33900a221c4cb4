//! Boards in words, as command line and scenarios have them.

use super::{BoardSetting, BoardState, Power, ProgramState, Project, RunSwitch, Start};
use crate::layout::{RegType, split_plc, value};

/// Why a text is no [`BoardSetting`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}`: {right}")]
pub struct BoardWordError {
    /// As given.
    pub text: String,
    /// What would be right.
    pub right: String,
}

impl BoardSetting {
    /// PLC and setting of `line2:dip=5`: dip (0 to 31), leds (0 to 15), switch (run, stop, reset), power (on, off),
    /// start (cold, warm, hot, stop), project (none, boot, sent).
    ///
    /// # Errors
    /// There is no such setting, or it cannot be that.
    pub fn parse(text: &str) -> Result<(Option<&str>, Self), BoardWordError> {
        let wrong = |right: &str| BoardWordError { text: text.to_owned(), right: right.to_owned() };
        let (place, value) =
            text.split_once('=').ok_or_else(|| wrong("write NAME=VALUE, for example dip=5"))?;
        let (plc, name) = split_plc(place);
        let number = |limit: u8| {
            let number = value::parse(value, RegType::Usint).ok().and_then(|it| u8::try_from(it).ok());
            let right = format!("{name} is a number from 0 to {limit}");
            number.filter(|number| *number <= limit).ok_or_else(|| wrong(&right))
        };
        let setting = match (name, value) {
            ("dip", _) => BoardSetting::Dip(number(31)?),
            ("leds", _) => BoardSetting::Leds(number(15)?),
            ("switch", "run") => BoardSetting::Switch(RunSwitch::Run),
            ("switch", "stop") => BoardSetting::Switch(RunSwitch::Stop),
            ("switch", "reset") => BoardSetting::Switch(RunSwitch::Reset),
            ("switch", _) => return Err(wrong("the switch has the positions run, stop, reset")),
            ("power", "on") => BoardSetting::Power(Power::On),
            ("power", "off") => BoardSetting::Power(Power::Off),
            ("power", _) => return Err(wrong("power is on or off")),
            ("start", "cold") => BoardSetting::Start(Start::Cold),
            ("start", "warm") => BoardSetting::Start(Start::Warm),
            ("start", "hot") => BoardSetting::Start(Start::Hot),
            ("start", "stop") => BoardSetting::Start(Start::Stop),
            ("start", _) => return Err(wrong("starts are cold, warm, hot; stop ends the program")),
            ("project", "none") => BoardSetting::Project(Project::None),
            ("project", "boot") => BoardSetting::Project(Project::Boot),
            ("project", "sent") => BoardSetting::Project(Project::Sent),
            ("project", _) => {
                return Err(wrong("projects are boot and sent; none deletes the one that is loaded"));
            }
            _ => return Err(wrong("there are dip, leds, switch, power, start and project")),
        };
        Ok((plc, setting))
    }
}

/// A [`BoardState`] as one reads it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardWords {
    /// Character and point of the display; a blank if it is dark.
    pub display: String,
    /// The LEDs: `2#0101`.
    pub leds: String,
    /// `run`, `stop`, `reset`.
    pub switch: String,
    /// `on`, `off`.
    pub power: String,
    /// The DIP switch as set.
    pub dip: u32,
    /// The DIP number that counts.
    pub dip_latched: u32,
    /// `none`, `stopped`, `initializing`, `cyclic` and so on.
    pub program: String,
    /// The last start: `none`, `cold`, `warm`, `hot`, `stop`.
    pub start: String,
    /// Power-ons and resets.
    pub restarts: u32,
    /// `none`, `boot`, `sent`.
    pub project: String,
}

impl BoardState {
    /// The state in words; codes that mean nothing stay numbers.
    pub fn words(&self) -> BoardWords {
        BoardWords {
            display: self.display_text(),
            leds: format!("2#{:04b}", self.leds & 0xF),
            switch: named(RunSwitch::from_code(self.switch), self.switch),
            power: named(Power::from_code(self.power), self.power),
            dip: self.dip,
            dip_latched: self.dip_latched,
            program: named(ProgramState::from_code(self.program), self.program),
            start: named(Start::from_code(self.start_kind), self.start_kind),
            restarts: self.restarts,
            project: named(Project::from_code(self.project), self.project),
        }
    }
}

/// The name of a code, as words: `boot project copied`.
fn named(name: Option<impl core::fmt::Debug>, code: u32) -> String {
    let Some(name) = name else { return code.to_string() };
    let mut words = String::new();
    for character in format!("{name:?}").chars() {
        if character.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(character.to_lowercase());
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_named() {
        let parse = BoardSetting::parse;
        assert_eq!(parse("dip=31").unwrap(), (None, BoardSetting::Dip(31)));
        assert_eq!(parse("line2:leds=2#1010").unwrap(), (Some("line2"), BoardSetting::Leds(10)));
        assert_eq!(parse("switch=reset").unwrap().1, BoardSetting::Switch(RunSwitch::Reset));
        assert_eq!(parse("start=hot").unwrap().1, BoardSetting::Start(Start::Hot));
        assert_eq!(parse("project=sent").unwrap().1, BoardSetting::Project(Project::Sent));
        let message = |text| parse(text).err().unwrap().to_string();
        assert_eq!(message("dip=32"), "`dip=32`: dip is a number from 0 to 31");
        assert_eq!(message("dip"), "`dip`: write NAME=VALUE, for example dip=5");
        assert!(message("switch=off").contains("run, stop, reset"));
        assert!(message("display=8").contains("there are dip, leds"));
    }

    #[test]
    fn codes_are_told_in_words() {
        assert_eq!(named(ProgramState::from_code(6), 6), "boot project copied");
        assert_eq!(named(ProgramState::from_code(60), 60), "60");
    }
}
