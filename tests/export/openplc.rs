//! Tests the exports for OpenPLC and for Beremiz, with programs in the form that these tools generate. Both exports
//! bind located variables by their names.
//!
//! `tests/openplc` has the output of matiec and of OpenPLC's glue generator for one program, and a main program with
//! OpenPLC's order of calls. If `COMMRAM_OPENPLC` and `COMMRAM_BEREMIZ` name their directories, the tests follow
//! `docs/guide/plc-programs.md` word by word.

use crate::common::{
    Emulator, Outcome, commram, eventually, finish, is_there, python, run, skipped, wait_for,
};
use std::fs;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Copies the stubs and the exports to the paths of OpenPLC's files, and registers the header as
/// `docs/guide/plc-programs.md` describes.
fn prepare(core: &Path) {
    let library = core.join("lib");
    fs::create_dir_all(&library).unwrap();
    let copy = |name: &str, to: PathBuf| fs::copy(Path::new(ROOT).join("tests").join(name), to).unwrap();
    for name in ["accessor.h", "iec_std_lib.h", "iec_types.h"] {
        copy(&format!("matiec/{name}"), library.join(name));
    }
    for name in ["Config0.c", "POUS.h", "LOCATED_VARIABLES.h", "glueVars.cpp", "ladder.h", "main.cpp"] {
        copy(&format!("openplc/{name}"), core.join(name));
    }
    let export = |args: &[&str], to: PathBuf| {
        run(&[&["export", "openplc"], args, &["--output", to.to_str().unwrap()]].concat()).ok();
    };
    export(&[], library.join("commram_openplc.h"));
    export(&["--main"], core.join("hardware_layer.cpp"));
    let header = library.join("iec_std_lib.h");
    let with_ours = fs::read_to_string(&header).unwrap() + "#include \"commram_openplc.h\"\n";
    fs::write(header, with_ours).unwrap();
}

/// Runs `g++` like OpenPLC's script.
fn compile(core: &Path, args: &str) -> Outcome {
    let line = format!("c++ -std=gnu++11 -I ./lib {args} -w");
    finish(Command::new("sh").current_dir(core).args(["-c", &line]))
}

fn image(instance: &str) -> String {
    format!("/dev/shm/commram.{instance}.line")
}

/// A runtime that runs until it is stopped.
struct Runtime(Child);

impl Runtime {
    fn start(command: &mut Command, instance: &str) -> Self {
        command.env("COMMRAM_IMAGE", image(instance)).stdin(Stdio::null()).stdout(Stdio::piped());
        // Beremiz starts a child process, so the whole process group is killed.
        Runtime(command.process_group(0).spawn().unwrap())
    }

    /// Stops the runtime and returns its output.
    fn end(mut self) -> String {
        let pid = self.0.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
        let mut text = String::new();
        self.0.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        wait_for(&mut self.0, "the runtime");
        text
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        let group = format!("-{}", self.0.id());
        let _ = Command::new("kill").args(["-KILL", "--", &group]).stderr(Stdio::null()).status();
        let _ = self.0.wait();
    }
}

#[test]
fn located_variables_of_openplc_are_the_registers() {
    if !is_there("c++") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let core = directory.path();
    prepare(core);
    compile(core, "-c Config0.c -O2").ok();
    compile(core, "*.cpp *.o -o openplc -pthread -fpermissive -lrt").ok();
    let mut emulator = Emulator::stepped();
    let name = emulator.name.clone();
    let runtime = Runtime::start(&mut Command::new(core.join("openplc")), &name);
    let goes = |emulator: &Emulator| {
        let mut ms = 0;
        // The program writes two commands to one register in one scan. Both have had their effect, so the status is
        // 16#0002.
        let ready = eventually(|| {
            emulator.step(&["1ms"]);
            ms += 1;
            emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0002"
        });
        assert!(ready);
        // The emulated time advances only by steps.
        assert!(eventually(|| emulator.peek(&["%MB10000002"]) == format!("16#{:02X}", ms % 256)), "{ms}");
        // This flag contains the value that the first scan has read from a register, which gets no initial value.
        assert_eq!(emulator.peek(&["%MB10000001"]), "16#01");
        let speed = emulator.peek(&["ethernet.w_SPEED"]);
        assert_eq!(emulator.peek(&["%MB10000003"])[3..], speed[5..]);
    };
    goes(&emulator);
    // After a restart of the controller the program starts, too.
    emulator.kill();
    drop(emulator);
    let emulator = Emulator::start_as(&name, &["--clock", "stepped"]);
    goes(&emulator);
    let printed = runtime.end();
    let image = image(&name);
    assert!(printed.starts_with(&format!("{image}: attached\n{image}: ")), "{printed}");
    assert!(printed.ends_with(&format!("{image}: attached\noutput 1\n")), "{printed}");
}

