//! Functions of the plant for the boards of its PLCs: switches, supply, events, NOVRAM.

use super::Plant;
use crate::devices::records::{BoardEvent, OnBoard};
use crate::devices::{Context, Events, FrontAction, Power};
use crate::identity::DeviceIndex;
use crate::journal::{By, Origin};
use crate::layout::{FrontWord, Owner};
use crate::memory::header::{BoardSetting, FRONT, SeatState};

impl Plant {
    /// Handles requests and switches that clients have written in the header pages, at the present time. Returns true
    /// if a board was polled.
    pub fn look_at_boards(&mut self) -> bool {
        if !self.is_asked() {
            return false;
        }
        self.look_for_writes();
        let changed = self.look_at_requests();
        // The new baseline is stored only if the firmware has written registers. Otherwise the checker would
        // mistake stores of a task in lockstep for stores of the firmware.
        if changed {
            // A cold start writes the retain flags, so forced values must be restored.
            self.forces.apply(&self.devices);
            self.leave();
        }
        changed
    }

    /// True if a client has made a request to the board of a device, or turned a switch.
    pub(crate) fn is_asked(&self) -> bool {
        self.devices.iter().any(|device| device.front_has_changed())
    }

    pub(super) fn look_at_requests(&mut self) -> bool {
        let mut changed = false;
        for plc in DeviceIndex::first(self.devices.len()) {
            let origin = Origin::of_device(plc);
            let ctx = &mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 };
            let look = self.devices[plc.index()].look(ctx);
            changed |= look != FrontAction::Nothing;
            self.follow(look, plc);
        }
        if changed {
            self.pass_signals();
            self.find_next_device();
        }
        changed
    }

    /// Switches the supply or RESET of a PLC at the present time. Other PLCs and their buses continue. The bus at node
    /// 2 of this PLC stops, as at a restart of its master.
    pub fn set_power(&mut self, plc: DeviceIndex, power: Power) {
        self.look_for_writes();
        if let Some(device) = self.devices.get_mut(plc.index()) {
            let look = device.set_power(power);
            self.follow(look, plc);
            self.find_next_device();
            self.forces.apply(&self.devices);
        }
        self.leave();
    }

    /// Changes a setting of the board of a PLC at the present time. Returns `false` if the board has no such switch.
    pub fn set_board(&mut self, plc: DeviceIndex, setting: BoardSetting) -> bool {
        let steps = match setting {
            BoardSetting::Reset => [Power::HoldReset, Power::ReleaseReset],
            BoardSetting::PowerCycle => [Power::Off, Power::On],
            _ => {
                self.keep_changes(By::Program);
                let has_it = match setting {
                    BoardSetting::Front { word, value } => self.set_front(plc, word.into(), value),
                    _ => self.devices.get(plc.index()).is_some_and(|device| device.turn(setting)),
                };
                self.keep_changes(By::Channel);
                self.look_at_boards();
                return has_it;
            }
        };
        steps.into_iter().for_each(|step| self.set_power(plc, step));
        true
    }

    /// Writes a word of a front panel as a client does. Returns `false` if clients cannot write this word, or not this
    /// value.
    fn set_front(&self, plc: DeviceIndex, index: usize, value: u32) -> bool {
        let Some(device) = self.devices.get(plc.index()) else { return false };
        let is_it =
            |word: &&FrontWord| word.index() == index && word.owner == Owner::Plc && word.takes(value);
        let word = device.layout().front.iter().find(is_it);
        let index = word.map(FrontWord::index).filter(|index| *index < FRONT);
        // The image of a device with a front panel is writable, so the firmware has access to its header
        // page.
        let face = device.segment().firmware_header().ok();
        index.zip(face).map(|(index, face)| face.put(|page| &page.front[index], value)).is_some()
    }

    /// Records the new state of a task in lockstep.
    pub fn note_lockstep(&mut self, plc: DeviceIndex, event: usize, state: SeatState) {
        let event = u8::try_from(event).unwrap_or(u8::MAX);
        self.journal.push(self.now, OnBoard { plc, what: BoardEvent::Lockstep { event, state } });
    }

    /// Stores the contents of the NOVRAM registers, as at power-off.
    pub fn keep_novram(&mut self) {
        let novram = self.devices.iter_mut().filter_map(|device| device.novram_mut());
        novram.for_each(|novram| novram.store());
    }

    /// Returns the interrupt level of an event of PLC `plc`; `None` if the event does not exist.
    pub fn event_level(&self, plc: DeviceIndex, event: usize) -> Option<u8> {
        self.devices.get(plc.index())?.event_level(event)
    }

    /// Returns and clears the events of PLC `plc` since the last call: bit n for event n.
    pub fn take_fired(&mut self, plc: DeviceIndex) -> u16 {
        let events = self.devices.get_mut(plc.index()).and_then(|device| device.events());
        events.map_or(0, Events::take_fired)
    }
}
