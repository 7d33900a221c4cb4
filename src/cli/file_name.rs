//! Names of files on the command line. A line end in a name would make false lines in results, in error messages and in
//! the logs of CI services, so such names are refused.

use super::complete;
use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Arg, Command};
use clap_complete::engine::ArgValueCompleter;
use std::any::TypeId;
use std::path::{Path, PathBuf};

/// Checks the name of a file.
///
/// # Errors
/// The name contains a line end.
pub(crate) fn check(path: &Path) -> Result<(), &'static str> {
    match path.as_os_str().as_encoded_bytes().contains(&b'\n') {
        true => Err("the name of a file must not contain a line end; rename the file"),
        false => Ok(()),
    }
}

/// Makes all arguments of the type [`PathBuf`] refuse names with a line end, and not offer such names as completions.
pub(super) fn restrict(command: Command) -> Command {
    command.mut_args(restrict_argument).mut_subcommands(restrict)
}

fn restrict_argument(arg: Arg) -> Arg {
    if arg.get_value_parser().type_id() != TypeId::of::<PathBuf>() {
        return arg;
    }
    let checked = |path: PathBuf| check(&path).map(|()| path);
    let is_completed = arg.get::<ArgValueCompleter>().is_some();
    let arg = arg.value_parser(PathBufValueParser::new().try_map(checked));
    if is_completed { arg } else { arg.add(complete::any_files()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{advice, parse};
    use clap::error::ErrorKind;
    use std::ffi::OsString;

    /// Calls `found` with each command and the words that lead to it.
    fn for_each_command(command: &Command, words: &[String], found: &mut impl FnMut(&Command, &[String])) {
        found(command, words);
        for inner in command.get_subcommands() {
            for_each_command(inner, &[words, &[inner.get_name().to_owned()]].concat(), found);
        }
    }

    /// Returns words with `value` for the argument, and acceptable values for the positional arguments before it.
    fn words_with(command: &Command, arg: &Arg, value: &str) -> Vec<String> {
        if let Some(long) = arg.get_long() {
            return vec![format!("--{long}={value}")];
        }
        let before = command.get_positionals().take_while(|other| other.get_id() != arg.get_id());
        let known = |arg: &Arg| arg.get_possible_values().first().map(|known| known.get_name().to_owned());
        before.map(|arg| known(arg).unwrap_or_else(|| "x".to_owned())).chain([value.to_owned()]).collect()
    }

    #[test]
    fn no_command_prints_a_line_end_in_the_name_of_a_file() {
        let mut all = parse::command();
        all.build();
        let (mut files, mut wrong) = (0, Vec::new());
        for_each_command(&all, &["commram".to_owned()], &mut |command, words| {
            for arg in command.get_arguments().filter(|arg| arg.get_action().takes_values()) {
                let is_file = arg.get_value_parser().type_id() == TypeId::of::<PathBuf>();
                let line = [words, &words_with(command, arg, "html=a\nb")].concat();
                let error = parse::parse(line.iter().map(OsString::from)).err();
                let text = error.as_ref().map(advice::text).unwrap_or_default();
                let is_refused = error.is_some_and(|error| error.kind() == ErrorKind::ValueValidation)
                    && text.contains("name of a file must not contain a line end")
                    && text.contains("=a\\nb");
                files += usize::from(is_file);
                if text.contains("\nb") || (is_file || arg.get_id() == "report") && !is_refused {
                    wrong.push((line, text));
                }
            }
        });
        assert!(files > 30 && wrong.is_empty(), "{files} {wrong:#?}");
    }

    #[test]
    fn a_name_with_a_line_end_is_not_offered() {
        let directory = tempfile::tempdir().unwrap();
        for name in ["a.h", "a\nb.h", "a\u{202e}.h"] {
            std::fs::write(directory.path().join(name), "").unwrap();
        }
        let begun = directory.path().join("a");
        let words = ["commram", "export", "c", "--output"].map(OsString::from).into_iter();
        let words = words.chain([begun.clone().into_os_string()]).collect();
        let found = clap_complete::engine::complete(&mut parse::command(), words, 4, None).unwrap();
        let found: Vec<_> = found.iter().map(clap_complete::CompletionCandidate::get_value).collect();
        assert_eq!(found, [begun.with_extension("h").as_os_str()]);
    }
}