#[test]
fn addresses_that_are_no_registers_are_refused_in_cpp() {
    if !is_there("c++") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let core = directory.path();
    prepare(core);
    for (located, why) in [
        ("WORD,__MW3_200001", "__MW3_200001: the address is not divisible by the width"),
        ("WORD,__MW3_200012", "__MW3_200012: the register there has another width"),
        ("WORD,__MB3_200012", "__MB3_200012: the type has another width than the address"),
        ("WORD,__MW3_128", "__MW3_128: the address is not in any area of the device"),
        ("BOOL,__MX3_200012_7", "__MX3_200012_7: a single bit has no separate address"),
        ("BOOL,__M3_200012", "__M3_200012: an address without a size is that of a bit"),
        ("BYTE,__MB3_200012_1", "__MB3_200012_1: the address has levels too many"),
        ("ETHERNET_DIAGNOSE_BMSTRUCT,__MB3_200000", "__MB3_200000: no structure of this size"),
        ("WORD,__MW10000008", "__MW10000008: OpenPLC has tables for numbers below 1024 only"),
        ("WORD,__MW3_99999999999", "__MW3_99999999999: the address"),
    ] {
        let (ty, name) = located.split_once(',').unwrap();
        let source = format!(
            "#include \"iec_std_lib.h\"\nextern __IEC_{ty}_p there;\n__IEC_{ty}_p there;\n\
             void init(BOOL retain) {{ __INIT_LOCATED({ty},{name},there,retain) }}\n"
        );
        fs::write(core.join("refused.c"), source).unwrap();
        let refused = compile(core, "-fsyntax-only refused.c");
        assert!(refused.code != Some(0) && refused.err.contains(why), "{why}: {}", refused.err);
    }
}

/// Returns the fenced block of `page` after the paragraph with `marker`.
pub(crate) fn block(page: &str, marker: &str) -> String {
    let text = fs::read_to_string(Path::new(ROOT).join("docs").join(page)).unwrap();
    let following = text.split_once(marker).unwrap_or_else(|| panic!("{page}: {marker}")).1;
    let fenced = following.split_once("```").unwrap().1.split_once('\n').unwrap().1;
    fenced.split_once("\n```").unwrap().0.to_owned() + "\n"
}

/// Returns the C extension of `docs/guide/plc-programs.md` as Beremiz writes it into a file.
fn extension() -> String {
    let text = block("guide/plc-programs.md", "`commram@c_ext/cfile.xml`");
    let section = |name: &str| {
        let from = format!("<{name}><![CDATA[");
        let text = text.split_once(&from).unwrap_or_else(|| panic!("{name}")).1;
        text.split_once("]]>").unwrap().0.to_owned()
    };
    format!(
        "#include <stdio.h>\n{}\n#include \"iec_std_lib.h\"\n{}\n\
         int __init_3(int argc, char **argv)\n{{\n(void)argc, (void)argv;\n{}  return 0;\n}}\n\
         void __cleanup_3(void)\n{{\n{}}}\nvoid __retrieve_3(void)\n{{\n{}}}\nvoid __publish_3(void)\n{{\n{}}}\n",
        section("includes"),
        section("globals"),
        section("initFunction"),
        section("cleanUpFunction"),
        section("retrieveFunction"),
        section("publishFunction")
    )
}

