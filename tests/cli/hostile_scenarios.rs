//! `commram test` with scenarios that loop, crash, hang or import each other. Each affects only itself, and a report
//! is always written.

use crate::common::{commram, eventually, finish, promised, wait_for};
use crate::scenarios::Scripts;
use rustix::fs::{Mode, OFlags};
use std::io::{BufRead, BufReader};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

#[test]
fn endless_output_of_a_scenario_is_cut_and_ended() {
    let scripts =
        Scripts::new(&[("print.rhai", "let text = \"ü\"; text.pad(10000, \"ü\"); loop { print(text) }")]);
    let outcome = scripts.run(&["print.rhai", "--max-operations", "10000", "--format", "json"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.err);
    let reports: serde_json::Value = serde_json::from_str(&outcome.out).unwrap();
    let printed = reports[0]["printed"].as_str().unwrap();
    assert!(printed.ends_with("\n(cut here: the first 1 MiB of a scenario's output are kept)\n"));
    assert!(printed.len() < 1_100_000, "{}", printed.len());
    assert_eq!(
        reports[0]["message"],
        "the script does not end: stopped after 10000 steps (--max-operations)"
    );
}

/// Reports and logs of CI services consist of lines.
#[test]
fn a_line_end_in_the_name_of_a_scenario_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("a\npassed  forged.rhai"), "now();").unwrap();
    for options in [&[][..], &["--list"]] {
        let outcome = finish(commram().arg("test").arg(directory.path()).args(options));
        let message = outcome.fails(2);
        assert!(message.contains("a\\npassed  forged.rhai`: the name of a file must not"), "{message}");
        assert_eq!((message.lines().count(), outcome.out.as_str()), (1, ""));
    }
}

/// Text that a script prints, expects or is named must not control the terminal.
#[test]
fn control_characters_of_scripts_are_spelled_out() {
    let clears = "\u{1b}[2J";
    let text = format!(
        "section(\"part {clears}\"); print(\"says {clears}\\r\u{9b}1m\");\nexpect(\"node2.b_BT_0\", 1); // {clears}\n"
    );
    let scripts =
        Scripts::new(&[("clear.rhai", &text), ("wrong.rhai", &format!("let x = \"{clears}\"; x +;\n"))]);
    let outcome = scripts.run(&["clear.rhai", "wrong.rhai"]);
    assert_eq!(outcome.code, Some(2), "{}", outcome.err);
    let is_harmless = |text: &str| !text.chars().any(|sign| sign.is_control() && sign != '\n');
    assert!(is_harmless(&outcome.out) && is_harmless(&outcome.err), "{:?}", outcome.out);
    for message in [
        "  section   part \\u{1b}[2J\n",
        "| says \\u{1b}[2J\\r\\u{9b}1m\n",
        "expect(\"node2.b_BT_0\", 1); // \\u{1b}[2J\n",
        "let x = \"\\u{1b}[2J\"; x +;\n",
    ] {
        assert!(outcome.out.contains(message), "{}\nlacks {message}", outcome.out);
    }
}

/// Control characters, and characters that change the direction of the text: a terminal would interpret them.
const HOSTILE: &str = "\u{1b}[2J\u{7f}\u{9b}31m\u{202e}\u{2066}\u{200f}";

#[track_caller]
fn assert_is_harmless(text: &str) {
    let interpreted = |sign: char| {
        sign.is_control() && !['\n', '\t'].contains(&sign) || HOSTILE.contains(sign) && !sign.is_ascii()
    };
    assert!(!text.contains(interpreted), "{text:?}");
}

