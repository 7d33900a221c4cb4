//! commram with an additional device.

fn main() -> Result<std::process::ExitCode, Box<dyn std::error::Error>> {
    commram::devices::register(&commram_invented::GATE)?;
    Ok(commram::cli::main())
}
