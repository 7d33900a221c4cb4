//! Process limits (`ulimit`), and the cost of writes by other programs.

use crate::common::{
    Emulator, Outcome, commram, files_of, finish, in_mount_namespace, promised, unique_name,
};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Runs the program in a shell with a limit.
fn limited(limit: &str, args: &[&str]) -> Outcome {
    let script = format!("ulimit {limit} || exit 77; exec \"$0\" \"$@\"");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).arg(commram().get_program()).args(args);
    shell.env_remove("COMMRAM_INSTANCE").env("COMMRAM_CONNECT_TIMEOUT", "0s");
    finish(&mut shell)
}

/// Returns the number after these words.
#[track_caller]
fn number_after(text: &str, words: &str) -> u64 {
    let (_, rest) = text.split_once(words).unwrap_or_else(|| panic!("no `{words}` in: {text}"));
    rest.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap()
}

#[test]
fn a_client_names_the_limit_that_keeps_it_out_and_what_it_needs() {
    let emulator = Emulator::stepped();
    let peek = ["peek", "--raw", "-i", &emulator.name, "node2.w_OPTION_STATUS"];
    for (option, words) in [("-n", "a client would have "), ("-v", "a client would have ")] {
        let few = if option == "-n" { 8 } else { 120_000 };
        let outcome = limited(&format!("{option} {few}"), &peek);
        let message = outcome.fails(3);
        assert!(message.contains(&format!("`ulimit {option}`")), "{message}");
        let needed = number_after(message, words);
        assert!(needed > few, "{message}");
        assert_eq!(limited(&format!("{option} {needed}"), &peek).ok(), "16#0001\n");
    }
    for few in 4..20 {
        let outcome = limited(&format!("-n {few}"), &peek);
        assert!(outcome.code == Some(0) || outcome.err.contains("`ulimit -n`"), "{few}: {outcome:?}");
    }
    let stop = limited("-n 6", &["stop", "-i", &emulator.name]);
    assert!(stop.fails(3).contains("`ulimit -n`"), "{}", stop.err);
}

/// The limit would end the process by SIGXFSZ, without a message.
#[test]
fn a_limit_of_file_sizes_is_named_and_leaves_no_partial_files() {
    let (name, directory) = (unique_name(), tempfile::tempdir().unwrap());
    let header = directory.path().join("registers.h");
    let exported = limited("-f 1", &["export", "c", "--output", header.to_str().unwrap()]);
    assert!(exported.fails(3).contains("`ulimit -f`"), "{}", exported.err);
    assert_eq!(directory.path().read_dir().unwrap().count(), 0);
    for blocks in [0, 1, 1000] {
        let started = limited(&format!("-f {blocks}"), &["run", "--detach", "-i", &name]);
        assert!(started.fails(1).contains("`ulimit -f`"), "{blocks}: {}", started.err);
        assert_eq!(files_of(&name), Vec::<PathBuf>::new(), "{blocks}");
    }
    // The process under `with` reaches its own limit, and its own signal ends it.
    let own = limited(
        "-f 1000000",
        &["with", "--", "sh", "-c", "ulimit -f 0; echo text >$0", header.to_str().unwrap()],
    );
    assert_eq!(own.code, Some(128 + 25), "{}", own.err);
}

/// Runs in a separate `/dev/shm`, because the command ends all emulators with files in it.
#[test]
fn stop_all_names_the_limit_that_hides_emulators() {
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        start() { $COMMRAM run --detach --clock stepped -i one >/dev/null; }
        start
        for n in 4 5 6 7 8 9 10 11 12 13 14 16; do
            answer=$( (ulimit -n $n; exec $COMMRAM stop --all) 2>&1); code=$?
            case \"$code $answer\" in
                '0 '*'has stopped'*) start;;
                '3 '*'ulimit -n'*) ;;
                *) echo \"$n: $code $answer\";;
            esac
        done
        $COMMRAM stop --all";
    let Some(outcome) = in_mount_namespace(script, None) else { return };
    assert_eq!(outcome.ok(), "instance 'one' has stopped\n");
}

