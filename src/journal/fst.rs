//! Waveforms in FST, GTKWave's own format. It has the same signals as a value change dump, but smaller files.
//!
//! The library that writes the format supports vectors of bits but no texts. So a text is a vector with 8 bits for each
//! character, like a string in Verilog: the last character is in the lowest bits, and unused upper bits are 0. Viewers
//! show such a vector as text in ASCII mode (D-590).

use super::waves::{Change, Content, Shape, Step, Waves};
use fst_writer::{
    FstFileType, FstHeaderWriter, FstInfo, FstScopeType, FstSignalId, FstSignalType, FstVarDirection,
    FstVarType, FstWriteError,
};
use std::io::{Seek, Write};

/// Exponent of the time unit: microseconds.
const MICROSECONDS: i8 = -6;
/// Maximum length of a name that viewers can read.
const LONGEST_NAME: usize = 500;

/// Waveforms as the contents of an FST file.
///
/// # Errors
/// No error is known that this function could return.
pub fn write(waves: &Waves) -> Result<Vec<u8>, FstWriteError> {
    let info = FstInfo {
        start_time: 0,
        timescale_exponent: MICROSECONDS,
        version: concat!("commram ", env!("CARGO_PKG_VERSION")).to_owned(),
        date: String::new(),
        file_type: FstFileType::Verilog,
    };
    let lengths = lengths(waves);
    let mut header = FstHeaderWriter::write_to_mem(&info)?;
    let signals = define(waves, &lengths, &mut header)?;
    let mut body = header.finish()?;
    // The library can remove repeated values of a signal. It must not do so, because each event counts even if it
    // repeats. The other signals have no repeated values.
    body.set_deduplicate(false);
    for Change { time_us, signal, content } in &waves.changes {
        let Some(Some(id)) = signals.get(*signal) else { continue };
        body.time_change(*time_us)?;
        let value = match content {
            Content::Bits { width, value, known } => bits(*width, *value, *known),
            Content::Text(text) => characters(text, lengths[*signal]),
            Content::Event => vec![b'1'],
        };
        body.signal_change(*id, &value)?;
    }
    Ok(body.finish()?.into_inner())
}

/// Returns the length of the longest text that each signal shows, at least 1.
fn lengths(waves: &Waves) -> Vec<usize> {
    let mut lengths = vec![1; waves.signals.len()];
    for Change { signal, content, .. } in &waves.changes {
        if let Content::Text(text) = content {
            lengths[*signal] = lengths[*signal].max(text.len());
        }
    }
    lengths
}

/// Declares the signals, scope by scope; their handles in the file are in the order of their numbers.
fn define(
    waves: &Waves,
    lengths: &[usize],
    header: &mut FstHeaderWriter<impl Write + Seek>,
) -> Result<Vec<Option<FstSignalId>>, FstWriteError> {
    let mut ids = vec![None; waves.signals.len()];
    for step in waves.outline() {
        match step {
            Step::Into(scope) => header.scope(cut(scope), "", FstScopeType::Module)?,
            Step::Out => header.up_scope()?,
            Step::Signal(number, name) => {
                let (kind, width) = match waves.signals[number].shape {
                    Shape::Bits(width) => (FstVarType::Reg, width),
                    Shape::Text => (FstVarType::Reg, 8 * lengths[number] as u32),
                    Shape::Event => (FstVarType::Event, 1),
                };
                let vector = FstSignalType::bit_vec(width);
                ids[number] = Some(header.var(cut(name), vector, kind, FstVarDirection::Implicit, None)?);
            }
        }
    }
    Ok(ids)
}

fn cut(name: &str) -> &str {
    &name[..name.floor_char_boundary(LONGEST_NAME)]
}

/// The highest bit first.
fn bits(width: u32, value: u64, known: u64) -> Vec<u8> {
    let bit = |bit: u32| match (known >> bit & 1, value >> bit & 1) {
        (0, _) => b'x',
        (_, 0) => b'0',
        _ => b'1',
    };
    (0..width).rev().map(bit).collect()
}

/// Returns a text as bits of `length` characters, its last one lowest.
fn characters(text: &str, length: usize) -> Vec<u8> {
    let filled = std::iter::repeat_n(0, length.saturating_sub(text.len())).chain(text.bytes());
    filled.flat_map(|byte| bits(8, byte.into(), u64::MAX)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_bits_of_their_characters_the_last_one_lowest() {
        assert_eq!(characters("A", 2), *b"0000000001000001");
        assert_eq!(characters("ab", 2), *b"0110000101100010");
        assert_eq!(bits(4, 0b1010, 0b1101), *b"10x0");
    }
}
