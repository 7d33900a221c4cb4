//! The emulator as a host of operations.

use super::emulator::Emulator;
use crate::door::Doors;
use crate::memory::describe_process;
use crate::plant::Plant;
use crate::request::{Host, InstanceInfo, Travel};
#[cfg(feature = "channel")]
use crate::request::{Op, Refused};

impl Emulator {
    /// Returns the time of the next possible action of a task, guest or simulator.
    fn next_from_outside(&self) -> u64 {
        let next = self.lockstep.next_turn().min(self.guests.next_turn());
        #[cfg(feature = "channel")]
        let next = next.min(self.membership.next_exchange(self.plant.now()));
        next
    }

    /// Description of the participant for which the clock waits.
    fn waits_for(&self) -> Option<String> {
        let here = self.lockstep.waits_for(&self.plant).or_else(|| self.guests.waits_for(&self.plant));
        #[cfg(feature = "channel")]
        let here = here.or_else(|| self.membership.waits_for(self.plant.now()));
        here.or_else(|| self.lateness())
    }
}

impl Host for Emulator {
    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel) {
        (&mut self.plant, &mut self.travel)
    }

    fn outsiders(&mut self) -> Option<String> {
        self.guests.look(&mut self.plant);
        let task = self.lockstep.present(&self.plant);
        task.or_else(|| self.guests.present_one(&self.plant)).or_else(|| self.mapped_client())
    }

    fn take_over_files(&mut self) {
        // The files of several hosts may differ.
        #[cfg(feature = "channel")]
        if self.membership.federation.is_some() {
            return;
        }
        let written = self.plant.journal().written();
        if self.plant.take_over_files() {
            self.travel.has_other_files();
        } else if self.plant.journal().written() != written {
            // A device has refused its files. The history cannot repeat the record of this refusal.
            self.travel.touch();
        }
    }

    fn has_travelled(&mut self) {
        self.guests.reconnect_all(&mut self.plant);
        // Wakes clients that wait for a register, so that they check it again.
        self.announce();
    }

    fn is_stepped(&self) -> bool {
        self.options.clock.is_stepped()
    }

    #[cfg(feature = "channel")]
    fn permit(&mut self, op: &Op) -> Result<(), Refused> {
        let Emulator { plant, membership, .. } = self;
        membership.federation.as_mut().map_or(Ok(()), |federation| federation.permit(plant, op))
    }

    #[cfg(feature = "channel")]
    fn may_act(&self) -> bool {
        self.membership.may_act(self.plant.now())
    }

    fn begin_request(&mut self) {
        #[cfg(feature = "channel")]
        if self.membership.federation.is_some() {
            self.look_around();
            return;
        }
        self.guests.look(&mut self.plant);
        if self.options.clock.is_stepped() {
            self.look_at_rings();
        }
    }

    fn next_event(&self) -> u64 {
        self.plant.next_event().min(self.next_from_outside())
    }

    fn next_change(&self) -> u64 {
        self.plant.next_change().min(self.next_from_outside())
    }

    fn advance_to(&mut self, t: u64) -> bool {
        #[cfg(feature = "channel")]
        if self.membership.federation.is_some() {
            return self.ask_for(t);
        }
        let has_arrived = self.step_to(t);
        self.notify_events();
        has_arrived
    }

    fn set_speed(&mut self, permille: u32) -> bool {
        self.set_real_speed(permille)
    }

    fn is_changing_speed(&self) -> bool {
        self.speed_change.is_some()
    }

    fn should_pause(&self) -> bool {
        self.slice.is_over()
    }

    fn doors(&mut self) -> Option<&mut Doors> {
        self.guests.look(&mut self.plant);
        Some(self.guests.doors())
    }

    fn doors_seen(&self) -> Option<&Doors> {
        Some(self.guests.doors_seen())
    }

    fn info(&self) -> InstanceInfo {
        let header = self.header();
        InstanceInfo {
            name: self.options.instance.clone(),
            is_stepped: self.options.clock.is_stepped(),
            speed: header.speed.load(),
            time_us: self.plant.now(),
            generation: header.generation.load(),
            pid: header.firmware_pid.load(),
            abi_version: header.abi_version.load(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            waits_for: self.waits_for(),
            names: self.plant.names(),
        }
    }

    fn request_stop(&mut self, by: Option<u32>) {
        self.stop.make(by.map(|pid| format!("{} has asked it to", describe_process(pid))));
    }

    fn end_reason(&self) -> Option<&str> {
        self.stop.reason()
    }

    fn should_stop(&self) -> bool {
        self.is_stopping()
    }
}
