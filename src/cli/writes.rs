//! Writes of registers and of single bits in them.

use super::error::CliError;
use super::place::NamedLocation;
use super::session::Session;
use crate::identity::DeviceIndex;
use crate::layout::{BitAccess, Width};
use crate::plant::Forced;
use crate::request::{Op, Reply};
use std::collections::HashMap;

/// A write of a register, or of one bit of it.
pub(crate) struct RegisterWrite {
    plc: DeviceIndex,
    offset: u32,
    width: Width,
    value: u32,
    /// For a single bit: its location, its new state, and the value of the register before the write.
    bit: Option<(BitAccess, u32, u32)>,
}

impl RegisterWrite {
    /// Prepares writes. Reads the registers that contain single bits to write.
    ///
    /// # Errors
    /// The instance has no such PLC, or the emulator has ended.
    pub(crate) fn of(session: &Session, writes: &[(NamedLocation, u32)]) -> Result<Vec<Self>, CliError> {
        let mut registers = Vec::new();
        for (place, _) in writes {
            if let Some(BitAccess { offset, width, .. }) = place.bit_access() {
                registers.push(Op::Peek { plc: session.plc_of(place)?, offset, width });
            }
        }
        let mut replies = session.request_in_parts(&registers)?.into_iter();
        // Several writes may concern bits of one register. So each write to a bit starts from the value after the
        // preceding writes.
        let mut known: HashMap<(DeviceIndex, u32), u32> = HashMap::new();
        let mut prepared = Vec::with_capacity(writes.len());
        for (place, value) in writes {
            let plc = session.plc_of(place)?;
            let write = match place.bit_access() {
                None => Self { plc, offset: place.offset(), width: place.width(), value: *value, bit: None },
                Some(access) => {
                    let read = replies.next().map(Reply::value).transpose()?.unwrap_or_default();
                    let current = known.get(&(plc, access.offset)).copied().unwrap_or(read);
                    let (offset, width, new) = (access.offset, access.width, access.set(current, *value));
                    Self { plc, offset, width, value: new, bit: Some((access, *value, current)) }
                }
            };
            known.insert((plc, write.offset), write.value);
            prepared.push(write);
        }
        Ok(prepared)
    }

    /// Returns the operation that stores the value. For a bit, the operation has no effect if the register has changed
    /// in the meantime.
    pub(crate) fn store(&self) -> Op {
        let Self { plc, offset, width, value, bit } = *self;
        match bit {
            None => Op::Poke { plc, offset, width, value },
            Some((_, _, current)) => Op::CompareExchange { plc, offset, width, current, new: value },
        }
    }

    /// True if the write concerns at least one byte of the forced register.
    pub(crate) fn is_to(&self, forced: &Forced) -> bool {
        self.plc == forced.plc
            && forced.offset < self.offset + self.width.bytes()
            && self.offset < forced.offset + forced.width.bytes()
    }

    /// Returns the operation that forces the register to the value.
    pub(crate) fn force(&self) -> Op {
        let Self { plc, offset, width, value, .. } = *self;
        Op::Force { plc, offset, width, value }
    }

    /// Repeats the store of a bit until no other program writes the register in between, or the register is forced.
    ///
    /// # Errors
    /// The emulator has ended, or refuses the request.
    pub(crate) fn complete(&self, session: &Session, mut reply: Reply) -> Result<(), CliError> {
        let Self { plc, offset, width, bit: Some((access, state, mut before)), .. } = *self else {
            return Ok(());
        };
        while let Reply::Exchanged { ok: false, found: current } = reply {
            // The register is forced (decision D-860).
            if current == before {
                break;
            }
            before = current;
            let new = access.set(current, state);
            let again = session.request(&[Op::CompareExchange { plc, offset, width, current, new }])?;
            let Some(next) = again.into_iter().next() else { break };
            reply = next;
        }
        Ok(())
    }
}
