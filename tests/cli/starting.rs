//! Ways to start an emulator: `run --detach`, `with`, and clients that connect during the start.

use crate::common::{
    Outcome, commram, eventually, files_of, finish, remove_remains, run, stat, unique_name, wait_for,
};
use crate::folders::Place;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

/// An instance that a test starts in the background. Dropping this value ends it and removes its files.
struct Background(String);

impl Background {
    fn new() -> Self {
        Self(unique_name())
    }

    fn run(&self, command: &str, args: &[&str]) -> Outcome {
        finish(commram().arg(command).args(args).args(["-i", &self.0]))
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        let _ = commram().args(["stop", "-i", &self.0]).output();
        remove_remains(&self.0);
    }
}

fn program() -> &'static str {
    env!("CARGO_BIN_EXE_commram")
}

#[test]
fn a_detached_emulator_is_ready_when_the_command_returns() {
    let instance = Background::new();
    let name = &instance.0;
    let outcome = instance.run("run", &["--detach", "--clock", "stepped"]);
    let (ready, rest) = outcome.ok().split_once('\n').unwrap();
    assert!(ready.starts_with(&format!("commram: instance '{name}' ready: ")), "{ready}");
    let message = rest.strip_prefix("commram: process ").unwrap();
    let (pid, message) = message.split_once(' ').unwrap();
    assert_eq!(message, format!("continues in the background; end it with `commram stop -i {name}`\n"));
    assert!(PathBuf::from(format!("/proc/{pid}")).exists());
    assert_eq!(instance.run("peek", &["--raw", "node2.w_OPTION_STATUS"]).ok(), "16#0001\n");
    instance.run("stop", &[]).ok();
    assert_eq!(files_of(name), Vec::<PathBuf>::new());
}

/// The kernel kills a process when memory runs out. The child is killed while it waits for its plant.
#[test]
fn a_detached_emulator_that_is_killed_during_its_start_is_an_error_with_the_signal() {
    let instance = Background::new();
    for options in [&[][..], &["-q"]] {
        let mut command = commram();
        command.args(["run", "/dev/stdin", "--detach", "-i", &instance.0]).args(options);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut starter = command.spawn().unwrap();
        let input = starter.stdin.take();
        let children = format!("/proc/{0}/task/{0}/children", starter.id());
        let child = || std::fs::read_to_string(&children).unwrap().trim().parse::<i32>().ok();
        eventually(|| child().is_some());
        let pid = rustix::process::Pid::from_raw(child().unwrap()).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
        let output = starter.wait_with_output().unwrap();
        drop(input);
        let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        let outcome = Outcome { code: output.status.code(), out, err };
        let message = outcome.fails(1);
        let begin =
            format!("commram: the emulator of instance '{}' was killed before it was ready", instance.0);
        assert!(message.starts_with(&begin) && message.contains("(signal: 9 (SIGKILL))"), "{message}");
    }
}

