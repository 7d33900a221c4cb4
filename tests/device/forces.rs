//! Forced registers keep their values against the firmware and the PLC until they are unforced (D-105).

use crate::rig::{BOTH, FASTEST, Memory, Rate, Rig};
use commram::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::identity::DeviceIndex;
use commram::journal::{Force, State, Unforce};
use commram::memory::Width;
use commram::plant::{ForceError, Forced};
use core::mem::offset_of;

/// Returns the offsets of `w_CPU_CONTROL`, `w_OPTION_STATUS` and `b_CTRLREG_WRC1` of the master.
fn registers(rate: Rate) -> [u32; 3] {
    [
        offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_CPU_CONTROL),
        offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_OPTION_STATUS),
        offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1),
    ]
    .map(|offset| rate.kind.master.base + offset as u32)
}

fn word(offset: u32, value: u32) -> Forced {
    Forced { plc: DeviceIndex(0), offset, width: Width::Word, value }
}

#[test]
fn the_firmware_cannot_change_a_forced_register() {
    for rate in FASTEST {
        let [_, w_option_status, _] = registers(rate);
        for memory in BOTH {
            let mut rig = Rig::new(memory, rate);
            rig.plant.force(word(w_option_status, 0x1234)).unwrap();
            assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x1234, "at once");
            rig.master.w_CPU_CONTROL.store(0x0001);
            rig.step(2_000);
            assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x1234);
            let changed =
                rig.records().any(|record| record.event.get().is_some_and(|it: State| it.to == 0x0002));
            assert!(changed, "the state machine itself goes on");
        }
    }
}

#[test]
fn a_register_that_the_firmware_writes_in_each_poll_has_the_same_journal_in_any_slices() {
    for rate in FASTEST {
        let offset = rate.kind.master.base + offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_CANsync_STATUS) as u32;
        let journal = |slice_us| {
            let mut rig = Rig::new(Memory::Heap, rate);
            rig.plant.force(word(offset, 0x4739)).unwrap();
            (0..20_000 / slice_us).for_each(|_| rig.step(slice_us));
            assert_eq!(rig.master.w_CANsync_STATUS.load(), 0x4739);
            rig.records().collect::<Vec<_>>()
        };
        let whole = journal(20_000);
        assert!(whole.len() > 1, "{whole:?}");
        for slice_us in [500, 1_000, 2_500, 5_000] {
            assert_eq!(journal(slice_us), whole, "slices of {slice_us} us");
        }
    }
}

#[test]
fn the_firmware_sees_no_other_value() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.activate();
        let [_, _, b_ctrlreg_wrc1] = registers(rate);
        let released =
            Forced { plc: DeviceIndex(0), offset: b_ctrlreg_wrc1, width: Width::Byte, value: 0x05 };
        rig.plant.force(released).unwrap();
        for _ in 0..5 {
            rig.master.b_CTRLREG_WRC1.store(0xFF);
            rig.run_to_sync();
            assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x05);
        }
        let sent = rig.frames().iter().filter(|(_, frame)| frame.id() & 0x7E0 == 0x100).count();
        assert_eq!(sent, 5, "one in each interval");
    }
}

#[test]
fn an_unforced_register_changes_again() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let [w_cpu_control, ..] = registers(rate);
        rig.plant.force(word(w_cpu_control, 0x0001)).unwrap();
        rig.master.w_CPU_CONTROL.store(0x0000);
        rig.step(1_000);
        assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0002);
        assert!(rig.plant.unforce(DeviceIndex(0), w_cpu_control));
        assert!(!rig.plant.unforce(DeviceIndex(0), w_cpu_control), "it is no longer forced");
        assert_eq!(rig.master.w_CPU_CONTROL.load(), 0x0001, "until the next write");
        rig.master.w_CPU_CONTROL.store(0x0000);
        rig.step(1_000);
        assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0001);
        let events: Vec<_> = rig.records().map(|record| record.event).collect();
        assert!(
            events.contains(&Force { plc: DeviceIndex(0), offset: w_cpu_control, width: 2, value: 1 }.into())
        );
        assert!(events.contains(&Unforce { plc: DeviceIndex(0), offset: w_cpu_control }.into()));
    }
}

#[test]
fn a_refused_force_gives_its_reason() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let [w_cpu_control, w_option_status, _] = registers(rate);
        let mut message = |forced| rig.plant.force(forced).unwrap_err().to_string();
        let byte = Forced { width: Width::Byte, ..word(w_option_status + 1, 0) };
        let whole = "only a whole register can be forced, here";
        assert_eq!(message(byte), format!("%MB3.{}: {whole} %MW3.{w_option_status}", w_option_status + 1));
        let dword = Forced { width: Width::Dword, ..word(w_cpu_control, 0) };
        assert_eq!(message(dword), format!("%MD3.{w_cpu_control}: {whole} %MW3.{w_cpu_control}"));
        let wide = word(w_cpu_control, 0x1_0000);
        let expected = format!("%MW3.{w_cpu_control}: 16#10000 does not fit, a WORD holds at most 16#FFFF");
        assert_eq!(message(wide), expected);
        assert!(message(word(8, 0)).contains("is not in any area"));
        assert_eq!(message(Forced { plc: DeviceIndex(7), ..word(w_cpu_control, 0) }), "there is no such PLC");
        assert!(rig.plant.forces().is_empty());
    }
}

#[test]
fn the_number_of_forced_registers_is_limited() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        let first = rate.kind.master.base + offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_RD_BMARRAY) as u32;
        let place = |number: u32| Forced { width: Width::Dword, ..word(first + 4 * number, number) };
        for number in 0..256 {
            rig.plant.force(place(number)).unwrap();
        }
        assert!(matches!(rig.plant.force(place(256)), Err(ForceError::TooMany)));
        rig.plant.force(Forced { value: 99, ..place(255) }).expect("a forced one can be changed");
        assert_eq!(rig.plant.forces().len(), 256);
        assert!(rig.plant.forces().is_sorted_by_key(|forced| forced.offset));
    }
}
