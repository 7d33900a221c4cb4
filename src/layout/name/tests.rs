//! Names of registers, correct and wrong, with nodes and with slots.

use crate::devices::samples::tables::NODES as DEVICE;
use crate::devices::samples::tables::SLOTS;
use crate::identity::PortNumber;
use crate::layout::{AreaOrRegisters, DeviceFit, Fit, LayoutError, RegisterRef, Role, split_plc};

fn error(name: &str) -> String {
    DEVICE.register(name).unwrap_err().to_string()
}

#[test]
fn names_and_addresses_agree_both_ways() {
    for (name, address) in [
        ("node2.w_CPU_CONTROL", "%MW3.200000"),
        ("node1.w_OPTION_STATUS", "%MW3.100002"),
        ("node2.b_MA_SL_MODE", "%MB3.200012"),
        ("node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0", "%MB3.200020"),
        ("node1._CFG_RDC_WORD.b_CFG_RDC1_WORD0", "%MB3.100100"),
        ("node2.a_WR_VALUE[31]", "%MD3.200176"),
        ("node2.a_RD_BMARRAY[3][0]", "%MD3.201024"),
        ("node2.a_CFG_RDC_WORD[31].b_CFG_RDC2_WORD3", "%MB3.200820"),
        ("ethernet_config.d_ROUTER", "%MD3.180028"),
        ("ethernet_config.a_IP_ADDRESS[3]", "%MB3.180023"),
    ] {
        let register = DEVICE.register(name).unwrap();
        assert_eq!(register.address().to_string(), address);
        assert_eq!(register.name(), name);
    }
}

#[test]
fn a_dot_between_the_brackets_is_taken_as_in_the_watch_window() {
    let register = DEVICE.register("node2.a_RD_BMARRAY[3].[15]").unwrap();
    assert_eq!(register.path(), "a_RD_BMARRAY[3][15]");
    assert!(register.is_reserved());
}

#[test]
fn the_plc_is_split_off() {
    assert_eq!(split_plc("line2:node2.w_CPU_CONTROL"), (Some("line2"), "node2.w_CPU_CONTROL"));
    assert_eq!(split_plc("node2.w_CPU_CONTROL"), (None, "node2.w_CPU_CONTROL"));
}

#[test]
fn wrong_names_are_answered_with_the_right_ones() {
    let areas: Vec<_> = DEVICE.areas.iter().map(|area| area.name).collect();
    assert_eq!(
        error("node3.w_CPU_CONTROL"),
        format!("unknown area `node3`; the areas are {}; did you mean node1 or node2?", areas.join(", "))
    );
    assert_eq!(error("Node2.w_CPU_CONTROL"), "`Node2` is spelled `node2`");
    assert_eq!(error("node2.w_cpu_control"), "`w_cpu_control` is spelled `w_CPU_CONTROL`");
    assert_eq!(
        error("node2.a_rd_bmarray[3][0]"),
        "`a_rd_bmarray[3][0]` is spelled `a_RD_BMARRAY[0..31][0..15]`"
    );
    assert_eq!(
        error("node2.w_CPU_CONTRL"),
        "area `node2` has no register `w_CPU_CONTRL`; did you mean w_CPU_CONTROL?"
    );
    assert_eq!(
        error("node1.a_WR_VALUE[0]").split(';').next(),
        Some("area `node1` has no register `a_WR_VALUE`")
    );
    assert_eq!(error("option1.x"), "area `option1` has no register `x`: it is plain RAM, use an address");
    assert_eq!(
        error("node2.a_DATA_PARAMETER"),
        "`a_DATA_PARAMETER` is a sub-structure, not a register; its registers are d_PAR_VALUE, w_PAR_NR, \
         w_SUBSL_ADR"
    );
}

