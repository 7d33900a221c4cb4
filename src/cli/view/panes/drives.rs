//! The drives: states, and a running chart of reference and actual value of the chosen drive.

use super::{lines, marked, titled};
use crate::cli::view::drives::ChartedDrive;
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::style::{Theme, at_right, padded};
use crate::request::DriveEntry;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType};

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let count = model.drives.all.len();
    let height = (count + 2).clamp(3, (usize::from(area.height) / 2).max(3)) as u16;
    let [list, chart] = Layout::vertical([Constraint::Length(height), Constraint::Min(0)]).areas(area);
    let inner = titled(frame, " drives ".to_owned(), theme.head(), list);
    if count == 0 {
        return lines(frame, vec![Line::styled(" the plant has no drive", theme.dim())], inner);
    }
    let width = usize::from(inner.width);
    let head =
        columns(width, ["drive", "at", "state", "SYNC", "reference", "actual", "fault"].map(str::to_owned));
    let rows = Rect { y: inner.y + 1, height: inner.height.saturating_sub(1), ..inner };
    let seen = model.drives.list.fit(usize::from(rows.height), count);
    let line = |number: usize| {
        let line = drive_line(model.drives.all.get(number)?, theme, width);
        Some(marked(line, number == model.drives.list.chosen, true, theme))
    };
    let mut drawn = vec![Line::styled(head.concat(), theme.dim())];
    drawn.extend(seen.filter_map(line));
    lines(frame, drawn, inner);
    model.hot.push((rows, ClickTarget::List(ListId::Drives)));
    if let Some(shown) = model.drives.all.get(model.drives.list.chosen) {
        draw_chart(frame, shown, theme, chart);
    }
}

/// Columns of a line: name, bus and number, state, synchronization, speeds, fault.
fn columns(width: usize, cells: [String; 7]) -> [String; 7] {
    let names = width.saturating_sub(1 + 11 + 22 + 6 + 11 + 11 + 7).clamp(8, 24);
    let [name, at, state, sync, reference, actual, fault] = cells;
    [
        format!(" {}", padded(&name, names)),
        format!("{} ", padded(&at, 10)),
        padded(&state, 22),
        padded(&sync, 6),
        at_right(&reference, 11),
        at_right(&actual, 11),
        at_right(&fault, 7),
    ]
}

fn drive_line(shown: &ChartedDrive, theme: Theme, width: usize) -> Line<'static> {
    let DriveEntry { name, bus, state } = &shown.entry;
    let at = match (bus, state.number) {
        (Some(bus), Some(number)) => format!("{bus}/{number}"),
        _ => "built in".to_owned(),
    };
    let sync = if state.is_synchronized { "\u{25cf}" } else { "\u{25cb}" };
    let fault = if state.fault == 0 { "-".to_owned() } else { state.fault.to_string() };
    let drive_cells = [
        name.clone(),
        at,
        state.state.replace('_', " "),
        sync.to_owned(),
        state.speed_reference.to_string(),
        state.speed_actual.to_string(),
        fault,
    ];
    let [name, at, state_cell, sync, reference, actual, fault] = columns(width, drive_cells);
    let sync_style = if state.is_synchronized { theme.good() } else { theme.dim() };
    let fault_style = if state.fault == 0 { theme.dim() } else { theme.bad() };
    Line::from(vec![
        Span::styled(name, theme.name()),
        Span::styled(at, theme.dim()),
        Span::raw(state_cell),
        Span::styled(sync, sync_style),
        Span::styled(reference, theme.warning()),
        Span::styled(actual, theme.good()),
        Span::styled(fault, fault_style),
    ])
}

fn draw_chart(frame: &mut Frame, shown: &ChartedDrive, theme: Theme, area: Rect) {
    let title = format!(" {}: reference (yellow) and actual speed (green) at each poll ", shown.entry.name);
    let inner = titled(frame, title, theme.dim(), area);
    let reference: Vec<_> = shown.points.iter().map(|(time, reference, _)| (*time, *reference)).collect();
    let actual: Vec<_> = shown.points.iter().map(|(time, _, actual)| (*time, *actual)).collect();
    let values = || reference.iter().chain(&actual).map(|(_, value)| *value);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    // A constant value has no range: this range puts its line in the middle.
    let (low, high) = if low < high { (low, high) } else { (low - 1.0, high + 1.0) };
    let begin = reference.first().map_or(0.0, |(time, _)| *time);
    let end = reference.last().map_or(1.0, |(time, _)| *time).max(begin + 1e-6);
    let line = |name: &'static str, points, style| {
        Dataset::default()
            .name(name)
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(style)
            .data(points)
    };
    let sets = vec![line("reference", &reference, theme.warning()), line("actual", &actual, theme.good())];
    let times = [begin, end].map(|time| format!("{time:.3} s"));
    let bounds = [low, high].map(|value| format!("{value:.0}"));
    let chart = Chart::new(sets)
        .x_axis(Axis::default().bounds([begin, end]).labels(times).style(theme.dim()))
        .y_axis(Axis::default().bounds([low, high]).labels(bounds).style(theme.dim()));
    frame.render_widget(chart, inner);
}
