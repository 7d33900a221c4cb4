//! The ZK parameters that configure the CANsync card (manual 5.01010.01 p. 14-17).

use super::parameters::ParamFormat;
use crate::devices::cansync::frames::Channel;
use serde::{Deserialize, Serialize};

/// The card's parameters. The value of a missing parameter is 0: no mapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with the numbers of parameters")]
pub struct ZkParameters {
    /// Number of the parameter that reference value 1 is written to.
    pub zk_0: u16,
    /// Number of the parameter that reference value 2 is written to.
    pub zk_1: u16,
    /// Mapping of reference value 1, see [`ReferenceMapping`].
    pub zk_4: u16,
    /// Mapping of reference value 2.
    pub zk_5: u16,
    /// Number of the parameter that actual value 1 is read from.
    pub zk_16: u16,
    /// Number of the parameter that actual value 2 is read from.
    pub zk_17: u16,
    /// Mapping of actual value 1, see [`ActualMapping`].
    pub zk_20: u16,
    /// Mapping of actual value 2.
    pub zk_21: u16,
    /// Intervals by which reference values are delayed, 0 to 3.
    pub zk_24: u16,
    /// Mapping of the status word, as an actual value of word format.
    pub zk_25: u16,
    /// Permitted reference value losses in direct succession; 0 switches the monitoring off.
    pub zk_26: u16,
}

/// Source of a reference value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// A reference value frame of the master.
    Master,
    /// An actual value frame of the slave with this number, 0 to 31.
    Slave(u8),
}

/// ZK 4 and 5: frame and words of a reference value (p. 15).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ReferenceMapping {
    /// First word of the value, 0 to 3. A value of a single word can begin at 3.
    pub word: u8,
    /// Frame 1 or 2.
    pub channel: Channel,
    /// Width of the parameter: word or doubleword.
    pub format: ParamFormat,
    /// Sender of the frame.
    pub source: Source,
}

/// ZK 20, 21 and 25: frame and words of an actual value (p. 16-17).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ActualMapping {
    /// First word of the value, 0 to 3. A value of a single word can begin at 3.
    pub word: u8,
    /// Frame 1 or 2.
    pub channel: Channel,
    /// Width of the parameter: word or doubleword.
    pub format: ParamFormat,
}

/// An invalid mapping in a card parameter (ZK).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MappingError {
    /// A bit is set that the manual reserves.
    #[error("reserved bits 16#{0:04X} are set")]
    ReservedBits(u16),
    /// Frame number other than 1 and 2.
    #[error("frame number {0} is reserved, 0 (frame 1) or 1 (frame 2) would be right")]
    Frame(u16),
    /// A doubleword cannot begin with word 3.
    #[error("a doubleword cannot begin with word 3, the last of the frame")]
    BeyondFrame,
}

const VALID: u16 = 0x0001;
const DOUBLEWORD: u16 = 0x0040;
const FROM_SLAVE: u16 = 0x0080;

const fn channel(number: u16) -> Result<Channel, MappingError> {
    match number {
        0 => Ok(Channel::One),
        1 => Ok(Channel::Two),
        _ => Err(MappingError::Frame(number)),
    }
}

const fn place(zk: u16) -> Result<(u8, ParamFormat), MappingError> {
    let word = (zk >> 1 & 3) as u8;
    match (zk & DOUBLEWORD != 0, word) {
        (true, 3) => Err(MappingError::BeyondFrame),
        (true, _) => Ok((word, ParamFormat::Doubleword)),
        (false, _) => Ok((word, ParamFormat::Word)),
    }
}

const fn bits(word: u8, channel: Channel, format: ParamFormat) -> u16 {
    let format = match format {
        ParamFormat::Word => 0,
        ParamFormat::Doubleword => DOUBLEWORD,
    };
    VALID | (word as u16 & 3) << 1 | (channel as u16) << 3 | format
}

impl ReferenceMapping {
    /// Reads ZK 4 or 5. Returns `None` if bit 0 is clear: the card has no reference value then.
    ///
    /// # Errors
    /// [`MappingError`] if bit 0 is set but the mapping is wrong.
    pub fn from_zk(zk: u16) -> Result<Option<Self>, MappingError> {
        if zk & VALID == 0 {
            return Ok(None);
        }
        if zk & 0xE000 != 0 {
            return Err(MappingError::ReservedBits(zk & 0xE000));
        }
        let channel = channel(zk >> 3 & 7)?;
        let (word, format) = place(zk)?;
        // Bits 12-8 have a meaning only if bit 7 is set.
        let source =
            if zk & FROM_SLAVE != 0 { Source::Slave((zk >> 8 & 0x1F) as u8) } else { Source::Master };
        Ok(Some(ReferenceMapping { word, channel, format, source }))
    }

    /// Returns the value for ZK 4 or 5.
    pub const fn to_zk(self) -> u16 {
        let source = match self.source {
            Source::Master => 0,
            Source::Slave(number) => FROM_SLAVE | (number as u16 & 0x1F) << 8,
        };
        bits(self.word, self.channel, self.format) | source
    }
}

impl ActualMapping {
    /// Reads ZK 20 or 21. Returns `None` if bit 0 is clear: the card has no actual value then.
    ///
    /// # Errors
    /// [`MappingError`] if bit 0 is set but the mapping is wrong.
    pub fn from_zk(zk: u16) -> Result<Option<Self>, MappingError> {
        if zk & VALID == 0 {
            return Ok(None);
        }
        if zk & 0xFFA0 != 0 {
            return Err(MappingError::ReservedBits(zk & 0xFFA0));
        }
        let channel = channel(zk >> 3 & 3)?;
        let (word, format) = place(zk)?;
        Ok(Some(ActualMapping { word, channel, format }))
    }

