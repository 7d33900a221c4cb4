//! Writing to the terminal, or to whatever stands in for it.

use super::error::CliError;
use std::io::{self, Write};

/// Writes `text` to the standard output and flushes it.
///
/// # Errors
/// [`CliError::BrokenPipe`] if nobody reads it any more, [`CliError::Output`] for all else.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    write(text.as_bytes())
}

/// Writes `bytes` to the standard output and flushes it.
///
/// # Errors
/// As [`print()`].
pub(crate) fn write(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|reason| match reason.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        _ => CliError::Output { reason },
    })
}

/// Writes a complaint to the standard error output. If even that fails, nobody is left to be told.
pub(crate) fn complain(text: &str) {
    let _ = writeln!(io::stderr().lock(), "commram: {text}");
}

/// Passes on what another process has said on its standard error output.
pub(crate) fn relay(text: &[u8]) {
    let _ = io::stderr().lock().write_all(text);
}

/// Writes something worth knowing, which is no error, to the standard error output.
pub(crate) fn note(text: &str) {
    complain(&format!("note: {text}"));
}

/// Shows help to somebody who has not asked for it.
pub(crate) fn print_help(text: &str) {
    let _ = write!(io::stderr().lock(), "{text}");
}
