//! A register in a plot.

use crate::journal::Past;
use crate::layout::place::NamedLocation;
use crate::layout::{Address, Handshake, Meaning, RegType};

/// Drawing style of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// For codes and bits: each value stays until the next value.
    Steps,
    /// For numbers that change continuously from each value to the next.
    Line,
    /// For handshakes: spans from a request to its answer.
    Handshake(Handshake),
}

/// A register in a plot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Name of the register beside the row.
    pub name: String,
    /// Style in which the values are drawn.
    pub style: Style,
    /// Points of the row: the time in microseconds, ascending, and the register's value from this time on, as a number
    /// of the register's type.
    pub points: Vec<(u64, i64)>,
    /// Text for each entry of `points`: the value, and after two blanks its meaning.
    pub texts: Vec<String>,
    /// True if the journal has every change of the register.
    pub is_recorded: bool,
    /// Additional note beside the row.
    pub note: Option<String>,
}

impl Row {
    /// Creates a row for the register at `place`, with all its values in a journal. For a single bit, these are the
    /// values of its register.
    pub fn of(name: String, place: &NamedLocation, past: &Past) -> Self {
        // Types and meanings of overlaid registers depend on the phase. So the plot uses those of the last phase.
        let live = place.last_phase();
        let bit = place.bit_in();
        let number = |value: u32| match bit {
            Some((_, bit)) => i64::from(value >> bit & 1),
            None => place.ty(live).number(value),
        };
        let text = |value: u32| match bit {
            Some((_, bit)) => (value >> bit & 1).to_string(),
            None => match (place.format(live, value), place.meaning(live, value)) {
                (value, meaning) if meaning.is_empty() => value,
                (value, meaning) => format!("{value}  {meaning}"),
            },
        };
        let points: Vec<_> = past.values.iter().map(|(time, value)| (*time, number(*value))).collect();
        let texts = past.values.iter().map(|(_, value)| text(*value)).collect();
        let note = match (past.values.is_empty(), past.is_recorded) {
            (true, _) => Some("nothing in the journal".to_owned()),
            (false, false) => Some("not recorded: only values from the journal".to_owned()),
            (false, true) => None,
        };
        let meaning = place.meanings(live).filter(|_| bit.is_none());
        let ty = bit.map_or(place.ty(live), |_| RegType::Byte);
        Self { name, style: style(ty, meaning), points, texts, is_recorded: past.is_recorded, note }
    }

    /// If the journal has no values of the register, shows the final value as a constant. `is_recorded` is true if
    /// every change of the register would be in the journal.
    pub fn or_holds(mut self, text: &str, is_recorded: bool) -> Self {
        self.is_recorded = is_recorded;
        if self.points.is_empty() {
            let why = if is_recorded { "has not changed" } else { "no change recorded" };
            self.note = Some(format!("{why}, present value {text}"));
        } else if is_recorded {
            self.note = None;
        }
        self
    }

    /// Keeps the visible part from `from_us` to `to_us`, with the value that is valid at the beginning.
    pub(super) fn cut(&mut self, from_us: u64, to_us: u64, edges: &[u64]) {
        let first = self.points.partition_point(|(time, _)| *time <= from_us).saturating_sub(1);
        let end = self.points.partition_point(|(time, _)| *time <= to_us);
        self.points.truncate(end);
        self.texts.truncate(end);
        self.points.drain(..first.min(end));
        self.texts.drain(..first.min(end));
        if self.style == Style::Line {
            self.hold(edges);
        }
        if let Some((time, _)) = self.points.first_mut() {
            *time = (*time).max(from_us);
        }
    }

