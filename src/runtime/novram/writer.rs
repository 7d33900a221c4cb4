//! Writes NOVRAM files in a separate thread.

use super::file::{self, Content};
use super::{Directory, Novram, NovramError};
use crate::identity::DeviceIndex;
use std::collections::BTreeMap;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Interval for checking retain flags. A PLC may change them in every cycle, which is too often for a disk.
const RETAIN_EVERY: Duration = Duration::from_secs(1);
/// Delay before the next attempt to write a file.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// A job of the thread that writes. It contains the name of a file.
enum Job {
    /// Write the changed content.
    Store(String, Content),
    /// Write the unchanged content if another program has damaged or removed the file.
    Restore(String, Content),
}

/// The thread that writes the NOVRAM.
type Writer = JoinHandle<Result<(), NovramError>>;

/// Writes the NOVRAM files of all PLCs. Dropping it waits until everything is written.
#[derive(Debug)]
pub struct Keeper {
    novram: Vec<Option<Novram>>,
    writer: Option<(Sender<Job>, Writer)>,
    next_look: Instant,
}

impl Keeper {
    /// Creates a keeper for the NOVRAM of each device; without a directory it does nothing.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn new(directory: Option<Directory>, novram: Vec<Option<Novram>>) -> std::io::Result<Self> {
        let writer = match directory {
            None => None,
            Some(directory) => {
                let (jobs, received) = mpsc::channel();
                let thread = std::thread::Builder::new().name("novram".to_owned());
                Some((jobs, thread.spawn(move || write_all(directory, &received))?))
            }
        };
        Ok(Keeper { novram, writer, next_look: Instant::now() + RETAIN_EVERY })
    }

    /// Writes the changes. `stored` returns the registers that a device has stored, or `None` if they are lost; if its
    /// second argument is true, it first checks whether another process has shortened the image. Retain flags are checked
    /// once a second, and in the `last` call, which also restores files that another program has
    /// damaged or removed.
    pub fn save<'a>(&mut self, stored: impl Fn(DeviceIndex, bool) -> Option<(&'a [u8], u32)>, last: bool) {
        let Some((jobs, _)) = &self.writer else { return };
        let now = Instant::now();
        let retain = last || now >= self.next_look;
        if retain {
            self.next_look = now + RETAIN_EVERY;
        }
        let novram = DeviceIndex::enumerate(&mut self.novram);
        for (index, novram) in novram.filter_map(|(index, novram)| Some((index, novram.as_mut()?))) {
            if let Some(stored_now) = stored(index, false) {
                let job = match novram.changed(stored_now, retain) {
                    Some(content) => Job::Store(novram.name.clone(), content),
                    None if last => Job::Restore(novram.name.clone(), novram.saved.clone()),
                    None => continue,
                };
                // If the image was shortened during the read, the file keeps the last known content.
                if stored(index, true).is_some() {
                    // This cannot fail: the thread runs as long as this value exists.
                    let _ = jobs.send(job);
                }
            }
        }
    }

    /// Waits until everything is written, and releases the directory.
    ///
    /// # Errors
    /// [`NovramError::Lost`]: the last attempt to write a file failed, too. If several files failed, the log has the
    /// others.
    pub fn close(&mut self) -> Result<(), NovramError> {
        let Some((jobs, thread)) = self.writer.take() else { return Ok(()) };
        drop(jobs);
        // If the thread has panicked, some files may not be written. So the panic continues here.
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        if let Some((jobs, thread)) = self.writer.take() {
            drop(jobs);
            if let Ok(Err(error)) = thread.join() {
                tracing::error!("{error}");
            }
        }
    }
}

/// Writes each job, or only the newest one of a file if several have arrived. Retries failed writes, for the last time
/// when no more jobs can arrive.
fn write_all(mut directory: Directory, jobs: &Receiver<Job>) -> Result<(), NovramError> {
    let mut dirty: BTreeMap<String, Content> = BTreeMap::new();
    let mut logged_faults = BTreeMap::new();
    loop {
        let next = match dirty.is_empty() {
            true => jobs.recv().map_err(|_| RecvTimeoutError::Disconnected),
            false => jobs.recv_timeout(RETRY_AFTER),
        };
        match next {
            Ok(job) => {
                for job in [job].into_iter().chain(jobs.try_iter()) {
                    match job {
                        Job::Store(name, content) => drop(dirty.insert(name, content)),
                        Job::Restore(name, content) if !file::holds(&directory, &name, &content) => {
                            dirty.insert(name, content);
                        }
                        Job::Restore(..) => {}
                    }
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        dirty.retain(|name, content| {
            let result = file::store(&mut directory, name, content);
            log_change(name, &result, &mut logged_faults);
            result.is_err()
        });
    }
    let mut result = Ok(());
    for (name, content) in dirty {
        if let Err(source) = file::store(&mut directory, &name, &content) {
            let lost = NovramError::Lost { source: Box::new(source) };
            match &result {
                Ok(()) => result = Err(lost),
                Err(_) => tracing::error!("{lost}"),
            }
        }
    }
    result
}

/// Logs a failed write of a file only once, until the file is written or another error occurs.
fn log_change(name: &str, result: &Result<(), NovramError>, logged_faults: &mut BTreeMap<String, String>) {
    match result {
        Ok(()) => {
            if logged_faults.remove(name).is_some() {
                tracing::warn!("NOVRAM {name}: written now");
            }
        }
        Err(error) => {
            let text = error.to_string();
            if logged_faults.get(name) != Some(&text) {
                tracing::error!("{text}; next attempts every {RETRY_AFTER:?}");
                logged_faults.insert(name.to_owned(), text);
            }
        }
    }
}
