//! The clients that follow registers without records in the journal.
//!
//! The number of followed registers is limited. A client may follow at most as many as it leaves to the other clients,
//! so that no client takes all of them. If a client requests more, the journal releases registers that this client has
//! not requested again for a while. It then also releases all registers of clients that have requested nothing for a
//! while.

use super::history::GONE;
use crate::identity::DeviceIndex;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Real time after which a register may be released, if its client has not requested it again.
const STALE: Duration = Duration::from_secs(30);
/// Real time between two searches for registers to release.
const SEARCH: Duration = Duration::from_secs(1);

/// A register: device and offset.
pub(super) type Place = (DeviceIndex, u32);

/// A client, and the registers that it follows.
struct Onlooker {
    client: u128,
    /// Time of the client's last request to follow a register, or for changes.
    asked: Instant,
    /// Followed registers, each with the time of the client's last request to follow it.
    registers: HashMap<Place, Instant>,
}

/// All clients that follow registers.
#[derive(Default)]
pub(super) struct Onlookers {
    all: Vec<Onlooker>,
    searched: Option<Instant>,
}

impl Onlookers {
    /// Notes that a client has requested changes.
    pub(super) fn ask(&mut self, client: u128, now: Instant) {
        if let Some(known) = self.all.iter_mut().find(|it| it.client == client) {
            known.asked = now;
        }
    }

    /// Returns the number of registers that a client follows.
    pub(super) fn count(&self, client: u128) -> usize {
        self.all.iter().find(|it| it.client == client).map_or(0, |it| it.registers.len())
    }

    /// Adds a register to those of a client.
    pub(super) fn add(&mut self, client: u128, place: Place, now: Instant) {
        let at = self.all.iter().position(|it| it.client == client).unwrap_or_else(|| {
            self.all.push(Onlooker { client, asked: now, registers: HashMap::new() });
            self.all.len() - 1
        });
        let Some(own) = self.all.get_mut(at) else { return };
        own.asked = now;
        own.registers.insert(place, now);
    }

    /// True if the client follows the register.
    pub(super) fn contains(&self, client: u128, place: Place) -> bool {
        self.all.iter().any(|it| it.client == client && it.registers.contains_key(&place))
    }

    /// True if any client follows the register.
    pub(super) fn any_follows(&self, place: Place) -> bool {
        self.all.iter().any(|it| it.registers.contains_key(&place))
    }

    /// Makes room for a client. Releases its old registers, and all registers of clients that have requested nothing for
    /// a while. Returns true if a register was released.
    pub(super) fn release(&mut self, client: u128, now: Instant) -> bool {
        if self.searched.is_some_and(|last| now.saturating_duration_since(last) < SEARCH) {
            return false;
        }
        self.searched = Some(now);
        let is_older = |time: Instant, than: Duration| now.saturating_duration_since(time) > than;
        let count = |all: &[Onlooker]| all.iter().map(|it| it.registers.len()).sum::<usize>();
        let before = count(&self.all);
        self.all.retain(|it| it.client == client || !is_older(it.asked, GONE));
        if let Some(own) = self.all.iter_mut().find(|it| it.client == client) {
            own.registers.retain(|_, asked| !is_older(*asked, STALE));
        }
        count(&self.all) != before
    }

    /// True if a client of a channel follows registers. Client 0 is the emulator's own process.
    #[cfg(any(feature = "channel", test))]
    pub(super) fn any_of_clients(&self) -> bool {
        self.all.iter().any(|it| it.client != 0)
    }

    /// Releases the registers of clients for which `is_present` is false. Returns true if there were such clients.
    #[cfg(any(feature = "channel", test))]
    pub(super) fn release_departed(&mut self, is_present: impl Fn(u128) -> bool) -> bool {
        let before = self.all.len();
        self.all.retain(|it| it.client == 0 || is_present(it.client));
        self.all.len() != before
    }

    /// Makes all requests of a client older by a duration.
    #[cfg(test)]
    pub(super) fn age(&mut self, client: u128, by: Duration) {
        let older = |time: &mut Instant| *time = time.checked_sub(by).unwrap_or(*time);
        for own in self.all.iter_mut().filter(|it| it.client == client) {
            older(&mut own.asked);
            own.registers.values_mut().for_each(older);
        }
        self.searched = None;
    }
}
