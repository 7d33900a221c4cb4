//! Compiles the register layouts of `layouts/` into `OUT_DIR`, for `src/layout`.

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
    let out_dir = std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?;
    let compiled =
        commram_layoutc::compile(Path::new("layouts/omega-drive-line-2")).map_err(|e| e.to_string())?;
    let out = PathBuf::from(out_dir).join("omega_drive_line_2.rs");
    std::fs::write(&out, compiled.rust).map_err(|e| format!("{}: {e}", out.display()))
}
