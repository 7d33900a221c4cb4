//! Tests of the blocks `LED`, `INTR_SET`, `OPT_INIT`, `TIME_MEASURE_START` and `TIME_MEASURE_END`.

use crate::omega::cansync::bench::{Bench, Dead};
use crate::rig::{BOTH, Memory};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::NODE2;
use commram::identity::DeviceIndex;
use commram::plant::Power;

/// Returns the RAM of PLC `a`.
fn ram(bench: &Bench) -> Ram {
    Ram::of(bench.rig.plant.devices()[0].segment()).unwrap()
}

/// Manual p. 51: four bits, four LEDs; dark after a reset.
#[test]
fn led_sets_four_leds() {
    for memory in BOTH {
        let mut bench = Bench::new(memory);
        let ram = ram(&bench);
        LED { b_LEDS: 0xF5 }.call(&ram);
        assert_eq!(ram.header().board.leds.load(), 0x05);
        bench.rig.plant.set_power(DeviceIndex(0), Power::HoldReset);
        bench.rig.step(1000);
        assert_eq!(ram.header().board.leds.load(), 0);
    }
}

/// Manual p. 47-50: the board raises an event for each of its own sources, at the period of the source.
#[test]
fn intr_set_enables_and_disables_events() {
    for memory in BOTH {
        let mut bench = Bench::active(memory);
        let ram = ram(&bench);
        let count = |event: usize| ram.header().events[event].bell.rings();
        for (event, i_PAR1, expected) in [(0, 20, 40), (2, 100, 8), (12, 0, 20)] {
            let mut block = INTR_SET { i_EVENT: event as i8, i_PAR1, x_EN: true, ..Default::default() };
            bench.until(|_| {
                block.call(&ram);
                block.is_answered()
            });
            assert!(!block.x_ERR);
            let before = count(event);
            bench.cycles(40, |_| block.call(&ram));
            let got = count(event) - before;
            assert!((expected - 1..=expected + 1).contains(&got), "event {event}: {got}");
            block.x_EN = false;
            block.call(&ram);
            bench.rig.step(1000);
            let before = count(event);
            bench.cycles(40, |_| block.call(&ram));
            assert_eq!(count(event), before, "event {event} is disabled");
        }
    }
}

/// Manual p. 48: reserved numbers, events that exclude each other, a CPU timer without a period.
#[test]
fn intr_set_reports_refusals_of_the_board() {
    let mut bench = Bench::new(Memory::Heap);
    let ram = ram(&bench);
    let mut sync = INTR_SET { i_EVENT: 12, x_EN: true, ..Default::default() };
    bench.until(|_| {
        sync.call(&ram);
        sync.is_answered()
    });
    for (i_EVENT, i_PAR1) in [(1, 0), (16, 0), (-1, 0), (11, 0), (0, 0), (2, -1)] {
        let mut block = INTR_SET { i_EVENT, i_PAR1, x_EN: true, ..Default::default() };
        bench.until(|_| {
            block.call(&ram);
            block.is_answered()
        });
        assert!(block.x_ERR, "{i_EVENT} {i_PAR1}");
        // The inputs have changed, so the block makes another request.
        (block.i_EVENT, block.i_PAR1) = (0, 20);
        bench.until(|_| {
            block.call(&ram);
            block.is_answered()
        });
        assert!(!block.x_ERR);
    }
}

#[test]
fn a_reset_of_the_board_makes_a_block_ask_again() {
    let mut bench = Bench::new(Memory::Heap);
    let ram = ram(&bench);
    let mut timer = INTR_SET { i_EVENT: 0, i_PAR1: 20, x_EN: true, ..Default::default() };
    let mut triggers = OPT_INIT::default();
    let both = |bench: &mut Bench, timer: &mut INTR_SET, triggers: &mut OPT_INIT| {
        bench.until(|_| {
            timer.call(&ram);
            triggers.call(&ram);
            timer.is_answered() && (triggers.x_OK || triggers.x_ERR)
        });
        assert!(triggers.x_OK && !timer.x_ERR);
    };
    both(&mut bench, &mut timer, &mut triggers);
    bench.rig.plant.set_power(DeviceIndex(0), Power::Off);
    bench.rig.step(1000);
    bench.rig.plant.set_power(DeviceIndex(0), Power::On);
    timer.call(&ram);
    triggers.call(&ram);
    assert!(!timer.is_answered() && !triggers.x_OK);
    both(&mut bench, &mut timer, &mut triggers);
}

