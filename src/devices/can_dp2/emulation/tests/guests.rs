//! Foreign masters on the PROFIBUS segment.

use super::*;
use crate::devices::GuestRefusal;
use crate::devices::can_dp2::registers::values::dp_state;
use crate::door::{BusMessage, Guest};
use crate::identity::BusIndex;
use crate::profibus::{Burst, MIN_TSDR_BITS, SYN_BITS, Telegram};

/// Returns the number of bits that pass in `us` microseconds on the PROFIBUS segment of the bench.
const fn bits(us: u64) -> u64 {
    us / 2
}

/// A foreign master that sends octets through a door.
struct Foreign {
    number: u8,
    address: u8,
    receiver: Arc<Guest>,
    fcb: Option<bool>,
}

impl Foreign {
    /// Joins the bus as the guest with this number. The number is also the guest's address.
    fn come(bench: &mut Bench, number: u8) -> Self {
        let receiver = Guest::of_a_test(BusIndex(0), number);
        assert!(bench.buses[0].guests().unwrap().guest_joins(number, bench.now));
        bench.buses[0].guests().unwrap().guest_hears(number, Some(receiver.clone()));
        Foreign { number, address: number, receiver, fcb: None }
    }

    fn send(&self, bench: &mut Bench, begin: u64, octets: &[u8]) {
        let message = BusMessage::Burst(Burst { begin, octets: octets.to_vec() });
        let now = bench.now;
        assert_eq!(
            bench.buses[0].guests().unwrap().guest_sends(self.number, &message, now, &mut bench.journal),
            Ok(())
        );
    }

    fn hear(&self) -> Option<Burst> {
        match self.receiver.hears()? {
            BusMessage::Burst(burst) => Some(burst),
            BusMessage::Frame(frame) => panic!("{frame:?}"),
        }
    }

    /// Returns a request to the gateway, which has address 5.
    fn request(&mut self, dsap: Option<u8>, data: &[u8]) -> Vec<u8> {
        let (fcb, fcv) = (self.fcb.is_none_or(|last| !last), self.fcb.is_some());
        self.fcb = Some(fcb);
        let fc = 0x4D | u8::from(fcb) << 5 | u8::from(fcv) << 4;
        let ssap = dsap.map(|_| 62);
        let frame = crate::profibus::Frame { da: 5, sa: self.address, fc, dsap, ssap, data: data.to_vec() };
        Telegram::Frame(frame).octets().unwrap()
    }

    /// Sends a request; returns the answer.
    fn ask(&mut self, bench: &mut Bench, dsap: u8, data: &[u8]) -> Telegram {
        while self.hear().is_some() {}
        let octets = self.request((dsap != 255).then_some(dsap), data);
        self.send(bench, 0, &octets);
        for _ in 0..1000 {
            bench.run(CYCLE);
            if let Some(burst) = self.hear() {
                return Telegram::parse(&burst.octets).unwrap();
            }
        }
        panic!("no answer to {dsap}");
    }

    fn data(&mut self, bench: &mut Bench, dsap: u8) -> Vec<u8> {
        match self.ask(bench, dsap, &[]) {
            Telegram::Frame(frame) => frame.data,
            other => panic!("{other:?}"),
        }
    }

    /// Brings the gateway into data exchange, with a watchdog of 100 ms.
    fn commission(&mut self, bench: &mut Bench) {
        let status = [0x10, 5, self.address, 0x49, 5u8.wrapping_add(self.address).wrapping_add(0x49), 0x16];
        // The slave uses the first telegram only to detect the bit rate.
        self.send(bench, 0, &status);
        bench.run(MS);
        let mut prm = prm(0, 0);
        (prm[0], prm[1], prm[2]) = (0x88, 10, 1);
        assert_eq!(self.ask(bench, 61, &prm), Telegram::ShortAck);
        assert_eq!(self.ask(bench, 62, &CFG), Telegram::ShortAck);
    }
}

