//! Mapping and exchange of process data: `CANsync_PD_CFG_...`, `CANsync_PD_COMM_...`.

use super::bench::{Bench, Dead};
use super::device::*;
use crate::rig::{BOTH, Memory};

const NEW: CANsync_RD_BMARRAY = [[0; 16]; 32];

/// Manual p. 234: the example of the mapping, and words without a value.
#[test]
fn mapping_of_reference_values_as_in_the_manual() {
    let dead = Dead::new();
    let ma = dead.master();
    CANsync_PD_CFG_MA {
        a_WRC1: [1, 1, 0, 2],
        a_HL_WRC1: [false, true, false, false],
        a_WRC2: [7, -1, 3, 4],
        a_HL_WRC2: [true; 4],
    }
    .call(&ma);
    let cfg = ma._CFG_WRC_WORD.snapshot();
    let words1 = [cfg.b_CFG_WRC1_WORD0, cfg.b_CFG_WRC1_WORD1, cfg.b_CFG_WRC1_WORD2, cfg.b_CFG_WRC1_WORD3];
    let words2 = [cfg.b_CFG_WRC2_WORD0, cfg.b_CFG_WRC2_WORD1, cfg.b_CFG_WRC2_WORD2, cfg.b_CFG_WRC2_WORD3];
    assert_eq!(words1, [0x05, 0x07, 0x01, 0x09]);
    assert_eq!(words2, [0x1F, 0x00, 0x00, 0x13], "value 3 does not belong to frame 2");
}

/// Manual p. 237, 240: the example of the mapping, at the master for slave 3 and at a slave.
#[test]
fn mapping_of_actual_values_as_in_the_manual() {
    let dead = Dead::new();
    let ma = dead.master();
    let sl = dead.slave();
    let (a_RDC1, a_HL_RDC1) = ([1, 1, 0, 2], [false, true, false, false]);
    let (a_RDC2, a_HL_RDC2) = ([4, -1, 5, 5], [false, true, true, false]);
    let (si_SL_NR, wrong) = (3, 32);
    CANsync_PD_CFG_READ_MA { si_SL_NR, a_RDC1, a_HL_RDC1, a_RDC2, a_HL_RDC2 }.call(&ma);
    CANsync_PD_CFG_READ_MA { si_SL_NR: wrong, ..Default::default() }.call(&ma);
    CANsync_PD_CFG_READ_SL { si_SL_NR, a_RDC1, a_HL_RDC1, a_RDC2, a_HL_RDC2 }.call(&sl);
    let whole = CANsync_PD_CFG_SL { a_RDC1, a_HL_RDC1, a_RDC2, a_HL_RDC2, ..Default::default() };
    whole.clone().call(&sl);
    for cfg in [&ma.a_CFG_RDC_WORD[3], &sl.a_CFG_RDC_WORD[3], &sl._CFG_RDC_WORD].map(|cfg| cfg.snapshot()) {
        let words1 = [cfg.b_CFG_RDC1_WORD0, cfg.b_CFG_RDC1_WORD1, cfg.b_CFG_RDC1_WORD2, cfg.b_CFG_RDC1_WORD3];
        let words2 = [cfg.b_CFG_RDC2_WORD0, cfg.b_CFG_RDC2_WORD1, cfg.b_CFG_RDC2_WORD2, cfg.b_CFG_RDC2_WORD3];
        assert_eq!((words1, words2), ([0x05, 0x07, 0x01, 0x09], [0x11, 0x00, 0x17, 0x15]));
    }
    assert_eq!(ma.a_CFG_RDC_WORD[2].b_CFG_RDC1_WORD0.load(), 0);
}

