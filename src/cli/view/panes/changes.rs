//! Every recorded change of the pinned registers, in order of time.

use super::{lines, marked, titled};
use crate::cli::change;
use crate::cli::view::actions::Pane;
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::pins::Pins;
use crate::cli::view::style::{Theme, at_right, padded, padded_name};
use crate::journal::{By, Change, Names};
use crate::layout::format_value;
use crate::time;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let lost = match model.pins.lost {
        0 => String::new(),
        count => format!("; {count} are lost, the buffer was full"),
    };
    let which = if model.pins.all.is_empty() { "recorded" } else { "pinned" };
    let title = format!(" changes of the {which} registers, the latest at the end{lost} ");
    let inner = titled(frame, title, theme.head(), area);
    if model.pins.shown().is_empty() {
        let text = match model.pins.all.is_empty() {
            true => {
                " no register is pinned: Space pins one in pane 2; the journal holds no changes of recorded ones"
            }
            false => {
                " no pinned register has changed since it was pinned; the journal holds no earlier changes"
            }
        };
        return lines(frame, vec![Line::styled(text, theme.dim())], inner);
    }
    let width = usize::from(inner.width);
    // The times of a plant that has run for a long time need a wider column.
    let times = model.pins.shown().last().map_or(0, |last| time::seconds(last.time_us).len()).max(TIMES);
    let head = ["time", "after", "register", "from", "to", "by", "meaning"].map(str::to_owned);
    let head = columns(width, times, head);
    let rows = Rect { y: inner.y + 1, height: inner.height.saturating_sub(1), ..inner };
    let seen = model.pins.history.fit(usize::from(rows.height), model.pins.shown().len());
    let names = model.names();
    let has_keys = model.pane == Pane::Changes;
    let line = |number: usize| {
        let change = model.pins.shown().get(number)?;
        let before = number.checked_sub(1).and_then(|before| model.pins.shown().get(before));
        let cells = change_cells(names, change, before);
        let line = change_line(columns(width, times, cells), change.what.how.by, theme);
        Some(marked(line, number == model.pins.history.chosen, has_keys, theme))
    };
    let mut drawn = vec![Line::styled(head.concat(), theme.dim())];
    drawn.extend(seen.filter_map(line));
    lines(frame, drawn, inner);
    model.hot.push((rows, ClickTarget::List(ListId::Changes)));
}

/// Minimum number of columns at which a column shows the previous value.
const WIDE: usize = 110;
/// Minimum width of the column of times.
const TIMES: usize = 12;

/// Columns of a line: time, interval, register, old and new value, writer, meaning.
fn columns(
    width: usize,
    times: usize,
    [time, after, name, from, to, by, meaning]: [String; 7],
) -> [String; 7] {
    let names = (width * 3 / 10).clamp(16, 44);
    let before = if width < WIDE { 0 } else { 12 };
    let rest = width.saturating_sub(times + 10 + 2 + names + before + 12 + 10);
    [
        at_right(&time, times),
        at_right(&after, 10),
        format!("  {}", padded_name(&name, names)),
        padded(&format!(" {from}"), before),
        format!(" {}", padded(&to, 11)),
        format!(" {}", padded(&by, 9)),
        padded(&meaning, rest),
    ]
}

fn change_cells(names: &Names, change: &Change, before: Option<&Change>) -> [String; 7] {
    let what = &change.what;
    let fitted = names.fitted(what.plc);
    let address = fitted.device().at(what.how.width, what.offset);
    let register = change::register(&fitted, what);
    let (ty, name) = match &register {
        Some(register) => (register.ty(), register.to_string()),
        None => (what.how.width.bits(), address.to_string()),
    };
    let after =
        before.map_or_else(String::new, |before| distance(change.time_us.saturating_sub(before.time_us)));
    let [from, to] = [what.from, what.to].map(|value| format_value(ty, value));
    let meaning = register.map(|register| register.decode(what.to)).unwrap_or_default();
    let name = Pins::prefix(names, what.plc) + &name;
    [time::seconds(change.time_us), after, name, from, to, what.how.by.name().to_owned(), meaning]
}

/// Formats an interval in few characters.
fn distance(us: u64) -> String {
    match us {
        0..100_000 => format!("+{us} us"),
        100_000..100_000_000 => format!("+{} ms", us / 1_000),
        _ => format!("+{} s", us / 1_000_000),
    }
}

fn change_line(
    [time, after, name, from, to, by, meaning]: [String; 7],
    originator: By,
    theme: Theme,
) -> Line<'static> {
    let style = match originator {
        By::Firmware => theme.name(),
        By::Program => theme.good(),
        By::Channel => theme.value(),
        By::Force => theme.bad(),
    };
    Line::from(vec![
        Span::raw(time),
        Span::styled(after, theme.dim()),
        Span::raw(name),
        Span::styled(from, theme.dim()),
        Span::styled(to, theme.value()),
        Span::styled(by, style),
        Span::raw(meaning),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cutting_never_changes_a_unit_or_an_index() {
        let cells = ["86400.002000 s", "+99999 ms", "node2.a_STEUREG_CONTROLWORD[31]", "", "", "", ""];
        let [time, after, name, ..] = columns(80, 14, cells.map(str::to_owned));
        assert_eq!((time.as_str(), after.as_str()), ("86400.002000 s", " +99999 ms"));
        assert!(name.ends_with("[31]"), "{name}");
        assert_eq!(
            [99_999, 99_999_999, 86_400_000_000].map(distance),
            ["+99999 us", "+99999 ms", "+86400 s"]
        );
    }
}
