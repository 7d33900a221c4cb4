//! Many clients that stop one emulator at the same time, emulators with the same name, and damaged instance
//! directories.

use crate::common::{
    Emulator, Outcome, commram, eventually, files_of, finish, in_mount_namespace, promised, remove_remains,
    run, unique_name, wait_for,
};
use commram::memory::{AttachMode, Image, RunningInstance, State};
use rustix::fs::{Mode, OFlags};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs;
use std::io::{PipeWriter, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// Number of clients that stop one emulator.
const CLIENTS: usize = 6;
/// Environment variable: if it is set, the test runs all combinations instead of a selection, which takes minutes.
const ALL: &str = "COMMRAM_ATTACK_ALL";

const NOTHING: Vec<PathBuf> = Vec::new();

fn spawn(mut command: Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn outcome(child: Child) -> Outcome {
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Outcome { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// A client that arrives after the end finds no instance. All other clients report an orderly end.
#[track_caller]
fn assert_has_stopped(outcome: &Outcome) {
    let is_late = outcome.code == Some(3) && outcome.err.contains("is not running");
    assert!(is_late || outcome.code == Some(0), "{outcome:?}");
    assert!(!outcome.err.contains("was killed"), "{outcome:?}");
}

#[test]
fn many_stops_at_once_are_one_orderly_end() {
    for round in 0..6 {
        let mut emulator = Emulator::start(&["--clock", ["stepped", "realtime"][round % 2]]);
        let clean: &[&str] = if round % 3 == 2 { &["--clean"] } else { &[] };
        let clients: Vec<_> = (0..CLIENTS).map(|_| spawn(emulator.command("stop", clean))).collect();
        clients.into_iter().map(outcome).for_each(|it| assert_has_stopped(&it));
        assert_eq!(emulator.wait().code(), Some(0), "round {round}");
        assert!(eventually(|| emulator.files().is_empty()), "{:?}", emulator.files());
        assert_eq!(emulator.complaints(), "");
    }
}

/// The directory of the instance is removed, and the lock of its name with it. The emulator still holds the locks of
/// the images.
#[test]
fn a_start_beside_an_emulator_without_its_directory_names_the_instance() {
    let emulator = Emulator::stepped();
    fs::remove_dir_all(format!("/dev/shm/commram.{}.iox.d", emulator.name)).unwrap();
    let refused = finish(commram().args(["run", "-i", &emulator.name]));
    let begin =
        format!("commram: instance '{}' is already running (process {}), ", emulator.name, emulator.pid());
    assert!(refused.fails(1).starts_with(&begin) && refused.err.contains("PLC 'line'"), "{}", refused.err);
    assert_eq!(emulator.run("stop", &[]).code, Some(0));
}

#[test]
fn signals_of_other_processes_never_cut_the_end_short() {
    for (first, code) in [("-TERM", 0), ("-INT", 130), ("-HUP", 0)] {
        let mut emulator = Emulator::start(&[]);
        let stops: Vec<_> = (0..2).map(|_| spawn(emulator.command("stop", &[]))).collect();
        let pid = emulator.pid().to_string();
        let kill = |signal: &str| Command::new("kill").args([signal, &pid]).stderr(Stdio::null()).status();
        for signal in [first, "-TERM", "-INT", "-INT", "-HUP", "-TERM"] {
            kill(signal).unwrap();
        }
        stops.into_iter().map(outcome).for_each(|it| assert_has_stopped(&it));
        // The machine's load decides which signal arrives first.
        let status = emulator.wait();
        assert!(status.code() == Some(code) || [Some(0), Some(130)].contains(&status.code()), "{status}");
        assert!(eventually(|| emulator.files().is_empty()), "{:?}", emulator.files());
    }
}

/// Clients that find no channel signal again and again until the emulator has ended.
#[test]
fn signals_without_end_are_one_orderly_end() {
    let mut emulator = Emulator::stepped();
    let callers: Vec<_> = (0..10).map(|_| RunningInstance::find(&emulator.name).unwrap().unwrap()).collect();
    std::thread::scope(|scope| {
        for caller in &callers {
            scope.spawn(|| {
                while !caller.has_ended() {
                    caller.process().unwrap().terminate().unwrap();
                }
            });
        }
    });
    assert_eq!(emulator.wait().code(), Some(0));
    assert!(callers.iter().all(|caller| caller.has_ended() && !caller.has_left_files()));
    assert_eq!(emulator.files(), NOTHING);
}

/// An emulator needs only some milliseconds to end. So the test suspends the emulator during this time, and repeats a
/// trial in which the suspension came too late.
#[test]
fn only_a_second_ctrl_c_at_the_terminal_cuts_the_end_short() {
    for is_pressed_again in [false, true] {
        let status = (0..50).find_map(|_| status_after_an_interrupted_end(is_pressed_again));
        let status = status.expect("an emulator that is suspended while it ends");
        let expected = if is_pressed_again { (None, Some(2)) } else { (Some(130), None) };
        assert_eq!((status.code(), status.signal()), expected);
    }
}

/// Ends an emulator by Ctrl-C, suspends it in its end, and sends it the key or signals of other processes. `None` if it
/// ended before.
fn status_after_an_interrupted_end(is_pressed_again: bool) -> Option<ExitStatus> {
    let (name, terminal) = (unique_name(), Terminal::new());
    let (_reader, writer) = std::io::pipe().unwrap();
    // The emulator waits some milliseconds for the full pipe when it prints the message about the missing image.
    fill(&writer);
    let mut command = Command::new("setsid");
    command.args(["--ctty", commram().get_program().to_str().unwrap(), "run", "-i", &name]);
    command.stdin(terminal.slave()).stdout(Stdio::null()).stderr(writer);
    let mut child = command.spawn().unwrap();
    drop(command);
    let mut image = None;
    let is_ready = || {
        image = Image::attach(&name, "line", AttachMode::ReadOnly, None).ok();
        image.is_some()
    };
    assert!(eventually(is_ready), "no image");
    let image = image.unwrap();
    fs::remove_file(format!("/dev/shm/commram.{name}.line")).unwrap();
    let pid = Pid::from_child(&child);
    terminal.press_ctrl_c();
    let is_ending = || State::from_code(image.header_snapshot().state.load()).is_some_and(State::is_ending);
    while !is_ending() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    kill_process(pid, Signal::STOP).ok()?;
    let stat = PathBuf::from(format!("/proc/{}/stat", child.id()));
    let state = || fs::read_to_string(&stat).ok().and_then(|stat| stat.rsplit(") ").next()?.chars().next());
    assert!(eventually(|| state().is_none_or(|state| "TZ".contains(state))));
    let is_suspended = state() == Some('T');
    if is_suspended && is_pressed_again {
        terminal.press_ctrl_c();
    } else if is_suspended {
        for signal in [Signal::INT, Signal::TERM, Signal::HUP] {
            kill_process(pid, signal).unwrap();
        }
    }
    let _ = kill_process(pid, Signal::CONT);
    let status = wait_for(&mut child, "an emulator that ends");
    if status.code().is_some() {
        assert_eq!(files_of(&name), NOTHING);
    }
    remove_remains(&name);
    is_suspended.then_some(status)
}

/// A pseudo-terminal and its user.
struct Terminal(OwnedFd);

impl Terminal {
    fn new() -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        Self(master)
    }

    fn slave(&self) -> fs::File {
        let path = ptsname(&self.0, Vec::new()).unwrap();
        let slave = rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty());
        slave.unwrap().into()
    }

    fn press_ctrl_c(&self) {
        assert_eq!(rustix::io::write(&self.0, b"\x03"), Ok(1));
    }
}

/// Writes to a pipe until it is full.
fn fill(writer: &PipeWriter) {
    let flags = rustix::fs::fcntl_getfl(writer).unwrap();
    rustix::fs::fcntl_setfl(writer, flags | OFlags::NONBLOCK).unwrap();
    let mut writing = writer;
    while writing.write(&[b'.'; 4096]).is_ok() {}
    rustix::fs::fcntl_setfl(writer, flags).unwrap();
}

/// The first client stops all emulators while the others still search. Runs in a separate `/dev/shm`, because it
/// stops all emulators that it finds.
#[test]
fn all_kinds_of_stop_and_a_dying_parent_are_one_orderly_end() {
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        directory=$(mktemp -d); trap 'rm -r $directory' EXIT
        for round in 1 2 3; do
            sh -c '$COMMRAM run --parent $$ -i one >'$directory'/ready; echo $? >'$directory'/code; :' & parent=$!
            until grep -q ready $directory/ready 2>/dev/null; do sleep 0.01; done
            pid=$($COMMRAM list --format csv | sed -n 's/^one,[^,]*,\\([0-9]*\\),.*/\\1/p')
            clients=
            for act in 'stop -i one' 'stop --all' 'stop --all --clean' 'stop -i one' 'stop --clean -i one'; do
                output=$(mktemp $directory/output.XXXXXX)
                { $COMMRAM $act >$output 2>&1; code=$?
                  [ $code = 0 ] || { [ $code = 3 ] && grep -q 'is not running' $output; } || echo \"$act: $code, $(cat $output)\"; } &
                clients=\"$clients $!\"
            done
            kill -TERM $pid 2>/dev/null; kill -INT $pid 2>/dev/null; kill -TERM $pid 2>/dev/null
            wait $clients; wait $parent
            case $(cat $directory/code) in 0|130) ;; *) echo \"emulator: $(cat $directory/code)\";; esac
            rm $directory/*; ls /dev/shm
        done";
    let Some(outcome) = in_mount_namespace(script, None) else { return };
    assert_eq!(outcome.ok(), "");
}

/// A supervisor starts the next emulator as soon as the name is free.
#[test]
fn stop_does_not_wait_for_the_next_emulator_of_that_name() {
    let mut first = Emulator::stepped();
    let name = first.name.clone();
    let stop = spawn(first.command("stop", &[]));
    let next = loop {
        let outcome = finish(&mut first.command("run", &["--detach", "--clock", "stepped"]));
        if outcome.code == Some(0) {
            break outcome;
        }
        assert!(outcome.err.contains("is already running"), "{outcome:?}");
    };
    let outcome = promised(Duration::from_secs(2), || outcome(stop));
    assert_eq!(outcome.ok(), format!("instance '{name}' has stopped\n"));
    assert_eq!(first.wait().code(), Some(0));
    assert!(next.out.contains("continues in the background"), "{}", next.out);
    first.run("status", &[]).ok();
    first.run("stop", &[]).ok();
    assert_eq!(first.files(), NOTHING);
}

/// A way to damage a file.
#[derive(Clone, Copy, Debug)]
enum Damage {
    Emptied,
    Shortened,
    /// Another file with the same name and other content replaces the file.
    Replaced,
    /// A directory, a pipe or a link of this name.
    Odd,
    Removed,
}

const DAMAGES: [Damage; 5] =
    [Damage::Emptied, Damage::Shortened, Damage::Replaced, Damage::Odd, Damage::Removed];

impl Damage {
    /// Damages the file at this path, or all files below it.
    fn hit(self, path: &Path) {
        if let (Self::Odd, true) = (self, path.is_dir()) {
            fs::remove_dir_all(path).unwrap();
            fs::write(path, "").unwrap();
        }
        if path.is_dir() {
            for entry in fs::read_dir(path).unwrap().flatten() {
                self.hit(&entry.path());
            }
            return;
        }
        let set_length =
            |length| fs::File::options().write(true).open(path).unwrap().set_len(length).unwrap();
        match self {
            Self::Emptied => set_length(0),
            Self::Shortened => set_length(path.metadata().unwrap().len() / 2),
            Self::Replaced => {
                fs::remove_file(path).unwrap();
                fs::write(path, "1 1\n").unwrap();
            }
            Self::Odd => {
                fs::remove_file(path).unwrap();
                match path.file_name().unwrap().len() % 3 {
                    0 => fs::create_dir(path).unwrap(),
                    1 => symlink("/nowhere", path).unwrap(),
                    _ => assert!(Command::new("mkfifo").arg(path).status().unwrap().success()),
                }
            }
            Self::Removed => fs::remove_file(path).unwrap(),
        }
    }
}

/// State of the emulator's process during the damage.
#[derive(Clone, Copy, Debug)]
enum ProcessState {
    Running,
    Stopped,
    Dying,
}

/// Returns the entries of the directory. The files of iceoryx2 are in two of them.
fn parts(directory: &Path) -> Vec<PathBuf> {
    let mut parts: Vec<_> = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    parts.sort();
    parts
}

#[test]
fn stop_and_clean_reach_the_emulator_despite_damaged_instance_files() {
    let all = std::env::var_os(ALL).is_some();
    let count = parts(&directory(&Emulator::stepped())).len();
    assert!(count >= 4, "lock, prefix, ready and what iceoryx2 has made");
    let mut case = 0;
    for subset in 1..1_u32 << count {
        for state in [ProcessState::Running, ProcessState::Stopped, ProcessState::Dying] {
            for damage in DAMAGES {
                case += 1;
                // The test combines each subset of the files with each state of the process, and each combination with
                // one of the damages. The lock file is combined with every damage.
                if all || case % 15 == (subset % 5) * 3 {
                    reach(subset, damage, state);
                }
            }
        }
    }
}

fn directory(emulator: &Emulator) -> PathBuf {
    format!("/dev/shm/commram.{}.iox.d", emulator.name).into()
}

fn reach(subset: u32, damage: Damage, state: ProcessState) {
    let mut emulator = Emulator::stepped();
    let parts = parts(&directory(&emulator));
    let hit: Vec<_> = (0..).zip(&parts).filter(|(n, _)| subset >> n & 1 != 0).map(|(_, path)| path).collect();
    let what = format!("{hit:?} {damage:?}, {state:?}");
    if let ProcessState::Stopped = state {
        emulator.signal("-STOP");
    }
    hit.iter().for_each(|path| damage.hit(path));
    if let ProcessState::Dying = state {
        // The parent process does not wait for the killed process, which remains a zombie.
        emulator.signal("-KILL");
    }
    let stop = promised(Duration::from_secs(2), || emulator.run("stop", &[]));
    let clean = || emulator.run("stop", &["--clean"]);
    match state {
        ProcessState::Dying => {
            assert!(stop.code == Some(3) && stop.err.contains("is dead"), "{what}: {stop:?}");
            let clean = promised(Duration::from_secs(2), clean);
            assert_eq!(clean.code, Some(0), "{what}: {clean:?}");
            emulator.kill();
        }
        ProcessState::Running | ProcessState::Stopped => {
            assert_eq!(stop.code, Some(0), "{what}: {stop:?}");
            // The emulator may refuse to remove some damaged parts of the channel.
            clean();
            assert_eq!(emulator.wait().code(), Some(0), "{what}");
        }
    }
    assert_eq!(emulator.files(), NOTHING, "{what}");
}

/// Runs in a separate `/dev/shm`, because `--all` ends all emulators with files in it. The second directory has no
/// lock.
#[test]
fn a_held_lock_in_a_directory_open_to_others_shows_the_emulator() {
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        for stop in 'stop -i one' 'stop --all' 'stop --clean -i one'; do
            $COMMRAM run --detach --clock stepped -i one >/dev/null
            rm /dev/shm/commram.one.line; chmod 777 /dev/shm/commram.one.iox.d
            $COMMRAM $stop || echo \"$stop: $?\"
            ls /dev/shm
        done
        mkdir -m 777 /dev/shm/commram.two.iox.d
        for stop in 'stop -i two' 'stop --all' 'stop --clean -i two' 'stop --all --clean'; do
            answer=$($COMMRAM $stop 2>&1); code=$?
            case \"$code $answer\" in
                '1 '*'/dev/shm/commram.two.iox.d can be written by other users'*) ;;
                *) echo \"$stop: $code $answer\";;
            esac
        done";
    let Some(outcome) = in_mount_namespace(script, None) else { return };
    assert_eq!(outcome.ok(), "instance 'one' has stopped\n".repeat(3));
}

/// A lock file may contain any process ID; only the kernel has the real holder of the lock.
#[test]
fn a_process_that_a_damaged_file_names_is_not_signalled() {
    let mut bystander = Command::new("sleep").arg("600").spawn().unwrap();
    let stat = crate::common::stat(&bystander.id().to_string());
    for damage_directory in [true, false] {
        let mut emulator = Emulator::stepped();
        let image = Image::attach(&emulator.name, "line", AttachMode::ReadWrite, None).unwrap();
        image.header().unwrap().firmware_pid.store(bystander.id());
        image.header().unwrap().firmware_start.store(stat[19].parse().unwrap());
        match damage_directory {
            true => fs::remove_dir_all(directory(&emulator)).unwrap(),
            false => {
                let lock = format!("{} {}\n", bystander.id(), stat[19]);
                fs::write(directory(&emulator).join("lock"), lock).unwrap();
                fs::write(directory(&emulator).join("prefix"), "").unwrap();
            }
        }
        drop(image);
        let outcome = emulator.run("stop", &[]);
        let lives = bystander.try_wait().unwrap().is_none();
        assert_eq!(outcome.ok(), format!("instance '{}' has stopped\n", emulator.name));
        assert!(lives);
        assert_eq!(emulator.wait().code(), Some(0));
        emulator.run("stop", &["--clean"]);
        assert_eq!(emulator.files(), NOTHING);
    }
    let _ = bystander.kill();
    let _ = bystander.wait();
}

/// A signal waits 1 s for the end of a start. The scripts of the devices make this start longer.
#[test]
fn a_signal_during_a_long_start_leaves_no_files() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("slow");
    run(&["new", "--template", "device", folder.to_str().unwrap()]).ok();
    let firmware = fs::read_to_string(folder.join("firmware.rhai")).unwrap();
    let slow = "fn power_on() { let n = 0; while n < 100000 { n += 1; }";
    fs::write(folder.join("firmware.rhai"), firmware.replace("fn power_on() {", slow)).unwrap();
    let plant = place.path().join("plant.toml");
    let device = |number| format!("[[device]]\nkind = \"./slow\"\nname = \"p{number}\"\n");
    fs::write(&plant, (1..=14).map(device).collect::<String>()).unwrap();
    let (new, empty) = (place.path().join("new"), place.path().join("empty"));
    fs::create_dir(&empty).unwrap();
    let directories = [new.join("inner"), empty.clone()];
    for (way, novram) in ["-TERM", "-INT", "-HUP", "stop"].into_iter().zip(directories.iter().cycle()) {
        let name = unique_name();
        let mut command = commram();
        command.args(["run", "--clock", "stepped", "-i", &name]).arg(&plant).arg("--novram").arg(novram);
        let mut emulator = spawn(command);
        let image = PathBuf::from(format!("/dev/shm/commram.{name}.p1"));
        assert!(eventually(|| image.exists() && novram.join(".lock").exists()));
        match way {
            "stop" => {
                let outcome = run(&["stop", "-i", &name]);
                assert_eq!(outcome.ok(), format!("instance '{name}' has stopped\n"));
            }
            signal => {
                let pid = emulator.id().to_string();
                assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
            }
        }
        wait_for(&mut emulator, "the emulator");
        assert_eq!(files_of(&name), NOTHING, "{way}");
        assert!(!new.exists(), "{way}");
        assert_eq!(fs::read_dir(&empty).unwrap().count(), 0, "{way}");
    }
}

/// The emulator ends in good order, but it cannot remove an image with another name.
#[test]
fn an_instance_with_a_renamed_image_ends_in_good_order() {
    for clean in [true, false] {
        let emulator = Emulator::stepped();
        let image = PathBuf::from(format!("/dev/shm/commram.{}.line", emulator.name));
        let renamed = image.with_extension("line2");
        fs::rename(&image, &renamed).unwrap();
        let stopped = emulator.run("stop", if clean { &["--clean"] } else { &[] });
        assert_eq!(stopped.code, Some(0), "{stopped:?}");
        assert_eq!(stopped.out, format!("instance '{}' has stopped\n", emulator.name));
        let note = format!("{} remains: another program has renamed this image", renamed.display());
        assert_eq!(stopped.err.contains(&note), !clean, "{}", stopped.err);
        assert_eq!(renamed.exists(), !clean);
        emulator.run("stop", &["--clean"]);
        assert_eq!(files_of(&emulator.name), NOTHING);
    }
}

/// A copy of `/dev/shm` by hard links (`cp -al`) gives files of a running emulator a second name.
#[test]
fn an_instance_is_not_ended_under_the_name_of_another_one() {
    for is_image in [true, false] {
        let (emulator, other) = (Emulator::stepped(), unique_name());
        let of_other = PathBuf::from(format!("/dev/shm/commram.{other}.iox.d"));
        let (file, link) = match is_image {
            true => (
                format!("/dev/shm/commram.{}.line", emulator.name).into(),
                format!("/dev/shm/commram.{other}.line").into(),
            ),
            false => (directory(&emulator).join("lock"), of_other.join("lock")),
        };
        if !is_image {
            fs::DirBuilder::new().mode(0o700).create(&of_other).unwrap();
        }
        fs::hard_link(file, &link).unwrap();
        let expected = format!("{} is a file of instance '{}'", link.display(), emulator.name);
        let status = ["status", "-i", &other];
        for (arguments, code) in [
            (&["stop", "-i", &other][..], 3),
            (&["stop", "--clean", "-i", &other], 3),
            (&status, 3),
            (&["run", "-i", &other], 1),
        ] {
            let outcome = run(arguments);
            assert!(outcome.fails(code).contains(&expected), "{arguments:?}: {}", outcome.err);
        }
        assert_eq!(run(&["list"]).ok().contains(&format!("{other}: {expected}")), is_image);
        emulator.step(&["1ms"]);
        assert_eq!(emulator.run("stop", &[]).ok(), format!("instance '{}' has stopped\n", emulator.name));
        run(&["stop", "--clean", "-i", &other]);
        assert_eq!(files_of(&other), NOTHING);
    }
}

/// Any program of this user can lock the files of a killed emulator.
#[test]
fn a_process_that_locks_the_files_of_a_killed_emulator_is_not_signalled() {
    for name in ["lock", "image"] {
        let mut emulator = Emulator::stepped();
        let path = match name {
            "lock" => directory(&emulator).join("lock"),
            _ => Path::new("/dev/shm").join(format!("commram.{}.line", emulator.name)),
        };
        emulator.kill();
        let mut other = Command::new("flock");
        let mut other = other
            .arg("--no-fork")
            .arg(&path)
            .args(["sh", "-c", "echo; exec sleep 600"])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        std::io::Read::read_exact(&mut other.stdout.take().unwrap(), &mut [0]).unwrap();
        for arguments in [&[][..], &["--clean"]] {
            let outcome = emulator.run("stop", arguments);
            assert_eq!(outcome.code, Some(3), "{outcome:?}");
            assert!(outcome.err.contains(&format!("process {}", other.id())), "{}", outcome.err);
            assert!(other.try_wait().unwrap().is_none(), "{name} {arguments:?}");
        }
        let _ = other.kill();
        let _ = other.wait();
        emulator.run("stop", &["--clean"]).ok();
        assert_eq!(emulator.files(), NOTHING);
    }
}

/// Several clients remove the files of a killed emulator together.
#[test]
fn many_cleaning_clients_do_not_end_each_other() {
    for _ in 0..3 {
        let mut emulator = Emulator::stepped();
        emulator.kill();
        let clients = (0..CLIENTS).map(|n| spawn(emulator.command("stop", &["--clean"][n % 2..])));
        for outcome in clients.collect::<Vec<_>>().into_iter().map(outcome) {
            // One of the clients removes the files; for the other clients the emulator is dead or does not exist.
            assert!(matches!(outcome.code, Some(0 | 3)), "{outcome:?}");
        }
        assert_eq!(files_of(&emulator.name), NOTHING);
    }
}

#[test]
fn the_last_client_removes_files_with_a_damaged_lock() {
    let name = unique_name();
    let directory = PathBuf::from(format!("/dev/shm/commram.{name}.iox.d"));
    fs::create_dir_all(directory.join("lock/deep")).unwrap();
    let outcome = finish(commram().args(["stop", "--clean", "-i", &name]));
    let left = files_of(&name);
    remove_remains(&name);
    assert_eq!(outcome.ok(), format!("instance '{name}' was dead, its files are removed\n"));
    assert_eq!(left, NOTHING);
}
