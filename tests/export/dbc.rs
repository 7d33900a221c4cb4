//! CAN databases in cantools, with all frames of the exercises.

use crate::common::{finish, python, run};
use crate::played::PLAYED;
use std::path::Path;

#[test]
fn cantools_knows_every_frame_of_the_exercises() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (database, log) = (path("bus.dbc"), path("bus.log"));
    for it in PLAYED.iter().filter(|it| !it.contains.is_empty()) {
        let (plant, emulator) = it.play(directory.path());
        run(&["export", "dbc", "--plant", plant.to_str().unwrap(), "--bus", it.bus, "--output", &database])
            .ok();
        std::fs::write(&log, &emulator.run("trace", &["--format", "candump"]).out).unwrap();
        let Some(mut command) = python(&["cantools"]) else { return };
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_dbc_trace.py");
        let outcome = finish(command.arg(script).args([&database, &log]));
        assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
        for message in it.contains {
            let begin = format!("{message} ");
            assert!(outcome.out.lines().any(|line| line.starts_with(&begin)), "{message}\n{}", outcome.out);
        }
    }
}

/// SavvyCAN reads lines by fixed patterns, and accepts each identifier only once. So the lines must match the patterns,
/// and the identifiers must differ.
#[test]
fn lines_have_the_forms_that_savvycan_reads() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    std::fs::write(&plant, PLAYED[0].plant.replace("${KBIT_S}", "500")).unwrap();
    let text = run(&["export", "dbc", "--plant", plant.to_str().unwrap(), "--bus", "drives"]);
    let mut identifiers = std::collections::HashSet::new();
    for line in text.ok().lines().filter(|line| line.starts_with("BO_ ")) {
        let words: Vec<_> = line.split(' ').collect();
        let [_, id, name, length, sender] = &words[..] else { panic!("{line}") };
        assert!(
            name.strip_suffix(':').is_some_and(|name| name.chars().all(|c| c.is_alphanumeric() || c == '_'))
        );
        assert!(length.parse::<u8>().is_ok_and(|length| length <= 8) && !sender.is_empty(), "{line}");
        assert!(identifiers.insert(id.parse::<u32>().unwrap()), "{line}");
    }
    assert_eq!(identifiers.len(), 6 * 32 + 1);
    for line in [
        "BO_ 1281 JOB_1: 8 master",
        " SG_ up_download M : 7|1@1+ (1,0) [0|1] \"\" slave_1",
        " SG_ number : 3|12@0+ (1,0) [0|4095] \"\" slave_1",
        " SG_ element m0 : 4|3@1+ (1,0) [0|7] \"\" slave_1",
        " SG_ download m1 : 6|1@1+ (1,0) [0|1] \"\" slave_1",
    ] {
        assert!(text.out.lines().any(|it| it == line), "{line}\n{}", text.out);
    }
}
