//! The configuration file `commram.toml`: defaults of a user or a directory for options.

use super::output;
use super::style::ColourMode;
use super::table::Format;
use crate::input_file;
use clap::{Command, ValueEnum};
use serde::Deserialize;
use std::ffi::OsStr;
use std::fs::File;
use std::io::ErrorKind;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Name of the file, in the working directory and in the user's directory for commram.
const NAME: &str = "commram.toml";
/// Environment variable with the path of a file that is read instead of both files. If the variable is empty, no file
/// is read.
pub(crate) const VARIABLE: &str = "COMMRAM_CONFIG";
/// Longest file in bytes.
const LONGEST: u64 = 64 << 10;
/// Maximum number of links to a file, as in Linux.
const LONGEST_WAY: u32 = 40;

/// Default values of options, from the configuration files.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Config {
    /// Instance of commands without `-i`.
    pub(crate) instance: Option<String>,
    /// Output format of tables, for commands with an option for it.
    format: Option<String>,
    /// The mode that decides whether output has colours.
    color: Option<String>,
    /// Plant file of `run`, `with` and `plant check`.
    plant: Option<PathBuf>,
    /// Directories with folders of devices.
    devices: Option<Vec<PathBuf>>,
}

/// The defaults of this process, and the notes about configuration files that were ignored.
static LOADED: OnceLock<(Config, Vec<String>)> = OnceLock::new();

/// Returns the defaults of this process.
pub(crate) fn get() -> &'static Config {
    &load().0
}

/// Notes about configuration files that were ignored because of an error.
pub(crate) fn notes() -> &'static [String] {
    &load().1
}

fn load() -> &'static (Config, Vec<String>) {
    LOADED.get_or_init(|| {
        let mut notes = Vec::new();
        let mut all = Config::default();
        let is_named = std::env::var_os(VARIABLE).is_some();
        let source = if is_named { format!("{VARIABLE}: ") } else { String::new() };
        for path in places() {
            let reason = match read(&path) {
                Ok(Some(config)) => {
                    all = all.or(config);
                    continue;
                }
                Ok(None) if is_named => "the file does not exist".to_owned(),
                Ok(None) => continue,
                Err(reason) => reason,
            };
            let path = output::in_one_line(&path.to_string_lossy());
            notes.push(format!("{source}{path} is ignored: {reason}"));
        }
        (all, notes)
    })
}

/// Returns the files; the first one has the highest precedence.
fn places() -> Vec<PathBuf> {
    match std::env::var_os(VARIABLE) {
        Some(file) if file.is_empty() => Vec::new(),
        Some(file) => vec![file.into()],
        None => {
            let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".config"));
            let user = std::env::var_os("XDG_CONFIG_HOME").map(PathBuf::from).filter(|dir| dir.is_absolute());
            let user = user.or_else(home).map(|dir| dir.join("commram").join(NAME));
            std::iter::once(PathBuf::from(NAME)).chain(user).collect()
        }
    }
}

/// Opens a configuration file. Follows at most `links` links, and only those of this user: the paths in the file count
/// from the directory of the link.
fn open(path: &Path, links: u32) -> std::io::Result<File> {
    use rustix::fs::{FileType, Mode, OFlags, fstat, readlinkat};
    let link = rustix::fs::open(path, OFlags::PATH | OFlags::NOFOLLOW | OFlags::CLOEXEC, Mode::empty())?;
    let found = fstat(&link)?;
    if FileType::from_raw_mode(found.st_mode) != FileType::Symlink {
        // The call must not block: another user could put a pipe into the working directory.
        return input_file::open_no_link(path);
    }
    if found.st_uid != rustix::process::geteuid().as_raw() {
        return Err(std::io::Error::other("it is a link of another user"));
    }
    let Some(links) = links.checked_sub(1) else { return Err(rustix::io::Errno::LOOP.into()) };
    // The target is read from the open link, because another user may exchange the entry of the directory.
    let target = readlinkat(&link, "", Vec::new())?;
    let target = Path::new(OsStr::from_bytes(target.as_bytes()));
    open(&path.parent().unwrap_or(Path::new("")).join(target), links)
}

