//! `commram layout import` on the project's own layout, and programs that do not fit a layout any more.

use crate::common::{Emulator, Outcome, commram, finish, run};
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use std::fs;
use std::path::{Path, PathBuf};

const LAYOUT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/layouts/omega-drive-line-2");

/// As a vendor's library could declare it: other types, another order, fillers, comments, initial values.
const VENDOR: &str = "\
(* BM_TYPES *)
TYPE
    IP_BMARRAY : ARRAY [1..4] OF BYTE;
    ETHERNET_DIAGNOSE_BMSTRUCT :
    STRUCT
        a_IP_ADDRESS : IP_BMARRAY := [192, 168, 1, 1]; (* the address *)
        a_IP_MASK : IP_BMARRAY;
        d_IP_CONFIG : DWORD := 16#0000_0001;
        w_STATUS, w_SPEED, w_DIP_NR : WORD;
        w_RESERVE : WORD;
    END_STRUCT;
END_TYPE
";

/// A checkout with nothing but a layout and a file with declarations.
struct Checkout(tempfile::TempDir);

impl Checkout {
    fn new(declarations: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        for directory in ["omega-drive-line-2", "cansync"] {
            let layout = dir.path().join("layouts").join(directory);
            fs::create_dir_all(&layout).unwrap();
            for (name, text) in files(&Path::new(LAYOUT).with_file_name(directory)) {
                fs::write(layout.join(name), text).unwrap();
            }
        }
        fs::write(dir.path().join("TYPES.st"), declarations).unwrap();
        Self(dir)
    }

    fn layout(&self) -> PathBuf {
        self.0.path().join("layouts/omega-drive-line-2")
    }

    fn import(&self, args: &[&str]) -> Outcome {
        let mut command = commram();
        finish(command.args(["layout", "import", "TYPES.st"]).args(args).current_dir(self.0.path()))
    }
}

