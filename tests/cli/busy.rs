//! A stepped emulator still answers while it advances a long emulated time.

use crate::common::{
    Emulator, commram, eventually, finish, in_mount_namespace, promised, run, unique_name, wait_for,
};
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A running command that advances the clock by a day. Dropping this value kills it.
struct Busy(Child);

impl Busy {
    fn start(emulator: &Emulator, command: &str, args: &[&str]) -> Self {
        // With traffic on the bus a day takes minutes, without traffic a second.
        emulator.set_up(&[]);
        let before = time(emulator);
        let mut command = emulator.command(command, args);
        let busy = Self(command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap());
        assert!(eventually(|| time(emulator) > before));
        busy
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Returns the emulated time that the emulator reports.
fn time(emulator: &Emulator) -> u64 {
    let outcome = emulator.run("dump", &["node2", "--format", "text"]);
    let seconds = outcome.ok().split(" at ").nth(1).unwrap().split(" s").next().unwrap();
    seconds.replace('.', "").parse().unwrap()
}

#[test]
fn other_clients_are_served_during_a_step_of_a_day() {
    for (command, args) in
        [("step", &["24h"][..]), ("wait", &["node2.w_OPTION_STATUS==7", "--within", "20h"])]
    {
        let mut emulator = Emulator::stepped();
        let mut busy = Busy::start(&emulator, command, args);
        assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0020");
        assert!(run(&["list"]).ok().contains(&emulator.name));
        promised(Duration::from_secs(2), || emulator.run("stop", &[])).ok();
        assert_eq!(emulator.wait().code(), Some(0));
        assert_eq!(wait_for(&mut busy.0, command).code(), Some(3), "{command}");
    }
}

/// A client that waits gets the name of the instance and the reason when the emulator ends.
#[test]
fn a_waiting_client_learns_why_the_emulator_ends() {
    let ends_with = |emulator: &Emulator, end: &dyn Fn() -> String| {
        let mut busy = Busy::start(emulator, "step", &["24h"]);
        let reason = end();
        assert_eq!(wait_for(&mut busy.0, "step").code(), Some(3));
        let mut message = String::new();
        busy.0.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        let begin = format!("commram: instance '{}' is ending: ", emulator.name);
        assert!(message.starts_with(&begin) && message.trim_end().ends_with(&reason), "{message} {reason}");
    };
    let emulator = Emulator::stepped();
    ends_with(&emulator, &|| {
        let mut stop = emulator.command("stop", &[]).spawn().unwrap();
        wait_for(&mut stop, "stop");
        format!("process {}) has asked it to", stop.id())
    });
    let emulator = Emulator::stepped();
    ends_with(&emulator, &|| {
        let pid = rustix::process::Pid::from_raw(emulator.pid() as i32).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        format!("(process {}) has sent SIGTERM", std::process::id())
    });
}

/// Tests the same with an emulator that ends because its parent process or the command of `with` has ended.
#[test]
fn a_waiting_client_learns_that_the_parent_has_ended() {
    const BEGIN: &str = "$COMMRAM step 24h -i $NAME 2>&1 & step=$!
        while $COMMRAM status -i $NAME | grep -q \"at 0.000000 s\"; do :; done";
    let name = unique_name();
    let with_parent = format!(
        "sh -c '$COMMRAM run --parent $$ -i $NAME --clock stepped; :' >/dev/null & parent=$!
        until $COMMRAM status -i $NAME >/dev/null 2>&1; do sleep 0.01; done
        {BEGIN}
        kill -KILL $parent; wait $step; [ $? = 3 ] && echo parent is $parent"
    );
    let with_command = format!("$COMMRAM with --clock stepped -i $NAME -- sh -c '{BEGIN}'; wait");
    for (script, reason) in
        [(with_parent, "its parent, process "), (with_command, "the command of `commram with` has ended")]
    {
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]).env("COMMRAM", commram().get_program()).env("NAME", &name);
        let outcome = finish(&mut shell);
        let begin = format!("commram: instance '{name}' is ending: {reason}");
        assert!(outcome.out.contains(&begin), "{outcome:?}");
    }
}

