//! Checks the sources of all facts of the register maps. A fact either is documented, with its page, or
//! follows from a decision in one of the pages `decisions.md` of the documentation.

use super::omega_drive_line_2::registers::DEVICE;
use super::{all, bm4_o_can_06, omega_drive_line_2};
use crate::layout::{DeviceLayout, Meaning, Provenance, Register, Structure, ValueMeaning};
use std::collections::BTreeMap;

const DECISIONS: [&str; 6] = [
    include_str!("../../docs/devices/bm4-plc/decisions.md"),
    include_str!("../../docs/devices/can-dp2/decisions.md"),
    include_str!("../../docs/devices/cansync/decisions.md"),
    include_str!("../../docs/devices/cs0015/decisions.md"),
    include_str!("../../docs/devices/omega-drive-line-2/decisions.md"),
    include_str!("../../docs/internals/decisions.md"),
];

fn structures() -> impl Iterator<Item = &'static Structure> {
    DEVICE.areas.iter().flat_map(|area| area.structures).map(|placed| placed.structure)
}

fn registers() -> impl Iterator<Item = &'static Register> {
    structures().flat_map(|structure| structure.registers)
}

fn meanings() -> BTreeMap<&'static str, &'static Meaning> {
    registers().filter_map(|register| register.meaning).map(|meaning| (meaning.name, meaning)).collect()
}

/// Returns all sources in a meaning, each with the text that has this source.
fn sources(meaning: &Meaning) -> Vec<(&'static str, Provenance)> {
    let values = |of: &'static [ValueMeaning]| of.iter().map(|value| (value.text, value.source));
    let bits = meaning.bits.iter().flat_map(|bit| values(bit.values).chain([(bit.name, bit.source)]));
    values(meaning.values).chain(bits).collect()
}

#[track_caller]
fn check(what: &str, source: Provenance, page: &str) {
    match source {
        Provenance::Manual => {
            let pages = page.split(", ").flat_map(|range| range.split('-'));
            let known = |page: &str| page.parse().is_ok_and(|page: u16| (1..=276).contains(&page));
            assert!(pages.clone().count() > 0 && pages.clone().all(known), "{what}: pages `{page}`");
        }
        Provenance::Documented(document) => assert!(!document.is_empty(), "{what}"),
        // A fact of a sub-structure can follow from two decisions.
        Provenance::Inferred(decisions) => decisions.split(' ').for_each(|decision| {
            let heading = format!("\n### {decision}: ");
            assert!(
                DECISIONS.iter().any(|page| page.contains(&heading)),
                "{what}: {decision} has no entry in the \
                 pages of DECISIONS in src/devices/provenance_tests.rs; write it in decisions.md of the device, and add the page of \
                 a new device to DECISIONS, as docs/internals/architecture.md, section \"A device\", says"
            );
        }),
    }
}

#[test]
fn every_fact_has_a_page_or_a_decision() {
    for device in all() {
        every_fact_of(device.layout);
    }
}

/// The comments of the layouts have the pages of the documented deadlines.
#[test]
fn every_deadline_of_a_baud_rate_has_a_page_or_a_decision() {
    let rates =
        [&omega_drive_line_2::registers::BAUD_RATES[..], &bm4_o_can_06::registers::BAUD_RATES].concat();
    for rate in rates {
        for deadline in [rate.deadline_WRC, rate.deadline_RDC1, rate.deadline_RDC2] {
            if deadline.source.decision().is_some() {
                check(&format!("{} kbit/s", rate.kbit_per_s), deadline.source, "");
            }
        }
    }
}

#[test]
#[cfg(feature = "emulator")]
fn every_fact_of_a_drive_parameter_has_a_page_or_a_decision() {
    for row in &super::cansync::drive::PARAMETERS {
        for (fact, source) in row.facts() {
            assert_ne!(source, Provenance::Manual, "P{}: {fact}: the source names the manual", row.number);
            check(&format!("P{}: {fact}", row.number), source, "");
        }
    }
}

