//! `commram bus compare`.

use super::super::super::error::CliError;
use super::super::super::session::Session;
use super::super::super::{Instance, output, time};
use super::message::{Message, Senders};
use super::select::Select;
use super::{AddressedMessage, Buses, nothing, put_in_order, read};
use crate::identity::BusIndex;
use crate::journal::Source;
use crate::plural::plural;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Compare the frames and telegrams of the journal with those of a log.
///
/// On each bus the frames must be the same in the same order. Their times since the first frame of the bus must be
/// the same within the tolerance. Every difference is a line: `missing` is only in the log, `extra` only in the
/// journal, `moved` comes at another time. The selection applies to the log and, except for interface and direction,
/// to the journal. Exit code 1: there are differences.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram bus compare open.log
  commram bus compare can0.log --bus open --tolerance 100us --since 2s
  commram bus compare can0.log --id 180:780
  commram bus compare dp.jsonl --station 5")]
pub(in super::super) struct Compare {
    /// The log
    log: PathBuf,
    /// Compare all frames with this bus
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// Largest allowed difference of the times
    #[arg(long, value_name = "TIME", value_parser = time::parse, default_value = "1ms")]
    tolerance: u64,
    /// Compare only frames at or after this emulated time
    #[arg(long, value_name = "TIME", value_parser = time::parse, default_value = "0s", hide_default_value = true)]
    since: u64,
    /// A log without a frame to compare is no error
    #[arg(long)]
    allow_empty: bool,
    #[command(flatten)]
    select: Select,
    #[command(flatten)]
    instance: Instance,
}

/// A frame or telegram and its time in microseconds.
type TimedFrame = (u64, Message);

/// After a difference, the comparison searches this number of frames ahead for the next match.
const WINDOW: usize = 64;

/// Returns the differences between the log and the journal, one per line.
fn differences(bus: &str, wanted: &[TimedFrame], found: &[TimedFrame], tolerance_us: u64) -> Vec<String> {
    let (first_wanted, first_found) = match (wanted.first(), found.first()) {
        (Some(wanted), Some(found)) => (wanted.0, found.0),
        _ => (0, 0),
    };
    let show = |what: &str, (time_us, message): &TimedFrame| {
        format!("{what:7}  {}  {bus} {message}", time::seconds(*time_us))
    };
    let ahead = |frame: &TimedFrame, list: &[TimedFrame]| {
        list.iter().take(WINDOW).position(|other| other.1 == frame.1)
    };
    let mut lines = Vec::new();
    let (mut wanted, mut found) = (wanted, found);
    loop {
        match (wanted, found) {
            ([], []) => return lines,
            ([first, rest @ ..], []) => {
                lines.push(show("missing", first));
                wanted = rest;
            }
            ([], [first, rest @ ..]) => {
                lines.push(show("extra", first));
                found = rest;
            }
            ([first, rest @ ..], [other, others @ ..]) if first.1 == other.1 => {
                let (due, came) = (first.0.saturating_sub(first_wanted), other.0.saturating_sub(first_found));
                if due.abs_diff(came) > tolerance_us {
                    let side = if came > due { "later" } else { "earlier" };
                    let line = show("moved", other);
                    lines.push(format!("{line}  {} {side}", time::short(due.abs_diff(came))));
                }
                (wanted, found) = (rest, others);
            }
            ([first, rest @ ..], [other, others @ ..]) => {
                // The log and the journal differ here in one frame each. For both frames, this searches the same frame
                // ahead on the opposite side. The frame whose match is nearer has only moved; the other frame is
                // missing or extra.
                let (again, before) = (ahead(first, others), ahead(other, rest));
                if before.is_some_and(|before| again.is_none_or(|again| before < again)) || again.is_none() {
                    lines.push(show("missing", first));
                    wanted = rest;
                } else {
                    lines.push(show("extra", other));
                    found = others;
                }
            }
        }
    }
}

