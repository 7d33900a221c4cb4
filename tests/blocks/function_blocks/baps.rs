//! Tests the BAPS blocks `BAPS_INIT`, `BAPS_PD_COMM2`, `_COMM8`, `_COMM24` and `BAPS_PD_CONTROL`. `service_data` has
//! the tests of the blocks for service data.

use crate::omega::cansync::bench::Dead;
use crate::rig::{BOTH, Memory, segment};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::*;
use commram::memory::Image;
use commram::plant::{Plant, PlantConfig};
use std::time::Duration;

/// Values of `w_COMMAND_REG`. `SAME_CYCLE`: two reference values and two (or four) actual values every 0.5 ms.
/// `TIME_SLICES`: eight values in time slices.
pub(crate) const SAME_CYCLE: u16 = 0x0014;
const TIME_SLICES: u16 = 0x0010;
/// Parameters: speed reference and actual value, additional reference value.
pub(crate) const SPEED: u16 = 300;
pub(crate) const SPEED_ACTUAL: u16 = 301;
const ADDITIONAL: u16 = 302;
const UNKNOWN: u16 = 4000;

/// A plant of one PLC with a drive at its BAPS.
pub(crate) struct Stage {
    pub plant: Plant,
    pub ram: Ram,
    pub base: Base<BAPS_CTRL_BMSTRUCT>,
    _images: Vec<Image>,
}

impl Stage {
    /// `drive` is TOML text for the section `[plc.drive]`.
    pub(crate) fn new(memory: Memory, drive: &str) -> Stage {
        let text = format!("[[plc]]\nname = 'line'\n[plc.drive]\nenable = 'at_power_on'\n{drive}");
        let config = PlantConfig::parse("baps", &text).unwrap();
        let mut images = Vec::new();
        let plant = Plant::new(&config, |plc, device| segment(memory, plc, device, &mut images)).unwrap();
        let ram = Ram::of(plant.devices()[0].segment()).unwrap();
        Stage { base: ram.at(BAPS).unwrap(), ram, plant, _images: images }
    }

    /// Runs PLC cycles of 500 us until `done` returns true; returns the duration in us.
    #[track_caller]
    pub(crate) fn until(&mut self, mut done: impl FnMut(&mut Stage) -> bool) -> u64 {
        let start = self.plant.now();
        while !done(self) {
            self.step(500);
            assert!(self.plant.now() - start < 60_000_000, "it never ends");
        }
        self.plant.now() - start
    }

    pub(crate) fn step(&mut self, us: u64) {
        self.plant.advance_to(self.plant.now() + us);
    }

    /// Runs `BAPS_INIT` to its end.
    #[track_caller]
    pub(crate) fn initialize(&mut self, init: &mut BAPS_INIT) {
        self.until(|stage| {
            init.call(&stage.base);
            init.x_OK || init.x_ERR
        });
    }
}

pub(crate) fn init(w_COMMAND_REG: u16, reference: [u16; 2], actual: [u16; 4]) -> BAPS_INIT {
    BAPS_INIT {
        w_COMMAND_REG,
        u_WR_PAR_NR0: reference[0],
        u_WR_PAR_NR1: reference[1],
        u_RD_PAR_NR0: actual[0],
        u_RD_PAR_NR1: actual[1],
        u_RD_PAR_NR2: actual[2],
        u_RD_PAR_NR3: actual[3],
        ..Default::default()
    }
}

/// Returns `BAPS_PD_COMM24` with the method and cycle time of the configuration.
pub(crate) fn exchange() -> BAPS_PD_COMM24 {
    BAPS_PD_COMM24 { w_COMMAND_REG: SAME_CYCLE, ..Default::default() }
}

/// Manual p. 86-103: after the configuration, two values are exchanged in each direction.
#[test]
fn two_values_are_exchanged() {
    for memory in BOTH {
        let mut stage = Stage::new(memory, "");
        let mut init = init(SAME_CYCLE, [SPEED, ADDITIONAL], [SPEED_ACTUAL, ADDITIONAL, 0, 0]);
        stage.initialize(&mut init);
        assert_eq!((init.x_OK, init.b_ERR, init.b_SL_QUIT), (true, 0, 0x02), "{memory:?}");
        let mut comm = BAPS_PD_COMM2 {
            w_CONTROLWORD: 0x000F,
            w_COMMAND_REG: SAME_CYCLE,
            ud_WR_VALUE0: 5000,
            ud_WR_VALUE1: 0x8765_4321,
            ..Default::default()
        };
        let mut errors = 0;
        for _ in 0..40 {
            comm.call(&stage.base);
            errors += u32::from(comm.x_ERR);
            stage.step(500);
        }
        assert_eq!((comm.b_SL_QUIT, comm.b_ERR, errors), (0x01, 0, 0));
        assert_eq!((comm.ud_RD_VALUE0, comm.ud_RD_VALUE1), (5000, 0x8765_4321));
        assert_eq!(comm.w_STATUSWORD & 0x006F, 0x0027, "operation enabled");
        assert_eq!(comm.w_STATUS_REG & 1, 0, "nothing triggers the drive");
        // Without `x_EN` the block does nothing, not even at the timeout register.
        let timeout = stage.base.w_TIMEOUT.load();
        comm.x_EN = false;
        comm.call(&stage.base);
        assert_eq!((stage.base.w_TIMEOUT.load(), stage.base.b_COMMAND.load()), (timeout, 0));
    }
}

