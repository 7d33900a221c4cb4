//! `commram stop`: end an emulator.

use super::error::CliError;
use super::session::{alive, dead, images_of, is_alive};
use super::{InstanceName, output};
use crate::memory::names::channel_root;
use crate::memory::{AttachMode, EmulatorProcess, Image, InstanceLock, MemoryError, RunningInstance};
use std::borrow::Cow;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// End an emulator and wait until it has removed its files.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram stop
  commram stop -i test-3
  commram stop --all
  commram stop --clean -i test-3")]
pub(crate) struct Args {
    /// If the emulator was killed, remove its files
    #[arg(long)]
    clean: bool,
    /// End all emulators of this user
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    instance: InstanceName,
}

/// Time limit for the end of an emulator.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time limit for the system to remove a process that has been killed.
const DYING: Duration = Duration::from_secs(1);
/// Longest wait for an emulator that has confirmed the request. After this time the emulator also gets a signal,
/// because another program can write the same confirmation to the header page.
const DOUBT: Duration = Duration::from_secs(1);
/// Pause between two checks of whether the emulator has ended.
const LOOK: Duration = Duration::from_millis(2);
/// Time limit for connecting to the channel, and for the answer, before the emulator gets a signal.
const ANSWER: Duration = Duration::from_millis(500);
/// Maximum number of attempts to remove files while other emulators of this name start and end.
const CLEANING_TRIES: u32 = 5;

/// Ends the emulator, or all of them.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let name = &args.instance.name;
    if args.clean {
        super::web::remove_left_files()?;
    }
    if args.all {
        // The arguments do not show whether the user has named the default instance or no instance. So only another
        // name is refused.
        if *name != InstanceName::usual() {
            let right = "ends all instances; leave out either this or --all".to_owned();
            return Err(CliError::Argument { text: format!("--all -i {name}"), right });
        }
        return end_all(args.clean);
    }
    end(name, args.clean).map_err(|error| match error {
        CliError::NotRunning { instance, running } => CliError::NothingToEnd { instance, running },
        other => other,
    })
}

/// Ends all instances. An error at one instance does not prevent the end of the other instances.
fn end_all(clean: bool) -> Result<(), CliError> {
    let mut failed = None;
    let mut any = false;
    for name in crate::memory::instances()? {
        let mut note_failure = |error: CliError| {
            any = true;
            if let Some(before) = failed.replace(error) {
                output::complain(&before.to_string());
            }
        };
        let is_running = match find(&name) {
            Ok(running) => running.is_some(),
            // Another user owns the directory of this name, so no instance of this user has it.
            Err(CliError::Memory(MemoryError::ForeignDirectory { .. })) => false,
            Err(error) => {
                note_failure(error);
                continue;
            }
        };
        let is_dead = || matches!(killed(&name), Ok(Some(_)));
        let is_left = || is_dead() || channel_root(&name).is_ok_and(|root| is_own(&root));
        if !is_running && !clean {
            if is_dead() {
                note_killed(&name);
            }
            continue;
        }
        if !is_running && !is_left() {
            continue;
        }
        match end(&name, clean) {
            // The instance may have ended by itself in the meantime.
            Ok(()) | Err(CliError::NotRunning { .. }) => any = true,
            Err(CliError::Dead { .. }) => {
                any = true;
                note_killed(&name);
            }
            Err(error) => note_failure(error),
        }
    }
    if !any {
        return output::print("no instance is running\n");
    }
    failed.map_or(Ok(()), Err)
}

fn note_killed(name: &str) {
    output::note(&format!("instance '{name}' was killed; `commram stop --all --clean` removes its files"));
}

fn note_renamed(name: &str, path: &Path) {
    output::note(&format!(
        "{} remains: another program has renamed this image, so the emulator could not remove it; `commram stop --clean -i \
         {name}` removes it",
        path.display()
    ));
}

/// True if a directory exists and belongs to this user.
fn is_own(directory: &Path) -> bool {
    let user = rustix::process::geteuid().as_raw();
    directory.symlink_metadata().is_ok_and(|it| it.is_dir() && it.uid() == user)
}

/// Finds the emulator of an instance.
///
/// # Errors
/// Returns the errors of [`RunningInstance::find`]. [`CliError::OpenDirectory`]: an emulator may run, but it holds no
/// lock that proves it.
fn find(name: &str) -> Result<Option<RunningInstance>, CliError> {
    RunningInstance::find(name).map_err(|error| match error {
        MemoryError::OpenDirectory { .. } => CliError::OpenDirectory(error),
        other => other.into(),
    })
}