#[test]
fn without_an_area_the_only_register_of_that_name_is_meant() {
    let name = |text: &str| DEVICE.register(text).unwrap().name();
    assert_eq!(name("a_STAT_SL[3]"), "node2.a_STAT_SL[3]");
    assert_eq!(name("a_DATA_PARAMETER[1].w_PAR_NR"), "node2.a_DATA_PARAMETER[1].w_PAR_NR");
    assert_eq!(DEVICE.registers("a_STAT_SL").unwrap().len(), 32);
    assert_eq!(
        error("w_CPU_CONTROL"),
        "`w_CPU_CONTROL` is ambiguous: node1.w_CPU_CONTROL or node2.w_CPU_CONTROL"
    );
    assert_eq!(error("w_CPU_CONTRL"), "no area has a register `w_CPU_CONTRL`; did you mean w_CPU_CONTROL?");
    assert_eq!(error("a_stat_sl[0]"), "`a_stat_sl[0]` is spelled `a_STAT_SL[0..31]`");
    assert!(error("a_STAT_SL[32]").contains("index 32 is out of range"));
    assert!(error("a_STAT_SL").contains("needs indices"));
}

#[test]
fn a_block_or_a_pattern_is_not_one_register() {
    assert!(
        error("node2").starts_with("`node2` is a block of registers, not one register; `commram dump node2`")
    );
    let variable = DEVICE.area("node2").unwrap().structures.last().unwrap().variable;
    assert!(error(variable).contains("is a block of registers"));
    assert!(error("node2.a_STAT_SL[0..3]").contains("can mean several registers"));
    let named = |name: &str| DeviceFit::unknown(&DEVICE).area_or_registers(name);
    assert!(matches!(named("node2"), Ok(AreaOrRegisters::Area(area)) if area.name == "node2"));
    assert!(matches!(named("node2.a_STAT_SL"), Ok(AreaOrRegisters::Registers(all)) if all.len() == 32));
    assert!(matches!(named("a_STAT_SL"), Ok(AreaOrRegisters::Registers(all)) if all.len() == 32));
    let of = |name: &str| DEVICE.registers(name).unwrap().iter().map(RegisterRef::name).collect::<Vec<_>>();
    let element =
        ["d_PAR_VALUE", "w_PAR_NR", "w_SUBSL_ADR"].map(|own| format!("node2.a_DATA_PARAMETER[1].{own}"));
    assert_eq!(of("node2.a_DATA_PARAMETER[1]"), element);
    assert_eq!(of("a_DATA_PARAMETER[1]"), element);
    assert!(matches!(named("node7"), Err(LayoutError::UnknownArea { .. })));
    assert!(matches!(named("w_CPU_CONTRL"), Err(LayoutError::UnknownName { .. })));
}

#[test]
fn wrong_indices_are_answered_with_the_ranges() {
    assert_eq!(
        error("node2.a_RD_BMARRAY[32][0]"),
        "`a_RD_BMARRAY[32][0]`: index 32 is out of range, a_RD_BMARRAY has elements 0 to 31"
    );
    assert_eq!(
        error("node2.a_RD_BMARRAY[0][16]"),
        "`a_RD_BMARRAY[0][16]`: index 16 is out of range, a_RD_BMARRAY has elements 0 to 15"
    );
    assert_eq!(error("node2.a_RD_BMARRAY[0]"), "`a_RD_BMARRAY[0]` needs indices: a_RD_BMARRAY[0..31][0..15]");
    assert_eq!(
        error("node2.a_DATA_PARAMETER.w_PAR_NR[3]"),
        "`a_DATA_PARAMETER.w_PAR_NR[3]` needs indices: a_DATA_PARAMETER[0..31].w_PAR_NR"
    );
    let several = |name: &str| DEVICE.registers(name).unwrap_err().to_string();
    assert_eq!(
        several("node2.a_DATA_PARAMETER[32]"),
        "`a_DATA_PARAMETER[32]`: index 32 is out of range, a_DATA_PARAMETER has elements 0 to 31"
    );
    assert_eq!(
        several("node2.a_DATA_PARAMETER[3][0]"),
        "`a_DATA_PARAMETER[3][0]` needs indices: a_DATA_PARAMETER[0..31].d_PAR_VALUE"
    );
    assert_eq!(error("node2.w_CPU_CONTROL[0]"), "`w_CPU_CONTROL[0]` is not an array; leave out the index");
    assert!(error("node2.a_STAT_SL[99999999]").contains("index 99999999 is out of range"));
    for name in ["node2.w_CPU_CONTROL[0]", "node2.a_STAT_SL[0][0]", "node2.a_DATA_PARAMETER[0].w_PAR_NR[0]"] {
        assert_eq!(DEVICE.registers(name).unwrap_err(), DEVICE.register(name).unwrap_err(), "{name}");
    }
}

