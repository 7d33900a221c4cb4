//! Follows docs/guide/ci.md: creates the files of the page and of `tools/ci`, and runs their scripts.

use crate::common::{Outcome, commram, finish, python, python_for, wait_for};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// The package of the jobs, in the repository.
const PACKAGE: &str = "packages/commram.tar.gz";

/// Returns a file of the page: the block after a line that ends with its path.
fn file(name: &str) -> String {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/guide/ci.md")).unwrap();
    let (_, rest) = page.split_once(&format!("`{name}`:\n\n```yaml\n")).unwrap();
    rest.split_once("\n```").unwrap().0.to_owned() + "\n"
}

/// Creates a project with the files of the page, and a package in the form of the tarball. Returns the package's checksum too.
fn repository() -> (TempDir, String) {
    let directory = TempDir::new().unwrap();
    let at = |name: &str| directory.path().join(name);
    let project = directory.path().to_str().unwrap();
    finish(commram().args(["new", project])).ok();
    for name in [".github/workflows/scenarios.yml", ".gitlab-ci.yml"] {
        std::fs::write(at(name), file(name)).unwrap();
    }
    let program = at("commram-0.1.0-x86_64-linux/bin/commram");
    std::fs::create_dir_all(program.parent().unwrap()).unwrap();
    std::fs::create_dir(at("packages")).unwrap();
    std::fs::write(&program, format!("#!/bin/sh\nexec {} \"$@\"\n", commram().get_program().display()))
        .unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let script = format!("tar czf {PACKAGE} commram-0.1.0-x86_64-linux && sha256sum {PACKAGE}");
    let sum = finish(Command::new("sh").args(["-c", &script]).current_dir(directory.path())).ok().to_owned();
    std::fs::remove_dir_all(at("commram-0.1.0-x86_64-linux")).unwrap();
    (directory, sum.split(' ').next().unwrap().to_owned())
}

/// Returns the scripts of a file: blocks after a line that ends with ` |`, without their indentation.
fn scripts(text: &str) -> Vec<String> {
    let mut scripts = Vec::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line.trim_start() != "run: |" && line.trim_start() != "- |" {
            continue;
        }
        let indent = |line: &str| line.len() - line.trim_start().len();
        let depth = lines.peek().map_or(0, |first| indent(first));
        let mut script = String::new();
        while let Some(line) = lines.next_if(|line| line.is_empty() || indent(line) >= depth) {
            script += line.get(depth..).unwrap_or_default();
            script.push('\n');
        }
        scripts.push(script);
    }
    scripts
}

/// Runs a script as a server does. Its environment has no commram.
fn run_script(directory: &Path, script: &str, path: &str, environment: &[(&str, &str)]) -> Outcome {
    let mut command = Command::new("bash");
    command.args(["-eo", "pipefail", "-c", script]).current_dir(directory).env("PATH", path);
    finish(command.envs(environment.iter().copied()))
}

/// Checks the page for people in the directory of reports, and returns the JUnit report.
fn read_reports(directory: &Path, name: &str) -> String {
    let page = std::fs::read_to_string(directory.join(format!("{name}.html"))).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>"), "{page}");
    std::fs::read_to_string(directory.join(format!("{name}.xml"))).unwrap()
}

/// Runs the command of the page that merges the reports of the shards.
fn assert_merged(directory: &Path, page: &str, path: &str) {
    let command = page.lines().find_map(|line| line.split_once("commram test merge "));
    let (_, arguments) = command.unwrap();
    let merged = run_script(directory, &format!("commram test merge {arguments}"), path, &[]);
    assert_eq!(merged.code, Some(0), "{}{}", merged.out, merged.err);
    let report = std::fs::read_to_string(directory.join("report.xml")).unwrap();
    assert!(report.contains("tests=\"1\" failures=\"0\" errors=\"0\""), "{report}");
}

/// The scenario is in the first of two shards. The second shard has no scenario and passes.
fn assert_shared([first, second]: [String; 2]) {
    assert!(first.contains("tests=\"1\" failures=\"0\" errors=\"0\""), "{first}");
    assert!(first.contains("file=\"scenarios/start.rhai\""), "{first}");
    assert!(second.contains("tests=\"0\""), "{second}");
}

