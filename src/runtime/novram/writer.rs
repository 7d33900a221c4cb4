//! Writes NOVRAM files beside the emulator's own thread.

use super::file::{self, Content};
use super::{Novram, NovramError};
use crate::firmware::ethernet::Stored;
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often retain flags are looked at. A PLC may change them in every cycle; a disk cannot.
const RETAIN_EVERY: Duration = Duration::from_secs(1);

/// A content and the file it belongs to.
type Job = (PathBuf, Content);

/// Keeps the NOVRAM files of all PLCs. Dropping it waits until everything is written.
#[derive(Debug)]
pub struct Keeper {
    novram: Vec<Novram>,
    writer: Option<(Sender<Job>, JoinHandle<()>)>,
    next_look: Instant,
}

impl Keeper {
    /// Keeps these, in the order of the plant; without any it never does anything.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn new(novram: Vec<Novram>) -> std::io::Result<Self> {
        let writer = match novram.first() {
            None => None,
            Some(_) => {
                let (jobs, received) = mpsc::channel();
                let name = "novram".to_owned();
                Some((jobs, std::thread::Builder::new().name(name).spawn(move || write_all(&received))?))
            }
        };
        Ok(Keeper { novram, writer, next_look: Instant::now() + RETAIN_EVERY })
    }

    /// Writes what has changed; `stored` tells the Ethernet configuration of a PLC. The retain flags are looked at
    /// once a second, or if this is the `last` time.
    pub fn save<'a>(&mut self, stored: impl Fn(usize) -> Option<(&'a Stored, u32)>, last: bool) {
        let Some((jobs, _)) = &self.writer else { return };
        let now = Instant::now();
        let retain = last || now >= self.next_look;
        if retain {
            self.next_look = now + RETAIN_EVERY;
        }
        for (index, novram) in self.novram.iter_mut().enumerate() {
            if let Some(stored) = stored(index)
                && let Some(content) = novram.changed(stored, retain)
            {
                // The thread ends after this value only.
                let _ = jobs.send((novram.path.clone(), content));
            }
        }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        if let Some((jobs, thread)) = self.writer.take() {
            drop(jobs);
            // It does not panic, and if it did there would be nothing left to write.
            let _ = thread.join();
        }
    }
}

/// Writes each job, or only the last one for a file if several have come meanwhile.
fn write_all(jobs: &Receiver<Job>) {
    let mut failed = None;
    while let Ok(first) = jobs.recv() {
        let mut waiting = vec![first];
        for job in jobs.try_iter() {
            waiting.retain(|(path, _)| *path != job.0);
            waiting.push(job);
        }
        for (path, content) in waiting {
            complain(file::store(&path, &content), &mut failed);
        }
    }
}

/// Says what is wrong, once until it is well again or something else is wrong.
fn complain(result: Result<(), NovramError>, failed: &mut Option<String>) {
    match result {
        Ok(()) => *failed = None,
        Err(error) => {
            let text = error.to_string();
            if failed.as_ref() != Some(&text) {
                tracing::error!("{text}");
            }
            *failed = Some(text);
        }
    }
}
