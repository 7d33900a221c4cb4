//! `w_CPU_CONTROL` and `w_OPTION_STATUS` of both nodes (manual 5.00005.03a p. 147-150, 173-175; D-05).

use crate::rig::{BOTH, Memory, RATES, Rig, write_init_data};
use commram::check::Rule;
use commram::journal::{Command, Event};
use commram::layout::omega_drive_line_2::CANsync_INIT_BMSTRUCT;
use commram::memory::View;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Master,
    Slave,
}

/// Status values: start-up, waiting for init data, waiting for start, set-up mode, active operation.
fn status(role: Role) -> [u16; 5] {
    match role {
        Role::Master => [0x0001, 0x0002, 0x0003, 0x0043, 0x0080],
        Role::Slave => [0x0001, 0x0002, 0x0003, 0x0013, 0x0020],
    }
}

fn regs(rig: &Rig, role: Role) -> View<CANsync_INIT_BMSTRUCT> {
    match role {
        Role::Master => rig.master_init.clone(),
        Role::Slave => rig.slave_init.clone(),
    }
}

/// Brings the node into state number `state` by the documented way.
fn bring_to(rig: &mut Rig, role: Role, state: usize) -> View<CANsync_INIT_BMSTRUCT> {
    let regs = regs(rig, role);
    for (number, command) in [0x0000, 0x0001, 0x0002, 0x0020, 0x0040].into_iter().enumerate().take(state + 1)
    {
        if command == 0x0002 {
            write_init_data(&regs, RATES[0], u8::from(role == Role::Slave));
        }
        regs.w_CPU_CONTROL.store(command);
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), status(role)[number], "{role:?} after 16#{command:04X}");
    }
    regs
}

/// Next state for each command in each state; `None`: nothing changes.
fn next(state: usize, command: u16) -> Option<usize> {
    match (state, command) {
        (0, 0x0000) => None,
        (_, 0x0000) => Some(0),
        (0, 0x0001) => Some(1),
        (1, 0x0002) => Some(2),
        (2, 0x0020) => Some(3),
        (3, 0x0040 | 0x0060) => Some(4),
        (4, 0x0020) => Some(3),
        _ => None,
    }
}

#[test]
fn every_command_in_every_state() {
    let commands = [0x0000, 0x0001, 0x0002, 0x0012, 0x0013, 0x0020, 0x0040, 0x0060, 0x0003, 0x1234, 0xFF00];
    for memory in BOTH {
        for role in [Role::Master, Role::Slave] {
            for state in 0..5 {
                for command in commands {
                    let mut rig = Rig::new(memory, RATES[0]);
                    let regs = bring_to(&mut rig, role, state);
                    if state == 1 {
                        write_init_data(&regs, RATES[0], u8::from(role == Role::Slave));
                    }
                    // A command that already stands in the register is no new one.
                    let again = regs.w_CPU_CONTROL.load() == command;
                    let is_refused =
                        !again && next(state, command).is_none() && !(state == 4 && command & 0x0040 != 0);
                    rig.expect_errors(if is_refused { &[Rule::Command] } else { &[] });
                    regs.w_CPU_CONTROL.store(command);
                    rig.step(500);
                    let expected = if again { state } else { next(state, command).unwrap_or(state) };
                    assert_eq!(
                        regs.w_OPTION_STATUS.load(),
                        status(role)[expected],
                        "{role:?}, state {state}, 16#{command:04X}"
                    );
                    assert_eq!(regs.w_CPU_CONTROL.load(), command, "only bit 7 is ever cleared");
                }
            }
        }
    }
}

#[test]
fn an_ignored_command_is_noted_once() {
    let mut rig = Rig::new(Memory::Heap, RATES[0]);
    rig.expect_errors(&[Rule::Command]);
    let regs = bring_to(&mut rig, Role::Master, 0);
    for (value, why) in [(0x0040, Command::NotNow), (0x0012, Command::Unknown), (0x0007, Command::Unknown)] {
        regs.w_CPU_CONTROL.store(value);
        rig.step(5000);
        let noted: Vec<_> = rig
            .records()
            .filter_map(|record| match record.event {
                Event::CommandIgnored { value: seen, why, .. } if seen == value => Some(why),
                _ => None,
            })
            .collect();
        assert_eq!(noted, [why], "16#{value:04X}");
    }
}

