//! Emulators and commands as separate processes, for tests that drive the built program.
#![allow(dead_code, reason = "each test binary uses a part of it")]

mod tools;

#[allow(unused_imports, reason = "each test binary uses a part of it")]
pub(crate) use tools::{is_there, python, python_for, skipped};

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Lines, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, Once, mpsc};
use std::time::{Duration, Instant, SystemTime};

/// Time limit for each step of a test, even on a slow machine.
const WATCHDOG: Duration = Duration::from_secs(60);

/// Rules that are tolerated with a real-time clock: the machine's load then decides whether a process is in time.
const TOO_LATE: [&str; 2] = ["late-reference", "late-actual"];

/// Path of the program. In the tests of a crate with a separate device it is that crate's program.
const PROGRAM: &str =
    match (option_env!("CARGO_BIN_EXE_commram"), option_env!("CARGO_BIN_EXE_commram-invented")) {
        (Some(program), _) | (None, Some(program)) => program,
        (None, None) => panic!("these tests drive a program"),
    };

/// Returns a name that no other test and no other test run uses.
pub(crate) fn unique_name() -> String {
    static COUNTER: AtomicU32 = AtomicU32::new(0);
    format!("t{}-{}", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed))
}

/// Returns the program without the user's settings.
pub(crate) fn commram() -> Command {
    let mut command = Command::new(PROGRAM);
    command
        .env_remove("COMMRAM_INSTANCE")
        .env("COMMRAM_CONFIG", "")
        .env("COLUMNS", "100")
        .stdin(Stdio::null());
    // A missing instance will not appear during a test; tests of the connect timeout set it explicitly.
    command.env("COMMRAM_CONNECT_TIMEOUT", "0s");
    command
}

/// Returns the path of an example program. `cargo test` builds the examples only if it runs all tests, so this function
/// builds them unless they are newer than the sources. It does not always build them, because such a build has other
/// features than a build of the workspace, and cargo would compile all dependencies again.
pub(crate) fn example(name: &str) -> PathBuf {
    static BUILT: Once = Once::new();
    let example = PathBuf::from(PROGRAM).with_file_name("examples").join(name);
    BUILT.call_once(|| {
        if changed(&example).is_some_and(|built| built > newest_source()) {
            return;
        }
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--examples"]);
        if !cfg!(debug_assertions) {
            cargo.arg("--release");
        }
        assert!(cargo.status().unwrap().success());
    });
    example
}

/// Returns the modification time of a file, or `None` if the file does not exist.
fn changed(file: &Path) -> Option<SystemTime> {
    file.metadata().and_then(|data| data.modified()).ok()
}

/// Returns the time of the last change of the sources of an example.
fn newest_source() -> SystemTime {
    let sources =
        ["Cargo.lock", "Cargo.toml", "build.rs", "layouts", "src", "tools/examples", "tools/layoutc"];
    let mut waiting = sources.map(PathBuf::from).to_vec();
    let mut newest = SystemTime::UNIX_EPOCH;
    while let Some(path) = waiting.pop() {
        newest = newest.max(changed(&path).unwrap());
        if path.is_dir() {
            waiting.extend(path.read_dir().unwrap().map(|entry| entry.unwrap().path()));
        }
    }
    newest
}

/// Output of a command and its exit code.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

/// Runs the program with these arguments to its end.
pub(crate) fn run(args: &[&str]) -> Outcome {
    finish(commram().args(args))
}

/// Returns the names of all devices of the program, in the order of the registry.
pub(crate) fn devices() -> impl Iterator<Item = &'static str> {
    commram::devices::all().iter().map(|device| device.layout.name)
}

/// Runs a command to its end.
pub(crate) fn finish(command: &mut Command) -> Outcome {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let out = collect(child.stdout.take().unwrap());
    let err = collect(child.stderr.take().unwrap());
    let status = wait_for(&mut child, "a command");
    let text = |stream: mpsc::Receiver<String>| stream.recv_timeout(WATCHDOG).unwrap();
    Outcome { code: status.code(), out: text(out), err: text(err) }
}