/// Manual p. 87, 99: exchange with the event that the drive raises.
#[test]
fn init_enables_the_event_of_the_process_data() {
    for i_EVENT in [4, 8] {
        let mut stage = Stage::new(Memory::Heap, "");
        let mut init = BAPS_INIT { i_EVENT, ..init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]) };
        stage.initialize(&mut init);
        assert!(init.x_OK);
        let count = |stage: &Stage| stage.ram.header().events[i_EVENT as usize].bell.rings();
        let before = count(&stage);
        stage.step(10_000);
        assert_eq!(count(&stage) - before, 20);
    }
}

/// Manual p. 90, 112-116: each of eight values is exchanged at its own cycle time.
#[test]
fn eight_values_are_exchanged_in_time_slices() {
    let numbers = (1000..1008)
        .map(|number| format!("[[plc.drive.parameters]]\nnumber = {number}\nformat = 'doubleword'\n"));
    let mut stage = Stage::new(Memory::Heap, &numbers.collect::<String>());
    let mut init = BAPS_INIT {
        w_COMMAND_REG: TIME_SLICES,
        u_WR_PAR_NR0: 1000,
        u_WR_PAR_NR1: 1001,
        u_WR_PAR_NR2: 1002,
        u_WR_PAR_NR3: 1003,
        u_WR_PAR_NR4: 1004,
        u_WR_PAR_NR5: 1005,
        u_WR_PAR_NR6: 1006,
        u_WR_PAR_NR7: 1007,
        u_RD_PAR_NR0: 1000,
        u_RD_PAR_NR1: 1001,
        u_RD_PAR_NR2: 1002,
        u_RD_PAR_NR3: 1003,
        u_RD_PAR_NR4: 1004,
        u_RD_PAR_NR5: 1005,
        u_RD_PAR_NR6: 1006,
        u_RD_PAR_NR7: 1007,
        ..Default::default()
    };
    stage.initialize(&mut init);
    assert!(init.x_OK, "{init:?}");
    let mut comm = BAPS_PD_COMM8 {
        w_COMMAND_REG: TIME_SLICES,
        ud_WR_VALUE0: 10,
        ud_WR_VALUE1: 11,
        ud_WR_VALUE2: 12,
        ud_WR_VALUE3: 13,
        ud_WR_VALUE4: 14,
        ud_WR_VALUE5: 15,
        ud_WR_VALUE6: 16,
        ud_WR_VALUE7: 17,
        ..Default::default()
    };
    for _ in 0..520 {
        comm.call(&stage.base);
        assert!(!comm.x_ERR);
        stage.step(500);
    }
    comm.call(&stage.base);
    let low = [comm.ud_RD_VALUE0, comm.ud_RD_VALUE1, comm.ud_RD_VALUE2, comm.ud_RD_VALUE3];
    let high = [comm.ud_RD_VALUE4, comm.ud_RD_VALUE5, comm.ud_RD_VALUE6, comm.ud_RD_VALUE7];
    assert_eq!((low, high), ([10, 11, 12, 13], [14, 15, 16, 17]));
}

