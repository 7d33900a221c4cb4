//! Commands that need no emulator: `map`, `completions` and help, and the format of errors.

use crate::common::{commram, finish, finish_on_a_full_disk, run};
use crate::scenarios::Scripts;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

#[test]
fn the_map_shows_all_details_of_a_register() {
    assert_eq!(
        run(&["map", "node2.w_CANsync_STATUS"]).ok(),
        "\
node2.w_CANsync_STATUS
  meaning         Status of the CAN controller, refreshed every processor cycle
  address         %MW3.200004 (CPU 16#B414A004)
  type            WORD
  owner           firmware
  reset value     16#0000
  structure       CANsync_MA_CTRL_BMSTRUCT
  manual          5.00005.03a p. 147-148, 173
  area from       inferred D-220
  structure from  manual
  name from       manual
  offset from     inferred D-02
  type from       manual
  owner from      manual
  reset from      inferred D-320
  values, bits    5.00005.03a p. 148, 173
  values
    16#0000  nothing to report (inferred D-322)
  bits
    0     reserved     reserved
    1     overrun      1: overrun, a message was lost
    2     buffer free  1: send buffer free
    3     sent         1: last send job done
    4     receiving    1: receiving
    5     sending      1: sending
    6     warning      1: error present (warning)
    7     BUS-off      1: node deactivated (BUS-off)
    8-15  reserved     reserved
"
    );
}

#[test]
fn the_map_shows_arrays_compactly() {
    let map = run(&["map", "node2.a_RD_BMARRAY"]);
    assert!(map.ok().starts_with("node2.a_RD_BMARRAY[0..31][0..15]\n"), "{}", map.out);
    assert!(map.out.contains("  elements        [0..31][0..7] used, the others reserved\n"), "{}", map.out);
    let all = run(&["map"]);
    assert_eq!(all.ok().matches("node2.a_RD_BMARRAY").count(), 1);
    let one = run(&["map", "node2.a_RD_BMARRAY[3][1]"]);
    assert!(
        one.ok().starts_with("node2.a_RD_BMARRAY[3][1]\n") && one.out.contains("%MD3.201028"),
        "{}",
        one.out
    );
}

#[test]
fn the_map_shows_reserved_registers_on_request_only() {
    assert!(!run(&["map", "node2"]).ok().contains("b_CTRLREG_WRC3"));
    assert!(run(&["map", "node2", "--all"]).ok().contains("node2.b_CTRLREG_WRC3"));
    assert!(run(&["map", "node2.b_CTRLREG_WRC3"]).ok().contains("reserved        yes"));
}

#[test]
fn the_map_finds_registers_by_address() {
    let both = run(&["map", "%MB3.200012"]);
    assert!(both.ok().contains("node2.b_MA_SL_MODE\n") && both.out.contains("node2.b_CTRLREG_WRC1\n"));
    assert_eq!(run(&["map", "%MW3.200000"]).ok().matches("node2.w_CPU_CONTROL").count(), 1);
}

#[test]
fn the_map_lists_each_register_of_a_block_once_under_its_structure() {
    let map = run(&["map", "node2"]);
    assert_eq!(map.ok().matches("node2.w_OPTION_STATUS").count(), 1);
    let heads: Vec<_> =
        map.out.lines().filter(|line| line.starts_with("node2  %MB3.200000-232767")).collect();
    assert_eq!(heads.len(), 2, "{heads:?}");
    assert!(heads[0].contains("CANsync_INIT_BMSTRUCT") && heads[1].contains("CANsync_MA_CTRL_BMSTRUCT"));
}

#[test]
fn the_map_in_the_formats_of_programs() {
    let json = run(&["map", "--all", "--format", "json"]);
    let json: Vec<serde_json::Value> = serde_json::from_str(json.ok()).unwrap();
    let status = json.iter().find(|entry| entry["name"] == "node2.w_OPTION_STATUS").unwrap();
    assert_eq!(status["address"], "%MW3.200002");
    assert_eq!(status["provenance"]["offset"], "inferred D-02");
    assert_eq!(
        status["values"][0],
        serde_json::json!({
            "first": 1, "last": 1, "hex": "16#0001", "meaning": "start-up", "provenance": "manual",
        })
    );
    assert_eq!(status["provenance"]["type"], "manual");
    assert_eq!(status["provenance"]["reset"], "manual", "p. 150");
    let sync = json.iter().find(|entry| entry["name"] == "node1.b_SYNC_MODUS").unwrap();
    assert_eq!(sync["values"][1]["provenance"], "inferred D-06");
    assert_eq!(sync["provenance"]["owner"], "inferred D-321");
    let plain = json.iter().find(|entry| entry["name"] == "option1").unwrap();
    assert_eq!(plain["type"], "BYTE[262144]");
    assert_eq!(
        (&plain["provenance"]["offset"], &plain["provenance"]["owner"]),
        (&"manual".into(), &"inferred D-330".into())
    );
    assert_eq!(plain["provenance"]["area"], "inferred D-220");
    let plain = run(&["map", "option1", "--format", "csv"]);
    assert!(plain.ok().contains(",\"type D-330, owner D-330, reset D-330\","), "{}", plain.out);
    let csv = run(&["map", "node1", "--format", "csv"]);
    let head = "name,structure,address,cpu_address,type,owner,reset,reserved,page,provenance,meaning\n";
    assert!(csv.ok().starts_with(head), "{}", csv.out);
    let line = "node1.w_CPU_CONTROL,CANsync_INIT_BMSTRUCT,%MW3.100000,16#B4142000,WORD,both,16#0000,false,\
                \"149-150, 174-175\",\"offset D-02, reset D-320\",Command to the CANsync node\n";
    assert!(csv.out.contains(line), "{}", csv.out);
    assert!(run(&["map", "node1", "--format", "md"]).ok().starts_with("| name | structure |"));
}

#[test]
fn the_map_refuses_what_does_not_exist() {
    assert!(run(&["map", "node9"]).fails(2).contains("unknown area `node9`; the areas are baps, node1"));
    assert!(run(&["map", "node2.w_CPU_CONTRL"]).fails(2).contains("did you mean w_CPU_CONTROL?"));
    assert!(run(&["map", "%MB3.1000000"]).fails(2).contains("plain RAM"));
    assert!(run(&["map", "%MX3.200000.8"]).fails(2).contains("bits 0 to 7"));
}

#[test]
fn completions_for_all_shells() {
    for shell in ["bash", "elvish", "fish", "zsh"] {
        let script = run(&["completions", shell]);
        assert!(script.ok().contains("commram") && script.out.contains("COMMRAM_COMPLETE"), "{shell}");
    }
    assert!(run(&["completions", "tcsh"]).fails(2).contains("possible values: bash"));
}

/// Returns the candidates of bash for the last of these words, in order.
fn offered(words: &[&str]) -> Vec<String> {
    let [.., previous, current] = words else { panic!("a command and a word") };
    let script = format!(
        "source <({} completions bash)\nCOMP_WORDS=({})\nCOMP_CWORD={}\n_clap_complete_commram commram '{current}' '{previous}'\n\
         printf '%s\\n' \"${{COMPREPLY[@]}}\"",
        env!("CARGO_BIN_EXE_commram"),
        words.iter().map(|word| format!("'{word}' ")).collect::<String>(),
        words.len() - 1,
    );
    let mut bash = std::process::Command::new("bash");
    let programs = std::path::Path::new(env!("CARGO_BIN_EXE_commram")).parent().unwrap();
    bash.env("PATH", format!("{}:{}", programs.display(), std::env::var("PATH").unwrap_or_default()));
    let outcome = finish(bash.args(["--norc", "-c", &script]));
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(0), ""), "{words:?}");
    outcome.out.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

