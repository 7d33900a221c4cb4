//! Emulators and clients that are killed, stopped or damaged, and the files that they leave.

use crate::common::{
    Emulator, Outcome, commram, eventually, files_of, finish, in_mount_namespace, promised, remove_remains,
    run, stat, unique_name,
};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ExitStatus, Stdio};
use std::time::Duration;

/// Stops an emulator within the promised time.
fn stop(emulator: &mut Emulator) -> (Outcome, ExitStatus) {
    promised(Duration::from_secs(2), || (emulator.run("stop", &[]), emulator.wait()))
}

/// Starts a shell of the emulator, and enters its first line.
fn shell_with(emulator: &Emulator, line: &str) -> (Child, ChildStdin) {
    let mut command = emulator.command("shell", &[]);
    let mut shell =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut input = shell.stdin.take().unwrap();
    writeln!(input, "{line}").unwrap();
    (shell, input)
}

#[test]
fn a_killed_client_does_not_disturb_the_others() {
    let emulator = Emulator::start(&[]);
    let wait = || emulator.command("wait", &["node2.w_OPTION_STATUS==16#0002", "--within", "1h"]);
    let mut waiting = wait();
    let patient = std::thread::spawn(move || finish(&mut waiting));
    let spawn = || wait().stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let mut clients: Vec<_> = (0..3).map(|_| spawn()).collect();
    emulator.peek(&["node2.w_OPTION_STATUS"]);
    for client in &mut clients {
        client.kill().unwrap();
        client.wait().unwrap();
    }
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    emulator.run("wait", &["node2.w_OPTION_STATUS==16#0002", "--within", "10s"]).ok();
    patient.join().unwrap().ok();
}

/// The snapshots of `save` end with the shell that keeps them, whether it was killed or has ended.
#[test]
fn snapshots_of_an_ended_shell_take_no_place() {
    let emulator = Emulator::stepped();
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("a.snap").display().to_string();
    for is_killed in [true, false] {
        let (mut shell, input) = shell_with(&emulator, "for i in 0..64 { save(); } print(\"saved\");");
        let lines = BufReader::new(shell.stdout.take().unwrap()).lines();
        assert!(lines.map_while(Result::ok).any(|line| line.contains("saved")));
        if is_killed {
            shell.kill().unwrap();
        }
        drop(input);
        shell.wait().unwrap();
        emulator.run("snapshot", &[&file]).ok();
    }
}

#[test]
fn a_client_that_waits_learns_that_the_emulator_was_killed() {
    let mut emulator = Emulator::start(&[]);
    // The client's node is in the channel's directory before it sends its request.
    let nodes = format!("/dev/shm/commram.{}.iox.d/nodes", emulator.name);
    let count = || std::fs::read_dir(&nodes).map_or(0, |entries| entries.count());
    let alone = count();
    let mut waiting = emulator.command("wait", &["node2.w_OPTION_STATUS==16#0002", "--within", "1h"]);
    let client = std::thread::spawn(move || finish(&mut waiting));
    assert!(eventually(|| count() > alone));
    emulator.kill();
    let outcome = client.join().unwrap();
    assert!(outcome.fails(3).contains(&emulator.name), "{}", outcome.err);
}

/// The client sleeps until another emulator has the instance.
#[test]
fn a_client_that_waits_learns_that_another_emulator_runs() {
    let mut emulator = Emulator::stepped();
    let mut command = emulator.command("step", &["24h"]);
    let step = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    assert!(eventually(|| !emulator.run("status", &[]).ok().contains("at 0.000000 s")));
    let client = rustix::process::Pid::from_child(&step);
    rustix::process::kill_process(client, rustix::process::Signal::STOP).unwrap();
    let pid = emulator.pid();
    emulator.kill();
    let _next = Emulator::start_with(&emulator.name, &["--clock", "stepped"], &[]);
    rustix::process::kill_process(client, rustix::process::Signal::CONT).unwrap();
    let output = step.wait_with_output().unwrap();
    let expected = format!(
        "the emulator of instance '{}' (process {pid}) was killed, and another one runs now",
        emulator.name
    );
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(3) && message.contains(&expected), "{message}");
}

