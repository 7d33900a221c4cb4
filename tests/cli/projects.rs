//! `commram new`: a project, and the commands that it prints.

use crate::common::{Outcome, commram, devices, finish, finish_on_a_full_disk, is_there, run};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// Creates the project `my press` in the directory. Returns the commands that follow.
fn new(directory: &Path, args: &[&str]) -> Vec<String> {
    let outcome = finish(commram().args(["new", "my press"]).args(args).current_dir(directory));
    let (files, commands) = outcome.ok().split_once("\n\nNext:\n").unwrap();
    for file in files.lines() {
        assert!(directory.join(file).is_file(), "{file}");
    }
    commands.lines().map(|line| line.strip_prefix("  ").unwrap().to_owned()).collect()
}

/// Runs the commands in one shell, with the built program in its path.
fn follow(directory: &Path, commands: &[String], environment: &[(&str, &str)]) -> Outcome {
    let programs = Path::new(env!("CARGO_BIN_EXE_commram")).parent().unwrap().display().to_string();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap());
    let mut shell = Command::new("sh");
    shell.args(["-ec", &commands.join("\n")]).current_dir(directory).env("PATH", path);
    finish(shell.envs(environment.iter().copied()))
}

#[test]
fn the_commands_of_a_new_project_pass_on_every_device() {
    for device in devices() {
        let directory = TempDir::new().unwrap();
        let commands = new(directory.path(), &["--device", device]);
        assert_eq!(
            commands,
            ["cd -- 'my press'", "commram plant check plant.toml", "commram test scenarios"]
        );
        let outcome = follow(directory.path(), &commands, &[]);
        let out = outcome.ok();
        assert!(
            out.starts_with("plant.toml: fine: ") && out.contains("1 passed, 0 failed, 0 broken"),
            "{out}"
        );
        assert!(!out.contains("warning"), "{out}");
        // Makes the failing expectation of the template active: removes the slashes of its comment.
        let scenario = directory.path().join("my press/scenarios/start.rhai");
        let text = fs::read_to_string(&scenario).unwrap();
        fs::write(&scenario, text.replace("// expect(", "expect(")).unwrap();
        let outcome = follow(directory.path(), &commands[..], &[]);
        assert_eq!(outcome.code, Some(1), "{device}: {}", outcome.out);
        assert!(outcome.out.contains("\n    expected  16#"), "{device}: {}", outcome.out);
    }
}

#[test]
fn a_soft_plc_in_c_compiles_and_gets_its_answer() {
    if !is_there("make") {
        return;
    }
    for device in devices() {
        let directory = TempDir::new().unwrap();
        let commands = new(directory.path(), &["--device", device, "--template", "soft-plc-c"]);
        assert_eq!(commands.last().unwrap(), "make run");
        let flags = [("CFLAGS", "-std=c11 -O1 -Wall -Wextra -Werror"), ("MAKEFLAGS", "-e")];
        let outcome = follow(directory.path(), &commands, &flags);
        assert!(outcome.ok().lines().last().unwrap().contains(" = 0x00"), "{device}: {}", outcome.out);
    }
}

/// The device has the name of its directory, and passes its own scenario.
#[test]
fn a_device_in_a_folder_passes_its_scenario_and_serves_its_program() {
    let directory = TempDir::new().unwrap();
    let card = directory.path().join("counter");
    let outcome =
        finish(commram().args(["new", "counter", "--template", "device"]).current_dir(directory.path()));
    let (_, commands) = outcome.ok().split_once("\n\nNext:\n").unwrap();
    let mut commands: Vec<_> = commands.lines().map(|line| line.trim().to_owned()).collect();
    assert_eq!(commands, ["cd counter", "commram device check ./", "commram device test ./", "make run"]);
    if !is_there("make") || !is_there("cc") {
        commands.pop();
    }
    let flags = [("CFLAGS", "-std=c11 -O1 -Wall -Wextra -Werror"), ("MAKEFLAGS", "-e")];
    let outcome = follow(directory.path(), &commands, &flags);
    let out = &outcome.out;
    assert_eq!(outcome.code, Some(0), "{out}{}", outcome.err);
    assert!(out.contains("1 passed, 0 failed, 0 broken") && out.contains("card.w_STATUS"), "{out}");
    assert!(
        outcome.err.contains("counter (Counter card)") && outcome.err.contains("script with 2 hooks"),
        "{}",
        outcome.err
    );
    assert!(commands.len() < 4 || out.ends_with("count 20\n"), "{out}");
    for file in ["device.toml", "CARD.toml", "firmware.rhai", "tests/start.rhai", "client.c"] {
        assert!(card.join(file).is_file(), "{file}");
    }
    let message = run(&["new", "x", "--template", "device", "--device", "cs0015"]).fails(2).to_owned();
    assert!(message.contains("omit --device"), "{message}");
}

