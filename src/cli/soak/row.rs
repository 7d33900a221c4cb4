//! Tables of `commram soak`.

use super::runner::RoundResult;
use crate::cli::table;
use crate::devices::Exercise;
use serde::Serialize;

/// Results of the rounds of an exercise.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    exercise: &'static str,
    buses: String,
    rounds: u64,
    failed: u64,
    emulated_us: u64,
    real_us: u64,
}

impl Row {
    /// Creates a row without rounds, for an exercise with these kinds of buses.
    pub(super) fn of(exercise: &'static str, buses: String) -> Self {
        Self { exercise, buses, rounds: 0, failed: 0, emulated_us: 0, real_us: 0 }
    }

    /// True if the row has no rounds.
    pub(super) fn is_empty(&self) -> bool {
        self.rounds == 0
    }

    /// True if the round belongs to this row.
    pub(super) fn is_of(&self, judged: &RoundResult) -> bool {
        self.exercise == judged.exercise
    }

    /// Adds the result of a round to the row.
    pub(super) fn add(&mut self, judged: &RoundResult) {
        self.rounds += 1;
        self.failed += u64::from(judged.failure.is_some());
        self.emulated_us += judged.emulated_us;
        self.real_us += u64::try_from(judged.took.as_micros()).unwrap_or_default();
    }

    /// Returns the sum for each kind of bus that several rows have, and the sum of all rows.
    pub(super) fn sums(rows: &[Self]) -> Vec<Self> {
        let mut kinds: Vec<&str> = rows.iter().map(|row| row.buses.as_str()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let of_kind = |kind: &str| rows.iter().filter(|row| row.buses == kind).collect::<Vec<_>>();
        let mut sums = Vec::new();
        for kind in kinds {
            let some = of_kind(kind);
            if some.len() > 1 {
                sums.push(Self { buses: kind.to_owned(), ..Self::sum("all of", some) });
            }
        }
        sums.push(Self::sum("all", rows));
        sums
    }

    /// Returns the sum of these rows.
    pub(super) fn sum<'a>(name: &'static str, rows: impl IntoIterator<Item = &'a Self>) -> Self {
        rows.into_iter().fold(Self::of(name, String::new()), |mut all, row| {
            all.rounds += row.rounds;
            all.failed += row.failed;
            all.emulated_us += row.emulated_us;
            all.real_us += row.real_us;
            all
        })
    }

    /// Returns the ratio of emulated time to real time. The emulated time of a round counts once, although the round
    /// runs twice.
    fn speed(&self) -> u64 {
        self.emulated_us / self.real_us.max(1)
    }

    /// Emulated days per hour of one processor.
    fn days_per_hour(&self) -> f64 {
        let hundredths = 100 * self.emulated_us / 24 / self.real_us.max(1);
        hundredths as f64 / 100.0
    }

    /// Formats a summary: `12 rounds, 340 s emulated, 40 times real time on each processor`.
    pub(super) fn sentence(&self) -> String {
        format!(
            "{} rounds, {} emulated, {} times real time on each processor",
            self.rounds,
            whole_seconds(self.emulated_us),
            self.speed()
        )
    }
}

impl table::Row for Row {
    const COLUMNS: &'static [&'static str] =
        &["exercise", "buses", "rounds", "failed", "emulated_us", "real_us", "speed", "days_per_hour"];

    fn cells(&self) -> Vec<String> {
        let numbers = [self.rounds, self.failed, self.emulated_us, self.real_us, self.speed()];
        let names = [self.exercise.to_owned(), self.buses.clone()];
        let numbers = numbers.map(|number| number.to_string());
        names.into_iter().chain(numbers).chain([format!("{:.2}", self.days_per_hour())]).collect()
    }

    fn text_cells(&self) -> Vec<String> {
        vec![
            self.exercise.to_owned(),
            self.buses.clone(),
            self.rounds.to_string(),
            self.failed.to_string(),
            whole_seconds(self.emulated_us),
            whole_seconds(self.real_us),
            self.speed().to_string(),
            format!("{:.2}", self.days_per_hour()),
        ]
    }
}

/// Formats a time in whole seconds: `3 s`.
fn whole_seconds(us: u64) -> String {
    format!("{} s", us / 1_000_000)
}

/// An exercise in the list.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ExerciseRow {
    exercise: &'static str,
    moves: Vec<&'static str>,
    wrongs: usize,
}

impl ExerciseRow {
    pub(super) fn of(exercise: &Exercise) -> Self {
        let moves = exercise.moves.iter().map(|it| it.name).collect();
        Self { exercise: exercise.name, moves, wrongs: exercise.wrongs.len() }
    }
}

impl table::Row for ExerciseRow {
    const COLUMNS: &'static [&'static str] = &["exercise", "moves", "wrongs"];

    fn cells(&self) -> Vec<String> {
        vec![self.exercise.to_owned(), self.moves.join(" "), self.wrongs.to_string()]
    }
}
