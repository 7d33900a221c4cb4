//! Commands without an answer: broadcast commands 0 to 2 and control word commands (manual 5.00005.03a
//! p. 162-163).

use super::master::acknowledge;
use crate::devices::Context;
use crate::devices::cansync::frames::Frame;
use crate::devices::cansync::frames::codec::action::ActionCommand;
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::send;
use crate::memory::{Cell8, Cell16, Cell32};
use core::mem::offset_of;

/// The registers of one broadcast command.
struct Area<'a> {
    control: &'a Cell8,
    offset: usize,
    mask: &'a Cell32,
    command: &'a Cell8,
    data_byte: &'a Cell8,
    data_word: &'a Cell16,
}

macro_rules! area {
    ($regs:ident, $control:ident, $mask:ident, $command:ident, $byte:ident, $word:ident) => {
        Area {
            control: &$regs.$control,
            offset: offset_of!(CANsync_MA_CTRL_BMSTRUCT, $control),
            mask: &$regs.$mask,
            command: &$regs.$command,
            data_byte: &$regs.$byte,
            data_word: &$regs.$word,
        }
    };
}

/// Returns the released broadcast command with the lowest number.
#[inline]
pub(super) fn broadcast(ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT) -> Option<Frame> {
    [
        area!(regs, b_CTRL_REG_BC0, d_SL_MASK_BC0, b_CMD_BC0, b_DATA_BYTE_BC0, w_DATA_WORD_BC0),
        area!(regs, b_CTRL_REG_BC1, d_SL_MASK_BC1, b_CMD_BC1, b_DATA_BYTE_BC1, w_DATA_WORD_BC1),
        area!(regs, b_CTRL_REG_BC2, d_SL_MASK_BC2, b_CMD_BC2, b_DATA_BYTE_BC2, w_DATA_WORD_BC2),
    ]
    .into_iter()
    .find_map(|area| {
        take(ctx, area.control, area.offset, || ActionCommand {
            slave_group: area.mask.load(),
            command: area.command.load(),
            data_byte: area.data_byte.load(),
            data_word: area.data_word.load(),
        })
    })
}

/// If the PLC has released the control word for `slave`, returns it as an action command for this slave only.
#[inline]
pub(super) fn control_word(ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT, slave: u8) -> Option<Frame> {
    let index = usize::from(slave);
    let (control, word) = (regs.a_STEUREG_CONTROLWORD.get(index)?, regs.a_CONTROLWORD_SL.get(index)?);
    let offset = offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_STEUREG_CONTROLWORD) + index;
    take(ctx, control, offset, || ActionCommand::control_word(1 << slave, word.load()))
}

/// Takes over a released command. When its frame is passed to the controller, 16#05 becomes 16#04 (decision
/// D-40).
#[inline]
fn take(
    ctx: &mut Context,
    control: &Cell8,
    offset: usize,
    command: impl FnOnce() -> ActionCommand,
) -> Option<Frame> {
    if control.load() != send::RELEASED {
        return None;
    }
    let frame = command().frame();
    // If the PLC has withdrawn its release since the firmware read it, the master sends no frame.
    acknowledge(ctx, control, offset).then_some(frame)
}