#[test]
fn control_characters_reach_the_terminal_in_no_format() {
    let files = Scripts::new(&[
        ("clear.rhai", &format!("print(\"{HOSTILE}\"); expect_that(false, \"{HOSTILE}\");")),
        ("plant.toml", "[[plc]]\nname = \"\\u001b[2J\\u009b\\u202e\"\n"),
        ("empty.json", "[]"),
    ]);
    let register = serde_json::json!([{
        "plc": HOSTILE, "register": HOSTILE, "address": "%MB3.200000", "hex": "16#00", "meaning": HOSTILE
    }]);
    std::fs::write(files.0.path().join("dump.json"), register.to_string()).unwrap();
    let run = |args: &[&str]| {
        let outcome = finish(commram().args(args).current_dir(files.0.path()));
        assert_is_harmless(&outcome.out);
        assert_is_harmless(&outcome.err);
        outcome
    };
    let hostile = format!("{HOSTILE}.toml");
    std::fs::write(files.0.path().join(&hostile), "[[plc]]\nname = 'line'\n").unwrap();
    for format in ["text", "json", "csv", "md"] {
        let outcome = run(&["test", "clear.rhai", "--format", format]);
        assert_eq!(outcome.code, Some(1), "{format}: {}", outcome.err);
        let escape = match format {
            "json" => "\\u001b[2J\\u007f\\u009b",
            "md" => "\\u&#123;1b}[2J\\u&#123;7f}\\u&#123;9b}",
            _ => "\\u{1b}[2J\\u{7f}\\u{9b}",
        };
        assert!(outcome.out.contains(escape), "{format}: {}", outcome.out);
        assert_eq!(run(&["diff", "empty.json", "dump.json", "--format", format]).code, Some(1), "{format}");
        assert_eq!(run(&["run", "--check", "plant.toml", "--format", format]).code, Some(2), "{format}");
        assert_eq!(run(&["layout", "check", HOSTILE, "--format", format]).code, Some(2), "{format}");
        for command in [["plant", "check"], ["run", "--check"]] {
            let [first, second] = command;
            assert_eq!(run(&[first, second, &hostile, "--format", format]).code, Some(0), "{format}");
        }
    }
    // JSON keeps the text itself.
    let outcome = run(&["test", "clear.rhai", "--format", "json", "--shard", "1/1", "--junit", "report.xml"]);
    let report: serde_json::Value = serde_json::from_str(&outcome.out).unwrap();
    assert_eq!(report[0]["printed"], format!("{HOSTILE}\n"));
    std::fs::write(files.0.path().join("report.json"), outcome.out).unwrap();
    for report in ["report.xml", "report.json"] {
        assert_eq!(run(&["test", "merge", report]).code, Some(1), "{report}");
    }
}

/// Without this check, the second report would silently replace the first report.
#[test]
fn two_reports_in_one_file_are_refused() {
    let scripts = Scripts::new(&[("a.rhai", "step(1)")]);
    std::os::unix::fs::symlink("report", scripts.0.path().join("link")).unwrap();
    for page in ["html=report", "html=./report", "html=link"] {
        let outcome = scripts.run(&["a.rhai", "--junit", "report", "--report", page]);
        let message = outcome.fails(2);
        assert!(
            message.contains("--junit report --report html=") && message.contains("both name the same file"),
            "{message}"
        );
        assert!(!scripts.0.path().join("report").exists());
    }
    let outcome =
        scripts.run(&["a.rhai", "--allow-empty", "--junit", "/dev/null", "--report", "html=/dev/null"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
}

#[test]
fn a_report_that_is_too_long_names_the_limit() {
    let text = "let text = \"x\"; text.pad(1000000, 'x'); for n in 0..20 { section(text); } step(1);";
    let scripts = Scripts::new(&[("long.rhai", text)]);
    let outcome = scripts.run(&["long.rhai", "--allow-empty"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.err);
    let message =
        "long.rhai: its report has 20 MiB, and the limit is 16 MiB: use fewer or shorter texts in section()";
    assert!(outcome.out.contains(message), "{}", &outcome.out[..outcome.out.len().min(1000)]);
}

/// Two circular imports, one direct and one through the scenario itself, and one module that is imported twice.
#[test]
fn imports_in_a_circle_are_named_with_their_lines() {
    let scripts = Scripts::new(&[
        ("self.rhai", "// nothing\nimport \"self\" as me;\n"),
        ("main.rhai", "import \"a\" as a;\n"),
        ("a.rhai", "\nimport \"b\" as b;\n"),
        ("b.rhai", "\n\nimport \"./a\" as a;\n"),
        ("twice.rhai", "import \"part\" as p; import \"other\" as o; o::part();"),
        ("other.rhai", "import \"part\" as p; fn part() { p::part() }"),
        ("part.rhai", "fn part() { step(\"1ms\"); expect(\"node2.b_BT_0\", 0); }"),
    ]);
    let outcome = scripts.run(&["self.rhai", "main.rhai", "twice.rhai", "--junit", "report.xml"]);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(2), ""));
    for expected in [
        "broken  self.rhai  0.000000 s emulated",
        "  self.rhai:2: `self`: this import is circular: self.rhai:2 imports self.rhai\n",
        "  b.rhai:3: `./a`: this import is circular: a.rhai:2 imports b.rhai, b.rhai:3 imports a.rhai\n",
        "    line      import \"./a\" as a;\n",
        "passed  twice.rhai  0.001000 s emulated",
        "1 passed, 0 failed, 2 broken; ",
    ] {
        assert!(outcome.out.contains(expected), "{}\nlacks {expected}", outcome.out);
    }
    assert!(scripts.read("report.xml").contains("tests=\"3\""));
}

#[test]
fn deeply_nested_imports_are_refused() {
    let scripts = Scripts::new(&[]);
    for n in 0..100 {
        let text = format!("import \"s{}\" as next;\n", n + 1);
        std::fs::write(scripts.0.path().join(format!("s{n}.rhai")), text).unwrap();
    }
    let outcome = scripts.run(&["s0.rhai"]);
    assert_eq!(outcome.code, Some(2), "{}", outcome.out);
    assert!(outcome.out.contains("s32.rhai:1: `s33`: imports may be nested 32 deep"), "{}", outcome.out);
}

#[test]
fn a_loop_ends_after_its_real_time() {
    let scripts = Scripts::new(&[("loop.rhai", "let n = 0;\nloop { n += 1 }")]);
    let outcome =
        scripts.run(&["loop.rhai", "--max-real-time", "100ms", "--max-operations", "1000000000000"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.out);
    let expected = "the script does not end: stopped after 100 ms of real time (--max-real-time)\n    line      loop.rhai:2: ";
    let plain = outcome.out.replace("  ", " ");
    assert!(plain.contains(&expected.replace("  ", " ")), "{}", outcome.out);
}

/// The engine restarts its count of operations at each call of a closure.
#[test]
fn steps_of_closures_are_counted() {
    let text = "let a = []; a.pad(100000, 1); let sum = 0; a.for_each(|x| sum += x);";
    let scripts = Scripts::new(&[("closures.rhai", text)]);
    let outcome = scripts.run(&["closures.rhai", "--max-operations", "10000"]);
    let expected = "the script does not end: stopped after 10000 steps (--max-operations)";
    assert!(outcome.code == Some(1) && outcome.out.contains(expected), "{outcome:?}");
}

#[test]
fn a_scenario_that_crashes_harms_no_other() {
    let scripts = Scripts::new(&[
        ("1-memory.rhai", "print(\"begins\"); let all = []; loop { all.push(snapshot(\"node2\")) }"),
        ("2-good.rhai", "print(\"fine\"); step(\"1ms\"); expect_no_findings();"),
    ]);
    let files = ["1-memory.rhai", "2-good.rhai"];
    let outcome = scripts.run(&[&files[..], &["--max-memory", "64", "--junit", "report.xml"]].concat());
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(1), ""));
    for expected in [
        "died    1-memory.rhai  in ",
        "1-memory.rhai: its process ended before the scenario was finished (signal: 6 (SIGABRT)",
        "memory allocation of ",
        "  | begins\n",
        "passed  2-good.rhai  0.001000 s emulated in ",
        "1 passed, 0 failed, 0 broken, 1 died; ",
    ] {
        assert!(outcome.out.contains(expected), "{}\nlacks {expected}", outcome.out);
    }
    let report = scripts.read("report.xml");
    assert!(report.contains("<error message=\"1-memory.rhai: its process"), "{report}");
    assert!(report.contains("tests=\"2\""), "{report}");
}

