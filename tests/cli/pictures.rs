//! Plots and pages: the output of `commram plot`, the verb `plot` and `commram test --report html`.

use crate::common::Emulator;
use crate::common::{finish, is_there, python};
use crate::scenarios::Scripts;
use serde_json::{Value, json};
use std::process::Command;

/// Starts a master in set-up mode with recorded registers and the times of its first two handshakes.
fn recorded() -> Emulator {
    let emulator = Emulator::start(&["--clock", "stepped", "--watch", "node2"]);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
    let data = ["node2.b_BT_1=16#1C", "node2.b_TIME_PATTERN=2", "node2.b_AC=16#FF", "node2.b_AM=16#FF"];
    emulator.poke(&[&data[..], &["node2.w_CPU_CONTROL=16#0002"]].concat());
    emulator.step(&["1ms"]);
    emulator
}

#[test]
fn an_instance_and_its_journal_give_the_same_plot() {
    let emulator = recorded();
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let registers = ["node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS", "node2.w_OPTION_STATUS.1"];
    let (live, past, png) = (path("live.svg"), path("past.svg"), path("live.png"));
    let plot = |more: &[&str]| emulator.run("plot", &[&registers, more].concat());
    assert_eq!(plot(&["-o", &live, "--to", "1500us"]).ok(), "");
    std::fs::write(path("run.jsonl"), emulator.run("trace", &["--format", "jsonl"]).ok()).unwrap();
    // The file needs no instance.
    let mut of_file = crate::common::commram();
    of_file.arg("plot").args(registers).args([
        "--to",
        "1500us",
        "--journal",
        &path("run.jsonl"),
        "-o",
        &past,
    ]);
    // The plot does not need the machine's fonts either.
    of_file
        .env("FONTCONFIG_FILE", "/dev/null")
        .env("HOME", "/nonexistent")
        .env("XDG_DATA_DIRS", "/nonexistent");
    assert_eq!(finish(&mut of_file).ok(), "");
    let svg = std::fs::read_to_string(&live).unwrap();
    assert_eq!(svg, std::fs::read_to_string(&past).unwrap());
    for text in ["node2.w_OPTION_STATUS", "16#0002", "500 us", "1500 us"] {
        assert!(svg.contains(text), "{text}\n{svg}");
    }
    plot(&["-o", &png]).ok();
    assert!(std::fs::read(&png).unwrap().starts_with(b"\x89PNG\r\n"));
    // A register without recorded values has no curve, and the plot contains a note.
    let unknown = emulator.run("plot", &["node1.w_CPU_CONTROL", "-o", &live]);
    let note = "node1.w_CPU_CONTROL: no change recorded, present value 16#0000";
    assert!(unknown.code == Some(0) && unknown.err.contains(note), "{}", unknown.err);
    let hint = "(run --record, record)";
    assert!(unknown.err.contains(hint), "{}", unknown.err);
    let unchanged = emulator.run("plot", &["node2.a_RD_BMARRAY[1][0]", "-o", &live]);
    assert!(
        unchanged.err.contains("has not changed, present value") && !unchanged.err.contains(hint),
        "{}",
        unchanged.err
    );
    for (args, message) in [
        (&["node2.w_CPU_CONTROL", "-o", "x.gif"][..], "must end in .svg or .png"),
        (&["node2.w_CPU_CONTROL", "-o", "x.svg", "--from", "2ms", "--to", "1ms"], "later than --since"),
        (&["%MB3.200001", "-o", "x.svg"], "a part of a register"),
        (&["node2.w_NO", "-o", "x.svg"], "w_NO"),
    ] {
        assert!(emulator.run("plot", args).fails(2).contains(message), "{message}");
    }
}

/// Registers that no client records have the values of writes, answers and states.
#[test]
fn a_journal_file_has_the_states_of_a_register_that_is_not_recorded() {
    let emulator = Emulator::stepped();
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["5ms"]);
    emulator.poke(&["node2.b_BT_1=16#1C"]);
    std::fs::write(path("run.jsonl"), emulator.run("trace", &["--format", "jsonl"]).ok()).unwrap();
    let plot = |name: &str, more: &[&str]| {
        let output = path(name);
        let fixed = ["node2.w_OPTION_STATUS", "node2.w_CPU_CONTROL", "--until", "2ms", "-o", &output];
        let outcome = emulator.run("plot", &[&fixed, more].concat());
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
        std::fs::read_to_string(output).unwrap()
    };
    let live = plot("live.svg", &[]);
    assert!(live.contains("16#0002"), "{live}");
    assert_eq!(plot("past.svg", &["--journal", &path("run.jsonl")]), live);
}

