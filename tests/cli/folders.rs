//! Devices of folders: registered while the program runs, with names in every command.

use crate::common::{Emulator, eventually, finish, is_there, python, run, skipped, stat};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest real time of the load beside a script, so that a failed test ends.
const LONGEST_LOAD: Duration = Duration::from_secs(60);

const EXAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/digital-io");

/// A directory with a copy of an example device, and with a plant that contains the device.
pub(crate) struct Place(tempfile::TempDir);

impl Place {
    pub(crate) fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        fs::create_dir_all(place.card()).unwrap();
        for entry in fs::read_dir(EXAMPLE).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                fs::copy(&path, place.card().join(path.file_name().unwrap())).unwrap();
            }
        }
        place.write("plant.toml", "[[device]]\nname = 'io'\nkind = './cards/digital-io'\n");
        place
    }

    fn card(&self) -> PathBuf {
        self.0.path().join("cards/digital-io")
    }

    pub(crate) fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.0.path().join(name), text).unwrap();
    }

    /// Replaces a text that a file of the card has once.
    fn edit(&self, file: &str, from: &str, to: &str) {
        let path = self.card().join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches(from).count(), 1, "{from}: {text}");
        fs::write(&path, text.replace(from, to)).unwrap();
    }

    fn refused(&self) -> String {
        run(&["plant", "check", &self.path("plant.toml")]).fails(2).to_owned()
    }
}

#[test]
fn a_folder_is_a_device_in_every_command() {
    let place = Place::new();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.poke(&["io:data.w_OUT=16#1234"]);
    assert_eq!(emulator.peek(&["data.w_OUT", "%MW3.16"]), "16#1234 16#1234");
    let dump = emulator.run("dump", &[]);
    assert!(dump.ok().contains("data.w_OUT") && dump.out.contains("%MW3.16"), "{}", dump.out);
    assert!(emulator.run("status", &[]).ok().contains("digital-io"));

    // These names exist only in the folder, not in a device that is built into the program.
    for block in ["data", "io:data", "data.*", "%MW3.16"] {
        assert!(emulator.run("dump", &[block]).ok().contains("data.w_OUT"), "{block}");
    }
    assert!(emulator.run("dump", &["date"]).fails(2).contains("did you mean data?"));
    place.write("before.json", emulator.run("dump", &["--full", "--format", "json"]).ok());
    assert_eq!(emulator.run("diff", &[&place.path("before.json")]).ok(), "no differences\n");
    emulator.poke(&["data.w_OUT=16#4321"]);
    let changed = emulator.run("diff", &[&place.path("before.json")]);
    assert!(changed.code == Some(1) && changed.out.contains("16#4321"), "{}", changed.out);
    emulator.poke(&["data.w_OUT=16#1234"]);

    let found = run(&["find", "toggle", "--device", &place.path("cards/digital-io")]);
    assert!(found.ok().contains("w_TOGGLE_ACK"), "{}", found.out);

    // The registers have owners and reserved bits, so the access checker checks them.
    emulator.breaks(&["owner"]);
    emulator.poke(&["data.w_IN=7"]);
    emulator.step(&["10ms"]);
    let check = emulator.run("check", &["--format", "csv"]);
    assert!(check.out.contains("data.w_IN"), "{}", check.out);
}

#[test]
fn the_map_and_the_exports_read_a_folder_without_an_emulator() {
    let map = run(&["map", "control.w_COMMAND", "--device", EXAMPLE]);
    assert!(map.ok().contains("enable the outputs"), "{}", map.out);
    for format in ["c", "python", "csv", "json", "md", "st", "svd", "systemrdl", "matiec"] {
        let export = run(&["export", format, "--device", EXAMPLE]);
        assert!(export.ok().contains("w_COMMAND") || format == "matiec", "{format}: {}", export.out);
        // The head names the device and the command that makes the export again. An XML comment has no `--`.
        if ["c", "python", "md", "st", "systemrdl", "matiec"].contains(&format) {
            let command = format!("commram export {format} --device {EXAMPLE}");
            assert!(export.out.contains(&command), "{format}");
        }
        if !["csv", "json"].contains(&format) {
            assert!(export.out.contains(&format!("device digital-io in the folder {EXAMPLE}")), "{format}");
        }
    }
    let place = Place::new();
    fs::rename(place.card(), place.card().with_file_name("digital io *)")).unwrap();
    let export = run(&["export", "c", "--device", &place.path("cards/digital io *)")]);
    let command = format!("commram export c --device {}", place.path("cards/digital?io??"));
    assert!(export.ok().contains(&command), "{}", export.out);
    let unknown = run(&["map", "--device", "./no-such-folder"]);
    assert!(unknown.fails(2).contains("name a folder with a device.toml"), "{}", unknown.err);
    let unnamed = run(&["map", "--device", "digital-io"]);
    assert!(unnamed.fails(2).contains("[possible values: omega-drive-line-2, "), "{}", unnamed.err);
}

/// The word that shows the state of the script is in no manual.
#[test]
fn a_word_without_a_page_has_no_page_in_maps_and_exports() {
    let place = Place::new();
    place.write("cards/digital-io/firmware.rhai", "fn power_on() {}");
    let card = place.path("cards/digital-io");
    let map = run(&["map", "--device", &card]);
    assert!(map.ok().contains("FRONT_WORDS: What the device has at its front\n"), "{}", map.out);
    let detail = run(&["map", "front.script", "--device", &card]);
    assert!(!detail.ok().contains("  manual  "), "{}", detail.out);
    let exports = ["c", "st", "python", "systemrdl", "md"];
    let exports = exports.map(|format| run(&["export", format, "--device", &card]));
    for text in [map, detail].iter().chain(&exports).map(|outcome| outcome.ok()) {
        for wrong in ["(p. )", "(p. ;", "p.    ", "p. \n"] {
            assert!(!text.contains(wrong), "{wrong}: {text}");
        }
    }
}

/// The names of exported padding belong to no register.
#[test]
fn a_register_may_have_the_name_of_padding() {
    let place = Place::new();
    place.edit("IO_DATA.toml", "name = \"w_IN\"", "name = \"padding_4\"");
    for file in ["handshakes.toml", "exercise.rhai"] {
        fs::remove_file(place.card().join(file)).unwrap();
    }
    for (format, register, padding) in
        [("c", " padding_4; /*", "uint8_t padding_4_2[4];"), ("st", " padding_4 : WORD", " padding_4_2 : ")]
    {
        let export = run(&["export", format, "--device", &place.path("cards/digital-io")]);
        assert!(export.ok().contains(register) && export.out.contains(padding), "{}", export.out);
        assert!(!export.out.contains("padding_4["), "{}", export.out);
    }
}

#[test]
fn handshakes_of_a_table_pass_their_scenario() {
    let outcome = run(&["test", &format!("{EXAMPLE}/tests/card.rhai")]);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
    let check = run(&["device", "check", EXAMPLE, "--format", "csv"]);
    for row in [
        "answer,control.w_COMMAND,",
        "watchdog,control.w_WATCHDOG,",
        "mirror,data.w_OUT,appears in data.w_IN,5,manual",
    ] {
        assert!(check.out.contains(row), "{row}: {}", check.out);
    }
    assert!(
        check.err.contains("digital-io (Digital I/O card): 2 areas, 8 registers, 6 handshakes"),
        "{}",
        check.err
    );
}