#[test]
fn the_operation_of_a_killed_client_ends() {
    let emulator = Emulator::stepped();
    let mut busy = Busy::start(&emulator, "step", &["24h"]);
    busy.0.kill().unwrap();
    busy.0.wait().unwrap();
    // A write waits for the end of the current operation, which would take a day.
    emulator.poke(&["%MB3.1000000=1"]);
    let ended = time(&emulator);
    assert!(ended < 24 * 3_600 * 1_000_000, "{ended}");
    emulator.step(&["1us"]);
    assert_eq!(time(&emulator), ended + 1);
}

/// A return takes as long as the first run, here seconds because of the script.
#[test]
fn the_return_of_a_killed_client_ends() {
    let directory = tempfile::tempdir().unwrap();
    let device = directory.path().join("dev");
    let new = ["new", device.to_str().unwrap(), "--template", "device"];
    run(&new).ok();
    let script = "fn power_on() { this.n = 0; }
        fn poll() {
            let a = [];
            for i in range(0, 500) { if a.len() > 300 { a = []; } a.push(i); a.sort(); }
            this.n += 1;
        }";
    std::fs::write(device.join("firmware.rhai"), script).unwrap();
    let plant = directory.path().join("plant.toml");
    std::fs::write(&plant, "[[device]]\nkind = \"./dev\"\nname = \"d\"\n").unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    emulator.step(&["40ms"]);
    let work = || {
        let stat = crate::common::stat(&emulator.pid().to_string());
        stat[11].parse::<u64>().unwrap()
    };
    let before = work();
    let mut back = emulator.command("step", &["--back", "20ms"]);
    let mut back = Busy(back.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    // The return has begun when the emulator works.
    assert!(eventually(|| work() >= before + 3));
    back.0.kill().unwrap();
    back.0.wait().unwrap();
    assert_eq!(emulator.step(&["0us"]), "0.040000 s");
    assert_eq!(emulator.step(&["--back", "20ms"]), "0.020000 s");
}

/// The first client is killed during its operation. The other clients get an answer only after the emulator has noticed
/// this.
#[test]
fn clients_queued_after_a_killed_client_are_served() {
    let emulator = Emulator::stepped();
    let nodes = format!("/dev/shm/commram.{}.iox.d/nodes", emulator.name);
    let count = || std::fs::read_dir(&nodes).map_or(0, |entries| entries.count());
    let mut busy = Busy::start(&emulator, "step", &["24h"]);
    let before = count();
    let waiting: Vec<_> = (0..3)
        .map(|_| {
            let mut step = emulator.command("step", &["1us"]);
            std::thread::spawn(move || finish(&mut step))
        })
        .collect();
    assert!(eventually(|| count() >= before + waiting.len()));
    busy.0.kill().unwrap();
    busy.0.wait().unwrap();
    for client in waiting {
        client.join().unwrap().ok();
    }
}

/// Runs in a separate `/dev/shm`, because the command stops all emulators that it finds.
#[test]
fn all_emulators_can_be_ended_at_once() {
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        for name in one two killed; do $COMMRAM run --detach -i $name >/dev/null || exit 1; done
        pid=$($COMMRAM list --format csv | sed -n 's/^killed,[^,]*,\\([0-9]*\\),.*/\\1/p')
        kill -KILL $pid; while readlink /proc/$pid/exe >/dev/null; do :; done
        $COMMRAM stop --all 2>&1; echo $?; $COMMRAM list | wc -l
        $COMMRAM stop --all --clean; $COMMRAM stop --all; ls /dev/shm";
    let Some(outcome) = in_mount_namespace(script, None) else { return };
    let expected = "commram: note: instance 'killed' was killed; `commram stop --all --clean` removes its files\n\
                    instance 'one' has stopped\ninstance 'two' has stopped\n0\n2\n\
                    instance 'killed' was dead, its files are removed\nno instance is running\n";
    assert_eq!(outcome.ok(), expected);
}
