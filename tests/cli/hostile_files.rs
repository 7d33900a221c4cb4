//! Files of the maximum length, made to be slow to read. Each is refused or accepted within the time that
//! docs/internals/promises.md promises.

use crate::common::{Outcome, commram, finish, promised, unique_name};
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;
use tempfile::TempDir;

const MIB: usize = 1 << 20;
/// Divisor of the lengths of files. A debug build is several times slower, so it gets shorter files;
/// `tools/nightly attack` runs these tests with whole files on a release build.
const PART: usize = if cfg!(debug_assertions) { 8 } else { 1 };
/// Time in which a file is accepted or refused.
const FIGURE: Duration = Duration::from_secs(10);

struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    fn run(&self, args: &[&str]) -> Outcome {
        promised(FIGURE, || finish(commram().args(args).current_dir(self.0.path())))
    }
}

/// Returns `head`, then as many items as fit into `bytes` bytes with `tail`.
fn filled(bytes: usize, head: &str, item: impl Fn(usize) -> String, tail: &str) -> String {
    let mut text = head.to_owned();
    for item in (0..).map(item) {
        if text.len() + item.len() + tail.len() > bytes {
            break;
        }
        text += &item;
    }
    text + tail
}

/// The mistake is at the end of the file, so that everything else is read before the error.
#[test]
fn plants_are_refused_within_the_promised_time() {
    let files = Files::new();
    let wrong = "[[fault]]\nkind = 'none'\n";
    let (plc, most) = ("[[plc]]\nname = 'p'\n", 8 * MIB / PART);
    let pairs = |n: usize| match n {
        0..65_000 => format!("[[plc]]\nname='p{n}'\nnode2='b{n}'\n[[bus]]\nname='b{n}'\n"),
        _ => "# and nothing else\n".to_owned(),
    };
    let drives = |n: usize| {
        let bus = if n.is_multiple_of(32) { format!("[[bus]]\nname='b{}'\n", n / 32) } else { String::new() };
        format!("{bus}[[bus.drive]]\nname='d{n}'\nslave_number={}\n", n % 32)
    };
    let fault = |_| "[[fault]]\nkind='lose_frame'\nslot='WRC1'\n".to_owned();
    let one_bus = format!("{plc}node2 = 'b'\n[[bus]]\nname = 'b'\n");
    let parameters = format!("{one_bus}[[bus.drive]]\nname='d'\nslave_number=1\nparameters=[");
    for (name, text, message) in [
        ("pairs", filled(most, "", pairs, wrong), "there is no such fault"),
        ("drives", filled(most, plc, drives, wrong), "there is no such fault"),
        ("faults", filled(most, &one_bus, fault, ""), "[[fault]] 257: "),
        (
            "parameters",
            filled(most, &parameters, |n| format!("{{number={},format='word'}},", 1000 + n % 3000), "]\n"),
            "the number is used twice",
        ),
        ("keys", filled(most, plc, |n| format!("k{n}=1\n"), ""), "unknown field `k0`"),
        ("deep", filled(most, &format!("{plc}x="), |_| "[".to_owned(), ""), "cannot recurse further"),
    ] {
        files.write(name, &text);
        let outcome = files.run(&["run", name, "-i", &unique_name()]);
        assert!(outcome.fails(2).contains(message), "{name}: {}", &outcome.err[..outcome.err.len().min(400)]);
    }
}

