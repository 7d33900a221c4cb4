//! `SERIAL_3964R`: a partner of the procedure 3964R at the RS485 port (decision D-869).

use super::serial_ring::{drop_received, put, take};
use crate::devices::omega_drive_line_2::registers::SERIAL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{serial_parity, serial_status};
use crate::plc::{Base, function_block};
use crate::serial::procedure_3964r::{Event, Priority, Procedure, ProcedureError, Settings};
use std::collections::VecDeque;

/// Number of octets of the longest block.
pub const SERIAL_OCTETS: usize = 1024;

/// The data of a block.
pub type SERIAL_BMARRAY = [u8; SERIAL_OCTETS];

function_block! {
    /// Sends and receives blocks by the procedure 3964R (manual p. 9, 26; pins: decision D-869).
    ///
    /// The program switches the port on before the first call. Call the block in an event task of a timer.
    pub struct SERIAL_3964R(_BASE: Base<SERIAL_BMSTRUCT>) {
        in {
            /// TRUE lets the block take part. FALSE ends a transmission and clears the outputs.
            x_EN: bool;
            /// TRUE: high priority. The partner has the other priority. Takes effect at a rising edge of `x_EN`.
            x_HIGH: bool;
            /// FALSE: the procedure 3964, without check sum. Takes effect at a rising edge of `x_EN`.
            x_BCC: bool = true;
            /// A rising edge sends the block in `a_SEND`.
            x_SEND: bool;
            /// Number of octets to send, 1 to 1024.
            u_SEND: u16;
            /// A rising edge reports that the program has taken the received block.
            x_TAKEN: bool;
        }
        out {
            /// A block is being sent.
            x_BUSY: bool;
            /// The partner has acknowledged the last block.
            x_SENT: bool;
            /// A received block is in `a_RECEIVED`.
            x_RECEIVED: bool;
            /// Number of octets in `a_RECEIVED`.
            u_RECEIVED: u16;
            /// Error of the last transmission, or 0.
            b_ERR_SEND: u8;
            /// Error of the last reception, or 0.
            b_ERR_RECEIVE: u8;
        }
        in_out {
            a_SEND: SERIAL_BMARRAY;
            a_RECEIVED: SERIAL_BMARRAY;
        }
        internal: Partner;
    }
}

/// State of the block between two calls.
#[derive(Clone, Debug, Default)]
pub struct Partner {
    procedure: Option<Procedure>,
    /// Characters for which the ring of the port has no room yet.
    waiting: VecDeque<u8>,
    was_send: bool,
    was_taken: bool,
}

/// Number of an error at an output of the block.
const fn number(error: ProcedureError) -> u8 {
    match error {
        ProcedureError::NoConnection => 1,
        ProcedureError::NotAcknowledged => 2,
        ProcedureError::Break => 3,
        ProcedureError::CharacterDelay => 4,
        ProcedureError::DamagedCharacter => 5,
        ProcedureError::WrongEscape(_) => 6,
        ProcedureError::CheckSum { .. } => 7,
        ProcedureError::Empty => 8,
        ProcedureError::TooLong(_) => 9,
        ProcedureError::NoBuffer => 10,
        ProcedureError::NotRepeated => 11,
        ProcedureError::Unexpected => 12,
    }
}

impl SERIAL_3964R {
    /// Runs one PLC cycle.
    pub fn call(
        &mut self,
        _BASE: &Base<SERIAL_BMSTRUCT>,
        a_SEND: &SERIAL_BMARRAY,
        a_RECEIVED: &mut SERIAL_BMARRAY,
    ) {
        let is_ready = _BASE.w_STATUS.load() & serial_status::READY != 0;
        if !self.x_EN || !is_ready {
            return self.reset(_BASE);
        }
        let mut procedure =
            self.internal.procedure.take().unwrap_or_else(|| Procedure::new(self.settings(_BASE)));
        let (starts, is_taken) =
            (self.x_SEND && !self.internal.was_send, self.x_TAKEN && !self.internal.was_taken);
        (self.internal.was_send, self.internal.was_taken) = (self.x_SEND, self.x_TAKEN);
        if is_taken {
            self.x_RECEIVED = false;
        }
        procedure.pause_reception(self.x_RECEIVED);
        if starts && !procedure.is_sending() {
            self.start(&mut procedure, a_SEND);
        }
        let now = _BASE.ram().exact_us();
        while let Some(character) = take(_BASE) {
            procedure.received(now, character);
        }
        self.internal.waiting.extend(procedure.poll(now));
        put(_BASE, &mut self.internal.waiting);
        while let Some(event) = procedure.next_event() {
            self.show(event, a_RECEIVED);
        }
        self.x_BUSY = procedure.is_sending();
        self.internal.procedure = Some(procedure);
    }

    /// Ends a transmission, clears the outputs, and drops received characters.
    fn reset(&mut self, _BASE: &Base<SERIAL_BMSTRUCT>) {
        self.internal = Partner { was_send: self.x_SEND, was_taken: self.x_TAKEN, ..Partner::default() };
        (self.x_BUSY, self.x_SENT, self.x_RECEIVED, self.u_RECEIVED) = (false, false, false, 0);
        (self.b_ERR_SEND, self.b_ERR_RECEIVE) = (0, 0);
        drop_received(_BASE);
    }

    /// Returns the settings of the procedure for the settings of the port.
    fn settings(&self, _BASE: &Base<SERIAL_BMSTRUCT>) -> Settings {
        let parity = u64::from(_BASE.b_PARITY.load() != serial_parity::NONE);
        let bits = 1 + u64::from(_BASE.us_DATA_BITS.load()) + parity + u64::from(_BASE.us_STOP_BITS.load());
        let character_time = (bits * 1_000_000).div_ceil(u64::from(_BASE.u_BAUD_RATE.load()).max(1));
        let priority = if self.x_HIGH { Priority::High } else { Priority::Low };
        if self.x_BCC {
            Settings::new(priority, character_time)
        } else {
            Settings::without_check_sum(priority, character_time)
        }
    }

    fn start(&mut self, procedure: &mut Procedure, a_SEND: &SERIAL_BMARRAY) {
        let length = usize::from(self.u_SEND);
        self.x_SENT = false;
        let error = match a_SEND.get(..length) {
            Some([]) => Some(ProcedureError::Empty),
            Some(block) => procedure.send(block).err().map(|_| ProcedureError::TooLong(SERIAL_OCTETS)),
            None => Some(ProcedureError::TooLong(SERIAL_OCTETS)),
        };
        self.b_ERR_SEND = error.map_or(0, number);
    }

    fn show(&mut self, event: Event, a_RECEIVED: &mut SERIAL_BMARRAY) {
        match event {
            Event::Sent => self.x_SENT = true,
            Event::SendFailed(error) => self.b_ERR_SEND = number(error),
            Event::ReceiveFailed(error) => self.b_ERR_RECEIVE = number(error),
            Event::Received(block) => {
                // The procedure permits at most as many octets as the array has.
                a_RECEIVED.iter_mut().zip(&block).for_each(|(octet, received)| *octet = *received);
                (self.x_RECEIVED, self.u_RECEIVED, self.b_ERR_RECEIVE) = (true, block.len() as u16, 0);
            }
        }
    }
}
