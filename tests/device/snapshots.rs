//! A plant restored from a snapshot continues exactly like a plant that did not stop, for every plant and every sequence of
//! events.

mod acts;

pub(crate) use acts::bring_up;

use crate::rig::plant_of;
use acts::{Act, BM4, OMEGA, PLANTS, act, masters, nodes, take};
use commram::devices::all;
use commram::devices::cansync::records::InitRefused;
use commram::identity::DeviceIndex;
use commram::journal::Record;
use commram::layout::Width;
use commram::plant::{Plant, PlantConfig};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// The master that starts is active: reference values are sent.
#[test]
fn masters_that_have_come_up_send_reference_values() {
    for text in [OMEGA, BM4] {
        let mut plant = plant_of(text);
        bring_up(&mut plant);
        take(&mut plant, &Act::Reference(7));
        plant.advance_to(plant.now() + 10_000);
        let sent: Vec<_> = masters(&plant).map(|master| master.load("b_CTRLREG_WRC1")).collect();
        assert_eq!(sent, [0x04; 2], "{text}");
    }
}

fn records_from(plant: &Plant, from: u64) -> Vec<Record> {
    plant.journal().read(from).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_restored_plant_continues_like_the_original(
        which in 0..PLANTS.len(),
        comes_up in prop::bool::weighted(0.7),
        before in prop::collection::vec(act(), 0..60),
        after in prop::collection::vec(act(), 1..25),
    ) {
        let mut plant = plant_of(PLANTS[which]);
        if comes_up {
            bring_up(&mut plant);
        }
        for act in &before {
            take(&mut plant, act);
        }
        let snapshot = plant.snapshot();
        let position = plant.journal().end();
        let mut other = plant_of(PLANTS[which]);
        prop_assert_eq!(other.restore(&snapshot), Ok(()));
        prop_assert!(other.snapshot() == snapshot, "what is restored is what was saved");
        for act in &after {
            take(&mut plant, act);
            take(&mut other, act);
        }
        plant.advance_to(plant.now() + 3_000);
        other.advance_to(other.now() + 3_000);
        let journals = [&plant, &other].map(|plant| {
            let journal = plant.journal();
            let findings: Vec<_> = journal.findings().iter().cloned().collect();
            (journal.written(), journal.hash(), records_from(plant, position), journal.pending(), findings)
        });
        prop_assert_eq!(&journals[0], &journals[1]);
        prop_assert!(plant.snapshot() == other.snapshot(), "all registers and all firmware");
        // The plant goes back to the snapshot, and keeps the records up to that moment.
        let records = records_from(&plant, 0).into_iter().filter(|record| record.seq < position).collect::<Vec<_>>();
        prop_assert_eq!(plant.go_back(&snapshot), Ok(()));
        prop_assert_eq!(records_from(&plant, 0), records);
        prop_assert!(plant.snapshot() == snapshot);
        for act in &after {
            take(&mut plant, act);
        }
        plant.advance_to(plant.now() + 3_000);
        prop_assert_eq!(plant.journal().hash(), journals[0].1);
        prop_assert!(plant.snapshot() == other.snapshot());
    }
}

/// The firmware reports meaningless initialization data only once, even if a snapshot is restored between two checks.
#[test]
fn refused_initialization_data_are_reported_once_across_a_snapshot() {
    for text in [OMEGA, BM4] {
        let mut plant = plant_of(text);
        for command in [0, 1, 2] {
            take(&mut plant, &Act::Command(command));
            plant.advance_to(plant.now() + 2_000);
        }
        let refusals =
            plant.journal().records().filter(|record| record.event.get::<InitRefused>().is_some()).count();
        assert!(refusals > 0, "nothing is refused");
        let mut other = plant_of(text);
        other.restore(&plant.snapshot()).unwrap();
        for plant in [&mut plant, &mut other] {
            take(plant, &Act::Store { device: 0, register: 3, value: 0, through_channel: true });
            plant.advance_to(plant.now() + 5_000);
        }
        assert_eq!(plant.journal().hash(), other.journal().hash());
    }
}

