//! FB4: orders over the Communication Window (p. 38-49, 77-81).

use super::Peripherals;
use crate::plc::{Shared, function_block};

/// Number of octets of a window.
pub(super) const WINDOW: usize = 16;

/// Position of the loop counter in the window.
const COUNTER: usize = 13;

/// The command that reads a frame (p. 42).
const RECEIVE: u8 = 3;

/// Value in the window instead of an identifier while no frame is received (p. 41).
const NOTHING: [u8; 2] = [0xEE; 2];

/// No window exists at one of the addresses; defined by commram.
const NO_WINDOW: u16 = 1;

/// An order over the window.
#[derive(Clone, Debug, Default)]
pub(super) struct Transfer {
    /// Counter of the expected answer.
    waits_for: Option<u8>,
    /// Counter of a command 3 that has not returned a frame yet. The window will show the next frame with
    /// this counter.
    reads: Option<u8>,
    /// A frame that the window has shown with a delay, and that the block has not returned yet.
    found: Option<[u8; WINDOW]>,
}

impl Transfer {
    /// Stops waiting for the answer of the gateway.
    fn abandon(&mut self) {
        self.waits_for = None;
    }

    /// Keeps a frame that the window has shown with a delay as the answer to a command 3. Otherwise the next
    /// order would overwrite the frame.
    fn look(&mut self, window: [u8; WINDOW]) {
        if self.reads == Some(window[COUNTER]) && !window.starts_with(&NOTHING) {
            (self.found, self.reads) = (Some(window), None);
        }
    }

    /// Continues an order in one cycle. Writes the order with the next counter, and returns the window once when it
    /// contains the answer. Returns `Err` if no window exists at the addresses.
    pub(super) fn call(
        &mut self,
        peripherals: &mut Peripherals,
        (write, read): (u16, u16),
        mut order: [u8; WINDOW],
    ) -> Result<Option<[u8; WINDOW]>, ()> {
        let window: [u8; WINDOW] = peripherals.read(read).ok_or(())?;
        self.look(window);
        let is_reading = order[WINDOW - 1] == RECEIVE;
        match self.waits_for {
            Some(counter) if counter == window[COUNTER] => self.waits_for = None,
            Some(_) => return Ok(None),
            None if is_reading && self.found.is_some() => return Ok(self.found.take()),
            None => {
                order[COUNTER] = window[COUNTER].wrapping_add(1);
                if !peripherals.write(write, &order) {
                    return Err(());
                }
                self.waits_for = Some(order[COUNTER]);
                return Ok(None);
            }
        }
        let has_nothing = window.starts_with(&NOTHING);
        self.reads = (is_reading && has_nothing).then_some(window[COUNTER]);
        if !is_reading {
            return Ok(Some(window));
        }
        // The delayed frame is older than the answer, so it is returned first.
        let first = self.found.take();
        if first.is_some() && !has_nothing {
            self.found = Some(window);
        }
        Ok(Some(first.unwrap_or(window)))
    }
}

/// Step of an FB4 transfer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum TransferStep {
    /// The block writes the order into the window.
    #[default]
    Write,
    /// The block reads a received frame from the window.
    Read,
    /// Waits until FREIGABE is FALSE.
    Over,
}

/// State of the block during a pulse of FREIGABE.
#[derive(Clone, Debug, Default)]
pub struct Pulse {
    step: TransferStep,
    transfer: Transfer,
}

