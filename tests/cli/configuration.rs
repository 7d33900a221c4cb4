//! The configuration file, `-` as a file, `--quiet` and `--verbose`.

use crate::common::{Emulator, Outcome, commram, finish, run, unique_name};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs a command in `directory`, with the user's directory for configurations in `user`.
fn configured(directory: &Path, user: &Path, args: &[&str]) -> Outcome {
    let mut command = commram();
    command.args(args).current_dir(directory).env("XDG_CONFIG_HOME", user).env_remove("COMMRAM_CONFIG");
    finish(&mut command)
}

#[test]
fn a_configuration_file_sets_the_defaults_of_options() {
    let emulator = Emulator::stepped();
    let (directory, user) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    std::fs::create_dir(user.path().join("commram")).unwrap();
    let of_user = user.path().join("commram/commram.toml");
    std::fs::write(&of_user, format!("instance = \"{}\"\nformat = \"json\"\n", emulator.name)).unwrap();
    let run = |args: &[&str]| configured(directory.path(), user.path(), args);
    assert!(run(&["peek", "node2.w_CPU_CONTROL"]).ok().starts_with("[\n"), "instance and format");
    assert_eq!(run(&["peek", "--raw", "node2.w_CPU_CONTROL"]).ok(), "16#0000\n");
    assert!(
        run(&["peek", "node2.w_CPU_CONTROL", "--format", "csv"]).ok().starts_with("time_us,"),
        "command line"
    );
    // The file in the working directory has precedence over the file in the user's directory. The environment has
    // precedence over both files.
    let own = directory.path().join("commram.toml");
    std::fs::write(&own, "format = \"text\"\nplant = \"p.toml\"\n").unwrap();
    assert!(run(&["peek", "node2.w_CPU_CONTROL"]).ok().starts_with("node2.w_CPU_CONTROL = "));
    std::fs::write(directory.path().join("p.toml"), "[[plc]]\nname = 'only'\n").unwrap();
    assert!(run(&["plant", "check"]).ok().starts_with("p.toml: fine: 1 device, 0 buses"));
    let missing = unique_name();
    let mut command = commram();
    command
        .args(["peek", "node2.w_CPU_CONTROL"])
        .current_dir(directory.path())
        .env("COMMRAM_INSTANCE", &missing);
    let other = finish(command.env("XDG_CONFIG_HOME", user.path()).env_remove("COMMRAM_CONFIG"));
    assert!(other.fails(3).contains(&missing), "{}", other.err);
    let verbose = run(&["list", "--verbose"]);
    assert!(verbose.err.contains("note: configuration: instance = "), "{}", verbose.err);
}

#[test]
fn a_wrong_configuration_file_is_ignored_with_a_note() {
    let (directory, user) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let own = directory.path().join("commram.toml");
    for (text, expected) in [
        ("instance = \"x\"\ncolour = \"never\"\n", "commram.toml is ignored: line 2: unknown field `colour`"),
        ("format = \"xml\"\n", "format = \"xml\": write one of text, json, csv, md"),
        ("instance = \"a/b\"\n", "instance: "),
    ] {
        std::fs::write(&own, text).unwrap();
        let outcome = configured(directory.path(), user.path(), &["list"]);
        assert!(outcome.code == Some(0) && outcome.err.contains(expected), "{text}: {}", outcome.err);
        assert_eq!(configured(directory.path(), user.path(), &["list", "-q"]).err, "");
    }
    if rustix::process::geteuid().is_root() {
        std::fs::write(&own, "instance = \"x\"\n").unwrap();
        std::os::unix::fs::chown(&own, Some(65_534), None).unwrap();
        let outcome = configured(directory.path(), user.path(), &["list"]);
        assert!(
            outcome.err.contains("commram.toml is ignored: it belongs to another user"),
            "{}",
            outcome.err
        );
        // The paths in the file count from the directory of the link, so the link decides, too.
        let target = user.path().join("own.toml");
        std::fs::rename(&own, &target).unwrap();
        std::os::unix::fs::chown(&target, Some(0), None).unwrap();
        std::os::unix::fs::symlink(&target, &own).unwrap();
        assert_eq!(configured(directory.path(), user.path(), &["list"]).err, "");
        std::os::unix::fs::lchown(&own, Some(65_534), None).unwrap();
        let outcome = configured(directory.path(), user.path(), &["list"]);
        let expected = "commram.toml is ignored: it is a link of another user";
        assert!(outcome.err.contains(expected), "{}", outcome.err);
    }
}

#[test]
fn messages_name_the_variable_of_a_wrong_value() {
    let with = |variable: &str, value: &str, args: &[&str]| finish(commram().args(args).env(variable, value));
    let outcome = with("COMMRAM_CONFIG", "/nonexistent/commram.toml", &["list"]);
    let expected = "COMMRAM_CONFIG: /nonexistent/commram.toml is ignored: the file does not exist";
    assert!(outcome.code == Some(0) && outcome.err.contains(expected), "{}", outcome.err);
    let outcome = with("COMMRAM_CONFIG", "/nonexistent/a\nb", &["list"]);
    assert!(outcome.err.contains("COMMRAM_CONFIG: /nonexistent/a\\nb is ignored: "), "{}", outcome.err);
    for (variable, value, option) in [
        ("COMMRAM_INSTANCE", "", "--instance <NAME>"),
        ("COMMRAM_INSTANCE", "a/b", "--instance <NAME>"),
        ("COMMRAM_CONNECT_TIMEOUT", "x", "--connect-timeout <TIME>"),
        ("COMMRAM_CONNECT_TIMEOUT", "", "--connect-timeout <TIME>"),
    ] {
        let outcome = with(variable, value, &["status"]);
        let expected = format!("'{variable} ({option})'");
        assert!(outcome.fails(2).contains(&expected), "{}", outcome.err);
        let outcome = with(variable, "default", &["status", "--instance", "a/b"]);
        assert!(outcome.fails(2).contains("'--instance <NAME>'"), "{}", outcome.err);
    }
    let emulator = Emulator::stepped();
    let web = ["web", "--listen", "127.0.0.1:0", "-i", &emulator.name];
    let outcome = with("XDG_RUNTIME_DIR", "/nonexistent", &web);
    let expected = "/nonexistent/commram: ";
    assert!(outcome.err.contains(expected) && outcome.err.contains("set XDG_RUNTIME_DIR"), "{}", outcome.err);
    assert_eq!(outcome.code, Some(3));
}

