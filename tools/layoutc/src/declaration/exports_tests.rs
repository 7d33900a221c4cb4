//! Tests of exported files with more than plain structures: other parts, other forms of types, XML.

use super::*;

/// Returns the offsets of the members of `T`, and its size. Reads the files one after the other.
#[track_caller]
fn laid_out(texts: &[&str]) -> String {
    let declarations = added(texts).unwrap_or_else(|error| panic!("{error}"));
    let ty = declarations.find("T").expect("a type T");
    let mut sizes = Sizes::new(&declarations, Alignment::Natural);
    let members = sizes.members(ty).and_then(|members| Ok((members, sizes.size(ty)?)));
    let (members, size) = members.unwrap_or_else(|error| panic!("{error}"));
    let offsets = members.iter().map(|(offset, member)| format!("{} {offset}, ", member.name));
    format!("{}{size}", offsets.collect::<String>())
}

/// Returns the error of the files, or of the size of their type `T`.
#[track_caller]
fn refused(texts: &[&str]) -> String {
    let size = |declarations: Declarations| {
        let ty = declarations.find("T").expect("a type T");
        Sizes::new(&declarations, Alignment::Natural).size(ty)
    };
    added(texts).and_then(size).expect_err("refused").to_string()
}

fn added(texts: &[&str]) -> Result<Declarations, DeclarationError> {
    let mut declarations = Declarations::default();
    for (number, text) in texts.iter().enumerate() {
        declarations.add(Path::new(&format!("{number}.st")), Ok(text.as_bytes().to_vec()))?;
    }
    Ok(declarations)
}

