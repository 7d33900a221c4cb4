//! Compiles the register layouts and parameter tables of `layouts/` into `OUT_DIR`, for `src/devices`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The devices: directories below `layouts/`. Each becomes a file of its name, `-` replaced by `_`.
const DEVICES: [&str; 5] = ["omega-drive-line-2", "bm4-plc", "cs0015", "cr201x", "can-dp2"];

/// Families, with the parts that devices share: directories below `layouts/`, each of which becomes a file of the same name.
const FAMILIES: [&str; 1] = ["cansync"];

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
    for device in DEVICES {
        let compiled =
            commram_layoutc::compile(&Path::new("layouts").join(device)).map_err(|e| e.to_string())?;
        write(&out_dir.join(format!("{}.rs", device.replace('-', "_"))), compiled.rust)?;
    }
    for family in FAMILIES {
        let rust = commram_layoutc::compile_family(&Path::new("layouts").join(family));
        write(&out_dir.join(format!("{family}.rs")), rust.map_err(|e| e.to_string())?)?;
    }
    let parameters = commram_layoutc::parameters::compile(Path::new("layouts/v-regler"), "parameters.toml")
        .map_err(|e| e.to_string())?;
    write(&out_dir.join("v_regler.rs"), parameters)
}

fn write(out: &Path, rust: String) -> Result<(), String> {
    std::fs::write(out, rust).map_err(|e| format!("{}: {e}", out.display()))
}