/// Every example has its own scenarios.
#[test]
fn the_examples_pass_their_scenarios() {
    let examples = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices");
    let mut count = 0;
    for entry in fs::read_dir(examples).unwrap() {
        let dir = entry.unwrap().path();
        let outcome = run(&["device", "test", dir.to_str().unwrap()]);
        assert!(outcome.ok().contains(" passed, 0 failed, 0 broken"), "{}", outcome.out);
        let files = fs::read_dir(&dir).unwrap().map(|entry| entry.unwrap().path());
        let texts = files.filter(|path| path.is_file()).map(|path| fs::read_to_string(path).unwrap());
        let lines: usize = texts.map(|text| text.lines().count()).sum();
        // The dual-port memory is a real device; the other folders are short examples.
        assert!(lines <= 120 || dir.ends_with("netx-dpm"), "{}: {lines} lines", dir.display());
        count += 1;
    }
    assert!(count >= 5);
    let missing = run(&["device", "test", examples]);
    assert!(missing.fails(2).contains("device.toml"), "{}", missing.err);
}

/// The examples run in `soak`, which runs each one in two ways. Both ways must have the same journal.
#[test]
fn the_examples_pass_rounds_of_soak() {
    // A round of the dual-port memory takes as long as several rounds of a small card.
    for (example, rounds) in
        [("digital-io", "12"), ("mailbox", "12"), ("encoder", "12"), ("can-sensor", "12"), ("netx-dpm", "3")]
    {
        let dir = format!("{}/tools/devices/{example}", env!("CARGO_MANIFEST_DIR"));
        let keep = tempfile::tempdir().unwrap();
        let keep = keep.path().to_str().unwrap();
        let soak = run(&["soak", "--seed", "7", "--rounds", rounds, "--exercise", &dir, "--keep", keep]);
        // On a slow machine the command prints notes.
        assert_eq!(soak.code, Some(0), "{example}: {}{}", soak.out, soak.err);
    }
}

/// The vendor's own library opens the dual-port memory and passes every step, in real time and in emulated time. It also
/// exchanges bytes with a DP slave.
#[test]
fn libcifx_drives_the_netx() {
    if std::env::var_os("COMMRAM_LIBCIFX").is_none() {
        return skipped("libcifx", "COMMRAM_LIBCIFX is not set");
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/netx/run");
    let outcome = finish(Command::new(script).arg(env!("CARGO_BIN_EXE_commram")));
    let steps = outcome.ok();
    let passed = |step: &str| steps.lines().filter(|line| line.ends_with(step)).count();
    assert_eq!((passed("done"), passed("communicating without triggers")), (3, 2), "{steps}");
    assert_eq!(passed("DP slave: outputs 12 34, inputs 56 78"), 1, "{steps}");
}

/// Each mistake in an exercise has its file and the correct form.
#[test]
fn wrong_exercises_are_refused() {
    let wrong = [
        ("fn start( {", "exercise.rhai:1: "),
        ("fn recover() {}", "has a function start()"),
        ("fn start() {}\nfn recover() {}", "write `const MOVES = #{ name: [[0, 10]] };`"),
        ("const MOVES = #{ a: [[1, 0]] };\nfn start() {}\nfn recover() {}", "write `const MOVES"),
        (
            "const MOVES = #{ a: [[0, 1]] };\nfn start() {}\nfn recover() {}\nfn a(right) {}",
            "a function of 2 parameters",
        ),
        ("loop {}", "exercise.rhai:1: its constants"),
        ("import \"other\" as other;", "its constants"),
        ("poke(\"control.w_COMMAND\", 5);", "its constants"),
    ];
    for (text, message) in wrong {
        let place = Place::new();
        fs::write(place.card().join("exercise.rhai"), text).unwrap();
        let refused = run(&["device", "check", &place.path("cards/digital-io")]);
        assert!(refused.fails(2).contains(message), "{text}: {}", refused.err);
    }
    let place = Place::new();
    fs::remove_file(place.card().join("exercise.rhai")).unwrap();
    let refused = run(&["soak", "--exercise", &place.path("cards/digital-io")]);
    assert!(refused.fails(2).contains("has no exercise.rhai"), "{}", refused.err);
}

/// An error of the script has its place in the journal, and the front panel shows it.
#[test]
fn a_stopped_script_is_visible_in_every_command() {
    let place = Place::new();
    let script = "fn written(register, old, value) {\n    throw \"no such output\";\n}\n";
    fs::write(place.card().join("firmware.rhai"), script).unwrap();
    let check = run(&["device", "check", &place.path("cards/digital-io")]);
    assert!(check.err.contains("6 handshakes, script with 1 hook, "), "{}", check.err);
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    assert!(emulator.run("board", &["get"]).ok().contains("script running"));
    emulator.poke(&["io:data.w_OUT=1"]);
    emulator.step(&["1ms"]);
    assert!(emulator.run("board", &["get"]).ok().contains("script stopped"));
    let trace = emulator.run("trace", &[]);
    assert!(trace.ok().contains("script stopped: firmware.rhai:2: no such output"), "{}", trace.out);
    let json = emulator.run("trace", &["--kind", "stopped", "--format", "jsonl"]);
    assert!(json.ok().contains("\"text\":\"firmware.rhai:2: no such output\""), "{}", json.out);
    emulator.breaks(&["script-stopped"]);
    let check = emulator.run("check", &[]);
    assert_eq!(check.code, Some(1), "{}", check.out);
    assert!(check.out.contains("front.script: firmware.rhai:2: no such output"), "{}", check.out);
    let json = emulator.run("check", &["--format", "json"]);
    assert!(json.out.contains("\"note\": \"firmware.rhai:2: no such output\""), "{}", json.out);
    let status = emulator.run("status", &[]);
    assert!(status.ok().contains("script of io: stopped"), "{}", status.out);
    assert!(emulator.run("status", &["--format", "json"]).out.contains("\"script\": \"stopped\""));
    // The tables of handshakes still work after the error of the script.
    emulator.step(&["20ms"]);
    assert_eq!(emulator.peek(&["data.w_IN"]), "16#0001");
}

/// A name without a path is searched in the configuration, then in the data directory of the user.
#[test]
fn a_folder_is_found_by_its_name_in_the_search_path() {
    let place = Place::new();
    let of_user = place.0.path().join("data/commram/devices");
    fs::create_dir_all(&of_user).unwrap();
    fs::rename(place.card(), of_user.join("digital-io")).unwrap();
    place.write("plant.toml", "[[device]]\nname = 'io'\nkind = 'digital-io'\n");
    place.write("wrong.toml", "[[device]]\nname = 'io'\nkind = 'digital-oi'\n");
    place.write("commram.toml", "devices = ['cards']\n");
    let run_at = |config: &str, args: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_commram"));
        command.args(args).current_dir(place.0.path()).env("COMMRAM_CONFIG", config);
        let outcome = command.env("XDG_DATA_HOME", place.0.path().join("data")).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (outcome.status.code(), text(&outcome.stdout) + &text(&outcome.stderr))
    };
    let found = run_at("", &["plant", "check", "plant.toml"]);
    assert_eq!(found.0, Some(0), "{}", found.1);
    let map = run_at("", &["map", "--device", "digital-io", "data.w_OUT"]);
    assert!(map.0 == Some(0) && map.1.contains("The 16 outputs"), "{}", map.1);
    let wrong = run_at("", &["plant", "check", "wrong.toml"]);
    assert!(wrong.0 == Some(2) && wrong.1.contains("digital-io"), "{}", wrong.1);
    // The configuration comes first.
    fs::create_dir_all(place.card()).unwrap();
    for entry in fs::read_dir(of_user.join("digital-io")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, place.card().join(path.file_name().unwrap())).unwrap();
    }
    place.edit("IO_DATA.toml", "The 16 outputs", "Outputs of the configuration");
    let map = run_at("commram.toml", &["map", "--device", "digital-io", "data.w_OUT"]);
    assert!(map.0 == Some(0) && map.1.contains("Outputs of the configuration"), "{}", map.1);
    // A scenario runs in a separate process.
    fs::remove_dir_all(of_user).unwrap();
    place.write("one.rhai", "plant(\"plant.toml\"); expect(\"data.w_OUT\", 0);");
    let test = run_at("commram.toml", &["test", "one.rhai"]);
    assert_eq!(test.0, Some(0), "{}", test.1);
    let verbose = run_at("commram.toml", &["-v", "list"]);
    assert!(verbose.1.contains("devices = ") && verbose.1.contains("/cards"), "{}", verbose.1);
}

