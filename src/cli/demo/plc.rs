//! The soft-PLC of a demonstration: a process that only uses the image of its PLC.

use crate::cli::demo::{processes, show};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::devices;
use crate::memory::AttachMode;

/// The soft-PLC of `commram demo`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram demo-plc default line")]
pub(crate) struct Args {
    /// Name of the instance
    instance: String,
    /// Name of the PLC
    plc: String,
    /// End when the process with this id ends
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

/// Attaches and runs the soft-PLC program of the device.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if let Some(parent) = args.parent {
        processes::end_with(parent)?;
    }
    let (attached, device) = devices::attach(&args.instance, &args.plc, AttachMode::ReadWrite)?;
    let known = devices::of_hash(device.layout_hash);
    let demo =
        known.and_then(|known| known.emulation.demo).ok_or(CliError::NoDemo { device: device.name })?;
    let (pid, image) = (std::process::id(), attached.path().display().to_string());
    output::print(&format!("soft-PLC: process {pid}, attached to {image}\n"))?;
    Ok((demo.program)(attached, &show)?)
}
