//! Board settings and states as text, for the command line and scenarios.

use super::{BoardSetting, BoardState, Power, ProgramState, Project, RunSwitch, Start};
use crate::layout::{DeviceLayout, LayoutError, Owner, RegType, split_plc, value};

/// The reason why a text is not a [`BoardSetting`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}`: {expected}")]
pub struct BoardAssignmentError {
    /// Assignment to the board that cannot be read, as the user wrote it.
    pub text: String,
    /// Text about the accepted values, as a sentence.
    pub expected: String,
}

/// A [`BoardSetting`] as text. Its PLC is a name that was not looked up yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardAssignment<'a> {
    /// The assignment as the user wrote it.
    pub text: &'a str,
    /// Name of the PLC, if the user has given one.
    pub plc: Option<&'a str>,
    what: AssignmentTarget<'a>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AssignmentTarget<'a> {
    Setting(BoardSetting),
    /// Setting of the DIP switches of a module in a port.
    ModuleDip {
        port: &'a str,
        dip: u8,
    },
    /// Setting of a front panel element that only some devices have.
    Front {
        name: &'a str,
        value: &'a str,
    },
}

/// Settings with a fixed set of values: name, word of the value, setting.
const WORDS: [(&str, &str, BoardSetting); 12] = [
    ("switch", "run", BoardSetting::Switch(RunSwitch::Run)),
    ("switch", "stop", BoardSetting::Switch(RunSwitch::Stop)),
    ("switch", "reset", BoardSetting::Switch(RunSwitch::Reset)),
    ("power", "on", BoardSetting::Power(Power::On)),
    ("power", "off", BoardSetting::Power(Power::Off)),
    ("start", "cold", BoardSetting::Start(Start::Cold)),
    ("start", "warm", BoardSetting::Start(Start::Warm)),
    ("start", "hot", BoardSetting::Start(Start::Hot)),
    ("start", "stop", BoardSetting::Start(Start::Stop)),
    ("project", "none", BoardSetting::Project(Project::None)),
    ("project", "boot", BoardSetting::Project(Project::Boot)),
    ("project", "sent", BoardSetting::Project(Project::Sent)),
];

impl<'a> BoardAssignment<'a> {
    /// Parses PLC and setting, for example `line2:dip=5`: dip (0 to 31), leds (0 to 15), switch (run, stop, reset),
    /// power (on, off), start (cold, warm, hot, stop), project (none, boot, sent). `maxx:slotH.dip=7` sets the DIP
    /// switches of a module. Any other NAME=VALUE is an element of the front panel of a specific device, for example
    /// `panel:s1=unlock`.
    ///
    /// # Errors
    /// The setting is unknown, or cannot have this value.
    pub fn parse(text: &'a str) -> Result<Self, BoardAssignmentError> {
        let wrong =
            |expected: &str| BoardAssignmentError { text: text.to_owned(), expected: expected.to_owned() };
        let (place, value) =
            text.split_once('=').ok_or_else(|| wrong("write NAME=VALUE, for example dip=5"))?;
        let (plc, name) = split_plc(place);
        let number = |limit: u8| {
            let number = value::parse(value, RegType::Usint).ok().and_then(|it| u8::try_from(it).ok());
            let expected = format!("{name} is a number from 0 to {limit}");
            number.filter(|number| *number <= limit).ok_or_else(|| wrong(&expected))
        };
        if let Some((port, name)) = name.split_once('.') {
            return match name {
                "dip" => Ok(Self { text, plc, what: AssignmentTarget::ModuleDip { port, dip: number(31)? } }),
                _ => Err(wrong("a module has dip, its DIP switches")),
            };
        }
        let word = WORDS.iter().find(|(known, word, _)| (*known, *word) == (name, value));
        let setting = match (name, word) {
            (_, Some((.., setting))) => *setting,
            ("dip", _) => BoardSetting::Dip(number(31)?),
            ("leds", _) => BoardSetting::Leds(number(15)?),
            ("switch", _) => return Err(wrong("the switch has the positions run, stop, reset")),
            ("power", _) => return Err(wrong("power is on or off")),
            ("start", _) => return Err(wrong("starts are cold, warm, hot; stop ends the program")),
            ("project", _) => {
                return Err(wrong("projects are boot and sent; none deletes the loaded one"));
            }
            _ => return Ok(Self { text, plc, what: AssignmentTarget::Front { name, value } }),
        };
        Ok(Self { text, plc, what: AssignmentTarget::Setting(setting) })
    }

    /// Creates the assignment of `setting` to a PLC. Messages show `text`.
    pub fn of(text: &'a str, plc: Option<&'a str>, setting: BoardSetting) -> Self {
        Self { text, plc, what: AssignmentTarget::Setting(setting) }
    }

