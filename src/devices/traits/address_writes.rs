//! Writes of clients by address, which a device can answer immediately.

use crate::devices::Context;

/// A device that reacts to a write by address ([`Device::address_writes`](crate::devices::Device::address_writes)).
pub trait AddressWrites {
    /// Called after a client has written `bytes` bytes at `offset` by address.
    fn written_by_address(&self, offset: u32, bytes: u32);

    /// True if the firmware answers a write at `offset` immediately when it comes through the channel, even if the
    /// value is unchanged.
    fn answers_write(&self, offset: u32) -> bool;

    /// Handles a write that [`AddressWrites::answers_write`] has accepted.
    fn answer_write(&mut self, ctx: &mut Context);
}
