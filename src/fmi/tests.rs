//! Units without C.

use super::unit::FORMAT;
use super::*;
use crate::devices::samples::copy_folder;
use crate::format_samples::{sample, samples, with_header};
#[cfg(feature = "channel")]
use crate::plant::{Plant, PlantConfig};
use crate::snapshot_fields::{seal, unseal};
use core::f64::consts::TAU;
use proptest::prelude::*;

fn unit(registers: &[&str]) -> Unit {
    let registers = registers.iter().map(|it| (*it).to_owned()).collect();
    Unit::new(&Resources::built_in(registers).unwrap()).unwrap()
}

/// Returns the reference of a variable.
fn at(unit: &Unit, name: &str) -> u32 {
    unit.variables().iter().position(|it| it.name == name).unwrap_or_else(|| panic!("{name}")) as u32
}

fn names(registers: &[&str]) -> Vec<String> {
    unit(registers).variables().iter().map(|it| it.name.clone()).collect()
}

#[test]
fn a_folder_is_found_from_the_directory_of_the_plant_file_and_of_an_unpacked_unit() {
    let directory = tempfile::tempdir().unwrap();
    let place = directory.path();
    let (card, unpacked) = (place.join("digital-io"), place.join("unpacked"));
    copy_folder("digital-io", &card);
    std::fs::create_dir_all(&unpacked).unwrap();
    let plant = place.join("plant.toml");
    std::fs::write(&plant, "[[device]]\nkind = \"./digital-io\"\nname = \"io\"\n").unwrap();
    let resources = Resources::of_file(&plant, vec!["data.w_OUT".to_owned()]).unwrap();
    for (name, content) in resources.files() {
        std::fs::write(unpacked.join(name), content).unwrap();
    }
    let unit = Unit::new(&Resources::of_directory(&unpacked).unwrap()).unwrap();
    assert!(unit.variables().iter().any(|it| it.name == "data.w_OUT"));
}

#[test]
fn steps_end_at_the_next_microsecond_and_errors_do_not_add_up() {
    let mut unit = unit(&["node2.w_*"]);
    unit.begin(7.0, None).unwrap();
    let third = 0.001 / 3.0;
    let mut point = 7.0;
    for _ in 0..3000 {
        unit.step(point, third).unwrap();
        point += third;
    }
    assert_eq!(unit.plant().now(), 1_000_000);
    assert_eq!(unit.step(8.0, 4e-7), Ok(8.0));
    for (point, size) in [(8.1, 0.001), (7.9, 0.1), (f64::NAN, 0.1), (f64::INFINITY, 0.0)] {
        assert!(matches!(unit.step(point, size), Err(UnitError::OtherTime { .. })), "{point} {size}");
    }
    for size in [-0.001, f64::NAN, f64::INFINITY, 1e300] {
        assert!(matches!(unit.step(8.0, size), Err(UnitError::Step { .. })), "{size}");
    }
    assert_eq!(unit.plant().now(), 1_000_000);
}

#[test]
fn a_start_time_leaves_room_for_microseconds() {
    let mut unit = unit(&["node2.w_*"]);
    for start in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 1e14, -1e14, 9.000_001e9] {
        assert!(matches!(unit.begin(start, None), Err(UnitError::Start { .. })), "{start}");
    }
    for start in [-9e9, -5.0, 9e9, 8e9] {
        unit.begin(start, None).unwrap();
        assert_eq!(unit.time_s(), start);
    }
    let before = unit.plant().now();
    unit.step(8e9, 0.0001).unwrap();
    assert_eq!(unit.plant().now(), before + 100);
    assert!(matches!(unit.step(8e9 + 0.0001, 1.1e9), Err(UnitError::Step { .. })));
}

#[test]
fn no_step_ends_after_the_stop_time() {
    let mut unit = unit(&["node2.w_*"]);
    for stop in [0.5, f64::NAN, f64::NEG_INFINITY] {
        assert!(matches!(unit.begin(1.0, Some(stop)), Err(UnitError::Stop { .. })), "{stop}");
    }
    unit.begin(1.0, Some(1.005)).unwrap();
    let state = unit.state();
    assert_eq!(unit.step(1.0, 0.01), Err(UnitError::PastStop { end: 1.01, stop: 1.005 }));
    assert_eq!(unit.time_s(), 1.0);
    // Thirds of a millisecond add up to the stop time, except for rounding errors.
    let (third, mut point) = (0.001 / 3.0, 1.0);
    for _ in 0..15 {
        unit.step(point, third).unwrap();
        point += third;
    }
    assert_eq!(unit.plant().now(), 5000);
    assert!(matches!(unit.step(point, third), Err(UnitError::PastStop { .. })));
    // The stop time belongs to the initialization, not to a state.
    unit.restore(&state).unwrap();
    assert!(matches!(unit.step(1.0, 0.01), Err(UnitError::PastStop { .. })));
    unit.begin(1.0, Some(f64::INFINITY)).unwrap();
    unit.step(1.0, 0.01).unwrap();
}

