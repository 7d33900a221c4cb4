//! Blocks by the procedure 3964R with a program by other authors: rl3964R of the library rllib (pvbrowser). The partners are
//! `SERIAL_3964R` in Rust, in Structured Text compiled by matiec, and in a scenario. The program in Rust also drives a slave
//! by USS.
//!
//! `COMMRAM_RLLIB` names the directory `rllib/lib` of pvbrowser.

use crate::common::{Emulator, eventually, skipped, wait_for};
use crate::matiec::Plc;
use crate::serial_partner::{Partner, port_of, start_timer};
use crate::st_blocks::PATIENCE;
use crate::st_blocks::serial::compiled;
use commram::devices::omega_drive_line_2::blocks::{SERIAL_USS, USS_BMARRAY};
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use commram::memory::{AttachMode, Image, MemoryError};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc;
use std::{fs, thread};

const PLANT: &str = "\
[[plc]]
name = 'line'
serial = 'rs485'
[[plc]]
name = 'master'
serial = 'drives'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 4
baud_rate = 38400
doors = ['serial-pty']
[[bus]]
name = 'drives'
kind = 'serial'
wires = 2
baud_rate = 38400
[[bus.drive]]
name = 'pump'
address = 3
pzd_words = 3
";

/// Files of rllib that rl3964R needs.
const SOURCES: [&str; 9] = [
    "rl3964r",
    "rlserial",
    "rlthread",
    "rlwthread",
    "rlcutil",
    "rlinifile",
    "rlstring",
    "rlsocket",
    "rlspreadsheet",
];

/// Blocks with control characters. rl3964R ends a block at an octet 0, and takes at most 500 octets.
fn blocks() -> Vec<Vec<u8>> {
    let all: Vec<u8> = (1..=255).collect();
    vec![vec![0x41], vec![0x10], vec![0x02, 0x03, 0x10, 0x10, 0x15, 0x10], all, vec![0x10; 200]]
}

fn hex(block: &[u8]) -> String {
    block.iter().map(|octet| format!("{octet:02X}")).collect()
}

/// Compiles the foreign partner; `None` if its sources are missing.
fn foreign(directory: &Path) -> Option<PathBuf> {
    let Some(sources) = std::env::var_os("COMMRAM_RLLIB").map(PathBuf::from) else {
        skipped("rl3964R", "COMMRAM_RLLIB names no directory with rl3964r.cpp");
        return None;
    };
    let program = directory.join("rl3964r");
    let mut compiler = Command::new("c++");
    compiler.args(["-w", "-O1", "-o"]).arg(&program).arg("-I").arg(&sources);
    compiler.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/export/rl3964r.cpp"));
    compiler.args(SOURCES.map(|name| sources.join(name).with_extension("cpp"))).arg("-lpthread");
    assert!(compiler.status().unwrap().success());
    Some(program)
}

/// Starts the emulator with its clock stepped.
fn emulator(directory: &Path) -> Emulator {
    let plant = directory.join("plant.toml");
    fs::write(&plant, PLANT).unwrap();
    Emulator::start(&["--clock", "stepped", plant.to_str().unwrap()])
}

/// Starts the foreign partner at the pseudo-terminal, and waits until it is ready.
fn start(program: &Path, emulator: &Emulator, args: &[&str]) -> (Child, BufReader<ChildStdout>) {
    let buses: Value = serde_json::from_str(emulator.run("bus", &["list", "--format", "json"]).ok()).unwrap();
    let doors = buses[0]["doors"].as_array().unwrap().iter().filter_map(Value::as_str);
    let terminal = doors.filter_map(|door| door.strip_prefix("serial-pty:")).next().unwrap();
    let mut command = Command::new(program);
    let mut child = command.arg(terminal).args(args).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    lines.read_line(&mut line).unwrap();
    assert_eq!(line, "ready\n");
    (child, lines)
}

/// Advances the clock until the foreign partner has ended.
fn run(emulator: &Emulator, child: &mut Child) {
    let has_ended = || {
        emulator.step(&["20ms"]);
        child.try_wait().unwrap().is_some()
    };
    assert!(eventually(has_ended), "{}", emulator.run("trace", &["--last", "40"]).out);
    assert_eq!(wait_for(child, "rl3964r").code(), Some(0));
}

