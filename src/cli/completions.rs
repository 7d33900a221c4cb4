//! `commram completions`: scripts that make shells ask this program for completions.

mod quoting;

use super::{complete, error::CliError, output, parse};
use clap::ValueEnum;
use clap_complete::CompleteEnv;
use clap_complete::env::{Bash, Elvish, EnvCompleter, Fish, Shells, Zsh};
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;

/// Environment variable that the scripts set when they ask for completions.
const VARIABLE: &str = "COMMRAM_COMPLETE";

/// Print a script that makes a shell complete commands, options and values.
///
/// The shell asks this program for completions. The program completes registers and the names of their values, running
/// instances with their PLCs and buses, kinds of faults and their fields, scenarios and plant files.
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

/// Prints the completion script of a shell.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    output::print(&script(args.shell)?)
}

fn script(shell: Shell) -> Result<String, CliError> {
    let known: &dyn EnvCompleter = match shell {
        Shell::Bash => &WholeWords,
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
        // Prevents a blank after a word that can be continued, such as an area or an index.
        Shell::Bash => script
            .replacen("[=/:]$", "[=/:.[]$", 1)
            .replacen(
                // After a separator such as `=`, bash passes the separator as the word to complete. The word to
                // complete is then empty, and the separator must stay in the line. Within quotes, bash passes the
                // word without the quote at its beginning, and quotes the candidates itself if they are names of
                // files.
                "        words[COMP_CWORD]=\"$2\"",
                "        local quote=\"${words[COMP_CWORD]:0:1}\"\n        \
                 [[ $quote == [\\\"\\'] && ( -z $2 || ${words[COMP_CWORD]} != \"$2\"* ) ]] && compopt -o filenames 2> /dev/null || quote=\n        \
                 [[ ${words[COMP_CWORD]} == [=:]* ]] || words[COMP_CWORD]=\"$quote$2\"",
                1,
            )
            // Bash must not expand a candidate as a pattern of file names.
            .replacen(
                "    COMPREPLY=( ",
                "    local globbing=\"$(shopt -po noglob)\"\n    set -f\n    COMPREPLY=( ",
                1,
            )
            .replacen(
                "    if [[ $? != 0 ]]",
                "    local code=$?\n    eval \"$globbing\"\n    if [[ $code != 0 ]]",
                1,
            ),
        Shell::Zsh => script
            // A name may contain colons, for example after a PLC. They have a backslash; the colon before the description
            // has none.
            .replacen(
                "local value=\"${completion%%:*}\"",
                "local colon=$'\\1'\n            local value=\"${${completion//\\\\:/$colon}%%:*}\"\n            \
                 value=\"${value//$colon/\\\\:}\"",
                1,
            )
            .replacen("\"$completion\" == *:*", "\"$completion\" == \"$value:\"*", 1)
            .replacen("${completion#*:}", "${completion#\"$value:\"}", 1)
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

/// The completer for bash. Bash splits words at `=` and `:`, replaces only the part after the separator, and reads the
/// replacement like typed text.
struct WholeWords;

impl EnvCompleter for WholeWords {
    fn name(&self) -> &'static str {
        Bash.name()
    }

    fn is(&self, name: &str) -> bool {
        Bash.is(name)
    }

    fn write_registration(
        &self,
        var: &str,
        name: &str,
        bin: &str,
        completer: &str,
        out: &mut dyn Write,
    ) -> io::Result<()> {
        Bash.write_registration(var, name, bin, completer, out)
    }

    fn write_complete(
        &self,
        command: &mut clap::Command,
        args: Vec<OsString>,
        directory: Option<&Path>,
        out: &mut dyn Write,
    ) -> io::Result<()> {
        let index = std::env::var("_CLAP_COMPLETE_INDEX").ok().and_then(|index| index.parse().ok());
        let index: usize = index.unwrap_or(args.len().saturating_sub(1));
        let mut until = args.get(..=index).unwrap_or(&args).to_vec();
        let mut quote = None;
        if let Some(begun) = until.last_mut()
            && let Some(text) = begun.to_str()
        {
            let (found, text) = quoting::unquoted(text);
            (quote, *begun) = (found, text.into());
        }
        let (words, front) = (complete::whole(&until), complete::front_of_last(&until));
        let (last, front) = (words.len().saturating_sub(1), front.to_string_lossy());
        let separator = std::env::var("_CLAP_IFS").unwrap_or_else(|_| "\n".to_owned());
        let found = clap_complete::engine::complete(command, words, last, directory)?;
        let found = found
            .iter()
            .filter_map(|it| quoting::quoted(it.get_value().to_str()?.strip_prefix(&*front)?, quote));
        write!(out, "{}", found.collect::<Vec<_>>().join(&separator))
    }
}

/// If a shell asks for completions, answers and exits. Otherwise returns.
pub(crate) fn answer() {
    let shells = Shells(&[&WholeWords, &Elvish, &Fish, &Zsh]);
    CompleteEnv::with_factory(parse::command).var(VARIABLE).shells(shells).complete();
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the scripts of the library still contain the texts that are replaced.
    #[test]
    fn scripts_add_no_blank_after_a_word_that_can_be_continued() {
        let bash = script(Shell::Bash).ok().unwrap();
        assert!(bash.contains("set -f\n") && bash.contains("eval \"$globbing\"\n    if [[ $code"), "{bash}");
        assert!(
            bash.contains("[=/:.[]$") && bash.contains("== [=:]* ]] || words[COMP_CWORD]=\"$quote"),
            "{bash}"
        );
        let zsh = script(Shell::Zsh).ok().unwrap();
        for part in [
            "value=\"${value//",
            "== \"$value:\"*",
            "#\"$value:\"}",
            "local -a begun=()",
            "begun+=(",
            "_describe -V 'values' begun -S ''",
        ] {
            assert!(zsh.contains(part), "{part}\n{zsh}");
        }
    }
}
