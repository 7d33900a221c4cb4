//! `docs/internals/architecture.md` lists the allowed dependencies; these tests compare the list with the imports.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules in the order of the layers, each with its row and the modules that its row may use.
struct Layers {
    rows: Vec<(Vec<String>, BTreeSet<String>)>,
}

/// Returns the text between backquotes.
fn names(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

impl Layers {
    fn documented() -> Self {
        let page = include_str!("../../docs/internals/architecture.md");
        let section =
            page.split("## Allowed dependencies").nth(1).and_then(|rest| rest.split("\n## ").next());
        let lines = section.expect("the section").lines().filter(|line| line.starts_with("| `"));
        let row = |line: &str| {
            let cells: Vec<_> = line.trim_matches('|').split('|').collect();
            (names(cells[0]), names(cells[2]).into_iter().collect())
        };
        Layers { rows: lines.map(row).collect() }
    }

    fn row_of(&self, module: &str) -> Option<usize> {
        self.rows.iter().position(|(modules, _)| modules.iter().any(|name| name == module))
    }

    fn may_use(&self, user: &str, used: &str) -> bool {
        let row = self.row_of(user).map(|row| &self.rows[row]);
        row.is_some_and(|(row, uses)| row.iter().any(|name| name == used) || uses.contains(used))
    }
}

fn sources(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, found);
        } else if entry.extension().is_some_and(|it| it == "rs") {
            found.push(entry);
        }
    }
}

/// Returns the modules that a source names after `crate::` or the equivalent `commram::`, without comments.
fn used(source: &str) -> BTreeSet<String> {
    let code: String =
        source.lines().flat_map(|line| [line.split("//").next().unwrap_or(""), "\n"]).collect();
    // Test tables use only `layout` and the cells of `memory`.
    let code = code.replace("crate::devices::samples::tables", "crate::layout");
    // This function of tests uses no module.
    let code = code.replace("crate::devices::samples::copy_folder", "");
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut used = BTreeSet::new();
    for prefix in ["crate::", "commram::"] {
        for (at, _) in code.match_indices(prefix).filter(|(at, _)| !code[..*at].ends_with(is_part)) {
            let rest = &code[at + prefix.len()..];
            assert!(!rest.starts_with('{'), "one `use` for each module, so that this test can read it");
            used.insert(rest.split(|c| !is_part(c)).next().unwrap_or("").to_owned());
        }
    }
    used
}

/// Returns every module of `src` with the modules that it uses, and a file that uses each.
fn imports() -> BTreeMap<String, BTreeMap<String, PathBuf>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut imports: BTreeMap<String, BTreeMap<String, PathBuf>> = BTreeMap::new();
    for file in files {
        let path = file.strip_prefix(&root).unwrap().to_owned();
        let module = path.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs").to_owned();
        if module == "lib" || module == "main" {
            continue;
        }
        let uses = imports.entry(module.clone()).or_default();
        for name in used(&fs::read_to_string(&file).unwrap()) {
            if name != module {
                uses.entry(name).or_insert_with(|| path.clone());
            }
        }
    }
    let modules: BTreeSet<_> = imports.keys().cloned().collect();
    for uses in imports.values_mut() {
        uses.retain(|name, _| modules.contains(name));
    }
    imports
}

