//! The layout files are the only source: an import with another offset and a build move the register everywhere.
//!
//! The project is copied into cargo's directory for test files and built there. Both stay, so that later runs only
//! compile the changes.

use commram::devices::omega_drive_line_2::registers::{CANsync_MA_CTRL_BMSTRUCT, DEVICE, LAYOUT_HASH};
use commram_layoutc::declaration::{Alignment, Declarations};
use commram_layoutc::import::{Import, NamePairs};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A program that prints the location of the copy's register in every way that the library offers.
const PROBE: &str = r#"//! Tells where `b_CTRL_REG_BC1` lies.
use commram::devices::omega_drive_line_2::registers::{CANsync_MA_CTRL_BMSTRUCT as Master, DEVICE, LAYOUT_HASH};
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
    println!("provenance {}", named.register.offset_from);
    let csv = commram::export::export(&DEVICE, commram::export::Format::Csv, Some("node2")).unwrap();
    println!("csv {}", csv.contains("\nnode2.b_CTRL_REG_BC1,%MB3.202895,"));
    let c = commram::export::export(&DEVICE, commram::export::Format::C, Some("node2")).unwrap();
    println!("c {}", c.contains("offsetof(CANsync_MA_CTRL_BMSTRUCT, b_CTRL_REG_BC1) == 2895"));
    println!("hash {LAYOUT_HASH}");
}
"#;

/// Copies files that differ. Equal files keep their time stamps, so that cargo does not rebuild them.
fn write_if_changed(path: &Path, content: &[u8]) {
    if fs::read(path).ok().as_deref() != Some(content) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
}

/// Removes files that the project no longer has; only the probe's directory stays.
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
        write_if_changed(to, &fs::read(from).unwrap());
    }
}

/// Returns the declarations with `b_CTRL_REG_BC1` after its padding instead of before it.
fn moved() -> String {
    let declarations = commram::export::export(
        &DEVICE,
        commram::export::Format::St(commram::export::StForm::default()),
        None,
    )
    .unwrap();
    // An export of commram proves nothing and is not imported, unlike a vendor's library. The first line of the export and
    // the names of its paddings identify it (decision D-742).
    let declarations = declarations.replace("padding_", "spare_");
    let is_own_mark = |line: &&str| line.starts_with("(* Made by commram ");
    let mut lines: Vec<&str> = declarations.lines().filter(|line| !is_own_mark(line)).collect();
    let at = lines.iter().position(|line| line.trim_start().starts_with("b_CTRL_REG_BC1 ")).unwrap();
    assert!(lines[at + 1].contains("BYTE_3_BMARRAY"), "the layout has changed; adapt this test");
    lines.swap(at, at + 1);
    lines.join("\n")
}

/// Creates a copy of all layouts with these declarations.
fn imported() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("layouts"), dir.path());
    let declarations = Declarations::parse(Path::new("BM_TYPES.st"), &moved()).unwrap();
    let import =
        Import::plan(&dir.path().join(DEVICE.name), &declarations, Alignment::Natural, &NamePairs::default())
            .unwrap();
    for (path, text) in import.files() {
        fs::write(path, text).unwrap();
    }
    dir
}

/// Creates a copy of the project with the changed layout and the probe.
fn project() -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR"));
    let copied = Path::new(env!("CARGO_TARGET_TMPDIR")).join("layout-moves/project");
    for entry in fs::read_dir(source).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name();
        if name != "target" && name != "layouts" && !name.to_string_lossy().starts_with('.') {
            copy(&entry.path(), &copied.join(name));
        }
    }
    copy(imported().path(), &copied.join("layouts"));
    write_if_changed(&copied.join("src/bin/probe.rs"), PROBE.as_bytes());
    copied
}

#[test]
fn an_import_moves_the_register_everywhere() {
    let project = project();
    let output = Command::new(env!("CARGO"))
        .args([
            "run",
            "--quiet",
            "--offline",
            "--no-default-features",
            "--features",
            "export",
            "--bin",
            "probe",
        ])
        .current_dir(&project)
        .env("CARGO_TARGET_DIR", project.with_file_name("target"))
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(
        lines[..9],
        [
            "struct 2895",
            "descriptor 2895",
            "name %MB3.202895",
            "202892 nothing",
            "202895 b_CTRL_REG_BC1",
            "byte 2895",
            "provenance manual: BM_TYPES, BM_TYPES.st",
            "csv true",
            "c true",
        ]
    );
    let hash: u64 = lines[9].strip_prefix("hash ").unwrap().parse().unwrap();
    assert_ne!(hash, LAYOUT_HASH);

    // This build, with the unchanged layout, has the original offset.
    assert_eq!(core::mem::offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRL_REG_BC1), 2892);
    assert_eq!(DEVICE.register("node2.b_CTRL_REG_BC1").unwrap().address().to_string(), "%MB3.202892");
    assert_eq!(DEVICE.layout_hash, LAYOUT_HASH);
}
