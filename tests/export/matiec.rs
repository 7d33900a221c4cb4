//! Tests the exported glue code for matiec and the program that runs a compiled program, with a program in the form
//! that matiec generates.
//!
//! matiec itself is in no package registry. `tests/matiec` therefore has its output for one program, and stubs
//! for the two files of its runtime library that such a program includes. If `COMMRAM_MATIEC` names a directory with
//! `iec2c` and `lib`, matiec compiles `program.st`, too.

use crate::common::{Emulator, Outcome, devices, eventually, finish, run, skipped, wait_for};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

pub(crate) const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/matiec");
/// The command of docs/reference/export.md that makes a header of matiec's list of located variables.
const FILTER: &str = "grep -o '__LOCATED_VAR([^)]*)' LOCATED_VARIABLES.h | sort -u > commram_located.h";
const ACCESS: [&str; 3] = ["-DCOMMRAM_MATIEC_ACCESS", "-include", "commram_matiec.h"];

/// Exports the glue and the program around it.
pub(crate) fn exported(directory: &Path) {
    let path = |name: &str| directory.join(name).to_str().unwrap().to_owned();
    run(&["export", "matiec", "--output", &path("commram_matiec.h")]).ok();
    run(&["export", "matiec", "--main", "--output", &path("main.c")]).ok();
}

/// Exports the glue and copies the stubs beside it.
fn prepare(directory: &Path) {
    exported(directory);
    for name in ["accessor.h", "iec_std_lib.h", "iec_types.h", "POUS.h", "config.c", "LOCATED_VARIABLES.h"] {
        fs::copy(Path::new(SOURCES).join(name), directory.join(name)).unwrap();
    }
}

fn filter(directory: &Path) {
    finish(Command::new("sh").current_dir(directory).args(["-c", FILTER])).ok();
}

fn compile(directory: &Path, flags: &[&str], sources: &[&str]) -> Outcome {
    let mut command = Command::new("cc");
    command.current_dir(directory).args(flags).args(ACCESS).args(sources).args(["-o", "plc"]);
    finish(&mut command)
}

/// Builds the stub as a program.
fn built(directory: &Path) -> PathBuf {
    prepare(directory);
    filter(directory);
    compile(directory, &["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror"], &["main.c", "config.c"]).ok();
    directory.join("plc")
}

fn image(emulator: &Emulator) -> String {
    image_of(emulator, "line")
}

fn image_of(emulator: &Emulator, plc: &str) -> String {
    format!("/dev/shm/commram.{}.{plc}", emulator.name)
}

/// A PLC program that runs until it is stopped.
pub(crate) struct Plc(Child);

impl Plc {
    fn start(program: &Path, emulator: &Emulator, args: &[&str]) -> Self {
        Self::start_at(program, emulator, "line", args)
    }

    pub(crate) fn start_at(program: &Path, emulator: &Emulator, plc: &str, args: &[&str]) -> Self {
        Self::start_in(program, emulator, plc, args, Path::new("."))
    }

    pub(crate) fn start_in(
        program: &Path,
        emulator: &Emulator,
        plc: &str,
        args: &[&str],
        directory: &Path,
    ) -> Self {
        let mut command = Command::new(program);
        command.arg(image_of(emulator, plc)).args(args).stdin(Stdio::null()).current_dir(directory);
        Plc(command.spawn().unwrap())
    }

    pub(crate) fn end(mut self) -> Option<i32> {
        let pid = self.0.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
        wait_for(&mut self.0, "the PLC program").code()
    }
}