/// With exactly the number of files in the message, the emulator starts completely and answers clients.
#[test]
fn a_start_needs_as_many_open_files_as_it_says() {
    let plc = |n| format!("[[plc]]\nname = \"p{n}\"\n");
    let door = "[[bus]]\nname = \"open\"\nkind = \"can\"\nkbit_s = 125\ndoors = [\"slcan-pty\", \"slcan-tcp:127.0.0.1:0\"]\n";
    let plants = [plc(0), plc(0) + door, (0..5).map(plc).collect::<String>() + door];
    for plant in plants {
        let file = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
        std::fs::write(&file, &plant).unwrap();
        let (name, novram) = (unique_name(), tempfile::tempdir().unwrap());
        let path = file.path().to_str().unwrap();
        let novram = novram.path().to_str().unwrap();
        let log = tempfile::NamedTempFile::new().unwrap();
        let run = ["run", path, "--clock", "stepped", "--novram", novram, "-i", &name];
        let run = [&run[..], &["--detach", "--log", log.path().to_str().unwrap()]].concat();
        let refused = limited("-n 20", &run);
        let needed = number_after(&refused.err, " has ");
        assert!(refused.err.contains("ulimit -Hn"), "{}", refused.err);
        assert!(limited(&format!("-n {}", needed - 1), &run).err.contains("ulimit -Hn"));
        let started = limited(&format!("-n {needed}"), &run);
        assert_eq!((started.code, started.err.as_str()), (Some(0), ""), "{plant}");
        // The clients run at the same time.
        let status = || finish(commram().args(["status", "-i", &name]));
        let outcomes: Vec<_> = std::thread::scope(|scope| {
            let clients: Vec<_> = (0..4).map(|_| scope.spawn(status)).collect();
            clients.into_iter().map(|client| client.join().unwrap()).collect()
        });
        let stopped = finish(commram().args(["stop", "-i", &name]));
        for outcome in outcomes {
            outcome.ok();
        }
        stopped.ok();
        assert_eq!(std::fs::read_to_string(&log).unwrap(), "");
    }
}

/// Another program fills all registers with random values, and sends requests through the header page all the time. The
/// test does not overwrite the fields that identify the image.
#[test]
fn a_program_that_writes_at_random_delays_no_client() {
    let emulator = Emulator::stepped();
    let image = File::options().write(true).open(format!("/dev/shm/commram.{}.line", emulator.name)).unwrap();
    let size = image.metadata().unwrap().len();
    let ends = AtomicBool::new(false);
    let write = || {
        let mut random = 0x9E37_79B9_7F4A_7C15_u64;
        let mut next = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random
        };
        let noise: Vec<u8> = (0..size / 8).flat_map(|_| next().to_le_bytes()).collect();
        image.write_all_at(&noise[4096..], 4096).unwrap();
        while !ends.load(Ordering::Relaxed) {
            for (first, last) in [(256, 4096), (4096, size)] {
                let at = first + 4 * (next() % ((last - first) / 4));
                image.write_all_at(&next().to_le_bytes()[..4], at).unwrap();
            }
        }
    };
    let outcomes: Vec<_> = std::thread::scope(|scope| {
        scope.spawn(write);
        let ask = |figure: u64, name: &str, args: &[&str]| {
            promised(Duration::from_secs(figure), || emulator.run(name, args))
        };
        let outcomes = (0..3).flat_map(|_| [ask(2, "step", &["10ms"]), ask(1, "status", &[])]).collect();
        ends.store(true, Ordering::Relaxed);
        outcomes
    });
    outcomes.iter().for_each(|outcome| assert_eq!(outcome.code, Some(0), "{outcome:?}"));
    let stop = promised(Duration::from_secs(2), || emulator.run("stop", &[]));
    assert_eq!(stop.code, Some(0), "{stop:?}");
}