#[test]
fn a_foreign_master_commands_the_slave() {
    let mut bench = Bench::new(5);
    let mut master = Foreign::come(&mut bench, 2);
    master.commission(&mut bench);
    assert_eq!(master.data(&mut bench, 60), [0x00, 0x0C, 0, 2, 0x04, 0xA4]);
    let Telegram::Frame(inputs) = master.ask(&mut bench, 255, &[0x12, 0x34]) else { panic!() };
    assert_eq!((inputs.fc, inputs.data), (0x08, vec![0, 0]));
    bench.run(5 * MS);
    assert_eq!(bench.heard(), ["203: 12 34"]);
}

/// In data exchange the slave answers read requests of every master. It still belongs to its own master.
#[test]
fn a_second_master_reads_inputs_outputs_and_configuration() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.send(data(0x289, &[0xAB, 0xCD]));
    bench.run(5 * MS);
    bench.exchange(&[0x12, 0x34]);
    let mut second = Foreign::come(&mut bench, 9);
    assert_eq!(second.data(&mut bench, 56), [0xAB, 0xCD], "RD_Inp");
    assert_eq!(second.data(&mut bench, 57), [0x12, 0x34], "RD_Outp");
    assert_eq!(second.data(&mut bench, 59), CFG, "Get_Cfg");
    assert_eq!(second.data(&mut bench, 60)[..4], [0x80, 4, 0, 1], "the slave is locked by master 1");
    assert_eq!(bench.exchange(&[0x12, 0x35]), [0xAB, 0xCD]);
    // Outside data exchange inputs cannot be read.
    let mut bench = Bench::new(5);
    let mut second = Foreign::come(&mut bench, 9);
    bench.diag();
    for dsap in [56, 57] {
        let Telegram::Frame(refusal) = second.ask(&mut bench, dsap, &[]) else { panic!() };
        assert_eq!((refusal.fc, refusal.data), (3, vec![]));
    }
    assert!(second.data(&mut bench, 59).is_empty());
}

#[test]
fn a_telegram_with_a_time_begins_at_that_bit() {
    let mut bench = Bench::new(5);
    let mut master = Foreign::come(&mut bench, 2);
    master.commission(&mut bench);
    let (listener, begin) = (Foreign::come(&mut bench, 3), bits(bench.now) + 1003);
    let octets = master.request(Some(60), &[]);
    master.send(&mut bench, begin, &octets);
    bench.run(5 * MS);
    let end = begin + Telegram::bits(octets.len());
    assert_eq!(listener.hear(), Some(Burst { begin, octets }));
    let answer = master.hear().unwrap();
    assert_eq!((answer.begin, Some(&answer)), (end + MIN_TSDR_BITS, listener.hear().as_ref()));
    assert_eq!((master.hear(), listener.hear()), (None, None), "a guest does not hear its own telegrams");
    // A telegram with a time in the past begins now.
    master.send(&mut bench, 1, &[0xDC, 2, 2]);
    let now = bits(bench.now);
    bench.run(MS);
    assert_eq!(listener.hear(), Some(Burst { begin: now, octets: vec![0xDC, 2, 2] }));
}

#[test]
fn a_telegram_without_a_time_waits_for_an_idle_line() {
    let mut bench = Bench::new(5);
    let (one, other, listener) =
        (Foreign::come(&mut bench, 2), Foreign::come(&mut bench, 3), Foreign::come(&mut bench, 4));
    one.send(&mut bench, 10, &[0xDC, 2, 2]);
    other.send(&mut bench, 0, &[0xDC, 3, 3]);
    one.send(&mut bench, 0, &[0xE5]);
    bench.run(MS);
    let heard: Vec<_> = core::iter::from_fn(|| listener.hear()).collect();
    // After the first telegram, the minimum pause before an answer is shorter than before a request or a
    // token.
    let (second, third) = (10 + 33 + MIN_TSDR_BITS, 10 + 33 + MIN_TSDR_BITS + 11 + SYN_BITS);
    assert_eq!(
        heard,
        [
            Burst { begin: 10, octets: vec![0xDC, 2, 2] },
            Burst { begin: second, octets: vec![0xE5] },
            Burst { begin: third, octets: vec![0xDC, 3, 3] },
        ]
    );
}

