//! `commram watch`: changes of registers.

mod follow;

use super::given;
use super::{Instance, number};
use clap::ValueEnum;

/// Show changes of registers, until the emulator ends or Ctrl-C.
///
/// The emulator itself records the changes, each time its firmware polls and each time it has written. A request and
/// its answer are therefore two changes, however quickly they follow each other. Each change is shown with its emulated
/// time and its writer: the firmware, a program on the mapped RAM, the channel, a force. If a program writes several
/// times between two polls of the firmware, only the last value is recorded. Watching does not change the behaviour of
/// the plant or its journal.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram watch
  commram watch node2.w_CPU_CONTROL node2.w_OPTION_STATUS
  commram watch 'node2.a_RD_BMARRAY[1]' --format jsonl
  commram watch node2 --count 1       # until the next change")]
pub(crate) struct Args {
    /// Blocks, arrays or registers; a PLC with a colon alone means all blocks of that PLC [default: everything]
    #[arg(add = super::complete::blocks(), value_name = "BLOCK", value_parser = given::text(given::BLOCK))]
    blocks: Vec<String>,
    /// End after N changes
    #[arg(short_alias = 'n', long, value_name = "N", value_parser = number::positive::<u64>())]
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

pub(crate) use follow::{ChangedRegisters, report, run};
