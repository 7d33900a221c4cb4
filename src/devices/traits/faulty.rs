//! Faults of a device or a bus, as the part that applies them sees them.

use crate::fault::{Effect, Faults, Hit, Target};

/// A device or bus that applies faults ([`Device::faults`](crate::devices::Device::faults), [`Bus::faults`](crate::devices::Bus::faults)).
pub trait Faulty {
    /// Called when the set of active faults of the device or bus has changed.
    fn faults_changed(&mut self, now: u64, faults: &Faults) {
        let _ = (now, faults);
    }

    /// Called when one of its faults is active, at the start of the fault or in a processor cycle: returns a hit if the
    /// fault fires by itself. Faults that fire at an event are found during the event
    /// ([`World::faults`](crate::devices::World::faults)).
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let _ = (now, target, effect);
        None
    }
}
