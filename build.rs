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

fn generate() -> Result<(), String> {
    let out_dir = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let compiled =
        commram_layoutc::compile(Path::new("layouts/omega-drive-line-2")).map_err(|e| e.to_string())?;
    write(&out_dir.join("omega_drive_line_2.rs"), compiled.rust)?;
    let parameters = commram_layoutc::parameters::compile(Path::new("layouts/v-regler"), "parameters.toml")
        .map_err(|e| e.to_string())?;
    write(&out_dir.join("v_regler.rs"), parameters)
}

fn write(out: &Path, rust: String) -> Result<(), String> {
    std::fs::write(out, rust).map_err(|e| format!("{}: {e}", out.display()))
}
