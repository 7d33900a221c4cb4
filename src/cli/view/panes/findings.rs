//! Findings of the access checker; for the chosen finding also the rule and its page in the manual.

use super::{lines, marked, titled};
use crate::cli::check::FindingRow;
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::style::{Theme, at_right, padded, padded_name};
use crate::time;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

/// Number of lines for the rule.
const RULE: u16 = 5;

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let [list, rule] = Layout::vertical([Constraint::Min(0), Constraint::Length(RULE)]).areas(area);
    let inner = titled(frame, " violations of the manual ".to_owned(), theme.head(), list);
    if model.findings.is_empty() {
        let text = " no violations of the manual were found";
        return lines(frame, vec![Line::styled(text, theme.dim())], inner);
    }
    let names = model.names();
    let found: Vec<_> = model.findings.iter().map(|entry| FindingRow::new(entry, names)).collect();
    let width = usize::from(inner.width);
    let head = columns(width, ["severity", "rule", "register", "value", "count", "last"].map(str::to_owned));
    let rows = Rect { y: inner.y + 1, height: inner.height.saturating_sub(1), ..inner };
    let seen = model.finding.fit(usize::from(rows.height), found.len());
    let line = |number: usize| {
        let row = found.get(number)?;
        let line = finding_line(row, theme, width);
        Some(marked(line, number == model.finding.chosen, true, theme))
    };
    let mut drawn = vec![Line::styled(head.concat(), theme.dim())];
    drawn.extend(seen.filter_map(line));
    lines(frame, drawn, inner);
    model.hot.push((rows, ClickTarget::List(ListId::Findings)));
    if let Some(FindingRow { finding: row, .. }) = found.get(model.finding.chosen) {
        let inner = titled(frame, format!(" {} ", row.rule), theme.head(), rule);
        let mut text = vec![Line::from(row.note.as_deref().unwrap_or(row.text))];
        text.push(Line::styled(row.source, theme.name()));
        if let Some(late_us) = row.late_us {
            text.push(Line::from(format!("up to {late_us} us late")));
        }
        frame.render_widget(Paragraph::new(text).wrap(Wrap { trim: true }), inner);
    }
}

fn columns(width: usize, [severity, rule, register, value, count, last]: [String; 6]) -> [String; 6] {
    let rules = (width / 4).clamp(12, 22);
    let times = (last.len() + 1).max(13);
    let rest = width.saturating_sub(9 + rules + 1 + 12 + 6 + times);
    [
        format!(" {}", padded(&severity, 8)),
        format!("{} ", padded(&rule, rules)),
        padded_name(&register, rest),
        format!(" {}", padded(&value, 11)),
        at_right(&count, 6),
        at_right(&last, times),
    ]
}

fn finding_line(row: &FindingRow, theme: Theme, width: usize) -> Line<'static> {
    let FindingRow { finding: row, value_text } = row;
    let register = row.register.clone().unwrap_or_else(|| "(further registers)".to_owned());
    let cells = [
        row.severity.to_owned(),
        row.rule.to_owned(),
        register,
        value_text.clone(),
        row.count.to_string(),
        time::seconds(row.last_us),
    ];
    let style = if row.severity == "error" { theme.bad() } else { theme.warning() };
    let [severity, rule, register, value, count, last] = columns(width, cells);
    Line::from(vec![
        Span::styled(severity, style),
        Span::raw(rule),
        Span::styled(register, theme.name()),
        Span::styled(value, theme.value()),
        Span::raw(count),
        Span::styled(last, theme.dim()),
    ])
}
