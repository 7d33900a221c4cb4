//! Tests that input files with any contents are read or refused. The corpus of these targets is in `__fuzz__` next to
//! this file; see `tests/__fuzz__/README.md` of the repository.

#![cfg(feature = "import")]

use commram_layoutc::declaration::{Alignment, Declarations, Sizes};
use commram_layoutc::import::{Import, NamePairs};
use std::fs;
use std::path::Path;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixture");
const MIXED: &str = include_str!("__fuzz__/declarations/corpus/mixed.st");

/// Any file is read or refused; accepted declarations are laid out, and imported or refused.
fn read_or_refuse(bytes: &[u8]) {
    let Ok(declarations) = Declarations::read(Path::new("x.st"), Ok(bytes.to_vec())) else { return };
    for alignment in [Alignment::Packed, Alignment::Natural] {
        let mut sizes = Sizes::new(&declarations, alignment);
        for ty in declarations.structures().map(|name| declarations.find(name).unwrap()) {
            for (offset, member) in sizes.members(ty).unwrap_or_default() {
                let end = offset + sizes.size(member.ty).unwrap();
                assert!(sizes.shape(member.ty).is_ok() && end <= sizes.size(ty).unwrap());
            }
        }
        let _ = Import::plan(Path::new(FIXTURE), &declarations, alignment, &NamePairs::default());
    }
}

#[test]
fn fuzz_declarations() {
    bolero::check!(name = "declarations").with_iterations(50).for_each(|bytes: &[u8]| {
        read_or_refuse(bytes);
    });
}

/// The first byte selects a file of the layout. The remaining bytes are the content of this file.
#[test]
fn fuzz_layout() {
    let mut files: Vec<_> = fs::read_dir(FIXTURE).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    bolero::check!(name = "layout").with_iterations(50).for_each(|bytes: &[u8]| {
        let Some((which, text)) = bytes.split_first() else { return };
        let directory = tempfile::tempdir().unwrap();
        for (number, file) in files.iter().enumerate() {
            let to = directory.path().join(file.file_name().unwrap());
            if number == usize::from(*which) % files.len() {
                fs::write(to, text).unwrap();
            } else {
                fs::copy(file, to).unwrap();
            }
        }
        let _ = commram_layoutc::compile(directory.path());
    });
}

const PIECES: [&str; 54] = [
    "TYPE",
    "END_TYPE",
    "STRUCT",
    "END_STRUCT",
    "ARRAY",
    "OF",
    "VAR_GLOBAL",
    "END_VAR",
    "AT",
    "STRING",
    "T",
    "U",
    "BYTE",
    "LREAL",
    ":",
    ":=",
    ";",
    ",",
    "(",
    ")",
    "[",
    "]",
    "..",
    "0",
    "31",
    "16#FFFF_FFFF_FFFF_FFFF",
    "-",
    "%MB3.5",
    "'a'",
    "(*",
    "*)",
    "{",
    "}",
    "'pack_mode' :=",
    "UNION",
    "END_UNION",
    "EXTENDS",
    "CONSTANT",
    "FUNCTION",
    "END_FUNCTION",
    "NAMESPACE",
    "POINTER TO",
    "*",
    "<project>",
    "</project>",
    "<TcPlcObject>",
    "<dataType name=\"T\">",
    "<baseType>",
    "<struct>",
    "<BYTE/>",
    "<![CDATA[",
    "]]>",
    "ä",
    "\n",
];

proptest::proptest! {
    #[test]
    fn random_text_is_read_or_refused(text in "\\PC*") {
        read_or_refuse(text.as_bytes());
    }

    #[test]
    fn random_words_are_read_or_refused(
        words in proptest::collection::vec(proptest::sample::select(&PIECES[..]), 0..60)
    ) {
        read_or_refuse(words.join(" ").as_bytes());
    }

    /// A correct declaration with one replaced piece reaches deeper parts of the parser than random text.
    #[test]
    fn a_damaged_declaration_is_read_or_refused(
        at in 0..MIXED.split_whitespace().count(), piece in proptest::sample::select(&PIECES[..])
    ) {
        let mut words: Vec<_> = MIXED.split_whitespace().collect();
        words[at] = piece;
        read_or_refuse(words.join("\n").as_bytes());
    }
}
