//! Reads changes until the end.

use super::{Args, FormatArg};
use crate::cli::change::{self, Change};
use crate::cli::device::NameChecks;
use crate::cli::dump::{self, Blocks};
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::cli::output;
use crate::cli::pause::{Pause, PauseEnd, PollResult, following};
use crate::cli::session::Session;
use crate::cli::table;
use crate::cli::time;
use crate::identity::DeviceIndex;
use crate::journal::{self, Changed};
use crate::layout::{DeviceFit, RegisterPhase, RegisterRef, format_value};
use crate::memory::Width;
use crate::plural::plural;
use crate::request::{MAX_RECORDS, Op};
use serde::Serialize;
use std::collections::HashMap;

/// A change with its texts.
#[derive(Serialize)]
pub(crate) struct ReportedChange {
    /// Emulated time, in microseconds.
    time_us: u64,
    #[serde(flatten)]
    change: Change,
    /// Name of the writer.
    by: &'static str,
}

/// Shows changes until the end.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    following(|| show(args))
}

fn show(args: &Args) -> Result<(), CliError> {
    let checks = NameChecks::new(&args.instance);
    args.blocks.iter().try_for_each(|name| dump::check(&checks, name))?;
    drop(checks);
    let session = Session::open(&args.instance, 0)?;
    let blocks = Blocks::find(&session, &args.blocks)?;
    let mut pause = Pause::new()?;
    let (mut from, mut turn) = blocks.follow(&session)?;
    let stretches = blocks.stretches();
    let first = blocks.read(&session)?;
    let (registers, begin) = (first.rows.len(), time::seconds(first.time_us));
    output::note(&format!("watching {} from {begin} on; Ctrl-C ends", plural(registers as u64, "register")));
    let mut left = args.count;
    loop {
        match pause.wait()? {
            PauseEnd::Time => {}
            PauseEnd::Signal => return Err(CliError::Ended(Exit::Interrupted.code())),
            PauseEnd::OutputClosed => return Err(CliError::BrokenPipe),
        }
        let mut changes = Vec::new();
        let outcome = read(&session, &mut from, &mut turn, &mut changes);
        changes
            .retain_mut(|change| watched(&stretches, &change.what).map(|what| change.what = what).is_some());
        if let Some(left) = &mut left {
            changes.truncate(usize::try_from(*left).unwrap_or(usize::MAX));
            *left -= changes.len() as u64;
        }
        print(args.format, &session, &changes)?;
        if left == Some(0) {
            return Ok(());
        }
        match PollResult::of(outcome, args.instance.name(), "changes")? {
            PollResult::Answered(()) | PollResult::Later => {}
            PollResult::Ended | PollResult::CutOff => return Ok(()),
        }
    }
}

/// Returns the change, or the part of it that concerns a watched register. `None` if it concerns no watched register:
/// the emulator also records registers that other clients watch.
fn watched(stretches: &[(DeviceIndex, u32, u32)], what: &journal::Changed) -> Option<journal::Changed> {
    let of = |&(plc, first, len): &(DeviceIndex, u32, u32)| {
        let has_begin = plc == what.plc && (first..first + len).contains(&what.offset);
        let part = || what.part(plc, first, Width::of_bytes(len)?);
        if has_begin { Some(*what) } else { part() }
    };
    stretches.iter().find_map(of)
}

/// Reads all changes from number `from` on. Sets `from` to the number after the last one. After an error, `all` has the
/// changes that were read before it.
fn read(
    session: &Session,
    from: &mut u64,
    turn: &mut u16,
    all: &mut Vec<journal::Change>,
) -> Result<(), CliError> {
    loop {
        let reply = session.ask(Op::Changes { from: *from, max: MAX_RECORDS })?;
        let (changes, end, now) = reply.turned_changes()?;
        if core::mem::replace(turn, now.number) != now.number {
            output::note("the instance has gone back; differences are shown as changes by the channel");
        }
        if let Some(lost) =
            changes.first().map(|first| first.seq.saturating_sub(*from)).filter(|lost| *lost > 0)
        {
            output::note(&format!("{} lost: the buffer was full", plural(lost, "change")));
        }
        *from = changes.last().map_or(end, |last| last.seq + 1);
        let is_last = changes.is_empty() || *from >= end;
        all.extend(changes);
        if is_last {
            return Ok(());
        }
    }
}

fn print(format: FormatArg, session: &Session, changes: &[journal::Change]) -> Result<(), CliError> {
    if changes.is_empty() {
        return Ok(());
    }
    let mut registers = ChangedRegisters::default();
    let reported: Vec<_> = changes.iter().map(|change| report(session, &mut registers, change)).collect();
    let lines = match format {
        FormatArg::Text => text(&reported),
        FormatArg::Jsonl => reported.iter().map(output::json_line).collect::<Result<String, _>>()?,
    };
    output::print_while_read(lines.as_bytes())
}

/// Formats changes as lines: `0.001000 s  node2.w_OPTION_STATUS  %MW3.200002  16#0001 -> 16#0002  firmware  waiting for
/// ...`
fn text(reported: &[ReportedChange]) -> String {
    let cells = |ReportedChange { change, by, .. }: &ReportedChange| {
        let values = change::values(change);
        let [register, address, meaning] =
            [&change.register, &change.address, &change.meaning].map(Clone::clone);
        vec![register, address, values, (*by).to_owned(), meaning]
    };
    let columns = table::columns(&reported.iter().map(cells).collect::<Vec<_>>());
    let line = |(it, line): (&ReportedChange, &str)| format!("{}  {line}\n", time::seconds(it.time_us));
    reported.iter().zip(columns.lines()).map(line).collect()
}

/// The registers of the changes so far. The search for the register at an address takes long, and programs change the
/// same registers again and again.
#[derive(Default)]
pub(crate) struct ChangedRegisters(HashMap<(DeviceIndex, u32, Width, RegisterPhase), Option<RegisterRef>>);

impl ChangedRegisters {
    fn find(&mut self, fitted: &DeviceFit, what: &Changed) -> Option<RegisterRef> {
        let key = (what.plc, what.offset, what.how.width, what.how.live);
        *self.0.entry(key).or_insert_with(|| change::register(fitted, what))
    }
}

/// Creates the texts of a change. The register has the name that was valid at the time of the change.
pub(crate) fn report(
    session: &Session,
    registers: &mut ChangedRegisters,
    &journal::Change { time_us, what, .. }: &journal::Change,
) -> ReportedChange {
    let fitted = session.fitted(what.plc);
    let address = fitted.device().at(what.how.width, what.offset);
    let register = registers.find(&fitted, &what);
    let (ty, name) = match &register {
        Some(register) => (register.ty(), register.to_string()),
        None => (what.how.width.bits(), address.to_string()),
    };
    let value = |bits| Some(format_value(ty, bits));
    let change = Change {
        plc: session.plcs().get(what.plc.index()).cloned().unwrap_or_default(),
        register: format!("{}{name}", session.prefix(what.plc)),
        address: address.to_string(),
        before: value(what.from),
        after: value(what.to),
        meaning: register.map(|register| register.decode(what.to)).unwrap_or_default(),
    };
    ReportedChange { time_us, change, by: what.how.by.name() }
}
