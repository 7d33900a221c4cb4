//! `commram soak`: random scenarios for a chosen time.

mod kills;
mod row;
mod runner;

use super::demo::Interrupts;
use super::error::CliError;
use super::table::{self, Format, FormatArg};
use super::test::{LimitArgs, process};
use super::{number, output};
use crate::devices::Exercise;
use crate::devices::folder;
use crate::plant::PlantConfig;
use crate::script::soak::{Round, exercises};
use row::Row;
use runner::{RoundResult, RoundRunner};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Real time between two progress lines.
const PROGRESS_EVERY: Duration = Duration::from_secs(10);

/// Run random programs on all devices and check the results.
///
/// Each round is a scenario: a plant and a program that uses its device correctly. The program also contains
/// faults, writes to random registers, or one forbidden action. The scenario runs twice, the second time with other
/// time slices and with steps that are taken back; both runs must produce the same journal. A failing round is made
/// as short as possible and written as a scenario that fails alone. Some rounds kill emulators and check their
/// NOVRAM. The same seed produces the same rounds.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram soak
  commram soak --seed 7 --hours 8 --jobs 2
  commram soak --rounds 100 --exercise NAME
  commram soak --rounds 100 --exercise ./cards/counter
  commram soak --list
  commram test soak-7.rhai

Exit codes:
  0  every round gave the expected result
  1  a round failed; its scenario was written
  2  wrong use")]
pub(crate) struct Args {
    /// Seed of the random generator [default: chosen at random and printed]
    #[arg(long, value_name = "N", value_parser = number::any::<u64>())]
    seed: Option<u64>,
    /// Real time in hours, for example 8 or 0.5 [default: until Ctrl-C]
    #[arg(long, value_name = "H", value_parser = hours)]
    hours: Option<Duration>,
    /// End after N rounds
    #[arg(long, value_name = "N", value_parser = rounds)]
    rounds: Option<u64>,
    /// Number of rounds that run at the same time [default: one per processor]
    #[arg(long, value_name = "N", value_parser = number::jobs)]
    jobs: Option<NonZero<usize>>,
    /// Only this exercise, or the exercise.rhai of the device in this folder; can be given several times
    #[arg(long = "exercise", value_name = "NAME", value_parser = exercise, add = names())]
    chosen: Vec<&'static Exercise>,
    /// Directory for the scenario of a round that fails
    #[arg(long, value_name = "DIR", default_value = ".")]
    keep: PathBuf,
    /// Run nothing, list the exercises
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    format: FormatArg,
}

fn hours(text: &str) -> Result<Duration, String> {
    let hours = text.parse().ok().filter(|hours: &f64| *hours > 0.0);
    let time = hours.and_then(|hours| Duration::try_from_secs_f64(hours * 3600.0).ok());
    time.ok_or_else(|| "write hours as a number above 0, for example 0.5".to_owned())
}

fn rounds(text: &str) -> Result<u64, String> {
    let rounds = text.parse().ok().filter(|rounds| *rounds > 0);
    rounds.ok_or_else(|| "write a number above 0; without --rounds the rounds have no limit".to_owned())
}

fn exercise(name: &str) -> Result<&'static Exercise, String> {
    if folder::is_path(name) {
        return exercise_of_folder(name);
    }
    exercises().find(|exercise| exercise.name == name).ok_or_else(|| {
        let known: Vec<_> = exercises().map(|exercise| exercise.name).collect();
        format!("the exercises are {}", known.join(", "))
    })
}

/// Returns the exercise of a device in a folder.
fn exercise_of_folder(dir: &str) -> Result<&'static Exercise, String> {
    let read = folder::find(Path::new(""), dir).and_then(|dir| folder::load(&dir));
    let exercises = read.map_err(|reason| reason.to_string())?.registered.emulation.exercises;
    exercises.first().copied().ok_or_else(|| format!("{dir} has no exercise.rhai"))
}

fn names() -> clap_complete::engine::ArgValueCandidates {
    clap_complete::engine::ArgValueCandidates::new(|| {
        exercises().map(|exercise| clap_complete::CompletionCandidate::new(exercise.name)).collect()
    })
}