/// With any number of open files, a start ends with a message, and nothing of it remains.
#[test]
fn a_start_without_enough_open_files_leaves_nothing() {
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        for n in $(seq 4 20); do
            (ulimit -n $n; exec $COMMRAM run -i few) >/dev/null 2>&1
            (ulimit -n $n; exec $COMMRAM with -- true) >/dev/null 2>&1
        done; ls -A /dev/shm";
    let Some(outcome) = crate::common::in_mount_namespace(script, None) else { return };
    assert_eq!(outcome.ok(), "");
}

#[test]
fn a_file_system_without_inodes_is_named() {
    let script = "log=$(mktemp); for n in 2 3 4 8 12 16; do
            mount -t tmpfs -o nr_inodes=$n,size=200m tmpfs /dev/shm || exit 77
            $COMMRAM run --clock stepped --detach --log $log -i few; cat $log
            $COMMRAM stop -i few >/dev/null 2>&1
            umount /dev/shm
            echo end of $n
        done 2>&1; rm $log";
    let Some(outcome) = crate::common::in_mount_namespace(script, None) else { return };
    for part in outcome.out.split_inclusive("end of ").filter(|part| part.contains("commram")) {
        assert!(part.contains("/dev/shm has ") || part.contains("iox.d has "), "{part}");
        assert!(part.contains(" free inodes: remove files"), "{part}");
    }
    assert!(outcome.out.contains("end of 16"), "{outcome:?}");
}

#[test]
fn a_limit_of_the_stack_or_of_data_is_named() {
    for few in [64, 128, 256] {
        let refused = limited(&format!("-s {few}"), &["list"]);
        assert!(refused.fails(3).contains(&format!("{few} KiB of stack")), "{}", refused.err);
        assert!(refused.err.contains("`ulimit -s`"), "{}", refused.err);
        // A command raises its soft limit, but not its hard limit.
        assert_eq!(limited(&format!("-S -s {few}"), &["list"]).code, Some(0));
    }
    let name = unique_name();
    let run = ["run", "--detach", "--clock", "stepped", "-i", &name];
    // With less than 3.1 MB, the loader of the system cannot load a debug build.
    for few in [3500, 4000, 5000, 8000] {
        for command in [&run[..], &["run", "-i", &name], &["with", "--", "true"], &["demo"], &["list"]] {
            let refused = limited(&format!("-d {few}"), command);
            assert!(refused.fails(3).contains("(`ulimit -d`)"), "{}", refused.err);
            assert_eq!(limited(&format!("-S -d {few}"), &["list"]).code, Some(0));
        }
    }
    assert_eq!(files_of(&name), Vec::<PathBuf>::new());
}

/// The journals of an emulator grow. It starts only if the limits leave room for them.
#[test]
fn a_start_names_the_limit_of_memory_that_its_journals_would_exceed() {
    let name = unique_name();
    let run = ["run", "--detach", "--clock", "stepped", "-i", &name];
    let refused = limited("-d 30000", &run);
    let message = refused.fails(1);
    assert!(message.contains("(`ulimit -d`)") && !message.contains("ulimit -u"), "{message}");
    assert_eq!(files_of(&name), Vec::<PathBuf>::new());
    for command in [&["test", "-"][..], &["soak", "--rounds", "1"]] {
        let refused = limited("-d 30000", command);
        assert!(refused.fails(3).contains("(`ulimit -d`)"), "{}", refused.err);
    }
    let needed = number_after(message, "can have ");
    assert_eq!(limited(&format!("-d {needed}"), &run).code, Some(0));
    finish(commram().args(["stop", "-i", &name])).ok();
}

/// Data segments of the channel are files.
#[test]
fn a_limit_of_file_sizes_that_keeps_a_client_out_is_named() {
    let emulator = Emulator::start(&["--clock", "stepped"]);
    let refused = limited("-f 8", &["status", "-i", &emulator.name]);
    assert!(refused.fails(3).contains("(`ulimit -f`)"), "{}", refused.err);
}

