//! Blocks without firmware: the test plays the firmware and sets the registers itself.

use super::bench::Dead;
use super::device::*;
use std::time::Duration;

#[test]
fn an_initialization_hands_over_the_bit_timing_of_its_baud_rate() {
    for &(us_BAUDRATE, timing, error) in TIMINGS {
        let dead = Dead::new();
        let base = dead.init();
        let mut init = CANsync_INIT { us_BAUDRATE, us_SYNC_INTERVAL: 1, ..Default::default() };
        for state in [0x0001, 0x0002, 0x0003] {
            init.call(&base);
            base.w_OPTION_STATUS.store(state);
        }
        init.call(&base);
        assert_eq!([base.b_BT_0.load(), base.b_BT_1.load()], timing, "{us_BAUDRATE}");
        assert_eq!((init.w_ERR, init.x_OK, init.x_ERR), (error, error == 0, error != 0));
        assert_eq!((base.b_TIME_PATTERN.load(), base.b_MA_SL_MODE.load()), (1, 0));
    }
}

#[test]
fn a_parameter_of_another_format_gives_the_result_of_the_manual() {
    // For each case: true if the block requests a doubleword, and true if the answer is a doubleword.
    for (asked, answered) in [(false, false), (true, true), (false, true), (true, false)] {
        let dead = Dead::new();
        let base = dead.master();
        let mut read = CANsync_PAR_READ_MA {
            si_SL_NR: 5,
            u_PAR_NR: 1000,
            x_PAR_FORMAT: asked,
            x_EN: true,
            ..Default::default()
        };
        read.call(&base);
        let job = &base.a_CTRLREG_PAR_CMD_SL[5];
        assert_eq!(job.b_STEUREG_PAR_CMD.load(), if asked { 0x13 } else { 0x03 });
        base.a_DATA_PARAMETER[5].d_PAR_VALUE.store(77);
        job.b_STEUREG_PAR_CMD.store(if answered { 0x12 } else { 0x02 });
        read.call(&base);
        let [doubleword, word] = FORMAT_ERRORS;
        let error = if asked == answered {
            0
        } else if answered {
            doubleword
        } else {
            word
        };
        assert_eq!((read.b_ERR, read.x_ERR, read.x_OK), (error, error != 0, error == 0));
        assert_eq!((read.ud_PAR_VALUE, read.x_PAR_FORMAT_READ), (77, answered));
        assert!(!read.x_BUSY);
        // After an error the block accepts a job only when it has been reset.
        read.x_EN = false;
        read.call(&base);
        read.x_EN = true;
        read.call(&base);
        assert_eq!(read.x_BUSY, error == 0);
    }
}

#[test]
fn frames_received_show_the_numbers_of_the_manual_once() {
    let dead = Dead::new();
    let (ma, sl) = (dead.master(), dead.slave());
    let mut comm = CANsync_PD_COMM_SL::default();
    let mut of_master = CANsync_PD_COMM_READ_MA { si_SL_NR: 3, ..Default::default() };
    let mut of_slave = CANsync_PD_COMM_READ_SL { si_SL_NR: 3, ..Default::default() };
    let mut shown = |one: u8, two: u8| {
        sl.b_CTRLREG_WRC1.store(one);
        sl.b_CTRLREG_WRC2.store(two);
        for states in [&ma.a_STATREG_RDC[3], &sl.a_STATREG_RDC[3]] {
            states.b_STATREG_RDC1.store(one);
            states.b_STATREG_RDC2.store(two);
        }
        comm.call(&sl, &mut [[0; 16]; 32]);
        of_master.call(&ma);
        of_slave.call(&sl);
        let shown = [comm.si_WRC1_RECEIVED, comm.si_WRC2_RECEIVED];
        assert_eq!([of_master.si_RD_SL_NR1_RECEIVED, of_master.si_RD_SL_NR2_RECEIVED], shown);
        assert_eq!([of_slave.si_RD_SL_NR1_RECEIVED, of_slave.si_RD_SL_NR2_RECEIVED], shown);
        shown
    };
    let [one, two] = RECEIVED;
    assert_eq!(shown(2, 2), [one, two]);
    assert_eq!(shown(0, 0), [0, 0]);
    assert_eq!(shown(2, 0), [one, 0]);
    assert_eq!(shown(0, 2), [0, two]);
}

#[test]
fn a_transfer_that_fails_sets_the_bit_of_the_manual() {
    let [slave, length, timeout] = TRANSFER_ERRORS;
    let failed = |u_LENGTH, answer: Option<u16>| {
        let dead = Dead::new();
        let base = dead.master();
        let t_TIME = Duration::from_millis(10);
        let mut transfer = CANsync_UPDOWNLOAD_MA { u_LENGTH, t_TIME, x_EN: true, ..Default::default() };
        let mut data = [0; 2048];
        transfer.call(&base, &[0; 2048], &mut data);
        match answer {
            Some(number) => {
                base.w_ERR_NR_UPDOWNBLK1.store(number);
                base.b_STEUREG_UPDOWNBLK1.store(0x20);
            }
            None => dead.pass(10_000),
        }
        transfer.call(&base, &[0; 2048], &mut data);
        assert!(!transfer.x_OK && !transfer.x_BUSY);
        assert_eq!(transfer.x_ERR, transfer.b_ERR != 0);
        assert_eq!(transfer.x_ERR_SL, transfer.w_ERR_SL != 0);
        (transfer.b_ERR, transfer.w_ERR_SL)
    };
    assert_eq!(failed(1, Some(0x0103)), (slave, 0x0103));
    assert_eq!(failed(0, None), (length, 0));
    assert_eq!(failed(2049, None), (length, 0));
    assert_eq!(failed(1, None), (timeout, 0));
}

/// Tests every preset that the manuals name (5.00005.03a; 5.02066.01a).
#[test]
fn presets_are_the_manuals() {
    let comm_control = CANsync_COMM_CONTROL_MA::default();
    let numbers = [comm_control.si_SL_NR_CTRL, comm_control.si_SL_NR_PAR, comm_control.si_SL_NR_UDL];
    assert_eq!(numbers, [-128; 3], "p. 205-206; 113-116");
    assert_eq!(comm_control.si_MAX_SL_NR, -1, "p. 206; 113-116");
    let init = CANsync_INIT::default();
    assert_eq!((init.b_ACCEPT_CODE, init.b_ACCEPT_MASK), (0xFF, 0xFF), "p. 214; 122-127");
    assert_eq!((init.us_BAUDRATE, init.x_SYNC_IN), (0, false), "p. 214; 122-127");
    assert_eq!(CANsync_PAR_READ_MA::default().t_TIME, Duration::from_secs(3), "p. 223; 136-139");
    assert_eq!(CANsync_PAR_WRITE_MA::default().t_TIME, Duration::from_secs(3), "p. 231; 146-149");
    let comm = CANsync_PD_COMM_MA::default();
    assert_eq!((comm.si_RD_SL_NR1_RECEIVE, comm.si_RD_SL_NR2_RECEIVE), (-128, -128), "p. 250; 168-173");
    assert_eq!((comm.si_MAX_SL_NR, comm.x_COPY_TO_RD_ARRAY), (-1, false), "p. 250-251; 168-173");
    assert!(!CANsync_PD_COMM_SL::default().x_COPY_TO_RD_ARRAY, "p. 259; 180-184");
    assert_eq!(CANsync_UPDOWNLOAD_MA::default().us_MAX_NR_OF_COMM, 1, "p. 266; 187-192");
    assert_eq!(CANsync_UPDOWNLOAD_SL::default().t_TIME, Duration::from_secs(30), "p. 270; 193-196");
}
