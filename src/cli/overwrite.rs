//! Refuses an output file that is an input file of the same command, because the output would destroy the input.

use super::error::CliError;
use crate::input_file;
use crate::output_file;
use std::path::Path;

/// Checks that an output file is not an input file, even under another name.
///
/// # Errors
/// The output file is an input file. The standard input and the standard output count as different files.
pub(super) fn refuse_inputs<'a>(
    output: Option<&Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), CliError> {
    let Some(output) = output else { return Ok(()) };
    let is_input = |input: &Path| !input_file::is_standard(input) && output_file::is_same(output, input);
    if !inputs.into_iter().any(is_input) {
        return Ok(());
    }
    let right = "the command reads this file; give the output another name".to_owned();
    Err(CliError::Argument { text: output.display().to_string(), right })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_that_is_an_input_is_refused_by_any_name() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        std::fs::write(at("in"), "").unwrap();
        std::os::unix::fs::symlink("in", at("link")).unwrap();
        let check = |output: &Path| refuse_inputs(Some(output), [at("other").as_path(), &at("in")]).is_ok();
        for name in ["in", "./in", "link", "other"] {
            assert!(!check(&at(name)), "{name}");
        }
        assert!(check(&at("new")) && check(Path::new("/dev/null")));
        assert!(refuse_inputs(None, [at("in").as_path()]).is_ok());
        let standard = Path::new("-");
        assert!(refuse_inputs(Some(standard), [standard]).is_ok());
        assert!(refuse_inputs(Some(Path::new("/dev/null")), [Path::new("/dev/null")]).is_ok());
    }
}