#[test]
fn other_parts_of_a_file_are_skipped_and_named() {
    let text = "
(*@KEY@:DESCRIPTION*) don't (* read *) *) { 5 (*@KEY@:END_DESCRIPTION*) {library public}
NAMESPACE Vendor.Types USING Other.Types;
FUNCTION_BLOCK INTERNAL Motor VAR don't : BOOL; END_VAR (* END_FUNCTION_BLOCK *)
    a^.b ?= 'END_FUNCTION_BLOCK' => §; METHOD m END_METHOD
END_FUNCTION_BLOCK
TYPE T : STRUCT b : BYTE; d : DWORD; END_STRUCT END_TYPE;
VAR_GLOBAL PERSISTENT x AT %QX0.0 : Motor(a := 1); END_VAR
TEST 'one' ASSERT(1 = 1); END_TEST
PROGRAM END_PROGRAM
CONFIGURATION c RESOURCE r ON PLC TASK t(INTERVAL := T#1ms); PROGRAM p WITH t : main; END_RESOURCE END_CONFIGURATION
FUNCTION one : INT END_FUNCTION FUNCTION two : INT END_FUNCTION
END_NAMESPACE
PROGRAM main x := 1;";
    assert_eq!(laid_out(&[text]), "b 0, d 4, 8");
    assert_eq!(
        added(&[text]).unwrap().notes(),
        ["0.st: skipped, because only types are read: FUNCTION_BLOCK INTERNAL in line 4, TEST  in line 9, \
          PROGRAM END_PROGRAM in line 10, CONFIGURATION c in line 11, FUNCTION one in line 12, 2 more"]
    );
    assert_eq!(added(&["TYPE T : BYTE; END_TYPE"]).unwrap().notes(), [""; 0]);
}

#[test]
fn every_form_of_a_type_is_read() {
    let text = "
TYPE INTERNAL E : (RED := 1, (* one *) GREEN, BLUE := 16#FF) USINT := GREEN; END_TYPE
TYPE F : UINT (LOW := 1, HIGH) := LOW; END_TYPE
{attribute 'qualified_only'}
TYPE
    T EXTENDS N.BASE : STRUCT
        {attribute 'pytmc' := '
            pv: X
        '}
        e : E := E.RED; f : F;
        u : UNION b : BYTE; d : ARRAY[0..1] OF WORD; END_UNION;
        s : INT(-100..100) := -5;
        m : N.BASE := (a := 1, b := [2(T#5s + 3 * 4)]);
        type, of : REAL := 1.5E-3 ** 2;
    END_STRUCT;
    BASE : STRUCT a : BYTE; b : WORD; END_STRUCT;
    NOT_READ : STRUCT
        p : POINTER TO ARRAY[0..GVL.NONE] OF DWORD; q : REFERENCE TO BASE; o : REF_TO INT;
        t : STRING(GVL.LEN + 1) := 'it$'s'; w : WSTRING[80] := \"a\"; x : ARRAY[*] OF BYTE;
        fb : MC_Power(Axis := a, Enable := TRUE); fbs : ARRAY[1..2] OF FB[(a := 1), (a := 2)]; any : ANY_NUM;
    END_STRUCT;
END_TYPE";
    assert_eq!(laid_out(&[text]), "a 0, b 2, e 4, f 6, u 8, s 12, m 14, type 20, of 24, 28");
    for (member, reason) in [
        (
            "q : POINTER TO T",
            "2:5: the size of a pointer is not fixed by IEC 61131-3, so no offset after it is known",
        ),
        (
            "x : ARRAY[*] OF BYTE",
            "2:11: the size of an array without bounds is not fixed by IEC 61131-3, so no offset after it is known",
        ),
        (
            "a : BYTE; b AT %B5 : BYTE",
            "2:13: this member has its own address, which is not read; declare the structure without AT",
        ),
        ("b : BIT", "2:5: the size of BIT is not fixed by IEC 61131-3, so no offset after it is known"),
        (
            "f : N.Motor",
            "2:5: `N.Motor` is neither an elementary type nor declared in the given files; add the file that declares it",
        ),
    ] {
        assert_eq!(
            refused(&[&format!("TYPE T : STRUCT\n{member}; END_STRUCT END_TYPE")]),
            format!("0.st:{reason}")
        );
    }
    let base = "TYPE T EXTENDS Motor : STRUCT END_STRUCT END_TYPE";
    assert_eq!(
        refused(&[base]),
        "0.st:1:24: `Motor` is no structure of the given files; add the file that declares it"
    );
    assert_eq!(refused(&["TYPE T EXTENDS T : STRUCT END_STRUCT END_TYPE"]), "0.st:1:20: `T` contains itself");
}

#[test]
fn bounds_can_be_expressions_with_constants_of_any_file() {
    let types = "TYPE T : STRUCT a : ARRAY[GVL.FIRST..2 * (LAST - 1) MOD 16#10, UINT#0..1] OF BYTE; END_STRUCT END_TYPE";
    let constants = "VAR_GLOBAL CONSTANT RETAIN\n FIRST : INT := -LAST / 2; LAST : INT := 4; LIST : ARRAY[0..1] OF INT := [1, 2]; OTHER : INT;\nEND_VAR";
    assert_eq!(laid_out(&[types, constants]), "a 0, 18");
    assert_eq!(laid_out(&[constants, types]), "a 0, 18");
    let array = |bound: &str| format!("TYPE T : ARRAY[0..{bound}] OF BYTE; END_TYPE");
    for (bound, constants, reason) in [
        ("N", "", "`N` is no constant of the given files; add the file that declares it"),
        ("N", "N : INT := M; M : INT := 1 + N;", "the constant `N` depends on itself"),
        ("N", "N : INT := 1.5;", "`1.5` is no array bound; bounds are whole numbers"),
        ("N / 0", "N : INT := 1;", "`N/0` is no array bound; bounds are whole numbers"),
        ("(1", "", "`(1` is no array bound; bounds are whole numbers"),
        ("N * N", "N : DINT := 16#7FFF_FFFF;", "`N*N` is no array bound; bounds are whole numbers"),
        ("N", "N : INT := 1; n : INT := 2;", "the constant `N` is declared more than once"),
    ] {
        let constants = format!("VAR_GLOBAL CONSTANT {constants} END_VAR");
        assert_eq!(refused(&[&array(bound), &constants]), format!("0.st:1:16: {reason}"));
    }
    let long = "1+".repeat(40) + "1";
    assert_eq!(refused(&[&array(&long)]), "0.st:1:16: this expression has more than 64 parts");
    let chain: String = (0..1000).map(|n| format!("N{n} : INT := N{};", n + 1)).collect();
    let deep = refused(&[&array("N0"), &format!("VAR_GLOBAL CONSTANT {chain} N1000 : INT := 1; END_VAR")]);
    assert_eq!(deep, "0.st:1:16: the constant `N32` depends on others more than 32 deep");
    // Every constant refers many times to the next one. Without stored values, the time of the evaluation would grow
    // exponentially.
    let broad: String =
        (0..30).map(|n| format!("N{n} : INT := {}0;", format!("N{} + ", n + 1).repeat(20))).collect();
    let text = format!("VAR_GLOBAL CONSTANT {broad} N30 : INT := 0; END_VAR");
    assert_eq!(laid_out(&[&array("N0"), &text]), "1");
}

/// The attribute `pack_mode` is given as text and as XML.
#[test]
fn the_attribute_pack_mode_sets_the_alignment_of_one_structure() {
    for (mode, size) in [("0", 7), ("1", 7), ("2", 8), ("4", 12), ("8", 12), ("x", 12)] {
        let text = format!(
            "{{attribute 'pack_mode' := '{mode}'}} {{attribute 'hide'}}
             TYPE T : STRUCT a : BYTE; b : DWORD; c : WORD; END_STRUCT END_TYPE
             TYPE NEXT : STRUCT a : BYTE; b : DWORD; END_STRUCT END_TYPE"
        );
        assert!(laid_out(&[&text]).ends_with(&size.to_string()), "{mode}");
        let after = format!("{text} TYPE V : NEXT; END_TYPE")
            .replace("TYPE T ", "TYPE U ")
            .replace("V : NEXT", "T : NEXT");
        assert_eq!(laid_out(&[&after]), "8", "{mode}");
    }
}

/// Projects declare some types in several files.
#[test]
fn a_type_in_two_files_matters_only_where_it_is_used() {
    let files = ["TYPE A : BYTE; END_TYPE", "TYPE B : BYTE;\n a : WORD; END_TYPE"];
    let with = |text| [files[0], files[1], text];
    assert_eq!(laid_out(&with("TYPE T : B; END_TYPE")), "1");
    let several = "`A` is declared at 0.st:1:6 and at 1.st:2:2; name only one of these files";
    assert_eq!(refused(&with("TYPE T : A; END_TYPE")), format!("2.st:1:10: {several}"));
    assert_eq!(
        refused(&with("TYPE T EXTENDS A : STRUCT END_STRUCT END_TYPE")),
        format!("2.st:1:20: {several}")
    );
    let declarations = added(&files).unwrap();
    assert_eq!(declarations.find_only("a").unwrap_err().to_string(), format!("1.st:2:2: {several}"));
    assert_eq!(declarations.file_of(declarations.find_only("N.B").unwrap().unwrap()), Path::new("1.st"));
    assert_eq!(declarations.title(), "0.st with another file");
}

const OBJECT: &str = "\u{FEFF}<?xml version=\"1.0\" encoding=\"utf-8\"?>\r
<TcPlcObject Version=\"1.1.0.1\">\r
  <DUT Name=\"T\" Id=\"{00000000-0000-0000-0000-000000000001}\">\r
    <Declaration><![CDATA[{attribute 'pack_mode' := '1'}\r
TYPE T : STRUCT // a < b & c\r
    a : BYTE; b : ARRAY[0..N] OF WORD;\r
END_STRUCT END_TYPE\r
]]></Declaration>\r
  </DUT>\r
</TcPlcObject>\r
";

#[test]
fn objects_of_twincat_are_read_with_their_places() {
    let list = "<TcPlcObject><GVL Name=\"G\"><Declaration>VAR_GLOBAL CONSTANT N : INT := 4 * (1 &gt; 0) * 0 + 1; M : INT := 1;\nEND_VAR</Declaration></GVL></TcPlcObject>";
    assert_eq!(
        refused(&[OBJECT]),
        "0.st:6:25: `N` is no constant of the given files; add the file that declares it"
    );
    assert_eq!(laid_out(&[&OBJECT.replace("N]", "M]"), list]), "a 0, b 1, 5");
    let wrong = OBJECT.replace("{attribute 'pack_mode' := '1'}\r\n", "").replace("T : STRUCT", "T STRUCT");
    assert_eq!(refused(&[&wrong]), "0.st:4:34: expected `:` after the name of the type, found `STRUCT`");
    let block = "<TcPlcObject>\n<POU Name=\"F&#27;B\"><Declaration><![CDATA[FUNCTION_BLOCK FB]]></Declaration>\
                 <Implementation><ST><![CDATA[TYPE]]></ST></Implementation></POU></TcPlcObject>";
    assert_eq!(
        added(&[block]).unwrap().notes(),
        ["0.st: skipped, because only types are read: POU F?B in line 2"]
    );
}

const PROJECT: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<project xmlns="http://www.plcopen.org/xml/tc6_0201" xmlns:x="http://www.w3.org/1999/xhtml">
  <fileHeader companyName="a" productName="b" productVersion="1" creationDateTime="2026-01-01T00:00:00"/>
  <types>
    <dataTypes>
      <dataType name="ROW"><baseType><array><dimension lower="0" upper="N - 1"/><baseType><WORD/></baseType></array></baseType></dataType>
      <dataType name="BASE"><baseType><struct><variable name="first"><type><DINT/></type></variable></struct></baseType></dataType>
      <dataType name="T">
        <baseType>
          <struct>
            <variable name="a"><type><BYTE/></type><initialValue><simpleValue value="5"/></initialValue></variable>
            <variable name="e"><type><enum><values><value name="RED"/></values><baseType><UINT/></baseType></enum></type></variable>
            <variable name="rows">
              <type><array><dimension lower="1" upper="2"/><baseType><derived name="ROW"/></baseType></array></type>
              <documentation><x:p>two &lt; three</x:p></documentation>
            </variable>
            <variable name="s"><type><subrangeSigned><range lower="-5" upper="5"/><baseType><SINT/></baseType></subrangeSigned></type></variable>
          </struct>
        </baseType>
        <documentation><x:p>text</x:p></documentation>
        <addData>
          <data name="http://www.3s-software.com/plcopenxml/attributes" handleUnknown="implementation">
            <Attributes><Attribute Name="pack_mode" Value="2"/></Attributes>
          </data>
          <data name="http://www.3s-software.com/plcopenxml/datatypeinheritance" handleUnknown="discard">
            <Inheritance><Extends>BASE</Extends></Inheritance>
          </data>
        </addData>
      </dataType>
      <dataType name="NOT_READ"><baseType><struct>
        <variable name="t"><type><string length="80"/></type></variable>
        <variable name="p"><type><pointer><baseType><INT/></baseType></pointer></type></variable>
        <variable name="q"><type><enum><values/></enum></type></variable>
      </struct></baseType></dataType>
    </dataTypes>
    <pous><pou name="main" pouType="program"><interface/><body><ST><x:p>x := 1;</x:p></ST></body></pou></pous>
  </types>
  <instances><configurations><configuration name="c">
    <globalVars name="G" constant="true"><variable name="N"><type><INT/></type><initialValue><simpleValue value="3"/></initialValue></variable></globalVars>
    <globalVars name="H"><variable name="N"><type><INT/></type><initialValue><simpleValue value="9"/></initialValue></variable></globalVars>
  </configuration></configurations></instances>
</project>"#;

#[test]
fn data_types_of_plcopen_are_read() {
    assert_eq!(laid_out(&[PROJECT]), "first 0, a 4, e 6, rows 8, s 20, 24");
    let declarations = added(&[PROJECT]).unwrap();
    assert_eq!(declarations.structures().collect::<Vec<_>>(), ["BASE", "T", "NOT_READ"]);
    assert_eq!(declarations.notes(), ["0.st: skipped, because only types are read: POU main in line 36"]);
    for (from, to, reason) in [
        (
            "<WORD/>",
            "<string/>",
            "6:91: the size of STRING is not fixed by IEC 61131-3, so no offset after it is known",
        ),
        ("N - 1", "M", "6:45: `M` is no constant of the given files; add the file that declares it"),
        (" upper=\"N - 1\"", "", "6:45: `<dimension>` needs the attribute `upper`"),
        ("<baseType><WORD/></baseType>", "", "6:38: `<array>` has no type"),
        ("<type><BYTE/></type>", "", "11:13: `<variable>` has no type"),
        ("variable name=\"a\"", "variable", "11:13: `<variable>` needs the attribute `name`"),
        (
            "name=\"e\"",
            "name=\"A\"",
            "12:13: `A` is already declared at line 11, column 13; names do not distinguish upper and lower case",
        ),
        (
            "\"BASE\"",
            "\"row\"",
            "7:7: `row` is already declared at line 6, column 7; names do not distinguish upper and lower case",
        ),
    ] {
        assert_eq!(PROJECT.matches(from).count(), 1, "{from}");
        assert_eq!(refused(&[&PROJECT.replace(from, to)]), format!("0.st:{reason}"));
    }
}

#[test]
fn hostile_and_other_xml_is_refused() {
    let nested = |count: usize| format!("<project>{}", "<a>".repeat(count));
    assert_eq!(
        refused(&[&nested(200)]),
        "0.st:1:391: the elements of this XML are nested more than 128 deep"
    );
    let array = "<array><baseType>".repeat(17);
    let types = format!("<project><dataType name=\"T\"><baseType>{array}");
    assert_eq!(refused(&[&types]), "0.st:1:318: type definitions are nested more than 16 deep");
    assert_eq!(
        refused(&["<ExportFile/>"]),
        "0.st:1:1: `ExportFile` is no XML with declarations; export PLCopen XML, an object of TwinCAT (.TcDUT) or plain text"
    );
    assert_eq!(refused(&["<project>"]), "0.st:1:10: this element has no end");
    assert!(refused(&["<project></pro>"]).starts_with("0.st:1:10: this is no well-formed XML: "));
    assert_eq!(refused(&["<!-- nothing -->"]), "0.st:1:17: this is no well-formed XML: it has no element");
    // No entity is replaced. Many attributes or entities take no more time than other text.
    let entities = "<!DOCTYPE a [<!ENTITY a \"&b;&b;\"><!ENTITY b \"&a;\">]>";
    let attributes: String = (0..200_000).map(|n| format!(" a{n}=\"&a;\"")).collect();
    let text = format!(
        "{entities}<project{attributes}><dataType name=\"T\"><baseType><BYTE/></baseType></dataType>{}</project>",
        "&a;".repeat(200_000)
    );
    assert_eq!(laid_out(&[&text]), "1");
}