#[test]
fn bash_completes_subcommands_and_existing_values() {
    for (words, expected) in [
        (&["commram", "tr"][..], &["trace"][..]),
        (&["commram", "fault", "c"], &["clear"]),
        (
            &["commram", "fault", "add", "lose"],
            &["lose_frame", "lose_sync", "lose_telegram", "lose_character"],
        ),
        (&["commram", "board", "s"], &["set"]),
        (&["commram", "layout", "im"], &["import"]),
        (&["commram", "layout", "import", "--align", "na"], &["natural"]),
        (&["commram", "map", "--dev"], &["--device"]),
        (&["commram", "map", "--device", "bm"], &["bm4-plc"]),
        (&["commram", "export", "sys"], &["systemrdl"]),
        (&["commram", "trace", "--kind", "hand"], &["handshake"]),
        (&["commram", "run", "--clock", ""], &["realtime", "stepped"]),
        (&["commram", "completions", "f"], &["fish"]),
    ] {
        assert_eq!(offered(words), expected, "{words:?}");
    }
}

#[test]
fn help_has_examples_and_no_colours() {
    for command in [
        "run",
        "list",
        "stop",
        "map",
        "export",
        "peek",
        "poke",
        "wait",
        "step",
        "dump",
        "demo",
        "completions",
    ] {
        let help = run(&[command, "--help"]);
        assert!(help.ok().contains("Examples:\n  "), "{command}: {}", help.out);
        assert!(!help.out.contains('\x1b'), "{command}");
        assert!(help.out.lines().all(|line| line.chars().count() <= 100), "{command}: {}", help.out);
    }
    let help = run(&["--help"]);
    assert!(help.ok().contains("Exit codes:"));
    let version = run(&["--version"]);
    assert!(version.ok().starts_with("commram 0."));
    for part in ["\ncommit    ", "\nfeatures  plc, emulator, ", "\n  can-dp2             16#"] {
        assert!(version.out.contains(part), "{}", version.out);
    }
    assert_eq!(run(&["-V"]).ok().lines().count(), 1);
}

