//! The vendor's function blocks by name, with their pins as properties.

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

use super::pins::Pin;
use super::wires::{Board, Connected, Jobs, JobsAndRegisters, Nothing, Wires};
use crate::devices::omega_drive_line_2::blocks::{self as plc, CANsync_RD_BMARRAY, CANsync_UPDOWN_BMARRAY};
use crate::devices::omega_drive_line_2::registers::{
    BAPS_CTRL_BMSTRUCT, CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT,
};
use crate::memory::MemoryError;
use crate::script::ScenarioError;
use core::cell::RefCell;
use rhai::Dynamic;
use std::rc::Rc;

/// A function block with the registers that are connected to its `_BASE`, and its in-out data.
pub(super) trait Instance {
    /// An input or output, or in-out data.
    fn get(&self, pin: &str) -> Option<Dynamic>;

    /// Sets one.
    fn set(&mut self, pin: &str, value: &Dynamic) -> Option<Result<(), ScenarioError>>;

    /// One PLC cycle.
    fn call(&mut self);
}

/// A block that several variables of a script may refer to.
pub(super) type Placed = Rc<RefCell<dyn Instance>>;

/// What the names of function blocks stand for.
pub(super) struct Kind {
    /// The block's name.
    pub name: &'static str,
    /// The structure of its `_BASE`; none for blocks without.
    pub base: Option<&'static str>,
    /// Its pins.
    pub pins: &'static [&'static str],
    /// Makes one.
    pub make: fn(&Wires<'_>) -> Result<Placed, MemoryError>,
}

macro_rules! blocks {
    ($(
        $name:ident ($base:ident $(, $data:ident: $type:ty)*)
        [$($pin:ident)*]
        |$block:ident, $registers:ident| $call:expr;
    )*) => {
        /// The blocks that scripts can use.
        pub(super) const KINDS: &[Kind] = &[$(Kind {
            name: stringify!($name),
            base: <$base as Connected>::STRUCTURE,
            pins: &[$(stringify!($pin),)* $(stringify!($data)),*],
            make: |wires| {
                struct This {
                    block: plc::$name,
                    base: <$base as Connected>::Base,
                    $($data: Box<$type>,)*
                }
                impl Instance for This {
                    fn get(&self, pin: &str) -> Option<Dynamic> {
                        match pin {
                            $(stringify!($pin) => Some(self.block.$pin.show()),)*
                            $(stringify!($data) => Some(self.$data.show()),)*
                            _ => None,
                        }
                    }

                    fn set(&mut self, pin: &str, value: &Dynamic) -> Option<Result<(), ScenarioError>> {
                        match pin {
                            $(stringify!($pin) => Some(self.block.$pin.take(value)),)*
                            $(stringify!($data) => Some(self.$data.take(value)),)*
                            _ => None,
                        }
                    }

                    fn call(&mut self) {
                        let This { block: $block, base: $registers, $($data),* } = self;
                        $call
                    }
                }
                Ok(Rc::new(RefCell::new(This {
                    block: plc::$name::default(),
                    base: <$base as Connected>::connect(wires)?,
                    $($data: zeroed::<$type>(),)*
                })))
            },
        }),*];
    };
}

/// In-out data begin as zeros.
fn zeroed<T: zerocopy::FromZeros>() -> Box<T> {
    Box::new(T::new_zeroed())
}