function_block! {
    /// Sends an order over the Communication Window, then reads a frame by command 3 (p. 77-80). One pulse of FREIGABE
    /// is one transfer.
    pub struct FB4(peripherals: Shared<Peripherals>) {
        in {
            /// TRUE starts a transfer. The next transfer can start when the value has been FALSE in between.
            FREIGABE: bool;
            /// Sends the order of WRITE_COMMAND.
            WRITE_ENABLE: bool;
            /// Reads a frame after the order, by command 3, which the block issues itself.
            READ_ENABLE: bool;
            /// Identifier, of 11 bits.
            WRITE_CAN_ID: u16;
            /// Data byte 0 of the order.
            WRITE_DATA0: u8;
            /// Data byte 1 of the order.
            WRITE_DATA1: u8;
            /// Data byte 2 of the order.
            WRITE_DATA2: u8;
            /// Data byte 3 of the order.
            WRITE_DATA3: u8;
            /// Data byte 4 of the order.
            WRITE_DATA4: u8;
            /// Data byte 5 of the order.
            WRITE_DATA5: u8;
            /// Data byte 6 of the order.
            WRITE_DATA6: u8;
            /// Data byte 7 of the order.
            WRITE_DATA7: u8;
            /// Number of bytes to send.
            WRITE_LEN: u8;
            /// Sub-command of the order, always 0.
            WRITE_SUBCOMMAND: u8;
            /// Command of the order, p. 42.
            WRITE_COMMAND: u8;
            /// First output of the window.
            WRITE_ADDRESS: u16;
            /// First input of the window.
            READ_ADDRESS: u16;
        }
        out {
            /// The transfer is over.
            TRANSFER_READY: bool;
            /// Identifier; 16#EEEE: no frame received.
            READ_CAN_ID: u16;
            /// Data byte 0 of the received frame.
            READ_DATA0: u8;
            /// Data byte 1 of the received frame.
            READ_DATA1: u8;
            /// Data byte 2 of the received frame.
            READ_DATA2: u8;
            /// Data byte 3 of the received frame.
            READ_DATA3: u8;
            /// Data byte 4 of the received frame.
            READ_DATA4: u8;
            /// Data byte 5 of the received frame.
            READ_DATA5: u8;
            /// Data byte 6 of the received frame.
            READ_DATA6: u8;
            /// Data byte 7 of the received frame.
            READ_DATA7: u8;
            /// Number of received bytes.
            READ_LEN: u8;
            /// Octet 14 of the window, by its name in the example of p. 79; according to p. 41 the returned sub-command.
            READ_FIFO_COUNT: u8;
            /// Octet 15 of the window, by its name in the example of p. 79; according to p. 41 an error code that is always 0.
            READ_COMMAND: u8;
            /// 0: good; 1: no window at READ_ADDRESS (D-469).
            READ_RET_VAL: u16;
            /// 0: good; 1: no window at WRITE_ADDRESS (D-469).
            WRITE_RET_VAL: u16;
        }
        internal: Pulse;
    }
}

impl FB4 {
    /// Runs one PLC cycle.
    pub fn call(&mut self, peripherals: &mut Peripherals) {
        if !self.FREIGABE {
            self.TRANSFER_READY = false;
            self.internal.step = TransferStep::Write;
            self.internal.transfer.abandon();
            return;
        }
        if self.internal.step == TransferStep::Write {
            self.write(peripherals);
        }
        if self.internal.step == TransferStep::Read {
            self.read(peripherals);
        }
        self.TRANSFER_READY = self.internal.step == TransferStep::Over;
    }

    /// Writes the order, unless the transfer only reads.
    fn write(&mut self, peripherals: &mut Peripherals) {
        let only_reads = self.READ_ENABLE && (!self.WRITE_ENABLE || self.WRITE_COMMAND == RECEIVE);
        if only_reads {
            self.internal.step = TransferStep::Read;
            return;
        }
        let order = if self.WRITE_ENABLE { self.order(self.WRITE_COMMAND) } else { [0; WINDOW] };
        if self.transfer(peripherals, order).is_some() {
            self.internal.step = if self.READ_ENABLE { TransferStep::Read } else { TransferStep::Over };
        }
    }

    /// Reads a received frame from the window.
    fn read(&mut self, peripherals: &mut Peripherals) {
        let Some(window) = self.transfer(peripherals, self.order(RECEIVE)) else { return };
        let [id0, id1, _, _, d0, d1, d2, d3, d4, d5, d6, d7, length, _, fourteen, fifteen] = window;
        self.READ_CAN_ID = u16::from_be_bytes([id0, id1]);
        (self.READ_DATA0, self.READ_DATA1, self.READ_DATA2, self.READ_DATA3) = (d0, d1, d2, d3);
        (self.READ_DATA4, self.READ_DATA5, self.READ_DATA6, self.READ_DATA7) = (d4, d5, d6, d7);
        (self.READ_LEN, self.READ_FIFO_COUNT, self.READ_COMMAND) = (length, fourteen, fifteen);
        self.internal.step = TransferStep::Over;
    }

    /// Continues an order in one cycle, and returns the window once when it contains the answer. If no window
    /// exists at the addresses, ends the transfer.
    fn transfer(&mut self, peripherals: &mut Peripherals, order: [u8; WINDOW]) -> Option<[u8; WINDOW]> {
        let has_inputs = peripherals.read::<WINDOW>(self.READ_ADDRESS).is_some();
        let addresses = (self.WRITE_ADDRESS, self.READ_ADDRESS);
        let answer = self.internal.transfer.call(peripherals, addresses, order);
        self.READ_RET_VAL = if has_inputs { 0 } else { NO_WINDOW };
        self.WRITE_RET_VAL = if answer.is_err() && has_inputs { NO_WINDOW } else { 0 };
        if answer.is_err() {
            self.internal.step = TransferStep::Over;
        }
        answer.unwrap_or(None)
    }

    /// Returns the order from the pins with this command.
    fn order(&self, command: u8) -> [u8; WINDOW] {
        let [high, low] = self.WRITE_CAN_ID.to_be_bytes();
        [
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
            command,
        ]
    }
}
