//! Reads the journal up to its end and, with `--follow`, new records.

use super::csv::Csv;
use super::{Args, FormatArg};
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::cli::output;
use crate::cli::pause::{Pause, PauseEnd, PollResult, following};
use crate::cli::session::{self, Session};
use crate::cli::time;
use crate::devices;
use crate::door::TrafficKind;
use crate::journal::candump::Candump;
use crate::journal::folded::Folded;
use crate::journal::jsonl::Jsonl;
use crate::journal::pcapng::{Link, Pcapng};
use crate::journal::text::Text;
use crate::journal::vcd;
use crate::journal::{Format, Names, Printer, Record, Selection, Waves};
use crate::plural::plural;
use crate::request::{BusState, MAX_RECORDS, Op, WrongReply};
use std::collections::VecDeque;
use std::io::IsTerminal;

/// Maximum number of events in a waveform. A waveform is kept in memory as a whole.
const MOST_EVENTS: u64 = 20_000_000;

/// With `--follow`, a folded line covers at most this emulated time, in microseconds, so that the output is not late.
const LONGEST_FOLLOWED_US: u64 = 1_000_000;

/// Prints the existing records and, with `--follow`, new ones.
pub(crate) fn print(
    args: &Args,
    session: &Session,
    selection: Selection,
    names: Names,
) -> Result<(), CliError> {
    let text: Box<dyn Format> = match args.format {
        FormatArg::Text if args.is_folded() => {
            let longest_us = if args.follow { LONGEST_FOLLOWED_US } else { u64::MAX };
            Box::new(Folded::new(names, devices::catalogue(), longest_us))
        }
        FormatArg::Text => Box::new(Text::new(names, devices::catalogue())),
        FormatArg::Jsonl => Box::new(Jsonl::new(names, devices::catalogue())),
        FormatArg::Csv => Box::new(Csv::new(names, devices::catalogue())),
        FormatArg::Candump => Box::new(Candump::new(&names)),
        FormatArg::Pcapng => {
            return print_as::<Vec<u8>>(args, session, selection, Box::new(Pcapng::new(links(session)?)));
        }
        FormatArg::Vcd | FormatArg::Fst => return print_waveforms(args, session, &selection, names),
    };
    print_as(args, session, selection, text)
}

/// Returns the names of the buses and the kinds of their links.
fn links(session: &Session) -> Result<Vec<(String, Link)>, CliError> {
    let link = |bus: BusState| {
        let link = match devices::emulation::traffic_kind_of(&bus.kind) {
            Some(TrafficKind::Telegrams) => Link::Profibus,
            Some(TrafficKind::Octets) => Link::Serial,
            Some(TrafficKind::Frames) | None => Link::Can,
        };
        (bus.name, link)
    };
    Ok(session.ask(Op::Buses)?.buses()?.into_iter().map(link).collect())
}

/// Prints the existing records as waveforms. The output begins with a list of all signals.
fn print_waveforms(
    args: &Args,
    session: &Session,
    selection: &Selection,
    names: Names,
) -> Result<(), CliError> {
    let records = session.records(args.from)?;
    let wanted = records.iter().filter(|record| selection.takes(record));
    check_length(wanted.map(|record| u64::from(record.count)).sum())?;
    let waves = Waves::of(&records, selection, names, devices::catalogue());
    let mut bytes = Vec::new();
    match args.format {
        FormatArg::Fst => bytes = fst(&waves)?,
        _ => vcd::write(&waves, &mut bytes).map_err(|reason| CliError::Output { reason })?,
    }
    output::print_while_read(&bytes)
}

/// Refuses a waveform with more events than fit in memory.
fn check_length(events: u64) -> Result<(), CliError> {
    if events <= MOST_EVENTS {
        return Ok(());
    }
    let right = format!(
        "the records have {events} events, a waveform has at most {MOST_EVENTS}; select fewer with --since, --kind, --bus or --plc"
    );
    Err(CliError::Argument { text: "--format".to_owned(), right })
}

fn fst(waves: &Waves) -> Result<Vec<u8>, CliError> {
    let failed = |error| CliError::Output { reason: std::io::Error::other(error) };
    crate::journal::fst::write(waves).map_err(failed)
}

