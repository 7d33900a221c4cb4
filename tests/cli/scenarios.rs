//! `commram test`: the scenarios of the tutorial, and all failures of a scenario.

use crate::common::{Outcome, commram, finish, finish_on_a_full_disk, python, run, skipped};
use std::process::Command;
use tempfile::TempDir;

mod attached;
mod selected;
mod spelling;
mod tutorial;
mod workers;

/// Scripts in a separate directory, in which the command runs.
pub(crate) struct Scripts(pub TempDir);

impl Scripts {
    pub(crate) fn new(scripts: &[(&str, &str)]) -> Self {
        let directory = TempDir::new().unwrap();
        for (name, text) in scripts {
            let file = directory.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        Self(directory)
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = commram();
        command.arg("test").args(args).current_dir(self.0.path());
        command
    }

    pub(crate) fn run(&self, args: &[&str]) -> Outcome {
        finish(&mut self.command(args))
    }

    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.path().join(name)).unwrap()
    }
}

/// Runs one script and returns its report without the real times.
fn run_one(script: &str, code: i32) -> String {
    let scripts = Scripts::new(&[("one.rhai", script)]);
    let outcome = scripts.run(&["one.rhai"]);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(code), ""), "{}", outcome.out);
    without_real_times(&outcome.out)
}

