//! Transport of messages between federates.

/// Connection to the other federates. An implementation also wakes the emulator when a message has arrived.
pub trait Exchange: Send {
    /// Sends a message to all other federates. The messages of a federate arrive in the order in which it sent them.
    ///
    /// # Errors
    /// The connection failed; the text gives the reason.
    fn send(&mut self, message: &[u8]) -> Result<(), String>;

    /// Returns the next message of another federate, with the number of that federate; does not wait.
    ///
    /// # Errors
    /// Returns the errors of [`Exchange::send`].
    fn receive(&mut self) -> Result<Option<(u8, Vec<u8>)>, String>;

    /// Describes the partner for which the connection is waiting; `None` if the connection is established.
    fn missing(&self) -> Option<String> {
        None
    }

    /// Sends the last message to the federates that still receive, then closes the connection.
    fn leave(&mut self, message: &[u8]);
}