/// Runs the steps of the action with the inputs of the workflow. `GITHUB_PATH` names a file with directories for the next
/// steps.
#[test]
fn the_action_for_github_installs_a_package_and_runs_the_scenarios() {
    let (directory, sum) = repository();
    let action =
        std::fs::read_to_string(directory.path().join(".github/actions/commram/action.yml")).unwrap();
    let [install, test] = &scripts(&action)[..] else { panic!("two scripts: {action}") };
    assert!(file(".github/workflows/scenarios.yml").contains("arguments: --shard ${{ matrix.shard }}/2\n"));
    let paths = directory.path().join("paths");
    let environment = |sum: &str| -> Vec<(&'static str, String)> {
        vec![
            ("COMMRAM_PACKAGE", PACKAGE.to_owned()),
            ("COMMRAM_SHA256", sum.to_owned()),
            ("COMMRAM_SCENARIOS", "scenarios".to_owned()),
            ("GITHUB_PATH", paths.display().to_string()),
        ]
    };
    let run = |script: &str, path: &str, sum: &str, arguments: &str| {
        let environment = environment(sum);
        let mut environment: Vec<_> = environment.iter().map(|(name, text)| (*name, text.as_str())).collect();
        environment.push(("COMMRAM_ARGUMENTS", arguments));
        run_script(directory.path(), script, path, &environment)
    };
    let system = "/usr/local/bin:/usr/bin:/bin";
    let wrong = run(install, system, &"0".repeat(64), "");
    assert_eq!(wrong.code, Some(1), "a wrong checksum ends the job: {}", wrong.err);
    let installed = run(install, system, &sum, "");
    assert_eq!(installed.code, Some(0), "{}", installed.err);
    let path = format!("{}:{system}", std::fs::read_to_string(&paths).unwrap().trim());
    std::fs::create_dir(directory.path().join("shards")).unwrap();
    assert_shared(["1", "2"].map(|shard| {
        let outcome = run(test, &path, &sum, &format!("--shard {shard}/2"));
        assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
        // The action uploads and downloads the directory as an artifact.
        let artifact = directory.path().join("shards").join(format!("commram-reports-{shard}"));
        std::fs::rename(directory.path().join("commram-reports"), &artifact).unwrap();
        read_reports(&artifact, "report")
    }));
    assert_merged(directory.path(), &file(".github/workflows/scenarios.yml"), &path);

    // The pattern in the command must not be expanded by the shell, even if it matches files.
    std::fs::write(directory.path().join("st-no"), "").unwrap();
    let filtered = run(test, &path, &sum, "--filter st*");
    assert!(filtered.ok().contains("1 passed, 0 failed, 0 broken"), "{}{}", filtered.out, filtered.err);
}

#[test]
fn a_wrong_package_is_refused_by_name() {
    let (directory, sum) = repository();
    let script = &scripts(&std::fs::read_to_string(Path::new(ROOT).join("tools/ci/gitlab.yml")).unwrap())[0];
    let line = format!("{sum}  commram-0.1.0-x86_64-linux.tar.gz");
    for (package, sum, message) in [
        ("", "", "COMMRAM_PACKAGE: set it to the path or the address (https) of commram-VERSION-"),
        (
            "http://localhost/x.tar.gz",
            "",
            "http://localhost/x.tar.gz is not encrypted; use an address with https",
        ),
        (PACKAGE, line.as_str(), ""),
    ] {
        let environment = [("COMMRAM_PACKAGE", package), ("COMMRAM_SHA256", sum)];
        let outcome = run_script(directory.path(), script, "/usr/local/bin:/usr/bin:/bin", &environment);
        assert_eq!(outcome.code == Some(0), message.is_empty(), "{}", outcome.err);
        assert!(outcome.err.contains(message), "{package}: {}", outcome.err);
    }
}

/// If a server cancels a job, it sends a signal only to the shell of the step, not to the programs that the shell has
/// started.
#[test]
fn a_cancelled_job_writes_its_reports() {
    let (directory, _) = repository();
    let endless = "step(\"1ms\"); while true { }";
    std::fs::write(directory.path().join("scenarios/z.rhai"), endless).unwrap();
    let test = &scripts(&std::fs::read_to_string(Path::new(ROOT).join("tools/ci/action.yml")).unwrap())[1];
    let programs = Path::new(commram().get_program()).parent().unwrap().display().to_string();
    for signal in ["-INT", "-TERM"] {
        let mut shell = Command::new("bash");
        shell.args(["-eo", "pipefail", "-c", test]).current_dir(directory.path());
        shell.env("PATH", format!("{programs}:/usr/local/bin:/usr/bin:/bin"));
        shell.env("COMMRAM_SCENARIOS", "scenarios");
        shell.env("COMMRAM_ARGUMENTS", "--jobs 1 --max-operations 1000000000000");
        let mut shell = shell.stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(shell.stdout.take().unwrap()).lines().map(Result::unwrap);
        let rest = lines.skip_while(|line| !line.starts_with("passed  scenarios/start.rhai"));
        let mut rest = rest.peekable();
        assert!(rest.peek().is_some(), "the first scenario does not end");
        assert!(Command::new("kill").args([signal, &shell.id().to_string()]).status().unwrap().success());
        assert_eq!(wait_for(&mut shell, "a cancelled job").code(), Some(130), "{signal}");
        let reports = directory.path().join("commram-reports");
        let junit = read_reports(&reports, "report");
        assert!(junit.contains("tests=\"2\"") && junit.contains("interrupted"), "{signal}: {junit}");
        std::fs::remove_dir_all(reports).unwrap();
    }
}

