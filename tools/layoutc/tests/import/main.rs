//! Declarations imported into a layout: moved registers, reports, refusals, and the resulting files.

use commram_layoutc::declaration::{Alignment, Declarations};
use commram_layoutc::import::{Import, ImportError, NamePairs, Verdict};
use std::fs;
use std::path::Path;

mod files;
mod round_trip;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixture");

/// Declarations that agree with the fixture.
const AS_IT_IS: &str = "
TYPE
    PAIR : STRUCT w_FIRST : WORD; w_SECOND : WORD; END_STRUCT;
    INIT : STRUCT
        w_COMMAND : WORD; w_STATUS : WORD; b_MODE : BYTE; a_TYPE : ARRAY[0..1] OF BYTE;
    END_STRUCT;
    CTRL : STRUCT
        w_COMMAND : WORD; w_STATUS : WORD; b_CONTROL : BYTE; a_FLAGS : ARRAY[1..3] OF BYTE; d_VALUE : DWORD;
        i_TEMPERATURE : INT; padding_1 : ARRAY[0..1] OF BYTE;
        a_PAIRS : ARRAY[0..1] OF PAIR; a_GRID : ARRAY[0..1, 0..1] OF DINT;
    END_STRUCT;
END_TYPE";

/// Declarations of another library. They have other names of types, another case of letters, another order, and
/// registers that the layout does not have.
const OTHER: &str = "
TYPE
    WORDS2 : STRUCT w_SECOND : WORD; w_FIRST : WORD; END_STRUCT;
    PAIRS_BMARRAY : ARRAY[1..2] OF WORDS2;
    ROW : ARRAY[0..1] OF DINT;
    init : STRUCT
        W_STATUS : WORD; w_COMMAND : WORD; a_TYPE : ARRAY[0..1] OF USINT; b_MODE : BYTE;
    END_STRUCT
    ctrl : STRUCT
        w_STATUS : WORD; w_COMMAND : WORD; a_FLAGS : ARRAY[0..2] OF BYTE; b_CONTROL : BYTE;
        i_TEMPERATURE : INT; d_VALUE : DWORD; b_NEW : BYTE;
        a_GRID : ARRAY[0..1] OF ROW; a_PAIRS : PAIRS_BMARRAY;
    END_STRUCT
END_TYPE";

fn fixture() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(FIXTURE).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, dir.path().join(path.file_name().unwrap())).unwrap();
    }
    let device = dir.path().join("device.toml");
    let text = fs::read_to_string(&device).unwrap();
    fs::write(&device, format!("library = \"BM_TYPES\"\n{text}")).unwrap();
    dir
}

fn plan_with(
    dir: &Path,
    text: &str,
    alignment: Alignment,
    called: &[(&str, &str)],
) -> Result<Import, ImportError> {
    let declarations = Declarations::parse(Path::new("lib/TYPES.st"), text).unwrap();
    let called = called.iter().map(|(ours, theirs)| ((*ours).to_owned(), (*theirs).to_owned()));
    Import::plan(dir, &declarations, alignment, &NamePairs::new(called)?)
}

fn plan(dir: &Path, text: &str) -> Result<Import, ImportError> {
    plan_with(dir, text, Alignment::Natural, &[])
}

/// Writes the files of an import.
fn write(import: &Import) {
    import.files().for_each(|(path, text)| fs::write(path, text).unwrap());
}

/// Returns the rows that have a remark, with `-` for missing parts.
fn reported_rows(import: &Import) -> Vec<String> {
    let number = |value: Option<u32>| value.map_or("-".to_owned(), |value| value.to_string());
    let rows = import.rows.iter().filter(|row| row.verdict != Verdict::Same);
    rows.map(|row| {
        let (before, after) = (number(row.before), number(row.after));
        let text =
            format!("{}.{} {} {before} {after} {}", row.structure, row.member, row.verdict, row.remark);
        text.trim_end().to_owned()
    })
    .collect()
}

#[track_caller]
fn refused(text: &str, called: &[(&str, &str)]) -> String {
    plan_with(fixture().path(), text, Alignment::Natural, called).expect_err("refused").to_string()
}

#[test]
fn unchanged_registers_do_not_move_and_are_marked() {
    let dir = fixture();
    let import = plan(dir.path(), AS_IT_IS).unwrap();
    assert_eq!(reported_rows(&import), [""; 0]);
    assert!(import.is_whole());
    assert_eq!(import.hash_before, import.hash_after);
    let files: Vec<_> = import.files().map(|(path, _)| path.file_name().unwrap().to_owned()).collect();
    assert_eq!(files, ["parts.toml", "INIT.toml", "CTRL.toml"], "only the marks");
    write(&import);
    for name in ["parts.toml", "INIT.toml", "CTRL.toml"] {
        let before = fs::read_to_string(Path::new(FIXTURE).join(name)).unwrap();
        let mark = "offsets = \"manual: BM_TYPES, TYPES.st\"";
        assert_eq!(
            fs::read_to_string(dir.path().join(name)).unwrap(),
            before.replace("offsets = \"inferred D-02\"", mark)
        );
    }
    assert!(plan(dir.path(), AS_IT_IS).unwrap().changes_nothing(), "twice is as good as once");
}

