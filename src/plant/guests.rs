//! Guests: programs that take part in buses of the plant through doors. The plant depends only on their actions: the
//! same actions at the same emulated times give the same journal.

use super::Plant;
use crate::can::{ErrorState, Frame};
use crate::check::rules;
use crate::devices::{Attendance, BusGuests, GuestNews, GuestRefusal};
use crate::door::{BusMessage, Guest};
use crate::identity::BusIndex;
use crate::journal::Finding;
use crate::profibus::Burst;
use std::sync::Arc;

impl Plant {
    /// Returns the guests of bus number `bus`, for an action of a guest. The action may change registers, so
    /// the next poll is not skipped.
    fn guests_of(&mut self, bus: BusIndex) -> Option<&mut dyn BusGuests> {
        (self.has_looked, self.is_seen) = (false, false);
        self.guests_seen(bus)
    }

    /// Returns the guests of bus number `bus`, for reading the state of a guest.
    fn guests_seen(&mut self, bus: BusIndex) -> Option<&mut dyn BusGuests> {
        self.buses[..self.named_buses].get_mut(bus.index())?.guests()
    }

    /// Lets guest number `guest` take part in bus number `bus` from now on. If `is_stepped`, the bus takes over frames
    /// of the guest only at the next step of the clock; the journal records this.
    pub fn guest_joins(&mut self, bus: BusIndex, guest: u8, is_stepped: bool) {
        let now = self.now;
        let Some(guests) = self.guests_of(bus) else { return };
        guests.guest_joins(guest, now);
        let news = if is_stepped { Attendance::TakesPartStepped } else { Attendance::TakesPart };
        self.journal.push(now, GuestNews { bus, guest, news });
    }

    /// Returns the guests that take part in buses with known stations, each as bus and number. The list does not
    /// include guest 0, which acts for requests of clients.
    pub(crate) fn guests(&self) -> Vec<(BusIndex, u8)> {
        let mut found = Vec::new();
        for (index, bus) in BusIndex::enumerate(self.buses()) {
            let guests = bus.stations().into_iter().filter_map(|it| it.origin.guest());
            found.extend(guests.filter(|guest| *guest != 0).map(|guest| (index, guest)));
        }
        found
    }

    /// Ends a guest's participation. Frames that it has passed to its controller are still sent.
    pub fn guest_leaves(&mut self, bus: BusIndex, guest: u8) {
        let now = self.now;
        let Some(guests) = self.guests_of(bus) else { return };
        guests.guest_leaves(guest, now);
        self.journal.push(now, GuestNews { bus, guest, news: Attendance::Left });
    }

    /// Called when the guest has disconnected before all its frames were sent. The bus drops those of the
    /// frames that might wait for a long time.
    pub(crate) fn guest_has_gone(&mut self, bus: BusIndex, guest: u8) {
        let now = self.now;
        if let Some(guests) = self.guests_of(bus) {
            guests.guest_has_gone(guest, now);
        }
    }

    /// Records an event of a guest's seat in lockstep.
    pub fn note_guest(&mut self, bus: BusIndex, guest: u8, news: Attendance) {
        self.journal.push(self.now, GuestNews { bus, guest, news });
    }

    /// Returns the error state of a guest's controller; error-active on buses without error states.
    pub(crate) fn guest_errors(&mut self, bus: BusIndex, guest: u8) -> ErrorState {
        self.guests_seen(bus).map_or_else(ErrorState::default, |guests| guests.guest_errors(guest))
    }

    /// Sends the traffic of the bus, except the guest's own frames, to `receiver` from now on. With `None`
    /// the guest receives no more traffic.
    pub fn guest_hears(&mut self, bus: BusIndex, guest: u8, receiver: Option<Arc<Guest>>) {
        if let Some(guests) = self.guests_seen(bus) {
            guests.guest_hears(guest, receiver);
        }
    }