/// Returns a bench in active operation. The master sends reference values 0, 1 and 4. The slave takes them and sends
/// its own actual values 0 and 5. Both receive the frames of the drive (slave 1).
pub(crate) fn mapped(memory: Memory) -> Bench {
    let bench = Bench::active(memory);
    let low_high = [false, true, false, true];
    CANsync_PD_CFG_MA {
        a_WRC1: [0, 0, 1, 1],
        a_HL_WRC1: low_high,
        a_WRC2: [4, 4, -1, -1],
        a_HL_WRC2: low_high,
    }
    .call(&bench.ma);
    CANsync_PD_CFG_SL {
        a_WRC1: [0, 0, 1, 1],
        a_HL_WRC1: low_high,
        a_WRC2: [4, 4, -1, -1],
        a_HL_WRC2: low_high,
        a_RDC1: [0, 0, -1, -1],
        a_HL_RDC1: low_high,
        a_RDC2: [5, 5, -1, -1],
        a_HL_RDC2: low_high,
    }
    .call(&bench.sl);
    let from = |si_SL_NR| CANsync_PD_CFG_READ_MA {
        si_SL_NR,
        a_RDC1: [0, 0, -1, -1],
        a_HL_RDC1: low_high,
        a_RDC2: [5, 5, -1, -1],
        a_HL_RDC2: low_high,
    };
    from(0).call(&bench.ma);
    from(1).call(&bench.ma);
    CANsync_PD_CFG_READ_SL { si_SL_NR: 1, a_RDC1: [0, 0, -1, -1], a_HL_RDC1: low_high, ..Default::default() }
        .call(&bench.sl);
    bench
}

/// Manual p. 247-260: both blocks in their event tasks, over several intervals.
#[test]
fn master_slave_and_drive_exchange_process_data() {
    for memory in BOTH {
        let mut bench = mapped(memory);
        let mut ma = CANsync_PD_COMM_MA {
            a_WR_VALUES_SEND: [5000, -2, 0, 0, 0x1234_5678, 0, 0, 0],
            si_WRC1_SEND: 5,
            si_WRC2_SEND: 5,
            si_MAX_SL_NR: 1,
            x_COPY_TO_RD_ARRAY: true,
            ..Default::default()
        };
        let mut sl = CANsync_PD_COMM_SL {
            a_RD_VALUES_SEND: [-77, 0, 0, 0, 0, 99_999, 0, 0],
            si_RDC1_SEND: 5,
            si_RDC2_SEND: 5,
            x_COPY_TO_RD_ARRAY: true,
            ..Default::default()
        };
        let (mut at_master, mut at_slave) = (NEW, NEW);
        let (mut heard1, mut heard2, mut overheard) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..20 {
            bench.rig.run_to_sync();
            sl.call(&bench.sl, &mut at_slave);
            ma.call(&bench.ma, &mut at_master);
            heard1.push(ma.si_RD_SL_NR1_RECEIVED);
            heard2.push(ma.si_RD_SL_NR2_RECEIVED);
            overheard.push(sl.si_RD_SL_NR1_RECEIVED);
        }
        assert_eq!([sl.si_WRC1_RECEIVED, sl.si_WRC2_RECEIVED], RECEIVED, "{memory:?}");
        assert_eq!(sl.a_WR_VALUES_RECEIVED, [5000, -2, 0, 0, 0x1234_5678, 0, 0, 0]);
        assert_eq!(at_master[0][..8], [-77, 0, 0, 0, 0, 99_999, 0, 0]);
        assert_eq!(at_master[1][0], 5000, "the drive follows its reference value");
        assert_eq!(at_slave[1][0], 5000, "the slave overhears the drive");
        assert_eq!(at_slave[0], [0; 16], "never its own values (p. 258)");
        // The master receives from slaves 0 and 1 in turn, and from no slave before the end of the first interval.
        assert!(heard1.ends_with(&[0, 1, 0, 1]) || heard1.ends_with(&[1, 0, 1, 0]), "{heard1:?}");
        assert_eq!(heard1, heard2);
        assert_eq!(heard1[0], -128);
        assert!(overheard.ends_with(&[-128, 1]) || overheard.ends_with(&[1, -128]), "{overheard:?}");
    }
}

