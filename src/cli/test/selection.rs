//! Selection of scenarios: folders, filters, shards.

use crate::cli::error::CliError;
use crate::cli::{file_name, output};
use crate::input_file;
use crate::script::{is_part, needs, with_stack};
use core::fmt;
use core::num::NonZero;
use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

/// Every n-th scenario, beginning with the i-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Number of the shard, counted from 1.
    index: usize,
    count: NonZero<usize>,
}

/// Maximum number of shards of a run. The limit exists because reports of other machines may contain any number.
const MAX_SHARDS: usize = 10_000;

impl Shard {
    /// Parses `2/3`.
    ///
    /// # Errors
    /// The notation is wrong, or the number of the shard is larger than the number of all shards.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse::<usize>().ok();
        let numbers = text.split_once('/').and_then(|(index, count)| Some((number(index)?, number(count)?)));
        match numbers.map(|(index, count)| (index, NonZero::new(count))) {
            Some((_, Some(count))) if count.get() > MAX_SHARDS => {
                Err(format!("a run has at most {MAX_SHARDS} shards"))
            }
            Some((index, Some(count))) if (1..=count.get()).contains(&index) => Ok(Self { index, count }),
            Some((_, Some(count))) => Err(format!("shards are counted from 1 up to {count}")),
            Some((_, None)) => Err("there is at least one shard, 1/1".to_owned()),
            None => Err("write the number of the shard and of all shards, for example 1/3".to_owned()),
        }
    }

    /// Parses `0/3`, with the index counted from 0.
    ///
    /// # Errors
    /// Returns the errors of [`Shard::parse`].
    pub(crate) fn parse_index(text: &str) -> Result<Self, String> {
        let wrong =
            || "write the index of the shard from 0 and the number of all shards, for example 0/3".to_owned();
        let (index, count) = text.split_once('/').ok_or_else(wrong)?;
        let index = index.parse::<usize>().ok().and_then(|index| index.checked_add(1)).ok_or_else(wrong)?;
        let parsed = Self::parse(&format!("{index}/{count}"));
        parsed.map_err(|_| {
            format!("{}; there must be at least one shard, and the index must be below their number", wrong())
        })
    }

    /// Returns the number of the shard, from 1.
    pub(crate) const fn index(self) -> usize {
        self.index
    }

    /// Returns the number of all shards.
    pub(crate) const fn count(self) -> usize {
        self.count.get()
    }

    /// Returns the scenarios of this shard.
    fn of(self, all: Vec<PathBuf>) -> Vec<PathBuf> {
        all.into_iter().skip(self.index - 1).step_by(self.count.get()).collect()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// Returns the scenarios in the order of the arguments, each once. The scenarios of a folder are in the order of their
/// paths.
///
/// # Errors
/// A folder cannot be read or has no scenarios, or no scenario matches a filter.
pub(crate) fn scenarios(
    named: &[PathBuf],
    filters: &[String],
    shard: Option<Shard>,
) -> Result<Vec<PathBuf>, CliError> {
    let mut files = Vec::new();
    for path in named {
        if path.is_dir() {
            files.append(&mut in_folder(path)?);
        } else {
            files.push(path.clone());
        }
    }
    for file in &files {
        file_name::check(file).map_err(|right| {
            let text = output::in_one_line(&file.to_string_lossy());
            CliError::Argument { text, right: right.to_owned() }
        })?;
    }
    let mut known = HashSet::new();
    files.retain(|file| known.insert(identity(file)));
    if !filters.is_empty() {
        files.retain(|file| filters.iter().any(|filter| matches(filter, file)));
        if files.is_empty() {
            let right = "no scenario has this in its path; without --filter, --list shows all".to_owned();
            return Err(CliError::Argument { text: filters.join("`, `"), right });
        }
    }
    Ok(match shard {
        Some(shard) => shard.of(files),
        None => files,
    })
}

/// Returns the path of a file in its real folder, which is the same for every spelling of the path. A link to a file
/// counts as another file.
fn identity(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (folder.canonicalize(), file.file_name()) {
        (Ok(folder), Some(name)) if !input_file::is_standard(file) => folder.join(name),
        _ => file.to_owned(),
    }
}

/// Returns the scenarios of a folder and its subfolders, except scripts that others import and that only define
/// functions.
fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let wrong = |right: &dyn std::fmt::Display| CliError::Argument {
        text: folder.display().to_string(),
        right: right.to_string(),
    };
    let mut files = Vec::new();
    walk(folder, &mut files).map_err(|reason| wrong(&reason))?;
    if files.is_empty() {
        return Err(wrong(&"this directory has no files that end in .rhai"));
    }
    files.sort();
    let parts = parts(&files)?;
    files.retain(|file| !parts.contains(file));
    Ok(files)
}

