//! Connects guests with the plant: passes on the frames that they send, and the traffic that they receive.
//!
//! In real time this happens after every firmware step. With a stepped clock, frames of guests enter the buses at the
//! beginning of a step, and guests receive frames at its end. [`super::turns`] describes the different rules for guests
//! with a seat in lockstep.

use crate::devices::{Attendance, GuestRefusal};
use crate::door::{DoorError, DoorState, Doors, Guest, GuestRequests, GuestTurn, Rate};
use crate::identity::BusIndex;
use crate::plant::{Plant, PlantConfig};
use std::sync::Arc;

/// The doors of an instance, and the guests at them.
pub(super) struct Guests {
    doors: Doors,
    present: Vec<GuestEntry>,
}

/// A connected guest, which may take part in its bus.
struct GuestEntry {
    guest: Arc<Guest>,
    requests: GuestRequests,
    /// Number of frames that waited at the last check of the guest. Frames that arrive later are sent after the next
    /// check.
    waiting: usize,
    /// Number of frames that enter the bus as soon as the guest's controller has room for them.
    due: usize,
    /// The requests that the emulator carries out at present. Later requests of the guest take effect at the next step.
    carried_out: GuestRequests,
    /// True if the guest has the bit rate of the bus, or has not set a bit rate.
    fits: bool,
    /// True if the guest takes part in the bus.
    is_in: bool,
    /// True if the bus sends its traffic to the guest.
    is_receiver: bool,
    /// True if the guest has a seat: the stepped clock waits for this guest.
    has_seat: bool,
    /// The bit rates of guest and bus, in bit/s, that a finding has reported as different.
    rate_mismatch: Option<(Rate, u32)>,
    /// True if a finding has reported an invalid message of this guest.
    is_nonsense: bool,
}

