//! `commram export fmu`: a plant as a unit for other simulators.

use crate::cli::error::CliError;
use crate::cli::output;
use crate::fmi::{LIBRARY, Resources, archive, is_library};
use crate::input_file;
use std::ffi::OsString;
use std::fs;
use std::io::{self, IsTerminal};
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};

/// Maximum length of the shared object in bytes; with debug symbols it has more than 100 MB.
const LONGEST_LIBRARY: u64 = 512 << 20;

/// Writes the archive of a plant.
///
/// # Errors
/// The plant is refused, the shared object is missing or of another version, or the file cannot be written.
pub(super) fn run(
    plant: Option<&Path>,
    registers: &[String],
    library: Option<&Path>,
    to: &Path,
) -> Result<(), CliError> {
    if input_file::is_standard(to) && io::stdout().is_terminal() {
        let right = "a unit is binary; redirect it to a file or a program, for example `>plant.fmu`";
        return Err(CliError::Argument { text: "--output -".to_owned(), right: right.to_owned() });
    }
    let resources = match plant {
        Some(path) => Resources::of_file(path, registers.to_vec()),
        None => Resources::built_in(registers.to_vec()),
    };
    let resources = resources.map_err(|error| CliError::Fmu(Box::new(error.into())))?;
    let named = plant.filter(|path| !input_file::is_standard(path));
    let name = named
        .and_then(Path::file_stem)
        .map_or(if plant.is_some() { "plant" } else { "built-in" }.into(), |stem| stem.to_string_lossy());
    let library = match library {
        Some(path) => read(path)?,
        None => read(&found()?)?,
    };
    let bytes = archive(&resources, &name, &library).map_err(|error| CliError::Fmu(Box::new(error)))?;
    output::write(to, &bytes)
}

/// Finds the shared object. Packages install it in the directory of the program. After `cargo install --path .` it is
/// in the checkout.
fn found() -> Result<PathBuf, CliError> {
    let name = format!("lib{LIBRARY}.so");
    let program = std::env::current_exe().and_then(fs::canonicalize);
    let program = program.map_err(|reason| CliError::Process { reason })?;
    let beside = program.parent().unwrap_or(Path::new("/"));
    let checkout = fs::read_to_string(beside.join("../.crates.toml")).ok().and_then(|text| checkout(&text));
    let mut places = vec![beside.join(&name), beside.join("../lib/commram").join(&name)];
    places.extend(checkout.as_ref().map(|checkout| checkout.join("target/release").join(&name)));
    places.iter().find(|place| place.is_file()).cloned().ok_or_else(|| {
        let looked: Vec<_> =
            places.iter().filter_map(|place| Some(place.parent()?.display().to_string())).collect();
        let of = checkout.map_or_else(String::new, |checkout| format!(" in {}", checkout.display()));
        let right = format!(
            "{name} is in none of {}; `cargo build --release -p commram-fmi`{of} makes it, --library names it",
            looked.join(", "),
        );
        CliError::Argument { text: "fmu".to_owned(), right }
    })
}

/// Returns the directory from which cargo has installed commram: `text` is cargo's list of the installed programs.
fn checkout(text: &str) -> Option<PathBuf> {
    let list: toml::Table = text.parse().ok()?;
    let of_commram = format!("commram {} (path+file://", env!("CARGO_PKG_VERSION"));
    let mut packages = list.get("v1")?.as_table()?.keys();
    let address = packages.find_map(|package| package.strip_prefix(&of_commram)?.strip_suffix(')'))?;
    Some(PathBuf::from(decoded(address)?))
}

/// Returns the path in a file URL.
fn decoded(address: &str) -> Option<OsString> {
    let mut bytes = Vec::new();
    let mut rest = address.as_bytes();
    while let Some((first, others)) = rest.split_first() {
        rest = others;
        match first {
            b'%' => {
                let digits = rest.split_off(..2)?;
                bytes.push(u8::from_str_radix(core::str::from_utf8(digits).ok()?, 16).ok()?);
            }
            byte => bytes.push(*byte),
        }
    }
    Some(OsString::from_vec(bytes))
}

fn read(path: &Path) -> Result<Vec<u8>, CliError> {
    let wrong = |reason: &str| CliError::Argument {
        text: format!("--library {}", path.display()),
        right: reason.to_owned(),
    };
    let bytes =
        input_file::read_regular(path, LONGEST_LIBRARY).map_err(|reason| wrong(&reason.to_string()))?;
    if !is_library(&bytes) {
        let version = env!("CARGO_PKG_VERSION");
        return Err(wrong(&format!("it is not the lib{LIBRARY}.so of this commram, {version}")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checkout_is_in_the_list_of_installed_programs() {
        let version = env!("CARGO_PKG_VERSION");
        let list = format!(
            "[v1]\n\"commram 0.0.1 (path+file:///old)\" = [\"commram\"]\n\"ripgrep 1.0.0 (registry+x)\" = [\"rg\"]\n\
             \"commram {version} (path+file:///home/a%20b/commram)\" = [\"commram\"]\n"
        );
        assert_eq!(checkout(&list), Some(PathBuf::from("/home/a b/commram")));
        for other in ["", "[v1]\n", "[v2]\n", &list.replace(version, "0.0.2"), &list.replace("%20", "%zz")] {
            assert_eq!(checkout(other), None, "{other}");
        }
    }
}
