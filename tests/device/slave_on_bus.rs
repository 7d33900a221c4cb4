//! A slave node's jobs and actual values over the simulated bus, with the master's firmware at the other
//! end: the registers that both PLCs see, and their values after the SYNC signal fails.

use crate::rig::{BOTH, FASTEST, Memory, RATES, Rate, Rig};
use commram::devices::cansync::records::Missed;
use commram::journal::Event;

/// Returns a test rig with both nodes active; the master polls slave 0 in every interval, and block 1 of the slave is
/// enabled.
fn connected(memory: Memory, rate: Rate) -> Rig {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    rig.slave.b_EN_UPDOWNBLK1.store(1);
    rig.run_to_sync();
    rig
}

fn enter_parameter(rig: &Rig, value: u8) {
    let registers = &rig.master.a_CTRLREG_PAR_CMD_SL[0];
    registers.b_STATREG_PAR_CMD.store(value);
    registers.b_STEUREG_PAR_CMD.store(value);
}

fn enter_block(rig: &Rig, value: u8) {
    rig.master.b_STATREG_UPDOWNBLK1.store(value);
    rig.master.b_STEUREG_UPDOWNBLK1.store(value);
}

fn master_par(rig: &Rig) -> u8 {
    rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.load()
}

fn slave_par(rig: &Rig) -> u8 {
    rig.slave.b_STEUREG_PAR_CMD.load()
}

fn write_slave_par(rig: &Rig, value: u8) {
    rig.slave.b_STATREG_PAR_CMD.store(value);
    rig.slave.b_STEUREG_PAR_CMD.store(value);
}

/// Acts as the slave's application: allows and takes every transfer in block 1, once per interval.
fn serve_block(rig: &Rig) {
    let control = rig.slave.b_STEUREG_UPDOWNBLK1.load();
    if control & 0x01 != 0 {
        rig.slave.b_STATREG_UPDOWNBLK1.store(control & 0xFE);
        rig.slave.b_STEUREG_UPDOWNBLK1.store(control & 0xFE);
    }
}

/// Runs until `done`, at most for `intervals`.
fn run_until(rig: &mut Rig, intervals: usize, done: impl Fn(&Rig) -> bool) {
    for _ in 0..intervals {
        if done(rig) {
            return;
        }
        serve_block(rig);
        rig.run_to_sync();
    }
    assert!(done(rig), "not done after {intervals} intervals");
}

/// Manual p. 164-165 and 189-190. The slave is busy for three intervals.
#[test]
fn a_parameter_job_runs_through_both_register_sets() {
    for memory in BOTH {
        for rate in RATES {
            let mut rig = connected(memory, rate);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(300);
            enter_parameter(&rig, 0x03);
            rig.run_to_sync();
            assert_eq!((master_par(&rig), slave_par(&rig)), (0x0B, 0x00), "the frame is still on the wire");
            for _ in 0..3 {
                rig.run_to_sync();
                assert_eq!((master_par(&rig), slave_par(&rig)), (0x4B, 0x43));
            }
            assert_eq!(rig.slave.w_PAR_NR.load(), 300);
            rig.slave.d_DATA_PAR_CMD.store(0x1234_5678);
            write_slave_par(&rig, 0x52);
            rig.run_to_sync();
            rig.run_to_sync();
            assert_eq!((master_par(&rig), slave_par(&rig)), (0x12, 0x12));
            assert_eq!(rig.master.a_DATA_PARAMETER[0].d_PAR_VALUE.load(), 0x1234_5678);

            rig.master.a_DATA_PARAMETER[0].d_PAR_VALUE.store(7);
            enter_parameter(&rig, 0x05);
            rig.run_to_sync();
            rig.run_to_sync();
            assert_eq!((slave_par(&rig), rig.slave.d_DATA_PAR_CMD.load()), (0x45, 7));
            rig.slave.w_ERR_NR_PAR_CMD.store(0xFFFD);
            write_slave_par(&rig, 0x64);
            rig.run_to_sync();
            rig.run_to_sync();
            assert_eq!((master_par(&rig), slave_par(&rig)), (0x24, 0x24));
            assert_eq!(rig.master.a_DATA_PARAMETER[0].d_PAR_VALUE.load(), 0xFFFD);
        }
    }
}

