//! `commram completions`: scripts that make shells ask this program what can follow.

use super::{Cli, error::CliError, output};
use clap::{CommandFactory, ValueEnum};
use clap_complete::CompleteEnv;
use clap_complete::env::{Bash, Elvish, EnvCompleter, Fish, Zsh};

/// Set by the scripts when they ask.
const VARIABLE: &str = "COMMRAM_COMPLETE";

/// Print a script that makes a shell complete commands, options and values.
///
/// The shell asks this program, which knows registers and what their values are called, instances that run, their PLCs and
/// buses, kinds of faults and their fields, and looks for scenarios and plant files.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  source <(commram completions bash)
  source <(commram completions zsh)
  commram completions fish > ~/.config/fish/completions/commram.fish")]
pub(crate) struct Args {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

#[derive(Clone, Copy, ValueEnum)]
enum Shell {
    Bash,
    Elvish,
    Fish,
    Zsh,
}

/// Prints the script.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    output::print(&script(args.shell)?)
}

fn script(shell: Shell) -> Result<String, CliError> {
    let known: &dyn EnvCompleter = match shell {
        Shell::Bash => &Bash,
        Shell::Elvish => &Elvish,
        Shell::Fish => &Fish,
        Shell::Zsh => &Zsh,
    };
    let mut script = Vec::new();
    known
        .write_registration(VARIABLE, "commram", "commram", "commram", &mut script)
        .map_err(|reason| CliError::Output { reason })?;
    let script = String::from_utf8_lossy(&script).into_owned();
    Ok(match shell {
        // No blank behind what goes on: an area, an index.
        Shell::Bash => script.replacen("[=/:]$", "[=/:.[]$", 1),
        Shell::Zsh => script
            .replacen("local -a other=()\n", "local -a other=()\n        local -a begun=()\n", 1)
            .replacen(
                "            else\n                other+=",
                "            elif [[ \"$value\" == *[.=\\[] ]]; then\n                begun+=(\"$completion\")\n            else\n                other+=",
                1,
            )
            .replacen(
                "        [[ -n $other ]]",
                "        [[ -n $begun ]] && _describe -V 'values' begun -S ''\n        [[ -n $other ]]",
                1,
            ),
        Shell::Elvish | Shell::Fish => script,
    })
}

/// Answers a shell that asks, and ends then.
pub(crate) fn answer() {
    CompleteEnv::with_factory(Cli::command).var(VARIABLE).complete();
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is put into the scripts of the library is still where it was looked for.
    #[test]
    fn scripts_leave_no_blank_behind_what_goes_on() {
        assert!(script(Shell::Bash).ok().unwrap().contains("[=/:.[]$"));
        let zsh = script(Shell::Zsh).ok().unwrap();
        for part in ["local -a begun=()", "begun+=(", "_describe -V 'values' begun -S ''"] {
            assert!(zsh.contains(part), "{part}\n{zsh}");
        }
    }
}
