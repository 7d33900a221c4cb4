//! `commram layout import` of files as engineering tools export them: objects of TwinCAT, PLCopen XML, exports of CODESYS, and
//! projects with programs.

use crate::common::{commram, finish};
use std::fs;
use std::path::{Path, PathBuf};

const LAYOUTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/layouts");

/// The structure of the diagnosis registers, in another order than the layout: the import moves their offsets.
const MEMBERS: [(&str, &str); 5] = [
    ("a_IP_ADDRESS", "IP_BMARRAY"),
    ("a_IP_MASK", "IP_BMARRAY"),
    ("d_IP_CONFIG", "DWORD"),
    ("w_STATUS", "WORD"),
    ("w_SPEED", "WORD"),
];

/// Runs `layout import --format json` on files in a checkout with the layouts, and returns the offset of `w_SPEED`, the
/// provenance of the structure, and the standard error output.
#[track_caller]
fn imported(files: &[(&str, Vec<u8>)]) -> (u64, String, String) {
    let checkout = tempfile::tempdir().unwrap();
    copy(Path::new(LAYOUTS), &checkout.path().join("layouts"));
    for (name, content) in files {
        fs::write(checkout.path().join(name), content).unwrap();
    }
    let names = files.iter().map(|(name, _)| name);
    let mut command = commram();
    command.args(["layout", "import", "--format", "json"]).args(names).current_dir(checkout.path());
    let outcome = finish(&mut command);
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&outcome.out).unwrap();
    let row = rows.iter().find(|row| row["member"] == "w_SPEED").unwrap();
    let path = checkout.path().join("layouts/omega-drive-line-2/ETHERNET_DIAGNOSE_BMSTRUCT.toml");
    let text = fs::read_to_string(path).unwrap();
    let provenance = text.lines().find(|line| line.starts_with("offsets = ")).unwrap().to_owned();
    (row["after"].as_u64().unwrap(), provenance, outcome.err)
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path: PathBuf = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, target).unwrap();
        }
    }
}

/// Returns the members as text, with `w_DIP_NR` at the end.
fn members() -> String {
    let members = MEMBERS.iter().map(|(name, ty)| format!("    {name} : {ty};\r\n"));
    members.collect::<String>() + "    w_DIP_NR : WORD;\r\n"
}

fn object(kind: &str, name: &str, declaration: &str) -> Vec<u8> {
    format!(
        "\u{FEFF}<?xml version=\"1.0\" encoding=\"utf-8\"?>\r\n<TcPlcObject Version=\"1.1.0.1\">\r\n  <{kind} Name=\"{name}\" \
         Id=\"{{00000000-0000-0000-0000-000000000001}}\">\r\n    <Declaration><![CDATA[{declaration}]]></Declaration>\r\n  \
         </{kind}>\r\n</TcPlcObject>\r\n"
    )
    .into_bytes()
}

#[test]
fn objects_of_twincat_are_imported_together() {
    let structure = format!(
        "{{attribute 'pack_mode' := '1'}}\r\n// The diagnosis\r\nTYPE ETHERNET_DIAGNOSE_BMSTRUCT :\r\nSTRUCT\r\n{}END_STRUCT\r\nEND_TYPE\r\n",
        members()
    );
    let files = [
        ("STRUCTURE.TcDUT", object("DUT", "ETHERNET_DIAGNOSE_BMSTRUCT", &structure)),
        (
            "ARRAY.TcDUT",
            object("DUT", "IP_BMARRAY", "TYPE IP_BMARRAY : ARRAY[1..GVL.OCTETS] OF BYTE; END_TYPE"),
        ),
        (
            "GVL.TcGVL",
            object(
                "GVL",
                "GVL",
                "{attribute 'qualified_only'}\r\nVAR_GLOBAL CONSTANT\r\n OCTETS : INT := 4;\r\nEND_VAR",
            ),
        ),
        ("FB_X.TcPOU", object("POU", "FB_X", "FUNCTION_BLOCK FB_X\r\nVAR a : BOOL; END_VAR")),
    ];
    let (offset, provenance, err) = imported(&files);
    assert_eq!(
        (offset, provenance.as_str()),
        (14, "offsets = \"manual: BM_TYPES, STRUCTURE.TcDUT\""),
        "{err}"
    );
    assert!(
        err.contains("note: FB_X.TcPOU: skipped, because only types are read: POU FB_X in line 3\n"),
        "{err}"
    );
    // If only one of the files is given, the error names what is missing.
    let checkout = tempfile::tempdir().unwrap();
    copy(Path::new(LAYOUTS), &checkout.path().join("layouts"));
    fs::write(checkout.path().join("STRUCTURE.TcDUT"), &files[0].1).unwrap();
    let mut command = commram();
    let outcome = finish(command.args(["layout", "import", "STRUCTURE.TcDUT"]).current_dir(checkout.path()));
    assert_eq!(
        outcome.fails(2),
        "commram: STRUCTURE.TcDUT:8:20: `IP_BMARRAY` is neither an elementary type nor declared in the given files; add the file \
         that declares it\n"
    );
}

