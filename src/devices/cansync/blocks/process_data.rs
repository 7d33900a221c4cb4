//! Process data registers: values that a PLC releases or reads, frame by frame. Frame 1 carries values 0 to 3, frame 2
//! values 4 to 7.

use super::CANsync_RD_BMARRAY;
use super::registers::{AUTOMATIC, slave_index, take_received};
use crate::devices::cansync::registers::STATREG_RDC;
use crate::devices::cansync::registers::values::{last_received, send};
use crate::memory::{Cell8, Cell32};

/// Values of one frame.
const FRAME: usize = 4;

/// Writes the values of each frame with 5 at its input `..._SEND`, and releases the frame.
pub(super) fn send(values: &[i32; 8], inputs: [i8; 2], registers: &[Cell32], controls: [&Cell8; 2]) {
    let frames = values.chunks(FRAME).zip(registers.chunks(FRAME));
    for ((input, control), (values, registers)) in inputs.into_iter().zip(controls).zip(frames) {
        if input == send::RELEASED as i8 {
            registers.iter().zip(values).for_each(|(register, value)| register.store(*value as u32));
            control.store(send::RELEASED);
        }
    }
}

/// Copies the values of the frames received since the last call. Returns true for each received frame.
pub(super) fn receive(states: [&Cell8; 2], registers: &[Cell32], values: &mut [i32]) -> [bool; 2] {
    let received = states.map(|state| take_received(state) != 0);
    let frames = values.chunks_mut(FRAME).zip(registers.chunks(FRAME));
    for (received, (values, registers)) in received.into_iter().zip(frames) {
        if received {
            values.iter_mut().zip(registers).for_each(|(value, register)| *value = register.load() as i32);
        }
    }
    received
}

/// Receives the actual values of one slave, like [`receive`].
pub(super) fn receive_from(state: &STATREG_RDC, registers: &[Cell32; 16], values: &mut [i32]) -> [bool; 2] {
    receive([&state.b_STATREG_RDC1, &state.b_STATREG_RDC2], registers, values)
}

/// Receives the actual values of all slaves, like [`receive`].
pub(super) fn receive_from_all(
    states: &[STATREG_RDC; 32],
    registers: &[[Cell32; 16]; 32],
    a_RD_ARRAY: &mut CANsync_RD_BMARRAY,
) {
    for ((state, registers), values) in states.iter().zip(registers).zip(a_RD_ARRAY) {
        receive_from(state, registers, values);
    }
}

/// Returns the slave from which the last frame since the previous call was received; -128: no slave.
pub(super) fn take_last_slave(register: &Cell8) -> i8 {
    let number = register.update(|_| last_received::RE_ARMED) as i8;
    if slave_index(number).is_some() { number } else { AUTOMATIC }
}
