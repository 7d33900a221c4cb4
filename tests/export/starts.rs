//! Starts of a program with the exported runner: on every device, and of all kinds.

use crate::common::{Emulator, devices, eventually, finish, run};
use crate::matiec::{Plc, SOURCES};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Declarations of a program in matiec's form.
const POUS: &str = "#include \"iec_std_lib.h\"\n";

/// A program without a register: it writes the number of its scans since the start to a file.
const SCANS: &str = r#"
#include "POUS.h"
unsigned long long common_ticktime__ = 2000000ULL;
static struct { __DECLARE_VAR(INT,SCANS) __DECLARE_VAR(INT,KEPT) } own;
void config_init__(void) { __INIT_VAR(own.SCANS,0,0) __INIT_VAR(own.KEPT,100,1) }
void config_run__(unsigned long tick) {
  FILE *file = fopen("scans.tmp", "w");
  own.SCANS.value++, own.KEPT.value++, (void)tick;
  fprintf(file, "%d %d", own.SCANS.value, own.KEPT.value);
  fclose(file), rename("scans.tmp", "scans");
}
"#;

/// Variables of all kinds, each incremented in each scan. Variables outside the flags are copied to flags.
const KINDS: &str = r#"
#include "POUS.h"
unsigned long long common_ticktime__ = 2000000ULL;
static struct {
  __DECLARE_VAR(INT,KEPT) __DECLARE_VAR(INT,LOST)
  __DECLARE_LOCATED(BYTE,FLAG) __DECLARE_LOCATED(BYTE,BARE) __DECLARE_LOCATED(BYTE,KEPT_SEEN) __DECLARE_LOCATED(BYTE,LOST_SEEN)
} own, *data__ = &own;
void config_init__(void) {
  BOOL retain = 0;
  __INIT_VAR(own.KEPT,7,1)
  __INIT_VAR(own.LOST,3,retain)
  __INIT_LOCATED(BYTE,__MB10000008,own.FLAG,retain)
  __INIT_LOCATED_VALUE(own.FLAG,5)
  __INIT_LOCATED(BYTE,__MB10000009,own.BARE,retain)
  __INIT_LOCATED_VALUE(own.BARE,0)
  __INIT_LOCATED(BYTE,__MB10000012,own.KEPT_SEEN,retain)
  __INIT_LOCATED_VALUE(own.KEPT_SEEN,0)
  __INIT_LOCATED(BYTE,__MB10000013,own.LOST_SEEN,retain)
  __INIT_LOCATED_VALUE(own.LOST_SEEN,0)
}
void config_run__(unsigned long tick) {
  (void)tick;
  __SET_VAR(data__->,KEPT,,__GET_VAR(data__->KEPT,) + 1);
  __SET_VAR(data__->,LOST,,__GET_VAR(data__->LOST,) + 1);
  __SET_LOCATED(data__->,FLAG,,__GET_LOCATED(data__->FLAG,) + 1);
  __SET_LOCATED(data__->,BARE,,__GET_LOCATED(data__->BARE,) + 1);
  __SET_LOCATED(data__->,KEPT_SEEN,,(BYTE)__GET_VAR(data__->KEPT,));
  __SET_LOCATED(data__->,LOST_SEEN,,(BYTE)__GET_VAR(data__->LOST,));
}
"#;
const LOCATED: &str = "__LOCATED_VAR(BYTE,__MB10000008,M,B,10000008)\n__LOCATED_VAR(BYTE,__MB10000009,M,B,10000009)\n\
                       __LOCATED_VAR(BYTE,__MB10000012,M,B,10000012)\n__LOCATED_VAR(BYTE,__MB10000013,M,B,10000013)\n";
/// Registers that show the variables of `KINDS`: KEPT, LOST, FLAG, BARE.
const SEEN: [&str; 4] = ["%MB10000012", "%MB10000013", "%MB10000008", "%MB10000009"];

/// A plant with a CS0015.
const PANEL: &str = "[[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'open'\nprogram = 'attached'\n\
                     [[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";

