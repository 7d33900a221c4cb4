//! Follows docs/guide/ci.md word by word: creates the files of the page and runs its shell lines.

use crate::common::{commram, finish, python, python_for};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// Programs of the servers that are not tested here: `cargo install` would build commram again. The stub checks
/// the path of commram's sources and installs the existing build.
const SERVER: [(&str, &str); 3] = [
    ("rustup", "exit 0"),
    ("git", "[ \"$*\" = '-C commram rev-parse HEAD' ] && echo 0123456789"),
    (
        "cargo",
        "while [ $# -gt 0 ]; do case $1 in --path) from=$2;; --root) to=$2;; esac; shift; done
         grep -q 'name = \"commram\"' \"$from/Cargo.toml\" && mkdir -p \"$to/bin\" && cp \"$COMMRAM_BUILT\" \"$to/bin/commram\"",
    ),
];

/// Returns the files of the page: each block after a line that contains only a path.
fn files() -> Vec<(String, String)> {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/guide/ci.md")).unwrap();
    let file = |(at, mark): (usize, &str)| {
        let (before, after) = (&page[..at], &page[at + mark.len()..]);
        let name = before.rsplit('`').next()?;
        let (_, block) = after.split_once('\n')?;
        Some((name.to_owned(), block.split_once("\n```")?.0.to_owned() + "\n"))
    };
    page.match_indices("`:\n\n```").filter_map(file).collect()
}

fn text<'a>(files: &'a [(String, String)], name: &str) -> &'a str {
    &files.iter().find(|(known, _)| known == name).unwrap().1
}

/// Creates a repository as the page describes it, on a server.
fn repository() -> TempDir {
    let directory = TempDir::new().unwrap();
    for (name, text) in files() {
        let path = directory.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    symlink(ROOT, directory.path().join("commram")).unwrap();
    std::fs::create_dir(directory.path().join("server")).unwrap();
    for (name, script) in SERVER {
        let path = directory.path().join("server").join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    directory
}

/// Runs the lines one after the other, like a server. Returns the report.
fn follow(directory: &Path, lines: &[String], environment: &[(&str, &str)]) -> String {
    let path = format!("{}:{}", directory.join("server").display(), std::env::var("PATH").unwrap());
    let _ = std::fs::remove_file(directory.join("report.xml"));
    for line in lines {
        let mut command = Command::new("bash");
        command.args(["-e", "-c", line]).current_dir(directory).env("PATH", &path);
        command.env("COMMRAM_BUILT", env!("CARGO_BIN_EXE_commram")).envs(environment.iter().copied());
        let outcome = finish(&mut command);
        assert_eq!(outcome.code, Some(0), "{line}\n{}{}", outcome.out, outcome.err);
    }
    std::fs::read_to_string(directory.join("report.xml")).unwrap()
}

/// The scenario is in the first of two shards. The second shard has no scenario and passes.
fn assert_shared([first, second]: [String; 2]) {
    assert!(first.contains("tests=\"1\" failures=\"0\" errors=\"0\""), "{first}");
    assert!(first.contains("file=\"scenarios/start.rhai\""), "{first}");
    assert!(second.contains("tests=\"0\""), "{second}");
}

#[test]
fn the_page_for_github_works_as_printed() {
    let (directory, files) = (repository(), files());
    let workflow = text(&files, ".github/workflows/scenarios.yml");
    let lines: Vec<_> = workflow.lines().filter_map(|line| line.trim().strip_prefix("- run: ")).collect();
    assert_eq!(lines.len(), 3, "{workflow}");
    assert_shared(["1", "2"].map(|shard| {
        let lines: Vec<_> = lines.iter().map(|line| line.replace("${{ matrix.shard }}", shard)).collect();
        follow(directory.path(), &lines, &[])
    }));
}

#[test]
fn the_page_for_gitlab_works_as_printed() {
    let (directory, files) = (repository(), files());
    let (_, rest) = text(&files, ".gitlab-ci.yml").split_once("  script:\n").unwrap();
    let lines = rest.lines().map_while(|line| line.strip_prefix("    - ")).map(str::to_owned);
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines.len(), 5, "{rest}");
    assert_shared(
        ["1", "2"].map(|index| {
            follow(directory.path(), &lines, &[("CI_NODE_INDEX", index), ("CI_NODE_TOTAL", "2")])
        }),
    );
}

#[test]
fn the_servers_accept_their_files() {
    let directory = repository();
    for (name, schema) in [
        (".github/workflows/scenarios.yml", "vendor.github-workflows"),
        (".gitlab-ci.yml", "vendor.gitlab-ci"),
    ] {
        let Some(mut command) = python(&["check_jsonschema"]) else { return };
        command.args(["-m", "check_jsonschema", "--builtin-schema", schema, name]);
        let outcome = finish(command.current_dir(directory.path()));
        assert_eq!(outcome.code, Some(0), "{name}: {}{}", outcome.out, outcome.err);
    }
}

/// The machines of the farm are processes here, as on the page.
#[test]
fn the_farm_makes_one_report_of_its_shards() {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/guide/ci.md")).unwrap();
    let script = page.split("```bash\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let farm = TempDir::new().unwrap();
    std::fs::create_dir(farm.path().join("scenarios")).unwrap();
    for name in ["a", "b", "c", "d", "e"] {
        let text = "poke(\"node2.w_CPU_CONTROL\", 1); wait(\"node2.w_OPTION_STATUS\", 2, \"1ms\");";
        std::fs::write(farm.path().join("scenarios").join(name).with_extension("rhai"), text).unwrap();
    }
    let program = Path::new(commram().get_program()).parent().unwrap().display().to_string();
    let path = format!("{program}:{}", std::env::var("PATH").unwrap());
    let outcome = finish(Command::new("bash").args(["-ec", script]).current_dir(&farm).env("PATH", path));
    assert!(outcome.ok().ends_with("5 passed, 0 failed, 0 broken\n"), "{}{}", outcome.out, outcome.err);
    let report = std::fs::read_to_string(farm.path().join("report.xml")).unwrap();
    assert!(report.contains("<testsuites name=\"commram\" tests=\"5\""), "{report}");
}

#[test]
fn the_kubernetes_job_has_as_many_shards_as_pods() {
    let manifest = Path::new(ROOT).join("tools/farm/job.yaml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    let value =
        |key: &str| text.lines().find_map(|line| line.trim().strip_prefix(key)).unwrap().trim().to_owned();
    let pods = value("completions:");
    assert_eq!(value("parallelism:"), pods);
    assert!(text.contains(&format!("- $(JOB_COMPLETION_INDEX)/{pods}\n")), "{text}");
    let Some(mut command) = python_for("kubernetes", &["kubernetes_validate"]) else { return };
    let outcome = finish(command.args(["-m", "kubernetes_validate", "--strict"]).arg(manifest));
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
}