impl Guests {
    /// Opens the doors of the plant. `ring` wakes the emulator from another thread.
    ///
    /// # Errors
    /// A door cannot be opened.
    pub(super) fn new(
        config: &PlantConfig,
        is_stepped: bool,
        ring: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, DoorError> {
        let mut doors = Doors::new(is_stepped, ring);
        for (index, bus) in BusIndex::enumerate(&config.buses) {
            for door in bus.doors() {
                doors.open(index, *door)?;
            }
        }
        Ok(Guests { doors, present: Vec::new() })
    }

    /// Returns the doors of the instance.
    pub(super) fn doors(&mut self) -> &mut Doors {
        &mut self.doors
    }

    /// Returns the doors, for reading.
    pub(super) fn doors_seen(&self) -> &Doors {
        &self.doors
    }

    /// Returns the doors of a bus.
    pub(super) fn open_doors(&self, bus: BusIndex) -> Vec<DoorState> {
        self.doors.of_bus(bus)
    }

    /// True if a guest is connected.
    pub(super) fn are_present(&self) -> bool {
        !self.present.is_empty()
    }

    #[inline]
    fn is_empty(&self) -> bool {
        self.doors.is_empty() && self.present.is_empty()
    }

    /// Reads the requests of the guests. A guest with another bit rate than its bus receives nothing, and a finding
    /// reports this.
    pub(super) fn look(&mut self, plant: &mut Plant) {
        if self.is_empty() {
            return;
        }
        for guest in self.doors.guests() {
            if !self.present.iter().any(|it| Arc::ptr_eq(&it.guest, guest)) {
                self.present.push(GuestEntry::new(Arc::clone(guest)));
            }
        }
        // Guests act in this order at a moment, independent of the order in which their messages have arrived.
        self.present.sort_by_key(|it| (it.guest.bus, it.guest.number));
        learn_all(&mut self.present, |_| true, plant);
        self.forget_departed();
    }

    /// Connects and disconnects guests and passes their frames to the plant. Gives seats to guests that have requested
    /// one. If a guest has requested time until its next turn, this time begins now.
    pub(super) fn enter(&mut self, plant: &mut Plant, is_stepped: bool) {
        if self.is_empty() {
            return;
        }
        self.look(plant);
        self.bring_in(plant, is_stepped);
    }

    /// Carries out the requests of the last check.
    fn bring_in(&mut self, plant: &mut Plant, is_stepped: bool) {
        bring_in_all(&mut self.present, |_| true, plant, is_stepped);
        // Every guest with room must be resumed, so the loop uses `count`, which visits all guests.
        if self.present.iter().filter(|it| it.guest.resume()).count() > 0 {
            self.doors.announce();
        }
        self.forget_departed();
    }

    /// Removes disconnected guests from the list, as soon as the plant has removed them and has taken all their frames.
    fn forget_departed(&mut self) {
        let is_over = |it: &mut GuestEntry| {
            it.requests.has_gone && !it.is_in && !it.has_seat && it.guest.waiting() == 0
        };
        for gone in self.present.extract_if(.., is_over) {
            self.doors.forget(&gone.guest);
        }
    }

    /// Does the same as [`Guests::enter`] during a step, but only for guests with a seat.
    pub(super) fn enter_seated(&mut self, plant: &mut Plant) {
        learn_all(&mut self.present, |it| it.has_seat, plant);
        bring_in_all(&mut self.present, |it| it.has_seat, plant, true);
    }

    /// True if frames that have waited since the beginning of a step have had no room yet.
    #[inline]
    pub(super) fn have_due_frames(&self) -> bool {
        self.present.iter().any(|it| it.due > 0)
    }

    /// Passes frames for which there was no room to the plant, as far as there is room now.
    pub(super) fn send_due_frames(&mut self, plant: &mut Plant) {
        self.present.iter_mut().filter(|it| it.due > 0).for_each(|it| it.send_and_leave(plant));
    }

    /// Description of a guest that takes part; `None` if there is none.
    pub(super) fn present_one(&self, plant: &Plant) -> Option<String> {
        // Disconnected guests stay in the list until the clock advances.
        let is_here = |it: &&GuestEntry| (it.is_in || it.has_seat) && !it.guest.requests().has_gone;
        self.present.iter().find(is_here).map(|it| it.label(plant))
    }

    /// Description of the guest that the clock waits for.
    pub(super) fn waits_for(&self, plant: &Plant) -> Option<String> {
        self.present.iter().find(|it| it.has_turn()).map(|it| it.label(plant))
    }

    /// Called after the plant has moved to another moment of emulated time. Other guests may have taken part then, so
    /// this connects the present guests again.
    pub(super) fn reconnect_all(&mut self, plant: &mut Plant) {
        for (bus, guest) in plant.guests() {
            if !self.present.iter().any(|it| it.is_in && (it.guest.bus, it.guest.number) == (bus, guest)) {
                plant.guest_leaves(bus, guest);
            }
        }
        for it in self.present.iter().filter(|it| it.is_in) {
            plant.guest_joins(it.guest.bus, it.guest.number, true);
        }
        for it in self.present.iter().filter(|it| it.is_receiver) {
            plant.guest_hears(it.guest.bus, it.guest.number, Some(Arc::clone(&it.guest)));
        }
    }

    /// True if the emulated time waits for a guest.
    #[inline]
    pub(super) fn have_seats(&self) -> bool {
        self.present.iter().any(|it| it.has_seat)
    }

    /// Returns the time of the first requested turn; `u64::MAX` if there is none.
    pub(super) fn next_turn(&self) -> u64 {
        self.present.iter().map(|it| it.guest.seat().next_turn()).fold(u64::MAX, u64::min)
    }

    /// Gives a turn to all guests for which `now` is the requested time.
    pub(super) fn grant(&mut self, now: u64) {
        // Every guest must get its turn, so the loop uses `count`, which visits all guests. `any` would stop at the
        // first guest that takes a turn.
        if self.present.iter().filter(|it| it.guest.grant(now)).count() > 0 {
            self.doors.announce();
        }
    }

    /// True if the clock waits for the turn of a guest.
    pub(super) fn have_turns(&self) -> bool {
        self.present.iter().any(GuestEntry::has_turn)
    }

    /// Takes away the seats of all guests that have their turn.
    pub(super) fn give_up(&mut self, plant: &mut Plant) {
        for it in self.present.iter_mut().filter(|it| it.has_turn()) {
            if it.guest.give_up() {
                it.has_seat = false;
                plant.note_guest(it.guest.bus, it.guest.number, Attendance::SeatLost);
                tracing::warn!(
                    "{}: guest{} has lost its seat in lockstep: it took too long",
                    it.guest.door,
                    it.guest.number
                );
            }
        }
    }

    /// Sends each guest the state of its bus. Wakes the doors if guests have received traffic from the buses.
    pub(super) fn send_heard(&mut self, plant: &mut Plant) {
        if !self.present.iter().any(GuestEntry::hears) {
            return;
        }
        for it in self.present.iter().filter(|it| it.is_in) {
            it.guest.note_errors(plant.guest_errors(it.guest.bus, it.guest.number));
        }
        if self.present.iter().any(|it| it.guest.has_unread_messages()) {
            self.doors.announce();
        }
    }
}

/// Reads the requests of the selected guests.
fn learn_all(present: &mut [GuestEntry], are_meant: fn(&GuestEntry) -> bool, plant: &mut Plant) {
    // The frames of all guests are counted before the requests are read. So a guest that connected before another guest
    // sent a frame takes part when that frame enters the bus.
    for it in present.iter_mut().filter(|it| are_meant(it)) {
        it.waiting = it.guest.waiting();
    }
    present.iter_mut().filter(|it| are_meant(it)).for_each(|it| it.learn(plant));
}

/// Carries out the last requests of the selected guests: connects and disconnects them and passes their frames to the
/// plant.
fn bring_in_all(
    present: &mut [GuestEntry],
    are_meant: fn(&GuestEntry) -> bool,
    plant: &mut Plant,
    is_stepped: bool,
) {
    for it in present.iter_mut().filter(|it| are_meant(it)) {
        // Messages that a guest has sent before it disconnected are still valid.
        if it.fits && (it.requests.takes_part || it.waiting > 0) && !it.is_in {
            plant.guest_joins(it.guest.bus, it.guest.number, is_stepped);
            it.is_in = true;
        }
    }
    for it in present.iter_mut().filter(|it| are_meant(it)) {
        (it.due, it.carried_out) = (it.waiting, it.requests);
        it.send_and_leave(plant);
        it.guest.take_request(plant.now());
        if is_stepped {
            it.update_seat(plant);
        }
    }
}

impl GuestEntry {
    fn new(guest: Arc<Guest>) -> Self {
        let requests = guest.requests();
        GuestEntry {
            guest,
            requests,
            waiting: 0,
            due: 0,
            carried_out: requests,
            fits: true,
            is_in: false,
            is_receiver: false,
            has_seat: false,
            rate_mismatch: None,
            is_nonsense: false,
        }
    }

