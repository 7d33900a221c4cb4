//! Tests a PROFIBUS segment without ports: the time for which the line is busy, and requests that a snapshot
//! restores.

use super::*;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::profibus::Frame;

fn bus() -> ProfibusBus {
    let config =
        ProfibusConfig { name: "dp".to_owned(), rate: BusRate::ALL[6], slot_factor: 1, doors: Vec::new() };
    ProfibusBus::new(BusIndex(0), &config)
}

/// At 500 kbit/s a bit takes 2 us, and an octet has 11 bits.
#[test]
fn the_line_is_busy_for_as_long_as_the_octets_take() {
    let (bus, sender) = (bus(), Origin { plc: DeviceIndex(0), node: PortNumber(1) });
    assert_eq!(bus.bit_s(), 500_000);
    let busy = |telegram: &Telegram| {
        let event = match (short(BusIndex(0), sender, telegram), telegram) {
            (Some(short), _) => short.into(),
            (None, Telegram::Frame(frame)) => DpTelegram::new(BusIndex(0), sender, frame).into(),
            (None, _) => unreachable!("only frames are long"),
        };
        assert_eq!(bus.busy_ns(&event) % 22_000, 0);
        bus.busy_ns(&event) / 22_000
    };
    assert_eq!((busy(&Telegram::ShortAck), busy(&Telegram::Token { da: 2, sa: 3 })), (1, 3));
    for length in [0, 1, 5, 200] {
        let frame = Frame { da: 5, sa: 2, fc: 0x6D, dsap: None, ssap: None, data: vec![7; length] };
        let telegram = Telegram::Frame(frame);
        assert_eq!(busy(&telegram), telegram.octets().unwrap().len() as u64, "{length} octets of data");
    }
}

/// A snapshot contains a request that waits for its answer. If the sender of the request has no port, the
/// snapshot is damaged.
#[test]
fn a_snapshot_that_waits_for_a_missing_sender_is_refused() {
    for sender in [0, 1, 200] {
        let mut bus = bus();
        bus.asked = Some(PendingAnswer { sender, until: 100 });
        let mut saved = Saving::default();
        bus.save(&mut saved);
        assert!(bus.restore(&mut Saved::new(saved.bytes())).is_err(), "{sender}");
    }
    assert_eq!(bus().apart_until(), 0, "it asks for others in each of its events");
}
