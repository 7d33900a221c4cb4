//! Finds the register, PLC or bus with a given name.

use super::ask::Spot;
use super::{Bench, memory};
use crate::identity::{BusIndex, DeviceIndex};
use crate::layout::{Area, NamedLocation, RegisterPhase, plc_prefix, split_plc};
use crate::script::ScenarioError;

/// A register of a plant. [`Bench::find`] returns it, so that it need not be searched again for each access.
#[derive(Clone, Debug)]
pub struct Register {
    pub(super) place: NamedLocation,
    pub(super) spot: Spot,
    /// The PLC as a prefix, if there are several.
    pub(super) prefix: String,
}

impl Register {
    /// Place of the register.
    pub fn place(&self) -> &NamedLocation {
        &self.place
    }

    /// Returns the number of the PLC in the plant.
    pub fn plc(&self) -> DeviceIndex {
        self.spot.plc
    }

    /// Returns the register that a write accesses. For a single bit, the register that contains the bit.
    pub(super) fn written_spot(&self) -> Spot {
        self.place.bit_access().map_or(self.spot, |bit| Spot {
            plc: self.spot.plc,
            offset: bit.offset,
            width: bit.width,
        })
    }

    /// Returns the name of the register: `node2.w_CPU_CONTROL`, with the PLC as a prefix if there are several.
    pub(super) fn name(&self, live: RegisterPhase) -> String {
        format!("{}{}", self.prefix, self.place.name(live))
    }

    /// Returns the name and address of the register: `node2.w_CPU_CONTROL (%MW3.200000)`.
    pub(super) fn label(&self, live: RegisterPhase) -> String {
        format!("{}{}", self.prefix, self.place.label(live))
    }

    /// Returns the value with its meaning, in the form of `commram peek`: `16#0043  [forced] synchronous operation
    /// ...`.
    pub(super) fn describe(&self, live: RegisterPhase, value: u32, forced: bool) -> String {
        let mark = if forced { "[forced] " } else { "" };
        let meaning = self.place.meaning(live, value);
        format!("{}  {mark}{meaning}", self.place.format(live, value)).trim_end().to_owned()
    }

    /// Returns the value as a number of the register's type.
    pub(super) fn number(&self, live: RegisterPhase, value: u32) -> i64 {
        match self.place.bit() {
            Some(bit) => i64::from(value >> bit & 1),
            None => self.place.ty(live).number(value),
        }
    }

    /// True if the value is the same number in all structures that overlay each other at this address.
    pub(super) fn is_same_number(&self) -> bool {
        let mut numbers = self.place.area().all_phases().map(|live| self.place.ty(live).number(u32::MAX));
        let first = numbers.next();
        numbers.all(|number| Some(number) == first)
    }

    /// Returns the mask of the register's bits, and `value` shifted to these bits.
    pub(super) fn pattern(&self, value: u32) -> (u32, u32) {
        match self.place.bit() {
            Some(bit) => (1 << bit, value << bit),
            None => (self.spot.width.max_value(), value),
        }
    }
}

impl Bench {
    /// Returns the PLC with this name; `""` means the only PLC.
    pub(in crate::script) fn only_plc(&self, name: &str) -> Result<DeviceIndex, ScenarioError> {
        match self.names.plcs.as_slice() {
            [_] if name.is_empty() => Ok(DeviceIndex(0)),
            all => position("PLC", all, name).map(DeviceIndex::at),
        }
    }

    /// Returns the PLC and the area that a text such as `node2` or `line2:node1` means.
    ///
    /// # Errors
    /// There is no such PLC or area of registers.
    pub(in crate::script) fn area(&self, text: &str) -> Result<(DeviceIndex, &'static Area), ScenarioError> {
        let (plc, name) = split_plc(text);
        let plc = self.plc(plc, name)?;
        Ok((plc, memory::register_area(self.names.device(plc), name)?))
    }

    /// Returns the register with this name or address.
    ///
    /// # Errors
    /// There is no such register.
    pub fn find(&self, text: &str) -> Result<Register, ScenarioError> {
        let (plc, name) = split_plc(text);
        let plc = self.plc(plc, name)?;
        let place = NamedLocation::parse(&self.names.fitted(plc), text)?;
        let spot = Spot::new(plc, place.address());
        Ok(Register { place, spot, prefix: self.prefix(plc) })
    }

    pub(super) fn whole_register(&self, text: &str) -> Result<Register, ScenarioError> {
        let register = self.find(text)?;
        register.place.whole_only()?;
        Ok(register)
    }

    /// Returns the prefix of names of this PLC.
    pub(super) fn prefix(&self, plc: DeviceIndex) -> String {
        plc_prefix(&self.names.plcs, plc)
    }

    /// Returns the number of the PLC that the prefix `plc` of `text` names.
    pub(in crate::script) fn plc(&self, plc: Option<&str>, text: &str) -> Result<DeviceIndex, ScenarioError> {
        match (plc, self.names.plcs.as_slice()) {
            (Some(name), all) => position("PLC", all, name).map(DeviceIndex::at),
            (None, [_]) => Ok(DeviceIndex(0)),
            (None, all) => Err(ScenarioError::WhichPlc {
                text: text.to_owned(),
                plcs: all.join(", "),
                example: all.first().cloned().unwrap_or_default(),
            }),
        }
    }

    pub(in crate::script) fn bus(&self, name: &str) -> Result<BusIndex, ScenarioError> {
        position("bus", &self.names.buses, name).map(BusIndex::at)
    }

    /// Returns the phase at the register's address: if structures overlay each other, it shows which structure is
    /// valid.
    pub(super) fn live(&mut self, register: &Register) -> Result<RegisterPhase, ScenarioError> {
        let status = register.place.status();
        let status = status.map(|status| self.load(Spot::new(register.spot.plc, status.address())));
        Ok(register.place.phase(status.transpose()?))
    }
}

fn position(what: &'static str, all: &[String], name: &str) -> Result<usize, ScenarioError> {
    let found = all.iter().position(|known| known == name);
    let known = || if all.is_empty() { "none".to_owned() } else { all.join(", ") };
    found.ok_or_else(|| ScenarioError::Unknown { what, name: name.to_owned(), known: known() })
}
