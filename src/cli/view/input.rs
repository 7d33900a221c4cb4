//! Effects of keys and mouse on the model.

use super::actions::{self, Action, Pane};
use super::link::LinkCommand;
use super::model::{ClickTarget, ListId, Model};
use super::pins::Pins;
use super::prompt::{InputPurpose, Prompt, TextInput};
use super::tree::Row;
use super::work::{Task, Work};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::layout::NamedLocation;
use crate::request::Op;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;

/// Number of lines per step of the mouse wheel.
const WHEEL: isize = 3;

impl Model {
    /// Handles a key that the user has pressed.
    pub(super) fn press(&mut self, key: KeyEvent) {
        match self.prompt.take() {
            Some(prompt) => self.answer(prompt, key),
            None => {
                if let Some(action) = actions::action_of(key) {
                    self.act(action);
                }
            }
        }
    }

    /// Handles a mouse event.
    pub(super) fn mouse(&mut self, event: MouseEvent) {
        let place = Position::new(event.column, event.row);
        let hit = self.hot.iter().rev().find(|(area, _)| area.contains(place)).copied();
        let Some((area, hot)) =
            hit.filter(|_| self.prompt.is_none() || matches!(self.prompt, Some(Prompt::Find)))
        else {
            return;
        };
        match (event.kind, hot) {
            (MouseEventKind::Down(MouseButton::Left), ClickTarget::Tab(pane)) => self.act(Action::Show(pane)),
            (MouseEventKind::Down(MouseButton::Left), ClickTarget::List(which)) => {
                self.look_at(which);
                let (list, len) = self.list_of(which);
                let line = list.top + usize::from(place.y - area.y);
                let was_chosen = list.chosen;
                list.stays = false;
                list.choose(line, len);
                // The second click on a line opens it.
                if line == was_chosen && which == ListId::Tree {
                    self.act(Action::Toggle);
                }
            }
            (MouseEventKind::ScrollUp | MouseEventKind::ScrollDown, ClickTarget::List(which)) => {
                let lines = if event.kind == MouseEventKind::ScrollUp { -WHEEL } else { WHEEL };
                self.look_at(which);
                let (list, len) = self.list_of(which);
                list.go(lines, len);
            }
            _ => {}
        }
    }

    fn look_at(&mut self, which: ListId) {
        self.pane = match which {
            ListId::Tree | ListId::Pins => {
                self.on_pins = which == ListId::Pins;
                Pane::Registers
            }
            ListId::Changes => Pane::Changes,
            ListId::Frames => Pane::Frames,
            ListId::Board => Pane::Board,
            ListId::Drives => Pane::Drives,
            ListId::Findings => Pane::Findings,
            ListId::Plant => Pane::Plant,
        };
    }

