//! The error paths of the BAPS blocks, with a silent or slow drive.

use super::baps::{SAME_CYCLE, SPEED, SPEED_ACTUAL, Stage, exchange, init};
use crate::rig::{Memory, add_fault};
use commram::devices::omega_drive_line_2::blocks::*;
use std::time::Duration;

impl Stage {
    /// Adds a fault that begins at once; returns its number.
    fn fault(&mut self, kind: &str, fields: &[&str]) -> u16 {
        add_fault(&mut self.plant, kind, fields)
    }
}

fn configuration() -> BAPS_INIT {
    init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0])
}

/// Manual p. 92: tests the timeout in bit 4 of `b_ERR`. The preset monitoring time is 3 s.
#[test]
fn a_configuration_that_is_not_answered_is_a_timeout() {
    for (kind, fields) in [("baps_silent", &[][..]), ("baps_slow", &["delay=3.5s"])] {
        let mut stage = Stage::new(Memory::Heap, "");
        let number = stage.fault(kind, fields);
        let mut block = configuration();
        let begin = stage.plant.now();
        stage.initialize(&mut block);
        assert_eq!(
            (block.b_ERR, block.x_OK, stage.plant.now() - begin),
            (1 << 4, false, 3_000_000),
            "{kind}"
        );
        stage.plant.clear_fault(number).unwrap();
        let mut again = configuration();
        stage.initialize(&mut again);
        assert!(again.x_OK, "{kind}");
    }
    let mut stage = Stage::new(Memory::Heap, "");
    stage.fault("baps_slow", &["delay=2.5s"]);
    let mut block = configuration();
    stage.initialize(&mut block);
    assert!(block.x_OK, "slow, but in time");
}

/// Manual p. 109: tests the timeout in bit 1 of `b_ERR`. The preset monitoring time is 1 s.
#[test]
fn a_re_initialization_that_is_not_answered_is_a_timeout() {
    let mut stage = Stage::new(Memory::Heap, "");
    stage.initialize(&mut configuration());
    let mut comm = exchange();
    for _ in 0..10 {
        comm.call(&stage.base);
        stage.step(500);
    }
    BAPS_INIT { us_MODE: 2, ..init(0, [SPEED, 0], [SPEED_ACTUAL, 121, 0, 0]) }.call(&stage.base);
    let number = stage.fault("baps_silent", &[]);
    comm.x_RE_INIT_START = true;
    let took = stage.until(|stage| {
        comm.call(&stage.base);
        comm.x_ERR
    });
    assert_eq!((comm.b_ERR, took), (1 << 1, 1_000_000));
    assert!(!comm.x_RE_INIT_OK && !comm.x_RE_INIT_ERR);
    stage.plant.clear_fault(number).unwrap();
    comm.x_RE_INIT_START = false;
    comm.call(&stage.base);
    comm.x_RE_INIT_START = true;
    stage.until(|stage| {
        comm.call(&stage.base);
        comm.x_RE_INIT_OK
    });
    assert_eq!((comm.b_ERR, comm.x_RE_INIT_ERR), (0, false));
}

/// Manual p. 117: without process data there is no event and no call of the block; `BAPS_PD_CONTROL` reports this to
/// another task.
#[test]
fn a_silent_drive_stops_the_event_task() {
    let mut stage = Stage::new(Memory::Heap, "");
    stage.initialize(&mut BAPS_INIT { i_EVENT: 4, ..configuration() });
    let mut comm = BAPS_PD_COMM2 { us_MODE: 1, w_COMMAND_REG: SAME_CYCLE, ..Default::default() };
    let mut control = BAPS_PD_CONTROL::default();
    let mut seen = 0;
    let mut cycle = |stage: &mut Stage, control: &mut BAPS_PD_CONTROL| {
        let rings = stage.ram.header().events[4].bell.rings();
        if core::mem::replace(&mut seen, rings) != rings {
            comm.call(&stage.base);
        }
        control.call(&stage.base);
    };
    for _ in 0..100 {
        cycle(&mut stage, &mut control);
        stage.step(500);
    }
    assert!(!control.x_ERR);
    stage.fault("baps_silent", &["duration=4s"]);
    let took = stage.until(|stage| {
        cycle(stage, &mut control);
        control.x_ERR
    });
    assert!((3_000_000..=3_001_000).contains(&took), "{took}");
    stage.step(1_000_000);
    control.x_RESET = true;
    cycle(&mut stage, &mut control);
    control.x_RESET = false;
    for _ in 0..10_000 {
        cycle(&mut stage, &mut control);
        stage.step(500);
    }
    assert!(!control.x_ERR, "the events are there again");
}

