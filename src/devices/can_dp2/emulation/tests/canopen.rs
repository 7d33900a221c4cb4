//! The start as CANopen master or slave, and SYNC (p. 28-30, 44, 87).

use super::*;
use crate::devices::can_dp2::registers::values::can_state;

/// Valid parameters with a wake-up time in s and a SYNC time in ms.
fn timed(flags_1: u8, wakeup: u8, sync: u16) -> Vec<u8> {
    let mut octets = prm(flags_1, 0);
    octets[13] = wakeup;
    octets[14..].copy_from_slice(&sync.to_be_bytes());
    octets
}

/// Returns a gateway that has exchanged data with outputs of 1 for `us` microseconds.
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
fn in_layer_2_canopen_settings_have_no_effect() {
    let mut bench = started(&timed(0x12, 5, 10), 100 * MS);
    assert_eq!(bench.heard(), ["203: 01 01"]);
}

#[test]
fn a_slave_waits_for_its_start_command() {
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

/// The window can change the SYNC time. The most recent change is valid (p. 30, 44).
#[test]
fn sync_times_by_the_window() {
    let mut bench = Bench::new(5);
    bench.ask(61, &timed(0x94, 0, 0));
    let cfg = [0x85, 0x8F, 0xFF, 0xEF, 0, 0, 20, 0x43, 0x8F, 0xFF, 0xEF, 0];
    bench.ask(62, &cfg);
    assert_eq!(bench.registers.stored.stored_sync_time.load(), 20);
    let mut order = [0; 16];
    bench.exchange(&order);
    bench.run(110 * MS);
    assert_eq!(bench.heard().len(), 5);
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

/// 8.2 p. 78: 16#0200 in octets 4 and 5 of command 20 means 512 ms, and 0 ends SYNC. Only a master sends SYNC
/// (p. 42).
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

/// The values 255 and 65535 keep the previous time, even if the supply was off in the meantime (p. 29-30).
#[test]
fn times_are_kept_without_supply() {
    let mut bench = started(&timed(0x04, 1, 30), 10 * MS);
    bench.power(Power::Off);
    bench.power(Power::On);
    bench.heard();
    bench.ask(61, &timed(0x14, 255, 0xFFFF));
    bench.ask(62, &CFG);
    bench.exchange(&[0, 0]);
    bench.run(900 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
    bench.run(200 * MS);
    let heard = bench.heard();
    assert_eq!(
        (heard.first().map(String::as_str), heard.get(1).map(String::as_str)),
        (Some("203: 00 00"), Some("80:"))
    );
}

/// Manual p. 29, table 5.1.2: a master sends remote frames after the wake-up time, and a slave sends them
/// after its start. Remote frames carry no outputs, so they do not wait for outputs. A DP master that only
/// clears outputs therefore also receives its inputs (D-675).
#[test]
fn inputs_are_asked_for_before_there_are_outputs() {
    for (flags, then) in
        [(0x04, &["289: remote 2"][..]), (0x06, &["0: 01 00", "289: remote 2"]), (0x14, &[]), (0x00, &[])]
    {
        let mut bench = Bench::new(5);
        bench.ask(61, &timed(flags, 1, 0));
        bench.ask(62, &CFG);
        bench.exchange(&[]);
        bench.run(900 * MS);
        assert_eq!(bench.heard(), Vec::<String>::new(), "flags 16#{flags:02X}");
        bench.run(200 * MS);
        assert_eq!(bench.heard(), then, "flags 16#{flags:02X}");
        bench.exchange(&[1, 1]);
        bench.run(10 * MS);
        assert_eq!(bench.heard(), ["203: 01 01"], "once: flags 16#{flags:02X}");
    }
}

/// Decision D-386: when data exchange ends, the waiting frames are dropped, also in the CAN controller. Only
/// a frame on the wire is sent to its end. So the gateway sends no output of a configuration after the end of
/// the configuration (p. 30; D-675).
#[test]
fn the_end_of_data_exchange_empties_the_can_controller() {
    let cfg: Vec<u8> = (0..30).flat_map(|id| [0x83, 7, 1, id, 0]).collect();
    for way in ["parameters", "configuration", "wrong configuration", "length"] {
        let mut bench = Bench::new(5);
        bench.commission(0, 0, &cfg);
        bench.exchange(&[0x55; 240]);
        match way {
            "parameters" => {
                bench.ask(61, &timed(0, 0, 0));
                bench.ask(62, &cfg);
            }
            "configuration" => drop(bench.ask(62, &cfg[..20])),
            "wrong configuration" => drop(bench.ask(62, &[0x83])),
            _ => drop(bench.ask(255, &[1])),
        }
        // The SDO request and its answer take some milliseconds. In this time the gateway sends some frames.
        let before = bench.heard().len();
        bench.run(100 * MS);
        let after = bench.heard();
        assert!(before + after.len() < 30 && after.len() <= 1, "{way}: {before}, then {after:?}");
    }
}

/// Manual p. 28: the parameters set the bit rate. Frames that no station has acknowledged at the previous
/// rate are not sent at the new rate (D-386).
#[test]
fn another_bit_rate_drops_frames_of_the_previous_one() {
    let mut bench = Bench::new(5);
    let mut octets = timed(0, 0, 0);
    octets[8] = 2;
    bench.ask(61, &octets);
    bench.ask(62, &CFG);
    for value in 1..=5 {
        bench.exchange(&[value, value]);
    }
    bench.run(10 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
    bench.ask(61, &timed(0, 0, 0));
    bench.ask(62, &CFG);
    bench.run(100 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
    bench.exchange(&[7, 7]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 07 07"]);
}

/// Manual p. 30, 44: the most recent setting of the SYNC time is valid. The comment of a configuration sets
/// the time even if this configuration is already in force (D-381, D-385).
#[test]
fn the_same_configuration_again_sets_its_sync_time() {
    let mut bench = Bench::new(5);
    bench.ask(61, &timed(0x94, 0, 0xFFFF));
    let cfg = [0x85, 0x8F, 0xFF, 0xEF, 0, 0, 20, 0x43, 0x8F, 0xFF, 0xEF, 0];
    bench.ask(62, &cfg);
    let mut order = [0; 16];
    (order[5], order[13], order[15]) = (50, 1, 20);
    bench.exchange(&order);
    assert_eq!(bench.registers.stored.stored_sync_time.load(), 50);
    bench.ask(62, &cfg);
    assert_eq!(bench.registers.stored.stored_sync_time.load(), 20);
    assert_eq!(bench.diag()[..2], [0, 4], "data exchange goes on");
    bench.heard();
    bench.run(201 * MS);
    assert_eq!(bench.heard(), ["80:"; 10]);
}

/// Manual p. 29, table 5.1.2: in layer 2 the gateway ignores wake-up and SYNC times from any source. So the
/// stored times do not change (D-720).
#[test]
fn in_layer_2_the_stored_times_are_unchanged() {
    let cfg = [0x85, 0x8F, 0xFF, 0xEF, 0, 0, 20, 0x43, 0x8F, 0xFF, 0xEF, 0];
    for (flags, then) in [(0x90, (3, 30)), (0x94, (9, 50)), (0x98, (9, 50))] {
        let mut bench = Bench::new(5);
        bench.registers.stored.stored_wakeup_time.store(3);
        bench.registers.stored.stored_sync_time.store(30);
        bench.ask(61, &timed(flags, 9, 7));
        bench.ask(62, &cfg);
        let mut order = [0; 16];
        (order[5], order[13], order[15]) = (50, 1, 20);
        bench.exchange(&order);
        let stored = &bench.registers.stored;
        let found = (stored.stored_wakeup_time.load(), stored.stored_sync_time.load());
        assert_eq!(found, then, "flags 16#{flags:02X}");
    }
}

/// Manual p. 29-30: 255 and 65535 mean the stored times and are not stored themselves. If a program writes
/// such a value into a register, the firmware replaces it by the stored time (D-370).
#[test]
fn values_for_stored_times_are_replaced_by_the_stored_times() {
    let mut bench = Bench::new(5);
    let times = |bench: &Bench| {
        let stored = &bench.registers.stored;
        (stored.stored_wakeup_time.load(), stored.stored_sync_time.load())
    };
    let write = |bench: &mut Bench, (wakeup, sync)| {
        bench.registers.stored.stored_wakeup_time.store(wakeup);
        bench.registers.stored.stored_sync_time.store(sync);
        bench.run(CYCLE);
    };
    write(&mut bench, (255, 0xFFFF));
    assert_eq!(times(&bench), (0, 0), "from the factory");
    write(&mut bench, (254, 0xFFFE));
    assert_eq!(times(&bench), (254, 0xFFFE));
    write(&mut bench, (255, 5));
    assert_eq!(times(&bench), (254, 5));
    write(&mut bench, (6, 0xFFFF));
    assert_eq!(times(&bench), (6, 5));
    bench.power(Power::Off);
    bench.power(Power::On);
    assert_eq!(times(&bench), (6, 5));
}

/// Manual p. 30: the gateway begins to send data as soon as it has data. Before the first outputs it sends
/// only the start frame, the boot-up message and remote frames (p. 28-29; D-675). So no drive receives a
/// control word of 0 while the parameters are sent.
#[test]
fn no_data_are_sent_before_the_first_outputs() {
    // The configuration: an output with a cycle of 20 ms, an output without a cycle, an input.
    let cfg = [0x85, 1, 2, 3, 0, 0, 20, 0x83, 0, 2, 4, 0, 0x43, 1, 2, 0x89, 0];
    let asked = "289: remote 2";
    for (flags, start) in [(0x04, &[asked][..]), (0x06, &["0: 01 00", asked]), (0x08, &["85:"]), (0x00, &[])]
    {
        let mut bench = Bench::new(5);
        for round in 0..2 {
            bench.ask(61, &timed(flags, 0, 10));
            bench.ask(62, &cfg);
            bench.run(100 * MS);
            assert_eq!(bench.heard(), start, "flags 16#{flags:02X}, round {round}");
            // Cleared outputs do not count as outputs, no matter which of the two ways cleared them (D-387).
            // A start without outputs sends no frames.
            bench.exchange(&[]);
            bench.ask(58, &[2, 0]);
            let at_start: &[&str] = if flags == 0x08 { &[asked] } else { &[] };
            if flags == 0x08 {
                bench.send(data(0, &[1, 5]));
            }
            bench.run(100 * MS);
            assert_eq!(bench.heard(), at_start, "flags 16#{flags:02X}, round {round}");
            bench.exchange(&[0, 7, 0]);
            bench.run(15 * MS);
            let heard = bench.heard();
            match flags {
                0x00 => assert_eq!(heard, ["203: 00 07"]),
                0x08 => assert_eq!(heard, ["203: 00 07", "204: 00"]),
                _ => assert_eq!(heard, ["203: 00 07", "204: 00", "80:"]),
            }
            bench.run(100 * MS);
            let heard = bench.heard();
            let count = |what: &str| heard.iter().filter(|frame| *frame == what).count();
            assert_eq!(count("203: 00 07"), 5, "every 20 ms: {heard:?}");
            assert_eq!(count("80:"), if flags & 0x04 == 0 { 0 } else { 10 }, "{heard:?}");
        }
        // If data exchange has not begun, a start sends no data, as if there were no outputs (D-386).
        bench.ask(61, &timed(flags, 0, 10));
        bench.send(data(0, &[1, 5]));
        bench.run(100 * MS);
        assert_eq!(bench.heard(), Vec::<String>::new(), "flags 16#{flags:02X}");
    }
}

/// Manual p. 30, 39, 44: the parameters, octets 4 and 5 of a window's comment, and command 20 all set the
/// SYNC time. The most recent setting is valid. 0 switches SYNC off. 16#FFFF keeps the stored time, even if
/// no time was stored (D-385).
#[test]
fn all_sources_of_a_sync_time_have_the_same_rule() {
    for stored in [0, 20] {
        for (time, then) in [(0, 0), (10, 10), (0xFFFE, 0xFFFE), (0xFFFF, stored)] {
            let [high, low] = u16::to_be_bytes(time);
            for way in ["parameters", "comment of the input", "comment of the output", "command 20"] {
                let mut bench = Bench::new(5);
                bench.registers.stored.stored_sync_time.store(stored);
                let (mut cfg, mut order) = (vec![], [0; 16]);
                let comment = |is_its: bool| if is_its { vec![high, low] } else { vec![] };
                for (head, is_its) in
                    [(0x43, way == "comment of the input"), (0x83, way == "comment of the output")]
                {
                    let octets = comment(is_its);
                    cfg.extend([head + octets.len() as u8, 0x8F, 0xFF, 0xEF, 0]);
                    cfg.extend(octets);
                }
                let of_parameters = if way == "parameters" { time } else { 0xFFFF };
                bench.ask(61, &timed(0x94, 0, of_parameters));
                bench.ask(62, &cfg);
                if way == "command 20" {
                    (order[4], order[5], order[13], order[15]) = (high, low, 1, 20);
                }
                bench.exchange(&order);
                let found = bench.registers.stored.stored_sync_time.load();
                assert_eq!(found, then, "16#{time:04X} by {way}, {stored} before");
                bench.heard();
                bench.run(202 * MS);
                let count = if then == 0 { 0 } else { 200 / usize::from(then) };
                assert_eq!(bench.heard(), vec!["80:"; count], "16#{time:04X} by {way}, {stored} before");
            }
        }
    }
}

/// Manual p. 44: a SYNC object waits until the frames of a DP telegram are sent. Even if they take longer
/// than the SYNC time, only one SYNC object waits (D-676).
#[test]
fn sync_objects_do_not_pile_up() {
    let cfg: Vec<u8> = (0..30).flat_map(|id| [0x83, 7, 1, id, 0]).collect();
    for sync in [1, 3] {
        let mut bench = Bench::new(5);
        bench.ask(61, &timed(0x14, 0, sync));
        bench.ask(62, &cfg);
        bench.exchange(&[0; 240]);
        bench.run(100 * MS);
        bench.heard();
        bench.exchange(&[0x55; 240]);
        bench.run(100 * MS);
        let heard = bench.heard_at();
        let of_outputs = |(_, text): &(u64, String)| text.contains("55 55");
        let (first, last) =
            (heard.iter().position(of_outputs).unwrap(), heard.iter().rposition(of_outputs).unwrap());
        assert_eq!(last - first + 1, 30, "no SYNC in between: {heard:?}");
        assert!(heard[last].0 - heard[first].0 > 25 * MS);
        let syncs: Vec<u64> = heard.iter().filter(|(_, text)| text == "80:").map(|(at, _)| *at).collect();
        let gaps: Vec<u64> = syncs.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let time = u64::from(sync) * MS;
        assert!(gaps.iter().all(|gap| *gap + MS / 2 >= time), "{gaps:?}");
        assert!(gaps.iter().filter(|gap| **gap > 2 * time).count() == 1, "{gaps:?}");
        assert!(syncs.len() > 60 / usize::from(sync), "SYNC continues: {syncs:?}");
    }
}
