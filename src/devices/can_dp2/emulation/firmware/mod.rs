//! The firmware of a CAN-DP/2: its ports on the PROFIBUS and on the CAN bus, and the gateway between them.

pub(super) mod can_port;
pub(super) mod dp_port;
pub(super) mod form;
pub(super) mod gateway;
pub(super) mod master;
pub(super) mod modules;
pub(super) mod pages;
pub(super) mod parameters;
pub(super) mod ram;
pub(super) mod slave;
pub(super) mod stored;
pub(super) mod window;

use gateway::Gateway;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The CAN side, which both ports share. A plant runs the ports one after the other, so no port ever waits
/// for the lock.
pub(super) type Shared = Arc<Mutex<Gateway>>;

pub(super) fn share(gateway: Gateway) -> Shared {
    Arc::new(Mutex::new(gateway))
}

pub(super) fn lock(gateway: &Shared) -> MutexGuard<'_, Gateway> {
    gateway.lock().unwrap_or_else(PoisonError::into_inner)
}
