//! Tests which parts of the files an import preserves: comments, columns, order, padding.

use super::{AS_IT_IS, OTHER, fixture, plan, write};
use std::fs;
use std::path::Path;

fn edit(dir: &Path, file: &str, pairs: &[(&str, &str)]) {
    let path = dir.join(file);
    let mut text = fs::read_to_string(&path).unwrap();
    for (from, to) in pairs {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text = text.replace(from, to);
    }
    fs::write(path, text).unwrap();
}

#[test]
fn comments_stay_with_their_lines_and_keys_below_each_other() {
    let dir = fixture();
    edit(
        dir.path(),
        "CTRL.toml",
        &[
            ("name = \"CTRL\"", "# What comes first.\nname = \"CTRL\" # its name"),
            ("  { offset = 8,", "  # The value\n  # that counts\n  { offset = 8,"),
            (
                "doc = \"Flags\", meaning = \"kind\" },",
                "doc = \"Flags\", meaning = \"kind\", name_from = \"manual\" }, # three of them",
            ),
            ("names = \"manual\"", "names = \"inferred D-07\""),
            (
                "doc = \"Control\" }",
                "doc = \"Control\", name_from = \"inferred D-08\", offset_from = \"inferred D-07\" }",
            ),
            ("  { offset = 14, padding = 2 },", "  # a hole\n  { offset = 14, padding = 2 }, # of two bytes"),
            ("doc = \"Grid\" },\n]", "doc = \"Grid\" } # at the end\n  # and after it\n]"),
        ],
    );
    write(&plan(dir.path(), OTHER).unwrap());
    assert_eq!(
        fs::read_to_string(dir.path().join("CTRL.toml")).unwrap(),
        r#"# What comes first.
name = "CTRL" # its name
name_from = "manual"
offsets = "manual: BM_TYPES, TYPES.st"
names = "manual: BM_TYPES, TYPES.st"
types = "manual"
owners = "manual"
resets = "inferred D-03"
size = 44
page = "4"
doc = "Afterwards"
blocks = ["GENERAL"]
register = [
  { offset = 4,  name = "a_FLAGS", type = "BYTE", array = [3], used = [2], owner = "both", doc = "Flags", meaning = "kind", name_from = "manual" }, # three of them
  { offset = 7,  name = "b_CONTROL", type = "BYTE", owner = "both", doc = "Control" },
  { offset = 8,  name = "i_TEMPERATURE", type = "INT", owner = "firmware", reset = -40, reset_from = "manual", doc = "Temperature" },
  { offset = 10, padding = 2 },
  # The value
  # that counts
  { offset = 12, name = "d_VALUE", type = "DWORD", owner = "plc", doc = "Value" },
  { offset = 16, padding = 4 },
  { offset = 20, name = "a_GRID", type = "DINT", array = [2, 2], owner = "both", doc = "Grid" }, # at the end
  # a hole
  # of two bytes
  { offset = 36, name = "a_PAIRS", type = "PAIR", array = [2], doc = "Pairs" },
  # and after it
]
"#
    );
}

#[test]
fn a_list_on_one_line_stays_a_list() {
    let dir = fixture();
    edit(
        dir.path(),
        "INIT.toml",
        &[
            ("[\n  { offset = 4", "[{ offset = 4"),
            ("},\n  { offset = 5", "}, { offset = 5"),
            ("},\n  { offset = 7, padding = 1 },\n]", "}, { offset = 7, padding = 1 } ]"),
        ],
    );
    write(&plan(dir.path(), AS_IT_IS).unwrap());
    let text = fs::read_to_string(dir.path().join("INIT.toml")).unwrap();
    assert!(text.contains("register = [{ offset = 4, name"), "{text}");
    write(&plan(dir.path(), OTHER).unwrap());
    commram_layoutc::compile(dir.path()).unwrap();
    assert!(plan(dir.path(), OTHER).unwrap().changes_nothing());
}

#[test]
fn other_forms_are_refused_with_their_file() {
    let dir = fixture();
    edit(dir.path(), "INIT.toml", &[("register = [\n", "register = [ # why not\n")]);
    let error = plan(dir.path(), OTHER).expect_err("not moved").to_string();
    assert!(
        error.ends_with("INIT.toml: write the registers of `INIT` as a list of inline tables, one per line"),
        "{error}"
    );
}
