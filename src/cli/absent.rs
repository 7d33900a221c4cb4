//! Commands that this program could have, but was built without.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// The commands of the feature `studio`.
const VIEWERS: [&str; 3] = ["view", "plot", "shell"];

/// What is told to whom asks for one of them.
pub(super) const TEXT: &str = "this commram was built without viewers (view, plot, shell); those of the packages have them, \
    and so has `cargo build --release --features studio`";

/// Whether a refused command line asks for one of them.
pub(super) fn is_meant(error: &clap::Error) -> bool {
    let named = error.get(ContextKind::InvalidSubcommand);
    error.kind() == ErrorKind::InvalidSubcommand
        && matches!(named, Some(ContextValue::String(name)) if VIEWERS.contains(&name.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn a_viewer_is_not_taken_for_a_slip_of_the_pen() {
        let refused =
            |name: &str| super::super::Cli::command().try_get_matches_from(["commram", name]).unwrap_err();
        assert!(VIEWERS.iter().all(|name| is_meant(&refused(name))));
        assert!(!is_meant(&refused("vieww")));
    }
}