fn end(name: &str, clean: bool) -> Result<(), CliError> {
    let Some(running) = find(name)? else {
        if clean && let Some(outcome) = clean_up(name)? {
            return output::print(&outcome);
        }
        return Err(why_not(name));
    };
    match stop(name, &running) {
        Ok(()) => {
            let renamed: Vec<_> = running.renamed().collect();
            if clean && !renamed.is_empty() {
                remove_remains(name)?;
            } else {
                renamed.iter().for_each(|path| note_renamed(name, path));
            }
            output::print(&format!("instance '{name}' has stopped\n"))
        }
        Err(error @ CliError::Dead { .. }) if clean => {
            clean_up(name)?.map_or(Err(error), |outcome| output::print(&outcome))
        }
        // The loss stays an error, although the files are removed.
        Err(CliError::KilledAtEnd { instance, pid, files }) if clean => {
            let files = clean_up(name)?.map_or(files, |_| "its files are removed".to_owned());
            Err(CliError::KilledAtEnd { instance, pid, files })
        }
        Err(error) => Err(error),
    }
}

/// Removes the files of a killed emulator and returns the message about it. Returns `None` if there were no such files.
/// If a new emulator of this name has started in the meantime, it has replaced these files, and the function does
/// nothing.
///
/// # Errors
/// Returns the errors of [`remove_remains`], except the error about a new emulator.
fn clean_up(name: &str) -> Result<Option<String>, CliError> {
    let mut tries = 0;
    loop {
        let taken = match remove_remains(name) {
            Err(CliError::Memory(
                error @ (MemoryError::InstanceTaken { .. } | MemoryError::AlreadyRunning { .. }),
            )) => error,
            outcome => {
                let text = format!("instance '{name}' was dead, its files are removed\n");
                return outcome.map(|any| any.then_some(text));
            }
        };
        if let Some(new) = RunningInstance::find(name)? {
            let process = new.process().map_or_else(String::new, |it| format!(" (process {})", it.pid()));
            return Ok(Some(format!(
                "instance '{name}' runs again: a new emulator{process} has replaced the files of the dead one and is \
                 left alone\n"
            )));
        }
        // Another emulator of this name has started and ended in the meantime. It may have left files, too, so the
        // removal begins again.
        tries += 1;
        if tries == CLEANING_TRIES {
            return Err(taken.into());
        }
    }
}

/// Explains why there is no instance to end.
fn why_not(name: &str) -> CliError {
    let instance = name.to_owned();
    match killed(name) {
        Ok(Some(pid)) => CliError::Dead { instance, pid },
        Ok(None) => CliError::NotRunning { instance, running: String::new() },
        Err(error) => error,
    }
}

/// Returns the process id of a killed emulator with remaining images. If a process has released its locks and still
/// exists, it was just killed; the function gives the system time to remove it. Returns `None` if no image exists, or
/// if a new emulator runs.
fn killed(name: &str) -> Result<Option<u32>, CliError> {
    let start = Instant::now();
    loop {
        let images = images_of(name)?;
        if let Some(pid) = dead(&images) {
            return Ok(Some(pid));
        }
        let Some(pid) = alive(&images) else { return Ok(None) };
        if find(name)?.is_some() {
            return Ok(None);
        }
        if start.elapsed() > DYING {
            return Ok(Some(pid));
        }
        std::thread::sleep(LOOK);
    }
}

/// Removes the files of a killed emulator. No other emulator of this name can start during this time. Returns true if
/// files existed.
///
/// # Errors
/// An emulator is running, its files cannot be removed, or the operating system refuses the request.
pub(crate) fn remove_remains(instance: &str) -> Result<bool, CliError> {
    let directory = channel_root(instance)?.symlink_metadata().is_ok();
    let lock = InstanceLock::take_to_clean(instance)?;
    let images = lock.remove_dead(|_| false);
    crate::channel::remove_remains(instance, &channel_root(instance)?)?;
    let left = lock.empty_directory()?;
    drop(lock);
    let images = images?;
    if left.is_empty() {
        return Ok(images || directory);
    }
    let (directory, entries) = (channel_root(instance)?, left.join(", "));
    Err(CliError::Remains { instance: instance.to_owned(), directory, entries })
}

/// The place of an emulator whose process this command does not see.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EmulatorPlace {
    /// `/proc` is missing here, so the emulator may be anywhere.
    Unknown,
    /// The emulator is in another PID namespace, or `/proc` does not show its locks.
    Elsewhere,
    /// This process holds the locks, and is not an emulator.
    Other(u32),
}

impl EmulatorPlace {
    fn of_unseen(running: &RunningInstance) -> Self {
        match running.other_holder() {
            Some(pid) => Self::Other(pid),
            None if Path::new("/proc/self/stat").exists() => Self::Elsewhere,
            None => Self::Unknown,
        }
    }

    /// The reason and the remedy, as the end of a message.
    pub(crate) fn text(self) -> Cow<'static, str> {
        match self {
            Self::Unknown => "`/proc` is missing here. Call `commram stop` where it is mounted".into(),
            Self::Elsewhere => {
                "the emulator runs in another PID namespace, such as a container. Call `commram stop` there"
                    .into()
            }
            Self::Other(pid) => {
                format!("process {pid} holds them, and is not an emulator; end it first").into()
            }
        }
    }
}

