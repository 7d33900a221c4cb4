//! `commram completions`: scripts that make shells complete commands, options and values that are known beforehand.

use super::{Cli, error::CliError, output};
use clap::CommandFactory;
use clap_complete::Shell;

/// Print a script that makes a shell complete commands, options and their values.
///
/// Values are those that this program knows by itself: devices, kinds of faults and of journal records, formats. Names of
/// instances, PLCs and registers are not among them.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  source <(commram completions bash)
  commram completions fish > ~/.config/fish/completions/commram.fish
  commram completions zsh > ~/.zfunc/_commram")]
pub(crate) struct Args {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Prints the script.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let mut command = visible(&Cli::command()).version(env!("CARGO_PKG_VERSION"));
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "commram", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}

/// The command without what is hidden: scripts have no notion of that, so it must not be there at all.
fn visible(known: &clap::Command) -> clap::Command {
    let about = known.get_about().cloned().unwrap_or_default();
    let arguments = known.get_arguments().filter(|arg| !arg.is_hide_set()).cloned();
    let commands = known.get_subcommands().filter(|known| !known.is_hide_set()).map(visible);
    clap::Command::new(known.get_name().to_owned()).about(about).args(arguments).subcommands(commands)
}
