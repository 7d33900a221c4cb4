//! `commram layout import` on the project's layout, and programs that no longer match a layout.

use crate::common::{Emulator, Outcome, commram, finish, run};
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use std::fs;
use std::path::{Path, PathBuf};

const LAYOUT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/layouts/omega-drive-line-2");

/// Declarations as in a vendor's library: other types, another order, fillers, comments, initial values.
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

/// A checkout with only a layout and a file with declarations.
struct Checkout(tempfile::TempDir);

impl Checkout {
    fn new(declarations: &str) -> Self {
        Self::with(declarations, &["omega-drive-line-2", "cansync"].map(str::to_owned))
    }

    fn with(declarations: &str, directories: &[String]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        for directory in directories {
            let layout = dir.path().join("layouts").join(directory);
            fs::create_dir_all(&layout).unwrap();
            for (name, text) in files(&Path::new(LAYOUT).with_file_name(directory)) {
                fs::write(layout.join(name), text).unwrap();
            }
        }
        fs::write(dir.path().join("TYPES.st"), declarations).unwrap();
        Self(dir)
    }

    /// Returns every layout file with its directory and name.
    fn all_files(&self) -> Vec<(String, String)> {
        let of = |directory: String| {
            let path = self.0.path().join("layouts").join(&directory);
            files(&path).into_iter().map(move |(name, text)| (format!("{directory}/{name}"), text))
        };
        every_layout().into_iter().flat_map(of).collect()
    }

    fn layout(&self) -> PathBuf {
        self.0.path().join("layouts/omega-drive-line-2")
    }

    fn import(&self, args: &[&str]) -> Outcome {
        let mut command = commram();
        finish(command.args(["layout", "import", "TYPES.st"]).args(args).current_dir(self.0.path()))
    }
}

