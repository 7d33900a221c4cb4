//! Colours on a terminal, and its width.

use anstream::stream::RawStream;
use anstream::{AutoStream, ColorChoice};
use anstyle::{AnsiColor, Style};
use clap::ValueEnum;
use std::ffi::OsString;
use std::io;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColourMode {
    /// On a terminal, unless NO_COLOR is set
    Auto,
    /// For all kinds of output
    Always,
    /// Never
    Never,
}

/// Sets the colour mode from the arguments before the arguments are parsed, because an error of the parser may need
/// colours.
pub(crate) fn set(arguments: impl Iterator<Item = OsString>) {
    let mut arguments = arguments.take_while(|argument| argument != "--");
    let mut when = None;
    while let Some(argument) = arguments.next() {
        let Some(argument) = argument.to_str() else { continue };
        let value = match argument.strip_prefix("--color") {
            Some("") => arguments.next().and_then(|value| value.into_string().ok()),
            Some(value) => value.strip_prefix('=').map(str::to_owned),
            None => None,
        };
        when = value.and_then(|value| ColourMode::from_str(&value, false).ok()).or(when);
    }
    match when.or_else(|| super::config::get().colour()) {
        Some(ColourMode::Always) => ColorChoice::Always.write_global(),
        Some(ColourMode::Never) => ColorChoice::Never.write_global(),
        Some(ColourMode::Auto) | None => {}
    }
}

/// True if a stream gets colours.
pub(crate) fn is_on(stream: &impl RawStream) -> bool {
    AutoStream::choice(stream) != ColorChoice::Never
}

/// Returns the prefix of an error message.
pub(crate) fn error(text: &str) -> String {
    paint(AnsiColor::Red.on_default().bold(), text, &io::stderr())
}

/// Returns the heading of a table or a block.
pub(crate) fn head(text: &str) -> String {
    paint(Style::new().bold(), text, &io::stdout())
}

/// Returns the outcome of a test.
pub(crate) fn outcome(text: &str, is_good: bool) -> String {
    let colour = if is_good { AnsiColor::Green } else { AnsiColor::Red };
    paint(colour.on_default(), text, &io::stdout())
}

fn paint(style: Style, text: &str, stream: &impl RawStream) -> String {
    if is_on(stream) && !text.is_empty() { format!("{style}{text}{style:#}") } else { text.to_owned() }
}

/// Returns the width of the terminal in characters; `None` if the output is not a terminal.
pub(crate) fn width() -> Option<usize> {
    let size = rustix::termios::tcgetwinsize(io::stdout()).ok()?;
    Some(usize::from(size.ws_col)).filter(|width| *width > 0)
}
