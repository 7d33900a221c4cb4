//! Every fact needs a source: the manual with its page, another document, or a decision.

use crate::{check, edited, error_of};

#[test]
fn invalid_provenance() {
    for wrong in ["guessed", "manual:", "inferred", "inferred 2", "inferred D-x", "inferred D-02, D-03"] {
        let dir = edited("CTRL.toml", "offsets = \"inferred D-02\"", &format!("offsets = \"{wrong}\""));
        assert_eq!(
            error_of(dir.path()),
            format!(
                "CTRL.toml:3:11: `{wrong}` is no provenance; write \"manual\", \"manual: DOCUMENT\" or \
                 \"inferred D-nn\""
            )
        );
    }
}

#[test]
fn another_document_is_named() {
    let dir = edited("CTRL.toml", "offsets = \"inferred D-02\"", "offsets = \"manual: LIBRARY control.st\"");
    let rust = commram_layoutc::compile(dir.path()).unwrap().rust;
    assert!(rust.contains("offset_from: Provenance::Documented(\"LIBRARY control.st\")"));
}

#[test]
fn structures_state_the_sources_of_all_facts() {
    for (key, name) in [
        ("offsets = \"inferred D-02\"", "offsets"),
        ("names = \"manual\"", "names"),
        ("types = \"manual\"", "types"),
        ("owners = \"manual\"", "owners"),
        ("resets = \"inferred D-03\"", "resets"),
    ] {
        check("INIT.toml", key, "", &format!("INIT.toml:1:1: missing field `{name}`"));
    }
    check(
        "INIT.toml",
        "name_from = \"manual\"",
        "",
        "INIT.toml:8:8: a type needs `name_from`: where its own name comes from",
    );
}

/// Names of areas are not from the manual, and neither are names of variables that no manual contains.
#[test]
fn names_of_areas_and_variables_say_where_they_are_from() {
    check("device.toml", "names = \"inferred D-05\"", "", "device.toml:1:1: missing field `names`");
    let named = "live = \"cyclic\", variable = \"_CTRL\" }";
    let dir = edited("device.toml", "live = \"cyclic\" }", named);
    let rust = commram_layoutc::compile(dir.path()).unwrap().rust;
    let inferred = "Provenance::Inferred(\"D-05\")";
    assert!(rust.contains(&format!("Area {{ name: \"node\", name_from: {inferred},")), "{rust}");
    assert!(rust.contains(&format!("variable: \"_node_INIT\", variable_from: {inferred},")), "{rust}");
    assert!(rust.contains("variable: \"_CTRL\", variable_from: Provenance::Manual,"), "{rust}");
}

#[test]
fn a_reset_value_says_where_it_is_from() {
    check("CTRL.toml", ", reset_from = \"manual\"", "", "CTRL.toml:16:3: register without `reset_from`");
}

#[test]
fn a_meaning_has_a_page_or_a_source() {
    check(
        "parts.toml",
        "name = \"state\"\npage = \"2\"",
        "name = \"state\"",
        "parts.toml:2:8: meaning `state` needs the `page` of the manual or a `source`",
    );
    check(
        "parts.toml",
        "page = \"2\"\nvalue = [\n  { is = 0, text = \"off\" },",
        "source = \"inferred D-06\"\nvalue = [\n  { is = 0, text = \"off\", source = \"manual\" },",
        "parts.toml:2:8: meaning `state` has values or bits from the manual; they need its `page`",
    );
    // Each value and bit may have another source than the rest.
    let dir = edited("parts.toml", "text = \"off\"", "text = \"off\", source = \"inferred D-07\"");
    let rust = commram_layoutc::compile(dir.path()).unwrap().rust;
    assert!(rust.contains("text: \"off\", reserved: false, source: Provenance::Inferred(\"D-07\")"));
    assert!(rust.contains("text: \"step {}\", reserved: false, source: Provenance::Manual"));
}

#[test]
fn reserved_registers_have_one_owner() {
    check(
        "CTRL.toml",
        "name = \"b_CONTROL\", type = \"BYTE\", owner = \"both\"",
        "name = \"b_CONTROL\", type = \"BYTE\", reserved = true, owner = \"both\"",
        "CTRL.toml:13:3: `b_CONTROL` is reserved and so has the owner that `reserved` of device.toml names",
    );
    let dir = edited(
        "CTRL.toml",
        "name = \"b_CONTROL\", type = \"BYTE\", owner = \"both\"",
        "name = \"b_CONTROL\", type = \"BYTE\", reserved = true",
    );
    let rust = commram_layoutc::compile(dir.path()).unwrap().rust;
    assert!(rust.contains("owner_from: Provenance::Inferred(\"D-05\")"));
}