/// Compiles such a program with the runner for the device.
fn built(directory: &Path, device: &str, program: &str, located: &str) -> PathBuf {
    for (args, name) in [(&[][..], "commram_matiec.h"), (&["--main"], "main.c")] {
        let path = directory.join(name);
        let args = [&["export", "matiec", "--device", device], args, &["--output", path.to_str().unwrap()]];
        run(&args.concat()).ok();
    }
    for name in ["accessor.h", "iec_std_lib.h", "iec_types.h"] {
        fs::copy(Path::new(SOURCES).join(name), directory.join(name)).unwrap();
    }
    for (name, text) in [("POUS.h", POUS), ("config.c", program), ("commram_located.h", located)] {
        fs::write(directory.join(name), text).unwrap();
    }
    let flags = "-std=gnu11 -O2 -Wall -Wextra -Werror -DCOMMRAM_MATIEC_ACCESS -include commram_matiec.h";
    let mut command = Command::new("cc");
    command.current_dir(directory).args(flags.split(' ')).args(["main.c", "config.c", "-o", "plc"]);
    finish(&mut command).ok();
    directory.join("plc")
}

/// Returns the values from the file of `SCANS`: scans since the start, and the variable that is declared RETAIN.
fn scans(directory: &Path) -> Option<(i32, i32)> {
    let text = fs::read_to_string(directory.join("scans")).ok()?;
    let (scans, kept) = text.split_once(' ')?;
    Some((scans.parse().ok()?, kept.parse().ok()?))
}

/// Every device runs a program while it has power, and orders a restart when the supply returns. Variables that are
/// declared RETAIN keep their values then (5.00005.03a p. 38; D-630).
#[test]
fn a_program_runs_on_every_device_while_there_is_power() {
    let all = [
        ("omega-drive-line-2", "line", "[[plc]]\nname = 'line'\n"),
        ("bm4-plc", "maxx", "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n"),
        ("cs0015", "panel", PANEL),
        (
            "cr201x",
            "inputs",
            "[[device]]\nkind = 'cr201x'\nmodule = 'cr2010'\nname = 'inputs'\nnode_id = 1\n",
        ),
        ("can-dp2", "gate", "[[device]]\nkind = 'can-dp2'\nname = 'gate'\n"),
    ];
    for device in devices() {
        let is_known = all.iter().any(|(known, ..)| *known == device);
        assert!(is_known, "add a plant with the PLC {device} to this list");
    }
    for (device, plc, section) in all {
        let directory = tempfile::tempdir().unwrap();
        let directory = directory.path();
        let program = built(directory, device, SCANS, "");
        let plant = directory.join("plant.toml");
        fs::write(&plant, section).unwrap();
        let emulator = Emulator::start(&[plant.to_str().unwrap()]);
        let running = Plc::start_in(&program, &emulator, plc, &[], directory);
        let scans = || scans(directory);
        assert!(eventually(|| scans().is_some_and(|(scans, _)| scans > 20)), "{device}: {:?}", scans());
        emulator.run("board", &["set", &format!("{plc}:power=off")]).ok();
        let mut last = None;
        assert!(
            eventually(|| core::mem::replace(&mut last, scans()) == scans()),
            "{device} runs without supply"
        );
        emulator.run("board", &["set", &format!("{plc}:power=on")]).ok();
        let (_, kept) = last.unwrap();
        assert!(eventually(|| scans().is_some_and(|(scans, now)| scans > 20 && now > kept)), "{device}");
        let (scans, now) = scans().unwrap();
        assert!(
            now - kept >= scans && now - kept < scans + 20,
            "{device}: {kept} became {now} in {scans} scans"
        );
        assert_eq!(running.end(), Some(0));
    }
}

