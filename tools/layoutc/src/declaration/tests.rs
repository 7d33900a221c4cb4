//! Tests of declarations in the form in which engineering tools write them, and of wrong declarations.

use super::*;

/// Returns the names, offsets and sizes of the members of `name`, then the size of the whole.
#[track_caller]
fn laid_out(text: &str, name: &str, alignment: Alignment) -> String {
    let declarations = Declarations::parse(Path::new("x.st"), text).unwrap_or_else(|error| panic!("{error}"));
    let mut sizes = Sizes::new(&declarations, alignment);
    let ty = declarations.find(name).unwrap();
    let members = sizes.members(ty).unwrap();
    let mut texts: Vec<_> =
        members.iter().map(|(offset, member)| format!("{} {offset}", member.name)).collect();
    texts.push(sizes.size(ty).unwrap().to_string());
    texts.join(", ")
}

/// Returns the error about `text`, or about the size of its type `T`.
#[track_caller]
fn refused(text: &str) -> String {
    let declarations = match Declarations::parse(Path::new("x.st"), text) {
        Ok(declarations) => declarations,
        Err(error) => return error.to_string(),
    };
    let mut sizes = Sizes::new(&declarations, Alignment::Natural);
    let ty = declarations.find("T").expect("a type T");
    let first = sizes.size(ty).expect_err("refused").to_string();
    assert_eq!(sizes.size(ty).unwrap_err().to_string(), first, "the same when asked again");
    first
}

const MIXED: &str = include_str!("../../tests/__fuzz__/declarations/corpus/mixed.st");

#[test]
fn members_begin_at_multiples_of_their_alignment_and_of_the_limit() {
    let natural = "b 0, d 4, a 8, c 12, pairs 16, l 32, x 40, 48";
    assert_eq!(laid_out(MIXED, "MIXED", Alignment::Natural), natural);
    let four = "b 0, d 4, a 8, c 12, pairs 16, l 28, x 36, 40";
    assert_eq!(laid_out(MIXED, "mixed", Alignment::Four), four);
    let two = "b 0, d 2, a 6, c 10, pairs 14, l 26, x 34, 36";
    assert_eq!(laid_out(MIXED, "Mixed", Alignment::Two), two);
    let packed = "b 0, d 1, a 5, c 8, pairs 11, l 20, x 28, 29";
    assert_eq!(laid_out(MIXED, "Mixed", Alignment::Packed), packed);
}

