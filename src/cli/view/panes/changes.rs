//! Every change of the pinned registers as the emulator has kept it, in their order.

use super::{lines, marked, titled};
use crate::cli::change;
use crate::cli::view::model::{Hot, Model, Which};
use crate::cli::view::pins::Pins;
use crate::cli::view::style::{Theme, at_right, padded};
use crate::journal::{By, Change, Names};
use crate::layout::format_value;
use crate::time;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let lost = match model.pins.lost {
        0 => String::new(),
        count => format!("; {count} are lost, more came than are kept"),
    };
    let title = format!(" changes of the pinned registers, the latest at the end{lost} ");
    let inner = titled(frame, title, theme.head(), area);
    if model.pins.changes.is_empty() {
        let text = match model.pins.all.is_empty() {
            true => " no register is pinned: Space pins one in pane 2",
            false => " none of the pinned registers has changed since",
        };
        return lines(frame, vec![Line::styled(text, theme.dim())], inner);
    }
    let width = usize::from(inner.width);
    let head =
        columns(width, ["time", "after", "register", "from", "to", "by", "meaning"].map(str::to_owned));
    let rows = Rect { y: inner.y + 1, height: inner.height.saturating_sub(1), ..inner };
    let seen = model.pins.history.fit(usize::from(rows.height), model.pins.changes.len());
    let names = model.names();
    let line = |number: usize| {
        let change = model.pins.changes.get(number)?;
        let before = number.checked_sub(1).and_then(|before| model.pins.changes.get(before));
        let line = change_line(&names, change, before, theme, width);
        Some(marked(line, number == model.pins.history.chosen, true, theme))
    };
    let mut drawn = vec![Line::styled(head.concat(), theme.dim())];
    drawn.extend(seen.filter_map(line));
    lines(frame, drawn, inner);
    model.hot.push((rows, Hot::List(Which::Changes)));
}

/// From this width on there is room for what registers held before.
const WIDE: usize = 110;

/// Time, distance, register, what it held and holds, who, meaning.
fn columns(width: usize, [time, after, name, from, to, by, meaning]: [String; 7]) -> [String; 7] {
    let names = (width * 3 / 10).clamp(16, 44);
    let before = if width < WIDE { 0 } else { 12 };
    let rest = width.saturating_sub(12 + 9 + 2 + names + before + 12 + 10);
    [
        at_right(&time, 12),
        at_right(&after, 9),
        format!("  {}", padded(&name, names)),
        padded(&format!(" {from}"), before),
        format!(" {}", padded(&to, 11)),
        format!(" {}", padded(&by, 9)),
        padded(&meaning, rest),
    ]
}

fn change_line(
    names: &Names,
    change: &Change,
    before: Option<&Change>,
    theme: Theme,
    width: usize,
) -> Line<'static> {
    let what = &change.what;
    let fitted = names.fitted(what.plc);
    let address = fitted.device().at(what.how.width, what.offset);
    let register = change::register(&fitted, what);
    let (ty, name) = match &register {
        Some(register) => (register.ty(), register.to_string()),
        None => (what.how.width.bits(), address.to_string()),
    };
    let after = before.map(|before| change.time_us.saturating_sub(before.time_us));
    let after = match after {
        None => String::new(),
        Some(us @ 0..100_000) => format!("+{us} us"),
        Some(us) => format!("+{} ms", us / 1_000),
    };
    let [from, to] = [what.from, what.to].map(|value| format_value(ty, value));
    let meaning = register.map(|register| register.decode(what.to)).unwrap_or_default();
    let name = Pins::prefix(names, what.plc) + &name;
    let by = what.how.by;
    let time = time::seconds(change.time_us);
    let cells = columns(width, [time, after, name, from, to, by.name().to_owned(), meaning]);
    let style = match by {
        By::Firmware => theme.name(),
        By::Program => theme.good(),
        By::Channel => theme.value(),
        By::Force => theme.bad(),
    };
    let [time, after, name, from, to, by, meaning] = cells;
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
