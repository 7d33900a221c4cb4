//! Forced registers: against the firmware, against the PLC, until they are let go (D-105).

use crate::rig::{BOTH, Memory, OMEGA_RATES, Rig};
use commram::devices::omega_drive_line_2::registers::NODE2;
use commram::journal::{Force, State, Unforce};
use commram::memory::Width;
use commram::plant::{ForceError, Forced};

/// `w_CPU_CONTROL`, `w_OPTION_STATUS` and `b_CTRLREG_WRC1` of node 2.
const W_CPU_CONTROL: u32 = NODE2 as u32;
const W_OPTION_STATUS: u32 = NODE2 as u32 + 2;
const B_CTRLREG_WRC1: u32 = NODE2 as u32 + 12;

fn word(offset: u32, value: u32) -> Forced {
    Forced { plc: 0, offset, width: Width::Word, value }
}

#[test]
fn the_firmware_cannot_change_it() {
    for memory in BOTH {
        let mut rig = Rig::new(memory, OMEGA_RATES[0]);
        rig.plant.force(word(W_OPTION_STATUS, 0x1234)).unwrap();
        assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x1234, "at once");
        rig.master.w_CPU_CONTROL.store(0x0001);
        rig.step(2_000);
        assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x1234);
        let changed = rig.records().any(|record| record.event.get().is_some_and(|it: State| it.to == 0x0002));
        assert!(changed, "the state machine itself goes on");
    }
}

#[test]
fn the_firmware_sees_no_other_value() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    rig.activate();
    let released = Forced { plc: 0, offset: B_CTRLREG_WRC1, width: Width::Byte, value: 0x05 };
    rig.plant.force(released).unwrap();
    for _ in 0..5 {
        rig.master.b_CTRLREG_WRC1.store(0xFF);
        rig.run_to_sync();
        assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x05);
    }
    let sent = rig.frames().iter().filter(|(_, frame)| frame.id() & 0x7E0 == 0x100).count();
    assert_eq!(sent, 5, "one in each interval");
}

#[test]
fn it_goes_when_it_is_let_go() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    rig.plant.force(word(W_CPU_CONTROL, 0x0001)).unwrap();
    rig.master.w_CPU_CONTROL.store(0x0000);
    rig.step(1_000);
    assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0002);
    assert!(rig.plant.unforce(0, W_CPU_CONTROL));
    assert!(!rig.plant.unforce(0, W_CPU_CONTROL), "it is no longer forced");
    assert_eq!(rig.master.w_CPU_CONTROL.load(), 0x0001, "until somebody writes it");
    rig.master.w_CPU_CONTROL.store(0x0000);
    rig.step(1_000);
    assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0001);
    let events: Vec<_> = rig.records().map(|record| record.event).collect();
    assert!(events.contains(&Force { plc: 0, offset: W_CPU_CONTROL, width: 2, value: 1 }.into()));
    assert!(events.contains(&Unforce { plc: 0, offset: W_CPU_CONTROL }.into()));
}

#[test]
fn what_cannot_be_forced_is_said() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    let mut message = |forced| rig.plant.force(forced).unwrap_err().to_string();
    let byte = Forced { width: Width::Byte, ..word(W_OPTION_STATUS + 1, 0) };
    assert_eq!(message(byte), "%MB3.200003: only a whole register can be forced, here %MW3.200002");
    let dword = Forced { width: Width::Dword, ..word(W_CPU_CONTROL, 0) };
    assert_eq!(message(dword), "%MD3.200000: only a whole register can be forced, here %MW3.200000");
    let wide = word(W_CPU_CONTROL, 0x1_0000);
    assert_eq!(message(wide), "%MW3.200000: 16#10000 does not fit, a WORD holds at most 16#FFFF");
    assert!(message(word(8, 0)).contains("lies in no area"));
    assert_eq!(message(Forced { plc: 7, ..word(W_CPU_CONTROL, 0) }), "there is no such PLC");
    assert!(rig.plant.forces().is_empty());
}

#[test]
fn there_is_an_end_to_them() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    // Plain RAM behind the registers of node 2.
    let place = |number: u32| word(NODE2 as u32 + 20_000 + 2 * number, number);
    for number in 0..256 {
        rig.plant.force(place(number)).unwrap();
    }
    assert!(matches!(rig.plant.force(place(256)), Err(ForceError::TooMany)));
    rig.plant.force(Forced { value: 99, ..place(255) }).expect("a forced one can be changed");
    assert_eq!(rig.plant.forces().len(), 256);
    assert!(rig.plant.forces().is_sorted_by_key(|forced| forced.offset));
}