#[test]
fn names_arrays_of_arrays_and_inner_structures_are_seen_through() {
    let text = "
TYPE ROW : ARRAY[0..15] OF VALUE; END_TYPE
TYPE GRID : ARRAY[-1..2#11, 5..5] OF ROW := [80(0)]; VALUE : DINT (-5..5) := 3; END_TYPE;
TYPE T : STRUCT
    grid : GRID;
    inner : ARRAY[0..1] OF STRUCT us : USINT; u : UINT; END_STRUCT;
END_STRUCT; END_TYPE
VAR_GLOBAL CONSTANT RETAIN
    one, two AT %MB3.200000 : T := (grid := [1, 2], text := 'a;$'b');
END_VAR";
    let declarations = Declarations::parse(Path::new("x.st"), text).unwrap();
    let mut sizes = Sizes::new(&declarations, Alignment::Natural);
    let members = declarations.members(declarations.find("t").unwrap());
    let grid = Shape { counts: vec![5, 1, 16], element: size::Element::Scalar("DINT"), size: 4 };
    assert_eq!(sizes.shape(members[0].ty).unwrap(), grid);
    let inner = sizes.shape(members[1].ty).unwrap();
    assert_eq!((inner.counts, inner.size), (vec![2], 4));
    assert_eq!(declarations.structures().collect::<Vec<_>>(), ["T"]);
    assert_eq!((members[1].at.line, members[1].at.column), (6, 5));
}

#[test]
fn a_syntax_error_is_reported_with_its_place() {
    let body = |member: &str| format!("TYPE T : STRUCT\n  {member}\nEND_STRUCT; END_TYPE");
    for (text, complaint) in [
        ("x := 5;", "x.st:1:1: expected TYPE or VAR_GLOBAL, found `X` without END_X"),
        ("5;", "x.st:1:1: expected TYPE or VAR_GLOBAL, found `5`"),
        ("VAR_GLOBAL a : BYTE;", "x.st:1:1: this list of variables has no end"),
        ("VAR_GLOBAL CONSTANT a : BYTE := 1 END_VAR", "x.st:1:35: expected `;`, found `END_VAR`"),
        ("FUNCTION a (* comment", "x.st:1:12: this comment has no end"),
        (
            "TYPE T : UNION a : BYTE; END_STRUCT",
            "x.st:1:26: expected the name of a member or END_UNION, found the keyword `END_STRUCT`",
        ),
        ("TYPE T : POINTER BYTE;", "x.st:1:18: expected TO, found `BYTE`"),
        ("TYPE T EXTENDS : STRUCT", "x.st:1:16: expected the name of a structure, found `:`"),
        ("TYPE\n T BYTE;", "x.st:2:4: expected `:` after the name of the type, found `BYTE`"),
        ("TYPE T : BYTE", "x.st:1:14: expected `;`, found the end of the file"),
        ("TYPE T : BYTE; ", "x.st:1:16: expected the name of a type or END_TYPE, found the end of the file"),
        ("TYPE OF : BYTE;", "x.st:1:6: expected the name of a type or END_TYPE, found the keyword `OF`"),
        (
            "TYPE T : BYTE; t : WORD; END_TYPE",
            "x.st:1:16: `t` is already declared at line 1, column 6; names do not distinguish upper and lower case",
        ),
        (
            &body("a : BYTE; A : BYTE;"),
            "x.st:2:13: `A` is already declared at line 2, column 3; names do not distinguish upper and lower case",
        ),
        (&body("a : BYTE"), "x.st:3:1: expected `;`, found `END_STRUCT`"),
        (&body("a : BYTE := 5"), "x.st:3:1: expected `;` after the initial value, found `END_STRUCT`"),
        (&body("a : BYTE := ;"), "x.st:2:15: expected an initial value, found `;`"),
        (&body("a : BYTE := (1];"), "x.st:2:17: expected `)`, found `]`"),
        (&body("a : ARRAY[0..] OF BYTE;"), "x.st:2:16: expected a number as array bound, found `]`"),
        (&body("a : ARRAY[0, 1] OF BYTE;"), "x.st:2:14: expected `..` after the lower bound, found `,`"),
        (
            &body("a : ARRAY[0..16#FG] OF BYTE;"),
            "x.st:2:13: `16#FG` is no array bound; bounds are whole numbers",
        ),
        (
            &body("a : ARRAY[5..4] OF BYTE;"),
            "x.st:2:13: the array's bounds 5..4 must ascend and hold at most 16777216 elements",
        ),
        (&body("a : ARRAY[0..4] BYTE;"), "x.st:2:19: expected OF, found `BYTE`"),
        (&body("a : BYTE; (* comment"), "x.st:2:13: this comment has no end"),
        (&body("(* a *) c *) d : BYTE;"), "x.st:2:13: `*)` without a comment before it"),
    ] {
        assert_eq!(refused(text), complaint);
    }
}

#[test]
fn types_without_a_size_are_reported_only_where_they_are_used() {
    let body = |ty: &str| {
        format!("TYPE T : STRUCT\n  a : {ty};\nEND_STRUCT; COLOUR : (RED, GREEN) := RED; END_TYPE")
    };
    let no_size = "is not fixed by IEC 61131-3, so no offset after it is known";
    for (ty, complaint) in [
        ("STRING[80]", format!("x.st:2:7: the size of STRING {no_size}")),
        ("COLOUR", format!("x.st:3:22: the size of an enumeration {no_size}")),
        ("TIME", format!("x.st:2:7: the size of TIME {no_size}")),
        ("BITE", "x.st:2:7: `BITE` is neither an elementary type nor declared in the given files; add the file that declares it".to_owned()),
        ("ARRAY[0..1] OF T", "x.st:1:10: `T` contains itself".to_owned()),
        ("ARRAY[1..9999, 1..9999] OF BYTE", "x.st:2:7: this type has more than 16 MiB".to_owned()),
    ] {
        assert_eq!(refused(&body(ty)), complaint);
    }
    assert_eq!(laid_out(&body("BYTE"), "T", Alignment::Natural), "a 0, 1");
}

#[test]
fn depth_and_breadth_are_bounded() {
    let inner = |depth: usize| format!("TYPE T : {}BYTE; END_TYPE", "ARRAY[0..0] OF ".repeat(depth));
    assert_eq!(refused(&inner(17)), "x.st:1:265: type definitions are nested more than 16 deep");
    assert!(Declarations::parse(Path::new("x.st"), &inner(16)).is_ok());

    let chain: String = (1..100_000).map(|n| format!("T{n} : T{};", n - 1)).collect();
    let text = format!("TYPE T0 : BYTE; {chain} T : T99999; END_TYPE");
    assert!(refused(&text).ends_with("this type is nested more than 64 deep"));

    // Every type contains the previous type twice. The last type has 2^29 bytes, which are too many to count one by
    // one.
    let doubled: String = (1..30).map(|n| format!("T{n} : STRUCT a, b : T{}; END_STRUCT;", n - 1)).collect();
    assert!(refused(&format!("TYPE T0 : BYTE; {doubled} T : T29; END_TYPE")).ends_with("more than 16 MiB"));
}

#[test]
fn files_are_bounded_and_may_be_older_than_utf_8() {
    let path = Path::new("types.st");
    let read = |content: &[u8]| Declarations::read(path, Ok(content.to_vec())).map_err(|error| error.reason);
    assert_eq!(read(b"(* gr\xF6\xDFer *) TYPE T : BYTE; END_TYPE").unwrap().named.len(), 1);
    assert_eq!(read(b"\xEF\xBB\xBFTYPE T : BYTE; END_TYPE").unwrap().named.len(), 1);
    let units: Vec<u16> = "TYPE \u{FC}T : BYTE; END_TYPE".encode_utf16().collect();
    let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
    for content in [[b"\xFF\xFE", &*little].concat(), [b"\xFE\xFF", &*big].concat(), little, big] {
        assert_eq!(read(&content).unwrap().named[0].name, "\u{FC}T");
    }
    assert_eq!(read(b"\xFF\xFET\0Y").unwrap_err().to_string(), "`\u{FFFD}` is not allowed in a declaration");
    assert_eq!(read(&vec![b' '; MAX_BYTES as usize + 1]).unwrap_err(), Wrong::TooLong(MAX_BYTES));
    let mut both = Declarations::read(path, Ok(vec![b' '; MAX_BYTES as usize - 9])).unwrap();
    assert_eq!(both.add(path, Ok(vec![b' '; 10])).unwrap_err().reason, Wrong::TooLongTogether(MAX_BYTES));
    let missing = Declarations::read(path, Err(io::ErrorKind::NotFound.into())).unwrap_err().to_string();
    assert!(missing.contains("types.st:1:1: cannot read this file"), "{missing}");
}
