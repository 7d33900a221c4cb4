//! `w_CPU_CONTROL` and `w_OPTION_STATUS` of both nodes (manual 5.00005.03a p. 147-150, 173-175; D-05).

use crate::rig::bring_up::{Mode, Node, Stage};
use crate::rig::{BOTH, FASTEST, Memory, RATES, Rig};
use commram::devices::cansync;
use commram::devices::cansync::firmware::InitFault;
use commram::devices::cansync::records::{Command, CommandIgnored, InitRefused};
use commram::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use commram::identity::DeviceIndex;
use commram::memory::{View, Width};
use commram::plant::Forced;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Master,
    Slave,
}

/// Returns the value of `w_OPTION_STATUS` in each state.
fn status(role: Role) -> [u16; 5] {
    let mode = if role == Role::Master { Mode::Master } else { Mode::Slave };
    Stage::ALL.map(|stage| stage.status(mode))
}

fn node(rig: &Rig, role: Role) -> Node {
    match role {
        Role::Master => rig.master_node(),
        Role::Slave => rig.slave_node(),
    }
}

fn regs(rig: &Rig, role: Role) -> View<CANsync_INIT_BMSTRUCT> {
    node(rig, role).init
}

/// Brings the node into state number `state` by the documented way.
fn bring_to(rig: &mut Rig, role: Role, state: usize) -> View<CANsync_INIT_BMSTRUCT> {
    let node = node(rig, role);
    rig.bring_up(&[&node], ..=Stage::ALL[state]);
    node.init
}

/// Returns the next state for each command in each state, and `None` if nothing changes.
fn next(state: usize, command: u16) -> Option<usize> {
    match (state, command) {
        (0, 0x0000) => None,
        (_, 0x0000) => Some(0),
        (0, 0x0001) => Some(1),
        (1, 0x0002) => Some(2),
        (1, 0x0020) => Some(3),
        (2, 0x0020) => Some(3),
        (3, 0x0040 | 0x0060) => Some(4),
        (4, 0x0020) => Some(3),
        _ => None,
    }
}

#[test]
fn every_command_in_every_state() {
    for rate in FASTEST {
        let commands =
            [0x0000, 0x0001, 0x0002, 0x0012, 0x0013, 0x0020, 0x0040, 0x0060, 0x0003, 0x1234, 0xFF00];
        for memory in BOTH {
            for role in [Role::Master, Role::Slave] {
                for state in 0..5 {
                    for command in commands {
                        let mut rig = Rig::new(memory, rate);
                        let regs = bring_to(&mut rig, role, state);
                        if state == 1 {
                            node(&rig, role).write_init_data();
                        }
                        // A command that the register already contains is not a new command.
                        let again = regs.w_CPU_CONTROL.load() == command;
                        let is_refused = !again
                            && next(state, command).is_none()
                            && !(state == 4 && command & 0x0040 != 0);
                        rig.expect_errors(&vec![&cansync::rules::COMMAND; is_refused.into()]);
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
}

/// Manual p. 218, 221; 5.02066.01a p. 131, 134: a node that waits for initialization data takes the command that sets the mode,
/// too. After a restart the node can use the data from before the restart (D-602).
#[test]
fn the_mode_can_be_set_with_the_data_from_before_a_restart() {
    for rate in FASTEST {
        for role in [Role::Master, Role::Slave] {
            let mut rig = Rig::new(Memory::Heap, rate);
            let regs = bring_to(&mut rig, role, 4);
            for (command, state) in [(0x0000, 0), (0x0001, 1), (0x0020, 3), (0x0040, 4)] {
                regs.w_CPU_CONTROL.store(command);
                rig.step(500);
                assert_eq!(regs.w_OPTION_STATUS.load(), status(role)[state], "{role:?}, 16#{command:04X}");
            }
        }
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.activate();
        rig.initialize_master();
        let regs = bring_to(&mut rig, Role::Master, 1);
        regs.w_CPU_CONTROL.store(0x0020);
        rig.step(500);
        assert!(rig.next_sync().is_some(), "the bus runs at the rate it had");
    }
}

/// A node that has no data from before the restart takes the data in the registers, as with the command 16#0002.
#[test]
fn the_mode_cannot_be_set_with_bad_data() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&cansync::rules::INIT_INTERVAL]);
        let regs = bring_to(&mut rig, Role::Master, 1);
        rig.master_node().write_init_data();
        regs.b_TIME_PATTERN.store(16);
        regs.w_CPU_CONTROL.store(0x0020);
        rig.step(1000);
        assert_eq!((regs.w_OPTION_STATUS.load(), regs.w_CANsync_STATUS.load()), (0x0002, 0x0040));
        regs.b_TIME_PATTERN.store(rig.rate.timing.b_TIME_PATTERN);
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0043);
    }
}

