//! What keys do: one table, which the keyboard, the help and the page of the view go by.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// What fills the screen between the lines at its top and its bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pane {
    /// The plant with its buses.
    Plant,
    /// Blocks with their registers, and those that are pinned.
    Registers,
    /// How the pinned registers changed.
    Changes,
    /// What was on a bus in an interval.
    Frames,
    /// The fronts of the PLCs.
    Board,
    /// The drives.
    Drives,
    /// What the access checker has found.
    Findings,
}

impl Pane {
    /// All of them, in the order of their numbers.
    pub(super) const ALL: [Self; 7] = [
        Self::Plant,
        Self::Registers,
        Self::Changes,
        Self::Frames,
        Self::Board,
        Self::Drives,
        Self::Findings,
    ];

    /// Its name.
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

    /// What it is good for.
    fn what(self) -> &'static str {
        match self {
            Self::Plant => "the plant: PLCs with their ports, buses with their drives",
            Self::Registers => "blocks and registers; below them those that are pinned",
            Self::Changes => "every change of the pinned registers, with time and who it was",
            Self::Frames => "the frames of an interval on a line of time, with its slots",
            Self::Board => "the fronts of the PLCs: display, LEDs, switches",
            Self::Drives => "the drives: states, reference and actual value as a running chart",
            Self::Findings => "what the access checker has found, with the page of the manual",
        }
    }
}

/// What the user wants.
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

/// A key and what it does.
pub(super) struct Binding {
    /// The keys; one of them is enough.
    keys: &'static [(KeyCode, KeyModifiers)],
    /// What it does.
    pub action: Action,
    /// The same for the user, short enough for a half of a narrow screen.
    pub text: &'static str,
    /// What the page says besides.
    pub more: &'static str,
    /// Whether it changes something in the plant.
    pub changes: bool,
}

const NONE: KeyModifiers = KeyModifiers::NONE;
const CTRL: KeyModifiers = KeyModifiers::CONTROL;

/// A key that only looks.
const fn looks(
    keys: &'static [(KeyCode, KeyModifiers)],
    action: Action,
    text: &'static str,
    more: &'static str,
) -> Binding {
    Binding { keys, action, text, more, changes: false }
}

/// A key that changes something in the plant.
const fn changes(
    keys: &'static [(KeyCode, KeyModifiers)],
    action: Action,
    text: &'static str,
    more: &'static str,
) -> Binding {
    Binding { keys, action, text, more, changes: true }
}