    /// Description of the guest.
    fn label(&self, plant: &Plant) -> String {
        let bus = plant.buses().get(self.guest.bus.index()).map_or("", |bus| bus.name());
        format!("guest{} at door {} of bus '{bus}'", self.guest.number, self.guest.door)
    }

    /// Reads the requests of the guest.
    fn learn(&mut self, plant: &mut Plant) {
        self.requests = self.guest.requests();
        let bit_s = plant.buses().get(self.guest.bus.index()).map_or(0, |bus| bus.bit_s());
        self.guest.is_at(bit_s);
        self.fits = self.requests.rate.is_none_or(|rate| rate.fits(bit_s));
        let rate_mismatch =
            self.requests.rate.filter(|_| self.requests.hears && !self.fits).map(|rate| (rate, bit_s));
        if let Some((rate, _)) = rate_mismatch.filter(|_| self.rate_mismatch != rate_mismatch) {
            plant.report_rate_mismatch(self.guest.bus, self.guest.number, rate.code());
        }
        self.rate_mismatch = rate_mismatch;
        let hears = self.hears();
        if core::mem::replace(&mut self.is_receiver, hears) != hears {
            let receiver = hears.then(|| Arc::clone(&self.guest));
            plant.guest_hears(self.guest.bus, self.guest.number, receiver);
        }
        if let Some(octets) = self.requests.bad_length.filter(|_| !self.is_nonsense) {
            plant.guest_talks_nonsense(self.guest.bus, self.guest.number, octets);
            self.is_nonsense = true;
        }
    }

