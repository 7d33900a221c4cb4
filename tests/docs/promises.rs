//! Every promise of `docs/internals/promises.md` names the tests that check it, and these tests exist.

use std::path::Path;

/// Returns the promises with their tests: numbered items, tests in backticks as `path::name`.
fn promises(page: &str) -> Vec<(String, Vec<(String, String)>)> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let mut promises: Vec<(String, Vec<_>)> = Vec::new();
    for line in page.lines() {
        if let Some((number, _)) = line.split_once(". ").filter(|(number, _)| is_number(number)) {
            promises.push((number.to_owned(), Vec::new()));
        }
        for code in line.split('`').skip(1).step_by(2) {
            if let Some((path, name)) = code.split_once(".rs::") {
                let (_, tests) = promises.last_mut().expect("a test belongs to a promise");
                tests.push((format!("{path}.rs"), name.to_owned()));
            }
        }
    }
    promises
}

/// Returns whether the file has a test of this name, including tests of `proptest!`.
fn has_test(source: &str, name: &str) -> bool {
    let lines: Vec<_> = source.lines().map(str::trim).collect();
    let head = format!("fn {name}(");
    let is_test = |at: usize| {
        // Attributes and comments may come between them.
        let mut above =
            lines[..at].iter().rev().take_while(|line| line.starts_with("#[") || line.starts_with("//"));
        above.any(|line| *line == "#[test]")
    };
    lines.iter().enumerate().any(|(at, line)| line.starts_with(&head) && is_test(at))
}

#[test]
fn every_promise_names_tests_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/internals/promises.md")).unwrap();
    let promises = promises(&page);
    assert!(promises.len() > 10, "{promises:?}");
    for (at, (number, tests)) in promises.iter().enumerate() {
        assert_eq!(*number, (at + 1).to_string(), "promises are numbered one after the other");
        assert!(!tests.is_empty(), "promise {number} names no test");
        for (path, name) in tests {
            let source = std::fs::read_to_string(root.join(path));
            let source = source.unwrap_or_else(|error| panic!("promise {number}: {path}: {error}"));
            assert!(has_test(&source, name), "promise {number}: {path} has no test {name}");
        }
    }
}

/// The names of figures in the table of the page and in the program that measures them, with `#` for each number.
#[test]
fn the_figures_of_the_page_are_those_that_are_measured() {
    let without_numbers = |text: &str| {
        let mut short = String::new();
        let mut depth = 0;
        for sign in text.chars() {
            match sign {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ if depth > 0 => continue,
                sign if !sign.is_ascii_digit() => {
                    short.push(sign);
                    continue;
                }
                _ => {}
            }
            if !short.ends_with('#') {
                short.push('#');
            }
        }
        short
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = std::fs::read_to_string(root.join("tools/benches/figures")).unwrap();
    let measured = program.lines().filter_map(|line| line.trim().strip_prefix("row("));
    let measured: Vec<_> = measured
        .filter_map(|row| {
            Some(without_numbers(row.split('"').nth(if row.starts_with('"') { 3 } else { 1 })?))
        })
        .collect();
    assert!(measured.len() > 15, "{measured:?}");
    let page = std::fs::read_to_string(root.join("docs/internals/promises.md")).unwrap();
    let (_, table) = page.split_once("| promise | figure |").unwrap();
    let named = table
        .lines()
        .skip(2)
        .filter_map(|line| line.split('|').nth(2))
        .map(|name| without_numbers(name.trim()));
    let named: Vec<_> = named.collect();
    assert!(named.len() > 15, "{named:?}");
    for name in named {
        assert!(measured.contains(&name), "tools/benches/figures does not measure `{name}`: {measured:#?}");
    }
}

#[test]
fn other_functions_do_not_count_as_tests() {
    let source = "#[test]\n#[ignore]\nfn a() {\n}\nfn helper() {}\n    /// Why.\n    #[test]\n    // So.\n    fn b(x in 0..1) {";
    assert!(has_test(source, "a") && has_test(source, "b"));
    assert!(!has_test(source, "helper") && !has_test(source, "c"));
}