/// Creates a script as a pipe with one blank in it and an open writer, so that reading it never ends.
pub(crate) fn endless_script(path: &Path) -> OwnedFd {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    let pipe = rustix::fs::open(path, OFlags::RDWR | OFlags::CLOEXEC, Mode::empty()).unwrap();
    rustix::io::write(&pipe, b" ").unwrap();
    pipe
}

#[test]
fn a_scenario_that_hangs_within_a_step_is_killed_and_harms_no_other() {
    let scripts = Scripts::new(&[("2-good.rhai", "expect_no_findings();")]);
    let _pipe = endless_script(&scripts.0.path().join("1-pipe.rhai"));
    let outcome = scripts.run(&["1-pipe.rhai", "2-good.rhai", "--max-real-time", "1s", "--format", "json"]);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(1), ""));
    let reports: serde_json::Value = serde_json::from_str(&outcome.out).unwrap();
    assert_eq!((&reports[0]["outcome"], &reports[1]["outcome"]), (&"died".into(), &"passed".into()));
    let expected =
        "1-pipe.rhai: killed: after 1 s of real time (--max-real-time) it was still at the same step";
    assert_eq!((&reports[0]["message"], reports[0].get("emulated_us")), (&expected.into(), None));
}

#[test]
fn a_report_is_written_although_the_user_interrupts_the_run() {
    let scripts = Scripts::new(&[("1-good.rhai", "expect_no_findings()"), ("3-good.rhai", "")]);
    let pipe = endless_script(&scripts.0.path().join("2-pipe.rhai"));
    let files = ["1-good.rhai", "2-pipe.rhai", "3-good.rhai"];
    let mut command = scripts.command(&[&files[..], &["--jobs", "1", "--junit", "report.xml"]].concat());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.next().unwrap().starts_with("passed  1-good.rhai"));
    let is_read = || rustix::io::ioctl_fionread(&pipe).unwrap() == 0;
    assert!(eventually(is_read), "the second scenario does not begin");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<_> = lines.collect();
    assert_eq!(wait_for(&mut child, "an interrupted test").code(), Some(130));
    assert!(rest.contains(&"  2-pipe.rhai: interrupted".to_owned()), "{rest:?}");
    assert!(rest.contains(&"not run  3-good.rhai  interrupted".to_owned()), "{rest:?}");
    assert!(
        rest.last().unwrap().starts_with("1 passed, 0 failed, 0 broken, 1 died, 1 not run; "),
        "{rest:?}"
    );
    let report = scripts.read("report.xml");
    assert!(
        report.contains("tests=\"3\"") && report.contains("<skipped message=\"interrupted\"/>"),
        "{report}"
    );
}

