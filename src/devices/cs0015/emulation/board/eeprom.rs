//! The serial EEPROM: flags %MW128 to %MW511 as a block, which `E2WRITE` saves and `E2READ` loads (p. 107-110).

use crate::devices::cs0015::emulation::ram::Registers;
use serde::{Deserialize, Serialize};

/// Time in us for writing 768 bytes, 16 bytes at a time (D-474). `READ_US` is the time for reading them.
const WRITE_US: u64 = 480_000;
const READ_US: u64 = 20_000;

/// RESULT of both functions (p. 109-110).
const INACTIVE: u32 = 0;
const FINISHED: u32 = 1;
const WORKING: u32 = 2;

/// Function of the EEPROM.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Access {
    /// The block `E2WRITE`, which writes to the EEPROM.
    Write,
    /// The block `E2READ`, which reads from the EEPROM.
    Read,
}

/// A function in progress.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Work {
    access: Access,
    /// Emulated time at which the function is finished, in microseconds.
    until: u64,
    /// The flags at the start of a write. This content is written.
    flags: Vec<u16>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Eeprom {
    work: Option<Work>,
    /// Function that has ended, as long as it is still enabled.
    done: Option<Access>,
}

impl Eeprom {
    /// Handles a call of a function. A function in progress continues to its end, even if it is no longer
    /// enabled. The other function must wait for this end.
    pub(crate) fn call(&mut self, access: Access, is_enabled: bool, registers: &Registers, now: u64) -> u32 {
        if !is_enabled {
            self.done = self.done.filter(|done| *done != access);
            return INACTIVE;
        }
        if self.done == Some(access) {
            return FINISHED;
        }
        if self.work.is_none() {
            let (us, flags) = match access {
                Access::Write => {
                    (WRITE_US, registers.function.a_FUNCTION.iter().map(|it| it.load()).collect())
                }
                Access::Read => (READ_US, Vec::new()),
            };
            self.work = Some(Work { access, until: now + us, flags });
        }
        WORKING
    }

    /// Returns the end of the function in progress; `u64::MAX` if there is none.
    pub(crate) fn next_time(&self) -> u64 {
        self.work.as_ref().map_or(u64::MAX, |work| work.until)
    }

    /// Ends a function that is due. Only at this moment the EEPROM, or the flags, get the new content.
    pub(crate) fn due(&mut self, registers: &Registers, now: u64) {
        let Some(work) = self.work.take_if(|work| work.until <= now) else { return };
        let (flags, kept) = (&registers.function.a_FUNCTION, &registers.parameters);
        match work.access {
            Access::Write => {
                kept.a_EEPROM.iter().zip(&work.flags).for_each(|(cell, flag)| cell.store(*flag));
                kept.d_EEPROM_WRITES.update(|writes| writes.wrapping_add(1));
            }
            Access::Read => flags.iter().zip(&kept.a_EEPROM).for_each(|(flag, cell)| flag.store(cell.load())),
        }
        self.done = Some(work.access);
    }
}