/// 5.00005.03a p. 38: the values of variables and flags after each kind of start. The first scan after the start
/// finds the new values, whether or not the program ran before.
#[test]
fn each_kind_of_start_gives_the_values_of_its_kind() {
    let directory = tempfile::tempdir().unwrap();
    let program = built(directory.path(), "omega-drive-line-2", KINDS, LOCATED);
    let journal = || {
        let emulator = Emulator::stepped();
        let running = Plc::start_at(&program, &emulator, "line", &["0", "40"]);
        assert!(eventually(|| emulator.run("board", &["get"]).ok().contains("cyclic")));
        let after_scans = |ms: &str| {
            emulator.step(&[ms]);
            SEEN.map(|flag| u32::from_str_radix(&emulator.peek(&[flag])[3..], 16).unwrap())
        };
        let board = |setting: &str| drop(emulator.run("board", &["set", setting]).ok().to_owned());
        assert_eq!(after_scans("7ms"), [10, 6, 8, 3], "cold, three scans");
        board("line:start=warm");
        assert_eq!(after_scans("2ms"), [11, 4, 9, 4], "warm");
        board("line:start=hot");
        assert_eq!(after_scans("2ms"), [12, 5, 10, 5], "hot");
        board("line:start=stop");
        assert_eq!(after_scans("20ms"), [12, 5, 10, 5], "stop");
        board("line:start=cold");
        assert_eq!(after_scans("2ms"), [8, 4, 6, 1], "cold");
        board("line:switch=stop");
        assert_eq!(after_scans("20ms"), [8, 4, 6, 1], "the switch at STOP");
        board("line:switch=run");
        assert_eq!(after_scans("2ms"), [9, 4, 7, 2], "back at RUN: warm");
        emulator.run("board", &["power-cycle", "line"]).ok();
        assert_eq!(after_scans("2ms"), [10, 4, 8, 3], "the boot project, after the supply: warm");
        assert_eq!(running.end(), Some(0));
        emulator.run("trace", &[]).ok().to_owned()
    };
    let once = journal();
    for _ in 0..3 {
        assert_eq!(once, journal(), "the same, however fast this computer is");
    }
}

/// A word, its byte and one of its bits share memory, and get their initial values together.
const OVERLAID: &str = r#"
#include "POUS.h"
unsigned long long common_ticktime__ = 2000000ULL;
static struct {
  __DECLARE_LOCATED(WORD,WORD_) __DECLARE_LOCATED(BYTE,BYTE_) __DECLARE_LOCATED(BOOL,BIT) __DECLARE_LOCATED(BOOL,KEPT)
  __DECLARE_LOCATED(BYTE,SEEN)
} own, *data__ = &own;
void config_init__(void) {
  BOOL retain = 0;
  __INIT_LOCATED(WORD,__MW100,own.WORD_,retain)
  __INIT_LOCATED_VALUE(own.WORD_,0x0100)
  __INIT_LOCATED(BYTE,__MB100,own.BYTE_,retain)
  __INIT_LOCATED_VALUE(own.BYTE_,0)
  __INIT_LOCATED(BOOL,__MX100_2,own.BIT,retain)
  __INIT_LOCATED_VALUE(own.BIT,1)
  __INIT_LOCATED(BOOL,__MX10000000_7,own.KEPT,retain)
  __INIT_LOCATED_VALUE(own.KEPT,1)
  __INIT_LOCATED(BYTE,__MB101,own.SEEN,retain)
}
void config_run__(unsigned long tick) {
  (void)tick;
  __SET_LOCATED(data__->,BYTE_,,__GET_LOCATED(data__->BYTE_,) + 0x10);
  __SET_LOCATED(data__->,BIT,,!__GET_LOCATED(data__->BIT,));
  __SET_LOCATED(data__->,WORD_,,__GET_LOCATED(data__->WORD_,) + 0x0100);
  __SET_LOCATED(data__->,KEPT,,!__GET_LOCATED(data__->KEPT,));
}
"#;
const OVERLAID_PLACES: &str = "__LOCATED_VAR(WORD,__MW100,M,W,100)\n__LOCATED_VAR(BYTE,__MB100,M,B,100)\n\
                               __LOCATED_VAR(BOOL,__MX100_2,M,X,100,2)\n__LOCATED_VAR(BOOL,__MX10000000_7,M,X,10000000,7)\n\
                               __LOCATED_VAR(BYTE,__MB101,M,B,101)\n";

