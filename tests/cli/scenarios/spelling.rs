//! Spellings of PLC languages in scenarios.

use crate::common::run;

#[test]
fn a_spelling_of_a_plc_language_is_named_with_the_right_one() {
    let directory = tempfile::tempdir().unwrap();
    for (line, expected) in [
        ("poke(\"node2.w_CPU_CONTROL\", 16#0001);", "`16#0001`: write 0x0001, or the text \"16#0001\""),
        (
            "peek(node2.w_CPU_CONTROL);",
            "`node2.w_CPU_CONTROL`: write a register as a text, \"node2.w_CPU_CONTROL\"",
        ),
        ("print('two words');", "write a text in double quotes, \"two words\""),
        ("step(1ms);", "`1ms`: write a time as a text, \"1ms\""),
        ("assert(true);", "there is no verb or function `assert`; write expect_that(condition, \"text\")"),
        ("delay(\"1ms\");", "there is no verb or function `delay`; write step(\"1ms\")"),
        ("sleep(1);", "a scenario has emulated time only; write step(\"1ms\")"),
    ] {
        let file = directory.path().join("a.rhai");
        std::fs::write(&file, format!("step(\"1ms\");\n{line}\n")).unwrap();
        let outcome = run(&["test", file.to_str().unwrap()]);
        assert_eq!(outcome.code, Some(2), "{line}: {}", outcome.err);
        assert!(
            outcome.out.contains("a.rhai:2: ") && outcome.out.contains(expected),
            "{line}: {}",
            outcome.out
        );
    }
}
