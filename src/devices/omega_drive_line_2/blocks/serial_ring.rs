//! The rings of characters of the RS485 port, as function blocks use them.

use crate::devices::omega_drive_line_2::registers::SERIAL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::serial_received;
use crate::plc::Base;
use crate::serial::{Character, CharacterError};
use std::collections::VecDeque;

/// Number of characters in a ring of the port.
const RING: u16 = 256;

/// Takes the next received character from the ring of the port.
pub(super) fn take(_BASE: &Base<SERIAL_BMSTRUCT>) -> Option<Character> {
    let tail = _BASE.u_RX_TAIL.load();
    if tail == _BASE.u_RX_HEAD.load() {
        return None;
    }
    let word = _BASE.a_RX[usize::from(tail % RING)].load();
    _BASE.u_RX_TAIL.store(tail.wrapping_add(1));
    let errors = [
        (serial_received::BREAK, CharacterError::Break),
        (serial_received::FRAMING, CharacterError::Framing),
        (serial_received::PARITY, CharacterError::Parity),
        (serial_received::OVERRUN, CharacterError::Overrun),
    ];
    let error = errors.into_iter().find(|(bit, _)| word & bit != 0);
    Some(error.map_or(Character::Byte((word & 0xFF) as u8), |(_, error)| Character::Error(error)))
}

/// Puts characters into the ring of the port, as many as it has room for.
pub(super) fn put(_BASE: &Base<SERIAL_BMSTRUCT>, waiting: &mut VecDeque<u8>) {
    let mut head = _BASE.u_TX_HEAD.load();
    while head.wrapping_sub(_BASE.u_TX_TAIL.load()) < RING
        && let Some(octet) = waiting.pop_front()
    {
        _BASE.a_TX[usize::from(head % RING)].store(octet.into());
        head = head.wrapping_add(1);
    }
    _BASE.u_TX_HEAD.store(head);
}

/// Drops the received characters.
pub(super) fn drop_received(_BASE: &Base<SERIAL_BMSTRUCT>) {
    _BASE.u_RX_TAIL.store(_BASE.u_RX_HEAD.load());
}