/// 5.00005.03a p. 41-42: flags are memory of the device and can be addressed with any width. P. 38: the kinds of
/// start that keep them (D-632).
#[test]
fn located_flags_overlay_each_other() {
    let directory = tempfile::tempdir().unwrap();
    let program = built(directory.path(), "omega-drive-line-2", OVERLAID, OVERLAID_PLACES);
    let emulator = Emulator::stepped();
    let running = Plc::start_at(&program, &emulator, "line", &["0", "40"]);
    assert!(eventually(|| emulator.run("board", &["get"]).ok().contains("cyclic")));
    let after_scan = || {
        emulator.step(&["2ms"]);
        emulator.peek(&["%MW100", "%MB200", "%MB10000000"])
    };
    emulator.poke(&["%MB200=7"]);
    assert_eq!(after_scan(), "16#0210 16#07 16#00", "the bit is off, so 16#10 is left of 16#14");
    assert_eq!(after_scan(), "16#0324 16#07 16#80");
    for (start, found) in
        [("hot", "16#0430 16#07 16#00"), ("warm", "16#0210 16#00 16#80"), ("cold", "16#0210 16#00 16#00")]
    {
        emulator.run("board", &["set", &format!("line:start={start}")]).ok();
        assert_eq!(after_scan(), found, "{start}");
    }
    emulator.run("board", &["power-cycle", "line"]).ok();
    assert_eq!(after_scan(), "16#0210 16#00 16#80", "the supply: RAM loses what it holds, NOVRAM does not");
    assert_eq!(running.end(), Some(0));
}

/// A program that initializes the bus of node 2, from which its own event comes, and counts its scans.
const INITIALIZES: &str = r#"
#include "POUS.h"
unsigned long long common_ticktime__ = 1000000ULL;
static struct {
  __DECLARE_VAR(INT,PHASE)
  __DECLARE_LOCATED(WORD,CONTROL) __DECLARE_LOCATED(WORD,STATUS) __DECLARE_LOCATED(BYTE,MODE) __DECLARE_LOCATED(BYTE,AC)
  __DECLARE_LOCATED(BYTE,AM) __DECLARE_LOCATED(BYTE,BT0) __DECLARE_LOCATED(BYTE,BT1) __DECLARE_LOCATED(BYTE,OUT)
  __DECLARE_LOCATED(BYTE,CLOCK) __DECLARE_LOCATED(BYTE,PATTERN) __DECLARE_LOCATED(BYTE,SLAVE) __DECLARE_LOCATED(WORD,SCANS)
} own, *data__ = &own;
void config_init__(void) {
  BOOL retain = 0;
  __INIT_VAR(own.PHASE,0,retain)
  __INIT_LOCATED(WORD,__MW3_200000,own.CONTROL,retain)
  __INIT_LOCATED(WORD,__MW3_200002,own.STATUS,retain)
  __INIT_LOCATED(BYTE,__MB3_200012,own.MODE,retain)
  __INIT_LOCATED(BYTE,__MB3_200013,own.AC,retain)
  __INIT_LOCATED(BYTE,__MB3_200014,own.AM,retain)
  __INIT_LOCATED(BYTE,__MB3_200015,own.BT0,retain)
  __INIT_LOCATED(BYTE,__MB3_200016,own.BT1,retain)
  __INIT_LOCATED(BYTE,__MB3_200017,own.OUT,retain)
  __INIT_LOCATED(BYTE,__MB3_200018,own.CLOCK,retain)
  __INIT_LOCATED(BYTE,__MB3_200019,own.PATTERN,retain)
  __INIT_LOCATED(BYTE,__MB3_200021,own.SLAVE,retain)
  __INIT_LOCATED(WORD,__MW100,own.SCANS,retain)
  __INIT_LOCATED_VALUE(own.SCANS,0)
}
void config_run__(unsigned long tick) {
  (void)tick;
  __SET_LOCATED(data__->,SCANS,,__GET_LOCATED(data__->SCANS,) + 1);
  switch (__GET_VAR(data__->PHASE,)) {
  case 0:
    __SET_LOCATED(data__->,CONTROL,,0);
    if (__GET_LOCATED(data__->STATUS,) == 1) __SET_VAR(data__->,PHASE,,1);
    break;
  case 1:
    __SET_LOCATED(data__->,CONTROL,,1);
    if (__GET_LOCATED(data__->STATUS,) == 2) {
      __SET_LOCATED(data__->,MODE,,0);
      __SET_LOCATED(data__->,AC,,0xFF);
      __SET_LOCATED(data__->,AM,,0xFF);
      __SET_LOCATED(data__->,BT0,,0x00);
      __SET_LOCATED(data__->,BT1,,0x1C);
      __SET_LOCATED(data__->,OUT,,0xFA);
      __SET_LOCATED(data__->,CLOCK,,0x07);
      __SET_LOCATED(data__->,PATTERN,,2);
      __SET_LOCATED(data__->,SLAVE,,1);
      __SET_LOCATED(data__->,CONTROL,,2);
      __SET_VAR(data__->,PHASE,,2);
    }
    break;
  case 2:
    if (__GET_LOCATED(data__->STATUS,) == 3) {
      __SET_LOCATED(data__->,CONTROL,,0x20);
      __SET_VAR(data__->,PHASE,,3);
    }
    break;
  }
}
"#;
const INITIALIZED: &str = "__LOCATED_VAR(WORD,__MW3_200000,M,W,3,200000)\n__LOCATED_VAR(WORD,__MW3_200002,M,W,3,200002)\n\
                           __LOCATED_VAR(BYTE,__MB3_200012,M,B,3,200012)\n__LOCATED_VAR(BYTE,__MB3_200013,M,B,3,200013)\n\
                           __LOCATED_VAR(BYTE,__MB3_200014,M,B,3,200014)\n__LOCATED_VAR(BYTE,__MB3_200015,M,B,3,200015)\n\
                           __LOCATED_VAR(BYTE,__MB3_200016,M,B,3,200016)\n__LOCATED_VAR(BYTE,__MB3_200017,M,B,3,200017)\n\
                           __LOCATED_VAR(BYTE,__MB3_200018,M,B,3,200018)\n__LOCATED_VAR(BYTE,__MB3_200019,M,B,3,200019)\n\
                           __LOCATED_VAR(BYTE,__MB3_200021,M,B,3,200021)\n__LOCATED_VAR(WORD,__MW100,M,W,100)\n";

