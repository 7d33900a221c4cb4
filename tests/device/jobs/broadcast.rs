//! Broadcast and control word commands, and their order of priority.

use super::bench::Bench;
use crate::rig::{BOTH, FASTEST, RATES, Rig};
use commram::devices::cansync::frames::Frame;

/// Returns the frames of the command channel since `mark`.
fn commands(rig: &Rig, mark: u64) -> Vec<Frame> {
    let of_the_channel = |frame: &Frame| frame.id() == 0x010 || frame.id() & 0x780 == 0x500;
    rig.frames()
        .into_iter()
        .filter(|(time, frame)| *time > mark && of_the_channel(frame))
        .map(|(_, frame)| frame)
        .collect()
}

/// T10, 5.00005.03a p. 163: the control word for slave 3 is an action command with bit 3 alone.
#[test]
fn a_control_word_goes_to_its_slave() {
    for memory in BOTH {
        for rate in RATES {
            let mut rig = Rig::new(memory, rate);
            rig.activate();
            rig.run_to_sync(); // "SYNC mode: on" is through
            let mark = rig.plant.now();
            rig.master.b_SL_NR_CONTROLWORD.store(3);
            rig.master.a_CONTROLWORD_SL[3].store(0x1234);
            rig.master.a_STEUREG_CONTROLWORD[3].store(0x05);
            rig.run_to_sync();
            assert_eq!(rig.master.a_STEUREG_CONTROLWORD[3].load(), 0x04, "acknowledged in the same interval");
            rig.run_to_sync();
            let frames = commands(&rig, mark);
            assert_eq!(frames.len(), 1);
            assert_eq!((frames[0].id(), frames[0].data()), (0x010, &[8, 0, 0, 0, 0x01, 0, 0x34, 0x12][..]));
        }
    }
}

/// T11 and T29: a broadcast command goes out in this interval, to all slaves with the full mask.
#[test]
fn a_broadcast_command_goes_out_at_once_and_reaches_the_slave() {
    for memory in BOTH {
        for rate in RATES {
            let mut rig = Rig::new(memory, rate);
            rig.activate();
            rig.run_to_sync();
            let mark = rig.plant.now();
            rig.master.d_SL_MASK_BC0.store(0xFFFF_FFFF);
            rig.master.b_CMD_BC0.store(0x80);
            rig.master.b_DATA_BYTE_BC0.store(0x5A);
            rig.master.w_DATA_WORD_BC0.store(0xBEEF);
            rig.master.b_CTRL_REG_BC0.store(0x05);
            rig.run_to_sync();
            assert_eq!(rig.master.b_CTRL_REG_BC0.load(), 0x04);
            rig.run_to_sync();
            let frames = commands(&rig, mark);
            assert_eq!(frames.len(), 1);
            assert_eq!(frames[0].data(), [0xFF, 0xFF, 0xFF, 0xFF, 0x80, 0x5A, 0xEF, 0xBE]);
            assert_eq!(rig.slave.b_STATREG_AKT_CMD.load(), 0x02);
            assert_eq!(rig.slave.b_AKT_CMD.load(), 0x80);
            assert_eq!(rig.slave.b_DATA_BYTE_AKT_CMD.load(), 0x5A);
            assert_eq!(rig.slave.w_DATAWORD_AKT_CMD.load(), 0xBEEF);
        }
    }
}

/// 5.00005.03a p. 162: a PLC that enters broadcast command 0 in every interval, at the start of its event task,
/// keeps all other commands waiting.
#[test]
fn broadcast_command_0_in_every_interval_blocks_everything_else() {
    for rate in RATES {
        let mut rig = Rig::new(BOTH[0], rate);
        rig.activate();
        rig.run_to_sync();
        let mark = rig.plant.now();
        rig.master.b_CMD_BC0.store(0x81);
        rig.master.b_CTRL_REG_BC1.store(0x05);
        rig.master.a_STEUREG_CONTROLWORD[0].store(0x05);
        for _ in 0..10 {
            rig.step(80);
            assert_ne!(rig.master.b_CTRL_REG_BC0.load(), 0x05, "the last one is acknowledged by now");
            rig.master.b_CTRL_REG_BC0.store(0x05);
            rig.run_to_sync();
        }
        assert_eq!(rig.master.b_CTRL_REG_BC1.load(), 0x05);
        assert_eq!(rig.master.a_STEUREG_CONTROLWORD[0].load(), 0x05);
        rig.step(rate.interval_us / 2);
        let frames = commands(&rig, mark);
        assert_eq!(frames.len(), 10);
        assert!(frames.iter().all(|frame| frame.data()[4] == 0x81));
    }
}

#[test]
fn each_broadcast_area_has_its_own_registers_and_0_comes_first() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            let regs = bench.regs.clone();
            let areas = [
                (
                    &regs.b_CTRL_REG_BC0,
                    &regs.d_SL_MASK_BC0,
                    &regs.b_CMD_BC0,
                    &regs.b_DATA_BYTE_BC0,
                    &regs.w_DATA_WORD_BC0,
                ),
                (
                    &regs.b_CTRL_REG_BC1,
                    &regs.d_SL_MASK_BC1,
                    &regs.b_CMD_BC1,
                    &regs.b_DATA_BYTE_BC1,
                    &regs.w_DATA_WORD_BC1,
                ),
                (
                    &regs.b_CTRL_REG_BC2,
                    &regs.d_SL_MASK_BC2,
                    &regs.b_CMD_BC2,
                    &regs.b_DATA_BYTE_BC2,
                    &regs.w_DATA_WORD_BC2,
                ),
            ];
            for (n, (control, mask, command, byte, word)) in (0u8..3).zip(areas) {
                mask.store(1 << n);
                command.store(0x80 + n);
                byte.store(0x10 + n);
                word.store(0x2000 + u16::from(n));
                control.store(0x05);
            }
            for n in 0..3 {
                let frame = bench.interval().unwrap();
                assert_eq!(frame.data(), [1 << n, 0, 0, 0, 0x80 + n, 0x10 + n, n, 0x20]);
                let done: Vec<bool> = areas.iter().map(|area| area.0.load() == 0x04).collect();
                assert_eq!(done, [true, n >= 1, n >= 2]);
            }
            assert_eq!(bench.interval(), None);
        }
    }
}

