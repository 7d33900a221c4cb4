//! `run`, `list`, `stop`: several instances that start and end at the same time.

use crate::common::{Emulator, commram, eventually, files_of, finish, remove_remains, run, unique_name};
use commram::devices;
use commram::memory::AttachMode;
use std::io::Write;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

const TWO_PLCS: &str = "\
[[plc]]
name = 'saw'

[[plc]]
name = 'press'
node2 = 'b'

[[bus]]
name = 'b'
";

fn plant(text: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    file
}

fn start_with_plant(text: &str) -> Emulator {
    let file = plant(text);
    Emulator::start(&[file.path().to_str().unwrap(), "--clock", "stepped"])
}

#[test]
fn run_says_in_one_line_when_it_is_ready() {
    let emulator = Emulator::stepped();
    let name = &emulator.name;
    assert_eq!(
        emulator.ready,
        format!("commram: instance '{name}' ready: line (/dev/shm/commram.{name}.line), clock stepped\n")
    );
    let emulator = Emulator::start(&["--speed", "2.5"]);
    assert!(emulator.ready.ends_with(", clock real time x 2.5\n"), "{}", emulator.ready);
    let emulator = Emulator::start(&[]);
    assert!(emulator.ready.ends_with(", clock real time\n"), "{}", emulator.ready);
}

/// `CLOCK_MONOTONIC` times and the time that a program computes from the header page agree with the emulator's.
#[test]
fn the_speed_of_a_real_time_clock_can_be_changed() {
    let emulator = Emulator::start(&[]);
    let now = || {
        let text = emulator.run("status", &["--format", "json"]).ok().to_owned();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()[0].clone()
    };
    let speed = |factor: &str| emulator.run("speed", &[factor]).ok().to_owned();
    speed("0");
    let paused = now();
    assert_eq!(paused["speed"], 0.0);
    assert!(emulator.run("status", &[]).ok().contains("clock real time, paused\n"));
    assert_eq!(now()["time_us"], paused["time_us"]);
    let waits = emulator.run("wait", &["node2.w_OPTION_STATUS==16#FFFF", "--within", "10ms"]);
    assert!(waits.fails(3).contains("its clock is paused (`commram speed 1` continues it)"), "{waits:?}");
    let seconds = paused["time_us"].as_u64().unwrap() as f64 / 1e6;
    assert_eq!(speed("1000"), format!("{seconds:.6} s\n"), "it continues from there");
    emulator.run("wait", &["node2.w_OPTION_STATUS!=16#FFFF"]).ok();
    let (attached, _) = devices::attach(&emulator.name, "line", AttachMode::ReadWrite).unwrap();
    let header = attached.header().unwrap();
    assert_eq!(header.speed.load(), 1_000_000);
    let before = now()["time_us"].as_u64().unwrap();
    let (exact, after) = (header.exact_us(), now()["time_us"].as_u64().unwrap());
    assert!(before <= exact && exact <= after + 100_000, "{before} {exact} {after}");
    speed("0");
    assert_eq!(header.exact_us(), header.virtual_time_us.load());
    // At this speed the emulator is late. When the speed changes, it drops the time by which it is late.
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let computed = scope.spawn(|| {
            let mut last = header.exact_us();
            while !is_over.load(Ordering::Relaxed) {
                let exact = header.exact_us();
                assert!(exact >= last, "{last} {exact}");
                last = exact;
            }
            last
        });
        for factor in ["1000", "1", "1000", "0", "1000", "0.5"] {
            speed(factor);
            let begin = header.virtual_time_us.load();
            assert!(eventually(|| factor == "0" || header.virtual_time_us.load() > begin));
        }
        is_over.store(true, Ordering::Relaxed);
        assert!(computed.join().unwrap() > 0);
    });
    let stepped = Emulator::stepped();
    assert!(stepped.run("speed", &["1"]).fails(1).contains("the clock is stepped"));
}

#[test]
fn signals_end_the_emulator_in_good_order_without_remaining_files() {
    for (signal, code) in [("-TERM", 0), ("-INT", 130), ("-HUP", 0)] {
        for clock in ["stepped", "realtime"] {
            let mut emulator = Emulator::start(&["--clock", clock]);
            assert!(!emulator.files().is_empty());
            emulator.signal(signal);
            assert_eq!(emulator.wait().code(), Some(code), "{signal} {clock}");
            assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
            assert_eq!(emulator.complaints(), "");
        }
    }
}