/// Manual p. 166-168 and 190-193: a download of 300 bytes, then an upload.
#[test]
fn a_block_travels_down_and_up() {
    for memory in BOTH {
        for rate in RATES {
            let mut rig = connected(memory, rate);
            let value = |n: usize| 0x1122_3344u32.rotate_left(n as u32).wrapping_add(n as u32);
            for (n, cell) in rig.master.a_DATA_UPDOWNBLK1.iter().enumerate() {
                cell.store(value(n));
            }
            rig.master.d_BASE_ADR_UPDOWNBLK1.store(0x1000);
            rig.master.w_LENGTH_UPDOWNBLK1.store(300);
            enter_block(&rig, 0x15);
            run_until(&mut rig, 200, |rig| rig.slave.b_STEUREG_UPDOWNBLK1.load() == 0x1C);
            run_until(&mut rig, 2, |rig| rig.master.b_STEUREG_UPDOWNBLK1.load() == 0x1C);
            for (n, cell) in rig.slave.a_DATA_UPDOWNBLK1.iter().enumerate() {
                assert_eq!(cell.load(), value(n));
                cell.store(!value(n));
            }
            assert_eq!(rig.slave.w_COUNTER_UPDOWNBLK1.load(), 300);

            enter_block(&rig, 0x05);
            run_until(&mut rig, 200, |rig| rig.master.b_STEUREG_UPDOWNBLK1.load() == 0x0C);
            assert_eq!(rig.slave.b_STEUREG_UPDOWNBLK1.load(), 0x0C);
            let uploaded: Vec<u32> = rig.master.a_DATA_UPDOWNBLK1.iter().map(|cell| cell.load()).collect();
            assert_eq!(uploaded, (0..75).map(|n| !value(n)).collect::<Vec<_>>());
        }
    }
}

/// Manual p. 168 (bit 7 of the master), 192 (change bit of the slave); D-45, D-70.
#[test]
fn a_cancelled_block_shows_at_the_slave() {
    for rate in FASTEST {
        let mut rig = connected(Memory::Heap, rate);
        rig.master.d_BASE_ADR_UPDOWNBLK1.store(0x1000);
        rig.master.w_LENGTH_UPDOWNBLK1.store(300);
        enter_block(&rig, 0x15);
        run_until(&mut rig, 50, |rig| rig.slave.w_COUNTER_UPDOWNBLK1.load() == 60);
        enter_block(&rig, 0x80);
        run_until(&mut rig, 3, |rig| rig.slave.b_STEUREG_UPDOWNBLK1.load() == 0x1A);
        assert_eq!(rig.master.b_STEUREG_UPDOWNBLK1.load(), 0x00);
        rig.slave.b_STATREG_UPDOWNBLK1.store(0x9A);
        rig.slave.b_STEUREG_UPDOWNBLK1.store(0x9A);
        rig.step(500);
        assert_eq!(rig.slave.b_STEUREG_UPDOWNBLK1.load(), 0x00);
    }
}

/// Decision D-63: when the slave's PLC leaves active operation, the jobs of the master end. They do not wait for an
/// answer without end.
#[test]
fn a_slave_that_leaves_active_operation_refuses_the_jobs() {
    for rate in FASTEST {
        let mut rig = connected(Memory::Heap, rate);
        rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(300);
        enter_parameter(&rig, 0x03);
        run_until(&mut rig, 5, |rig| slave_par(rig) == 0x43);
        rig.slave.w_CPU_CONTROL.store(0x0020);
        run_until(&mut rig, 5, |rig| master_par(rig) == 0x22);
        assert_eq!(slave_par(&rig), 0x00);
        assert_eq!(rig.master.a_DATA_PARAMETER[0].d_PAR_VALUE.load(), 0xFFFA);
    }
}

