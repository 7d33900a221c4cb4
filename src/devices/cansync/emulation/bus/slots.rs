//! Frames in their slots: the start of a frame, its delivery, and the time when the bus is free again.

use super::disturbance::Fate;
use super::schedule::Slot;
use super::{Run, Sender, SimBus, Station};
use crate::devices::cansync::firmware::Slave;
use crate::devices::cansync::frames::{Frame, wire};
use crate::devices::cansync::records::Transmitted;
use crate::door::BusMessage;
use serde::{Deserialize, Serialize};

/// Number of frame places in an interval.
pub(super) const PLACES: usize = 6;

/// A frame on the wire, or a scheduled frame. The status registers need it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct OnWire {
    /// Start of the frame, in microseconds.
    pub(super) from: u64,
    /// End of the frame, in microseconds.
    pub(super) until: u64,
    /// Regular end of the frame, in microseconds. If a fault delays the frame, this time is before `until`.
    pub(super) due: u64,
    /// Earliest start of the next slot's frame, in microseconds. 0 if this frame is outside of its slot: it
    /// then delays no other frame (decision D-127).
    pub(super) free: u64,
    pub(super) sender: Sender,
}

impl Run<'_> {
    /// Puts a frame on the wire at the start of its slot, or now if that time has passed. The event `slot` is
    /// the end of the frame. The frame waits until the previous slot's frame has left the wire (decision
    /// D-280). Returns the time at which the receivers see the start of the frame; `None` if a fault loses
    /// the frame.
    pub(super) fn transmit(
        &mut self,
        slot: Slot,
        frame: &Frame,
        slot_start: u64,
        sender: Sender,
    ) -> Option<u64> {
        let airtime = wire::airtime(frame, u32::from(self.timing.kbit_per_s));
        let place = place_on_wire(slot);
        let before = self.bus.on_wire[(place + PLACES - 1) % PLACES];
        let from = slot_start.max(self.now).max(before.map_or(0, |frame| frame.free));
        // An earlier frame in this place may not have reached its end. Its fate is cleared here.
        self.bus.disturbance.take_fate(place);
        let begin =
            if self.faults.is_empty() { Some(from) } else { self.disturb(place, frame, from, airtime) };
        let from_seen = begin.unwrap_or(from);
        let is_regular = from_seen == from && slot_start >= self.now;
        let free = if is_regular { from + u64::from(airtime.occupation_us) } else { 0 };
        let delivery = u64::from(airtime.delivery_us);
        let (until, due) = (from_seen + delivery, from + delivery);
        self.bus.on_wire[place] = Some(OnWire { from: from_seen, until, due, free, sender });
        self.bus.schedule.set(slot, due);
        if slot == Slot::Actual1End {
            // The master passes WRC2 to its controller before RDC1 is requested, so WRC2 may have to wait for
            // this frame.
            self.hold_back(Slot::Reference2End, free);
        }
        begin
    }

    /// Delays a frame in a future slot, so that it begins at `free` at the earliest.
    fn hold_back(&mut self, slot: Slot, free: u64) {
        let Some(wire) = &mut self.bus.on_wire[place_on_wire(slot)] else { return };
        if wire.free == 0 || wire.from <= self.now {
            return;
        }
        let wait = free.saturating_sub(wire.from);
        for time in [&mut wire.from, &mut wire.until, &mut wire.due, &mut wire.free] {
            *time += wait;
        }
        let due = wire.due;
        self.bus.schedule.set(slot, due);
    }

    /// Handles the regular end of a frame. If the frame arrives now, notes this for the LEDs.
    pub(super) fn arrives(&mut self, slot: Slot, frame: &Frame) -> Fate {
        let place = place_on_wire(slot);
        let fate = self.bus.disturbance.take_fate(place);
        if let Some(wire) = self.bus.on_wire[place] {
            self.show_sent(wire.sender);
        }
        if fate == Fate::Arrives {
            self.note_frame(*frame);
        }
        fate
    }

    pub(super) fn note_frame(&mut self, frame: Frame) {
        if self.bus.is_wired {
            self.bus.receivers_of_traffic.send(self.now, None, || BusMessage::Frame(frame.into()));
            self.journal.push(self.now, Transmitted { bus: self.bus.index, frame });
        }
        self.show_received(&frame);
    }

    /// Notes that a frame of `sender` has ended, for the LED of the sender.
    fn show_sent(&mut self, sender: Sender) {
        let now = Some(self.now);
        match sender {
            Sender::Master => self.bus.masters.iter_mut().for_each(|end| end.last_frame = now),
            Sender::Slave(number) => {
                if let Some(Station::Node(index)) = self.bus.stations.get(usize::from(number)) {
                    self.bus.slaves[*index].last_frame = now;
                }
                let mut ends = self.bus.drive_ends.iter_mut();
                ends.find(|end| end.number == number).into_iter().for_each(|end| end.last_frame = now);
            }
        }
    }

    /// Notes a received frame, for the LEDs of the nodes that receive it.
    fn show_received(&mut self, frame: &Frame) {
        let (now, kbit_per_s, id) = (Some(self.now), self.timing.kbit_per_s, frame.id());
        let SimBus { masters, slaves, drive_ends, disturbance, .. } = &mut *self.bus;
        for end in masters.iter_mut().filter(|end| end.firmware.accepts(id)) {
            end.last_frame = now;
        }
        let hears = |slave: &Slave| {
            slave.hears(kbit_per_s) && slave.accepts(id) && !disturbance.is_off(slave.number())
        };
        for end in slaves.iter_mut().filter(|end| hears(&end.firmware)) {
            end.last_frame = now;
        }
        for end in
            drive_ends.iter_mut().filter(|end| end.kbit_s == kbit_per_s && !disturbance.is_off(end.number))
        {
            end.last_frame = now;
        }
    }
}

/// Returns the index in `SimBus::on_wire` of the frame that ends with `slot`. The indices are in the order of
/// the slots. The frame before the first place of an interval is the last frame of the previous interval.
fn place_on_wire(slot: Slot) -> usize {
    match slot {
        Slot::ResponseEnd => 0,
        Slot::Reference1End => 1,
        Slot::Actual1End => 2,
        Slot::Reference2End => 3,
        Slot::Actual2End => 4,
        _ => 5,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame waits only for the frame in the previous place. Two frames in one place would not wait for
    /// each other.
    #[test]
    fn frames_of_an_interval_have_places_in_slot_order() {
        use Slot::*;
        let ends = [ResponseEnd, Reference1End, Actual1End, Reference2End, Actual2End, CommandEnd];
        assert_eq!(ends.map(place_on_wire), core::array::from_fn::<usize, PLACES, _>(|place| place));
    }
}