/// Each mistake in a table of handshakes has its line and the correct form.
#[test]
fn a_script_that_is_too_slow_stops_and_the_emulator_answers() {
    let place = Place::new();
    // The steps count neither the size of values that a call builds in `this`, nor copies of these values.
    let script =
        "fn poll() {\n    this.n = [];\n    this.n.pad(2000, []);\n    while true { [this.n]; }\n}\n";
    fs::write(place.card().join("firmware.rhai"), script).unwrap();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.breaks(&["script-stopped"]);
    emulator.step(&["50ms"]);
    let trace = emulator.run("trace", &["--kind", "stopped"]);
    assert!(trace.ok().contains("firmware.rhai:1: the script is too slow"), "{}", trace.out);
}

/// Processor time that a process has used. The process may have ended, as long as its parent has not read its exit code.
fn processor_time(pid: u32) -> Duration {
    let fields = stat(&pid.to_string());
    let ticks = |field: usize| fields[field].parse::<u64>().unwrap();
    // User and system time, in ticks of 10 ms.
    Duration::from_millis(10 * (ticks(11) + ticks(12)))
}

/// The limit of steps stops scripts whose verbs take long, so their journals do not depend on the speed of the machine.
#[test]
fn the_journal_of_a_slow_script_does_not_depend_on_the_load() {
    // The interpreter of a debug build is slower, and the script must not reach its limit of processor time.
    let elements = if cfg!(debug_assertions) { 30 } else { 2000 };
    let array = format!("let a = []; a.pad({elements}, 7); this.a = a;");
    let text = format!("let s = \"a\"; s.pad({elements}, \",\");");
    let count = "if i % 100 == 0 { journal(\"call \" + i); }";
    let scripts = [
        format!("fn poll() {{ {array} for i in 0..60000 {{ let b = a; {count} }} }}"),
        format!("fn poll() {{ {text} for i in 0..60000 {{ s.split(\",\"); {count} }} }}"),
        format!(
            "fn power_on() {{ {array} this.n = 0; for i in 0..60 {{ at(now() + i, \"f\"); }} }}\n\
             fn f() {{ let a = this.a; this.n += 1; let i = this.n; {count} at(now(), \"f\"); }}"
        ),
    ];
    for script in scripts {
        let steps: [(bool, &[&str]); 3] = [(false, &["2ms"]), (true, &["2ms"]), (false, &["500us"; 4])];
        let found = steps.map(|(is_loaded, steps)| {
            let place = Place::new();
            fs::write(place.card().join("firmware.rhai"), &script).unwrap();
            let is_over = AtomicBool::new(!is_loaded);
            std::thread::scope(|scope| {
                for _ in 0..4 {
                    scope.spawn(|| {
                        let start = Instant::now();
                        while !is_over.load(Ordering::Relaxed) && start.elapsed() < LONGEST_LOAD {
                            std::hint::spin_loop();
                        }
                    });
                }
                let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
                emulator.breaks(&["script-stopped"]);
                steps.iter().for_each(|step| drop(emulator.step(&[step])));
                let trace = emulator.run("trace", &[]);
                is_over.store(true, Ordering::Relaxed);
                trace.ok().to_owned()
            })
        });
        assert!(found[0].contains("it takes more than 200000 steps"), "{script}: {found:#?}");
        assert!(found.iter().all(|it| *it == found[0]), "{script}: {found:#?}");
    }
}

/// Scripts that use many of their steps for slow verbs, in each processor cycle. The test measures processor time, so it
/// does not depend on the load of the machine.
#[test]
fn a_script_that_uses_all_its_steps_delays_no_answer() {
    // The interpreter of a debug build is slower, and the script must not reach its limit of processor time.
    let count = |release, debug| if cfg!(debug_assertions) { debug } else { release };
    let scripts = [
        format!(
            "let s = \"x\"; s.pad(4000, \"y\"); for i in 0..{} {{ let t = s.replace(\"y\", \"z\"); }}",
            count(4000, 225)
        ),
        format!(
            "let a = []; for i in 0..1000 {{ a.push((i * 7919) % 2003); }} for j in 0..{} {{ let b = a; b.sort(); }}",
            count(120, 10)
        ),
        format!(
            "for i in 0..{} {{ violation(\"control.w_COMMAND\", \"t\" + i + now()); }}",
            count(1500, 125)
        ),
        format!("for i in 0..{} {{ read_all(\"data.*\"); }}", count(6000, 500)),
    ];
    let longest = Duration::from_secs(2);
    for (script, clock) in scripts.iter().flat_map(|script| [(script, "stepped"), (script, "realtime")]) {
        let place = Place::new();
        fs::write(place.card().join("firmware.rhai"), format!("fn poll() {{ {script} }}\n")).unwrap();
        let mut emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", clock]);
        let pid = emulator.pid();
        let mut stepping = (clock == "stepped").then(|| {
            let mut step = emulator.command("step", &["1h"]);
            step.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
        });
        let before = processor_time(pid);
        assert!(
            eventually(|| processor_time(pid) > before + Duration::from_millis(300)),
            "{script}: is idle"
        );

        let asked = processor_time(pid);
        emulator.run("status", &[]).ok();
        let took = processor_time(pid) - asked;
        assert!(took < longest, "{clock} {script}: status after {took:?}");
        assert_eq!(emulator.run("trace", &["--kind", "stopped"]).out, "", "{script}");
        if clock == "realtime" {
            let says = |late: bool| {
                eventually(|| emulator.run("status", &[]).ok().contains(" s late") == late)
                    && emulator.run("trace", &["--kind", "late"]).ok().contains("no longer late") != late
            };
            assert!(says(true), "{script}: {}", emulator.run("status", &[]).out);
            // A change of the speed drops the time by which the clock is late. The plant first advances by up to 100 ms of
            // emulated time, for which a client may be too impatient.
            emulator.run("speed", &["0.001"]);
            assert!(says(false), "{script}: {}", emulator.run("trace", &["--kind", "late"]).out);
        }

        let asked = processor_time(pid);
        emulator.run("stop", &[]);
        let took = processor_time(pid) - asked;
        assert!(took < longest, "{clock} {script}: stop after {took:?}");
        assert_eq!(emulator.wait().code(), Some(0));
        if let Some(step) = &mut stepping {
            step.wait().unwrap();
        }
    }
}

#[test]
fn wrong_handshakes_are_refused_with_their_line() {
    let wrong = [
        ("after = \"1ms\"", "after = \"soon\"", ":12: ", "`soon` is no time"),
        ("request = 0x05", "request = 0x12345", ":10: ", "does not fit the register of 16 bits"),
        ("answer = 0x04", "answer = 0x05", ":11: ", "the answer is the request"),
        ("register = \"control.w_COMMAND\"", "register = \"control.w_COMMANDO\"", ":9: ", "w_COMMANDO"),
        (
            "register = \"control.w_COMMAND\"",
            "register = \"control.w_STATUS\"",
            ":9: ",
            "has the owner \"both\"",
        ),
        ("every = \"1ms\"", "every = \"1us\"", ":27: ", "it is at least 100 us"),
        ("to = \"data.w_IN\"", "to = \"control.ud_CYCLES\"", ":41: ", "have other registers"),
        ("to = \"data.w_IN\"", "to = \"control.w_TOGGLE\"", ":41: ", "the program writes control.w_TOGGLE"),
        ("set = 0x0002", "set = 0x0002, value = 1", ":13: ", "either a `value`, or different bits"),
        (
            "register = \"control.w_WATCHDOG\"",
            "register = \"control.w_STATUS\"",
            ":32: ",
            "only the device writes control.w_STATUS",
        ),
        ("bits = 0x0001", "bits = 0x0001\ncolour = 1", ":21: ", "unknown field `colour`"),
        ("answer = 0x04", "answer = 0x04\nthen = 5", ":12: ", "the device would answer itself"),
        ("answer = 0x04", "answer = 0x04\nthen_after = \"1ms\"", ":12: ", "`then_after` needs `then`"),
        (
            "[[toggle]]",
            "[[answer]]\nregister = \"control.w_COMMAND\"\nrequest = 5\nanswer = 6\npage = \"3\"\nsource = \"manual\"\n[[toggle]]",
            ":19: ",
            "another table answers this request",
        ),
    ];
    for (from, to, line, message) in wrong {
        let place = Place::new();
        place.edit("handshakes.toml", from, to);
        let refused = run(&["device", "check", &place.path("cards/digital-io")]).fails(2).to_owned();
        assert!(
            refused.contains(&format!("handshakes.toml{line}")) && refused.contains(message),
            "{to}: {refused}"
        );
    }
}

