//! `CANsync_INIT`, `CANsync_SL_TYP_INIT`, `CANsync_MODE_MA`, `CANsync_MODE_SL`.

use super::bench::{Bench, Dead, init};
use super::device::*;
use crate::rig::{BOTH, Memory};
use commram::devices::cansync::{self, BaudRate};

/// Manual p. 134, 212, 216-217: the registers during a start, on heap and mapped memory.
#[test]
fn init_and_mode_bring_both_nodes_into_active_operation() {
    for memory in BOTH {
        let bench = Bench::active(memory);
        let mut mode = CANsync_MODE_MA::default();
        mode.call(&bench.ma);
        let shown = (mode.x_CANsync_ACTIV, mode.x_SYNC_MODE_ACTIV, mode.x_MA, mode.x_SL);
        assert_eq!(shown, (true, true, true, false), "{memory:?}");
        let mut mode = CANsync_MODE_SL::default();
        mode.call(&bench.sl);
        let shown = (mode.x_CANsync_ACTIV, mode.x_SYNC_MODE_ACTIV, mode.x_MA, mode.x_SL);
        assert_eq!(shown, (true, true, false, true), "{memory:?}");
        assert_eq!([0, 1, 2].map(|n| bench.ma.a_STAT_SL[n].load()), [3, 3, 0], "{memory:?}");
    }
}

#[test]
fn init_sets_up_the_mode_if_asked_and_can_run_again() {
    let mut bench = Bench::active(Memory::Heap);
    let mut init = CANsync_INIT { x_SYNC_MODE: true, ..init() };
    bench.until(|b| {
        init.call(&b.ma_init);
        init.x_OK
    });
    assert_eq!(bench.ma.w_OPTION_STATUS.load(), 0x0043);
    assert_eq!((init.w_ERR, init.x_ERR), (0, false));
    init.call(&bench.ma_init);
    assert!(!init.x_OK, "a call after the end starts again");
}

/// The block writes exactly the values of its inputs; p. 149, 212-214.
#[test]
fn init_data_follow_the_inputs() {
    let role = |x_SL, x_SYNC_IN| CANsync_INIT { x_SL, x_SYNC_IN, ..init() };
    let [fastest, next, .., slowest] = &BAUD_RATES;
    let own_timing = |b_BIT_TIMING0| CANsync_INIT {
        b_BIT_TIMING0,
        b_BIT_TIMING1: next.b_BT_1,
        us_BAUDRATE: 0,
        us_SYNC_INTERVAL: next.b_TIME_PATTERN,
        ..init()
    };
    let at = |rate: &BaudRate| CANsync_INIT {
        us_BAUDRATE: rate.us_BAUDRATE,
        us_SYNC_INTERVAL: rate.b_TIME_PATTERN,
        ..own_timing(9)
    };
    for (mut block, mode, timing) in [
        (role(false, false), 0x00, fastest),
        (role(false, true), 0x02, fastest),
        (role(true, false), 0x01, fastest),
        (role(true, true), 0x01, fastest),
        (own_timing(next.b_BT_0), 0x00, next),
        (at(next), 0x00, next),
        (at(slowest), 0x00, slowest),
    ] {
        let dead = Dead::new();
        let base = dead.init();
        block.a_SL_TYP[31] = 1;
        for state in [1, 2] {
            base.w_OPTION_STATUS.store(state);
            block.call(&base);
        }
        let found = [&base.b_BT_0, &base.b_BT_1, &base.b_TIME_PATTERN].map(|cell| cell.load());
        let timing = [timing.b_BT_0, timing.b_BT_1, timing.b_TIME_PATTERN];
        assert_eq!((base.b_MA_SL_MODE.load(), found), (mode, timing), "{block:?}");
        let found = [&base.b_AC, &base.b_AM, &base.b_OUTPUT_CONTROL, &base.b_CLOCK_DIVIDER];
        assert_eq!(found.map(|cell| cell.load()), [0xFF, 0xFF, 0xFA, 0x07]);
        assert_eq!(base.a_SL_TYP[31].load(), u8::from(mode != 0x01), "slave types are the master's");
        assert_eq!(base.w_CPU_CONTROL.load(), 0x0002);
    }
}

/// Manual p. 215: each bit of `w_ERR`.
#[test]
fn init_reports_every_error() {
    let refused = CANsync_INIT { us_SYNC_INTERVAL: 8, ..init() };
    let unknown_rate = CANsync_INIT { us_BAUDRATE: 7, us_SYNC_INTERVAL: 8, ..init() };
    let unknown_timing = CANsync_INIT { us_BAUDRATE: 0, b_BIT_TIMING1: 0x14, ..init() };
    for (mut block, w_ERR, state) in [
        (refused, 1 << 11, 0x0002),
        (unknown_rate, 1 << 1, 0x0003),
        (unknown_timing, 1 << 1 | 1 << 11, 0x0002),
    ] {
        let mut bench = Bench::new(Memory::Heap);
        bench.rig.tolerate_errors(&[&cansync::rules::INIT_INTERVAL, &cansync::rules::INIT_BAUD_RATE]);
        bench.until(|b| {
            block.call(&b.ma_init);
            block.x_OK || block.x_ERR
        });
        assert_eq!((block.w_ERR, block.x_ERR, block.x_OK), (w_ERR, true, false));
        assert_eq!(bench.ma.w_OPTION_STATUS.load(), state, "{w_ERR:04X}");
    }

    let dead = Dead::new();
    let base = dead.init();
    let mut block = init();
    for us in [0, 999_999] {
        dead.pass(us);
        block.call(&base);
        assert!(!block.x_ERR && !block.x_OK);
    }
    dead.pass(1);
    block.call(&base);
    assert_eq!((block.w_ERR, block.x_ERR, block.x_OK), (1 << 0 | 1 << 11, true, false));
}

