//! Compiles the register map in this directory.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=.");
    let out = std::path::PathBuf::from(std::env::var("OUT_DIR")?).join("gate.rs");
    Ok(std::fs::write(out, commram_layoutc::compile(".".as_ref())?.rust)?)
}
