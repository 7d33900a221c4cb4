//! Tests the built-in program as master of nodes. The test simulates the nodes.

use super::*;
use crate::devices::cs0015::registers::values::program;

const KEYS: &str = "node_id = 1, program = 'master', nodes = [5], guard_ms = 100, life = 2, sync_ms = 20";

/// Returns the frames, except SYNC, that the master has sent since the last call. Remote frames have no data.
fn orders(bench: &mut Bench) -> Vec<(u16, Vec<u8>)> {
    bench.heard().into_iter().filter(|(id, _)| *id != 0x80).collect()
}

/// Manual p. 53-61.
#[test]
fn a_master_guards_starts_and_synchronizes_until_it_is_stopped() {
    let mut bench = Bench::new(KEYS);
    bench.run(260 * MS);
    assert_eq!(orders(&mut bench), [(0x705, vec![])], "the master requests the state of its node");
    bench.send(0x705, &[0x7F]);
    bench.run(20 * MS);
    assert_eq!(orders(&mut bench), [(0, vec![1, 0])], "it starts the network");
    assert_eq!(bench.stat(), "green 2 Hz", "and itself");
    bench.run(300 * MS);
    let syncs = bench.heard().iter().filter(|(id, _)| *id == 0x80).count();
    assert!((14..=16).contains(&syncs), "{syncs}");
    bench.command(program::STOP);
    bench.heard();
    bench.run(500 * MS);
    assert_eq!(bench.heard(), []);
}

/// Manual p. 28, 59, 152.
#[test]
fn a_master_resets_a_missing_node_and_starts_it_again() {
    let mut bench = Bench::new(KEYS);
    bench.run(260 * MS);
    bench.send(0x705, &[0x05]);
    bench.run(600 * MS);
    let missing = |bench: &Bench| bench.registers.flags.COP_GUARDFAIL_NODEID.load();
    assert_eq!(missing(&bench), 5);
    let resets = orders(&mut bench).into_iter().filter(|order| *order == (0, vec![129, 5])).count();
    assert!(resets > 1, "the master continues");
    bench.send(0x705, &[0x7F]);
    bench.run(20 * MS);
    assert_eq!((missing(&bench), orders(&mut bench)), (0, vec![(0, vec![1, 5])]));
}

/// Decision D-432.
#[test]
fn a_master_waits_two_seconds_for_a_missing_node() {
    let mut bench = Bench::new(KEYS);
    bench.run(2_200 * MS);
    assert!(!orders(&mut bench).contains(&(0, vec![1, 0])));
    bench.run(100 * MS);
    assert!(orders(&mut bench).contains(&(0, vec![1, 0])));
}