fn every_fact_of(device: &'static DeviceLayout) {
    for word in device.front {
        check(word.name, word.source, word.page);
    }
    for object in device.objects {
        check(&object.to_string(), object.row_from, object.page);
        check(&object.to_string(), object.default_from, object.page);
    }
    if let Some(gsd) = device.gsd {
        for key in gsd.keys {
            check(key.name, key.from, gsd.page);
        }
        if let Some(texts) = &gsd.diagnosis {
            check(texts.register.name, texts.from, gsd.page);
        }
        for module in gsd.modules {
            check(module.name, module.from, module.page);
        }
    }
    for area in device.areas {
        check(area.name, area.name_from, area.page);
        if let Some(phases) = area.phases {
            check(phases.register, phases.source, area.page);
        }
        for placed in area.structures {
            check(placed.variable, placed.variable_from, placed.structure.page);
        }
    }
    for structure in device.areas.iter().flat_map(|area| area.structures).map(|placed| placed.structure) {
        check(structure.name, structure.name_from, structure.page);
        for register in structure.registers {
            for (fact, source) in register.facts() {
                check(&format!("{}.{}: {fact}", structure.name, register.name), source, register.page);
            }
            check(register.group_type, register.group_type_from, register.page);
            for (meaning, (text, source)) in register
                .meaning
                .into_iter()
                .flat_map(|known| sources(known).into_iter().map(move |it| (known, it)))
            {
                check(&format!("{}: {}: {text}", device.name, meaning.name), source, meaning.page);
            }
        }
    }
}

/// Facts that no manual states must have the mark `inferred`.
#[test]
fn undocumented_facts_are_marked() {
    let decisions = |meaning: &str| -> Vec<_> {
        sources(meanings()[meaning]).into_iter().map(|(text, source)| (text, source.decision())).collect()
    };
    let all = |meaning: &str, decision: &str| {
        let found = decisions(meaning);
        assert!(found.iter().all(|(_, known)| *known == Some(decision)), "{meaning}: {found:?}");
    };
    all("sync_modus", "D-06");
    all("sw_release", "D-35");
    all("baps_job", "D-150");
    all("baps_format", "D-150");
    all("baps_command", "D-151");
    all("drive_control", "D-87");
    let some = |meaning: &str, text: &str| {
        decisions(meaning).into_iter().find(|(known, _)| known.contains(text)).unwrap().1
    };
    assert_eq!(some("ip_config", "delivery state"), Some("D-327"));
    assert_eq!(some("ip_config", "own fixed address"), None);
    for bits in ["par_job_master", "par_job_slave", "updown_master", "updown_slave"] {
        assert_eq!((some(bits, "no job"), some(bits, "busy")), (Some("D-322"), None), "{bits}");
    }
    assert_eq!(some("cansync_status", "nothing to report"), Some("D-322"));
    assert_eq!(some("par_element", "minimum"), Some("D-160"));
    assert_eq!(some("par_element", "value"), None);
    assert_eq!(some("baps_status_reg", "reserved"), Some("D-328"));
    assert_eq!(some("drive_status", "ready"), Some("D-87"));
    assert_eq!(some("drive_status", "synchronized"), None);
    assert!(
        registers()
            .filter(|register| !register.group.is_empty())
            .all(|register| { register.group_type_from == Provenance::Inferred("D-326") })
    );
}

#[test]
fn the_sources_of_registers_are_those_of_the_facts() {
    let source = |name: &str, fact: &str| {
        let register = DEVICE.register(name).unwrap().register;
        register.facts().into_iter().find(|(known, _)| *known == fact).unwrap().1.decision()
    };
    assert_eq!(source("node2.w_OPTION_STATUS", "reset"), None, "p. 150");
    assert_eq!(source("node2.w_OPTION_STATUS", "offset"), Some("D-02"));
    assert_eq!(source("node2.a_WR_VALUE[0]", "type"), Some("D-90"));
    assert_eq!(source("node2.b_CTRLREG_WRC1", "type"), None, "its short name says it");
    assert_eq!(source("node2.b_CTRLREG_WRC3", "owner"), Some("D-91"));
    assert_eq!(source("baps.w_COMMAND_REG", "reset"), Some("D-320"));
    assert_eq!(source("ethernet_config.d_ROUTER", "reset"), Some("D-320"));
    assert_eq!(source("ethernet_config.d_ROUTER", "offset"), None);
}

/// Several structures share a sub-structure. A register's page depends on the structure in which the register
/// is found.
#[test]
fn registers_of_sub_structures_have_the_page_of_their_use() {
    let page = |name: &str| DEVICE.register(name).unwrap().register.page;
    assert_eq!(page("node2.a_STATREG_RDC[1].b_STATREG_RDC1"), "155");
    assert_eq!(page("node1.a_STATREG_RDC[1].b_STATREG_RDC1"), "182");
    assert_eq!(page("node1._CFG_RDC_WORD.b_CFG_RDC1_WORD0"), "179-180");
    assert_eq!(page("node1.a_CFG_RDC_WORD[0].b_CFG_RDC1_WORD0"), "183-184");
    assert_eq!(page("node2.w_CPU_CONTROL"), "149-150, 174-175");
    assert_eq!(page("node2.w_OMEGA_NR"), "147-148, 173");
}