/// Replaces `in 12 ms` at the ends of lines.
fn without_real_times(text: &str) -> String {
    let line = |line: &str| match line.rfind(" emulated in ") {
        Some(at) if line.ends_with(" ms") => format!("{} emulated in R\n", &line[..at]),
        _ => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

#[test]
fn too_many_records_for_a_script_are_refused_with_a_later_time() {
    let pokes = "record(\"node2.b_AM\");\nfor i in 0..17_000 { poke(\"node2.b_AM\", i & 1); }\n";
    for (verb, remedy) in [
        ("journal(0)", "`journal(0)`: a script can hold 16384 such records"),
        ("history(\"node2.b_AM\")", "use `journal` with a later `since`"),
    ] {
        let report = run_one(&format!("{pokes}{verb};\n"), 2);
        assert!(report.contains(remedy) && report.contains("later `since`"), "{report}");
    }
    let later = format!(
        "{pokes}step(\"1ms\");\nlet kept = journal(now()).len();\nexpect_that(kept < 9, `${{kept}}`);\n"
    );
    assert!(run_one(&later, 0).contains("1 passed"));
}

#[test]
fn the_emulated_time_of_a_scenario_is_the_same_in_every_run() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenarios/01-start-of-the-master.rhai");
    let text = std::fs::read_to_string(script).unwrap();
    let scripts = Scripts::new(&[("one.rhai", &text), ("two.rhai", &text)]);
    let report = || without_real_times(scripts.run(&["one.rhai", "two.rhai", "--jobs", "2"]).ok());
    let first = report();
    assert_eq!(first, report());
    let lines: Vec<_> = first.lines().collect();
    assert_eq!(lines[0], lines[2].replace("two", "one"), "two at a time do not disturb each other");
}

#[test]
fn a_failing_expectation_reports_all_details() {
    let script = "\
// a comment
section(\"initialization\");
poke(\"node2.w_CPU_CONTROL\", 0x0001);
step(\"1ms\");
print(\"so far so good\");
expect(\"node2.w_OPTION_STATUS\", 0x0003);
";
    let expected = "\
failed  one.rhai  0.001000 s emulated in R
  node2.w_OPTION_STATUS (%MW3.200002) is 16#0002, not 16#0003
    expected  16#0003  waiting for start
    actual    16#0002  waiting for \"take over initialization data\"
    section   initialization
    line      one.rhai:6: expect(\"node2.w_OPTION_STATUS\", 0x0003);
    time      0.001000 s emulated
    journal, last entries:
      0.000000 s  line        w_CPU_CONTROL (%MW3.200000) := 16#0001 (handshake)
      0.000500 s  line:node2  w_OPTION_STATUS (%MW3.200002) 16#0001 -> 16#0002, waiting for \"take over initialization data\", answered after 500 us
  | so far so good
0 passed, 1 failed, 0 broken; 0.001000 s emulated in R
";
    assert_eq!(run_one(script, 1), expected);
}

#[test]
fn forced_registers_are_marked() {
    let script = "force(\"node2.w_CPU_CONTROL\", 0); print(describe(\"node2.w_CPU_CONTROL\"));\n\
                  expect(\"%MX3.200001.3\", 1);";
    let report = run_one(script, 1);
    assert!(report.contains("\n  | node2.w_CPU_CONTROL = 16#0000  [forced] restart\n"), "{report}");
    assert!(report.contains("\n    actual    0  [forced] bit 11 of node2.w_CPU_CONTROL\n"), "{report}");
    let freed =
        run_one("force(\"node2.b_BT_0\", 1); unforce(\"node2.b_BT_0\"); expect(\"node2.b_BT_0\", 0);", 1);
    assert!(!freed.contains("[forced]"), "{freed}");
}

#[test]
fn every_kind_of_expectation_can_fail() {
    let cases = [
        (
            "wait(\"node2.w_OPTION_STATUS\", 2, \"3ms\")",
            "node2.w_OPTION_STATUS (%MW3.200002) did not become 16#0002 within 3 ms from 0.000000 s on",
        ),
        (
            "wait_bits(\"node2.w_OPTION_STATUS\", 3, 2, 5)",
            "did not become 16#0002 under mask 16#0003 within 5 us",
        ),
        (
            "wait_until(|| peek(\"node2.w_OPTION_STATUS\") == 2, \"2ms\")",
            "the condition did not hold within 2 ms",
        ),
        ("expect(\"node2.w_OPTION_STATUS\", true == false)", "is 16#0001, not 16#0000"),
        ("expect(\"%MX3.200002.0\", 0)", "%MX3.200002.0 is 1, not 0"),
        ("expect_bits(\"node2.w_OPTION_STATUS\", 0x0F, 0x02)", "is 16#0001, not 16#0002 under mask 16#000F"),
        ("expect_near(\"node2.a_WR_VALUE[0]\", -5, 4)", "is 0, not -5 +- 4"),
        ("expect_that(1 > 2, \"one is more than two\")", "not so: one is more than two"),
        (
            "expect_frame(\"drives\", 0x101, \"44 ..\", \"2ms\")",
            "no frame 16#101 44 .. on bus drives within 2 ms",
        ),
        (
            "let s = snapshot(\"node2\"); poke(\"node2.b_BT_0\", 1); expect_changes(s, [])",
            "the changed registers of node2 are not the expected ones",
        ),
        (
            "let s = snapshot(\"node2\"); expect_changes(s, [\"node2.b_BT_0\"])",
            "node2.b_BT_0 has not changed",
        ),
        (
            "let b = block(\"CANsync_INIT\", \"node2\"); b.us_BAUDRATE = 9; cycle_until(b, \"x_OK\", \"1s\")",
            "CANsync_INIT at node2: x_OK did not become TRUE",
        ),
        (
            "poke(\"node2.w_OPTION_STATUS\", 3); step(\"1ms\"); expect_no_findings()",
            "error: owner: node2.w_OPTION_STATUS (%MW3.200002) := 16#0003, 1 time since 0.000000 s: A register",
        ),
        (
            "step_to_sync()",
            "PLC 'line': there is no SYNC signal at node2; the master of bus 'drives', line:node2, has not started",
        ),
        ("throw \"enough\"", "the script throws enough"),
    ];
    for (verb, expected) in cases {
        let report = run_one(verb, 1);
        assert!(report.starts_with("failed  one.rhai") && report.contains(expected), "{verb}\n{report}");
        assert!(report.contains("    line      one.rhai:1: "), "{report}");
    }
}

#[test]
fn a_compile_error_of_a_script_names_its_line() {
    let report = run_one("let x = 1;\npoke(\"node2.w_CPU_CONTROL\", ;\n", 2);
    assert!(report.starts_with("broken  one.rhai  0.000000 s emulated in R\n  one.rhai:2: "), "{report}");
    assert!(report.contains("\n    line      poke(\"node2.w_CPU_CONTROL\", ;\n"), "{report}");
}

#[test]
fn wrong_use_of_a_verb_says_what_would_be_right() {
    let cases = [
        ("peek(\"node2.w_CPU_CONTRL\")", "w_CPU_CONTROL"),
        ("peek(\"%MW3.200001\")", "a WORD needs an even address"),
        ("force(\"%MB10020000\", 1)", "%MB10020000: this PLC has fewer retain flags than this BYTE needs"),
        ("peek(\"line9:node2.w_CPU_CONTROL\")", "there is no PLC 'line9'; there are: line"),
        ("poke(\"node2.w_CPU_CONTROL\", 0x10000)", "a WORD holds 0 to 65535"),
        ("poke(\"node2.w_CPU_CONTROL\", \"16#\")", "is no number; write it decimal"),
        ("poke(\"node2.w_CPU_CONTROL\", 1.5)", "`1.5`: a value is an integer"),
        ("poke(\"%MX3.200000.1\", 2)", "`2` is no value of a single bit"),
        ("compare_exchange(\"%MX3.200000.1\", 0, 1)", "a single bit is not possible here"),
        ("step(\"2\")", "a time needs a unit"),
        ("step(-1)", "`-1`: the time must not be negative"),
        ("step(1.5)", "a time is a text with a unit"),
        ("step_to_sync(\"node3\")", "unknown port `node3`; the ports are node1, node2"),
        ("wait_bits(\"node2.w_OPTION_STATUS\", 1, 2, 0)", "the value has bits outside the mask"),
        ("expect_frame(\"upper\", 0x101, \"*\", \"1ms\")", "there is no bus 'upper'; there are: drives"),
        ("expect_frame(\"drives\", 0x801, \"*\", \"1ms\")", "identifiers have 11 bits"),
        ("expect_frame(\"drives\", -1, \"*\", \"1ms\")", "identifiers have 11 bits"),
        ("expect_frame(\"drives\", 1, \"4\", \"1ms\")", "two hexadecimal digits"),
        ("expect_frame(\"drives\", 1, [256], \"1ms\")", "data are an array of bytes"),
        ("expect_near(\"node2.b_BT_0\", 0, -1)", "the tolerance must not be negative"),
        ("snapshot(\"node3\")", "there is no area 'node3'; there are: "),
        ("force(\"%MB3.200000\", 1)", "only a whole register can be forced, here %MW3.200000"),
        ("unforce(\"node2.b_BT_0\")", "`node2.b_BT_0`: node2.b_BT_0 (%MB3.200015) is not forced"),
        (
            "block(\"CANsync_INI\", \"node2\")",
            "`CANsync_INI`: no such function block; did you mean CANsync_INIT? Omega Drive-Line II has CANsync_BC_MA0",
        ),
        (
            "block(\"CANsync_MODE_SL\", \"node2\")",
            "`node2`: CANsync_MODE_SL needs CANsync_SL_CTRL_BMSTRUCT, which is in node1",
        ),
        (
            "block(\"CANsync_INIT\", \"node2\").x_OKAY",
            "`x_OKAY`: CANsync_INIT has no such input or output; it has x_SL",
        ),
        (
            "let b = block(\"CANsync_INIT\", \"node2\"); b.us_BAUDRATE = 256",
            "`256`: us_BAUDRATE of CANsync_INIT is an integer from 0 to 255",
        ),
        (
            "let b = block(\"CANsync_INIT\", \"node2\"); b.a_SL_TYP = [1]",
            "a_SL_TYP of CANsync_INIT is an array of 32",
        ),
        ("cycle_until(block(\"CANsync_INIT\", \"node2\"), \"w_ERR\", 0)", "`w_ERR`: this output is no BOOL"),
        ("fault(\"lose_bus\")", "there is no such fault; the kinds are: lose_frame"),
        ("fault(\"lose_frame count=many\")", "`count=many`: `many` is no number"),
        ("fault(\"slave_busy slave=9\")", "bus \"drives\" has no slave 9; its slaves are: 1, 2, 3"),
        ("expect_no_findings([\"nothing\"])", "there is no rule 'nothing'; there are: owner"),
        ("clear_fault(0)", "there is no fault 0; it may have ended"),
        ("clear_fault(-1)", "`-1`: the fault's number must not be negative"),
        ("set_board(\"dip=32\")", "`dip=32`: dip is a number from 0 to 31"),
        ("set_board(\"\")", "write NAME=VALUE, for example dip=5"),
        ("set_board(\"line9:dip=3\")", "there is no PLC 'line9'; there are: line"),
        ("board(\"line9\")", "there is no PLC 'line9'; there are: line"),
        ("reset(\"line9\")", "there is no PLC 'line9'; there are: line"),
        ("power_cycle(\"line9\")", "there is no PLC 'line9'; there are: line"),
        ("event_count(16)", "`16`: event numbers are 0 to 12"),
        ("trigger_count(0)", "`0`: triggers are 1, 2, and 3"),
        ("block(\"LED\", \"node2\")", "there is no PLC 'node2'; there are: line"),
        ("expect_changes(snapshot(\"node2\"), [1])", "`1`: this is no register's name"),
        ("plant(\"missing.toml\")", "missing.toml: No such file"),
        ("plant(`[[plc]]\nname = \"a b\"`)", "PLC name 'a b': use 1 to 31 characters"),
        ("step(0); plant(`[[plc]]\nname = \"a\"`)", "`plant`: this must be the first verb"),
        ("no_such_verb(1)", "there is no verb or function `no_such_verb` of an integer"),
        (
            "expct(\"node2.b_BT_0\", 1)",
            "there is no verb or function `expct` of a text, an integer; did you mean expect",
        ),
        ("wait(\"node2.b_BT_0\", 1)", "`wait`: 2 arguments are given; write wait(register, value, within)"),
        ("peek(5)", "`peek`: `register` is a text, here it is an integer; write peek(register)"),
        ("wait-until(|| true, 5)", "; the verb is `wait_until`, with `_`"),
        ("expect-that(true, \"so\")", "there is no variable `expect`; the verb is `expect_that`, with `_`"),
        ("wait_until(|| 5, 5)", "here is an integer, where a bool is needed"),
        ("let n = 1 + (); n", "`+` does not go with an integer and nothing"),
        ("changes(1)", "`snapshot` is a snapshot, here it is an integer"),
        ("let s = snapshot(\"node2\"); peek(s)", "`register` is a text, here it is a snapshot"),
        ("import \"nothing\" as nothing", "nothing"),
        ("wait_until(|| wait_until(1, 2), 3)", "wait_until"),
        ("fn deep(n) { deep(n + 1) } deep(0)", "Stack overflow"),
    ];
    for (script, expected) in cases {
        let report = run_one(script, 2);
        assert!(report.starts_with("broken  one.rhai"), "{script}\n{report}");
        assert!(report.contains(expected), "{script}\n{report}\nlacks: {expected}");
        for ours in ["i64", "&str", "::", "alloc", "Rc<"] {
            let summary = report.split("line      ").next().unwrap().replace("start::", "");
            assert!(!summary.contains(ours), "{script}\n{report}\ntells {ours}");
        }
    }
}

#[test]
fn a_caught_error_has_a_message_and_can_be_thrown_again() {
    let script = r#"
        try { expect("node2.w_OPTION_STATUS", 2); } catch (error) {
            print(`${error}: ${error.kind} ${error.register} ${error.expected} ${error.actual} ${error.time}`);
        }
        try { peek("node2.nothing"); } catch (error) { print(error.kind + " " + error.register.type_of()); }
        try { wait(1); } catch (error) { print(error.message); }
        try { nothing("x", 1, 2.5); } catch (error) { print(error.message); }
        print(type_of(1) + " " + type_of(1.5));
        try { expect("node2.w_OPTION_STATUS", 3); } catch (error) { throw error; }
    "#;
    let report = run_one(script, 1);
    for expected in [
        "node2.w_OPTION_STATUS (%MW3.200002) is 16#0001, not 16#0003\n    expected  16#0003",
        "  | node2.w_OPTION_STATUS (%MW3.200002) is 16#0001, not 16#0002: expectation node2.w_OPTION_STATUS 2 1 0\n",
        "  | wrong_use ()\n",
        "  | `wait`: 1 arguments are given; write wait(register, value, within)\n",
        "  | Function not found: nothing (string, integer, float)\n",
        "  | integer float\n",
    ] {
        assert!(report.contains(expected), "{report}\nlacks: {expected}");
    }
}

#[test]
fn long_texts_of_a_script_are_cut() {
    let long = "let text = \"x\"; text.pad(1000000, \"x\");";
    for end in
        ["throw text", "peek(text)", "expect_that(false, text)", "section(text); expect_that(false, \"no\")"]
    {
        let scripts = Scripts::new(&[("long.rhai", &format!("{long} {end}"))]);
        let outcome = scripts.run(&["long.rhai", "--junit", "report.xml"]);
        assert!(outcome.out.contains(" more characters)"), "{end}: {}", outcome.out.len());
        assert!(
            outcome.out.len() + scripts.read("report.xml").len() < 20_000,
            "{end}: {}",
            outcome.out.len()
        );
    }
}

#[test]
fn definitions_for_editors_are_written_to_the_expected_path() {
    let scripts = Scripts::new(&[]);
    assert_eq!(scripts.run(&["--definitions"]).ok(), ".rhai/definitions/commram.d.rhai\n");
    assert!(
        scripts
            .read(".rhai/definitions/commram.d.rhai")
            .contains("\nfn expect(register: String, value: ?);\n")
    );
}

#[test]
fn several_plcs_need_a_name_in_front() {
    let plant = "plant(`[[plc]]\nname = \"a\"\n[[plc]]\nname = \"b\"`);\n";
    let report = run_one(&format!("{plant}peek(\"node2.w_CPU_CONTROL\")"), 2);
    let expected = "one.rhai:5: `node2.w_CPU_CONTROL`: the plant has several PLCs (a, b); write for example \
                    a:node2.w_CPU_CONTROL";
    assert!(report.contains(expected), "{report}");
    run_one(&format!("{plant}expect(\"b:node2.w_OPTION_STATUS\", 1)"), 0);
}

#[test]
fn endless_scenarios_are_ended() {
    let scripts =
        Scripts::new(&[("loop.rhai", "let n = 0;\nloop { n += 1 }"), ("time.rhai", "loop { step(\"1s\") }")]);
    let outcome = scripts.run(&["loop.rhai", "time.rhai", "--max-operations", "10000", "--max-time", "5s"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.out);
    let expected = "the script does not end: stopped after 10000 steps (--max-operations)";
    assert!(outcome.out.contains(expected), "{}", outcome.out);
    let expected = "1 s of emulated time at 5.000000 s would go beyond the 5 s that a scenario may take";
    assert!(outcome.out.contains(expected), "{}", outcome.out);
    assert!(outcome.out.contains("line      time.rhai:1: loop"), "{}", outcome.out);
}

#[test]
fn a_failure_in_an_imported_script_is_found_there() {
    let scripts = Scripts::new(&[
        ("part.rhai", "fn check() {\n    expect(\"node2.w_OPTION_STATUS\", 2);\n}\n"),
        ("whole.rhai", "import \"part\" as part;\npart::check();\n"),
    ]);
    let outcome = scripts.run(&["whole.rhai"]);
    assert_eq!(outcome.code, Some(1));
    let expected = "line      part.rhai:2: expect(\"node2.w_OPTION_STATUS\", 2);";
    assert!(outcome.out.contains(expected), "{}", outcome.out);
}

/// The library has a script that it imports, and scenarios of several directories use it.
#[test]
fn scenarios_of_several_directories_share_a_library() {
    let of = |path: &str| format!("import \"{path}\" as v;\nexpect_that(v::f() == 3, \"v\");\n");
    let (up, inside) = (of("../lib/v"), of("lib/v"));
    let scripts = Scripts::new(&[
        ("lib/v.rhai", "import \"u\" as z; import \"../lib/./w\" as w;\nfn f() { z::g() + w::g() }\n"),
        ("lib/u.rhai", "fn g() { 1 }\nfn fails() {\n    expect(\"node2.w_OPTION_STATUS\", 2);\n}\n"),
        // A path from the directory of the scenario.
        ("lib/w.rhai", "import \"lib/x\" as x;\nfn g() { 2 }\n"),
        ("lib/x.rhai", "fn x() { }\n"),
        ("own/lib/x.rhai", "fn x() { }\n"),
        ("whole.rhai", &inside),
        ("own/whole.rhai", &up),
        ("fails.rhai", "import \"lib/y\" as y;\n"),
        ("lib/y.rhai", "import \"u\" as u;\nu::fails();\n"),
    ]);
    scripts.run(&["whole.rhai", "own/whole.rhai"]).ok();
    let outcome = scripts.run(&["fails.rhai"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.out);
    assert!(outcome.out.contains("line      lib/u.rhai:3: expect("), "{}", outcome.out);
}

#[test]
fn a_missing_scenario_is_wrong_use_and_the_others_run() {
    let scripts = Scripts::new(&[("good.rhai", "step(\"1ms\"); expect_no_findings();")]);
    let outcome = scripts.run(&["missing.rhai", "good.rhai"]);
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.out.contains("missing.rhai: No such file or directory"), "{}", outcome.out);
    assert!(outcome.out.contains("passed  good.rhai  0.001000 s"), "{}", outcome.out);

    let empty = Scripts::new(&[]);
    assert!(empty.run(&["."]).fails(2).contains("this directory has no files that end in .rhai"));
    assert!(empty.run(&[]).fails(2).contains("FILE"));
}

#[test]
fn a_report_gets_its_directories_and_does_not_hide_the_verdict() {
    let scripts = Scripts::new(&[
        ("good.rhai", "expect_no_findings();"),
        ("bad.rhai", "expect(\"node2.w_OPTION_STATUS\", 7);"),
        ("broken.rhai", "nothing("),
        ("file", ""),
    ]);
    scripts.run(&["good.rhai", "--junit", "new/a/report.xml", "--report", "html=new/b/report.html"]).ok();
    assert!(scripts.read("new/a/report.xml").contains("tests=\"1\""));
    assert!(scripts.read("new/b/report.html").starts_with("<!DOCTYPE html>"));
    let same = scripts.run(&["good.rhai", "--junit", "c/report", "--report", "html=./c/report"]);
    assert!(same.fails(2).contains("both name the same file"), "{}", same.err);
    for (file, code) in [("good.rhai", 3), ("bad.rhai", 1), ("broken.rhai", 2)] {
        let outcome = scripts.run(&[file, "--junit", "file/report.xml", "--report", "html=file/x"]);
        let printed = &outcome.err;
        assert_eq!(outcome.code, Some(code), "{file}: {printed}");
        assert!(printed.contains("cannot write file/report.xml: "), "{file}: {printed}");
        assert!(printed.contains("cannot write file/x: "), "{file}: {printed}");
        let full = finish_on_a_full_disk(&mut scripts.command(&[file]));
        assert_eq!(full.code, Some(if code == 3 { 4 } else { code }), "{file}: {}", full.err);
        assert!(full.err.contains("cannot write the output: "), "{file}: {}", full.err);
    }
}

const MIXED: [(&str, &str); 3] = [
    ("a.rhai", "print(\"1 < 2 & so on\"); step(\"2ms\"); expect_no_findings();"),
    ("b.rhai", "poke(\"node2.b_BT_0\", 1);\nexpect(\"node2.w_OPTION_STATUS\", 2);"),
    ("c.rhai", "peek(\"node2.nothing\");"),
];

#[test]
fn json_has_everything() {
    let outcome = Scripts::new(&MIXED).run(&["a.rhai", "b.rhai", "c.rhai", "--format", "json"]);
    assert_eq!(outcome.code, Some(2));
    let reports: serde_json::Value = serde_json::from_str(&outcome.out).unwrap();
    let outcomes: Vec<_> = reports.as_array().unwrap().iter().map(|report| &report["outcome"]).collect();
    assert_eq!(outcomes, ["passed", "failed", "broken"]);
    assert_eq!(
        (&reports[0]["emulated_us"], &reports[0]["expectations"], &reports[0]["printed"]),
        (&2000.into(), &1.into(), &"1 < 2 & so on\n".into())
    );
    assert!(reports[0]["started"].as_str().unwrap().ends_with('Z'), "{}", reports[0]);
    let failed = &reports[1];
    for (key, value) in [
        ("kind", "expectation"),
        ("register", "node2.w_OPTION_STATUS"),
        ("address", "%MW3.200002"),
        ("actual_text", "16#0001  start-up"),
        ("script", "b.rhai"),
        ("source", "expect(\"node2.w_OPTION_STATUS\", 2);"),
    ] {
        assert_eq!(failed[key], value, "{failed}");
    }
    assert_eq!([&failed["expected"], &failed["actual"], &failed["line"], &failed["time_us"]], [2, 1, 2, 0]);
    let journal = &failed["journal"][0];
    assert_eq!((&journal["time_us"], &journal["kind"]), (&0.into(), &"channel_write".into()), "{journal}");
    let broken = &reports[2];
    assert_eq!((&broken["script"], &broken["line"]), (&"c.rhai".into(), &1.into()), "{broken}");
}

#[test]
fn the_junit_report_is_xml_that_parsers_read() {
    use quick_xml::events::Event;

    let scripts = Scripts::new(&MIXED);
    let outcome = scripts.run(&["a.rhai", "b.rhai", "c.rhai", "--junit", "report.xml"]);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(2), ""));
    let text = scripts.read("report.xml");
    let mut reader = quick_xml::Reader::from_str(&text);
    let (mut names, mut content) = (Vec::new(), String::new());
    loop {
        match reader.read_event().unwrap() {
            Event::Start(tag) | Event::Empty(tag) => {
                let mut name = String::from_utf8(tag.name().as_ref().to_vec()).unwrap();
                for attribute in tag.attributes().map(Result::unwrap) {
                    let key = String::from_utf8(attribute.key.as_ref().to_vec()).unwrap();
                    if ["name", "message", "tests", "failures", "errors", "type", "file"]
                        .contains(&key.as_str())
                    {
                        name += &format!(" {key}={}", String::from_utf8_lossy(&attribute.value));
                    }
                }
                names.push(name);
            }
            Event::Text(part) => content += &String::from_utf8_lossy(&part),
            Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(names[0], "testsuites name=commram tests=3 failures=1 errors=1");
    assert!(names.contains(&"testcase name=b".to_owned()), "{names:?}");
    let failure =
        "failure message=node2.w_OPTION_STATUS (%MW3.200002) is 16#0001, not 16#0002 type=expectation";
    assert!(names.contains(&failure.to_owned()), "{names:?}");
    assert!(content.contains("expected  16#0002") && content.contains("b.rhai:2: expect("), "{content}");
    let error =
        |name: &String| name.starts_with("error message=c.rhai:1: ") && name.ends_with(" type=script");
    assert!(names.iter().any(error), "{names:?}");
    let suite = "testsuite name=b tests=1 errors=0 failures=1 file=b.rhai".to_owned();
    assert!(names.contains(&suite), "{names:?}");
    assert!(text.contains("<property name=\"line\" value=\"b.rhai:2\"/>"), "{text}");
    assert!(text.contains("<property name=\"emulated_us\" value=\"2000\"/>"), "{text}");
}

/// A scenario skips itself. Each shard writes a report with all data, and one page is made of these reports.
#[test]
fn shards_with_skipped_scenarios_become_one_page() {
    let drive = r#"
        expect_that(drive("drive1").state == "operation_enabled" && drive("drive1").parameters.P167 == 2000, "at first");
        try { skip("not here"); } catch { }
        expect_that(false, "not reached");
    "#;
    let faulty = "fault(\"lose_frame bus=drives count=3\"); step(\"1ms\"); expect_that(false, \"wanted\");";
    let scripts = Scripts::new(&[("a.rhai", drive), ("b.rhai", faulty), ("c.rhai", "drive(\"drive9\");")]);
    let skipped = scripts.run(&["a.rhai", "./a.rhai", "--junit", "a.xml"]);
    assert!(skipped.ok().starts_with("skipped  a.rhai"), "{}", skipped.out);
    assert!(skipped.out.contains("\n  not here\n"), "{}", skipped.out);
    assert!(skipped.out.contains("0 passed, 0 failed, 0 broken, 1 skipped; "), "{}", skipped.out);
    assert!(scripts.read("a.xml").contains("<skipped message=\"not here\" type=\"skip\"/>"));
    let unknown = scripts.run(&["c.rhai"]);
    assert!(
        unknown.out.contains("there is no drive 'drive9'; there are: drive1, drive2, drive3"),
        "{}",
        unknown.out
    );
    let failed = scripts.run(&["b.rhai"]);
    let line = "  faults:\n      lose_frame bus=drives count=3 (acting, 0 hits)\n";
    assert!(failed.out.contains(line), "{}", failed.out);
    for shard in ["1/2", "2/2"] {
        let (json, page) = (format!("json={}.json", &shard[..1]), format!("html={}.html", &shard[..1]));
        let run = scripts.run(&["a.rhai", "b.rhai", "--shard", shard, "--report", &json, "--report", &page]);
        assert_eq!(run.code, Some(if shard == "1/2" { 0 } else { 1 }), "{run:?}");
    }
    let reports: serde_json::Value = serde_json::from_str(&scripts.read("2.json")).unwrap();
    assert_eq!(reports[0]["faults"][0], "lose_frame bus=drives count=3 (acting, 0 hits)");
    let [one, two, page] = ["1.json", "2.json", "all.html"].map(|name| scripts.0.path().join(name));
    let [one, two] = [&one, &two].map(|path| path.to_str().unwrap());
    let all = format!("html={}", page.display());
    let merged = run(&["test", "merge", two, one, "--report", &all]);
    assert_eq!(merged.code, Some(1), "{merged:?}");
    let page = scripts.read("all.html");
    assert!(page.contains("<td>a.rhai</td>") || page.contains(">a.rhai<"), "{page}");
    assert!(page.contains("not here") && page.contains("(acting, 0 hits)"), "{page}");
    let xml = scripts.0.path().join("a.xml");
    assert!(
        run(&["test", "merge", xml.to_str().unwrap(), "--report", &all]).fails(2).contains("no data for")
    );
}

#[test]
fn jenkins_accepts_the_junit_report() {
    let Some(schema) = std::env::var_os("COMMRAM_JUNIT_XSD") else {
        return skipped("junit-10", "COMMRAM_JUNIT_XSD names no file");
    };
    let Some(mut command) = python(&["xmlschema"]) else { return };
    let scripts = Scripts::new(&MIXED);
    assert_eq!(scripts.run(&["a.rhai", "b.rhai", "c.rhai", "--junit", "report.xml"]).code, Some(2));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_xml.py");
    let outcome = finish(command.arg(script).arg(scripts.0.path().join("report.xml")).arg(schema));
    assert_eq!(outcome.ok(), "valid by 1 schemas\n");
}

/// Returns the keys of an event in docs/reference/scenarios.md.
fn documented_keys(event: &str) -> Vec<String> {
    let page = include_str!("../../docs/reference/scenarios.md");
    let row = page.lines().find(|line| line.starts_with(&format!("| `{event}` | "))).unwrap();
    // Texts in parentheses describe keys.
    let cell = row.split(" | ").nth(1).unwrap();
    let mut depth = 0;
    let plain: String = cell
        .chars()
        .filter(|letter| {
            depth += i32::from(*letter == '(');
            let is_plain = depth == 0;
            depth -= i32::from(*letter == ')');
            is_plain
        })
        .collect();
    plain.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn events_are_written_with_their_documented_keys() {
    let script = "section(\"one\");\nstep(\"1ms\");\nsection(\"two\");\nprint(\"hello\");\nexpect(\"node2.b_BT_0\", 9);\n";
    let scripts =
        Scripts::new(&[("a.rhai", script), ("b.rhai", "expect(\"node2.b_BT_0\", 0);\n"), ("c.rhai", "x(")]);
    let output = scripts.run(&["a.rhai", "b.rhai", "c.rhai", "--jobs", "1", "--format", "events"]);
    assert_eq!(output.code, Some(2));
    let events: Vec<serde_json::Value> =
        output.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<_> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        [
            "start", "begin", "section", "section", "output", "failure", "end", "begin", "end", "begin",
            "failure", "end", "summary"
        ]
    );
    for event in &events {
        let name = event["event"].as_str().unwrap();
        if name == "failure" {
            continue;
        }
        let mut keys: Vec<_> =
            event.as_object().unwrap().keys().filter(|key| *key != "event").cloned().collect();
        let mut documented = documented_keys(name);
        keys.sort();
        documented.sort();
        assert_eq!(keys, documented, "{name}");
    }
    assert_eq!((&events[3]["name"], &events[3]["time_us"]), (&"two".into(), &1000.into()));
    assert_eq!(events[4]["text"], "hello\n");
    assert_eq!((&events[5]["line"], &events[5]["register"]), (&5.into(), &"node2.b_BT_0".into()));
    assert_eq!(
        (&events[12]["passed"], &events[12]["failed"], &events[12]["broken"]),
        (&1.into(), &1.into(), &1.into())
    );
    assert!(scripts.run(&["a.rhai", "--list", "--format", "events"]).fails(2).contains("use --format json"));
}

#[test]
fn a_scenario_fails_if_a_required_fault_never_fired() {
    let report = run_one("fault(\"lose_frame slot=WRC1 required\");\nstep(\"10ms\");\n", 1);
    assert!(report.contains("fault 1 has not taken effect: lose_frame slot=WRC1 required"), "{report}");
    let refused = run(&["fault", "add", "lose_frame", "required"]);
    assert!(refused.fails(2).contains("only a scenario"), "{}", refused.err);
}

/// Bits in the spelling of the CS0015's manual (p. 152-154), and a STRING of a block.
#[test]
fn single_bits_and_strings_are_written() {
    let script = r#"
        plant(`[[device]]
            kind = 'cs0015'
            name = 'panel'`);
        step("1s");
        poke("%QX0.03", true);
        poke("outputs.Q0.5", 1);
        expect("%QW0", 0x28);
        poke("%QX0.3", "FALSE");
        expect("outputs.Q0", 0x20);
        poke("%MX1010.15", 1);
        expect("slaves.a_SLAVE[0][0]", 0x8000);
        force("%MX1010.00", 1);
        poke("%MW1010", 0);
        step("20ms");
        expect("%MW1010", 0x8001);
        force("%MX1010.15", 0);
        step("20ms");
        expect("%MW1010", 1);
        unforce("%MX1010.4");
        poke("%MW1010", 0);
        step("20ms");
        expect("%MW1010", 0);
        force("%IX1.8", 1);
        step("50ms");
        expect("inputs.S3", 1);
        let text = block("STR", "panel");
        text.F = "n = %d";
        cycle(text);
    "#;
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("bits.rhai");
    std::fs::write(&file, script).unwrap();
    let outcome = run(&["test", file.to_str().unwrap()]);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
}

/// The page lists the function blocks of each device, and the fields of `board()`.
#[test]
fn the_page_lists_blocks_and_fields() {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference/scenarios.md")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("lists.rhai");
    for (title, device) in [
        ("Omega Drive-Line II", "kind = 'omega-drive-line-2'"),
        ("b maXX PLC", "kind = 'bm4-plc'"),
        ("CS0015", "kind = 'cs0015'"),
        ("CAN-DP/2", "kind = 'can-dp2'"),
        ("CR2010", "kind = 'cr201x'\nmodule = 'cr2010'\nnode_id = 3"),
        ("CR2011", "kind = 'cr201x'\nmodule = 'cr2011'\nnode_id = 3"),
    ] {
        let script = format!(
            "plant(`\n[[device]]\n{device}\nname = 'a'`);\n\
             for key in board().keys() {{ print(`field ${{key}}`); }}\n\
             try {{ block(\"nonesuch\", \"\"); }} catch (error) {{ print(`${{error}}`); }}\n"
        );
        std::fs::write(&file, script).unwrap();
        let outcome = run(&["test", file.to_str().unwrap(), "--allow-empty"]);
        let lines = outcome.ok().lines().filter_map(|line| line.strip_prefix("  | ")).collect::<Vec<_>>();
        let row = |names: &[&str]| {
            let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
            format!("| {title} | {} |", names.join(", "))
        };
        let mut fields: Vec<_> = lines.iter().filter_map(|line| line.strip_prefix("field ")).collect();
        fields.sort_unstable();
        let known = lines.last().and_then(|line| line.rsplit_once(" has ")).unwrap().1;
        let blocks: Vec<_> = known.split(", ").filter(|name| !name.contains(' ')).collect();
        let rows = [row(&fields), row(&blocks)];
        for row in rows.iter().filter(|row| row.contains('`')) {
            assert!(page.lines().any(|line| line == row), "{row}");
        }
    }
}