/// Runs rounds until the end or until the first failing round.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let exercises: Vec<_> = if args.chosen.is_empty() { exercises().collect() } else { args.chosen.clone() };
    if args.list {
        return list(args.format.format, &exercises);
    }
    process::allow_memory()?;
    let interrupts = Interrupts::catch()?;
    let seed = args.seed.unwrap_or_else(|| {
        let seed = any_seed();
        output::note(&format!("seed {seed}"));
        seed
    });
    let judge = RoundRunner::new(exercises, &args.keep, args.limits)?;
    let mut rows: Vec<Row> = judge
        .exercises()
        .iter()
        .copied()
        .map(|exercise| Ok(Row::of(exercise.name, buses(exercise)?)))
        .collect::<Result<_, CliError>>()?;
    rows.push(Row::of(kills::NAME, String::new()));
    let failure = play(args, seed, &judge, &interrupts, &mut rows)?;
    // The last row of the table is for rounds with kills. If there was no such round, the row is removed.
    let _ = rows.pop_if(|row| row.is_empty());
    if args.format.format == Format::Text {
        rows.extend(Row::sums(&rows));
    }
    table::print(args.format.format, &rows, table::aligned)?;
    match failure {
        Some(text) => {
            output::complain(&text);
            Err(CliError::Reported)
        }
        // Without a limit, Ctrl-C is the normal way to end.
        None if interrupts.any() && (args.hours.is_some() || args.rounds.is_some()) => {
            Err(CliError::Interrupted)
        }
        None => Ok(()),
    }
}

/// Runs rounds; returns the report of the first failing round.
fn play(
    args: &Args,
    seed: u64,
    judge: &RoundRunner,
    interrupts: &Interrupts,
    rows: &mut [Row],
) -> Result<Option<String>, CliError> {
    let begun = Instant::now();
    let (next, over) = (AtomicUsize::new(0), AtomicBool::new(false));
    let is_over = || {
        let late = args.hours.is_some_and(|hours| begun.elapsed() >= hours);
        over.load(Ordering::Relaxed) || late || interrupts.any()
    };
    let failure = Mutex::new(None);
    let jobs = args.jobs.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZero::get);
    let (send, receive) = mpsc::channel::<RoundResult>();
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            let (send, next, over, is_over, failure) = (send.clone(), &next, &over, &is_over, &failure);
            let work = move || {
                while !is_over() {
                    let number = next.fetch_add(1, Ordering::Relaxed) as u64;
                    if args.rounds.is_some_and(|rounds| number >= rounds) {
                        break;
                    }
                    let judged = match judge.round(seed.wrapping_add(number), is_over) {
                        Ok(judged) => judged,
                        Err(error) => return end_with(failure, over, || Err(error)),
                    };
                    if let Some(fails) = &judged.failure {
                        end_with(failure, over, || Ok(judge.keep(fails, &|| interrupts.any())));
                    }
                    // Sending cannot fail: the receiver exists until all results have been received.
                    let _ = send.send(judged);
                }
            };
            std::thread::Builder::new()
                .spawn_scoped(scope, work)
                .map_err(|reason| CliError::Process { reason })?;
        }
        drop(send);
        let mut printed_at = Instant::now();
        for judged in receive {
            if let Some(row) = rows.iter_mut().find(|row| row.is_of(&judged)) {
                row.add(&judged);
            }
            if printed_at.elapsed() >= PROGRESS_EVERY {
                printed_at = Instant::now();
                let all = Row::sum("all", &*rows);
                output::note(&format!("{} s: {}", begun.elapsed().as_secs(), all.sentence()));
            }
        }
        Ok::<(), CliError>(())
    })?;
    failure.into_inner().unwrap_or_else(PoisonError::into_inner).transpose()
}

/// Stops all rounds. `result` becomes the result of the command, unless another round has set one before.
fn end_with(
    first: &Mutex<Option<Result<String, CliError>>>,
    over: &AtomicBool,
    result: impl FnOnce() -> Result<String, CliError>,
) {
    over.store(true, Ordering::Relaxed);
    let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
    if first.is_none() {
        *first = Some(result());
    }
}

/// Returns the kinds of buses of an exercise.
fn buses(exercise: &'static Exercise) -> Result<String, CliError> {
    let plant = Round::draw(0, &[exercise])?.plant();
    let mut families: Vec<_> =
        PlantConfig::parse(exercise.name, &plant)?.buses.iter().map(|bus| bus.family()).collect();
    families.dedup();
    Ok(families.join(" "))
}

fn list(format: Format, exercises: &[&'static Exercise]) -> Result<(), CliError> {
    let rows: Vec<_> = exercises.iter().map(|exercise| row::ExerciseRow::of(exercise)).collect();
    table::print(format, &rows, table::aligned)
}

/// Returns a seed that differs from run to run and is short enough to type.
fn any_seed() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(1, |time| time.as_secs() % 1_000_000)
}
