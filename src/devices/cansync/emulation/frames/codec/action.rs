//! The action command: one order of the master to any group of slaves. The slaves do not answer (manual
//! 5.00005.03a p. 138 and 162-163).

use super::CodecError;
use crate::can::Payload;
use crate::devices::cansync::frames::{Frame, FrameKind};
use crate::devices::cansync::registers::values::action_command;

/// An action command frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ActionCommand {
    /// SLAVE_GROUP: bit n concerns slave n, 0 to 31 (D-16).
    pub slave_group: u32,
    /// COMMAND, data byte 4.
    pub command: u8,
    /// DB, data byte 5.
    pub data_byte: u8,
    /// DW, data bytes 6 and 7.
    pub data_word: u16,
}

/// Order of an action command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Action {
    /// Command 16#01: take over this control word.
    ControlWord(u16),
    /// Command 16#02: SYNC mode on or off. Data byte 1 means on, any other value off.
    SyncMode(bool),
    /// Any other command. The application defines its meaning.
    Other,
}

impl ActionCommand {
    /// SLAVE_GROUP of a broadcast.
    pub const ALL_SLAVES: u32 = u32::MAX;

    /// Creates a command with a control word for every slave in `slave_group`.
    #[inline]
    pub const fn control_word(slave_group: u32, word: u16) -> Self {
        ActionCommand { slave_group, command: action_command::CONTROL_WORD, data_byte: 0, data_word: word }
    }

    /// Creates a command that switches the SYNC mode of every slave in `slave_group`.
    #[inline]
    pub const fn sync_mode(slave_group: u32, on: bool) -> Self {
        ActionCommand { slave_group, command: action_command::SYNC_MODE, data_byte: on as u8, data_word: 0 }
    }

    /// Returns true if the command addresses `slave`. Numbers above 31 have no bit.
    #[inline]
    pub const fn concerns(&self, slave: u8) -> bool {
        slave < 32 && self.slave_group >> slave & 1 != 0
    }

    /// Returns the order of the command.
    #[inline]
    pub const fn action(&self) -> Action {
        match self.command {
            action_command::CONTROL_WORD => Action::ControlWord(self.data_word),
            action_command::SYNC_MODE => Action::SyncMode(self.data_byte == 1),
            _ => Action::Other,
        }
    }

    /// Returns the frame, always with eight data bytes.
    #[inline]
    pub const fn frame(&self) -> Frame {
        let [a, b, c, d] = self.slave_group.to_le_bytes();
        let [low, high] = self.data_word.to_le_bytes();
        let bytes = [a, b, c, d, self.command, self.data_byte, low, high];
        Frame::of(FrameKind::Action, Payload::from_padded(bytes, 8))
    }

    /// Decodes the data field of an action command.
    ///
    /// Some commands have less data than others (p. 138), so bytes after the command byte may be missing. Missing bytes
    /// count as 0.
    ///
    /// # Errors
    /// [`CodecError::Length`] if the command byte is missing.
    #[inline]
    pub const fn decode(payload: &Payload) -> Result<Self, CodecError> {
        if payload.len() < 5 {
            return Err(CodecError::length("action command", payload, "5 to 8"));
        }
        let [a, b, c, d, command, data_byte, low, high] = payload.padded();
        Ok(ActionCommand {
            slave_group: u32::from_le_bytes([a, b, c, d]),
            command,
            data_byte,
            data_word: u16::from_le_bytes([low, high]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn control_word_for_slave_3_as_on_page_163() {
        let frame = ActionCommand::control_word(1 << 3, 0x000F).frame();
        assert_eq!(frame.id(), 0x010);
        assert_eq!(frame.data(), [0x08, 0, 0, 0, 0x01, 0, 0x0F, 0x00]);
    }

    #[test]
    fn sync_mode_to_all() {
        for on in [true, false] {
            let command = ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, on);
            assert_eq!(command.frame().data(), [0xFF, 0xFF, 0xFF, 0xFF, 0x02, u8::from(on), 0, 0]);
            assert_eq!(command.action(), Action::SyncMode(on));
        }
    }

    #[test]
    fn each_slave_has_a_separate_bit() {
        for slave in 0..32 {
            let command = ActionCommand::control_word(1 << slave, 0);
            assert!((0..=u8::MAX).all(|n| command.concerns(n) == (n == slave)));
        }
    }

    #[test]
    fn missing_data_counts_as_zero_but_the_command_byte_must_be_there() {
        let all = [1, 0, 0, 0, 0x80, 2, 3, 4];
        for len in 0..=8 {
            let decoded = ActionCommand::decode(&Payload::from_padded(all, len));
            match len {
                0..5 => assert!(matches!(decoded, Err(CodecError::Length { .. })), "{len}"),
                _ => assert_eq!(decoded.map(|c| c.command), Ok(0x80)),
            }
        }
        let five = ActionCommand::decode(&Payload::from_padded(all, 5)).unwrap();
        assert_eq!((five.data_byte, five.data_word, five.action()), (0, 0, Action::Other));
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn round_trip(slave_group: u32, command: u8, data_byte: u8, data_word: u16) {
            let sent = ActionCommand { slave_group, command, data_byte, data_word };
            prop_assert_eq!(ActionCommand::decode(sent.frame().payload()), Ok(sent));
        }
    }
}