/// `control_changed` reports a new command before the firmware polls.
#[test]
fn a_new_command_is_reported_before_the_firmware_polls() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.step(1_000);
        for role in [Role::Master, Role::Slave] {
            assert!(!rig.plant.control_changed(), "{role:?}");
            node(&rig, role).init.w_CPU_CONTROL.store(0x0001);
            assert!(rig.plant.control_changed(), "{role:?}");
            rig.step(500);
        }
        assert!(!rig.plant.control_changed(), "the firmware has polled all commands");
    }
}

/// A store of 16#0000 over 16#0000 is a restart. If a program has not stored it, the same value in the register is no
/// restart (D-29).
#[test]
fn restarts_are_counted_where_they_are_stored() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.step(1_000);
        let (at, others) = (rig.master_at, rig.master_at.base + 20);
        let counted = |rig: &Rig| -> u32 {
            let header = rig.plant.devices()[at.plc].header();
            header.ports.iter().map(|port| port.restarts_written.load()).sum()
        };
        let before = counted(&rig);
        rig.plant.store(DeviceIndex::at(at.plc), others, Width::Byte, 0).unwrap();
        assert_eq!(counted(&rig), before, "that was another register");
        rig.plant.store(DeviceIndex::at(at.plc), at.base, Width::Word, 0x0000).unwrap();
        assert_eq!(counted(&rig), before + 1);
        rig.plant.store(DeviceIndex::at(at.plc), at.base, Width::Word, 0x0001).unwrap();
        assert_eq!(counted(&rig), before + 1, "that was no restart");
    }
}

#[test]
fn an_ignored_command_is_noted_once() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&cansync::rules::COMMAND]);
        let regs = bring_to(&mut rig, Role::Master, 0);
        for (value, why) in
            [(0x0040, Command::NotNow), (0x0012, Command::Unknown), (0x0007, Command::Unknown)]
        {
            regs.w_CPU_CONTROL.store(value);
            rig.step(5000);
            let noted: Vec<_> = rig
                .records()
                .filter_map(|record| record.event.get())
                .filter_map(|it: CommandIgnored| (it.value == value).then_some(it.why))
                .collect();
            assert_eq!(noted, [why], "16#{value:04X}");
        }
    }
}

/// Manual p. 150: bit 7 is set and the firmware clears it; D-29: the other bits act like any other command.
#[test]
fn the_other_bits_written_with_bit_7_act_as_they_do_alone() {
    for rate in FASTEST {
        for role in [Role::Master, Role::Slave] {
            for state in 0..5 {
                for command in [0x0001, 0x0002, 0x0020, 0x0040, 0x0060, 0x1234] {
                    let mut rig = Rig::new(Memory::Heap, rate);
                    let regs = bring_to(&mut rig, role, state);
                    if state == 1 {
                        node(&rig, role).write_init_data();
                    }
                    let is_current = regs.w_CPU_CONTROL.load() == command;
                    let is_unchanged = is_current || state == 4 && command & 0x0040 != 0;
                    let is_refused = !is_unchanged && next(state, command).is_none();
                    rig.expect_errors(&vec![&cansync::rules::COMMAND; is_refused.into()]);
                    regs.w_CPU_CONTROL.store(0x0080 | command);
                    rig.step(2000);
                    assert_eq!(regs.w_CPU_CONTROL.load(), command, "bit 7 is cleared, the others stay");
                    let expected = if is_current { state } else { next(state, command).unwrap_or(state) };
                    assert_eq!(
                        regs.w_OPTION_STATUS.load(),
                        status(role)[expected],
                        "{role:?}, state {state}, 16#0080 with 16#{command:04X}"
                    );
                }
            }
        }
    }
}

