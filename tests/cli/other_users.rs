//! Other users of the machine have no access to an emulator. The tests run two users and therefore need root; without
//! root they print a note and pass.

use crate::common::{Emulator, Outcome, files_of, finish, remove_remains, run, unique_name};
use std::io::BufRead;
use std::os::unix::fs::{MetadataExt, symlink};
use std::os::unix::process::CommandExt;
use std::process::Command;

/// User ID of the attacker.
const ATTACKER: u32 = 65_534;

/// Returns whether the test can switch to the attacker's user ID; prints a note if not.
fn can_be_another_user() -> bool {
    let root = rustix::process::geteuid().is_root();
    if !root {
        eprintln!("SKIPPED: only root can be another user");
    }
    root
}

/// Runs a shell script as the attacker.
fn attack(script: &str) -> Outcome {
    finish(Command::new("sh").args(["-c", script]).current_dir("/").uid(ATTACKER).gid(ATTACKER))
}

/// Creates a file that the attacker wants to be overwritten.
fn victim() -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, "precious").unwrap();
    file
}

#[test]
fn a_directory_of_another_user_is_refused_and_its_links_are_not_followed() {
    if !can_be_another_user() {
        return;
    }
    let (name, victim) = (unique_name(), victim());
    let directory = format!("/dev/shm/commram.{name}.iox.d");
    let target = victim.path().display();
    let links =
        ["ready", "ready.new", "prefix", "prefix.new", "lock"].map(|file| format!("ln -s {target} {file}"));
    assert_eq!(
        attack(&format!("mkdir {directory} && cd {directory} && {}", links.join(" && "))).code,
        Some(0)
    );
    let outcomes = [run(&["run", "-i", &name]), run(&["stop", "--clean", "-i", &name])];
    std::fs::remove_dir_all(&directory).unwrap();
    assert_eq!(std::fs::read_to_string(&victim).unwrap(), "precious");
    for (outcome, code) in outcomes.into_iter().zip([1, 3]) {
        let expected = format!("{directory} belongs to user {ATTACKER}, not to user 0");
        assert!(outcome.fails(code).contains(&expected), "{}", outcome.err);
    }
    assert!(files_of(&name).is_empty());
}

#[test]
fn a_link_in_place_of_the_directory_is_refused() {
    if !can_be_another_user() {
        return;
    }
    let (name, own) = (unique_name(), tempfile::tempdir().unwrap());
    let directory = format!("/dev/shm/commram.{name}.iox.d");
    assert_eq!(attack(&format!("ln -s {} {directory}", own.path().display())).code, Some(0));
    let outcome = run(&["run", "-i", &name]);
    std::fs::remove_file(&directory).unwrap();
    let expected = format!("{directory} belongs to user {ATTACKER}, not to user 0");
    assert!(outcome.fails(1).contains(&expected), "{}", outcome.err);
    assert_eq!(std::fs::read_dir(own.path()).unwrap().count(), 0);
    // An emulator does not follow a link, even if the link belongs to its own user.
    symlink(own.path(), &directory).unwrap();
    let outcome = run(&["run", "-i", &name]);
    std::fs::remove_file(&directory).unwrap();
    assert!(outcome.fails(1).contains("is a symbolic link"), "{}", outcome.err);
}

/// Any user can create an entry of any kind before the emulator starts. Only the owner of the entry and root can remove
/// it.
#[test]
fn an_entry_of_another_user_is_reported_with_its_owner_and_a_remedy() {
    if !can_be_another_user() {
        return;
    }
    type MakeEntry = fn(&str);
    let make: [(&str, MakeEntry); 5] = [
        ("file", |path| std::fs::write(path, "").unwrap()),
        ("directory", |path| std::fs::create_dir(path).unwrap()),
        ("pipe", |path| assert!(Command::new("mkfifo").arg(path).status().unwrap().success())),
        ("link", |path| symlink("/nowhere", path).unwrap()),
        ("socket", |path| drop(std::os::unix::net::UnixListener::bind(path).unwrap())),
    ];
    for ending in ["line", "iox.d"] {
        for (kind, make) in make {
            let name = unique_name();
            let path = format!("/dev/shm/commram.{name}.{ending}");
            make(&path);
            std::os::unix::fs::lchown(&path, Some(ATTACKER), Some(ATTACKER)).unwrap();
            let outcomes = [
                run(&["run", "-i", &name]),
                run(&["stop", "-i", &name]),
                run(&["peek", "node2.w_OPTION_STATUS", "-i", &name]),
            ];
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir(&path));
            for (outcome, code) in outcomes.into_iter().zip([1, 3, 3]) {
                let message = outcome.fails(code);
                assert!(
                    message.contains(&format!("{path} belongs to user {ATTACKER}, not to user 0")),
                    "{kind}: {message}"
                );
                assert!(
                    message.contains(&format!("ask user {ATTACKER} or root to remove it")),
                    "{kind}: {message}"
                );
                assert!(message.contains("choose another"), "{kind}: {message}");
            }
            assert!(files_of(&name).is_empty());
        }
    }
}

