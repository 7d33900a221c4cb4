//! Exchanges with scripted simulators.

use super::*;
use crate::fmi::{Resources, Unit};
use crate::identity::BusIndex;
use crate::plant::PlantConfig;
use crate::request::testing::TestHost;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

/// Scripted input, and a record of the output.
#[derive(Clone, Default)]
struct ScriptedSimulators(Arc<Mutex<(VecDeque<SimulatorOutput>, Vec<PlantOutput>)>>);

impl Simulators for ScriptedSimulators {
    fn give(&mut self, given: PlantOutput) {
        self.0.lock().unwrap().1.push(given);
    }

    fn take(&mut self) -> Result<Option<SimulatorOutput>, String> {
        Ok(self.0.lock().unwrap().0.pop_front())
    }

    fn leave(&mut self) {}
}

/// Returns a host with the built-in plant, or with the plant of a plant file.
fn host_of(toml: &str) -> TestHost {
    let config = match toml {
        "" => PlantConfig::built_in().unwrap(),
        toml => PlantConfig::parse("plant", toml).unwrap(),
    };
    TestHost::of(&config, true)
}

fn coupling(plant: &Plant, file: &str) -> Result<Coupling, String> {
    let config = CouplingConfig::parse("exchange.toml", file).map_err(|error| error.to_string())?;
    Coupling::new(&config, plant, Duration::from_secs(9)).map_err(|error| error.to_string())
}

const EXCHANGE: &str = "\
period = '1ms'
[[publish]]
value = 'node2.w_OPTION_STATUS'
[[publish]]
value = 'drive1.speed_actual'
key = 'speed'
[[subscribe]]
value = 'node2.w_CPU_CONTROL'
key = 'control'
[[subscribe]]
value = 'drive1.speed_modelled'
[[subscribe]]
value = 'node2.b_BT_1'
";

fn taken(values: &[(usize, f64)]) -> SimulatorOutput {
    SimulatorOutput { values: values.to_vec(), ..SimulatorOutput::default() }
}

#[test]
fn inputs_are_stored_and_changes_are_published() {
    let mut host = host_of("");
    let mut coupling = coupling(&host.plant, EXCHANGE).unwrap();
    assert_eq!(coupling.interface().publications[0].key, "plant/node2.w_OPTION_STATUS");
    assert_eq!(coupling.interface().subscriptions[1].key, "plant/drive1.speed_modelled");
    let first = coupling.first(&host.plant);
    assert_eq!(first.values, [(0, Value::Integer(1)), (1, Value::Float(0.0))]);
    let letters = ScriptedSimulators::default();
    coupling.connect(Box::new(letters.clone()));
    assert!(coupling.is_due(0));
    assert_eq!(coupling.take(&mut host).unwrap(), Progress::Waits);
    let give = |values: &[(usize, f64)]| letters.0.lock().unwrap().0.push_back(taken(values));
    give(&[(0, 1.2), (1, 10.0), (2, 28.0)]);
    let Progress::Exchanged(turned) = coupling.take(&mut host).unwrap() else { panic!() };
    assert_eq!(turned.len(), 1);
    coupling.give(&host.plant);
    assert!(!coupling.is_due(999) && coupling.is_due(1000));
    host.plant.advance_to(1000);
    // An exchange that delivers unchanged values stores nothing, and values out of range are refused.
    let before = host.plant.journal().hash();
    give(&[(2, 28.0), (0, 65_536.0), (0, f64::NAN), (1, f64::INFINITY)]);
    assert_eq!(coupling.take(&mut host).unwrap(), Progress::Exchanged(Vec::new()));
    assert_eq!(host.plant.journal().hash(), before);
    assert_eq!(coupling.refused_values.iter().map(|it| it.0).collect::<Vec<_>>(), [2, 1, 0]);
    coupling.give(&host.plant);
    assert_eq!(coupling.take(&mut host).unwrap(), Progress::Nothing);
    let given = letters.0.lock().unwrap().1.clone();
    assert_eq!(given.len(), 2);
    assert_eq!(given[0], PlantOutput { next_us: 1000, ..PlantOutput::default() });
    assert!(given[1].values.contains(&(0, Value::Integer(2))) && given[1].next_us == 2000, "{given:?}");
    letters.0.lock().unwrap().0.push_back(SimulatorOutput { have_gone: true, ..SimulatorOutput::default() });
    host.plant.advance_to(2000);
    assert_eq!(coupling.take(&mut host).unwrap(), Progress::HaveGone);
}

#[test]
fn frames_go_both_ways() {
    let mut host = host_of("[[plc]]\nname = 'line'\n[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n");
    // Another participant must acknowledge the frames.
    host.plant.guest_joins(BusIndex(0), 1, true);
    let file = "period = '1ms'\n[[bus]]\nname = 'open'\nto = ['sensor/can']\n";
    let mut coupling = coupling(&host.plant, file).unwrap();
    let letters = ScriptedSimulators::default();
    coupling.connect(Box::new(letters.clone()));
    let output = |frames: &[&str]| {
        let frames = frames.iter().map(|text| (0, text.as_bytes().to_vec())).collect();
        letters.0.lock().unwrap().0.push_back(SimulatorOutput { frames, ..SimulatorOutput::default() });
    };
    output(&["123#1122", "(0000000000.000000) other 00000007#R3", "nonsense", "", "123#11 22"]);
    assert!(matches!(coupling.take(&mut host), Ok(Progress::Exchanged(_))));
    assert_eq!(coupling.refused_frames[0].0, 3);
    coupling.give(&host.plant);
    host.plant.advance_to(1000);
    output(&[]);
    assert!(matches!(coupling.take(&mut host), Ok(Progress::Exchanged(_))));
    coupling.give(&host.plant);
    host.plant.advance_to(2000);
    output(&[]);
    assert!(matches!(coupling.take(&mut host), Ok(Progress::Exchanged(_))));
    coupling.give(&host.plant);
    let given = letters.0.lock().unwrap().1.clone();
    let frames: Vec<_> =
        given.iter().flat_map(|given| &given.frames).map(|(_, line)| line.as_str()).collect();
    let words: Vec<_> = frames.iter().map(|line| line.split_once(") ").unwrap().1).collect();
    assert_eq!(words.len(), 2, "{frames:?}");
    assert!(words.contains(&"open 123#1122") && words.contains(&"open 00000007#R3"), "{frames:?}");
}

