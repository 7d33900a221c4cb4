//! The name of a PLC's image in the file system.

use super::claim::{ImageCreator, ImageName};
use super::{Image, ImageSpec, allocate};
use crate::memory::file::{self, ImageFile};
use crate::memory::{MemoryError, State, names};
use rustix::fs::{AtFlags, CWD, Mode, OFlags};
use rustix::io::Errno;
use std::fs::File;
use std::os::fd::AsRawFd;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Longest wait of a starting emulator for a lock, if its holder does not look like a running emulator. The holder may
/// be an emulator shortly before its end, or a client that checks whether an emulator runs.
const PATIENCE: Duration = Duration::from_millis(500);
/// Longest wait if the holder looks like a running emulator. That emulator may have been killed a moment ago, while its
/// process still exists.
const GRACE: Duration = Duration::from_millis(50);

/// The path of an image, the start of the attempt to get it, and the properties of the image.
pub(super) struct ImageSite<'a, S> {
    instance: &'a str,
    plc: &'a str,
    path: PathBuf,
    /// Start of the attempt to get the image, in real time.
    since: Instant,
    spec: S,
}

impl<'a, S> ImageSite<'a, S> {
    pub(super) fn new(instance: &'a str, plc: &'a str, spec: S) -> Result<Self, MemoryError> {
        let path = names::image_path(instance, plc)?;
        Ok(Self { instance, plc, path, since: Instant::now(), spec })
    }

    fn failed(&self, reason: Errno) -> MemoryError {
        MemoryError::System { path: self.path.clone(), doing: "create", reason: reason.into() }
    }
}

impl<S> ImageName for ImageSite<'_, S> {
    type File = ImageFile;
    type Error = MemoryError;

    fn find(&self) -> Result<Option<ImageFile>, MemoryError> {
        ImageFile::open(self.instance, self.plc, true)
    }

    fn judge(&self, file: &ImageFile) -> Result<(), MemoryError> {
        // An empty file is accepted, because nothing in it can be lost.
        if file.size()? > 0 { file.own_header().map(drop) } else { Ok(()) }
    }

    fn wait(&self, file: ImageFile) -> Result<(), MemoryError> {
        let header = file.own_header()?;
        file.check_instance(&header)?;
        let process = file::emulator(&header);
        let state = State::from_code(header.state.load());
        let is_running = process.is_running();
        let is_at_work = is_running && matches!(state, Some(State::Starting | State::Ready));
        if self.since.elapsed() >= if is_at_work { GRACE } else { PATIENCE } {
            let pid = is_running.then_some(process.pid);
            return Err(MemoryError::AlreadyRunning { instance: file.instance, plc: file.plc, pid });
        }
        std::thread::sleep(Duration::from_millis(1));
        Ok(())
    }
}

impl ImageCreator for ImageSite<'_, &ImageSpec> {
    type Image = Image;

    fn nameless(&self) -> Result<ImageFile, MemoryError> {
        let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
        let file = rustix::fs::open(names::IMAGE_DIRECTORY, flags, Mode::RUSR | Mode::WUSR);
        let file = file.map_err(|reason| self.failed(reason))?;
        Ok(ImageFile::new(self.instance, self.plc, self.path.clone(), File::from(file)))
    }

    fn fill(&self, file: ImageFile) -> Result<Image, MemoryError> {
        allocate(&file, self.spec.device.segment_size())?;
        let mut image = Image::map(file, self.spec.device.segment_size(), None)?;
        image.fill(self.spec);
        Ok(image)
    }

    fn name(&self, image: &Image) -> Result<bool, MemoryError> {
        let nameless = format!("/proc/self/fd/{}", image.file.file.as_raw_fd());
        match rustix::fs::linkat(CWD, nameless, CWD, &self.path, AtFlags::SYMLINK_FOLLOW) {
            Ok(()) => Ok(true),
            Err(Errno::EXIST) => Ok(false),
            Err(Errno::NOENT) => Err(MemoryError::System {
                path: self.path.clone(),
                doing: "create",
                reason: std::io::Error::other("there is no /proc/self/fd; is /proc mounted?"),
            }),
            Err(errno) => Err(self.failed(errno)),
        }
    }

    fn fits(&self, file: &ImageFile) -> Result<bool, MemoryError> {
        Ok(file.check_shape(&*file.header()?).is_ok())
    }

    fn take_over(&self, file: ImageFile) -> Result<Image, MemoryError> {
        Image::take_over(file, self.spec)
    }
}
