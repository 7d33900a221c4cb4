//! How an owner moves into the directory of a channel, and how whoever leaves last removes what iceoryx2 leaves there.
//!
//! Owner is who has the instance's lock, which lies in the same directory. It sweeps before it announces itself and when it ends; clients
//! that outlive it do so when they leave. Whoever sweeps must not hit an owner that has come meanwhile.

#[cfg(test)]
mod model;

/// A directory that may have a name; a real one, or one of a model.
pub(super) trait Root {
    /// As long as it lives, nobody else has the lock.
    type Held;

    /// Takes the lock, if nobody else has it.
    fn try_lock(&self) -> Option<Self::Held>;

    /// Whether the name is still this directory's.
    fn is_named(&self) -> bool;
}

/// What lies in it.
pub(super) trait Place {
    type Root: Root;

    fn root(&self) -> &Self::Root;

    /// Whether a living process has announced itself.
    fn is_served(&self) -> bool;

    /// Whether anybody who lives is in it.
    fn in_use(&self) -> bool;

    /// Takes the announcement back.
    fn withdraw(&self);

    /// Removes everything that iceoryx2 has put there.
    fn sweep(&self);

    /// Removes the directory, if nothing is in it any more.
    fn remove_root(&self);
}

/// The directory for its owner, who makes it with `create`. As long as the second value lives, those who leave do not sweep.
pub(super) fn own<R: Root, E>(
    mut create: impl FnMut() -> Result<R, E>,
    mut wait: impl FnMut() -> Result<(), E>,
) -> Result<(R, R::Held), E> {
    loop {
        let root = create()?;
        match root.try_lock() {
            Some(held) if root.is_named() => return Ok((root, held)),
            // Whoever held it has removed it.
            Some(_) => {}
            None => wait()?,
        }
    }
}

/// A client has left. If the server has gone before, nobody else would remove what stays.
pub(super) fn leave(place: &impl Place) {
    while !place.is_served() {
        let Some(held) = place.root().try_lock() else { return };
        if !place.root().is_named() || place.is_served() {
            return;
        }
        if !place.in_use() {
            place.withdraw();
            place.sweep();
            place.remove_root();
            return;
        }
        drop(held);
        // Others that have left meanwhile have found the lock taken and gone their way.
        if place.in_use() {
            return;
        }
    }
}

/// The server has gone, and those who are left have been given the time to leave.
pub(super) fn close(place: &impl Place, is_unused: impl FnOnce() -> bool) {
    if is_unused() {
        place.sweep();
    }
    place.remove_root();
}
