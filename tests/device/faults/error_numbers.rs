//! Every error number of both lists. A slave sends each number once, and the PLC of the master receives it.

use super::*;
use crate::rig::{FASTEST, Memory};
use commram::devices::cansync::registers::values::{par_error, updown_error};

/// Cause of an error number.
#[derive(Clone, Copy)]
enum ErrorSource {
    /// A job to the drive: control register, parameter, value.
    Job(u8, u16, u32),
    /// A job that the application of slave node 0 refuses with that number.
    Application,
    /// An up-/download to slave node 0: control register, base address, length.
    Block(u8, u32, u16),
    /// A download to slave node 0 that the fault with this text disturbs.
    Fault(&'static str),
    /// The error comes from a fault, which answers in place of the slave.
    Slave,
}

/// Manual 5.00005.03a p. 166.
const PARAMETER: [(u16, ErrorSource); 7] = [
    (par_error::GENERAL, ErrorSource::Job(0x01, 1000, 0)), // neither read nor write (D-41)
    (par_error::BELOW_MINIMUM, ErrorSource::Job(0x05, 1000, 9)),
    (par_error::ABOVE_MAXIMUM, ErrorSource::Job(0x05, 1000, 501)),
    (par_error::NOT_CHANGEABLE, ErrorSource::Job(0x05, 121, 0)),
    (par_error::NOT_PRESENT, ErrorSource::Job(0x03, 999, 0)),
    (par_error::NOT_AVAILABLE_NOW, ErrorSource::Application),
    (par_error::DATA_FORMAT, ErrorSource::Job(0x15, 1000, 100)),
];

/// Manual 5.00005.03a p. 168; the list has no 16#0106.
const UPDOWN: [(u16, ErrorSource); 11] = [
    (updown_error::WRONG_BLOCK, ErrorSource::Fault("kind = 'wrong_offset'\nslave = 0\ncount = 1")),
    (updown_error::LENGTH, ErrorSource::Block(0x15, 0x1000, 301)),
    (
        updown_error::EXPECTS_OTHER_BLOCK,
        ErrorSource::Fault("kind = 'wrong_offset'\nslave = 0\nslot = 'CC'\noffset = 12\ncount = 1"),
    ),
    (updown_error::EXPECTS_END, ErrorSource::Slave),
    (updown_error::END_TOO_EARLY, ErrorSource::Slave),
    (updown_error::SLAVE_CANCELS, ErrorSource::Application),
    (updown_error::NOT_POSSIBLE, ErrorSource::Block(0x15, 0x1000, 0)),
    (updown_error::BASE_ADDRESS, ErrorSource::Block(0x05, 0xFF, 6)),
    (updown_error::TOO_LONG, ErrorSource::Slave),
    (updown_error::MODE, ErrorSource::Slave),
    (0x0200, ErrorSource::Application), // above 16#00FF: a number of the slave's application (p. 192)
];

#[test]
fn every_error_number_of_a_parameter_job() {
    for rate in FASTEST {
        for (number, by) in PARAMETER {
            let mut rig = running(Memory::Heap, rate);
            let slave = match by {
                ErrorSource::Job(control, parameter, value) => {
                    enter_parameter(&rig, DRIVE, control, parameter, value);
                    DRIVE
                }
                ErrorSource::Application => {
                    enter_parameter(&rig, 0, 0x03, 300, 0);
                    intervals(&mut rig, 3);
                    rig.slave.w_ERR_NR_PAR_CMD.store(number);
                    rig.slave.b_STATREG_PAR_CMD.store(0x62);
                    rig.slave.b_STEUREG_PAR_CMD.store(0x62);
                    0
                }
                ErrorSource::Block(..) | ErrorSource::Fault(_) | ErrorSource::Slave => unreachable!(),
            };
            intervals(&mut rig, 3);
            let (control, value) = parameter(&rig, slave);
            assert_eq!((control & 0x61, value), (0x20, number.into()), "16#{number:04X}");
        }
    }
}

#[test]
fn every_error_number_of_an_up_or_download() {
    for rate in FASTEST {
        for (number, by) in UPDOWN {
            let mut rig = running(Memory::Heap, rate);
            match by {
                ErrorSource::Block(control, address, length) => enter_block(&rig, control, address, length),
                ErrorSource::Fault(fault) => {
                    add(&mut rig, fault);
                    enter_block(&rig, 0x15, 0x1000, 24);
                }
                ErrorSource::Slave => {
                    let at = rig.plant.now() + 10_000;
                    add(
                        &mut rig,
                        &format!(
                            "kind = 'slave_error'\nslave = 0\nerror = {number}\nat_us = {at}\ncount = 1"
                        ),
                    );
                    enter_block(&rig, 0x15, 0x1000, 60);
                }
                ErrorSource::Application => {
                    enter_block(&rig, 0x15, 0x1000, 24);
                    intervals(&mut rig, 3);
                    rig.slave.w_ERR_NR_UPDOWNBLK1.store(number);
                    rig.slave.b_STATREG_UPDOWNBLK1.store(0x74);
                    rig.slave.b_STEUREG_UPDOWNBLK1.store(0x74);
                }
                ErrorSource::Job(..) => unreachable!(),
            }
            serve_block(&mut rig, 20);
            let (control, error, _) = block(&rig);
            assert_eq!((control & 0x61, error), (0x20, number), "16#{number:04X}");
        }
    }
}

/// The fault `slave_error` can make a drive or a node answer any error number of either list.
#[test]
fn a_slave_can_be_made_to_answer_any_error_number() {
    for rate in FASTEST {
        for (number, _) in PARAMETER {
            for slave in [0, DRIVE] {
                let mut rig = running(Memory::Heap, rate);
                add(&mut rig, &format!("kind = 'slave_error'\nslave = {slave}\nerror = {number}\ncount = 1"));
                enter_parameter(&rig, slave, 0x15, 300, 1);
                intervals(&mut rig, 2);
                assert_eq!(parameter(&rig, slave), (0x34, number.into()));
                assert_eq!(rig.slave.b_STEUREG_PAR_CMD.load(), 0, "no application has seen the job");
            }
        }
        for (number, _) in UPDOWN {
            let mut rig = running(Memory::Heap, rate);
            add(&mut rig, &format!("kind = 'slave_error'\nslave = 0\nerror = {number}\ncount = 1"));
            enter_block(&rig, 0x05, 0x1000, 12);
            intervals(&mut rig, 2);
            let (control, error, _) = block(&rig);
            assert_eq!((control, error), (0x24, number));
        }
    }
}