/// A plot cannot extend beyond the present, or beyond the end of a journal file.
#[test]
fn a_plot_ends_at_the_last_known_time() {
    let emulator = recorded();
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("run.jsonl"), emulator.run("trace", &["--format", "jsonl"]).ok()).unwrap();
    let last = emulator.run("trace", &["--format", "jsonl"]).ok().lines().last().unwrap().to_owned();
    let last: Value = serde_json::from_str(&last).unwrap();
    let end_us = last["time_us"].as_u64().unwrap();
    let journal = ["--journal", &path("run.jsonl")];
    for (source, end_us) in [(&[][..], 2000), (&journal[..], end_us)] {
        let plot = |more: &[&str]| {
            let picture = path("a.svg");
            let _ = std::fs::remove_file(&picture);
            emulator.run("plot", &[&["node2.w_OPTION_STATUS", "-o", &picture], source, more].concat())
        };
        let end = commram::time::short(end_us);
        for late in ["1h", &format!("{}us", end_us + 1)] {
            let refused = plot(&["--since", late]);
            assert!(
                refused.fails(2).contains(&format!("ends at {end}; choose an earlier begin")),
                "{}",
                refused.err
            );
            assert!(!directory.path().join("a.svg").exists());
        }
        let shorter = plot(&["--until", "1h"]);
        assert_eq!(shorter.code, Some(0), "{}", shorter.err);
        let note = format!("note: --until 3600 s: the plot ends at {end}, the last known time");
        assert!(shorter.err.contains(&note), "{}", shorter.err);
        let svg = std::fs::read_to_string(path("a.svg")).unwrap();
        assert!(svg.contains(&format!("Registers from 0 us to {end} of emulated time")), "{svg}");
        assert_eq!(plot(&["--until", &format!("{end_us}us")]).err, "");
    }
    let late = Scripts::new(&[("a.rhai", "step(5); plot(\"a.svg\", [\"node2.w_CPU_CONTROL\"], 6);")]);
    let refused = late.run(&["a.rhai", "--allow-empty"]);
    assert!(refused.code == Some(2) && refused.out.contains("the plot ends now, at 5 us"), "{}", refused.out);
}

/// Returns a scenario with a plot that fails, and one with a hostile name that passes.
fn scripts() -> Scripts {
    let plot = "plot(\"start.svg\", [\"node2.w_OPTION_STATUS\"]);\nplot(\"late.png\", [\"node2.w_CPU_CONTROL\"], 500);";
    let failing = format!(
        "record(\"node2\");\nsection(\"start\");\npoke(\"node2.w_CPU_CONTROL\", 1);\n\
         wait(\"node2.w_OPTION_STATUS\", 2, \"1ms\");\npoke(\"node2.b_AM\", 3);\nstep(\"1ms\");\n{plot}\nsection(\"<i>wrong</i>\");\n\
         expect(\"node2.w_OPTION_STATUS\", 3);"
    );
    Scripts::new(&[
        ("fails.rhai", &failing),
        ("<b onclick=x>'&amp;.rhai", "expect(\"node2.w_CPU_CONTROL\", 0);"),
    ])
}

#[test]
fn a_report_opens_in_a_browser_without_a_complaint() {
    let scripts = scripts();
    let files = ["fails.rhai", "<b onclick=x>'&amp;.rhai"];
    let outcome = scripts.run(&[&files[..], &["--report", "html=report.html"]].concat());
    assert_eq!(outcome.code, Some(1), "{}{}", outcome.out, outcome.err);
    let page = scripts.read("report.html");
    for text in ["&lt;b onclick=x&gt;&#39;&amp;amp;", "&lt;i&gt;wrong&lt;/i&gt;", "16#0002", "fails.rhai:"] {
        assert!(page.contains(text), "{text}\n{page}");
    }
    assert_eq!(page.matches("<figure>").count(), 2);
    assert_eq!(page.matches("<td>built-in plant</td>").count(), 2);
    for fact in ["<dt>host</dt><dd>", "<dt>begun</dt><dd>"] {
        assert!(page.contains(fact), "{fact}\n{page}");
    }
    // The plot is an image with a title, a legend, the sections and the meanings of values.
    let picture = scripts.read("start.svg");
    for text in
        ["Registers from 0 us to 1500 us of emulated time\n", "value\n", "start\n", "16#0002  waiting for "]
    {
        assert!(picture.contains(&format!(">\n{text}")), "{text}\n{picture}");
    }
    assert!(scripts.read("start.svg").starts_with("<svg"));
    assert!(std::fs::read(scripts.0.path().join("late.png")).unwrap().starts_with(b"\x89PNG"));
    let refused = scripts.run(&["fails.rhai", "--report", "pdf"]);
    assert!(refused.fails(2).contains("write html, or html=FILE"), "{}", refused.err);
    if !is_there("chromium") {
        return;
    }
    let Some(python) = python(&["websocket"]) else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_page.py");
    let mut browser = Command::new(python.get_program());
    let output = finish(browser.arg(script).arg("chromium").arg(scripts.0.path().join("report.html")));
    let shown: Value = serde_json::from_str(output.ok()).unwrap();
    let wanted = json!({
        "title": "commram: not all passed",
        "scripts": 1,
        "names": ["fails failed", "<b onclick=x>'&amp; passed"],
        "badges": ["failed", "passed", "passed", "failed", "passed"],
        "sequences": [true],
        "plots": [true, true],
        "wide": false,
        "ascending": ["<b onclick=x>'&amp;.rhai", "fails.rhai"],
        "descending": ["fails.rhai", "<b onclick=x>'&amp;.rhai"],
        "filtered": [["fails.rhai"], 1],
        "told": "1 of 2 shown",
    });
    assert_eq!(shown, wanted);
}