/// A connection belongs to one emulator: the next one of this name may have another plant.
#[test]
fn a_connected_client_does_not_act_on_the_next_emulator() {
    for is_killed in [false, true] {
        let mut emulator = Emulator::stepped();
        let (mut shell, mut input) = shell_with(&emulator, "step(\"5ms\"); print(now());");
        let mut line = String::new();
        BufReader::new(shell.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, "5000\n");
        if is_killed {
            emulator.kill();
        } else {
            stop(&mut emulator).0.ok();
        }
        let next = Emulator::start_with(&emulator.name, &["--clock", "stepped"], &[]);
        input.write_all(b"poke(\"node2.w_CPU_CONTROL\", 1);\n").unwrap();
        drop(input);
        let output = shell.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        let expected = if is_killed { "another one runs now" } else { "has ended; start it again" };
        assert!(output.status.code() == Some(3) && message.contains(expected), "{message}");
        assert_eq!(next.peek(&["node2.w_CPU_CONTROL"]), "16#0000", "{is_killed}");
    }
}

#[test]
fn the_image_of_a_killed_emulator_can_be_read_but_not_used() {
    let mut emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    let (name, pid) = (emulator.name.clone(), emulator.pid());
    emulator.kill();

    let note = format!(
        "commram: note: instance '{name}' is dead, its emulator (process {pid}) was killed; these are its last values\n"
    );
    let peek = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
    assert_eq!((peek.code, &peek.err), (Some(0), &note));
    assert!(peek.out.starts_with("node2.w_OPTION_STATUS = 16#0002  "), "{}", peek.out);
    let dump = emulator.run("dump", &["node2.w_CPU_CONTROL"]);
    assert_eq!((dump.code, &dump.err), (Some(0), &note));
    let register = "node2.w_CPU_CONTROL  %MW3.200000  16#0001  handshake\n";
    assert_eq!(dump.out, format!("instance '{name}' at 0.001000 s\n{register}"));

    for args in [
        &["poke", "node2.w_CPU_CONTROL=0"][..],
        &["wait", "node2.w_CPU_CONTROL==0"],
        &["step", "1ms"],
        &["stop"],
    ] {
        let outcome = emulator.run(args[0], &args[1..]);
        let message = outcome.fails(3);
        assert!(message.contains("is dead") && message.contains("commram run"), "{message}");
    }
    let list = run(&["list"]);
    let line = list.ok().lines().find(|line| line.starts_with(&name)).unwrap();
    // The column widths depend on the other running instances.
    let cells: Vec<_> = line.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect();
    assert_eq!(cells, [name.as_str(), "line", &pid.to_string(), "stepped", "0.001000 s", "dead"]);
}

#[test]
fn a_killed_emulator_is_restarted_on_the_same_image() {
    let mut emulator = Emulator::stepped();
    emulator.poke(&["%MB3.1000000=1"]);
    let (name, pid) = (emulator.name.clone(), emulator.pid());
    emulator.kill();

    let mut again = Emulator::start_as(&name, &["--clock", "stepped"]);
    assert_eq!(again.peek(&["%MB3.1000000"]), "16#00", "a restart is a power-on");
    assert_eq!(again.step(&["1ms"]), "0.001000 s");
    again.run("stop", &[]).ok();
    again.wait();
    let note = format!(
        "commram: note: took over /dev/shm/commram.{name}.line, which a killed emulator (process {pid}) had left\n"
    );
    assert_eq!(again.complaints(), note);
    assert_eq!(again.files(), Vec::<std::path::PathBuf>::new());
}