/// After the start, the user may close the terminal and the outputs. The emulator must continue.
#[test]
fn a_detached_emulator_has_left_its_terminal_and_outputs() {
    let instance = Background::new();
    let outcome = instance.run("run", &["--detach"]);
    let pid = outcome.ok().split("process ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    assert_eq!(stat(&pid)[3], pid, "it leads its own session");
    for output in ["0", "1", "2"] {
        let file = std::fs::read_link(format!("/proc/{pid}/fd/{output}")).unwrap();
        assert_eq!(file, PathBuf::from("/dev/null"));
    }
}

/// A shell may hold a lock, or the end of a pipe, in a descriptor of its own. The plant may be the output of a command.
#[test]
fn a_detached_emulator_keeps_no_descriptor_of_its_starter() {
    let instance = Background::new();
    let folder = tempfile::tempdir().unwrap();
    let script = "exec 9>lock && flock 9 || exit 9
        $0 run <($0 new -) --detach --web=127.0.0.1:0 -i $1 >/dev/null || exit 8
        exec 9>&-
        flock --nonblock lock true; echo lock $?";
    let mut command = Command::new("bash");
    command.args(["-c", script, program(), &instance.0]).current_dir(folder.path());
    assert_eq!(finish(&mut command).ok(), "lock 0\n");
    assert_eq!(instance.run("peek", &["--raw", "node2.w_OPTION_STATUS"]).ok(), "16#0001\n");
}

#[test]
fn later_messages_of_a_detached_emulator_go_to_its_log() {
    let instance = Background::new();
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    instance.run("run", &["--detach", "--log", log.to_str().unwrap()]).ok();
    let image = format!("/dev/shm/commram.{}.line", instance.0);
    std::fs::OpenOptions::new().write(true).open(image).unwrap().set_len(0).unwrap();
    let log_text = || std::fs::read_to_string(&log).unwrap_or_default();
    assert!(eventually(|| log_text().contains("another program has shortened it")), "{}", log_text());
    let alone = run(&["run", "--log", "x"]);
    assert!(alone.fails(2).contains("--detach"), "{}", alone.err);
}

/// Root can use a file without permissions, so the check must not depend on a refused access.
#[test]
fn a_start_without_the_permissions_of_the_owner_is_refused() {
    for mask in ["777", "277", "100"] {
        let instance = Background::new();
        let script = format!("umask {mask}; exec $0 run --detach -i {}", instance.0);
        let outcome = finish(Command::new("sh").args(["-c", &script, program()]));
        let message = outcome.fails(1);
        assert!(message.contains(&format!("mask is {mask}")) && message.contains("`umask 077`"), "{message}");
        assert_eq!(files_of(&instance.0), Vec::<PathBuf>::new());
    }
}

#[test]
fn a_failed_start_prints_its_reason_in_foreground_and_background() {
    let instance = Background::new();
    instance.run("run", &["--detach"]).ok();
    for args in [&[][..], &["no-such-plant.toml"], &["--speed", "0"], &["--clock", "stepped", "--speed", "2"]]
    {
        let here = instance.run("run", args);
        let detached = instance.run("run", &[&["--detach"], args].concat());
        assert_ne!(here.code, Some(0));
        assert_eq!(
            (here.code, &here.out, &here.err),
            (detached.code, &detached.out, &detached.err),
            "{args:?}"
        );
    }
}

#[test]
fn clients_wait_for_an_emulator_that_is_just_starting() {
    let place = Place::new();
    let folder = &[&*place.path("plant.toml")];
    for (plant, command, args) in [
        (&[][..], "peek", &["node2.w_OPTION_STATUS"][..]),
        (&[], "poke", &["node2.w_CPU_CONTROL=0"]),
        (&[], "wait", &["node2.w_OPTION_STATUS==1"]),
        // Only the instance knows these names.
        (folder, "peek", &["data.w_OUT"]),
        (folder, "dump", &["data.*"]),
    ] {
        let instance = Background::new();
        let mut client = commram();
        client.arg(command).args(args).args(["-i", &instance.0, "--connect-timeout", "1min"]);
        let client = client.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        instance.run("run", &[plant, &["--detach"]].concat()).ok();
        let output = client.wait_with_output().unwrap();
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// The test does what a new user types: a start in the background, and at once a command.
#[test]
fn a_command_right_after_a_background_start_works() {
    let instance = Background::new();
    let script = format!("'{0}' run >/dev/null 2>&1 & '{0}' peek --raw node2.w_OPTION_STATUS", program());
    let mut shell = Command::new("sh");
    // Waits longer than the default, because the machine may be busy with tests.
    shell.args(["-c", &script]).env("COMMRAM_INSTANCE", &instance.0).env("COMMRAM_CONNECT_TIMEOUT", "1min");
    assert_eq!(finish(&mut shell).ok(), "16#0001\n");
}

/// Clients must not mistake the files of a killed emulator for those of the emulator that takes them over.
#[test]
fn clients_wait_for_the_successor_of_a_killed_one() {
    let instance = Background::new();
    let started = instance.run("run", &["--detach", "--clock", "stepped"]);
    let pid = started.ok().split("process ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    assert!(Command::new("kill").args(["-KILL", &pid]).status().unwrap().success());
    assert!(eventually(|| instance.run("step", &["1ms"]).code == Some(3)));
    // The new emulator takes the locks first. Until it has written its process id into the image, the image contains
    // that of the killed emulator.
    let lock = commram::memory::InstanceLock::take(&instance.0).unwrap();
    let image = std::fs::File::open(format!("/dev/shm/commram.{}.line", instance.0)).unwrap();
    image.lock().unwrap();
    let in_between = instance.run("step", &["1ms", "--connect-timeout", "50ms"]);
    assert!(
        in_between.fails(3).contains(&format!("its emulator (process {pid}) was killed")),
        "{in_between:?}"
    );
    drop((image, lock));
    let mut client = commram();
    client.args(["step", "1ms", "-i", &instance.0, "--connect-timeout", "1min"]).stdout(Stdio::piped());
    let client = client.spawn().unwrap();
    let again = instance.run("run", &["--detach", "--clock", "stepped"]);
    assert_eq!(again.code, Some(0), "{}", again.err);
    assert!(again.err.contains("took over"), "{}", again.err);
    assert_eq!(client.wait_with_output().unwrap().stdout, b"0.001000 s\n");
}

fn with(args: &[&str], script: &str) -> Outcome {
    finish(commram().arg("with").args(args).args(["--", "sh", "-c", script]).env("COMMRAM", program()))
}

#[test]
fn with_gives_a_command_an_emulator_and_ends_with_its_exit_code() {
    let outcome = with(
        &["--clock", "stepped"],
        "$COMMRAM peek --raw node2.w_OPTION_STATUS; echo $COMMRAM_INSTANCE; exit 42",
    );
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(42), ""));
    let (value, name) = outcome.out.split_once('\n').unwrap();
    assert_eq!(value, "16#0001");
    assert!(name.starts_with("with-"), "{name}");
    assert_eq!(files_of(name.trim_end()), Vec::<PathBuf>::new());
    assert_eq!(with(&[], "true").ok(), "");
    assert_eq!(with(&[], "kill -KILL $$").code, Some(128 + 9));
}

/// Processes in different containers can have the same process id.
#[test]
fn names_that_with_chooses_differ_although_the_process_ids_are_equal() {
    let name = || {
        let mut shell = Command::new("unshare");
        shell.args(["--pid", "--fork", "--kill-child", "--mount-proc"]).arg(commram().get_program());
        finish(shell.args(["with", "--clock", "stepped", "--", "sh", "-c", "echo $COMMRAM_INSTANCE"]))
    };
    let [one, other] = [name(), name()];
    if one.err.contains("unshare: ") {
        eprintln!("SKIPPED: no PID namespace: {}", one.err);
        return;
    }
    assert!(one.ok().starts_with("with-1-") && other.ok().starts_with("with-1-"), "{one:?} {other:?}");
    assert_ne!(one.out, other.out);
}

#[test]
fn with_takes_plant_and_name_and_exports_the_name() {
    let name = unique_name();
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/examples/plant.toml");
    let outcome =
        with(&[plant, "-i", &name], "echo $COMMRAM_INSTANCE; ls /dev/shm/commram.$COMMRAM_INSTANCE.cell");
    assert_eq!(outcome.ok(), format!("{name}\n/dev/shm/commram.{name}.cell\n"));
}

/// A name in the environment or an enclosing `with` does not interfere.
#[test]
fn a_nested_with_has_a_separate_name() {
    let outcome = with(&[], "echo $COMMRAM_INSTANCE; $COMMRAM with -- sh -c 'echo $COMMRAM_INSTANCE'");
    let names: Vec<_> = outcome.ok().lines().collect();
    assert_eq!(names.len(), 2);
    assert_ne!(names[0], names[1]);
}

#[test]
fn with_reports_wrong_use() {
    let nowhere = finish(commram().args(["with", "--", "./no-such-program"]));
    assert!(nowhere.fails(127).contains("cannot run ./no-such-program"), "{}", nowhere.err);
    let folder = finish(commram().args(["with", "--", "/"]));
    assert!(folder.fails(126).contains("cannot run /"), "{}", folder.err);
    assert!(with(&["no-such-plant.toml"], "true").fails(2).contains("no-such-plant.toml"));
    assert!(run(&["with"]).fails(2).contains("COMMAND"));
    let taken = unique_name();
    let outcome = with(&["-i", &taken], &format!("$COMMRAM with -i {taken} -- true"));
    assert!(outcome.fails(1).contains("is already running"), "{}", outcome.err);
}

#[test]
fn with_passes_signals_on_and_cleans_up() {
    for (signal, code) in [("-TERM", 43), ("-INT", 44), ("-HUP", 45)] {
        let script = "trap 'exit 43' TERM; trap 'exit 44' INT; trap 'exit 45' HUP; echo $COMMRAM_INSTANCE; \
                      while :; do sleep 0.01; done";
        let mut command = commram();
        command.args(["with", "--", "sh", "-c", script]).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let name = lines.next().unwrap().unwrap();
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        assert_eq!(wait_for(&mut child, "with").code(), Some(code), "{signal}");
        assert_eq!(files_of(&name), Vec::<PathBuf>::new());
    }
}

/// The command may run as another user, who must not get the files of the channel.
#[test]
fn the_command_of_with_inherits_no_file_of_the_channel() {
    let script = "for file in /proc/self/fd/*; do readlink $file; done | grep -v '^/proc/\\|^pipe:\\|^/dev/null'; echo $(cat <&7)";
    let shell = "echo seven | { exec 7<&0; exec $COMMRAM with -- sh -c \"$1\" </dev/null; }";
    let mut command = Command::new("sh");
    let outcome = finish(command.args(["-c", shell, "sh", script]).env("COMMRAM", program()));
    assert_eq!(outcome.ok(), "seven\n");
}

#[test]
fn with_ends_although_its_command_is_suspended() {
    let mut command = commram();
    command.args(["with", "--", "sh", "-c", "echo $$; kill -STOP $$"]).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let suspended = lines.next().unwrap().unwrap();
    assert!(eventually(|| stat(&suspended)[0] == "T"));
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(wait_for(&mut child, "with").code(), Some(128 + 15));
}

#[test]
fn with_waits_for_its_command_although_the_emulator_was_ended() {
    let outcome = with(&[], "$COMMRAM stop -i $COMMRAM_INSTANCE && exit 7");
    assert_eq!(outcome.code, Some(7));
    assert!(outcome.err.contains("has ended before the command"), "{}", outcome.err);
}

/// A stop sends a signal to the process of `with` if the channel is damaged, or if other stops run at the same time.
#[test]
fn stops_of_every_kind_leave_the_command_of_with_alone() {
    let without_channel = "sed -n 's|.* \\(/dev/shm/commram_.*[.]data\\)$|\\1|p' /proc/$PPID/maps | sort -u | \
         while read file; do : >$file; done; $COMMRAM stop; sleep 0.2; exit 7";
    let at_once =
        "for n in 1 2 3 4 5; do $COMMRAM stop & stops=\"$stops $!\"; done; wait $stops; sleep 0.2; exit 7";
    for script in [without_channel, at_once, at_once] {
        let outcome = with(&["--clock", "stepped"], script);
        assert_eq!(outcome.code, Some(7), "{script}: {outcome:?}");
        assert!(outcome.err.contains("has ended before the command"), "{}", outcome.err);
    }
}

#[test]
fn the_signal_of_a_stop_ends_only_the_emulator_of_with() {
    let name = unique_name();
    let mut command = commram();
    command.args(["with", "-i", &name, "--", "sh", "-c", "echo begins; read line; exit 7"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert_eq!(lines.next().unwrap().unwrap(), "begins");
    let emulator = commram::memory::RunningInstance::find(&name).unwrap().unwrap();
    emulator.process().unwrap().terminate().unwrap();
    while !emulator.has_ended() {
        emulator.wait(Duration::from_millis(10));
    }
    drop(child.stdin.take());
    assert_eq!(wait_for(&mut child, "with").code(), Some(7));
}

/// Each PLC uses several files. The emulator requests the maximum that is allowed, and reports an error if that is
/// not enough.
#[test]
fn too_many_plcs_for_the_open_file_limit_are_refused() {
    let instance = Background::new();
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    let plcs = (0..3).map(|plc| format!("[[plc]]\nname = 'p{plc}'\n")).collect::<String>();
    std::fs::write(&plant, plcs).unwrap();
    let run = |hard: u32, arguments: &[&str]| {
        let limited = format!("ulimit -Sn 30 && ulimit -Hn {hard} && exec \"$@\"");
        let mut command = Command::new("sh");
        command.args(["-c", &limited, "sh", program(), "run", "-i", &instance.0]);
        finish(command.arg(&plant).args(arguments))
    };
    let refused = run(34, &[]);
    let message = refused.fails(1);
    let named = ["an emulator with 3 PLCs has ", " open files, and this process may have 34"];
    assert!(named.iter().all(|part| message.contains(part)), "{message}");
    run(200, &["--detach"]).ok();
}
