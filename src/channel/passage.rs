//! How an owner enters the directory of a channel, and how the last process that leaves removes the files of iceoryx2.
//!
//! The owner holds the instance's lock, which is in the same directory. It sweeps (removes all files) before it
//! announces itself and when it ends. A client that leaves after the end of the owner sweeps, too: the owner may have been
//! killed, or the client may have entered while the owner ended. Such a sweep must not affect the next owner, which may
//! already have entered.

#[cfg(test)]
mod model;

/// An opened directory, real or modelled. If it was renamed or removed, another directory may have its name.
pub(super) trait ChannelRoot {
    /// While a value of this type exists, no other process has the lock.
    type Lock;

    /// Takes the lock if it is free.
    fn try_lock(&self) -> Option<Self::Lock>;

    /// True if the domain's name still leads to this directory.
    fn is_named(&self) -> bool;
}

/// Content of the directory.
pub(super) trait ChannelSite: Sized {
    type ChannelRoot: ChannelRoot;

    fn root(&self) -> &Self::ChannelRoot;

    /// True if a living process has announced itself.
    fn is_served(&self) -> bool;

    /// True if a living process is in the domain.
    fn in_use(&self) -> bool;

    /// True if the directory that now has the domain's name contains directories of iceoryx2.
    fn has_files(&self) -> bool;

    /// Withdraws the announcement of this process.
    fn withdraw(&self);

    /// Removes all files of iceoryx2.
    fn sweep(&self);

    /// Removes the directory if it is empty.
    fn remove_root(&self);

    /// Returns the directory that now has the domain's name, if it is a new directory without an owner. Such
    /// a directory appears if a client enters while the owner removes the old directory: iceoryx2 works with
    /// paths and creates a missing directory.
    fn made_again(&self) -> Option<Self>;
}

/// Returns the directory for its owner; `create` opens or creates it. While the returned lock exists, leaving clients
/// do not sweep.
pub(super) fn own<R: ChannelRoot, E>(
    mut create: impl FnMut() -> Result<R, E>,
    mut wait: impl FnMut() -> Result<(), E>,
) -> Result<(R, R::Lock), E> {
    loop {
        let root = create()?;
        match root.try_lock() {
            Some(held) if root.is_named() => return Ok((root, held)),
            // The previous holder has removed the directory.
            Some(_) => {}
            None => wait()?,
        }
    }
}

/// Maximum number of sweeps of a leaving client. Files that it cannot remove stay.
const SWEEPS: u32 = 10;

/// Called by a client that has left the channel. If the server ended before the client left, the client must
/// remove the remaining files.
pub(super) fn leave(place: &impl ChannelSite) {
    sweep_as_last(place);
    if let Some(place) = place.made_again() {
        sweep_as_last(&place);
    }
}

/// Removes all files if the server has ended and no living process is in the domain.
fn sweep_as_last(place: &impl ChannelSite) {
    for _ in 0..SWEEPS {
        if place.is_served() {
            return;
        }
        let Some(held) = place.root().try_lock() else { return };
        if !place.root().is_named() || place.is_served() {
            return;
        }
        if !place.in_use() {
            place.withdraw();
            place.sweep();
            place.remove_root();
        }
        drop(held);
        // Clients that left during the sweep, or failed to enter, found the lock taken and did not sweep. If
        // they left files, the loop sweeps again.
        if !place.has_files() || place.in_use() {
            return;
        }
    }
}

/// Called after the server has ended. Clients that are still connected after `leave` have no use for the files any more. They
/// may be suspended or killed before they leave, so the files are removed without them.
pub(super) fn close(place: &impl ChannelSite, leave: impl FnOnce()) {
    leave();
    place.sweep();
    place.remove_root();
}
