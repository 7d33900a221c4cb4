//! A word in the front panel of a device with a script. It shows whether the script runs (D-801).

use super::FolderError;
use crate::layout::{Owner as RegisterOwner, RegisterRef};
use commram_layoutc::model::{Device, FrontWord, Meaning, Owner, Provenance, Scalar, Value};
use std::path::Path;

/// Name of the word in the front panel.
pub(crate) const WORD: &str = "script";
/// Name of the word as a register.
pub(super) const NAME: &str = "front.script";

/// Number of bytes of the front panel in the header page.
const FRONT_BYTES: u32 = 256;

/// Checks that the device's own files may change a register.
///
/// # Errors
/// Only the program, or only the emulator, writes the register.
pub(super) fn may_change(register: &RegisterRef) -> Result<(), String> {
    if register.name() == NAME {
        return Err(format!("only the emulator writes `{NAME}`, which shows whether the script runs"));
    }
    match register.register.owner {
        RegisterOwner::Plc => Err(format!(
            "only the program writes {register}; the device changes registers of \"firmware\" or \"both\""
        )),
        _ => Ok(()),
    }
}

fn decision() -> Provenance {
    Provenance::Inferred("D-801".to_owned())
}

/// Adds the word to the front panel, after the words that the device declares.
///
/// # Errors
/// The front panel has a word of this name, or is full.
pub(super) fn add(dir: &Path, device: &mut Device) -> Result<(), FolderError> {
    let offset = device.front.last().map_or(0, |word| word.offset + 4);
    let what = if device.front.iter().any(|word| word.name.eq_ignore_ascii_case(WORD)) {
        "the front has a word `script`, which shows the state of firmware.rhai"
    } else if offset >= FRONT_BYTES {
        "the front has no room for the word `script`, which shows the state of firmware.rhai"
    } else {
        device.front.push(word(offset, device.meanings.len()));
        let meaning = meaning(&device.meanings);
        device.meanings.push(meaning);
        return Ok(());
    };
    Err(FolderError::Script { path: dir.join("device.toml"), line: 1, what: what.to_owned() })
}

fn word(offset: u32, meaning: usize) -> FrontWord {
    FrontWord {
        name: WORD.to_owned(),
        scalar: Scalar::Dword,
        offset,
        owner: Owner::Firmware,
        meaning: Some(meaning),
        is_text: false,
        source: decision(),
        page: String::new(),
        doc: "Whether the script of the device runs".to_owned(),
    }
}

/// Returns the meaning of the word. Its name differs from those of the device's own meanings.
fn meaning(others: &[Meaning]) -> Meaning {
    let mut name = WORD.to_owned();
    while others.iter().any(|other| other.name.eq_ignore_ascii_case(&name)) {
        name.push_str("_word");
    }
    let value = |number, text: &str| Value {
        id: None,
        first: number,
        last: number,
        text: text.to_owned(),
        reserved: false,
        source: decision(),
    };
    Meaning {
        name,
        pages: Vec::new(),
        shared: false,
        scalar: None,
        handshake: None,
        values: vec![value(0, "running"), value(1, "stopped")],
        bits: Vec::new(),
    }
}