/// Runs a shell script in a separate mount namespace, with the program as `$COMMRAM`. Prints a note and returns `None` if
/// the machine cannot provide a namespace, or if the script exits with 77 because it cannot mount.
pub(crate) fn in_mount_namespace(script: &str, instance: Option<&str>) -> Option<Outcome> {
    let mut shell = Command::new("unshare");
    shell.args(["--mount", "sh", "-c", script]).env("COMMRAM", commram().get_program());
    match instance {
        Some(name) => shell.env("COMMRAM_INSTANCE", name),
        None => shell.env_remove("COMMRAM_INSTANCE"),
    };
    let outcome = finish(&mut shell);
    if outcome.code == Some(77) || outcome.err.contains("unshare") {
        eprintln!("SKIPPED: no mount namespace: {}", outcome.err);
        return None;
    }
    Some(outcome)
}

/// Runs a command to its end with `/dev/full` as standard output.
pub(crate) fn finish_on_a_full_disk(command: &mut Command) -> Outcome {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut child = command.stdout(full).stderr(Stdio::piped()).spawn().unwrap();
    let err = collect(child.stderr.take().unwrap());
    let status = wait_for(&mut child, "a command");
    Outcome { code: status.code(), out: String::new(), err: err.recv_timeout(WATCHDOG).unwrap() }
}

fn collect(mut stream: impl Read + Send + 'static) -> mpsc::Receiver<String> {
    let (send, receive) = mpsc::channel();
    std::thread::spawn(move || {
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let _ = send.send(text);
    });
    receive
}

/// Waits for the end of a process; kills it and fails if it does not end.
pub(crate) fn wait_for(child: &mut Child, what: &str) -> ExitStatus {
    let mut status = None;
    let ended = eventually(|| {
        status = child.try_wait().unwrap();
        status.is_some()
    });
    if !ended {
        let _ = child.kill();
        let _ = child.wait();
        panic!("{what} did not end within {WATCHDOG:?}");
    }
    status.unwrap()
}

/// Returns the fields of `/proc/<pid>/stat` after the process name: state, parent, group, session and more.
pub(crate) fn stat(pid: &str) -> Vec<String> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    stat.rsplit(')').next().unwrap().split_ascii_whitespace().map(str::to_owned).collect()
}

/// Fails unless `act` keeps the promise of docs/internals/promises.md. The limit is ten times `figure`, because a
/// test machine may be slow.
pub(crate) fn promised<T>(figure: Duration, act: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let done = act();
    let took = start.elapsed();
    assert!(took < 10 * figure, "promised within {figure:?}, it took {took:?}");
    done
}

/// Returns whether the condition becomes true within the watchdog time.
pub(crate) fn eventually(mut condition: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    loop {
        if condition() {
            return true;
        }
        if start.elapsed() > WATCHDOG {
            return false;
        }
        // Pauses between two polls; the pause is no estimate of the duration.
        std::thread::sleep(Duration::from_millis(2));
    }
}

impl Outcome {
    /// Returns the output of a command that must succeed without text on stderr.
    #[track_caller]
    pub(crate) fn ok(&self) -> &str {
        assert_eq!((self.code, self.err.as_str()), (Some(0), ""), "stdout: {}", self.out);
        &self.out
    }

    /// Returns the error message of a command that must fail with this exit code.
    #[track_caller]
    pub(crate) fn fails(&self, code: i32) -> &str {
        assert_eq!(self.code, Some(code), "stdout: {}\nstderr: {}", self.out, self.err);
        assert_eq!(self.out, "", "a command that fails prints nothing");
        assert!(self.err.starts_with("commram: "), "{}", self.err);
        &self.err
    }
}

/// A running command that shows events of an emulator.
pub(crate) struct Follower {
    pub child: Child,
    pub lines: Lines<BufReader<ChildStdout>>,
    notes: Lines<BufReader<ChildStderr>>,
}

impl Follower {
    pub(crate) fn start(emulator: &Emulator, subcommand: &str, args: &[&str]) -> Self {
        let mut command = emulator.command(subcommand, args);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let notes = BufReader::new(child.stderr.take().unwrap()).lines();
        Self { child, lines, notes }
    }

    /// Returns the next line of the process on stdout.
    pub(crate) fn line(&mut self) -> String {
        self.lines.next().expect("a line").unwrap()
    }

    /// Returns the next line of the process on stderr.
    pub(crate) fn note(&mut self) -> String {
        self.notes.next().expect("a note").unwrap()
    }

    /// Returns the exit code and the rest of both outputs.
    pub(crate) fn end(mut self) -> (Option<i32>, Vec<String>, String) {
        let rest = self.lines.map(Result::unwrap).collect();
        let status = wait_for(&mut self.child, "a command that follows");
        let err = self.notes.map(|note| note.unwrap() + "\n").collect();
        (status.code(), rest, err)
    }
}

