//! The NOVRAM of a device: registers that keep their values at power-off.

/// The NOVRAM of a device ([`Device::novram`](crate::devices::Device::novram)).
pub trait NovramContents {
    /// Returns the contents, and a number that changes with the contents. The contents are empty if the
    /// device stores no registers.
    fn contents(&self) -> (&[u8], u32);

    /// Stores the contents of the NOVRAM registers, as at power-off.
    fn store(&mut self);
}
