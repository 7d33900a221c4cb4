//! Blocks with their registers, and the pinned registers below or beside them.

use super::{lines, marked, titled};
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::pins::{Pin, Pins};
use crate::cli::view::poll::MemoryLocation;
use crate::cli::view::prompt::Prompt;
use crate::cli::view::style::{Theme, at_right, padded, padded_name};
use crate::cli::view::tree::Row;
use crate::identity::DeviceIndex;
use crate::layout::place::meaning_in;
use crate::plural::plural;
use crate::time;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};

/// Minimum number of columns at which both lists are side by side.
const WIDE: u16 = 150;
/// Width of the column of values: `16#0000_0000` and a mark.
const VALUE: usize = 12;

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let pinned = (model.pins.all.len() + 2).clamp(3, (usize::from(area.height) / 2).max(3)) as u16;
    let [tree, pins] = if area.width >= WIDE {
        Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(area)
    } else {
        Layout::vertical([Constraint::Min(0), Constraint::Length(pinned)]).areas(area)
    };
    draw_tree(frame, model, theme, tree);
    draw_pins(frame, model, theme, pins);
}

fn draw_tree(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let title = match (&model.tree.sought, &model.prompt) {
        (Some(text), Some(Prompt::Find)) => format!(" find: {text}\u{2588} "),
        (Some(text), _) => format!(" found: {text} "),
        (None, _) => " blocks ".to_owned(),
    };
    let style = if model.on_pins { theme.dim() } else { theme.head() };
    let inner = titled(frame, title, style, area);
    let len = model.tree.rows().len();
    let seen = model.tree.list.fit(usize::from(inner.height), len);
    if len == 0 {
        let nothing = Line::styled(" no register has this text in its name or meaning", theme.dim());
        return lines(frame, vec![nothing], inner);
    }
    let width = usize::from(inner.width);
    let line = |number: usize| {
        let row = model.tree.rows().get(number)?;
        Some(marked(
            row_line(model, row, theme, width),
            number == model.tree.list.chosen,
            !model.on_pins,
            theme,
        ))
    };
    let drawn = seen.filter_map(line).collect();
    lines(frame, drawn, inner);
    model.hot.push((inner, ClickTarget::List(ListId::Tree)));
}

fn row_line(model: &Model, row: &Row, theme: Theme, width: usize) -> Line<'static> {
    let names = (width * 2 / 5).clamp(24, 44);
    let sign = match row {
        Row::Register(plc, register) => match is_pinned(model, *plc, register.offset()) {
            true => "\u{2022}",
            false => " ",
        },
        _ if model.tree.is_open(row) => "\u{25be}",
        _ => "\u{25b8}",
    };
    let before = format!(" {}{sign} ", "  ".repeat(model.tree.depth(row)));
    let label = padded_name(&model.tree.label(row), names.saturating_sub(before.chars().count()));
    let label = before + &label;
    let rest = width.saturating_sub(names);
    match row {
        Row::Plc(plc) => {
            let title = model.names().device(*plc).title;
            Line::from(vec![
                Span::styled(label, theme.head()),
                Span::styled(padded(title, rest), theme.dim()),
            ])
        }
        Row::Block(plc, area) => {
            let role = model.names().fitted(*plc).area(area).role();
            let text = role.map_or_else(|| area.doc.to_owned(), |role| format!("{role}: {}", area.doc));
            Line::from(vec![
                Span::styled(label, theme.name()),
                Span::styled(padded(&text, rest), theme.dim()),
            ])
        }
        Row::Array(_, first) => {
            let text = first.register.doc;
            Line::from(vec![Span::raw(label), Span::styled(padded(text, rest), theme.dim())])
        }
        Row::Register(plc, register) => {
            let location = MemoryLocation::register(*plc, register);
            let mark = if model.is_forced(location) { "!" } else { " " };
            let (value, meaning) = match model.value(location) {
                Some(value) => {
                    let live = model.live(*plc, register.area);
                    (register.format_value(value), meaning_in(register, live, value))
                }
                None => (String::new(), String::new()),
            };
            Line::from(vec![
                Span::raw(label),
                Span::styled(format!(" {mark}"), theme.bad()),
                Span::styled(padded(&value, VALUE), theme.value()),
                Span::raw(padded(&meaning, rest.saturating_sub(VALUE + 2))),
            ])
        }
    }
}