/// A main program with Beremiz's order of calls.
const BEREMIZ: &str = r#"
#include <signal.h>
#include "iec_std_lib.h"
#include "beremiz.h"
TIME __CURRENT_TIME;
BOOL __DEBUG;
BOOL *__QX0_1 = &(BOOL){0};
int LogMessage(uint8_t level, char *text, uint32_t size) { (void)level; printf("%.*s\n", (int)size, text); return fflush(stdout); }
void config_init__(void);
void config_run__(unsigned long tick);
int __init_3(int argc, char **argv);
void __cleanup_3(void);
void __retrieve_3(void);
void __publish_3(void);
static volatile sig_atomic_t ended;
static void on_signal(int number) { (void)number; ended = 1; }
int main(int argc, char **argv)
{
    struct timespec pause = { 0, 2000000 };
    signal(SIGTERM, on_signal);
    config_init__();
    if (__init_3(argc, argv)) return 3;
    for (unsigned long tick = 0; !ended; tick++) {
        __retrieve_3();
        config_run__(tick);
        __publish_3();
        nanosleep(&pause, 0);
    }
    __cleanup_3();
    printf("output %d\n", *__QX0_1);
    return 0;
}
"#;

/// Compiles the program and the extension of the page, with the page's two flags.
fn beremiz(directory: &Path) {
    for name in [
        "matiec/accessor.h",
        "matiec/iec_std_lib.h",
        "matiec/iec_types.h",
        "openplc/Config0.c",
        "openplc/POUS.h",
    ] {
        let from = Path::new(ROOT).join("tests").join(name);
        fs::copy(&from, directory.join(from.file_name().unwrap())).unwrap();
    }
    run(&["export", "matiec", "--output", directory.join("commram_matiec.h").to_str().unwrap()]).ok();
    let logging = "#include \"iec_types.h\"\n#define LOG_WARNING 1\nint LogMessage(uint8_t level, char *text, uint32_t size);\n";
    fs::write(directory.join("beremiz.h"), logging).unwrap();
    fs::write(directory.join("plc_main.c"), BEREMIZ).unwrap();
    fs::write(directory.join("CFile_3.c"), extension()).unwrap();
    let page = block("guide/plc-programs.md", "`beremiz.xml`");
    let flags = page.split_once("CFLAGS=\"").unwrap().1.split_once('"').unwrap().0;
    let flags = flags.replace("/home/you/plc/", "");
    let line = format!("cc -O2 -fPIC {flags} plc_main.c Config0.c CFile_3.c -o plc");
    finish(Command::new("sh").current_dir(directory).args(["-c", &line])).ok();
}

