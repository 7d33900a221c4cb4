//! Detects whether another process has an image open or mapped. Only such a process can read or write a register.
//!
//! The kernel reports each open of the file (inotify). The emulator detects the end of such accesses by a write lease:
//! the kernel grants the lease only while no other process has the file open or mapped. The emulator releases the lease
//! immediately. If inotify or leases are not available, the image counts as open.

use super::image::ImageFileWatch;
use rustix::buffer::spare_capacity;
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fs::inotify::{self, CreateFlags, WatchFlags};
use rustix::io;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::time::Duration;

/// Watches the images of this process.
#[derive(Debug)]
pub(crate) struct Onlookers {
    images: Vec<ImageFileWatch>,
    /// Reports of the kernel about opened images. With `None`, the images always count as open.
    opened: Option<OwnedFd>,
}

impl Onlookers {
    pub(crate) fn of(images: Vec<ImageFileWatch>) -> Self {
        let opened = watch(&images).inspect_err(|reason| {
            tracing::debug!(%reason, "cannot detect processes that open an image: it counts as open");
        });
        Onlookers { opened: opened.ok(), images }
    }

    pub(crate) fn images(&self) -> &[ImageFileWatch] {
        &self.images
    }

    /// True if no other process has an image open. [`Onlookers::wait`] reports processes that open one later.
    pub(crate) fn are_gone(&self) -> bool {
        self.opened.is_some() && self.images.iter().all(is_free)
    }

    /// Waits until another process opens an image, `end` is rung, or `timeout` is over; returns which.
    pub(crate) fn wait(&self, end: &OwnedFd, timeout: Duration) -> WakeReason {
        let timeout = Timespec::try_from(timeout).ok();
        let mut ends = vec![PollFd::new(end, PollFlags::IN)];
        ends.extend(self.opened.iter().map(|opened| PollFd::new(opened, PollFlags::IN)));
        // A signal may interrupt the wait.
        let _ = poll(&mut ends, timeout.as_ref());
        let [ends, opened @ ..] = &ends[..] else { return WakeReason::Ended };
        if !ends.revents().is_empty() {
            return WakeReason::Ended;
        }
        if opened.iter().any(|opened| !opened.revents().is_empty()) {
            self.forget_events();
            return WakeReason::Opened;
        }
        WakeReason::InTime
    }

    fn forget_events(&self) {
        let mut events = Vec::with_capacity(4096);
        while let Some(opened) = &self.opened
            && rustix::io::read(opened, spare_capacity(&mut events)).is_ok_and(|bytes| bytes > 0)
        {
            events.clear();
        }
    }
}

/// Reason for the end of a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WakeReason {
    /// A process has opened an image.
    Opened,
    /// The waiting thread must end.
    Ended,
    /// The timeout is over.
    InTime,
}

/// Creates a descriptor that ends a wait when written to.
pub(crate) fn end() -> io::Result<OwnedFd> {
    eventfd(0, EventfdFlags::CLOEXEC)
}

fn watch(images: &[ImageFileWatch]) -> io::Result<OwnedFd> {
    let opened = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
    for image in images {
        // The path leads to the open descriptor, because the name of the file may have been removed or replaced.
        let path = format!("/proc/self/fd/{}", image.as_fd().as_raw_fd());
        inotify::add_watch(&opened, path, WatchFlags::OPEN)?;
    }
    Ok(opened)
}

fn is_free(image: &ImageFileWatch) -> bool {
    let file = image.as_fd().as_raw_fd();
    // A process that opens the file at this moment waits until the lease is released. The kernel reports this with a
    // signal; SIGURG is ignored by default.
    // SAFETY: the file is open; these operations take an integer each.
    unsafe {
        libc::fcntl(file, F_SETSIG, libc::SIGURG) == 0
            && libc::fcntl(file, libc::F_SETLEASE, libc::F_WRLCK) == 0
            && libc::fcntl(file, libc::F_SETLEASE, libc::F_UNLCK) == 0
    }
}

/// `F_SETSIG` of `fcntl(2)`, which the libc crate does not have.
const F_SETSIG: libc::c_int = 10;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::testing::{HASH, Instance, PLC};
    use crate::memory::{AttachMode, Image};

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn a_process_with_a_mapped_image_counts_until_it_unmaps() {
        let instance = Instance::new();
        let image = instance.create();
        image.set_ready();
        let onlookers = Onlookers::of(vec![image.watch()]);
        assert!(onlookers.are_gone());
        let end = end().unwrap();
        assert_eq!(onlookers.wait(&end, Duration::ZERO), WakeReason::InTime);
        for mode in [AttachMode::ReadWrite, AttachMode::ReadOnly] {
            let attached = Image::attach(&instance, PLC, mode, Some(HASH)).unwrap();
            assert_eq!(onlookers.wait(&end, LONG), WakeReason::Opened);
            assert!(!onlookers.are_gone());
            drop(attached);
            assert!(onlookers.are_gone());
        }
        rustix::io::write(&end, &1u64.to_ne_bytes()).unwrap();
        assert_eq!(onlookers.wait(&end, LONG), WakeReason::Ended);
    }
}
