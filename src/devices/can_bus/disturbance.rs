//! Effects of injected faults on the traffic of a bus. None of this code runs without a fault.

use super::CanBus;
use crate::can::{Event, Fate, Frame, OnWire};
use crate::devices::World;
use crate::devices::emulation::can_faults::{Effect, FrameEffect};
use crate::fault::{Hit, Owner, Target};
use crate::journal::Origin;

impl CanBus {
    fn owner(&self) -> Owner {
        Owner::Bus(self.index)
    }

    /// Applies the faults that can act on this frame. `fire` applies one effect and returns true if the
    /// effect has acted.
    fn disturb_frame(&self, frame: &Frame, world: &mut World, mut fire: impl FnMut(FrameEffect) -> bool) {
        let field = frame.arbitration();
        world.faults.fire(world.now, self.owner(), world.journal, |_, effect, _| match *effect {
            Effect::Frame(frames, what) if frames.include(field) && fire(what) => {
                Some(Hit::Frame(field.number()))
            }
            _ => None,
        });
    }

    /// Performs one due event on the wire. A fault may delay the frame that would begin now.
    #[cold]
    pub(super) fn advance_disturbed(&mut self, at_ns: u64, world: &mut World) -> Option<Event> {
        let mut withdrawn = None;
        while let Some((station, frame)) = self.wire.as_ref()?.next_sender(at_ns, &self.stations) {
            let is_delayed = self.stations.all()[station].is_delayed;
            let mut until_ns = None;
            self.disturb_frame(&frame, world, |what| match what {
                FrameEffect::Delay(us) if !is_delayed && until_ns.is_none() => {
                    until_ns = Some((at_ns + u64::from(us) * 1000, true));
                    true
                }
                // Because of the fault, the frame loses this arbitration. It takes part in the next one.
                FrameEffect::LoseArbitration if until_ns.is_none() => {
                    until_ns = Some((at_ns + 1, false));
                    true
                }
                _ => false,
            });
            let Some((until_ns, is_delayed)) = until_ns else { break };
            if !is_delayed {
                withdrawn = withdrawn.or(Some((station, frame)));
            }
            self.stations.hold(station, until_ns, is_delayed);
        }
        let wire = self.wire.as_mut()?;
        match withdrawn {
            Some((station, frame)) if wire.next_sender(at_ns, &self.stations).is_none() => {
                Some(wire.withdraw(at_ns, station, frame))
            }
            _ => wire.advance(at_ns, &self.stations),
        }
    }

    /// Called when a frame has begun. Applies the faults that decide whether the frame arrives undisturbed.
    #[cold]
    pub(super) fn disturb(&mut self, it: &OnWire, world: &mut World) {
        if it.fate != Fate::Arrives {
            return;
        }
        let (mut lost, mut disturbed, mut copies) = (false, false, Vec::new());
        let is_copy = self.stations.all()[it.sender].is_copy;
        self.disturb_frame(&it.frame, world, |what| {
            match what {
                _ if lost || disturbed => return false,
                FrameEffect::Lose => lost = true,
                FrameEffect::Disturb => disturbed = true,
                FrameEffect::Duplicate(us) if !is_copy => copies.push(us.into()),
                _ => return false,
            }
            true
        });
        self.is_lost = lost;
        if disturbed && let Some(wire) = &mut self.wire {
            wire.disturb();
        }
        if !is_copy {
            // If the frame does not arrive, its sender repeats it, and the faults then act on it again.
            self.stations.get_mut(it.sender).copies = copies;
        }
    }

    /// True if `station` loses a frame because of an overrun.
    #[cold]
    pub(super) fn overruns(&mut self, station: usize, frame: &Frame, world: &mut World) -> bool {
        let Origin { plc: device, node: port } = self.stations.all()[station].origin;
        let (here, number) = (Target::Port { device, port }, frame.arbitration().number());
        let mut lost = false;
        world.faults.fire(world.now, self.owner(), world.journal, |target, effect: &Effect, _| {
            let hits = !lost && target == here && *effect == Effect::Overrun;
            lost |= hits;
            hits.then_some(Hit::Frame(number))
        });
        lost
    }

    /// Switches a working controller to BUS-off. Returns false if the controller was not working.
    pub(super) fn switch_off(&mut self, station: usize) -> bool {
        let is_plugged_in = self.wire.is_some();
        let end = self.stations.get_mut(station);
        let works = is_plugged_in && end.member_since_ns.is_some();
        if works {
            end.controller.errors_mut().bus_off();
            self.stations.note_errors(station);
            self.has_state_changes = true;
        }
        works
    }
}
