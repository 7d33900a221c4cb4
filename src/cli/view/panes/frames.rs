//! The frames of an interval: as a time line with slots, and as a list.

use super::{lines, marked, titled};
use crate::cli::view::frames::{BusFrame, Window};
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::style::{Theme, at_right, padded};
use crate::devices::Slot;
use crate::time;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

/// Number of lines above the list of frames: times, slots, frames, current time, and a heading.
const ABOVE: u16 = 5;

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let Some(info) = model.info.clone() else { return };
    let Some(bus) = model.scene.get(model.frames.bus.index()).cloned() else {
        let inner = titled(frame, " frames ".to_owned(), theme.head(), area);
        return lines(frame, vec![Line::styled(" the plant has no bus", theme.dim())], inner);
    };
    let window = model.frames.window(&info, &model.scene);
    let what = if window.is_interval { "interval of" } else { "no SYNC here;" };
    let others = if model.scene.len() > 1 { ", Tab: next bus" } else { "" };
    let title = format!(
        " {}, {} bus at {} kbit/s, {what} {} from {}{} ",
        bus.name,
        bus.kind,
        f64::from(bus.bit_s) / 1000.0,
        time::short(window.us),
        time::seconds(window.begin_us),
        if model.frames.is_held() { ", held" } else { others }
    );
    let inner = titled(frame, title, theme.head(), area);
    let slots =
        bus.interval.as_ref().filter(|_| window.is_interval).map_or(&[][..], |interval| &interval.slots);
    let wires = model.frames.within(window);
    let width = usize::from(inner.width).saturating_sub(2).max(1);
    let rows = Rect { y: inner.y + ABOVE, height: inner.height.saturating_sub(ABOVE), ..inner };
    let seen = model.frames.list.fit(usize::from(rows.height), wires.len());
    let chosen = model.frames.list.chosen;
    let mut drawn = vec![
        Line::styled(ruler(window, width), theme.dim()),
        Line::styled(slot_line(slots, window, width), theme.name()),
        wire_line(&wires, window, chosen, width, theme),
        Line::styled(now_line(window, info.time_us, width), theme.warning()),
        Line::styled(
            format!("{}{}  {}frame", at_right("at", 9), at_right("takes", 10), padded("slot", 6)),
            theme.dim(),
        ),
    ];
    if wires.is_empty() {
        drawn.push(Line::styled(" no frame", theme.dim()));
    }
    drawn.extend(seen.filter_map(|number| {
        let line = frame_line(wires.get(number)?, window, slots, usize::from(inner.width), theme);
        Some(marked(line, number == chosen, true, theme))
    }));
    lines(frame, drawn, inner);
    model.hot.push((rows, ClickTarget::List(ListId::Frames)));
}

/// Column of a time.
fn column(window: Window, time_us: u64, width: usize) -> usize {
    let us = time_us.saturating_sub(window.begin_us).min(window.us);
    (us as usize * width / window.us as usize).min(width.saturating_sub(1))
}

/// Ruler with the quarters of the window.
fn ruler(window: Window, width: usize) -> String {
    let mut text = vec![' '; width + 1];
    for quarter in 0..4 {
        let us = window.us * quarter / 4;
        let at = 1 + column(window, window.begin_us + us, width);
        let sign = format!("|{us} us");
        text.iter_mut().skip(at).zip(sign.chars()).for_each(|(to, from)| *to = from);
    }
    text.into_iter().collect()
}

/// Returns the names of the slots, each at the column where its slot begins.
fn slot_line(slots: &[Slot], window: Window, width: usize) -> String {
    let mut text = vec![' '; width + 1];
    for slot in slots {
        let at = 1 + column(window, window.begin_us + u64::from(slot.start_us), width);
        text.iter_mut().skip(at).zip(slot.name.chars().chain([' '])).for_each(|(to, from)| *to = from);
    }
    text.into_iter().collect()
}

fn wire_line(wires: &[BusFrame], window: Window, chosen: usize, width: usize, theme: Theme) -> Line<'static> {
    let mut cells = vec![(' ', theme.plain()); width + 1];
    for (number, wire) in wires.iter().enumerate() {
        let from = column(window, wire.from_us.max(window.begin_us), width);
        let until = column(window, wire.until_us, width).max(from);
        let style = match (wire.is_bad, number == chosen) {
            (true, _) => theme.bad(),
            (false, true) => theme.warning(),
            (false, false) => theme.good(),
        };
        let sign = if wire.is_bad { '\u{00d7}' } else { '\u{2588}' };
        cells.iter_mut().skip(1 + from).take(until - from + 1).for_each(|cell| *cell = (sign, style));
    }
    Line::from(
        cells.into_iter().map(|(sign, style)| Span::styled(sign.to_string(), style)).collect::<Vec<_>>(),
    )
}

/// Marker of the current emulated time, if it is within the window.
fn now_line(window: Window, now_us: u64, width: usize) -> String {
    if now_us < window.begin_us || now_us >= window.begin_us + window.us {
        return String::new();
    }
    let at = 1 + column(window, now_us, width);
    match at > width / 2 {
        true => format!("{}now \u{25b2}", " ".repeat(at - 4)),
        false => format!("{}\u{25b2} now", " ".repeat(at)),
    }
}

fn frame_line(wire: &BusFrame, window: Window, slots: &[Slot], width: usize, theme: Theme) -> Line<'static> {
    let at_us = wire.from_us.saturating_sub(window.begin_us);
    let slot = slots.iter().rfind(|slot| u64::from(slot.start_us) <= at_us + 1).map_or("", |slot| &slot.name);
    let slot = if wire.is_bad { "" } else { slot };
    let before = if wire.from_us < window.begin_us { "before".to_owned() } else { format!("{at_us} us") };
    let takes = match wire.until_us - wire.from_us {
        0 => String::new(),
        us => format!("{us} us"),
    };
    let style = if wire.is_bad { theme.bad() } else { theme.plain() };
    Line::from(vec![
        Span::raw(at_right(&before, 9)),
        Span::styled(at_right(&takes, 10), theme.dim()),
        Span::styled(format!("  {}", padded(slot, 6)), theme.name()),
        Span::styled(padded(&wire.text, width.saturating_sub(27)), style),
    ])
}
