//! Process data objects: their times, and the settings of the program.

use super::*;

fn word(bench: &Bench, pdo: usize, word: usize) -> u16 {
    bench.registers.rx.a_RX_PDO[pdo][word].load()
}

/// Manual p. 42.
#[test]
fn pdos_are_sent_on_change_and_received_at_once() {
    let mut bench = Bench::operational("");
    bench.run(100 * MS);
    assert_eq!(bench.heard(), [], "nothing has changed");
    bench.registers.tx.a_TX_PDO[0][0].store(0x1234);
    bench.registers.tx.a_TX_PDO[2][3].store(0x00FF);
    bench.run(100 * MS);
    let sent = [(0x1A0, vec![0x34, 0x12, 0, 0, 0, 0, 0, 0]), (0x38A, vec![0, 0, 0, 0, 0, 0, 0xFF, 0])];
    assert_eq!(bench.heard(), sent);
    bench.exchange(0x220, &[0x34, 0x12, 0x78, 0x56, 1, 0, 2, 0]);
    bench.exchange(0x387, &[9, 0]);
    let words = [word(&bench, 0, 0), word(&bench, 0, 1), word(&bench, 0, 3), word(&bench, 7, 0)];
    assert_eq!(words, [0x1234, 0x5678, 2, 9]);
    bench.exchange(0x220, &[1]);
    assert_eq!(word(&bench, 0, 0), 0x1201, "words that a short frame does not contain are unchanged");
}

#[test]
fn pdos_are_exchanged_in_operational_only() {
    let mut bench = Bench::running("");
    bench.registers.tx.a_TX_PDO[0][0].store(1);
    bench.exchange(0x220, &[1; 8]);
    bench.run(50 * MS);
    assert_eq!((bench.heard(), word(&bench, 0, 0)), (vec![], 0));
    bench.exchange(0, &[1, 0]);
    bench.run(50 * MS);
    assert_eq!(bench.heard(), [], "the value at the start is not new (D-423)");
}

/// Manual p. 47-50.
#[test]
fn synchronous_pdos_wait_for_their_sync() {
    let mut bench = Bench::operational(
        "pdo_tx = [{ pdo = 1, trans_type = 1 }, { pdo = 2, trans_type = 5 }], \
         pdo_rx = [{ pdo = 1, trans_type = 1 }]",
    );
    bench.exchange(0x220, &[7, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(word(&bench, 0, 0), 0);
    let sent: Vec<Vec<u16>> =
        (0..10).map(|_| bench.exchange(0x80, &[]).into_iter().map(|(id, _)| id).collect()).collect();
    assert_eq!(word(&bench, 0, 0), 7);
    for (turn, sent) in (1..).zip(sent) {
        let expected: &[u16] = if turn % 5 == 0 { &[0x1A0, 0x2A0] } else { &[0x1A0] };
        assert_eq!(sent, expected, "{turn}");
    }
}

/// Manual p. 46.
#[test]
fn a_sync_is_seen_for_one_cycle() {
    let mut bench = Bench::operational("");
    bench.send(0x80, &[]);
    let mut seen = Vec::new();
    for _ in 0..60 {
        bench.run(MS);
        seen.push(bench.registers.flags.COP_SYNC.load());
    }
    let first = seen.iter().position(|flag| *flag == 1).unwrap();
    let expected: Vec<u8> = (0..60).map(|at| u8::from((first..first + 10).contains(&at))).collect();
    assert_eq!(seen, expected, "a cycle has 10 ms");
}

/// Manual p. 42, 47.
#[test]
fn the_inhibit_time_is_kept() {
    let mut bench = Bench::operational("pdo_tx = [{ pdo = 1, id = 0x390, inhibit_ms = 100 }]");
    for value in 1..=50 {
        bench.registers.tx.a_TX_PDO[0][0].store(value);
        bench.run(10 * MS);
    }
    let times: Vec<_> = bench.heard_when().into_iter().map(|(at, id, _)| (at, id)).collect();
    assert!((5..=6).contains(&times.len()), "{times:?}");
    assert!(times.iter().all(|(_, id)| *id == 0x390), "{times:?}");
    // The times agree to the microsecond, except for the duration of stuff bits.
    assert!(times.windows(2).all(|two| two[1].0 - two[0].0 + 200 >= 100 * MS), "{times:?}");
    bench.run(200 * MS);
    let last = bench.heard();
    assert_eq!(last.last(), Some(&(0x390, vec![50, 0, 0, 0, 0, 0, 0, 0])), "the last value goes, too");
}

/// Manual p. 48, 155: a reset of the communication keeps the program's settings, but not settings that were
/// made by SDO.
#[test]
fn settings_of_the_program_outlive_a_reset() {
    let mut bench = Bench::operational("boot_up = '700', pdo_rx = [{ pdo = 3, id = 0x3A0 }]");
    // 1400h sub 1, 3A1h.
    bench.exchange(0x620, &[0x23, 0x00, 0x14, 1, 0xA1, 3, 0, 0]);
    bench.exchange(0x3A1, &[5; 8]);
    bench.exchange(0x3A0, &[6; 8]);
    assert_eq!((word(&bench, 0, 0), word(&bench, 2, 0)), (0x0505, 0x0606));
    bench.exchange(0, &[130, 0]);
    bench.exchange(0, &[1, 0]);
    bench.exchange(0x3A1, &[7; 8]);
    bench.exchange(0x220, &[8; 8]);
    bench.exchange(0x3A0, &[9; 8]);
    assert_eq!((word(&bench, 0, 0), word(&bench, 2, 0)), (0x0808, 0x0909));
}

/// The start has two stages (p. 155): first CANopen starts, then the configuration of the PDOs restarts it.
#[test]
fn a_program_with_pdo_settings_starts_in_two_stages() {
    let boots = |keys: &str| {
        let mut bench = Bench::new(keys);
        bench.run(300 * MS);
        bench.heard().len()
    };
    assert_eq!(boots("boot_up = '700'"), 1);
    assert_eq!(boots("boot_up = '700', pdo_rx = [{ pdo = 3, id = 0x3A0 }]"), 2);
}

#[test]
fn a_pdo_is_sent_on_request() {
    let mut bench = Bench::operational("");
    bench.registers.tx.a_TX_PDO[1][0].store(3);
    bench.run(20 * MS);
    bench.heard();
    bench.ask(0x2A0);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x2A0, vec![3, 0, 0, 0, 0, 0, 0, 0])]);
    // Bit 30 is set, so the PDO is not sent on request.
    bench.exchange(0x620, &[0x23, 0x01, 0x18, 1, 0xA0, 2, 0, 0x40]);
    bench.ask(0x2A0);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), []);
}

/// Decision D-419: bit 31 of a COB-ID.
#[test]
fn an_invalid_pdo_is_neither_sent_nor_received() {
    let mut bench = Bench::operational("");
    for (index, id) in [(0x14, 0x220_u16), (0x18, 0x1A0)] {
        let [low, high] = id.to_le_bytes();
        bench.exchange(0x620, &[0x23, 0x00, index, 1, low, high, 0, 0x80]);
    }
    bench.registers.tx.a_TX_PDO[0][0].store(3);
    bench.exchange(0x220, &[1; 8]);
    bench.run(30 * MS);
    assert_eq!((bench.heard(), word(&bench, 0, 0)), (vec![], 0));
}
