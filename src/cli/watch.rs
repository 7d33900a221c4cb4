//! `commram watch`: registers as they change.

mod follow;

use super::Instance;
use clap::ValueEnum;

/// Show registers as they change, until the emulator ends or Ctrl-C.
///
/// The emulator itself keeps the changes, each time its firmware looks and each time it has written, so that a request and
/// its answer are two changes however quickly they come. Each is shown with its emulated time and who it was: the
/// firmware, a program on the mapped RAM, the channel, a force. Of what a program writes between two looks of the firmware
/// only the last value is seen. The plant goes, and its journal reads, as if nobody watched.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram watch
  commram watch node2.w_CPU_CONTROL node2.w_OPTION_STATUS
  commram watch 'node2.a_RD_BMARRAY[1]' --format jsonl
  commram watch node2 --count 1       # until something changes")]
pub(crate) struct Args {
    /// Blocks, arrays or registers; a PLC with a colon alone means all blocks of that PLC [default: everything]
    #[arg(add = super::complete::blocks(), value_name = "BLOCK")]
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

pub(crate) use follow::run;