/// The name of a file or of a function in the folder is wrong, so the file would not be read, or the function not
/// called. The error names it.
#[test]
fn misnamed_files_are_refused_and_others_are_named() {
    for (name, wrong) in [("handshakes.toml", "handshake.toml"), ("handshakes.toml", "Handshakes.toml")] {
        let place = Place::new();
        fs::rename(place.card().join(name), place.card().join(wrong)).unwrap();
        let refused = place.refused();
        assert!(refused.contains(wrong) && refused.contains("did you mean handshakes.toml?"), "{refused}");
    }
    let place = Place::new();
    fs::write(place.card().join("Firmware.rhai"), "fn poll() {}").unwrap();
    assert!(place.refused().contains("did you mean firmware.rhai?"), "{}", place.refused());
    let place = Place::new();
    fs::write(place.card().join("firmware.rhai"), "import \"helper\" as helper;").unwrap();
    for name in ["helper.rhai", "other.rhai", "notes.toml", ".hidden.toml", "readme.md"] {
        fs::write(place.card().join(name), "").unwrap();
    }
    let check = run(&["device", "check", &place.path("cards/digital-io")]);
    assert_eq!(check.code, Some(0), "{}", check.err);
    let named: Vec<_> = check.err.lines().filter(|line| line.contains("does not read this file")).collect();
    assert!(
        named.len() == 2 && named[0].contains("notes.toml") && named[1].contains("other.rhai"),
        "{}",
        check.err
    );
}

/// A snapshot has the absolute path, and belongs to the files of the folder.
#[test]
fn a_snapshot_continues_with_the_same_files_only() {
    let place = Place::new();
    let saved = place.path("saved.snapshot");
    {
        let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
        emulator.poke(&["data.w_OUT=16#55AA"]);
        emulator.step(&["10ms"]);
        emulator.run("snapshot", &[&saved]).ok();
    }
    let emulator = Emulator::start(&["--from", &saved, "--clock", "stepped"]);
    assert_eq!(emulator.peek(&["data.w_OUT"]), "16#55AA");
    place.edit("IO_DATA.toml", "The 16 outputs", "The outputs");
    let refused = run(&["run", "--from", &saved]);
    let message = refused.fails(1);
    assert!(message.contains("a file of PLC 'io' has changed since the snapshot, in /"), "{message}");
    assert!(message.contains("digital-io; restore it"), "{message}");
}

/// A snapshot has the files that the device uses.
#[test]
fn a_script_that_no_other_script_imports_may_change_after_a_snapshot() {
    let place = Place::new();
    let write = |name: &str, text: &str| fs::write(place.card().join(name), text).unwrap();
    write("firmware.rhai", "import \"helper\" as helper;\nfn poll() { helper::count(); }");
    write("helper.rhai", "fn count() { 1 }");
    write("spare.rhai", "fn spare() { 1 }");
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    let snapshot = place.path("a.snap");
    emulator.run("snapshot", &[&snapshot]).ok();
    write("spare.rhai", "fn spare() { 2 }");
    emulator.run("restore", &[&snapshot]).ok();
    write("helper.rhai", "fn count() { 2 }");
    let refused = emulator.run("restore", &[&snapshot]);
    assert!(refused.fails(2).contains("has changed since the snapshot"), "{}", refused.err);
}

/// Steps of any size give the same journal, even if tables of two devices answer each other.
#[test]
fn the_journal_of_a_folder_does_not_depend_on_the_steps() {
    let answer = |request: u8, answer: u8| {
        format!(
            "[[answer]]\nregister = 'control.w_COMMAND'\nrequest = {request}\nanswer = {answer}\npage = '3'\nsource = 'manual'\n"
        )
    };
    let recovered = "[[watchdog]]\nregister = 'control.w_COMMAND'\nwithin = '700us'\n\
         state = [{ register = 'data.w_IN', set = 2 }]\n\
         recovered = [{ register = 'control.w_STATUS', set = 1, clear = 32 }]\npage = '3'\nsource = 'manual'\n\
         [[toggle]]\nregister = 'control.w_STATUS'\nacknowledge = 'control.w_TOGGLE_ACK'\nbits = 15\nafter = '3us'\n\
         page = '3'\nsource = 'manual'\n";
    for tables in [answer(5, 4) + &answer(4, 5), recovered.to_owned()] {
        let place = Place::new();
        fs::write(place.card().join("handshakes.toml"), &tables).unwrap();
        let mut journals = Vec::new();
        for steps in [&[10_000][..], &[1000; 10], &[2500; 4], &[137, 863, 4000, 5000]] {
            let run = ["--clock", "stepped", "--record", "control,data"];
            let emulator = Emulator::start(&[&[place.path("plant.toml").as_str()][..], &run].concat());
            for command in ["control.w_COMMAND=5", "control.w_COMMAND=7"] {
                emulator.poke(&[command]);
                steps.iter().for_each(|us| drop(emulator.step(&[&format!("{us}us")])));
            }
            journals.push(emulator.run("trace", &[]).ok().to_owned());
        }
        assert!(
            journals[0].lines().count() > 6 && journals.iter().all(|it| *it == journals[0]),
            "{journals:#?}"
        );
    }
}

#[test]
fn a_new_request_replaces_the_second_value_of_an_answer() {
    let place = Place::new();
    let table = "[[answer]]\nregister = 'control.w_COMMAND'\nrequest = 5\nanswer = 4\nafter = '1ms'\nthen = 9\n\
         then_after = '10ms'\npage = '3'\nsource = 'manual'\n";
    fs::write(place.card().join("handshakes.toml"), table).unwrap();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    for (value, step, expected) in
        [("5", "3ms", "16#0004"), ("5", "3ms", "16#0004"), ("4", "12ms", "16#0009")]
    {
        emulator.poke(&[&format!("control.w_COMMAND={value}")]);
        emulator.step(&[step]);
        assert_eq!(emulator.peek(&["control.w_COMMAND"]), expected);
    }
}

/// Users compile and run exported files.
#[test]
fn a_text_of_a_folder_is_no_code_in_an_export() {
    for (file, from, to) in [
        ("device.toml", "Digital I/O card", "x\\\"\\\"\\\"\\nimport os\\ny=\\\"\\\"\\\""),
        ("device.toml", "Control and status", "*/ int code; /*"),
        ("IO_CONTROL.toml", "State of the card", "*) code; (*"),
        ("meanings.toml", "no command", "no\\ncommand"),
        ("handshakes.toml", "page = \"5\"", "page = \"\\u0007\""),
    ] {
        let place = Place::new();
        place.edit(file, from, to);
        for command in
            [&["device", "check"][..], &["export", "python", "--device"], &["export", "c", "--device"]]
        {
            let outcome = run(&[command, &[&place.path("cards/digital-io")]].concat());
            let message = outcome.fails(2);
            let is_named =
                message.contains(&format!("{file}:")) && message.contains("comments and strings of exports");
            assert!(is_named, "{to}: {message}");
        }
    }
}

