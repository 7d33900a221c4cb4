//! `commram completions`: scripts that make shells complete commands and options.

use super::{Cli, error::CliError, output};
use clap::CommandFactory;
use clap_complete::Shell;

/// Print a script that makes a shell complete commands and options.
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
    let mut command = clap::Command::new("commram").version(env!("CARGO_PKG_VERSION"));
    // Scripts have no notion of what is hidden, so it must not be there at all.
    for known in Cli::command().get_subcommands().filter(|known| !known.is_hide_set()) {
        let about = known.get_about().cloned().unwrap_or_default();
        let visible = known.get_arguments().filter(|arg| !arg.is_hide_set()).cloned();
        command =
            command.subcommand(clap::Command::new(known.get_name().to_owned()).about(about).args(visible));
    }
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "commram", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}