#[test]
fn an_early_write_is_reported_with_bit_7_too() {
    for rate in FASTEST {
        for command in [0x0002, 0x0082] {
            let mut rig = Rig::new(Memory::Heap, rate);
            rig.expect_errors(&[&cansync::rules::BEFORE_INIT]);
            let regs = bring_to(&mut rig, Role::Master, 1);
            rig.master_node().write_init_data();
            rig.master.a_RD_BMARRAY[31][7].store(1);
            regs.w_CPU_CONTROL.store(command);
            rig.step(500);
            assert_eq!(regs.w_OPTION_STATUS.load(), 0x0003);
            assert_eq!(
                rig.plant
                    .journal()
                    .findings()
                    .iter()
                    .filter(|it| it.last.rule == &cansync::rules::BEFORE_INIT)
                    .count(),
                1
            );
        }
    }
}

/// Writes `w_CPU_CONTROL` by its name, as the channel does.
fn write_by_name(rig: &mut Rig, role: Role, value: u16) {
    regs(rig, role).w_CPU_CONTROL.store(value);
    let at = if role == Role::Master { rig.master_at } else { rig.slave_at };
    rig.plant.note_channel_write(DeviceIndex::at(at.plc), at.base, 2, value.into());
}

/// Decision D-29: the value that the firmware leaves after clearing is no command, even if a program rings the doorbell
/// repeatedly.
#[test]
fn bit_7_alone_restarts_nothing_until_a_0_is_written() {
    for rate in FASTEST {
        for role in [Role::Master, Role::Slave] {
            for state in 0..5 {
                let begin = || {
                    let mut rig = Rig::new(Memory::Heap, rate);
                    let regs = bring_to(&mut rig, role, state);
                    regs.w_CPU_CONTROL.store(0x0080);
                    for _ in 0..1000 {
                        rig.plant.processor_cycle();
                    }
                    rig.step(2000);
                    assert_eq!(regs.w_CPU_CONTROL.load(), 0);
                    assert_eq!(regs.w_OPTION_STATUS.load(), status(role)[state], "{role:?}, state {state}");
                    (rig, regs)
                };
                let (mut rig, regs) = begin();
                write_by_name(&mut rig, role, 0x0000);
                rig.step(500);
                assert_eq!(regs.w_OPTION_STATUS.load(), 0x0001, "{role:?}, state {state}: written by name");

                let (mut rig, regs) = begin();
                rig.tolerate_errors(&[&cansync::rules::COMMAND]);
                regs.w_CPU_CONTROL.store(0x0012);
                rig.step(500);
                regs.w_CPU_CONTROL.store(0x0000);
                rig.step(500);
                assert_eq!(
                    regs.w_OPTION_STATUS.load(),
                    0x0001,
                    "{role:?}, state {state}: a change in the RAM"
                );
            }
        }
    }
}

#[test]
fn a_restart_written_before_bit_7_does_not_act_after_it() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let regs = bring_to(&mut rig, Role::Master, 4);
        write_by_name(&mut rig, Role::Master, 0x0000);
        regs.w_CPU_CONTROL.store(0x0080);
        rig.step(2000);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0080);
    }
}

