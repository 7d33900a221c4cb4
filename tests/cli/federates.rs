//! One plant in several processes that are connected through HELICS.

use crate::common::{Emulator, Outcome, commram, eventually, finish, is_there, python_for, unique_name};
use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, LAYOUT_HASH, NODE2};
use commram::memory::{AttachMode, Image, MemoryError, Width};
use std::net::TcpListener;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const LONG: Duration = Duration::from_secs(60);
/// Time after which a task detects that it is no longer needed.
const SHORT: Duration = Duration::from_millis(5);
/// Number of the event of a SYNC edge.
const SYNC: usize = 12;
/// `b_CTRLREG_WRC1` of node 2.
const WRC1: u32 = NODE2 + 12;

/// Two identical PLCs, each with a separate bus, and faults.
const PLANT: &str = "\
[[plc]]
name = 'line'
node2 = 'drives'
[[plc]]
name = 'press'
node2 = 'rams'
[[bus]]
name = 'drives'
[[bus.drive]]
name = 'drive1'
slave_number = 1
[[bus]]
name = 'rams'
[[bus.drive]]
name = 'ram1'
slave_number = 1
[[fault]]
kind = 'lose_frame'
bus = 'drives'
slot = 'CC'
at_us = 6000
count = 2
[[fault]]
kind = 'jitter_sync'
bus = 'rams'
amplitude_us = 40
at_us = 8000
duration_us = 9000
";

