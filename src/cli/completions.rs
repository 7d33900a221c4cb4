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
pub struct Args {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Prints the script.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "commram", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}