/// Manual p. 120: the timeouts of all three steps of a job, one after the other, each with 3 s.
#[test]
fn a_silent_drive_gives_each_timeout_of_the_service_data() {
    let mut stage = Stage::new(Memory::Heap, "");
    let mut data = BAPS_BMSTRUCT::default();
    let mut read = BAPS_PAR_READ { u_PAR_NR: 167, ..Default::default() };
    let mut control = BAPS_SD_CONTROL::default();
    for (bit, is_silent_from) in [
        // Three cases: the drive does not take the job; the drive has given its result and does not notice that the
        // block has read it; the drive's semaphore is still set from the previous job.
        (3, Some(0)),
        (4, Some(1)),
        (2, None),
    ] {
        if is_silent_from == Some(0) {
            stage.fault("baps_silent", &[]);
        }
        read.x_EN = true;
        let mut begin = stage.plant.now();
        stage.until(|stage| {
            read.call(&mut data);
            control.call(&stage.base, &mut data);
            if is_silent_from == Some(1)
                && stage.base.b_MA_SEMAPHORE.load() == 0
                && stage.plant.faults().count() == 0
            {
                stage.fault("baps_silent", &[]);
                begin = stage.plant.now();
            }
            control.x_ERR
        });
        assert_eq!((control.b_ERR, stage.plant.now() - begin), (1 << bit, 3_000_000));
        read.call(&mut data);
        assert_eq!((read.x_ERR, read.i_ERR_COMM, read.i_ERR_DETAIL), (true, -1, 0));
        if bit != 4 {
            stage.plant.clear_faults();
        }
        (read.x_RESET, read.x_EN, control.x_RESET) = (true, false, true);
        read.call(&mut data);
        control.call(&stage.base, &mut data);
        (read.x_RESET, control.x_RESET) = (false, false);
        if bit != 4 {
            stage.step(1000);
        }
    }
    read.x_EN = true;
    stage.until(|stage| {
        read.call(&mut data);
        control.call(&stage.base, &mut data);
        read.x_OK
    });
    assert_eq!(read.ud_PAR_VALUE, 2000);
}

/// The drive takes the job 3 s late and answers 3 s late. With a longer monitoring time, both are in time.
#[test]
fn a_longer_monitoring_time_allows_a_slower_job() {
    for (t_TIME, is_in_time) in [(Duration::from_secs(3), false), (Duration::from_secs(7), true)] {
        let mut stage = Stage::new(Memory::Heap, "");
        stage.fault("baps_slow", &["delay=3s"]);
        let mut data = BAPS_BMSTRUCT::default();
        let mut write = BAPS_PAR_WRITE { u_PAR_NR: 168, ud_PAR_VALUE: 250, x_EN: true, ..Default::default() };
        let mut control = BAPS_SD_CONTROL { t_TIME, ..Default::default() };
        stage.until(|stage| {
            write.call(&mut data);
            control.call(&stage.base, &mut data);
            write.x_OK || write.x_ERR
        });
        let written = stage.plant.devices()[0]
            .as_a::<commram::devices::omega_drive_line_2::Plc>()
            .unwrap()
            .baps()
            .drive()
            .parameter(168)
            == Some(250);
        assert_eq!((write.x_OK, written), (is_in_time, is_in_time), "{t_TIME:?}");
    }
}
