//! Keys and their actions: one table for the keyboard, the help and the documentation page of the view.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// A screen between the lines at the top and the bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pane {
    /// The plant with its buses.
    Plant,
    /// Blocks with their registers, and the pinned registers.
    Registers,
    /// History of the pinned registers.
    Changes,
    /// Frames of a bus in an interval.
    Frames,
    /// The front panels of the PLCs.
    Board,
    Drives,
    /// Findings of the access checker.
    Findings,
}

impl Pane {
    /// All panes in the order of their numbers.
    pub(super) const ALL: [Self; 7] = [
        Self::Plant,
        Self::Registers,
        Self::Changes,
        Self::Frames,
        Self::Board,
        Self::Drives,
        Self::Findings,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Plant => "Plant",
            Self::Registers => "Registers",
            Self::Changes => "Changes",
            Self::Frames => "Frames",
            Self::Board => "Board",
            Self::Drives => "Drives",
            Self::Findings => "Findings",
        }
    }

    /// Returns a sentence about the content of the pane, for the help.
    fn what(self) -> &'static str {
        match self {
            Self::Plant => "the plant: PLCs with their ports, buses with their drives",
            Self::Registers => "blocks with their registers, and the pinned registers",
            Self::Changes => "every change of the pinned registers, with time and writer",
            Self::Frames => "the frames of an interval on a time line, with its slots",
            Self::Board => "the fronts of the PLCs: display, LEDs, switches",
            Self::Drives => "the drives: states, reference and actual value as a running chart",
            Self::Findings => "the findings of the access checker, with the page of the manual",
        }
    }
}

/// An action of the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    Quit,
    Interrupt,
    Help,
    Cancel,
    Show(Pane),
    Next,
    Up,
    Down,
    PageUp,
    PageDown,
    First,
    Last,
    Open,
    Close,
    Toggle,
    Pin,
    Find,
    Poke,
    Force,
    Unforce,
    Step,
    ToSync,
    ToEvent,
    Until,
    Back,
    BackUntil,
    Turn,
    Clear,
}

/// Keys and their action.
pub(super) struct Binding {
    /// Any of these keys triggers the action.
    keys: &'static [(KeyCode, KeyModifiers)],
    pub action: Action,
    /// Description of the action, short enough for half of a narrow screen.
    pub text: &'static str,
    /// Further text for the documentation page.
    pub more: &'static str,
    /// True if the action changes something in the plant.
    pub changes: bool,
}

const NONE: KeyModifiers = KeyModifiers::NONE;
const CTRL: KeyModifiers = KeyModifiers::CONTROL;

/// Returns a key that changes nothing in the plant.
const fn looks(
    keys: &'static [(KeyCode, KeyModifiers)],
    action: Action,
    text: &'static str,
    more: &'static str,
) -> Binding {
    Binding { keys, action, text, more, changes: false }
}

/// Returns a key that changes something in the plant.
const fn changes(
    keys: &'static [(KeyCode, KeyModifiers)],
    action: Action,
    text: &'static str,
    more: &'static str,
) -> Binding {
    Binding { keys, action, text, more, changes: true }
}

/// All keys in display order.
pub(super) static KEYS: &[Binding] = &[
    looks(
        &[(KeyCode::Tab, NONE)],
        Action::Next,
        "the other list, the next bus",
        "selects the other list of the pane; in the frames it shows the next bus",
    ),
    looks(
        &[(KeyCode::Up, NONE), (KeyCode::Char('k'), NONE)],
        Action::Up,
        "up",
        "moves the selection up by a line",
    ),
    looks(
        &[(KeyCode::Down, NONE), (KeyCode::Char('j'), NONE)],
        Action::Down,
        "down",
        "moves the selection down by a line",
    ),
    looks(
        &[(KeyCode::PageUp, NONE)],
        Action::PageUp,
        "a page up",
        "moves the selection up by the height of the list",
    ),
    looks(
        &[(KeyCode::PageDown, NONE)],
        Action::PageDown,
        "a page down",
        "moves the selection down by the height of the list",
    ),
    looks(
        &[(KeyCode::Home, NONE), (KeyCode::Char('g'), NONE)],
        Action::First,
        "to the first line",
        "moves the selection to the first line",
    ),
    looks(
        &[(KeyCode::End, NONE), (KeyCode::Char('G'), NONE)],
        Action::Last,
        "to the last line",
        "moves the selection to the last line; the list of changes then follows the latest change, and the frames show the latest interval",
    ),
    looks(
        &[(KeyCode::Right, NONE), (KeyCode::Char('l'), NONE)],
        Action::Open,
        "open; next interval",
        "opens a block or an array; in the frames it shows the next interval",
    ),
    looks(
        &[(KeyCode::Left, NONE), (KeyCode::Char('h'), NONE)],
        Action::Close,
        "close; previous interval",
        "closes a block or an array; in the frames it shows the previous interval, which stays on the screen while the clock runs",
    ),
    looks(
        &[(KeyCode::Enter, NONE)],
        Action::Toggle,
        "open or close; pin; turn",
        "opens or closes a block, pins or unpins a register, or turns a switch",
    ),
    looks(
        &[(KeyCode::Char(' '), NONE)],
        Action::Pin,
        "pin or unpin a register",
        "a pinned register is in the list of pinned registers, and its changes are in pane 3",
    ),
    looks(
        &[(KeyCode::Char('/'), NONE)],
        Action::Find,
        "find registers",
        "the list shows matching registers while you type; Enter keeps the result, and Esc ends the search",
    ),
    changes(
        &[(KeyCode::Char('p'), NONE)],
        Action::Poke,
        "poke a register",
        "the view asks for the value and a confirmation",
    ),
    changes(
        &[(KeyCode::Char('f'), NONE)],
        Action::Force,
        "force a register",
        "the register keeps the value; the view asks for the value and a confirmation",
    ),
    changes(
        &[(KeyCode::Char('u'), NONE)],
        Action::Unforce,
        "unforce a register",
        "the view asks for a confirmation",
    ),
    changes(
        &[(KeyCode::Char('t'), NONE)],
        Action::Turn,
        "turn a switch of the board",
        "turns the switch in the chosen line of pane 5; the view asks for a confirmation",
    ),
    changes(&[(KeyCode::Char('s'), NONE)], Action::Step, "advance the clock", "only with a stepped clock"),
    changes(
        &[(KeyCode::Char('n'), NONE)],
        Action::ToSync,
        "go to the next SYNC",
        "only with a stepped clock",
    ),
    changes(
        &[(KeyCode::Char('e'), NONE)],
        Action::ToEvent,
        "go to the next event",
        "advances the clock to the next scheduled action of the emulator; only with a stepped clock",
    ),
    changes(
        &[(KeyCode::Char('w'), NONE)],
        Action::Until,
        "wait for a condition",
        "the wait advances a stepped clock",
    ),
    changes(
        &[(KeyCode::Char('b'), NONE)],
        Action::Back,
        "go back in time",
        "events after that time are lost; only with a stepped clock",
    ),
    changes(
        &[(KeyCode::Char('B'), NONE)],
        Action::BackUntil,
        "go back to a condition",
        "goes to the last moment before now at which the condition became true; only with a stepped clock",
    ),
    changes(
        &[(KeyCode::Char('c'), NONE)],
        Action::Clear,
        "delete the findings",
        "the view asks for a confirmation",
    ),
    looks(&[(KeyCode::Esc, NONE)], Action::Cancel, "cancel", "ends a question, a search or a wait"),
    looks(&[(KeyCode::Char('?'), NONE), (KeyCode::F(1), NONE)], Action::Help, "this help", ""),
    looks(&[(KeyCode::Char('q'), NONE)], Action::Quit, "quit", "the emulator continues"),
    looks(&[(KeyCode::Char('c'), CTRL)], Action::Interrupt, "quit with exit code 130", ""),
];