    /// A line rises from each value to the next. This function adds points, so that the number stays constant until the
    /// interval in which it changes.
    fn hold(&mut self, edges: &[u64]) {
        let mut held: Vec<(u64, i64)> = Vec::with_capacity(2 * self.points.len());
        let mut texts = Vec::with_capacity(2 * self.points.len());
        for ((time, value), text) in self.points.iter().zip(&self.texts) {
            if let Some((before, value)) = held.last().copied() {
                // The change begins at the last SYNC edge before it. Without SYNC, the begin is unknown.
                let at =
                    edges.partition_point(|edge| edge < time).checked_sub(1).map_or(*time, |at| edges[at]);
                if at > before {
                    held.push((at, value));
                    texts.push(String::new());
                }
            }
            held.push((*time, *value));
            texts.push(text.clone());
        }
        (self.points, self.texts) = (held, texts);
    }

    /// For a handshake, returns begin and end of each span, and true if the request was answered.
    pub(super) fn spans(&self, to_us: u64) -> Vec<(u64, u64, bool)> {
        let Style::Handshake(Handshake { request, answer }) = self.style else { return Vec::new() };
        let ends = self.points.iter().skip(1).map(|(time, value)| (*time, *value == i64::from(answer)));
        let ends = ends.chain([(to_us, false)]);
        let spans = self.points.iter().zip(ends).filter(|((_, value), _)| *value == i64::from(request));
        spans.map(|((begin, _), (end, is_answered))| (*begin, end, is_answered)).collect()
    }
}

/// Returns the address of the register that a row at `place` shows.
pub fn address_of(place: &NamedLocation) -> Address {
    place.bit_in().map_or(place.address(), |(register, _)| register.address())
}

/// Drawing style of a register of this type and meaning.
fn style(ty: RegType, meaning: Option<&'static Meaning>) -> Style {
    let Some(meaning) = meaning else {
        return match ty {
            RegType::Byte | RegType::Word | RegType::Dword => Style::Steps,
            RegType::Sint | RegType::Int | RegType::Dint => Style::Line,
            RegType::Usint | RegType::Uint | RegType::Udint => Style::Line,
        };
    };
    meaning.handshake.map_or(Style::Steps, Style::Handshake)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(style: Style, points: &[(u64, i64)]) -> Row {
        let texts = points.iter().map(|(_, value)| value.to_string()).collect();
        Row { name: "r".to_owned(), style, points: points.to_vec(), texts, is_recorded: true, note: None }
    }

    #[test]
    fn the_initial_value_is_kept_and_invisible_changes_are_not() {
        let mut cut = row(Style::Steps, &[(0, 1), (10, 2), (20, 3), (30, 4)]);
        cut.cut(15, 25, &[]);
        assert_eq!((cut.points, cut.texts), (vec![(15, 2), (20, 3)], vec!["2".to_owned(), "3".to_owned()]));
        let mut unknown = row(Style::Steps, &[(30, 4)]);
        unknown.cut(15, 25, &[]);
        assert_eq!(unknown.points, []);
        let mut later = row(Style::Steps, &[(20, 4)]);
        later.cut(15, 25, &[]);
        assert_eq!(later.points, [(20, 4)], "before it nothing is known");
    }

    #[test]
    fn a_number_holds_until_the_interval_in_which_it_changes() {
        let mut line = row(Style::Line, &[(100, 0), (2500, 5), (10_400, 9)]);
        line.cut(0, 20_000, &[0, 2000, 4000, 6000, 8000, 10_000, 12_000]);
        assert_eq!(line.points, [(100, 0), (2000, 0), (2500, 5), (10_000, 5), (10_400, 9)]);
        let mut without = row(Style::Line, &[(100, 0), (2500, 5)]);
        without.cut(0, 20_000, &[]);
        assert_eq!(without.points, [(100, 0), (2500, 0), (2500, 5)]);
    }

    #[test]
    fn spans_go_from_the_request_to_the_next_value() {
        let spans = row(
            Style::Handshake(Handshake { request: 5, answer: 4 }),
            &[(0, 0), (5, 5), (9, 4), (12, 5), (13, 1), (20, 5)],
        )
        .spans(30);
        assert_eq!(spans, [(5, 9, true), (12, 13, false), (20, 30, false)]);
    }
}
