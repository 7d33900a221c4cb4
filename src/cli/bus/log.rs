//! `commram bus play` and `commram bus compare`: logs of frames.

use super::super::error::CliError;
use super::super::{Instance, output, time};
use crate::input_file;
use crate::journal::candump::{self, Logged};
use crate::journal::pcapng;
use crate::request::MAX_ADVANCE_US;
use std::path::{Path, PathBuf};

/// Send the frames of a log to buses, with the time intervals of the log.
///
/// LOG is a file written by `candump -L`, by `commram trace --format candump` or `pcapng`, or by Wireshark. The
/// first frame is sent at once. With the stepped clock the command advances the clock from one frame to the next,
/// with the real-time clock it waits. Other stations on the bus take part in the arbitration. An interface of the
/// log means the bus of the same name, or the only bus of the instance.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram bus play open.log
  commram bus play open.pcapng
  commram bus play can0.log --bus open")]
pub(super) struct Play {
    /// The log
    log: PathBuf,
    /// Send all frames to this bus
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    #[command(flatten)]
    instance: Instance,
}

/// Compare the frames of the journal with the frames of a log.
///
/// On each bus the frames must be the same in the same order. Their times since the first frame of the bus must be
/// the same within the tolerance. Every difference is a line: `missing` is only in the log, `extra` only in the
/// journal, `moved` comes at another time. Exit code 1: there are differences.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram bus compare open.log
  commram bus compare can0.log --bus open --tolerance 100us --since 2s")]
pub(super) struct Compare {
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
    #[command(flatten)]
    instance: Instance,
}

/// A log file after reading.
struct Log {
    frames: Vec<Logged>,
    /// Unit of [`Logged::at`]: line or byte.
    unit: &'static str,
}

/// Longest time between two frames of a played log: the limit of one advance operation, 24 h in
/// microseconds.
const LONGEST_GAP_US: u64 = MAX_ADVANCE_US;

impl Log {
    /// Checks that the times of the frames can be played. A frame with an earlier time than the preceding frame is
    /// accepted: it is sent at once, with a note on the standard error output.
    fn check_times(&self, path: &Path) -> Result<(), CliError> {
        let unit = self.unit;
        let mut latest = self.frames.first().map_or(0, |first| first.time_us);
        let mut earlier = Vec::new();
        for frame in &self.frames {
            let gap_us = frame.time_us.saturating_sub(latest);
            if gap_us > LONGEST_GAP_US {
                let right = format!(
                    "{unit} {}: its frame comes {} after the preceding frame; the longest gap in a log is {}",
                    frame.at,
                    time::seconds(gap_us),
                    time::seconds(LONGEST_GAP_US)
                );
                return Err(CliError::Argument { text: path.display().to_string(), right });
            }
            if frame.time_us < latest {
                earlier.push(frame.at);
            }
            latest = latest.max(frame.time_us);
        }
        if let Some((first, others)) = earlier.split_first() {
            let others = match others.len() {
                0 => String::new(),
                count => format!(", and {count} more frames"),
            };
            output::note(&format!(
                "{}: {unit} {first}: its time is before the time of an earlier frame{others}; they are sent at once",
                path.display()
            ));
        }
        Ok(())
    }
}

/// Reads the frames of a log.
fn read(path: &Path) -> Result<Log, CliError> {
    let wrong = |right: String| CliError::Argument { text: path.display().to_string(), right };
    let bytes =
        input_file::read_bytes(path, input_file::LONGEST).map_err(|reason| wrong(reason.to_string()))?;
    if pcapng::is_one(&bytes) {
        let frames = pcapng::read(&bytes).map_err(|error| wrong(error.to_string()))?;
        return Ok(Log { frames, unit: "byte" });
    }
    let text = input_file::text(bytes).map_err(|_| {
        wrong("it is neither a candump log nor a pcapng file (as Wireshark writes)".to_owned())
    })?;
    let frames = candump::read(&text).map_err(|error| wrong(error.to_string()))?;
    Ok(Log { frames, unit: "line" })
}