blocks! {
    CANsync_BC_MA0(CANsync_MA_CTRL_BMSTRUCT)
        [us_BC_CMD_NR si_BC_BYTE i_BC_WORD d_SL_MASK x_EN x_OK]
        |block, base| block.call(base);
    CANsync_BC_MA1(CANsync_MA_CTRL_BMSTRUCT)
        [us_BC_CMD_NR si_BC_BYTE i_BC_WORD d_SL_MASK x_EN x_OK]
        |block, base| block.call(base);
    CANsync_BC_MA2(CANsync_MA_CTRL_BMSTRUCT)
        [us_BC_CMD_NR si_BC_BYTE i_BC_WORD d_SL_MASK x_EN x_OK]
        |block, base| block.call(base);
    CANsync_BC_SL(CANsync_SL_CTRL_BMSTRUCT)
        [us_BC_CMD_NR si_BC_BYTE i_BC_WORD si_BC_RECEIVED]
        |block, base| block.call(base);
    CANsync_COMM_CONTROL_MA(CANsync_MA_CTRL_BMSTRUCT)
        [si_SL_NR_CTRL x_EN_CTRL si_SL_NR_PAR x_EN_PAR si_SL_NR_UDL x_EN_UDL si_MAX_SL_NR]
        |block, base| block.call(base);
    CANsync_CONTROLWORD_MA(CANsync_MA_CTRL_BMSTRUCT)
        [si_SL_NR_CTRL w_CONTROLWORD x_EN x_OK]
        |block, base| block.call(base);
    CANsync_CONTROLWORD_SL(CANsync_SL_CTRL_BMSTRUCT)
        [w_CONTROLWORD si_RECEIVED]
        |block, base| block.call(base);
    CANsync_INIT(CANsync_INIT_BMSTRUCT)
        [x_SL x_SYNC_IN x_SYNC_MODE x_ASYNC_MODE0 x_ASYNC_MODE1 a_SL_TYP b_ACCEPT_CODE b_ACCEPT_MASK
         b_BIT_TIMING0 b_BIT_TIMING1 us_BAUDRATE us_SYNC_INTERVAL w_ERR x_ERR x_OK]
        |block, base| block.call(base);
    CANsync_MODE_MA(CANsync_MA_CTRL_BMSTRUCT)
        [x_RESET_SOFTWARE x_SET_INIT_DATA x_CANsync_RUN x_RESET_CANsync_CONTROLLER x_SYNC_MODE x_ASYNC_MODE0
         x_ASYNC_MODE1 x_HS_ACTIV x_INIT_POSSIBLE x_WAIT x_PREPARE_ACTIV x_CANsync_ACTIV x_SYNC_MODE_ACTIV
         x_ASYNC_MODE_ACTIV x_SL x_MA]
        |block, base| block.call(base);
    CANsync_MODE_SL(CANsync_SL_CTRL_BMSTRUCT)
        [x_RESET_SOFTWARE x_SET_INIT_DATA x_CANsync_RUN x_RESET_CANsync_CONTROLLER x_SYNC_MODE x_ASYNC_MODE0
         x_ASYNC_MODE1 x_HS_ACTIV x_INIT_POSSIBLE x_WAIT x_PREPARE_ACTIV x_CANsync_ACTIV x_SYNC_MODE_ACTIV
         x_ASYNC_MODE_ACTIV x_SL x_MA]
        |block, base| block.call(base);
    CANsync_PAR_READ_MA(CANsync_MA_CTRL_BMSTRUCT)
        [si_SL_NR u_PAR_NR x_PAR_FORMAT i_SUB_SL t_TIME x_EN x_RESET ud_PAR_VALUE x_PAR_FORMAT_READ x_BUSY b_ERR i_ERR x_ERR x_OK]
        |block, base| block.call(base);
    CANsync_PAR_WRITE_MA(CANsync_MA_CTRL_BMSTRUCT)
        [si_SL_NR u_PAR_NR x_PAR_FORMAT i_SUB_SL ud_PAR_VALUE t_TIME x_EN x_RESET x_BUSY i_ERR b_ERR x_ERR x_OK]
        |block, base| block.call(base);
    CANsync_PAR_SL(CANsync_SL_CTRL_BMSTRUCT)
        [ud_PAR_VALUE_READ x_PAR_FORMAT_READ i_ERR x_ERR_IN x_OK_IN x_EN x_RESET x_RESET_JOB x_READ x_WRITE
         u_PAR_NR x_PAR_FORMAT_WRITE ud_PAR_VALUE_WRITE x_ACTIV x_BUSY x_OK]
        |block, base| block.call(base);
    CANsync_PD_CFG_MA(CANsync_MA_CTRL_BMSTRUCT)
        [a_WRC1 a_HL_WRC1 a_WRC2 a_HL_WRC2]
        |block, base| block.call(base);
    CANsync_PD_CFG_READ_MA(CANsync_MA_CTRL_BMSTRUCT)
        [si_SL_NR a_RDC1 a_HL_RDC1 a_RDC2 a_HL_RDC2]
        |block, base| block.call(base);
    CANsync_PD_CFG_READ_SL(CANsync_SL_CTRL_BMSTRUCT)
        [si_SL_NR a_RDC1 a_HL_RDC1 a_RDC2 a_HL_RDC2]
        |block, base| block.call(base);
    CANsync_PD_CFG_SL(CANsync_SL_CTRL_BMSTRUCT)
        [a_WRC1 a_HL_WRC1 a_WRC2 a_HL_WRC2 a_RDC1 a_HL_RDC1 a_RDC2 a_HL_RDC2]
        |block, base| block.call(base);
    CANsync_PD_COMM_MA(CANsync_MA_CTRL_BMSTRUCT, a_RD_ARRAY: CANsync_RD_BMARRAY)
        [a_WR_VALUES_SEND si_WRC1_SEND si_WRC2_SEND si_RD_SL_NR1_RECEIVE si_RD_SL_NR2_RECEIVE si_MAX_SL_NR
         x_COPY_TO_RD_ARRAY si_RD_SL_NR1_RECEIVED si_RD_SL_NR2_RECEIVED]
        |block, base| block.call(base, a_RD_ARRAY);
    CANsync_PD_COMM_READ_MA(CANsync_MA_CTRL_BMSTRUCT)
        [si_SL_NR a_RD_VALUES si_RD_SL_NR1_RECEIVED si_RD_SL_NR2_RECEIVED]
        |block, base| block.call(base);
    CANsync_PD_COMM_READ_SL(CANsync_SL_CTRL_BMSTRUCT)
        [si_SL_NR a_RD_VALUES si_RD_SL_NR1_RECEIVED si_RD_SL_NR2_RECEIVED]
        |block, base| block.call(base);
    CANsync_PD_COMM_SL(CANsync_SL_CTRL_BMSTRUCT, a_RD_ARRAY: CANsync_RD_BMARRAY)
        [a_RD_VALUES_SEND si_RDC1_SEND si_RDC2_SEND x_COPY_TO_RD_ARRAY a_WR_VALUES_RECEIVED si_WRC1_RECEIVED
         si_WRC2_RECEIVED si_RD_SL_NR1_RECEIVED si_RD_SL_NR2_RECEIVED]
        |block, base| block.call(base, a_RD_ARRAY);
    CANsync_SL_TYP_INIT(Nothing)
        [us_SL_TYP0 us_SL_TYP1 us_SL_TYP2 us_SL_TYP3 us_SL_TYP4 us_SL_TYP5 us_SL_TYP6 us_SL_TYP7 us_SL_TYP8
         us_SL_TYP9 us_SL_TYP10 us_SL_TYP11 us_SL_TYP12 us_SL_TYP13 us_SL_TYP14 us_SL_TYP15 us_SL_TYP16
         us_SL_TYP17 us_SL_TYP18 us_SL_TYP19 us_SL_TYP20 us_SL_TYP21 us_SL_TYP22 us_SL_TYP23 us_SL_TYP24
         us_SL_TYP25 us_SL_TYP26 us_SL_TYP27 us_SL_TYP28 us_SL_TYP29 us_SL_TYP30 us_SL_TYP31 a_SL_TYP]
        |block, _base| block.call();
    CANsync_UPDOWNLOAD_MA(CANsync_MA_CTRL_BMSTRUCT, a_DOWNLOAD: CANsync_UPDOWN_BMARRAY, a_UPLOAD: CANsync_UPDOWN_BMARRAY)
        [si_SL_NR x_UPDOWN u_LENGTH us_MAX_NR_OF_COMM t_TIME x_EN x_RESET x_BUSY w_ERR_SL x_ERR_SL b_ERR x_ERR x_OK]
        |block, base| block.call(base, a_DOWNLOAD, a_UPLOAD);
    CANsync_UPDOWNLOAD_SL(CANsync_SL_CTRL_BMSTRUCT, a_DOWNLOAD: CANsync_UPDOWN_BMARRAY, a_UPLOAD: CANsync_UPDOWN_BMARRAY)
        [t_TIME x_EN x_RESET x_UPDOWN x_ORDER_ACTIV u_LENGTH x_BUSY w_ERR x_ERR x_OK]
        |block, base| block.call(base, a_DOWNLOAD, a_UPLOAD);
    BAPS_INIT(BAPS_CTRL_BMSTRUCT)
        [us_HW_TYPE i_EVENT w_COMMAND_REG us_MODE u_WR_PAR_NR0 u_WR_PAR_NR1 u_WR_PAR_NR2 u_WR_PAR_NR3 u_WR_PAR_NR4
         u_WR_PAR_NR5 u_WR_PAR_NR6 u_WR_PAR_NR7 u_RD_PAR_NR0 u_RD_PAR_NR1 u_RD_PAR_NR2 u_RD_PAR_NR3 u_RD_PAR_NR4
         u_RD_PAR_NR5 u_RD_PAR_NR6 u_RD_PAR_NR7 t_TIME x_EN x_RESET w_STATUS_REG x_BUSY b_SL_QUIT b_ERR x_ERR x_OK]
        |block, base| block.call(base);
    BAPS_PD_COMM2(BAPS_CTRL_BMSTRUCT)
        [us_HW_TYPE w_CONTROLWORD w_COMMAND_REG us_MODE ud_WR_VALUE0 ud_WR_VALUE1 x_EN w_STATUSWORD w_STATUS_REG
         ud_RD_VALUE0 ud_RD_VALUE1 b_SL_QUIT b_ERR x_ERR]
        |block, base| block.call(base);
    BAPS_PD_COMM8(BAPS_CTRL_BMSTRUCT)
        [us_HW_TYPE w_CONTROLWORD w_COMMAND_REG us_MODE ud_WR_VALUE0 ud_WR_VALUE1 ud_WR_VALUE2 ud_WR_VALUE3
         ud_WR_VALUE4 ud_WR_VALUE5 ud_WR_VALUE6 ud_WR_VALUE7 x_EN w_STATUSWORD w_STATUS_REG ud_RD_VALUE0
         ud_RD_VALUE1 ud_RD_VALUE2 ud_RD_VALUE3 ud_RD_VALUE4 ud_RD_VALUE5 ud_RD_VALUE6 ud_RD_VALUE7 b_SL_QUIT
         b_ERR x_ERR]
        |block, base| block.call(base);
    BAPS_PD_COMM24(BAPS_CTRL_BMSTRUCT)
        [us_HW_TYPE w_CONTROLWORD w_COMMAND_REG us_MODE ud_WR_VALUE0 ud_WR_VALUE1 t_RE_INIT_TIME x_RE_INIT_START
         x_EN w_STATUSWORD w_STATUS_REG ud_RD_VALUE0 ud_RD_VALUE1 ud_RD_VALUE2 ud_RD_VALUE3 b_SL_QUIT b_ERR x_ERR
         x_RE_INIT_ERR x_RE_INIT_OK]
        |block, base| block.call(base);
    BAPS_PD_CONTROL(BAPS_CTRL_BMSTRUCT)
        [x_RESET t_TIME x_ERR]
        |block, base| block.call(base);
    BAPS_PAR_READ(Jobs)
        [u_PAR_NR us_PAR_ELEMENT x_EN x_RESET ud_PAR_VALUE x_PAR_FORMAT x_BUSY i_ERR_DETAIL i_ERR_COMM x_ERR x_OK]
        |block, jobs| block.call(&mut jobs.borrow_mut());
    BAPS_PAR_WRITE(Jobs)
        [u_PAR_NR x_PAR_FORMAT ud_PAR_VALUE x_EN_ERR_FORMAT x_EN x_RESET x_BUSY i_ERR_DETAIL i_ERR_COMM x_ERR x_OK]
        |block, jobs| block.call(&mut jobs.borrow_mut());
    BAPS_SD_CONTROL(JobsAndRegisters)
        [x_RESET t_TIME b_ERR x_ERR]
        |block, base| block.call(&base.0, &mut base.1.borrow_mut());
    LED(Board) [b_LEDS] |block, ram| block.call(ram);
    INTR_SET(Board)
        [i_EVENT i_MODE i_PAR1 i_PAR2 x_EN x_ERR]
        |block, ram| block.call(ram);
    OPT_INIT(Board)
        [us_MODE_TRIGGER_1 us_MODE_TRIGGER_2 us_MODE_TRIGGER_CONTROLLER u_DIVIDER_TIMER_A x_EN_TIMER_A
         ud_CFG_MODE_TIMER_A u_DIVIDER_TIMER_B x_EN_TIMER_B ud_CFG_MODE_TIMER_B x_ERR x_OK]
        |block, ram| block.call(ram);
    TIME_MEASURE_START(Board) [ud_TIME] |block, ram| block.call(ram);
    TIME_MEASURE_END(Board) [ud_TIME ud_TIME_DIFF] |block, ram| block.call(ram);
}
