//! Completions as shells request them, and in the shells themselves.

use crate::common::{Emulator, commram, finish, run, skipped};
use std::path::Path;
use std::process::{Command, Stdio};

/// Returns the candidates for the last of these words.
fn completed(words: &[&str]) -> Vec<String> {
    let mut command = commram();
    let index = words.len().to_string();
    command.env("COMMRAM_COMPLETE", "bash").env("_CLAP_COMPLETE_INDEX", &index).env("_CLAP_IFS", "\n");
    let outcome = finish(command.args(["--", "commram"]).args(words));
    outcome.ok().lines().map(str::to_owned).collect()
}

#[test]
fn registers_are_completed_area_by_area_and_index_by_index() {
    assert_eq!(completed(&["peek", "nod"]), ["node1.", "node2."]);
    assert_eq!(completed(&["peek", "node2.w_OPT"]), ["node2.w_OPTION_STATUS"]);
    assert_eq!(completed(&["peek", "node2.a_STAT_S"]), ["node2.a_STAT_SL["]);
    let elements = completed(&["peek", "node2.a_STAT_SL["]);
    assert_eq!((elements.len(), elements[31].as_str()), (32, "node2.a_STAT_SL[31]"));
    assert_eq!(completed(&["peek", "_CANsync_CTRL_MA.w_CPU"]), ["_CANsync_CTRL_MA.w_CPU_CONTROL"]);
    assert_eq!(completed(&["poke", "node2.w_CPU"]), ["node2.w_CPU_CONTROL="]);
    assert_eq!(completed(&["wait", "node2.w_OPT"]), ["node2.w_OPTION_STATUS=="]);
}

#[test]
fn values_are_completed_by_name_with_any_word_breaks() {
    assert_eq!(completed(&["poke", "node2.w_CPU_CONTROL=rest"]), ["node2.w_CPU_CONTROL=restart"]);
    assert_eq!(completed(&["poke", "node2.w_CPU_CONTROL", "=", "rest"]), ["restart"]);
    let names = completed(&["poke", "node2.w_CPU_CONTROL", "="]);
    assert!(
        names.contains(&"handshake".to_owned()) && !names.iter().any(|it| it.starts_with('-')),
        "{names:?}"
    );
    assert_eq!(completed(&["poke", "node2.a_WR_VALUE[0]", "="]), [""; 0], "no names, and no options instead");
    assert_eq!(completed(&["wait", "node2.w_OPTION_STATUS", "==", "master_a"]), ["master_active"]);
}

#[test]
fn faults_are_completed_with_their_fields_and_words() {
    assert!(completed(&["fault", "add", "lose"]).contains(&"lose_frame".to_owned()));
    assert!(completed(&["fault", "add", "lose_frame", "sl"]).iter().any(|field| field == "slot="));
    assert!(completed(&["fault", "add", "lose_frame", "slot", "=", "WR"]).contains(&"WRC1".to_owned()));
    let slots = completed(&["fault", "add", "lose_frame", "slot", "="]);
    assert!(slots.contains(&"WRC1".to_owned()) && !slots.iter().any(|it| it.ends_with('=')), "{slots:?}");
    let fields = completed(&["fault", "add", "lose_frame", "slot", "=", "WRC1", ""]);
    assert!(fields.contains(&"count=".to_owned()) && !fields.contains(&"slot=".to_owned()), "{fields:?}");
    assert!(completed(&["fault", "add", "supply", "what=d"]).contains(&"what=drop".to_owned()));
}

#[test]
fn running_instances_their_plcs_and_buses_are_completed() {
    let emulator = Emulator::stepped();
    let name = emulator.name.as_str();
    assert!(completed(&["peek", "-i", &name[..2]]).contains(&name.to_owned()));
    assert_eq!(completed(&["board", "get", "-i", name, "li"]), ["line"]);
    assert_eq!(completed(&["bus", "open", "-i", name, "dr"]), ["drives"]);
    assert_eq!(completed(&["fault", "add", "lose_frame", "-i", name, "bus="]), ["bus=drives"]);
    assert_eq!(completed(&["drive", "show", "-i", name, "dr"]), ["drive1", "drive2", "drive3"]);
    assert_eq!(completed(&["drive", "set", "-i", name, "drive1", "P16"]), ["P167=", "P168="]);
    for slot in ["slot=WRC1", "slot=RDC1"] {
        run(&["fault", "add", "lose_frame", "-i", name, slot]).ok();
    }
    assert_eq!(completed(&["fault", "clear", "-i", name, "1", ""])[..1], ["2"]);
    assert!(completed(&["-i", &name[..2]]).contains(&name.to_owned()));
    assert!(completed(&["test", "--attach", &name[..2]]).contains(&name.to_owned()));
}

