//! The history of registers: every change with its writer. Recording does not change the run of the plant.

use crate::rig::{FASTEST, Memory, Rate, Rig};
use commram::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::identity::DeviceIndex;
use commram::journal::{By, Changed, Keep};
use core::mem::offset_of;

fn place(rate: Rate, offset: usize) -> u32 {
    rate.kind.master.base + offset as u32
}

/// Records the whole structure of the master.
fn follow(rig: &mut Rig, rate: Rate, keep: Keep) {
    let len = size_of::<CANsync_MA_CTRL_BMSTRUCT>() as u32;
    rig.plant.follow_registers(DeviceIndex(0), place(rate, 0), len, keep).unwrap();
}

/// Returns the changes of a register: old value, new value and writer.
fn of_register(changes: &[Changed], offset: u32) -> Vec<(u32, u32, By)> {
    let own = changes.iter().filter(|change| change.offset == offset);
    own.map(|change| (change.from, change.to, change.how.by)).collect()
}

#[test]
fn a_handshake_is_recorded_with_both_sides() {
    for rate in FASTEST {
        let control = place(rate, offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_CPU_CONTROL));
        let status = place(rate, offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_OPTION_STATUS));
        let wrc1 = place(rate, offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1));
        let mut rig = Rig::new(Memory::Heap, rate);
        follow(&mut rig, rate, Keep::ForOnlookers);
        rig.activate();
        let (_, from) = rig.plant.changes(0, 0);
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.step(10_000);
        let (changes, _) = rig.plant.changes(0, usize::MAX);
        let recorded: Vec<Changed> = changes.iter().map(|change| change.what).collect();
        let (setting_up, cyclic) = recorded.split_at(from as usize);
        assert_eq!(of_register(setting_up, control).first(), Some(&(0, 1, By::Program)));
        assert_eq!(of_register(setting_up, status).first(), Some(&(1, 2, By::Firmware)));
        let handshake = of_register(cyclic, wrc1);
        let [.., (_, 5, By::Program), (5, 4, By::Firmware)] = handshake.as_slice() else {
            panic!("{handshake:?}");
        };
    }
}

#[test]
fn recording_does_not_change_the_run() {
    for rate in FASTEST {
        let mut hashes = [false, true].map(|is_followed| {
            let mut rig = Rig::new(Memory::Heap, rate);
            if is_followed {
                follow(&mut rig, rate, Keep::ForOnlookers);
            }
            rig.activate();
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.step(10_000);
            assert_eq!(rig.plant.changes(0, 1).0.len(), usize::from(is_followed));
            (rig.plant.journal().hash(), rig.plant.journal().end())
        });
        let [without, with] = &mut hashes;
        assert_eq!(without, with);
    }
}

#[test]
fn the_history_is_recorded_only_in_the_journal() {
    for rate in FASTEST {
        let wrc1 = place(rate, offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1));
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.activate();
        rig.plant.follow_registers(DeviceIndex(0), wrc1, 1, Keep::InJournal).unwrap();
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.step(10_000);
        let recorded: Vec<Changed> = rig.records().filter_map(|record| record.event.get()).collect();
        assert!(of_register(&recorded, wrc1).ends_with(&[(5, 4, By::Firmware)]), "{recorded:?}");
        assert!(recorded.iter().all(|change| change.offset == wrc1));
        assert_eq!(rig.plant.changes(0, 1), (vec![], 0));
    }
}
