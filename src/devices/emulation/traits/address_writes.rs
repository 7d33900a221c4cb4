//! Writes of clients by address. A device can answer them immediately.

use crate::devices::Context;

/// A device that reacts to a write by address ([`Device::address_writes`](crate::devices::Device::address_writes)).
pub trait AddressWrites {
    /// Called after a client has written `bytes` bytes at `offset` by address.
    fn written_by_address(&self, offset: u32, bytes: u32);

    /// True if the firmware immediately answers a write at `offset` that comes through the channel, even if
    /// the value does not change.
    fn answers_write(&self, offset: u32) -> bool;

    /// Handles a write that [`AddressWrites::answers_write`] has accepted.
    fn answer_write(&mut self, ctx: &mut Context);
}
