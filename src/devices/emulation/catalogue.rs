//! Catalogue of everything that can occur in a journal of any device. It is the sum of all registrations.

use super::traits::guest;
use super::{BUS_KINDS, records};
use crate::check;
use crate::devices::{all, folder, of_hash};
use crate::door::{DoorSpec, TrafficKind, doors_of};
use crate::fault;
use crate::fault::{BusSite, Fault};
use crate::journal;
use crate::journal::{Catalogue, EventKind, FaultName, Rule};
use crate::layout::DeviceLayout;
use std::sync::LazyLock;

/// Kinds of records, rules and faults that belong to no device, with their owner.
pub(in crate::devices) struct Generic {
    pub owner: &'static str,
    pub records: &'static [&'static EventKind],
    pub rules: &'static [&'static Rule],
    pub faults: &'static [&'static fault::FaultKind],
}

/// Returns the registrations that do not depend on the device, then the registrations of each kind of bus.
pub(in crate::devices) fn generic() -> impl Iterator<Item = Generic> {
    let own = [
        Generic { owner: "journal", records: journal::KINDS, rules: &[], faults: &[] },
        Generic { owner: "fault", records: fault::KINDS, rules: &[], faults: &[] },
        Generic { owner: "check", records: &[], rules: check::rules::ALL, faults: &[] },
        Generic { owner: "devices", records: records::KINDS, rules: &[], faults: &[] },
        Generic { owner: "folder", records: folder::records::KINDS, rules: folder::rules::ALL, faults: &[] },
        Generic { owner: "guests", records: guest::KINDS, rules: &[], faults: &[] },
    ];
    let of_media = BUS_KINDS.iter().map(|kind| Generic {
        owner: kind.name,
        records: kind.records,
        rules: kind.rules,
        faults: kind.faults,
    });
    own.into_iter().chain(of_media)
}

/// Returns all registrations: first the generic ones, then those of each device.
fn registrations() -> impl Iterator<Item = Generic> {
    let of_devices = all().iter().map(|device| Generic {
        owner: device.layout.name,
        records: device.emulation.records,
        rules: device.emulation.rules,
        faults: device.emulation.faults,
    });
    generic().chain(of_devices)
}

/// Returns all kinds of events, rules and kinds of faults. After this call, no device can be registered any
/// more.
pub fn catalogue() -> &'static Catalogue {
    static SUM: LazyLock<Catalogue> = LazyLock::new(|| {
        let (mut kinds, mut rules): (Vec<&EventKind>, Vec<&Rule>) = Default::default();
        for Generic { records, rules: more, .. } in registrations() {
            kinds.extend(records);
            rules.extend(more);
        }
        // Devices may share the faults of their family, so duplicates are removed.
        kinds.sort_by_key(|kind| kind.number());
        kinds.dedup_by(|one, other| core::ptr::eq(*one, *other));
        rules.sort_by_key(|rule| rule.number());
        rules.dedup_by(|one, other| core::ptr::eq(*one, *other));
        let name = |kind: &&fault::FaultKind| FaultName { number: kind.number(), name: kind.name() };
        Catalogue { kinds, rules, faults: fault_kinds().iter().map(name).collect() }
    });
    &SUM
}

/// Returns all kinds of faults, in the order of their numbers. After this call, no device can be registered
/// any more.
pub fn fault_kinds() -> &'static [&'static fault::FaultKind] {
    static SUM: LazyLock<Vec<&'static fault::FaultKind>> = LazyLock::new(|| {
        let own = generic().map(|it| it.faults).chain(all().iter().map(|device| device.emulation.faults));
        let mut kinds: Vec<&'static fault::FaultKind> = own.flatten().copied().collect();
        kinds.sort_by_key(|kind| kind.number());
        kinds.dedup_by(|one, other| core::ptr::eq(*one, *other));
        kinds
    });
    &SUM
}

/// Returns the kinds of faults that device folders declare. Only folders that this process has read count.
/// The kinds are in the order of reading.
pub(crate) fn declared_fault_kinds() -> Vec<&'static fault::FaultKind> {
    folder::declared_fault_kinds()
}

/// Returns the kinds of faults of [`fault_kinds`], then those of [`declared_fault_kinds`].
pub(crate) fn known_fault_kinds() -> Vec<&'static fault::FaultKind> {
    fault_kinds().iter().copied().chain(declared_fault_kinds()).collect()
}