/// The package comes from the sources of this checkout, with the dependencies of its lock file.
#[test]
#[ignore = "it compiles the library once more; tools/nightly runs it"]
fn a_soft_plc_in_rust_compiles_and_gets_its_answer() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let directory = TempDir::new().unwrap();
    fs::create_dir(directory.path().join(".cargo")).unwrap();
    let patch =
        format!("[patch.crates-io]\ncommram = {{ path = '{}' }}\n[net]\noffline = true\n", root.display());
    fs::write(directory.path().join(".cargo/config.toml"), patch).unwrap();
    let target = root.join("target/projects");
    for device in devices() {
        let project = directory.path().join("my press");
        let commands = new(directory.path(), &["--device", device, "--template", "soft-plc-rust"]);
        fs::copy(root.join("Cargo.lock"), project.join("Cargo.lock")).unwrap();
        std::os::unix::fs::symlink(&target, project.join("target")).unwrap();
        let outcome = follow(directory.path(), &commands, &[("CARGO_TERM_QUIET", "true")]);
        assert_eq!(outcome.code, Some(0), "{device}: {}", outcome.err);
        assert!(outcome.out.lines().last().unwrap().contains(" = 0x00"), "{device}: {}", outcome.out);
        fs::remove_dir_all(project).unwrap();
    }
}

/// The files for GitHub and GitLab run pytest and the scenarios, even if one of the two fails, and keep both reports.
#[test]
fn only_the_project_for_pytest_needs_a_wheel_in_ci() {
    for template in ["minimal", "soft-plc-c", "soft-plc-rust", "pytest"] {
        let directory = TempDir::new().unwrap();
        new(directory.path(), &["--template", template]);
        let read = |name: &str| fs::read_to_string(directory.path().join("my press").join(name)).unwrap();
        let (github, gitlab) = (read(".github/workflows/commram.yml"), read(".gitlab-ci.yml"));
        for text in [&github, &gitlab] {
            let names_wheel = text.contains("\n# COMMRAM_WHEEL is the path or the address of the wheel");
            assert_eq!(names_wheel, template == "pytest", "{text}");
            assert_eq!(text.contains("COMMRAM_WHEEL"), names_wheel, "{text}");
            assert_eq!(
                text.contains("pytest --junit-xml commram-reports/pytest.xml\n"),
                names_wheel,
                "{text}"
            );
            assert!(text.contains(": --max-real-time 2min\n"), "{text}");
        }
        assert_eq!(github.contains("if: ${{ !cancelled() }}"), template == "pytest", "{github}");
        assert!(read(".gitlab/commram.yml").contains("junit: commram-reports/*.xml\n"));
        assert!(read(".gitignore").contains("\n/commram-report.html\n"));
    }
}

#[test]
fn nothing_is_overwritten_and_an_incomplete_project_is_removed() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("press");
    let project = path.to_str().unwrap();
    fs::create_dir_all(path.join(".vscode")).unwrap();
    let settings = path.join(".vscode/settings.json");
    fs::write(&settings, "old").unwrap();
    let message = run(&["new", project]).fails(2).to_owned();
    assert!(message.contains(".vscode/settings.json`: this file exists and is not overwritten"), "{message}");
    assert_eq!(fs::read_to_string(&settings).unwrap(), "old");
    assert_eq!(path.read_dir().unwrap().count(), 1);
    fs::remove_file(&settings).unwrap();

    // A file size limit of one kilobyte simulates a full disk.
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" new press"]).arg(commram().get_program());
    let outcome = finish(shell.current_dir(directory.path()));
    assert!(outcome.fails(3).contains("cannot write "), "{}", outcome.err);
    assert_eq!(path.read_dir().unwrap().count(), 1, "only .vscode, which was there");
    run(&["new", project]).ok();
    assert!(run(&["new", project]).fails(2).contains("plant.toml`: this file exists"));
    assert_eq!(finish_on_a_full_disk(commram().args(["new", "-"])).code, Some(4));
}

/// In each round, the signal arrives at another moment of the command.
#[test]
fn an_interrupted_project_is_complete_or_removed() {
    let directory = TempDir::new().unwrap();
    run(&["new", directory.path().join("whole").to_str().unwrap(), "--template", "pytest"]).ok();
    let count = |path: &Path| path.read_dir().map_or(0, |files| files.count());
    let all = count(&directory.path().join("whole"));
    for n in 0..40 {
        let path = directory.path().join(format!("p{n}"));
        let mut new = commram();
        new.args(["new", path.to_str().unwrap(), "--template", "pytest"]).stdout(Stdio::null());
        let mut child = new.stderr(Stdio::null()).spawn().unwrap();
        while !path.exists() && child.try_wait().unwrap().is_none() {}
        let _ = Command::new("kill").args(["-TERM", &child.id().to_string()]).stderr(Stdio::null()).status();
        child.wait().unwrap();
        assert!([0, all].contains(&count(&path)), "{n}: {} of {all}", count(&path));
    }
}

#[test]
fn a_dash_prints_the_plant_alone() {
    let printed = run(&["new", "-", "--device", "can-dp2"]);
    assert!(printed.ok().starts_with("#:schema ./plant.schema.json\n"), "{}", printed.out);
    assert!(printed.out.contains("kind = \"can-dp2\""), "{}", printed.out);
    let message = run(&["new", "-", "--template", "pytest"]).fails(2).to_owned();
    assert!(message.contains("`-`: only a plant goes to the standard output"), "{message}");
    assert!(run(&["plant", "new", "x.toml"]).fails(2).contains("tip: write `commram new DIR`"));
}

/// The path contains a character that all commands refuse when they read the folder. So `new` refuses it, too.
#[test]
fn a_device_with_control_characters_in_its_path_is_not_made() {
    let directory = TempDir::new().unwrap();
    let mut command = commram();
    command.args(["new", "--template", "device", "bell\u{7}x"]).current_dir(directory.path());
    let refused = finish(&mut command);
    assert!(refused.fails(2).contains("text in UTF-8 without control characters"), "{}", refused.err);
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
}
