//! Looks whether somebody changes the image files under the emulator's hands, and says so.

use super::emulator::StopHandle;
#[cfg(feature = "channel")]
use crate::channel::ChannelWatch;
use crate::memory::{FileState, ImageFileWatch};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often it looks.
const EVERY: Duration = Duration::from_millis(200);

/// The thread that looks. Dropping it ends it, after a last look.
#[derive(Debug)]
pub(super) struct Watch(Option<(Sender<()>, JoinHandle<()>)>);

impl Watch {
    /// Watches these files, and the channel, whose emulator asks what was found; a shortened image ends the emulator, see
    /// [`super::RuntimeError::Shortened`].
    ///
    /// # Errors
    /// No thread can be started.
    pub(crate) fn start(
        files: Vec<ImageFileWatch>,
        #[cfg(feature = "channel")] channel: Option<ChannelWatch>,
        stop: StopHandle,
    ) -> std::io::Result<Self> {
        let (end, ended) = mpsc::channel();
        let thread = std::thread::Builder::new().name("images".to_owned());
        let look = move || {
            #[cfg(feature = "channel")]
            if let Some(channel) = &channel {
                channel.look();
            }
        };
        Ok(Self(Some((end, thread.spawn(move || watch(&files, look, &stop, &ended))?))))
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        if let Some((end, thread)) = self.0.take() {
            drop(end);
            // It does not panic; if it did, nothing would depend on it.
            let _ = thread.join();
        }
    }
}

fn watch(files: &[ImageFileWatch], look: impl Fn(), stop: &StopHandle, ended: &Receiver<()>) {
    let mut known = vec![FileState::Intact; files.len()];
    loop {
        let end = ended.recv_timeout(EVERY) != Err(RecvTimeoutError::Timeout);
        for (file, known) in files.iter().zip(&mut known) {
            let state = file.look();
            if core::mem::replace(known, state) != state {
                say(file, state);
            }
            if state == FileState::Shortened {
                stop.stop();
            }
        }
        look();
        if end {
            return;
        }
    }
}

fn say(file: &ImageFileWatch, state: FileState) {
    let path = file.path().display();
    match state {
        FileState::Intact | FileState::Shortened => {}
        FileState::Lengthened { size } => {
            tracing::warn!("{path}: somebody has made it longer ({size} bytes); that changes nothing");
        }
        FileState::Removed => tracing::warn!(
            "{path}: somebody has removed it; who is attached goes on, nobody else can attach until a restart"
        ),
    }
}