#[test]
fn a_set_is_a_store_and_one_that_changes_nothing_of_the_plcs_own_is_none() {
    let mut unit = unit(&[]);
    let (own, both) = (at(&unit, "node2.b_BT_1"), at(&unit, "node2.b_CTRLREG_WRC1"));
    let mut stores = |reference, value| {
        let before = unit.plant().journal().hash();
        unit.set(reference, VariableType::U8, Value::Integer(value)).unwrap();
        assert_eq!(unit.get(reference, VariableType::U8), Ok(Value::Integer(value)));
        unit.plant().journal().hash() != before
    };
    assert!(stores(own, 0x1C) && !stores(own, 0x1C) && stores(own, 0x1D));
    assert!(stores(both, 5) && stores(both, 5));
    let out = at(&unit, "node2.b_CTRLREG_WRC1.out");
    assert_eq!(unit.get(out, VariableType::U8), Ok(Value::Integer(5)));
    assert!(matches!(unit.set(out, VariableType::U8, Value::Integer(0)), Err(UnitError::Output { .. })));
    assert!(matches!(unit.get(own, VariableType::U16), Err(UnitError::OtherKind { .. })));
    assert!(matches!(unit.get(u32::MAX, VariableType::U16), Err(UnitError::NoVariable { .. })));
}

#[test]
fn a_set_of_several_variables_sets_all_or_none() {
    let mut unit = unit(&[]);
    let own = at(&unit, "node2.b_BT_1");
    let set = |unit: &mut Unit, other, value| {
        let values = [(own, Value::Integer(0x1C)), (other, Value::Integer(value))];
        unit.set_all(VariableType::U8, values.into_iter())
    };
    let before = unit.plant().journal().hash();
    for other in [at(&unit, "node2.b_CTRLREG_WRC1.out"), at(&unit, "node2.w_CPU_CONTROL"), u32::MAX] {
        assert!(set(&mut unit, other, 5).is_err());
        assert_eq!(unit.get(own, VariableType::U8), Ok(Value::Integer(0)), "{other}");
    }
    assert_eq!(unit.plant().journal().hash(), before);
    let both = at(&unit, "node2.b_CTRLREG_WRC1");
    set(&mut unit, both, 5).unwrap();
    assert_eq!(
        [own, both].map(|it| unit.get(it, VariableType::U8)),
        [0x1C, 5].map(|it| Ok(Value::Integer(it)))
    );
}

#[test]
fn registers_are_chosen_by_name_and_pattern() {
    let of_drives = names(&["node2.w_CPU_CONTROL"]).len() - 3;
    let chosen = names(&["node2.a_WR_VALUE[0..1]", "line:node2.w_CPU_CONTROL"]);
    assert_eq!(chosen.len(), 5 + of_drives);
    for name in ["time", "node2.w_CPU_CONTROL", "node2.w_CPU_CONTROL.out", "node2.a_WR_VALUE[1]"] {
        let is_there = chosen.iter().any(|it| it == name);
        assert!(is_there || name.ends_with(".out"), "{name} in {chosen:?}");
    }
    assert_eq!(
        names(&["%MW3.200000", "line:%MD3.200052"]),
        names(&["node2.w_CPU_CONTROL", "node2.a_WR_VALUE[0]"])
    );
    for (wrong, why) in [
        ("node2.w_NOTHING", "w_NOTHING"),
        ("other:node2.w_CPU_CONTROL", "its PLCs are: line"),
        ("l*:node2.w_CPU_CONTROL", "without a PLC means the registers of all PLCs"),
        ("%MB3.200001", "use the address of one: node2.w_CPU_CONTROL at %MW3.200000"),
        ("%MX3.200000.1", "use the address of one: node2.w_CPU_CONTROL at %MW3.200000"),
        ("%MW3.9999999", "%MW3.9999999"),
    ] {
        let error = Unit::new(&Resources::built_in(vec![wrong.to_owned()]).unwrap()).err().unwrap();
        assert!(error.to_string().contains(why), "{error}");
    }
    assert_ne!(unit(&["node2.w_*"]).token(), unit(&[]).token());
    assert_eq!(unit(&[]).token(), unit(&[]).token());
}

