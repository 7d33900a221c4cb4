//! The boards of the PLCs as the plant's callers see them: switches, supply, events, NOVRAM.

use super::{Plant, Plc, Power};
use crate::journal::{BoardEvent, Event};
use crate::memory::header::{BoardSetting, SeatState};

impl Plant {
    /// Answers what clients ask of the boards at the present time: requests and switches in the header pages. Tells
    /// whether there was anything.
    pub fn look_at_boards(&mut self) -> bool {
        if !self.plcs.iter().any(|plc| plc.board.has_changed()) {
            return false;
        }
        self.look_for_writes();
        let changed = self.look_at_requests();
        // Without an answer nothing was written here, and what a task stores meanwhile, in its turn, must not pass for
        // the firmware's own.
        if changed {
            // A cold start has written the retain flags.
            self.forces.apply(&self.plcs);
            self.leave();
        }
        changed
    }

    pub(super) fn look_at_requests(&mut self) -> bool {
        let mut changed = false;
        for index in 0..self.plcs.len() {
            changed |= self.plcs[index].look_at_board(index, self.now, &mut self.buses, &mut self.journal);
        }
        if changed {
            self.find_next_timer();
        }
        changed
    }

    /// Switches supply or RESET of a PLC at the present time. Other PLCs and their buses go on; the bus of its node
    /// 2 stops as when its master is restarted.
    pub fn set_power(&mut self, plc: usize, power: Power) {
        self.look_for_writes();
        if let Some(it) = self.plcs.get_mut(plc) {
            it.set_power(power, plc, self.now, &mut self.buses, &mut self.journal);
            self.find_next_timer();
            self.forces.apply(&self.plcs);
        }
        self.leave();
    }

    /// Does something to the board of a PLC at the present time.
    pub fn set_board(&mut self, plc: usize, setting: BoardSetting) {
        let steps = match setting {
            BoardSetting::Reset => [Power::HoldReset, Power::ReleaseReset],
            BoardSetting::PowerCycle => [Power::Off, Power::On],
            _ => {
                if let Some(plc) = self.plcs.get(plc) {
                    plc.turn(setting);
                }
                self.look_at_boards();
                return;
            }
        };
        steps.into_iter().for_each(|step| self.set_power(plc, step));
    }

    /// Notes what became of a task in lockstep.
    pub fn note_lockstep(&mut self, plc: usize, event: usize, state: SeatState) {
        let (plc, event) = (plc as u16, u8::try_from(event).unwrap_or(u8::MAX));
        self.journal.push(self.now, Event::Board { plc, what: BoardEvent::Lockstep { event, state } });
    }

    /// What stands in the NOVRAM registers counts as stored, as at power-off.
    pub fn keep_novram(&mut self) {
        self.plcs.iter_mut().for_each(Plc::keep_ethernet_config);
    }

    /// Events of PLC `plc` since the last call, bit n for event n.
    pub fn take_fired(&mut self, plc: usize) -> u16 {
        self.plcs.get_mut(plc).map_or(0, |plc| plc.board.take_fired())
    }
}