/// Manual p. 92: each bit of `b_ERR`.
#[test]
fn init_reports_every_error() {
    let good = || init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]);
    let mut enabled_before = Stage::new(Memory::Heap, "");
    enabled_before.initialize(&mut BAPS_INIT { i_EVENT: 4, ..good() });
    for (stage, mut block, b_ERR, b_SL_QUIT) in [
        (Stage::new(Memory::Heap, ""), init(0x0012, [SPEED, 0], [0; 4]), 1 << 0, 0x80),
        (Stage::new(Memory::Heap, ""), init(SAME_CYCLE, [SPEED, 0], [UNKNOWN, 0, 0, 0]), 1 << 0, 0x82),
        (Stage::new(Memory::Heap, ""), init(SAME_CYCLE, [UNKNOWN, 0], [0; 4]), 1 << 0, 0x83),
        (Stage::new(Memory::Heap, ""), BAPS_INIT { i_EVENT: 5, ..good() }, 1 << 3, 0x00),
        (enabled_before, BAPS_INIT { i_EVENT: 8, ..good() }, 1 << 5, 0x02),
    ] {
        let mut stage = stage;
        stage.initialize(&mut block);
        assert_eq!((block.b_ERR, block.b_SL_QUIT, block.x_OK), (b_ERR, b_SL_QUIT, false), "{block:?}");
        // The block needs a reset.
        block.call(&stage.base);
        assert!(block.x_ERR);
        block.x_RESET = true;
        block.call(&stage.base);
        assert_eq!((block.b_ERR, block.x_ERR), (0, false));
        let mut again = BAPS_INIT { internal: block.internal, ..good() };
        stage.initialize(&mut again);
        assert!(again.x_OK);
    }

    // The drive does not answer; the preset monitoring time is 3 s.
    let dead = Dead::new();
    let base = dead.ram.at::<BAPS_CTRL_BMSTRUCT>(BAPS).unwrap();
    let mut block = good();
    for us in [0, 2_999_999] {
        dead.pass(us);
        block.call(&base);
        assert!(!block.x_ERR && !block.x_BUSY);
    }
    dead.pass(1);
    block.call(&base);
    assert_eq!((block.b_ERR, block.x_ERR), (1 << 4, true));
}

/// Manual p. 90-91: with `us_MODE` 1 the block shows that it is busy, and can be used any number of times.
#[test]
fn process_data_are_reconfigured_while_no_exchange_runs() {
    let mut stage = Stage::new(Memory::Heap, "");
    let mut block = BAPS_INIT { us_MODE: 1, ..init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]) };
    block.call(&stage.base);
    assert!(block.x_BUSY);
    stage.initialize(&mut block);
    assert!(block.x_OK && !block.x_BUSY);
    block.x_EN = false;
    block.call(&stage.base);
    (block.x_EN, block.u_RD_PAR_NR0) = (true, UNKNOWN);
    block.x_OK = false;
    stage.initialize(&mut block);
    assert_eq!((block.b_ERR, block.b_SL_QUIT), (1, 0x82));
}

/// Manual p. 103, 108: `b_ERR` bit 0 of all three blocks, without a configuration and with a bad value.
#[test]
fn the_process_data_blocks_report_refusals_of_the_drive() {
    macro_rules! check {
        ($block:ident) => {
            let mut stage = Stage::new(Memory::Heap, "");
            let mut comm = $block::default();
            comm.call(&stage.base);
            assert!(!comm.x_ERR, "16#00 means nothing");
            stage.until(|stage| {
                comm.call(&stage.base);
                comm.x_ERR
            });
            assert_eq!((comm.b_ERR, comm.b_SL_QUIT), (1 << 0, 0x81));

            let limits = "[[plc.drive.parameters]]\nnumber = 1000\nformat = 'doubleword'\nmax = 10\n";
            let mut stage = Stage::new(Memory::Heap, limits);
            stage.initialize(&mut init(SAME_CYCLE, [1000, 0], [0; 4]));
            let mut comm = $block { w_COMMAND_REG: SAME_CYCLE, ud_WR_VALUE0: 11, ..Default::default() };
            stage.until(|stage| {
                comm.call(&stage.base);
                comm.x_ERR
            });
            assert_eq!((comm.b_ERR, comm.b_SL_QUIT), (1 << 0, 0x83));
            comm.ud_WR_VALUE0 = 10;
            stage.until(|stage| {
                comm.call(&stage.base);
                !comm.x_ERR
            });
            assert_eq!(comm.b_SL_QUIT, 0x01);
        };
    }
    check!(BAPS_PD_COMM2);
    check!(BAPS_PD_COMM8);
    check!(BAPS_PD_COMM24);
}

/// Manual p. 109-111: the parameter numbers change while the process data run.
#[test]
fn numbers_are_changed_while_the_process_data_run() {
    for memory in BOTH {
        let mut stage = Stage::new(memory, "");
        stage.initialize(&mut init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]));
        let mut comm = BAPS_PD_COMM24 { ud_WR_VALUE0: 77, ud_WR_VALUE1: 88, ..exchange() };
        for _ in 0..10 {
            comm.call(&stage.base);
            stage.step(500);
        }
        let mut change =
            BAPS_INIT { us_MODE: 2, ..init(0, [SPEED, ADDITIONAL], [SPEED_ACTUAL, 121, ADDITIONAL, 0]) };
        change.call(&stage.base);
        assert_eq!((change.x_OK, change.x_ERR, change.x_BUSY), (false, false, false));
        comm.x_RE_INIT_START = true;
        let mut seen_active = false;
        stage.until(|stage| {
            comm.call(&stage.base);
            assert!(!comm.x_ERR, "{comm:?}");
            seen_active |= comm.b_SL_QUIT == 0x03;
            comm.x_RE_INIT_START = false; // An edge is enough.
            comm.x_RE_INIT_OK || comm.x_RE_INIT_ERR
        });
        assert!(seen_active && comm.x_RE_INIT_OK, "{memory:?}");
        for _ in 0..10 {
            stage.step(500);
            comm.call(&stage.base);
        }
        assert_eq!((comm.ud_RD_VALUE2, comm.b_SL_QUIT, comm.x_RE_INIT_OK), (88, 0x01, true));
        assert_eq!(comm.ud_RD_VALUE1, u32::from(comm.w_STATUSWORD));
    }
}