#[test]
fn invalid_files_are_refused() {
    let plant = host_of("").plant;
    let refusal = |file: &str| coupling(&plant, file).err().unwrap_or_else(|| panic!("taken: {file}"));
    let section = |section: &str| refusal(&format!("period = '1ms'\n{section}"));
    for (file, why) in [
        ("", "period"),
        ("period = '1ms'", "nothing is exchanged"),
        ("period = '0us'\n[[bus]]\nname = 'drives'", "is not 1us to 24h"),
        ("period = '5'\n[[bus]]\nname = 'drives'", "5ms"),
        ("period = '1ms'\nperiods = 3", "line 2"),
        ("period = '1ms'\nname = ''\n[[bus]]\nname = 'drives'", "not a name for HELICS"),
    ] {
        assert!(refusal(file).contains(why), "{file}: {}", refusal(file));
    }
    for (text, why) in [
        ("[[bus]]\nname = 'nobus'", "the buses are: drives"),
        ("[[bus]]\nname = 'drives'", "frames are exchanged with buses of the kind can: none"),
        ("[[publish]]\nvalue = 'node2.w_CPU_CONTROLL'", "w_CPU_CONTROL"),
        ("[[publish]]\nvalue = 'other:node2.w_CPU_CONTROL'", "its PLCs are: line"),
        ("[[publish]]\nvalue = 'drive1.speed'", "speed_demand"),
        ("[[publish]]\nvalue = 'node2.w_*'\nkey = 'one'", "one key"),
        (
            "[[publish]]\nvalue = 'node2.w_CPU_CONTROL'\n[[publish]]\nvalue = 'node2.w_*'",
            "publishes this twice",
        ),
        ("[[subscribe]]\nvalue = 'node2.w_*'", "names several"),
        ("[[subscribe]]\nvalue = 'node2.w_OPTION_STATUS'", "cannot subscribe to it"),
        ("[[subscribe]]\nvalue = 'drive1.speed_demand'", "cannot subscribe to it"),
    ] {
        assert!(section(text).contains(why), "{text}: {}", section(text));
    }
}

#[test]
fn only_can_buses_exchange_frames() {
    let buses = [("one", "can", 125), ("two", "can", 125), ("dp", "profibus", 1500)];
    let of = |(name, kind, rate)| format!("[[bus]]\nname = '{name}'\nkind = '{kind}'\nkbit_s = {rate}\n");
    let plant = host_of(&format!("[[plc]]\nname = 'line'\n{}", buses.map(of).concat())).plant;
    let refusal = |buses: &str| coupling(&plant, &format!("period = '1ms'\n{buses}")).err();
    assert_eq!(refusal("[[bus]]\nname = 'one'\n[[bus]]\nname = 'two'"), None);
    let profibus = refusal("[[bus]]\nname = 'dp'").unwrap();
    assert!(profibus.contains("'dp': it is a bus of the kind profibus"), "{profibus}");
    assert!(profibus.ends_with("of the kind can: one, two"), "{profibus}");
    let twice = refusal("[[bus]]\nname = 'one'\n[[bus]]\nname = 'one'").unwrap();
    assert!(twice.contains("twice"), "{twice}");
}

/// A model has the same effect on the plant whether it is connected as a unit of FMI or over a coupling.
#[test]
fn a_model_behaves_as_at_a_unit() {
    let mut host = host_of("");
    let mut coupling = coupling(&host.plant, EXCHANGE).unwrap();
    let letters = ScriptedSimulators::default();
    coupling.connect(Box::new(letters.clone()));
    let mut unit = Unit::new(&Resources::built_in(Vec::new()).unwrap()).unwrap();
    let at = |name: &str| unit.variables().iter().position(|it| it.name == name).unwrap() as u32;
    let [control, modelled, speed] =
        ["node2.w_CPU_CONTROL", "drive1.is_modelled", "drive1.speed_modelled"].map(at);
    unit.set(modelled, crate::fmi::VariableType::Bool, Value::Boolean(true)).unwrap();
    for step in 0..50_u32 {
        let (word, turns) = (u32::from(step > 3), f64::from(step) * 1.7);
        letters.0.lock().unwrap().0.push_back(taken(&[(0, f64::from(word)), (1, turns)]));
        let Progress::Exchanged(turned) = coupling.take(&mut host).unwrap() else { panic!() };
        turned.iter().for_each(|(drive, speed)| assert!(host.plant.turn_shaft(*drive, *speed)));
        coupling.give(&host.plant);
        host.plant.advance_to(u64::from(step + 1) * 1000);
        unit.set(control, crate::fmi::VariableType::U16, Value::Integer(word.into())).unwrap();
        unit.set(speed, crate::fmi::VariableType::F64, Value::Float(turns)).unwrap();
        unit.step(unit.time_s(), 0.001).unwrap();
        assert_eq!(
            host.plant.shaft(0).map(|it| (it.speed, it.angle)),
            unit.plant().shaft(0).map(|it| (it.speed, it.angle))
        );
    }
    assert_eq!(host.plant.journal().hash(), unit.plant().journal().hash());
}
