//! The view of a plant in this process, without a terminal: keys, questions and screens.
//!
//! `COMMRAM_UPDATE_SCREENS=1` updates the screens in `tests/view`, the pictures and the table of keys in `docs`.

mod picture;
mod screens;
mod usage;

use super::draw;
use super::link::{LinkReport, TaskQueue};
use super::model::Model;
use super::poll::Poller;
use super::source::{RequestError, RequestKind, Source};
use super::style::Theme;
use crate::identity::DeviceIndex;
use crate::memory::Header;
use crate::plant::PlantConfig;
use crate::request::testing::TestHost;
use crate::request::{Execution, Host, Op, Reply};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind};
use std::path::PathBuf;

impl Source for TestHost {
    fn request(&mut self, ops: &[Op], _: RequestKind) -> Result<Vec<Reply>, RequestError> {
        self.begin_request();
        let (mut replies, mut execution) = (Vec::new(), Execution::default());
        for op in ops {
            let reply = loop {
                match execution.run(self, op) {
                    Ok(Some(reply)) => break reply,
                    Ok(None) => {}
                    Err(refused) => {
                        replies.push(Reply::Error(refused));
                        replies.resize(ops.len(), Reply::NotExecuted);
                        return Ok(replies);
                    }
                }
            };
            replies.push(reply);
        }
        Ok(replies)
    }

    fn header(&mut self, plc: DeviceIndex) -> Option<Box<Header>> {
        Some(self.plant.devices().get(plc.index())?.segment().header_snapshot())
    }
}

/// A user at a screen of 80x24.
struct User {
    host: TestHost,
    queue: TaskQueue,
    poller: Poller,
    model: Model,
    terminal: Terminal<TestBackend>,
}

impl User {
    fn of(toml: &str, read_only: bool) -> Self {
        let config = PlantConfig::parse("test", toml).unwrap();
        Self::at(TestHost::of(&config, true), read_only)
    }

    /// Returns a user at the built-in plant, with power on and a stepped clock.
    fn built_in() -> Self {
        Self::at(TestHost::of(&PlantConfig::built_in().unwrap(), true), false)
    }

    fn at(host: TestHost, read_only: bool) -> Self {
        let model = Model::new("default", read_only);
        let terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        let mut user = Self { host, queue: TaskQueue::default(), poller: Poller::default(), model, terminal };
        user.look();
        user
    }

    /// Draws, polls, and draws the result, until all tasks are done.
    fn look(&mut self) {
        // The view reads only data for which the screen has space, and new data can change the space. So drawing and
        // polling are repeated until the screen is complete.
        for _ in 0..3 {
            self.draw();
            self.queue.take(super::link::LinkCommand::Show(self.model.query()));
            self.model.orders.drain(..).for_each(|order| self.queue.take(order));
            loop {
                let news = self.queue.turn(&mut self.host, &mut self.poller);
                let has_progress = news.iter().any(|news| matches!(news, LinkReport::Progress(_)));
                news.into_iter().for_each(|news| self.model.take(news));
                if !has_progress {
                    break;
                }
            }
        }
        self.draw();
    }

    fn draw(&mut self) {
        let (model, theme) = (&mut self.model, Theme { has_colours: true });
        self.terminal.draw(|frame| draw::draw(frame, model, theme)).unwrap();
    }

    fn press(&mut self, code: KeyCode) {
        self.model.press(KeyEvent::new(code, KeyModifiers::NONE));
        self.look();
    }

    /// Types a text; `\n` is Enter.
    fn type_in(&mut self, text: &str) {
        for letter in text.chars() {
            self.press(if letter == '\n' { KeyCode::Enter } else { KeyCode::Char(letter) });
        }
    }

    fn click(&mut self, column: u16, row: u16) {
        let kind = MouseEventKind::Down(MouseButton::Left);
        self.model.mouse(MouseEvent { kind, column, row, modifiers: KeyModifiers::NONE });
        self.look();
    }

    fn buffer(&self) -> &Buffer {
        self.terminal.backend().buffer()
    }

