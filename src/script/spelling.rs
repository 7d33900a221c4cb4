//! Recognizes spellings of PLC languages in a line of a scenario, and suggests the spelling of scenarios.

use super::verb::verbs;
use crate::devices;
use crate::layout::DeviceFit;
use crate::plc_spelling::Dialect;

/// Functions of other languages and test tools, each with the correct call.
const CALLS: &[(&str, &str)] = &[
    ("assert", "expect_that(condition, \"text\"), or expect(\"register\", value)"),
    ("assert_eq", "expect(\"register\", value)"),
    ("expect_eq", "expect(\"register\", value)"),
    ("assert_true", "expect_that(condition, \"text\")"),
    ("check", "expect(\"register\", value)"),
    ("delay", "step(\"1ms\")"),
    ("sleep", "step(\"1ms\")"),
    ("advance", "step(\"1ms\")"),
    ("wait_for", "wait(\"register\", value, \"1s\"), or wait_until(|| condition, \"1s\")"),
    ("set", "poke(\"register\", value)"),
    ("write", "poke(\"register\", value)"),
    ("get", "peek(\"register\")"),
    ("read", "peek(\"register\")"),
    ("log", "print(\"text\")"),
    ("echo", "print(\"text\")"),
    ("printf", "print(\"text\")"),
    ("fail", "throw \"text\""),
];

/// Returns the correct call instead of a function that scenarios do not have.
pub(super) fn call(name: &str) -> Option<&'static str> {
    CALLS.iter().find(|(known, _)| *known == name).map(|(_, right)| *right)
}

/// Describes the first spelling of another language in a line, and the correct spelling. `None` if the line has none.
pub(super) fn mistake(line: &str) -> Option<String> {
    let is_register =
        |word: &str| devices::all().iter().any(|known| DeviceFit::unknown(known.layout).target(word).is_ok());
    let is_verb = |word: &str| verbs().iter().any(|verb| verb.name == word);
    let store = "poke(\"register\", value)";
    Dialect { store, is_register: &is_register, is_verb: &is_verb }.mistake(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hints_name_registers_and_verbs_of_scenarios() {
        for (line, expected) in [
            (
                "poke(node2.w_CPU_CONTROL, 1);",
                "`node2.w_CPU_CONTROL`: write a register as a text, \"node2.w_CPU_CONTROL\"",
            ),
            ("poke(%MW3.200000, 1);", "`%MW3.200000`: write a register as a text, \"%MW3.200000\""),
            ("poke \"x\", 1;", "`poke`: write the arguments in parentheses, poke(...)"),
        ] {
            assert_eq!(mistake(line).as_deref(), Some(expected), "{line}");
        }
        assert_eq!(mistake("expect(\"node2.w_CPU_CONTROL\", 1); frames[0].id"), None);
    }
}