#[test]
fn a_model_turns_the_motor_and_a_state_has_it() {
    let mut unit = unit(&["node2.w_*"]);
    let [actual, angle, modelled, speed] = ["speed_actual", "angle_actual", "is_modelled", "speed_modelled"]
        .map(|it| at(&unit, &format!("drive1.{it}")));
    unit.set(speed, VariableType::F64, Value::Float(TAU)).unwrap();
    let near = |unit: &Unit, reference, expected: f64| {
        let Ok(Value::Float(value)) = unit.get(reference, VariableType::F64) else { panic!("{reference}") };
        assert!((value - expected).abs() < 1e-3, "{value} {expected}");
    };
    unit.step(0.0, 0.01).unwrap();
    near(&unit, actual, 0.0);
    unit.set(modelled, VariableType::Bool, Value::Boolean(true)).unwrap();
    unit.step(0.01, 0.25).unwrap();
    near(&unit, actual, TAU);
    let state = unit.state();
    let bytes = unit.to_bytes(&state, 2);
    let Ok(Value::Float(here)) = unit.get(angle, VariableType::F64) else { panic!() };
    assert!((here - TAU / 4.0).abs() < 0.01, "{here}");
    unit.step(0.26, 0.25).unwrap();
    near(&unit, angle, here + TAU / 4.0);
    let (read, phase) = unit.of_bytes(&bytes).unwrap();
    assert_eq!(phase, 2);
    unit.restore(&read).unwrap();
    near(&unit, angle, here);
    unit.step(0.26, 0.25).unwrap();
    near(&unit, angle, here + TAU / 4.0);
    assert!(unit.set(speed, VariableType::F64, Value::Float(f64::NAN)).is_err());
    for length in [0, 1, 8, bytes.len() / 2, bytes.len() - 1] {
        assert!(unit.of_bytes(&bytes[..length]).is_err(), "{length}");
    }
    // Tests each bit of the data that precede the snapshot, and some bits of the snapshot.
    for at in (0..128).chain((128..bytes.len()).step_by(97)) {
        for bit in (0..8).filter(|bit| at < 128 || *bit == at % 8) {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1 << bit;
            let error = unit.of_bytes(&bytes).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains("its checksum is wrong"), "bit {bit} of byte {at} flipped: {error}");
        }
    }
}

/// A state consists of a snapshot and other data. If the other data change, the state needs a new format number. The
/// snapshot has its own format number.
#[test]
fn a_sample_of_the_state_format_can_be_read() {
    let bytes = sample(&format!("fmu-state-{FORMAT}"), || {
        let mut unit = unit(&["node2.w_*"]);
        let [modelled, speed] =
            ["is_modelled", "speed_modelled"].map(|it| at(&unit, &format!("drive1.{it}")));
        unit.begin(1.5, None).unwrap();
        unit.set(modelled, VariableType::Bool, Value::Boolean(true)).unwrap();
        unit.set(speed, VariableType::F64, Value::Float(2.25)).unwrap();
        unit.step(1.5, 0.02).unwrap();
        unit.to_bytes(&unit.state(), 2)
    });
    let bytes = with_header(&bytes, FORMAT, env!("CARGO_PKG_VERSION"));
    let mut unit = unit(&["node2.w_*"]);
    let read = match unit.of_bytes(&bytes) {
        Err(UnitError::State(text)) if text.contains("it was made by commram") => {
            panic!("{text}: a snapshot format with a new number needs a new state format with a sample")
        }
        read => read,
    };
    let (state, phase) = read.unwrap_or_else(|error| panic!("{error}; count FORMAT up"));
    unit.restore(&state).unwrap();
    assert_eq!((phase, unit.time_s()), (2, 1.52));
    let speed = at(&unit, "drive1.speed_modelled");
    assert_eq!(unit.get(speed, VariableType::F64), Ok(Value::Float(2.25)));
    assert_eq!(unit.to_bytes(&state, phase), bytes);
}

