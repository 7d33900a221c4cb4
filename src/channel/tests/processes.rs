//! Killed processes. The child processes run this test binary with a role in the environment.

use super::rig::{Emulator, InstanceFiles, LONG, is_gone, serve};
use crate::channel::client::Patience;
use crate::channel::{Bells, Client, ClientError};
use crate::identity::DeviceIndex;
use crate::journal::Keep;
use crate::memory::Width;
use crate::request::testing::{RAM, TestHost};
use crate::request::{MAX_ADVANCE_US, Op, Reply};
use rustix::process::Pid;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

const REG: u32 = RAM.start;
const ROLE: &str = "COMMRAM_TEST_ROLE";

/// A child process; killed on drop.
struct Process(Child);

impl Process {
    fn spawn(place: &InstanceFiles, role: &str) -> Self {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "channel::tests::processes::child", "--nocapture"])
            .env(ROLE, role)
            .env("COMMRAM_TEST_DIRECTORY", &place.directory)
            .env("COMMRAM_TEST_INSTANCE", &place.instance)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        Self(child)
    }

    /// Sends SIGKILL. The process must still run.
    fn kill(mut self) {
        assert!(!is_gone(Pid::from_child(&self.0)), "the child ended by itself");
        self.0.kill().unwrap();
        assert_eq!(self.0.wait().unwrap().signal(), Some(9));
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The body of the child processes, and not a real test.
#[test]
fn child() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let directory = std::env::var_os("COMMRAM_TEST_DIRECTORY").unwrap().into();
    let place = InstanceFiles::inherited(directory, std::env::var("COMMRAM_TEST_INSTANCE").unwrap());
    match role.as_str() {
        "server" => serve(&place, TestHost::new(false)),
        // The script of this host has a store outside of the image, so the advance of the clock panics.
        "crashing" => {
            let mut host = TestHost::new(true);
            host.script = vec![(1000, u32::MAX - 1, 1)];
            serve(&place, host);
        }
        "waiter" => {
            let wait = Op::Wait {
                plc: DeviceIndex(0),
                offset: REG,
                width: Width::Word,
                mask: 1,
                value: 1,
                within_us: MAX_ADVANCE_US,
            };
            let poke = Op::Poke { plc: DeviceIndex(0), offset: REG + 2, width: Width::Word, value: 1 };
            place.client().request(&[poke, wait]).unwrap();
        }
        "hammer" => {
            let client = place.client();
            for value in 0.. {
                client.poke(DeviceIndex(0), REG, Width::Dword, value).unwrap();
            }
        }
        "saver" => {
            let client = place.client();
            while save(&client).is_ok() {}
            client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
            std::thread::park();
        }
        "idle" => {}
        other => panic!("no such role: {other}"),
    }
}

/// Repeats the check until it is true.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < LONG, "timed out: {what}");
        std::thread::yield_now();
    }
}

fn quick() -> Patience {
    Patience { connect: LONG, reply: LONG, ..Patience::default() }
}

#[test]
fn a_client_killed_while_it_waits_does_not_disturb_the_others() {
    let place = Arc::new(InstanceFiles::new());
    let mut host = TestHost::new(false);
    host.is_frozen = true;
    let emulator = Emulator::start_with(&place, host);
    let client = place.client();
    let waiter = Process::spawn(&place, "waiter");
    until("the child waits", || client.peek(DeviceIndex(0), REG + 2, Width::Word).unwrap() == 1);
    waiter.kill();
    client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
    assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 1);
    place.client().poke(DeviceIndex(0), REG, Width::Word, 2).unwrap();
    drop(client);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

fn save(client: &Client) -> Result<u32, String> {
    match client.request(&[Op::Save]).unwrap().remove(0) {
        Reply::Value(number) => Ok(number),
        Reply::Error(refused) => Err(refused.text),
        other => panic!("{other:?}"),
    }
}

