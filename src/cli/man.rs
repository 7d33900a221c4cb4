//! `commram man`: manual pages for `man`.

use super::{error::CliError, parse};
use crate::input_file::is_standard;
use crate::output_file;
use clap::Command;
use std::path::{Path, PathBuf};

/// Write manual pages for `man`, one for each command, into a directory.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram man ~/.local/share/man/man1
  commram man target/man && man target/man/commram-wait.1")]
pub(crate) struct Args {
    /// The directory; it is created if it does not exist
    #[arg(value_name = "DIR")]
    directory: PathBuf,
}

/// Writes a manual page for each command into the directory.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if is_standard(&args.directory) {
        let right = "the pages are many files; give a directory".to_owned();
        return Err(CliError::Argument { text: "-".to_owned(), right });
    }
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |reason| CliError::File { path, reason }
    };
    output_file::create_own_place(&args.directory).map_err(failed(&args.directory))?;
    let mut all = parse::command().disable_help_subcommand(true);
    all.build();
    let mut commands = vec![(all.get_name().to_owned(), all)];
    while let Some((name, command)) = commands.pop() {
        let inner = command.get_subcommands().filter(|inner| !inner.is_hide_set());
        commands.extend(inner.map(|inner| (format!("{name}-{}", inner.get_name()), inner.clone())));
        let path = args.directory.join(format!("{name}.1"));
        let mut page = Vec::new();
        let command = with_usage(command).name(name).version(env!("CARGO_PKG_VERSION"));
        let man = clap_mangen::Man::new(command);
        man.render(&mut page).map_err(failed(&path))?;
        let page = with_tables(&String::from_utf8_lossy(&page));
        output_file::write(&path, page.as_bytes()).map_err(failed(&path))?;
    }
    Ok(())
}

/// Keeps `man` from joining lines of the help that begin with spaces, such as examples and tables.
fn with_tables(page: &str) -> String {
    let mut text = String::with_capacity(page.len());
    let mut is_table = false;
    for line in page.lines() {
        if line.starts_with("  ") != is_table {
            is_table = !is_table;
            text += if is_table { ".nf\n" } else { ".fi\n" };
        }
        text += line;
        text.push('\n');
    }
    text
}

/// Sets the usage line of the help as the synopsis: the generated synopsis does not show repeatable arguments.
fn with_usage(mut command: Command) -> Command {
    let usage = command.render_usage().to_string();
    command.override_usage(usage.strip_prefix("Usage: ").unwrap_or(&usage).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_and_tables_are_not_filled() {
        let page = ".SH EXTRA\nExamples:\n  commram step 2ms\n  commram step 1s\n\nExit code 1.\n";
        let expected =
            ".SH EXTRA\nExamples:\n.nf\n  commram step 2ms\n  commram step 1s\n.fi\n\nExit code 1.\n";
        assert_eq!(with_tables(page), expected);
    }
}
