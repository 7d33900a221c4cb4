//! Cases that only the Omega Drive-Line II has: its BAPS and its Ethernet interface.

use super::Case;
use crate::rig::Rig;
use commram::check::rules;
use commram::devices::omega_drive_line_2 as omega;
use commram::devices::omega_drive_line_2::registers::*;
use commram::memory::View;
use commram::memory::header::ProgramState;

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &omega::rules::IP_ADDRESS,
        register: "ethernet_config.a_IP_ADDRESS[3]",
        value: |_| 255,
        wrong: |rig| store_ip_config(rig, 255),
        right: |rig| store_ip_config(rig, 7),
    },
    Case {
        rule: &rules::OWNER,
        register: "baps.w_STATUSWORD",
        value: |_| 0x1234,
        wrong: |rig| baps(rig).w_STATUSWORD.store(0x1234),
        right: |rig| baps(rig).w_CONTROLWORD.store(0x1234),
    },
    Case {
        rule: &rules::RESERVED_BIT,
        register: "baps.w_COMMAND_REG",
        value: |_| 0x0114,
        wrong: |rig| configure(&baps(rig), rig, 0x0114),
        right: |rig| configure(&baps(rig), rig, 0x0014),
    },
    Case {
        rule: &rules::RESERVED_VALUE,
        register: "baps.w_COMMAND_REG",
        value: |_| 0x0012,
        wrong: |rig| configure(&baps(rig), rig, 0x0012),
        right: |rig| configure(&baps(rig), rig, 0x0010),
    },
    Case {
        rule: &omega::rules::BAPS_EARLY,
        register: "baps.b_COMMAND",
        value: |_| 2,
        wrong: |rig| configure_in_program(rig, ProgramState::Cyclic, 5),
        right: |rig| configure_in_program(rig, ProgramState::Cyclic, 6),
    },
    Case {
        rule: &omega::rules::BAPS_EARLY,
        register: "baps.b_COMMAND",
        value: |_| 2,
        wrong: |rig| configure_in_program(rig, ProgramState::Initializing, 0),
        // A program that does not count cycles is not checked.
        right: |rig| configure_in_program(rig, ProgramState::Cyclic, 0),
    },
    Case {
        rule: &omega::rules::BAPS_RUNNING,
        register: "baps.b_COMMAND",
        value: |_| 2,
        wrong: |rig| {
            let regs = baps(rig);
            configure(&regs, rig, 0x0014);
            exchange(&regs, rig, 0x0014);
            configure(&regs, rig, 0x0014);
        },
        right: |rig| {
            let regs = baps(rig);
            configure(&regs, rig, 0x0014);
            exchange(&regs, rig, 0x0014);
            rig.step(500);
            configure(&regs, rig, 0x0014);
        },
    },
    Case {
        rule: &omega::rules::BAPS_CYCLE,
        register: "baps.w_COMMAND_REG",
        value: |_| 0x0024,
        wrong: |rig| {
            let regs = baps(rig);
            configure(&regs, rig, 0x0014);
            exchange(&regs, rig, 0x0024);
            exchange(&regs, rig, 0x0024);
        },
        right: |rig| {
            let regs = baps(rig);
            configure(&regs, rig, 0x0014);
            exchange(&regs, rig, 0x0014);
        },
    },
    Case {
        rule: &omega::rules::BAPS_SYNC_SLOT,
        register: "baps.w_COMMAND_REG",
        value: |_| 0x0014,
        wrong: |rig| follow_positions(rig, 0x0014),
        right: |rig| follow_positions(rig, 0x0044),
    },
];

/// Advances the clock, and returns the BAPS registers of PLC `a`.
pub(crate) fn baps(rig: &mut Rig) -> View<BAPS_CTRL_BMSTRUCT> {
    rig.step(5000);
    rig.plant.devices()[0].segment().view(BAPS).unwrap()
}

/// Performs the register accesses of `BAPS_INIT`.
fn configure(regs: &View<BAPS_CTRL_BMSTRUCT>, rig: &mut Rig, command_reg: u16) {
    regs.w_COMMAND_REG.store(command_reg);
    regs.b_COMMAND.store(2);
    rig.step(500);
}

/// Performs the register accesses of `BAPS_PD_COMM2`.
fn exchange(regs: &View<BAPS_CTRL_BMSTRUCT>, rig: &mut Rig, command_reg: u16) {
    regs.w_COMMAND_REG.store(command_reg);
    regs.b_COMMAND.store(1);
    rig.step(500);
}

/// Configures the BAPS in this cycle of the PLC program.
fn configure_in_program(rig: &mut Rig, state: ProgramState, cycles: u32) {
    let header = rig.plant.devices()[0].segment().header().unwrap();
    header.program.state.store(state.code());
    header.program_cycles.store(cycles);
    configure(&baps(rig), rig, 0x0014);
}

/// Exchanges process data with a drive in mode "synchronous reference position" with a SYNC slot of 2 ms.
fn follow_positions(rig: &mut Rig, command_reg: u16) {
    let regs = baps(rig);
    regs.b_JOB.store(2);
    regs.u_PAR_NR.store(304);
    regs.us_PAR_ELEMENT.store(7);
    regs.us_NUMBER.store(1);
    regs.ud_PAR_VALUE.store(1);
    regs.b_MA_SEMAPHORE.store(1);
    rig.step(3000);
    assert_eq!((regs.b_SL_SEMAPHORE.load(), regs.i_ERR_DETAIL.load()), (1, 0));
    configure(&regs, rig, command_reg);
    for _ in 0..2 {
        exchange(&regs, rig, command_reg);
        rig.step(2000);
    }
}

/// Stores a fixed IP address of PLC `a` that ends in `last` (manual p. 79).
fn store_ip_config(rig: &mut Rig, last: u8) {
    let segment = rig.plant.devices()[0].segment();
    let config = segment.view::<ETHERNET_CONFIG_BMSTRUCT>(ETHERNET_CONFIG).unwrap();
    config.a_IP_ADDRESS.iter().zip([192, 168, 75, last]).for_each(|(cell, byte)| cell.store(byte));
    config.a_IP_MASK.iter().zip([255, 255, 255, 0]).for_each(|(cell, byte)| cell.store(byte));
    config.d_IP_CONFIG.store(0x1234_5678);
}
