//! commram: the communication RAM of drive and fieldbus controllers, emulated register by register: Baumüller's Omega
//! Drive-Line II and b maXX PLC with CANsync modules, ifm's CANopen controller CS0015, esd's PROFIBUS/CAN gateway CAN-DP/2.
//!
//! The RAM of a device is on the heap or in an image file in shared memory; for the first two devices, byte n is
//! `%MB3.n`. Firmware, buses and drives work on this memory. One deterministic function advances all of them:
//! [`Plant::advance_to`](plant::Plant::advance_to).
//!
//! | module | content |
//! |---|---|
//! | [`identity`] | indices of devices and buses, numbers of ports |
//! | [`layout`] | the register maps: typed structures, names, addresses, meanings; generated from `layouts/` |
//! | [`memory`] | cells, segments, and the parts to which a soft-PLC attaches: image files, the header page |
//! | [`can`] | CAN frames, their time on the wire, a CAN bus |
//! | [`profibus`] | PROFIBUS telegrams, their time on the line |
//! | [`serial`] | characters of serial lines, and the protocols 3964R and USS |
//! | [`door`] | interfaces through which foreign programs take part in buses |
//! | [`devices`] | the devices: behaviour of the registers, buses, function blocks |
//! | [`plant`] | PLCs, buses and drives from a plant file, with one clock |
//! | [`plc`] | the PLC side: the RAM as a program sees it, tasks |
//! | [`check`] | the access checker: violations of the manual by PLC programs |
//! | [`journal`] | the events with their times |
//! | [`request`] | operations on an emulator, their replies, and the function that executes them |
//! | [`fmi`] | a plant as a unit for co-simulation by FMI 3.0 |
//! | `plot` | registers over time as SVG or PNG (feature `studio`) |
//! | [`coupling`] | exchange of values and frames with other simulators |
//! | [`federation`] | one plant over several hosts |
//! | `helics` | connections between federates by HELICS (feature `helics`) |
//! | [`script`] | scenarios: Rust tests and Rhai scripts with the same verbs |
//! | [`runtime`] | a plant on image files, in real time or stepped |
//! | [`channel`] | the request-response interface for tools and tests |
//! | [`export`] | the register map for other languages and tools |
//! | [`cli`] | the program, also for programs with additional devices |
//! | [`time`] | emulated times as text |
//! | [`input_file`] | input files of users |
//!
//! The modules `layout` and `memory` are always available. Cargo features add the others: `channel`, `script` and
//! `export` add the modules of these names, `plc` adds the function blocks, `emulator` the emulation of the registers,
//! `cli` the program. All features are on by default. A soft-PLC sets `default-features = false, features = ["plc"]`.
//!
//! Example of a test, which needs no file and no other process:
//!
//! ```
//! use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, NODE2};
//! use commram::memory::Segment;
//! use commram::plant::{Plant, PlantConfig};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = PlantConfig::built_in()?;
//! let mut plant = Plant::new(&config, |_plc, device| Ok::<_, Box<dyn std::error::Error>>(Segment::of(device)))?;
//! let node2 = plant.devices()[0].segment().view::<CANsync_INIT_BMSTRUCT>(NODE2)?;
//! node2.w_CPU_CONTROL.store(0x0001);
//! plant.advance_to(1000);
//! assert_eq!(node2.w_OPTION_STATUS.load(), 0x0002);
//! # Ok(())
//! # }
//! ```

// Generated register maps refer to `commram`, so that they are valid in this crate and in others.
extern crate self as commram;

#[cfg(feature = "emulator")]
mod awake_time;
#[cfg(feature = "emulator")]
pub mod can;
#[cfg(feature = "channel")]
pub mod channel;
#[cfg(feature = "emulator")]
pub mod check;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "channel")]
pub mod coupling;
pub mod devices;
#[cfg(feature = "emulator")]
pub mod door;
#[cfg(feature = "emulator")]
mod due_queue;
#[cfg(feature = "export")]
pub mod export;
#[cfg(feature = "emulator")]
pub mod fault;
#[cfg(feature = "channel")]
pub mod federation;
#[cfg(feature = "emulator")]
pub mod fmi;
#[cfg(all(test, feature = "emulator"))]
#[path = "../tests/formats/samples.rs"]
mod format_samples;
#[cfg(feature = "helics")]
pub mod helics;
pub mod identity;
#[cfg(feature = "emulator")]
pub mod input_file;
#[cfg(feature = "emulator")]
pub mod journal;
pub mod layout;
pub mod memory;
#[cfg(feature = "script")]
mod namesakes;
#[cfg(feature = "cli")]
mod output_file;
#[cfg(any(test, feature = "emulator", feature = "export"))]
mod plain_text;
#[cfg(feature = "emulator")]
pub mod plant;
#[cfg(feature = "plc")]
pub mod plc;
#[cfg(feature = "script")]
mod plc_spelling;
#[cfg(feature = "studio")]
pub mod plot;
#[cfg(feature = "emulator")]
mod plural;
#[cfg(feature = "emulator")]
pub mod profibus;
#[cfg(feature = "emulator")]
pub mod request;
#[cfg(feature = "emulator")]
pub mod runtime;
#[cfg(feature = "script")]
pub mod script;
#[cfg(any(feature = "emulator", feature = "plc"))]
pub mod serial;
#[cfg(feature = "emulator")]
pub mod snapshot_fields;
pub mod time;
#[cfg(feature = "script")]
mod whole_script;
#[cfg(any(test, feature = "export", feature = "script", feature = "studio"))]
mod xml_text;

