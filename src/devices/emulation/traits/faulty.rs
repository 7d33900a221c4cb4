//! Interface of the part of a device or bus that applies faults.

use crate::fault::{Effect, Faults, Hit, Target};

/// A device or bus that applies faults ([`Device::faults`](crate::devices::Device::faults), [`Bus::faults`](crate::devices::Bus::faults)).
pub trait Faulty {
    /// Called when the set of active faults of the device or bus has changed.
    fn faults_changed(&mut self, now: u64, faults: &Faults) {
        let _ = (now, faults);
    }

    /// Called at the start of a fault, and in each processor cycle while the fault is active. Returns a hit
    /// if the fault acts now, without an event. Faults that act at an event are applied by the code that
    /// handles the event ([`World::faults`](crate::devices::World::faults)).
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let _ = (now, target, effect);
        None
    }
}
