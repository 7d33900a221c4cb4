//! The RS 232 interface, while the program uses it (`SERIAL_MODE`). It transmits bytes in order, at 9600 baud
//! (p. 7, 112-114).

use crate::devices::cs0015::registers::CS0015_PERIPHERALS;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Maximum number of received bytes (p. 113), and of bytes to send (D-475).
const ROOM: usize = 1000;
/// Duration of a byte on the line, with start and stop bit, in us.
const BYTE_US: u64 = 1_042;

/// Results of `SERIAL_RX`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SerialByte {
    /// RX; 0 without a byte.
    pub byte: u8,
    /// AVAILABLE: number of remaining bytes.
    pub available: u16,
    /// True if OVERFLOW is set.
    pub has_overflowed: bool,
}

/// One direction of the serial line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Line {
    /// Number of transmitted bytes, wrapping.
    count: u32,
    /// End of the byte on the line, in microseconds; `None` if the line is idle.
    until: Option<u64>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Serial {
    received: VecDeque<u8>,
    has_overflowed: bool,
    to_send: VecDeque<u8>,
    inwards: Line,
    outwards: Line,
}

impl Serial {
    /// Handles power-on: bytes that the other end has sent before are lost.
    pub(crate) fn power_on(&mut self, registers: &CS0015_PERIPHERALS) {
        *self = Serial::default();
        self.inwards.count = registers.d_RS232_GIVEN.load();
    }

    /// Runs `SERIAL_TX` (p. 112). If there is no room for the byte, it is lost.
    pub(crate) fn send(&mut self, byte: u8) {
        if self.to_send.len() < ROOM {
            self.to_send.push_back(byte);
        }
    }

    /// Runs `SERIAL_RX` (p. 113).
    pub(crate) fn take(&mut self, is_clear: bool) -> SerialByte {
        if is_clear {
            self.received.clear();
            self.has_overflowed = false;
        }
        let byte = self.received.pop_front().unwrap_or(0);
        SerialByte { byte, available: self.pending(), has_overflowed: self.has_overflowed }
    }

    /// Runs `SERIAL_PENDING` (p. 114).
    pub(crate) fn pending(&self) -> u16 {
        self.received.len() as u16
    }

    /// Checks for bytes from the other end, and starts to send.
    pub(crate) fn look(&mut self, registers: &CS0015_PERIPHERALS, now: u64) {
        let is_given = registers.d_RS232_GIVEN.load() != self.inwards.count;
        if is_given && self.inwards.until.is_none() {
            self.inwards.until = Some(now + BYTE_US);
        }
        if !self.to_send.is_empty() && self.outwards.until.is_none() {
            self.outwards.until = Some(now + BYTE_US);
        }
    }

    /// Returns the time at which the next byte ends; `u64::MAX` if both lines are idle.
    pub(crate) fn next_time(&self) -> u64 {
        let of = |line: &Line| line.until.unwrap_or(u64::MAX);
        of(&self.inwards).min(of(&self.outwards))
    }

    /// Handles bytes that have ended. While the programming system uses the interface, received bytes are
    /// ignored.
    pub(crate) fn due(&mut self, registers: &CS0015_PERIPHERALS, is_programs: bool, now: u64) {
        if self.inwards.until.take_if(|until| *until <= now).is_some() {
            let ring = &registers.a_RS232_GIVEN;
            let given = registers.d_RS232_GIVEN.load();
            // Overwritten bytes are lost.
            if given.wrapping_sub(self.inwards.count) as usize > ring.len() {
                self.inwards.count = given.wrapping_sub(ring.len() as u32);
            }
            let byte = ring[self.inwards.count as usize % ring.len()].load();
            self.inwards.count = self.inwards.count.wrapping_add(1);
            match is_programs {
                true if self.received.len() < ROOM => self.received.push_back(byte),
                true => self.has_overflowed = true,
                false => {}
            }
        }
        if self.outwards.until.take_if(|until| *until <= now).is_some()
            && let Some(byte) = self.to_send.pop_front()
        {
            let ring = &registers.a_RS232_SENT;
            ring[self.outwards.count as usize % ring.len()].store(byte);
            self.outwards.count = self.outwards.count.wrapping_add(1);
            registers.d_RS232_SENT.store(self.outwards.count);
        }
        self.look(registers, now);
    }
}
