//! Speed of devices in folders: 200 registers, ten handshakes, a process image of 32 bytes, one handshake completed in
//! each millisecond. The device uses only tables, only a script, or a script that also polls in each processor cycle.
//!
//! This benchmark does not use criterion. It prints the speed of each device relative to real time. It measures
//! processor time, so that other work of the machine has little influence. `peer_cards.py` does the same work in
//! another simulator.

use commram::memory::{Segment, Width};
use commram::plant::{Plant, PlantConfig};
use rustix::time::{ClockId, clock_gettime};
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Emulated milliseconds of a measurement, and the number of measurements.
const MILLISECONDS: u64 = 20_000;
const ROUNDS: usize = 5;
const HANDSHAKES: u32 = 10;
/// Offset of the first register in the image.
const FIRST: u32 = 4096;

const SCRIPT: &str = "\
const WRITTEN = [\"card.w_COMMAND*\"];
fn written(register, old, value) {
    if value == 5 { after(500, \"answer\", [register]); }
}
fn answer(register) {
    copy(\"card.a_IN\", \"card.a_OUT\");
    exchange(register, 5, 4);
}
";
const POLL: &str = "fn poll() { if read(\"card.w_PLC0\") != 0 { output(\"card.w_FW0\", 1); } }\n";

/// Writes the files of the device `name`.
fn write_device(dir: &Path, name: &str) -> Result<(), Box<dyn Error>> {
    let sources = "page = '1'\ndoc = 'x'\nname_from = 'manual'\noffsets = 'manual'\nnames = 'manual'\ntypes = 'manual'\nowners = 'manual'\nresets = 'manual'\n";
    let mut registers = String::new();
    let kinds = [("COMMAND", HANDSHAKES, "both"), ("PLC", 95, "plc"), ("FW", 95, "firmware")];
    let all = kinds
        .iter()
        .flat_map(|(kind, count, owner)| (0..*count).map(move |n| (format!("w_{kind}{n}"), owner)));
    let mut offset = 0;
    for (register, owner) in all {
        writeln!(
            registers,
            "  {{ offset = {offset}, name = '{register}', type = 'WORD', owner = '{owner}', doc = 'x' }},"
        )?;
        offset += 2;
    }
    for (register, owner) in [("a_IN", "plc"), ("a_OUT", "firmware")] {
        writeln!(
            registers,
            "  {{ offset = {offset}, name = '{register}', type = 'WORD', array = [16], owner = '{owner}', doc = 'x' }},"
        )?;
        offset += 32;
    }
    fs::write(
        dir.join("CARD.toml"),
        format!("name = 'CARD'\nsize = {offset}\n{sources}register = [\n{registers}]\n"),
    )?;
    let device = format!(
        "name = '{name}'\ntitle = 'Card'\nmanual = '{name}'\nnames = 'manual'\nstructures = ['CARD']\nreserved = {{ owner = 'firmware', source = 'manual' }}\n\
         space = [{{ name = 'card', letter = 'M', segment = 3, unit = 'byte', first = 0, offset = {FIRST}, page = '1', doc = 'x' }}]\n\
         area = [{{ name = 'card', first = 0, page = '1', doc = 'x', structure = [{{ name = 'CARD', live = 'always' }}] }}]\n"
    );
    Ok(fs::write(dir.join("device.toml"), device)?)
}

/// Returns the tables that do the same work as the script.
fn tables() -> String {
    let answer = |n| {
        format!(
            "[[answer]]\nregister = 'card.w_COMMAND{n}'\nrequest = 5\nanswer = 4\nafter = '500us'\npage = '1'\nsource = 'manual'\n"
        )
    };
    let answers: String = (0..HANDSHAKES).map(answer).collect();
    answers + "[[mirror]]\nfrom = 'card.a_IN'\nto = 'card.a_OUT'\npage = '1'\nsource = 'manual'\n"
}

/// Returns the processor time of this process, which has one thread.
fn processor_time() -> Result<Duration, Box<dyn Error>> {
    Ok(clock_gettime(ClockId::ProcessCPUTime).try_into()?)
}

/// Returns the emulated time divided by the processor time.
fn speed(dir: &Path) -> Result<f64, Box<dyn Error>> {
    let plant = format!("[[device]]\nname = 'card'\nkind = '{}'\n", dir.display());
    let config = PlantConfig::parse("plant", &plant)?;
    let mut plant = Plant::new(&config, |_plc, device| Ok::<_, Box<dyn Error>>(Segment::of(device)))?;
    let begin = processor_time()?;
    for ms in 1..=MILLISECONDS {
        let command = FIRST + 2 * (ms as u32 % HANDSHAKES);
        let segment = plant.devices()[0].segment().clone();
        segment.store(command, Width::Word, 5)?;
        segment.store(FIRST + 400, Width::Word, ms as u32 & 0xFFFF)?;
        plant.advance_to(ms * 1000);
    }
    let took = (processor_time()? - begin).as_secs_f64();
    let last = FIRST + 2 * ((MILLISECONDS as u32 - 1) % HANDSHAKES);
    if plant.devices()[0].segment().load(last, Width::Word)? != 4 {
        return Err("a handshake was not completed".into());
    }
    Ok(MILLISECONDS as f64 / 1000.0 / took)
}

fn main() -> Result<(), Box<dyn Error>> {
    let variants = [
        ("tables", None),
        ("script", Some(SCRIPT.to_owned())),
        ("script with poll", Some(format!("{SCRIPT}{POLL}"))),
    ];
    for (number, (name, script)) in variants.into_iter().enumerate() {
        let dir = tempfile::tempdir()?;
        write_device(dir.path(), &format!("card{number}"))?;
        match script {
            Some(script) => fs::write(dir.path().join("firmware.rhai"), script)?,
            None => fs::write(dir.path().join("handshakes.toml"), tables())?,
        }
        let mut speeds = (0..ROUNDS).map(|_| speed(dir.path())).collect::<Result<Vec<_>, _>>()?;
        speeds.sort_by(f64::total_cmp);
        let [least, median, most] =
            [0, ROUNDS / 2, ROUNDS - 1].map(|at| speeds.get(at).copied().unwrap_or(0.0));
        println!("{name:<17} {median:.0} times real time ({least:.0} to {most:.0})");
    }
    Ok(())
}