#[test]
fn every_module_has_a_row_and_uses_only_the_listed_modules() {
    let (layers, imports) = (Layers::documented(), imports());
    let mut wrong = Vec::new();
    for (module, uses) in &imports {
        if layers.row_of(module).is_none() {
            wrong.push(format!("{module} has no row"));
        }
        for (used, path) in uses {
            if !layers.may_use(module, used) {
                wrong.push(format!("{module} uses {used} (src/{})", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn rows_name_modules_below_them_that_are_used() {
    let (layers, imports) = (Layers::documented(), imports());
    for (row, (modules, may_use)) in layers.rows.iter().enumerate() {
        for name in may_use {
            let place = layers.row_of(name).unwrap_or_else(|| panic!("{name} has no row"));
            assert!(place < row, "{name} comes after {modules:?}, which may use it");
            let is_used = modules.iter().any(|module| imports[module].contains_key(name));
            assert!(is_used, "{modules:?} may use {name}, but does not");
        }
    }
}

/// Generic modules never name a device: not in comments, tests or generated tables. Only the text of the package in
/// `lib.rs` lists the devices.
#[test]
fn generic_modules_name_no_device() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let folders = fs::read_dir(src.join("devices")).unwrap().map(|entry| entry.unwrap().path());
    let folders = folders.filter(|path| path.join("mod.rs").exists());
    let first_word = |path: PathBuf| {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        name.split('_').next().unwrap().to_owned()
    };
    // A word that is also the name of a generic module is not a device name; the common emulation, and devices that are
    // read from folders, are no device.
    let devices = folders.map(first_word).filter(|word| !src.join(word).exists());
    let devices = devices.filter(|word| !["emulation", "folder"].contains(&word.as_str()));
    let devices: BTreeSet<_> = devices.collect();
    assert!(devices.contains("omega"), "{devices:?}");
    let mut files = Vec::new();
    sources(&src, &mut files);
    files.retain(|file| !file.starts_with(src.join("devices")) && *file != src.join("lib.rs"));
    assert!(files.len() > 100, "{files:?}");
    for file in files {
        let text = fs::read_to_string(&file).unwrap().to_lowercase();
        let named: Vec<_> = devices.iter().filter(|device| text.contains(device.as_str())).collect();
        assert!(named.is_empty(), "{} names {named:?}", file.display());
    }
}

/// Returns the names of all registers of the devices that begin like `w_X`.
fn register_names() -> BTreeSet<&'static str> {
    let structures = commram::devices::all().iter().flat_map(|device| device.layout.areas);
    let placed = structures.flat_map(|area| area.structures);
    let names = placed.flat_map(|placed| placed.structure.registers).map(|register| register.name);
    let is_typed = |name: &&str| {
        let (prefix, rest) = name.split_once('_').unwrap_or_default();
        let is_type = (1..=2).contains(&prefix.len()) && prefix.chars().all(|c| c.is_ascii_lowercase());
        is_type && rest.starts_with(|c: char| c.is_ascii_uppercase())
    };
    names.filter(is_typed).collect()
}

/// Returns the lines of a source with their numbers, without comments, modules of tests and examples in texts.
fn code(source: &str) -> Vec<(usize, &str)> {
    let without_tests = source.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let is_example = |line: &str| line.contains("example") || line.trim_start().starts_with("commram ");
    let lines = (1..).zip(without_tests.lines());
    lines
        .map(|(number, line)| (number, line.split("//").next().unwrap_or("")))
        .filter(|(_, line)| !is_example(line))
        .collect()
}

/// True if a text begins with a code of a handshake or a mode in the notation of manuals: `05` for 16#05.
fn is_code(text: &str) -> bool {
    let digits: Vec<_> = text.chars().take_while(char::is_ascii_hexdigit).collect();
    matches!(digits.as_slice(), ['0', last] if *last != '0')
}

/// The code of generic modules uses no register and no value of a device: layouts declare phases and handshakes. The
/// program's texts about the names of registers have examples.
#[test]
fn generic_modules_use_no_register_of_a_device() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let names = register_names();
    assert!(names.contains("w_OPTION_STATUS") && names.len() > 100, "{names:?}");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let texts = ["cli/mod.rs", "cli/shell.rs"].map(|path| src.join(path));
    let is_generic = |file: &PathBuf| !file.starts_with(src.join("devices")) && !texts.contains(file);
    let is_test = |file: &PathBuf| file.to_str().unwrap().contains("tests");
    let mut found = Vec::new();
    for file in files.into_iter().filter(|file| is_generic(file) && !is_test(file)) {
        let text = fs::read_to_string(&file).unwrap();
        for (number, line) in code(&text) {
            let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
            let has_register = words.into_iter().any(|word| names.contains(word));
            let has_code = line.split("16#").skip(1).any(is_code);
            if has_register || has_code || line.contains("segment 3") {
                found.push(format!("{}:{number}: {}", file.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// proptest would create a separate directory beside `src`.
#[test]
fn property_tests_of_the_library_store_failures_below_tests() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let places = text.matches("crate::property_tests()").count();
        assert_eq!(text.matches("proptest! {").count(), places, "{}", file.display());
    }
}