/// A frame and its time in microseconds.
type TimedFrame = (u64, crate::can::Frame);

/// How many missing or extra frames the comparison skips to find a match again.
const WINDOW: usize = 64;

/// Returns the differences between the log and the journal, one per line.
fn differences(bus: &str, wanted: &[TimedFrame], found: &[TimedFrame], tolerance_us: u64) -> Vec<String> {
    let (first_wanted, first_found) = match (wanted.first(), found.first()) {
        (Some(wanted), Some(found)) => (wanted.0, found.0),
        _ => (0, 0),
    };
    let show = |what: &str, &(time_us, ref frame): &TimedFrame| {
        format!("{what:7}  {}  {bus} {}", time::seconds(time_us), candump::Shown(frame))
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
                // The frame that occurs again sooner was only delayed; the other one is missing or extra.
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

pub(super) use by_channel::{compare, play};

mod by_channel {
    use super::super::super::demo::Interrupts;
    use super::super::super::session::Session;
    use super::super::super::{error::CliError, output, time};
    use super::{Compare, Play, TimedFrame, differences, read};
    use crate::can::Frame;
    use crate::journal::candump::Logged;
    use crate::journal::{Record, Source};
    use crate::plural::plural;
    use crate::request::{InstanceInfo, MAX_OPS, Op};
    use std::time::Duration;

    /// A frame of the log, with the number of its bus.
    struct AddressedFrame {
        time_us: u64,
        bus: u16,
        frame: Frame,
    }

    /// Assigns each frame to a bus.
    fn aim(
        log: Vec<Logged>,
        only: Option<&str>,
        info: &InstanceInfo,
    ) -> Result<Vec<AddressedFrame>, CliError> {
        let buses = &info.names.buses;
        let number = |name: &str| buses.iter().position(|bus| bus == name);
        let unknown = |bus: &str| CliError::UnknownBus {
            bus: bus.to_owned(),
            instance: info.name.clone(),
            buses: buses.join(", "),
        };
        let for_all = only.map(|name| number(name).ok_or_else(|| unknown(name))).transpose()?;
        let aim = |it: Logged| {
            let only_one = (buses.len() == 1).then_some(0);
            let bus = for_all.or_else(|| number(&it.interface)).or(only_one);
            let bus = bus.ok_or_else(|| unknown(&it.interface))? as u16;
            Ok(AddressedFrame { time_us: it.time_us, bus, frame: it.frame })
        };
        log.into_iter().map(aim).collect()
    }

    pub(crate) fn play(args: &Play) -> Result<(), CliError> {
        let log = read(&args.log)?;
        log.check_times(&args.log)?;
        let info = Session::open(&args.instance, 0)?.ask(Op::Info)?.info()?;
        let log = aim(log.frames, args.bus.as_deref(), &info)?;
        let Some(first) = log.first() else {
            return output::print("0 frames\n");
        };
        let start_us = first.time_us;
        let length_us = log.iter().map(|it| it.time_us).max().unwrap_or(start_us).saturating_sub(start_us);
        let session = Session::open(&args.instance, length_us)?;
        let mut sent = 0;
        let played = match info.is_stepped {
            true => stepped(&session, &log, start_us, &mut sent).map(|()| String::new()),
            false => in_real_time(&session, &log, start_us, &mut sent).map(|timing| timing.text()),
        };
        let frames = plural(log.len() as u64, "frame");
        if played.is_err() {
            output::note(&format!("{sent} of {frames} were sent"));
        }
        output::print(&format!("{frames} in {}{}\n", time::short(length_us), played?))
    }

    /// Timing of a log that was played with the real-time clock. Times are emulated, in microseconds.
    struct Timing {
        took_us: u64,
        latest_us: u64,
    }

    impl Timing {
        fn text(&self) -> String {
            let Timing { took_us, latest_us } = self;
            format!(
                " of the log; sent within {}, up to {} late",
                time::short(*took_us),
                time::short(*latest_us)
            )
        }
    }

    /// Advances the clock from frame to frame. `sent` counts the frames of completed requests.
    fn stepped(
        session: &Session,
        log: &[AddressedFrame],
        start_us: u64,
        sent: &mut usize,
    ) -> Result<(), CliError> {
        let mut now_us = start_us;
        for part in log.chunks(MAX_OPS / 2) {
            let mut ops = Vec::with_capacity(2 * part.len());
            for it in part {
                let us = it.time_us.saturating_sub(now_us);
                ops.extend((us > 0).then_some(Op::Advance { us }));
                now_us += us;
                ops.push(Op::BusSend { bus: it.bus, frame: Some(it.frame) });
            }
            session.request(&ops)?;
            *sent += part.len();
        }
        Ok(())
    }

    /// Waits for the time of each frame. `sent` counts the frames.
    fn in_real_time(
        session: &Session,
        log: &[AddressedFrame],
        start_us: u64,
        sent: &mut usize,
    ) -> Result<Timing, CliError> {
        let interrupts = Interrupts::catch()?;
        let begin_us = session.ask(Op::Time)?.time()?;
        let mut timing = Timing { took_us: 0, latest_us: 0 };
        for it in log {
            let due_us = begin_us + it.time_us.saturating_sub(start_us);
            let now_us = loop {
                if interrupts.any() {
                    return Err(CliError::Interrupted);
                }
                let now_us = session.ask(Op::Time)?.time()?;
                let left_us = due_us.saturating_sub(now_us);
                if left_us == 0 {
                    break now_us;
                }
                // Emulated time can run faster or slower than real time, so at most 10 ms are slept before the next
                // query.
                std::thread::sleep(Duration::from_micros(left_us.min(10_000)));
            };
            session.ask(Op::BusSend { bus: it.bus, frame: Some(it.frame) })?.written()?;
            *sent += 1;
            timing.took_us = now_us.saturating_sub(begin_us);
            timing.latest_us = timing.latest_us.max(now_us.saturating_sub(due_us));
        }
        Ok(timing)
    }

    pub(crate) fn compare(args: &Compare) -> Result<(), CliError> {
        let log = read(&args.log)?;
        let session = Session::open(&args.instance, 0)?;
        let info = session.ask(Op::Info)?.info()?;
        let log = aim(log.frames, args.bus.as_deref(), &info)?;
        let journal = frames(&session, args.since)?;
        let mut buses: Vec<u16> = log.iter().map(|it| it.bus).collect();
        buses.sort_unstable();
        buses.dedup();
        let mut lines = Vec::new();
        for bus in buses {
            let wanted: Vec<TimedFrame> =
                log.iter().filter(|it| it.bus == bus).map(|it| (it.time_us, it.frame)).collect();
            let found: Vec<TimedFrame> = journal.iter().filter(|it| it.0 == bus).map(|it| it.1).collect();
            let name = info.names.buses.get(usize::from(bus)).map_or("", String::as_str);
            lines.extend(differences(name, &wanted, &found, args.tolerance));
        }
        if lines.is_empty() {
            let frames = plural(log.len() as u64, "frame");
            return output::print(&format!("{frames}, no difference\n"));
        }
        output::print(&(lines.join("\n") + "\n"))?;
        Err(CliError::Reported)
    }

    /// Reads the frames of the journal with their buses.
    fn frames(session: &Session, since_us: u64) -> Result<Vec<(u16, TimedFrame)>, CliError> {
        let frame = |record: &Record| {
            let (carried, source) = (record.event.frame()?, record.event.source());
            let Source::Bus(bus) = source else { return None };
            (record.time_us >= since_us).then_some((bus, (record.time_us, carried.frame)))
        };
        Ok(session.records(0)?.iter().filter_map(frame).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{Frame, Payload};

    fn at(time_us: u64, mark: u8) -> TimedFrame {
        (time_us, Frame::standard(0x100, Payload::from_padded([mark; 8], 1)))
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