#[test]
fn data_types_of_plcopen_xml_are_imported() {
    let variable = |name: &str, ty: &str| format!("<variable name=\"{name}\"><type>{ty}</type></variable>\n");
    let members = MEMBERS.iter().map(|(name, ty)| match *ty {
        "IP_BMARRAY" => variable(name, "<derived name=\"IP_BMARRAY\"/>"),
        elementary => variable(name, &format!("<{elementary}/>")),
    });
    let members: String = members.chain([variable("w_DIP_NR", "<WORD/>")]).collect();
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-16\"?>
<project xmlns=\"http://www.plcopen.org/xml/tc6_0201\"><types><dataTypes>
<dataType name=\"IP_BMARRAY\"><baseType><array><dimension lower=\"1\" upper=\"4\"/><baseType><BYTE/></baseType></array></baseType></dataType>
<dataType name=\"ETHERNET_DIAGNOSE_BMSTRUCT\"><baseType><struct>
{members}</struct></baseType></dataType>
</dataTypes><pous><pou name=\"main\" pouType=\"program\"/></pous></types></project>"
    );
    let utf_16: Vec<u8> =
        "\u{FEFF}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let (offset, provenance, err) = imported(&[("export.xml", utf_16)]);
    assert_eq!((offset, provenance.as_str()), (14, "offsets = \"manual: BM_TYPES, export.xml\""), "{err}");
    assert!(err.contains("POU main in line "), "{err}");
}

#[test]
fn an_export_of_codesys_with_programs_is_imported() {
    let text = format!(
        "\r\n(* @NESTEDCOMMENTS := 'Yes' *)\r\n(* @PATH := '\\/Types' *)\r\n(* @OBJECTFLAGS := '0, 8' *)\r\n\
         TYPE IP_BMARRAY : ARRAY[1..4] OF BYTE; (* for (* every *) address, gr\u{F6}\u{DF}er *)\r\nEND_TYPE\r\n\
         (* @END_DECLARATION := '0' *)\r\n\
         TYPE ETHERNET_DIAGNOSE_BMSTRUCT :\r\nSTRUCT\r\n{}    NAME_OF_IT : WORD := 16#0;\r\nEND_STRUCT\r\nEND_TYPE\r\n\
         PROGRAM PLC_PRG\r\nVAR\r\n x : STRING(20) := 'END_PROGRAM';\r\nEND_VAR\r\n(* @END_DECLARATION := '0' *)\r\n\
         x := 'don''t'; y := a >= 5 AND NOT b;\r\nEND_PROGRAM\r\n",
        members()
    );
    // Programs of that age write the characters of Windows.
    let ansi: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let (offset, provenance, err) = imported(&[("project.exp", ansi)]);
    assert_eq!((offset, provenance.as_str()), (14, "offsets = \"manual: BM_TYPES, project.exp\""), "{err}");
    assert!(
        err.contains("note: project.exp: skipped, because only types are read: PROGRAM PLC_PRG in line "),
        "{err}"
    );
}

/// A structure that is not imported can contain anything.
#[test]
fn types_without_a_size_do_not_matter_elsewhere() {
    let text = format!(
        "TYPE OTHER_BMSTRUCT : STRUCT s : STRING(GVL.N); p : POINTER TO X; t : TIME; fb : TON(PT := T#1s); END_STRUCT END_TYPE
TYPE E : (A, B := 5) := A; IP_BMARRAY : ARRAY[1..4] OF BYTE; END_TYPE
TYPE ETHERNET_DIAGNOSE_BMSTRUCT : STRUCT\n{}END_STRUCT END_TYPE",
        members()
    );
    let (offset, ..) = imported(&[("types.st", text.into_bytes())]);
    assert_eq!(offset, 14);
}
