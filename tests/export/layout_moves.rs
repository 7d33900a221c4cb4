//! One offset in one layout file decides: change it, build, and the register has moved everywhere.
//!
//! The project is copied into cargo's directory for test files and built there. Both stay, so that
//! later runs only have to compile what has changed.

use commram::layout::omega_drive_line_2::{CANsync_MA_CTRL_BMSTRUCT, DEVICE, LAYOUT_HASH};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A program that tells where the copy's register lies, in every way the library can tell it.
const PROBE: &str = r#"//! Tells where `b_CTRL_REG_BC1` lies.
use commram::layout::omega_drive_line_2::{CANsync_MA_CTRL_BMSTRUCT as Master, DEVICE, LAYOUT_HASH};
use zerocopy::FromZeros;

fn main() {
    let named = DEVICE.register("node2.b_CTRL_REG_BC1").unwrap();
    println!("struct {}", core::mem::offset_of!(Master, b_CTRL_REG_BC1));
    println!("descriptor {}", named.register.offset);
    println!("name {}", named.address());
    for offset in [202892, 202895] {
        let at = DEVICE.registers_at(commram::layout::Address::byte(offset), None);
        println!("{offset} {}", at.map_or("nothing".into(), |found| found[0].path()));
    }
    let mut node = Master::new_zeroed();
    node.b_CTRL_REG_BC1.store(0x05);
    let place = zerocopy::IntoBytes::as_mut_bytes(&mut node).iter().position(|byte| *byte == 0x05);
    println!("byte {}", place.unwrap());
    println!("hash {LAYOUT_HASH}");
}
"#;

/// Copies what differs; equal files keep their time stamps, so cargo need not look at them again.
fn write_if_changed(path: &Path, content: &[u8]) {
    if fs::read(path).ok().as_deref() != Some(content) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
}

/// Removes what the project no longer has; only the probe's directory stays.
fn remove_stale(from: &Path, to: &Path) {
    for old in fs::read_dir(to).into_iter().flatten().map(Result::unwrap) {
        if from.join(old.file_name()).exists() || old.file_name() == "bin" {
            continue;
        }
        let removed =
            if old.path().is_dir() { fs::remove_dir_all(old.path()) } else { fs::remove_file(old.path()) };
        removed.unwrap();
    }
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        remove_stale(from, to);
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        let mut content = fs::read(from).unwrap();
        if from.ends_with("layouts/omega-drive-line-2/CANsync_MA_CTRL_BMSTRUCT.toml") {
            content = moved(&String::from_utf8(content).unwrap()).into_bytes();
        }
        write_if_changed(to, &content);
    }
}

/// The layout with `b_CTRL_REG_BC1` behind its padding instead of in front of it.
fn moved(layout: &str) -> String {
    let before = "{ offset = 2892, name = \"b_CTRL_REG_BC1\"";
    let padding = "{ offset = 2893, padding = 3 }";
    assert!(layout.contains(before) && layout.contains(padding), "the layout has changed; adapt this test");
    layout.replace(before, &before.replace("2892", "2895")).replace(padding, "{ offset = 2892, padding = 3 }")
}

/// A copy of the project with the changed layout and the probe.
fn project() -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR"));
    let copied = Path::new(env!("CARGO_TARGET_TMPDIR")).join("layout-moves/project");
    for entry in fs::read_dir(source).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name();
        if name != "target" && !name.to_string_lossy().starts_with('.') {
            copy(&entry.path(), &copied.join(name));
        }
    }
    write_if_changed(&copied.join("src/bin/probe.rs"), PROBE.as_bytes());
    copied
}

#[test]
fn one_offset_in_one_file_moves_the_register_everywhere() {
    let project = project();
    let output = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--offline", "--no-default-features", "--bin", "probe"])
        .current_dir(&project)
        .env("CARGO_TARGET_DIR", project.with_file_name("target"))
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(
        lines[..6],
        [
            "struct 2895",
            "descriptor 2895",
            "name %MB3.202895",
            "202892 nothing",
            "202895 b_CTRL_REG_BC1",
            "byte 2895"
        ]
    );
    let hash: u64 = lines[6].strip_prefix("hash ").unwrap().parse().unwrap();
    assert_ne!(hash, LAYOUT_HASH);

    // This build, with the layout as it is, says otherwise.
    assert_eq!(core::mem::offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRL_REG_BC1), 2892);
    assert_eq!(DEVICE.register("node2.b_CTRL_REG_BC1").unwrap().address().to_string(), "%MB3.202892");
    assert_eq!(DEVICE.layout_hash, LAYOUT_HASH);
}
