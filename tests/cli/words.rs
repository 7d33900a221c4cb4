//! Tests of words from other programs, and of the positions where options may be given.

use crate::common::{Emulator, commram, finish, run};

#[test]
fn commands_have_the_names_that_people_type() {
    let emulator = Emulator::stepped();
    emulator.run("set", &["node2.w_CPU_CONTROL=1"]).ok();
    emulator.run("write", &["node2.w_CPU_CONTROL=2"]).ok();
    for word in ["get", "read"] {
        assert_eq!(emulator.run(word, &["--raw", "node2.w_CPU_CONTROL"]).ok(), "16#0002\n");
    }
    for word in ["ps", "ls"] {
        assert!(run(&[word]).ok().contains(&emulator.name));
    }
    for word in ["log", "journal"] {
        assert!(emulator.run(word, &[]).ok().contains("w_CPU_CONTROL"));
    }
    assert!(run(&["start", "--check"]).ok().starts_with("built-in plant: fine: "));
    emulator.run("kill", &[]).ok();
    for word in ["get", "ps", "kill", "journal"] {
        assert!(!run(&["help"]).ok().contains(&format!("\n  {word} ")), "{word} is hidden");
    }
}

#[test]
fn other_words_lead_to_the_right_command() {
    for (args, expected) in [
        (&["back", "1ms"][..], "tip: write `commram step --back TIME`"),
        (&["undo"], "tip: write `commram step --back TIME`"),
        (&["fault", "remove", "1"], "tip: write `commram fault clear NUMBER`"),
        (&["peek", "--json", "x"], "tip: write `--format json`"),
        (&["list", "--csv"], "tip: write `--format csv`"),
        (&["wait", "a==1", "--timeout", "1s"], "tip: write `--within TIME`"),
        (&["test", ".", "--timeout", "1s"], "tip: write `--max-real-time TIME`"),
        (&["test", ".", "--retries", "2"], "tip: omit it: a scenario gives the same result in every run"),
        (&["test", ".", "--seed", "7"], "tip: omit it: a scenario gives the same result in every run"),
        (&["run", "--daemon"], "tip: write `--detach`"),
        (&[concat!("li", "ts")], "tip: a similar subcommand exists: 'list'"),
    ] {
        let message = run(args).fails(2).to_owned();
        assert!(message.contains(expected), "{args:?}: {message}");
        assert_eq!(message.matches("tip:").count(), 1, "{args:?}: {message}");
    }
    let message = run(&["poke", "--no-such-option"]).fails(2).to_owned();
    assert!(!message.contains("tip:"), "{message}");
}

#[test]
fn plant_check_checks_a_plant() {
    assert!(run(&["plant", "check"]).ok().starts_with("built-in plant: fine: "));
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), "[[plc]]\nname = 'p'\n[[bus]]\nname = 'b'\nkbits = 500\n").unwrap();
    let message = run(&["plant", "check", file.path().to_str().unwrap()]).fails(2).to_owned();
    assert!(
        message.contains(
            "line 5: unknown field `kbits`; did you mean kbit_s?; the keys of [[bus]] are: kind, name, "
        ),
        "{message}"
    );
}

#[test]
fn the_instance_is_allowed_before_and_after_the_command() {
    let emulator = Emulator::stepped();
    for args in [
        &["-i", &emulator.name, "peek", "--raw", "node2.w_CPU_CONTROL"][..],
        &["peek", "-i", &emulator.name, "--raw", "node2.w_CPU_CONTROL"],
        &["peek", "--raw", "node2.w_CPU_CONTROL", "-i", &emulator.name],
        &[
            "--color",
            "never",
            &format!("--instance={}", emulator.name),
            "peek",
            "--raw",
            "node2.w_CPU_CONTROL",
        ],
    ] {
        assert_eq!(finish(commram().args(args)).ok(), "16#0000\n", "{args:?}");
    }
    let list = finish(commram().args(["-i", &emulator.name, "fault", "list"]));
    assert_eq!(list.ok(), "no faults\n");
    let list = finish(commram().args(["fault", "-i", &emulator.name, "list"]));
    assert_eq!(list.ok(), "no faults\n");
}

#[test]
fn the_help_groups_the_commands_by_purpose() {
    let help = run(&["--help"]);
    for part in [
        "\n\nEmulators:\n  run          Run an emulator",
        "\n\nRegisters:\n  peek  ",
        "\n\nOptions:\n",
        "Exit codes:",
    ] {
        assert!(help.ok().contains(part), "{part}: {}", help.out);
    }
    assert_eq!(run(&["help"]).ok(), help.out);
}
