//! Blocks of both devices against a firmware that the test plays: it sets the registers itself.

#![allow(non_snake_case, reason = "the manuals' names, letter for letter")]

use commram::memory::{Header, Segment, View};
use commram::plc::Ram;

/// RAM behind which no firmware runs, with a clock that the test sets.
struct Played {
    ram: Ram,
    header: View<Header>,
}

impl Played {
    fn new(device: &'static commram::layout::Device) -> Self {
        let segment = Segment::of(device);
        Played { ram: Ram::of(&segment).unwrap(), header: segment.header().unwrap() }
    }

    fn pass(&self, us: u64) {
        self.header.virtual_time_us.store(self.header.virtual_time_us.load() + us);
    }
}

/// The tests over a device: its types, where a master and a slave lie, and what its manual says.
macro_rules! tests {
    ($name:ident, $device:ident, $init:ident $ma:ident $sl:ident, $master:expr, $slave:expr,
     rates $rates:expr, format_errors $formats:expr, received $received:expr, transfer_errors $errors:expr) => {
        mod $name {
            use super::Played;
            use commram::devices::$device::blocks::*;
            use commram::devices::$device::registers::*;
            use std::time::Duration;

            #[test]
            fn an_initialization_hands_over_the_bit_timing_of_its_baud_rate() {
                let cases: &[(u8, [u8; 2], u16)] = $rates;
                for &(us_BAUDRATE, timing, error) in cases {
                    let played = Played::new(&DEVICE);
                    let base = played.ram.at::<$init>($master).unwrap();
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
            fn a_parameter_of_another_format_is_what_the_manual_says() {
                // Asked for a doubleword, answered with one.
                for (asked, answered) in [(false, false), (true, true), (false, true), (true, false)] {
                    let played = Played::new(&DEVICE);
                    let base = played.ram.at::<$ma>($master).unwrap();
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
                    let [doubleword, word]: [u8; 2] = $formats;
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
                    // After an error only a reset makes it ready again.
                    read.x_EN = false;
                    read.call(&base);
                    read.x_EN = true;
                    read.call(&base);
                    assert_eq!(read.x_BUSY, error == 0);
                }
            }

            #[test]
            fn frames_received_show_the_numbers_of_the_manual_once() {
                let played = Played::new(&DEVICE);
                let (ma, sl) =
                    (played.ram.at::<$ma>($master).unwrap(), played.ram.at::<$sl>($slave).unwrap());
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
                let [one, two]: [i8; 2] = $received;
                assert_eq!(shown(2, 2), [one, two]);
                assert_eq!(shown(0, 0), [0, 0]);
                assert_eq!(shown(2, 0), [one, 0]);
                assert_eq!(shown(0, 2), [0, two]);
            }

            #[test]
            fn a_transfer_that_fails_sets_the_bit_of_the_manual() {
                let [slave, length, timeout]: [u8; 3] = $errors;
                let failed = |u_LENGTH, answer: Option<u16>| {
                    let played = Played::new(&DEVICE);
                    let base = played.ram.at::<$ma>($master).unwrap();
                    let t_TIME = Duration::from_millis(10);
                    let mut transfer =
                        CANsync_UPDOWNLOAD_MA { u_LENGTH, t_TIME, x_EN: true, ..Default::default() };
                    let mut data = [0; 2048];
                    transfer.call(&base, &[0; 2048], &mut data);
                    match answer {
                        Some(number) => {
                            base.w_ERR_NR_UPDOWNBLK1.store(number);
                            base.b_STEUREG_UPDOWNBLK1.store(0x20);
                        }
                        None => played.pass(10_000),
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
        }
    };
}

// 5.00005.03a p. 214, 224, 253-259, 267.
tests!(
    omega, omega_drive_line_2,
    CANsync_INIT_BMSTRUCT CANsync_MA_CTRL_BMSTRUCT CANsync_SL_CTRL_BMSTRUCT, NODE2, NODE1,
    rates &[(5, [0x00, 0x1C], 0), (4, [0x01, 0x1C], 0), (3, [0x03, 0x1C], 0), (6, [0x03, 0x1C], 2), (2, [0x03, 0x1C], 2)],
    format_errors [0, 0], received [2, 2], transfer_errors [0, 2, 1]
);

// 5.02066.01a p. 126, 139, 176-184, 192.
tests!(
    bm4_slot_g, bm4_o_can_06,
    CANsync_PLC_INIT_BMSTRUCT CANsync_PLC_MA_BMSTRUCT CANsync_PLC_SL_BMSTRUCT, 2_001_792, 7_001_792,
    rates &[
        (6, [0x40, 0x34], 0), (5, [0x41, 0x34], 0), (4, [0x43, 0x34], 0), (3, [0x47, 0x34], 0),
        (7, [0x47, 0x34], 2), (2, [0x47, 0x34], 2),
    ],
    format_errors [4, 8], received [1, 2], transfer_errors [1, 2, 4]
);
