//! Merging of shards.

use super::*;
use proptest::prelude::*;

fn part(shard: Option<&str>, files: &[&str]) -> Part<()> {
    let scenario = |file: &&str| Scenario {
        file: (*file).to_owned(),
        ending: EndResult::Passed,
        is_run: true,
        content: (),
    };
    Part {
        path: format!("{}.xml", shard.unwrap_or("empty").replace('/', "-")).into(),
        shard: shard.map(|shard| Shard::parse(shard).unwrap()),
        scenarios: files.iter().map(scenario).collect(),
    }
}

fn refused(parts: Vec<Part<()>>) -> String {
    in_order(parts).err().map(|error| error.to_string()).unwrap_or_default()
}

fn files(parts: Vec<Part<()>>) -> Vec<String> {
    in_order(parts).unwrap_or_default().into_iter().map(|it| it.file).collect()
}

#[test]
fn shards_are_merged_in_the_order_of_one_run() {
    let all = vec![part(Some("2/3"), &["b", "e"]), part(Some("3/3"), &["c"]), part(Some("1/3"), &["a", "d"])];
    assert_eq!(files(all), ["a", "b", "c", "d", "e"]);
    assert_eq!(files(vec![part(None, &[]), part(Some("1/3"), &["a"]), part(None, &[])]), ["a"]);
    assert_eq!(files(vec![part(Some("1/1"), &["a", "b"])]), ["a", "b"]);
}

#[test]
fn missing_duplicate_and_foreign_reports_are_refused() {
    let one = || part(Some("1/2"), &["a", "c"]);
    let two = || part(Some("2/2"), &["b"]);
    assert_eq!(refused(vec![two()]), "`missing: shard 1/2`: the reports of these shards are needed");
    assert_eq!(refused(vec![one(), two(), two()]), "`2-2.xml`: it is shard 2/2, as is 2-2.xml");
    assert_eq!(
        refused(vec![one(), part(Some("2/3"), &["b"])]),
        "`2-3.xml`: it is shard 2/3, but others belong to 2 shards"
    );
    assert_eq!(
        refused(vec![one(), part(Some("2/2"), &["a"])]),
        "`2-2.xml`: a is in this report and in 1-2.xml"
    );
    let uneven = refused(vec![part(Some("1/2"), &["a", "b", "c"]), two()]);
    assert!(
        uneven
            .ends_with("it has 3 scenarios, expected are 2 of all 4; the shards do not have the same files")
    );
    let more = refused(vec![one(), two(), part(None, &[])]);
    assert!(more.contains("all shards are present without it"), "{more}");
    assert!(refused(vec![part(Some("1/3"), &["a"]), part(None, &[])]).contains("missing: shard 2/3"));
}

#[test]
fn large_numbers_of_shards_and_unknown_outcomes_are_refused() {
    let json = |shard: &str, outcome: &str| {
        let text = format!(r#"[{{"file": "a.rhai", "outcome": "{outcome}", "shard": "{shard}"}}]"#);
        of_json(Path::new("r.json"), &text).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(json("1/2", "passed"), "");
    let huge = "`r.json`: shard 1/18446744073709551615: a run has at most 10000 shards";
    assert_eq!(json("1/18446744073709551615", "passed"), huge);
    assert!(json("1/2", "great").contains("a.rhai has the outcome great"));
    let many = refused(vec![part(Some("1/10000"), &["a"])]);
    assert!(many.contains("20/10000, 21/10000 and 9979 more"), "{many}");
}

#[test]
fn the_exit_code_equals_the_exit_code_of_one_run() {
    let of = |endings: &[EndResult]| verdict(&endings.iter().map(|it| (*it, true)).collect::<Vec<_>>());
    assert!(of(&[]).is_ok() && of(&[EndResult::Passed]).is_ok());
    assert!(matches!(of(&[EndResult::Passed, EndResult::NotPassed]), Err(CliError::Reported)));
    assert!(matches!(of(&[EndResult::NotPassed, EndResult::Broken]), Err(CliError::ReportedWrongUse)));
    let endings = [(EndResult::Passed, true), (EndResult::NotPassed, true), (EndResult::NotPassed, false)];
    assert_eq!(summary(&endings), "1 passed, 1 failed, 0 broken, 1 not run\n");
    let skipped = [(EndResult::Skipped, true)];
    assert!(verdict(&skipped).is_ok());
    assert_eq!(summary(&skipped), "0 passed, 0 failed, 0 broken, 1 skipped\n");
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn splitting_and_merging_keeps_every_scenario(scenarios in 0_usize..40, count in 1_usize..12) {
        let all: Vec<_> = (0..scenarios).map(|it| format!("{it:02}")).collect();
        let parts = (0..count).map(|index| {
            let own: Vec<_> = all.iter().skip(index).step_by(count).map(String::as_str).collect();
            part(Some(&format!("{}/{count}", index + 1)), &own)
        });
        prop_assert_eq!(files(parts.collect()), all.clone());
    }

    #[test]
    fn no_input_text_causes_a_panic(text in "\\PC{0,60}", xml in prop::bool::ANY) {
        let text = if xml { format!("<testsuites name=\"commram 1/2\">{text}") } else { text };
        let _ = of_junit(Path::new("x"), &text).map(|part| in_order(vec![part]).is_ok());
        let _ = of_json(Path::new("x"), &text).map(|part| in_order(vec![part]).is_ok());
    }
}