/// The scans wait for the SYNC event, but there is no SYNC signal until a scan of the program has started the bus. The
/// runner therefore scans without the event while the event is missing, so the program can start its bus. After a
/// restart, the program stops the bus and starts it again. Then each SYNC edge causes a scan.
#[test]
fn a_program_that_scans_at_sync_starts_its_bus_itself() {
    let directory = tempfile::tempdir().unwrap();
    let program = built(directory.path(), "omega-drive-line-2", INITIALIZES, INITIALIZED);
    let journal = || {
        let emulator = Emulator::stepped();
        let running = Plc::start_at(&program, &emulator, "line", &["12", "0"]);
        assert!(eventually(|| emulator.run("board", &["get"]).ok().contains("cyclic")));
        for start in ["first", "second"] {
            emulator.step(&["500ms"]);
            assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0043", "{start}");
            let scans = || u32::from_str_radix(&emulator.peek(&["%MW100"])[3..], 16).unwrap();
            let before = scans();
            emulator.step(&["20ms"]);
            assert_eq!(scans() - before, 10, "{start}: a scan each 2 ms");
            emulator.run("board", &["set", "line:start=cold"]).ok();
        }
        assert_eq!(running.end(), Some(0));
        emulator.run("trace", &[]).ok().to_owned()
    };
    assert_eq!(journal(), journal(), "the same, however fast this computer is");
    // Without a stepped clock the program uses the time of the computer's clock.
    let emulator = Emulator::start(&[]);
    let running = Plc::start_at(&program, &emulator, "line", &["12", "0"]);
    assert!(eventually(|| emulator.peek(&["node2.w_OPTION_STATUS"]) == "16#0043"));
    assert_eq!(running.end(), Some(0));
}

/// A program that is not started prints the reason.
#[test]
fn a_stopped_program_prints_its_reason() {
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    let program = built(directory, "cs0015", SCANS, "");
    let plant = directory.join("plant.toml");
    fs::write(&plant, "[[device]]\nkind = 'cs0015'\nname = 'panel'\nprogram = 'none'\n").unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap()]);
    let image = format!("/dev/shm/commram.{}.panel", emulator.name);
    let mut command = Command::new("timeout");
    let outcome = finish(command.current_dir(directory).args(["-s", "TERM", "4"]).arg(program).arg(image));
    assert_eq!(outcome.err, "the program is stopped: the device says that no program is loaded\n");
    assert_eq!(scans(directory), None);
}