/// Requests the emulator to end, through its channel. An emulator that does not answer gets a signal: it may have no
/// channel, or its clock may wait for a client. A stopped process is continued, also if it is stopped during
/// this function.
fn stop(name: &str, running: &RunningInstance) -> Result<(), CliError> {
    let process = running.process();
    let mut let_go_on = go_on(name, process);
    let_go_on()?;
    let pid = process.map(EmulatorProcess::pid).or_else(|| alive(&images_of(name).ok()?));
    let refused = ask(name, running).err();
    let mut terminate = {
        let mut is_done = false;
        move || match process.filter(|_| !core::mem::replace(&mut is_done, true)) {
            Some(process) => process.terminate(),
            None => Ok(()),
        }
    };
    if refused.is_some() {
        terminate()?;
    }
    // A process that is not visible here gets no signal. Usually it has just ended.
    let unseen = refused.filter(|_| process.is_none());
    let patience = if unseen.is_some() { DYING } else { PATIENCE };
    let start = Instant::now();
    while !running.has_ended() {
        if start.elapsed() > patience {
            if let Some(refused) = unseen {
                let place = EmulatorPlace::of_unseen(running);
                return Err(CliError::Unseen { instance: name.to_owned(), place, source: Box::new(refused) });
            }
            return Err(CliError::StillThere { instance: name.to_owned(), pid, seconds: PATIENCE.as_secs() });
        }
        if start.elapsed() > DOUBT {
            terminate()?;
        }
        // The process may have been stopped (SIGSTOP) since the first check. It must run, so that the termination
        // signal takes effect.
        let_go_on()?;
        running.wait(LOOK);
    }
    // An emulator that ends cleanly leaves no files, except images that another program has renamed.
    if running.has_left_files() {
        let (instance, pid) = (name.to_owned(), pid.unwrap_or_default());
        if !running.was_ending() {
            return Err(CliError::Dead { instance, pid });
        }
        let files = format!("remove its files with `commram stop --clean -i {name}`");
        return Err(CliError::KilledAtEnd { instance, pid, files });
    }
    match running.is_unsaved() {
        true => Err(CliError::Unsaved { instance: name.to_owned() }),
        false => Ok(()),
    }
}

/// Continues the process of the emulator each time it is stopped. Prints a note the first time.
fn go_on<'a>(
    name: &'a str,
    process: Option<&'a EmulatorProcess>,
) -> impl FnMut() -> Result<(), CliError> + 'a {
    let mut is_reported = false;
    move || {
        if let Some(process) = process
            && process.resume()?
            && !core::mem::replace(&mut is_reported, true)
        {
            output::note(&format!(
                "instance '{name}' was stopped (process {}); it is continued to end",
                process.pid()
            ));
        }
        Ok(())
    }
}

/// Requests the emulator to end, unless another emulator of this name has replaced it.
fn ask(name: &str, running: &RunningInstance) -> Result<(), CliError> {
    use crate::channel::client::Patience;
    use crate::channel::{Client, ClientError, HeaderBells};
    use crate::request::{Op, Reply, WrongReply};
    let images = images_of(name)?;
    let Some(image) = images.iter().find(|image| is_alive(image)) else {
        return Err(why_not(name));
    };
    let attached = match Image::attach(name, &image.plc, AttachMode::HeaderOnly, None) {
        Err(MemoryError::NotReady { state: Some(state), .. }) if state.is_ending() => return Ok(()),
        other => other?,
    };
    let bells = Box::new(HeaderBells::of_client(attached)?);
    let patience = Patience { enter_limit: ANSWER, reply: ANSWER, ..Patience::default() };
    // The emulator can remove its channel only when no client is connected. So this client must not outlive the
    // function.
    let client = Client::connect(name, &channel_root(name)?, bells, patience)?;
    // Another emulator of this name can open a channel only after `running` has released its locks. So if `running`
    // still holds its locks, the connected channel belongs to it.
    if running.has_ended() {
        return Ok(());
    }
    match client.request(&[Op::Info, Op::Stop]) {
        Ok(replies) => {
            if let Some(Reply::Info(info)) = replies.first()
                && let Some(awaited) = &info.waits_for
            {
                output::note(&format!("instance '{name}' waited for {awaited}"));
            }
            match replies.into_iter().next_back() {
                Some(Reply::Stopping | Reply::NotExecuted) => Ok(()),
                _ => Err(WrongReply.into()),
            }
        }
        Err(ClientError::EmulatorGone { .. }) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_emulator_has_replaced_the_files_to_be_removed() {
        let name = format!("stop-clean-{}", std::process::id());
        let new = InstanceLock::take(&name).unwrap();
        let outcome = clean_up(&name).unwrap().unwrap();
        let process = std::process::id();
        assert!(outcome.contains(&format!("a new emulator (process {process}) has replaced")), "{outcome}");
        drop(new);
        assert_eq!(clean_up(&name).unwrap(), None);
    }
}