    /// Reads ZK 25. Bit 6 must be 0, because the status word is no doubleword.
    ///
    /// # Errors
    /// [`MappingError`] as [`ActualMapping::from_zk`], and also if bit 6 is set.
    pub fn from_zk_25(zk: u16) -> Result<Option<Self>, MappingError> {
        if zk & VALID != 0 && zk & DOUBLEWORD != 0 {
            return Err(MappingError::ReservedBits(DOUBLEWORD));
        }
        Self::from_zk(zk)
    }

    /// Returns the value for ZK 20, 21 or 25.
    pub const fn to_zk(self) -> u16 {
        bits(self.word, self.channel, self.format)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Channel::{One, Two};
    use ParamFormat::{Doubleword, Word};

    #[test]
    fn zk_4_and_5_as_on_page_15() {
        let master = |word, channel, format| {
            Ok(Some(ReferenceMapping { word, channel, format, source: Source::Master }))
        };
        let slave = |n| {
            let source = Source::Slave(n);
            Ok(Some(ReferenceMapping { word: 0, channel: One, format: Word, source }))
        };
        for (zk, expected) in [
            (0x0000, Ok(None)),             // bit 0: not valid
            (0xFFFE, Ok(None)),             // without bit 0, no other bit matters
            (0x0001, master(0, One, Word)), // bits 2-1: start word
            (0x0003, master(1, One, Word)),
            (0x0005, master(2, One, Word)),
            (0x0007, master(3, One, Word)),
            (0x0009, master(0, Two, Word)), // bits 5-3: frame
            (0x0011, Err(MappingError::Frame(2))),
            (0x0019, Err(MappingError::Frame(3))),
            (0x0021, Err(MappingError::Frame(4))),
            (0x0039, Err(MappingError::Frame(7))),
            (0x0041, master(0, One, Doubleword)), // bit 6: format
            (0x0043, master(1, One, Doubleword)),
            (0x0045, master(2, One, Doubleword)),
            (0x0047, Err(MappingError::BeyondFrame)), // word 3: word format only
            (0x0081, slave(0)),                       // bit 7: from a slave, bits 12-8: which
            (0x0181, slave(1)),
            (0x1E81, slave(30)),
            (0x1F81, slave(31)),
            (0x1F01, master(0, One, Word)), // bits 12-8 have no meaning without bit 7
            (0x2001, Err(MappingError::ReservedBits(0x2000))), // bits 13-15: reserved
            (0x4001, Err(MappingError::ReservedBits(0x4000))),
            (0x8001, Err(MappingError::ReservedBits(0x8000))),
        ] {
            assert_eq!(ReferenceMapping::from_zk(zk), expected, "16#{zk:04X}");
        }
    }

    #[test]
    fn zk_20_and_21_as_on_page_16() {
        let at = |word, channel, format| Ok(Some(ActualMapping { word, channel, format }));
        for (zk, expected) in [
            (0x0000, Ok(None)),
            (0xFFFE, Ok(None)),
            (0x0001, at(0, One, Word)),
            (0x0003, at(1, One, Word)),
            (0x0005, at(2, One, Word)),
            (0x0007, at(3, One, Word)),
            (0x0009, at(0, Two, Word)),
            (0x0011, Err(MappingError::Frame(2))),
            (0x0019, Err(MappingError::Frame(3))),
            (0x0021, Err(MappingError::ReservedBits(0x0020))), // bit 5: reserved here
            (0x0041, at(0, One, Doubleword)),
            (0x004D, at(2, Two, Doubleword)),
            (0x0047, Err(MappingError::BeyondFrame)),
            (0x0081, Err(MappingError::ReservedBits(0x0080))),
            (0x8001, Err(MappingError::ReservedBits(0x8000))),
        ] {
            assert_eq!(ActualMapping::from_zk(zk), expected, "16#{zk:04X}");
        }
    }

    #[test]
    fn zk_25_as_on_page_17() {
        let at = |word, channel| Ok(Some(ActualMapping { word, channel, format: Word }));
        for (zk, expected) in [
            (0x0000, Ok(None)),
            (0x0040, Ok(None)),
            (0x0001, at(0, One)),
            (0x0005, at(2, One)),
            (0x000F, at(3, Two)),
            (0x0011, Err(MappingError::Frame(2))),
            (0x0041, Err(MappingError::ReservedBits(0x0040))), // bit 6: always a word
            (0x0101, Err(MappingError::ReservedBits(0x0100))),
        ] {
            assert_eq!(ActualMapping::from_zk_25(zk), expected, "16#{zk:04X}");
        }
    }

    #[test]
    fn every_valid_mapping_survives_a_round_trip() {
        for zk in 0..=u16::MAX {
            if let Ok(Some(mapping)) = ReferenceMapping::from_zk(zk) {
                let read_again = ReferenceMapping::from_zk(mapping.to_zk());
                assert_eq!(read_again, Ok(Some(mapping)), "16#{zk:04X}");
            }
            if let Ok(Some(mapping)) = ActualMapping::from_zk(zk) {
                assert_eq!(mapping.to_zk(), zk);
            }
        }
    }
}