#[test]
fn the_extension_for_beremiz_attaches() {
    let directory = tempfile::tempdir().unwrap();
    beremiz(directory.path());
    let emulator = Emulator::start(&[]);
    let runtime = Runtime::start(&mut Command::new(directory.path().join("plc")), &emulator.name);
    assert!(eventually(|| emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0002"));
    assert_eq!(emulator.peek(&["%MB10000001"]), "16#01");
    assert_eq!(runtime.end(), "attached\noutput 1\n");
}

#[test]
fn beremiz_receives_the_reason_of_a_refusal() {
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    beremiz(directory);
    let config = fs::read_to_string(directory.join("Config0.c")).unwrap();
    for (address, why) in [
        ("__MW3_200001", "the address is not divisible by the width"),
        ("__MW3_200012", "the register there has another width"),
        ("__MB3_200012", "the type has another width than the address"),
        ("__M3_200012", "an address without a size is that of a bit; write %MB, %MW or %MD"),
        ("__MW3_128", "the address is not in any area of the device"),
        ("__QW7", "the device has no such address, and no library has it"),
    ] {
        fs::write(directory.join("Config0.c"), config.replace("__MW3_200000", address)).unwrap();
        let line =
            "cc -DCOMMRAM_MATIEC_BY_NAME -include commram_matiec.h plc_main.c Config0.c CFile_3.c -o plc";
        finish(Command::new("sh").current_dir(directory).args(["-c", line])).ok();
        let refused = finish(&mut Command::new(directory.join("plc")));
        assert_eq!((refused.code, refused.out), (Some(3), format!("{address}: {why}\n")));
    }
}

/// Runs the commands of a page, without the prompts, with this crate's `commram`.
pub(crate) fn type_in(lines: &str, directory: &Path) {
    let path = commram().get_program().to_owned();
    let bin = Path::new(&path).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    for line in lines.lines().filter_map(|line| line.strip_prefix("$ ")) {
        let mut command = Command::new("sh");
        finish(command.current_dir(directory).env("PATH", &path).args(["-ec", line])).ok();
    }
}

pub(crate) const ARRIVED: &str = "16#00001267";

#[test]
fn the_page_on_openplc_works_with_openplc() {
    let Some(openplc) = std::env::var_os("COMMRAM_OPENPLC").map(PathBuf::from) else {
        skipped("openplc", "COMMRAM_OPENPLC names no directory of OpenPLC with what its install.sh builds");
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let copy = "cp -r --parents webserver utils/snap7_src/wrapper ";
    let copy = format!("{copy}{}", directory.path().display());
    finish(Command::new("sh").current_dir(openplc).args(["-c", &copy])).ok();
    let webserver = directory.path().join("webserver");
    fs::write(webserver.join("program.st"), block("guide/plc-programs.md", "`program.st` brings")).unwrap();
    let once =
        block("guide/plc-programs.md", "Once for each OpenPLC").replace("$ cd OpenPLC_v3/webserver\n", "");
    type_in(&once, &webserver);
    type_in(&block("guide/plc-programs.md", "For each program, type two"), &webserver);
    let emulator = Emulator::start(&[]);
    let mut command = Command::new(webserver.join("core/openplc"));
    let _runtime = Runtime::start(command.current_dir(&webserver), &emulator.name);
    assert!(eventually(|| emulator.peek(&["node2.a_RD_BMARRAY[1][0]"]) == ARRIVED));
}

#[test]
fn the_page_on_beremiz_works_with_beremiz() {
    let Some(beremiz) = std::env::var_os("COMMRAM_BEREMIZ").map(PathBuf::from) else {
        skipped("beremiz", "COMMRAM_BEREMIZ names no directory of Beremiz with matiec beside it");
        return;
    };
    let Some(mut command) = python(&["erpc", "lxml", "twisted", "click"]) else { return };
    let directory = tempfile::tempdir().unwrap();
    let made = block("guide/plc-programs.md", "Make the folder and the header")
        .replace("$ cd plc\n", "")
        .replace("plc/", "");
    type_in(&made, directory.path());
    let write = |name: &str, text: String| fs::write(directory.path().join(name), text).unwrap();
    let here = directory.path().to_str().unwrap();
    write("beremiz.xml", block("guide/plc-programs.md", "`beremiz.xml`").replace("/home/you/plc", here));
    for name in ["baseconfnode.xml", "confnode.xml", "cfile.xml"] {
        let name = format!("commram@c_ext/{name}");
        write(&name, block("guide/plc-programs.md", &format!("`{name}`")));
    }
    write("program.st", block("guide/plc-programs.md", "`program.st` brings"));
    type_in(&block("guide/plc-programs.md", "For the manual's own names"), directory.path());
    write("plc.xml", block("guide/plc-programs.md", "`plc.xml`, which"));
    let emulator = Emulator::start(&[]);
    command.arg(beremiz.join("Beremiz_cli.py")).args([
        "-k",
        "--project-home",
        here,
        "build",
        "transfer",
        "run",
    ]);
    let _runtime = Runtime::start(&mut command, &emulator.name);
    assert!(eventually(|| emulator.peek(&["node2.a_RD_BMARRAY[1][0]"]) == ARRIVED));
}