    /// Returns the setting for a PLC of this device type.
    ///
    /// # Errors
    /// The device has no such port or switch, or the switch cannot have this value.
    pub fn at(&self, device: &'static DeviceLayout) -> Result<BoardSetting, BoardAssignmentError> {
        let wrong = |error: LayoutError| BoardAssignmentError {
            text: self.text.to_owned(),
            expected: error.to_string(),
        };
        match self.what {
            AssignmentTarget::Setting(setting) => Ok(setting),
            AssignmentTarget::ModuleDip { port, dip } => {
                let port = device.port_named(port).map_err(wrong)?.number;
                Ok(BoardSetting::ModuleDip { port, dip })
            }
            AssignmentTarget::Front { name, value } => {
                let wrong = |expected| BoardAssignmentError { text: self.text.to_owned(), expected };
                let switches = || device.front.iter().filter(|word| word.owner == Owner::Plc);
                let Some(word) = switches().find(|word| word.name == name) else {
                    let own: String = switches().map(|word| format!(", {}", word.name)).collect();
                    return Err(wrong(format!(
                        "the settings are dip, leds, switch, power, start, project{own}"
                    )));
                };
                let value = word.parse(value);
                let value = value.ok_or_else(|| wrong(format!("{name} can be {}", word.choices())))?;
                Ok(BoardSetting::Front { word: word.index() as u8, value })
            }
        }
    }
}

impl BoardSetting {
    /// Returns the word for this value in [`BoardAssignment::parse`].
    pub fn name(self) -> &'static str {
        match self {
            BoardSetting::Dip(_) | BoardSetting::ModuleDip { .. } => "dip",
            BoardSetting::Leds(_) => "leds",
            BoardSetting::Switch(_) => "switch",
            BoardSetting::Power(_) => "power",
            BoardSetting::Start(_) => "start",
            BoardSetting::Project(_) => "project",
            BoardSetting::Reset => "reset",
            BoardSetting::PowerCycle => "power-cycle",
            BoardSetting::Front { .. } => "front",
        }
    }

    /// Returns the text from which [`BoardAssignment`] makes this setting of a device, without the PLC. `None` for
    /// RESET and an interruption of the supply, which have no such text, and for a setting that the device does not
    /// have.
    #[cfg(feature = "cli")]
    pub(crate) fn word(self, device: &DeviceLayout) -> Option<String> {
        Some(match self {
            BoardSetting::Dip(number) => format!("dip={number}"),
            BoardSetting::Leds(leds) => format!("leds={leds}"),
            BoardSetting::ModuleDip { port, dip } => {
                format!("{}.dip={dip}", device.port_numbered(port)?.name)
            }
            BoardSetting::Front { word, value } => {
                let word = device.front.iter().find(|known| known.index() == usize::from(word))?;
                format!("{}={}", word.name, word.called(value))
            }
            other => {
                let (name, value, _) = WORDS.iter().find(|(.., setting)| *setting == other)?;
                format!("{name}={value}")
            }
        })
    }
}

/// A [`BoardState`] as text. A field is `None` if the device does not have this element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardWords {
    /// Character and point of the display; a blank if it is dark.
    pub display: Option<String>,
    /// The LEDs as a binary number, for example `2#0101`.
    pub leds: Option<String>,
    /// Position of the switch: `run`, `stop` or `reset`.
    pub switch: Option<String>,
    /// State of the supply: `on` or `off`.
    pub power: String,
    /// Present position of the DIP switch.
    pub dip: Option<u32>,
    /// The DIP number in effect: the switches as they were at the last power-on or reset.
    pub dip_latched: Option<u32>,
    /// `none`, `stopped`, `initializing`, `cyclic` and so on.
    pub program: Option<String>,
    /// Kind of the last start: `none`, `cold`, `warm`, `hot` or `stop`.
    pub start: Option<String>,
    /// Number of power-ons and resets.
    pub restarts: u32,
    /// Project on the board: `none`, `boot` or `sent`.
    pub project: Option<String>,
}

impl BoardWords {
    /// Names of the fields, in outputs and in the description of a device.
    pub const NAMES: [&'static str; 10] = [
        "display",
        "leds",
        "switch",
        "power",
        "dip",
        "dip_latched",
        "program",
        "start",
        "restarts",
        "project",
    ];
}

impl BoardState {
    /// Returns the state as text, limited to the fields `has`, which are names of [`BoardWords::NAMES`]. A code without
    /// a name becomes a number.
    pub fn words(&self, has: &[&str]) -> BoardWords {
        let has = |name| has.contains(&name);
        let if_has = |name, text: String| has(name).then_some(text);
        BoardWords {
            display: if_has("display", self.display_text()),
            leds: if_has("leds", format!("2#{:04b}", self.leds & 0xF)),
            switch: if_has("switch", named(RunSwitch::from_code(self.switch), self.switch)),
            power: named(Power::from_code(self.power), self.power),
            dip: has("dip").then_some(self.dip),
            dip_latched: has("dip_latched").then_some(self.dip_latched),
            program: if_has("program", named(ProgramState::from_code(self.program), self.program)),
            start: if_has("start", named(Start::from_code(self.start_kind), self.start_kind)),
            restarts: self.restarts,
            project: if_has("project", named(Project::from_code(self.project), self.project)),
        }
    }
}

