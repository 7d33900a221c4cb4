//! The parts of a program in Rust that exchanges blocks by 3964R in the timer event of its PLC.

use crate::st_blocks::PATIENCE;
use commram::devices::omega_drive_line_2::blocks::{
    Base, INTR_SET, Ram, SERIAL_3964R, SERIAL_BMARRAY, SERIAL_OCTETS,
};
use commram::devices::omega_drive_line_2::registers::values::{serial_control, serial_parity};
use commram::devices::omega_drive_line_2::registers::{SERIAL, SERIAL_BMSTRUCT};
use commram::memory::{Attached, MemoryError};

/// Switches the timer event of a PLC on.
pub(crate) fn start_timer(image: &Attached) -> Result<(), MemoryError> {
    let ram = Ram::of(image.segment())?;
    let mut event = INTR_SET { i_PAR1: 20, x_EN: true, ..Default::default() };
    image.wait_until("INTR_SET", PATIENCE, |_| {
        event.call(&ram);
        image.ring().ok()?;
        event.is_answered().then_some(())
    })
}

/// Switches the serial port of a PLC on.
pub(crate) fn port_of(image: &Attached, wires: u8) -> Result<Base<SERIAL_BMSTRUCT>, MemoryError> {
    let base = Ram::of(image.segment())?.at::<SERIAL_BMSTRUCT>(SERIAL)?;
    base.u_BAUD_RATE.store(38_400);
    base.us_DATA_BITS.store(8);
    base.b_PARITY.store(serial_parity::EVEN);
    base.us_STOP_BITS.store(1);
    base.us_WIRES.store(wires);
    base.w_CONTROL.store(serial_control::ON);
    Ok(base)
}

/// Sends blocks one after the other, each when the block before it has come back.
pub(crate) struct Partner {
    block: SERIAL_3964R,
    send: Box<SERIAL_BMARRAY>,
    received: Box<SERIAL_BMARRAY>,
    left: std::vec::IntoIter<Vec<u8>>,
    sent: usize,
    /// The blocks that have come back.
    pub(crate) back: Vec<Vec<u8>>,
}

impl Partner {
    pub(crate) fn new(blocks: Vec<Vec<u8>>, has_check_sum: bool) -> Self {
        let block = SERIAL_3964R { x_EN: true, x_HIGH: true, x_BCC: has_check_sum, ..Default::default() };
        let (send, received) = (Box::new([0; SERIAL_OCTETS]), Box::new([0; SERIAL_OCTETS]));
        Partner { block, send, received, left: blocks.into_iter(), sent: 0, back: Vec::new() }
    }

    /// Calls the block once. The caller does so in each timer event.
    pub(crate) fn call(&mut self, port: &Base<SERIAL_BMSTRUCT>) {
        let block = &mut self.block;
        if block.x_SEND {
            block.x_SEND = false;
        } else if !block.x_BUSY
            && self.back.len() == self.sent
            && let Some(octets) = self.left.next()
        {
            self.send[..octets.len()].copy_from_slice(&octets);
            (block.u_SEND, block.x_SEND) = (octets.len() as u16, true);
            self.sent += 1;
        }
        block.x_TAKEN = block.x_RECEIVED;
        block.call(port, &self.send, &mut self.received);
        if block.x_RECEIVED {
            self.back.push(self.received[..usize::from(block.u_RECEIVED)].to_vec());
        }
    }
}