/// The snapshots of a client end with the client, whether it was killed or has left.
#[test]
fn snapshots_of_departed_clients_take_no_place() {
    let place = Arc::new(InstanceFiles::new());
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    let own = save(&client).unwrap();
    let other = Process::spawn(&place, "saver");
    until("the child has taken all places", || client.peek(DeviceIndex(0), REG, Width::Word).unwrap() == 1);
    let refused = save(&client).unwrap_err();
    let expected =
        "64 snapshots are kept, which is the maximum: other clients keep 63 of them until they end";
    assert!(refused.contains(expected), "{refused}");
    other.kill();
    // The first request after the death finds places.
    let second = save(&client).unwrap();
    let leaving = place.client();
    while save(&leaving).is_ok() {}
    drop(leaving);
    let third = save(&client).unwrap();
    for number in [own, second, third] {
        let reply = client.request(&[Op::BackTo { number, detached: false }]).unwrap().remove(0);
        assert!(matches!(reply, Reply::Time(_)), "{reply:?}");
    }
    drop(client);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

/// The registers that a client follows become free for other clients at once when the client leaves.
#[test]
fn followed_registers_of_departed_clients_take_no_place() {
    // Less than half of all registers, so that a client alone may follow them. In plain RAM, a register has four bytes.
    const COUNT: u32 = 30_000;
    let place = Arc::new(InstanceFiles::new());
    let emulator = Emulator::start(&place, true);
    let follow = |client: &Client, first: u32| {
        (first..first + 4 * COUNT).step_by(4000).all(|offset| {
            let follow = Op::Follow { plc: DeviceIndex(0), offset, len: 4000, keep: Keep::ForOnlookers };
            client.request(&[follow]).unwrap() == [Reply::Written]
        })
    };
    let (first, second) = (RAM.start, RAM.start + 4 * COUNT);
    let leaving = place.client();
    assert!(follow(&leaving, first));
    let next = place.client();
    assert!(!follow(&next, second));
    drop(leaving);
    assert!(follow(&next, second));
    drop(next);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn killed_clients_do_not_use_up_the_places() {
    let place = Arc::new(InstanceFiles::new());
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    // There are more rounds than places for clients, so a place that stays occupied makes a later round fail.
    for round in 0..12 {
        let before = client.peek(DeviceIndex(0), REG, Width::Dword).unwrap();
        let children: [_; 4] = std::array::from_fn(|_| Process::spawn(&place, "hammer"));
        until("the children hammer", || {
            let now = client.peek(DeviceIndex(0), REG, Width::Dword).unwrap();
            now > 20 && now != before
        });
        children.into_iter().for_each(Process::kill);
        client.poke(DeviceIndex(0), REG, Width::Dword, round).unwrap();
    }
    place.client().poke(DeviceIndex(0), REG, Width::Dword, 1).unwrap();
    drop(client);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

/// The server removes the objects of killed clients, even if no request comes.
#[test]
fn objects_of_killed_clients_are_removed() {
    let place = Arc::new(InstanceFiles::new());
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    client.peek(DeviceIndex(0), REG, Width::Dword).unwrap();
    let alone = place.remains().len();
    let children: [_; 3] = std::array::from_fn(|_| Process::spawn(&place, "hammer"));
    until("the children hammer", || client.peek(DeviceIndex(0), REG, Width::Dword).unwrap() > 20);
    children.into_iter().for_each(Process::kill);
    assert!(place.remains().len() > alone, "the objects of killed clients remain at first");
    until("the objects are removed", || place.remains().len() <= alone);
    client.poke(DeviceIndex(0), REG, Width::Dword, 1).unwrap();
    drop(client);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

/// A client may be killed between creating a part of the channel and setting its size.
#[test]
fn remains_of_a_client_killed_while_it_entered_block_no_other() {
    let place = Arc::new(InstanceFiles::new());
    let emulator = Emulator::start(&place, true);
    // The channel exists from here on.
    let client = place.client();
    let (part, _) = place.domain().lengths().swap_remove(0);
    let half_made = PathBuf::from(format!("{}-half", part.display()));
    let maker = std::fs::File::create(&half_made).unwrap();
    let impatient = Patience { connect: Duration::ZERO, ..quick() };
    let refused = place.connect(impatient).unwrap_err();
    assert!(matches!(&refused, ClientError::Damaged { path, .. } if *path == half_made), "{refused}");
    drop(maker);
    // A child of another test may have inherited the file until its `exec`.
    until("no process has it open", || place.connect(impatient).is_ok());
    assert!(!half_made.exists());
    client.poke(DeviceIndex(0), REG, Width::Dword, 1).unwrap();
    drop(client);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn a_killed_emulator_is_noticed_and_can_be_started_again() {
    let place = InstanceFiles::new();
    for _ in 0..3 {
        let server = Process::spawn(&place, "server");
        let client = place.connect(quick()).unwrap();
        client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
        server.kill();
        let start = Instant::now();
        let gone = client.peek(DeviceIndex(0), REG, Width::Word).unwrap_err();
        assert!(matches!(gone, ClientError::EmulatorGone { killed: Some(_), .. }), "{gone}");
        assert!(gone.to_string().contains("killed or has crashed") && gone.to_string().contains("run --log"));
        assert!(start.elapsed() < quick().reply, "a dead emulator is noticed before the timeout");
        let gone = client.peek(DeviceIndex(0), REG, Width::Word).unwrap_err();
        assert!(matches!(gone, ClientError::EmulatorGone { .. }), "{gone}");
        // A new client does not wait for a dead emulator, but gets an error at once.
        let refused = place.connect(Patience::default()).unwrap_err();
        assert!(matches!(refused, ClientError::NotRunning { .. }), "{refused}");
        assert!(!place.remains().is_empty());
        drop(client);
        assert!(place.remains().is_empty(), "the last client removes them: {:?}", place.remains());
    }
    let server = Process::spawn(&place, "server");
    until("the emulator is up again", || {
        place.connect(quick()).is_ok_and(|c| c.peek(DeviceIndex(0), REG, Width::Word).is_ok())
    });
    place.connect(quick()).unwrap().stop().unwrap();
    until("the emulator has ended", || is_gone(Pid::from_child(&server.0)));
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn the_error_after_a_crash_names_the_crash() {
    let place = InstanceFiles::new();
    let server = Process::spawn(&place, "crashing");
    let client = place.connect(quick()).unwrap();
    client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
    let gone = client.request(&[Op::Advance { us: 2000 }]).unwrap_err();
    assert!(
        matches!(gone, ClientError::EmulatorGone { killed: Some(pid), .. } if pid == server.0.id()),
        "{gone}"
    );
    assert!(gone.to_string().contains("killed or has crashed"), "{gone}");
}

#[test]
fn a_client_in_the_middle_of_a_request_notices_the_death_of_the_emulator() {
    let place = InstanceFiles::new();
    let server = Process::spawn(&place, "server");
    let client = place.connect(quick()).unwrap();
    std::thread::scope(|scope| {
        let waiter = scope.spawn(|| {
            let client = place.connect(quick()).unwrap();
            let poke = Op::Poke { plc: DeviceIndex(0), offset: REG + 2, width: Width::Word, value: 1 };
            let (mask, value, within_us) = (1, 1, MAX_ADVANCE_US);
            let wait =
                Op::Wait { plc: DeviceIndex(0), offset: REG, width: Width::Word, mask, value, within_us };
            client.request(&[poke, wait])
        });
        until("the other client waits", || client.peek(DeviceIndex(0), REG + 2, Width::Word).unwrap() == 1);
        server.kill();
        let gone = waiter.join().unwrap().unwrap_err();
        assert!(matches!(gone, ClientError::EmulatorGone { .. }), "{gone}");
    });
}

/// A process that was killed in its first milliseconds once blocked the service permanently. So this test
/// kills a process at every stage of its start.
#[test]
fn an_emulator_killed_while_it_starts_does_not_block_the_next() {
    let place = InstanceFiles::new();
    let files = || {
        let mut count = place.remains().len();
        let mut directories = vec![place.root()];
        while let Some(directory) = directories.pop() {
            for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
                count += 1;
                if entry.path().is_dir() {
                    directories.push(entry.path());
                }
            }
        }
        count
    };
    for stage in 1..=14 {
        let server = Process::spawn(&place, "server");
        until("the emulator has got that far", || files() >= stage || place.root().join("ready").exists());
        server.kill();
    }
    let server = Process::spawn(&place, "server");
    place.connect(quick()).unwrap().stop().unwrap();
    until("the emulator has ended", || is_gone(Pid::from_child(&server.0)));
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn the_dead_are_recognised() {
    let place = InstanceFiles::new();
    let bells = place.bells();
    bells.set_pid(std::process::id());
    assert!(bells.emulator_alive());
    let child = Process::spawn(&place, "idle");
    bells.set_pid(child.0.id());
    until("the child has ended", || !bells.emulator_alive());
}
