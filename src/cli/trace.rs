//! `commram trace`: the journal of events.

mod csv;
mod follow;

use super::Instance;
use super::error::CliError;
use super::{number, time};
use crate::devices;
use crate::journal::{EventKind, Ring};
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Show the journal: frames, states, handshakes with their latency, missed deadlines.
///
/// All times are emulated time since power-on. The emulator keeps the last 65536 records each of frames, of SYNC
/// edges and register traffic, of missed deadlines, and of all other events. Events that repeat at equal intervals
/// are one record with their number and interval; frames are always single records. A terminal shows frames,
/// telegrams, SYNC edges and the handshakes of a program as one counted line until something else happens; --full,
/// --kind, --last, --from-seq, a file and a pipe have every record. If records are lost, the output shows their
/// number. The formats candump, pcapng, vcd and fst have no place for it, so it is printed on the
/// standard error output.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram trace
  commram trace --last 20 --kind state,handshake,channel_write
  commram trace --follow
  commram trace --full | less
  commram trace --since 1.5s --plc line --format jsonl | jq 'select(.latency_us > 1000)'
  commram trace --format csv >run.csv                        # pandas.read_csv('run.csv')
  commram trace --bus drives --format candump >drives.log    # wireshark drives.log
  commram trace --bus drives --format candump | log2asc drives
  commram trace --format pcapng | wireshark -k -i -
  commram trace --format fst >run.fst                        # gtkwave run.fst

--follow asks the emulator every 50 ms of real time and ends with it, by Ctrl-C, or when its reader closes the output. \
A note says so if the last records before this end may be missing. docs/reference/journal.md describes the formats.")]
pub(crate) struct Args {
    /// Wait for further records and show them as they arrive
    #[arg(short, long)]
    follow: bool,
    /// Output format
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = FormatArg::Text)]
    format: FormatArg,
    /// Only these kinds of records, separated by commas
    #[arg(
        short,
        long,
        value_name = "KIND",
        value_delimiter = ',',
        value_parser = PossibleValuesParser::new(devices::catalogue().kinds.iter().map(|kind| kind.name()))
            .try_map(|name| devices::catalogue().kind(&name).ok_or("no such kind"))
    )]
    kind: Vec<&'static EventKind>,
    /// Only events on this bus; can be given several times
    #[arg(add = super::complete::buses(), long, value_name = "NAME")]
    bus: Vec<String>,
    /// Only events of this PLC and its nodes; can be given several times, with --bus, events of both are shown
    #[arg(add = super::complete::plcs(), long, value_name = "NAME")]
    plc: Vec<String>,
    /// Only at or after this emulated time
    #[arg(long, value_name = "TIME", value_parser = time::parse, default_value = "0s", hide_default_value = true)]
    since: u64,
    /// Only records from this number on (field `seq` of jsonl), to continue an earlier output
    #[arg(long = "from-seq", alias = "from", value_name = "NUMBER", default_value = "0", hide_default_value = true, value_parser = number::any::<u64>())]
    from: u64,
    /// Only the last N existing records; with --follow also 0, to see only new records
    #[arg(short = 'n', long, value_name = "N", value_parser = number::any::<usize>())]
    last: Option<usize>,
    /// Every record; without it a terminal shows cyclic traffic as one counted line until something else happens
    #[arg(long)]
    full: bool,
    #[command(flatten)]
    instance: Instance,
}

impl Args {
    /// True if the output shows a count of cyclic traffic in place of each single record. This is so on a terminal,
    /// unless the user has selected records.
    fn is_folded(&self) -> bool {
        use std::io::IsTerminal;
        let has_choice = !self.kind.is_empty() || self.last.is_some() || self.from != 0;
        !self.full && !has_choice && std::io::stdout().is_terminal()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FormatArg {
    /// One line per record, for people
    Text,
    /// One JSON object per line, for programs
    #[value(alias = "json")]
    Jsonl,
    /// Comma-separated values (RFC 4180) with a head line, for spreadsheets and data frames
    Csv,
    /// The log format of can-utils (`candump -L`), which Wireshark can read too; only frames
    Candump,
    /// The log format of Wireshark, with one interface for each bus; only frames
    Pcapng,
    /// Waveforms for GTKWave, Surfer and the like: registers, SYNC, frames, states; without --follow and --last
    Vcd,
    /// The same waveforms in less space, for GTKWave and Surfer
    Fst,
}

impl FormatArg {
    /// Returns the option as the user writes it.
    fn option(self) -> String {
        let value = self.to_possible_value();
        format!("--format {}", value.as_ref().map_or("", |value| value.get_name()))
    }

    /// True if the format is not text.
    fn is_binary(self) -> bool {
        matches!(self, FormatArg::Pcapng | FormatArg::Fst)
    }

    /// True if the output begins with a list of all its signals, so that the whole journal must be read first.
    fn is_waveform(self) -> bool {
        matches!(self, FormatArg::Vcd | FormatArg::Fst)
    }
}

/// Returns the selected kinds of records that the format supports.
fn kinds(args: &Args) -> Result<Vec<&'static EventKind>, CliError> {
    match args.format {
        FormatArg::Text | FormatArg::Jsonl | FormatArg::Csv | FormatArg::Vcd | FormatArg::Fst => {
            Ok(args.kind.clone())
        }
        FormatArg::Candump | FormatArg::Pcapng => {
            let frames = |kind: &&EventKind| kind.ring() == Ring::Traffic;
            let wanted = |kind: &&EventKind| args.kind.is_empty() || args.kind.contains(kind);
            let kinds: Vec<_> =
                devices::catalogue().kinds.iter().copied().filter(frames).filter(wanted).collect();
            if !kinds.is_empty() {
                return Ok(kinds);
            }
            let right = "this format contains only frames; use text or jsonl for other records".to_owned();
            Err(CliError::Argument { text: args.format.option(), right })
        }
    }
}

/// Prints the journal of the instance.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::session::{Session, number_of_bus};
    use crate::request::{InstanceInfo, Op};
    use std::io::IsTerminal;

    let kinds = kinds(args)?;
    let refused = |right: &str| CliError::Argument { text: args.format.option(), right: right.to_owned() };
    if args.format.is_binary() && std::io::stdout().is_terminal() {
        return Err(refused(
            "this format is binary; redirect it to a file or a program, for example `>run.out`",
        ));
    }
    if args.format.is_waveform() && (args.follow || args.last.is_some()) {
        let right = "waveforms begin with a list of all their signals; omit --follow and --last";
        return Err(refused(right));
    }
    let session = Session::open(&args.instance, 0)?;
    let InstanceInfo { name: instance, names, .. } = session.ask(Op::Info)?.info()?;
    let bus = |name: &String| number_of_bus(&instance, &names.buses, name);
    let selection = crate::journal::Selection {
        kinds,
        buses: args.bus.iter().map(bus).collect::<Result<_, _>>()?,
        plcs: args.plc.iter().map(|name| session.plc(Some(name), name)).collect::<Result<_, _>>()?,
        since_us: args.since,
    };
    follow::print(args, &session, selection, names)
}
