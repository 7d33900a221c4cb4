//! FB1: initialises a CANopen device by a list of SDOs, by the Communication Window (p. 76-77, 83-86).

use super::fb4::{Transfer, WINDOW};
use super::{DataBlocks, Peripherals};
use crate::plc::{Shared, function_block};

/// Values of `ret_value` (D-469).
pub mod initialisation {
    /// `transfer` is FALSE.
    pub const OFF: u16 = 0;
    /// The list is through.
    pub const DONE: u16 = 1;
    /// The list, a window or a data block is not there.
    pub const NO_LIST: u16 = 2;
    /// The device has refused the entry of this number, from 0, added to it.
    pub const REFUSED: u16 = 0x8000;
    /// It runs (p. 77).
    pub const RUNS: u16 = 0xFFFF;
}

/// Bytes of an entry, and the index behind the last one (p. 85).
const ENTRY: usize = 10;
const END: u16 = 0xEEEE;

/// What an entry does: domain download, domain upload (p. 84).
const WRITE: u8 = 1;
const READ: u8 = 2;

/// Commands of the window (p. 42).
const SEND: u8 = 1;
const RECEIVE: u8 = 3;
const ENABLE: u8 = 4;
const DISABLE: u8 = 5;

/// What is under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    /// The answers of the device are enabled.
    #[default]
    Enable,
    /// A request goes out.
    Request,
    /// Its answer is looked for.
    Answer,
    /// The answers are disabled, with this result.
    Disable(u16),
    /// `transfer` has to become FALSE.
    Over,
}

/// Where a list is.
#[derive(Clone, Debug, Default)]
pub struct List {
    step: Step,
    entry: u16,
    transfer: Transfer,
}

function_block! {
    /// Initialises a CANopen device by the list at `offset` of `init_db` (p. 76). Data that it reads stand in the list afterwards, high byte
    /// first, as those that it writes. Other users of the window have to wait until it is through.
    pub struct FB1(data_blocks: Shared<DataBlocks>, peripherals: Shared<Peripherals>) {
        in {
            /// Begins; FALSE: ends.
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
            /// First byte of the list in it.
            offset: u16;
        }
        out {
            /// As `initialisation` has it: 16#FFFF while it runs, 1 when it is through.
            ret_value: u16;
        }
        internal: List;
    }
}

/// An order of the window.
fn order(id: u16, command: u8, data: &[u8]) -> [u8; WINDOW] {
    let mut order = [0; WINDOW];
    order[..2].copy_from_slice(&id.to_be_bytes());
    order[4..12].iter_mut().zip(data).for_each(|(to, from)| *to = *from);
    (order[12], order[15]) = (data.len() as u8, command);
    order
}

/// The SDO that an entry asks for; none if it is no entry.
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

    /// One PLC cycle.
    pub fn call(&mut self, data_blocks: &mut DataBlocks, peripherals: &mut Peripherals) {
        if !self.transfer {
            (self.ret_value, self.internal) = (initialisation::OFF, List::default());
            return;
        }
        if self.internal.step == Step::Over {
            return;
        }
        self.ret_value = initialisation::RUNS;
        let next = match self.internal.step {
            Step::Enable => Some(order(self.rx_id, ENABLE, &[])),
            Step::Disable(_) | Step::Over => Some(order(self.rx_id, DISABLE, &[])),
            Step::Answer => Some(order(self.rx_id, RECEIVE, &[])),
            Step::Request if data_blocks.word(self.init_db, self.place()) == Some(END) => {
                self.internal.step = Step::Disable(initialisation::DONE);
                return;
            }
            Step::Request => {
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
        (self.ret_value, self.internal.step) = (result, Step::Over);
    }

    /// An order is carried out.
    fn done(&mut self, window: [u8; WINDOW], data_blocks: &mut DataBlocks) {
        let id = u16::from_be_bytes([window[0], window[1]]);
        match self.internal.step {
            Step::Enable => self.internal.step = Step::Request,
            Step::Request => self.internal.step = Step::Answer,
            Step::Answer if id == self.rx_id => {
                let &[_, _, _, _, command, _, _, _, data @ .., _, _, _, _] = &window;
                let is_good = match command {
                    0x60 => true,
                    0x40..=0x5F => self.store(command, data, data_blocks),
                    _ => false,
                };
                self.internal.step = if is_good {
                    self.internal.entry += 1;
                    Step::Request
                } else {
                    Step::Disable(initialisation::REFUSED | self.internal.entry)
                };
            }
            Step::Answer => {}
            Step::Disable(result) => self.end(result),
            Step::Over => {}
        }
    }

    /// Data that were read go to the list.
    fn store(&self, command: u8, data: [u8; 4], data_blocks: &mut DataBlocks) -> bool {
        // Expedited with a length; longer data have no room in an entry.
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
