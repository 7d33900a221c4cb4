//! `commram snapshot` and `commram restore`: save the state of an instance to a file, and return to it.

use super::Instance;
use super::error::CliError;
use crate::input_file;
use crate::plant::SnapshotFile;
use std::io;
use std::path::{Path, PathBuf};

/// Save the state of a stepped instance to a file.
///
/// The file contains the whole emulated plant: registers, firmware, buses, drives, faults, forces, findings and the
/// clock. It does not contain the records of the journal or processes outside. `commram restore` returns to this
/// state, `commram run --from` starts with it.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram snapshot before.snap
  commram snapshot -i test-1 active.snap")]
pub(crate) struct Args {
    /// The file; an existing file is replaced
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    instance: Instance,
}

/// Return to the state in a file written by `commram snapshot`.
///
/// The instance must have the same plant. Its journal continues from that state. The command is refused while a task in
/// lockstep, a program that has mapped the registers or a guest at a door takes part, because these cannot go back.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram restore before.snap
  commram restore before.snap --ignore-programs")]
pub(crate) struct RestoreArgs {
    /// The file
    #[arg(add = super::complete::files(&["snap"]), value_name = "FILE")]
    file: PathBuf,
    /// Return to the state even if programs outside the emulator take part
    #[arg(long = "ignore-programs", alias = "detached")]
    detached: bool,
    #[command(flatten)]
    instance: Instance,
}

/// Reads a snapshot.
///
/// # Errors
/// The file cannot be read, or is not a snapshot.
pub(crate) fn load(path: &Path) -> Result<SnapshotFile, CliError> {
    let failed = |reason: io::Error| CliError::Snapshot { path: path.to_owned(), reason: reason.to_string() };
    let bytes = input_file::read_bytes(path, SnapshotFile::LONGEST).map_err(failed)?;
    SnapshotFile::of_bytes(&bytes)
        .map_err(|error| CliError::Snapshot { path: path.to_owned(), reason: error.to_string() })
}

/// Writes a snapshot of the instance to a file.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::session::Session;
    use super::{output, time};

    let is_standard = input_file::is_standard(&args.file);
    if !is_standard && std::fs::metadata(&args.file).is_ok_and(|found| !found.is_file()) {
        let reason = "it is a directory, a device or a pipe; name a regular file".to_owned();
        return Err(CliError::Snapshot { path: args.file.clone(), reason });
    }
    let session = Session::open(&args.instance, 0)?;
    let bytes = take(&session)?;
    if bytes.len() as u64 > SnapshotFile::LONGEST {
        let text = format!(
            "the snapshot has {} bytes; `restore` reads at most {}",
            bytes.len(),
            SnapshotFile::LONGEST
        );
        let reason = std::io::Error::new(std::io::ErrorKind::FileTooLarge, text);
        return Err(CliError::File { path: args.file.clone(), reason });
    }
    output::write(&args.file, &bytes)?;
    let time_us = SnapshotFile::of_bytes(&bytes).map(|file| file.snapshot.time_us()).unwrap_or_default();
    let (file, at) = (args.file.display(), time::seconds(time_us));
    if is_standard {
        return Ok(());
    }
    output::print(&output::harmless(&format!("{file}: the state at {at}, {} bytes\n", bytes.len())))
}

/// Takes a snapshot, as the bytes of a file.
///
/// # Errors
/// The clock is not stepped, or the emulator has ended.
pub(crate) fn take(session: &super::session::Session) -> Result<Vec<u8>, CliError> {
    use crate::request::{MAX_RANGE, Op};

    let number = session.ask(Op::Save)?.value()?;
    let mut bytes = Vec::new();
    loop {
        let part = session.ask(Op::ReadSaved { number, from: bytes.len() as u32 })?.bytes()?;
        bytes.extend_from_slice(&part);
        if part.len() < MAX_RANGE as usize {
            break;
        }
    }
    session.ask(Op::Forget { number })?.written()?;
    Ok(bytes)
}

/// Restores the snapshot of a file in the instance.
pub(crate) fn restore(args: &RestoreArgs) -> Result<(), CliError> {
    use super::session::Session;
    use super::{output, time};
    use crate::request::Op;

    let session = Session::open(&args.instance, 0)?;
    let bytes = load(&args.file)?.to_bytes();
    session.request_in_parts(&Op::bring(&bytes).collect::<Vec<_>>())?;
    let time_us = session.ask(Op::Restore { detached: args.detached })?.time()?;
    output::print(&format!("{}\n", time::seconds(time_us)))
}