#[test]
fn collisions_are_not_passed_to_guests() {
    let mut bench = Bench::new(5);
    let (one, other, listener) =
        (Foreign::come(&mut bench, 2), Foreign::come(&mut bench, 3), Foreign::come(&mut bench, 4));
    one.send(&mut bench, 100, &[0xDC, 2, 2]);
    other.send(&mut bench, 110, &[0xDC, 3, 3]);
    bench.run(MS);
    assert_eq!((one.hear(), other.hear(), listener.hear()), (None, None, None));
    // Octets that are not a telegram are sent unchanged. The stations ignore them.
    one.send(&mut bench, 0, &[0x10, 5, 2, 0x49, 0, 0x16]);
    bench.run(MS);
    assert_eq!(listener.hear().unwrap().octets, [0x10, 5, 2, 0x49, 0, 0x16]);
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::BAUD_SEARCH);
}

/// From a request until the end of its slot, no other station sends a request.
#[test]
fn the_line_is_reserved_for_an_answer() {
    for (factor, slot_bits) in [(1, 200), (50, 10_000)] {
        let mut bench = Bench::with_segment(5, &format!("kbit_s = 500, slot_factor = {factor}"));
        let (one, other) = (Foreign::come(&mut bench, 2), Foreign::come(&mut bench, 3));
        // No station has address 9.
        let request = [0x10, 9, 2, 0x49, 0x54, 0x16];
        one.send(&mut bench, 100, &request);
        bench.run(MS / 2);
        other.send(&mut bench, 0, &[0xDC, 3, 3]);
        bench.run(100 * MS);
        let asked_until = 100 + Telegram::bits(request.len()) + slot_bits;
        assert_eq!(one.hear().unwrap().begin, asked_until.max(bits(MS / 2)), "factor {factor}");
    }
}

/// The line is reserved for an answer, so an answer never waits for the end of the slot. This is true for a
/// receipt, and for the status of a slave, of a master that wants to enter a ring, and of a master in the
/// ring (D-358).
#[test]
fn an_answer_does_not_wait_for_the_end_of_its_slot() {
    let status = |fc: u8| vec![0x10, 2, 9, fc, fc.wrapping_add(11), 0x16];
    // At factor 20 the slot ends after 8 ms.
    for (factor, after) in [(1, 0), (20, 0), (200, 0), (20, 4 * MS), (200, 70 * MS)] {
        for answer in [vec![0xE5], status(0x00), status(0x20), status(0x30)] {
            let mut bench = Bench::with_segment(5, &format!("kbit_s = 500, slot_factor = {factor}"));
            let [one, other, slave] = [2, 3, 9].map(|number| Foreign::come(&mut bench, number));
            one.send(&mut bench, 100, &[0x10, 9, 2, 0x49, 0x54, 0x16]);
            bench.run(MS / 4 + after);
            other.send(&mut bench, 0, &[0xDC, 3, 3]);
            slave.send(&mut bench, 0, &answer);
            bench.run(100 * MS);
            let begin = (100 + Telegram::bits(6) + MIN_TSDR_BITS).max(bits(MS / 4 + after));
            let token = begin + Telegram::bits(answer.len()) + SYN_BITS;
            let heard: Vec<Burst> = core::iter::from_fn(|| one.hear()).collect();
            let expected =
                [Burst { begin, octets: answer.clone() }, Burst { begin: token, octets: vec![0xDC, 3, 3] }];
            assert_eq!(heard, expected, "factor {factor}, {after} us");
        }
    }
}

