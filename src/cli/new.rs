//! `commram new`: a project with a plant, a scenario, files for CI and settings of an editor.

mod device_files;
mod files;
mod words;

use super::demo::Interrupts;
use super::error::CliError;
use super::{output, plant};
use crate::devices::{self, FirstExchange, Registered};
use crate::input_file::is_standard;
use crate::output_file;
use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use files::Project;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Create a project: a plant, a scenario that passes, files for CI and an editor.
///
/// The command prints the files and the next commands. It overwrites no file. With `-` in place of the directory it prints
/// the plant alone.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram new press && cd press && commram test scenarios
  commram new press --template soft-plc-c
  commram new press --device DEVICE --template pytest
  commram new cards/counter --template device
  commram new - --device DEVICE > plant.toml")]
pub(crate) struct Args {
    /// The directory, which is created if it does not exist
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// Type of the device
    #[arg(long, value_name = "DEVICE", value_parser = with_template(), default_value = devices::default().layout.name)]
    device: Device,
    /// Program or test in the project, in addition to the plant and the scenario
    #[arg(long, value_enum, value_name = "TEMPLATE", default_value_t = Template::Minimal)]
    template: Template,
}

/// Content of a project.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Template {
    /// Plant and scenario
    Minimal,
    /// A soft-PLC in C with a Makefile
    SoftPlcC,
    /// A soft-PLC in Rust as a package for Cargo
    SoftPlcRust,
    /// A test for pytest
    Pytest,
    /// A device of your own in a folder, with script, scenario and program in C
    Device,
}

/// A device with a template of a plant.
#[derive(Clone, Copy)]
pub(crate) struct Device {
    known: &'static Registered,
    plant: &'static str,
    exchange: FirstExchange,
}

impl Device {
    fn of(known: &'static Registered) -> Option<Self> {
        let emulation = &known.emulation;
        Some(Device { known, plant: emulation.template?, exchange: emulation.first_exchange? })
    }
}

/// Accepts the names of devices with a template of a plant.
fn with_template() -> impl TypedValueParser<Value = Device> {
    let names = devices::all().iter().filter(|known| Device::of(known).is_some());
    let names = names.map(|known| PossibleValue::new(known.layout.name).help(known.layout.title));
    PossibleValuesParser::new(names).try_map(|name| {
        devices::find(&name).and_then(Device::of).ok_or("no template for a device of this name")
    })
}

/// Creates the project.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if args.template == Template::Device {
        return create_device(args);
    }
    let project = Project::new(args.device, args.template)?;
    if is_standard(&args.directory) {
        if args.template != Template::Minimal {
            let right = "only a plant goes to the standard output; give a directory, or omit --template";
            return Err(CliError::Argument { text: "-".to_owned(), right: right.to_owned() });
        }
        return output::print(&plant::with_schema(args.device.plant));
    }
    write(&args.directory, project.files(), &project.commands(&args.directory))
}

/// Creates the files of a device in a folder.
fn create_device(args: &Args) -> Result<(), CliError> {
    let refused =
        |text: &str, right: &str| Err(CliError::Argument { text: text.to_owned(), right: right.to_owned() });
    if is_standard(&args.directory) {
        return refused("-", "a device has several files; give a directory");
    }
    // A path with other characters is refused by all commands that read the folder.
    let path = std::path::absolute(&args.directory).unwrap_or_else(|_| args.directory.clone());
    if path.to_str().is_none_or(|path| path.chars().any(char::is_control)) {
        let right = "the path of a device's folder is text in UTF-8 without control characters";
        return refused(&args.directory.display().to_string(), right);
    }
    if args.device.known.layout.name != devices::default().layout.name {
        return refused("--device", "the template makes a new type of device; omit --device");
    }
    write(&args.directory, device_files::files(&args.directory)?, &device_files::commands(&args.directory))
}

/// Creates the files, and prints their paths and the next commands.
fn write(directory: &Path, files: Vec<(&'static str, String)>, commands: &str) -> Result<(), CliError> {
    let files: Vec<_> = files.into_iter().map(|(name, text)| (directory.join(name), text)).collect();
    create(directory, &files, &Interrupts::catch()?)?;
    let names: String = files.iter().map(|(path, _)| format!("{}\n", path.display())).collect();
    output::print(&output::harmless(&format!("{names}\nNext:\n{commands}")))
}

/// Creates all files in the directory, or none after an error or an interrupt.
fn create(directory: &Path, files: &[(PathBuf, String)], interrupts: &Interrupts) -> Result<(), CliError> {
    for (path, _) in files {
        for above in path.ancestors().skip(1).take_while(|above| above.starts_with(directory)) {
            output_file::check_own_place(above)
                .map_err(|reason| CliError::File { path: path.clone(), reason })?;
        }
        if path.symlink_metadata().is_ok() {
            return Err(exists(path));
        }
    }
    let mut made = Made::default();
    for (path, text) in files {
        if interrupts.any() {
            return Err(CliError::Interrupted);
        }
        made.file(path, text).map_err(|reason| match reason.kind() {
            ErrorKind::AlreadyExists => exists(path),
            _ => CliError::File { path: path.clone(), reason },
        })?;
    }
    made.paths.clear();
    Ok(())
}

fn exists(path: &Path) -> CliError {
    CliError::Argument {
        text: path.display().to_string(),
        right: "this file exists and is not overwritten; choose another directory".to_owned(),
    }
}

/// Files and directories that this command has created. Dropping this value removes them.
#[derive(Default)]
struct Made {
    paths: Vec<PathBuf>,
}

impl Made {
    /// Creates a file and its missing directories.
    fn file(&mut self, path: &Path, text: &str) -> io::Result<()> {
        let above = path.ancestors().skip(1).take_while(|above| !above.as_os_str().is_empty());
        let missing: Vec<_> = above.take_while(|above| !above.exists()).map(Path::to_owned).collect();
        for directory in missing.into_iter().rev() {
            fs::create_dir(&directory)?;
            self.paths.push(directory);
        }
        output_file::write_new(path, text.as_bytes())?;
        self.paths.push(path.to_owned());
        Ok(())
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        for path in self.paths.iter().rev() {
            // `remove_dir` does not remove a directory into which another program has written.
            let _ = if path.is_dir() { fs::remove_dir(path) } else { fs::remove_file(path) };
        }
    }
}