/// All keys, in the order in which they are told.
pub(super) static KEYS: &[Binding] = &[
    looks(&[(KeyCode::Tab, NONE)], Action::Next, "the other list, the next bus", ""),
    looks(&[(KeyCode::Up, NONE), (KeyCode::Char('k'), NONE)], Action::Up, "up", ""),
    looks(&[(KeyCode::Down, NONE), (KeyCode::Char('j'), NONE)], Action::Down, "down", ""),
    looks(&[(KeyCode::PageUp, NONE)], Action::PageUp, "a page up", ""),
    looks(&[(KeyCode::PageDown, NONE)], Action::PageDown, "a page down", ""),
    looks(&[(KeyCode::Home, NONE), (KeyCode::Char('g'), NONE)], Action::First, "to the first line", ""),
    looks(
        &[(KeyCode::End, NONE), (KeyCode::Char('G'), NONE)],
        Action::Last,
        "to the last line",
        "among the changes it stays at the latest then; among the frames the latest interval is shown again",
    ),
    looks(
        &[(KeyCode::Right, NONE), (KeyCode::Char('l'), NONE)],
        Action::Open,
        "open; an interval on",
        "opens a block or an array; among the frames it goes on by an interval",
    ),
    looks(
        &[(KeyCode::Left, NONE), (KeyCode::Char('h'), NONE)],
        Action::Close,
        "close; an interval back",
        "an interval that was gone back to stays while the clock runs",
    ),
    looks(
        &[(KeyCode::Enter, NONE)],
        Action::Toggle,
        "open or close; pin; turn",
        "a register is pinned, or let go; a switch is turned",
    ),
    looks(&[(KeyCode::Char(' '), NONE)], Action::Pin, "pin a register, let it go", ""),
    looks(
        &[(KeyCode::Char('/'), NONE)],
        Action::Find,
        "find registers",
        "as you type; Enter keeps what is found, Esc ends it",
    ),
    changes(&[(KeyCode::Char('p'), NONE)], Action::Poke, "poke a register", "asks before it does"),
    changes(
        &[(KeyCode::Char('f'), NONE)],
        Action::Force,
        "force a register",
        "it keeps the value; asks before it does",
    ),
    changes(&[(KeyCode::Char('u'), NONE)], Action::Unforce, "let a forced one go", "asks before it does"),
    changes(
        &[(KeyCode::Char('t'), NONE)],
        Action::Turn,
        "turn a switch of the board",
        "the one in the chosen line of pane 5; asks before it does",
    ),
    changes(&[(KeyCode::Char('s'), NONE)], Action::Step, "let some time pass", "stepped clock only"),
    changes(&[(KeyCode::Char('n'), NONE)], Action::ToSync, "on to the next SYNC", "stepped clock only"),
    changes(
        &[(KeyCode::Char('e'), NONE)],
        Action::ToEvent,
        "on to the next event",
        "to the next moment at which the emulator has something to do; stepped clock only",
    ),
    changes(
        &[(KeyCode::Char('w'), NONE)],
        Action::Until,
        "wait for a condition",
        "a stepped clock runs meanwhile",
    ),
    changes(
        &[(KeyCode::Char('b'), NONE)],
        Action::Back,
        "back by some time",
        "what was done since is gone; stepped clock only",
    ),
    changes(
        &[(KeyCode::Char('B'), NONE)],
        Action::BackUntil,
        "back until a condition",
        "to the last moment before now at which it came to hold; stepped clock only",
    ),
    changes(&[(KeyCode::Char('c'), NONE)], Action::Clear, "forget the findings", "asks before it does"),
    looks(&[(KeyCode::Esc, NONE)], Action::Cancel, "end what is going on", "a question, a search, a wait"),
    looks(&[(KeyCode::Char('?'), NONE), (KeyCode::F(1), NONE)], Action::Help, "this help", ""),
    looks(&[(KeyCode::Char('q'), NONE)], Action::Quit, "quit", "the emulator goes on"),
    looks(&[(KeyCode::Char('c'), CTRL)], Action::Interrupt, "quit with exit code 130", ""),
];

/// What a key does; numbers show panes.
pub(super) fn action_of(key: KeyEvent) -> Option<Action> {
    let pressed = (key.code, key.modifiers - KeyModifiers::SHIFT);
    if let KeyCode::Char(digit) = key.code
        && let Some(number) = digit.to_digit(10)
    {
        return Pane::ALL.get((number as usize).checked_sub(1)?).copied().map(Action::Show);
    }
    KEYS.iter().find(|binding| binding.keys.contains(&pressed)).map(|binding| binding.action)
}

/// Whether the action changes something in the plant.
pub(super) fn changes_the_plant(action: Action) -> bool {
    KEYS.iter().any(|binding| binding.action == action && binding.changes)
}

/// Keys, what they do, and more about that, for people.
pub(super) fn told() -> Vec<(String, &'static str, &'static str)> {
    let panes = (1..).zip(Pane::ALL).map(|(number, pane)| (number.to_string(), pane.name(), pane.what()));
    let keys = KEYS.iter().map(|binding| {
        let keys: Vec<_> = binding.keys.iter().map(|(code, modifiers)| name(*code, *modifiers)).collect();
        (keys.join(", "), binding.text, binding.more)
    });
    panes.chain(keys).collect()
}

/// How a key is called.
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
    fn no_key_does_two_things() {
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
    fn numbers_show_panes() {
        let key = |digit| action_of(KeyEvent::new(KeyCode::Char(digit), NONE));
        assert_eq!((key('1'), key('0'), key('9')), (Some(Action::Show(Pane::Plant)), None, None));
    }

    /// `COMMRAM_UPDATE_SCREENS=1` renews the table.
    #[test]
    fn the_page_tells_the_keys() {
        let row = |(keys, text, more): (String, &str, &str)| {
            let more = if more.is_empty() { String::new() } else { format!(": {more}") };
            format!("| `{}` | {text}{more} |\n", keys.replace(", ", "`, `"))
        };
        let table: String = told().into_iter().map(row).collect();
        crate::cli::view::tests::held_part(
            "docs/guide/view.md",
            "| key | what it does |\n|---|---|\n",
            &table,
        );
    }
}