/// The line must be idle for 33 bits (T_SYN) before a request, and for 11 bits before an answer. If a guest's
/// telegram has an earlier bit time, this is reported.
#[test]
fn a_telegram_that_begins_too_soon_is_reported() {
    use crate::check::rules::GUEST_EARLY;
    for (pause, octets, is_early) in [
        (11, &[0x10, 5, 2, 0x49, 0x50, 0x16][..], true),
        (32, &[0xDC, 2, 2], true),
        (33, &[0x10, 5, 2, 0x49, 0x50, 0x16], false),
        (33, &[0xDC, 2, 2], false),
        (10, &[0xE5], true),
        (11, &[0xE5], false),
        (11, &[0x10, 2, 9, 0, 11, 0x16], false),
    ] {
        let mut bench = Bench::new(5);
        let master = Foreign::come(&mut bench, 2);
        let end = 100 + Telegram::bits(3);
        master.send(&mut bench, 100, &[0xDC, 2, 2]);
        master.send(&mut bench, end + pause, octets);
        bench.run(5 * MS);
        let found: Vec<_> = bench.journal.findings().iter().map(|it| (it.last.rule, it.last.value)).collect();
        let expected = if is_early { vec![(&GUEST_EARLY, pause as u32)] } else { vec![] };
        assert_eq!(found, expected, "{octets:02X?} after {pause} bits");
    }
}

/// A telegram for a distant bit time would delay all later telegrams of the guest (D-677).
#[test]
fn a_telegram_for_a_distant_time_is_refused() {
    use crate::check::rules::GUEST_TIME;
    let mut bench = Bench::new(5);
    let (master, listener) = (Foreign::come(&mut bench, 2), Foreign::come(&mut bench, 3));
    let message = |begin| BusMessage::Burst(Burst { begin, octets: vec![0xDC, 2, 2] });
    let most = 60 * 500_000;
    for (begin, seconds) in
        [(u64::MAX, u32::MAX), (1 << 62, u32::MAX), (most + bits(bench.now) + 500_001, 61)]
    {
        let refused =
            bench.buses[0].guests().unwrap().guest_sends(2, &message(begin), bench.now, &mut bench.journal);
        assert!(matches!(refused, Err(GuestRefusal::TooFarAhead { .. })), "{refused:?}");
        let last = bench.journal.findings().iter().last().map(|it| (it.last.rule, it.last.value));
        assert_eq!(last, Some((&GUEST_TIME, seconds)));
    }
    master.send(&mut bench, 0, &[0xDC, 2, 2]);
    bench.run(MS);
    assert!(listener.hear().is_some(), "later telegrams are sent");
    master.send(&mut bench, most, &[0xDC, 2, 2]);
}

/// A DP slave has the services SRD and SDN. It refuses SDA with a code and without data. It ignores a request
/// with a reserved bit (D-679).
#[test]
fn unsupported_services_get_no_data() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    let master = Foreign::come(&mut bench, 2);
    for sap in [None, Some(60), Some(56), Some(61)] {
        for fc in [0x43, 0x45, 0x63, 0x75] {
            while master.hear().is_some() {}
            let frame = |fc| crate::profibus::Frame {
                da: 5,
                sa: 2,
                fc,
                dsap: sap,
                ssap: sap.map(|_| 62),
                data: vec![0; 2],
            };
            let octets = Telegram::Frame(frame(fc)).octets().unwrap();
            master.send(&mut bench, 0, &octets);
            bench.run(5 * MS);
            let answer = Telegram::parse(&master.hear().unwrap().octets);
            let Ok(Telegram::Frame(refusal)) = answer else { panic!("{answer:?}") };
            assert_eq!((refusal.fc, refusal.data), (0x03, vec![]), "SDA 16#{fc:02X} to {sap:?}");
            for reserved in [fc | 0x80, 0xED, 0xCC] {
                let octets = Telegram::Frame(frame(reserved)).octets().unwrap();
                master.send(&mut bench, 0, &octets);
                bench.run(5 * MS);
                assert_eq!(master.hear(), None, "16#{reserved:02X}");
            }
        }
    }
    assert_eq!(bench.exchange(&[1, 2]), [0, 0]);
}

