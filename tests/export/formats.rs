//! `commram export`: common properties of all formats, and the formats for data and documents.

use crate::common::{devices, run};
use serde_json::Value;

/// All devices of commram, in the order of the lists below.
const DEVICES: [&str; 5] = ["omega-drive-line-2", "bm4-plc", "cs0015", "cr201x", "can-dp2"];
const FORMATS: [&str; 10] =
    ["c", "matiec", "openplc", "st", "python", "svd", "systemrdl", "json", "csv", "md"];

#[test]
fn the_register_references_are_up_to_date() {
    let pages = [
        include_str!("../../docs/devices/omega-drive-line-2/registers.md"),
        include_str!("../../docs/devices/bm4-plc/registers.md"),
        include_str!("../../docs/devices/cs0015/registers.md"),
        include_str!("../../docs/devices/cs0015/registers-cr201x.md"),
        include_str!("../../docs/devices/can-dp2/registers.md"),
    ];
    assert!(
        devices().eq(DEVICES),
        "add {:?} to DEVICES of tests/export/formats.rs, its page and one of its names to the lists there, as \
         docs/internals/architecture.md, section \"A device\", says",
        devices().filter(|device| !DEVICES.contains(device)).collect::<Vec<_>>()
    );
    for (device, page) in DEVICES.into_iter().zip(pages) {
        let export = run(&["export", "md", "--device", device]);
        assert!(export.ok() == page, "the page of {device} is old; renew it: just registers");
    }
}

/// Every export names its device, its command and the source of its names.
#[test]
fn every_device_is_exported_in_every_format() {
    for device in DEVICES {
        for format in FORMATS {
            let export = run(&["export", format, "--device", device]);
            // For each device, the list has a name that no other device has.
            let names = match format {
                "svd" => [
                    "CANsync_INIT_MA",
                    "CANsyncMaster_Init_Slot_G",
                    "COP_GUARDFAIL_NODEID",
                    "b_PWM_FRQ",
                    "stored_wakeup_time",
                ],
                _ => [
                    "CANsync_INIT_BMSTRUCT",
                    "CANsync_PLC_INIT_BMSTRUCT",
                    "COP_GUARDFAIL_NODEID",
                    "b_PWM_FRQ",
                    "stored_wakeup_time",
                ],
            };
            let has_names = names.map(|name| export.ok().contains(name));
            assert_eq!(has_names, DEVICES.map(|it| it == device), "{device} as {format}");
            // An XML comment cannot contain two consecutive hyphens.
            if !["json", "csv", "svd"].contains(&format) {
                let command = format!("commram export {format} --device {device}");
                assert!(export.out.contains(&command), "{device} as {format}");
            }
        }
    }
}

/// The notes about gaps in the Omega Drive-Line II's manual do not appear for another device.
#[test]
fn the_head_of_an_export_describes_only_its_device() {
    for format in ["c", "matiec", "openplc", "st", "python", "svd", "systemrdl"] {
        let export = run(&["export", format, "--device", "bm4-plc"]);
        assert!(export.ok().contains("nor how long a slot's area is"), "{format}");
        assert!(export.out.contains("are ours (D-297)"), "{format}");
        assert!(!export.out.contains("BAPS") && !export.out.contains("D-220"), "{format}");
    }
}

/// 5.00005.03a p. 77, 213, 249. matiec accepts each spelling of an address once, and no arrays of arrays.
#[test]
fn matiec_has_separate_declarations() {
    let whole = run(&["export", "st", "--matiec"]);
    for line in [
        "    CANsync_RD_BMARRAY : ARRAY[0..31, 0..15] OF DINT;\n",
        "    _CANsync_INIT_MA AT %MB3.200000 : CANsync_INIT_BMSTRUCT;\n",
        "    _CANsync_CTRL_MA AT %MB3.200000.0 : CANsync_MA_CTRL_BMSTRUCT;\n",
    ] {
        assert!(whole.ok().contains(line), "{line}");
    }
    assert!(whole.out.ends_with("END_RESOURCE\nEND_CONFIGURATION\n"));
    let elementary = run(&["export", "st", "--elementary", "--block", "node2"]);
    assert!(elementary.ok().contains("    node2_b_CTRLREG_WRC1 AT %MB3.200012.0 : BYTE;"));
    for (args, why) in [
        (["c", "--matiec"], "only `st` has a form for matiec"),
        (["c", "--strucpp"], "only `st` has a form for STruC++"),
        (["st", "--main"], "only `matiec`, `strucpp` and `openplc` have a program around the compiled one"),
    ] {
        assert!(run(&["export", args[0], args[1]]).fails(2).contains(why), "{args:?}");
    }
}