/// A program in Rust: sends the blocks by 3964R, and moves the drive. Returns the blocks that came back, and the speed that
/// the drive has reported.
fn program(
    instance: &str,
    ready: &mpsc::Sender<()>,
    done: &mpsc::Sender<()>,
) -> Result<(Vec<Vec<u8>>, [u16; 2]), MemoryError> {
    let line = Image::attach(instance, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
    let master = Image::attach(instance, "master", AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
    let mut task = line.join_lockstep(0, PATIENCE, PATIENCE)?;
    start_timer(&line)?;
    let (to_partner, to_drives) = (port_of(&line, 4)?, port_of(&master, 2)?);
    ready.send(()).unwrap();
    let mut partner = Partner::new(blocks(), true);
    let mut drives = SERIAL_USS { x_EN: true, d_SLAVES: 1 << 3, us_PZD: 3, ..Default::default() };
    let (mut setpoints, mut actual): (Box<USS_BMARRAY>, Box<USS_BMARRAY>) =
        (Box::new([0; 512]), Box::new([0; 512]));
    let (values, mut reply): (USS_BMARRAY, USS_BMARRAY) = ([0; 512], [0; 512]);
    let mut is_told = false;
    while task.next_event(PATIENCE).is_ok() {
        partner.call(&to_partner);
        // DRIVECOM: ready to switch on, switched on, operation enabled.
        setpoints[48] = match actual[48] & 0x006F {
            0x0021 => 0x0007,
            0x0023 | 0x0027 => 0x000F,
            _ => 0x0006,
        };
        (setpoints[49], setpoints[50]) = (0x0001, 0x2345);
        drives.call(&to_drives, &setpoints, &mut actual, &values, &mut reply);
        if partner.back.len() == blocks().len() && actual[50] == 0x2345 && !is_told {
            is_told = true;
            done.send(()).unwrap();
        }
        line.ring()?;
        master.ring()?;
    }
    Ok((partner.back, [actual[49], actual[50]]))
}

#[test]
fn a_program_in_rust_exchanges_blocks_and_drives_a_slave() {
    let directory = tempfile::tempdir().unwrap();
    let Some(foreign) = foreign(directory.path()) else { return };
    let mut emulator = emulator(directory.path());
    let count = blocks().len().to_string();
    let (mut child, mut lines) = start(&foreign, &emulator, &["low", "echo", &count]);
    let ((ready, is_ready), (done, is_done)) = (mpsc::channel(), mpsc::channel());
    let program = {
        let instance = emulator.name.clone();
        thread::spawn(move || program(&instance, &ready, &done))
    };
    is_ready.recv_timeout(PATIENCE).unwrap();
    run(&emulator, &mut child);
    let is_over = || {
        emulator.step(&["20ms"]);
        is_done.try_recv().is_ok()
    };
    assert!(eventually(is_over));
    let mut heard = String::new();
    lines.read_to_string(&mut heard).unwrap();
    let expected: Vec<String> = blocks().iter().map(|block| hex(block)).collect();
    assert_eq!(heard.lines().collect::<Vec<_>>(), expected);
    emulator.run("stop", &[]).ok();
    emulator.wait();
    assert_eq!(program.join().unwrap().unwrap(), (blocks(), [0x0001, 0x2345]));
}

#[test]
fn a_program_in_structured_text_returns_the_blocks() {
    let Some(matiec) = std::env::var_os("COMMRAM_MATIEC").map(PathBuf::from) else {
        skipped("matiec", "COMMRAM_MATIEC names no directory with iec2c and lib");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let Some(foreign) = foreign(directory.path()) else { return };
    compiled(&matiec, directory.path(), "serial.st", "");
    let mut emulator = emulator(directory.path());
    let plc = Plc::start_at(&directory.path().join("plc"), &emulator, "line", &["0", "20"]);
    let is_on = || {
        emulator.step(&["20ms"]);
        emulator.peek(&["line:serial.w_STATUS"]) == "16#0001"
    };
    assert!(eventually(is_on));
    let expected: Vec<String> = blocks().iter().map(|block| hex(block)).collect();
    let mut args = vec!["high", "send"];
    args.extend(expected.iter().map(String::as_str));
    let (mut child, mut lines) = start(&foreign, &emulator, &args);
    run(&emulator, &mut child);
    let mut heard = String::new();
    lines.read_to_string(&mut heard).unwrap();
    assert_eq!(heard.lines().collect::<Vec<_>>(), expected);
    assert_eq!(plc.end(), Some(0));
    emulator.run("stop", &[]).ok();
    emulator.wait();
}

/// The script is the program of the PLC: it calls the block every millisecond of emulated time.
#[test]
fn a_scenario_exchanges_blocks() {
    let directory = tempfile::tempdir().unwrap();
    let Some(foreign) = foreign(directory.path()) else { return };
    let emulator = emulator(directory.path());
    let list: Vec<String> = blocks().iter().map(|block| format!("{block:?}")).collect();
    let script = format!(
        r#"
poke("line:serial.u_BAUD_RATE", 38400);
poke("line:serial.us_DATA_BITS", 8);
poke("line:serial.b_PARITY", 2);
poke("line:serial.us_STOP_BITS", 1);
poke("line:serial.us_WIRES", 4);
poke("line:serial.w_CONTROL", 1);
wait("line:serial.w_STATUS", 1, "2ms");
let plc = block("SERIAL_3964R", "line:serial");
plc.x_EN = true;
plc.x_HIGH = true;
for octets in [{}] {{
    for n in 0..octets.len() {{ plc.a_SEND[n] = octets[n]; }}
    plc.u_SEND = octets.len();
    plc.x_SEND = true;
    let end = now() + 60_000_000;
    while !plc.x_RECEIVED && now() < end {{
        cycle(plc);
        step("1ms");
    }}
    expect_that(plc.x_SENT && plc.x_RECEIVED, `errors ${{plc.b_ERR_SEND}} and ${{plc.b_ERR_RECEIVE}}`);
    expect_that(plc.u_RECEIVED == octets.len(), "the length");
    for n in 0..octets.len() {{ expect_that(plc.a_RECEIVED[n] == octets[n], `octet ${{n}}`); }}
    plc.x_SEND = false;
    plc.x_TAKEN = true;
    cycle(plc);
    plc.x_TAKEN = false;
    // The partner gets its acknowledgement, and the line is silent.
    for n in 0..20 {{ cycle(plc); step("1ms"); }}
}}
"#,
        list.join(", ")
    );
    let file = directory.path().join("blocks.rhai");
    fs::write(&file, script).unwrap();
    let count = blocks().len().to_string();
    let (mut child, mut lines) = start(&foreign, &emulator, &["low", "echo", &count]);
    crate::common::run(&["test", file.to_str().unwrap(), "--attach", &emulator.name]).ok();
    assert_eq!(wait_for(&mut child, "rl3964r").code(), Some(0));
    let mut heard = String::new();
    lines.read_to_string(&mut heard).unwrap();
    let expected: Vec<String> = blocks().iter().map(|block| hex(block)).collect();
    assert_eq!(heard.lines().collect::<Vec<_>>(), expected);
}
