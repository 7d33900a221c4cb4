//! A pseudo-terminal as a serial adapter.

use rustix::fs::{Mode, OFlags, fchmod, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;

/// An open pseudo-terminal. The emulator keeps both ends open, so that programs can connect and disconnect without
/// events. Only this user can access it.
#[derive(Debug)]
pub(super) struct Pty {
    pub(super) master: File,
    pub(super) number: u32,
    _slave: OwnedFd,
}

impl Pty {
    /// Opens a pseudo-terminal that passes bytes on unchanged.
    ///
    /// # Errors
    /// The operating system has no free pseudo-terminal.
    pub(super) fn open() -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let path = ptsname(&master, Vec::new())?;
        let slave = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        fchmod(&slave, Mode::RUSR | Mode::WUSR)?;
        let mut settings = tcgetattr(&slave)?;
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings)?;
        fcntl_setfl(&master, OFlags::NONBLOCK)?;
        let number = path.to_str().ok().and_then(|path| path.rsplit('/').next()?.parse().ok());
        let number = number.ok_or(io::ErrorKind::Unsupported)?;
        Ok(Pty { master: master.into(), number, _slave: slave })
    }
}