/// Texts that other formats would take as code.
const HOSTILE: [&str; 8] = [
    "<%=6*7%> <%while(1){}%>",
    "a `id` and an odd ` sign",
    "=HYPERLINK(A1,A2)",
    "+A1",
    "-1+2",
    "@SUM(A1)",
    "<script>alert(1)</script> [a](javascript:alert(1)) {{#include /etc/passwd}}",
    "---><x/><!--",
];

/// Compilers and viewers of these formats execute parts of texts, so the exports escape them (D-798, D-799).
#[test]
fn a_text_of_a_folder_is_a_text_in_every_export() {
    for hostile in HOSTILE {
        let place = Place::new();
        place.edit("device.toml", "Digital I/O card", hostile);
        place.edit("device.toml", "Control and status", hostile);
        place.edit("IO_DATA.toml", "The 16 outputs", hostile);
        place.edit("meanings.toml", "no command", &format!("text {hostile}"));
        let card = place.path("cards/digital-io");
        let export = |format: &str| run(&["export", format, "--device", &card]).ok().to_owned();

        let rdl = export("systemrdl");
        assert!(!rdl.contains("<%") && !rdl.contains('`') && !rdl.contains("\\u{"), "{rdl}");
        for table in [export("csv"), run(&["map", "--device", &card, "--format", "csv"]).ok().to_owned()] {
            let is_formula = hostile.starts_with(['=', '+', '-', '@']);
            let is_marked = table.contains(&format!("'{hostile}")) && !table.contains(&format!(",{hostile}"));
            assert!(is_marked || !is_formula, "{table}");
        }
        let md = export("md");
        assert!(
            !md.contains("<s")
                && !md.contains("<%")
                && !md.contains("{{")
                && !md.replace("\\](j", "").contains("](j"),
            "{md}"
        );
        let svd = export("svd");
        assert_eq!(svd.matches("<!--").count(), svd.matches("-->").count(), "{svd}");
        svd_parser::parse(&svd).unwrap();

        place.write("card.rdl", &rdl);
        place.write("card.py", &export("python"));
        place.write("card.csv", &export("csv"));
        let Some(mut command) = python(&["systemrdl"]) else { continue };
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_texts.py");
        let files = ["card.rdl", "card.py", "card.csv"].map(|name| place.path(name));
        assert_eq!(finish(command.arg(script).args(files).arg(hostile)).ok(), "3 files\n", "{hostile}");
    }
}

#[test]
fn a_lost_folder_of_a_running_instance_is_named() {
    let place = Place::new();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    fs::rename(place.card(), place.0.path().join("moved")).unwrap();
    for args in [&["peek", "control.w_COMMAND"][..], &["step", "1ms"], &["status"]] {
        let outcome = emulator.run(args[0], &args[1..]);
        let folder = place.card().display().to_string();
        assert!(
            outcome.err.contains(&folder) && outcome.err.contains("is gone or has changed"),
            "{outcome:?}"
        );
    }
    fs::rename(place.0.path().join("moved"), place.card()).unwrap();
}

/// Clients need the registers only, so other changes of the folder do not concern them.
#[test]
fn clients_of_a_running_instance_accept_changes_beside_the_registers() {
    let place = Place::new();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    place.edit("device.toml", "Digital I/O card", "Card with inputs");
    place.edit("IO_DATA.toml", "The 16 outputs", "The outputs of the card");
    place.edit("handshakes.toml", "request = 0x05", "request = five");
    emulator.poke(&["data.w_OUT=16#55AA"]);
    assert_eq!(emulator.peek(&["data.w_OUT"]), "16#55AA");
    assert!(emulator.run("map", &["data.w_OUT"]).ok().contains("The outputs of the card"));
    place.edit("IO_DATA.toml", "\"w_OUT\"", "\"w_OUTPUTS\"");
    let refused = emulator.run("peek", &["control.w_COMMAND"]);
    assert!(refused.fails(3).contains("a register has another name, type or address"), "{}", refused.err);
    place.edit("device.toml", "names = \"manual\"", "names = manual");
    let refused = emulator.run("peek", &["control.w_COMMAND"]);
    assert!(refused.fails(3).contains("device.toml:"), "{}", refused.err);
    place.edit("device.toml", "names = manual", "names = \"manual\"");
    place.edit("IO_DATA.toml", "\"w_OUTPUTS\"", "\"w_OUT\"");
}

/// An editor may remove a script and create it again. The device keeps its script in between, and a new script has no effect.
#[test]
fn clients_of_a_running_instance_know_the_script_that_it_has() {
    let place = Place::new();
    let script = place.card().join("firmware.rhai");
    fs::write(&script, "fn power_on() {}").unwrap();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    let saved = place.path("saved.snapshot");
    emulator.run("snapshot", &[&saved]).ok();
    fs::remove_file(&script).unwrap();
    assert_eq!(emulator.peek(&["front.script"]), "16#00000000");
    let refused = emulator.run("restore", &[&saved]);
    assert!(
        refused.fails(2).contains("a file of PLC 'io' has changed since the snapshot"),
        "{}",
        refused.err
    );
    let reloads = || emulator.run("trace", &["--kind", "reload"]).ok().to_owned();
    assert!(reloads().contains("files not read again: firmware.rhai is missing"), "{}", reloads());
    assert_eq!(emulator.peek(&["front.script"]), "16#00000000");
    fs::write(&script, "fn power_on() {}").unwrap();
    emulator.run("restore", &[&saved]).ok();
    drop(emulator);

    let place = Place::new();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    place.write("cards/digital-io/firmware.rhai", "fn power_on() {}");
    emulator.step(&["1ms"]);
    let trace = emulator.run("trace", &["--kind", "reload"]);
    assert!(trace.ok().contains("firmware.rhai is new; start the instance again"), "{}", trace.out);
    let refused = emulator.run("peek", &["front.script"]);
    assert!(refused.fails(2).contains("unknown area `front`"), "{}", refused.err);
}

/// A snapshot is compared with the files, also if the clock has not advanced since they changed.
#[test]
fn a_snapshot_is_compared_with_the_present_files() {
    let place = Place::new();
    let script = |text: &str| fs::write(place.card().join("firmware.rhai"), text).unwrap();
    let (first, second) =
        ("fn poll() { output(\"data.w_IN\", 1); }", "fn poll() { output(\"data.w_IN\", 2); }");
    script(first);
    fs::write(place.card().join("handshakes.toml"), "").unwrap();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.step(&["1ms"]);
    let [saved, later] = ["saved.snapshot", "later.snapshot"].map(|name| place.path(name));
    emulator.run("snapshot", &[&saved]).ok();
    script(second);
    let refused = || {
        let refused = emulator.run("restore", &[&saved]);
        let reason = "a file of PLC 'io' has changed since the snapshot";
        assert!(refused.fails(2).contains(reason), "{}", refused.err);
    };
    refused();
    // The snapshot belongs to the changed file.
    script("fn poll() { output(\"data.w_IN\", 3); }");
    emulator.run("snapshot", &[&later]).ok();
    emulator.run("restore", &[&later]).ok();
    script(first);
    emulator.run("restore", &[&saved]).ok();
    // A file that the device refuses has changed, too.
    script("fn poll() {");
    refused();
    refused();
    script(first);
    emulator.run("restore", &[&saved]).ok();
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["data.w_IN"]), "16#0001");
}

