//! Tests of the registration of devices.

use super::*;
use crate::event_kinds;
use crate::fault;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Reader, Rule};
use crate::rules;

rules! {
    OWN: 250, "own", Warning, "p. 1", "Something was done. Something else would be right.";
    SAME_NUMBER: 250, "other", Warning, "p. 1", "Something was done. Something else would be right.";
}

event_kinds! {
    /// A kind with the number that kind `frame` already has.
    NumberOfFrames = 2, "own", Rare, at plc {}

    /// A kind with the name that kind `frame` already has.
    NameOfFrames = 250, "frame", Rare, at plc {}
}

impl EventText for NumberOfFrames {
    fn text(&self, _: &mut Reader) -> String {
        "own".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

impl EventText for NameOfFrames {
    fn text(&self, _: &mut Reader) -> String {
        "own".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

/// Creates a device with this name and hash, and these registrations.
fn device(
    name: &'static str,
    layout_hash: u64,
    records: Vec<&'static EventKind>,
    rules: Vec<&'static Rule>,
) -> &'static Registered {
    let layout = Box::leak(Box::new(Layout { name, layout_hash, ..Layout::UNKNOWN }));
    let emulation = Emulation { records: records.leak(), rules: rules.leak(), ..Emulation::NONE };
    Box::leak(Box::new(Registered { emulation, ..Registered::new(layout) }))
}

fn taken(
    name: &'static str,
    what: &'static str,
    taken: impl ToString,
    other: &'static str,
) -> Result<(), RegisterError> {
    Err(RegisterError::Taken { name, what, taken: taken.to_string(), other })
}

#[test]
fn added_devices_follow_the_built_in_ones_in_registration_order() {
    let registry = Registry::new();
    let (one, two) = (device("one", 1, vec![], vec![&OWN]), device("two", 2, vec![], vec![&OWN]));
    assert_eq!(
        (registry.register(one), registry.register(two)),
        (Ok(()), Ok(())),
        "a family shares its rules"
    );
    let all = registry.all();
    assert_eq!(all.len(), BUILT_IN.len() + 2);
    assert!(core::ptr::eq(all[0], default()));
    assert!(core::ptr::eq(all[all.len() - 2], one) && core::ptr::eq(all[all.len() - 1], two));
}

#[test]
fn a_taken_name_or_number_is_refused() {
    let registry = Registry::new();
    let built_in = BUILT_IN[1].layout;
    let hash = format!("16#{:016X}", built_in.layout_hash);
    let refusals = [
        (
            device(built_in.name, 1, vec![], vec![]),
            taken(built_in.name, "the name", built_in.name, built_in.name),
        ),
        (
            device("it", built_in.layout_hash, vec![], vec![]),
            taken("it", "the layout hash", hash, built_in.name),
        ),
        (device("it", 1, vec![], ALL.to_vec()), taken("it", "the number of rule", 250, "it")),
    ];
    for (device, refusal) in refusals {
        assert_eq!(registry.register(device), refusal);
    }
    assert_eq!(registry.register(device("it", 1, vec![], vec![&OWN])), Ok(()));
    assert_eq!(registry.register(device("it", 2, vec![], vec![])), taken("it", "the name", "it", "it"));
    assert_eq!(
        registry.register(default()),
        taken(default().layout.name, "the name", default().layout.name, default().layout.name)
    );
    let other = device("other", 2, vec![], vec![&SAME_NUMBER]);
    assert_eq!(registry.register(other), taken("other", "the number of rule", 250, "it"));
}

#[test]
fn numbers_and_names_of_records_of_commram_are_taken() {
    let registry = Registry::new();
    let number = device("it", 1, vec![NumberOfFrames::KIND], vec![]);
    assert_eq!(registry.register(number), taken("it", "the number of record", 2, "cansync"));
    let name = device("it", 1, vec![NameOfFrames::KIND], vec![]);
    assert_eq!(registry.register(name), taken("it", "the name of record", "frame", "cansync"));
}

static OWN_FAULT: fault::FaultKind = fault::FaultKind::new(
    250,
    "own_fault",
    fault::TargetKind::Device,
    "It stops",
    |_| fault::Effect::new(()),
);
static NUMBER_OF_BUS_OFF: fault::FaultKind =
    fault::FaultKind::new(11, "other_fault", fault::TargetKind::Device, "It stops", |_| {
        fault::Effect::new(())
    });
static NAME_OF_BUS_OFF: fault::FaultKind =
    fault::FaultKind::new(251, "bus_off", fault::TargetKind::Device, "It stops", |_| fault::Effect::new(()));

#[test]
fn faults_belong_to_one_family() {
    let registry = Registry::new();
    let with = |name, hash, kind: &'static fault::FaultKind| {
        let Registered { layout, .. } = device(name, hash, vec![], vec![]);
        let emulation = Emulation { faults: vec![kind].leak(), ..Emulation::NONE };
        &*Box::leak(Box::new(Registered { emulation, ..Registered::new(layout) }))
    };
    assert_eq!(registry.register(with("it", 1, &OWN_FAULT)), Ok(()));
    assert_eq!(registry.register(with("other", 2, &OWN_FAULT)), Ok(()), "a family shares its faults");
    let number = registry.register(with("third", 3, &NUMBER_OF_BUS_OFF));
    assert_eq!(number, taken("third", "the number of fault", 11, "cansync"));
    let name = registry.register(with("third", 3, &NAME_OF_BUS_OFF));
    assert_eq!(name, taken("third", "the name of fault", "bus_off", "cansync"));
}

#[test]
fn the_first_lookup_ends_the_registration() {
    let registry = Registry::new();
    registry.all();
    assert_eq!(
        registry.register(device("it", 1, vec![], vec![])),
        Err(RegisterError::TooLate { name: "it" })
    );
}
