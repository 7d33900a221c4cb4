//! The NOVRAM of a device: registers that survive a power-off.

/// The NOVRAM of a device ([`Device::novram`](crate::devices::Device::novram)).
pub trait NovramContents {
    /// Returns the contents, and a number that changes with them; empty if the device stores no registers.
    fn contents(&self) -> (&[u8], u32);

    /// Stores the contents of the NOVRAM registers, as at power-off.
    fn store(&mut self);
}
