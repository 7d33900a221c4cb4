//! The start as CANopen master or slave, and SYNC (p. 28-30, 44, 87).

use super::*;
use crate::devices::can_dp2::registers::values::can_state;

/// Good parameters with a wake-up time in s and a SYNC time in ms.
fn timed(flags_1: u8, wakeup: u8, sync: u16) -> Vec<u8> {
    let mut octets = prm(flags_1, 0);
    octets[13] = wakeup;
    octets[14..].copy_from_slice(&sync.to_be_bytes());
    octets
}

/// In data exchange with outputs of 1, after so long.
fn started(octets: &[u8], us: u64) -> Bench {
    let mut bench = Bench::new(5);
    assert_eq!(bench.ask(61, octets).0, mst_result::RECEIPT);
    bench.ask(62, &CFG);
    bench.exchange(&[1, 1]);
    bench.run(us);
    bench
}

#[test]
fn a_master_wakes_up() {
    for (flags, expected) in [
        (0x04, &["203: 01 01", "289: remote 2"][..]),
        (0x14, &["203: 01 01"]),
        (0x06, &["0: 01 00", "203: 01 01", "289: remote 2"]),
        (0x16, &["0: 01 00", "203: 01 01"]),
    ] {
        let mut bench = started(&timed(flags, 1, 0), 900 * MS);
        assert_eq!(bench.heard(), Vec::<String>::new(), "flags 16#{flags:02X}");
        bench.run(200 * MS);
        let heard = bench.heard_at();
        assert!(heard.iter().all(|(at, _)| (S..S + 10 * MS).contains(at)), "{heard:?}");
        assert_eq!(
            heard.into_iter().map(|(_, text)| text).collect::<Vec<_>>(),
            expected,
            "flags 16#{flags:02X}"
        );
    }
}

#[test]
fn in_layer_2_nothing_of_it_counts() {
    let mut bench = started(&timed(0x12, 5, 10), 100 * MS);
    assert_eq!(bench.heard(), ["203: 01 01"]);
}

#[test]
fn a_slave_waits_to_be_started() {
    let mut bench = started(&timed(0x08, 0, 10), 100 * MS);
    assert_eq!(
        (bench.heard(), bench.registers.can.can_state.load()),
        (vec!["85:".to_owned()], can_state::PRE_OPERATIONAL)
    );
    bench.send(data(0, &[1, 6]));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new(), "another node is started");
    bench.send(data(0, &[1, 5]));
    bench.run(100 * MS);
    assert_eq!(bench.heard(), ["203: 01 01", "289: remote 2"]);
    bench.send(data(0, &[0x80, 0]));
    bench.run(10 * MS);
    bench.exchange(&[2, 2]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new(), "Pre-Operational sends no outputs");
    bench.send(data(0, &[0x82, 5]));
    bench.run(10 * MS);
    bench.send(data(0, &[1, 0]));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["85:", "203: 02 02", "289: remote 2"]);
}

#[test]
fn a_master_sends_sync() {
    let mut bench = started(&timed(0x14, 0, 50), 10 * MS);
    bench.heard();
    bench.run(200 * MS);
    let heard = bench.heard_at();
    assert!(heard.len() == 4 && heard.iter().all(|(_, text)| text == "80:"), "{heard:?}");
    assert!(heard.windows(2).all(|pair| pair[1].0 - pair[0].0 == 50 * MS), "{heard:?}");
}

/// By the window the time can be set anew; the last one counts (p. 30, 44).
#[test]
fn sync_times_by_the_window() {
    let mut bench = Bench::new(5);
    bench.ask(61, &timed(0x94, 0, 0));
    let cfg = [0x85, 0x8F, 0xFF, 0xEF, 0, 0, 20, 0x43, 0x8F, 0xFF, 0xEF, 0];
    bench.ask(62, &cfg);
    assert_eq!(bench.registers.stored.stored_sync_time.load(), 20);
    bench.run(110 * MS);
    assert_eq!(bench.heard().len(), 5);
    let mut order = [0; 16];
    (order[4], order[5], order[13], order[15]) = (0, 128, 1, 20);
    bench.exchange(&order);
    bench.run(10 * MS);
    bench.heard();
    bench.run(256 * MS);
    assert_eq!(bench.heard(), ["80:", "80:"]);
    (order[5], order[13]) = (0, 2);
    bench.exchange(&order);
    bench.run(10 * MS);
    bench.heard();
    bench.run(200 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
}

/// 8.2 p. 78: 16#0200 in octets 4 and 5 of command 20 are 512 ms, 0 ends it; nobody but a master does it (p. 42).
#[test]
fn sync_of_the_example() {
    let cfg = [0x83, 0x8F, 0xFF, 0xEF, 0, 0x43, 0x8F, 0xFF, 0xEF, 0];
    for (flags, expected) in [(0x94, vec!["80:".to_owned(); 3]), (0x90, vec![]), (0x98, vec![])] {
        let mut bench = Bench::new(5);
        bench.ask(61, &timed(flags, 0, 0));
        bench.ask(62, &cfg);
        let mut order = [0; 16];
        (order[4], order[13], order[15]) = (2, 1, 20);
        bench.exchange(&order);
        bench.run(MS);
        bench.heard();
        bench.run(3 * 512 * MS);
        assert_eq!(bench.heard(), expected, "flags 16#{flags:02X}");
        (order[4], order[13]) = (0, 2);
        bench.exchange(&order);
        bench.run(MS);
        bench.heard();
        bench.run(S);
        assert_eq!(bench.heard(), Vec::<String>::new());
    }
}

/// 255 and 65535 take what was there before, after power-off too (p. 29-30).
#[test]
fn times_are_kept() {
    let mut bench = started(&timed(0x04, 1, 30), 10 * MS);
    bench.power(Power::Off);
    bench.power(Power::On);
    bench.heard();
    bench.ask(61, &timed(0x14, 255, 0xFFFF));
    bench.ask(62, &CFG);
    bench.run(900 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
    bench.run(200 * MS);
    let heard = bench.heard();
    assert_eq!(
        (heard.first().map(String::as_str), heard.get(1).map(String::as_str)),
        (Some("203: 00 00"), Some("80:"))
    );
}