/// Returns the name of a code as separate words: `boot project copied`.
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
    use crate::devices::samples::tables::{PANEL, SLOTS};
    use crate::identity::PortNumber;

    #[test]
    fn settings_are_named() {
        let parse = |text| BoardAssignment::parse(text).unwrap();
        let setting = |text| parse(text).at(&SLOTS).unwrap();
        assert_eq!((parse("dip=31").plc, setting("dip=31")), (None, BoardSetting::Dip(31)));
        assert_eq!(parse("line2:leds=2#1010").plc, Some("line2"));
        assert_eq!(setting("line2:leds=2#1010"), BoardSetting::Leds(10));
        assert_eq!(setting("switch=reset"), BoardSetting::Switch(RunSwitch::Reset));
        assert_eq!(setting("start=hot"), BoardSetting::Start(Start::Hot));
        assert_eq!(setting("project=sent"), BoardSetting::Project(Project::Sent));
        assert_eq!(parse("maxx:slotH.dip=7").plc, Some("maxx"));
        assert_eq!(setting("maxx:slotH.dip=7"), BoardSetting::ModuleDip { port: PortNumber(2), dip: 7 });
        let message = |text| {
            let setting = BoardAssignment::parse(text).and_then(|word| word.at(&SLOTS));
            setting.err().unwrap().to_string()
        };
        assert_eq!(message("dip=32"), "`dip=32`: dip is a number from 0 to 31");
        assert_eq!(message("dip"), "`dip`: write NAME=VALUE, for example dip=5");
        assert!(message("switch=off").contains("run, stop, reset"));
        assert_eq!(message("slotH.dip=32"), "`slotH.dip=32`: slotH.dip is a number from 0 to 31");
        assert!(message("slotH.leds=1").contains("a module has dip"));
        assert!(message("slotI.dip=1").contains("unknown port `slotI`; the ports are slotG, slotH"));
        assert!(message("display=8").contains("the settings are dip, leds, switch, power, start, project"));
    }

    /// A setting does not change when it is converted to text and back, or to the two numbers of the channel and back.
    #[test]
    fn every_setting_has_a_unique_word_and_unique_numbers() {
        use BoardSetting as Set;
        let all = [
            ("dip=17", Set::Dip(17)),
            ("leds=9", Set::Leds(9)),
            ("switch=run", Set::Switch(RunSwitch::Run)),
            ("switch=stop", Set::Switch(RunSwitch::Stop)),
            ("switch=reset", Set::Switch(RunSwitch::Reset)),
            ("power=on", Set::Power(Power::On)),
            ("power=off", Set::Power(Power::Off)),
            ("start=cold", Set::Start(Start::Cold)),
            ("start=warm", Set::Start(Start::Warm)),
            ("start=hot", Set::Start(Start::Hot)),
            ("start=stop", Set::Start(Start::Stop)),
            ("project=none", Set::Project(Project::None)),
            ("project=boot", Set::Project(Project::Boot)),
            ("project=sent", Set::Project(Project::Sent)),
            ("slotH.dip=21", Set::ModuleDip { port: PortNumber(2), dip: 21 }),
        ];
        let mut numbers = Vec::new();
        for (text, setting) in all {
            assert_eq!(BoardAssignment::parse(text).unwrap().at(&SLOTS), Ok(setting), "{text}");
            let (which, value) = setting.numbers();
            assert_eq!(BoardSetting::from_numbers(which, value), Some(setting), "{text}");
            assert!(!numbers.contains(&(which, value)), "{text}");
            numbers.push((which, value));
        }
        for (text, expected) in [
            ("power=half", "power is on or off"),
            ("start=slow", "starts are cold, warm, hot; stop ends the program"),
            ("project=old", "projects are boot and sent; none deletes the loaded one"),
        ] {
            assert_eq!(BoardAssignment::parse(text).unwrap_err().expected, expected);
        }
    }

    #[test]
    fn a_device_can_have_own_switches() {
        let setting = |text| BoardAssignment::parse(text).and_then(|word| word.at(&PANEL));
        let front = |word, value| Ok(BoardSetting::Front { word, value });
        assert_eq!(setting("panel:s1=unlock"), front(5, 1));
        assert_eq!(setting("s2=15"), front(6, 15));
        assert_eq!(setting("inputs=16#8001"), front(4, 0x8001));
        assert_eq!(setting("program=stop"), front(3, 2));
        let message = |text| setting(text).unwrap_err().to_string();
        assert_eq!(message("s2=16"), "`s2=16`: s2 can be 0 to 15");
        assert_eq!(message("s1=open"), "`s1=open`: s1 can be lock, unlock");
        // Clients cannot set words that the firmware writes.
        assert!(message("stat=green").ends_with("s4, s5, mhz_0, mhz_1, mhz_2, mhz_3, turn_0, turn_1"));
        for setting in [BoardSetting::Front { word: 63, value: u32::MAX }, BoardSetting::Dip(3)] {
            let (which, value) = setting.numbers();
            assert_eq!(BoardSetting::from_numbers(which, value), Some(setting));
        }
        assert_eq!(BoardSetting::from_numbers(0x140, 0), None);
    }

    #[test]
    fn codes_are_printed_as_words() {
        assert_eq!(named(ProgramState::from_code(6), 6), "boot project copied");
        assert_eq!(named(ProgramState::from_code(60), 60), "60");
    }
}
