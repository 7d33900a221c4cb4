//! FB4: orders by the Communication Window (p. 38-49, 77-81).

use super::Peripherals;
use crate::plc::{Shared, function_block};

/// Octets of a window.
pub(super) const WINDOW: usize = 16;

/// The loop counter.
const COUNTER: usize = 13;

/// The command that reads a frame (p. 42).
const RECEIVE: u8 = 3;

/// Stands in place of an identifier while nothing has come (p. 41).
const NOTHING: [u8; 2] = [0xEE; 2];

/// There is no window at one of the addresses; ours.
const NO_WINDOW: u16 = 1;

/// A transfer.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    /// The counter that it waits for.
    waits_for: Option<u8>,
    /// It is over, and FREIGABE has not been taken away since.
    is_over: bool,
    /// The counter of a command 3 that has brought nothing yet: what comes is shown under it.
    reads: Option<u8>,
}

impl Transfer {
    /// A call: the window that came back for `order`, once. The order is given with the next counter; `Err` if there is no window there.
    pub(super) fn call(
        &mut self,
        peripherals: &mut Peripherals,
        (write, read): (u16, u16),
        mut order: [u8; WINDOW],
    ) -> Result<Option<[u8; WINDOW]>, ()> {
        let window: [u8; WINDOW] = peripherals.read(read).ok_or(())?;
        match self.waits_for {
            Some(counter) if counter == window[COUNTER] => self.waits_for = None,
            Some(_) => return Ok(None),
            // Another order would drop what has come meanwhile.
            None if order[WINDOW - 1] == RECEIVE && self.reads == Some(window[COUNTER]) => {}
            None => {
                order[COUNTER] = window[COUNTER].wrapping_add(1);
                if !peripherals.write(write, &order) {
                    return Err(());
                }
                self.waits_for = Some(order[COUNTER]);
                return Ok(None);
            }
        }
        let has_nothing = order[WINDOW - 1] == RECEIVE && window.starts_with(&NOTHING);
        self.reads = has_nothing.then_some(window[COUNTER]);
        Ok(Some(window))
    }
}

function_block! {
    /// Gives one order by the Communication Window and fetches what it shows (p. 78-81). One pulse of FREIGABE is one transfer.
    pub struct FB4(peripherals: Shared<Peripherals>) {
        in {
            /// Begins a transfer; FALSE: the next one can begin.
            FREIGABE: bool;
            /// Gives the order; FALSE: an order that does nothing.
            WRITE_ENABLE: bool;
            /// Fetches what comes back.
            READ_ENABLE: bool;
            /// Identifier, of 11 bits.
            WRITE_CAN_ID: u16;
            /// Data.
            WRITE_DATA0: u8;
            /// Data.
            WRITE_DATA1: u8;
            /// Data.
            WRITE_DATA2: u8;
            /// Data.
            WRITE_DATA3: u8;
            /// Data.
            WRITE_DATA4: u8;
            /// Data.
            WRITE_DATA5: u8;
            /// Data.
            WRITE_DATA6: u8;
            /// Data.
            WRITE_DATA7: u8;
            /// How many bytes are sent.
            WRITE_LEN: u8;
            /// Always 0.
            WRITE_SUBCOMMAND: u8;
            /// Command, p. 42.
            WRITE_COMMAND: u8;
            /// First output of the window.
            WRITE_ADDRESS: u16;
            /// First input of the window.
            READ_ADDRESS: u16;
        }
        out {
            /// The transfer is over.
            TRANSFER_READY: bool;
            /// Identifier; 16#EEEE: nothing has come.
            READ_CAN_ID: u16;
            /// Data.
            READ_DATA0: u8;
            /// Data.
            READ_DATA1: u8;
            /// Data.
            READ_DATA2: u8;
            /// Data.
            READ_DATA3: u8;
            /// Data.
            READ_DATA4: u8;
            /// Data.
            READ_DATA5: u8;
            /// Data.
            READ_DATA6: u8;
            /// Data.
            READ_DATA7: u8;
            /// How many bytes have come.
            READ_LEN: u8;
            /// Octet 14 of the window, by its name in the example of p. 79; by p. 41 the sub-command that comes back.
            READ_FIFO_COUNT: u8;
            /// Octet 15 of the window, by its name in the example of p. 79; by p. 41 an error code that is always 0.
            READ_COMMAND: u8;
            /// 0: good; 1: there is no window at READ_ADDRESS (D-469).
            READ_RET_VAL: u16;
            /// 0: good; 1: there is no window at WRITE_ADDRESS (D-469).
            WRITE_RET_VAL: u16;
        }
        internal: Transfer;
    }
}

impl FB4 {
    /// One PLC cycle.
    pub fn call(&mut self, peripherals: &mut Peripherals) {
        if !self.FREIGABE {
            self.TRANSFER_READY = false;
            (self.internal.waits_for, self.internal.is_over) = (None, false);
            return;
        }
        if self.internal.is_over {
            return;
        }
        let [high, low] = self.WRITE_CAN_ID.to_be_bytes();
        let order = [
            high,
            low,
            0,
            0,
            self.WRITE_DATA0,
            self.WRITE_DATA1,
            self.WRITE_DATA2,
            self.WRITE_DATA3,
            self.WRITE_DATA4,
            self.WRITE_DATA5,
            self.WRITE_DATA6,
            self.WRITE_DATA7,
            self.WRITE_LEN,
            0,
            self.WRITE_SUBCOMMAND,
            self.WRITE_COMMAND,
        ];
        let order = if self.WRITE_ENABLE { order } else { [0; WINDOW] };
        let has_inputs = peripherals.read::<WINDOW>(self.READ_ADDRESS).is_some();
        let answer = self.internal.call(peripherals, (self.WRITE_ADDRESS, self.READ_ADDRESS), order);
        let is_wrong = answer.is_err();
        self.READ_RET_VAL = if has_inputs { 0 } else { NO_WINDOW };
        self.WRITE_RET_VAL = if is_wrong && has_inputs { NO_WINDOW } else { 0 };
        let Ok(Some(window)) = answer else {
            self.internal.is_over = is_wrong;
            self.TRANSFER_READY = is_wrong;
            return;
        };
        (self.internal.is_over, self.TRANSFER_READY) = (true, true);
        if self.READ_ENABLE {
            let [id0, id1, _, _, d0, d1, d2, d3, d4, d5, d6, d7, length, _, fourteen, fifteen] = window;
            self.READ_CAN_ID = u16::from_be_bytes([id0, id1]);
            (self.READ_DATA0, self.READ_DATA1, self.READ_DATA2, self.READ_DATA3) = (d0, d1, d2, d3);
            (self.READ_DATA4, self.READ_DATA5, self.READ_DATA6, self.READ_DATA7) = (d4, d5, d6, d7);
            (self.READ_LEN, self.READ_FIFO_COUNT, self.READ_COMMAND) = (length, fourteen, fifteen);
        }
    }
}
