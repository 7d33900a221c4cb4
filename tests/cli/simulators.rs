//! Python models that take part in a plant through HELICS.

use crate::common::{Emulator, commram, finish, unique_name};
use crate::federates::{Broker, Helics, at, helics, journal, mortal, passes, written};
use commram::fmi::{Resources, Unit, Value, VariableType};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use tempfile::TempDir;

/// A model process. It is killed when this value is dropped, or when the test is killed.
struct Model(Child);

impl Model {
    fn start(helics: &Helics, script: &Path, broker: &Broker, more: &[&str]) -> Self {
        let mut command = mortal(&helics.python);
        command.arg(script).arg(&broker.address).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        Model(command.spawn().unwrap())
    }

    /// Waits for a successful end and returns its output.
    fn end(mut self) -> String {
        let mut printed = String::new();
        self.0.stdout.take().unwrap().read_to_string(&mut printed).unwrap();
        assert!(self.0.wait().unwrap().success(), "{printed}");
        printed
    }
}

impl Drop for Model {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Returns the code blocks in one language of the page about simulators.
fn blocks(language: &str) -> Vec<String> {
    let page = include_str!("../../docs/guide/helics.md");
    let begin = format!("```{language}\n");
    page.split(&begin).skip(1).filter_map(|rest| Some(rest.split_once("```")?.0.to_owned())).collect()
}

/// Brings the first drive of the built-in plant to a state that accepts values, and saves a snapshot.
fn snapshot(directory: &TempDir) -> PathBuf {
    let program = "\
        poke(\"node2.w_CPU_CONTROL\", 1);
        step(\"1ms\");
        for it in [[\"b_BT_1\", 0x1C], [\"b_TIME_PATTERN\", 2], [\"b_AC\", 0xFF], [\"b_AM\", 0xFF], [\"b_OUTPUT_CONTROL\", 0xFA],
                   [\"b_CLOCK_DIVIDER\", 7], [\"a_SL_TYP[1]\", 1], [\"w_CPU_CONTROL\", 2]] {
            poke(\"node2.\" + it[0], it[1]);
        }
        step(\"2ms\");
        for it in [[\"_CFG_WRC_WORD.b_CFG_WRC1_WORD0\", 1], [\"_CFG_WRC_WORD.b_CFG_WRC1_WORD1\", 3],
                   [\"a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD0\", 1], [\"a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD1\", 3],
                   [\"b_CTRLREG_RD_ORDER_RDC1\", 1], [\"w_CPU_CONTROL\", 0x20]] {
            poke(\"node2.\" + it[0], it[1]);
        }
        step(2_000_000 - now());
        poke(\"node2.w_CPU_CONTROL\", 0x40);
        step(\"10ms\");
        expect(\"node2.w_OPTION_STATUS\", 0x0080);
    ";
    let emulator = Emulator::stepped();
    passes(at(&emulator, &written(directory, "begin.rhai", program)));
    let path = directory.path().join("begin.snap");
    emulator.run("snapshot", &[path.to_str().unwrap()]).ok();
    path
}

/// Duration of the closed loop in milliseconds.
const STEPS: u32 = 60;
/// Speed reference: 100 rad/s.
const SPEED: i64 = 68_356_554;

/// Runs the loop in this process with the page's Python model. Returns the values that the master reads after each
/// millisecond.
fn expected(snapshot: &Path) -> Vec<i64> {
    let mut unit = Unit::new(&Resources::of_file(snapshot, Vec::new()).unwrap()).unwrap();
    let of = |name: &str| unit.variables().iter().position(|it| it.name == name).unwrap() as u32;
    let [given, demand, is_fed, modelled, turned, control, read] = [
        "node2.a_WR_VALUE[0]",
        "drive1.speed_demand",
        "drive1.is_fed",
        "drive1.is_modelled",
        "drive1.speed_modelled",
        "node2.b_CTRLREG_WRC1",
        "node2.a_RD_BMARRAY[1][0]",
    ]
    .map(of);
    let kind = |reference: u32| unit.variables()[reference as usize].kind;
    let (given_kind, read_kind) = (kind(given), kind(read));
    unit.set(modelled, VariableType::Bool, Value::Boolean(true)).unwrap();
    let demanded = |unit: &Unit| {
        let Ok(Value::Float(demand)) = unit.get(demand, VariableType::F64) else { panic!() };
        if unit.get(is_fed, VariableType::Bool) == Ok(Value::Boolean(true)) { 0.98 * demand } else { 0.0 }
    };
    let (mut speed, mut seen) = (0.0, Vec::new());
    let mut wanted = demanded(&unit);
    for step in 0..STEPS {
        speed += 0.001 / 0.02 * (wanted - speed);
        unit.set(turned, VariableType::F64, Value::Float(speed)).unwrap();
        wanted = demanded(&unit);
        if step == 0 {
            unit.set(given, given_kind, Value::Integer(SPEED)).unwrap();
        }
        if step % 2 == 0 {
            unit.set(control, VariableType::U8, Value::Integer(5)).unwrap();
        }
        unit.step(unit.time_s(), 0.001).unwrap();
        let Ok(Value::Integer(value)) = unit.get(read, read_kind) else { panic!() };
        seen.push(value);
    }
    seen
}

#[test]
fn a_motor_in_python_closes_the_loop_of_a_drive() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let begin = snapshot(&directory);
    let expected = expected(&begin);
    assert!(expected.is_sorted() && expected.last() > Some(&(SPEED * 8 / 10)), "{expected:?}");
    // Takes the exchange file from the page.
    let exchange = written(&directory, "motor.toml", &blocks("toml")[0]);
    let model = written(&directory, "motor.py", &blocks("python")[0]);
    let mut program = format!("poke(\"node2.a_WR_VALUE[0]\", {SPEED});\n");
    for (step, value) in (0..STEPS).zip(&expected) {
        let order = if step % 2 == 0 { "poke(\"node2.b_CTRLREG_WRC1\", 5); " } else { "" };
        program += &format!("{order}step(\"1ms\"); expect(\"node2.a_RD_BMARRAY[1][0]\", {value});\n");
    }
    let program = written(&directory, "loop.rhai", &program);
    let (from, exchange) = (begin.to_str().unwrap(), exchange.to_str().unwrap());
    let mut journals = Vec::new();
    for count in [1, 2] {
        // The broker expects the exchange and the model in addition to the federates of the plant.
        let broker = Broker::start(&helics, if count == 1 { 2 } else { 4 });
        let motor = Model::start(&helics, &model, &broker, &[]);
        let first = broker
            .emulator(&["--from", from], &["--federate", &format!("0/{count}"), "--exchange", exchange]);
        let second =
            (count == 2).then(|| broker.emulator(&["--from", from], &["--federate", "1/2", "--follow"]));
        passes(at(&first, &program));
        journals.push(journal(&first));
        journals.extend(second.as_ref().map(journal));
        first.run("stop", &[]).ok();
        motor.end();
    }
    assert!(journals.len() == 3 && journals.iter().all(|it| *it == journals[0]));
}

const CAN: &str = "\
[[plc]]
name = 'line'
[[device]]
kind = 'cs0015'
name = 'panel'
bus = 'open'
node_id = 32
kbit_s = 125
boot_up = '700'
[[bus]]
name = 'open'
kind = 'can'
kbit_s = 125
";

#[test]
fn a_sensor_in_python_is_on_a_can_bus() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let plant = written(&directory, "plant.toml", CAN);
    let exchange = "period = '1ms'\n[[bus]]\nname = 'open'\nto = ['sensor/can']\n";
    let exchange = written(&directory, "can.toml", exchange);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/can_federate.py");
    let mut seen = Vec::new();
    for _ in 0..2 {
        let broker = Broker::start(&helics, 2);
        let sensor = Model::start(&helics, &script, &broker, &["50"]);
        let more = ["--exchange", exchange.to_str().unwrap(), "--follow"];
        let mut emulator = broker.emulator(&[plant.to_str().unwrap()], &more);
        let printed = sensor.end();
        assert!(printed.contains("open 720#00") && printed.contains("said 50 heard 1"), "{printed}");
        // The process ends because all other federates have ended.
        assert_eq!(emulator.wait().code(), Some(0));
        let complaints = emulator.complaints();
        assert!(complaints.contains("the other simulators have ended"), "{complaints}");
        seen.push(printed);
    }
    assert_eq!(seen[0], seen[1]);
}

/// A model that publishes at each exchange, or at a single one.
#[test]
fn the_plant_ends_after_its_last_model() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let exchange = written(&directory, "motor.toml", &blocks("toml")[0]);
    for steps in [20, 1] {
        let condition = "while h.helicsInputGetBoolean(runs):";
        let text = blocks("python")[0].replace(condition, &format!("while now < {steps} * STEP:"));
        let text = text.replace("    speed += ", "    speed += 1 + ");
        assert!(!text.contains(condition));
        let broker = Broker::start(&helics, 2);
        let model = Model::start(&helics, &written(&directory, "ends.py", &text), &broker, &[]);
        let mut emulator = broker.emulator(&[], &["--exchange", exchange.to_str().unwrap()]);
        // The emulator may end before it answers this command, so the outcome is not checked.
        drop(emulator.run("step", &["100ms"]));
        model.end();
        assert_eq!(emulator.wait().code(), Some(0));
        let complaints = emulator.complaints();
        assert!(complaints.contains("the other simulators have ended"), "{complaints}");
    }
}

#[test]
fn missing_or_wrong_simulators_are_reported() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let toml = blocks("toml").remove(0);
    let text = blocks("python").remove(0);
    let exchange = written(&directory, "motor.toml", &toml);
    let wrong = |from: &str, to: &str| written(&directory, "wrong.toml", &toml.replace(from, to));
    let nobody = Broker::start(&helics, 2);
    let unknown = wrong("drive1.speed_modelled", "drive1.speed_model");
    let outcome =
        finish(&mut nobody.command(&[], &["--exchange", unknown.to_str().unwrap(), "-i", &unique_name()]));
    assert!(outcome.fails(2).contains("it has: speed_reference"), "{}", outcome.err);
    let motor = written(&directory, "motor.py", &text);
    let broker = Broker::start(&helics, 2);
    let _model = Model::start(&helics, &motor, &broker, &[]);
    let unpublished = wrong("motor/speed", "motor/sped");
    let mut emulator = broker.emulator(&[], &["--exchange", unpublished.to_str().unwrap()]);
    assert_eq!(emulator.wait().code(), Some(3));
    let complaints = emulator.complaints();
    assert!(complaints.contains("drive1.speed_modelled from motor/sped is required"), "{complaints}");
    // The emulator detects a killed model.
    let model = text.replace("    speed += ", "    if now > 0.004: import os; os._exit(0)\n    speed += ");
    let broker = Broker::start(&helics, 2);
    let model = Model::start(&helics, &written(&directory, "dies.py", &model), &broker, &[]);
    let more = ["--exchange", exchange.to_str().unwrap(), "--follow", "--limit", "3s"];
    let mut emulator = broker.emulator(&[], &more);
    model.end();
    assert_eq!(emulator.wait().code(), Some(3));
    let complaints = emulator.complaints();
    assert!(complaints.contains("the other simulators have not reached 5 ms in 3 s"), "{complaints}");
    let outcome =
        finish(commram().args(["run", "--clock", "stepped", "--federate", "1/2", "--exchange", "x.toml"]));
    assert!(outcome.fails(2).contains("federate 0"), "{}", outcome.err);
}
