//! The timing table.

use crate::error::{Error, Reason};
use crate::model::{BaudRate, Deadline};
use crate::raw;
use crate::source::{Sources, at};
use toml::Spanned;

/// Checks one line of the table of baud rates.
pub(crate) fn check(sources: &Sources, file: usize, raw: &raw::BaudRate) -> Result<BaudRate, Error> {
    let numbers = vec![
        ("kbit_per_s", raw.kbit_per_s.into()),
        ("us_BAUDRATE", raw.us_BAUDRATE.into()),
        ("b_BT_0", raw.b_BT_0.into()),
        ("b_BT_1", raw.b_BT_1.into()),
        ("b_TIME_PATTERN", raw.b_TIME_PATTERN.into()),
        ("t_WRC1", raw.t_WRC1),
        ("t_RDC1", raw.t_RDC1),
        ("t_WRC2", raw.t_WRC2),
        ("t_RDC2", raw.t_RDC2),
        ("t_CC", raw.t_CC),
        ("t_RC", raw.t_RC),
        ("t_RSPTO", raw.t_RSPTO),
        ("max_bus_m", raw.max_bus_m.into()),
    ];
    let deadlines = [
        ("deadline_WRC", &raw.deadline_WRC),
        ("deadline_RDC1", &raw.deadline_RDC1),
        ("deadline_RDC2", &raw.deadline_RDC2),
    ];
    let deadlines = deadlines.into_iter().map(|(name, raw)| Ok((name, deadline(sources, file, raw)?)));
    Ok(BaudRate { numbers, deadlines: deadlines.collect::<Result<_, Error>>()? })
}

fn deadline(sources: &Sources, file: usize, raw: &Spanned<raw::Deadline>) -> Result<Deadline, Error> {
    let place = at(file, raw.span());
    let raw = raw.get_ref();
    let (earliest, latest) = match (raw.at, raw.from, raw.to) {
        (Some(at), None, None) => (at, at),
        (None, Some(from), Some(to)) if from < to => (from, to),
        _ => return Err(sources.error(place, Reason::BadRange("deadline", "at"))),
    };
    Ok(Deadline { earliest, latest, source: raw.source.clone() })
}
