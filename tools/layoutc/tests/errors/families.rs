//! Errors in a family, and in a device that shares its structures.

use super::error_of;
use std::fs;
use tempfile::TempDir;

/// Files below a directory: those of the family `common`, and those of the device `small` next to it.
const FILES: [(&str, &str); 5] = [
    (
        "common/family.toml",
        "name = \"common\"\n\
         title = \"Common\"\n\
         manual = \"1.00\"\n\
         reserved = { owner = \"firmware\", source = \"inferred D-05\" }\n\
         parts = [\"meanings.toml\"]\n\
         structures = [\"SHARED\"]\n",
    ),
    (
        "common/meanings.toml",
        "[[meaning]]\n\
         name = \"state\"\n\
         page = \"2\"\n\
         pages = { \"2.00\" = \"7\" }\n\
         value = [{ is = 0, text = \"off\" }]\n",
    ),
    (
        "common/SHARED.toml",
        "name = \"SHARED\"\n\
         name_from = \"manual\"\n\
         offsets = \"inferred D-02\"\n\
         names = \"manual\"\n\
         types = \"manual\"\n\
         owners = \"manual\"\n\
         resets = \"inferred D-03\"\n\
         size = 8\n\
         page = \"3\"\n\
         doc = \"Shared\"\n\
         register = [\n\
         { offset = 0, name = \"w_STATE\", type = \"WORD\", owner = \"plc\", meaning = \"state\", doc = \"State\" },\n\
         { offset = 2, name = \"a_LIST\", type = \"BYTE\", array = [2], owner = \"plc\", doc = \"List\" },\n\
         { offset = 4, name = \"d_VALUE\", type = \"DWORD\", owner = \"plc\", doc = \"Value\" },\n\
         ]\n",
    ),
    (
        "small/device.toml",
        "name = \"small\"\n\
         title = \"A small device\"\n\
         manual = \"2.00\"\n\
         family = \"common\"\n\
         reserved = { owner = \"firmware\", source = \"inferred D-05\" }\n\
         structures = [\"OWN\"]\n\
         names = \"inferred D-05\"\n\
         [[area]]\n\
         name = \"node\"\n\
         first = 0\n\
         last = 63\n\
         page = \"1\"\n\
         doc = \"The node\"\n\
         structure = [{ name = \"OWN\", live = \"always\" }]\n\
         [[space]]\n\
         name = \"memory\"\n\
         letter = \"M\"\n\
         segment = 3\n\
         unit = \"byte\"\n\
         first = 0\n\
         offset = 4096\n\
         page = \"1\"\n\
         doc = \"Shared memory\"\n",
    ),
    (
        "small/OWN.toml",
        "name = \"OWN\"\n\
         name_from = \"manual\"\n\
         view = \"SHARED\"\n\
         offsets = \"inferred D-02\"\n\
         names = \"manual\"\n\
         types = \"manual\"\n\
         owners = \"manual\"\n\
         resets = \"inferred D-03\"\n\
         page = \"3\"\n\
         doc = \"Own\"\n\
         register = [\n\
         { name = \"w_STATE\", type = \"WORD\", owner = \"plc\", meaning = \"state\", doc = \"State\" },\n\
         { name = \"a_LIST\", type = \"BYTE\", array = [2], owner = \"plc\", doc = \"List\" },\n\
         { name = \"d_OTHER\", type = \"DWORD\", owner = \"plc\", view_name = \"d_VALUE\", doc = \"Value\" },\n\
         ]\n",
    ),
];

/// Makes all files, with `from` of `file` replaced by `to`.
fn edited(file: &str, from: &str, to: &str) -> TempDir {
    let dir = TempDir::new().unwrap();
    for (path, text) in FILES {
        let path_there = dir.path().join(path);
        fs::create_dir_all(path_there.parent().unwrap()).unwrap();
        let text = if path == file {
            assert_eq!(text.matches(from).count(), 1, "`{from}` must occur once in {file}");
            text.replace(from, to)
        } else {
            text.to_owned()
        };
        fs::write(path_there, text).unwrap();
    }
    dir
}

#[track_caller]
fn check(file: &str, from: &str, to: &str, expected: &str) {
    let dir = edited(file, from, to);
    let error = error_of(&dir.path().join("small")).replace(&format!("{}/", dir.path().display()), "");
    assert_eq!(error, expected);
}

#[test]
fn a_device_of_a_family_is_correct() {
    let dir = edited("", "", "");
    let compiled = commram_layoutc::compile(&dir.path().join("small")).unwrap();
    assert_eq!(compiled.inputs.len(), FILES.len());
    commram_layoutc::compile_family(&dir.path().join("common")).unwrap();
}

#[test]
fn invalid_families() {
    let missing = "No such file or directory (os error 2)";
    let expected = format!("device.toml:4:10: cannot read this file: gone/family.toml: {missing}");
    check("small/device.toml", "\"common\"", "\"gone\"", &expected);
    let known = "`name`, `title`, `manual`, `reserved`, `phase`, `parts`, `structures`";
    let expected = format!("common/family.toml:2:1: unknown field `colour`, expected one of {known}");
    check("common/family.toml", "title = ", "colour = 1\ntitle = ", &expected);
    let expected = "common/family.toml:1:1: missing field `manual`";
    check("common/family.toml", "manual = \"1.00\"\n", "", expected);
    let expected = format!("common/family.toml:6:15: cannot read this file: common/GONE.toml: {missing}");
    check("common/family.toml", "\"SHARED\"", "\"GONE\"", &expected);
    let expected = "OWN.toml:1:8: `OWN` is already in use here; names must be unique";
    check("common/SHARED.toml", "name = \"SHARED\"", "name = \"OWN\"", expected);
}

#[test]
fn structures_without_a_match_in_the_family() {
    for name in ["NONE", "OWN"] {
        let expected = format!(
            "OWN.toml:3:8: unknown structure `{name}`; a view is one of the structures of the family: SHARED"
        );
        check("small/OWN.toml", "view = \"SHARED\"", &format!("view = \"{name}\""), &expected);
    }
    let expected = "OWN.toml:11:1: register without `offset`";
    check("small/OWN.toml", "view = \"SHARED\"\n", "", expected);
    let own = "a structure with `view` takes offsets, paddings and size from the family's; leave them out";
    check("small/OWN.toml", "page = \"3\"", "size = 8\npage = \"3\"", &format!("OWN.toml:9:8: {own}"));
    let offset = "{ offset = 2, name = \"a_LIST\"";
    check("small/OWN.toml", "{ name = \"a_LIST\"", offset, &format!("OWN.toml:13:1: {own}"));
}

#[test]
fn registers_without_a_match_in_the_family() {
    let unlike = |name: &str| {
        format!("OWN.toml:14:1: `SHARED` has no register `{name}`; give its name there as `view_name`")
    };
    check("small/OWN.toml", "view_name = \"d_VALUE\", ", "", &unlike("d_OTHER"));
    check("small/OWN.toml", "view_name = \"d_VALUE\"", "view_name = \"d_GONE\"", &unlike("d_GONE"));
    let expected = "OWN.toml:13:1: `a_LIST` must have the type and the bounds that it has in `SHARED`";
    check("small/OWN.toml", "array = [2]", "array = [3]", expected);
    let expected =
        "OWN.toml:12:61: meaning `state` has values or bits from a manual, but no `pages` of manual 2.00";
    check("common/meanings.toml", "pages = { \"2.00\" = \"7\" }\n", "", expected);
}
