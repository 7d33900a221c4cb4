//! The answer of `commram --version`: properties of this build, and its register maps.

use crate::devices;
use crate::memory::header::ABI_VERSION;
use std::env::consts::{ARCH, OS};

/// Commit of the sources, which `tools/package` sets. A build in a checkout does not use git, because the library would
/// then be compiled again after each commit.
const COMMIT: Option<&str> = option_env!("COMMRAM_COMMIT");

/// Features of the library in this build.
const FEATURES: &[(&str, bool)] = &[
    ("plc", cfg!(feature = "plc")),
    ("emulator", cfg!(feature = "emulator")),
    ("channel", cfg!(feature = "channel")),
    ("script", cfg!(feature = "script")),
    ("export", cfg!(feature = "export")),
    ("cli", cfg!(feature = "cli")),
    ("helics", cfg!(feature = "helics")),
    ("studio", cfg!(feature = "studio")),
    ("web", cfg!(feature = "web")),
    ("lsp", cfg!(feature = "lsp")),
];

/// Returns the text that follows the name of the program.
pub(super) fn long() -> String {
    let features: Vec<_> = FEATURES.iter().filter(|(_, is_on)| *is_on).map(|(name, _)| *name).collect();
    let mut text = format!(
        "{}\ncommit    {}\nbuilt     for {ARCH} {OS}\nfeatures  {}\nABI       {ABI_VERSION}\nlayouts\n",
        env!("CARGO_PKG_VERSION"),
        COMMIT.unwrap_or("unknown, not built by tools/package"),
        features.join(", "),
    );
    for known in devices::all() {
        text += &format!("  {:<20}16#{:016X}\n", known.layout.name, known.layout.layout_hash);
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_feature_of_the_package_is_in_the_list() {
        let manifest: toml::Table = toml::from_str(include_str!("../../Cargo.toml")).unwrap();
        let features = manifest["features"].as_table().unwrap().keys();
        let mut features: Vec<_> = features.map(String::as_str).filter(|name| *name != "default").collect();
        let mut known: Vec<_> = FEATURES.iter().map(|(name, _)| *name).collect();
        features.sort_unstable();
        known.sort_unstable();
        assert_eq!(known, features);
    }
}
