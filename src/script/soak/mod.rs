//! Random scenarios for `commram soak`.
//!
//! A round is an [`Exercise`] of a device; a seed determines the moves and their order. The text of the scenario
//! contains everything about the round. So a failing round can be saved as a file, and fails again with `commram test`.

mod bounds;
mod lot;
mod shrink;

pub(crate) use shrink::shrink;

use crate::devices::{self, Exercise, Wrong};
use crate::plant::{PlantConfig, PlantError};
use core::fmt::Write;
use fastrand::Rng;

/// The functions that every round has.
const COMMON: &str = include_str!("common.rhai");
/// Maximum number of moves of a round.
const MOST_MOVES: usize = 60;
/// Number of moves after a recovery.
const AFTERWARDS: usize = 4;
/// Range of the number of detours of a second run, and of the number of moves of each detour.
const DETOURS: core::ops::RangeInclusive<usize> = 0..=4;
const DETOUR_MOVES: core::ops::RangeInclusive<usize> = 1..=5;
/// If the plant has data that can be lost, one round out of this number kills or ends emulators. Such rounds are rare,
/// because they need much real time.
const KILLED_OF: u8 = 24;
/// Steps in which the repetition of a round advances the clock, in microseconds.
const SLICES: core::ops::RangeInclusive<u64> = 300..=30_000;

/// Returns the exercises of all devices.
pub(crate) fn exercises() -> impl Iterator<Item = &'static Exercise> {
    devices::all().iter().flat_map(|known| known.emulation.exercises.iter().copied())
}

/// The aim of a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RoundKind {
    /// A correct program: the plant behaves as the manual specifies, and the checker has no findings.
    Right,
    /// A correct program on a plant with faults. After the end of the faults the program restarts, and the plant
    /// behaves as the manual specifies.
    Disturbed,
    /// A correct program, with additional stores to any register.
    Hostile,
    /// A correct program that ends with a forbidden action, which the checker reports.
    Wrong,
    /// Emulators that are ended or killed at any moment. Each emulator continues with the data that the previous one
    /// has stored. Such a round is not a scenario.
    Killed,
}

impl RoundKind {
    /// The kinds of rounds that are scenarios.
    pub(crate) const SCENARIOS: [RoundKind; 4] =
        [RoundKind::Right, RoundKind::Disturbed, RoundKind::Hostile, RoundKind::Wrong];

    /// Returns the name in tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            RoundKind::Right => "right",
            RoundKind::Disturbed => "disturbed",
            RoundKind::Hostile => "hostile",
            RoundKind::Wrong => "wrong",
            RoundKind::Killed => "killed",
        }
    }
}

/// A round of `commram soak`: one random test.
#[derive(Clone, Debug)]
pub(crate) struct Round {
    /// The seed that determines the round.
    pub seed: u64,
    /// The exercise of the moves.
    pub exercise: &'static Exercise,
    /// The subject of the round.
    pub kind: RoundKind,
    /// Lines of the scenario between start and end. Each line may be omitted.
    pub moves: Vec<String>,
    setting: &'static [(&'static str, &'static str)],
    wrong: Option<&'static Wrong>,
    /// Moves after the recovery.
    afterwards: Vec<String>,
    /// Detours of a second run of the round, each a list of lines. The second run executes these lines and then undoes
    /// them.
    detours: Vec<Vec<String>>,
    slice_us: u64,
    /// The function that checks bounds.
    bounds: String,
}