/// When the master has disconnected, the watchdog of the slave runs out.
#[test]
fn the_watchdog_stops_a_slave_without_its_master() {
    let mut bench = Bench::new(5);
    let mut master = Foreign::come(&mut bench, 2);
    master.commission(&mut bench);
    master.ask(&mut bench, 255, &[1, 2]);
    let (now, request) = (bench.now, master.request(None, &[3, 4]));
    master.send(&mut bench, 0, &request);
    master.send(&mut bench, bits(now + 50 * MS), &[0xDC, 2, 2]);
    bench.buses[0].guests().unwrap().guest_leaves(2, now);
    let message = BusMessage::Burst(Burst { begin: 0, octets: vec![0xE5] });
    let refusal = bench.buses[0].guests().unwrap().guest_sends(2, &message, now, &mut bench.journal);
    assert_eq!(refusal, Err(GuestRefusal::NotHere));
    bench.run(60 * MS);
    assert_eq!(bench.registers.outputs(2), [3, 4], "earlier telegrams are still sent");
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
    bench.run(60 * MS);
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::BAUD_SEARCH);
    assert_eq!(bench.registers.outputs(2), [0, 0]);
    assert_eq!(master.hear(), None, "the guest has left");
}

/// A master passes the token to itself or to another master. Slaves receive the token and ignore it.
#[test]
fn slaves_ignore_tokens() {
    let mut bench = Bench::new(5);
    let (mut one, mut other) = (Foreign::come(&mut bench, 2), Foreign::come(&mut bench, 3));
    one.send(&mut bench, 0, &[0xDC, 2, 2]);
    bench.run(MS);
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::BAUD_CONTROL, "a token gives the rate, too");
    assert!(other.hear().is_some());
    one.commission(&mut bench);
    while other.hear().is_some() {}
    for round in 0..20u8 {
        assert!(matches!(one.ask(&mut bench, 255, &[round, 0]), Telegram::Frame(_)));
        one.send(&mut bench, 0, &[0xDC, 3, 2]);
        bench.run(MS);
        let heard: Vec<_> = core::iter::from_fn(|| other.hear()).map(|burst| burst.octets).collect();
        assert_eq!(heard.last().unwrap(), &[0xDC, 3, 2]);
        assert_eq!(other.data(&mut bench, 57), [round, 0]);
        other.send(&mut bench, 0, &[0xDC, 2, 3]);
        bench.run(MS);
        let heard: Vec<_> = core::iter::from_fn(|| one.hear()).map(|burst| burst.octets).collect();
        assert_eq!(heard.last().unwrap(), &[0xDC, 2, 3]);
    }
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
}

#[test]
fn a_guest_sends_octets_only_and_its_queue_is_limited() {
    let mut bench = Bench::new(5);
    let guest = Foreign::come(&mut bench, 2);
    let (journal, bus) = (&mut bench.journal, &mut bench.buses[0]);
    assert_eq!(
        bus.guests().unwrap().guest_sends(2, &BusMessage::Frame(data(1, &[])), 0, journal),
        Err(GuestRefusal::NotHere)
    );
    let message = BusMessage::Burst(Burst { begin: 0, octets: vec![0xE5] });
    let taken =
        (0..1000).take_while(|_| bus.guests().unwrap().guest_sends(2, &message, 0, journal).is_ok()).count();
    assert_eq!(
        (taken, bus.guests().unwrap().guest_sends(2, &message, 0, journal)),
        (64, Err(GuestRefusal::Full))
    );
    bench.run(10 * MS);
    guest.send(&mut bench, 0, &[0xE5]);
}