/// Collects the scripts of a folder and its subfolders. Skips hidden folders and links to folders. Scripts directly
/// in a device folder belong to the device and are no scenarios.
fn walk(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let is_device = folder.join("device.toml").is_file();
    for entry in folder.read_dir()? {
        let entry = entry?;
        let path = shown(&entry.path());
        if entry.file_type()?.is_dir() {
            if !entry.file_name().as_encoded_bytes().starts_with(b".") {
                walk(&path, files)?;
            }
        } else if !is_device && path.extension().is_some_and(|ending| ending == "rhai") && path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}

/// Removes a leading `.` from the path.
fn shown(path: &Path) -> PathBuf {
    path.components().filter(|part| *part != Component::CurDir).collect()
}

/// Returns the scripts that others import and that only define functions.
fn parts(files: &[PathBuf]) -> Result<HashSet<PathBuf>, CliError> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let imported: HashSet<_> = files.iter().flat_map(|file| needs(file)).map(|file| real(&file)).collect();
    let mut candidates: Vec<_> = files.iter().filter(|file| imported.contains(&real(file))).collect();
    if candidates.is_empty() {
        return Ok(HashSet::new());
    }
    let look = move || {
        let text = |file: &Path| input_file::read(file, input_file::LONGEST_SCRIPT).unwrap_or_default();
        candidates.retain(|file| is_part(&text(file)));
        candidates.into_iter().cloned().collect()
    };
    with_stack(look).map_err(|reason| CliError::Process { reason })
}

/// True if the path contains the text. If the text has `*` or `?`, true if the whole path, or the file name without its
/// extension, matches the pattern.
fn matches(filter: &str, file: &Path) -> bool {
    let path = file.to_string_lossy();
    if !filter.contains(['*', '?']) {
        return path.contains(filter);
    }
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    is_of_form(filter, &path) || is_of_form(filter, &name)
}

/// Matches a pattern: `*` matches any characters, `?` matches one character.
fn is_of_form(form: &str, text: &str) -> bool {
    let (form, text): (Vec<char>, Vec<char>) = (form.chars().collect(), text.chars().collect());
    let (mut at, mut in_form) = (0, 0);
    // Position of the last `*` in the pattern, and the end of the part of the text that this `*` matches so far.
    let mut star: Option<(usize, usize)> = None;
    while at < text.len() {
        match form.get(in_form) {
            Some('*') => {
                star = Some((in_form, at));
                in_form += 1;
            }
            Some(wanted) if *wanted == '?' || *wanted == text[at] => {
                at += 1;
                in_form += 1;
            }
            _ => match &mut star {
                Some((place, end)) => {
                    *end += 1;
                    (in_form, at) = (*place + 1, *end);
                }
                None => return false,
            },
        }
    }
    form[in_form..].iter().all(|rest| *rest == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(texts: &[&str]) -> Vec<PathBuf> {
        texts.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn every_scenario_is_in_one_shard() {
        let all = paths(&["a", "b", "c", "d", "e"]);
        let shard = |text: &str| Shard::parse(text).unwrap().of(all.clone());
        assert_eq!(shard("1/1"), all);
        assert_eq!((shard("1/2"), shard("2/2")), (paths(&["a", "c", "e"]), paths(&["b", "d"])));
        assert_eq!(shard("6/6"), paths(&[]));
        for wrong in ["", "1", "0/2", "3/2", "1/0", "-1/2", "a/b", "1/2/3"] {
            assert!(Shard::parse(wrong).is_err(), "{wrong}");
        }
        assert_eq!(Shard::parse("0/2").unwrap_err(), "shards are counted from 1 up to 2");
    }

    #[test]
    fn a_filter_is_a_part_of_the_path_or_a_pattern() {
        let file = Path::new("tests/scenarios/04-deadlines.rhai");
        for filter in ["dead", "scenarios/04", "*lines", "04-*", "tests/*.rhai", "0?-d*l*s", "*"] {
            assert!(matches(filter, file), "{filter}");
        }
        for filter in ["Dead", "05", "dead*", "?-deadlines", "*.rhai*x", "tests/*/?.rhai"] {
            assert!(!matches(filter, file), "{filter}");
        }
    }

    #[test]
    fn folders_are_searched_for_scenarios_without_imported_parts() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        for folder in ["deep/er", "common", ".hidden", "card/tests"] {
            std::fs::create_dir_all(at(folder)).unwrap();
        }
        for (name, text) in [
            ("b.rhai", "import \"common/start\" as start; start::begin();"),
            ("a.rhai", "import \"b\" as b;"),
            ("deep/er/c.rhai", "now();"),
            ("common/start.rhai", "fn begin() {}"),
            ("common/unused.rhai", "fn begin() {}"),
            (".hidden/d.rhai", "now();"),
            ("deep/e.txt", "now();"),
            ("card/device.toml", ""),
            ("card/firmware.rhai", "fn poll() {}"),
            ("card/exercise.rhai", "now();"),
            ("card/tests/f.rhai", "now();"),
        ] {
            std::fs::write(at(name), text).unwrap();
        }
        std::os::unix::fs::symlink(directory.path(), at("deep/round")).unwrap();
        let found = scenarios(&[directory.path().to_owned()], &[], None).unwrap();
        // `unused` is listed and reported as empty, because no script imports it. `b` is imported, but is also a
        // scenario, because it calls verbs.
        let expected =
            ["a.rhai", "b.rhai", "card/tests/f.rhai", "common/unused.rhai", "deep/er/c.rhai"].map(at);
        assert_eq!(found, expected);
        let filters = ["er/c".to_owned(), "a".to_owned()];
        let shard = Shard::parse("2/2").ok();
        assert!(scenarios(&[directory.path().join("deep")], &filters[..1], shard).unwrap().is_empty());
        assert!(scenarios(&[at("a.rhai")], &["nothing".to_owned()], None).is_err());
        // A file that is given twice, in any spelling, runs once.
        let twice = [at("deep/../a.rhai"), at("a.rhai"), at("deep"), at("deep/er/c.rhai")];
        let once = scenarios(&twice, &[], None).unwrap();
        assert_eq!(once, [at("deep/../a.rhai"), at("deep/er/c.rhai")]);
    }
}
