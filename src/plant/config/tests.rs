//! Mistakes in a plant file, each with its message.

use super::*;
use crate::devices;
use crate::devices::BUS_KINDS;
use crate::identity::BusIndex;
use crate::memory::Segment;
use crate::plant::Plant;

#[test]
fn the_built_in_plant_is_valid() {
    let plant = PlantConfig::built_in().unwrap();
    let numbers: Vec<u8> = plant.buses[0].participants().iter().map(|(_, number)| *number).collect();
    assert_eq!((plant.devices.len(), numbers), (1, vec![1, 2, 3]));
}

#[test]
fn the_documented_plant_file_is_valid() {
    let text = include_str!("../../../docs/reference/plant.md");
    let example = text.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let plant = PlantConfig::parse("docs/reference/plant.md", example).unwrap();
    assert_eq!(plant.buses[1].participants()[0].0, "winder");
    assert!(plant.buses[1].build(BusIndex(1)).is_ok());
}

/// Any plant file is either refused, or it is a plant that runs.
#[test]
fn fuzz_plant() {
    crate::fuzz("plant", |bytes| {
        let Ok(text) = str::from_utf8(bytes) else { return };
        let Ok(config) = PlantConfig::parse("plant", text) else { return };
        if config.check().is_err() || config.devices.len() > 8 {
            return;
        }
        let segment = |_: &str, device| Ok::<_, Box<dyn core::error::Error>>(Segment::of(device));
        if let Ok(mut plant) = Plant::new(&config, segment) {
            plant.advance_to(3_000);
        }
    });
}

#[test]
fn more_devices_than_there_are_numbers_for_are_refused() {
    let text: String = (0..65_536).map(|n| format!("[[plc]]\nname = 'p{n}'\n")).collect();
    let error = PlantConfig::parse("big.toml", &text).unwrap_err().to_string();
    assert!(error.contains("the plant has 65536 PLCs; there can be at most 65535"), "{error}");
}