/// A running instance knows the faults that a folder declares, on the command line, in the journal and in snapshots.
#[test]
fn declared_faults_work_in_every_command() {
    let place = Place::new();
    let fault = "\n[[fault]]\nname = 'frozen'\ntext = 'A counter does not count'\npage = '3'\n\
                 fields = [{ name = 'line', text = 'Number of the line', to = 3, default = 0 }]\n";
    let tables = fs::read_to_string(place.card().join("handshakes.toml")).unwrap();
    let tables = tables.replace("every = \"1ms\"", "every = \"1ms\"\nunless_fault = \"frozen\"");
    fs::write(place.card().join("handshakes.toml"), tables + fault).unwrap();
    let check = run(&["device", "check", place.card().to_str().unwrap()]);
    let row = "A counter does not count; line 0 to 3 (default 0)";
    assert!(check.out.contains(row) && check.out.contains("not while a fault frozen acts"), "{}", check.out);
    assert!(check.code == Some(0) && check.err.contains("6 handshakes, 1 fault"), "{}", check.err);
    place.write(
        "plant.toml",
        "[[plc]]\nname = 'line'\n[[device]]\nname = 'io'\nkind = './cards/digital-io'\n\
         [[fault]]\nkind = 'frozen'\nat_us = 900000\nline = 2\n",
    );
    run(&["plant", "check", &place.path("plant.toml")]).ok();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.step(&["10ms"]);
    let near = emulator.run("fault", &["add", "frosen", "line=1"]);
    assert!(near.fails(2).contains("did you mean frozen?"), "{}", near.err);
    let wrong = emulator.run("fault", &["add", "frozen", "line=4"]);
    assert!(wrong.fails(2).contains("line is 4; it must be 0 to 3"), "{}", wrong.err);
    assert_eq!(emulator.run("fault", &["add", "frozen", "line=1"]).ok(), "2\n");
    let list = emulator.run("fault", &["list"]);
    for line in ["frozen plc=io line=2 at_us=900000", "frozen plc=io line=1"] {
        assert!(list.ok().contains(line), "{line}: {}", list.out);
    }
    let saved = place.path("saved.snapshot");
    emulator.run("snapshot", &[&saved]).ok();
    for _ in 0..2 {
        emulator.step(&["20ms"]);
        assert_eq!(emulator.peek(&["io:control.ud_CYCLES"]), "16#0000000A");
        emulator.run("restore", &[&saved]).ok();
    }
    emulator.run("fault", &["clear", "2"]).ok();
    emulator.step(&["20ms"]);
    assert_eq!(emulator.peek(&["io:control.ud_CYCLES"]), "16#0000001E");
    let trace = emulator.run("trace", &["--kind", "fault"]);
    assert!(trace.out.contains("fault 2, frozen: cleared"), "{}{}", trace.out, trace.err);
}

/// A refused script changes only the journal, so the instance can go back to a moment before and after the refusal.
#[test]
fn a_refused_script_does_not_prevent_going_back() {
    let place = Place::new();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.step(&["5ms"]);
    place.write("cards/digital-io/firmware.rhai", "fn written(register, old, value) {\n  this.sum = ;\n}");
    emulator.step(&["5ms"]);
    let refusals =
        || emulator.run("trace", &["--kind", "reload"]).ok().matches("files not read again").count();
    assert_eq!(refusals(), 1);
    for (back, time, count) in
        [("1ms", "0.009000 s\n", 1), ("4ms", "0.005000 s\n", 1), ("2ms", "0.003000 s\n", 0)]
    {
        assert_eq!(emulator.run("step", &["--back", back]).ok(), time);
        assert_eq!(refusals(), count, "{back}");
    }
}

/// A stepped instance reads a changed script before its clock advances; a wrong one leaves the old one running.
#[test]
fn a_changed_script_is_read_again_in_stepped_mode() {
    let place = Place::new();
    let script = |text: &str| fs::write(place.card().join("firmware.rhai"), text).unwrap();
    script(
        "fn power_on() { this.sum = 0; }\nfn written(register, old, value) { this.sum += value; output(\"data.w_IN\", this.sum); }",
    );
    fs::write(place.card().join("handshakes.toml"), "").unwrap();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    let sum_after = |value: u32| {
        emulator.poke(&[&format!("io:data.w_OUT={value}")]);
        emulator.step(&["1ms"]);
        emulator.peek(&["data.w_IN"])
    };
    assert_eq!(sum_after(1), "16#0001");
    let saved = place.path("saved.snapshot");
    emulator.run("snapshot", &[&saved]).ok();
    script("fn written(register, old, value) {\n  this.sum += 16#10;\n}");
    assert_eq!(sum_after(2), "16#0003");
    let trace = emulator.run("trace", &["--kind", "reload"]);
    assert!(
        trace.ok().contains("files not read again: firmware.rhai:2: `16#10`: write 0x10"),
        "{}",
        trace.out
    );
    // The map `this` stays.
    script("fn written(register, old, value) { this.sum += 0x10 * value; output(\"data.w_IN\", this.sum); }");
    assert_eq!(sum_after(3), "16#0033");
    assert!(emulator.run("trace", &["--kind", "reload"]).ok().contains("script read again"));
    let refused = emulator.run("restore", &[&saved]);
    let reason = "a file of PLC 'io' has changed since the snapshot, in /";
    assert!(refused.code != Some(0) && refused.err.contains(reason), "{refused:?}");
    // The plant cannot go back to a moment before the change of the script, because another script ran then.
    emulator.step(&["1ms"]);
    assert_ne!(emulator.run("step", &["--back", "3ms"]).code, Some(0));
    emulator.run("step", &["--back", "1ms"]).ok();
    // A stopped script runs again.
    emulator.breaks(&["script-stopped"]);
    script("fn written(register, old, value) { throw \"no\"; }");
    sum_after(4);
    assert!(emulator.run("board", &["get"]).ok().contains("script stopped"));
    script("fn written(register, old, value) { output(\"data.w_IN\", this.sum + 1); }");
    assert_eq!(sum_after(5), "16#0034");
    assert!(emulator.run("board", &["get"]).ok().contains("script running"));
    place.edit("IO_DATA.toml", "The 16 outputs", "The outputs");
    emulator.step(&["1ms"]);
    let trace = emulator.run("trace", &["--kind", "reload"]);
    assert!(trace.ok().contains("a file with registers or handshakes has changed"), "{}", trace.out);
}

/// A snapshot belongs to the script that ran at its time.
#[test]
fn a_snapshot_after_a_changed_script_belongs_to_the_new_files() {
    let place = Place::new();
    let script = |text: &str| fs::write(place.card().join("firmware.rhai"), text).unwrap();
    let saved = place.path("saved.snapshot");
    script("fn poll() { output(\"data.w_IN\", 1); }");
    fs::write(place.card().join("handshakes.toml"), "").unwrap();
    {
        let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
        emulator.step(&["1ms"]);
        script("fn poll() { output(\"data.w_IN\", 2); }");
        emulator.step(&["1ms"]);
        emulator.run("snapshot", &[&saved]).ok();
    }
    let emulator = Emulator::start(&["--from", &saved, "--clock", "stepped"]);
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["data.w_IN"]), "16#0002");
}

#[test]
fn a_wrong_file_is_refused_with_its_line_and_that_of_the_plant() {
    let place = Place::new();
    place.edit("IO_DATA.toml", "offset = 2, name = \"w_IN\"", "offset = 3, name = \"w_IN\"");
    let refused = place.refused();
    for part in ["plant.toml: line 3: ", "/IO_DATA.toml:13:", "needs an offset divisible by 2"] {
        assert!(refused.contains(part), "{refused}");
    }
}

