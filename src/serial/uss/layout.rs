//! The net data: parameter channel and process data.

use super::pkw::Pkw;

/// Number of words of the parameter channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PkwWidth {
    /// There is no parameter channel.
    None,
    /// Three words, for parameters of one word.
    Three,
    /// Four words.
    Four,
    /// As many words as the request or the answer needs (code 127).
    Variable,
}

/// Sizes of the two parts of the net data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    pkw: PkwWidth,
    pzd: u8,
}

/// Reason for which net data and layout do not match.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// There are too many words of process data.
    #[error("{0} words of process data; there may be 0 to 16")]
    ProcessData(u8),
    /// There is no such PPO.
    #[error("there is no PPO type {0}; the types are 1 to 5")]
    Ppo(u8),
    /// The number of words of process data is wrong.
    #[error("{found} words of process data; the layout has {expected}")]
    Words {
        /// Number of words.
        found: usize,
        /// Number of words of the layout.
        expected: usize,
    },
    /// The number of characters is wrong.
    #[error("{0} characters of net data do not match the layout")]
    Length(usize),
    /// The values are longer than the parameter channel.
    #[error("{0} words of values do not fit into the parameter channel")]
    Values(usize),
}

impl Layout {
    /// Returns a layout. `pzd` is the number of words of process data, 0 to 16.
    ///
    /// # Errors
    /// There are more than 16 words of process data.
    pub const fn new(pkw: PkwWidth, pzd: u8) -> Result<Self, LayoutError> {
        if pzd > 16 { Err(LayoutError::ProcessData(pzd)) } else { Ok(Layout { pkw, pzd }) }
    }

    /// Returns the layout with the sizes of a PPO type of PROFIBUS, 1 to 5.
    ///
    /// # Errors
    /// There is no such type.
    pub const fn ppo(kind: u8) -> Result<Self, LayoutError> {
        match kind {
            1 => Layout::new(PkwWidth::Four, 2),
            2 => Layout::new(PkwWidth::Four, 6),
            3 => Layout::new(PkwWidth::None, 2),
            4 => Layout::new(PkwWidth::None, 6),
            5 => Layout::new(PkwWidth::Four, 10),
            _ => Err(LayoutError::Ppo(kind)),
        }
    }

    /// Returns the width of the parameter channel.
    #[must_use]
    pub const fn pkw(self) -> PkwWidth {
        self.pkw
    }

    /// Returns the number of words of process data.
    #[must_use]
    pub const fn pzd(self) -> usize {
        self.pzd as usize
    }

    /// Returns the net data of a parameter channel and process data.
    ///
    /// # Errors
    /// The values or the process data do not match the layout.
    pub fn data(self, pkw: &Pkw, pzd: &[u16]) -> Result<Vec<u8>, LayoutError> {
        if pzd.len() != self.pzd() {
            return Err(LayoutError::Words { found: pzd.len(), expected: self.pzd() });
        }
        let mut words = match self.pkw {
            PkwWidth::None => Vec::new(),
            PkwWidth::Three => padded(pkw, 1)?,
            PkwWidth::Four => padded(pkw, 2)?,
            PkwWidth::Variable => pkw.words().to_vec(),
        };
        words.extend(pzd);
        let data: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
        if data.len() > super::MAX_DATA {
            return Err(LayoutError::Values(pkw.values.len()));
        }
        Ok(data)
    }

    /// Returns the parameter channel and the process data of net data.
    ///
    /// # Errors
    /// The number of characters does not match the layout.
    pub fn parse(self, data: &[u8]) -> Result<(Pkw, Vec<u16>), LayoutError> {
        let wrong = LayoutError::Length(data.len());
        let (pairs, rest) = data.as_chunks::<2>();
        let words: Vec<u16> = pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect();
        let pkw = words.len().checked_sub(self.pzd()).filter(|_| rest.is_empty()).ok_or(wrong)?;
        let fits = match self.pkw {
            PkwWidth::None => pkw == 0,
            PkwWidth::Three => pkw == 3,
            PkwWidth::Four => pkw == 4,
            PkwWidth::Variable => pkw >= 2,
        };
        if !fits {
            return Err(wrong);
        }
        let (pkw, pzd) = words.split_at(pkw);
        Ok((Pkw::of_words(pkw), pzd.to_vec()))
    }
}

/// Values are at the end of a channel of fixed width: a word in a channel of four words is in its last word.
fn padded(pkw: &Pkw, width: usize) -> Result<Vec<u16>, LayoutError> {
    let missing = width.checked_sub(pkw.values.len()).ok_or(LayoutError::Values(pkw.values.len()))?;
    let mut words = pkw.words();
    words.splice(2..2, core::iter::repeat_n(0, missing));
    Ok(words)
}
