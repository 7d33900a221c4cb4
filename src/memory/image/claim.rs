//! Who gets the name of an image, when emulators that start meet one that ends, files that killed ones have left, and clients that look.
//!
//! Whoever has the lock of the file that has the name has the image, and nobody else names, takes over or removes it.

#[cfg(test)]
mod model;

/// A file that may have the name of an image; a real one, or one of a model.
pub(in crate::memory) trait Claimed: Sized {
    /// What the system refuses.
    type Error;

    /// Takes the lock, which lasts as long as this value; `false` if somebody else has it.
    fn lock(&self) -> Result<bool, Self::Error>;

    /// Whether the name is this file's, and not that of one that has replaced it.
    fn is_named(&self) -> Result<bool, Self::Error>;

    /// Takes the name from whatever file has it.
    fn remove_name(&self) -> Result<(), Self::Error>;

    /// Takes the name from this file, if it has it. Only for the holder of the lock.
    fn unlink(&self) -> Result<(), Self::Error> {
        if self.is_named()? { self.remove_name() } else { Ok(()) }
    }
}

/// The name, and what is known of files that have it.
pub(super) trait Site {
    type File: Claimed<Error = Self::Error>;
    type Error;

    /// The file that has the name.
    fn find(&self) -> Result<Option<Self::File>, Self::Error>;

    /// Refuses a file that is none of ours.
    fn judge(&self, file: &Self::File) -> Result<(), Self::Error>;

    /// Waits a moment for a lock that somebody else has; an error if it has been long enough.
    fn wait(&self, file: Self::File) -> Result<(), Self::Error>;
}

/// What is made of files there.
pub(super) trait Start: Site {
    type Image;

    /// A new file that has no name yet.
    fn nameless(&self) -> Result<Self::File, Self::Error>;

    /// An image of a new file, which is locked.
    fn fill(&self, file: Self::File) -> Result<Self::Image, Self::Error>;

    /// Gives it the name; `false` if another file has it.
    fn name(&self, image: &Self::Image) -> Result<bool, Self::Error>;

    /// Whether those who still map the file of a dead emulator can be served by a new one.
    fn fits(&self, file: &Self::File) -> Result<bool, Self::Error>;

    /// An image of a dead emulator's file, which is locked.
    fn take_over(&self, file: Self::File) -> Result<Self::Image, Self::Error>;
}

/// Gets the name, for a new file or that of a dead emulator.
pub(super) fn enter<S: Start>(site: &S) -> Result<S::Image, S::Error> {
    loop {
        let Some(file) = site.find()? else {
            let file = site.nameless()?;
            // It gets its name only when it is locked and filled, so nobody ever sees half an image.
            if file.lock()? {
                let image = site.fill(file)?;
                if site.name(&image)? {
                    return Ok(image);
                }
            }
            // Somebody was faster; meet them as the holder of the lock.
            continue;
        };
        match claim(site, file)? {
            Some(file) if site.fits(&file)? => return site.take_over(file),
            // Dead, but of another shape: its clients cannot be served, so a new file replaces it.
            Some(file) => file.unlink()?,
            None => {}
        }
    }
}

/// Removes what a dead emulator has left; whether there was anything.
pub(super) fn remove_dead<S: Site>(site: &S) -> Result<bool, S::Error> {
    loop {
        let Some(file) = site.find()? else { return Ok(false) };
        if let Some(file) = claim(site, file)? {
            file.unlink()?;
            return Ok(true);
        }
    }
}

/// Takes the lock of a file whose emulator is dead. `None`: try again, the file was replaced or somebody has its lock.
pub(super) fn claim<S: Site>(site: &S, file: S::File) -> Result<Option<S::File>, S::Error> {
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