fn files(dir: &Path) -> Vec<(String, String)> {
    let mut files: Vec<_> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| (entry.file_name().into_string().unwrap(), fs::read_to_string(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn the_exported_declarations_say_what_the_layout_says() {
    let checkout = Checkout::new(run(&["export", "st"]).ok());
    let before = files(&checkout.layout());
    let check = checkout.import(&["--check"]);
    assert_eq!(
        (check.code, check.out.as_str()),
        (Some(1), "all registers lie as declared\n"),
        "{}",
        check.err
    );
    assert!(check.err.contains("CANsync_MA_CTRL_BMSTRUCT.toml would be changed\n"), "{}", check.err);
    assert!(!check.err.contains("build it again"), "{}", check.err);
    assert_eq!(files(&checkout.layout()), before, "a check changes nothing");

    let import = checkout.import(&[]);
    assert_eq!(
        (import.code, import.out.as_str()),
        (Some(0), "all registers lie as declared\n"),
        "{}",
        import.err
    );
    for ((name, before), (_, after)) in before.iter().zip(files(&checkout.layout())) {
        let marked = after.lines().zip(before.lines()).filter(|(after, before)| after != before);
        let marked: Vec<_> = marked.map(|(after, _)| after).collect();
        assert!(
            marked.iter().all(|line| line.ends_with(" = \"manual: BM_TYPES, TYPES.st\"")),
            "{name}: {marked:?}"
        );
        assert_eq!(before.lines().count(), after.lines().count());
    }
    assert_eq!(checkout.import(&["--check"]).ok(), "all registers lie as declared\n");
}

#[test]
fn a_vendors_declarations_move_registers_and_the_program_no_longer_fits() {
    let checkout = Checkout::new(VENDOR);
    let import = checkout.import(&["--align", "2", "--format", "json"]);
    assert_eq!(import.code, Some(0), "{}", import.err);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&import.out).unwrap();
    let told = |name: &str| rows.iter().find(|row| row["member"] == name).unwrap();
    assert_eq!(
        told("w_SPEED"),
        &serde_json::json!({
            "structure": "ETHERNET_DIAGNOSE_BMSTRUCT", "member": "w_SPEED", "verdict": "moved",
            "before": 2, "after": 14, "remark": "",
        })
    );
    assert_eq!(told("w_RESERVE")["verdict"], "new");
    assert_eq!(rows.iter().filter(|row| row["verdict"] == "undeclared").count(), 5);
    let text = fs::read_to_string(checkout.layout().join("ETHERNET_DIAGNOSE_BMSTRUCT.toml")).unwrap();
    assert!(text.starts_with("# The manual names the structure and its address"), "{text}");
    for line in ["size = 20", "offsets = \"manual: BM_TYPES, TYPES.st\"", "  { offset = 18, padding = 2 },"] {
        assert!(text.lines().any(|other| other == line), "{line}: {text}");
    }
    assert!(text.contains("\n  { offset = 0,  name = \"a_IP_ADDRESS\","), "{text}");

    let built = format!("this commram was built with 16#{LAYOUT_HASH:016X}");
    assert!(import.err.contains(&built), "{}", import.err);
    let layout = checkout.layout().display().to_string();
    let refused = run(&["run", "--layout", &layout, "-i", "never-started"]);
    let refused = refused.fails(2);
    assert!(refused.starts_with(&format!("commram: {layout} has register map 16#")), "{refused}");
    let built = format!("commram {} was built with 16#{LAYOUT_HASH:016X}", env!("CARGO_PKG_VERSION"));
    assert!(refused.contains(&built), "{refused}");
}

#[test]
fn what_cannot_be_taken_over_is_told_and_the_exit_code_says_so() {
    let checkout = Checkout::new(&VENDOR.replace("w_SPEED, ", ""));
    let before = files(&checkout.layout());
    let left = checkout.import(&[]);
    assert_eq!(left.code, Some(1), "{}", left.err);
    for line in [
        "ETHERNET_DIAGNOSE_BMSTRUCT                left        20      20     its file stays as it is",
        "ETHERNET_DIAGNOSE_BMSTRUCT  w_SPEED       missing     2       -",
    ] {
        assert!(left.out.contains(line), "{}", left.out);
    }
    assert_eq!(files(&checkout.layout()), before);

    let broken = Checkout::new(&VENDOR.replace("[1..4]", "[1..N]"));
    assert_eq!(
        broken.import(&[]).fails(2),
        "commram: TYPES.st:3:28: expected a number as array bound, found `N`\n"
    );
    let odd = Checkout::new(&VENDOR.replace("a_IP_MASK :", "b : BYTE; a_IP_MASK :"));
    assert_eq!(
        odd.import(&["--align", "1"]).fails(1),
        "commram: the layout would be refused with these offsets: \
         `d_IP_CONFIG` (DWORD) at offset 9 needs an offset divisible by 4\n"
    );
    let called = checkout.import(&["--called", "nothing"]);
    assert!(
        called.fails(2).contains("write the layout's name, `=` and the declaration's name"),
        "{}",
        called.err
    );
    let nowhere = checkout.import(&["--layout", "nowhere"]);
    assert!(nowhere.fails(2).starts_with("commram: nowhere/device.toml:1:1: cannot read"), "{}", nowhere.err);
}

/// Whoever still maps the image counts on the registers of the old build.
#[test]
fn what_another_build_has_left_is_not_taken_over() {
    let mut emulator = Emulator::stepped();
    emulator.kill();
    let image =
        emulator.files().into_iter().find(|path| path.extension().is_some_and(|plc| plc == "line")).unwrap();
    let mut bytes = fs::read(&image).unwrap();
    bytes[16..24].copy_from_slice(&0x1122_3344_5566_7788_u64.to_le_bytes());
    fs::write(&image, bytes).unwrap();
    let refused = emulator.run("run", &["--clock", "stepped"]);
    let refused = refused.fails(1);
    for part in
        ["register map 16#1122334455667788", &format!("16#{LAYOUT_HASH:016X}"), "commram stop --clean -i"]
    {
        assert!(refused.contains(part), "{refused}");
    }
    emulator.run("stop", &["--clean"]).ok();
    assert_eq!(emulator.files(), Vec::<PathBuf>::new());
}

#[test]
fn layouts_are_judged_as_the_build_would() {
    let checkout = Checkout::new(VENDOR);
    let check =
        |args: &[&str]| finish(commram().args(["layout", "check"]).args(args).current_dir(checkout.0.path()));
    let json = |outcome: &Outcome| serde_json::from_str::<serde_json::Value>(&outcome.out).unwrap();
    let fine = json(&check(&["--format", "json"]));
    assert_eq!(fine[0]["layout"], "layouts/omega-drive-line-2");
    assert_eq!((&fine[0]["verdict"], fine.as_array().unwrap().len()), (&"built in".into(), 1));
    assert_eq!(fine[0]["register_map"], format!("16#{LAYOUT_HASH:016X}"));
    checkout.import(&[]);
    assert_eq!(json(&check(&["layouts/omega-drive-line-2", "--format", "json"]))[0]["verdict"], "other");
    let device = checkout.layout().join("device.toml");
    let text = fs::read_to_string(&device).unwrap();
    fs::write(&device, text.replacen("title", "titel", 1)).unwrap();
    let wrong = check(&[]);
    assert_eq!(wrong.code, Some(2));
    assert!(wrong.out.contains("wrong") && wrong.out.contains("titel"), "{}", wrong.out);
    let nowhere = finish(commram().args(["layout", "check"]).current_dir(checkout.layout()));
    assert!(nowhere.fails(2).contains("go to a checkout of commram"), "{}", nowhere.err);
}