/// A scenario that always prints never leaves a pause between two of its messages.
#[test]
fn a_signal_ends_a_scenario_that_prints_without_a_pause() {
    let scripts = Scripts::new(&[("a.rhai", "loop { section(`at ${now()}`); step(1); }")]);
    let mut command = scripts.command(&["a.rhai", "--format", "events", "--junit", "report.xml"]);
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("\"section\"")));
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let last = lines.last().unwrap();
    assert!(last.contains("\"summary\"") && last.contains("\"died\":1"), "{last}");
    assert_eq!(wait_for(&mut child, "an interrupted test").code(), Some(130));
    assert!(scripts.read("report.xml").contains("interrupted"));
}

/// The reader closes the pipe early, like `| head -1`.
#[test]
fn a_report_is_written_although_the_output_is_not_read() {
    let scripts = Scripts::new(&[("a.rhai", "step(1)"), ("b.rhai", "step(1)")]);
    let mut command = scripts.command(&["a.rhai", "b.rhai", "--junit", "report.xml"]);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut child = command.stdout(writer).spawn().unwrap();
    wait_for(&mut child, "a test with a closed standard output");
    assert!(scripts.read("report.xml").contains("tests=\"2\""));
}

#[test]
fn imports_of_pipes_and_without_names_end_at_once() {
    let scripts = Scripts::new(&[
        ("pipe.rhai", "import \"fifo\" as p; step(1);"),
        ("empty.rhai", "import \"\" as p; step(1);"),
        ("dot.rhai", "import \".\" as p; step(1);"),
    ]);
    assert!(Command::new("mkfifo").arg(scripts.0.path().join("fifo.rhai")).status().unwrap().success());
    let piped = promised(Duration::from_secs(10), || scripts.run(&["--allow-empty", "pipe.rhai"]));
    assert!(piped.code == Some(2) && piped.out.contains("it is an empty pipe"), "{piped:?}");
    for file in ["empty.rhai", "dot.rhai"] {
        let refused = scripts.run(&["--allow-empty", file]);
        assert!(refused.code == Some(2) && refused.out.contains("name the file of a script"), "{refused:?}");
    }
}

#[test]
fn a_scenario_without_memory_names_the_option() {
    let scripts =
        Scripts::new(&[("big.rhai", "let s = \"x\"; for i in 0..20 { s += s; } loop { section(s); }")]);
    let died = scripts.run(&["--max-memory", "64", "big.rhai"]);
    assert!(died.code == Some(1) && died.out.contains("than the 64 MiB of --max-memory"), "{died:?}");
}

#[test]
fn a_report_is_well_formed_for_any_text() {
    let scripts = Scripts::new(&[("odd.rhai", "print(\"a\u{fffe}b\"); expect_that(false, \"c\u{ffff}d\");")]);
    scripts.run(&["odd.rhai", "--junit", "report.xml"]);
    let report = scripts.read("report.xml");
    assert!(report.contains("a\u{fffd}b") && report.contains("c\u{fffd}d"), "{report}");
    assert!(!report.contains(['\u{fffe}', '\u{ffff}']));
}

/// A device without an end or a pipe without a writer must not block a command, wherever a file is named.
#[test]
fn devices_and_pipes_are_refused_as_plant_scenario_import_and_dump() {
    let scripts = Scripts::new(&[("import.rhai", "import \"endless\" as e;\n")]);
    std::os::unix::fs::symlink("/dev/zero", scripts.0.path().join("endless.rhai")).unwrap();
    let why = "it is a device or socket; a regular file is needed";
    for (args, code) in [
        (&["test", "import.rhai"][..], 2),
        (&["test", "/dev/zero"][..], 2),
        (&["run", "/dev/zero"][..], 2),
        (&["diff", "/dev/zero", "/dev/zero"][..], 2),
    ] {
        let output = commram().args(args).current_dir(scripts.0.path()).output().unwrap();
        let message = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        assert!(message.contains(why), "{args:?}: {message}");
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
    }
}
