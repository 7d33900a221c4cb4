//! FB1: initialises a CANopen device by a list of SDOs, over the Communication Window (p. 76-77, 83-86).

use super::fb4::{Transfer, WINDOW};
use super::{DataBlocks, Peripherals};
use crate::plc::{Shared, function_block};

/// Values of `ret_value` (D-469).
pub mod initialisation {
    /// The input `transfer` is FALSE.
    pub const OFF: u16 = 0;
    /// The list is finished.
    pub const DONE: u16 = 1;
    /// The list, the window or a data block does not exist.
    pub const NO_LIST: u16 = 2;
    /// The device has refused an entry. The result is this value plus the number of the entry, from 0.
    pub const REFUSED: u16 = 0x8000;
    /// The block is running (p. 77).
    pub const RUNS: u16 = 0xFFFF;
}

/// Number of bytes of an entry, and the index that ends the list (p. 85).
const ENTRY: usize = 10;
const END: u16 = 0xEEEE;

/// Operation of an entry: domain download, domain upload (p. 84).
const WRITE: u8 = 1;
const READ: u8 = 2;

/// Commands of the window (p. 42).
const SEND: u8 = 1;
const RECEIVE: u8 = 3;
const ENABLE: u8 = 4;
const DISABLE: u8 = 5;

/// Step of an initialisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum InitialisationStep {
    /// Enables the answers of the device.
    #[default]
    Enable,
    /// Sends the request for an entry of the list.
    Request,
    /// Waits for the answer.
    Answer,
    /// Disables the answers of the device. The block then ends with this result.
    Disable(u16),
    /// Waits until `transfer` is FALSE.
    Over,
}

/// Progress of a list.
#[derive(Clone, Debug, Default)]
pub struct List {
    step: InitialisationStep,
    entry: u16,
    transfer: Transfer,
}

function_block! {
    /// Initialises a CANopen device by the list at `offset` of `init_db` (p. 76). If an entry reads data, the
    /// block stores the data in the entry, high byte first, in the same form as data to write. Other users of
    /// the window must wait until the block has finished.
    pub struct FB1(data_blocks: Shared<DataBlocks>, peripherals: Shared<Peripherals>) {
        in {
            /// TRUE starts the initialisation; FALSE ends it.
            transfer: bool;
            /// Identifier of requests, 16#600 + number of the device.
            tx_id: u16;
            /// Identifier of answers, 16#580 + number of the device.
            rx_id: u16;
            /// First output of the Communication Window.
            write_address_cw: u16;
            /// First input of the Communication Window.
            read_address_cw: u16;
            /// Number of the data block with the list.
            init_db: u16;
            /// First byte of the list in the data block.
            offset: u16;
        }
        out {
            /// Result, as in the module `initialisation`: 16#FFFF while the block runs, 1 when it has finished.
            ret_value: u16;
        }
        internal: List;
    }
}

/// Returns an order for the window.
fn order(id: u16, command: u8, data: &[u8]) -> [u8; WINDOW] {
    let mut order = [0; WINDOW];
    order[..2].copy_from_slice(&id.to_be_bytes());
    order[4..12].iter_mut().zip(data).for_each(|(to, from)| *to = *from);
    (order[12], order[15]) = (data.len() as u8, command);
    order
}

/// Returns the SDO request of an entry; `None` if the entry is not valid.
fn request(entry: [u8; ENTRY]) -> Option<[u8; 8]> {
    let [high, low, sub, ccs, length, data @ .., _] = entry;
    let mut sdo = [0, low, high, sub, 0, 0, 0, 0];
    match (ccs, length) {
        (READ, _) => sdo[0] = 0x40,
        (WRITE, 1..=4) => {
            sdo[0] = 0x23 | (4 - length) << 2;
            let bytes = data[..length.into()].iter().rev();
            sdo[4..].iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        }
        _ => return None,
    }
    Some(sdo)
}

impl FB1 {
    fn place(&self) -> usize {
        usize::from(self.offset) + ENTRY * usize::from(self.internal.entry)
    }

    /// Runs one PLC cycle.
    pub fn call(&mut self, data_blocks: &mut DataBlocks, peripherals: &mut Peripherals) {
        if !self.transfer {
            (self.ret_value, self.internal) = (initialisation::OFF, List::default());
            return;
        }
        if self.internal.step == InitialisationStep::Over {
            return;
        }
        self.ret_value = initialisation::RUNS;
        let next = match self.internal.step {
            InitialisationStep::Enable => Some(order(self.rx_id, ENABLE, &[])),
            InitialisationStep::Disable(_) | InitialisationStep::Over => {
                Some(order(self.rx_id, DISABLE, &[]))
            }
            InitialisationStep::Answer => Some(order(self.rx_id, RECEIVE, &[])),
            InitialisationStep::Request if data_blocks.word(self.init_db, self.place()) == Some(END) => {
                self.internal.step = InitialisationStep::Disable(initialisation::DONE);
                return;
            }
            InitialisationStep::Request => {
                let entry = data_blocks.read(self.init_db, self.place());
                entry.and_then(request).map(|sdo| order(self.tx_id, SEND, &sdo))
            }
        };
        let addresses = (self.write_address_cw, self.read_address_cw);
        let answer = next.map_or(Err(()), |next| self.internal.transfer.call(peripherals, addresses, next));
        match answer {
            Err(()) => self.end(initialisation::NO_LIST),
            Ok(None) => {}
            Ok(Some(window)) => self.done(window, data_blocks),
        }
    }

    fn end(&mut self, result: u16) {
        (self.ret_value, self.internal.step) = (result, InitialisationStep::Over);
    }

    /// Continues after the window has carried out an order.
    fn done(&mut self, window: [u8; WINDOW], data_blocks: &mut DataBlocks) {
        let id = u16::from_be_bytes([window[0], window[1]]);
        match self.internal.step {
            InitialisationStep::Enable => self.internal.step = InitialisationStep::Request,
            InitialisationStep::Request => self.internal.step = InitialisationStep::Answer,
            InitialisationStep::Answer if id == self.rx_id => {
                let &[_, _, _, _, command, _, _, _, data @ .., _, _, _, _] = &window;
                let is_good = match command {
                    0x60 => true,
                    0x40..=0x5F => self.store(command, data, data_blocks),
                    _ => false,
                };
                self.internal.step = if is_good {
                    self.internal.entry += 1;
                    InitialisationStep::Request
                } else {
                    InitialisationStep::Disable(initialisation::REFUSED | self.internal.entry)
                };
            }
            InitialisationStep::Answer => {}
            InitialisationStep::Disable(result) => self.end(result),
            InitialisationStep::Over => {}
        }
    }

    /// Stores data that were read in the list.
    fn store(&self, command: u8, data: [u8; 4], data_blocks: &mut DataBlocks) -> bool {
        // An entry has room for the data only if the transfer is expedited and gives the length of the data.
        if command & 0x03 != 0x03 {
            return false;
        }
        let length = 4 - usize::from(command >> 2 & 0x03);
        let mut bytes = [0; 5];
        bytes[0] = length as u8;
        let read = data[..length].iter().rev();
        bytes[1..].iter_mut().zip(read).for_each(|(to, from)| *to = *from);
        data_blocks.write(self.init_db, self.place() + 4, &bytes)
    }
}
