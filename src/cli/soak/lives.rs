//! Emulators that end or are killed at any moment, one after the other: what the next one begins with is what was kept last, old or new.

use crate::cli::demo::command;
use crate::cli::stop::remove_remains;
use crate::memory::{AttachMode, Image, Segment, Width};
use crate::plant::PlantConfig;
use crate::script::soak::Round;
use fastrand::Rng;
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// How such rounds are called among the exercises.
pub(super) const NAME: &str = "novram";
/// Emulators of a round.
const LIVES: usize = 6;
/// How long a start or an end may take; then it hangs.
const PATIENCE: Duration = Duration::from_secs(60);
/// Retain flags are written once a second.
const LONGEST_LIFE_US: u64 = 1_200_000;
/// In this time it writes and ends.
const LONGEST_END_US: u64 = 15_000;

/// Retain flags of a device as words, all of which are mostly the same number.
struct Flags {
    device: String,
    first: u32,
    words: u32,
    /// What is kept for sure, and what was stored last.
    kept: u16,
    stored: u16,
}

impl Flags {
    fn all(&self) -> impl DoubleEndedIterator<Item = u32> + use<> {
        let (first, words) = (self.first, self.words);
        (0..words).map(move |word| first + 2 * word)
    }

    /// What stands there was kept last or stored after that. As they are stored in ascending order, a number is followed by none that was
    /// stored later.
    fn check(&mut self, segment: &Segment) -> Result<(), String> {
        let load = |offset| segment.load(offset, Width::Word).map_err(|error| error.to_string());
        let found: Vec<u32> = self.all().map(load).collect::<Result<_, _>>()?;
        let (most, least) = (found.first().copied().unwrap_or(0), found.last().copied().unwrap_or(0));
        let (kept, stored) = (self.kept, self.stored);
        if !found.is_sorted_by(|one, next| one >= next) || least < u32::from(kept) || most > u32::from(stored)
        {
            return Err(format!(
                "retain flags of {}: from {most} to {least}, in order, and not between {kept}, which was kept, and {stored}",
                self.device
            ));
        }
        // Both were read as words.
        (self.kept, self.stored) = (least as u16, most as u16);
        Ok(())
    }

    /// Stores the next number into so many of a thousand.
    fn store(&mut self, segment: &Segment, of_1000: u32) -> Result<(), String> {
        self.stored += 1;
        let words = (u64::from(self.words) * u64::from(of_1000) / 1000) as usize;
        self.all().take(words).try_for_each(|offset| {
            segment.store(offset, Width::Word, self.stored.into()).map_err(|error| error.to_string())
        })
    }
}

/// An emulator; killed when this value is dropped.
struct Life(Child);

impl Life {
    fn start(instance: &str, home: &Path, is_stepped: bool) -> Result<Self, String> {
        let mut command = command("run").map_err(|error| error.to_string())?;
        command.arg(home.join("plant.toml")).arg("--novram").arg(home.join("novram")).args(["-i", instance]);
        command.args(["--clock", if is_stepped { "stepped" } else { "realtime" }]);
        let complaints = home.join("complaints");
        let err = fs::File::create(&complaints).map_err(|error| error.to_string())?;
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(err);
        let mut life = Self(command.spawn().map_err(|error| error.to_string())?);
        let out = life.0.stdout.take();
        let (send, receive) = mpsc::channel();
        let listen = move || {
            let mut line = String::new();
            let mut out = out.map(BufReader::new);
            let _ended = out.as_mut().map(|out| out.read_line(&mut line));
            // Who waits no longer has given up.
            let _ = send.send(line);
            // Nothing that it says later may block it.
            let _ = out.map(|mut out| std::io::copy(&mut out, &mut std::io::sink()));
        };
        std::thread::Builder::new().spawn(listen).map_err(|error| error.to_string())?;
        if receive.recv_timeout(PATIENCE).is_ok_and(|line| !line.is_empty()) {
            return Ok(life);
        }
        drop(life);
        let told = fs::read_to_string(complaints).unwrap_or_default();
        Err(format!("the emulator did not start: {}", told.trim_end()))
    }

    fn signal(&self, signal: Signal) -> Result<(), String> {
        // It is ours, and waited for by nobody else.
        let pid = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw).ok_or("it has no number")?;
        kill_process(pid, signal).map_err(|error| error.to_string())
    }

    fn end(mut self) -> Result<ExitStatus, String> {
        let since = Instant::now();
        while since.elapsed() < PATIENCE {
            if let Some(status) = self.0.try_wait().map_err(|error| error.to_string())? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Err("an emulator that was told to end does not end".to_owned())
    }
}

impl Drop for Life {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What is left in the shared memory goes with it.
struct Instance(String);

impl Drop for Instance {
    fn drop(&mut self) {
        // Nobody can be told; if it cannot be removed, `commram list` shows it.
        let _ = remove_remains(&self.0);
    }
}

/// Plays a round, in this directory under this instance name, until told to `stop`.
///
/// # Errors
/// What was not as it must be.
pub(super) fn play(
    round: &Round,
    home: &Path,
    instance: String,
    stop: impl Fn() -> bool,
) -> Result<(), String> {
    let text = round.plant();
    let config = PlantConfig::parse(round.exercise.name, &text).map_err(|error| error.to_string())?;
    fs::create_dir_all(home.join("novram"))
        .and_then(|()| fs::write(home.join("plant.toml"), &text))
        .map_err(|error| format!("{}: {error}", home.display()))?;
    let areas = config.devices.iter().filter_map(|it| Some((it, &it.layout().retain?.area)));
    let mut flags: Vec<_> = areas
        .map(|(it, area)| {
            let (device, words) = (it.name().to_owned(), it.retain_bytes() / 2);
            Flags { device, first: area.first, words, kept: 0, stored: 0 }
        })
        .collect();
    let (mut rng, instance) = (Rng::with_seed(round.seed), Instance(instance));
    for number in 1..=LIVES {
        if stop() {
            break;
        }
        live(&mut flags, &mut rng, &instance.0, home)
            .map_err(|why| format!("emulator {number} of {LIVES}: {why}"))?;
    }
    Ok(())
}

fn live(flags: &mut [Flags], rng: &mut Rng, instance: &str, home: &Path) -> Result<(), String> {
    let life = Life::start(instance, home, rng.bool())?;
    let is_half_way = rng.u8(..3) == 0;
    for it in &mut *flags {
        let image = Image::attach(instance, &it.device, AttachMode::ReadWrite, None);
        let image = image.map_err(|error| error.to_string())?;
        it.check(image.segment())?;
        it.store(image.segment(), if is_half_way { rng.u32(..1000) } else { 1000 })?;
    }
    let asked = !is_half_way && rng.u8(..3) > 0;
    if asked {
        life.signal(Signal::TERM)?;
    }
    // Of those that are asked some have all the time that they need.
    if !asked || rng.bool() {
        let longest = if asked { LONGEST_END_US } else { LONGEST_LIFE_US };
        std::thread::sleep(Duration::from_micros(rng.u64(..longest)));
        // It may have ended.
        let _ = life.signal(Signal::KILL);
    }
    let status = life.end()?;
    if status.success() {
        flags.iter_mut().for_each(|it| it.kept = it.stored);
    } else if status.code().is_some() {
        return Err(format!("it ended with {status}"));
    }
    Ok(())
}