/// Manual p. 216-218: the commands one by one, and the state that each leads to.
#[test]
fn mode_gives_each_command_and_shows_each_state() {
    let mut bench = Bench::new(Memory::Heap);
    let shown = |b: &mut Bench| {
        let mut mode = CANsync_MODE_MA::default();
        mode.call(&b.ma);
        [mode.x_HS_ACTIV, mode.x_INIT_POSSIBLE, mode.x_WAIT, mode.x_PREPARE_ACTIV, mode.x_CANsync_ACTIV]
            .iter()
            .position(|&output| output)
    };
    let give = |b: &mut Bench, set: fn(&mut CANsync_MODE_MA)| {
        let mut mode = CANsync_MODE_MA::default();
        set(&mut mode);
        mode.call(&b.ma);
        b.rig.step(1000);
        shown(b)
    };
    assert_eq!(shown(&mut bench), Some(0));
    bench.ma.w_CPU_CONTROL.store(0x0001);
    bench.rig.step(1000);
    assert_eq!(shown(&mut bench), Some(1));
    bench.rig.master_node().write_init_data();
    assert_eq!(give(&mut bench, |mode| mode.x_SET_INIT_DATA = true), Some(2));
    assert_eq!(give(&mut bench, |mode| mode.x_SYNC_MODE = true), Some(3));
    assert_eq!(give(&mut bench, |mode| mode.x_CANsync_RUN = true), Some(4));
    // While `x_SYNC_MODE` and `x_CANsync_RUN` stay TRUE, the node stays active.
    assert_eq!(give(&mut bench, |mode| (mode.x_SYNC_MODE, mode.x_CANsync_RUN) = (true, true)), Some(4));
    assert_eq!(give(&mut bench, |mode| mode.x_RESET_CANsync_CONTROLLER = true), Some(4));
    assert_eq!(bench.ma.w_CPU_CONTROL.load() & 0x0080, 0, "the firmware has cleared bit 7");
    assert_eq!(give(&mut bench, |mode| mode.x_SYNC_MODE = true), Some(3));
    assert_eq!(give(&mut bench, |mode| mode.x_RESET_SOFTWARE = true), Some(0));
}

/// Decision D-29: bit 7 leaves 16#0000 in the register. A restart writes 16#0000 again, which the RAM alone does not
/// show.
#[test]
fn init_and_mode_restart_a_node_whose_controller_was_reset() {
    for memory in BOTH {
        let mut bench = Bench::active(memory);
        bench.ma.w_CPU_CONTROL.store(0x0080);
        bench.rig.step(2000);
        let mut init = init();
        bench.until(|b| {
            init.call(&b.ma_init);
            init.x_OK || init.x_ERR
        });
        assert_eq!((init.w_ERR, bench.ma.w_OPTION_STATUS.load()), (0, 0x0003), "{memory:?}");

        bench.sl.w_CPU_CONTROL.store(0x0080);
        bench.rig.step(2000);
        assert_eq!(bench.sl.w_OPTION_STATUS.load(), 0x0020);
        CANsync_MODE_SL { x_RESET_SOFTWARE: true, ..Default::default() }.call(&bench.sl);
        bench.rig.step(2000);
        assert_eq!(bench.sl.w_OPTION_STATUS.load(), 0x0001, "{memory:?}");
    }
}

/// A program gives both commands at the same time, as after BUS-off. The block resets the controller and enables active
/// operation.
#[test]
fn mode_enables_active_operation_and_resets_the_controller_in_one() {
    let mut bench = Bench::active(Memory::Heap);
    let mut mode = CANsync_MODE_MA { x_SYNC_MODE: true, ..Default::default() };
    bench.until(|b| {
        mode.call(&b.ma);
        mode.x_PREPARE_ACTIV
    });
    mode = CANsync_MODE_MA { x_CANsync_RUN: true, x_RESET_CANsync_CONTROLLER: true, ..Default::default() };
    mode.call(&bench.ma);
    assert_eq!(bench.ma.w_CPU_CONTROL.load(), 0x00C0);
    bench.rig.step(2000);
    mode.call(&bench.ma);
    assert!(mode.x_CANsync_ACTIV);
    assert_eq!(bench.ma.w_OPTION_STATUS.load(), 0x0080);
}