#[test]
fn a_folder_of_a_stranger_stays_within_its_bounds() {
    let place = Place::new();
    place.edit("device.toml", "parts = [\"meanings.toml\"]", "parts = [\"../../plant.toml\"]");
    assert!(place.refused().contains("`../../plant.toml` leads out of the folder"));

    let place = Place::new();
    let meanings = place.card().join("meanings.toml");
    fs::remove_file(&meanings).unwrap();
    std::os::unix::fs::symlink("/dev/zero", &meanings).unwrap();
    assert!(place.refused().contains("is a link"), "{}", place.refused());
    fs::remove_file(&meanings).unwrap();
    rustix::fs::mkfifoat(rustix::fs::CWD, &meanings, rustix::fs::Mode::RUSR).unwrap();
    assert!(place.refused().contains("it is no regular file"), "{}", place.refused());

    let place = Place::new();
    place.edit("device.toml", "offset = 4096", "offset = 4000000000");
    let refused = place.refused();
    assert!(refused.contains("bytes of its image; a device in a folder has at most 16777216"), "{refused}");

    let place = Place::new();
    place.edit("device.toml", "\"digital-io\"", "\"can-dp2\"");
    assert!(
        place.refused().contains("'can-dp2' has the name of the device 'can-dp2'"),
        "{}",
        place.refused()
    );
    place.edit("device.toml", "\"can-dp2\"", &format!("\"{}\"", "long".repeat(16)));
    assert!(place.refused().contains("has 64 bytes; it has at most 63"), "{}", place.refused());
}

/// Registers of sub-structures count once for each use, so a short file cannot fill the memory.
#[test]
fn registers_of_a_folder_are_counted_before_they_are_made() {
    let place = Place::new();
    let members: String = (0..4000)
        .map(|n| format!("{{ offset = {n}, name = 'b_{n}', type = 'BYTE', owner = 'plc', doc = 'x' }},\n"))
        .collect();
    let sources = "page = '1'\ndoc = 'x'\nname_from = 'manual'\noffsets = 'manual'\nnames = 'manual'\ntypes = 'manual'\nowners = 'manual'\nresets = 'manual'\n";
    let sub = format!("[[substructure]]\nname = 'MANY'\nsize = 4000\n{sources}register = [{members}]\n");
    let uses: String = (0..1000)
        .map(|n| format!("{{ offset = {}, name = '_{n}', type = 'MANY', doc = 'x' }},\n", n * 4000))
        .collect();
    let structure = format!("name = 'HUGE'\nsize = 4000000\n{sources}register = [{uses}]\n");
    fs::write(place.card().join("many.toml"), sub).unwrap();
    fs::write(place.card().join("HUGE.toml"), structure).unwrap();
    place.edit("device.toml", "parts = [", "parts = [\"many.toml\", ");
    place.edit("device.toml", "structures = [", "structures = [\"HUGE\", ");
    let begin = std::time::Instant::now();
    let refused = place.refused();
    assert!(refused.contains("registers; a device in a folder has at most 65536"), "{refused}");
    assert!(begin.elapsed().as_secs() < 10);
}

/// The path of the folder is relative to the directory of the plant file, and a client finds the folder without an
/// option.
#[test]
fn one_folder_serves_several_devices() {
    let place = Place::new();
    let section = |name: &str| format!("[[device]]\nname = '{name}'\nkind = './cards/digital-io'\n");
    place.write("plant.toml", &(section("left") + &section("right")));
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.poke(&["right:data.w_OUT=1"]);
    assert_eq!(emulator.peek(&["left:data.w_OUT", "right:data.w_OUT"]), "16#0000 16#0001");
    let devices = Path::new("/dev/shm").join(format!("commram.{}.iox.d/devices", emulator.name));
    assert_eq!(fs::read_to_string(&devices).unwrap().lines().count(), 2);
    emulator.run("stop", &[]).ok();
    assert!(!devices.exists());
}

/// Writes the device `words`: for each area its name, its structure, and names of registers, all WORDs.
fn write_words(place: &Place, areas: &[(&str, &str, &[&str])]) {
    fs::create_dir(place.0.path().join("words")).unwrap();
    let sources =
        ["name_from", "offsets", "names", "types", "owners", "resets"].map(|it| format!("{it} = 'manual'\n"));
    for (_, structure, words) in areas {
        let row = |(index, name): (usize, &&str)| {
            let offset = 2 * index;
            format!("  {{ offset = {offset}, name = '{name}', type = 'WORD', owner = 'plc', doc = 'x' }},\n")
        };
        let rows: String = words.iter().enumerate().map(row).collect();
        let (size, sources) = (2 * words.len(), sources.concat());
        let text = format!(
            "name = '{structure}'\nsize = {size}\npage = '1'\ndoc = 'x'\n{sources}register = [\n{rows}]\n"
        );
        place.write(&format!("words/{structure}.toml"), &text);
    }
    let structures: Vec<_> = areas.iter().map(|(_, structure, _)| structure).collect();
    let area = |(index, (name, structure, _)): (usize, &(&str, &str, &[&str]))| {
        let first = 100 * index;
        format!(
            "[[area]]\nname = '{name}'\nfirst = {first}\npage = '1'\ndoc = 'x'\n\
             structure = [{{ name = '{structure}', live = 'always' }}]\n"
        )
    };
    let areas: String = areas.iter().enumerate().map(area).collect();
    let device = format!(
        "name = 'words'\ntitle = 'Words'\nmanual = 'w-1'\nnames = 'manual'\nstructures = {structures:?}\n\
         reserved = {{ owner = 'firmware', source = 'manual' }}\n\
         space = [{{ name = 'card', letter = 'M', segment = 3, unit = 'byte', first = 0, offset = 4096, page = '1', doc = 'x' }}]\n\
         {areas}"
    );
    place.write("words/device.toml", &device);
}

/// Names that are identifiers in a layout, but equal or reserved in an export.
#[test]
fn equal_names_of_an_export_get_numbers() {
    let place = Place::new();
    let areas: [(&str, &str, &[&str]); 4] = [
        ("x", "card", &["w_C", "type", "r_type", "TYPE_"]),
        ("x_w", "X", &["C", "c_"]),
        ("end", "A__B", &["if", "r_if"]),
        ("card", "a_B", &["one", "two"]),
    ];
    write_words(&place, &areas);
    let export = |args: &[&str]| {
        run(&[&["export"], args, &["--device", &place.path("words")]].concat()).ok().to_owned()
    };
    let st = export(&["st"]);
    for line in ["        r_type_2 : WORD;", "        r_type : WORD;", "    _card AT %MB3.300 : a_B;"] {
        assert!(st.contains(line), "{line}\n{st}");
    }
    let elementary = export(&["st", "--elementary"]);
    for name in ["x_w_C AT", "x_w_C_2 AT", "r_end_if AT"] {
        assert_eq!(elementary.matches(&format!("    {name} ")).count(), 1, "{name}\n{elementary}");
    }
    // With the prefix of this export, the function of `_card` would have the name of the type of `card`.
    let matiec = export(&["matiec"]);
    for name in ["} commram_card;", " *commram_card_(const commram *ram)"] {
        assert!(matiec.contains(name), "{name}\n{matiec}");
    }
}