/// The directory for tokens has a name that other users can guess, if it is in a directory of all users.
#[test]
fn a_token_is_not_written_to_a_directory_of_another_user() {
    if !can_be_another_user() {
        return;
    }
    let (emulator, runtime) = (Emulator::stepped(), tempfile::tempdir().unwrap());
    let directory = runtime.path().join("commram");
    std::fs::create_dir(&directory).unwrap();
    std::os::unix::fs::chown(&directory, Some(ATTACKER), Some(ATTACKER)).unwrap();
    let mut command = emulator.command("web", &["--listen", "127.0.0.1:0"]);
    let outcome = finish(command.env("XDG_RUNTIME_DIR", runtime.path()));
    let expected = format!("{} belongs to user {ATTACKER}", directory.display());
    let message = outcome.fails(3);
    assert!(message.contains(&expected) && message.contains("--token-file"), "{message}");
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 0);
    // After `su`, the variable may name the directory of the user before.
    std::fs::remove_dir(&directory).unwrap();
    std::os::unix::fs::chown(runtime.path(), Some(ATTACKER), Some(ATTACKER)).unwrap();
    let mut command = emulator.command("web", &["--listen", "127.0.0.1:0"]);
    let outcome = finish(command.env("XDG_RUNTIME_DIR", runtime.path()));
    let expected = format!("{} belongs to user {ATTACKER}", runtime.path().display());
    assert!(outcome.fails(3).contains(&expected), "{}", outcome.err);
    assert_eq!(std::fs::read_dir(runtime.path()).unwrap().count(), 0);
}

#[test]
fn a_novram_directory_of_another_user_is_refused() {
    if !can_be_another_user() {
        return;
    }
    let (name, parent) = (unique_name(), tempfile::tempdir().unwrap());
    let path = parent.path().join("novram");
    std::fs::create_dir(&path).unwrap();
    std::os::unix::fs::chown(&path, Some(ATTACKER), Some(ATTACKER)).unwrap();
    let outcome = run(&["run", "-i", &name, "--novram", path.to_str().unwrap()]);
    let expected = format!("this directory belongs to user {ATTACKER}, not to user 0");
    assert!(outcome.fails(1).contains(&expected), "{}", outcome.err);
    assert_eq!(std::fs::read_dir(&path).unwrap().count(), 0);
    assert!(files_of(&name).is_empty());
}

