//! The screen: the lines at the top and the bottom, the pane in between, and boxes over it.

use super::actions::{self, Pane};
use super::model::{ClickTarget, Connection, Model};
use super::panes;
use super::prompt::{Prompt, TextInput};
use super::style::{Theme, cut, padded, wrapped};
use crate::time;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph, Wrap};

/// Smallest usable size of the terminal: columns and rows.
const LEAST: (u16, u16) = (40, 10);

/// Minimum number of columns at which the view shows two panes side by side.
const WIDE: u16 = 120;
/// Minimum number of columns for a line of keys that includes the SYNC key.
const ROOM_FOR_SYNC: u16 = 90;

/// Draws the whole screen of the view.
pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme) {
    model.hot.clear();
    let Rect { width, height, .. } = frame.area();
    model.is_wide = width >= WIDE;
    if width < LEAST.0 || height < LEAST.1 {
        let text = format!("{width}x{height} is too small: 80x24 shows everything");
        frame.render_widget(Paragraph::new(text).wrap(Wrap { trim: true }), frame.area());
        return;
    }
    let foot_lines = foot_lines(model, theme, frame.area());
    let [head, tabs, pane, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(1),
        Constraint::Min(0),
        Constraint::Length(foot_lines.len() as u16),
    ])
    .areas(frame.area());
    frame.render_widget(Paragraph::new(head_line(model, theme, usize::from(head.width))), head);
    draw_tabs(frame, model, theme, tabs);
    panes::draw(frame, model, theme, pane);
    frame.render_widget(Paragraph::new(foot_lines), foot);
    match &model.prompt {
        Some(Prompt::Text(asked)) => ask(frame, asked, theme, pane),
        Some(Prompt::Really(question, _)) => {
            let lines = vec![Line::from(question.clone() + "?"), Line::styled("y: yes   n: no", theme.dim())];
            over(frame, " really? ", lines, theme, pane);
        }
        Some(Prompt::Find) | None => {}
    }
    if model.help {
        help(frame, theme, frame.area());
    }
}

/// Returns the line at the top: instance, clock and connection.
fn head_line(model: &Model, theme: Theme, width: usize) -> Line<'static> {
    let mut left = format!(" commram view  {}", model.instance);
    if let Some(info) = &model.info {
        let speed = match info.speed {
            _ if info.is_stepped => "stepped".to_owned(),
            0 => "paused".to_owned(),
            1000 => "real time".to_owned(),
            permille => format!("{}.{:03} times real time", permille / 1000, permille % 1000),
        };
        left += &format!("  {}  {speed}", time::seconds(info.time_us));
        if let Some(awaited) = &info.waits_for {
            left += &format!("  waits for {awaited}");
        }
    }
    if model.read_only {
        left += "  read only";
    }
    let (how, style) = match &model.connection {
        Connection::Connecting => ("connecting ".to_owned(), theme.dim()),
        Connection::Live => ("live ".to_owned(), theme.good()),
        Connection::Busy => ("busy with another client ".to_owned(), theme.warning()),
        Connection::Absent(_) => ("gone, waiting for it ".to_owned(), theme.bad()),
    };
    let left = padded(&left, width.saturating_sub(how.chars().count()));
    Line::from(vec![Span::styled(left, theme.head()), Span::styled(how, style)])
}

fn draw_tabs(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let mut x = area.x;
    for (number, pane) in (1..).zip(Pane::ALL) {
        let text = format!(" {number} {} ", pane.name());
        let width = text.len() as u16;
        let place = Rect { x, width: width.min(area.right().saturating_sub(x)), ..area };
        let style = if pane == model.pane { theme.chosen() } else { theme.dim() };
        frame.render_widget(Paragraph::new(Span::styled(text, style)), place);
        model.hot.push((place, ClickTarget::Tab(pane)));
        x = x.saturating_add(width);
    }
}