/// Returns the kinds of faults that devices with these names can have.
#[cfg(feature = "cli")]
pub(crate) fn fault_kinds_of(names: &journal::Names) -> Vec<&'static fault::FaultKind> {
    fault::in_installation(&known_fault_kinds(), names)
}

/// Returns the kinds of faults that a device has itself.
pub fn faults_of_device(layout: &DeviceLayout) -> &'static [&'static fault::FaultKind] {
    of_hash(layout.layout_hash).map_or(&[], |known| known.emulation.faults)
}

/// Returns the fault targets of a bus of this family. In `participants`, bit n means participant n.
pub fn bus_site(family: &str, participants: u32) -> BusSite {
    let kind = BUS_KINDS.iter().find(|kind| kind.name == family);
    let (faults, fits) = kind.map_or((&[][..], (|_| Ok(())) as Fits), |kind| (kind.faults, kind.fits));
    BusSite { faults, fits, participants }
}

/// Checks that a bus of this family can have such a door.
///
/// # Errors
/// A text that names the kinds of doors of the family.
pub fn door_fits(family: &str, door: DoorSpec) -> Result<(), String> {
    let traffic_kind = BUS_KINDS.iter().find(|kind| kind.name == family).map(|kind| kind.traffic_kind);
    if traffic_kind == Some(door.traffic_kind()) {
        return Ok(());
    }
    let right = doors_of(traffic_kind.unwrap_or(TrafficKind::Frames));
    Err(format!("a {family} bus has no door {door}; open one of kind {right}"))
}

type Fits = fn(&Fault) -> Result<(), String>;

#[cfg(test)]
mod number_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn are_unique<T: Eq + std::hash::Hash>(all: impl ExactSizeIterator<Item = T>) -> bool {
        let count = all.len();
        all.collect::<HashSet<_>>().len() == count
    }

    #[test]
    fn numbers_and_names_are_unique() {
        let Catalogue { kinds, rules, faults } = catalogue();
        assert!(are_unique(kinds.iter().map(|kind| kind.number())), "{kinds:?}");
        assert!(are_unique(kinds.iter().map(|kind| kind.name())), "{kinds:?}");
        assert!(are_unique(rules.iter().map(|rule| rule.number())), "{rules:?}");
        assert!(are_unique(rules.iter().map(|rule| rule.id())), "{rules:?}");
        assert!(are_unique(faults.iter().map(|fault| fault.number)), "{faults:?}");
        assert!(are_unique(faults.iter().map(|fault| fault.name)), "{faults:?}");
    }

    #[test]
    fn numbers_and_names_lead_back() {
        for kind in &catalogue().kinds {
            assert_eq!(catalogue().kind(kind.name()), Some(*kind));
        }
        for rule in &catalogue().rules {
            assert_eq!(catalogue().rule(rule.number()), Some(*rule));
            assert_eq!(catalogue().rule_called(rule.id()), Some(*rule));
        }
        assert_eq!((catalogue().rule(u8::MAX), catalogue().rule_called("")), (None, None));
    }

    #[test]
    fn every_rule_describes_the_correct_access_in_full_sentences() {
        for rule in &catalogue().rules {
            let text = rule.text();
            assert!(text.ends_with('.') && text.matches(". ").count() >= 1, "{rule}: {text}");
            assert!(rule.id().bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-'), "{rule}");
        }
    }

    /// A rule may apply to several devices. So a page number in a rule is ambiguous without the name of its
    /// manual.
    #[test]
    fn pages_of_rules_name_their_manual() {
        for rule in catalogue().rules.iter().filter(|rule| rule.source().contains("p. ")) {
            for part in rule.source().split("; ").filter(|part| part.contains("p. ")) {
                let (manual, _) = part.split_once(" p. ").unwrap_or_default();
                let is_number = manual.bytes().next().is_some_and(|byte| byte.is_ascii_digit());
                let is_devices = all().iter().any(|device| device.layout.manual == manual);
                assert!(is_number && manual.contains('.') || is_devices, "{rule}: {part}");
            }
        }
    }

    /// The page for users lists exactly these rules, letter for letter.
    #[test]
    fn the_documentation_lists_exactly_these_rules() {
        let page = include_str!("../../../docs/reference/checker.md");
        let rows: Vec<_> = page.lines().filter(|line| line.starts_with("| `")).collect();
        let row = |rule: &&Rule| {
            format!("| `{rule}` | {} | {} | {} |", rule.severity(), rule.text(), rule.source())
        };
        assert_eq!(rows, catalogue().rules.iter().map(row).collect::<Vec<_>>());
    }
}