fn is_pinned(model: &Model, plc: DeviceIndex, offset: u32) -> bool {
    model
        .pins
        .all
        .iter()
        .any(|pin| pin.plc == plc && pin.place.bit().is_none() && pin.place.offset() == offset)
}

fn draw_pins(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let style = if model.on_pins { theme.head() } else { theme.dim() };
    let lost = match model.pins.lost {
        0 => String::new(),
        count => format!(", {} lost", plural(count, "change")),
    };
    let inner = titled(frame, format!(" pinned{lost} "), style, area);
    if model.pins.all.is_empty() {
        let text = " Space pins the chosen register: it is shown here, and its changes in pane 3";
        return lines(frame, vec![Line::styled(text, theme.dim())], inner);
    }
    let width = usize::from(inner.width);
    let head = columns(width, ["register", "value", "age", "rate", "meaning"].map(str::to_owned));
    let mut drawn = vec![Line::styled(head.concat(), theme.dim())];
    let rows = Rect { y: inner.y + 1, height: inner.height.saturating_sub(1), ..inner };
    let seen = model.pins.list.fit(usize::from(rows.height), model.pins.all.len());
    let line = |number: usize| {
        let pin = model.pins.all.get(number)?;
        Some(marked(
            pin_line(model, pin, theme, width),
            number == model.pins.list.chosen,
            model.on_pins,
            theme,
        ))
    };
    drawn.extend(seen.filter_map(line));
    lines(frame, drawn, inner);
    model.hot.push((rows, ClickTarget::List(ListId::Pins)));
}

/// Columns of a line: name, value, age, rate, meaning.
fn columns(width: usize, [name, value, age, rate, meaning]: [String; 5]) -> [String; 5] {
    const AGE: usize = 9;
    let names = (width * 7 / 20).clamp(20, 44);
    let rest = width.saturating_sub(names + 2 + VALUE + 2 * AGE + 2);
    [
        format!(" {}", padded_name(&name, names)),
        format!(" {}", padded(&value, VALUE)),
        at_right(&age, AGE),
        at_right(&rate, AGE),
        format!("  {}", padded(&meaning, rest)),
    ]
}

fn pin_line(model: &Model, pin: &Pin, theme: Theme, width: usize) -> Line<'static> {
    let live = model.live(pin.plc, pin.place.area());
    let (value, meaning) = match model.value(pin.location()) {
        Some(value) => (pin.place.format(live, value), pin.place.meaning(live, value)),
        None => ("?".to_owned(), String::new()),
    };
    let is_forced = model.is_forced(pin.location());
    let value = if is_forced { format!("!{value}") } else { value };
    let now_us = model.now_us();
    let age = pin.last_us.map_or_else(|| "-".to_owned(), |last| age(now_us.saturating_sub(last)));
    let rate = match pin.rate(now_us) {
        0 => "-".to_owned(),
        rate => format!("{rate}/s"),
    };
    let name = Pins::prefix(model.names(), pin.plc) + &pin.place.name(live);
    let [name, value, age, rate, meaning] = columns(width, [name, value, age, rate, meaning]);
    let value_style = if is_forced { theme.bad() } else { theme.value() };
    Line::from(vec![
        Span::raw(name),
        Span::styled(value, value_style),
        Span::styled(age, theme.dim()),
        Span::styled(rate, theme.dim()),
        Span::raw(meaning),
    ])
}

/// Formats an age in few characters: three figures are enough.
fn age(us: u64) -> String {
    match us {
        0..1_000 => time::short(us),
        1_000..1_000_000 => format!("{}.{} ms", us / 1_000, us % 1_000 / 100),
        1_000_000..1_000_000_000 => format!("{}.{} s", us / 1_000_000, us % 1_000_000 / 100_000),
        1_000_000_000..3_600_000_000_000 => format!("{} s", us / 1_000_000),
        _ => format!("{} h", us / 3_600_000_000),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ages_have_their_unit() {
        let ages = [999, 999_999, 999_999_999, 3_599_999_000_000, 90_000_000_000_000];
        assert_eq!(ages.map(age), ["999 us", "999.9 ms", "999.9 s", "3599999 s", "25000 h"]);
        for age in ages.map(age) {
            let cells = ["node2.a_CONTROLWORD_SL[1]", "16#0000_0000", &age, "100000/s", ""];
            let [name, _, shown, rate, _] = columns(80, cells.map(str::to_owned));
            assert_eq!((shown.trim(), rate.trim()), (age.as_str(), "100000/s"));
            assert!(name.contains("[1]"), "{name}");
        }
    }
}