/// These plants are valid, so all checks run. Each plant has many names, buses or warnings.
#[test]
fn large_plants_are_accepted_within_the_promised_time() {
    let files = Files::new();
    let pairs = |n| format!("[[plc]]\nname='p{n}'\nnode2='b{n}'\n[[bus]]\nname='b{n}'\n");
    let stations = |n| format!("[[device]]\nkind='cs0015'\nname='d{n}'\nbus='c'\n");
    let no_master = |n| format!("[[bus]]\nname='b{n}'\n[[bus.drive]]\nname='d{n}'\nslave_number=1\n");
    let count = 65_000 / PART;
    let many = |head: &str, item: &dyn Fn(usize) -> String| {
        head.to_owned() + &(0..count).map(item).collect::<String>()
    };
    let one_bus = "[[plc]]\nname='p'\n[[bus]]\nname='c'\nkind='can'\nkbit_s=125\n";
    for (name, text, message) in [
        ("pairs", many("", &pairs), format!("{count} devices, {count} buses")),
        ("stations", many(one_bus, &stations), format!("{} devices, 1 bus with 0 drives", count + 1)),
        ("masters", many("[[plc]]\nname='p'\n", &no_master), format!("bus 'b{}' has no master", count - 1)),
    ] {
        files.write(name, &text);
        let outcome = files.run(&["run", "--check", name]);
        assert_eq!(outcome.code, Some(0), "{name}: {}", outcome.err);
        assert!(
            outcome.out.contains(&message),
            "{name}: {}",
            &outcome.out[outcome.out.len().saturating_sub(400)..]
        );
    }
}