#[test]
fn a_signal_ends_the_emulator_unless_its_parent_ignores_it() {
    let start = |option: &str| {
        let mut command = Command::new("env");
        command.arg(option).arg(commram().get_program());
        Emulator::start_by(command, &unique_name(), &["--clock", "stepped"])
    };
    for signal in ["TERM", "HUP"] {
        let mut emulator = start(&format!("--block-signal={signal}"));
        emulator.signal(&format!("-{signal}"));
        assert_eq!(emulator.wait().code(), Some(0), "{signal}");
    }
    let mut emulator = start("--ignore-signal=HUP");
    emulator.signal("-HUP");
    (0..10).for_each(|_| drop(emulator.step(&["1ms"])));
    emulator.signal("-TERM");
    assert_eq!(emulator.wait().code(), Some(0));
}

#[test]
fn stop_waits_until_the_emulator_has_cleaned_up() {
    let mut emulator = Emulator::stepped();
    let outcome = emulator.run("stop", &[]);
    let image = format!("/dev/shm/commram.{}.line", emulator.name);
    assert!(!std::path::Path::new(&image).exists());
    assert_eq!(outcome.ok(), format!("instance '{}' has stopped\n", emulator.name));
    assert_eq!(emulator.wait().code(), Some(0));
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn the_instance_can_be_named_by_the_environment() {
    let emulator = Emulator::stepped();
    let mut command = commram();
    command.args(["peek", "--raw", "node2.w_OPTION_STATUS"]).env("COMMRAM_INSTANCE", &emulator.name);
    assert_eq!(finish(&mut command).ok(), "16#0001\n");
}

#[test]
fn two_instances_do_not_see_each_other() {
    let (one, two) = (Emulator::stepped(), Emulator::stepped());
    one.poke(&["%MB3.1000000=1"]);
    two.poke(&["%MB3.1000000=2"]);
    one.step(&["5ms"]);
    assert_eq!((one.peek(&["%MB3.1000000"]), two.peek(&["%MB3.1000000"])), ("16#01".into(), "16#02".into()));
    assert_eq!(two.step(&["0s"]), "0.000000 s");
    one.run("stop", &[]).ok();
    assert_eq!(two.peek(&["%MB3.1000000"]), "16#02");
}

#[test]
fn two_clients_at_once_are_both_served() {
    let emulator = Emulator::stepped();
    let spawn = |from: usize| {
        let mut children = Vec::new();
        for i in from..from + 4 {
            let write = format!("%MB3.{}={}", 1_000_000 + i, i + 1);
            let mut command = emulator.command("poke", &[&write]);
            children.push(command.stdout(Stdio::null()).stderr(Stdio::inherit()).spawn().unwrap());
        }
        children
    };
    for mut child in spawn(0).into_iter().chain(spawn(4)) {
        assert!(crate::common::wait_for(&mut child, "a poke").success());
    }
    assert_eq!(emulator.peek(&["%MD3.1000000", "%MD3.1000004"]), "16#04030201 16#08070605");
}

#[test]
fn stop_with_clean_also_ends_a_running_emulator() {
    let mut emulator = Emulator::stepped();
    emulator.run("stop", &["--clean"]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
}

#[test]
fn a_name_that_is_taken_is_refused() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("run", &["--clock", "stepped"]);
    let (name, pid) = (&emulator.name, emulator.pid());
    let expected = format!(
        "commram: instance '{name}' is already running (process {pid}); stop it first or choose another instance name\n"
    );
    assert_eq!(outcome.fails(1), expected);
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
}

/// Two emulators of one instance have PLCs with different names, and so images with different names. But an instance
/// has only one lock and one channel.
#[test]
fn a_used_instance_name_is_refused_for_any_plc_names() {
    let emulator = Emulator::stepped();
    emulator.poke(&["%MB3.1000000=1"]);
    let other = plant(TWO_PLCS);
    let outcome = emulator.run("run", &[other.path().to_str().unwrap(), "--clock", "stepped"]);
    assert!(outcome.fails(1).contains("is already running"), "{}", outcome.err);
    assert_eq!(emulator.peek(&["%MB3.1000000"]), "16#01", "the first one still answers");
    let images = emulator.files().len();
    assert_eq!(images, 2, "image and directory: {:?}", emulator.files());
}

#[test]
fn the_error_for_a_missing_instance_lists_the_running_ones() {
    let emulator = Emulator::stepped();
    let name = unique_name();
    for args in [
        &["peek", "node2.w_CPU_CONTROL"][..],
        &["poke", "node2.w_CPU_CONTROL=0"],
        &["wait", "node2.w_CPU_CONTROL==0"],
        &["step", "1ms"],
        &["dump"],
        &["stop"],
        &["stop", "--clean"],
    ] {
        let outcome = run(&[args, &["-i", &name]].concat());
        let right = match args[0] {
            "stop" => ", so there is nothing to end".to_owned(),
            _ => format!("; start it with `commram run -i {name}`"),
        };
        let expected = format!("commram: instance '{name}' is not running{right}");
        let message = outcome.fails(3);
        assert!(message.starts_with(&expected), "{message}");
        assert!(message.contains(&emulator.name), "{message}");
    }
}

#[test]
fn all_and_one_instance_exclude_each_other() {
    let outcome = run(&["stop", "--all", "-i", &unique_name()]);
    assert!(outcome.fails(2).contains("leave out either this or --all"), "{}", outcome.err);
}

#[test]
fn invalid_names_are_wrong_use() {
    for name in ["a.b", "a/b", "", "way-too-long-for-the-name-of-an-instance"] {
        let outcome = run(&["peek", "node2.w_CPU_CONTROL", "-i", name]);
        assert!(outcome.fails(2).contains("1 to 31 characters of A-Z a-z 0-9 _ -"), "{}", outcome.err);
    }
}

#[test]
fn list_shows_running_instances() {
    let emulator = start_with_plant(TWO_PLCS);
    emulator.step(&["3ms"]);
    let (name, pid) = (&emulator.name, emulator.pid());
    let json = run(&["list", "--format", "json"]);
    let json: Vec<serde_json::Value> = serde_json::from_str(json.ok()).unwrap();
    let own = json.iter().find(|entry| entry["name"] == name.as_str()).unwrap();
    assert_eq!(
        *own,
        serde_json::json!({
            "name": name, "plcs": ["press", "saw"], "pid": pid, "clock": "stepped", "time_us": 3000,
            "state": "ready",
        })
    );
    let csv = run(&["list", "--format", "csv"]);
    assert!(csv.ok().starts_with("name,plcs,pid,clock,time_us,state,reason\n"));
    assert!(csv.out.contains(&format!("{name},press saw,{pid},stepped,3000,ready,\n")), "{}", csv.out);
}

/// CS0015 p. 107, CAN-DP/2 (D-368), 5.00005.03a p. 41: the error about an address uses the words of a device of the
/// instance. If the devices refuse the address in different words, the command asks for the PLC.
#[test]
fn an_address_error_uses_the_words_of_the_devices_of_the_instance() {
    let emulator = start_with_plant(
        "[[device]]\nkind = 'can-dp2'\nname = 'gw'\n[[device]]\nkind = 'cs0015'\nname = 'panel'\n",
    );
    for text in ["%MB3.5", "%MW9999", "node2.w_CPU_CONTRL"] {
        for (command, argument) in
            [("peek", text.to_owned()), ("wait", format!("{text}==1")), ("poke", format!("{text}=1"))]
        {
            let refused = emulator.run(command, &[&argument]);
            let message = refused.fails(2);
            assert!(message.contains("has several PLCs (gw, panel)"), "{command} {argument}: {message}");
            assert!(
                !message.contains("baps") && !message.contains("even address"),
                "{command} {argument}: {message}"
            );
        }
    }
    let refused = emulator.run("peek", &["gw:%MW9999"]);
    assert!(refused.fails(2).contains("%MB0 to %MB3071"), "{}", refused.err);
    let refused = emulator.run("peek", &["panel:%MW9999"]);
    assert!(refused.fails(2).contains("%MW0 to %MW4095 (flags)"), "{}", refused.err);
    // The two PLCs have one type, so a refusal has the text that it has for a single PLC.
    let emulator = start_with_plant(TWO_PLCS);
    for (text, expected) in [
        ("%MB3.5", "is not in any area; the first one, `baps`, starts at %MB3.80000"),
        ("node2.w_CPU_CONTRL", "w_CPU_CONTROL"),
        ("%MW3.200001", "even address"),
    ] {
        let refused = emulator.run("peek", &[text]);
        assert!(
            refused.fails(2).contains(expected) && !refused.err.contains("several"),
            "{text}: {}",
            refused.err
        );
    }
}

#[test]
fn with_several_plcs_registers_need_one() {
    let emulator = start_with_plant(TWO_PLCS);
    let outcome = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
    let name = &emulator.name;
    assert_eq!(
        outcome.fails(2),
        format!(
            "commram: node2.w_OPTION_STATUS: instance '{name}' has several PLCs (saw, press); \
             write for example saw:node2.w_OPTION_STATUS\n"
        )
    );
    let outcome = emulator.run("poke", &["lathe:node2.w_CPU_CONTROL=1"]);
    assert!(outcome.fails(2).contains("has no PLC 'lathe'; its PLCs are: saw, press"), "{}", outcome.err);
    assert!(emulator.run("dump", &["node2"]).fails(2).contains("several PLCs"));
    assert!(emulator.run("step", &["--to-sync"]).fails(2).contains("saw:node2"));

    emulator.poke(&["press:%MB3.1000000=1", "saw:%MB3.1000000=2"]);
    let both = emulator.run("peek", &["saw:%MB3.1000000", "press:%MB3.1000000"]);
    assert_eq!(both.ok(), "saw:%MB3.1000000 = 16#02  no register\npress:%MB3.1000000 = 16#01  no register\n");

    emulator.poke(&["press:node2.w_CPU_CONTROL=1"]);
    let done = emulator.run("wait", &["press:node2.w_OPTION_STATUS==2"]);
    assert!(done.ok().starts_with("press:node2.w_OPTION_STATUS = 16#0002  "), "{}", done.out);
    let dump = emulator.run("dump", &["press:node2.w_OPTION_STATUS"]);
    assert!(dump.ok().contains("\npress:node2.w_OPTION_STATUS  %MW3.200002  16#0002"), "{}", dump.out);
    let everything = emulator.run("dump", &["--all", "--format", "csv"]);
    assert!(everything.ok().contains(",saw,saw:node1.w_OPTION_STATUS,"));
    assert!(everything.out.contains(",press,press:node2.w_OPTION_STATUS,"));
    let one = emulator.run("dump", &["press:", "--all", "--format", "csv"]);
    assert!(!one.ok().contains(",saw,") && one.out.contains(",press,press:node1.w_OPTION_STATUS,"));
}

#[test]
fn a_restart_removes_dead_images_of_plcs_that_it_does_not_have() {
    let mut emulator = start_with_plant(TWO_PLCS);
    let name = emulator.name.clone();
    emulator.kill();
    let one_plc = plant("[[plc]]\nname = 'saw'\n");
    let again = Emulator::start_as(&name, &[one_plc.path().to_str().unwrap(), "--clock", "stepped"]);
    assert_eq!(again.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
    let list = run(&["list"]);
    let states: Vec<_> = list.ok().lines().filter(|line| line.starts_with(&name)).collect();
    assert_eq!(states.len(), 1, "{states:?}");
    assert!(states[0].contains("saw") && states[0].ends_with("ready"), "{states:?}");
}

#[test]
fn invalid_plant_files_are_wrong_use() {
    let outcome = run(&["run", "/nowhere/plant.toml", "-i", &unique_name()]);
    assert!(outcome.fails(2).contains("/nowhere/plant.toml"), "{}", outcome.err);
    let bad = plant("[[plc]]\nname = 'a b'\n");
    let name = unique_name();
    let outcome = run(&["run", bad.path().to_str().unwrap(), "-i", &name]);
    assert!(outcome.fails(2).contains("PLC name"), "{}", outcome.err);
    assert!(files_of(&name).is_empty());
}

#[test]
fn invalid_speeds_are_wrong_use() {
    let name = unique_name();
    let fails = |args: &[&str]| run(&[&["run", "-i", &name], args].concat()).fails(2).to_owned();
    assert!(fails(&["--speed", "0"]).contains("0.001 to 1000"));
    assert!(fails(&["--speed", "NaN"]).contains("0.001 to 1000"));
    assert!(fails(&["--speed", "fast"]).contains("fast"));
    assert!(fails(&["--speed", "2", "--clock", "stepped"]).contains("there is no speed"));
}

#[test]
fn a_foreign_file_with_the_name_of_the_image_is_kept() {
    let name = unique_name();
    let path = format!("/dev/shm/commram.{name}.line");
    std::fs::write(&path, "not an image").unwrap();
    let outcomes = [
        run(&["run", "-i", &name]),
        run(&["peek", "node2.w_CPU_CONTROL", "-i", &name]),
        run(&["stop", "--clean", "-i", &name]),
    ];
    let content = std::fs::read_to_string(&path);
    std::fs::remove_file(&path).unwrap();
    remove_remains(&name);
    assert_eq!(content.unwrap(), "not an image");
    for (outcome, code) in outcomes.into_iter().zip([1, 3, 3]) {
        assert!(outcome.fails(code).contains("is no commram image"), "{}", outcome.err);
    }
}

#[test]
fn busy_polling_serves_clients() {
    let emulator = Emulator::start(&["--busy"]);
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    emulator.run("wait", &["node2.w_OPTION_STATUS==2", "--within", "10s"]).ok();
}