/// A limit of the threads of a user. The test is another user, because the limit does not concern root and counts all
/// processes of a user.
#[test]
fn too_few_threads_are_named_and_cause_no_wrong_advice() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("SKIPPED: only root can be another user");
        return;
    }
    let (name, uid) = (unique_name(), (70_000 + std::process::id() % 100_000).to_string());
    let as_user = |limit: &str, args: &[&str]| {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", &uid, "--regid", &uid, "--clear-groups", "prlimit", limit]);
        command.arg(commram().get_program()).args(args).env("COMMRAM_INSTANCE", &name).current_dir("/");
        finish(command.env("COMMRAM_CONNECT_TIMEOUT", "0s").env("HOME", "/nonexistent"))
    };
    as_user("--core=0", &["run", "--clock", "stepped", "--detach"]).ok();
    for few in [1, 3, 5, 7, 9, 11] {
        let limit = format!("--nproc={few}");
        for args in [&["peek", "node2.w_CPU_CONTROL"][..], &["step", "1us"], &["poke", "node2.b_AM=1"]] {
            let outcome = as_user(&limit, args);
            let is_named = outcome.code == Some(3) && outcome.err.contains("(`ulimit -u`)");
            assert!(outcome.code == Some(0) || is_named, "{few} {args:?}: {outcome:?}");
        }
        for args in [&["with", "--", "true"][..], &["demo"], &["run", "--detach", "-i", "few"]] {
            let outcome = as_user(&limit, args);
            let is_right = !outcome.err.contains("damaged") && outcome.code != Some(101);
            assert!(is_right && outcome.code.is_some(), "{few} {args:?}: {outcome:?}");
            // A refused start leaves no emulator, not even one that becomes ready later.
            let is_running = args[0] == "run" && outcome.code == Some(0);
            let stopped = as_user("--core=0", &["stop", "-i", "few"]);
            assert_eq!(stopped.code == Some(0), is_running, "{few} {args:?}: {outcome:?} {stopped:?}");
        }
    }
    // The process of a scenario has a limit of its data, too; it is not the cause.
    let scenario = tempfile::Builder::new().suffix(".rhai").tempfile().unwrap();
    std::fs::write(&scenario, "expect_that(now() == now(), \"\");").unwrap();
    std::fs::set_permissions(&scenario, std::os::unix::fs::PermissionsExt::from_mode(0o644)).unwrap();
    let scenario = scenario.path().to_str().unwrap();
    for few in 1..24 {
        let limit = format!("--nproc={few}");
        for args in [&["test", "--attach", &name, scenario][..], &["with", "--", "true"]] {
            let outcome = as_user(&limit, args);
            let text = format!("{}{}", outcome.out, outcome.err);
            assert!(
                !text.contains("os error 11") || text.contains("(`ulimit -u`)"),
                "{few} {args:?}: {text}"
            );
            assert!(!text.contains("ulimit -d"), "{few} {args:?}: {text}");
        }
    }
    as_user("--core=0", &["stop"]).ok();
    assert_eq!(files_of(&name), Vec::<PathBuf>::new());
}

/// Without `/proc` a process cannot list its open files; the command must not print a wrong number or limit.
#[test]
fn nothing_is_invented_without_proc() {
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 77
        $COMMRAM run --clock stepped --detach; mount -t tmpfs tmpfs /proc || exit 77
        $COMMRAM peek --raw node2.w_OPTION_STATUS; echo peek $?
        $COMMRAM step 1ms; echo step $?
        $COMMRAM with --clock stepped -- true; echo with $?
        $COMMRAM run --clock stepped --detach -i other; echo run $?
        umount /proc; $COMMRAM stop; echo stop $?; ls /dev/shm";
    let Some(outcome) = in_mount_namespace(script, Some("bare")) else { return };
    assert!(!outcome.err.contains("open files") && !outcome.err.contains("ulimit"), "{outcome:?}");
    for done in ["16#0001\npeek 0", "step 0", "with 1", "run 3", "stop 0\n"] {
        assert!(outcome.out.contains(done), "{done}: {outcome:?}");
    }
    assert!(outcome.out.ends_with("stop 0\n"), "{outcome:?}");
    assert_eq!(outcome.err.to_lowercase().matches("is /proc mounted?").count(), 2, "{outcome:?}");
}