/// Kills the emulator and its clients at one moment, during an operation.
#[test]
fn the_next_start_removes_files_of_killed_processes() {
    let novram = tempfile::tempdir().unwrap();
    let args = ["--novram", novram.path().to_str().unwrap()];
    let mut emulator = Emulator::start(&args);
    let nodes = format!("/dev/shm/commram.{}.iox.d/nodes", emulator.name);
    let count = || std::fs::read_dir(&nodes).map_or(0, |entries| entries.count());
    let alone = count();
    let wait = ["node2.w_OPTION_STATUS==16#0002", "--within", "1h"];
    let mut clients: Vec<_> = [("wait", &wait[..]), ("watch", &[]), ("wait", &wait)]
        .map(|(command, args)| {
            emulator.command(command, args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
        })
        .into();
    assert!(eventually(|| count() >= alone + clients.len()), "{} parts", count());
    clients.iter_mut().for_each(|client| client.kill().unwrap());
    emulator.kill();
    clients.iter_mut().for_each(|client| drop(client.wait()));

    let name = emulator.name.clone();
    let mut again = promised(Duration::from_secs(1), || Emulator::start_as(&name, &args));
    assert_eq!(count(), alone, "nothing is left of the clients");
    again.poke(&["node2.w_CPU_CONTROL=1"]);
    again.run("wait", &["node2.w_OPTION_STATUS==16#0002", "--within", "10s"]).ok();
    let (outcome, status) = stop(&mut again);
    assert_eq!((outcome.code, status.code()), (Some(0), Some(0)));
    assert!(again.complaints().contains("which a killed emulator"));
    assert_eq!(again.files(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn stop_can_clean_up_after_a_killed_emulator() {
    let mut emulator = Emulator::stepped();
    emulator.kill();
    assert!(!emulator.files().is_empty());
    let outcome = emulator.run("stop", &["--clean"]);
    assert_eq!(outcome.ok(), format!("instance '{}' was dead, its files are removed\n", emulator.name));
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}

/// A suspended client that watches a register holds up the end of the emulator, which is killed then. Every form of
/// `commram stop` reports this. A late kill finds an emulator that has ended, so the script repeats the round.
#[test]
fn a_kill_during_the_end_is_an_error() {
    let script = "mount -t tmpfs -o mode=1777 tmpfs /dev/shm || exit 77
        out=$(mktemp)
        round() {
            $COMMRAM run --clock stepped -i ending >/dev/null 2>&1 & emulator=$!
            until $COMMRAM status -i ending >/dev/null 2>&1; do sleep 0.05; done
            : >$out; $COMMRAM watch node2.b_AC -i ending >$out 2>&1 & reader=$!
            until grep -q watching $out; do sleep 0.05; done
            kill -STOP $reader
            $COMMRAM stop \"$@\" >$out 2>&1 & stop=$!
            until [ \"$(od -An -tu4 -j32 -N4 /dev/shm/commram.ending.line 2>&1 | tr -d ' ')\" != 2 ]; do :; done
            kill -KILL $emulator; wait $emulator; status=$?
            kill -KILL $reader; kill -CONT $reader; wait $reader
            wait $stop; code=$?
            [ $status = 137 ]
        }
        for arguments in '-i ending' '--all' '--clean -i ending' '--clean --all'; do
            until round $arguments; do $COMMRAM stop --clean -i ending; done
            echo code $code; cat $out; $COMMRAM stop --clean -i ending >/dev/null 2>&1
        done 2>/dev/null
        rm $out";
    let Some(outcome) = in_mount_namespace(script, None) else { return };
    let lines: Vec<_> = outcome.out.lines().collect();
    let [kept, all_kept, removed, all_removed] = lines.chunks(2).collect::<Vec<_>>()[..] else {
        panic!("{outcome:?}")
    };
    for (found, files) in [
        (kept, "remove its files with `commram stop --clean -i ending`"),
        (all_kept, "remove its files with `commram stop --clean -i ending`"),
        (removed, "its files are removed"),
        (all_removed, "its files are removed"),
    ] {
        let was_killed = "was killed during its end, and the last changes of NOVRAM may be lost; ";
        assert_eq!(found[0], "code 3", "{outcome:?}");
        assert!(found[1].ends_with(&format!("{was_killed}{files}")), "{outcome:?}");
    }
}

#[test]
fn a_refused_start_removes_the_files_of_a_killed_emulator() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("novram");
    std::fs::write(&file, "").unwrap();
    let mut emulator = Emulator::stepped();
    emulator.kill();
    let outcome = emulator.run("run", &["--clock", "stepped", "--novram", file.to_str().unwrap()]);
    assert!(outcome.fails(1).contains("novram"), "{}", outcome.err);
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}

/// Tests with each single file of a killed emulator, and with empty files, which do not identify a process.
#[test]
fn clean_removes_all_remaining_files_of_an_instance() {
    let name = unique_name();
    let image = |plc: &str| format!("/dev/shm/commram.{name}.{plc}");
    for plcs in [&[][..], &["line"], &["saw", "line"]] {
        let directory = image("iox.d");
        if plcs.len() != 1 {
            std::fs::create_dir_all(format!("{directory}/nodes/123")).unwrap();
            std::fs::write(format!("{directory}/lock"), "").unwrap();
        }
        plcs.iter().for_each(|plc| std::fs::write(image(plc), "").unwrap());
        let outcome = promised(Duration::from_secs(1), || run(&["stop", "--clean", "-i", &name]));
        let left = files_of(&name);
        remove_remains(&name);
        assert_eq!(outcome.ok(), format!("instance '{name}' was dead, its files are removed\n"));
        assert_eq!(left, Vec::<std::path::PathBuf>::new());
    }
}

/// Other programs of the user may have put anything into the directory. The target of a link stays.
#[test]
fn clean_removes_the_directory_with_foreign_entries() {
    let target = tempfile::tempdir().unwrap();
    let kept = target.path().join("kept");
    std::fs::write(&kept, "mine").unwrap();
    let mut emulator = Emulator::stepped();
    let directory = std::path::PathBuf::from(format!("/dev/shm/commram.{}.iox.d", emulator.name));
    std::fs::write(directory.join("foreign"), "x").unwrap();
    std::fs::create_dir_all(directory.join("sub/directory")).unwrap();
    std::fs::write(directory.join("sub/directory/file"), "x").unwrap();
    std::os::unix::fs::symlink(target.path(), directory.join("link")).unwrap();
    std::os::unix::fs::symlink(target.path(), directory.join("sub/link")).unwrap();
    emulator.kill();
    let outcome = emulator.run("stop", &["--clean"]);
    assert_eq!(outcome.ok(), format!("instance '{}' was dead, its files are removed\n", emulator.name));
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
    assert!(!directory.exists());
    assert_eq!(std::fs::read_to_string(kept).unwrap(), "mine");
}

/// A mounted file system is an entry that even root cannot remove.
#[test]
fn clean_reports_entries_that_it_cannot_remove() {
    let script = "mount -t tmpfs -o mode=1777 tmpfs /dev/shm || exit 77
        directory=/dev/shm/commram.left.iox.d
        $COMMRAM run --clock stepped -i left >/dev/null 2>&1 & emulator=$!
        until $COMMRAM status -i left >/dev/null 2>&1; do sleep 0.05; done
        kill -KILL $emulator; wait $emulator 2>/dev/null
        mkdir $directory/kept; mount -t tmpfs tmpfs $directory/kept || exit 77
        $COMMRAM stop --clean -i left; echo code $?
        umount $directory/kept
        $COMMRAM stop --clean -i left; echo code $?; ls /dev/shm";
    let Some(outcome) = in_mount_namespace(script, None) else { return };
    assert_eq!(
        outcome.out, "code 3\ninstance 'left' was dead, its files are removed\ncode 0\n",
        "{outcome:?}"
    );
    let stays = "commram: instance 'left' was dead, but /dev/shm/commram.left.iox.d stays: these entries cannot be removed: kept";
    assert!(outcome.err.contains(stays), "{outcome:?}");
}

#[test]
fn an_empty_file_is_no_obstacle() {
    let name = unique_name();
    std::fs::write(format!("/dev/shm/commram.{name}.line"), "").unwrap();
    let emulator = Emulator::start_as(&name, &["--clock", "stepped"]);
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
}

#[test]
fn a_stopped_emulator_can_be_ended() {
    for clock in ["stepped", "realtime"] {
        let mut emulator = Emulator::start(&["--clock", clock]);
        emulator.signal("-STOP");
        let (outcome, status) = stop(&mut emulator);
        let (name, pid) = (&emulator.name, emulator.pid());
        assert_eq!((outcome.code, outcome.out), (Some(0), format!("instance '{name}' has stopped\n")));
        // The signal that stops the process may take effect only after its end.
        assert!(outcome.err == continues_text(name, pid) || outcome.err.is_empty(), "{}", outcome.err);
        assert_eq!(status.code(), Some(0));
        assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
    }
}

/// A process in another PID namespace cannot be signalled, and the kernel does not name it as the holder of a lock.
#[test]
fn stop_in_another_pid_namespace_says_where_the_emulator_is() {
    let emulator = Emulator::stepped();
    emulator.signal("-STOP");
    for options in [&[][..], &["--clean"]] {
        let stop = emulator.command("stop", options);
        let mut shell = std::process::Command::new("unshare");
        shell.args(["--pid", "--fork", "--mount-proc"]).arg(stop.get_program()).args(stop.get_args());
        let outcome = finish(&mut shell);
        if outcome.err.contains("unshare: ") {
            eprintln!("SKIPPED: no PID namespace: {}", outcome.err);
            break;
        }
        assert!(outcome.fails(3).contains("the emulator runs in another PID namespace"), "{}", outcome.err);
    }
    emulator.signal("-CONT");
}

/// The files of an instance may name a process that has nothing to do with it, and the kernel may not show the holder
/// of the locks.
#[test]
fn stop_signals_no_process_that_does_not_hold_the_locks() {
    let mut emulator = Emulator::stepped();
    let name = emulator.name.clone();
    // Field 22 is the start time.
    let bystander = "sleep 600 & other=$!
        echo $other $(cut -d' ' -f22 /proc/$other/stat) >/dev/shm/commram.$COMMRAM_INSTANCE.iox.d/lock
        $COMMRAM stop; code=$?
        kill -0 $other || echo 'another process was ended'
        kill -9 $other; exit $code";
    emulator.signal("-STOP");
    let mut shell = std::process::Command::new("unshare");
    shell.args(["--pid", "--fork", "--mount-proc", "sh", "-c", bystander]);
    shell.env("COMMRAM", commram().get_program()).env("COMMRAM_INSTANCE", &name);
    let outcome = finish(&mut shell);
    if outcome.err.contains("unshare: ") {
        eprintln!("SKIPPED: no PID namespace: {}", outcome.err);
    } else {
        assert!(outcome.fails(3).contains("the emulator runs in another PID namespace"), "{}", outcome.err);
        assert_eq!(outcome.out, "");
    }
    emulator.signal("-CONT");
    // Without the table of locks, the emulator is found by its open files.
    let hidden = format!("mount --bind /dev/null /proc/locks || exit 77\n{bystander}");
    if let Some(outcome) = in_mount_namespace(&hidden, Some(&name)) {
        assert_eq!(outcome.ok(), format!("instance '{name}' has stopped\n"));
        assert_eq!(emulator.wait().code(), Some(0));
    }
    let mut emulator = Emulator::stepped();
    emulator.signal("-STOP");
    let hidden = "mount --bind /dev/null /proc/locks || exit 77; $COMMRAM stop";
    match in_mount_namespace(hidden, Some(&emulator.name)) {
        Some(outcome) => {
            let stopped = format!("instance '{}' has stopped\n", emulator.name);
            assert_eq!((outcome.code, outcome.out), (Some(0), stopped), "{}", outcome.err);
            assert_eq!(emulator.wait().code(), Some(0));
        }
        None => emulator.signal("-CONT"),
    }
}

fn continues_text(name: &str, pid: u32) -> String {
    format!("commram: note: instance '{name}' was stopped (process {pid}); it is continued to end\n")
}

/// Another process may suspend the emulator at any moment, not only while `stop` checks the emulator.
#[test]
fn stop_ends_an_emulator_that_is_suspended_repeatedly() {
    let mut emulator = Emulator::stepped();
    let pid = emulator.pid();
    let is_stopped = || stat(&pid.to_string())[0] == "T";
    emulator.signal("-STOP");
    assert!(eventually(is_stopped));
    let mut stop = emulator.command("stop", &[]);
    let outcome = promised(Duration::from_secs(2), || {
        let stop = std::thread::spawn(move || finish(&mut stop));
        for _ in 0..5 {
            assert!(eventually(|| !is_stopped() || stop.is_finished()));
            emulator.signal("-STOP");
        }
        stop.join().unwrap()
    });
    // `stop` waits only until the process serves no clients any more, not until the process has ended.
    emulator.signal("-CONT");
    assert_eq!((outcome.code, outcome.err), (Some(0), continues_text(&emulator.name, pid)));
    assert_eq!(emulator.wait().code(), Some(0));
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}

/// The lock was removed with the directory; the images still identify the process.
#[test]
fn stop_ends_an_emulator_without_its_directory_or_lock() {
    for (clock, lock_only) in [("stepped", false), ("realtime", false), ("stepped", true)] {
        let mut emulator = Emulator::start(&["--clock", clock]);
        let directory = format!("/dev/shm/commram.{}.iox.d", emulator.name);
        let prefix = std::fs::read_to_string(format!("{directory}/prefix")).unwrap();
        match lock_only {
            true => std::fs::remove_file(format!("{directory}/lock")).unwrap(),
            false => std::fs::remove_dir_all(&directory).unwrap(),
        }
        let (outcome, status) = stop(&mut emulator);
        assert_eq!(outcome.ok(), format!("instance '{}' has stopped\n", emulator.name));
        assert_eq!(status.code(), Some(0));
        assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
        let mut objects = std::fs::read_dir("/dev/shm").unwrap().flatten();
        assert!(!objects.any(|it| it.file_name().to_string_lossy().starts_with(prefix.trim_end())));
    }
}