/// Reads a configuration file. Returns `None` if the file does not exist. A file of another user is refused, because it
/// could name an instance of that user.
fn read(path: &Path) -> Result<Option<Config>, String> {
    let file = match open(path, LONGEST_WAY) {
        Ok(file) => file,
        Err(reason) if matches!(reason.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(None);
        }
        Err(reason) => return Err(reason.to_string()),
    };
    let found = file.metadata().map_err(|reason| reason.to_string())?;
    if !found.is_file() {
        return Err("it is not a file".to_owned());
    }
    if found.uid() != rustix::process::geteuid().as_raw() {
        return Err("it belongs to another user".to_owned());
    }
    let bytes = input_file::read_up_to(LONGEST, file).map_err(|reason| reason.to_string())?;
    let bytes = bytes.ok_or_else(|| format!("it has more than {LONGEST} bytes"))?;
    let text = input_file::text(bytes).map_err(|reason| reason.to_string())?;
    let mut config: Config = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        format!("line {line}: {}", error.message().lines().collect::<Vec<_>>().join(", "))
    })?;
    config.check()?;
    // Paths are relative to the directory of the file.
    let directory = path.parent().unwrap_or(Path::new(""));
    config.plant = config.plant.map(|plant| directory.join(plant));
    let absolute = |devices: PathBuf| std::path::absolute(directory.join(&devices)).unwrap_or(devices);
    config.devices = config.devices.map(|all| all.into_iter().map(absolute).collect());
    Ok(Some(config))
}

impl Config {
    /// Returns these defaults; each missing default is taken from `other`.
    fn or(self, other: Self) -> Self {
        Self {
            instance: self.instance.or(other.instance),
            format: self.format.or(other.format),
            color: self.color.or(other.color),
            plant: self.plant.or(other.plant),
            devices: self.devices.or(other.devices),
        }
    }

    fn check(&self) -> Result<(), String> {
        let names = |values: Vec<String>| values.join(", ");
        if let Some(name) = &self.instance {
            super::instance_name(name).map_err(|error| format!("instance: {error}"))?;
        }
        if let Some(format) = &self.format
            && Format::from_str(format, false).is_err()
        {
            return Err(format!("format = \"{format}\": write one of {}", names(values::<Format>())));
        }
        if let Some(color) = &self.color
            && ColourMode::from_str(color, false).is_err()
        {
            return Err(format!("color = \"{color}\": write one of {}", names(values::<ColourMode>())));
        }
        Ok(())
    }

    /// Returns the directories with folders of devices. They are searched before the usual directories.
    pub(crate) fn devices(&self) -> Vec<PathBuf> {
        self.devices.clone().unwrap_or_default()
    }

    /// Returns the mode that decides whether output has colours.
    pub(crate) fn colour(&self) -> Option<ColourMode> {
        self.color.as_deref().and_then(|color| ColourMode::from_str(color, false).ok())
    }

    /// Replaces the defaults of options and arguments. The environment and the command line still have precedence.
    pub(crate) fn apply(&self, command: Command) -> Command {
        let name = command.get_name().to_owned();
        let command = command.mut_args(|arg| {
            let has_default = !arg.get_default_values().is_empty();
            let takes =
                |value: &str| arg.get_possible_values().iter().any(|known| known.matches(value, false));
            match arg.get_long() {
                Some("instance") if has_default => match &self.instance {
                    Some(instance) => arg.default_value(instance.clone()),
                    None => arg,
                },
                Some("format") if has_default => match &self.format {
                    Some(format) if takes(format) => arg.default_value(format.clone()),
                    _ => arg,
                },
                _ => {
                    let is_plant = arg.is_positional()
                        && matches!(
                            (name.as_str(), arg.get_id().as_str()),
                            ("run" | "with", "plant") | ("check", "file")
                        );
                    match &self.plant {
                        Some(plant) if is_plant => arg.default_value(plant.as_os_str().to_owned()),
                        _ => arg,
                    }
                }
            }
        });
        command.mut_subcommands(|inner| self.apply(inner))
    }
}

/// Returns the values of an option.
fn values<T: ValueEnum>() -> Vec<String> {
    let names = T::value_variants().iter().filter_map(ValueEnum::to_possible_value);
    names.map(|value| value.get_name().to_owned()).collect()
}

impl core::fmt::Display for Config {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Config { instance, format, color, plant, devices } = self;
        let plant = plant.as_ref().map(|plant| plant.display().to_string());
        let devices = devices
            .as_ref()
            .map(|all| all.iter().map(|dir| dir.display().to_string()).collect::<Vec<_>>().join(":"));
        let all = [
            ("instance", instance),
            ("format", format),
            ("color", color),
            ("plant", &plant),
            ("devices", &devices),
        ];
        let given =
            all.into_iter().filter_map(|(name, value)| Some(format!("{name} = {:?}", value.as_ref()?)));
        let given: Vec<_> = given.collect();
        f.write_str(if given.is_empty() { "none" } else { "" })?;
        f.write_str(&given.join(", "))
    }
}