#[test]
fn command_line_errors_have_the_common_format() {
    let none = run(&[]);
    assert_eq!((none.code, none.out.as_str()), (Some(2), ""));
    assert!(none.err.contains("Usage: commram [OPTIONS] <COMMAND>"), "{}", none.err);
    assert!(run(&["peak"]).fails(2).contains("peek"));
    assert!(run(&["peek", "--row", "x"]).fails(2).contains("--raw"));
    assert!(run(&["list", "--format", "xml"]).fails(2).contains("[possible values: text, json, csv, md]"));
    assert!(run(&["peek", "--raw", "--format", "json", "node2.w_CPU_CONTROL"]).fails(2).contains("--raw"));
}

/// `commram map | head -1`: the reader closes the pipe early, which is no error and no panic.
#[test]
fn a_closed_pipe_is_no_error() {
    for args in [&["map", "--all"][..], &["completions", "bash"], &["--help"]] {
        let mut command = commram();
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut child = command.args(args).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
        assert_eq!(crate::common::wait_for(&mut child, "a command").code(), Some(0), "{args:?}");
        let mut err = String::new();
        std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut err).unwrap();
        assert_eq!(err, "", "{args:?}");
    }
}

/// An empty name could mean everything or nothing, so it is refused.
#[test]
fn an_empty_name_in_a_list_is_refused_with_the_right_form() {
    let name = crate::common::unique_name();
    for args in [
        &["run", "-i", &name, "--record", ","][..],
        &["run", "-i", &name, "--record", "node2,"],
        &["watch", ""],
        &["dump", " "],
        &["map", ""],
        &["find", ""],
        &["export", "fmu", "--registers", "", "--output", "plant.fmu"],
        &["test", ".", "--filter", ""],
        &["bus", "play", "a.log", "--interface", ""],
    ] {
        let outcome = run(args);
        let message = outcome.fails(2);
        assert!(message.contains("an empty name; write"), "{args:?}: {message}");
    }
}

#[test]
fn an_output_that_cannot_be_written_has_its_exit_code() {
    let scenario = Scripts::new(&[("good.rhai", "expect_that(true, \"fine\");")]);
    let scenario = scenario.0.path().to_str().unwrap();
    for args in [
        &["map"][..],
        &["--version"],
        &["--help"],
        &["help"],
        &["help", "run"],
        &["peek", "--help"],
        // A file with the name `-` is the standard output.
        &["export", "c", "--output", "-"],
        &["test", scenario, "--junit", "-"],
        &["test", scenario, "--report", "html=-"],
    ] {
        let outcome = finish_on_a_full_disk(commram().args(args));
        assert_eq!(outcome.code, Some(4), "{args:?}: {}", outcome.err);
        let message = "commram: cannot write the output: ";
        // The results of scenarios precede the message.
        let last = outcome.err.lines().last().unwrap_or_default();
        assert!(last.starts_with(message), "{args:?}: {}", outcome.err);
    }
}

/// Compiles a library with functions that replace those of libc.
fn library(directory: &Path, source: &str) -> PathBuf {
    let [text, library] = ["replaced.c", "replaced.so"].map(|name| directory.join(name));
    std::fs::write(&text, source).unwrap();
    finish(Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&text)).ok();
    library
}

/// Returns a command with such a library, in its directory. `output` redirects the output in the shell.
fn with_library(library: &Path, args: &[&str], output: &str) -> Command {
    let script = format!("LD_PRELOAD=$1; export LD_PRELOAD; shift; exec \"$0\" \"$@\" {output}");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).arg(commram().get_program()).arg(library).args(args);
    shell.current_dir(library.parent().unwrap());
    shell
}

