//! The files of `commram new --template device`: a device in a folder, with a scenario and a program in C.

use super::files::quoted;
use crate::cli::error::CliError;
use crate::cli::plant;
use crate::devices;
use crate::devices::folder;
use crate::script::DEFINITIONS;
use std::path::Path;

/// Files of the project, in which `@device@` is replaced by the name of the device.
const FILES: &[(&str, &str)] = &[
    ("device.toml", include_str!("templates/device/device.toml")),
    ("CARD.toml", include_str!("templates/device/CARD.toml")),
    ("handshakes.toml", include_str!("templates/device/handshakes.toml")),
    ("firmware.rhai", include_str!("templates/device/firmware.rhai")),
    ("tests/start.rhai", include_str!("templates/device/start.rhai")),
    ("client.c", include_str!("templates/device/client.c")),
    ("Makefile", include_str!("templates/device/Makefile")),
];

/// Name of the device if the name of the directory is not a valid name.
const NAME: &str = "card";
/// Longest name of a device in bytes.
const LONGEST_NAME: usize = 40;

/// Returns the paths of the files in the directory, and their texts.
///
/// # Errors
/// The directory has the name of a device of commram.
pub(super) fn files(directory: &Path) -> Result<Vec<(&'static str, String)>, CliError> {
    let name = name_of(directory);
    if devices::find(&name).is_some() {
        let right = format!("'{name}' is a device of commram; give your device another directory");
        return Err(CliError::Argument { text: directory.display().to_string(), right });
    }
    let own = [
        ("plant.toml", plant::with_schema(include_str!("templates/device/plant.toml"))),
        (plant::SCHEMA, plant::schema()),
        (".rhai/definitions/commram.d.rhai", DEFINITIONS.to_owned()),
        (".rhai/definitions/firmware.d.rhai", folder::DEFINITIONS.to_owned()),
    ];
    let rendered = FILES.iter().map(|(path, text)| (*path, text.replace("@device@", &name)));
    Ok(own.into_iter().chain(rendered).collect())
}

/// Returns the next commands for the user, one per line.
pub(super) fn commands(directory: &Path) -> String {
    let to = format!("cd {}", quoted(&directory.display().to_string()));
    [&to, "commram device check ./", "commram device test ./", "make run"]
        .iter()
        .map(|line| format!("  {line}\n"))
        .collect()
}

/// Returns the name of the device: the name of the directory if it is valid, otherwise [`NAME`].
fn name_of(directory: &Path) -> String {
    let name = directory.file_name().and_then(|name| name.to_str()).unwrap_or(NAME).to_ascii_lowercase();
    let is_name = name.len() <= LONGEST_NAME
        && name.starts_with(|letter: char| letter.is_ascii_lowercase())
        && name.chars().all(|letter| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-');
    if is_name { name } else { NAME.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_device_has_the_name_of_its_directory_if_it_can() {
        let names = ["cards/Counter-2", "cards/my card", "..", "7up"].map(|path| name_of(Path::new(path)));
        assert_eq!(names, ["counter-2", "card", "card", "card"]);
        let taken = Path::new("cards").join(devices::default().layout.name);
        assert!(files(&taken).is_err());
    }
}