/// A suspended emulator keeps other clients for 10 s.
#[test]
fn an_emulator_that_does_not_answer_does_not_hold_up_completions() {
    let place = tempfile::tempdir().unwrap();
    let plant = place.path().join("two.toml");
    std::fs::write(&plant, "[[plc]]\nname = 'one'\n[[plc]]\nname = 'two'\n").unwrap();
    let two = [plant.to_str().unwrap(), "--clock", "stepped"];
    for args in [&["--clock", "stepped"][..], &two] {
        let emulator = Emulator::start(args);
        let name = emulator.name.as_str();
        emulator.signal("-STOP");
        let start = std::time::Instant::now();
        let found = [
            completed(&["bus", "open", "-i", name, ""]),
            completed(&["drive", "show", "-i", name, ""]),
            completed(&["drive", "set", "-i", name, "drive1", "P"]),
            completed(&["fault", "add", "lose_frame", "-i", name, "bus="]),
            completed(&["fault", "clear", "-i", name, "1"]),
        ];
        let took = start.elapsed();
        emulator.signal("-CONT");
        assert!(found.iter().all(|names| names.iter().all(|name| name.starts_with('-'))), "{found:?}");
        assert!(took < std::time::Duration::from_secs(9), "{took:?}");
    }
}

/// A running instance does not matter to a command that names another device.
#[test]
fn registers_of_the_device_on_the_command_line_are_completed() {
    let emulator = Emulator::stepped();
    let of = |device, begun| completed(&["map", "-i", &emulator.name, "--device", device, begun]);
    assert_eq!(of("can-dp2", "ms"), ["mst.", "mst"]);
    assert_eq!(of("can-dp2", "nod"), [""; 0]);
    assert!(of("tools/devices/mailbox", "bo").contains(&"box.".to_owned()));
    assert_eq!(completed(&["export", "st", "--device", "can-dp2", "--block", "ms"]), ["mst"]);
}

/// The names are those of the plant that will run, not of an emulator that runs now.
#[test]
fn recorded_registers_are_those_of_the_plant_on_the_command_line() {
    let _running = Emulator::stepped();
    assert_eq!(completed(&["run", "--record", "node2.w_OPT"]), ["node2.w_OPTION_STATUS"]);
    assert_eq!(completed(&["run", "--record", "node1,node2.w_OPT"]), ["node1,node2.w_OPTION_STATUS"]);
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/plants/cs0015.toml");
    assert_eq!(completed(&["run", plant, "--record", "node2.w_OPT"]), [""; 0]);
    assert!(completed(&["run", plant, "--record", "inp"]).contains(&"inputs.".to_owned()));
}

#[test]
fn scenario_and_plant_files_are_completed() {
    let scenarios = completed(&["test", "tests/scenarios/01"]);
    assert_eq!(scenarios, ["tests/scenarios/01-start-of-the-master.rhai"]);
    assert!(completed(&["run", "tools/plants/cs"]).contains(&"tools/plants/cs0015.toml".to_owned()));
}

/// Returns the output of a shell that has the program in its path.
fn in_shell(shell: &str, script: &str) -> Option<String> {
    let program = commram();
    let directory = Path::new(program.get_program()).parent().unwrap();
    let path = format!("{}:{}", directory.display(), std::env::var("PATH").unwrap_or_default());
    let mut command = Command::new(shell);
    command.args(["-c", script]).env("PATH", path).env_remove("COMMRAM_INSTANCE").stdin(Stdio::null());
    if Command::new(shell).args(["-c", "true"]).status().is_err() {
        skipped(shell, "it is not there");
        return None;
    }
    Some(finish(&mut command).ok().to_owned())
}

#[test]
fn bash_completes() {
    let script = "source <(commram completions bash)
        COMP_WORDS=(commram poke node2.w_CPU); COMP_CWORD=2
        _clap_complete_commram commram node2.w_CPU poke; echo \"${COMPREPLY[@]}\"
        COMP_WORDS=(commram poke node2.w_CPU_CONTROL = rest); COMP_CWORD=4
        _clap_complete_commram commram rest =; echo \"${COMPREPLY[@]}\"
        COMP_WORDS=(commram fault add supply what =); COMP_CWORD=5
        _clap_complete_commram commram '' what; echo \"${COMPREPLY[@]}\"";
    if let Some(out) = in_shell("bash", script) {
        assert_eq!(out, "node2.w_CPU_CONTROL=\nrestart\nunder over drop\n");
    }
}