/// A journal file can come from anywhere, and one line can count any number of events.
#[test]
fn counted_records_of_any_length_are_drawn_or_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let sync = |time_us: u64| {
        format!(
            "{{\"v\":1,\"kind\":\"sync\",\"bus\":\"drives\",\"time_us\":{time_us},\"count\":1000000000,\"period_us\":1}}\n"
        )
    };
    let answer = |value: u8| {
        format!(
            "{{\"v\":1,\"kind\":\"register\",\"plc\":\"line\",\"address\":\"%MW3.200004\",\"to\":{value},\
             \"time_us\":1000000000,\"count\":1000000000,\"period_us\":1}}\n"
        )
    };
    let plot = |text: String| {
        std::fs::write(path("run.jsonl"), text).unwrap();
        let script = "ulimit -v 2000000; exec \"$0\" \"$@\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", script]).arg(crate::common::commram().get_program());
        finish(shell.args(["plot", "%MW3.200004", "--journal", &path("run.jsonl"), "-o", &path("a.svg")]))
    };
    let begun = std::time::Instant::now();
    for text in [
        (0..20).map(|n| sync(1_000_000_000 + n)).collect::<String>(),
        (0..20).map(|n| answer(n % 2)).collect(),
        sync(u64::MAX),
    ] {
        let outcome = plot(text);
        assert_eq!(outcome.code, Some(0), "{}", outcome.err);
        let svg = std::fs::read_to_string(path("a.svg")).unwrap();
        assert!(svg.len() < 1_000_000, "{}", svg.len());
    }
    let refused = plot((0..500).map(|n| answer((n % 2) as u8)).collect());
    assert!(refused.fails(2).contains("run.jsonl: line "), "{}", refused.err);
    assert!(refused.err.contains("more than 1000000 counted events"), "{}", refused.err);
    assert!(begun.elapsed() < std::time::Duration::from_secs(100), "{:?}", begun.elapsed());
}

#[test]
fn a_plot_is_written_only_beside_its_scenario() {
    for name in ["../x.svg", "/tmp/x.svg", "a/b.svg", "x.txt", ".svg", ""] {
        let script = format!("plot(\"{name}\", [\"node2.w_CPU_CONTROL\"]);");
        let scripts = Scripts::new(&[("one.rhai", &script)]);
        let outcome = scripts.run(&["one.rhai", "--allow-empty"]);
        assert_eq!(outcome.code, Some(2), "{name}: {}", outcome.out);
        assert!(
            outcome.out.contains("beside the scenario") || outcome.out.contains(".svg or .png"),
            "{}",
            outcome.out
        );
    }
    // A link at this path is replaced, not followed.
    let scripts =
        Scripts::new(&[("one.rhai", "plot(\"x.svg\", [\"node2.w_CPU_CONTROL\"]);"), ("mine", "mine")]);
    std::os::unix::fs::symlink(scripts.0.path().join("mine"), scripts.0.path().join("x.svg")).unwrap();
    scripts.run(&["one.rhai", "--allow-empty"]).ok();
    assert_eq!(scripts.read("mine"), "mine");
    assert!(scripts.read("x.svg").starts_with("<svg"));
}

/// The mistake that docs/guide/debugging.md finds in the program, and its correction.
#[test]
fn the_drive_turns_only_with_the_right_order() {
    let wrong = include_str!("../../tools/examples/wrong-order.rhai");
    let (control, word) = (
        "    poke(\"node2.a_STEUREG_CONTROLWORD[1]\", 0x05);\n",
        "    poke(\"node2.a_CONTROLWORD_SL[1]\", word);\n",
    );
    let right = wrong.replacen(control, "?", 1).replacen(word, control, 1).replacen('?', word, 1);
    assert!(wrong.find(control) < wrong.find(word) && right.find(control) > right.find(word), "{right}");
    let plant = include_str!("../../tools/examples/wrong-order.toml");
    let scripts = Scripts::new(&[("wrong.rhai", wrong), ("right.rhai", &right), ("wrong-order.toml", plant)]);
    let failed = scripts.run(&["wrong.rhai"]);
    assert!(failed.code == Some(1) && failed.out.contains("node2.a_RD_BMARRAY[1][0]"), "{}", failed.out);
    scripts.run(&["right.rhai"]).ok();
}
