//! The shared object: its functions against the standard's headers, and loaded by FMPy.

#[path = "../../../tests/common/tools.rs"]
#[allow(dead_code, reason = "this asks for Python only")]
mod tools;

use commram::fmi::{Resources, archive};
use commram::identity::DeviceIndex;
use commram::layout::Width;
use commram::memory::Segment;
use commram::plant::{Plant, PlantConfig};
use std::path::{Path, PathBuf};
use std::process::Command;
use tools::python;

/// Returns the output of a command, which must succeed.
fn output_of(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}\n{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// Returns the shared object of this build.
fn library() -> Vec<u8> {
    let test = std::env::current_exe().unwrap();
    let places = [test.parent().unwrap().to_owned(), test.parent().unwrap().parent().unwrap().to_owned()];
    let found = places.iter().map(|place| place.join("libcommram_fmi.so")).find(|path| path.exists());
    std::fs::read(found.expect("cargo builds it before the tests")).unwrap()
}

/// Returns the C name of a type.
fn in_c(ty: &str) -> String {
    if let Some(inner) = ty.strip_prefix("*const ") {
        return format!("{} const*", in_c(inner));
    }
    if let Some(inner) = ty.strip_prefix("*mut ") {
        return format!("{}*", in_c(inner));
    }
    let name = match ty {
        "c_char" => "char",
        "c_void" | "()" => "void",
        "bool" => "bool",
        "usize" => "size_t",
        "f32" => "float",
        "f64" => "double",
        "u8" => "uint8_t",
        "u16" => "uint16_t",
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "i8" => "int8_t",
        "i16" => "int16_t",
        "i32" => "int32_t",
        "i64" => "int64_t",
        "Instance" => "fmi3Instance",
        "Status" => "fmi3Status",
        "DependencyKind" => "fmi3DependencyKind",
        "IntervalQualifier" => "fmi3IntervalQualifier",
        "LogMessage" => "fmi3LogMessageCallback",
        "IntermediateUpdate" => "fmi3IntermediateUpdateCallback",
        "ClockUpdate" => "fmi3ClockUpdateCallback",
        "LockPreemption" => "fmi3LockPreemptionCallback",
        other => panic!("{other}"),
    };
    name.to_owned()
}

/// Each function of the standard's headers exists, and its declaration is the one in this crate.
#[test]
fn the_functions_are_those_of_the_headers() {
    let Some(mut command) = python(&["fmpy"]) else { return };
    let script = "import fmpy, os; print(os.path.join(os.path.dirname(fmpy.__file__), 'c-code'))";
    let headers = PathBuf::from(output_of(command.args(["-c", script])).trim());
    let declared = std::fs::read_to_string(headers.join("fmi3Functions.h")).unwrap();
    let signatures = commram_fmi::signatures();
    let mut source = String::from(
        "#include <stdbool.h>\n#include <stddef.h>\n#include <stdint.h>\n#include \"fmi3Functions.h\"\n",
    );
    for (name, arguments, returned) in &signatures {
        let arguments = match arguments {
            [] => "void".to_owned(),
            some => some.iter().map(|ty| in_c(ty)).collect::<Vec<_>>().join(", "),
        };
        source.push_str(&format!("{} {name}({arguments});\n", in_c(returned)));
    }
    let exports =
        declared.lines().filter_map(|line| line.strip_prefix("FMI3_Export ")?.split_whitespace().nth(1));
    let mut exports: Vec<_> = exports.map(|name| name.trim_end_matches(';')).collect();
    let mut ours: Vec<_> = signatures.iter().map(|(name, ..)| *name).collect();
    exports.sort_unstable();
    ours.sort_unstable();
    assert_eq!(ours, exports);
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("functions.c");
    std::fs::write(&file, source).unwrap();
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-Wall", "-Werror", "-fsyntax-only", "-I"]).arg(headers).arg(file);
    output_of(&mut cc);
}

/// Returns the actions of a PLC that bring a drive to an actual value. Each has a time, a register and a value. An
/// action without a value reads the register.
fn writes() -> String {
    let mut writes = String::new();
    let mut at = |us: u64, name: &str, value: Option<u32>| {
        let value = value.map_or(String::new(), |value| format!(" {value}"));
        writes.push_str(&format!("{us} {name}{value}\n"));
    };
    at(0, "node2.w_CPU_CONTROL", Some(1));
    at(1000, "node2.w_OPTION_STATUS", None);
    let init = [
        ("b_BT_1", 0x1C),
        ("b_TIME_PATTERN", 2),
        ("b_AC", 0xFF),
        ("b_AM", 0xFF),
        ("b_OUTPUT_CONTROL", 0xFA),
        ("b_CLOCK_DIVIDER", 7),
        ("a_SL_TYP[1]", 1),
        ("w_CPU_CONTROL", 2),
    ];
    init.iter().for_each(|(name, value)| at(1000, &format!("node2.{name}"), Some(*value)));
    at(3000, "node2.w_OPTION_STATUS", None);
    let cyclic = [
        ("_CFG_WRC_WORD.b_CFG_WRC1_WORD0", 1),
        ("_CFG_WRC_WORD.b_CFG_WRC1_WORD1", 3),
        ("a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD0", 1),
        ("a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD1", 3),
        ("b_CTRLREG_RD_ORDER_RDC1", 1),
        ("w_CPU_CONTROL", 0x20),
    ];
    cyclic.iter().for_each(|(name, value)| at(3000, &format!("node2.{name}"), Some(*value)));
    at(2_000_000, "node2.a_STAT_SL[1]", None);
    at(2_000_000, "node2.w_CPU_CONTROL", Some(0x40));
    at(2_010_000, "node2.w_OPTION_STATUS", None);
    at(2_010_000, "node2.a_WR_VALUE[0]", Some(0x1234));
    for cycle in 0..10_u64 {
        at(2_010_000 + 2000 * cycle, "node2.b_CTRLREG_WRC1", Some(5));
        at(2_011_500 + 2000 * cycle, "node2.b_CTRLREG_WRC1.out", None);
        at(2_011_500 + 2000 * cycle, "node2.a_RD_BMARRAY[1][0]", None);
    }
    writes
}

/// Returns the effect of these writes on a plant without FMI.
fn alone(writes: &str) -> Vec<String> {
    let config = PlantConfig::built_in().unwrap();
    let mut plant =
        Plant::new(&config, |_plc, device| Ok::<_, Box<dyn std::error::Error>>(Segment::of(device)));
    let plant = plant.as_mut().unwrap();
    let fitted = plant.names().devices[0];
    let mut seen = Vec::new();
    for line in writes.lines() {
        let mut words = line.split_whitespace();
        let (us, name) = (words.next().unwrap(), words.next().unwrap());
        plant.advance_to(us.parse().unwrap());
        let register = fitted.register(name.trim_end_matches(".out")).unwrap();
        let (offset, width) = (register.offset(), Width::of(register.ty()));
        match words.next() {
            Some(value) => plant.store(DeviceIndex(0), offset, width, value.parse().unwrap()).unwrap(),
            None => {
                let value = register.ty().number(plant.load(DeviceIndex(0), offset, width).unwrap());
                seen.push(format!("{us} {name} {value}"));
            }
        }
    }
    seen
}

#[test]
fn fmpy_runs_a_unit_with_the_values_of_the_plant_alone() {
    let Some(mut command) = python(&["fmpy", "lxml"]) else { return };
    let directory = tempfile::tempdir().unwrap();
    let (unit, list) = (directory.path().join("plant.fmu"), directory.path().join("writes"));
    let resources = Resources::built_in(Vec::new()).unwrap();
    std::fs::write(&unit, archive(&resources, "built-in", &library()).unwrap()).unwrap();
    let writes = writes();
    std::fs::write(&list, &writes).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/python/check_fmu.py");
    let lines = output_of(command.arg(script).arg(&unit).arg(&list));
    let lines: Vec<_> = lines.lines().collect();
    let expected = alone(&writes);
    assert!(expected.last().unwrap().ends_with(&0x1234.to_string()), "{expected:#?}");
    assert_eq!(lines[0], "problems []");
    assert_eq!(lines[1..=expected.len()], expected);
    assert_eq!(lines[1 + expected.len()..][..3], ["loop closed 98", "state True", "refused"]);
    assert!(lines.last().unwrap().starts_with("simulated "), "{lines:#?}");
}