/// Names of types and macros of C, and names that Structured Text does not allow.
#[test]
fn names_that_a_language_uses_itself_are_changed() {
    let place = Place::new();
    let areas: [(&str, &str, &[&str]); 4] = [
        ("y", "type", &["w__b", "w_b", "eof", "uint8_t"]),
        ("z", "r_type", &["one", "int16_t", "type", "uint16_t"]),
        ("uint8_t", "uint8_t", &["x", "m_pi"]),
        ("uint16_t", "uint16_t", &["int8_t", "uint32_t"]),
    ];
    write_words(&place, &areas);
    let sources = "page = '1'\ndoc = 'x'\nname_from = 'manual'\noffsets = 'manual'\nnames = 'manual'\ntypes = 'manual'\nowners = 'manual'\nresets = 'manual'\n";
    let rows = "{ offset = 0, name = 'a_x', type = 'BYTE', array = [6, 8], owner = 'plc', doc = 'x' },\n\
                { offset = 48, name = 'a_x_5_7', type = 'BYTE', array = [2], owner = 'plc', doc = 'x' },\n\
                { offset = 50, name = 'a_x_6_7', type = 'BYTE', array = [2], owner = 'plc', doc = 'x' },\n";
    let arrays = format!("name = 'ARRAYS'\nsize = 52\n{sources}register = [\n{rows}]\n");
    place.write("words/ARRAYS.toml", &arrays);
    let device = fs::read_to_string(place.path("words/device.toml")).unwrap();
    let device = device.replace("structures = [", "structures = [\"ARRAYS\", ");
    let area = "[[area]]\nname = 'arrays'\nfirst = 600\npage = '1'\ndoc = 'x'\n\
                structure = [{ name = 'ARRAYS', live = 'always' }]\n";
    place.write("words/device.toml", &(device + area));
    let export = |args: &[&str]| {
        run(&[&["export"], args, &["--device", &place.path("words")]].concat()).ok().to_owned()
    };
    let has = |text: &str, lines: &[&str]| {
        for line in lines {
            assert_eq!(text.matches(line).count(), 1, "{line}\n{text}");
        }
    };
    let st = export(&["st"]);
    has(
        &st,
        &[
            "    r_type : (*",
            "    r_type_2 : (*",
            "        w_b_2 : WORD;",
            "        eof : WORD;",
            ": r_type_2;",
        ],
    );
    assert!(!st.contains("__"), "{st}");
    let matiec = export(&["st", "--matiec"]);
    has(&matiec, &["        r_eof : WORD;", "        r_m_pi : WORD;"]);
    let svd = export(&["svd"]);
    has(&svd, &["<name>a_x_%s</name>", "<name>a_x_5_7_2[%s]</name>", "<name>a_x_6_7[%s]</name>"]);
    for format in ["c", "matiec"] {
        place.write("words.h", &export(&[format]));
        for (compiler, language) in [("cc", "c"), ("c++", "c++")] {
            if is_there(compiler) {
                let mut command = Command::new(compiler);
                command.args(["-fsyntax-only", "-x", language, &place.path("words.h")]);
                finish(&mut command).ok();
            }
        }
    }
}

/// A bit keeps the name that its manual has in any script. Exports to formats with ASCII identifiers have names that differ
/// from each other (D-221).
#[test]
fn bits_and_values_without_an_identifier_are_numbered() {
    let place = Place::new();
    place.edit("meanings.toml", "name = \"ready\"", "name = \"\u{6e96}\u{5099}\"");
    place.edit("meanings.toml", "name = \"outputs\"", "name = \"\u{b0}\u{43e}\"");
    place.edit("meanings.toml", "outputs are enabled", "\u{6709}\u{52b9}");
    place.edit(
        "meanings.toml",
        "{ from = 2, to = 14, name = \"reserved\", reserved = true },",
        "{ at = 2, name = \"Error A\", one = \"x\" },
  { at = 3, name = \"error-a\", one = \"x\" },
  { at = 4, name = \"error a 08\", one = \"x\" },
  { at = 5, name = \"1st\", one = \"x\" },
  { at = 6, name = \"value 1st\", one = \"x\" },
  { from = 7, to = 8, name = \"%\", value = [{ is = 0, text = \"\u{505c}\" }, { is = 1, text = \"Off\" }, { is = 2, text = \"off!\" }] },",
    );
    let card = place.path("cards/digital-io");
    let export = |format: &str| run(&["export", format, "--device", &card]).ok().to_owned();
    let has_each_once = |text: &str, names: &[&str]| {
        for name in names {
            assert_eq!(text.matches(name).count(), 1, "{name}\n{text}");
        }
    };

    let module = export("python");
    has_each_once(
        &module,
        &[
            "    BIT_0 = 0x1 ",
            "    BIT_1 = 0x2 ",
            "    ERROR_A_04 = 0x4 ",
            "    ERROR_A_08 = 0x8 ",
            "    ERROR_A_08_2 = 0x10 ",
            "    VALUE_1ST = 0x20 ",
            "    VALUE_1ST_2 = 0x40 ",
            "    BITS_7_TO_8_MASK = 0x180 ",
            "    BITS_7_TO_8_VALUE_00 = 0x0 ",
            "    BITS_7_TO_8_OFF_80 = 0x80 ",
            "\nSTATUS_BITS_7_TO_8_SHIFT = 7\n",
            "    VALUE_04 = 0x4 ",
        ],
    );
    place.write("card.py", &module);
    if let Some(mut command) = python(&[]) {
        finish(command.args(["-W", "error", &place.path("card.py")])).ok();
    }

    has_each_once(
        &export("c"),
        &[
            "#define COMMRAM_STATUS_BIT_0 ",
            "#define COMMRAM_STATUS_ERROR_A_08_2 ",
            "#define COMMRAM_COMMAND_VALUE_04 ",
        ],
    );

    let svd = export("svd");
    assert!(!svd.contains("<name></name>"), "{svd}");
    let names =
        ["BIT_0", "BIT_1", "ERROR_A_04", "ERROR_A_08", "ERROR_A_08_2", "_1ST", "VALUE_1ST", "BITS_7_TO_8"];
    has_each_once(&svd, &names.map(|name| format!("<name>{name}</name>")).each_ref().map(String::as_str));
    svd_parser::parse(&svd).unwrap();

    let rdl = export("systemrdl");
    has_each_once(
        &rdl,
        &[" f_bit_0[0:0]", " f_error_a_08[3:3]", " f_error_a_08_2[4:4]", "enum e_status_bits_7_to_8 {"],
    );
    place.write("card.rdl", &rdl);
    let Some(mut command) = python(&["systemrdl"]) else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_rdl.py");
    let outcome = finish(command.args([script, &place.path("card.rdl"), "digital_io", "_control.w_STATUS"]));
    assert!(outcome.ok().ends_with("_control.w_STATUS 4098\n"), "{}", outcome.out);
}

/// The word `front.script` of commram has a meaning beside those of the device.
#[test]
fn a_device_with_a_script_may_have_a_meaning_called_script() {
    let place = Place::new();
    place.edit("meanings.toml", "name = \"status\"", "name = \"script\"");
    place.edit("IO_CONTROL.toml", "meaning = \"status\"", "meaning = \"script\"");
    fs::write(place.card().join("firmware.rhai"), "fn poll() {}\n").unwrap();
    let export = run(&["export", "python", "--device", &place.path("cards/digital-io")]);
    for line in ["class SCRIPT(enum.IntFlag):", "class SCRIPT_WORD(enum.IntEnum):"] {
        assert!(export.ok().contains(line), "{line}\n{}", export.out);
    }
}

/// Macros and functions of the headers that `commram.h` includes, and words of C and C++.
#[test]
fn names_of_c_are_registers_of_an_exported_header() {
    let place = Place::new();
    let words = [
        "INT_MAX",
        "EINTR",
        "O_RDWR",
        "SYS_futex",
        "st_mtime",
        "linux",
        "class",
        "read",
        "BUFSIZ",
        "NULL",
        "uint16_t",
        "int",
        "int_",
        "int__",
    ];
    write_words(&place, &[("card", "FILE", &words)]);
    run(&["export", "c", "--device", &place.path("words"), "--output", &place.path("commram.h")]).ok();
    place.write("client.c", "#include <limits.h>\n#include \"commram.h\"\nint main(void) { return 0; }\n");
    for (compiler, language, mode) in [("cc", "c", "c99"), ("cc", "c", "gnu11"), ("c++", "c++", "gnu++17")] {
        if !is_there(compiler) {
            continue;
        }
        let source = place.path("client.c");
        let flags = [&format!("-std={mode}"), "-fsyntax-only", "-x", language, &source];
        finish(Command::new(compiler).args(flags)).ok();
    }
}

/// Relative paths in the text of a plant begin at the directory of the script, as those in a plant file do.
#[test]
fn a_plant_as_text_finds_its_folders_beside_the_script() {
    let place = Place::new();
    let scenario =
        "plant(\"[[device]]\\nname = 'io'\\nkind = './cards/digital-io'\");\nexpect(\"data.w_OUT\", 0);\n";
    place.write("text.rhai", scenario);
    run(&["test", &place.path("text.rhai")]).ok();
}
