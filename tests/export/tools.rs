//! Exports checked with external tools.

use crate::common::{Outcome, devices, finish, python, run};
use std::path::Path;
use svd_parser::svd::{Device, Peripheral, RegisterInfo};

fn peripheral<'a>(device: &'a Device, name: &str) -> &'a Peripheral {
    device.peripherals.iter().find(|known| known.name == name).unwrap()
}

fn expanded(device: &str) -> Device {
    let export = run(&["export", "svd", "--device", device]);
    let config = svd_parser::Config::default().validate_level(svd_parser::ValidateLevel::Strict);
    let device = svd_parser::parse_with_config(export.ok(), &config).unwrap();
    svd_parser::expand(&device).unwrap()
}

#[test]
fn svd_is_valid_and_says_where_the_cpu_finds_a_register() {
    let device = expanded("omega-drive-line-2");
    let node = peripheral(&device, "CANsync_CTRL_MA");
    assert_eq!(node.base_address, 0xB414_A000);
    let find = |name: &str| -> &RegisterInfo {
        node.all_registers().find(|known| known.name == name).unwrap_or_else(|| panic!("{name}"))
    };
    let status = find("w_OPTION_STATUS");
    assert_eq!((status.address_offset, status.properties.size), (2, Some(16)));
    let values = &status.fields.as_ref().unwrap()[0].enumerated_values[0].values;
    assert!(values.iter().any(|value| value.name == "WAITING_FOR_START" && value.value == Some(3)));
    assert_eq!(find("a_RD_BMARRAY_1_0").address_offset, 832 + 64);
    assert_eq!(find("a_CONTROLWORD_SL3").address_offset, 2948 + 6);
    assert_eq!(peripheral(&device, "CANsync_INIT_MA").registers().count(), 15 + 31);
    // The CPU addresses of the b maXX PLC are unknown, so the SVD has the offset in the image.
    let device = expanded("bm4-plc");
    assert_eq!(peripheral(&device, "CANsyncSlave_Ctrl_Slot_M").base_address, 7_001_792);
}

/// Exports `format` to a file, then runs a script of `tests/python` with the file's path.
fn check(format: &[&str], file: &str, script: &[&str], packages: &[&str]) -> Option<Outcome> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join(file);
    run(&[&["export"], format, &["--output", path.to_str().unwrap()]].concat()).ok();
    let mut command = python(packages)?;
    let (script, arguments) = script.split_first().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script);
    Some(finish(command.arg(script).arg(path).args(arguments)))
}

#[test]
fn svd_is_valid_by_the_schemas_of_its_makers() {
    for device in devices() {
        let export = ["svd", "--device", device];
        if let Some(outcome) = check(&export, "registers.svd", &["check_xml.py"], &["xmlschema"]) {
            assert!(outcome.ok().starts_with("valid by "), "{device}: {}", outcome.err);
        }
    }
}

#[test]
fn systemrdl_compiles_and_elaborates() {
    let (omega, bm4) = ("omega-drive-line-2", "bm4-plc");
    for (device, maps, register, address) in [
        (omega, &["init", "cyclic"][..], "_CANsync_CTRL_MA.a_RD_BMARRAY[1][0]", 200_896),
        // For devices with modules, each role has separate maps: instances must not overlap.
        (
            bm4,
            &["init_master", "init_slave", "cyclic_slave", "cyclic_master"],
            "_CANsyncMaster_Ctrl_Slot_G.a_RD_BMARRAY[1][0]",
            2_002_688,
        ),
    ] {
        let maps: Vec<_> = maps.iter().map(|map| format!("{}_{map}", device.replace('-', "_"))).collect();
        let mut script = vec!["check_rdl.py"];
        script.extend(maps.iter().map(String::as_str));
        script.push(register);
        let export = ["systemrdl", "--device", device];
        if let Some(outcome) = check(&export, "registers.rdl", &script, &["systemrdl"]) {
            assert!(outcome.ok().ends_with(&format!("{register} {address}\n")), "{}", outcome.out);
        }
    }
}

#[test]
fn declarations_are_structured_text() {
    // The parser takes a minute for the elementary variables of all areas.
    for format in
        [&["st"][..], &["st", "--elementary", "--block", "ethernet_config"], &["st", "--device", "bm4-plc"]]
    {
        if let Some(outcome) = check(format, "registers.st", &["check_st.py"], &["blark"]) {
            assert!(outcome.ok().starts_with("parsed "), "{}", outcome.out);
        }
    }
}

#[test]
fn readers_of_electronic_data_sheets_accept_all_of_ours() {
    let packages = &["canopen", "dcf", "dcfgen", "eds_utils"];
    for (device, node, expected) in [
        ("cs0015", "5", "canopen 68 64\nlely 8 8\neds-utils 68\n"),
        ("cr201x", "3", "canopen 22 10\nlely 2 2\neds-utils 22\n"),
    ] {
        let export = ["eds", "--device", device];
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("device.eds");
        run(&[&["export"], &export[..], &["--output", path.to_str().unwrap()]].concat()).ok();
        let Some(mut command) = python(packages) else { return };
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_eds.py");
        assert_eq!(finish(command.arg(script).arg(&path).arg(node)).ok(), expected, "{device}");
    }
}