/// Manual p. 50, 57-59: 1 ms on board timer A, as event and as trigger.
#[test]
fn opt_init_starts_a_timer_and_routes_triggers_once() {
    for memory in BOTH {
        let mut bench = Bench::new(memory);
        let ram = ram(&bench);
        let mut block = OPT_INIT {
            us_MODE_TRIGGER_1: 4,
            us_MODE_TRIGGER_2: 4,
            us_MODE_TRIGGER_CONTROLLER: 2,
            u_DIVIDER_TIMER_A: 2499,
            x_EN_TIMER_A: true,
            ..Default::default()
        };
        let mut event = INTR_SET { i_EVENT: 5, x_EN: true, ..Default::default() };
        bench.until(|_| {
            block.call(&ram);
            event.call(&ram);
            block.x_OK && event.is_answered()
        });
        bench.cycles(50, |_| block.call(&ram));
        let header = ram.header();
        assert!((49..=51).contains(&header.events[5].bell.rings()));
        for trigger in &header.triggers {
            assert!((49..=51).contains(&trigger.bell.rings()));
        }
        assert_eq!(header.timers[1].bell.rings(), 0);
        // A program may run the block only once.
        let mut again = OPT_INIT::default();
        bench.until(|_| {
            again.call(&ram);
            again.x_OK || again.x_ERR
        });
        assert_eq!((again.x_OK, again.x_ERR), (false, true));
    }
}

/// Manual p. 58: reserved modes and impossible periods.
#[test]
fn opt_init_reports_refusals_of_the_board() {
    for mut block in [
        OPT_INIT { us_MODE_TRIGGER_1: 1, ..Default::default() },
        OPT_INIT { us_MODE_TRIGGER_2: 5, ..Default::default() },
        OPT_INIT { us_MODE_TRIGGER_CONTROLLER: 3, ..Default::default() },
        OPT_INIT { u_DIVIDER_TIMER_A: 1, x_EN_TIMER_A: true, ..Default::default() },
        OPT_INIT { ud_CFG_MODE_TIMER_B: 1, x_EN_TIMER_B: true, ..Default::default() },
    ] {
        let mut bench = Bench::new(Memory::Heap);
        let ram = ram(&bench);
        bench.until(|_| {
            block.call(&ram);
            block.x_OK || block.x_ERR
        });
        assert!(block.x_ERR, "{block:?}");
    }
}

#[test]
fn time_measurement_counts_emulated_microseconds() {
    let dead = Dead::new();
    let (mut start, mut end) = (TIME_MEASURE_START::default(), TIME_MEASURE_END::default());
    for us in [0, 1, 37, u64::from(u32::MAX)] {
        start.call(&dead.ram);
        dead.pass(us);
        end.ud_TIME = start.ud_TIME;
        end.call(&dead.ram);
        assert_eq!(u64::from(end.ud_TIME_DIFF), us);
    }
}

/// In real time the clock also advances between two actions of the firmware.
#[test]
fn time_measurement_follows_the_real_clock() {
    let dead = Dead::new();
    let header = dead.ram.header();
    // The emulated time begins now; a program's time leads the emulator's time by 100 ms at most.
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    header.speed.store(1000);
    header.real_epoch_ns.store(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64);
    let mut start = TIME_MEASURE_START::default();
    start.call(&dead.ram);
    let mut end = TIME_MEASURE_END { ud_TIME: start.ud_TIME, ..Default::default() };
    let watchdog = std::time::Instant::now();
    while end.ud_TIME_DIFF == 0 {
        end.call(&dead.ram);
        assert!(watchdog.elapsed().as_secs() < 60);
    }
}

/// Blocks work at any address with the right alignment and size.
#[test]
fn a_structure_cannot_be_declared_where_it_does_not_fit() {
    let dead = Dead::new();
    type Master = commram::devices::omega_drive_line_2::registers::CANsync_MA_CTRL_BMSTRUCT;
    assert!(dead.ram.at::<Master>(NODE2).is_ok());
    assert!(dead.ram.at::<Master>(NODE2 + 1).is_err());
    assert!(dead.ram.at::<Master>(3_262_140).is_err());
}