    /// Performs the action of a key.
    pub(super) fn act(&mut self, action: Action) {
        if self.help {
            self.help = false;
            if !matches!(action, Action::Quit | Action::Interrupt) {
                return;
            }
        }
        if actions::changes_the_plant(action) && self.read_only {
            return self.complain("started with --read-only: the view changes nothing in the plant");
        }
        self.message = None;
        match action {
            Action::Quit => self.quits = true,
            Action::Interrupt => self.interrupt(),
            Action::Help => self.help = true,
            Action::Show(pane) => self.pane = pane,
            Action::Next if self.pane == Pane::Registers => self.on_pins = !self.on_pins,
            Action::Next if self.pane == Pane::Frames => {
                self.frames.bus = BusIndex::at((self.frames.bus.index() + 1) % self.scene.len().max(1));
                self.frames.follow();
            }
            Action::Next => {}
            Action::Up => self.go(-1),
            Action::Down => self.go(1),
            Action::PageUp => self.page(-1),
            Action::PageDown => self.page(1),
            Action::First => self.go(isize::MIN),
            Action::Last => {
                let comes_in = self.pane == Pane::Changes;
                if self.pane == Pane::Frames {
                    self.frames.follow();
                }
                let (list, len) = self.list();
                list.last(len);
                list.stays = comes_in;
            }
            Action::Open => self.open(Some(true)),
            Action::Close => self.open(Some(false)),
            Action::Toggle if self.pane == Pane::Board => self.act(Action::Turn),
            Action::Toggle if self.pane != Pane::Registers => {}
            Action::Toggle => match self.tree.chosen() {
                Some(Row::Register(..)) => self.pin(),
                _ if self.on_pins => self.pin(),
                _ => self.tree.open(None),
            },
            Action::Pin => self.pin(),
            Action::Find => {
                self.pane = Pane::Registers;
                self.on_pins = false;
                self.tree.seek(Some(String::new()));
                self.prompt = Some(Prompt::Find);
            }
            Action::Cancel => self.cancel(),
            Action::Poke => self.ask_value(InputPurpose::Poke, "poke"),
            Action::Force => self.ask_value(InputPurpose::Force, "force"),
            Action::Unforce => self.unforce(),
            Action::Turn => self.ask_switch(),
            Action::Step if self.has_stepped_clock() => {
                self.ask(InputPurpose::Step, "advance by", self.step.clone())
            }
            Action::Back if self.has_stepped_clock() => {
                self.ask(InputPurpose::Back, "go back by", self.step.clone())
            }
            Action::BackUntil if self.has_stepped_clock() => {
                self.ask(InputPurpose::BackUntil, "go back until (REG==VALUE and ...)", self.until.clone());
            }
            Action::ToEvent if self.has_stepped_clock() => {
                let work = Work::Ops(vec![Op::AdvanceToEvent { within_us: 1_000_000 }]);
                self.order(Task { description: "go to the next event".to_owned(), work });
            }
            Action::ToSync if self.has_stepped_clock() => match self.sync_port() {
                Some((plc, node)) => {
                    let work = Work::Ops(vec![Op::AdvanceToSync { plc, node }]);
                    self.order(Task { description: "go to the next SYNC".to_owned(), work });
                }
                None => self.complain("no PLC here has a master"),
            },
            Action::Step | Action::ToEvent | Action::ToSync | Action::Back | Action::BackUntil => {
                self.complain(
                    "the clock runs by itself; use `commram run --clock stepped` for a stepped clock",
                );
            }
            Action::Until => {
                self.ask(InputPurpose::Until, "wait until (REG==VALUE and ...)", self.until.clone())
            }
            Action::Clear => {
                let description = "findings deleted".to_owned();
                let work = Work::Ops(vec![Op::ClearFindings]);
                let question = "delete all findings".to_owned();
                self.prompt = Some(Prompt::Really(question, Task { description, work }));
            }
        }
    }

    /// Sends a task to the emulator.
    pub(super) fn order(&mut self, task: Task) {
        if task.is_long() {
            self.show_message(task.progress());
        }
        self.orders.push(LinkCommand::Do(task));
    }

    fn go(&mut self, lines: isize) {
        let (list, len) = self.list();
        list.go(lines, len);
    }

    fn page(&mut self, pages: isize) {
        let (list, len) = self.list();
        list.page(pages, len);
    }

    fn open(&mut self, open: Option<bool>) {
        if self.pane == Pane::Frames {
            let Some(info) = &self.info else { return };
            self.frames.turn(open != Some(true), info, &self.scene);
            if self.frames.is_held() {
                self.show_message("this interval stays; Right shows the next, End the latest");
            }
        } else if self.pane == Pane::Registers && !self.on_pins {
            self.tree.open(open);
        }
    }

    fn pin(&mut self) {
        let Some((plc, place)) = self.chosen() else {
            return self.complain("choose a register first");
        };
        let name = Pins::prefix(self.names(), plc) + &place.label(place.last_phase());
        let is_pinned = self.pins.toggle(plc, place);
        self.on_pins &= !self.pins.all.is_empty();
        self.show_message(format!("{name} is {}", if is_pinned { "pinned" } else { "no longer pinned" }));
    }

    fn cancel(&mut self) {
        self.orders.push(LinkCommand::Cancel);
        if self.tree.sought.is_some() {
            self.tree.seek(None);
        }
    }

    /// Ctrl-C ends the view with another exit code than quitting.
    fn interrupt(&mut self) {
        (self.quits, self.is_interrupted) = (true, true);
    }

    /// Opens a prompt for a text. The prompt contains the last input; typing replaces it.
    fn ask(&mut self, purpose: InputPurpose, head: &str, last: String) {
        self.prompt = Some(Prompt::Text(TextInput::new(purpose, head.to_owned(), last)));
    }

    fn ask_switch(&mut self) {
        let knob = match self.pane {
            Pane::Board => self.knobs.get(self.board.chosen).cloned().flatten(),
            _ => return self.complain("choose a switch in pane 5 first"),
        };
        match knob {
            Some(knob) => {
                let head = format!("set {}{}", Pins::prefix(self.names(), knob.plc), knob.name);
                self.ask(InputPurpose::Turn(knob), &head, String::new());
            }
            None => self.complain("this line has no switch"),
        }
    }