#[test]
fn states_of_other_formats_are_refused_by_number_and_version() {
    let unit = unit(&["node2.w_*"]);
    let today = unit.to_bytes(&unit.state(), 0);
    let ours = format!("this is commram {} (state format {FORMAT})", env!("CARGO_PKG_VERSION"));
    let refused = |bytes: &[u8], by: &str| {
        let error = unit.of_bytes(bytes).err().unwrap();
        assert!(matches!(error, UnitError::OtherVersion { .. }), "{error:?}");
        let error = error.to_string();
        assert!(error.starts_with(&format!("the state was saved by {by}, {ours}; use ")), "{error}");
    };
    for (format, version) in [(FORMAT + 1, "0.2.0"), (u16::MAX, "99.0.0"), (FORMAT, "0.0.9")] {
        refused(&with_header(&today, format, version), &format!("commram {version} (state format {format})"));
    }
    // In format 1, the first byte of a state was the phase. The rest had its own checksum.
    for phase in 0..=3 {
        let inner = seal(unseal(&today).unwrap()[20..].to_vec());
        refused(&seal([vec![phase], inner].concat()), "an older commram (state format 1)");
    }
    for (name, bytes) in samples("fmu-state-") {
        if name != format!("fmu-state-{FORMAT}") {
            assert!(matches!(unit.of_bytes(&bytes).err(), Some(UnitError::OtherVersion { .. })), "{name}");
        }
    }
    let something_else = unit.of_bytes(&seal(b"something else".to_vec())).err().unwrap().to_string();
    assert!(something_else.contains("it does not begin as a state does"), "{something_else}");
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_speed_can_be_modelled(speeds in prop::collection::vec(any::<f64>(), 1..6)) {
        let mut unit = unit(&["node2.w_*"]);
        let (modelled, speed) = (at(&unit, "drive1.is_modelled"), at(&unit, "drive1.speed_modelled"));
        unit.set(modelled, VariableType::Bool, Value::Boolean(true)).unwrap();
        for value in speeds {
            prop_assert_eq!(unit.set(speed, VariableType::F64, Value::Float(value)).is_ok(), value.is_finite());
            unit.step(unit.time_s(), 0.003).unwrap();
        }
    }
}

/// A finder returns the variables that a unit with the same name has.
#[cfg(feature = "channel")]
#[test]
fn a_finder_agrees_with_the_variables_of_a_unit() {
    let toml = "[[plc]]\nname = 'a'\nnode1 = 'x'\nnode2 = 'y'\n[[plc]]\nname = 'b'\n[[plc]]\nname = 'c'\nnode2 = 'z'\n\
                [[bus]]\nname = 'x'\n[[bus]]\nname = 'y'\n[[bus]]\nname = 'z'\n[[bus.drive]]\nname = 'd'\nslave_number = 1\n";
    let built_in = unit(&["node2.w_*"]);
    let several = PlantConfig::parse("plant", toml).unwrap();
    let several = Plant::new(&several, |_, device| {
        Ok::<_, Box<dyn std::error::Error>>(crate::memory::Segment::of(device))
    });
    let several = several.unwrap();
    for plant in [built_in.plant(), &several] {
        let all = variables::variables(plant, &[]).unwrap();
        let known = all.iter().filter(|it| matches!(it.quantity, Quantity::Register { .. }));
        let mut names: Vec<String> = known.map(|it| it.name.trim_end_matches(".out").to_owned()).collect();
        let arrays: Vec<String> =
            names.iter().filter_map(|it| it.split_once('[')).map(|(array, _)| array.to_owned()).collect();
        names.extend(arrays);
        names.sort();
        names.dedup();
        // The unit looks at all registers for each name.
        names = names.into_iter().step_by(97).collect();
        let more = [
            "*",
            "node2",
            "node1.*",
            "c:*STATUS*",
            "%MW3.200000",
            "w_CPU_CONTROL",
            "node2.a_RD_BMARRAY[3]",
            "node2.a_RD_BMARRAY[0..3][*]",
            "b:node1",
            "_CTRL_MA.w_CPU_CONTROL",
            "_CTRL_SL.w_CPU_CONTROL",
            "node9",
            "node2.none",
            "none:node2",
            "node2.a_RD_BMARRAY[99][0]",
            "%MB3.200001",
            "option1",
            "",
        ];
        names.extend(more.map(str::to_owned));
        let mut finder = VariableFinder::of(plant);
        for name in names {
            let wanted = variables::variables(plant, core::slice::from_ref(&name)).map(|all| {
                let registers = all.into_iter().filter(|it| matches!(it.quantity, Quantity::Register { .. }));
                let settable =
                    registers.filter(|it| !(it.causality == Causality::Output && it.name.ends_with(".out")));
                settable.map(|it| format!("{it:?}")).collect::<Vec<_>>()
            });
            let found = finder.find(&name);
            let found = found.map(|all| all.iter().map(|it| format!("{it:?}")).collect::<Vec<_>>());
            assert_eq!(found, wanted, "{name}");
        }
    }
    let mut finder = VariableFinder::of(&several);
    let speed = finder.find("d.speed_modelled").unwrap();
    assert_eq!((speed.len(), &*speed[0].name), (1, "d.speed_modelled"));
    let unknown = finder.find("d.none").unwrap_err();
    assert!(matches!(&unknown, VariablesError::UnknownOfDrive { drive, .. } if drive == "d"), "{unknown}");
}