/// Manual p. 134-135; D-64: without SYNC there is no interval, and what the PLC of the slave has entered waits.
#[test]
fn without_sync_nothing_is_due_and_nothing_is_lost() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = connected(memory, rate);
            rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(300);
            enter_parameter(&rig, 0x03);
            run_until(&mut rig, 5, |rig| slave_par(rig) == 0x43);

            rig.master.w_CPU_CONTROL.store(0x0000);
            rig.step(500);
            assert_eq!(rig.next_sync(), None);
            rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
            write_slave_par(&rig, 0x42);
            let frames = rig.frames().len();
            rig.step(50_000);
            assert_eq!(rig.frames().len(), frames, "silence");
            assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), 0x05, "no deadline");
            assert_eq!((rig.slave.w_OPTION_STATUS.load(), slave_par(&rig)), (0x0020, 0x42));

            rig.initialize_master();
            rig.master.w_CPU_CONTROL.store(0x0020);
            rig.step(500);
            rig.run_to_sync();
            assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), 0x04, "intervals again");
            run_until(&mut rig, 40, |rig| rig.master.a_STAT_SL[0].load() == 0x03);
            assert_eq!(
                (slave_par(&rig), rig.slave.w_PAR_NR.load()),
                (0x42, 300),
                "the master's polling is no change"
            );
        }
    }
}

/// The usual order of a start (p. 132): first the slaves go up to active operation, then the master starts. D-06, p.
/// 133, 176.
#[test]
fn a_slave_that_is_active_before_its_master_sets_up_is_synchronized() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = Rig::new(memory, rate);
            rig.initialize_slave();
            for (command, status) in [(0x0020, 0x0013), (0x0040, 0x0020)] {
                rig.slave.w_CPU_CONTROL.store(command);
                rig.step(500);
                assert_eq!(rig.slave.w_OPTION_STATUS.load(), status);
            }
            rig.initialize_master();
            rig.master.w_CPU_CONTROL.store(0x0020);
            rig.step(15_000);
            assert_eq!(rig.master.a_STAT_SL[0].load(), 0x01, "it responds, and has not locked yet");
            rig.step(25_000);
            assert_eq!(rig.master.a_STAT_SL[0].load(), 0x03);
            assert_eq!(slave_par(&rig), 0x00, "the application sees nothing of it");

            rig.master.w_CPU_CONTROL.store(0x0040);
            rig.step(500);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(300);
            enter_parameter(&rig, 0x03);
            run_until(&mut rig, 5, |rig| slave_par(rig) == 0x43);
            assert_eq!(rig.slave.w_PAR_NR.load(), 300, "the first real job is no change of another one");
        }
    }
}

/// Decision D-06: the firmware also answers a job of the master's application while another job waits for the slave's
/// application.
#[test]
fn the_status_word_of_an_active_slave_never_reaches_its_application() {
    for rate in FASTEST {
        let mut rig = connected(Memory::Heap, rate);
        rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(121);
        enter_parameter(&rig, 0x03);
        run_until(&mut rig, 5, |rig| master_par(rig) == 0x02);
        assert_eq!((rig.master.a_DATA_PARAMETER[0].d_PAR_VALUE.load(), slave_par(&rig)), (0x0000, 0x00));
        rig.step(30_000);
        enter_parameter(&rig, 0x03);
        run_until(&mut rig, 5, |rig| master_par(rig) == 0x02);
        assert_eq!((rig.master.a_DATA_PARAMETER[0].d_PAR_VALUE.load(), slave_par(&rig)), (0x8000, 0x00));
        enter_parameter(&rig, 0x05);
        run_until(&mut rig, 5, |rig| slave_par(rig) == 0x45);
        assert_eq!(rig.slave.w_PAR_NR.load(), 121, "writing it is the application's");
    }
}

/// Manual p. 181-182, with the deadlines of D-09: the firmware builds and acknowledges the frame whether or not the
/// master requests it.
#[test]
fn own_actual_values_are_taken_at_their_deadline() {
    for rate in RATES {
        let deadline = u64::from(rate.timing.deadline_RDC1.earliest);
        for (release_at, in_time) in [(0, true), (deadline - 1, true), (deadline, false)] {
            for asked in [0, 1] {
                let mut rig = connected(Memory::Heap, rate);
                rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
                rig.master.b_CTRLREG_RD_ORDER_RDC1.store(asked);
                rig.master.b_CTRLREG_WRC1.store(0x05);
                rig.step(release_at);
                rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
                rig.run_to_sync();
                assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), if in_time { 0x04 } else { 0x05 });
                assert_eq!(rig.last_frame(0x300..=0x37F).is_some(), in_time && asked == 0);
                let missed = |event: &Event| {
                    event.get().is_some_and(|it: Missed| it.origin.node == rate.kind.slave.port)
                };
                let missed = rig.records().any(|record| missed(&record.event));
                assert_eq!(missed, !in_time && asked == 0, "only a frame that was asked for is missed");
            }
        }
    }
}
