//! The master in the registers and the slave on a disturbed line. Each kind of fault of a PROFIBUS has a
//! test.

use super::*;
use crate::devices::can_dp2::registers::values::dp_state;
use crate::devices::profibus_bus::faults::KINDS;
use crate::devices::profibus_bus::records::{DpGarbled, DpTelegram};
use crate::fault::{Draft, Effect, Owner, Target};
use crate::journal::EventCodec;

const BUS: Target = Target::Bus(BusIndex(0));
const OUTPUTS: [u8; 2] = [0x12, 0x34];

impl Bench {
    /// Adds a fault of the PROFIBUS with these values of its fields, and a number of hits.
    pub(super) fn disturb(&mut self, name: &str, values: &[(&str, u64)], count: Option<u64>) {
        let kind = KINDS.iter().find(|kind| kind.name() == name).unwrap();
        let mut draft = Draft { count, ..Draft::new(kind, BUS) };
        for (value, field) in draft.values.iter_mut().zip(kind.fields()) {
            *value = values.iter().find(|(name, _)| *name == field.name()).map(|(_, value)| *value);
        }
        let fault = draft.check().unwrap();
        self.faults.add(self.now, fault, Owner::Bus(BusIndex(0)), &mut self.journal).unwrap();
        self.faults.advance(self.now, &mut self.journal);
    }

    /// Returns the number of records of a kind.
    fn count<T: EventCodec>(&self) -> usize {
        self.journal.records().filter(|record| record.event.is::<T>()).count()
    }

    /// Exchanges data once; returns the result and the number of telegrams.
    fn exchanged(&mut self) -> (u8, usize) {
        let before = self.count::<DpTelegram>();
        let (result, _) = self.ask(255, &OUTPUTS);
        (result, self.count::<DpTelegram>() - before)
    }
}

fn exchanging() -> Bench {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2));
    bench
}

#[test]
fn a_lost_request_is_repeated_by_the_master() {
    let mut bench = exchanging();
    bench.disturb("lose_telegram", &[("what", 0)], Some(1));
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2), "the lost telegram is not in the journal");
    assert!(bench.faults.is_empty());
}

#[test]
fn a_lost_answer_is_repeated_by_the_slave() {
    let mut bench = exchanging();
    bench.disturb("lose_telegram", &[("what", 1), ("station", 5)], Some(1));
    assert_eq!(bench.exchanged(), (mst_result::DATA, 3), "two requests, one answer");
    // Only telegrams to this service access point are lost.
    bench.disturb("lose_telegram", &[("what", 1), ("sap", 60)], None);
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2));
    assert_eq!(bench.ask(60, &[]).0, mst_result::NO_ANSWER);
}

#[test]
fn a_late_answer_comes_too_late_for_the_request() {
    let mut bench = exchanging();
    // The master waits for an answer for 300 bits and the time of 266 octets: 6.5 ms.
    bench.disturb("delay_telegram", &[("what", 1), ("delay_us", 2_000)], Some(1));
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2), "late, but in time");
    bench.disturb("delay_telegram", &[("what", 1), ("delay_us", 50_000)], Some(2));
    assert_eq!(bench.exchanged().0, mst_result::NO_ANSWER);
    let telegrams = bench.count::<DpTelegram>();
    bench.run(100 * MS);
    assert_eq!(bench.count::<DpTelegram>() - telegrams, 2, "both answers come");
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2));
}

#[test]
fn a_repeated_request_is_answered_alike() {
    let mut bench = exchanging();
    let before = bench.count::<DpTelegram>();
    bench.disturb("repeat_telegram", &[("what", 0), ("delay_us", 5_000)], Some(1));
    assert_eq!(bench.ask(255, &OUTPUTS).0, mst_result::DATA);
    bench.run(20 * MS);
    assert_eq!(bench.count::<DpTelegram>() - before, 4, "the slave repeats its answer");
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
}

#[test]
fn a_garbled_telegram_is_ignored_and_repeated() {
    for what in [0, 1] {
        let mut bench = exchanging();
        bench.disturb("garble_telegram", &[("what", what)], Some(1));
        let telegrams = bench.exchanged();
        assert_eq!((telegrams.0, bench.count::<DpGarbled>()), (mst_result::DATA, 1), "{what}");
        let record = bench.journal.records().find(|record| record.event.is::<DpGarbled>()).unwrap();
        let octets = record.octets.unwrap();
        assert_eq!((octets[0], octets.last()), (0x68, Some(&0x16)), "{octets:02X?}");
    }
}

/// Because of the frame count bit, the slave takes the request for a repetition. It repeats its previous
/// answer and ignores the outputs.
#[test]
fn outputs_with_a_wrong_frame_count_bit_are_not_taken() {
    let mut bench = exchanging();
    bench.disturb("wrong_frame_count", &[], Some(1));
    assert_eq!(bench.ask(255, &[0x56, 0x78]).0, mst_result::DATA);
    assert_eq!(bench.registers.outputs(2), OUTPUTS);
    assert!(bench.faults.is_empty());
    // The master has toggled its frame count bit, but the slave has not taken the request. So the frame count
    // bit of the next request equals that of the last request that the slave took.
    assert_eq!(bench.ask(255, &[0x9A, 0xBC]).0, mst_result::DATA);
    assert_eq!(bench.registers.outputs(2), OUTPUTS);
    assert_eq!(bench.ask(255, &[0xDE, 0xF0]).0, mst_result::DATA);
    assert_eq!(bench.registers.outputs(2), [0xDE, 0xF0]);
}

#[test]
fn a_silent_slave_is_not_there_and_its_master_counts_as_gone() {
    let mut bench = exchanging();
    bench.disturb("silent_station", &[("station", 5)], None);
    assert_eq!(bench.exchanged(), (mst_result::NO_ANSWER, 2), "two requests");
    bench.faults = Faults::default();
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2), "it has taken all requests");
    // The master itself does not send, so the slave receives nothing.
    bench.disturb("silent_station", &[("station", 1)], None);
    assert_eq!(bench.exchanged(), (mst_result::NO_ANSWER, 0));
}

#[test]
fn noise_destroys_what_is_on_the_line() {
    let mut bench = exchanging();
    bench.mst.mst_dsap.store(255);
    bench.mst.mst_control.store(mst_control::SEND);
    bench.run(CYCLE + 50);
    let effect = Effect::new(crate::devices::profibus_bus::faults::Effect::Noise(4));
    let now = bench.now;
    assert!(bench.buses[0].faults().unwrap().fire(now, BUS, &effect).is_some());
    for _ in 0..500 {
        bench.run(CYCLE);
    }
    assert_eq!(
        (bench.mst.mst_control.load(), bench.mst.mst_result.load()),
        (mst_control::DONE, mst_result::DATA)
    );
    assert_eq!(bench.count::<DpGarbled>(), 1, "the request; noise has no record");
    // Noise on an idle line delays a request.
    assert!(bench.buses[0].faults().unwrap().fire(bench.now, BUS, &effect).is_some());
    assert_eq!(bench.exchanged(), (mst_result::DATA, 2));
}
