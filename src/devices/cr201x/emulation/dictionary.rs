//! The object dictionary of a module for SDOs: the entries of `layouts/cr201x/objects.toml` with their present values.

use super::channels::Channels;
use crate::devices::canopen::sdo::{Abort, Dictionary, EntryAddress, Length};
use crate::devices::cr201x::registers::DEVICE;
use crate::layout::Object;
use crate::layout::object::{Access, Type};
use serde::{Deserialize, Serialize};

/// Guarding parameters that a master can set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Guarding {
    pub guard_ms: u16,
    pub life: u8,
}

/// Values in PDOs: bits of all connectors, and four words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PdoValues {
    pub bits: u8,
    pub words: [u16; 4],
}

/// Entries of the object dictionary, for one request.
pub(super) struct Entries<'a> {
    pub inputs: PdoValues,
    pub outputs: PdoValues,
    pub node: u8,
    pub error_register: u8,
    pub guarding: &'a mut Guarding,
    pub channels: &'a mut Channels,
}

fn object(at: EntryAddress) -> Result<&'static Object, Abort> {
    let missing = if DEVICE.has_index(at.index) { Abort::NoSub } else { Abort::NoObject };
    DEVICE.object(at.index, at.sub).ok_or(missing)
}

/// Returns the index for a sub-index. Sub-indices are counted from 1, indices from 0.
fn index(at: EntryAddress) -> usize {
    usize::from(at.sub).saturating_sub(1)
}

impl Dictionary for Entries<'_> {
    fn writable(&self, at: EntryAddress) -> Result<Length, Abort> {
        let object = object(at)?;
        if object.access != Access::ReadWrite {
            return Err(Abort::ReadOnly);
        }
        object.ty.and_then(Type::bytes).map(Length::Exactly).ok_or(Abort::ReadOnly)
    }

    fn read(&self, at: EntryAddress) -> Result<Vec<u8>, Abort> {
        let object = object(at)?;
        let Some(bytes) = object.ty.and_then(Type::bytes) else {
            return Ok(self.channels.model.name().as_bytes().to_vec());
        };
        let value = match (at.index, at.sub) {
            (0x1001, _) => self.error_register.into(),
            (0x100C, _) => self.guarding.guard_ms.into(),
            (0x100D, _) => self.guarding.life.into(),
            (0x2000, 1..) => self.channels.kinds.get(index(at)).copied().unwrap_or(0).into(),
            (0x2001, _) => self.channels.pwm_hz.into(),
            (0x6000, 1) => self.inputs.bits.into(),
            (0x6200, 1) => self.outputs.bits.into(),
            (0x6401, 1..) => self.inputs.words.get(index(at)).copied().unwrap_or(0).into(),
            (0x6411, 1..) => self.outputs.words.get(index(at)).copied().unwrap_or(0).into(),
            _ => object.default.at_node(self.node),
        };
        Ok(value.to_le_bytes().into_iter().take(bytes).collect())
    }

    fn write(&mut self, at: EntryAddress, value: &[u8]) -> Result<(), Abort> {
        let [low, high] = [0, 1].map(|byte| value.get(byte).copied().unwrap_or(0));
        let is_right = match at.index {
            0x100C => {
                self.guarding.guard_ms = u16::from_le_bytes([low, high]);
                true
            }
            0x100D => {
                self.guarding.life = low;
                true
            }
            0x2000 => self.channels.set(index(at), low),
            0x2001 => self.channels.set_pwm(low),
            _ => return Err(Abort::ReadOnly),
        };
        is_right.then_some(()).ok_or(Abort::Value)
    }
}