impl Drop for Plc {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn located_variables_are_the_registers() {
    let directory = tempfile::tempdir().unwrap();
    let program = built(directory.path());
    let emulator = Emulator::start(&[]);
    emulator.poke(&["node2.a_WR_VALUE[0]=41"]);
    let plc = Plc::start(&program, &emulator, &[]);
    // The program writes two commands to one register in one scan. Both have had their effect, so the status is
    // 16#0002.
    assert!(eventually(|| emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0002"));
    // These flags contain the values that the first scan has read from registers, which get no initial values.
    assert_eq!(emulator.peek(&["%MB10000001", "%MD10000004"]), "16#00 16#0000002A");
    assert_eq!(emulator.peek(&["%MW10000008"]), emulator.peek(&["ethernet.w_SPEED"]));
    let board = emulator.run("board", &["get"]);
    assert!(board.ok().contains("cyclic"), "{}", board.out);
    assert_eq!(plc.end(), Some(0));
    assert!(!emulator.run("board", &["get"]).ok().contains("cyclic"));
    drop(emulator);
    let gone = finish(Command::new(&program).arg("/dev/shm/commram.none.line"));
    let text = "/dev/shm/commram.none.line: there is no image of that name\n";
    assert_eq!((gone.code, gone.err.as_str()), (Some(2), text));
    assert_eq!(finish(&mut Command::new(&program)).code, Some(2));
}

/// The emulated time waits for each scan, so the same program leaves the same journal at any speed.
#[test]
fn in_stepped_mode_time_waits_for_each_scan() {
    let directory = tempfile::tempdir().unwrap();
    let program = built(directory.path());
    let journal = |slowly: bool| {
        let emulator = Emulator::stepped();
        let plc = Plc::start(&program, &emulator, &["0", "40"]);
        assert!(eventually(|| emulator.run("board", &["get"]).ok().contains("cyclic")));
        for _ in 0..if slowly { 10 } else { 1 } {
            emulator.step(&[if slowly { "1ms" } else { "10ms" }]);
        }
        assert_eq!(plc.end(), Some(0));
        let trace = emulator.run("trace", &[]);
        trace.ok().to_owned()
    };
    let once = journal(false);
    // CPU timer 1 fires every 2 ms, and the node answers at once.
    assert!(once.contains("event 0 enabled every 2000 us") && once.contains("16#0001 -> 16#0002"), "{once}");
    assert_eq!(once, journal(true));
}

#[test]
fn the_program_reports_that_the_emulator_has_ended() {
    let directory = tempfile::tempdir().unwrap();
    let program = built(directory.path());
    let mut emulator = Emulator::start(&[]);
    let mut command = Command::new(&program);
    command.arg(image(&emulator));
    let running = std::thread::spawn(move || finish(&mut command));
    assert!(eventually(|| emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0002"));
    let path = image(&emulator);
    emulator.kill();
    let outcome = running.join().unwrap();
    assert_eq!((outcome.code, outcome.err), (Some(1), format!("{path}: the emulator is gone\n")));
}

#[test]
fn addresses_that_are_no_registers_are_refused_by_the_compiler() {
    let directory = tempfile::tempdir().unwrap();
    prepare(directory.path());
    for (located, why) in [
        ("WORD,__MW3_200001,M,W,3,200001", "__MW3_200001: the address is not divisible by the width"),
        ("WORD,__MW3_200012,M,W,3,200012", "__MW3_200012: the register there has another width"),
        ("BYTE,__MB3_200000,M,B,3,200000", "__MB3_200000: the register there has another width"),
        ("WORD,__MB3_200012,M,B,3,200012", "__MB3_200012: the type has another width than the address"),
        ("WORD,__MW3_128,M,W,3,128", "__MW3_128: the address is not in any area of the device"),
        ("BOOL,__MX3_200012_7,M,X,3,200012,7", "__MX3_200012_7: a single bit has no separate address"),
        ("BOOL,__M3_200012,M,S,3,200012", "__M3_200012: an address without a size is that of a bit"),
        ("BYTE,__MB3_200012_1,M,B,3,200012,1", "__MB3_200012_1: the address has levels too many"),
        ("ETHERNET_DIAGNOSE_BMSTRUCT,__MB3_200000,M,B,3,200000", "__MB3_200000: no structure of this size"),
    ] {
        fs::write(directory.path().join("LOCATED_VARIABLES.h"), format!("__LOCATED_VAR({located})\n"))
            .unwrap();
        filter(directory.path());
        let refused = compile(directory.path(), &["-std=gnu11", "-fsyntax-only"], &["main.c"]);
        assert!(refused.code != Some(0) && refused.err.contains(why), "{why}: {}", refused.err);
    }
}

/// Inputs, outputs and flags of the same memory are used as bits, bytes and words, in several spellings (D-772).
#[test]
fn bits_and_bytes_of_inputs_outputs_and_flags_are_one_memory() {
    let directory = tempfile::tempdir().unwrap();
    prepare(directory.path());
    let header = directory.path().join("commram_matiec.h");
    run(&["export", "matiec", "--device", "cs0015", "--output", header.to_str().unwrap()]).ok();
    fs::copy(Path::new(SOURCES).join("bits.h"), directory.path().join("LOCATED_VARIABLES.h")).unwrap();
    fs::copy(Path::new(SOURCES).join("bits.c"), directory.path().join("bits.c")).unwrap();
    filter(directory.path());
    for how in ["-DCOMMRAM_MATIEC_ACCESS", "-DCOMMRAM_MATIEC_BY_NAME"] {
        let mut command = Command::new("cc");
        command.current_dir(directory.path()).args(["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", how]);
        finish(command.args(["-include", "commram_matiec.h", "bits.c", "-o", "plc"])).ok();
        let plant = directory.path().join("plant.toml");
        fs::write(&plant, "[[device]]\nkind = 'cs0015'\nname = 'panel'\n").unwrap();
        let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
        emulator.breaks(&["owner"]);
        emulator.run("poke", &["%IX0.0=1", "%IB0=16#A5", "%IX1.8=TRUE", "%MX1013.15=1"]);
        let outcome = finish(Command::new(directory.path().join("plc")).arg(image_of(&emulator, "panel")));
        assert_eq!(
            outcome.ok(),
            "outputs 0108 01 1 1\nother spelling 0100\ninputs A5 1 1\nslave 8001 -2147483648 8001\n",
            "{how}"
        );
        assert_eq!(emulator.peek(&["%QX0.08", "%QB1", "%MW1010"]), "1 16#01 16#8001");
    }
}

/// The time that a block computes is at most 100 ms after the last time of the firmware (D-789).
#[test]
fn the_computed_time_of_blocks_has_a_limit() {
    let directory = tempfile::tempdir().unwrap();
    prepare(directory.path());
    fs::copy(Path::new(SOURCES).join("exact_time.c"), directory.path().join("exact_time.c")).unwrap();
    fs::write(directory.path().join("commram_located.h"), "").unwrap();
    for standard in ["-std=gnu99", "-std=gnu11"] {
        let mut command = Command::new("cc");
        command.current_dir(directory.path());
        command.args([standard, "-O2", "-Wall", "-Wextra", "-Werror", "-DCOMMRAM_MATIEC_ACCESS"]);
        finish(command.args(["exact_time.c", "-o", "exact_time"])).ok();
        let outcome = finish(&mut Command::new(directory.path().join("exact_time")));
        let expected = "stepped 1000000\nlate 1100000\nfast 20000000\nahead 3600000000\nbetween 1\n";
        assert_eq!(outcome.ok(), expected, "{standard}");
    }
}

/// A device without flags has only its registers as memory. Variables of a program at `%MW100`, `%MB100` and `%MX100.2`
/// would not overlay each other, without a message (D-740). So the compiler refuses such variables, and also segments
/// that the device does not have.
#[test]
fn flags_that_a_device_does_not_have_are_refused_by_the_compiler() {
    let directory = tempfile::tempdir().unwrap();
    prepare(directory.path());
    for (device, located) in [
        ("bm4-plc", "WORD,__MW100,M,W,100"),
        ("bm4-plc", "BYTE,__MB100,M,B,100"),
        ("bm4-plc", "BOOL,__MX100_2,M,X,100,2"),
        ("bm4-plc", "BYTE,__MB4_100,M,B,4,100"),
        ("omega-drive-line-2", "WORD,__MW4_100,M,W,4,100"),
    ] {
        let header = directory.path().join("commram_matiec.h");
        run(&["export", "matiec", "--device", device, "--output", header.to_str().unwrap()]).ok();
        fs::write(directory.path().join("LOCATED_VARIABLES.h"), format!("__LOCATED_VAR({located})\n"))
            .unwrap();
        filter(directory.path());
        let refused = compile(directory.path(), &["-std=gnu11", "-fsyntax-only"], &["main.c"]);
        let name = located.split(',').nth(1).unwrap();
        let why = format!("{name}: the address is not in any area of the device");
        assert!(refused.code != Some(0) && refused.err.contains(&why), "{device}, {why}: {}", refused.err);
    }
}

fn iec2c(matiec: &Path, directory: &Path, options: &[&str]) {
    let mut command = Command::new(matiec.join("iec2c"));
    command.current_dir(directory).args(options).arg("-I").arg(matiec.join("lib")).arg("commram.st");
    finish(&mut command).ok();
}

/// Compiles the output of matiec.
fn compile_made(matiec: &Path, directory: &Path, level: &str) {
    filter(directory);
    let library = format!("-I{}", matiec.join("lib/C").display());
    compile(directory, &[level, &library], &["main.c", "Config0.c", "Res0.c", "-lm"]).ok();
}

/// Compiles a program that contains function blocks.
pub(crate) fn compile_program(matiec: &Path, directory: &Path, level: &str) {
    iec2c(matiec, directory, &["-r"]);
    compile_made(matiec, directory, level);
}

/// matiec itself, and its output for every export.
#[test]
fn matiec_compiles_its_exports() {
    let Some(matiec) = std::env::var_os("COMMRAM_MATIEC").map(PathBuf::from) else {
        skipped("matiec", "COMMRAM_MATIEC names no directory with iec2c and lib");
        return;
    };
    let iec2c = |directory: &Path| iec2c(&matiec, directory, &[]);
    // Every block is compiled, also with one variable per register.
    let empty = "PROGRAM MAIN\nVAR N : INT; END_VAR\nN := N + 1;\nEND_PROGRAM\n";
    for device in devices() {
        for form in [&[][..], &["--elementary"]] {
            let directory = tempfile::tempdir().unwrap();
            let file = directory.path().join("commram.st");
            let args = ["export", "st", "--matiec", "--device", device, "--output", file.to_str().unwrap()];
            run(&[&args[..], form].concat()).ok();
            fs::write(directory.path().join("program.st"), empty).unwrap();
            iec2c(directory.path());
        }
    }
    // Compiles the blocks of every device that has them in Structured Text. The option -r is needed because they use
    // references to their registers.
    for device in ["omega-drive-line-2", "bm4-plc"] {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("commram.st");
        run(&["export", "st", "--blocks", "--device", device, "--output", file.to_str().unwrap()]).ok();
        fs::write(directory.path().join("program.st"), empty).unwrap();
        self::iec2c(&matiec, directory.path(), &["-r"]);
    }
    // The program has a variable with the name of a block, so the export must omit this block.
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("commram.st");
    run(&["export", "st", "--blocks", "--without", "led", "--output", file.to_str().unwrap()]).ok();
    let blink = "PROGRAM MAIN\nVAR LED : BOOL; END_VAR\nLED := NOT LED;\nEND_PROGRAM\n";
    fs::write(directory.path().join("program.st"), blink).unwrap();
    self::iec2c(&matiec, directory.path(), &["-r"]);
    // matiec translates some functions to functions of the mathematics library of C, which must be linked.
    let directory = tempfile::tempdir().unwrap();
    exported(directory.path());
    let file = directory.path().join("commram.st");
    run(&["export", "st", "--matiec", "--output", file.to_str().unwrap()]).ok();
    let functions =
        "PROGRAM MAIN\nVAR X : REAL := 2.0; END_VAR\nX := SQRT(X) + LN(X) + EXPT(X, 0.5);\nEND_PROGRAM\n";
    fs::write(directory.path().join("program.st"), functions).unwrap();
    iec2c(directory.path());
    compile_made(&matiec, directory.path(), "-O0");
    // A user must delete the configuration that an editor writes. The page has the two messages of matiec if it was not
    // deleted.
    let page = include_str!("../../docs/guide/plc-programs.md");
    let own = "CONFIGURATION Config0\nRESOURCE Res0 ON PLC\nTASK T(INTERVAL := T#20ms, PRIORITY := 0);\n\
        PROGRAM P WITH T : MAIN;\nEND_RESOURCE\nEND_CONFIGURATION\n";
    for (variable, message) in [
        (
            "VAR_EXTERNAL _CANsync_CTRL_MA : CANsync_MA_CTRL_BMSTRUCT; END_VAR",
            "The external variable does not match with any global variable",
        ),
        ("VAR M AT %MW3.200002 : WORD; END_VAR", "A previous CONFIGURATION has already been declared"),
    ] {
        let program = format!("PROGRAM MAIN\n{variable}\nVAR N : INT; END_VAR\nN := 1;\nEND_PROGRAM\n{own}");
        fs::write(directory.path().join("program.st"), program).unwrap();
        let mut command = Command::new(matiec.join("iec2c"));
        command.current_dir(directory.path()).arg("-I").arg(matiec.join("lib")).arg("commram.st");
        let refused = finish(&mut command);
        assert!(format!("{}{}", refused.out, refused.err).contains(message), "{message}: {}", refused.err);
        assert!(page.contains(message), "{message}");
    }
    // Compiles a program with a function block, TON, CASE, SFC, global variables and two instances.
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    exported(directory);
    fs::copy(Path::new(SOURCES).join("program.st"), directory.join("program.st")).unwrap();
    let whole = run(&["export", "st", "--matiec"]);
    let own = "VAR_GLOBAL TARGET : DINT := 4711; END_VAR\nRESOURCE";
    let second = "    PROGRAM instance2 WITH scan : WATCH;\nEND_RESOURCE";
    let whole = whole.ok().replace("\nRESOURCE", &format!("\n{own}")).replace("END_RESOURCE", second);
    fs::write(directory.join("commram.st"), whole).unwrap();
    iec2c(directory);
    for level in ["-O0", "-O2"] {
        compile_made(&matiec, directory, level);
        let emulator = Emulator::start(&["--speed", "20"]);
        let plc = Plc::start(&directory.join("plc"), &emulator, &[]);
        assert!(eventually(
            || emulator.peek(&["node2.a_RD_BMARRAY[1][0]", "%MB10000000"]) == "16#00001267 16#01"
        ));
        assert_eq!(plc.end(), Some(0));
    }
}