/// A running emulator. It is killed, and its files are removed, when this value is dropped.
pub(crate) struct Emulator {
    pub name: String,
    /// Line that the emulator printed when it was ready.
    pub ready: String,
    child: Child,
    /// Lines of the emulator's stderr. The mutex is needed only because threads share an emulator.
    err: Mutex<Option<mpsc::Receiver<String>>>,
    /// Errors that the access checker must find in this test. Any other error, or a missing one, fails the test.
    expected: Mutex<Vec<&'static str>>,
    /// Errors that the access checker may find in this test.
    tolerated: &'static [&'static str],
}

impl Emulator {
    /// Starts `commram run` with a unique instance name and waits until it is ready.
    pub(crate) fn start(args: &[&str]) -> Self {
        Self::start_as(&unique_name(), args)
    }

    /// Starts an emulator with the built-in plant and the stepped clock.
    pub(crate) fn stepped() -> Self {
        Self::start(&["--clock", "stepped"])
    }

    /// Starts an instance of the given name.
    pub(crate) fn start_as(name: &str, args: &[&str]) -> Self {
        Self::start_with(name, args, &[])
    }

    /// Does the same as [`Emulator::start_as`], with these variables in its environment.
    pub(crate) fn start_with(name: &str, args: &[&str], environment: &[(&str, &OsStr)]) -> Self {
        let mut command = commram();
        command.envs(environment.iter().copied());
        Self::start_by(command, name, args)
    }

    /// Does the same as [`Emulator::start_as`] by a command that has only the program so far.
    pub(crate) fn start_by(mut command: Command, name: &str, args: &[&str]) -> Self {
        command.arg("run").args(args).args(["-i", name]).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let err = collect(child.stderr.take().unwrap());
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let tolerated = if args.contains(&"stepped") { &[][..] } else { &TOO_LATE };
        let mut this = Self {
            name: name.to_owned(),
            ready: String::new(),
            child,
            err: Mutex::new(Some(err)),
            expected: Mutex::default(),
            tolerated,
        };
        let (send, receive) = mpsc::channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let _ = out.read_line(&mut line);
            let _ = send.send(line);
            // Reads and drops later output, so that a full pipe does not block the emulator.
            let _ = std::io::copy(&mut out, &mut std::io::sink());
        });
        this.ready = receive.recv_timeout(WATCHDOG).unwrap_or_default();
        if this.ready.is_empty() {
            let status = this.wait();
            panic!("the emulator did not get ready ({status}): {}", this.complaints());
        }
        this
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Returns a subcommand on this instance.
    pub(crate) fn command(&self, subcommand: &str, args: &[&str]) -> Command {
        let mut command = commram();
        command.arg(subcommand).args(args).args(["-i", &self.name]);
        command
    }

    /// Runs a subcommand on this instance to its end.
    pub(crate) fn run(&self, subcommand: &str, args: &[&str]) -> Outcome {
        finish(&mut self.command(subcommand, args))
    }

    /// Returns the bare numbers of registers in one line.
    #[track_caller]
    pub(crate) fn peek(&self, registers: &[&str]) -> String {
        let outcome = self.run("peek", &[&["--raw"], registers].concat());
        outcome.ok().lines().collect::<Vec<_>>().join(" ")
    }

    /// Writes registers. A register of the firmware causes a note on stderr.
    #[track_caller]
    pub(crate) fn poke(&self, writes: &[&str]) {
        let outcome = self.run("poke", writes);
        let is_note = |line: &str| line.starts_with("commram: note: only the firmware writes ");
        assert!(outcome.code == Some(0) && outcome.err.lines().all(is_note), "{}", outcome.err);
    }

    #[track_caller]
    pub(crate) fn step(&self, args: &[&str]) -> String {
        self.run("step", args).ok().trim_end().to_owned()
    }

    /// Puts node 2 of the built-in plant into set-up mode with the expected drives 1 to 3, in the order of the manual
    /// (p. 132 and 150). `writes` are the PLC's first writes in the cyclic structure. In stepped mode.
    #[track_caller]
    pub(crate) fn set_up(&self, writes: &[&str]) {
        let init = [
            "node2.b_MA_SL_MODE=16#00",
            "node2.b_AC=16#FF",
            "node2.b_AM=16#FF",
            "node2.b_BT_0=16#00",
            "node2.b_BT_1=16#1C",
            "node2.b_OUTPUT_CONTROL=16#FA",
            "node2.b_CLOCK_DIVIDER=16#07",
            "node2.b_TIME_PATTERN=2",
            "node2.a_SL_TYP[1]=16#01",
            "node2.a_SL_TYP[2]=16#01",
            "node2.a_SL_TYP[3]=16#01",
        ];
        for (writes, command, status) in [
            (&[][..], "16#0000", "16#0001"),
            (&[], "16#0001", "16#0002"),
            (&init, "16#0002", "16#0003"),
            // The firmware has cleared the cyclic structure when it took over the initialization data.
            (writes, "16#0020", "16#0043"),
        ] {
            let command = format!("node2.w_CPU_CONTROL={command}");
            self.poke(&[writes, &[&command]].concat());
            let condition = format!("node2.w_OPTION_STATUS=={status}");
            self.run("wait", &[&condition, "--within", "10ms"]).ok();
        }
    }

    pub(crate) fn signal(&self, signal: &str) {
        let pid = self.pid().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
    }

    /// Kills the emulator like `kill -9`.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub(crate) fn wait(&mut self) -> ExitStatus {
        wait_for(&mut self.child, "the emulator")
    }

    /// Returns everything that the emulator has printed on stderr. The emulator must have ended.
    pub(crate) fn complaints(&mut self) -> String {
        self.err.get_mut().unwrap().take().and_then(|err| err.recv_timeout(WATCHDOG).ok()).unwrap_or_default()
    }

    /// Names the rules that this test violates on purpose. All of them are errors; warnings are never checked.
    pub(crate) fn breaks(&self, rules: &[&'static str]) {
        *self.expected.lock().unwrap() = rules.to_vec();
    }

    /// Checks the findings of the access checker at the end of every test, if the emulator still answers.
    fn assert_no_other_errors(&mut self) {
        let outcome = self.run("check", &["--format", "json"]);
        if outcome.code == Some(3) {
            let ends = eventually(|| self.child.try_wait().is_ok_and(|status| status.is_some()));
            assert!(ends, "it goes on, but cannot be asked: {}", outcome.err);
            return;
        }
        let findings: Vec<serde_json::Value> = serde_json::from_str(&outcome.out).unwrap();
        let errors = findings.iter().filter(|finding| finding["severity"] == "error");
        let mut found: Vec<_> = errors.filter_map(|finding| finding["rule"].as_str()).collect();
        found.retain(|rule| !self.tolerated.contains(rule));
        let mut expected = self.expected.lock().unwrap().clone();
        for rules in [&mut found, &mut expected] {
            rules.sort_unstable();
            rules.dedup();
        }
        assert_eq!(found, expected, "errors that the access checker has found: {}", outcome.out);
    }

    /// Returns the files of this instance in /dev/shm.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        files_of(&self.name)
    }
}