/// Returns the action of a key. The digits select the panes.
pub(super) fn action_of(key: KeyEvent) -> Option<Action> {
    let pressed = (key.code, key.modifiers - KeyModifiers::SHIFT);
    if let KeyCode::Char(digit) = key.code
        && let Some(number) = digit.to_digit(10)
    {
        return Pane::ALL.get((number as usize).checked_sub(1)?).copied().map(Action::Show);
    }
    KEYS.iter().find(|binding| binding.keys.contains(&pressed)).map(|binding| binding.action)
}

/// True if the action changes something in the plant.
pub(super) fn changes_the_plant(action: Action) -> bool {
    KEYS.iter().any(|binding| binding.action == action && binding.changes)
}

/// Returns all keys with their short and long descriptions.
pub(super) fn key_table() -> Vec<(String, &'static str, &'static str)> {
    let panes = (1..).zip(Pane::ALL).map(|(number, pane)| (number.to_string(), pane.name(), pane.what()));
    let keys = KEYS.iter().map(|binding| {
        let keys: Vec<_> = binding.keys.iter().map(|(code, modifiers)| name(*code, *modifiers)).collect();
        (keys.join(", "), binding.text, binding.more)
    });
    panes.chain(keys).collect()
}

/// Returns the name of a key.
fn name(code: KeyCode, modifiers: KeyModifiers) -> String {
    let name = match code {
        KeyCode::Char(' ') => "Space".to_owned(),
        KeyCode::Char(letter) if modifiers == CTRL => letter.to_ascii_uppercase().to_string(),
        KeyCode::Char(letter) => letter.to_string(),
        KeyCode::F(number) => format!("F{number}"),
        KeyCode::PageUp => "PgUp".to_owned(),
        KeyCode::PageDown => "PgDn".to_owned(),
        other => format!("{other:?}"),
    };
    if modifiers == CTRL { format!("Ctrl-{name}") } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_key_has_one_action() {
        let mut seen = HashSet::new();
        for binding in KEYS {
            for (code, modifiers) in binding.keys {
                assert!(seen.insert((*code, *modifiers)), "{code:?}");
                let key = KeyEvent::new(*code, *modifiers);
                assert_eq!(action_of(key), Some(binding.action), "{code:?}");
            }
        }
    }

    #[test]
    fn numbers_select_panes() {
        let key = |digit| action_of(KeyEvent::new(KeyCode::Char(digit), NONE));
        assert_eq!((key('1'), key('0'), key('9')), (Some(Action::Show(Pane::Plant)), None, None));
    }

    /// `COMMRAM_UPDATE_SCREENS=1` updates the table.
    #[test]
    fn the_page_lists_the_keys() {
        let row = |(keys, text, more): (String, &str, &str)| {
            let more = if more.is_empty() { String::new() } else { format!(": {more}") };
            format!("| `{}` | {text}{more} |\n", keys.replace(", ", "`, `"))
        };
        let table: String = key_table().into_iter().map(row).collect();
        crate::cli::view::tests::held_part(
            "docs/guide/view.md",
            "| key | what it does |\n|---|---|\n",
            &table,
        );
    }
}
