//! `commram watch`: registers as they change.

use super::Instance;
use clap::ValueEnum;

/// Show registers as they change, until the emulator ends or Ctrl-C.
///
/// The registers are looked at every 50 ms of real time, all at one moment of emulated time. What changes in between
/// and back again is not seen; the journal (`commram trace`) knows every handshake, state and frame. A register that
/// has just become live, as the cyclic ones after initialization, is shown if it does not hold its reset value.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram watch
  commram watch node2.w_CPU_CONTROL node2.w_OPTION_STATUS
  commram watch 'node2.a_RD_BMARRAY[1]' --format jsonl
  commram watch node2 --count 1       # until something changes")]
pub(crate) struct Args {
    /// Blocks, arrays or registers; a PLC with a colon alone means all blocks of that PLC [default: everything]
    #[arg(value_name = "BLOCK")]
    blocks: Vec<String>,
    /// End after so many changes
    #[arg(short = 'n', long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Output format
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = FormatArg::Text)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FormatArg {
    /// One line per change, for people
    Text,
    /// One JSON object per line, for programs
    #[value(alias = "json")]
    Jsonl,
}

#[cfg(feature = "channel")]
mod by_channel {
    use super::{Args, FormatArg};
    use crate::cli::change::{self, Change, Held, Known};
    use crate::cli::dump::{self, Blocks, Dump};
    use crate::cli::error::CliError;
    use crate::cli::exit::Exit;
    use crate::cli::output;
    use crate::cli::pause::{Look, Pause, Wake};
    use crate::cli::session::Session;
    use crate::cli::time;
    use serde::Serialize;

    /// A line of JSON.
    #[derive(Serialize)]
    struct Line<'a> {
        /// Emulated time, in microseconds.
        time_us: u64,
        #[serde(flatten)]
        change: &'a Change,
    }

    /// Shows changes until the end.
    pub(crate) fn run(args: &Args) -> Result<(), CliError> {
        dump::check(&args.blocks)?;
        let session = Session::open(&args.instance, 0)?;
        let blocks = Blocks::find(&session, &args.blocks)?;
        let mut pause = Pause::new()?;
        let first = blocks.read(&session)?;
        output::note(&format!(
            "watching {} registers from {} on; Ctrl-C ends",
            first.rows.len(),
            time::seconds(first.time_us)
        ));
        let mut known = Known::new(first.rows.into_iter().map(|row| row.holding.into()));
        let mut left = args.count;
        loop {
            match pause.wait()? {
                Wake::Time => {}
                Wake::Signal => return Err(CliError::Ended { code: Exit::Interrupted.code() }),
                Wake::NobodyReads => return Err(CliError::BrokenPipe),
            }
            let dump = match Look::of(blocks.read(&session), args.instance.name())? {
                Look::Seen(dump) => dump,
                Look::Later => continue,
                Look::Ended => return Ok(()),
            };
            let time_us = dump.time_us;
            let (mut changes, now) = changes(&known, dump);
            known = now;
            if let Some(left) = &mut left {
                changes.truncate(usize::try_from(*left).unwrap_or(usize::MAX));
                *left -= changes.len() as u64;
            }
            print(args.format, time_us, &changes)?;
            if left == Some(0) {
                return Ok(());
            }
        }
    }

    /// What has changed, and what is known now.
    fn changes(known: &Known, dump: Dump) -> (Vec<Change>, Known) {
        let rows = dump.rows.into_iter().map(|row| (row.differs, Held::from(row.holding)));
        let rows: Vec<_> = rows.collect();
        let is_of_interest = |(differs, held): &&(bool, Held)| *differs || known.has(held);
        let changes = known.changed(rows.iter().filter(is_of_interest).map(|(_, held)| held));
        (changes, Known::new(rows.into_iter().map(|(_, held)| held)))
    }

    fn print(format: FormatArg, time_us: u64, changes: &[Change]) -> Result<(), CliError> {
        if changes.is_empty() {
            return Ok(());
        }
        let lines = match format {
            FormatArg::Text => {
                let text = change::text(changes);
                text.lines().map(|line| format!("{}  {line}\n", time::seconds(time_us))).collect()
            }
            FormatArg::Jsonl => {
                let line = |change| serde_json::to_string(&Line { time_us, change }).map(|line| line + "\n");
                let lines = changes.iter().map(line).collect::<Result<String, _>>();
                lines.map_err(|error| CliError::Output { reason: error.into() })?
            }
        };
        output::print(&lines)
    }
}

#[cfg(feature = "channel")]
pub(crate) use by_channel::run;

/// Says that there is no channel.
#[cfg(not(feature = "channel"))]
pub(crate) fn run(args: &Args) -> Result<(), super::error::CliError> {
    super::dump::check(&args.blocks)?;
    Err(super::error::CliError::NoChannel { command: "watch" })
}
