//! `commram list`: the instances.

use super::error::CliError;
use super::table::{self, FormatArg, Row};
use super::time;
use crate::memory::{ClockMode, Condition, ImageInfo, ImageSummary, State};
use serde::Serialize;

/// List the instances.
///
/// Dead instances are listed too: emulators that were killed and could not clean up. `commram run` takes
/// over their files, `commram stop --clean` removes them.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram list
  commram list --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    format: FormatArg,
}

/// An instance in the list of `commram list`.
#[derive(Serialize)]
pub(crate) struct Entry {
    name: String,
    plcs: Vec<String>,
    pid: Option<u32>,
    clock: Option<String>,
    time_us: Option<u64>,
    state: &'static str,
    /// Reason why the instance cannot be used, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
}

impl Entry {
    /// Returns the name of the instance.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }
}

/// Returns all instances.
///
/// # Errors
/// The directory of the images cannot be read.
pub(crate) fn all() -> Result<Vec<Entry>, CliError> {
    Ok(entries(crate::memory::list()?))
}

impl Row for Entry {
    const COLUMNS: &'static [&'static str] = &["name", "plcs", "pid", "clock", "time_us", "state", "reason"];

    fn cells(&self) -> Vec<String> {
        let text = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
        vec![
            self.name.clone(),
            self.plcs.join(" "),
            text(self.pid.map(|pid| pid.to_string())),
            text(self.clock.clone()),
            text(self.time_us.map(|us| us.to_string())),
            self.state.to_owned(),
            self.reason.clone().unwrap_or_default(),
        ]
    }

    fn text_cells(&self) -> Vec<String> {
        let mut cells = self.cells();
        // Reasons are printed below the table.
        cells.pop();
        if let (Some(cell), Some(us)) = (cells.get_mut(4), self.time_us) {
            *cell = time::seconds(us);
        }
        cells
    }
}

/// Prints the instances of this user.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let entries = all()?;
    table::print(args.format.format, &entries, |entries| match entries {
        [] => "no instance is running; start one with `commram run`\n".to_owned(),
        entries => text(entries),
    })
}

fn text(entries: &[Entry]) -> String {
    let reason = |entry: &Entry| Some(format!("{}: {}\n", entry.name, entry.reason.as_ref()?));
    table::aligned(entries) + &entries.iter().filter_map(reason).collect::<String>()
}

/// Returns one entry for each emulator. If an emulator was restarted with fewer PLCs, images of the earlier emulator
/// may still exist.
fn entries(images: Vec<ImageInfo>) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for image in images {
        let new = entry(image);
        let same = |known: &&mut Entry| {
            (&known.name, known.pid, known.state, &known.reason)
                == (&new.name, new.pid, new.state, &new.reason)
        };
        match entries.iter_mut().find(same) {
            Some(known) => known.plcs.extend(new.plcs),
            None => entries.push(new),
        }
    }
    entries
}

fn entry(image: ImageInfo) -> Entry {
    let (summary, state, reason) = match image.condition {
        Condition::Alive(summary) => {
            let state = state_name(summary.state);
            (Some(summary), state, None)
        }
        Condition::Dead(summary) => (Some(summary), "dead", None),
        Condition::Unusable(reason) => (None, "unusable", Some(reason.to_string())),
    };
    Entry {
        name: image.instance,
        plcs: vec![image.plc],
        pid: summary.as_ref().map(|summary| summary.pid),
        clock: summary.as_ref().map(clock_name),
        time_us: summary.map(|summary| summary.virtual_time_us),
        state,
        reason,
    }
}

fn state_name(state: Option<State>) -> &'static str {
    match state {
        Some(State::Starting) => "starting",
        Some(State::Ready) => "ready",
        Some(State::Stopping | State::Stopped | State::Unsaved) => "stopping",
        None => "unknown",
    }
}

fn clock_name(summary: &ImageSummary) -> String {
    match (summary.clock_mode, summary.speed) {
        (Some(ClockMode::Stepped), _) => "stepped".to_owned(),
        (Some(ClockMode::RealTime), speed) => super::run::real_time_name(f64::from(speed) / 1000.0),
        (None, _) => "unknown".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::MemoryError;

    fn image(instance: &str, plc: &str, condition: Condition) -> ImageInfo {
        let path = format!("/dev/shm/commram.{instance}.{plc}").into();
        ImageInfo { instance: instance.into(), plc: plc.into(), path, condition }
    }

    fn summary(speed: u32) -> ImageSummary {
        ImageSummary {
            pid: 42,
            generation: 1,
            state: Some(State::Ready),
            clock_mode: Some(if speed == 0 { ClockMode::Stepped } else { ClockMode::RealTime }),
            speed,
            virtual_time_us: 2_500,
            device: "device".into(),
            layout_hash: 0,
        }
    }

    #[test]
    fn images_of_one_instance_are_one_line_and_dead_ones_are_flagged() {
        let bad = MemoryError::NotAFile { path: "/dev/shm/commram.z.p".into() };
        let entries = entries(vec![
            image("a", "saw", Condition::Alive(summary(0))),
            image("a", "press", Condition::Alive(summary(0))),
            image("b", "line", Condition::Dead(summary(2_500))),
            image("z", "p", Condition::Unusable(bad)),
        ]);
        let text = "\
NAME  PLCS       PID  CLOCK            TIME        STATE
a     saw press  42   stepped          0.002500 s  ready
b     line       42   real time x 2.5  0.002500 s  dead
z     p          -    -                -           unusable
z: /dev/shm/commram.z.p is no regular file; it is left alone, remove it yourself
";
        assert_eq!(super::text(&entries), text);
    }
}