#[test]
fn iec_declarations_are_those_of_the_manual() {
    let export = run(&["export", "st"]);
    let text = export.ok();
    for line in [
        "    _CANsync_CTRL_MA AT %MB3.200000 : CANsync_MA_CTRL_BMSTRUCT;",
        "    _Ethernet_config AT %MB3.180016 : ETHERNET_CONFIG_BMSTRUCT;",
        "    USINT_4_BMARRAY : ARRAY[0..3] OF USINT;",
        "    BYTE_32_BMARRAY : ARRAY[0..31] OF BYTE;",
        "    DINT_16_BMARRAY : ARRAY[0..15] OF DINT;",
        "    CANsync_RD_BMARRAY : ARRAY[0..31] OF DINT_16_BMARRAY;",
        "    DATA_PARAMETER_32_BMARRAY : ARRAY[0..31] OF DATA_PARAMETER;",
        "        padding_829 : BYTE_3_BMARRAY;",
    ] {
        assert!(text.contains(&format!("{line}\n")), "{line}");
    }
    let place = |name: &str| text.find(&format!("    {name} :")).unwrap();
    assert!(place("DINT_16_BMARRAY") < place("CANsync_RD_BMARRAY"));
    assert!(place("DATA_PARAMETER") < place("DATA_PARAMETER_32_BMARRAY"));
    assert!(place("DATA_PARAMETER_32_BMARRAY") < place("CANsync_MA_CTRL_BMSTRUCT"));
}

#[test]
fn the_csv_has_every_register_that_the_map_knows() {
    let export = run(&["export", "csv"]);
    let mut lines = export.ok().lines();
    assert!(lines.next().unwrap().starts_with("name,address,cpu_address,type,owner,reset,"));
    let rows: Vec<_> = lines.collect();
    assert!(rows.len() > 3000);
    for name in ["node2.a_RD_BMARRAY[31][15]", "node1.b_STEUREG_PAR_CMD", "ethernet_config.d_ROUTER"] {
        assert_eq!(rows.iter().filter(|row| row.starts_with(&format!("{name},"))).count(), 1, "{name}");
    }
    let status = rows.iter().find(|row| row.starts_with("node2.w_OPTION_STATUS,")).unwrap();
    assert!(status.contains(",%MW3.200002,16#B414A002,WORD,firmware,16#0001,false,"), "{status}");
    assert!(
        status.contains(",\"149-150, 174-175\",\"area D-220, offset D-02, live D-03\",option_status,"),
        "{status}"
    );
}

/// The keys that `docs/reference/export.md` promises, with their values for known registers.
#[test]
fn the_json_keeps_its_schema() {
    let export = run(&["export", "json"]);
    let document: Value = serde_json::from_str(export.ok()).unwrap();
    assert_eq!(document["schema"], "commram.registers");
    assert_eq!(document["schema_version"], 2);
    assert_eq!(document["segment_size"], 3_342_144);
    assert_eq!(document["layout_hash"].as_str().unwrap().len(), 16);
    let find = |list: &Value, name: &str| -> Value {
        list.as_array().unwrap().iter().find(|one| one["name"] == name).unwrap().clone()
    };
    let area = find(&document["areas"], "node2");
    assert_eq!((area["first"].clone(), area["bytes"].clone()), (200_000.into(), 32_768.into()));
    assert_eq!(area["structures"][1]["structure"], "CANsync_MA_CTRL_BMSTRUCT");
    assert_eq!(area["structures"][1]["live"], "cyclic");
    assert_eq!(area["provenance"], "inferred D-220");
    assert_eq!(area["structures"][1]["variable"], "_CANsync_CTRL_MA");
    assert_eq!(area["structures"][1]["variable_provenance"], "manual");
    let baps = find(&document["areas"], "baps");
    assert_eq!(baps["structures"][0]["variable_provenance"], "inferred D-220");
    let structure = find(&document["structures"], "CANsync_MA_CTRL_BMSTRUCT");
    let register = find(&structure["registers"], "a_RD_BMARRAY");
    assert_eq!((register["offset"].clone(), register["type"].clone()), (832.into(), "DINT".into()));
    assert_eq!(register["dims"][1], serde_json::json!({ "count": 16, "used": 8, "stride": 4 }));
    let status = find(&structure["registers"], "w_OPTION_STATUS");
    let values = &document["meanings"][status["meaning"].as_str().unwrap()]["values"];
    assert!(values.as_array().unwrap().iter().any(|value| value["first"] == 0x43), "{values}");
    let page = find(&document["header"]["structures"], "Header");
    assert_eq!(find(&page["fields"], "events")["type"], "EventSlot");
    assert_eq!(find(&page["fields"], "answer")["offset"], 192);
}