/// Returns the files in /dev/shm with the name of an instance in their names.
pub(crate) fn files_of(instance: &str) -> Vec<PathBuf> {
    let prefix = format!("commram.{instance}.");
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    let own = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix));
    own.map(|entry| entry.path()).collect()
}

impl Drop for Emulator {
    fn drop(&mut self) {
        /// Ends the process and removes its files, also if the check of the findings fails the test.
        struct End<'a>(&'a mut Emulator);
        impl Drop for End<'_> {
            fn drop(&mut self) {
                self.0.end();
            }
        }
        let end = End(self);
        let is_running = end.0.child.try_wait().is_ok_and(|status| status.is_none());
        if is_running && !std::thread::panicking() {
            end.0.assert_no_other_errors();
        }
    }
}

impl Emulator {
    fn end(&mut self) {
        if self.child.try_wait().is_ok_and(|status| status.is_none()) {
            let _ = Command::new("kill").args(["-TERM", &self.child.id().to_string()]).status();
            let ended = eventually(|| self.child.try_wait().is_ok_and(|status| status.is_some()));
            if !ended {
                let _ = self.child.kill();
                let _ = self.child.wait();
            }
        }
        remove_remains(&self.name);
    }
}

/// Removes the files of a killed emulator, including the unnamed parts of its channel.
pub(crate) fn remove_remains(instance: &str) {
    if !files_of(instance).is_empty() {
        let _ = commram().args(["stop", "--clean", "-i", instance]).output();
    }
    for path in files_of(instance) {
        let _ = std::fs::remove_file(&path);
        let _ = std::fs::remove_dir_all(&path);
    }
}