/// One pass over the devices gives the messages of all buses.
#[test]
fn exports_of_large_plants_end_within_the_promised_time() {
    let files = Files::new();
    let stations = |n| {
        format!(
            "[[bus]]\nname='b{n}'\nkind='can'\nkbit_s=125\n[[device]]\nkind='cs0015'\nname='d{n}'\nbus='b{n}'\n"
        )
    };
    let count = 40_000 / PART;
    files.write("p.toml", &(0..count).map(stations).collect::<String>());
    let outcome = files.run(&["export", "wireshark", "--plant", "p.toml", "-o", "p.lua"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
    let text = std::fs::read_to_string(files.0.path().join("p.lua")).unwrap();
    assert_eq!(text.matches("kind = \"can\"").count(), count);
    let last = format!("b{}", count - 1);
    files.run(&["export", "dbc", "--plant", "p.toml", "--bus", &last, "-o", "p.dbc"]);
}

/// A script is compiled completely before it runs.
#[test]
fn scripts_are_compiled_or_refused_within_the_promised_time() {
    let files = Files::new();
    let most = MIB / 16;
    for (name, text, code) in [
        ("map", filled(most, "let m = #{", |n| format!("a{n}:1,"), "};"), 0),
        ("switch", filled(most, "switch 1 {", |n| format!("{n} => step(1),\n"), "}"), 0),
        ("functions", filled(most, "", |n| format!("fn f{n}(){{}}\n"), ""), 0),
        ("statements", filled(most, "let x=0;", |_| "x+=1;".to_owned(), ""), 0),
        ("braces", filled(most, "", |_| "{".to_owned(), ""), 2),
    ] {
        let name = format!("{name}.rhai");
        files.write(&name, &text);
        let outcome = files.run(&["test", &name, "--allow-empty"]);
        assert_eq!(
            outcome.code,
            Some(code),
            "{name}: {}",
            &outcome.out[outcome.out.len().saturating_sub(200)..]
        );
    }
}

#[test]
fn logs_and_dumps_are_accepted_or_refused_within_the_promised_time() {
    let files = Files::new();
    let frame = |n| format!("({:010}.{:06}) can0 123#0011223344556677\n", n / 1000, n % 1000);
    files.write("log", &filled(64 * MIB / PART, "", frame, "no frame\n"));
    let outcome = files.run(&["bus", "compare", "log", "-i", &unique_name()]);
    assert!(outcome.fails(2).contains("a line of a candump log is for example"), "{}", outcome.err);
    let register = |n| {
        let mut text = String::new();
        let name = format!("\"plc\":\"line\",\"register\":\"node2.r{n}\",\"address\":\"%MB3.200000\"");
        write!(text, "{{{name},\"hex\":\"16#00\",\"meaning\":\"\"}},").unwrap();
        text
    };
    files.write("dump", &filled(64 * MIB / PART, "[", register, "{}]"));
    let outcome = files.run(&["diff", "dump", "dump"]);
    assert!(outcome.fails(2).contains("dump is not a dump"), "{}", outcome.err);
}

/// The pipe never has a writer, so there is nothing to read.
#[test]
fn pipes_without_a_writer_do_not_block_a_command() {
    let (files, name) = (Files::new(), unique_name());
    for name in ["pipe", "pipe.rhai"] {
        let pipe = files.0.path().join(name);
        rustix::fs::mkfifoat(rustix::fs::CWD, pipe, rustix::fs::Mode::RUSR).unwrap();
    }
    files.write("import.rhai", "import \"pipe\" as p; import \"pipe\" as q; expect_that(true, \"\");");
    for (args, code) in [
        (&["run", "pipe"][..], 2),
        (&["run", "--check", "pipe"], 2),
        (&["run", "--from", "pipe"], 2),
        (&["diff", "pipe", "pipe"], 2),
        (&["bus", "compare", "pipe"], 2),
        (&["test", "pipe", "--allow-empty"], 2),
        (&["test", "import.rhai"], 2),
        (&["plot", "node2.w_CPU_CONTROL", "--journal", "pipe", "-o", "a.svg"], 2),
    ] {
        let instance = ["-i", &name];
        let with = if matches!(args[0], "diff" | "test" | "plot") { &[][..] } else { &instance[..] };
        let outcome = files.run(&[args, with].concat());
        assert_eq!(outcome.code, Some(code), "{args:?}: {}", outcome.err);
        let message = outcome.out.clone() + &outcome.err;
        assert!(message.contains("it is an empty pipe, and no program has it open"), "{args:?}: {message}");
    }
}

/// The output would destroy the input.
#[test]
fn an_output_that_is_an_input_of_the_command_is_refused() {
    let files = Files::new();
    let journal = "{\"v\":1,\"kind\":\"changed\",\"plc\":\"line\",\"address\":\"%MB3.5\",\"to\":1}\n";
    let inputs = [
        ("s.rhai", "import \"part\" as p; plant(\"p.toml\"); expect_that(true, \"\");"),
        ("part.rhai", "fn f() {}"),
        ("p.toml", "[[plc]]\nname = \"a\"\n[[bus]]\nname = \"c\"\nkind = \"can\"\nkbit_s = 125\n"),
        ("j.svg", journal),
    ];
    inputs.iter().for_each(|(name, text)| drop(files.write(name, text)));
    std::os::unix::fs::symlink("s.rhai", files.0.path().join("link.xml")).unwrap();
    let fmu = "--output=p.toml";
    for args in [
        &["test", "s.rhai", "--junit", "s.rhai"][..],
        &["test", "s.rhai", "--junit", "link.xml"],
        &["test", "s.rhai", "--report", "html=./part.rhai"],
        &["test", "s.rhai", "--junit", "p.toml"],
        &["test", "merge", "s.rhai", "p.toml", "--output", "p.toml"],
        &["export", "dbc", "--plant", "p.toml", "-o", "p.toml"],
        &["export", "wireshark", "--plant", "p.toml", "-o", "p.toml"],
        &["export", "fmu", "p.toml", fmu],
        &["export", "fmu", "--library", "p.toml", fmu],
        &["plot", "node2.w_CPU_CONTROL", "--journal", "j.svg", "-o", "j.svg"],
        &["run", "p.toml", "--detach", "--log", "p.toml"],
    ] {
        let outcome = files.run(args);
        assert_eq!(outcome.code, Some(2), "{args:?}: {}{}", outcome.out, outcome.err);
        assert!(outcome.err.contains("give the output another name"), "{args:?}: {}", outcome.err);
        for (name, text) in inputs {
            assert_eq!(std::fs::read_to_string(files.0.path().join(name)).unwrap(), text, "{args:?}");
        }
    }
}

#[test]
fn declarations_are_refused_within_the_promised_time() {
    let files = Files::new();
    let most = 4 * MIB / PART;
    let (layout, end) = (concat!(env!("CARGO_MANIFEST_DIR"), "/layouts/bm4-plc"), "END_TYPE\n");
    let first = "TYPE\nCANsync_MA_CTRL_BMSTRUCT : T0;\n";
    for (name, text, message) in [
        ("chain", filled(most, first, |n| format!("T{n} : T{};\n", n + 1), end), "chain"),
        (
            "doubling",
            filled(most, first, |n| format!("T{n} : STRUCT a : T{0}; b : T{0}; END_STRUCT;\n", n + 1), end),
            "doubling",
        ),
        (
            "members",
            filled(most, "TYPE T : STRUCT\n", |n| format!("m{n} : BYTE;\n"), "END_STRUCT;\nEND_TYPE\n"),
            "none of",
        ),
        ("comments", filled(most, "", |_| "(*".to_owned(), ""), "this comment has no end"),
    ] {
        files.write(name, &text);
        let outcome = files.run(&["layout", "import", name, "--layout", layout, "--check"]);
        assert!(outcome.fails(2).contains(message), "{name}: {}", &outcome.err[..outcome.err.len().min(400)]);
    }
}

/// A pipe without a writer, a device without an end, a file of the maximum length and a file that is longer.
#[test]
fn layouts_are_accepted_or_refused_within_the_promised_time() {
    let files = Files::new();
    let layout = files.0.path().join("layout");
    std::fs::create_dir(&layout).unwrap();
    let head = "name = 'any'\nid = 'ANY'\n";
    let values = |n| format!("[[meaning]]\nname = 'm{n}'\nvalues = [{{ value = {n}, text = 'x' }}]\n");
    let check = |message: &str| {
        let outcome = files.run(&["layout", "check", "layout"]);
        assert!(outcome.out.contains(message), "{message}: {}", &outcome.out[..outcome.out.len().min(400)]);
        assert_eq!(outcome.code, Some(2), "{message}");
    };
    let device = layout.join("device.toml");
    rustix::fs::mkfifoat(rustix::fs::CWD, &device, rustix::fs::Mode::RUSR).unwrap();
    check("no regular file");
    std::fs::remove_file(&device).unwrap();
    std::os::unix::fs::symlink("/dev/zero", &device).unwrap();
    check("no regular file");
    std::fs::remove_file(&device).unwrap();
    std::fs::write(&device, filled(2 * MIB, head, values, "")).unwrap();
    check("more than 1 MiB");
    for text in [filled(MIB, head, values, ""), filled(MIB, "x = ", |_| "[".to_owned(), "")] {
        std::fs::write(&device, text).unwrap();
        check("wrong");
    }
    let pipe = files.0.path().join("pipe");
    rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR).unwrap();
    let known = concat!(env!("CARGO_MANIFEST_DIR"), "/layouts/bm4-plc");
    let outcome = files.run(&["layout", "import", "pipe", "--layout", known, "--check"]);
    assert!(outcome.fails(2).contains("it is an empty pipe"), "{}", outcome.err);
}

/// A layout with structures of `words` DWORDs that overlay each other in one area; each file has `more` at its end.
fn write_overlaid(layout: &std::path::Path, count: usize, words: usize, more: &str) {
    let names: Vec<_> = (0..count).map(|n| format!("S{n}")).collect();
    for name in &names {
        let sources = ["name_from", "offsets", "names", "types", "owners", "resets"];
        let sources: String = sources.iter().map(|key| format!("{key} = 'manual'\n")).collect();
        let registers = format!(
            "{{ offset = 0, name = 'a_R', type = 'DWORD', array = [{words}], owner = 'both', doc = 'x' }}"
        );
        let text = format!(
            "name = '{name}'\n{sources}size = {}\npage = '1'\ndoc = 'x'\nregister = [{registers}]\n{more}",
            4 * words
        );
        std::fs::write(layout.join(format!("{name}.toml")), text).unwrap();
    }
    let quoted = names.iter().map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", ");
    let placed: String = names
        .iter()
        .map(|name| format!("{{ name = '{name}', live = 'always', variable = '_{name}' }},\n"))
        .collect();
    let device = format!(
        "name = 'any'\ntitle = 'Any'\nmanual = '1'\nreserved = {{ owner = 'firmware', source = 'manual' }}\n\
         structures = [{quoted}]\nnames = 'manual'\n[[space]]\nname = 's'\nletter = 'M'\nsegment = 3\n\
         unit = 'byte'\nfirst = 0\noffset = 4096\npage = '1'\ndoc = 'x'\n[[area]]\nname = 'a'\nfirst = 0\n\
         last = {}\npage = '1'\ndoc = 'x'\nstructure = [\n{placed}]\n",
        4 * words - 1
    );
    std::fs::write(layout.join("device.toml"), device).unwrap();
}

