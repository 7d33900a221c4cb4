//! What function blocks are connected to: registers, the board, the service data of the BAPS.

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

use crate::devices::omega_drive_line_2::blocks::{BAPS_BMSTRUCT, Base, Ram};
use crate::devices::omega_drive_line_2::registers::{
    BAPS_CTRL_BMSTRUCT, CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT,
};
use crate::memory::MemoryError;
use core::cell::RefCell;
use std::rc::Rc;

/// The variable that connects the blocks of the service data of one PLC.
pub(super) type ServiceData = Rc<RefCell<BAPS_BMSTRUCT>>;

/// Where a block is placed.
pub(super) struct Wires<'a> {
    /// The RAM of its PLC.
    pub ram: &'a Ram,
    /// `%MB3` offset of its area.
    pub offset: usize,
    /// Of its PLC.
    pub service_data: &'a ServiceData,
}

/// What a block's `call` takes.
pub(super) trait Connected {
    /// The structure that its area must have; none for blocks of the board.
    const STRUCTURE: Option<&'static str>;
    /// What is connected.
    type Base;

    /// Connects it.
    ///
    /// # Errors
    /// The structure does not fit there.
    fn connect(wires: &Wires<'_>) -> Result<Self::Base, MemoryError>;
}

macro_rules! structures {
    ($($structure:ident)*) => {$(
        impl Connected for $structure {
            const STRUCTURE: Option<&'static str> = Some(stringify!($structure));
            type Base = Base<$structure>;

            fn connect(wires: &Wires<'_>) -> Result<Self::Base, MemoryError> {
                wires.ram.at(wires.offset)
            }
        }
    )*};
}

structures! { BAPS_CTRL_BMSTRUCT CANsync_INIT_BMSTRUCT CANsync_MA_CTRL_BMSTRUCT CANsync_SL_CTRL_BMSTRUCT }

/// The board: no registers, but the header page.
pub(super) struct Board;

impl Connected for Board {
    const STRUCTURE: Option<&'static str> = None;
    type Base = Ram;

    fn connect(wires: &Wires<'_>) -> Result<Ram, MemoryError> {
        Ok(wires.ram.clone())
    }
}

/// Nothing: the block touches no register.
pub(super) struct Nothing;

impl Connected for Nothing {
    const STRUCTURE: Option<&'static str> = None;
    type Base = ();

    fn connect(_: &Wires<'_>) -> Result<(), MemoryError> {
        Ok(())
    }
}

/// The service data alone.
pub(super) struct Jobs;

impl Connected for Jobs {
    const STRUCTURE: Option<&'static str> = BAPS_CTRL_BMSTRUCT::STRUCTURE;
    type Base = ServiceData;

    fn connect(wires: &Wires<'_>) -> Result<ServiceData, MemoryError> {
        Ok(Rc::clone(wires.service_data))
    }
}

/// The registers of the BAPS and the service data.
pub(super) struct JobsAndRegisters;

impl Connected for JobsAndRegisters {
    const STRUCTURE: Option<&'static str> = BAPS_CTRL_BMSTRUCT::STRUCTURE;
    type Base = (Base<BAPS_CTRL_BMSTRUCT>, ServiceData);

    fn connect(wires: &Wires<'_>) -> Result<Self::Base, MemoryError> {
        Ok((BAPS_CTRL_BMSTRUCT::connect(wires)?, Jobs::connect(wires)?))
    }
}