    fn ask_value(&mut self, purpose: fn(DeviceIndex, NamedLocation) -> InputPurpose, what: &str) {
        match self.chosen() {
            Some((plc, place)) => {
                let name = Pins::prefix(self.names(), plc) + &place.label(place.last_phase());
                self.ask(purpose(plc, place), &format!("{what} {name}"), String::new());
            }
            None => self.complain("choose a register first"),
        }
    }

    fn unforce(&mut self) {
        let Some((plc, place)) = self.chosen() else {
            return self.complain("choose a register first");
        };
        let description =
            format!("unforce {}{}", Pins::prefix(self.names(), plc), place.label(place.last_phase()));
        let (offset, width) = place.whole();
        let work = Work::Ops(vec![Op::Unforce { plc, offset, width }]);
        self.prompt = Some(Prompt::Really(description.clone(), Task { description, work }));
    }

    fn has_stepped_clock(&self) -> bool {
        self.is_stepped()
    }

    /// Returns the port for the command "go to the next SYNC": the port of the chosen register, otherwise the first
    /// master.
    fn sync_port(&self) -> Option<(DeviceIndex, PortNumber)> {
        let names = self.names();
        let first = DeviceIndex::enumerate(&names.devices)
            .find_map(|(plc, fitted)| Some((plc, fitted.first_master()?.number)));
        let of_chosen = self.chosen().and_then(|(plc, place)| {
            let ports = names.device(plc).ports;
            Some((plc, ports.iter().find(|port| port.area.contains(place.offset()))?.number))
        });
        of_chosen.or(first)
    }

    /// Handles a key while a prompt is open.
    fn answer(&mut self, prompt: Prompt, key: KeyEvent) {
        if key.modifiers.contains(KeyModifiers::CONTROL) && key.code == KeyCode::Char('c') {
            return self.interrupt();
        }
        match prompt {
            Prompt::Really(question, task) => match key.code {
                KeyCode::Char('y' | 'Y') => self.order(task),
                KeyCode::Char('n' | 'N') | KeyCode::Esc => self.show_message("not done"),
                _ => self.prompt = Some(Prompt::Really(question, task)),
            },
            Prompt::Find => self.find(key),
            Prompt::Text(mut asked) => {
                match key.code {
                    KeyCode::Esc => return,
                    KeyCode::Enter => match self.given(&asked) {
                        Ok(next) => {
                            self.prompt = next;
                            return;
                        }
                        Err(wrong) => asked.wrong = Some(wrong),
                    },
                    KeyCode::Tab => {
                        if let [only] = asked.hints().as_slice() {
                            asked.text = only.split("  ").next().unwrap_or_default().to_owned();
                        }
                    }
                    // A cursor key keeps the text, so that the user can edit it.
                    KeyCode::Left | KeyCode::Right | KeyCode::Home | KeyCode::End => {
                        asked.is_selected = false
                    }
                    _ => {
                        let mut text = if asked.is_selected { String::new() } else { asked.text.clone() };
                        if edit(&mut text, key) {
                            (asked.text, asked.is_selected) = (text, false);
                        }
                        asked.wrong = None;
                    }
                }
                self.prompt = Some(Prompt::Text(asked));
            }
        }
    }

    fn find(&mut self, key: KeyEvent) {
        let len = self.tree.rows().len();
        match key.code {
            KeyCode::Esc => return self.tree.seek(None),
            KeyCode::Enter => return,
            KeyCode::Up => self.tree.list.go(-1, len),
            KeyCode::Down => self.tree.list.go(1, len),
            KeyCode::PageUp => self.tree.list.page(-1, len),
            KeyCode::PageDown => self.tree.list.page(1, len),
            _ => {
                let mut text = self.tree.sought.clone().unwrap_or_default();
                if edit(&mut text, key) {
                    self.tree.seek(Some(text));
                }
            }
        }
        self.prompt = Some(Prompt::Find);
    }
}

/// Edits a text with a key; returns true if the key was used.
fn edit(text: &mut String, key: KeyEvent) -> bool {
    match key.code {
        KeyCode::Char('u') if key.modifiers.contains(KeyModifiers::CONTROL) => text.clear(),
        KeyCode::Char(letter) if !key.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT) => {
            text.push(letter);
        }
        KeyCode::Backspace => {
            text.pop();
        }
        _ => return false,
    }
    true
}