/// Prints in a text or binary format.
fn print_as<T: Default + AsRef<[u8]>>(
    args: &Args,
    session: &Session,
    selection: Selection,
    format: Box<dyn Format<T>>,
) -> Result<(), CliError> {
    let mut trace = Trace {
        session,
        printer: Printer::new(format, selection, args.from),
        out: LineBuffer { lines: VecDeque::new(), keep: args.last, page: is_paged(args).then(Vec::new) },
        counting: Vec::new(),
        turn: None,
        known_end: 0,
        held: is_ordered(args).then(Vec::new),
        is_folded: args.is_folded(),
    };
    trace.begin()?;
    if !args.follow {
        trace.read()?;
        return trace.end();
    }
    following(|| trace.follow(args.instance.name()))
}

/// True if the user's pager shows the output.
fn is_paged(args: &Args) -> bool {
    let is_text =
        matches!(args.format, FormatArg::Text | FormatArg::Jsonl | FormatArg::Csv | FormatArg::Candump);
    is_text && !args.follow && std::io::stdout().is_terminal()
}

/// True if the lines are printed in the order of their times. A record of repetitions gets its number when the
/// repetitions end. In the order of numbers, it would therefore follow events that are later than its first ones.
/// Programs get the records in the order of their numbers.
fn is_ordered(args: &Args) -> bool {
    args.format == FormatArg::Text && !args.follow
}

struct Trace<'a, T> {
    session: &'a Session,
    printer: Printer<T>,
    out: LineBuffer<T>,
    /// Records with a count that could still grow at the last poll.
    counting: Vec<Record>,
    /// The history that was read last.
    turn: Option<u16>,
    /// The number that the next record had when the emulator was asked last.
    known_end: u64,
    /// The records that were read so far; they are printed at the end in another order. `None` if records are printed
    /// as they are read. The number beside a record counts the missing records before it; a record without a number is
    /// not printed, because the user did not select it.
    held: Option<Vec<(Record, Option<u64>)>>,
    is_folded: bool,
}