#[test]
fn a_pipe_or_a_long_file_in_place_of_the_configuration_is_ignored_with_a_note() {
    let (directory, user) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let own = directory.path().join("commram.toml");
    std::fs::write(&own, "#".repeat(65_537)).unwrap();
    let long = configured(directory.path(), user.path(), &["list"]);
    assert!(long.err.contains("commram.toml is ignored: it has more than 65536 bytes"), "{}", long.err);
    std::fs::remove_file(&own).unwrap();
    rustix::fs::mkfifoat(rustix::fs::CWD, &own, rustix::fs::Mode::RUSR).unwrap();
    let pipe = configured(directory.path(), user.path(), &["list"]);
    assert!(pipe.code == Some(0) && pipe.err.contains("is ignored: it is not a file"), "{}", pipe.err);
}

/// Runs a command with this standard input.
fn with_input(command: &mut Command, input: &str) -> Outcome {
    let file = tempfile::NamedTempFile::new().unwrap();
    file.as_file().write_all(input.as_bytes()).unwrap();
    finish(command.stdin(Stdio::from(file.reopen().unwrap())))
}

#[test]
fn a_dash_is_standard_input_or_output() {
    let plant = "[[plc]]\nname = 'p'\n[[bus]]\nname = 'b'\n";
    let checked = with_input(commram().args(["plant", "check", "-"]), plant);
    assert!(checked.ok().starts_with("-: fine: 1 device, 1 bus"), "{}", checked.out);
    let name = unique_name();
    let started =
        with_input(commram().args(["run", "-", "--clock", "stepped", "--detach", "-i", &name]), plant);
    assert!(started.ok().contains(&format!("/dev/shm/commram.{name}.p")), "{}", started.out);
    run(&["stop", "-i", &name]).ok();
    assert_eq!(run(&["run", "--detach", "-q", "-i", &name]).ok(), "");
    run(&["stop", "-i", &name]).ok();
    let emulator = Emulator::stepped();
    let before = emulator.run("dump", &["--format", "json"]).ok().to_owned();
    let same = with_input(&mut emulator.command("diff", &["-"]), &before);
    assert_eq!(same.ok(), "no differences\n");
    let plot = emulator.run("plot", &["node2.w_CPU_CONTROL", "-o", "-", "-q"]);
    assert!(plot.ok().starts_with("<svg "), "{}", plot.out);
    let map = run(&["export", "c", "-o", "-"]);
    assert_eq!(map.ok(), run(&["export", "c"]).ok());
}

#[test]
fn a_scenario_comes_from_the_standard_input() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("p.toml"), "[[plc]]\nname = 'press'\n").unwrap();
    let text = "plant(\"p.toml\");\nexpect(\"press:node1.w_CPU_CONTROL\", 1);\n";
    let failed = with_input(commram().args(["test", "-"]).current_dir(directory.path()), text);
    assert_eq!(failed.code, Some(1), "{}", failed.err);
    let line = "line      -:2: expect(\"press:node1.w_CPU_CONTROL\", 1);";
    assert!(failed.out.starts_with("failed  -  ") && failed.out.contains(line), "{}", failed.out);
    let passed =
        with_input(commram().args(["test", "-", "--junit", "-"]), "expect(\"node1.w_CPU_CONTROL\", 0);");
    assert_eq!(passed.code, Some(0), "{passed:?}");
    assert!(passed.out.contains("<testsuite name=\"-\""), "{}", passed.out);
    // The results go to the standard error output, so that a program can read the report.
    assert!(passed.out.starts_with("<?xml ") && passed.err.contains("1 passed"), "{passed:?}");
    for (report, begin) in [("json=-", "["), ("html=-", "<!")] {
        for format in ["text", "json", "csv"] {
            let mut command = commram();
            let passed = with_input(
                command.args(["test", "-", "--format", format, "--report", report]),
                "expect_that(true, \"fine\");",
            );
            assert!(
                passed.code == Some(0) && passed.out.starts_with(begin) && passed.err.contains("passed"),
                "{passed:?}"
            );
        }
    }
    let refused = with_input(commram().args(["test", "-", "--format", "events", "--junit", "-"]), "now();");
    assert!(
        refused.fails(2).contains("`--format events`: a report goes to the standard output"),
        "{refused:?}"
    );
    let refused = with_input(commram().args(["test", "-", "--watch"]), text);
    assert!(refused.fails(2).contains("`-`: the standard input does not change"), "{}", refused.err);
    let long = with_input(commram().args(["test", "-"]), &"// long\n".repeat(10_000));
    assert!(long.fails(2).contains("`-`: it is longer than 64 KiB"), "{}", long.err);
}

#[test]
fn a_command_that_writes_several_files_refuses_a_dash() {
    assert!(run(&["man", "-"]).fails(2).contains("`-`: the pages are many files; give a directory"));
    assert!(run(&["test", "--definitions", "-"]).ok().contains("fn poke("));
}
