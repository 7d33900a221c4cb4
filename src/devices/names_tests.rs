//! Tests the search for names from the manuals, and the meanings of values.

use super::bm4_o_can_06::registers::DEVICE as SLOTS;
use super::omega_drive_line_2::registers::DEVICE;
use crate::identity::PortNumber;
use crate::layout::{DeviceFit, Fit, Role};

fn error(name: &str) -> String {
    DEVICE.register(name).unwrap_err().to_string()
}

#[test]
fn a_variable_of_the_manual_names_its_structure() {
    for (name, address) in [
        ("_CANsync_CTRL_MA.w_CPU_CONTROL", "%MW3.200000"),
        ("_CANsync_CTRL_SL.w_OMEGA_NR", "%MW3.100006"),
        ("_CANsync_INIT_MA.b_BT_0", "%MB3.200015"),
    ] {
        assert_eq!(DEVICE.register(name).unwrap().address().to_string(), address, "{name}");
    }
    assert_eq!(DEVICE.register("_CANsync_CTRL_MA.w_CPU_CONTROL").unwrap().name(), "node2.w_CPU_CONTROL");
    assert!(error("_CANsync_CTRL_MA.b_BT_0").starts_with("area `node2` has no register `b_BT_0`"));
    assert_eq!(error("_cansync_ctrl_ma.x"), "`_cansync_ctrl_ma` is spelled `_CANsync_CTRL_MA`");
    let unknown = error("_CANsync.w_CPU_CONTROL");
    assert!(unknown.starts_with("unknown variable `_CANsync`; the variables are "), "{unknown}");
    assert!(unknown.contains("_CANsync_INIT_MA, _CANsync_CTRL_MA"), "{unknown}");
    let all = DEVICE.registers("_CANsync_INIT_SL").unwrap();
    assert!(all.iter().all(|found| found.structure().name == "CANsync_INIT_BMSTRUCT"));
    assert_eq!(all.len(), 6 + 8 + 32);
}

#[test]
fn the_role_decides_between_different_meanings() {
    let [master, slave] = ["_CANsyncMaster_Ctrl_Slot_G", "_CANsyncSlave_Ctrl_Slot_G"];
    let offset = |fit, name: &str| {
        DeviceFit::unknown(&SLOTS).with(PortNumber(1), fit).register(name).unwrap().offset() - 2_001_792
    };
    assert_eq!(offset(Fit::As(Role::Master), "slotG.b_STATREG_RDC1"), 185);
    assert_eq!(offset(Fit::As(Role::Slave), "slotG.b_STATREG_RDC1"), 180);
    for fit in [Fit::Unknown, Fit::Empty] {
        assert_eq!(
            DeviceFit::unknown(&SLOTS)
                .with(PortNumber(1), fit)
                .register("slotG.b_STATREG_RDC1")
                .unwrap_err()
                .to_string(),
            format!("`slotG.b_STATREG_RDC1` is ambiguous: {master}.b_STATREG_RDC1 or {slave}.b_STATREG_RDC1")
        );
        for (variable, place) in [(master, 185), (slave, 180)] {
            let name = format!("{variable}.b_STATREG_RDC1");
            assert_eq!(offset(fit, &name), place);
            assert_eq!(
                DeviceFit::unknown(&SLOTS).with(PortNumber(1), fit).register(&name).unwrap().name(),
                name
            );
        }
    }
    let known = DeviceFit::unknown(&SLOTS).with(PortNumber(1), Fit::As(Role::Master));
    let register = known.register(&format!("{master}.b_STATREG_RDC1")).unwrap();
    assert_eq!(register.name(), "slotG.b_STATREG_RDC1");
    assert_eq!(
        known.register(&format!("{slave}.b_STATREG_RDC1")).unwrap_err().to_string(),
        format!("`{slave}` belongs to a slave, but `slotG` is a master")
    );
    assert!(known.register("slotG.a_WR_VALUE_RECEIVE[0]").is_err());
    let both = SLOTS.registers("slotG.b_STATREG_RDC1").unwrap();
    let both: Vec<_> = both.iter().map(|found| found.name()).collect();
    assert_eq!(both, [format!("{slave}.b_STATREG_RDC1"), format!("{master}.b_STATREG_RDC1")]);
}

#[test]
fn additions_to_a_manual_name_their_decision() {
    let decode = |name: &str, value| DEVICE.register(name).unwrap().decode(value);
    assert_eq!(decode("baps.us_PAR_ELEMENT", 7), "value");
    assert_eq!(decode("baps.us_PAR_ELEMENT", 5), "minimum (D-160)");
    // If one decision is the source of several adjacent bits, only the last of these bits names the decision.
    assert_eq!(decode("node2.a_CONTROLWORD_SL[1]", 0x0006), "enable voltage, no quick stop (D-87)");
    assert_eq!(decode("baps.w_STATUSWORD", 0x8001), "ready to switch on, quick stop (D-87), synchronized");
}