#[test]
fn each_mistake_is_named() {
    let drive = |name: &str, number: u8| format!("[[bus.drive]]\nname = '{name}'\nslave_number = {number}\n");
    let bus = "[[bus]]\nname = 'b'\n";
    let plc = "[[plc]]\nname = 'p'\n";
    let kind = devices::default().layout.name;
    let cases = [
        (String::new(), "the plant has no PLC"),
        ("[[plc]]\nname = 'a b'\n".into(), "PLC name 'a b': use 1 to 31 characters"),
        (format!("{plc}{plc}"), "there are two PLCs named 'p'"),
        (format!("{plc}dip = 32\n"), "dip of 'p' is 32; it must be 0 to 31"),
        (format!("{plc}option_sync_us = 49\n"), "option_sync_us of 'p' is 49; it must be 50 to 1000000"),
        (
            format!("{plc}retain_bytes = 57348\n"),
            "retain_bytes of 'p' is 57348; it must be 4 to 57344 (the 56 kB of the NOVRAM) and divisible by 4",
        ),
        (format!("{plc}retain_bytes = 6\n"), "retain_bytes of 'p' is 6; it must be 4 to 57344"),
        (format!("{plc}ethernet_mbit = 1\n"), "ethernet_mbit of 'p' is 1; it must be 100, 10 or 0"),
        (
            format!("{plc}node2 = 'x'\n{bus}"),
            "node2 of PLC 'p' is on bus 'x', which does not exist; buses are: b",
        ),
        (
            format!("{plc}node2 = 'b'\n{bus}kind = 'can'\nkbit_s = 500\n"),
            &format!(
                "node2 of PLC 'p' is on bus 'b' of kind 'can'; it needs one of kind '{}'",
                BUS_KINDS[0].name
            ),
        ),
        (
            format!("{plc}{bus}kbit_s = 1000\n{}", drive("d", 1)),
            "line 6: drive d: card_function 1 does not run at 1000 kbit/s",
        ),
        (
            format!("{plc}node2 = 'b'\n[[plc]]\nname = 'q'\nnode2 = 'b'\n{bus}"),
            "bus 'b' has two masters, node2 of 'p' and node2 of 'q'",
        ),
        (
            format!("{plc}{bus}{}{}", drive("d", 4), drive("e", 4)),
            "slave number 4 is used twice on bus 'b', by 'd' and 'e'",
        ),
        (
            format!("{plc}dip = 4\nnode1 = 'b'\n{bus}{}", drive("d", 4)),
            "slave number 4 is used twice on bus 'b', by 'p' and 'd'",
        ),
        (format!("{plc}{bus}kbit_s = 100\n"), "kbit_s of 'b' is 100; it must be 1000, 500, 250 or 125"),
        (
            format!("{plc}{bus}frame_length = 'long'\n"),
            "unknown variant `long`, expected `fixed` or `variable`",
        ),
        (
            format!("processor_cycle_us = 5\n{plc}"),
            "processor_cycle_us of 'plant' is 5; it must be 10 to 10000",
        ),
        (
            format!("{plc}[[device]]\nname = 'd'\nkind = 'toaster'\n"),
            &format!("test.toml: line 5: there is no device of kind 'toaster'; kinds are: {kind}"),
        ),
        (format!("{plc}[[device]]\nname = 'd'\n"), "test.toml: line 3: there is no device of kind ''"),
        (
            format!("{plc}{bus}kind = 'string'\n"),
            &format!("line 5: there is no bus of kind 'string'; kinds are: {}", BUS_KINDS[0].name),
        ),
        (
            format!("{plc}[[device]]\nkind = '{kind}'\nname = 'd'\ncolour = 1\n"),
            "test.toml: line 6: unknown field `colour`; the keys of [[device]] are: kind, option, name, ",
        ),
        (format!("{plc}[[device]]\nkind = '{kind}'\nname = 'p'\n"), "there are two PLCs named 'p'"),
        (format!("bus = 1\n{plc}"), "test.toml: line 1: [[bus]]"),
        (
            format!("{plc}colour = 1\n"),
            "test.toml: line 3: unknown field `colour`; the keys of [[plc]] are: option, name, ",
        ),
        (
            format!("{plc}{bus}kbits = 500\n"),
            "unknown field `kbits`; did you mean kbit_s?; the keys of [[bus]] are: kind, name, ",
        ),
        (
            format!("{plc}dip = 300\n"),
            "line 3: dip: invalid value: integer `300`, expected a whole number from 0 to 255",
        ),
        (
            format!("{plc}dip = 'x'\n"),
            "line 3: dip: invalid type: string \"x\", expected a whole number from 0 to 255",
        ),
        (
            format!("colour = 1\n{plc}"),
            "line 1: unknown field `colour`; the keys here are: processor_cycle_us, plc, ",
        ),
    ];
    for (text, expected) in cases {
        let message = PlantConfig::parse("test.toml", &text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}\n{message}\nlacks: {expected}");
    }
}

/// Errors that only a check of the whole plant can detect are reported with the line of the later entry.
#[test]
fn each_mistake_is_reported_with_its_line() {
    let plc = "[[plc]]\nname = 'p'\n";
    let bus = "[[bus]]\nname = 'b'\n";
    let drives = "[[bus.drive]]\nslave_number = 4\nname = 'd'\n[[bus.drive]]\nname = 'e'\n";
    for (text, line) in [
        (format!("{plc}[[plc]]\nname = 'a b'\n"), 3),
        (format!("{plc}{plc}"), 3),
        (format!("{plc}{bus}{bus}"), 5),
        (
            format!(
                "{plc}{bus}[[bus.drive]]\nname = 'd'\nslave_number = 1\n[[bus.drive]]\nname = 'd'\nslave_number = 2\n"
            ),
            8,
        ),
        (format!("{bus}{plc}dip = 32\n"), 5),
        (format!("{plc}[plc.drive]\nsync_loss_us = 0\n"), 4),
        (format!("{plc}{bus}{drives}slave_number = 32\n"), 10),
        (format!("{plc}{bus}{drives}slave_number = 4\n"), 10),
        // A drive with the name of a PLC is not mistaken for the PLC.
        (format!("{plc}{bus}[[bus.drive]]\nname = 'p'\nslave_number = 1\nlock_time_us = 3_600_000_001\n"), 8),
        (format!("{plc}node2 = 'x'\n{bus}"), 3),
        (format!("{bus}{plc}node2 = 'b'\n[[plc]]\nname = 'q'\nnode2 = 'b'\n"), 8),
        (format!("{plc}node1 = 'b'\n[[plc]]\nname = 'q'\nnode1 = 'b'\ndip = 0\n{bus}"), 7),
        (format!("{plc}node1 = 'b'\n[[plc]]\nname = 'q'\nnode1 = 'b'\n{bus}"), 6),
        (format!("{plc}{bus}kbit_s = 800\n"), 5),
        (format!("{plc}node2 = 'b'\n{bus}kind = 'can'\nkbit_s = 500\n"), 3),
        // Checks that only the drives themselves can make.
        (format!("{plc}{bus}kbit_s = 1000\n[[bus.drive]]\nname = 'd'\nslave_number = 1\n"), 6),
        (
            format!(
                "{plc}{bus}[[bus.drive]]\nname = 'd'\nslave_number = 1\nzk = {{ zk_0 = 120, zk_4 = 65 }}\n"
            ),
            8,
        ),
        (format!("{bus}{plc}drive = {{ parameters = [{{ number = 5000, format = 'word' }}] }}\n"), 5),
        (format!("{plc}{bus}doors = ['profibus-tcp:127.0.0.1:0']\n"), 5),
        (format!("{plc}[[fault]]\nkind = 'lose_frames'\n"), 3),
        (format!("\nprocessor_cycle_us = 5\n{plc}"), 2),
    ] {
        let message = PlantConfig::parse("test.toml", &text).unwrap_err().to_string();
        assert!(message.starts_with(&format!("test.toml: line {line}: ")), "{text}\n{message}");
    }
}