/// File systems such as vfat and some of FUSE have no hard links.
#[test]
fn a_project_is_created_without_hard_links() {
    let directory = tempfile::tempdir().unwrap();
    let source = r"
        #include <errno.h>
        int linkat(int from, const char *old, int to, const char *new, int flags) { errno = EPERM; return -1; }
        int link(const char *old, const char *new) { errno = EPERM; return -1; }
    ";
    let library = library(directory.path(), source);
    finish(&mut with_library(&library, &["new", "project"], "")).ok();
    let plant = std::fs::read_to_string(directory.path().join("project/plant.toml")).unwrap();
    assert!(plant.contains("[[plc]]"), "{plant}");
    assert_eq!(finish(&mut with_library(&library, &["new", "project"], "")).code, Some(2));
}

/// NFS reports only at `close` that the disk of its server is full. A library in place of the `close` of libc simulates it.
#[test]
fn a_file_that_is_not_stored_at_close_keeps_the_old_one() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::create_dir(at("nfs")).unwrap();
    std::fs::write(at("nfs/a.h"), "old").unwrap();
    let source = r#"
        #define _GNU_SOURCE
        #include <errno.h>
        #include <fcntl.h>
        #include <stdio.h>
        #include <string.h>
        #include <sys/syscall.h>
        #include <unistd.h>
        int close(int file)
        {
            char name[32], path[4096] = "";
            snprintf(name, sizeof name, "/proc/self/fd/%d", file);
            int is_stored = readlink(name, path, sizeof path - 1) < 0 || !strstr(path, "/nfs/")
                || (fcntl(file, F_GETFL) & O_ACCMODE) == O_RDONLY;
            long result = syscall(SYS_close, file);
            if (is_stored)
                return (int)result;
            errno = EDQUOT;
            return -1;
        }
    "#;
    let library = library(directory.path(), source);
    let run = |args: &[&str], output: &str| finish(&mut with_library(&library, args, output));
    let file = run(&["export", "c", "--output", "nfs/a.h"], "");
    assert!(file.code == Some(3) && file.err.contains("cannot write nfs/a.h: "), "{}", file.err);
    let names: Vec<_> =
        std::fs::read_dir(at("nfs")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["a.h"]);
    assert_eq!(std::fs::read_to_string(at("nfs/a.h")).unwrap(), "old");
    let standard = run(&["map"], "> nfs/map");
    assert!(
        standard.code == Some(4) && standard.err.contains("cannot write the output: "),
        "{}",
        standard.err
    );
}

/// A file size limit of one kilobyte simulates a full disk.
#[test]
fn a_full_disk_keeps_the_old_files() {
    let directory = tempfile::tempdir().unwrap();
    let outputs = [("export c --output", "a.h"), ("test one.rhai --junit", "a.xml")];
    let script = format!("print(\"{}\"); expect_no_findings();", "long ".repeat(1_000));
    std::fs::write(directory.path().join("one.rhai"), script).unwrap();
    for (command, name) in outputs {
        let path = directory.path().join(name);
        std::fs::write(&path, "old").unwrap();
        let script = format!("trap '' XFSZ; ulimit -f 1; exec \"$0\" {command} {name}");
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]).arg(commram().get_program()).current_dir(directory.path());
        let outcome = finish(shell.env("TMPDIR", directory.path()));
        assert_eq!(outcome.code, Some(3), "{}", outcome.err);
        assert!(outcome.err.contains(&format!("cannot write {name}")), "{}", outcome.err);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    }
    assert_eq!(directory.path().read_dir().unwrap().count(), 3);
}

/// A file size limit of one kilobyte simulates a full disk.
#[test]
fn a_full_disk_keeps_the_old_pages_and_definitions() {
    let directory = tempfile::tempdir().unwrap();
    let commands = [("man .", "commram.1"), ("test --definitions .", "commram.d.rhai")];
    for (command, name) in commands {
        let path = directory.path().join(name);
        std::fs::write(&path, "old").unwrap();
        let script = format!("trap '' XFSZ; ulimit -f 1; exec \"$0\" {command}");
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]).arg(commram().get_program()).current_dir(directory.path());
        let outcome = finish(shell.env("TMPDIR", directory.path()));
        assert!(outcome.fails(3).contains("cannot write "), "{}", outcome.err);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old", "{command}");
    }
    assert_eq!(directory.path().read_dir().unwrap().count(), 2);
}

#[test]
fn no_instance_is_a_friendly_line_or_a_table() {
    let list = finish(commram().arg("list"));
    assert!(
        list.ok().starts_with("NAME  ")
            || list.out == "no instance is running; start one with `commram run`\n"
    );
}
