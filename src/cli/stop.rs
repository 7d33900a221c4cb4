//! `commram stop`: end an emulator.

use super::error::CliError;
use super::session::{alive, dead, images_of, is_alive};
use super::{InstanceName, output};
use crate::memory::names::channel_root;
use crate::memory::{AttachMode, Condition, EmulatorProcess, Image, ImageInfo, InstanceLock};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// End an emulator and wait until it has cleaned up.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram stop
  commram stop -i test-3
  commram stop --all
  commram stop --clean -i test-3")]
pub(crate) struct Args {
    /// If the emulator was killed, remove what it left
    #[arg(long)]
    clean: bool,
    /// End all emulators of yours
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    instance: InstanceName,
}

/// How long an emulator may take to clean up.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long the system may take to do away with a process that has died.
const DYING: Duration = Duration::from_secs(1);
/// How long the way into the channel, and then the answer, may take before it gets a signal.
#[cfg(feature = "channel")]
const ANSWER: Duration = Duration::from_millis(500);

/// Ends the emulator, or all of them.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let name = &args.instance.name;
    if args.all {
        // Whether it was given cannot be seen if it is the usual one.
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

/// Ends all; what cannot be ended does not keep the others.
fn end_all(clean: bool) -> Result<(), CliError> {
    let is_meant = |image: &ImageInfo| match image.condition {
        Condition::Alive(_) => true,
        Condition::Dead(_) => clean,
        Condition::Unusable(_) => false,
    };
    let images = crate::memory::list()?;
    let killed = |image: &&ImageInfo| !clean && matches!(image.condition, Condition::Dead(_));
    let killed: BTreeSet<_> = images.iter().filter(killed).map(|image| image.instance.clone()).collect();
    let names: BTreeSet<_> = images.into_iter().filter(is_meant).map(|image| image.instance).collect();
    let was_killed = |name: &str| {
        output::note(&format!(
            "instance '{name}' was killed; `commram stop --all --clean` removes what it left"
        ));
    };
    killed.difference(&names).for_each(|name| was_killed(name));
    if names.is_empty() {
        return output::print("no instance is running\n");
    }
    let mut failed = None;
    for name in &names {
        match end(name, clean) {
            // It has ended by itself meanwhile.
            Ok(()) | Err(CliError::NotRunning { .. }) => {}
            Err(CliError::Dead { .. }) => was_killed(name),
            Err(error) => {
                if let Some(before) = failed.replace(error) {
                    output::complain(&before.to_string());
                }
            }
        }
    }
    failed.map_or(Ok(()), Err)
}

fn end(name: &str, clean: bool) -> Result<(), CliError> {
    let process = match InstanceLock::holder(name)? {
        // Somebody has removed the directory or the lock in it: the images tell who it is.
        None => serving(name).map(Some),
        holder => holder,
    };
    let Some(process) = process else {
        if clean && remove_remains(name)? {
            return output::print(&format!("instance '{name}' was dead, what it left is removed\n"));
        }
        return Err(why_not(name)?);
    };
    stop(name, process)?;
    output::print(&format!("instance '{name}' has stopped\n"))
}

/// The process that serves the images of an instance.
fn serving(name: &str) -> Option<EmulatorProcess> {
    let images = images_of(name).ok()?;
    let alive = images.iter().filter(|image| is_alive(image));
    alive.filter_map(|image| EmulatorProcess::serving(name, &image.plc).ok()?).next()
}

/// Why there is nothing to end.
fn why_not(name: &str) -> Result<CliError, CliError> {
    let images = images_of(name)?;
    let instance = name.to_owned();
    Ok(match (dead(&images), alive(&images)) {
        (Some(pid), _) => CliError::Dead { instance, pid },
        // Somebody has just killed it: it has let go of its lock, but the system has not done away with it yet.
        (None, Some(pid)) if channel_root(name)?.symlink_metadata().is_ok() => {
            CliError::Dead { instance, pid }
        }
        (None, Some(pid)) => CliError::NoDirectory { instance, pid },
        (None, None) => CliError::NotRunning { instance, running: String::new() },
    })
}

/// Removes what a killed emulator has left. Nobody else can start meanwhile. Returns whether there was anything.
///
/// # Errors
/// An emulator lives, something is in the way, or the system refuses.
pub(crate) fn remove_remains(instance: &str) -> Result<bool, CliError> {
    let directory = channel_root(instance)?.symlink_metadata().is_ok();
    let lock = InstanceLock::take(instance)?;
    let images = lock.remove_dead(|_| false);
    #[cfg(feature = "channel")]
    crate::channel::remove_remains(instance, &channel_root(instance)?)?;
    drop(lock);
    Ok(images? || directory)
}

/// Asks the emulator through its channel. If it does not answer, because it has no channel or its clock waits for
/// somebody, it gets a signal; one that is stopped, before or meanwhile, goes on.
fn stop(name: &str, process: Option<EmulatorProcess>) -> Result<(), CliError> {
    let mut is_told = false;
    let mut let_go_on = || -> Result<(), CliError> {
        if let Some(process) = process
            && process.resume()?
            && !core::mem::replace(&mut is_told, true)
        {
            output::note(&format!(
                "instance '{name}' was stopped (process {}); it goes on to end",
                process.pid()
            ));
        }
        Ok(())
    };
    let_go_on()?;
    // What the emulator says at its very end stands in each of its images, also when the files are gone.
    let seen = |image: ImageInfo| Image::attach(name, &image.plc, AttachMode::ReadOnly, None).ok();
    let image = images_of(name).into_iter().flatten().filter(is_alive).find_map(seen);
    let refused = ask(name).err();
    if refused.is_some()
        && let Some(process) = process
    {
        process.terminate()?;
    }
    // One that cannot be seen gets no signal, but mostly it has just died.
    let unseen = refused.filter(|_| process.is_none());
    let patience = if unseen.is_some() { DYING } else { PATIENCE };
    let start = Instant::now();
    // Its process may have more to do: that of `commram with` waits for its command.
    while InstanceLock::holder(name)?.is_some() || serving(name).is_some() {
        if start.elapsed() > patience {
            if let Some(refused) = unseen {
                return Err(refused);
            }
            let pid = process.map(|process| process.pid());
            return Err(CliError::StillThere { instance: name.to_owned(), pid, seconds: PATIENCE.as_secs() });
        }
        // The signal that stops it may have come behind the first look, and is done only when it runs.
        let_go_on()?;
        std::thread::sleep(Duration::from_millis(1));
    }
    // One that ends in good order leaves no images.
    match images_of(name).ok().and_then(|images| dead(&images)) {
        Some(pid) => Err(CliError::Dead { instance: name.to_owned(), pid }),
        None if image.is_some_and(|image| image.is_unsaved()) => {
            Err(CliError::Unsaved { instance: name.to_owned() })
        }
        None => Ok(()),
    }
}

#[cfg(feature = "channel")]
fn ask(name: &str) -> Result<(), CliError> {
    use crate::channel::client::Patience;
    use crate::channel::{Client, ClientError, HeaderBells};
    use crate::memory::MemoryError;
    use crate::request::{Op, Reply, WrongReply};
    let images = images_of(name)?;
    let Some(image) = images.iter().find(|image| is_alive(image)) else {
        return Err(why_not(name)?);
    };
    let attached = match Image::attach(name, &image.plc, AttachMode::ReadWrite, None) {
        Err(MemoryError::NotReady { state: Some(state), .. }) if state.is_ending() => return Ok(()),
        other => other?,
    };
    let bells = Box::new(HeaderBells::of_client(attached)?);
    let patience = Patience { enter: ANSWER, reply: ANSWER, ..Patience::default() };
    // The client is gone at the end of this, so that the emulator can sweep its channel.
    let client = Client::connect(name, &channel_root(name)?, bells, patience)?;
    match client.request(&[Op::Info, Op::Stop]) {
        Ok(replies) => {
            if let Some(Reply::Info(info)) = replies.first()
                && let Some(who) = &info.waits_for
            {
                output::note(&format!("instance '{name}' waited for {who}"));
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

#[cfg(not(feature = "channel"))]
fn ask(_name: &str) -> Result<(), CliError> {
    Err(CliError::NoChannel { command: "stop" })
}