/// Manual p. 109-111: the errors of re-initialization.
#[test]
fn re_initialization_reports_every_error() {
    for (reference, actual, quit) in
        [(UNKNOWN, SPEED_ACTUAL, 0x86), (SPEED, UNKNOWN, 0x87), (UNKNOWN, UNKNOWN, 0x86)]
    {
        let mut stage = Stage::new(Memory::Heap, "");
        stage.initialize(&mut init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]));
        let mut comm = BAPS_PD_COMM24 { w_CONTROLWORD: 0x000F, ud_WR_VALUE0: 5, ..exchange() };
        comm.call(&stage.base);
        BAPS_INIT { us_MODE: 2, ..init(0, [reference, 0], [actual, 0, 0, 0]) }.call(&stage.base);
        comm.x_RE_INIT_START = true;
        stage.until(|stage| {
            comm.call(&stage.base);
            comm.x_RE_INIT_OK || comm.x_RE_INIT_ERR
        });
        assert_eq!((comm.x_RE_INIT_ERR, comm.b_SL_QUIT), (true, quit));
        assert_eq!((comm.b_ERR, comm.x_ERR), (0, false), "no bit for that (p. 109)");
        // The drive still exchanges the old parameter numbers.
        for _ in 0..10 {
            stage.step(500);
            comm.call(&stage.base);
        }
        assert_eq!((comm.b_SL_QUIT, comm.ud_RD_VALUE0, comm.x_RE_INIT_ERR), (0x01, 5, true));
    }

    // Older drive software does not support the re-initialization.
    let mut stage = Stage::new(Memory::Heap, "software = 308\n");
    stage.initialize(&mut init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]));
    let mut comm = BAPS_PD_COMM24 { x_RE_INIT_START: true, ..exchange() };
    stage.until(|stage| {
        comm.call(&stage.base);
        comm.x_RE_INIT_OK || comm.x_RE_INIT_ERR
    });
    assert_eq!((comm.x_RE_INIT_ERR, comm.b_SL_QUIT, comm.b_ERR), (true, 0x80, 1 << 0));

    // The drive does not answer; the preset monitoring time is 1 s.
    let dead = Dead::new();
    let base = dead.ram.at::<BAPS_CTRL_BMSTRUCT>(BAPS).unwrap();
    let mut comm = BAPS_PD_COMM24 { x_RE_INIT_START: true, ..Default::default() };
    for us in [0, 999_999] {
        dead.pass(us);
        comm.call(&base);
        assert_eq!((comm.b_ERR, base.b_COMMAND.load()), (0, 0x03));
    }
    dead.pass(1);
    comm.call(&base);
    assert_eq!((comm.b_ERR, comm.x_ERR, base.b_COMMAND.load()), (1 << 1, true, 0x01));
}

/// Manual p. 117: `BAPS_PD_CONTROL` monitors whether the communication blocks are called. It ignores the results of the
/// calls.
#[test]
fn missing_process_data_exchange_is_reported() {
    let mut stage = Stage::new(Memory::Heap, "");
    let mut control = BAPS_PD_CONTROL { t_TIME: Duration::from_millis(20), ..Default::default() };
    let mut comm = BAPS_PD_COMM2::default();
    for _ in 0..100 {
        comm.call(&stage.base);
        control.call(&stage.base);
        assert!(!control.x_ERR);
        stage.step(500);
    }
    assert!(comm.x_ERR, "the drive is not even configured");
    let took = stage.until(|stage| {
        control.call(&stage.base);
        control.x_ERR
    });
    assert!((19_000..=20_500).contains(&took), "{took}");
    comm.call(&stage.base);
    control.call(&stage.base);
    assert!(control.x_ERR, "stays");
    control.x_RESET = true;
    control.call(&stage.base);
    assert!(!control.x_ERR);

    let dead = Dead::new();
    let base = dead.ram.at::<BAPS_CTRL_BMSTRUCT>(BAPS).unwrap();
    let mut control = BAPS_PD_CONTROL::default();
    control.call(&base);
    dead.pass(2_999_999);
    control.call(&base);
    assert!(!control.x_ERR);
    dead.pass(1);
    control.call(&base);
    assert!(control.x_ERR, "3 s are preset");
}