/// Short files with many structures, and many long files.
#[test]
fn many_overlaid_structures_are_accepted_or_refused_within_the_promised_time() {
    let files = Files::new();
    let layout = files.0.path().join("layout");
    std::fs::create_dir(&layout).unwrap();
    let long = format!("# {}\n", "x".repeat(MIB - 1000));
    for (count, words, more, code, message) in [
        (400, 8_192, "", 0, "other"),
        (700, 8_192, "", 2, "the structures of all areas up to `S512` in `a` have more than 16777216 bytes"),
        (3, 60_000, &long, 2, "the files of the layout up to this one have more than 2 MiB"),
    ] {
        write_overlaid(&layout, count, words, more);
        let outcome = files.run(&["layout", "check", "layout"]);
        assert_eq!(outcome.code, Some(code), "{}", &outcome.out[..outcome.out.len().min(600)]);
        assert!(outcome.out.contains(message), "{message}: {}", &outcome.out[..outcome.out.len().min(600)]);
    }
}

/// The content follows a valid head and has the maximum length that commram reads.
#[test]
fn snapshots_are_refused_within_the_promised_time() {
    let files = Files::new();
    let right = {
        let emulator = crate::common::Emulator::stepped();
        let path = files.0.path().join("right.snap");
        emulator.run("snapshot", &[path.to_str().unwrap()]).ok();
        std::fs::read(path).unwrap()
    };
    let longest = usize::try_from(commram::plant::SnapshotFile::LONGEST).unwrap();
    for (name, bytes, message) in [
        ("zeros", vec![0; longest], "it is not a snapshot"),
        ("longer", vec![0; longest + 1], "longer than 64 MiB"),
        ("tail", [&right[..right.len() / 2], &vec![0xFF; longest - right.len()][..]].concat(), "damaged"),
    ] {
        std::fs::write(files.0.path().join(name), bytes).unwrap();
        let outcome = files.run(&["run", "--from", name, "-i", &unique_name()]);
        assert!(outcome.fails(2).contains(message), "{name}: {}", outcome.err);
    }
}

