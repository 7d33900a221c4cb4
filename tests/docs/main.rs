//! Tests of the documentation's text, commands and examples.

#[path = "../common/mod.rs"]
mod common;

mod architecture;
mod ci;
mod commands;
mod features;
mod heads;
mod journals;
mod pages;
mod programs;
mod promises;
mod public_api;
mod shell;
mod troubleshooting;

use std::path::{Path, PathBuf};

/// Returns all pages below `docs` except the fragments of the changelog, in the order of their paths.
fn pages() -> Vec<PathBuf> {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")];
    let mut pages = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("changelog") {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    pages
}