/// Returns lines at the bottom. A message takes as many lines as it needs, up to a quarter of the screen; without a
/// message the line shows the most important keys.
fn foot_lines(model: &Model, theme: Theme, area: Rect) -> Vec<Line<'static>> {
    let (text, style) = match (&model.connection, &model.message) {
        (Connection::Absent(why), _) => (why, theme.bad()),
        (_, Some(message)) if message.is_bad => (&message.text, theme.bad()),
        (_, Some(message)) => (&message.text, theme.plain()),
        (_, None) => {
            let sync = if area.width < ROOM_FOR_SYNC { "" } else { "  n SYNC" };
            let keys = format!(
                " / find  Space pin  p poke  f force  s step{sync}  b/B back  w wait  ? help  q quit"
            );
            return vec![Line::styled(keys, theme.dim())];
        }
    };
    let lines = wrapped(text, usize::from(area.width) - 2, usize::from(area.height / 4));
    lines.into_iter().map(|line| Line::styled(format!(" {line}"), style)).collect()
}

fn ask(frame: &mut Frame, asked: &TextInput, theme: Theme, area: Rect) {
    let text = asked.text.clone();
    let text = if asked.is_selected { Span::styled(text, theme.chosen()) } else { Span::raw(text) };
    let mut lines = vec![Line::from(vec![text, Span::raw("\u{2588}")])];
    match &asked.wrong {
        Some(wrong) => lines.push(Line::styled(wrong.clone(), theme.bad())),
        None => lines.push(Line::styled("Enter: continue   Esc: cancel", theme.dim())),
    }
    lines.extend(asked.hints().into_iter().take(8).map(|hint| Line::styled(hint, theme.dim())));
    over(frame, &format!(" {} ", asked.head), lines, theme, area);
}

/// All keys, in as many columns as fit.
fn help(frame: &mut Frame, theme: Theme, area: Rect) {
    let key_rows = actions::key_table();
    let keys = key_rows.iter().map(|(keys, ..)| keys.chars().count()).max().unwrap_or(0);
    let room = usize::from(area.height.saturating_sub(2)).max(1);
    let columns = key_rows.len().div_ceil(room).max(1);
    let width = usize::from(area.width.saturating_sub(2)) / columns;
    let cell = |(key, text, _): &(String, &str, &str)| {
        vec![
            Span::styled(format!(" {} ", padded(key, keys)), theme.head()),
            Span::raw(padded(text, width.saturating_sub(keys + 2))),
        ]
    };
    let lines = (0..room).map(|line| {
        let cells = key_rows.iter().skip(line).step_by(room);
        Line::from(cells.flat_map(cell).collect::<Vec<_>>())
    });
    let block = Block::bordered().title(" keys; any key ends this ").border_style(theme.dim());
    frame.render_widget(Clear, area);
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
}

/// Draws a box in the middle of the screen.
fn over(frame: &mut Frame, title: &str, lines: Vec<Line<'static>>, theme: Theme, area: Rect) {
    let longest = lines.iter().map(Line::width).chain([title.chars().count()]).max().unwrap_or(0);
    let width = (longest + 4).clamp(24, usize::from(area.width).max(24)) as u16;
    // Long lines are wrapped and not cut: the user must be able to read a question to its end before confirming it.
    let inner = usize::from(width.saturating_sub(2)).max(1);
    let rows: usize = lines.iter().map(|line| line.width().div_ceil(inner).max(1)).sum();
    let height = (rows + 2).min(usize::from(area.height)) as u16;
    let place = Rect {
        x: area.x + (area.width - width.min(area.width)) / 2,
        y: area.y + (area.height - height) / 3,
        width: width.min(area.width),
        height,
    };
    let title = cut(title, usize::from(place.width.saturating_sub(2)));
    let block = Block::bordered().title(title).border_style(theme.warning());
    frame.render_widget(Clear, place);
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }).block(block), place);
}