#[test]
fn the_job_for_gitlab_installs_a_package_and_runs_the_scenarios() {
    let (directory, sum) = repository();
    let template = std::fs::read_to_string(directory.path().join(".gitlab/commram.yml")).unwrap();
    let parts = scripts(&template);
    assert_eq!(parts.len(), 2, "before_script, script: {template}");
    assert!(file(".gitlab-ci.yml").contains("COMMRAM_ARGUMENTS: --shard $CI_NODE_INDEX/$CI_NODE_TOTAL\n"));
    // GitLab runs both parts in one shell.
    let script = parts.concat();
    let path = "/usr/local/bin:/usr/bin:/bin";
    let reports = directory.path().join("commram-reports");
    assert!(file(".gitlab-ci.yml").contains("COMMRAM_REPORT: report-$CI_NODE_INDEX\n"));
    assert_shared(["1", "2"].map(|shard| {
        let (arguments, report) = (format!("--shard {shard}/2"), format!("report-{shard}"));
        let environment = [
            ("COMMRAM_PACKAGE", PACKAGE),
            ("COMMRAM_SHA256", sum.as_str()),
            ("COMMRAM_SCENARIOS", "scenarios"),
            ("COMMRAM_ARGUMENTS", arguments.as_str()),
            ("COMMRAM_REPORT", report.as_str()),
        ];
        let outcome = run_script(directory.path(), &script, path, &environment);
        assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
        read_reports(&reports, &report)
    }));
    let installed = format!("{}/.commram/bin:{path}", directory.path().display());
    assert_merged(directory.path(), &file(".gitlab-ci.yml"), &installed);
}

/// The files for GitHub and GitLab install the package by equal commands.
#[test]
fn the_servers_share_their_steps() {
    let text = |name: &str| std::fs::read_to_string(Path::new(ROOT).join("tools/ci").join(name)).unwrap();
    let (github, gitlab) = (scripts(&text("action.yml")), scripts(&text("gitlab.yml")));
    assert_eq!(github[1], gitlab[1]);
    let without_path =
        |script: &str| script.lines().filter(|line| !line.contains("PATH")).collect::<Vec<_>>().join("\n");
    assert_eq!(without_path(&github[0]), without_path(&gitlab[0]));
}

#[test]
fn the_servers_accept_their_files() {
    let (directory, _) = repository();
    let release = format!("{ROOT}/.github/workflows/release.yml");
    let mut files = vec![
        (".github/workflows/scenarios.yml".to_owned(), "vendor.github-workflows"),
        (".github/actions/commram/action.yml".to_owned(), "vendor.github-actions"),
        (".gitlab-ci.yml".to_owned(), "vendor.gitlab-ci"),
        (".gitlab/commram.yml".to_owned(), "vendor.gitlab-ci"),
        (release, "vendor.github-workflows"),
    ];
    for template in ["minimal", "soft-plc-c", "soft-plc-rust", "pytest"] {
        let project = directory.path().join(template);
        finish(commram().args(["new", "--template", template]).arg(&project)).ok();
        files.push((format!("{template}/.github/workflows/commram.yml"), "vendor.github-workflows"));
        files.push((format!("{template}/.gitlab-ci.yml"), "vendor.gitlab-ci"));
    }
    for (name, schema) in files {
        let Some(mut command) = python(&["check_jsonschema"]) else { return };
        command.args(["-m", "check_jsonschema", "--builtin-schema", schema]);
        if schema.ends_with("gitlab-ci") {
            // With this option check-jsonschema accepts `!reference`.
            command.args(["--data-transform", "gitlab-ci"]);
        }
        let outcome = finish(command.arg(&name).current_dir(directory.path()));
        assert_eq!(outcome.code, Some(0), "{name}: {}{}", outcome.out, outcome.err);
    }
}

/// `tools/package` makes each package that the page names, and the release publishes these packages.
#[test]
fn the_release_makes_the_packages_of_the_page() {
    let read = |name: &str| std::fs::read_to_string(Path::new(ROOT).join(name)).unwrap();
    let (page, script, release) =
        (read("docs/guide/ci.md"), read("tools/package"), read(".github/workflows/release.yml"));
    for word in ["deb", "tarball", "image", "wheel", "sbom"] {
        assert!(page.contains(&format!("tools/package {word}")), "{word}");
        assert!(script.contains(&format!("\n{word}() {{\n")), "{word}");
    }
    assert!(
        release.contains("run: tools/package\n") && release.contains("target/dist/SHA256SUMS\n"),
        "{release}"
    );
}

/// The page describes a farm of machines. In this test, processes replace the machines.
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