/// Manual p. 250, 259: only the value 5 releases a frame.
#[test]
fn values_that_are_not_valid_are_not_sent() {
    let mut bench = mapped(Memory::Heap);
    let mut ma = CANsync_PD_COMM_MA { a_WR_VALUES_SEND: [1; 8], si_WRC1_SEND: 5, ..Default::default() };
    let mut sl = CANsync_PD_COMM_SL { a_RD_VALUES_SEND: [1; 8], si_RDC2_SEND: 4, ..Default::default() };
    let (mut at_master, mut at_slave) = (NEW, NEW);
    for _ in 0..4 {
        bench.rig.run_to_sync();
        sl.call(&bench.sl, &mut at_slave);
        ma.call(&bench.ma, &mut at_master);
    }
    assert_eq!((sl.si_WRC1_RECEIVED, sl.si_WRC2_RECEIVED), (RECEIVED[0], 0));
    assert_eq!(sl.a_WR_VALUES_RECEIVED[4], 0);
    assert_eq!(bench.ma.a_WR_VALUE[4].load(), 0);
    assert_eq!(bench.sl.a_RD_VALUE_SEND[4].load(), 0);
    assert_eq!(at_master, NEW, "x_COPY_TO_RD_ARRAY is FALSE");
}

/// Manual p. 252-255: a block reads the values of one slave while `x_COPY_TO_RD_ARRAY` is FALSE.
#[test]
fn values_of_one_slave_are_read_once() {
    let mut bench = mapped(Memory::Heap);
    let mut ma = CANsync_PD_COMM_MA {
        a_WR_VALUES_SEND: [42; 8],
        si_WRC1_SEND: 5,
        si_RD_SL_NR1_RECEIVE: 1,
        si_RD_SL_NR2_RECEIVE: -1,
        ..Default::default()
    };
    let mut unused = NEW;
    for _ in 0..8 {
        bench.rig.run_to_sync();
        ma.call(&bench.ma, &mut unused);
    }
    assert_eq!(ma.si_RD_SL_NR1_RECEIVED, 1);
    assert_eq!(ma.si_RD_SL_NR2_RECEIVED, -128, "no slave was asked");
    let mut read_ma = CANsync_PD_COMM_READ_MA { si_SL_NR: 1, ..Default::default() };
    let mut read_sl = CANsync_PD_COMM_READ_SL { si_SL_NR: 1, ..Default::default() };
    read_ma.call(&bench.ma);
    read_sl.call(&bench.sl);
    assert_eq!([read_ma.a_RD_VALUES[0], read_sl.a_RD_VALUES[0]], [42, 42]);
    assert_eq!((read_ma.si_RD_SL_NR1_RECEIVED, read_ma.si_RD_SL_NR2_RECEIVED), (RECEIVED[0], 0));
    assert_eq!((read_sl.si_RD_SL_NR1_RECEIVED, read_sl.si_RD_SL_NR2_RECEIVED), (RECEIVED[0], 0));
    read_ma.call(&bench.ma);
    read_sl.call(&bench.sl);
    assert_eq!((read_ma.si_RD_SL_NR1_RECEIVED, read_sl.si_RD_SL_NR1_RECEIVED), (0, 0));
    assert_eq!(read_ma.a_RD_VALUES[0], 42, "the old values stay");
    read_ma.si_SL_NR = 32;
    read_ma.call(&bench.ma);
    assert_eq!(read_ma.si_RD_SL_NR1_RECEIVED, 0);
}

/// Manual p. 250 and decision D-208: the inputs decide which slave is polled.
#[test]
fn requests_follow_the_inputs() {
    let dead = Dead::new();
    let base = dead.master();
    for (input, register) in [(-128, 0x80), (0, 0), (31, 31), (-1, 0xFF), (32, 0xFF), (-2, 0xFF), (5, 5)] {
        let mut block = CANsync_PD_COMM_MA { si_RD_SL_NR1_RECEIVE: input, ..Default::default() };
        block.si_MAX_SL_NR = input;
        block.call(&base, &mut NEW.clone());
        assert_eq!(base.b_CTRLREG_RD_ORDER_RDC1.load(), register, "{input}");
        assert_eq!(base.b_CTRLREG_RD_ORDER_RDC2.load(), 0x80);
    }
    assert_eq!(base.b_MAX_SL_NR.load(), 5);
}