    /// Takes or gives back a seat, as requested.
    fn update_seat(&mut self, plant: &mut Plant) {
        let wants = self.guest.seat() != GuestTurn::Free;
        if core::mem::replace(&mut self.has_seat, wants) != wants {
            let news = if wants { Attendance::Seated } else { Attendance::SeatBack };
            plant.note_guest(self.guest.bus, self.guest.number, news);
        }
    }

    fn has_turn(&self) -> bool {
        self.has_seat && self.guest.seat() == GuestTurn::HasTurn
    }

    fn hears(&self) -> bool {
        self.requests.hears && self.fits
    }

    /// Sends the frames that are due. Removes the guest from the bus after its last frame, if it no longer takes part.
    fn send_and_leave(&mut self, plant: &mut Plant) {
        let is_through = self.send(plant);
        if self.carried_out.has_gone && !is_through {
            // Disconnecting here frees the place of the guest for other guests.
            plant.guest_has_gone(self.guest.bus, self.guest.number);
        }
        if self.is_in && is_through && (!self.carried_out.takes_part || !self.fits) {
            plant.guest_leaves(self.guest.bus, self.guest.number);
            self.is_in = false;
        }
    }

    /// Sends the frames that are due. Returns false if the guest's controller has no room for all of them.
    fn send(&mut self, plant: &mut Plant) -> bool {
        while self.due > 0 {
            let Some(message) = self.guest.next_to_send() else {
                // The messages of the disconnected guest were discarded.
                (self.due, self.waiting) = (0, 0);
                return true;
            };
            let refusal = if self.is_in {
                plant.guest_sends(self.guest.bus, self.guest.number, &message)
            } else {
                Err(GuestRefusal::NotHere)
            };
            if refusal == Err(GuestRefusal::Full) {
                return false;
            }
            self.guest.sent(refusal.is_ok());
            self.waiting -= 1;
            self.due -= 1;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::door::BusMessage;
    use crate::memory::Segment;
    use std::io::Write;
    use std::net::TcpStream;
    use std::time::{Duration, Instant};

    const OPEN: &str = "[[plc]]\nname = 'line'\n[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";

    fn plant(text: &str) -> (PlantConfig, Plant) {
        let config = PlantConfig::parse("plant.toml", text).unwrap();
        let plant = Plant::new(&config, |_, device| Ok::<_, Box<dyn std::error::Error>>(Segment::of(device)));
        (config, plant.unwrap())
    }

    /// The emulator first checks all guests and then carries out their requests. A message that arrives in between
    /// belongs to the next check. Otherwise a frame of a guest that is not connected yet would be lost, although its
    /// door has confirmed the frame.
    #[test]
    fn a_frame_that_comes_while_guests_are_brought_in_is_not_lost() {
        let (config, mut plant) = plant(OPEN);
        let mut guests = Guests::new(&config, false, || {}).unwrap();
        let [one, other] = [1, 2].map(|number| Guest::of_a_test(BusIndex(0), number));
        for guest in [&one, &other] {
            guests.present.push(GuestEntry::new(Arc::clone(guest)));
        }
        guests.look(&mut plant);
        other.opens();
        one.opens();
        one.sends(0x123);
        guests.bring_in(&mut plant, false);
        assert_eq!((one.state().refused, one.waiting()), (0, 1));
        guests.enter(&mut plant, false);
        assert_eq!(one.waiting(), 0);
        plant.advance_to(10_000);
        guests.send_heard(&mut plant);
        assert_eq!(other.heard(), 1);
    }

    /// A guest cannot see that octets are lost. So it waits, however it divides its octets into pieces.
    #[test]
    fn octets_of_a_guest_wait_for_the_plant_and_are_never_refused() {
        let (config, mut plant) = plant(
            "[[plc]]\nname = 'line'\n[[bus]]\nname = 'open'\nkind = 'serial'\nwires = 2\nbaud_rate = 38400\ndoors = ['serial-tcp:127.0.0.1:0']\n",
        );
        let mut guests = Guests::new(&config, true, || {}).unwrap();
        let other = Guest::of_a_test(BusIndex(0), 99);
        other.opens();
        guests.present.push(GuestEntry::new(Arc::clone(&other)));
        guests.enter(&mut plant, true);
        let door = guests.open_doors(BusIndex(0)).remove(0).door.to_string();
        let mut stream = TcpStream::connect(door.strip_prefix("serial-tcp:").unwrap()).unwrap();
        stream.set_nodelay(true).unwrap();
        let until = |what: &str, is_reached: &mut dyn FnMut() -> bool| {
            let begin = Instant::now();
            while !is_reached() {
                assert!(begin.elapsed() < Duration::from_secs(60), "{what}");
                std::thread::yield_now();
            }
        };
        until("the guest takes part", &mut || {
            guests.enter(&mut plant, true);
            guests.present.len() == 2
        });
        let one = Arc::clone(&guests.present[0].guest);
        for count in 1..=2000 {
            stream.write_all(&[count as u8]).unwrap();
            until("the octet waits", &mut || one.waiting() == count);
        }
        const MORE: usize = 200_000;
        let writer = std::thread::spawn(move || {
            stream.write_all(&(2001..=2000 + MORE).map(|count| count as u8).collect::<Vec<_>>()).unwrap();
            stream
        });
        until("there is no more room", &mut || !one.may_be_read());
        let mut heard = 0;
        until("all octets arrive", &mut || {
            guests.enter(&mut plant, true);
            plant.advance_to(plant.now() + 1_000_000);
            while let Some(BusMessage::Burst(burst)) = other.hears() {
                for octet in burst.octets {
                    heard += 1;
                    assert_eq!(octet, heard as u8, "octet {heard}");
                }
            }
            heard == 2000 + MORE
        });
        assert_eq!((one.state().refused, other.state().dropped), (0, 0));
        drop(writer.join().unwrap());
    }

    /// A guest that has disconnected frees its place. Otherwise a program that connects and leaves repeatedly would
    /// occupy all places.
    #[test]
    fn a_guest_does_not_keep_a_place_for_unsendable_frames() {
        let kinds: [(_, fn(&Guest)); 2] =
            [("can", |guest| guest.sends(1)), ("profibus", |guest| guest.sends_later())];
        for (kind, send) in kinds {
            let (config, mut plant) =
                plant(&OPEN.replace("'can'", &format!("'{kind}'")).replace("125", "500"));
            let mut guests = Guests::new(&config, false, || {}).unwrap();
            let guest = Guest::of_a_test(BusIndex(0), 1);
            guests.present.push(GuestEntry::new(Arc::clone(&guest)));
            guest.opens();
            (0..200).for_each(|_| send(&guest));
            guest.goes();
            for _ in 0..10 {
                guests.enter(&mut plant, false);
                plant.advance_to(plant.now() + 10_000);
            }
            assert!(!guests.are_present(), "{kind}: {} wait", guest.waiting());
        }
    }
}
