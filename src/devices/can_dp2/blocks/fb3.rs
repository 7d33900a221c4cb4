//! FB3: controls up to 127 CANopen devices of the same type, here motors (p. 76, 81-86). FB1 initialises them one after
//! the other, FB2 exchanges their data.

use super::{DataBlocks, FB1, FB2, Peripherals, initialisation};
use crate::plc::{Shared, function_block};

/// Maximum number of motors. The next two constants are the number of bytes of a motor in the list of motors,
/// and in the data block of the motors (p. 83-86).
const MOTORS: u16 = 127;
const IN_LIST: usize = 8;
const IN_DATA: usize = 16;

/// Value in the list of motors for a motor that exists but has no list of SDOs. For a missing motor, the
/// value is 0 (p. 76).
const NO_LIST: u16 = 0xFFFF;

/// Number of bytes of a motor in the blocks of outputs and inputs: length, `force` or `count_in`, a word, a double word
/// (p. 82-83).
const CELL: usize = 8;

/// Words of KONFIG_DB (p. 81).
mod config {
    pub(super) const TX_CONFIG: usize = 0;
    pub(super) const RX_CONFIG: usize = 6;
    pub(super) const OUTPUTS: usize = 12;
    pub(super) const INPUTS: usize = 18;
    pub(super) const WRITE_ADDRESS: usize = 24;
    pub(super) const READ_ADDRESS: usize = 26;
    pub(super) const WRITE_WINDOW: usize = 28;
    pub(super) const READ_WINDOW: usize = 30;
    pub(super) const INIT_LIST: usize = 32;
}

/// RET_VALUE while motors are initialised (D-469).
const INITIALISES: u16 = 1;

/// Internal data of FB3.
#[derive(Clone, Debug, Default)]
pub struct Motors {
    fb1: FB1,
    fb2: FB2,
    /// Motor in initialisation, from 0.
    motor: u16,
}

function_block! {
    /// Controls up to 127 motors. The block sends the values that a program writes to DATEN_DB. It stores the
    /// values that the motors send in DATEN_DB, too (p. 81, 85).
    pub struct FB3(data_blocks: Shared<DataBlocks>, peripherals: Shared<Peripherals>) {
        in {
            /// TRUE runs the block; FALSE restarts it.
            FREIGABE: bool;
            /// Number of the data block that contains the numbers of all other data blocks.
            KONFIG_DB: u16;
            /// Number of the data block with the motors' data.
            DATEN_DB: u16;
        }
        out {
            /// 0: off; 1: motors are being initialised; other values as in FB2. From 2 on, other users may
            /// use the window (p. 81).
            RET_VALUE: u16;
            /// `ERROR` of FB2. The value 16, which commram defines, also means that a data block is missing.
            ERROR: u8;
        }
        internal: Motors;
    }
}

impl FB3 {
    /// Runs one PLC cycle.
    pub fn call(&mut self, data_blocks: &mut DataBlocks, peripherals: &mut Peripherals) {
        if !self.FREIGABE {
            (self.RET_VALUE, self.ERROR, self.internal) = (0, 0, Motors::default());
            return;
        }
        if self.run(data_blocks, peripherals).is_none() {
            (self.RET_VALUE, self.ERROR) = (0, 16);
        }
    }

    /// Returns `None` if a data block is missing.
    fn run(&mut self, data_blocks: &mut DataBlocks, peripherals: &mut Peripherals) -> Option<()> {
        let config = |at: usize| data_blocks.word(self.KONFIG_DB, at);
        let (outputs, inputs) = (config(config::OUTPUTS)?, config(config::INPUTS)?);
        let list = config(config::INIT_LIST)?;
        let windows = (config(config::WRITE_WINDOW)?, config(config::READ_WINDOW)?);
        let fb2 = &mut self.internal.fb2;
        (fb2.WRITE_CONFIG_DB, fb2.READ_CONFIG_DB) = (config(config::TX_CONFIG)?, config(config::RX_CONFIG)?);
        (fb2.WRITE_ADDRESS, fb2.READ_ADDRESS) =
            (config(config::WRITE_ADDRESS)?, config(config::READ_ADDRESS)?);
        (fb2.WRITE_DB, fb2.READ_DB) = (outputs, inputs);
        let is_ready = self.internal.motor >= MOTORS;
        if is_ready {
            self.copy(data_blocks, list, |place| {
                // The fields of a motor: `force`, a reserved byte, control word and target position.
                let from: [u8; CELL] = place.data_blocks.read(place.data, place.of_data)?;
                let to = [from[0], from[2], from[3], from[4], from[5], from[6], from[7]];
                place.data_blocks.write(outputs, place.of_cell + 1, &to).then_some(())
            })?;
        } else {
            self.initialise(data_blocks, peripherals, list, windows)?;
        }
        let fb2 = &mut self.internal.fb2;
        fb2.FREIGABE = is_ready;
        fb2.call(data_blocks, peripherals);
        (self.RET_VALUE, self.ERROR) = (if is_ready { fb2.RET_VALUE.max(2) } else { INITIALISES }, fb2.ERROR);
        if is_ready {
            self.copy(data_blocks, list, |place| {
                let from: [u8; CELL] = place.data_blocks.read(inputs, place.of_cell)?;
                let to = [from[1], 0, from[2], from[3], from[4], from[5], from[6], from[7]];
                place.data_blocks.write(place.data, place.of_data + 8, &to).then_some(())
            })?;
        }
        Some(())
    }

    /// Initialises the next motor that has a list. The result is stored in the list of motors, after the
    /// motor's list number (p. 77, 83).
    fn initialise(
        &mut self,
        data_blocks: &mut DataBlocks,
        peripherals: &mut Peripherals,
        list: u16,
        (write, read): (u16, u16),
    ) -> Option<()> {
        let Motors { fb1, motor, .. } = &mut self.internal;
        if !fb1.transfer {
            while *motor < MOTORS
                && matches!(data_blocks.word(list, usize::from(*motor) * IN_LIST), Some(0 | NO_LIST))
            {
                *motor += 1;
            }
            if *motor >= MOTORS {
                return Some(());
            }
        }
        let entry = usize::from(*motor) * IN_LIST;
        (fb1.init_db, fb1.offset) = (data_blocks.word(list, entry)?, data_blocks.word(list, entry + 2)?);
        (fb1.tx_id, fb1.rx_id) = (0x601 + *motor, 0x581 + *motor);
        (fb1.write_address_cw, fb1.read_address_cw) = (write, read);
        fb1.transfer = true;
        fb1.call(data_blocks, peripherals);
        data_blocks.write(list, entry + 4, &fb1.ret_value.to_be_bytes()).then_some(())?;
        if fb1.ret_value != initialisation::RUNS {
            fb1.transfer = false;
            fb1.call(data_blocks, peripherals);
            *motor += 1;
        }
        Some(())
    }

    /// Calls `copy` for each existing motor.
    fn copy(
        &self,
        data_blocks: &mut DataBlocks,
        list: u16,
        what: impl Fn(MotorPosition<'_>) -> Option<()>,
    ) -> Option<()> {
        let mut of_cell = 0;
        for motor in 0..usize::from(MOTORS) {
            if data_blocks.word(list, motor * IN_LIST)? == 0 {
                continue;
            }
            what(MotorPosition { data_blocks, data: self.DATEN_DB, of_data: motor * IN_DATA, of_cell })?;
            of_cell += CELL;
        }
        Some(())
    }
}

/// Positions of a motor's data.
struct MotorPosition<'a> {
    data_blocks: &'a mut DataBlocks,
    data: u16,
    of_data: usize,
    of_cell: usize,
}