#[test]
fn malformed_names_are_refused_with_the_reason() {
    for (name, reason) in [
        ("node2.", "an empty part"),
        ("node2..x", "an empty part"),
        ("node2.a[", "a `[` without `]`"),
        ("node2.a[1]x", "something after a `]`"),
        ("node2.a[x]", "an index that is no number"),
        ("node2.a[-1]", "an index that is no number"),
        ("node2.a.b.c", "too many parts"),
    ] {
        let error = DEVICE.register(name).unwrap_err();
        assert!(
            matches!(error, LayoutError::BadName { reason: found, .. } if found == reason),
            "{name}: {error}"
        );
    }
}

#[test]
fn a_name_may_cover_many_registers() {
    let names = |name: &str| -> Vec<String> {
        DEVICE.registers(name).unwrap().iter().map(|register| register.path()).collect()
    };
    assert_eq!(names("node2.w_CPU_CONTROL"), ["w_CPU_CONTROL"]);
    assert_eq!(names("node2.a_STAT_SL").len(), 32);
    assert_eq!(names("node2.a_RD_BMARRAY").len(), 512);
    assert_eq!(names("node2.a_RD_BMARRAY[7]").first().unwrap(), "a_RD_BMARRAY[7][0]");
    assert_eq!(names("node2.a_RD_BMARRAY[7]").len(), 16);
    assert_eq!(
        names("node2.a_DATA_PARAMETER")[..4],
        [
            "a_DATA_PARAMETER[0].d_PAR_VALUE",
            "a_DATA_PARAMETER[0].w_PAR_NR",
            "a_DATA_PARAMETER[0].w_SUBSL_ADR",
            "a_DATA_PARAMETER[1].d_PAR_VALUE"
        ]
    );
    assert_eq!(names("node2.a_DATA_PARAMETER.w_PAR_NR").len(), 32);
    assert_eq!(names("node1._CFG_RDC_WORD").len(), 16);
    assert_eq!(names("ethernet_config").len(), 10);
    assert_eq!(names("node2").iter().filter(|name| *name == "w_CPU_CONTROL").count(), 1);
    assert!(DEVICE.registers("node2.a_RD_BMARRAY[32]").is_err());
    assert!(DEVICE.registers("node2.nothing").is_err());
}

fn slot_g(fit: Fit) -> DeviceFit {
    DeviceFit::unknown(&SLOTS).with(PortNumber(1), fit)
}

#[test]
fn variables_and_areas_of_a_device_have_different_names() {
    for device in [&DEVICE, &SLOTS] {
        let placed = device.areas.iter().flat_map(|area| area.structures);
        let mut names: Vec<_> = placed.map(|placed| placed.variable).collect();
        names.extend(device.areas.iter().map(|area| area.name));
        let all = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all);
    }
}

#[test]
fn where_master_and_slave_agree_no_role_is_needed() {
    for name in ["slotG.w_CPU_CONTROL", "slotG.w_SLAVE_NUMBER", "slotG.b_BT_0", "slotG.a_SL_TYP[3]"] {
        let register = SLOTS.register(name).unwrap();
        assert_eq!(register.name(), name);
    }
    assert_eq!(SLOTS.register("slotM.w_CPU_CONTROL").unwrap().address().to_string(), "%MW3.7001792");
}

#[test]
fn every_name_resolves_to_its_register_with_any_modules() {
    for fit in [Fit::Unknown, Fit::As(Role::Master), Fit::As(Role::Slave)] {
        let fitted = slot_g(fit);
        for found in fitted.registers("slotG").unwrap() {
            let named = fitted.register(&found.name()).unwrap();
            assert_eq!((named.address(), named.path()), (found.address(), found.path()), "{found} {fit:?}");
        }
    }
}