/// Documented and inferred addresses, names and meanings look alike in an export. Inferred facts must be marked in the
/// head of the file, at their structure, and at each of them.
#[test]
fn exports_mark_inferred_names_and_offsets() {
    for format in ["c", "matiec", "openplc", "st", "python", "svd", "systemrdl"] {
        let export = run(&["export", format]);
        let text = export.ok();
        assert!(text.contains("Each fact that it does not state names the decision (D-nn)"), "{format}");
        assert!(
            text.contains("Names of areas, and of variables for which it has none, are ours (D-220)"),
            "{format}"
        );
        for structure in [
            "p. 60, 83-120). Inferred, not in the manual: name D-150, offset D-150,",
            "p. 147-150, 173-175). Inferred, not in the manual: offset D-02, reset D-320 D-35.",
            "p. 151-169). Inferred, not in the manual: offset D-02,",
            "p. 176-193). Inferred, not in the manual: offset D-02,",
            "p. 61). Inferred, not in the manual: name D-192,",
        ] {
            assert!(text.contains(structure), "{format}: {structure}");
        }
        // Registers of several kinds: a scalar, an array, a register of a sub-structure, a reserved register, and a
        // register that no manual has.
        for register in [
            "offset D-02, owner D-321, reset D-320",
            "offset D-02, type D-90, reset D-320",
            "offset D-02, owner D-91, reset D-320",
            "name D-150, offset D-150, type D-150, owner D-150, reset D-320",
        ] {
            assert!(text.contains(register), "{format}: {register}");
        }
        if format != "st" {
            assert!(text.contains("SYNC mode (D-06)"), "{format}");
        }
        if format == "python" {
            // The decoder has the decisions as well.
            assert!(text.contains("\"SYNC mode\", \"D-06\""));
        }
        if format != "python" {
            assert!(text.contains("Name of the type: inferred, D-326."), "{format}");
        }
    }
    // Names of structures, of members that are sub-structures, and phases.
    for format in ["c", "matiec", "openplc", "st", "python", "svd", "systemrdl", "md"] {
        let export = run(&["export", format, "--device", "cs0015"]);
        assert!(export.ok().contains("Name of the type: inferred, D-400."), "{format}");
        let export = run(&["export", format]);
        assert!(export.ok().contains("overlaid structures are valid are inferred (D-03)."), "{format}");
    }
    let lines = run(&["export", "csv", "--device", "cs0015"]);
    let line = lines.ok().lines().find(|line| line.starts_with("flags.ERROR,")).unwrap();
    assert!(
        line.contains("\"area D-400, offset D-400,") && line.contains(", structure D-400, variable D-400\""),
        "{line}"
    );
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/netx-dpm");
    let map = run(&["map", "sys.atCom[0].bChannelType", "--device", folder]);
    assert!(map.ok().contains("  name from        inferred D-01\n"), "{}", map.ok());
    let variables = run(&["export", "st"]);
    assert!(
        variables.ok().contains("_baps AT %MB3.80000 : BAPS_CTRL_BMSTRUCT; (* name inferred, D-220 *)\n")
    );
    assert!(variables.out.contains("_CANsync_CTRL_MA AT %MB3.200000 : CANsync_MA_CTRL_BMSTRUCT;\n"));
    let csv = run(&["export", "csv"]);
    let from =
        |name: &str| csv.out.lines().find(|line| line.starts_with(name)).unwrap().contains("variable D-220");
    assert!(!csv.ok().is_empty() && from("baps.b_COMMAND,") && !from("node2.w_CPU_CONTROL,"));
    let elementary = run(&["export", "st", "--elementary", "--block", "node1"]);
    assert!(elementary.ok().contains("(p. 188; inferred: offset D-02, owner D-321, reset D-320) *)"));
}

