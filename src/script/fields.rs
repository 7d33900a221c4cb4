//! Results of verbs that have named fields: maps in scenarios, dictionaries in Python.

use super::Bench;
use super::ScenarioError;
use crate::devices::{DriveDetails, DriveState, Led, ModuleFront, Switch};
use crate::layout::{FrontWord, shown_text};
use crate::memory::header::{BoardState, BoardWords};

/// Names with their values. The order is that of the device.
pub type Fields = Vec<(String, Field)>;

/// The value of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Field {
    /// True or false.
    Flag(bool),
    /// A number.
    Number(i64),
    /// A text.
    Text(String),
    /// Further fields.
    Fields(Fields),
}

impl From<u64> for Field {
    fn from(number: u64) -> Self {
        Self::Number(i64::try_from(number).unwrap_or(i64::MAX))
    }
}

impl From<&str> for Field {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl Bench {
    /// Returns the displays and switch positions of the board of a PLC, as far as the device has these elements: `display`,
    /// `leds`, `run_switch`, `power`, `dip`, `dip_latched`, `program`, `start`, `restarts`, `project`, further elements of
    /// the front panel of this device, and `modules` if the PLC is modular. `""` means the only PLC.
    ///
    /// # Errors
    /// There is no such PLC.
    pub fn board_fields(&mut self, plc: &str) -> Result<Fields, ScenarioError> {
        let (BoardState { leds: lit, .. }, words) = self.board(plc)?;
        let BoardWords { display, leds, switch, power, dip, dip_latched, program, start, restarts, project } =
            words;
        let number = |number: Option<u64>| number.map(Field::from);
        let text = |text: Option<String>| text.map(Field::Text);
        let front = self.front(plc)?;
        let display = shown_text(&front).map(Field::Text).or(text(display));
        // The map has `run_switch`, because `switch` is a keyword of the language of scenarios.
        let fields = [
            ("display", display),
            ("leds", number(leds.map(|_| lit.into()))),
            ("run_switch", text(switch)),
            ("power", text(Some(power))),
            ("dip", number(dip.map(Into::into))),
            ("dip_latched", number(dip_latched.map(Into::into))),
            ("program", text(program)),
            ("start", text(start)),
            ("restarts", number(Some(restarts.into()))),
            ("project", text(project)),
        ];
        let fields = fields.into_iter().filter_map(|(name, field)| Some((name.to_owned(), field?)));
        let words = front.into_iter().filter(|(word, _)| !word.is_text);
        let mut fields: Fields = fields.chain(words.map(|(word, value)| front_field(word, value))).collect();
        if let Some(modules) = self.modules(plc)? {
            let modules = modules.into_iter().map(|(port, front)| (port.to_owned(), module_fields(front)));
            fields.push(("modules".to_owned(), Field::Fields(modules.collect())));
        }
        Ok(fields)
    }

    /// Returns the state of a drive like [`Bench::drive`]: `state`, `synchronized`, `reference`, `speed`, `fault`,
    /// `status_word`, `lost_references`, `stopped`, and `parameters` with the present values, for example `P167`.
    ///
    /// # Errors
    /// There is no such drive.
    pub fn drive_fields(&mut self, name: &str) -> Result<Fields, ScenarioError> {
        let DriveDetails { state: shown, parameters, .. } = self.drive(name)?;
        let DriveState { status_word, speed_reference, speed_actual, fault, lost_references, .. } = shown;
        let values = parameters.into_iter().map(|it| (format!("P{}", it.number), Field::Number(it.value)));
        let fields = [
            ("state", Field::Text(shown.state)),
            ("synchronized", Field::Flag(shown.is_synchronized)),
            ("reference", Field::Number(speed_reference.into())),
            ("speed", Field::Number(speed_actual.into())),
            ("fault", Field::Number(fault.into())),
            ("status_word", Field::Number(status_word.into())),
            ("lost_references", lost_references.into()),
            ("stopped", Field::Flag(shown.is_stopped)),
            ("parameters", Field::Fields(values.collect())),
        ];
        Ok(fields.map(|(name, field)| (name.to_owned(), field)).into())
    }
}

/// Returns the name of a value of the front panel, or its number if it has no name.
fn front_field(word: &FrontWord, value: u32) -> (String, Field) {
    let called = word.called(value);
    let number = word.ty.number(value);
    let field = if called == number.to_string() { Field::Number(number) } else { Field::Text(called) };
    (word.name.to_owned(), field)
}

/// Returns the fields of a module, with its switches: `kind`, `leds` with `H1`, `H2` ..., `dip` ...
fn module_fields(front: ModuleFront) -> Field {
    let leds = front.leds.into_iter().map(|(name, led)| {
        let shown = match led {
            Led::Off => "off".into(),
            Led::On => "on".into(),
            Led::Flashes(count) => u64::from(count).into(),
            Led::InTurn => "in_turn".into(),
        };
        (name.to_owned(), shown)
    });
    let switches = front.switches.into_iter().map(|(name, switch)| {
        let position = match switch {
            Switch::Number(number) => u64::from(number).into(),
            Switch::Is(on) => Field::Flag(on),
        };
        (name.to_owned(), position)
    });
    let kind = [("kind", front.kind.into()), ("leds", Field::Fields(leds.collect()))];
    Field::Fields(kind.map(|(name, field)| (name.to_owned(), field)).into_iter().chain(switches).collect())
}