/// Returns the directories of all layouts.
fn every_layout() -> Vec<String> {
    let entries = fs::read_dir(Path::new(LAYOUT).parent().unwrap()).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
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

/// Promise 26: an export of commram is made from the layout, so importing it again does not confirm the layout.
#[test]
fn an_export_of_commram_is_recognized_for_every_device_and_proves_nothing() {
    for device in commram::devices::all().iter().map(|device| device.layout.name) {
        let export = run(&["export", "st", "--device", device]).ok().to_owned();
        let checkout = Checkout::with(&export, &every_layout());
        let before = checkout.all_files();
        for args in [&["--check"][..], &[]] {
            let import = checkout.import(&[args, &["--device", device]].concat());
            assert_eq!(
                (import.code, import.out.as_str()),
                (Some(0), "all registers have the declared offsets\n"),
                "{device}: {}",
                import.err
            );
            assert!(import.err.contains("TYPES.st is an export of commram"), "{device}: {}", import.err);
            assert_eq!(checkout.all_files(), before, "{device}");
        }
    }
    // The test removes the head of the export, as a vendor's tool may do. The export is still recognized, because the
    // names of its fillers contain their offsets.
    for device in ["omega-drive-line-2", "bm4-plc"] {
        let export = run(&["export", "st", "--device", device]).ok().to_owned();
        let lines: Vec<_> = export.lines().filter(|line| !line.starts_with("(*")).collect();
        let checkout = Checkout::with(&lines.join("\n"), &every_layout());
        let before = checkout.all_files();
        let import = checkout.import(&["--device", device]);
        assert!(import.err.contains("TYPES.st is an export of commram"), "{device}: {}", import.err);
        assert_eq!((import.code, checkout.all_files()), (Some(0), before), "{device}");
    }
    // An export with a different declaration is no evidence either.
    let export = run(&["export", "st"]).ok().replacen("w_STATUS : WORD", "w_STATUS : DWORD", 1);
    let checkout = Checkout::new(&export.replace("END_STRUCT", "w_MORE : WORD; END_STRUCT"));
    let before = files(&checkout.layout());
    assert_eq!(checkout.import(&[]).code, Some(1));
    assert_eq!(files(&checkout.layout()), before);
}

#[test]
fn a_vendors_declarations_that_confirm_the_layout_change_its_provenance() {
    let checkout = Checkout::new(&vendors(run(&["export", "st"]).ok()));
    let before = files(&checkout.layout());
    let check = checkout.import(&["--check"]);
    assert_eq!(
        (check.code, check.out.as_str()),
        (Some(1), "all registers have the declared offsets\n"),
        "{}",
        check.err
    );
    assert!(check.err.contains("CANsync_MA_CTRL_BMSTRUCT.toml would be changed\n"), "{}", check.err);
    assert!(!check.err.contains("build it again"), "{}", check.err);
    assert_eq!(files(&checkout.layout()), before, "a check changes nothing");

    let import = checkout.import(&[]);
    assert_eq!(
        (import.code, import.out.as_str()),
        (Some(0), "all registers have the declared offsets\n"),
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
    assert_eq!(checkout.import(&["--check"]).ok(), "all registers have the declared offsets\n");
}

/// A file size limit of one kilobyte simulates a full disk.
#[test]
fn an_import_on_a_full_disk_changes_no_file() {
    let checkout = Checkout::new(&vendors(run(&["export", "st"]).ok()));
    let before = files(&checkout.layout());
    let script = "trap '' XFSZ; ulimit -f 1; exec \"$0\" layout import TYPES.st";
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", script]).arg(commram().get_program()).current_dir(checkout.0.path());
    let outcome = finish(&mut shell);
    assert!(outcome.fails(3).contains("cannot write layouts/"), "{}", outcome.err);
    assert_eq!(files(&checkout.layout()), before);
}

/// 5.02066.01a p. 42, 47, 72: the library of the b maXX PLC has separate structures with the names of the manual.
#[test]
fn the_library_of_the_bmaxx_plc_is_found_by_its_own_names() {
    let device = ["--device", "bm4-plc"];
    let declared = vendors(run(&["export", "st", "--device", "bm4-plc"]).ok());
    let checkout = Checkout::with(&declared.replace("a_RD_BMARRAY :", "a_RD_VALUE :"), &every_layout());
    let before = checkout.all_files();
    let import = checkout.import(&device);
    assert_eq!(
        (import.code, import.out.as_str()),
        (Some(0), "all registers have the declared offsets\n"),
        "{}",
        import.err
    );
    let after = checkout.all_files();
    let changed: Vec<_> = before.iter().zip(&after).filter(|(before, after)| before != after).collect();
    let names: Vec<_> = changed.iter().map(|(_, (name, _))| name.as_str()).collect();
    let own = [
        "CANsync_PLC_INIT_BMSTRUCT",
        "CANsync_PLC_MA_BMSTRUCT",
        "CANsync_PLC_SL_BMSTRUCT",
        "CANsync_PLC_parts",
    ];
    assert_eq!(names, own.map(|name| format!("bm4-plc/{name}.toml")), "the family's are the Omega's too");
    for ((_, before), (name, after)) in &changed {
        let differs = after.lines().zip(before.lines()).filter(|(after, before)| after != before);
        let marked: Vec<_> = differs.map(|(after, _)| after).collect();
        assert_eq!(marked, ["offsets = \"manual: BM_TYPES, TYPES.st\""], "{name}");
    }
    assert_eq!(
        checkout.import(&["--device", "bm4-plc", "--check"]).ok(),
        "all registers have the declared offsets\n"
    );
}

/// If the library has its registers at other offsets, the family's structure moves with them (D-296). The firmware
/// reads this structure.
#[test]
fn true_offsets_of_the_bmaxx_plc_move_the_structure_of_the_family() {
    let checkout = Checkout::with(&with_more_in_the_master(), &every_layout());
    let import = checkout.import(&["--device", "bm4-plc", "--format", "json"]);
    assert_eq!(import.code, Some(0), "{}", import.err);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&import.out).unwrap();
    let row = |name: &str| rows.iter().find(|row| row["member"] == name).unwrap();
    assert_eq!((&row("a_WR_VALUE")["before"], &row("a_WR_VALUE")["after"]), (&52.into(), &60.into()));
    assert!(import.err.contains("cansync/CANsync_MA_CTRL_BMSTRUCT.toml changed"), "{}", import.err);
    let text = |path: &str| fs::read_to_string(checkout.0.path().join("layouts").join(path)).unwrap();
    let family = text("cansync/CANsync_MA_CTRL_BMSTRUCT.toml");
    let offset_of = |name: &str| {
        let line = family.lines().find(|line| line.contains(&format!("name = \"{name}\""))).unwrap();
        let number = line.split("offset = ").nth(1).unwrap().split(',').next().unwrap();
        number.trim().parse::<u32>().unwrap()
    };
    assert_eq!((offset_of("b_CTRLREG_WRC1"), offset_of("a_WR_VALUE")), (12, 60));
    assert!(family.contains("offsets = \"inferred D-02\""), "the Omega's library has not said so");
    assert!(
        text("bm4-plc/CANsync_PLC_MA_BMSTRUCT.toml").contains("offsets = \"manual: BM_TYPES, TYPES.st\"")
    );
    let judged =
        finish(commram().args(["layout", "check", "--format", "json"]).current_dir(checkout.0.path()));
    assert!(!judged.out.contains("\"wrong\""), "{}", judged.out);
}

/// Returns the declarations as a vendor's tool would write them: without the head of our export, and with other names
/// of fillers.
fn vendors(export: &str) -> String {
    let lines = export.lines().filter(|line| !line.starts_with("(* Made by commram "));
    lines.collect::<Vec<_>>().join("\n").replace(" padding_", " padding_0")
}

/// Returns the declarations of a b maXX PLC with eight more bytes before the reference values of the master.
fn with_more_in_the_master() -> String {
    let declared = vendors(run(&["export", "st", "--device", "bm4-plc"]).ok());
    let (head, tail) = declared.split_once("CANsync_PLC_MA_BMSTRUCT : (*").unwrap();
    let moved =
        tail.replacen("        a_WR_VALUE :", "        d_NEW1 : DWORD; d_NEW2 : DWORD; a_WR_VALUE :", 1);
    format!("{head}CANsync_PLC_MA_BMSTRUCT : (*{moved}")
}

/// Promise 26: an import of one library does not move offsets that another library has confirmed. Both devices would
/// keep the provenance of a file that contradicts them.
#[test]
fn confirmed_offsets_of_a_shared_structure_stay_where_they_are() {
    let omega = vendors(run(&["export", "st"]).ok());
    let import = |checkout: &Checkout, text: &str, args: &[&str]| {
        fs::write(checkout.0.path().join("TYPES.st"), text).unwrap();
        checkout.import(args)
    };
    let bm4 = ["--device", "bm4-plc"];
    // Imports the library of the Omega Drive-Line II first.
    let checkout = Checkout::with(&omega, &every_layout());
    assert_eq!(checkout.import(&[]).code, Some(0));
    let before = checkout.all_files();
    let refused = import(&checkout, &with_more_in_the_master(), &bm4);
    assert_eq!(
        refused.fails(1),
        "commram: TYPES.st: `a_WR_VALUE` of `CANsync_MA_CTRL_BMSTRUCT` would move from 52 to 60, but \
         layouts/cansync/CANsync_MA_CTRL_BMSTRUCT.toml has 52 from `BM_TYPES, TYPES.st`, and both devices use the \
         structure; nothing is imported\n"
    );
    assert_eq!(checkout.all_files(), before);
    let confirms = import(&checkout, &vendors(run(&["export", "st", "--device", "bm4-plc"]).ok()), &bm4);
    assert_eq!(confirms.code, Some(0), "{}", confirms.err);
    // The test imports the library of the b maXX PLC before the library of the Omega Drive-Line II. The registers of
    // the Omega Drive-Line II are not confirmed yet, so they move too, and the command reports this.
    let checkout = Checkout::with(&with_more_in_the_master(), &every_layout());
    let moves = checkout.import(&bm4);
    assert_eq!(moves.code, Some(0), "{}", moves.err);
    assert!(moves.err.contains("the registers of omega-drive-line-2 move, too"), "{}", moves.err);
    let before = checkout.all_files();
    let refused = import(&checkout, &omega, &[]);
    assert!(
        refused.fails(1).contains(
            "would move from 60 to 52, but layouts/bm4-plc/CANsync_PLC_MA_BMSTRUCT.toml has 60 from `BM_TYPES, TYPES.st`"
        ),
        "{}",
        refused.err
    );
    assert_eq!(checkout.all_files(), before);
}

/// 5.02066.01a p. 47-71, 76-97: the tables have no block 0 and no single-frame area. A library without room for them
/// is imported as well: parts that only the family has follow the end of the structure (D-741).
#[test]
fn a_library_laid_out_as_the_tables_of_the_bmaxx_plc_is_taken_over() {
    let declared = vendors(run(&["export", "st", "--device", "bm4-plc"]).ok());
    // The master has no number (p. 47-48), but the general registers of all three structures have the same addresses.
    let is_room = |line: &&str| line.trim_start().starts_with("padding_0") && !line.contains(" padding_06 :");
    assert_eq!(declared.lines().filter(|line| line.contains(" padding_06 :")).count(), 1);
    let without: Vec<_> = declared.lines().filter(|line| !is_room(line)).collect();
    assert!(without.len() + 4 < declared.lines().count());
    let checkout = Checkout::with(&without.join("\n"), &every_layout());
    let import = checkout.import(&["--device", "bm4-plc", "--all", "--format", "json"]);
    assert_eq!(import.code, Some(0), "{}", import.err);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&import.out).unwrap();
    let offset_of = |structure: &str, name: &str| {
        let row = rows.iter().find(|row| row["structure"] == structure && row["member"] == name).unwrap();
        row["after"].as_u64().unwrap()
    };
    assert_eq!(offset_of("CANsync_PLC_MA_BMSTRUCT", "b_STEUREG_UPDOWNBLK1"), 3332);
    assert_eq!(offset_of("CANsync_PLC_SL_BMSTRUCT", "b_STEUREG_UPDOWNBLK1"), 2894);
    for (structure, first, last) in
        [("CANsync_MA_CTRL_BMSTRUCT", 3680, 3696), ("CANsync_SL_CTRL_BMSTRUCT", 3226, 3240)]
    {
        let path = checkout.0.path().join("layouts/cansync").join(structure).with_extension("toml");
        let text = fs::read_to_string(path).unwrap();
        for (name, offset) in [("b_STEUREG_UPDOWNBLK0", first), ("a_DATA_UPDOWNBLK0", last)] {
            let line = text.lines().find(|line| line.contains(&format!("name = \"{name}\""))).unwrap();
            assert!(line.contains(&format!("offset = {offset},")), "{structure}: {line}");
        }
    }
    let judged =
        finish(commram().args(["layout", "check", "--format", "json"]).current_dir(checkout.0.path()));
    assert!(!judged.out.contains("\"wrong\""), "{}", judged.out);

    // Without the padding for the number, the addresses of the general registers would differ from those of the
    // firmware, so the import is refused.
    let without: Vec<_> = declared.lines().filter(|line| !line.contains(" padding_0")).collect();
    let checkout = Checkout::with(&without.join("\n"), &every_layout());
    let refused = checkout.import(&["--device", "bm4-plc"]);
    let refused = refused.fails(1);
    assert!(
        refused.contains("`i_SW1_NR` of `CANsync_PLC_GENERAL` would be at offset 8 for `CANsync_PLC_INIT_BMSTRUCT`, but at 6 for")
            && refused.contains("the firmware needs the registers at one address in all of them"),
        "{refused}"
    );
}

