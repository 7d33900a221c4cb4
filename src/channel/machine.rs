//! What the channel needs of an emulator.

use super::{ChannelError, InstanceInfo};
use crate::fault::{Fault, FaultStatus, Refusal};
use crate::journal::Journal;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Unmapped, Width};
use crate::plant::Forced;
use core::num::NonZeroU16;

/// An emulator, seen from the channel.
///
/// The executor has checked PLC number, alignment and value width before it calls the memory functions;
/// an implementation only decides what is mapped. Times are emulated time in microseconds.
pub trait Machine {
    /// Number of PLCs.
    fn plc_count(&self) -> usize;

    /// Reads a register.
    ///
    /// # Errors
    /// No register area covers the address.
    fn load(&self, plc: usize, offset: u32, width: Width) -> Result<u32, Unmapped>;

    /// Writes a register.
    ///
    /// # Errors
    /// No register area covers the address.
    fn store(&mut self, plc: usize, offset: u32, width: Width, value: u32) -> Result<(), Unmapped>;

    /// Writes `new` if the register holds `current`; the inner result is what it held, `Ok` if written.
    ///
    /// # Errors
    /// No register area covers the address.
    fn compare_exchange(
        &mut self,
        plc: usize,
        offset: u32,
        width: Width,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, Unmapped>;

    /// Copies bytes, whatever their registers' widths.
    ///
    /// # Errors
    /// No register area covers one of the bytes.
    fn read_range(&self, plc: usize, offset: u32, to: &mut [u8]) -> Result<(), Unmapped>;

    /// Emulated time.
    fn now(&self) -> u64;

    /// Whether the time only passes on request.
    fn is_stepped(&self) -> bool;

    /// Time of the next event, not before [`Machine::now`]; `u64::MAX` if there is none. Once [`Machine::advance_to`]
    /// has gone there it is later.
    fn next_event(&self) -> u64;

    /// A request has come. With a stepped clock, what the boards were asked for before it is answered first: whoever
    /// asks of them and then sends a request always sees the same.
    fn begin_request(&mut self);

    /// Stepped mode: runs everything up to and including time `t`. Going there in several calls has the
    /// same outcome as going there in one.
    fn advance_to(&mut self, t: u64);

    /// Time of the next SYNC on that node's bus, later than [`Machine::now`]; `None` if nobody sends any.
    fn next_sync(&self, plc: usize, node: u8) -> Option<u64>;

    /// Makes a register keep a value.
    ///
    /// # Errors
    /// It is no whole register, or too many are forced.
    fn force(&mut self, forced: Forced) -> Result<(), ChannelError>;

    /// Lets a forced register go; `false` if it was not forced.
    fn unforce(&mut self, plc: u16, offset: u32) -> bool;

    /// The forced registers.
    fn forces(&self) -> &[Forced];

    /// The board of a PLC.
    fn board(&self, plc: usize) -> BoardState;

    /// Does something to the board of a PLC, at the present time.
    fn set_board(&mut self, plc: usize, setting: BoardSetting);

    /// What has happened.
    fn journal(&self) -> &Journal;

    /// Adds a fault; returns its number.
    ///
    /// # Errors
    /// The plant does not have what it concerns, or a number is out of its range.
    fn add_fault(&mut self, fault: Fault) -> Result<u16, Refusal>;

    /// Clears the fault of that number, or all; returns how many there were.
    ///
    /// # Errors
    /// There is no fault of that number.
    fn clear_faults(&mut self, id: Option<NonZeroU16>) -> Result<u16, Refusal>;

    /// The faults that wait or act.
    fn faults(&self) -> Vec<FaultStatus>;

    /// Forgets what the access checker has found.
    fn clear_findings(&mut self);

    /// What the instance says about itself.
    fn info(&self) -> InstanceInfo;

    /// Asks the emulator to end; [`Machine::should_stop`] is true from then on.
    fn request_stop(&mut self);

    /// Whether the emulator is to end (a signal came in, or a client asked). Asked during long advances.
    fn should_stop(&self) -> bool;
}