/// Manual p. 149: the controller is reset and the bit cleared; D-29: what is left is no command.
#[test]
fn bit_7_resets_the_controller_in_every_state_and_changes_none() {
    for role in [Role::Master, Role::Slave] {
        for state in 0..5 {
            for others in [0x0000, 0x0040] {
                let mut rig = Rig::new(Memory::Heap, RATES[0]);
                let regs = bring_to(&mut rig, role, state);
                regs.w_CPU_CONTROL.store(0x0080 | others);
                rig.step(2000);
                assert_eq!(regs.w_CPU_CONTROL.load(), others, "bit 7 is cleared, the others stay");
                assert_eq!(regs.w_OPTION_STATUS.load(), status(role)[state], "{role:?}, state {state}");
            }
        }
    }
}

#[test]
fn after_a_controller_reset_commands_are_taken_again() {
    let mut rig = Rig::new(Memory::Heap, RATES[0]);
    let regs = bring_to(&mut rig, Role::Master, 4);
    regs.w_CPU_CONTROL.store(0x0080);
    rig.step(500);
    regs.w_CPU_CONTROL.store(0x0020);
    rig.step(500);
    assert_eq!(regs.w_OPTION_STATUS.load(), 0x0043);
    regs.w_CPU_CONTROL.store(0x0000);
    rig.step(500);
    assert_eq!(regs.w_OPTION_STATUS.load(), 0x0001);
}

#[test]
fn bad_initialization_data_are_refused_until_they_are_right() {
    for memory in BOTH {
        let mut rig = Rig::new(memory, RATES[0]);
        rig.expect_errors(&[Rule::InitInterval]);
        let regs = bring_to(&mut rig, Role::Master, 1);
        write_init_data(&regs, RATES[0], 0x00);
        regs.b_TIME_PATTERN.store(4);
        regs.w_CPU_CONTROL.store(0x0002);
        rig.step(5000);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0002);
        assert_eq!(regs.w_CANsync_STATUS.load() & 0x0040, 0x0040, "bit 6: error present");
        let refused =
            rig.records().filter(|r| matches!(r.event, Event::InitRefused { reason: 3, .. })).count();
        assert_eq!(refused, 1, "noted once");

        regs.b_TIME_PATTERN.store(2);
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0003, "the order still stands in the register");
        assert_eq!(regs.w_CANsync_STATUS.load() & 0x0040, 0);
    }
}

/// D-03: the INIT structure overlays the cyclic one, which starts empty; general registers stay.
#[test]
fn taking_over_init_data_clears_the_cyclic_area() {
    for memory in BOTH {
        let mut rig = Rig::new(memory, RATES[0]);
        rig.expect_errors(&[Rule::BeforeInit]);
        rig.master.a_RD_BMARRAY[31][7].store(0xDEAD_BEEF);
        rig.master.a_STAT_SL[5].store(3);
        bring_to(&mut rig, Role::Master, 2);
        assert_eq!(rig.master.a_RD_BMARRAY[31][7].load(), 0);
        assert_eq!(rig.master.a_STAT_SL[5].load(), 0);
        assert_eq!(rig.master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.load(), 0, "where a_SL_TYP[0] stood");
        assert_eq!(rig.master.w_OMEGA_NR.load(), 9, "the DIP number stays");
        assert_eq!(rig.slave.w_OMEGA_NR.load(), 0, "the other PLC has its own");
    }
}

#[test]
fn restart_stops_sync_and_frames() {
    let mut rig = Rig::new(Memory::Heap, RATES[0]);
    let regs = bring_to(&mut rig, Role::Master, 4);
    rig.step(10_000);
    assert!(rig.plant.next_sync(0, 2).is_some());
    regs.w_CPU_CONTROL.store(0x0000);
    rig.step(500);
    assert_eq!(rig.plant.next_sync(0, 2), None);
    let written = rig.plant.journal().written();
    rig.step(100_000);
    assert_eq!(rig.plant.journal().written(), written, "a silent bus");
}

/// `w_CANsync_STATUS` is refreshed in every processor cycle (p. 147): idle, sending, receiving.
#[test]
fn the_can_status_shows_what_the_controller_does() {
    let mut rig = Rig::new(Memory::Heap, RATES[0]);
    rig.activate();
    assert_eq!(rig.master.w_CANsync_STATUS.load(), 0x0020, "\"SYNC mode: on\" is still on the wire");
    rig.run_to_sync();
    assert_eq!(rig.master.w_CANsync_STATUS.load(), 0x000C, "send buffer free, last job done");
    // WRC1 is on the wire from 730 us after SYNC on.
    rig.configure_wrc1([0x01, 0x03, 0x05, 0x07]);
    rig.run_to_sync();
    rig.master.b_CTRLREG_WRC1.store(0x05);
    rig.step(740);
    rig.plant.processor_cycle();
    assert_eq!(rig.master.w_CANsync_STATUS.load(), 0x0020, "sending");
    assert_eq!(rig.slave.w_CANsync_STATUS.load(), 0x001C, "receiving");
}