impl Round {
    /// Chooses a round with one of these exercises. The same seed gives the same round.
    ///
    /// # Errors
    /// The plant of an exercise is refused, which is an error in the code of its device.
    ///
    /// # Panics
    /// `exercises` is empty.
    pub(crate) fn draw(seed: u64, exercises: &[&'static Exercise]) -> Result<Self, PlantError> {
        let mut rng = Rng::with_seed(seed);
        let exercise = exercises[rng.usize(..exercises.len())];
        let setting: &'static [_] = rng.choice(exercise.settings).copied().unwrap_or_default();
        let plant = PlantConfig::parse(exercise.name, &filled(exercise.plant, setting))?;
        let keeps_flags = plant.devices.iter().any(|device| device.retain_bytes() > 0);
        let kind = match RoundKind::SCENARIOS[rng.usize(..RoundKind::SCENARIOS.len())] {
            _ if keeps_flags && rng.u8(..KILLED_OF) == 0 => RoundKind::Killed,
            RoundKind::Wrong if exercise.wrongs.is_empty() => RoundKind::Right,
            kind => kind,
        };
        let is_right = matches!(kind, RoundKind::Right | RoundKind::Wrong);
        let moves = (0..rng.usize(1..=MOST_MOVES)).map(|_| match kind {
            RoundKind::Disturbed if rng.u8(..4) == 0 => lot::fault(&plant, &mut rng),
            RoundKind::Hostile if rng.u8(..6) == 0 => lot::fault(&plant, &mut rng),
            RoundKind::Hostile if rng.u8(..2) == 0 => lot::store(&plant, &mut rng),
            _ => lot::made(exercise, is_right, &mut rng),
        });
        let moves = moves.collect();
        let wrong = if kind == RoundKind::Wrong { rng.choice(exercise.wrongs) } else { None };
        let afterwards = if is_right { 0 } else { AFTERWARDS };
        let afterwards = (0..afterwards).map(|_| lot::made(exercise, true, &mut rng)).collect();
        let detour = |rng: &mut Rng| {
            let line = |rng: &mut Rng| match rng.u8(..3) {
                0 => lot::fault(&plant, rng),
                1 => lot::store(&plant, rng),
                _ => lot::made(exercise, false, rng),
            };
            (0..rng.usize(DETOUR_MOVES)).map(|_| line(rng)).collect()
        };
        let detours = (0..rng.usize(DETOURS)).map(|_| detour(&mut rng)).collect();
        Ok(Self {
            seed,
            exercise,
            kind,
            moves,
            setting,
            wrong,
            afterwards,
            detours,
            slice_us: rng.u64(SLICES),
            bounds: bounds::function(&plant),
        })
    }

    /// Returns the plant file of the round.
    pub(crate) fn plant(&self) -> String {
        filled(self.exercise.plant, self.setting)
    }

    /// Returns the same round with other moves.
    #[must_use]
    pub(crate) fn with(&self, moves: Vec<String>) -> Self {
        Self { moves, ..self.clone() }
    }

    /// Returns the text of the scenario. With `another_way`, the clock advances in smaller steps, and the text contains
    /// the detours. The result of the run must be the same.
    pub(crate) fn text(&self, another_way: bool) -> String {
        let mut text = format!(
            "// Random scenario: {}, {}, seed {}.\n\n",
            self.exercise.name,
            self.kind.name(),
            self.seed
        );
        let _ = write!(text, "plant(`\n{}`);\n\n", self.plant());
        let slice_us = if another_way { self.slice_us } else { 0 };
        for (name, value) in self.setting.iter().copied().chain([("SLICE_US", slice_us.to_string().as_str())])
        {
            let _ = writeln!(text, "const {name} = {value};");
        }
        let _ = write!(
            text,
            "\n{COMMON}\n{}\n{}\nsection(\"start\");\nstart();\n\nsection(\"moves\");\n",
            self.bounds, self.exercise.script
        );
        let detours = if another_way { self.detours.as_slice() } else { &[] };
        for (at, line) in self.moves.iter().enumerate() {
            // The detours are spread evenly over the remaining moves.
            let here = detours.iter().enumerate().filter(|(n, _)| n * self.moves.len() / detours.len() == at);
            here.for_each(|(_, lines)| text += &taken_back(lines));
            text += line;
            text += "\n";
        }
        text += &self.end();
        text
    }

    fn end(&self) -> String {
        let allowed = self.exercise.allowed;
        match (self.kind, self.wrong) {
            (RoundKind::Wrong, Some(wrong)) => format!(
                "\nsection(\"what must not be done\");\nin_bounds();\nexpect_no_findings({allowed:?});\n{}\npass(20_000);\n\
                 let found = findings();\nexpect_that(found.some(|finding| finding.rule == {:?}), `{} among ${{found}}`);\n",
                wrong.script, wrong.rule, wrong.rule
            ),
            (RoundKind::Right | RoundKind::Wrong, _) => {
                format!("\nsection(\"end\");\nin_bounds();\nexpect_no_findings({allowed:?});\n")
            }
            (RoundKind::Disturbed | RoundKind::Hostile | RoundKind::Killed, _) => {
                let moves: String = self.afterwards.iter().map(|line| format!("{line}\n")).collect();
                // Hostile programs store any values in non-volatile memory, and these survive the restart. So a hostile
                // round does not check the values.
                let bounds = if self.kind == RoundKind::Hostile { "" } else { "in_bounds();\n" };
                format!(
                    "\nsection(\"recovery\");\nundisturbed();\nrecover();\n\nsection(\"afterwards\");\n{moves}{bounds}"
                )
            }
        }
    }
}

/// Returns lines that execute `lines` and then restore the earlier state.
fn taken_back(lines: &[String]) -> String {
    let lines: String = lines.iter().map(|line| format!("    {line}\n")).collect();
    format!("let before = save();\ntry {{\n{lines}}} catch {{}}\nback_to(before);\n")
}

/// Replaces each `${NAME}` in the text by its value in `setting`.
fn filled(text: &str, setting: &[(&str, &str)]) -> String {
    setting.iter().fold(text.to_owned(), |text, (name, value)| text.replace(&format!("${{{name}}}"), value))
}

#[cfg(test)]
mod tests;