/// Values of a plant with one PLC, and of a plant with many.
#[test]
fn exchange_files_are_accepted_or_refused_within_the_promised_time() {
    let files = Files::new();
    let count = 500;
    let pair = |n| format!("[[plc]]\nname='p{n}'\nnode2='b{n}'\n[[bus]]\nname='b{n}'\n");
    files.write("one.toml", &pair(0));
    files.write("many.toml", &(0..count).map(pair).collect::<String>());
    let entries = |bytes: usize, value: &dyn Fn(usize) -> String| {
        let item = |n: usize| format!("{{value='{}',key='k{n}'}},", value(n));
        filled(bytes, "period='1ms'\npublish=[", item, "]\n")
    };
    let all = |value: &str| format!("period='1ms'\npublish=[{{value='{value}'}}]\n");
    let of_array = |n: usize| format!("node2.a_RD_BMARRAY[{}][{}]", n / 8 % 32, n % 8);
    let most = MIB / PART;
    for (name, plant, text, message) in [
        ("names", "one.toml", entries(most, &of_array), "fine"),
        ("patterns", "one.toml", entries(MIB, &|_| "node2.w_OPTION_S*".to_owned()), "would take too long"),
        ("PLCs", "many.toml", entries(most, &|n| format!("p{}:node2.w_CPU_CONTROL", n % count)), "fine"),
        ("values", "many.toml", all("*"), "more than 100000 values"),
        ("nothing", "many.toml", all("node2.w_CPU_CONTROLS"), "has no register `w_CPU_CONTROLS`"),
        ("long", "one.toml", entries(MIB + 100, &of_array), "longer than 1 MiB"),
    ] {
        files.write("exchange.toml", &text);
        let outcome =
            files.run(&["run", "--check", plant, "--clock", "stepped", "--exchange", "exchange.toml"]);
        let output = format!("{}{}", outcome.out, outcome.err);
        assert!(output.contains(message), "{name}: {}", &output[..output.len().min(600)]);
    }
}
