//! Injected faults on a running plant: each kind, its effect on the registers, and its journal records.

mod controller;
mod each_kind;
mod error_numbers;
mod frames;
mod list;
mod recovery;
mod slaves;
mod slots;
mod sync;

use crate::rig::{Memory, Rate, Rig};
use commram::devices::cansync::records::SyncEdge;
use commram::devices::fault_kinds;
use commram::fault::{Fault, FaultSpec};
use commram::fault::{FaultNews, Hit, News};
use commram::journal::{Handshake, Register};

/// Slave number of the drive.
const DRIVE: usize = 1;

const DRIVES: &str = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n\
                      [[bus.drive.parameters]]\nnumber = 1000\nformat = 'word'\ninitial = 100\nmin = 10\nmax = 500\n\
                      [[bus.drive]]\nname = 'd2'\nslave_number = 2\nlock_time_us = 30000\n";

/// Returns the fault of a plant file's text, in which `MASTER` and `SLAVE` are the names of the nodes' ports.
fn fault(rig: &Rig, text: &str) -> Fault {
    let spec: FaultSpec = toml::from_str(&rig.rate.kind.named(text)).unwrap();
    spec.resolve(fault_kinds(), &rig.plant.names()).unwrap()
}

/// Adds a fault; returns its number.
pub(crate) fn add(rig: &mut Rig, text: &str) -> u16 {
    let fault = fault(rig, text);
    rig.plant.add_fault(fault).unwrap()
}

/// Returns all journal records about faults, with their times.
fn news(rig: &Rig) -> Vec<(u64, u16, News)> {
    let pending = rig.plant.journal().pending();
    let mut all: Vec<_> = rig
        .records()
        .chain(pending)
        .filter_map(|record| {
            let FaultNews { id, news, .. } = record.event.get()?;
            Some(record.times().map(move |time| (time, id, news)))
        })
        .flatten()
        .collect();
    all.sort_by_key(|(time, ..)| *time);
    all
}

/// Returns the numbers that the hits concerned.
fn hits(rig: &Rig) -> Vec<i32> {
    let hit = |(_, _, news)| match news {
        News::Hit(Hit::Plain) => Some(0),
        News::Hit(Hit::Frame(id)) => i32::try_from(id).ok(),
        News::Hit(Hit::Edge(us)) => Some(us),
        _ => None,
    };
    news(rig).into_iter().filter_map(hit).collect()
}

/// Returns a test rig with both nodes active and the drives locked, at a SYNC edge.
fn running(memory: Memory, rate: Rate) -> Rig {
    let mut rig = Rig::of(memory, rate, DRIVES);
    start(&mut rig);
    rig
}

/// Brings a test rig into the state that [`running`] returns.
fn start(rig: &mut Rig) {
    rig.activate();
    rig.step(60_000);
    rig.configure_wrc1([0x01, 0x03, 0, 0]);
    for slave in &rig.master.a_CFG_RDC_WORD {
        slave.b_CFG_RDC1_WORD0.store(0x01);
        slave.b_CFG_RDC1_WORD1.store(0x03);
    }
    rig.slave._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
    rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
    rig.slave.b_EN_UPDOWNBLK1.store(1);
    rig.master.b_CTRLREG_RD_ORDER_RDC1.store(DRIVE as u8);
    rig.run_to_sync();
}

/// Enters a parameter job at the master for one slave, which is the current slave from then on.
fn enter_parameter(rig: &Rig, slave: usize, control: u8, number: u16, value: u32) {
    rig.master.b_SL_NR_PARAMETER.store(slave as u8);
    rig.master.a_DATA_PARAMETER[slave].w_PAR_NR.store(number);
    rig.master.a_DATA_PARAMETER[slave].d_PAR_VALUE.store(value);
    rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STATREG_PAR_CMD.store(control);
    rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STEUREG_PAR_CMD.store(control);
}

/// Returns the control register and the value of a slave's parameter job at the master.
fn parameter(rig: &Rig, slave: usize) -> (u8, u32) {
    let job = &rig.master.a_CTRLREG_PAR_CMD_SL[slave];
    (job.b_STEUREG_PAR_CMD.load(), rig.master.a_DATA_PARAMETER[slave].d_PAR_VALUE.load())
}

/// Enters an up- or download of block 1 at the master, with slave 0 of the line.
fn enter_block(rig: &Rig, control: u8, address: u32, length: u16) {
    rig.master.b_SL_NR_UPDOWN.store(0);
    rig.master.b_SL_NR_UPDOWNBLK1.store(0);
    rig.master.d_BASE_ADR_UPDOWNBLK1.store(address);
    rig.master.w_LENGTH_UPDOWNBLK1.store(length);
    rig.master.b_STATREG_UPDOWNBLK1.store(control);
    rig.master.b_STEUREG_UPDOWNBLK1.store(control);
}

/// Returns the control register, the error number and the counter of block 1 at the master.
fn block(rig: &Rig) -> (u8, u16, u16) {
    let regs = &rig.master;
    (regs.b_STEUREG_UPDOWNBLK1.load(), regs.w_ERR_NR_UPDOWNBLK1.load(), regs.w_COUNTER_UPDOWNBLK1.load())
}

/// Acts as the application of slave node 0: allows and takes every transfer in block 1, once per interval.
fn serve_block(rig: &mut Rig, intervals: usize) {
    for _ in 0..intervals {
        let control = rig.slave.b_STEUREG_UPDOWNBLK1.load();
        if control & 0x01 != 0 {
            rig.slave.b_STATREG_UPDOWNBLK1.store(control & 0xFE);
            rig.slave.b_STEUREG_UPDOWNBLK1.store(control & 0xFE);
        }
        rig.run_to_sync();
    }
}

fn intervals(rig: &mut Rig, count: usize) {
    for _ in 0..count {
        rig.run_to_sync();
    }
}