/// Decision D-29: a restart written over the value that bit 7 has left cannot be seen in the RAM, and a finding reports
/// this.
#[test]
fn a_restart_over_the_remains_of_bit_7_is_reported() {
    for rate in FASTEST {
        for (state, noted) in [(0, 0), (1, 1), (4, 1)] {
            let mut rig = Rig::new(Memory::Heap, rate);
            let regs = bring_to(&mut rig, Role::Master, state);
            regs.w_CPU_CONTROL.store(0x0080);
            rig.step(5000);
            let records = rig.records().filter(|record| {
                let why = Command::LeftBehind;
                record.event.get().is_some_and(|it: CommandIgnored| it.value == 0 && it.why == why)
            });
            assert_eq!(records.count(), noted, "journal, state {state}");
            let entries = rig.plant.journal().findings().iter();
            let found = entries
                .filter(|entry| entry.last.rule == &cansync::rules::LEFT_BEHIND)
                .map(|entry| entry.last.offset);
            assert_eq!(found.collect::<Vec<_>>(), vec![rig.master_at.base; noted], "checker, state {state}");
        }
        // If the PLC writes bit 7 with the bits of the present state, the remaining value is no restart.
        let mut rig = Rig::new(Memory::Heap, rate);
        bring_to(&mut rig, Role::Master, 4).w_CPU_CONTROL.store(0x00C0);
        rig.step(5000);
        assert_eq!(
            rig.plant
                .journal()
                .findings()
                .iter()
                .filter(|it| it.last.rule == &cansync::rules::LEFT_BEHIND)
                .count(),
            0
        );
    }
}

/// Decision D-29: forcing names the register.
#[test]
fn a_forced_0_restarts_after_bit_7() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let regs = bring_to(&mut rig, Role::Master, 4);
        regs.w_CPU_CONTROL.store(0x0080);
        rig.step(500);
        rig.plant
            .force(Forced { plc: DeviceIndex(0), offset: rig.master_at.base, width: Width::Word, value: 0 })
            .unwrap();
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0001);
    }
}

#[test]
fn after_a_controller_reset_commands_are_taken_again() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let regs = bring_to(&mut rig, Role::Master, 4);
        regs.w_CPU_CONTROL.store(0x0080);
        rig.step(500);
        regs.w_CPU_CONTROL.store(0x0020);
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0043);
        regs.w_CPU_CONTROL.store(0x0080);
        rig.step(500);
        regs.w_CPU_CONTROL.store(0x0040);
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0080);
        regs.w_CPU_CONTROL.store(0x0000);
        rig.step(500);
        assert_eq!(regs.w_OPTION_STATUS.load(), 0x0001);
    }
}

#[test]
fn bad_initialization_data_are_refused_until_they_are_right() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = Rig::new(memory, rate);
            rig.expect_errors(&[&cansync::rules::INIT_INTERVAL]);
            let regs = bring_to(&mut rig, Role::Master, 1);
            rig.master_node().write_init_data();
            regs.b_TIME_PATTERN.store(16);
            regs.w_CPU_CONTROL.store(0x0002);
            rig.step(5000);
            assert_eq!(regs.w_OPTION_STATUS.load(), 0x0002);
            assert_eq!(regs.w_CANsync_STATUS.load() & 0x0040, 0x0040, "bit 6: error present");
            let refused = rig
                .records()
                .filter(|r| r.event.get().is_some_and(|it: InitRefused| it.fault == InitFault::TimePattern))
                .count();
            assert_eq!(refused, 1, "noted once");

            regs.b_TIME_PATTERN.store(rig.rate.timing.b_TIME_PATTERN);
            rig.step(500);
            assert_eq!(regs.w_OPTION_STATUS.load(), 0x0003, "the register still holds the order");
            assert_eq!(regs.w_CANsync_STATUS.load() & 0x0040, 0);
        }
    }
}