#[test]
fn every_device_of_the_registry_is_in_one_of_these_plants() {
    let plants: Vec<Plant> = PLANTS.iter().map(|text| plant_of(text)).collect();
    let devices = plants.iter().flat_map(|plant| plant.devices());
    let tried: BTreeSet<_> = devices.map(|device| device.layout().name).collect();
    let missing: Vec<_> =
        all().iter().map(|device| device.layout.name).filter(|name| !tried.contains(name)).collect();
    assert!(
        missing.is_empty(),
        "add a plant with {missing:?} to PLANTS of tests/device/snapshots/acts.rs, as docs/internals/architecture.md, \
         section \"A device\", says"
    );
}

#[test]
fn another_plant_is_refused_by_name_and_the_plant_continues_unchanged() {
    let mut plant = plant_of(OMEGA);
    plant.advance_to(5_000);
    let before = plant.snapshot();
    let error = plant.restore(&plant_of(BM4).snapshot()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "it is of another plant: it has PLCs a and buses drives (cansync), upper (cansync), lower (cansync), here \
         there are PLCs a, b and buses drives (cansync), lower (cansync)"
    );
    let other =
        plant_of(&OMEGA.replace("name = 'd1'", "name = 'd0'\nslave_number = 2\n[[bus.drive]]\nname = 'd1'"));
    let error = plant.restore(&other.snapshot()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "its plant file has another setting of bus 'drives' or its participants; start its plant by `commram run --from`"
    );
    assert!(plant.snapshot() == before);
    plant.advance_to(10_000);
}

#[test]
fn a_snapshot_is_small() {
    let mut plant = Plant::new(&PlantConfig::built_in().unwrap(), |_, device| {
        Ok::<_, Box<dyn std::error::Error>>(commram::memory::Segment::of(device))
    })
    .unwrap();
    plant.advance_to(1_000_000);
    assert!(plant.snapshot().size() < 64 * 1024, "{}", plant.snapshot().size());
}

#[test]
fn bells_and_counters_of_events_never_go_back() {
    let mut plant = plant_of(OMEGA);
    let snapshot = plant.snapshot();
    let header = plant.devices()[0].header();
    header.doorbell.ring();
    header.events[3].fire(7);
    header.sync_counter[1].increment();
    let count = |plant: &Plant| {
        let header = plant.devices()[0].header();
        (header.doorbell.rings(), header.events[3].bell.rings(), header.sync_counter[1].load())
    };
    let counted = count(&plant);
    plant.advance_to(1_000);
    plant.go_back(&snapshot).unwrap();
    assert_eq!((count(&plant), plant.now()), (counted, 0));
    assert_eq!(plant.devices()[0].header().virtual_time_us.load(), 0);
}

/// Advances the clock from event to event; a client that requests each processor cycle gets each.
fn pass_each(plant: &mut Plant, us: u64) {
    let end = plant.now() + us;
    while plant.next_event() <= end {
        plant.advance_to(plant.next_event());
    }
    plant.advance_to(end);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn skipped_polls_change_nothing(
        which in 0..PLANTS.len(),
        comes_up in prop::bool::weighted(0.3),
        acts in prop::collection::vec(act(), 1..40),
    ) {
        let mut plants = [plant_of(PLANTS[which]), plant_of(PLANTS[which])];
        for plant in &mut plants {
            if comes_up {
                bring_up(plant);
            }
        }
        let [swift, thorough] = &mut plants;
        for act in &acts {
            if let Act::Pass(us) = act {
                // The steps are so long that counts of repeated events end and become records.
                let us = us * 40;
                swift.advance_to(swift.now() + us);
                pass_each(thorough, us);
            } else {
                take(swift, act);
                take(thorough, act);
            }
            prop_assert!(swift.snapshot() == thorough.snapshot(), "{act:?}");
        }
        prop_assert_eq!(swift.journal().hash(), thorough.journal().hash());
        prop_assert_eq!(records_from(swift, 0), records_from(thorough, 0));
        prop_assert_eq!(swift.journal().pending(), thorough.journal().pending());
    }
}

#[test]
fn an_unstarted_plant_is_quiescent() {
    for text in [OMEGA.split("[[fault]]").next().unwrap(), BM4] {
        let text = text.replace("option_sync_us = 1000", "");
        let mut plant = plant_of(&text);
        plant.advance_to(1_000);
        assert_eq!(plant.next_change(), u64::MAX);
        plant.store(DeviceIndex(0), nodes(&plant)[0].1, Width::Word, 1).unwrap();
        assert_eq!(plant.next_change(), plant.next_event(), "there is something to look at");
        plant.advance_to(plant.next_event());
    }
}
