//! Layouts in a folder of an unknown author. Tests that such a layout has no files outside the folder, no links, and no
//! keys that only code implements.

use super::edited;
use std::fs;
use std::path::Path;

/// Returns the error of the folder, with paths relative to it.
fn error_of(dir: &Path) -> String {
    let Err(error) = commram_layoutc::read_folder(dir) else { panic!("the folder should be refused") };
    error.to_string().replace(&format!("{}/", dir.display()), "")
}

/// Returns the fixture without the ports and tables that only a device in a crate can have.
fn plain() -> tempfile::TempDir {
    let dir =
        edited("device.toml", "structures = [\"INIT\", \"CTRL\"]", "structures = [\"INIT\", \"CTRL\"] ");
    let path = dir.path().join("device.toml");
    let text = fs::read_to_string(&path).unwrap();
    let mut tables = text.split_inclusive('\n').map(str::to_owned).collect::<Vec<_>>();
    let mut is_left_out = false;
    tables.retain(|line| {
        if line.starts_with('[') {
            is_left_out = ["[[port]]", "[[baud_rate]]"].iter().any(|table| line.starts_with(table));
        }
        !is_left_out && !line.starts_with("objects") && !line.starts_with("gsd")
    });
    fs::write(&path, tables.concat()).unwrap();
    dir
}

fn replace(dir: &Path, from: &str, to: &str) {
    let path = dir.join("device.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text.matches(from).count(), 1, "{text}");
    fs::write(&path, text.replace(from, to)).unwrap();
}

#[test]
fn a_folder_reads_like_a_layout() {
    let dir = plain();
    let (folder, layout) =
        (commram_layoutc::read_folder(dir.path()).unwrap(), commram_layoutc::read(dir.path()).unwrap());
    assert_eq!(folder.layout_hash, layout.layout_hash);
    assert_eq!(folder.inputs, layout.inputs);
}

#[test]
fn keys_that_only_code_serves() {
    let dir = plain();
    replace(dir.path(), "title =", "objects = \"objects.toml\"\ntitle =");
    let error = error_of(dir.path());
    assert!(
        error.ends_with("a device in a folder has no `objects`; a device in a crate can have it"),
        "{error}"
    );
}

/// A device in a folder has port 1 at a CAN bus, or port 2 at PROFIBUS, or both, without registers.
#[test]
fn ports_of_a_folder() {
    let with = |ports: &str| {
        let dir = plain();
        replace(dir.path(), "title =", &format!("port = [{ports}]\ntitle ="));
        dir
    };
    let right = "{ name = 'bus', number = 1, medium = 'can', roles = ['peer'] }";
    let master = "{ name = 'dp', number = 2, medium = 'profibus', roles = ['master'] }";
    for (ports, count) in [(right.to_owned(), 1), (master.to_owned(), 1), (format!("{master}, {right}"), 2)] {
        let device = commram_layoutc::read_folder(with(&ports).path()).unwrap().device;
        assert_eq!((device.ports.len(), device.ports[0].area), (count, None));
    }
    for (from, to, error) in [
        ("number = 1", "number = 2", "its number at \"can\" is 1"),
        ("'can'", "'profibus'", "its number at \"profibus\" is 2"),
        ("1, medium = 'can'", "2, medium = 'profibus'", "its roles at \"profibus\" are [\"master\"]"),
        ("'can'", "'cansync'", "its medium is \"can\" or \"profibus\""),
        ("['peer']", "['peer', 'master']", "its roles at \"can\" are [\"peer\"]"),
        (" }", ", area = 'node' }", "it has no `area`, because no register belongs to it"),
    ] {
        let found = error_of(with(&right.replace(from, to)).path());
        let end = format!("the port of a device in a folder: {error}");
        assert!(found.starts_with("device.toml:") && found.ends_with(&end), "{found}");
    }
}

/// Only the code of a device can find out which structure is valid in other cases.
#[test]
fn structures_that_overlay_each_other_in_a_folder() {
    let dir = plain();
    replace(dir.path(), "live = \"cyclic\"", "live = \"init\"");
    assert_eq!(
        error_of(dir.path()),
        "device.toml:19:27: area `node`: `CTRL` and `INIT` are valid in the phase `init`; in a device in a folder, one \
         structure is valid in each phase"
    );
}

#[test]
fn files_outside_of_the_folder() {
    for outside in ["../INIT", "/etc/passwd", "sub/../../INIT"] {
        let dir = plain();
        replace(dir.path(), "[\"INIT\", ", &format!("[\"{outside}\", "));
        let error = error_of(dir.path());
        let message =
            format!("`{outside}.toml` leads out of the folder; all files of a device in a folder lie in it");
        assert!(error.starts_with("device.toml:") && error.ends_with(&message), "{error}");
    }
    let dir = plain();
    replace(dir.path(), "title =", "family = \"cansync\"\ntitle =");
    let error = error_of(dir.path());
    assert!(error.contains("`../cansync/family.toml` leads out of the folder"), "{error}");
}

#[test]
fn links_in_the_folder() {
    let dir = plain();
    let (file, away) = (dir.path().join("INIT.toml"), dir.path().join("AWAY.toml"));
    fs::rename(&file, &away).unwrap();
    std::os::unix::fs::symlink(&away, &file).unwrap();
    let error = error_of(dir.path());
    assert!(
        error.starts_with("device.toml:")
            && error.ends_with("is a link; a device in a folder has its own files"),
        "{error}"
    );
    let top = dir.path().join("device.toml");
    fs::rename(&top, dir.path().join("top.toml")).unwrap();
    std::os::unix::fs::symlink(dir.path().join("top.toml"), &top).unwrap();
    assert!(error_of(dir.path()).starts_with("device.toml:1:1: "));
}