/// A plant in which the panel `door-1` receives a PDO of the panel `panel`, and the panel `dark` has no program.
const PANELS: &str = "
[[device]]
kind = 'cs0015'
name = 'panel'
bus = 'open'
pdo_tx = [{ pdo = 2, id = 0x3A5 }]
[[device]]
kind = 'cs0015'
name = 'door-1'
bus = 'open'
node_id = 5
pdo_rx = [{ pdo = 4, id = 0x3A5 }]
[[device]]
kind = 'cs0015'
name = 'dark'
bus = 'open'
node_id = 6
program = 'none'
[[bus]]
name = 'open'
kind = 'can'
kbit_s = 125
[[bus]]
name = 'shut'
kind = 'can'
kbit_s = 125
";

#[test]
fn cantools_reads_the_messages_of_a_bus() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (plant, database) = (path("plant.toml"), path("open.dbc"));
    std::fs::write(&plant, PANELS).unwrap();
    let dbc = |args: &[&str]| run(&[&["export", "dbc"], args].concat());
    dbc(&["--plant", &plant, "--bus", "open", "--output", &database]).ok();
    for (args, why) in [
        (&[][..], "give the plant that contains the buses, --plant plant.toml; `commram new DIR`"),
        (&["--plant", &plant], "give one of its buses, --bus: open, shut"),
        (&["--plant", &plant, "--bus", "door"], "its buses are: open, shut"),
        (&["--plant", &plant, "--bus", "shut"], "no device on this bus knows its messages"),
        (&["--plant", &plant, "--elementary"], "a CAN database has no registers"),
    ] {
        assert!(dbc(args).fails(2).contains(why), "{args:?}");
    }
    assert!(
        run(&["export", "c", "--bus", "open"]).fails(2).contains("only `dbc` and `wireshark` export buses")
    );
    let Some(mut command) = python(&["cantools"]) else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_dbc.py");
    let outcome = finish(command.arg(script).arg(&database));
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
    let words = "word_1@0:16 word_2@16:16 word_3@32:16 word_4@48:16";
    for line in [
        "nodes door_1 panel".to_owned(),
        "0A0 panel_EMCY 8 panel> error_code@0:16 error_register@16:8 own@24:40".to_owned(),
        format!("1A0 panel_TX_PDO1 8 panel> {words}"),
        // Manual p. 160: the identifiers of PDOs from the third one on do not depend on the Node-ID, so two devices
        // send this identifier.
        format!("38A panel_TX_PDO3 8 panel,door_1> {words}"),
        format!("3A5 panel_TX_PDO2 8 panel>door_1 {words}"),
        "585 door_1_SDO_ANSWER 8 door_1> command@0:8 index@8:16 sub_index@24:8 data@32:32".to_owned(),
        "705 door_1_STATE 1 door_1> state@0:7 toggle@7:1".to_owned(),
        "comment %MW2033".to_owned(),
        "decoded 1 4660 0 32768".to_owned(),
    ] {
        assert!(outcome.out.lines().any(|it| it == line), "{line}\n{}", outcome.out);
    }
}

/// tools/fmi/tests packs and runs units.
#[test]
fn a_unit_needs_its_shared_object_and_an_output_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("other.so"), b"\x7FELF of another program").unwrap();
    std::fs::write(path("plant.toml"), "[[plc]]\n").unwrap();
    std::fs::File::create(path("long.so")).unwrap().set_len(1 << 40).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(path("pipe.so")).status().unwrap().success());
    let (unit, other) = (path("plant.fmu"), path("other.so"));
    for (args, why) in [
        (&["--library", &other][..], "give the file, --output plant.fmu"),
        (&["--output", &unit, "--library", &other], "it is not the libcommram_fmi.so of this commram"),
        (&["--output", &unit, "--library", &path("none.so")], "No such file"),
        (&["--output", &unit, "--library", "/dev/zero"], "it is no regular file"),
        (&["--output", &unit, "--library", &path("long.so")], "it has more than 536870912 bytes"),
        (&["--output", &unit, "--library", &path("pipe.so")], "it is no regular file"),
        (&["--output", &unit, &path("plant.toml")], "missing field `name`"),
        (&["--output", &unit, "--block", "node2"], "write the plant file after it"),
    ] {
        let outcome = run(&[&["export", "fmu"], args].concat());
        assert!(outcome.fails(2).contains(why), "{args:?}: {}", outcome.err);
    }
    assert!(run(&["export", "c", "plant.toml"]).fails(2).contains("only `fmu` exports a whole plant"));
    assert!(!Path::new(&unit).exists());
}

