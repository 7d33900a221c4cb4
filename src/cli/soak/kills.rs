//! Rounds in which emulators of one instance are ended or killed at any moment, one after the other. Each emulator must
//! start with values that its predecessors have saved.

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

/// Name of the rounds with kills among the exercises.
pub(super) const NAME: &str = "novram";
/// Number of emulators in a round, which run one after the other.
const LIVES: usize = 6;
/// Time limit for the start or the end of an emulator. A slower emulator counts as hanging.
const PATIENCE: Duration = Duration::from_secs(60);
/// Longest run of an emulator before it is killed, so that the kill often hits a write: the emulator writes retain
/// flags once a second.
const LONGEST_LIFE_US: u64 = 1_200_000;
/// Longest time between the request to end and the kill. Within this time the emulator writes NOVRAM and ends.
const LONGEST_END_US: u64 = 15_000;

/// Retain flags of a device as words; most of them contain the same number.
struct RetainFlags {
    device: String,
    first: u32,
    words: u32,
    /// The number that is certainly saved in a file; `stored` is the number that was stored last.
    kept: u16,
    stored: u16,
}

impl RetainFlags {
    fn all(&self) -> impl DoubleEndedIterator<Item = u32> + use<> {
        let (first, words) = (self.first, self.words);
        (0..words).map(move |word| first + 2 * word)
    }

    /// Checks that each flag contains the number that was saved last, or a number that was stored later. Each store
    /// begins at the first flag, so the number of a flag must not be larger than the number of the preceding flag.
    fn check(&mut self, segment: &Segment) -> Result<(), String> {
        let load = |offset| segment.load(offset, Width::Word).map_err(|error| error.to_string());
        let found: Vec<u32> = self.all().map(load).collect::<Result<_, _>>()?;
        let (most, least) = (found.first().copied().unwrap_or(0), found.last().copied().unwrap_or(0));
        let (kept, stored) = (self.kept, self.stored);
        if !found.is_sorted_by(|one, next| one >= next) || least < u32::from(kept) || most > u32::from(stored)
        {
            return Err(format!(
                "retain flags of {}: from {most} to {least} in order, but not between {kept}, which was saved, and {stored}",
                self.device
            ));
        }
        // The casts lose nothing: the numbers in the flags are words.
        (self.kept, self.stored) = (least as u16, most as u16);
        Ok(())
    }

    /// Stores the next number into `of_1000` of every thousand flags.
    fn store(&mut self, segment: &Segment, of_1000: u32) -> Result<(), String> {
        self.stored += 1;
        let words = (u64::from(self.words) * u64::from(of_1000) / 1000) as usize;
        self.all().take(words).try_for_each(|offset| {
            segment.store(offset, Width::Word, self.stored.into()).map_err(|error| error.to_string())
        })
    }
}

/// An emulator process. Dropping this value kills the process.
struct EmulatorChild(Child);

impl EmulatorChild {
    fn start(instance: &str, home: &Path, is_stepped: bool) -> Result<Self, String> {
        let mut command = command("run").map_err(|error| error.to_string())?;
        command.arg(home.join("plant.toml")).arg("--novram").arg(home.join("novram")).args(["-i", instance]);
        command.args(["--clock", if is_stepped { "stepped" } else { "realtime" }]);
        let complaints = home.join("complaints");
        let err = fs::File::create(&complaints).map_err(|error| error.to_string())?;
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(err);
        let mut emulator = Self(command.spawn().map_err(|error| error.to_string())?);
        let out = emulator.0.stdout.take();
        let (send, receive) = mpsc::channel();
        let listen = move || {
            let mut line = String::new();
            let mut out = out.map(BufReader::new);
            let _ended = out.as_mut().map(|out| out.read_line(&mut line));
            // An error is ignored: sending fails if the caller has given up because the start has timed out.
            let _ = send.send(line);
            // Reads further output, so that the emulator never blocks on it.
            let _ = out.map(|mut out| std::io::copy(&mut out, &mut std::io::sink()));
        };
        std::thread::Builder::new().spawn(listen).map_err(|error| error.to_string())?;
        if receive.recv_timeout(PATIENCE).is_ok_and(|line| !line.is_empty()) {
            return Ok(emulator);
        }
        drop(emulator);
        let error_text = fs::read_to_string(complaints).unwrap_or_default();
        Err(format!("the emulator did not start: {}", error_text.trim_end()))
    }

    fn signal(&self, signal: Signal) -> Result<(), String> {
        // The process is our child and has not been reaped, so its id is valid.
        let pid = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw).ok_or("it has no process id")?;
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
        Err("an emulator that was asked to end does not end".to_owned())
    }
}

impl Drop for EmulatorChild {
    fn drop(&mut self) {
        // The process may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Name of an instance. Dropping this value removes the shared memory files of the instance.
struct InstanceCleanup(String);

impl Drop for InstanceCleanup {
    fn drop(&mut self) {
        // An error cannot be reported here; `commram list` shows an instance that was not removed.
        let _ = remove_remains(&self.0);
    }
}

/// Plays a round in this directory and under this instance name. Ends early when `stop` returns true.
///
/// # Errors
/// The emulator behaved wrongly; the error is a description.
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
            RetainFlags { device, first: area.first, words, kept: 0, stored: 0 }
        })
        .collect();
    let (mut rng, instance) = (Rng::with_seed(round.seed), InstanceCleanup(instance));
    for number in 1..=LIVES {
        if stop() {
            break;
        }
        live(&mut flags, &mut rng, &instance.0, home)
            .map_err(|why| format!("emulator {number} of {LIVES}: {why}"))?;
    }
    Ok(())
}

fn live(flags: &mut [RetainFlags], rng: &mut Rng, instance: &str, home: &Path) -> Result<(), String> {
    let emulator = EmulatorChild::start(instance, home, rng.bool())?;
    let is_half_way = rng.u8(..3) == 0;
    for it in &mut *flags {
        let image = Image::attach(instance, &it.device, AttachMode::ReadWrite, None);
        let image = image.map_err(|error| error.to_string())?;
        it.check(image.segment())?;
        it.store(image.segment(), if is_half_way { rng.u32(..1000) } else { 1000 })?;
    }
    let asked = !is_half_way && rng.u8(..3) > 0;
    if asked {
        emulator.signal(Signal::TERM)?;
    }
    // An emulator that was requested to end is killed only at random. Otherwise it gets all the time that it needs to
    // end.
    if !asked || rng.bool() {
        let longest = if asked { LONGEST_END_US } else { LONGEST_LIFE_US };
        std::thread::sleep(Duration::from_micros(rng.u64(..longest)));
        // The process may have ended.
        let _ = emulator.signal(Signal::KILL);
    }
    let status = emulator.end()?;
    if status.success() {
        flags.iter_mut().for_each(|it| it.kept = it.stored);
    } else if status.code().is_some() {
        return Err(format!("it ended with {status}"));
    }
    Ok(())
}