#[test]
fn a_block_limits_the_export() {
    let whole = run(&["export", "csv"]);
    let block = run(&["export", "csv", "--block", "ethernet_config"]);
    assert_eq!(block.ok().lines().count(), 11);
    assert!(whole.ok().contains(block.out.lines().nth(1).unwrap()));
    let header = run(&["export", "c", "--block", "node1"]);
    assert!(header.ok().contains("CANsync_SL_CTRL_BMSTRUCT") && !header.out.contains("MA_CTRL"));
    assert!(header.out.contains("`commram export c --device omega-drive-line-2 --block node1`"));
}

#[test]
fn the_output_goes_to_the_given_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("registers.md");
    let path = path.to_str().unwrap();
    assert_eq!(run(&["export", "md", "--output", path]).ok(), "");
    assert_eq!(std::fs::read_to_string(path).unwrap(), run(&["export", "md"]).ok());
    let nowhere = run(&["export", "md", "--output", "/nowhere/registers.md"]);
    assert!(nowhere.fails(3).starts_with("commram: cannot write /nowhere/registers.md: "), "{}", nowhere.err);
}

#[test]
fn wrong_use_is_explained() {
    let block = run(&["export", "c", "--block", "node3"]);
    assert!(block.fails(2).contains("unknown area `node3`; the areas are baps, node1"), "{}", block.err);
    assert!(run(&["export", "c", "--elementary"]).fails(2).contains("only `st` has elementary variables"));
    assert!(run(&["export", "cobol"]).fails(2).contains("possible values: c, "));
    assert!(run(&["export"]).fails(2).contains("<FORMAT>"));
}

/// `tools.rs` and `tests/cli/cs0015.rs` test the programs that read the data sheet.
#[test]
fn a_data_sheet_contains_the_devices_object_dictionary() {
    let export = run(&["export", "eds", "--device", "cs0015"]);
    for section in [
        "=1800h sub 1: CAN identifier of transmit PDO 1, bit 31 is 0: valid (p. 160)\n",
        "\n[1800sub1]\nParameterName=COB ID\nObjectType=0x7\n\
         DataType=0x0007\nAccessType=rw\nDefaultValue=$NODEID+0x180\nPDOMapping=0\n",
        "NrOfRXPDO=8\nNrOfTXPDO=8\n",
        "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n",
        "=1600h sub 0: Number of objects mapped, receive PDO 1 (p. 158), the device answers with 4 octets, 16#4 (D-770)\n",
        "\n[1600sub0]\nParameterName=Highest sub-index\n",
        "[20F1]\nParameterName=Einstellung Node ID (20F1h)\n",
        "(p. 156, inferred: default D-406)",
    ] {
        assert!(export.ok().contains(section), "{section}");
    }
    assert!(!export.out.contains("[1007]"), "it is not implemented");
    let none = run(&["export", "eds", "--device", "bm4-plc"]);
    assert!(
        none.fails(2).contains("b maXX PLC with BM4-O-CAN-06/05 has no object dictionary"),
        "{}",
        none.err
    );
}

/// `tools.rs` tests the programs that read the description file.
#[test]
fn only_a_slave_has_a_device_description_file() {
    let export = run(&["export", "gsd", "--device", "can-dp2"]);
    for part in [
        "\n#Profibus_DP\nGSD_Revision=1\n",
        "31.25_supp=1 ; inferred: D-466\n",
        "Max_User_Prm_Data_Len=9\n",
        "Ext_User_Prm_Data_Const(0)=0x00,0x06,0x00,0x00,0x00,0x00,0xFF,0xFF,0xFF\nExt_User_Prm_Data_Ref(1)=1\n",
        "; p. 73\nModule=\"Output, 6 bytes, 16#203\" 0x83,0x05,0x02,0x03,0x00\nEndModule\n",
    ] {
        assert!(export.ok().contains(part), "{part}\n{}", export.out);
    }
    let none = run(&["export", "gsd", "--device", "cs0015"]);
    assert!(
        none.fails(2).contains("CS0015 is no PROFIBUS-DP slave: it has no device description file"),
        "{}",
        none.err
    );
}