/// Compares a log with the journal.
pub(in super::super) fn compare(args: &Compare) -> Result<(), CliError> {
    let log = read(&args.log)?;
    let session = Session::open(&args.instance, 0)?;
    let known = Buses::of(&session)?;
    let mut log = log.aim(&args.select, args.bus.as_deref(), &known)?;
    // `play` sends such a message at once.
    put_in_order(&mut log);
    if log.is_empty() && !args.allow_empty {
        return Err(nothing(&args.log, "it has no frame to compare; --allow-empty accepts that"));
    }
    let journal = frames(&session, args)?;
    let mut buses: Vec<BusIndex> = log.iter().map(|it| it.bus).collect();
    buses.sort_unstable();
    buses.dedup();
    let mut lines = Vec::new();
    for bus in buses {
        let of_bus = |it: &&AddressedMessage| it.bus == bus;
        let wanted: Vec<TimedFrame> =
            log.iter().filter(of_bus).map(|it| (it.time_us, it.message.clone())).collect();
        let found: Vec<TimedFrame> = journal.iter().filter(|it| it.0 == bus).map(|it| it.1.clone()).collect();
        let name = known.info.names.buses.get(bus.index()).map_or("", String::as_str);
        lines.extend(differences(name, &wanted, &found, args.tolerance));
    }
    if lines.is_empty() {
        let frames = plural(log.len() as u64, "frame");
        return output::print(&format!("{frames}, no difference\n"));
    }
    output::print(&(lines.join("\n") + "\n"))?;
    Err(CliError::Reported)
}

/// Reads the selected frames and telegrams of the journal with their buses.
fn frames(session: &Session, args: &Compare) -> Result<Vec<(BusIndex, TimedFrame)>, CliError> {
    let mut senders: BTreeMap<BusIndex, Senders> = BTreeMap::new();
    let mut found = Vec::new();
    for record in session.records(0)? {
        let (Some(message), Source::Bus(bus)) = (Message::of_record(&record), record.event.source()) else {
            continue;
        };
        let is_selected = match &message {
            Message::Frame(frame) => args.select.takes_id(frame),
            Message::Telegram(octets) => {
                let sender = senders.entry(bus).or_default().of_next(octets);
                args.select.takes_sender(sender)
            }
        };
        if is_selected && record.time_us >= args.since {
            found.push((bus, (record.time_us, message)));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{Frame, Payload};

    fn at(time_us: u64, mark: u8) -> TimedFrame {
        (time_us, Message::Frame(Frame::standard(0x100, Payload::from_padded([mark; 8], 1))))
    }

    fn kinds(wanted: &[TimedFrame], found: &[TimedFrame], tolerance_us: u64) -> Vec<String> {
        differences("open", wanted, found, tolerance_us)
    }

    #[test]
    fn only_intervals_are_compared() {
        let wanted = [at(5_000_000, 1), at(5_001_000, 2), at(5_002_000, 3)];
        let found = [at(10, 1), at(1_010, 2), at(2_020, 3)];
        assert!(kinds(&wanted, &found, 10).is_empty());
        assert_eq!(kinds(&wanted, &found, 9), ["moved    0.002020 s  open 100#03  10 us later"]);
    }

    #[test]
    fn missing_and_extra_frames_do_not_move_the_others() {
        let wanted = [at(0, 1), at(1000, 2), at(2000, 3), at(3000, 4)];
        let found = [at(0, 1), at(2000, 3), at(2500, 9), at(3000, 4), at(4000, 5)];
        assert_eq!(
            kinds(&wanted, &found, 0),
            [
                "missing  0.001000 s  open 100#02",
                "extra    0.002500 s  open 100#09",
                "extra    0.004000 s  open 100#05"
            ]
        );
        assert_eq!(kinds(&[], &found, 0).len(), 5);
        assert_eq!(kinds(&wanted, &[], 0).len(), 4);
    }

    #[test]
    fn a_different_frame_is_reported_as_missing_and_extra() {
        let (wanted, found) = ([at(0, 1), at(1000, 2)], [at(0, 1), at(1000, 7)]);
        let lines = kinds(&wanted, &found, 0);
        assert!(
            lines.len() == 2 && lines[0].starts_with("missing") && lines[1].starts_with("extra"),
            "{lines:?}"
        );
    }
}