/// Any user that can open a directory can take its lock, even with read rights only.
#[test]
fn another_user_cannot_keep_an_emulator_from_its_novram_directory() {
    if !can_be_another_user() {
        return;
    }
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("novram");
    std::fs::create_dir(&path).unwrap();
    for directory in [parent.path(), &path] {
        std::fs::set_permissions(directory, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    }
    let novram = ["--clock", "stepped", "--novram", path.to_str().unwrap()];
    // The first start makes all files.
    Emulator::start(&novram).run("stop", &[]).ok();
    let script = "for it in . .lock *; do (exec 9<\"$it\" && flock 9 && sleep 600) 2>/dev/null & done; sleep 0.5; echo locked; wait";
    let mut attacker = Command::new("sh");
    attacker.args(["-c", script]).current_dir(&path).uid(ATTACKER).gid(ATTACKER).process_group(0);
    let mut attacker = attacker.stdout(std::process::Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    std::io::BufReader::new(attacker.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let emulator = std::panic::catch_unwind(|| Emulator::start(&novram));
    let group = rustix::process::Pid::from_child(&attacker);
    rustix::process::kill_process_group(group, rustix::process::Signal::KILL).unwrap();
    attacker.wait().unwrap();
    assert_eq!(line, "locked\n");
    let emulator = emulator.unwrap_or_else(|failure| std::panic::resume_unwind(failure));
    assert_eq!(std::fs::metadata(path.join(".lock")).unwrap().mode() & 0o7777, 0o600);
    let second = run(&["run", "-i", &unique_name(), "--novram", path.to_str().unwrap()]);
    assert!(second.fails(1).contains("another emulator uses this directory"), "{}", second.err);
    emulator.run("stop", &[]).ok();
}

/// The image is an exact copy of an emulator's image, with read and write permission for all users.
#[test]
fn an_image_of_another_user_is_neither_taken_over_nor_used() {
    if !can_be_another_user() {
        return;
    }
    let (emulator, name, copy) =
        (Emulator::stepped(), unique_name(), tempfile::NamedTempFile::new().unwrap());
    std::fs::copy(format!("/dev/shm/commram.{}.line", emulator.name), &copy).unwrap();
    std::fs::set_permissions(copy.path(), std::os::unix::fs::PermissionsExt::from_mode(0o644)).unwrap();
    let image = format!("/dev/shm/commram.{name}.line");
    let made = attack(&format!("cp {} {image} && chmod 666 {image}", copy.path().display()));
    let before = std::fs::read(&image);
    let started = run(&["run", "-i", &name]);
    let others = [
        run(&["peek", "node2.w_OPTION_STATUS", "-i", &name]),
        // A device in a folder may have such a register.
        run(&["peek", "card.w_COUNT", "-i", &name]),
        run(&["poke", "node2.w_CPU_CONTROL=1", "-i", &name]),
        run(&["stop", "--clean", "-i", &name]),
    ];
    let after = std::fs::read(&image);
    std::fs::remove_file(&image).unwrap();
    assert_eq!(made.code, Some(0), "{}", made.err);
    let expected = format!("{image} belongs to user {ATTACKER}, not to user 0");
    assert!(started.fails(1).contains(&expected), "{}", started.err);
    for outcome in others {
        assert!(outcome.fails(3).contains(&expected), "{}", outcome.err);
    }
    assert!(before.unwrap() == after.unwrap(), "it was written to");
}

/// The attacker can create these entries at any time after the start.
#[test]
fn entries_of_others_with_names_of_images_do_not_disturb_clients() {
    if !can_be_another_user() {
        return;
    }
    let mut emulator = Emulator::stepped();
    let image = format!("/dev/shm/commram.{}", emulator.name);
    let entries = ["a-file", "x", "directory", "pipe", "link"].map(|plc| format!("{image}.{plc}"));
    let [closed, open, directory, pipe, link] = &entries;
    let made = attack(&format!(
        "umask 77; touch {closed}; umask 0; touch {open} && mkdir {directory} && mkfifo {pipe} && ln -s /nowhere {link}"
    ));
    let commands: [(&str, &[&str]); 8] = [
        ("status", &[]),
        ("peek", &["node2.w_OPTION_STATUS"]),
        ("poke", &["node2.b_AC=1"]),
        ("step", &["1ms"]),
        ("dump", &["node2"]),
        ("check", &[]),
        ("board", &["get"]),
        ("bus", &["list"]),
    ];
    let outcomes = commands.map(|(name, args)| (name, emulator.run(name, args)));
    emulator.kill();
    let left = [emulator.run("peek", &["node2.w_OPTION_STATUS"]), emulator.run("stop", &["--clean"])];
    let others = files_of(&emulator.name).len();
    for entry in &entries {
        let _ = std::fs::remove_file(entry).or_else(|_| std::fs::remove_dir(entry));
    }
    assert_eq!(made.code, Some(0), "{}", made.err);
    for (name, outcome) in outcomes {
        assert_eq!(outcome.code, Some(0), "{name}: {outcome:?}");
    }
    for outcome in left {
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
    }
    assert_eq!(others, entries.len(), "the entries of others are left alone");
}

/// One client is connected and another listens to events, so that all kinds of objects exist.
#[test]
fn nothing_of_a_running_instance_can_be_read_written_or_removed_by_others() {
    if !can_be_another_user() {
        return;
    }
    let mut emulator = Emulator::stepped();
    let mut follower = emulator.command("watch", &["node2.w_OPTION_STATUS"]);
    let mut follower = follower.stdout(std::process::Stdio::null()).spawn().unwrap();
    let nodes = format!("/dev/shm/commram.{}.iox.d/nodes", emulator.name);
    let count = || std::fs::read_dir(&nodes).map_or(0, |entries| entries.count());
    let alone = count();
    assert!(crate::common::eventually(|| count() > alone));
    let prefix = std::fs::read_to_string(format!("/dev/shm/commram.{}.iox.d/prefix", emulator.name)).unwrap();
    let ours = |name: &str| {
        name.starts_with(prefix.trim_end()) || name.starts_with(&format!("commram.{}.", emulator.name))
    };
    let entries = || std::fs::read_dir("/dev/shm").unwrap().flatten();
    let objects: Vec<_> = entries().filter(|entry| ours(&entry.file_name().to_string_lossy())).collect();
    assert!(objects.len() >= 5, "{objects:?}");
    for object in objects.iter().map(|entry| entry.path()) {
        let mode = object.metadata().unwrap().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", object.display());
        let path = object.display();
        let attacks =
            [format!("cat {path}"), format!("ls {path}/"), format!(": > {path}"), format!("rm -rf {path}")];
        for attack in attacks.iter().map(|script| self::attack(script)) {
            assert_ne!(attack.code, Some(0), "{attack:?}");
        }
        assert!(object.exists());
    }
    let _ = follower.kill();
    let _ = follower.wait();
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
    emulator.run("stop", &[]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
    remove_remains(&emulator.name);
}

/// The prefix of the channel's objects is public.
#[test]
fn objects_of_other_users_with_the_channels_prefix_block_no_client() {
    if !can_be_another_user() {
        return;
    }
    let mut emulator = Emulator::stepped();
    let prefix = std::fs::read_to_string(format!("/dev/shm/commram.{}.iox.d/prefix", emulator.name)).unwrap();
    let objects = ["service", "dynamic", "data", "global_mgmt"]
        .map(|kind| format!("/dev/shm/{}attack.{kind}", prefix.trim_end()));
    assert_eq!(attack(&format!("umask 0; touch {}", objects.join(" "))).code, Some(0));
    let peek = emulator.run("peek", &["--raw", "node2.w_OPTION_STATUS"]);
    let step = emulator.run("step", &["1ms"]);
    let stop = emulator.run("stop", &[]);
    for object in &objects {
        std::fs::remove_file(object).unwrap();
    }
    assert_eq!(peek.ok(), "16#0001\n");
    step.ok();
    stop.ok();
    assert_eq!(emulator.wait().code(), Some(0));
}

/// In a directory that is not sticky, the kernel follows links of all users.
#[test]
fn output_files_follow_no_link_of_another_user() {
    if !can_be_another_user() {
        return;
    }
    let (emulator, victim) = (Emulator::stepped(), victim());
    let (shared, own) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = |name: &str| shared.path().join(name).to_str().unwrap().to_owned();
    let link = |target: &std::path::Path, name: &str| {
        symlink(target, path(name)).unwrap();
        std::os::unix::fs::lchown(path(name), Some(ATTACKER), Some(ATTACKER)).unwrap();
    };
    link(victim.path(), "file.json");
    link(own.path(), "folder");
    std::fs::create_dir(path("project")).unwrap();
    std::os::unix::fs::chown(path("project"), Some(ATTACKER), Some(ATTACKER)).unwrap();
    link(own.path(), "project/scenarios");
    std::fs::create_dir(path("mine")).unwrap();
    link(own.path(), "mine/.github");
    let (file, folder, project, mine) = (path("file.json"), path("folder"), path("project"), path("mine"));
    let (deep, scenario) = (format!("{folder}/deep/a.xml"), own.path().join("a.rhai"));
    std::fs::write(&scenario, "step(1000);").unwrap();
    let scenario = scenario.to_str().unwrap();
    let (report, instance) = (format!("json={file}"), unique_name());
    let commands: [&[&str]; 12] = [
        &["test", scenario, "--junit", &file],
        &["test", scenario, "--junit", &deep],
        &["test", scenario, "--report", &report],
        &["test", "--definitions", &folder],
        &["man", &folder],
        &["man", &project],
        &["new", &folder],
        &["new", &project],
        &["new", &mine],
        &["export", "c", "--output", &file],
        &["snapshot", "-i", &emulator.name, &file],
        &["run", "-i", &instance, "--detach", "--log", &file],
    ];
    for command in commands {
        let outcome = run(command);
        assert_ne!(outcome.code, Some(0), "{command:?}");
        let expected = format!("belongs to user {ATTACKER}");
        assert!(outcome.err.contains(&expected), "{command:?}: {} {}", outcome.out, outcome.err);
    }
    assert_eq!(std::fs::read_to_string(&victim).unwrap(), "precious");
    assert_eq!(std::fs::read_dir(own.path()).unwrap().count(), 1, "the scenario");
    assert_eq!(std::fs::read_dir(path("project")).unwrap().count(), 1);
    // A link of the same user is followed.
    std::fs::remove_file(&file).unwrap();
    symlink(victim.path(), &file).unwrap();
    run(&["export", "c", "--output", &file]).ok();
    assert_ne!(std::fs::read_to_string(&victim).unwrap(), "precious");
    assert!(files_of(&instance).is_empty());
}