/// A completed file name must be one word for the shell, even if it contains special characters.
#[test]
fn bash_runs_nothing_of_a_completed_name() {
    let directory = tempfile::tempdir().unwrap();
    let names = [
        "$(touch ran).rhai",
        "`touch ran`.rhai",
        "a;touch ran;.rhai",
        "b c'd\"e.rhai",
        "*.rhai",
        "x\ny.rhai",
    ];
    for name in names {
        std::fs::write(directory.path().join(name), "").unwrap();
    }
    let script = format!(
        "cd {}; source <(commram completions bash)
        for begun in './' './b\\ '; do
            COMP_WORDS=(commram test \"$begun\"); COMP_CWORD=2
            _clap_complete_commram commram \"$begun\" test
            for word in \"${{COMPREPLY[@]}}\"; do eval \"printf '%s|' $word\"; done; echo
        done
        # Bash quotes names of files within quotes, which it passes without the opening quote.
        compopt() {{ if [[ $2 == filenames ]]; then is_quoted=true; fi; }}
        for quote in \"'\" '\"'; do
            COMP_WORDS=(commram test \"$quote./b c\"); COMP_CWORD=2; is_quoted=false
            _clap_complete_commram commram './b c' test
            printf '%s|' $is_quoted \"${{COMPREPLY[@]}}\"; echo
        done; [[ $- == *f* ]] && echo globbing; test ! -e ran",
        directory.path().display()
    );
    if let Some(out) = in_shell("bash", &script) {
        let all = "./$(touch ran).rhai|./*.rhai|./`touch ran`.rhai|./a;touch ran;.rhai|./b c'd\"e.rhai|";
        let mut found: Vec<_> = out.lines().map(str::to_owned).collect();
        for line in &mut found {
            let mut words: Vec<_> = line.split_inclusive('|').collect();
            words.sort_unstable();
            *line = words.concat();
        }
        let quoted = "true|./b c'd\"e.rhai|";
        let quoted = quoted.split_inclusive('|').collect::<std::collections::BTreeSet<_>>();
        let quoted: String = quoted.into_iter().collect();
        assert_eq!(found, [all, "./b c'd\"e.rhai|", &quoted, &quoted]);
    }
}

#[test]
fn fish_completes() {
    let script = "commram completions fish | source
        complete -C 'commram peek node2.w_OPT' | string split -f1 \\t
        complete -C 'commram poke node2.w_CPU_CONTROL=rest' | string split -f1 \\t
        complete -C 'commram fault add supply what='";
    if let Some(out) = in_shell("fish", script) {
        assert_eq!(
            out,
            "node2.w_OPTION_STATUS\nnode2.w_CPU_CONTROL=restart\nwhat=under\nwhat=over\nwhat=drop\n"
        );
    }
}

/// Without a terminal, zsh has no line to complete, but it can list its candidates.
#[test]
fn zsh_completes() {
    let script = "autoload -Uz compinit; compinit -u -D
        source <(commram completions zsh)
        _describe() { print -l -- ${(P)3} }
        words=(commram peek node2.w_OPT); CURRENT=3; _clap_dynamic_completer_commram
        words=(commram peek nod); _clap_dynamic_completer_commram
        words=(commram fault add supply what=); CURRENT=5; _clap_dynamic_completer_commram; true";
    if let Some(out) = in_shell("zsh", script) {
        let names: Vec<_> = out.lines().map(|line| line.split(':').next().unwrap_or_default()).collect();
        assert_eq!(
            names,
            ["node2.w_OPTION_STATUS", "node1.", "node2.", "what=under", "what=over", "what=drop"]
        );
    }
}

#[test]
fn every_command_has_a_page_of_the_manual() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("man1");
    run(&["man", path.to_str().unwrap()]).ok();
    let page = std::fs::read_to_string(path.join("commram-wait.1")).unwrap();
    assert!(page.starts_with(".ie") && page.contains(".TH commram-wait 1"), "{page}");
    assert!(page.contains("\\-\\-within") && page.contains("Wait until registers have"), "{page}");
    let page = std::fs::read_to_string(path.join("commram-fault-add.1")).unwrap();
    assert!(page.contains("[OPTIONS] <KIND> [FIELD=VALUE]..."), "{page}");
    for name in ["commram", "commram-fault-add", "commram-man"] {
        assert!(path.join(format!("{name}.1")).exists(), "{name}");
    }
    assert!(!path.join("commram-demo-plc.1").exists(), "hidden commands have no page");
}