#[test]
fn registers_move_by_their_paths_independently_of_type_names() {
    let dir = fixture();
    let import = plan(dir.path(), OTHER).unwrap();
    assert_eq!(
        reported_rows(&import),
        [
            "INIT.w_COMMAND moved 0 2",
            "INIT.w_STATUS moved 2 0",
            "INIT.b_MODE moved 4 6",
            "INIT.a_TYPE moved 5 4 USINT in the declaration, the layout keeps BYTE",
            "CTRL. moved 40 44 size in bytes",
            "CTRL.w_COMMAND moved 0 2",
            "CTRL.w_STATUS moved 2 0",
            "CTRL.b_CONTROL moved 4 7",
            "CTRL.a_FLAGS moved 5 4",
            "CTRL.d_VALUE moved 8 12",
            "CTRL.i_TEMPERATURE moved 12 8",
            "CTRL.a_PAIRS moved 16 36",
            "CTRL.a_PAIRS.w_FIRST moved 16 38",
            "CTRL.a_PAIRS.w_SECOND moved 18 36",
            "CTRL.a_GRID moved 24 20",
            "CTRL.b_NEW new - 16 BYTE; the layout has no register for it",
        ]
    );
    assert_ne!(import.hash_before, import.hash_after);
    write(&import);
    let compiled = commram_layoutc::compile(dir.path()).unwrap();
    assert_eq!(compiled.layout_hash, import.hash_after);
    for (structure, register, offset) in
        [("CTRL", "a_GRID", 20), ("PAIR", "w_FIRST", 2), ("CTRL", "d_VALUE", 12), ("INIT", "w_COMMAND", 2)]
    {
        let assertion = format!("assert!(core::mem::offset_of!({structure}, {register}) == {offset});");
        assert!(compiled.rust.contains(&assertion), "{assertion}");
    }
    assert!(compiled.rust.contains(r#"Provenance::Documented("BM_TYPES, TYPES.st")"#));
    assert!(plan(dir.path(), OTHER).unwrap().changes_nothing());
}

#[test]
fn a_packed_library_with_fillers_of_its_own_is_taken_over() {
    let packed = AS_IT_IS
        .replace("padding_1 : ARRAY[0..1] OF BYTE;", "w_RESERVE : WORD;")
        .replace("a_GRID : ARRAY[0..1, 0..1]", "b : BYTE; c, d, e : BYTE; a_GRID : ARRAY[0..1, 0..1]");
    let dir = fixture();
    let import = plan_with(dir.path(), &packed, Alignment::Packed, &[]).unwrap();
    let reported = reported_rows(&import);
    assert_eq!(reported.len(), 7, "{reported:?}");
    assert_eq!(reported[1], "CTRL.a_GRID moved 24 28");
    assert_eq!(reported[2], "CTRL.w_RESERVE new - 14 WORD; the layout has no register for it");
    write(&import);
    commram_layoutc::compile(dir.path()).unwrap();
}

#[test]
fn an_import_writes_no_layout_that_the_compiler_refuses() {
    let dir = fixture();
    let odd = AS_IT_IS.replace("a_GRID :", "w_MORE : WORD; a_GRID :");
    let packed = plan_with(dir.path(), &odd, Alignment::Packed, &[]).expect_err("misaligned").to_string();
    assert_eq!(
        packed,
        "the layout would be refused with these offsets: \
         `a_GRID` (DINT) at offset 26 needs an offset divisible by 4"
    );
    let long = AS_IT_IS.replace("d_VALUE : DWORD;", "d_VALUE : DWORD; more : ARRAY[0..6] OF DWORD;");
    assert_eq!(
        refused(&long, &[]),
        "the layout would be refused with these offsets: `CTRL` has 68 bytes, but `node` ends after 64"
    );
}

#[test]
fn a_structure_with_a_missing_or_different_register_stays_unchanged() {
    let dir = fixture();
    let text = AS_IT_IS
        .replace("d_VALUE : DWORD;", "d_WERT : DWORD;")
        .replace("padding_1 : ARRAY[0..1] OF BYTE;", "")
        .replace("[1..3] OF BYTE", "[1..3] OF WORD")
        .replace("w_SECOND : WORD; END", "w_SECOND : DWORD; END")
        .replace(
            "b_MODE : BYTE; a_TYPE : ARRAY[0..1] OF BYTE;",
            "a_TYPE : ARRAY[0..1] OF BYTE; b_MODE : BYTE;",
        );
    let import = plan(dir.path(), &text).unwrap();
    assert!(!import.is_whole() && !import.changes_nothing());
    assert_eq!(
        reported_rows(&import),
        [
            "INIT.b_MODE moved 4 6",
            "INIT.a_TYPE moved 5 4",
            "CTRL. left 40 52 its file stays as it is",
            "CTRL.a_FLAGS unlike 5 6 3 x WORD in the declaration, 3 x BYTE in the layout",
            "CTRL.d_VALUE missing 8 -",
            "CTRL.i_TEMPERATURE moved 12 16",
            "CTRL.a_PAIRS moved 16 20",
            "CTRL.a_PAIRS.w_SECOND unlike 18 24 DWORD in the declaration, WORD in the layout",
            "CTRL.a_GRID moved 24 36",
            "CTRL.d_WERT new - 12 DWORD; the layout has no register for it",
        ]
    );
    write(&import);
    let same = |name: &str| {
        fs::read(dir.path().join(name)).unwrap() == fs::read(Path::new(FIXTURE).join(name)).unwrap()
    };
    assert!(same("CTRL.toml") && !same("INIT.toml"));
}

#[test]
fn other_names_can_be_given() {
    let text = AS_IT_IS
        .replace("INIT : STRUCT", "INIT_T : STRUCT")
        .replace("w_SECOND", "w_ZWEITES")
        .replace("i_TEMPERATURE : INT;", "inner : STRUCT b_FILL, c_FILL : BYTE; i_TEMP : INT; END_STRUCT;")
        .replace("padding_1 : ARRAY[0..1] OF BYTE;", "");
    let called =
        [("INIT", "INIT_T"), ("CTRL.i_TEMPERATURE", "inner.i_TEMP"), ("CTRL.a_PAIRS.w_SECOND", "w_ZWEITES")];
    let import = plan_with(fixture().path(), &text, Alignment::Natural, &called).unwrap();
    assert_eq!(
        reported_rows(&import),
        [
            "CTRL.i_TEMPERATURE moved 12 14 there inner.i_TEMP",
            "CTRL.inner.b_FILL new - 12 BYTE; the layout has no register for it",
            "CTRL.inner.c_FILL new - 13 BYTE; the layout has no register for it",
        ]
    );
    let wrong = "write the layout's STRUCTURE or STRUCTURE.REGISTER on the left";
    for ours in ["NONE", "CTRL.none", "CTRL.d_VALUE.x", "CTRL.a_PAIRS.none", "PAIR"] {
        assert_eq!(refused(AS_IT_IS, &[(ours, "x")]), format!("`{ours}=x`: {wrong}"));
    }
    let import =
        plan_with(fixture().path(), AS_IT_IS, Alignment::Natural, &[("CTRL.d_VALUE", "d_X")]).unwrap();
    assert!(reported_rows(&import).contains(&"CTRL.d_VALUE missing 8 - nor is there a d_X".to_owned()));
}

#[test]
fn shared_parts_must_have_equal_offsets_in_all_structures() {
    let swapped = "INIT : STRUCT\n        w_STATUS : WORD; w_COMMAND : WORD;";
    let text = AS_IT_IS.replace("INIT : STRUCT\n        w_COMMAND : WORD; w_STATUS : WORD;", swapped);
    assert_eq!(
        refused(&text, &[]),
        "`w_COMMAND` of `GENERAL` would be at offset 2 for `INIT`, but at 0 for `CTRL`, and the layout has \
         `GENERAL` once for both: these structures overlay each other, and the firmware needs the registers at one address \
         in all of them"
    );
    // The structure `CTRL` is not declared, so its offsets must stay unchanged.
    let alone = text.replace("CTRL : STRUCT", "OTHER : STRUCT");
    assert_eq!(
        refused(&alone, &[]),
        "`w_COMMAND` of `GENERAL` would be at offset 2 for `INIT`, but at 0 for `CTRL`, which stays as it is, \
         and the layout has `GENERAL` once for both: these structures overlay each other, and the firmware needs \
         the registers at one address in all of them"
    );
}

/// Promise 26: a tool of the vendor may drop the comment at the head of an export of commram. The export is still
/// recognized by its fillers.
#[test]
fn an_export_without_its_head_is_recognized_by_its_fillers() {
    let dir = fixture();
    let ours = AS_IT_IS.replace("padding_1 :", "padding_14 :");
    let import = plan(dir.path(), &ours).unwrap();
    assert!(import.is_own_export && import.changes_nothing() && import.is_whole());
    let vendors = plan(dir.path(), AS_IT_IS).unwrap();
    assert!(!vendors.is_own_export && !vendors.changes_nothing());
}

/// Decision D-742: a device without a library of the vendor has addresses that no declarations can confirm.
#[test]
fn a_device_without_a_library_has_nothing_to_confirm() {
    let dir = fixture();
    let device = dir.path().join("device.toml");
    let text = fs::read_to_string(&device).unwrap();
    fs::write(&device, text.replace("library = \"BM_TYPES\"\n", "")).unwrap();
    assert_eq!(
        plan(dir.path(), AS_IT_IS).expect_err("refused").to_string(),
        "lib/TYPES.st cannot confirm the offsets of `small`: the layout names no library of the vendor that declares its \
         structures"
    );
    let export = format!("(* Made by commram 1 *)\n{AS_IT_IS}");
    assert!(plan(dir.path(), &export).unwrap().is_own_export, "a comparison needs no library");
    fs::write(&device, text.replace("\"BM_TYPES\"", "\"OWN_TYPES\"")).unwrap();
    write(&plan(dir.path(), AS_IT_IS).unwrap());
    let text = fs::read_to_string(dir.path().join("CTRL.toml")).unwrap();
    assert!(text.contains("offsets = \"manual: OWN_TYPES, TYPES.st\""), "{text}");
}

/// Decision D-785: if there are several files, the provenance of a register names the file that declares it.
#[test]
fn several_files_are_imported_as_one() {
    let (pair, rest) = AS_IT_IS.split_once("    INIT : STRUCT").unwrap();
    let rest = rest.replace("[0..1] OF PAIR", "[0..PAIRS - 1] OF PAIR");
    let mut declarations = Declarations::default();
    for (name, text) in [
        ("INIT.st", format!("TYPE INIT : STRUCT{rest}")),
        ("PAIR.st", format!("{pair} END_TYPE")),
        ("LIST.st", "VAR_GLOBAL CONSTANT PAIRS : INT := 2; END_VAR FUNCTION f END_FUNCTION".to_owned()),
    ] {
        declarations.add(Path::new(name), Ok(text.into_bytes())).unwrap();
    }
    assert_eq!(declarations.notes(), ["LIST.st: skipped, because only types are read: FUNCTION f in line 1"]);
    let dir = fixture();
    let import = Import::plan(dir.path(), &declarations, Alignment::Natural, &NamePairs::default()).unwrap();
    assert_eq!(reported_rows(&import), [""; 0]);
    write(&import);
    for (file, line) in [("CTRL.toml", "INIT.st"), ("INIT.toml", "INIT.st"), ("parts.toml", "PAIR.st")] {
        let text = fs::read_to_string(dir.path().join(file)).unwrap();
        assert!(text.contains(&format!("offsets = \"manual: BM_TYPES, {line}\"")), "{text}");
    }
}

#[test]
fn declarations_of_something_else_are_refused() {
    assert_eq!(
        refused("TYPE A : STRUCT b : BYTE; END_STRUCT; B : BYTE; END_TYPE", &[]),
        "lib/TYPES.st declares none of the layout's structures (INIT, CTRL); its structures: A"
    );
    let text = AS_IT_IS.replace("b_MODE : BYTE", "b_MODE : BITE");
    assert_eq!(
        refused(&text, &[]),
        "lib/TYPES.st:5:53: `BITE` is neither an elementary type nor declared in the given files; add the file that \
         declares it"
    );
    let alone = AS_IT_IS.replace("CTRL : STRUCT", "OTHER : STRUCT");
    assert_eq!(reported_rows(&plan(fixture().path(), &alone).unwrap()), ["CTRL. undeclared 40 -"]);
}

#[test]
fn a_name_that_the_declarations_lack_is_refused() {
    assert_eq!(
        refused(AS_IT_IS, &[("CTRL", "CTRLS")]),
        "`CTRL=CTRLS`: lib/TYPES.st declares no structure `CTRLS`; its structures: PAIR, INIT, CTRL"
    );
    assert_eq!(
        refused(AS_IT_IS, &[("CTRL", "CTRL"), ("CTRL", "INIT")]),
        "`CTRL=INIT`: `CTRL` already has the name `CTRL` in the declarations; give one name"
    );
}

#[test]
fn the_mark_has_only_printable_characters_of_the_file_name() {
    let dir = fixture();
    let declarations = Declarations::parse(Path::new("lib/a\u{202e}b\u{e4}\n.st"), AS_IT_IS).unwrap();
    let import = Import::plan(dir.path(), &declarations, Alignment::Natural, &NamePairs::default()).unwrap();
    write(&import);
    let text = fs::read_to_string(dir.path().join("CTRL.toml")).unwrap();
    assert!(text.contains("offsets = \"manual: BM_TYPES, a?b\u{e4}?.st\""), "{text}");
}
