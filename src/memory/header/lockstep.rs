//! Tasks in lockstep: the emulated time waits for them. `docs/reference/attach.md` describes the turns.

#[cfg(feature = "emulator")]
mod seat_owner;

use crate::memory::process::ProcessId;
use crate::memory::struct_tables::publish;
use crate::memory::{Bell, Cell32, Cell64, SharedRegs};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Flag in [`Seat::event`]: in addition to the turns of its event, the task gets a turn directly after it has joined,
/// when the board orders a start or stop of the program, and after a reset.
pub const SEAT_ORDERS: u32 = 0x100;

/// Flag in [`Seat::run_us`]: the task is done. The other bits are the longest emulated time in microseconds until its
/// next turn, which comes even if no event occurs. Until then the task does not occupy the processor of its PLC.
pub const SEAT_WAITS: u32 = 0x8000_0000;

/// The seat of one task in lockstep.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Seat {
    /// Process id of the task; 0 if the seat is free. A task takes the seat by compare-exchange.
    pub owner: Cell32,
    /// State of the seat, a [`SeatState`].
    pub state: Cell32,
    /// Start time of the process `owner`: field 22 of `/proc/<pid>/stat`.
    pub owner_start: Cell64,
    /// Number of the task's event, plus [`SEAT_ORDERS`] if orders of the board also give it a turn.
    pub event: Cell32,
    /// Longest real time of a turn, in ms. After this time the task counts as lost. 0: no limit while the task's
    /// process lives.
    pub patience_ms: Cell32,
    /// Rung by the emulator at the start of a turn. The clock stops until `done` has rung the same number of times.
    pub turn: Bell,
    /// Emulated time of the turn in microseconds; written before `turn` rings.
    pub time_us: Cell64,
    /// Request of the task at the end of a turn. If it is 0, the task is done until the next event. With another value,
    /// the task gets another turn after this emulated run time, in microseconds. With [`SEAT_WAITS`], the next turn
    /// comes at the next event, or after this time if no event occurs before.
    pub run_us: Cell32,
    /// Reserved; always zero.
    pub reserved_44: Cell32,
    /// Rung by the task at the end of its turn, after `run_us` was stored.
    pub done: Bell,
    /// Reserved; always zero.
    pub reserved_56: [Cell32; 2],
}

codes! {
    /// Steps by which a task takes part in lockstep.
    SeatState {
        /// Free, or the task has stopped taking part in lockstep.
        Free = 0,
        /// The task requests to take part.
        Asking = 1,
        /// The task takes part.
        Seated = 2,
        /// The emulator has refused the task: the clock is not stepped, or the event does not exist.
        Refused = 3,
        /// The emulator gave the task up, because its process died or its turn took too long.
        Lost = 4,
        /// The emulator is processing the request of the task. Its answer follows immediately.
        Deciding = 5,
    }
}

// SAFETY: every field is a cell, an array of cells or a struct of cells; IntoBytes proves that there is no
// padding and FromBytes that any bit pattern is valid.
unsafe impl SharedRegs for Seat {}

publish! { Seat:
    0 => owner, 4 => state, 8 => owner_start, 16 => event, 20 => patience_ms, 24 => turn, 32 => time_us,
    40 => run_us, 44 => reserved_44, 48 => done, 56 => reserved_56,
}
const _: () = assert!(size_of::<Seat>() == 64);

impl Seat {
    /// True if the process that has taken the seat still runs.
    pub fn owner_is_running(&self) -> bool {
        ProcessId { pid: self.owner.load(), start: self.owner_start.load() }.is_running()
    }

    /// Frees the seat; the bells keep their counts.
    pub fn clear(&self) {
        let cells = [&self.state, &self.event, &self.patience_ms, &self.run_us];
        cells.iter().for_each(|cell| cell.store(0));
        self.owner_start.store(0);
        self.owner.store(0);
    }
}
