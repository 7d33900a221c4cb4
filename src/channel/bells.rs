//! Bells, by which client and emulator wake each other.
//!
//! iceoryx2 transports the messages but wakes no thread. The emulator's thread sleeps on the doorbell in the
//! header page of the image. Clients sleep on another bell in the header page until the emulator announces a
//! reply. All clients share both bells. So a thread that wakes up must check whether its request or its reply
//! has arrived.

use std::time::Duration;

/// The bells between client and emulator.
///
/// A wait must not miss a ring. So a thread first reads the number of rings, then checks for work, and then
/// waits until the number has changed.
pub trait Bells {
    /// For the client: wakes the emulator's thread.
    fn ring_doorbell(&self);

    /// For the client: the number of announced replies so far. It wraps.
    fn reply_count(&self) -> u32;

    /// For the client: sleeps until [`Bells::reply_count`] is no longer `seen`, or until the timeout. May
    /// return early.
    fn wait_reply(&self, seen: u32, timeout: Duration);

    /// For the emulator: wakes the clients after a reply was sent.
    fn announce_reply(&self);

    /// For the client: process id of the emulator to which these bells belong, in the pid namespace of the emulator.
    fn emulator_pid(&self) -> u32;

    /// For the client: true if the emulator's process still runs. Called when a reply is late.
    fn emulator_alive(&self) -> bool;

    /// For the client: true if the emulator to which these bells belong has ended in an orderly way, or another emulator has
    /// taken its place. Called before each request, because an emulator that was started later uses the same channel.
    fn emulator_has_ended(&self) -> bool;

    /// For the client: true if the emulator's process has ended without an orderly end of the emulator.
    fn emulator_was_killed(&self) -> bool {
        !self.emulator_has_ended() && !self.emulator_alive()
    }
}

impl<T: Bells + ?Sized> Bells for std::sync::Arc<T> {
    fn ring_doorbell(&self) {
        (**self).ring_doorbell();
    }

    fn reply_count(&self) -> u32 {
        (**self).reply_count()
    }

    fn wait_reply(&self, seen: u32, timeout: Duration) {
        (**self).wait_reply(seen, timeout);
    }

    fn announce_reply(&self) {
        (**self).announce_reply();
    }

    fn emulator_pid(&self) -> u32 {
        (**self).emulator_pid()
    }

    fn emulator_alive(&self) -> bool {
        (**self).emulator_alive()
    }

    fn emulator_has_ended(&self) -> bool {
        (**self).emulator_has_ended()
    }
}
