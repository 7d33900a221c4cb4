//! The object dictionary for SDOs: the entries of `layouts/cs0015/objects.toml` with their present values.

use super::communication::{Communication, PdoDirection, is_cob_id};
use crate::devices::canopen::pdo::Transmission;
use crate::devices::canopen::sdo::{Abort, Dictionary, EntryAddress, Length};
use crate::devices::cs0015::emulation::ram::{RETAIN_BYTES, Registers};
use crate::devices::cs0015::registers::DEVICE;
use crate::layout::Object;
use crate::layout::object::{Access, Default, Type};
use crate::memory::Cell16;

/// Entries of the object dictionary, for one request.
pub(crate) struct Entries<'a> {
    pub communication: &'a mut Communication,
    pub registers: &'a Registers,
    pub error_register: u8,
}

/// Returns direction and number, from 0, of the PDO to which a parameter with this index belongs.
fn parameter(index: u16) -> Option<(PdoDirection, usize)> {
    match index {
        0x1400..=0x1407 => Some((PdoDirection::Receive, usize::from(index - 0x1400))),
        0x1800..=0x1807 => Some((PdoDirection::Transmit, usize::from(index - 0x1800))),
        _ => None,
    }
}

/// Returns the entry, if it exists and is implemented.
fn object(at: EntryAddress) -> Result<&'static Object, Abort> {
    let found = DEVICE.object(at.index, at.sub).filter(|object| object.access != Access::NotImplemented);
    found.ok_or_else(|| {
        let has_index = DEVICE.has_index(at.index);
        let is_named_only =
            DEVICE.object(at.index, 0).is_some_and(|object| object.access == Access::NotImplemented);
        if has_index && !is_named_only { Abort::NoSub } else { Abort::NoObject }
    })
}

impl Entries<'_> {
    /// Returns the word of a PDO that this entry contains (D-411).
    fn word(&self, at: EntryAddress) -> Option<&Cell16> {
        let word = usize::from(at.sub).checked_sub(1)?;
        match at.index {
            0x5800..=0x5870 if at.index & 0xF == 0 => {
                self.registers.rx.a_RX_PDO[usize::from(at.index >> 4 & 7)].get(word)
            }
            0xA100..=0xA107 => self.registers.tx.a_TX_PDO[usize::from(at.index & 7)].get(word),
            _ => None,
        }
    }

    /// Returns a number of any width.
    fn number(&self, at: EntryAddress, object: &Object) -> u32 {
        let (communication, registers) = (&*self.communication, self.registers);
        if let Some(word) = self.word(at) {
            return word.load().into();
        }
        match (at.index, at.sub) {
            (0x1001, _) => self.error_register.into(),
            (0x1005 | 0x100E | 0x1014, _) => communication.stored_cob_id(registers, at.index),
            (0x1006, _) => registers.parameters.d_COMMUNICATION_CYCLE.load(),
            (0x100C, _) => registers.parameters.w_GUARD_TIME.load().into(),
            (0x100D, _) => registers.parameters.b_LIFE_TIME_FACTOR.load().into(),
            (0x1200, 1..=2) => communication.sdo_cob_id(at.sub),
            (0x20F0..=0x20F3, _) => communication.entered(usize::from(at.index - 0x20F0)).into(),
            (index, sub) => match (parameter(index), sub) {
                (Some((way, pdo)), 1) => communication.pdo_cob_id(way, pdo),
                (Some((way, pdo)), 2) => communication.pdo(way, pdo).written_kind.code().into(),
                _ => object.default.at_node(communication.node()),
            },
        }
    }

    fn write_number(&mut self, at: EntryAddress, value: u32) -> Result<(), Abort> {
        if let Some(word) = self.word(at) {
            word.store(value as u16);
            return Ok(());
        }
        let parameters = &self.registers.parameters;
        match (at.index, at.sub) {
            (0x1005 | 0x100E | 0x1014, _) | (0x1200, _) | (_, 1) if !is_cob_id(value) => {
                return Err(Abort::Value);
            }
            (0x1005, _) => parameters.d_COB_ID_SYNC.store(value),
            (0x100E, _) => parameters.d_COB_ID_GUARDING.store(value),
            (0x1014, _) => parameters.d_COB_ID_EMCY.store(value),
            (0x1006, _) => parameters.d_COMMUNICATION_CYCLE.store(value),
            (0x100C, _) => parameters.w_GUARD_TIME.store(value as u16),
            (0x100D, _) => parameters.b_LIFE_TIME_FACTOR.store(value as u8),
            (0x1200, sub) => self.communication.set_sdo_cob_id(sub, value),
            (0x20F0..=0x20F3, _) => {
                let entry = usize::from(at.index - 0x20F0);
                if !self.communication.enter(self.registers, entry, value as u8) {
                    return Err(Abort::Value);
                }
            }
            (index, sub) => {
                let (way, pdo) = parameter(index).ok_or(Abort::ReadOnly)?;
                if sub == 1 {
                    self.communication.set_pdo_cob_id(way, pdo, value);
                } else {
                    let kind = Transmission::from_code(value as u8).ok_or(Abort::Value)?;
                    self.communication.pdo_mut(way, pdo).written_kind = kind;
                }
            }
        }
        Ok(())
    }
}

impl Dictionary for Entries<'_> {
    fn writable(&self, at: EntryAddress) -> Result<Length, Abort> {
        let object = object(at)?;
        if object.access != Access::ReadWrite {
            return Err(Abort::ReadOnly);
        }
        Ok(object.ty.and_then(Type::bytes).map_or(Length::UpTo(RETAIN_BYTES), Length::Exactly))
    }

    fn read(&self, at: EntryAddress) -> Result<Vec<u8>, Abort> {
        let object = object(at)?;
        Ok(match (object.ty.and_then(Type::bytes), object.default) {
            (Some(bytes), _) => self.number(at, object).to_le_bytes().into_iter().take(bytes).collect(),
            (None, Default::Text(text)) => text.as_bytes().to_vec(),
            (None, _) => self.registers.retain(),
        })
    }

    fn write(&mut self, at: EntryAddress, value: &[u8]) -> Result<(), Abort> {
        if object(at)?.ty == Some(Type::Domain) {
            self.registers.set_retain(value);
            return Ok(());
        }
        let mut bytes = [0; 4];
        bytes.iter_mut().zip(value).for_each(|(to, from)| *to = *from);
        self.write_number(at, u32::from_le_bytes(bytes))
    }
}
