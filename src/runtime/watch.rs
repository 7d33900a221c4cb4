//! Watches the image files: logs changes by other processes, and detects whether another process has an image open. If
//! no other process has an image open, the emulator sleeps longer.

use super::emulator::StopHandle;
#[cfg(feature = "channel")]
use crate::channel::ChannelWatch;
use crate::memory::{FileState, ImageFileWatch, Onlookers, WakeReason, end_of_wait};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Real time between two checks.
const EVERY: Duration = Duration::from_millis(200);

/// The watching thread. Dropping it ends the thread after a last check.
#[derive(Debug)]
pub(super) struct Watch {
    thread: Option<JoinHandle<()>>,
    end: Arc<OwnedFd>,
    /// True if no other process has an image open.
    is_alone: Arc<AtomicBool>,
}

impl Watch {
    /// Starts a watch over these files and the channel. The emulator queries the state of the watch. A shortened image
    /// ends the emulator, see [`super::RuntimeError::Shortened`].
    ///
    /// # Errors
    /// No thread can be started.
    pub(crate) fn start(
        files: Vec<ImageFileWatch>,
        #[cfg(feature = "channel")] channel: Option<ChannelWatch>,
        stop: StopHandle,
    ) -> std::io::Result<Self> {
        let (end, is_alone) = (Arc::new(end_of_wait()?), Arc::<AtomicBool>::default());
        let thread = std::thread::Builder::new().name("images".to_owned());
        let look = move || {
            #[cfg(feature = "channel")]
            if let Some(channel) = &channel {
                channel.look();
            }
        };
        let (ended, alone) = (Arc::clone(&end), Arc::clone(&is_alone));
        let run = move || watch(&Onlookers::of(files), look, &stop, &ended, &alone);
        Ok(Self { thread: Some(thread.spawn(run)?), end, is_alone })
    }

    /// True if no other process can read or write a register now. When a process opens an image, the doorbell rings.
    #[inline]
    pub(super) fn is_alone(&self) -> bool {
        self.is_alone.load(Ordering::Acquire)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        // A write to an eventfd needs a number of eight bytes.
        let _ = rustix::io::write(&*self.end, &1u64.to_ne_bytes());
        if let Some(thread) = self.thread.take() {
            // The thread does not panic, and its result is not needed.
            let _ = thread.join();
        }
    }
}

fn watch(onlookers: &Onlookers, look: impl Fn(), stop: &StopHandle, ended: &OwnedFd, is_alone: &AtomicBool) {
    let mut known = vec![FileState::Intact; onlookers.images().len()];
    let mut next = Instant::now() + EVERY;
    loop {
        let woken = onlookers.wait(ended, next.saturating_duration_since(Instant::now()));
        if woken == WakeReason::Opened {
            is_alone.store(false, Ordering::Release);
            stop.wake();
        }
        if woken != WakeReason::Ended && Instant::now() < next {
            continue;
        }
        next = Instant::now() + EVERY;
        // A process that opens an image after this check is reported by the next wait.
        if woken == WakeReason::InTime && !is_alone.load(Ordering::Relaxed) {
            is_alone.store(onlookers.are_gone(), Ordering::Release);
        }
        for (file, known) in onlookers.images().iter().zip(&mut known) {
            let state = file.look();
            if core::mem::replace(known, state) != state {
                warn_of(file, state);
            }
            if state == FileState::Shortened {
                stop.stop_because(format!("another program has shortened {}", file.path().display()));
            }
        }
        look();
        if woken == WakeReason::Ended {
            return;
        }
    }
}

fn warn_of(file: &ImageFileWatch, state: FileState) {
    let path = file.path().display();
    match state {
        FileState::Intact | FileState::Shortened => {}
        FileState::Lengthened { size } => {
            tracing::warn!("{path}: another program has made it longer ({size} bytes); this has no effect");
        }
        FileState::Removed => tracing::warn!(
            "{path}: another program has removed it; attached clients continue, new ones cannot attach until a restart"
        ),
    }
}