/// Returns the commands that bring these PLCs into active operation at the same emulated times and disturb them.
fn program(plcs: &str) -> String {
    format!(
        "let plcs = {plcs};
        for plc in plcs {{ poke(plc + \":node2.w_CPU_CONTROL\", 0x0001); }}
        for plc in plcs {{ wait(plc + \":node2.w_OPTION_STATUS\", 0x0002, \"1ms\"); }}
        for plc in plcs {{
            poke(plc + \":node2.b_MA_SL_MODE\", 0x00);
            poke(plc + \":node2.b_BT_0\", 0x00);
            poke(plc + \":node2.b_BT_1\", 0x1C);
            poke(plc + \":node2.b_TIME_PATTERN\", 2);
            poke(plc + \":node2.b_AC\", 0xFF);
            poke(plc + \":node2.b_AM\", 0xFF);
            poke(plc + \":node2.b_OUTPUT_CONTROL\", 0xFA);
            poke(plc + \":node2.b_CLOCK_DIVIDER\", 0x07);
            poke(plc + \":node2.a_SL_TYP[1]\", 1);
            poke(plc + \":node2.w_CPU_CONTROL\", 0x0002);
        }}
        for plc in plcs {{ wait(plc + \":node2.w_OPTION_STATUS\", 0x0003, \"1ms\"); }}
        for plc in plcs {{ poke(plc + \":node2.w_CPU_CONTROL\", 0x0020); }}
        for plc in plcs {{ wait(plc + \":node2.w_OPTION_STATUS\", 0x0043, \"1ms\"); }}
        step(20_000 - now());
        for plc in plcs {{
            poke(plc + \":node2.w_CPU_CONTROL\", 0x0040);
            fault(\"lose_sync bus=\" + if plc == \"line\" {{ \"drives\" }} else {{ \"rams\" }} + \" count=2\");
        }}
        step(40_000 - now());
        "
    )
}

/// HELICS as installed with Python: the interpreter, the directory of the library, and the broker.
#[derive(Clone)]
pub(crate) struct Helics {
    pub(crate) python: PathBuf,
    library: PathBuf,
    broker: PathBuf,
}

pub(crate) fn helics() -> Option<Helics> {
    let mut python = python_for("helics", &["helics"])?;
    let interpreter = python.get_program().into();
    let place =
        python.args(["-c", "import helics, os; print(os.path.dirname(helics.__file__))"]).output().unwrap();
    let install = Path::new(String::from_utf8(place.stdout).unwrap().trim()).join("install");
    Some(Helics {
        python: interpreter,
        library: install.join("lib64"),
        broker: install.join("bin/helics_broker"),
    })
}

/// Returns a command that starts a process which dies with this one, even if this one is killed.
pub(crate) fn mortal(program: &Path) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL"]).arg(program);
    command
}

/// A broker for a fixed number of federates.
pub(crate) struct Broker {
    _process: Ends,
    pub(crate) address: String,
    library: PathBuf,
}

/// Returns the first of the consecutive ports that a broker and its federates use. The ports lie below those that the
/// system assigns to other sockets, so they stay free until the broker starts.
fn free_ports() -> u16 {
    const BLOCK: u16 = 64;
    const BLOCKS: u32 = 340;
    static TAKEN: AtomicU32 = AtomicU32::new(0);
    (0..BLOCKS)
        .map(|_| {
            let block = (std::process::id() * 16 + TAKEN.fetch_add(1, Ordering::Relaxed)) % BLOCKS;
            10_000 + block as u16 * BLOCK
        })
        .find(|first| (*first..first + BLOCK).all(|port| TcpListener::bind(("127.0.0.1", port)).is_ok()))
        .expect("ports that are free")
}

impl Broker {
    pub(crate) fn start(helics: &Helics, federates: u8) -> Self {
        let port = free_ports();
        let mut command = mortal(&helics.broker);
        command.args(["--coretype=zmq", "--loglevel=no_print", "--local_interface=127.0.0.1"]);
        command.args([format!("--federates={federates}"), format!("--port={port}")]);
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        Broker {
            _process: Ends(child),
            address: format!("tcp://127.0.0.1:{port}"),
            library: helics.library.clone(),
        }
    }

    /// Returns the arguments of `commram run` for federate `part`.
    fn arguments<'a>(&'a self, plant: &'a str, part: &'a str) -> Vec<&'a str> {
        let federate = ["--federate", part, "--broker", &self.address];
        [&[plant, "--clock", "stepped"][..], &federate].concat()
    }

    /// Returns `commram run` with the stepped clock at this broker; `plant` is the argument for the plant.
    pub(crate) fn command(&self, plant: &[&str], more: &[&str]) -> Command {
        let mut command = commram();
        command.arg("run").args(plant).args(["--clock", "stepped", "--broker", &self.address]);
        command.args(more).env("COMMRAM_HELICS", &self.library);
        command
    }

    /// Starts an emulator with the command that `command` returns.
    pub(crate) fn emulator(&self, plant: &[&str], more: &[&str]) -> Emulator {
        let clock = ["--clock", "stepped", "--broker", &self.address];
        let environment = [("COMMRAM_HELICS", self.library.as_os_str())];
        Emulator::start_with(&unique_name(), &[plant, &clock, more].concat(), &environment)
    }

    fn federate(&self, plant: &Path, part: &str, more: &[&str]) -> Emulator {
        let arguments = self.arguments(plant.to_str().unwrap(), part);
        let environment = [("COMMRAM_HELICS", self.library.as_os_str())];
        Emulator::start_with(&unique_name(), &[&arguments, more].concat(), &environment)
    }
}

/// A process that is killed when this value is dropped.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(crate) fn written(directory: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = directory.path().join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Starts a program at a running instance.
pub(crate) fn at(emulator: &Emulator, program: &Path) -> Child {
    let mut command = commram();
    command.args(["test", "--attach", &emulator.name]).arg(program);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[track_caller]
pub(crate) fn passes(program: Child) {
    let output = program.wait_with_output().unwrap();
    let printed = [output.stdout, output.stderr].concat();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&printed));
}

pub(crate) fn journal(emulator: &Emulator) -> String {
    let outcome = emulator.run("trace", &[]);
    // The journal of an emulator that continues from a snapshot begins with a note.
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
    outcome.out
}

/// Runs a federate that is expected to fail early, up to its end.
fn ends(arguments: &[&str], library: &Path) -> Outcome {
    let mut command = commram();
    command.arg("run").args(arguments).args(["-i", &unique_name()]).env("COMMRAM_HELICS", library);
    finish(&mut command)
}

#[test]
fn federates_produce_the_same_journal_as_one_process() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let plant = written(&directory, "plant.toml", PLANT);
    let both = written(&directory, "both.rhai", &program("[\"line\", \"press\"]"));
    let one = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    passes(at(&one, &both));
    let expected = journal(&one);
    for count in [2, 3] {
        let broker = Broker::start(&helics, count);
        let follows = |number| broker.federate(&plant, &format!("{number}/{count}"), &["--follow"]);
        // The journals do not depend on the federate that leads.
        let leader = count - 2;
        let mut federates: Vec<_> = (0..count).filter(|number| *number != leader).map(follows).collect();
        federates.push(broker.federate(&plant, &format!("{leader}/{count}"), &[]));
        passes(at(federates.last().unwrap(), &both));
        for federate in &federates {
            assert!(eventually(|| journal(federate).lines().count() >= expected.lines().count()));
            assert_eq!(journal(federate), expected, "{count} federates");
        }
    }
    assert!(expected.contains("lose_frame") && expected.contains("jitter_sync"), "{expected}");
}

/// A device in a folder and an option card belong to every federate.
#[test]
fn folders_and_option_cards_behave_the_same_in_each_federate() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let folder = |name: &str| format!("{}/tools/devices/{name}", env!("CARGO_MANIFEST_DIR"));
    let (encoder, io) = (folder("encoder"), folder("digital-io"));
    let cards =
        format!("[[plc.option]]\nslot = 1\ncard = '{encoder}'\n[[device]]\nkind = '{io}'\nname = 'io'\n");
    // The option card belongs to the PLC `press`, after which its section is.
    let plant = PLANT.replacen("[[bus]]", &format!("{cards}[[bus]]"), 1);
    let plant = written(&directory, "plant.toml", &plant);
    let cards = "poke(\"press:encoder1.di_SPEED\", 500);\npoke(\"press:encoder1.w_COMMAND\", 7);\n\
                 wait(\"press:encoder1.w_COMMAND\", 6, \"3ms\");\npoke(\"io:data.w_OUT\", 5);\n";
    let both = written(&directory, "both.rhai", &format!("{cards}{}", program("[\"line\", \"press\"]")));
    let one = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    passes(at(&one, &both));
    let expected = journal(&one);
    let broker = Broker::start(&helics, 2);
    let follows = broker.federate(&plant, "1/2", &["--follow"]);
    let leads = broker.federate(&plant, "0/2", &[]);
    passes(at(&leads, &both));
    let position = |emulator: &Emulator| emulator.peek(&["press:encoder1.di_POSITION"]);
    for federate in [&leads, &follows] {
        assert!(eventually(|| journal(federate).lines().count() >= expected.lines().count()));
        assert_eq!(journal(federate), expected);
        assert_eq!(position(federate), position(&one));
    }
    assert!(expected.contains("press:option1") && expected.contains(" io "), "{expected}");
}

/// Two network namespaces that are connected by a cable are two hosts. The script ends with all its processes, because
/// they have a separate process namespace.
#[test]
fn federates_on_two_hosts_find_each_other() {
    let Some(helics) = helics() else { return };
    if !is_there("ip") {
        return;
    }
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        ip link set lo up
        unshare --net sleep 1000 & other=$!
        until [ $(readlink /proc/$other/ns/net) != $(readlink /proc/self/ns/net) ]; do sleep 0.01; done
        there=\"nsenter -t $other -n\"
        ip link add cable0 type veth peer name cable1 netns $other || exit 77
        ip address add 10.9.0.1/24 dev cable0; ip link set cable0 up
        $there ip address add 10.9.0.2/24 dev cable1; $there ip link set cable1 up; $there ip link set lo up
        $BROKER --coretype=zmq --federates=2 --ipv4 --loglevel=no_print &
        place='--clock stepped --broker tcp://10.9.0.1:23404 --detach --quiet'
        $there $COMMRAM run plant.toml $place -i press --federate 1/2 --follow || echo press $?
        $COMMRAM run plant.toml $place -i line --federate 0/2 || echo line $?
        $COMMRAM step 10ms -i line; echo step $?
        $COMMRAM stop -i line; echo stop $?";
    let directory = TempDir::new().unwrap();
    written(&directory, "plant.toml", PLANT);
    let mut command = Command::new("unshare");
    command.args(["--net", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c", script]);
    command.env("COMMRAM", commram().get_program()).env("BROKER", &helics.broker);
    command
        .env("COMMRAM_HELICS", &helics.library)
        .env_remove("COMMRAM_INSTANCE")
        .current_dir(directory.path());
    let outcome = finish(&mut command);
    if outcome.code == Some(77) || outcome.err.contains("unshare") {
        eprintln!("SKIPPED: no network namespaces: {}", outcome.err);
        return;
    }
    assert!(
        outcome.out.ends_with("0.010000 s\nstep 0\ninstance 'line' has stopped\nstop 0\n"),
        "{outcome:?}"
    );
}

/// A task in lockstep and a program that writes to an image run on a host that does not lead. The second host leads.
#[test]
fn programs_on_several_hosts_have_one_plant() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let plant = written(&directory, "plant.toml", PLANT);
    let broker = Broker::start(&helics, 2);
    let leads = broker.federate(&plant, "0/2", &[]);
    let follows = broker.federate(&plant, "1/2", &["--follow"]);
    passes(at(&leads, &written(&directory, "line.rhai", &program("[\"line\"]"))));
    let attach = |emulator: &Emulator, plc| {
        Image::attach(&emulator.name, plc, AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap()
    };
    let (joined, is_over) = (AtomicBool::new(false), AtomicBool::new(false));
    let turns = std::thread::scope(|scope| {
        let task = scope.spawn(|| {
            let image = attach(&follows, "line");
            let mut task = image.join_lockstep(SYNC, LONG, LONG).unwrap();
            // The program reads the board through the header page.
            let header = image.header().unwrap();
            let request = header.interrupts[SYNC].ask(0, true);
            header.submit_request();
            let outcome = |_: &_| header.interrupts[SYNC].outcome(request);
            assert_eq!(image.wait_until("INTR_SET", LONG, outcome).unwrap(), 0);
            joined.store(true, Ordering::Release);
            let mut turns = 0;
            while !is_over.load(Ordering::Acquire) {
                match task.next_event(SHORT) {
                    Ok(_) => {
                        task.run_for(NonZeroU32::new(80).unwrap(), LONG).unwrap();
                        image.segment().store(WRC1, Width::Byte, 0x05).unwrap();
                        turns += 1;
                    }
                    Err(MemoryError::Timeout { .. }) => {}
                    Err(other) => panic!("{other}"),
                }
            }
            turns
        });
        // The task gets its seat and its answers in turns of its host.
        assert!(eventually(|| {
            leads.step(&["100us"]);
            joined.load(Ordering::Acquire)
        }));
        leads.step(&["20ms"]);
        is_over.store(true, Ordering::Release);
        leads.step(&["5ms"]);
        task.join().unwrap()
    });
    assert!(turns >= 10, "{turns} turns");
    let press = attach(&follows, "press");
    press.segment().view::<CANsync_INIT_BMSTRUCT>(NODE2).unwrap().w_CPU_CONTROL.store(1);
    leads.step(&["5ms"]);
    let status = |emulator: &Emulator| emulator.run("peek", &["press:node2.w_OPTION_STATUS"]).ok().to_owned();
    assert!(eventually(|| status(&leads) == status(&follows)));
    assert!(status(&leads).contains('2'), "{}", status(&leads));
    assert_eq!(journal(&leads), journal(&follows));
}

/// The script of another program that has the name of a federate of this plant.
const IMPOSTOR: &str = "\
import sys, helics as h
info = h.helicsCreateFederateInfo()
h.helicsFederateInfoSetCoreTypeFromString(info, 'zmq')
h.helicsFederateInfoSetCoreInitString(info, '--federates=1 --loglevel=no_print --broker_address=' + sys.argv[1])
federate = h.helicsCreateValueFederate('commram/1', info)
h.helicsFederateEnterExecutingMode(federate)
h.helicsCoreSendCommand(h.helicsFederateGetCore(federate), 'commram/0', 'hello', h.helicsErrorInitialize())
h.helicsFederateSendCommand(federate, 'commram/0', sys.argv[2])
h.helicsFederateWaitCommand(federate)
h.helicsFederateDisconnect(federate)
";

#[test]
fn a_process_that_is_no_federate_of_this_plant_is_refused() {
    let Some(helics) = helics() else { return };
    // The other program sends a greeting of another version, or an invalid greeting.
    let other_version = "0005392e392e3902000000";
    for (greeting, code, complaint) in [
        (other_version, 2, "federate 1 is commram 9.9.9"),
        ("nonsense", 1, "federate 1 has sent an unexpected message"),
    ] {
        let broker = Broker::start(&helics, 2);
        let mut python = Command::new(&helics.python);
        python.args(["-c", IMPOSTOR, &broker.address, greeting]).stdout(Stdio::null()).stderr(Stdio::null());
        let mut impostor = Ends(python.spawn().unwrap());
        let outcome = ends(&broker.arguments("", "0/2")[1..], &broker.library);
        assert_eq!(outcome.code, Some(code), "{}", outcome.err);
        assert!(outcome.err.contains(complaint), "{}", outcome.err);
        let _ = impostor.0.wait();
    }
}

#[test]
fn a_dead_federate_is_noticed_and_an_orderly_end_ends_all() {
    let Some(helics) = helics() else { return };
    let directory = TempDir::new().unwrap();
    let plant = written(&directory, "plant.toml", PLANT);
    let broker = Broker::start(&helics, 2);
    let mut leads = broker.federate(&plant, "0/2", &["--limit", "3s"]);
    let mut follows = broker.federate(&plant, "1/2", &["--follow", "--limit", "3s"]);
    leads.step(&["1ms"]);
    let back = leads.run("step", &["--back", "1ms"]);
    assert!(back.fails(1).contains("the other federates cannot go back"), "{}", back.err);
    let step = leads.command("step", &["24h"]).stderr(Stdio::piped()).spawn().unwrap();
    assert!(eventually(|| !follows.run("status", &[]).ok().contains("at 0.001000 s")));
    follows.kill();
    let reason = format!("instance '{}' is ending: federate 1 has sent nothing for 3 s", leads.name);
    let output = step.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(3) && message.contains(&reason), "{message}");
    // A federate notices that the broker has ended even while it is idle.
    drop(broker);
    assert_eq!(leads.wait().code(), Some(3));
    let complaints = leads.complaints();
    assert!(complaints.contains("federate 1 has sent nothing for 3 s"), "{complaints}");

    let broker = Broker::start(&helics, 2);
    let leads = broker.federate(&plant, "0/2", &[]);
    let mut follows = broker.federate(&plant, "1/2", &["--follow"]);
    leads.step(&["1ms"]);
    assert!(eventually(|| follows.run("status", &[]).ok().contains("at 0.001000 s")));
    leads.run("stop", &[]).ok();
    assert_eq!(follows.wait().code(), Some(0));
    assert!(follows.complaints().contains("federate 0 has left"));

    // The leading federate has the turn and does nothing when the other federate leaves.
    let broker = Broker::start(&helics, 2);
    let mut leads = broker.federate(&plant, "0/2", &[]);
    let follows = broker.federate(&plant, "1/2", &["--follow"]);
    leads.step(&["1ms"]);
    assert_eq!(follows.run("stop", &[]).code, Some(0));
    assert_eq!(leads.wait().code(), Some(0));
    assert!(leads.complaints().contains("federate 1 has left"));
}

#[test]
fn a_mismatched_federate_is_refused_with_a_reason() {
    let outcome = finish(commram().args(["run", "--federate", "0/2"]));
    assert!(outcome.fails(2).contains("add --clock stepped"), "{}", outcome.err);
    let outcome = finish(commram().args(["run", "--clock", "stepped", "--federate", "2/2"]));
    assert!(outcome.fails(2).contains("0/2 and 1/2"), "{}", outcome.err);
    let nowhere = ["--clock", "stepped", "--federate", "0/2"];
    let outcome = ends(&nowhere, Path::new("/nonexistent/libhelics.so.3"));
    assert!(outcome.fails(3).contains("COMMRAM_HELICS=/nonexistent/libhelics.so.3"), "{}", outcome.err);
    let Some(helics) = helics() else { return };
    let library = helics.library.clone();
    let outcome = ends(&nowhere, &library.join("libzmq.so.5"));
    assert!(outcome.fails(3).contains("undefined symbol: helics"), "{}", outcome.err);
    // No broker listens at this address.
    let away = ["--broker", "tcp://127.0.0.1:9", "--limit", "2s"];
    let begin = Instant::now();
    let outcome = ends(&[&nowhere[..], &away].concat(), &library);
    assert!(begin.elapsed() < Duration::from_millis(4_500), "{:?}", begin.elapsed());
    assert_eq!(outcome.code, Some(3), "{}", outcome.err);
    // HELICS can report the missing broker before the time limit does.
    let is_named = ["no HELICS broker answers at tcp://127.0.0.1:9 within 2 s", "does a broker run"]
        .iter()
        .any(|text| outcome.err.contains(text));
    assert!(is_named, "{}", outcome.err);
    // The broker runs, and waits for another federate.
    let broker = Broker::start(&helics, 2);
    let outcome = ends(&[&nowhere[..], &["--broker", &broker.address, "--limit", "2s"]].concat(), &library);
    assert_eq!(outcome.code, Some(3), "{}", outcome.err);
    assert!(outcome.err.contains("has waited for more federates for 2 s"), "{}", outcome.err);
    // The broker keeps the name of the federate that has ended.
    let outcome = ends(&[&nowhere[..], &["--broker", &broker.address, "--limit", "2s"]].concat(), &library);
    assert_eq!(outcome.code, Some(3), "{}", outcome.err);
    assert!(outcome.err.contains("has already joined at this HELICS broker"), "{}", outcome.err);
    let directory = TempDir::new().unwrap();
    let plant = written(&directory, "plant.toml", PLANT);
    let other = written(&directory, "other.toml", &PLANT.replace("at_us = 8000", "at_us = 8001"));
    for (other, part, complaint) in
        [(&other, "1/2", "its state differs"), (&plant, "1/3", "federates, this one for")]
    {
        let broker = Broker::start(&helics, 2);
        let start =
            |plant: &Path, part: &str| ends(&broker.arguments(plant.to_str().unwrap(), part), &library);
        let ended = std::thread::scope(|scope| {
            let one = scope.spawn(|| start(&plant, "0/2"));
            let other = start(other, part);
            [one.join().unwrap(), other]
        });
        let is_refused = |it: &Outcome| it.code == Some(2) && it.err.contains(complaint);
        assert!(ended.iter().any(is_refused), "{:?}", ended.map(|it| it.err));
    }
}
