//! Tests every kind of error in a parameter table. Each test makes one edit in a correct table, and checks the place
//! and the text of the error.

use commram_layoutc::parameters;
use std::fs;

const TABLE: &str = r#"drive = "test drive"

[[parameter]]
number = 7
id = "LEVEL"
name = "level"
format = "word"
min = -5
max = 10
default = -1
access = "read_write"
unit = "mm"
page = "1 p. 2"

[[parameter]]
number = 9
id = "ANGLE"
name = "angle"
format = "doubleword"
default = 3
access = "read_only"
unit = ""
inferred = "D-1"
values_from = "D-2"
settle_us = 40
"#;

fn compile(text: &str) -> Result<String, String> {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("parameters.toml"), text).unwrap();
    parameters::compile(dir.path(), "parameters.toml")
        .map_err(|error| error.to_string().replace(&format!("{}/", dir.path().display()), ""))
}

#[track_caller]
fn refused(from: &str, to: &str, expected: &str) {
    assert_eq!(TABLE.matches(from).count(), 1, "`{from}` must occur once");
    assert_eq!(compile(&TABLE.replace(from, to)).unwrap_err(), expected);
}

#[test]
fn a_correct_table() {
    let rust = compile(TABLE).unwrap();
    for line in [
        "min: -5, max: 10, default: 65535, read_only: false, unit: \"mm\"",
        "source: Provenance::Documented(\"1 p. 2\"), unit_from: Provenance::Documented(\"1 p. 2\"), values_from: \
         Provenance::Documented(\"1 p. 2\"), settle_us: 0",
        "min: 0, max: 4294967295, default: 3, read_only: true, unit: \"\"",
        "source: Provenance::Inferred(\"D-1\"), unit_from: Provenance::Inferred(\"D-1\"), values_from: \
         Provenance::Inferred(\"D-2\"), settle_us: 40",
        "pub const ANGLE: u16 = 9;",
    ] {
        assert!(rust.contains(line), "{line}\n{rust}");
    }
}

#[test]
fn numbers() {
    refused("number = 7", "number = 0", "parameters.toml:4:10: parameter number 0: numbers are 1 to 4095");
    refused(
        "number = 9",
        "number = 4096",
        "parameters.toml:16:10: parameter number 4096: numbers are 1 to 4095",
    );
    for number in [7, 3] {
        refused(
            "number = 9",
            &format!("number = {number}"),
            &format!(
                "parameters.toml:16:10: parameter {number} after 7: parameters are listed in the order of their numbers, each once"
            ),
        );
    }
}

#[test]
fn ids() {
    refused(
        "\"ANGLE\"",
        "\"angle\"",
        "parameters.toml:17:6: `angle` is no id (capital letters, digits and `_`, starting with a letter)",
    );
    refused(
        "\"ANGLE\"",
        "\"LEVEL\"",
        "parameters.toml:17:6: `LEVEL` is already in use here; names must be unique",
    );
}

#[test]
fn values() {
    refused(
        "max = 10",
        "max = 32768",
        "parameters.toml:9:7: `max` of parameter 7 is 32768; its format holds -32768 to 32767",
    );
    refused(
        "min = -5",
        "min = -32769",
        "parameters.toml:8:7: `min` of parameter 7 is -32769; its format holds -32768 to 32767",
    );
    refused(
        "default = 3",
        "default = -3",
        "parameters.toml:20:11: `default` of parameter 9 is -3; its format holds 0 to 4294967295",
    );
    refused(
        "default = -1",
        "default = 11",
        "parameters.toml:10:11: `default` of parameter 7 lies outside its limits -5 to 10",
    );
    refused(
        "max = 10",
        "max = -6",
        "parameters.toml:10:11: `default` of parameter 7 lies outside its limits -5 to -6",
    );
}

#[test]
fn sources() {
    let both = "parameters.toml:4:10: parameter 7 needs either `page`, or `inferred` with the decision";
    refused("page = \"1 p. 2\"", "", both);
    refused("page = \"1 p. 2\"", "page = \"1 p. 2\"\ninferred = \"D-2\"", both);
}

#[test]
fn keys_and_words_that_do_not_exist() {
    for (from, to, expected) in [
        ("unit = \"mm\"", "units = \"mm\"", "parameters.toml:12:1: unknown field `units`"),
        ("unit = \"mm\"", "", "parameters.toml:3:1: missing field `unit`"),
        ("format = \"word\"", "format = \"byte\"", "parameters.toml:7:10: unknown variant `byte`"),
        ("\"read_only\"", "\"write_only\"", "parameters.toml:21:10: unknown variant `write_only`"),
    ] {
        let error = compile(&TABLE.replace(from, to)).unwrap_err();
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn a_missing_table() {
    let dir = tempfile::tempdir().unwrap();
    let error = parameters::compile(dir.path(), "parameters.toml").unwrap_err().to_string();
    assert!(
        error.ends_with("parameters.toml:1:1: cannot read this file: No such file or directory (os error 2)")
    );
}
