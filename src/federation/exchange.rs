//! How messages come from one federate to the others.

/// The way to the other federates. Whoever provides one says how it wakes the emulator when a message has come.
pub trait Exchange: Send {
    /// Sends to all others. What one federate sends arrives in the order in which it was sent.
    ///
    /// # Errors
    /// The way is broken: why.
    fn send(&mut self, message: &[u8]) -> Result<(), String>;

    /// The next message that has come from another, and the number of that one; does not wait.
    ///
    /// # Errors
    /// As [`Exchange::send`].
    fn receive(&mut self) -> Result<Option<(u8, Vec<u8>)>, String>;

    /// The last message, to those who still hear it; then the way ends.
    fn leave(&mut self, message: &[u8]);
}
