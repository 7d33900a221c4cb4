//! The schemas of plants and layouts. An external validator checks them against the files of the repository and against
//! invalid files.

use crate::common::{finish, python, run};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the TOML files of a directory.
fn in_directory(directory: &str) -> Vec<PathBuf> {
    let entries = root().join(directory).read_dir().unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.extension().is_some_and(|it| it == "toml")).collect()
}

/// Fails unless the schema accepts all files and none of the `broken` texts.
fn assert_schema_separates(schema: &[&str], files: &[PathBuf], broken: &[&str]) {
    let Some(mut validator) = python(&["check_jsonschema"]) else { return };
    let directory = TempDir::new().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::write(at("schema.json"), run(schema).ok()).unwrap();
    let name = |number: usize| format!("broken-{number:02}.toml");
    for (number, text) in broken.iter().enumerate() {
        std::fs::write(at(&name(number)), text).unwrap();
    }
    let expected: Vec<_> = (0..broken.len()).map(|number| at(&name(number)).display().to_string()).collect();
    validator.args(["-m", "check_jsonschema", "-o", "json", "-vv", "--schemafile"]).arg(at("schema.json"));
    let outcome = finish(validator.args(files).args(&expected));
    let report: serde_json::Value =
        serde_json::from_str(&outcome.out).unwrap_or_else(|_| panic!("{outcome:?}"));
    let errors = report["errors"].as_array().unwrap().iter();
    let mut refused: Vec<_> = errors.map(|error| error["filename"].as_str().unwrap().to_owned()).collect();
    refused.sort();
    refused.dedup();
    assert_eq!(refused, expected, "{}", outcome.out);
}

#[test]
fn the_schema_accepts_every_plant_of_the_repository_and_refuses_invalid_ones() {
    let directory = TempDir::new().unwrap();
    let single = ["src/plant/built_in.toml", "tools/examples/plant.toml", "tests/scenarios/common/pair.toml"];
    let mut plants: Vec<PathBuf> = single.map(|path| root().join(path)).to_vec();
    plants.extend(in_directory("tools/plants"));
    let devices = root().join("src/devices").read_dir().unwrap().map(|entry| entry.unwrap().path());
    let files = devices
        .flat_map(|device| ["plant.toml", "demo.toml"].map(|name| device.join("emulation").join(name)));
    plants.extend(files.filter(|path| path.exists()));
    let page = std::fs::read_to_string(root().join("docs/reference/plant.md")).unwrap();
    for (number, block) in page.split("```toml\n").skip(1).enumerate() {
        let path = directory.path().join(format!("page-{number}.toml"));
        std::fs::write(&path, block.split_once("```").unwrap().0).unwrap();
        plants.push(path);
    }
    assert!(plants.len() > 18, "{plants:?}");
    let broken = [
        "[[plc]]\nname = \"line\"\ndip = 32\n",
        "[[plc]]\nname = \"line\"\nnode = \"drives\"\n",
        "[[plc]]\nname = \"a b\"\n",
        "[[device]]\nname = \"panel\"\n",
        "[[device]]\nkind = \"cs0015\"\nname = \"panel\"\npdo_rx = [{ pdo = 1, inhibit_ms = 1 }]\n",
        "[[bus]]\nname = \"b\"\nkind = \"can\"\nkbit_s = 5\n",
        "[[bus]]\nname = \"b\"\ndoors = [\"slcan\"]\n",
        "[[bus]]\nname = \"b\"\n[[bus.drive]]\nname = \"d\"\nslave_number = 1\nenable = \"never\"\n",
        "[[fault]]\nkind = \"Lose everything\"\n",
        "[[fault]]\nkind = \"lose_frame\"\nslots = \"WRC1\"\n",
    ];
    assert_schema_separates(&["plant", "schema"], &plants, &broken);
}

#[test]
fn the_schema_accepts_every_layout_of_the_repository_and_refuses_invalid_ones() {
    let layouts = root().join("layouts").read_dir().unwrap().map(|entry| entry.unwrap().file_name());
    let files: Vec<_> =
        layouts.flat_map(|name| in_directory(&format!("layouts/{}", name.to_str().unwrap()))).collect();
    assert!(files.len() > 30, "{files:?}");
    let part = "[[meaning]]\nname = \"a\"\nvalue = [{ is = 1, text = \"on\" }]\n";
    let broken = [
        "name = \"device\"\n",
        "[[meaning]]\nnames = \"a\"\n",
        &part.replace("is = 1", "is = \"1\""),
        &part.replace("value = ", "values = "),
        &format!("{part}source = \"guessed\"\n"),
    ];
    assert_schema_separates(&["layout", "schema"], &files, &broken);
}
