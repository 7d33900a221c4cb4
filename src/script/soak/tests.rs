//! Rounds are scenarios, and the same seed gives the same rounds.

use super::*;
use crate::layout::RegisterRef;
use crate::script::{Limits, Outcome, Report, run_file};

/// Runs the text of a round.
fn run(name: &str, text: &str) -> Report {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join(format!("{name}.rhai"));
    std::fs::write(&file, text).unwrap();
    run_file(&file, None, Limits::default(), |_| {})
}

#[test]
fn names_of_exercises_are_unique_and_their_plants_are_plants() {
    let mut names: Vec<_> = exercises().map(|exercise| exercise.name).collect();
    names.sort_unstable();
    let all = names.len();
    names.dedup();
    assert_eq!(names.len(), all);
    for exercise in exercises() {
        for setting in exercise.settings {
            PlantConfig::parse(exercise.name, &filled(exercise.plant, setting)).unwrap().check().unwrap();
        }
    }
}

#[test]
fn a_seed_decides_everything() {
    let all: Vec<_> = exercises().collect();
    for seed in 0..50 {
        let [one, other] = [(); 2].map(|()| Round::draw(seed, &all).unwrap());
        assert_eq!(one.text(false), other.text(false));
        assert_ne!(one.text(false), Round::draw(seed + 1, &all).unwrap().text(false));
    }
}

/// Returns every move of an exercise, once with the least and once with the largest parameters.
fn with_all_moves(exercise: &'static Exercise) -> Round {
    let call = |pick: fn(&core::ops::RangeInclusive<i64>) -> i64| {
        exercise.moves.iter().map(move |it| {
            let parameters =
                it.parameters.iter().map(|range| format!(", {}", pick(range).clamp(-5_000, 500_000)));
            format!("{}(true{});", it.name, parameters.collect::<String>())
        })
    };
    let mut round = Round::draw(1, &[exercise]).unwrap();
    round.moves = call(|range| *range.start()).chain(call(|range| *range.end())).collect();
    round
}

#[test]
fn every_move_is_right_and_every_wrong_thing_is_found() {
    for exercise in exercises() {
        let round = with_all_moves(exercise);
        let wrongs = exercise.wrongs.iter().map(|wrong| (RoundKind::Wrong, Some(wrong)));
        for (kind, wrong) in wrongs.chain([(RoundKind::Right, None)]) {
            let round = Round { kind, wrong, afterwards: Vec::new(), ..round.clone() };
            let reports = [false, true].map(|in_slices| run(exercise.name, &round.text(in_slices)));
            for report in &reports {
                assert!(
                    matches!(report.outcome, Outcome::Passed),
                    "{}: {:#?}",
                    exercise.name,
                    report.outcome
                );
            }
            assert_eq!(reports[0].journal_hash, reports[1].journal_hash, "{}", exercise.name);
        }
    }
}

/// Journals of all devices at the time of this list, without random parts. A change of a firmware, of the texts of the
/// journal or of an exercise requires new journals.
const KEPT: &str = include_str!("../../../tests/journal/exercises.txt");

#[test]
fn journals_of_all_devices_are_those_that_are_kept() {
    let found = exercises().map(|exercise| {
        let setting = exercise.settings.first().copied().unwrap_or_default();
        let round = Round { kind: RoundKind::Right, wrong: None, setting, ..with_all_moves(exercise) };
        let report = run(exercise.name, &round.text(false));
        assert!(matches!(report.outcome, Outcome::Passed), "{}: {:#?}", exercise.name, report.outcome);
        format!("{}: 16#{:016X}\n", exercise.name, report.journal_hash.unwrap())
    });
    assert_eq!(
        found.collect::<String>(),
        KEPT,
        "the left ones belong into tests/journal/exercises.txt, if the change is meant"
    );
}

/// If the plant of an exercise has a checked register, this register is set to a value without a meaning.
#[test]
fn a_round_fails_where_a_register_is_out_of_its_bounds() {
    let mut tried = 0;
    for exercise in exercises() {
        let mut round = Round::draw(1, &[exercise]).unwrap();
        (round.kind, round.moves) = (RoundKind::Right, Vec::new());
        assert!(matches!(run("right", &round.text(false)).outcome, Outcome::Passed), "{}", exercise.name);
        let plant = PlantConfig::parse(exercise.name, &round.plant()).unwrap();
        let without = |it: &RegisterRef| {
            let wrongs = [0x77, 0xEE, 0x155, 0xFFFF, u32::MAX].into_iter();
            let mut wrongs = wrongs.filter(|value| value & !it.register.ty.mask() == 0);
            wrongs.find(|value| it.decode(*value).contains("no meaning"))
        };
        let mut areas = std::collections::BTreeMap::new();
        for device in &plant.devices {
            for register in bounds::bounded(device.layout()) {
                if let Some(value) = without(&register) {
                    let place = format!("{}:{}", device.name(), register.address());
                    areas.entry((device.name(), register.area.name)).or_insert((place, value));
                }
            }
        }
        if areas.is_empty() {
            continue;
        }
        // A port in another role, or a slot with another module, has another register at this address.
        let is_found = areas.into_values().any(|(place, value)| {
            // The register is forced, so the firmware cannot replace the value.
            round.moves = vec![format!("force({place:?}, {value});")];
            let outcome = run("wrong", &round.text(false)).outcome;
            matches!(outcome, Outcome::Failed(it) if it.what.contains(&place) && it.what.contains("no meaning"))
        });
        assert!(is_found, "{}", exercise.name);
        tried += 1;
    }
    assert!(tried >= 3, "{tried} exercises have such registers");
}

/// Counters are among the checked registers.
#[test]
fn counters_have_bounds() {
    let devices = devices::all().iter().map(|known| known.layout);
    let counters: Vec<_> =
        devices.flat_map(bounds::bounded).map(|it| it.name()).filter(|it| it.contains("COUNTER")).collect();
    assert!(counters.len() >= 3, "{counters:?}");
}

/// A round with a wrong program fails if the checker does not report the expected error.
#[test]
fn a_round_fails_where_a_device_is_not_as_it_should_be() {
    let exercise = exercises().find(|exercise| !exercise.wrongs.is_empty()).unwrap();
    let mut round = Round::draw(1, &[exercise]).unwrap();
    (round.kind, round.moves) = (RoundKind::Wrong, Vec::new());
    round.wrong = Some(&Wrong { script: "", rule: "owner" });
    assert!(matches!(run("silent", &round.text(false)).outcome, Outcome::Failed(_)));
}