/// `cargo install` installs no shared object: it is found in the checkout, which cargo's list of programs names.
#[test]
fn an_installed_program_finds_the_shared_object_of_its_checkout() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::create_dir_all(at("root/bin")).unwrap();
    let program = at("root/bin/commram");
    std::fs::copy(env!("CARGO_BIN_EXE_commram"), &program).unwrap();
    let list = format!(
        "[v1]\n\"commram {} (path+file://{})\" = [\"commram\"]\n",
        env!("CARGO_PKG_VERSION"),
        at("checkout").display()
    );
    std::fs::write(at("root/.crates.toml"), list).unwrap();
    let export = || {
        let mut command = std::process::Command::new(&program);
        command.args(["export", "fmu", "--registers", "node2.w_*", "--output"]).arg(at("plant.fmu"));
        finish(command.env("COMMRAM_CONFIG", ""))
    };
    let missing = export();
    let command = format!("`cargo build --release -p commram-fmi` in {}", at("checkout").display());
    assert!(missing.fails(2).contains(&command), "{}", missing.err);
    std::fs::create_dir_all(at("checkout/target/release")).unwrap();
    let library = [b"\x7FELF", commram::fmi::MARK.as_bytes()].concat();
    std::fs::write(at("checkout/target/release/libcommram_fmi.so"), library).unwrap();
    export().ok();
    assert!(std::fs::metadata(at("plant.fmu")).unwrap().len() > 1000);
}

/// The suite in `tests/python`; each of its tests has a separate emulator.
#[test]
fn the_python_suite_passes() {
    let directory = tempfile::tempdir().unwrap();
    run(&["export", "python", "--output", directory.path().join("commram.py").to_str().unwrap()]).ok();
    let Some(mut command) = python(&["pytest"]) else { return };
    let suite = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python");
    command.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).arg(suite);
    command.env("PYTHONPATH", directory.path()).env("PYTHONDONTWRITEBYTECODE", "1");
    command.env("COMMRAM", env!("CARGO_BIN_EXE_commram")).env_remove("COMMRAM_INSTANCE");
    let outcome = finish(&mut command);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
}

/// An external parser reads the values from the device description file that the slave accepts.
#[test]
fn gsd_parser_reads_the_description_of_a_slave() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("CDPS04A4.GSD");
    run(&["export", "gsd", "--device", "can-dp2", "--output", path.to_str().unwrap()]).ok();
    let gsd = gsd_parser::parse_from_file(&path);
    assert_eq!((gsd.gsd_revision, gsd.ident_number), (1, 0x04A4));
    assert_eq!((&*gsd.vendor, &*gsd.model, gsd.max_modules), ("esd", "CAN-DP/2", 48));
    assert_eq!((gsd.max_input_length, gsd.max_output_length, gsd.max_data_length), (244, 244, 300));
    assert_eq!(gsd.supported_speeds, gsd_parser::SupportedSpeeds::all());
    assert_eq!((gsd.max_tsdr.b9600, gsd.max_tsdr.b1500000, gsd.max_tsdr.b12000000), (60, 150, 800));

    let mut parameters = gsd_parser::PrmBuilder::new(&gsd.user_prm_data);
    assert_eq!(parameters.as_bytes(), [0, 6, 0, 1, 0, 0, 0xFF, 0xFF, 0xFF], "p. 24");
    parameters
        .set_prm_from_text("CAN-Bitrate", "500 kbit/s")
        .set_prm_from_text("Communication Window", "Yes")
        .set_prm_from_text("RTR-Frames", "No")
        .set_prm_from_text("CANopen-Slave", "Yes")
        .set_prm_from_text("CAN-Diagnosis", "Yes")
        .set_prm_from_text("Tx-Counter", "Yes")
        .set_prm("ModuleID", 127)
        .set_prm("WakeUp Time (0=Off, 255=Default)", 5)
        .set_prm("Sync Time (0=Off, 65535=Default)", 1000);
    assert_eq!(parameters.as_bytes(), [0, 2, 0x98, 127, 5, 0, 5, 0x03, 0xE8]);

    let [texts] = &gsd.unit_diag.areas[..] else { panic!("{:?}", gsd.unit_diag) };
    assert_eq!((texts.first, texts.last), (8, 15));
    assert_eq!((&*texts.values[&0x3D], texts.values.len()), ("Set_Prm is wrong", 6));
    let window = gsd.available_modules.iter().find(|it| it.name == "Communication Window, read").unwrap();
    assert_eq!(window.config, [0x43, 0x8F, 0xFF, 0xEF, 0x00]);
}

#[test]
fn pyprofibus_reads_the_description_of_a_slave() {
    let gsd = ["gsd", "--device", "can-dp2"];
    let Some(outcome) = check(&gsd, "CDPS04A4.GSD", &["check_gsd.py"], &["pyprofibus"]) else { return };
    assert_eq!(
        outcome.ok(),
        "Vendor_Name=esd\nModel_Name=CAN-DP/2\nMax_Module=48\nMax_Data_Len=300\nMaxTsdr_12M=800\n12M_supp=True\n\
         ident 04A4, modular True\nparameters 00 06 00 00 00 00 FF FF FF\nmodule 43 8F FF EF 00\nmodule 83 05 02 03 00\n"
    );
}