/// Decision D-541: plants with deliberate faults stay possible, and a warning prevents accidental faults.
#[test]
fn rates_at_which_drives_hear_nothing_are_doubted() {
    let plant = |bus: &str, drive: &str| {
        let text = format!(
            "[[plc]]\nname = 'a'\nnode2 = 'b'\n[[bus]]\nname = 'b'\n{bus}\n\
             [[bus.drive]]\nname = 'd'\nslave_number = 1\ncard_function = 0\n{drive}\n"
        );
        let doubts = PlantConfig::parse("p.toml", &text).unwrap().doubts(&text);
        doubts.into_iter().map(|(line, doubt)| (line, doubt.text)).collect::<Vec<_>>()
    };
    assert_eq!(plant("", ""), []);
    assert_eq!(plant("kbit_s = 250", "kbit_s = 250"), []);
    let others = "drive 'd' is set to 250 kbit/s and will hear nothing: its bus 'b' is at 500 kbit/s, and a bus has one \
                  rate, that of its master";
    assert_eq!(plant("", "kbit_s = 250"), [(Some(11), others.to_owned())]);
    let too_fast = "drives on bus 'b' are set to 1000 kbit/s and will hear nothing: the master of bus 'b', a:node2, runs \
                    at 500, 250, 125 kbit/s only";
    assert_eq!(plant("kbit_s = 1000", ""), [(Some(6), too_fast.to_owned())]);
    let one = plant("", "kbit_s = 1000");
    assert!(
        one[0].1.starts_with("drive 'd' is set to 1000 kbit/s and will hear nothing: the master"),
        "{one:?}"
    );
}

/// A number over the text of the settings is in snapshots, and another build of this version must compute the same
/// number. So a key that the plant file leaves out must not be in the text.
#[test]
fn settings_of_a_folder_are_its_files_and_the_given_keys_alone() {
    let folder = tempfile::tempdir().unwrap();
    devices::samples::copy_folder("encoder", folder.path());
    let settings = |keys: &str| {
        let kind = folder.path().display();
        let plant = format!("[[plc]]\nname = \"b\"\n[[{keys} = \"{kind}\"\nname = \"a\"\n");
        let config = PlantConfig::parse("plant", &plant).unwrap();
        format!("{:?}", config.devices.iter().find(|device| device.name() == "a").unwrap())
    };
    let alone = settings("device]]\nkind");
    let files = alone.strip_prefix("encoder { name: \"a\", files: ").and_then(|rest| rest.strip_suffix(" }"));
    let files: u64 = files.unwrap_or_else(|| panic!("{alone}")).parse().unwrap();
    let card = settings("plc.option]]\nslot = 2\ncard");
    assert_eq!(card, format!("encoder {{ name: \"a\", files: {files}, option: (\"b\", 2, 1) }}"));
}