/// Decision D-03: the INIT structure overlays the cyclic one, which starts empty; general registers stay.
#[test]
fn taking_over_init_data_clears_the_cyclic_area() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = Rig::new(memory, rate);
            rig.expect_errors(&[&cansync::rules::BEFORE_INIT]);
            rig.master.a_RD_BMARRAY[31][7].store(0xDEAD_BEEF);
            rig.master.a_STAT_SL[5].store(3);
            bring_to(&mut rig, Role::Master, 2);
            assert_eq!(rig.master.a_RD_BMARRAY[31][7].load(), 0);
            assert_eq!(rig.master.a_STAT_SL[5].load(), 0);
            assert_eq!(rig.master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.load(), 0, "where a_SL_TYP[0] stood");
            assert_eq!(rig.master.w_OMEGA_NR.load(), rig.rate.kind.master_number, "the number stays");
            assert_eq!(rig.slave.w_OMEGA_NR.load(), 0, "the other PLC has its own");
        }
    }
}

#[test]
fn restart_stops_sync_and_frames() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let regs = bring_to(&mut rig, Role::Master, 4);
        rig.step(10_000);
        assert!(rig.next_sync().is_some());
        regs.w_CPU_CONTROL.store(0x0000);
        rig.step(500);
        assert_eq!(rig.next_sync(), None);
        let written = rig.plant.journal().written();
        rig.step(100_000);
        assert_eq!(rig.plant.journal().written(), written, "a silent bus");
    }
}

/// `w_CANsync_STATUS` is refreshed in every processor cycle (p. 148): idle, sending, receiving.
#[test]
fn the_can_status_shows_what_the_controller_does() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.activate();
        let look = |rig: &mut Rig| {
            rig.step(10);
            rig.plant.processor_cycle();
            rig.master.w_CANsync_STATUS.load()
        };
        assert_eq!(look(&mut rig), 0x0020, "\"SYNC mode: on\" is still on the wire");
        rig.run_to_sync();
        assert_eq!(look(&mut rig), 0x000C, "send buffer free, last job done");
        // From this moment on, WRC1 is on the wire in each interval.
        rig.configure_wrc1([0x01, 0x03, 0x05, 0x07]);
        rig.run_to_sync();
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.step(u64::from(rig.rate.timing.t_WRC1) + 10);
        rig.plant.processor_cycle();
        assert_eq!(rig.master.w_CANsync_STATUS.load(), 0x0020, "sending");
        assert_eq!(rig.slave.w_CANsync_STATUS.load(), 0x001C, "receiving");
    }
}

/// Manual p. 148; 5.02066.01a p. 47: a program that polls the status of a master sees both sent and received frames on
/// the wire, although SYNC edges and processor cycles have the same phase (D-604).
#[test]
fn a_master_is_seen_receiving_as_often_as_it_does() {
    const SENDING: u16 = 1 << 5;
    const RECEIVING: u16 = 1 << 4;
    for rate in RATES {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.activate();
        rig.configure_wrc1([0x01, 0x03, 0x05, 0x07]);
        let words = &rig.slave._CFG_RDC_WORD;
        let words = [
            &words.b_CFG_RDC1_WORD0,
            &words.b_CFG_RDC1_WORD1,
            &words.b_CFG_RDC1_WORD2,
            &words.b_CFG_RDC1_WORD3,
        ];
        words.into_iter().zip([0x01, 0x03, 0x05, 0x07]).for_each(|(word, byte)| word.store(byte));
        let cycles = 400 * u64::from(rate.timing.b_TIME_PATTERN);
        let mut seen = [0u64; 2];
        for _ in 0..cycles {
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
            rig.step(500);
            let status = rig.master.w_CANsync_STATUS.load() & (SENDING | RECEIVING);
            assert_ne!(status, SENDING | RECEIVING);
            for (count, bit) in seen.iter_mut().zip([SENDING, RECEIVING]) {
                *count += u64::from(status & bit != 0);
            }
        }
        // Each of the two frames has 64 data bits, and takes about an eighth of the interval.
        for count in seen {
            assert!((cycles / 14..cycles / 6).contains(&count), "{rate:?}: {seen:?} of {cycles}");
        }
    }
}
