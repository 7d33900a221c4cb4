//! Decides which process gets the name of an image. Emulators start and end here, files of killed emulators are replaced,
//! and clients check the files at the same time.
//!
//! The process that has the lock of the named file owns the image. No other process gives the image its name, takes it
//! over or removes it.

#[cfg(test)]
mod model;

/// A file that may have the name of an image. It is a real file or a model of one.
pub(in crate::memory) trait LockableFile: Sized {
    /// Error of the system.
    type Error;

    /// Takes the lock for the lifetime of this value; `false` if another process has it.
    fn lock(&self) -> Result<bool, Self::Error>;

    /// True if this file has the name, and no other file has replaced it.
    fn is_named(&self) -> Result<bool, Self::Error>;

    /// Removes the name from any file that has it.
    fn remove_name(&self) -> Result<(), Self::Error>;

    /// Removes the name of this file, if the file still has the name. Only the holder of the lock may call it.
    fn unlink(&self) -> Result<(), Self::Error> {
        if self.is_named()? { self.remove_name() } else { Ok(()) }
    }
}

/// The name of an image, and operations on the files that have it.
pub(super) trait ImageName {
    type File: LockableFile<Error = Self::Error>;
    type Error;

    /// Returns the file that has the name.
    fn find(&self) -> Result<Option<Self::File>, Self::Error>;

    /// Refuses a file unless it is an image of this user.
    fn judge(&self, file: &Self::File) -> Result<(), Self::Error>;

    /// Waits a moment for a lock that another process has. Returns an error when the total wait is too long.
    fn wait(&self, file: Self::File) -> Result<(), Self::Error>;
}

/// Operations of a starting emulator.
pub(super) trait ImageCreator: ImageName {
    type Image;

    /// Creates a new file without a name.
    fn nameless(&self) -> Result<Self::File, Self::Error>;

    /// Fills a new, locked file as an image.
    fn fill(&self, file: Self::File) -> Result<Self::Image, Self::Error>;

    /// Gives the image the name; `false` if another file has it.
    fn name(&self, image: &Self::Image) -> Result<bool, Self::Error>;

    /// True if a new emulator can serve clients that still map the file of a dead one.
    fn fits(&self, file: &Self::File) -> Result<bool, Self::Error>;

    /// Takes over the locked file of a dead emulator.
    fn take_over(&self, file: Self::File) -> Result<Self::Image, Self::Error>;
}

/// Acquires the name of the image, with a new file or with the file of a dead emulator.
pub(super) fn enter<S: ImageCreator>(site: &S) -> Result<S::Image, S::Error> {
    loop {
        let Some(file) = site.find()? else {
            let file = site.nameless()?;
            // The file gets its name only when it is locked and filled, so no process sees a partial image.
            if file.lock()? {
                let image = site.fill(file)?;
                if site.name(&image)? {
                    return Ok(image);
                }
            }
            // Another process has taken the name or the lock first. The loop tries again.
            continue;
        };
        match claim(site, file)? {
            Some(file) if site.fits(&file)? => return site.take_over(file),
            // The file of a dead emulator has another shape, so this emulator cannot serve the clients that map it. A
            // new file replaces it.
            Some(file) => file.unlink()?,
            None => {}
        }
    }
}

/// Removes the file of a dead emulator. Returns true if there was such a file.
pub(super) fn remove_dead<S: ImageName>(site: &S) -> Result<bool, S::Error> {
    loop {
        let Some(file) = site.find()? else { return Ok(false) };
        if let Some(file) = claim(site, file)? {
            file.unlink()?;
            return Ok(true);
        }
    }
}

/// Takes the lock of a dead emulator's file. `None` if the file was replaced or another process has its lock; the
/// caller must then try again.
pub(super) fn claim<S: ImageName>(site: &S, file: S::File) -> Result<Option<S::File>, S::Error> {
    if !file.lock()? {
        site.wait(file)?;
        return Ok(None);
    }
    // Between opening and locking, the last holder may have removed the file.
    if !file.is_named()? {
        return Ok(None);
    }
    site.judge(&file)?;
    Ok(Some(file))
}