/// 5.00005.03a p. 160: with an explicit number only that slave is considered; 16#80 polls all slaves in turn.
#[test]
fn control_words_wait_for_their_slaves_turn() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            for n in 0..32 {
                bench.regs.a_CONTROLWORD_SL[n].store(0x0100 + n as u16);
                bench.regs.a_STEUREG_CONTROLWORD[n].store(0x05);
            }
            bench.regs.b_MAX_SL_NR.store(31);
            bench.regs.b_SL_NR_CONTROLWORD.store(7);
            assert_eq!(bench.interval().unwrap().data(), [0x80, 0, 0, 0, 1, 0, 7, 1]);
            assert_eq!(bench.interval(), None, "slave 7 is served and no other is asked");
            bench.regs.b_SL_NR_CONTROLWORD.store(0x80);
            // Two intervals have passed; the counter advances even if the master does not use it (D-08).
            for slave in (2..32).chain(0..2).filter(|slave| *slave != 7) {
                if slave == 8 {
                    assert_eq!(bench.interval(), None, "nothing is left for slave 7");
                }
                let group = u32::from_le_bytes(bench.interval().unwrap().data()[..4].try_into().unwrap());
                assert_eq!(group, 1 << slave);
            }
            assert_eq!(bench.interval(), None);
            assert!(bench.regs.a_STEUREG_CONTROLWORD.iter().all(|cell| cell.load() == 0x04));
        }
    }
}

#[test]
fn slave_numbers_without_a_register_get_no_turn() {
    for rate in FASTEST {
        let mut bench = Bench::new(BOTH[0], rate);
        bench.regs.a_STEUREG_CONTROLWORD.iter().for_each(|cell| cell.store(0x05));
        for slave in 0..32 {
            bench.enter_parameter(slave, 0x05, 1, 1);
        }
        for number in (32..=0x7F).chain(0x81..=0xFF) {
            bench.regs.b_SL_NR_CONTROLWORD.store(number);
            bench.regs.b_SL_NR_PARAMETER.store(number);
            bench.regs.b_SL_NR_UPDOWN.store(number);
            bench.enter_block(0x15, number, 0x100, 12);
            assert_eq!(bench.interval(), None, "16#{number:02X}");
            bench.enter_block(0x15, number & 0x7F, 0x100, 12);
            assert_eq!(bench.interval(), None, "16#{number:02X} is not its lower seven bits");
        }
    }
}

/// T36, 5.00005.03a p. 160-162, followed by an up-/download.
#[test]
fn jobs_pending_at_once_go_out_in_the_order_of_their_areas() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            bench.enter_block(0x15, 0, 0x100, 12);
            bench.enter_parameter(0, 0x03, 121, 0);
            bench.regs.a_STEUREG_CONTROLWORD[0].store(0x05);
            bench.regs.b_CMD_BC2.store(0x92);
            bench.regs.b_CTRL_REG_BC2.store(0x05);
            bench.regs.b_CMD_BC1.store(0x91);
            bench.regs.b_CTRL_REG_BC1.store(0x05);
            let kinds: Vec<(u16, u8)> = (0..5)
                .map(|_| {
                    let frame = bench.interval().unwrap();
                    let (_, data) = (bench.no_answer(), frame.data());
                    if frame.id() == 0x500 && data[0] & 0x80 == 0 {
                        bench.put(0, 0, 0); // the parameter job would be repeated without end
                    }
                    (frame.id(), if frame.id() == 0x010 { data[4] } else { data[0] })
                })
                .collect();
            assert_eq!(kinds, [(0x010, 0x91), (0x010, 0x92), (0x010, 0x01), (0x500, 0x70), (0x500, 0xD0)]);
        }
    }
}

/// 5.00005.03a p. 162: the rule "history is not considered" also applies to the order of the lower areas among each
/// other.
#[test]
fn a_parameter_job_in_every_interval_starves_an_up_or_download() {
    for rate in FASTEST {
        let mut bench = Bench::new(BOTH[0], rate);
        bench.enter_block(0x05, 0, 0x100, 12);
        bench.enter_parameter(0, 0x03, 121, 0);
        for _ in 0..20 {
            assert!(bench.parameter_job().is_some(), "D-11: repeated as long as no slave answers");
            bench.no_answer();
        }
        assert_eq!(bench.block(), 0x05);
        bench.put(0, 0, 0);
        assert!(bench.updown_job().is_some());
    }
}

#[test]
fn jobs_wait_in_set_up_mode() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            bench.command_node(0x0020);
            bench.regs.b_CTRL_REG_BC0.store(0x05);
            bench.regs.b_CMD_BC0.store(0x99);
            for _ in 0..5 {
                assert_ne!(bench.interval().map(|frame| frame.data()[4]), Some(0x99));
            }
            assert_eq!(bench.regs.b_CTRL_REG_BC0.load(), 0x05);
            bench.activate();
            assert_eq!(bench.interval().map(|frame| frame.data()[4]), Some(0x99));
        }
    }
}
