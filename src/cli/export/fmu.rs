//! `commram export fmu`: a plant as a unit for other simulators.

use crate::cli::error::CliError;
use crate::fmi::{LIBRARY, Resources, archive, is_library};
use crate::input_file;
use crate::output_file;
use std::fs;
use std::io::{self, IsTerminal};
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
    output_file::write(to, &bytes).map_err(|reason| CliError::File { path: to.to_owned(), reason })
}

/// Finds the shared object: in the directory of the program, or where packages install it.
fn found() -> Result<PathBuf, CliError> {
    let name = format!("lib{LIBRARY}.so");
    let program = std::env::current_exe().and_then(fs::canonicalize);
    let program = program.map_err(|reason| CliError::Process { reason })?;
    let beside = program.parent().unwrap_or(Path::new("/"));
    let places = [beside.join(&name), beside.join("../lib/commram").join(&name)];
    places.iter().find(|place| place.is_file()).cloned().ok_or_else(|| {
        let right = format!(
            "{name} is neither in {} nor in {}; `cargo build --release -p commram-fmi` makes it, --library names it",
            beside.display(),
            beside.join("../lib/commram").display(),
        );
        CliError::Argument { text: "fmu".to_owned(), right }
    })
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