impl<T: Default + AsRef<[u8]>> Trace<'_, T> {
    /// Prints the header of the format.
    fn begin(&mut self) -> Result<(), CliError> {
        let mut head = T::default();
        self.printer.begin(&mut head);
        if head.as_ref().is_empty() { Ok(()) } else { self.out.print(head.as_ref()) }
    }

    /// Prints new records until the end.
    fn follow(mut self, instance: &str) -> Result<(), CliError> {
        let mut pause = Pause::new()?;
        loop {
            match PollResult::of(self.read(), instance, "records")? {
                PollResult::Answered(records) => {
                    if records == 0 {
                        self.release_folded();
                    }
                    self.out.release()?;
                }
                PollResult::Later => {}
                PollResult::Ended => return self.end(),
                PollResult::CutOff => {
                    self.note_missing_end();
                    return self.end();
                }
            }
            match pause.wait()? {
                PauseEnd::Time => {}
                PauseEnd::Signal => {
                    self.end()?;
                    return Err(CliError::Ended(Exit::Interrupted.code()));
                }
                PauseEnd::OutputClosed => return Err(CliError::BrokenPipe),
            }
        }
    }

    /// Prints how many records the emulator had at least, when it was asked last, after the last record that was read.
    fn note_missing_end(&mut self) {
        let mut line = T::default();
        let untold = self.printer.miss(self.known_end, &mut line);
        if untold > 0 {
            output::note(&format!("{} lost at the end", plural(untold, "record")));
        }
        self.out.push(line);
    }

    /// Reads up to the end of the journal and prints it. Returns the number of records.
    fn read(&mut self) -> Result<usize, CliError> {
        let mut count = 0;
        loop {
            let from = self.printer.next();
            let reply = self.session.ask(Op::Journal { from, max: MAX_RECORDS })?;
            let part = reply.journal_part()?;
            let turn = part.turn;
            self.known_end = part.end;
            self.counting.clear();
            if self.turn.replace(turn.number).is_some_and(|known| known != turn.number) {
                self.out.flush()?;
                if let Some(held) = &mut self.held {
                    held.retain(|(record, _)| record.seq < turn.begin);
                }
                output::note(&format!(
                    "the instance has gone back; another history begins with record {}",
                    turn.begin
                ));
                self.printer.turn_to(turn.begin.min(from));
                continue;
            }
            if let Some(begin) = part.begins_at(from) {
                output::note(&session::continues(begin));
                self.printer.turn_to(begin);
            }
            self.printer.begin_part();
            count += part.records.len();
            part.records.iter().for_each(|record| self.print(record));
            if self.out.keep.is_none() {
                self.out.flush()?;
            }
            if part.is_last() {
                self.counting = part.pending;
                return Ok(count);
            }
            // A part that brings no progress would make this loop endless.
            if part.next() <= from {
                return Err(WrongReply.into());
            }
        }
    }

    fn print(&mut self, record: &Record) {
        let lost = self.printer.admit(record);
        match &mut self.held {
            Some(held) => held.push((record.clone(), lost)),
            None => self.write(record, lost),
        }
    }

    /// Prints a record after `lost` missing ones. With `None`, skips the record, because the user did not select it.
    fn write(&mut self, record: &Record, lost: Option<u64>) {
        let mut line = T::default();
        let untold = self.printer.write(record, lost, &mut line);
        if untold > 0 {
            output::note(&format!(
                "{} lost before {}",
                plural(untold, "record"),
                time::seconds(record.time_us)
            ));
        }
        self.out.push(line);
    }

    /// Prints the traffic that the format has folded so far.
    fn release_folded(&mut self) {
        let mut lines = T::default();
        self.printer.end(&mut lines);
        self.out.push(lines);
    }

    /// Prints the records with a count that could still grow.
    fn end(mut self) -> Result<(), CliError> {
        for record in std::mem::take(&mut self.counting) {
            self.print(&record);
        }
        let mut held = self.held.take().unwrap_or_default();
        // A folded line shows the time of its first event; any other line shows the time of its last event.
        held.sort_by_key(|(record, _)| if self.is_folded { record.first_us() } else { record.time_us });
        held.iter().for_each(|(record, lost)| self.write(record, *lost));
        self.release_folded();
        self.out.flush()?;
        self.out.page.map_or(Ok(()), |text| output::page(&String::from_utf8_lossy(&text)))
    }
}

/// Buffer of output lines.
struct LineBuffer<T> {
    lines: VecDeque<T>,
    /// Number of lines to keep, the last ones; `None` if all lines are printed.
    keep: Option<usize>,
    /// Text for the user's pager, which shows it at the end; `None` if the lines are printed at once.
    page: Option<Vec<u8>>,
}

impl<T: AsRef<[u8]>> LineBuffer<T> {
    fn push(&mut self, line: T) {
        // The format has no line for this record.
        if line.as_ref().is_empty() {
            return;
        }
        self.lines.push_back(line);
        if self.keep.is_some_and(|keep| self.lines.len() > keep) {
            self.lines.pop_front();
        }
    }

    /// Prints the kept lines. From here on every line is printed.
    fn release(&mut self) -> Result<(), CliError> {
        self.keep = None;
        self.flush()
    }

    fn flush(&mut self) -> Result<(), CliError> {
        if self.lines.is_empty() {
            return Ok(());
        }
        let mut bytes = Vec::new();
        self.lines.drain(..).for_each(|line| bytes.extend_from_slice(line.as_ref()));
        self.print(&bytes)
    }

    fn print(&mut self, bytes: &[u8]) -> Result<(), CliError> {
        let Some(page) = &mut self.page else { return output::print_while_read(bytes) };
        page.extend_from_slice(bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test checks the limit alone: a journal with so large a number of events needs hours of emulated time.
    #[test]
    fn a_waveform_with_too_many_events_is_refused() {
        assert!(check_length(MOST_EVENTS).is_ok());
        let refused = check_length(MOST_EVENTS + 1).unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        assert!(
            refused.to_string().contains("20000001 events, a waveform has at most 20000000"),
            "{refused}"
        );
    }
}