/// Decision D-368: the addresses of the CAN-DP/2's image are commram's own, so no file of a vendor confirms them.
#[test]
fn a_device_without_a_library_is_not_confirmed() {
    for device in ["can-dp2", "cr201x", "cs0015"] {
        let declared = vendors(run(&["export", "st", "--device", device]).ok());
        let checkout = Checkout::with(&declared, &every_layout());
        let before = checkout.all_files();
        let refused = checkout.import(&["--device", device]);
        assert!(
            refused
                .fails(1)
                .starts_with(&format!("commram: TYPES.st cannot confirm the offsets of `{device}`")),
            "{}",
            refused.err
        );
        assert_eq!(checkout.all_files(), before, "{device}");
    }
}

#[test]
fn a_vendors_declarations_move_registers_and_the_program_no_longer_fits() {
    let checkout = Checkout::new(VENDOR);
    let import = checkout.import(&["--align", "2", "--format", "json"]);
    assert_eq!(import.code, Some(0), "{}", import.err);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&import.out).unwrap();
    let row_of = |name: &str| rows.iter().find(|row| row["member"] == name).unwrap();
    assert_eq!(
        row_of("w_SPEED"),
        &serde_json::json!({
            "structure": "ETHERNET_DIAGNOSE_BMSTRUCT", "member": "w_SPEED", "verdict": "moved",
            "before": 2, "after": 14, "remark": "",
        })
    );
    assert_eq!(row_of("w_RESERVE")["verdict"], "new");
    assert_eq!(rows.iter().filter(|row| row["verdict"] == "undeclared").count(), 6);
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
fn members_that_cannot_be_imported_are_reported_with_an_exit_code() {
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
        "commram: TYPES.st:3:25: `N` is no constant of the given files; add the file that declares it\n"
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

/// A client that still maps the image uses the registers of the old build.
#[test]
fn files_of_another_build_are_not_taken_over() {
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
