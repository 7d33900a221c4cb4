//! The panes of the view; each has its own file.

mod board;
mod changes;
mod drives;
mod findings;
mod frames;
mod plant;
mod registers;

use super::actions::Pane;
use super::model::Model;
use super::style::Theme;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::Line;
use ratatui::widgets::{Block, Borders, Paragraph};

/// Draws the active pane and, on a wide screen, a second pane beside it.
pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let (left, right) = model.shown();
    let Some(right) = right else { return draw_one(frame, model, theme, left, area) };
    let halves = Layout::horizontal([Constraint::Percentage(50), Constraint::Percentage(50)]).spacing(1);
    let [left_area, right_area] = halves.areas(area);
    draw_one(frame, model, theme, left, left_area);
    draw_one(frame, model, theme, right, right_area);
}

fn draw_one(frame: &mut Frame, model: &mut Model, theme: Theme, pane: Pane, area: Rect) {
    match pane {
        Pane::Plant => plant::draw(frame, model, theme, area),
        Pane::Registers => registers::draw(frame, model, theme, area),
        Pane::Changes => changes::draw(frame, model, theme, area),
        Pane::Frames => frames::draw(frame, model, theme, area),
        Pane::Board => board::draw(frame, model, theme, area),
        Pane::Drives => drives::draw(frame, model, theme, area),
        Pane::Findings => findings::draw(frame, model, theme, area),
    }
}

/// Draws a heading above an area; returns the area below it.
fn titled(frame: &mut Frame, title: String, style: Style, area: Rect) -> Rect {
    let block = Block::new().borders(Borders::TOP).title(title).border_style(style).title_style(style);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    inner
}

/// Draws lines of text in an area of the screen.
fn lines(frame: &mut Frame, lines: Vec<Line<'static>>, area: Rect) {
    frame.render_widget(Paragraph::new(lines), area);
}

/// Highlights a line if it is the chosen one.
fn marked(line: Line<'static>, is_chosen: bool, has_keys: bool, theme: Theme) -> Line<'static> {
    match (is_chosen, has_keys) {
        (false, _) => line,
        (true, true) => line.patch_style(theme.chosen()),
        (true, false) => line.patch_style(theme.also_chosen()),
    }
}
