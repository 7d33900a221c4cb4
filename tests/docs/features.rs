//! Dependencies of a soft-PLC that uses only the function blocks.

use crate::common::finish;
use std::process::Command;

/// Limits the crates of a build with only the feature `plc` and commram itself.
#[test]
fn function_blocks_alone_need_few_crates() {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(env!("CARGO_MANIFEST_DIR")).args(["tree", "--locked", "--offline", "--quiet"]);
    cargo.args(["-e", "normal", "--prefix", "none", "--no-default-features", "--features", "plc"]);
    let tree = finish(&mut cargo).ok().to_owned();
    let mut crates: Vec<_> = tree.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    crates.sort_unstable();
    crates.dedup();
    assert!(crates.iter().any(|name| name.starts_with("zerocopy ")), "{crates:#?}");
    assert!(crates.len() <= 20, "{} crates: {crates:#?}", crates.len());
    for heavy in ["clap", "iceoryx2", "rhai", "serde", "toml"] {
        let needs = |name: &&str| name.starts_with(&format!("{heavy} "));
        assert!(!crates.iter().any(needs), "{heavy} in {crates:#?}");
    }
}
