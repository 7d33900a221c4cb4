//! Compiles the register layouts and parameter tables of `layouts/` into `OUT_DIR`, for `src/devices`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    println!("cargo::rerun-if-changed=layouts");
    match generate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            println!("cargo::error={message}");
            ExitCode::FAILURE
        }
    }
}

/// Compiles each directory below `layouts/`. The file in the directory decides how it is compiled. The result is a file
/// with the name of the directory, with `_` for `-`.
fn generate() -> Result<(), String> {
    let out_dir = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let mut directories = Vec::new();
    for entry in std::fs::read_dir("layouts").map_err(|e| format!("layouts: {e}"))? {
        directories.push(entry.map_err(|e| format!("layouts: {e}"))?.path());
    }
    directories.sort();
    for directory in directories {
        let name =
            directory.file_name().and_then(|name| name.to_str()).ok_or("a directory with another name")?;
        let rust = if directory.join("device.toml").exists() {
            commram_layoutc::compile(&directory).map(|compiled| compiled.rust)
        } else if directory.join("family.toml").exists() {
            commram_layoutc::compile_family(&directory)
        } else {
            commram_layoutc::parameters::compile(&directory, "parameters.toml")
        };
        let out = out_dir.join(format!("{}.rs", name.replace('-', "_")));
        write(&out, rust.map_err(|e| e.to_string())?)?;
    }
    Ok(())
}

fn write(out: &Path, rust: String) -> Result<(), String> {
    std::fs::write(out, rust).map_err(|e| format!("{}: {e}", out.display()))
}