/// The example of the attach contract is a test.
#[cfg(all(doctest, feature = "cli"))]
#[doc = include_str!("../docs/reference/attach.md")]
struct AttachContract;

/// The code blocks of the function blocks' documentation are tests, too.
#[cfg(all(doctest, feature = "cli"))]
#[doc = include_str!("../docs/devices/omega-drive-line-2/function-blocks.md")]
struct FunctionBlocks;

/// The code blocks of the documentation of the CS0015 blocks are tests, too.
#[cfg(all(doctest, feature = "cli"))]
#[doc = include_str!("../docs/devices/cs0015/function-blocks.md")]
struct Cs0015Blocks;

/// The code blocks of the documentation of the CAN-DP/2 blocks are tests, too.
#[cfg(all(doctest, feature = "cli"))]
#[doc = include_str!("../docs/devices/can-dp2/function-blocks.md")]
struct CanDp2Blocks;

/// The code blocks of the scenario reference are tests, too.
#[cfg(all(doctest, feature = "cli"))]
#[doc = include_str!("../docs/reference/scenarios.md")]
struct Scenarios;

/// Settings of the library's property tests. Each draws 64 cases, or the number in the environment variable
/// `PROPTEST_CASES`; `tools/nightly cases` draws more. Inputs of earlier failures are kept below `tests/`, and not next to
/// the sources.
#[cfg(test)]
fn property_tests() -> proptest::test_runner::Config {
    use proptest::test_runner::{Config, FailurePersistence, FileFailurePersistence};
    let mut config = Config::default();
    if std::env::var_os("PROPTEST_CASES").is_none() {
        config.cases = 64;
    }
    // The environment can disable the storage of failures, so only an existing setting is replaced.
    config.failure_persistence = config.failure_persistence.map(|_| -> Box<dyn FailurePersistence> {
        Box::new(FileFailurePersistence::SourceParallel("tests/proptest-regressions/src"))
    });
    config
}

/// Runs a fuzz target. In a test, `target` receives the files that are kept for its name in `tests/__fuzz__`, and some
/// random bytes. In a build for libFuzzer (`tools/nightly fuzz`), it receives variations of the kept files until the
/// user stops it.
#[cfg(all(test, feature = "emulator"))]
fn fuzz(name: &str, target: impl Fn(&[u8]) + core::panic::RefUnwindSafe) {
    let location = bolero::TargetLocation {
        package_name: env!("CARGO_PKG_NAME"),
        manifest_dir: env!("CARGO_MANIFEST_DIR"),
        module_path: module_path!(),
        // Stored inputs are searched for next to this path, below `__fuzz__`.
        file: concat!(env!("CARGO_MANIFEST_DIR"), "/tests/__fuzz__"),
        line: line!(),
        item_path: "commram::fuzz::__bolero_item_path__",
        test_name: Some(name.to_owned()),
    };
    bolero::test(location).with_iterations(50).for_each(target);
}

/// Compares `table` with the table that begins with `head` in a page of the documentation. If the environment variable
/// called `update` has any value, replaces the table in the page.
#[cfg(all(test, feature = "emulator"))]
fn check_table_of_page(page: &str, head: &str, table: &str, update: &str) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(page);
    let page = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = page.split_once(head).expect("the head of the table");
    let (_, after) = rest.split_once("\n\n").unwrap();
    let now = format!("{before}{table}\n{after}");
    if std::env::var_os(update).is_some() {
        std::fs::write(&path, &now).unwrap();
    } else {
        assert!(page == now, "run this test with {update}=1");
    }
}
