//! Guarding, supervision of SYNC, emergencies.

use super::*;

/// Returns a node with a guard time of 100 ms and a life time factor of 3.
fn guarded() -> Bench {
    let mut bench = Bench::running("");
    bench.exchange(0x620, &[0x2B, 0x0C, 0x10, 0, 100, 0, 0, 0]);
    bench.exchange(0x620, &[0x2F, 0x0D, 0x10, 0, 3, 0, 0, 0]);
    bench
}

fn guard(bench: &mut Bench) -> Vec<(u16, Vec<u8>)> {
    bench.ask(0x720);
    bench.run(5 * MS);
    bench.heard()
}

/// Manual p. 42-44.
#[test]
fn a_node_that_was_guarded_once_reports_a_missing_master() {
    let mut bench = guarded();
    bench.run(1000 * MS);
    assert_eq!((bench.heard(), bench.registers.flags.COP_GUARDFAIL_ERROR.load()), (vec![], 0));
    assert_eq!(guard(&mut bench), [(0x720, vec![0x7F])]);
    bench.run(200 * MS);
    assert_eq!(guard(&mut bench), [(0x720, vec![0xFF])]);
    bench.run(280 * MS);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 0);
    bench.run(20 * MS);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 1);
    assert_eq!(bench.heard(), [(0xA0, vec![0x00, 0x81, 0x10, 0, 0, 0, 0, 0])]);
    assert_eq!(bench.exchange(0x620, &[0x40, 0x01, 0x10, 0, 0, 0, 0, 0])[0].1[4], 0x10);
    bench.run(1000 * MS);
    assert_eq!(bench.heard(), [], "reported once");
    let heard = guard(&mut bench);
    assert_eq!(heard, [(0x720, vec![0x7F]), (0xA0, vec![0; 8])]);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 1, "the program resets it (p. 19)");
}

/// Manual p. 46: the settings of `NMS_GUARDING_CONFIG` are stored.
#[test]
fn a_program_sets_the_supervision_of_its_master() {
    let keys = "guarding = { guard_time_ms = 100, life_time = 3, cycle_period_ms = 50 }";
    let mut bench = Bench::running(keys);
    let parameters = &bench.registers.parameters;
    let set = (parameters.w_GUARD_TIME.load(), parameters.d_COMMUNICATION_CYCLE.load());
    assert_eq!(set, (100, 50_000));
    guard(&mut bench);
    bench.run(300 * MS);
    let fails = |bench: &Bench| {
        (bench.registers.flags.COP_GUARDFAIL_ERROR.load(), bench.registers.flags.COP_SYNCFAIL_ERROR.load())
    };
    assert_eq!(fails(&bench), (1, 0));
    bench.exchange(0, &[1, 0]);
    bench.run(50 * MS);
    assert_eq!(fails(&bench), (1, 1));
}

#[test]
fn without_a_guard_time_no_master_is_missed() {
    let mut bench = Bench::running("");
    guard(&mut bench);
    bench.run(10_000 * MS);
    assert_eq!((bench.heard(), bench.registers.flags.COP_GUARDFAIL_ERROR.load()), (vec![], 0));
}

#[test]
fn a_reset_of_the_communication_restarts_the_toggle_bit() {
    let mut bench = guarded();
    guard(&mut bench);
    bench.exchange(0, &[130, 0]);
    assert_eq!(guard(&mut bench), [(0x720, vec![0x7F])]);
    assert_eq!(guard(&mut bench), [(0x720, vec![0xFF])]);
}

/// Manual p. 44, 46.
#[test]
fn a_missing_sync_is_reported() {
    let mut bench = Bench::running("");
    // 200 ms.
    bench.exchange(0x620, &[0x23, 0x06, 0x10, 0, 0x40, 0x0D, 3, 0]);
    bench.run(1000 * MS);
    assert_eq!(bench.registers.flags.COP_SYNCFAIL_ERROR.load(), 0, "D-422");
    bench.exchange(0, &[1, 0]);
    for _ in 0..5 {
        bench.exchange(0x80, &[]);
        bench.run(150 * MS);
    }
    assert_eq!((bench.heard(), bench.registers.flags.COP_SYNCFAIL_ERROR.load()), (vec![], 0));
    bench.run(100 * MS);
    assert_eq!(bench.registers.flags.COP_SYNCFAIL_ERROR.load(), 1);
    assert_eq!(bench.heard(), [(0xA0, vec![0x00, 0x82, 0x10, 2, 0, 0, 0, 0])]);
    assert_eq!(bench.exchange(0x80, &[]), [(0xA0, vec![0; 8])]);
}

/// A prepared node sends no emergencies. As soon as it may send again, it reports the errors that are present
/// (D-414).
#[test]
fn emergencies_wait_until_they_can_be_sent() {
    let mut bench = Bench::running("");
    bench.exchange(0, &[2, 0]);
    bench.registers.flags.ERROR.store(1);
    bench.run(50 * MS);
    assert_eq!(bench.heard(), []);
    assert_eq!(bench.exchange(0, &[128, 0]), [(0xA0, vec![0x00, 0x10, 0x01, 0, 0, 0, 0, 0])]);
    // Bit 30 of 1014h is 0. This means that the node sends no emergencies.
    bench.exchange(0x620, &[0x23, 0x14, 0x10, 0, 0xA0, 0, 0, 0]);
    bench.registers.flags.ERROR.store(0);
    bench.run(50 * MS);
    assert_eq!(bench.heard(), []);
}