    /// Sends a frame or a telegram of a participating guest.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    pub fn guest_sends(
        &mut self,
        bus: BusIndex,
        guest: u8,
        message: &BusMessage,
    ) -> Result<(), GuestRefusal> {
        let now = self.now;
        let bus = self.buses[..self.named_buses].get_mut(bus.index());
        let guests = bus.and_then(|bus| bus.guests()).ok_or(GuestRefusal::NotHere)?;
        let sent = guests.guest_sends(guest, message, now, &mut self.journal);
        if sent != Err(GuestRefusal::Full) {
            // The message may change registers, so the next poll is not skipped.
            (self.has_looked, self.is_seen) = (false, false);
        }
        sent
    }

    /// Lets guest 0, which acts for requests of clients, take part in bus number `bus` from now on. Sends a frame if
    /// one is given.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    pub fn take_part(&mut self, bus: BusIndex, frame: Option<&Frame>) -> Result<(), GuestRefusal> {
        self.join_by_requests(bus)?;
        frame.map_or(Ok(()), |frame| self.guest_sends(bus, 0, &BusMessage::Frame(*frame)))
    }

    /// Lets guest 0, which acts for requests of clients, take part in PROFIBUS number `bus` from now on. Sends a telegram
    /// as soon as the line is free for it.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    pub fn send_telegram(&mut self, bus: BusIndex, octets: Vec<u8>) -> Result<(), GuestRefusal> {
        self.join_by_requests(bus)?;
        self.guest_sends(bus, 0, &BusMessage::Burst(Burst { begin: 0, octets }))
    }

    fn join_by_requests(&mut self, bus: BusIndex) -> Result<(), GuestRefusal> {
        let now = self.now;
        let guests = self.guests_of(bus).ok_or(GuestRefusal::NotHere)?;
        if guests.guest_joins(0, now) {
            self.journal.push(now, GuestNews { bus, guest: 0, news: Attendance::TakesPart });
        }
        Ok(())
    }

    /// Records that a guest wanted to take part with a baud rate that differs from that of the bus. `code` is the rate
    /// of the guest as an `S` code (decision D-316).
    pub fn report_rate_mismatch(&mut self, bus: BusIndex, guest: u8, code: u8) {
        self.journal.find(self.now, Finding::at_bus(&rules::GUEST_BIT_RATE, bus, guest, code.into()));
    }

    /// Records that a guest has announced a telegram of `octets` octets, which is an impossible length, and was
    /// disconnected (decision D-357).
    pub fn guest_talks_nonsense(&mut self, bus: BusIndex, guest: u8, octets: u16) {
        self.journal.find(self.now, Finding::at_bus(&rules::GUEST_TELEGRAM, bus, guest, octets.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{Payload, StandardId};
    use crate::devices;
    use crate::identity::DeviceIndex;
    use crate::journal::text::Text;
    use crate::journal::{Event, Format, Source};
    use crate::memory::Segment;
    use crate::plant::PlantConfig;

    type BuildFailure = Box<dyn std::error::Error>;

    const OPEN: &str = "[[plc]]\nname = 'line'\n[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";

    fn plant(toml: &str) -> Plant {
        let config = PlantConfig::parse("plant", toml).unwrap();
        Plant::new(&config, |_, device| Ok::<_, BuildFailure>(Segment::of(device))).unwrap()
    }

    fn frame(id: u16, data: &[u8]) -> BusMessage {
        BusMessage::Frame(Frame::standard(id, Payload::new(data).unwrap()))
    }

    /// Returns frames that have arrived: time, identifier and sender.
    fn arrived(plant: &Plant) -> Vec<(u64, u32, Option<u8>)> {
        let carried = plant.journal().records().filter(|it| it.event.source() == Source::Bus(BusIndex(0)));
        let frames = carried.filter_map(|it| Some((it.time_us, Event::frame(&it.event)?)));
        frames.map(|(at, it)| (at, it.frame.arbitration().number(), it.guest)).collect()
    }

    fn lines(plant: &Plant) -> String {
        let mut text = Text::new(plant.names(), devices::catalogue());
        let mut lines = String::new();
        plant.journal().records().for_each(|record| text.record(&record, &mut lines));
        lines
    }

    #[test]
    fn guests_are_stations_and_the_dominant_identifier_goes_first() {
        let mut plant = plant(OPEN);
        plant.guest_joins(BusIndex(0), 1, false);
        assert_eq!(plant.guest_sends(BusIndex(0), 1, &frame(0x200, &[])), Ok(()));
        plant.advance_to(10_000);
        assert!(arrived(&plant).is_empty(), "no station acknowledges");
        plant.guest_joins(BusIndex(0), 2, true);
        assert_eq!(plant.guest_sends(BusIndex(0), 2, &frame(0x123, &[])), Ok(()));
        plant.advance_to(20_000);
        // While guest 1 is alone, its first 16 attempts take 57 bit times each, the later ones 65. The 22nd attempt
        // begins at 9960 us and ends at 10416 us. Then follow 45 bits, an intermission of 3 bits, and 48 bits.
        assert_eq!(arrived(&plant), [(10_776, 0x123, Some(2)), (11_184, 0x200, Some(1))]);
        let lines = lines(&plant);
        assert!(
            lines.contains("guest1 takes part\n") && lines.contains("guest2 takes part; the clock"),
            "{lines}"
        );
        assert!(lines.contains("16#123 from guest2"), "{lines}");
    }

    #[test]
    fn frames_of_a_leaving_guest_are_sent_if_another_station_receives_them() {
        let mut plant = plant(OPEN);
        plant.guest_joins(BusIndex(0), 1, false);
        plant.guest_joins(BusIndex(0), 2, false);
        (0..3).for_each(|id| assert_eq!(plant.guest_sends(BusIndex(0), 1, &frame(id, &[])), Ok(())));
        plant.guest_leaves(BusIndex(0), 1);
        plant.advance_to(10_000);
        assert_eq!(arrived(&plant).len(), 3);
        assert_eq!(plant.guest_sends(BusIndex(0), 1, &frame(5, &[])), Err(GuestRefusal::NotHere));
        // The frame of a single guest on the bus is not kept for guests that join later.
        assert_eq!(plant.guest_sends(BusIndex(0), 2, &frame(6, &[])), Ok(()));
        plant.guest_leaves(BusIndex(0), 2);
        plant.guest_joins(BusIndex(0), 1, false);
        plant.advance_to(20_000);
        assert_eq!(arrived(&plant).len(), 3);
    }

    #[test]
    fn a_controller_has_room_for_a_limited_number_of_frames() {
        let mut plant = plant(OPEN);
        plant.guest_joins(BusIndex(0), 1, false);
        let taken =
            (0..1000).take_while(|_| plant.guest_sends(BusIndex(0), 1, &frame(1, &[])).is_ok()).count();
        assert_eq!(taken, 64);
        assert_eq!(plant.guest_sends(BusIndex(0), 1, &frame(1, &[])), Err(GuestRefusal::Full));
        plant.guest_joins(BusIndex(0), 2, false);
        plant.advance_to(100_000);
        assert_eq!(arrived(&plant).len(), 64);
    }

    #[test]
    fn requests_make_a_guest_a_station_too() {
        let mut plant = plant(OPEN);
        plant.guest_joins(BusIndex(0), 7, false);
        assert_eq!(plant.guest_sends(BusIndex(0), 7, &frame(0x300, &[])), Ok(()));
        assert_eq!(plant.take_part(BusIndex(0), None), Ok(()));
        assert_eq!(plant.take_part(BusIndex(0), Some(&Frame::remote(StandardId::MAX, 0).unwrap())), Ok(()));
        plant.advance_to(10_000);
        let senders: Vec<_> = arrived(&plant).into_iter().map(|(_, id, guest)| (id, guest)).collect();
        assert_eq!(senders, [(0x300, Some(7)), (0x7FF, Some(0))]);
        assert_eq!(lines(&plant).matches("guest0 takes part").count(), 1);
        assert_eq!(plant.take_part(BusIndex(1), None), Err(GuestRefusal::NotHere), "there is no such bus");
    }

    #[test]
    fn guests_with_a_wrong_rate_or_format_are_reported() {
        let mut plant = plant(&OPEN.replace("kind = 'can'\n", ""));
        plant.report_rate_mismatch(BusIndex(0), 3, 6);
        plant.guest_joins(BusIndex(0), 1, false);
        // No master runs the bus.
        assert_eq!(plant.guest_sends(BusIndex(0), 1, &frame(1, &[])), Err(GuestRefusal::NotHere));
        let found: Vec<_> = plant.journal().findings().iter().map(|entry| entry.last).collect();
        assert_eq!(found, [Finding::at_bus(&rules::GUEST_BIT_RATE, BusIndex(0), 3, 6)]);
        assert_eq!(
            (
                found[0].name(plant.names().fitted(DeviceIndex(0))),
                found[0].address(plant.names().fitted(DeviceIndex(0)))
            ),
            (Some("guest3".into()), None)
        );
        assert!(lines(&plant).contains("error guest-bit-rate: guest3 16#00000006"), "{}", lines(&plant));
    }
}