    /// Returns the screen as text, without trailing blanks.
    fn screen(&self) -> String {
        let buffer = self.buffer();
        let width = usize::from(buffer.area.width);
        let line = |cells: &[ratatui::buffer::Cell]| {
            let text: String = cells.iter().map(|cell| cell.symbol()).collect();
            text.trim_end().to_owned() + "\n"
        };
        buffer.content.chunks(width).map(line).collect()
    }

    #[track_caller]
    fn sees(&self, text: &str) {
        assert!(self.screen().contains(text), "no {text:?} in\n{}", self.screen());
    }

    /// Searches for a register and selects it.
    fn find(&mut self, name: &str) {
        self.type_in("/");
        self.type_in(name);
        self.type_in("\n");
    }

    /// Pokes registers like a client of the channel, then advances the clock.
    fn poke(&mut self, writes: &[(&str, u32)], then_us: u64) {
        let fitted = self.host.plant.names().fitted(DeviceIndex(0));
        for (name, value) in writes {
            let place = crate::layout::NamedLocation::parse(&fitted, name).unwrap();
            let op =
                Op::Poke { plc: DeviceIndex(0), offset: place.offset(), width: place.width(), value: *value };
            assert_eq!(self.host.request(&[op]), [Reply::Written], "{name}");
        }
        self.host.run_to(self.host.plant.now() + then_us);
    }

    /// Brings the master of the built-in plant into active operation (manual 5.00005.03a p. 149-150), with reference
    /// and actual values of slave 1.
    fn activate(&mut self) {
        self.poke(&[("node2.w_CPU_CONTROL", 0)], 1_000);
        self.poke(&[("node2.w_CPU_CONTROL", 1)], 5_000);
        let init = [
            ("b_MA_SL_MODE", 0x00),
            ("b_AC", 0xFF),
            ("b_AM", 0xFF),
            ("b_BT_0", 0x00),
            ("b_BT_1", 0x1C),
            ("b_OUTPUT_CONTROL", 0xFA),
            ("b_CLOCK_DIVIDER", 0x07),
            ("b_TIME_PATTERN", 2),
            ("a_SL_TYP[1]", 1),
            ("a_SL_TYP[2]", 1),
            ("a_SL_TYP[3]", 1),
            ("w_CPU_CONTROL", 2),
        ];
        let init = init.map(|(name, value)| (format!("node2.{name}"), value));
        self.poke(&init.iter().map(|(name, value)| (name.as_str(), *value)).collect::<Vec<_>>(), 5_000);
        let mapping = [
            ("node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0", 0x01),
            ("node2._CFG_WRC_WORD.b_CFG_WRC1_WORD1", 0x03),
            ("node2.a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD0", 0x01),
            ("node2.a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD1", 0x03),
            ("node2.b_CTRLREG_RD_ORDER_RDC1", 1),
            ("node2.w_CPU_CONTROL", 0x20),
        ];
        self.poke(&mapping, 1_100_000);
        self.poke(&[("node2.w_CPU_CONTROL", 0x40)], 10_000);
    }
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn renews() -> bool {
    std::env::var_os("COMMRAM_UPDATE_SCREENS").is_some()
}

/// Compares a file with the expected text, or updates the file.
#[track_caller]
fn held(name: &str, wanted: &str) {
    if renews() {
        std::fs::write(path(name), wanted).unwrap();
    }
    let found = std::fs::read_to_string(path(name)).unwrap_or_default();
    assert!(
        found == wanted,
        "{name} differs from the expected text; COMMRAM_UPDATE_SCREENS=1 updates it:\n{wanted}"
    );
}

/// Compares the part of a file from `head` to the next empty line with the expected text, or updates the file.
#[track_caller]
pub(super) fn held_part(name: &str, head: &str, wanted: &str) {
    let text = std::fs::read_to_string(path(name)).unwrap_or_default();
    let (before, rest) = text.split_once(head).unwrap_or_else(|| panic!("{name} has no {head:?}"));
    let rest = rest.find("\n\n").map_or("", |end| &rest[end + 1..]);
    held(name, &format!("{before}{head}{wanted}{rest}"));
}
