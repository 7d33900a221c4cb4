//! Registers and addresses as users name them.

use super::value::{self, ValueError};
use super::{
    Address, Area, DeviceFit, Fit, LayoutError, Meaning, Owner, RegType, RegisterPhase, RegisterRef, Width,
    format_value,
};
use std::collections::HashSet;
use thiserror::Error;

/// A value that the register cannot hold.
#[derive(Debug, PartialEq, Eq, Error)]
#[error("{place}: {source}")]
pub struct BadValue {
    /// Name and address of the register.
    pub place: String,
    /// The error in the value.
    pub source: ValueError,
}

/// Data to access a single bit through the register that contains it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitAccess {
    /// First byte of the register in the image.
    pub offset: u32,
    /// Width of the register.
    pub width: Width,
    /// Number of the bit in the register.
    pub bit: u32,
}

impl BitAccess {
    /// Returns `value` with this bit set to 0 if `state` is 0, otherwise to 1.
    #[must_use]
    pub const fn set(self, value: u32, state: u32) -> u32 {
        let cleared = value & !(1 << self.bit);
        if state == 0 { cleared } else { cleared | 1 << self.bit }
    }
}

/// A register or an address that the user has named. It exists in the layout, but the PLC in the name need not exist in
/// the plant.
#[derive(Clone, Debug)]
pub struct NamedLocation {
    /// The text as given, without the PLC.
    text: String,
    /// The PLC before the name, if one was given.
    pub plc: Option<String>,
    address: Address,
    area: &'static Area,
    /// The registers at this place; several if structures overlay each other.
    registers: Vec<RegisterRef>,
    /// True if the slot of their port is empty.
    is_empty: bool,
}

impl NamedLocation {
    /// Looks up `[PLC:]REGISTER` or `[PLC:]%ADDRESS` of a device.
    ///
    /// # Errors
    /// There is no such register or address.
    pub fn parse(fitted: &DeviceFit, text: &str) -> Result<Self, LayoutError> {
        let target = fitted.target(text)?;
        Ok(Self {
            text: target.plc.map_or(text, |plc| &text[plc.len() + 1..]).to_owned(),
            plc: target.plc.map(str::to_owned),
            address: target.address,
            area: target.area,
            registers: target.registers,
            is_empty: fitted.area(target.area) == Fit::Empty,
        })
    }

    /// Returns the text as given, without the PLC.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the offset of the first byte in the image.
    pub fn offset(&self) -> u32 {
        self.address.offset()
    }

    /// Returns the width of the access.
    pub fn width(&self) -> Width {
        self.address.width()
    }

    /// Returns the bit of the byte, if the place is a single bit.
    pub fn bit(&self) -> Option<u8> {
        self.address.bit()
    }

    /// Refuses a single bit, where only a whole register is possible.
    ///
    /// # Errors
    /// [`LayoutError::OneBit`], which names the whole register.
    pub fn whole_only(&self) -> Result<(), LayoutError> {
        if self.bit().is_none() {
            return Ok(());
        }
        let register = self.registers.first().map(RegisterRef::name);
        let whole = register.unwrap_or_else(|| self.address.of_byte().to_string());
        Err(LayoutError::OneBit { text: self.text.clone(), whole })
    }

    /// Returns the address: `%MW3.200000`.
    pub fn address(&self) -> Address {
        self.address
    }

    /// Returns the register that shows which structure is valid, if structures overlay each other.
    pub fn status(&self) -> Option<RegisterRef> {
        status_of(self.area)
    }

    /// Returns the phase that the value `status` of the register from [`NamedLocation::status`] means. If the value is not
    /// known, returns the last phase.
    pub fn phase(&self, status: Option<u32>) -> RegisterPhase {
        self.area.phase(status)
    }

    /// Returns the phase in which the device is operated. For callers that do not know the present phase or do not need
    /// it.
    pub fn last_phase(&self) -> RegisterPhase {
        self.area.phase(None)
    }

    /// Returns the area of the place.
    pub fn area(&self) -> &'static Area {
        self.area
    }

    /// Returns the register in phase `live` that is exactly this place. `None` if the place is a part of a register or
    /// several registers.
    pub(crate) fn exact(&self, live: RegisterPhase) -> Option<RegisterRef> {
        let exact = |found: &&RegisterRef| found.address() == self.address;
        let live_ones = || self.registers.iter().filter(|found| is_live(found, live));
        live_ones().find(exact).or(self.registers.iter().find(exact)).copied()
    }

    /// Data type in which values are parsed and shown.
    pub fn ty(&self, live: RegisterPhase) -> RegType {
        match (self.exact(live), self.address.width()) {
            (Some(register), _) => register.ty(),
            (None, Width::Byte) => RegType::Byte,
            (None, Width::Word) => RegType::Word,
            (None, Width::Dword) => RegType::Dword,
        }
    }

    /// Returns the meanings of values, if the place is a single register and the layout has meanings.
    pub fn meanings(&self, live: RegisterPhase) -> Option<&'static Meaning> {
        self.exact(live).and_then(|register| register.register.meaning)
    }

    /// Returns the register to which a single bit belongs, and the number of the bit in it.
    pub fn bit_in(&self) -> Option<(RegisterRef, u32)> {
        let register = self.registers.first()?;
        Some((*register, self.bit_of(register)?))
    }

    /// How a program writes the single bit. `None` if the place is not a single bit. A bit outside of all registers is
    /// written together with its byte.
    pub fn bit_access(&self) -> Option<BitAccess> {
        let bit = self.bit()?;
        let of_register = self.bit_in().map(|(register, bit)| {
            let address = register.address();
            BitAccess { offset: address.offset(), width: address.width(), bit }
        });
        Some(of_register.unwrap_or(BitAccess { offset: self.offset(), width: self.width(), bit: bit.into() }))
    }

    /// Returns offset and width of the whole register. For a single bit, this is the register that contains the bit.
    #[cfg(feature = "cli")]
    pub(crate) fn whole(&self) -> (u32, Width) {
        self.bit_access().map_or((self.offset(), self.width()), |bit| (bit.offset, bit.width))
    }

    /// Returns the name of the register, with the number of the bit if it was given in this form; otherwise the
    /// address.
    pub fn name(&self, live: RegisterPhase) -> String {
        if let Some((register, bit)) = self.named_bit() {
            return format!("{register}.{bit}");
        }
        self.exact(live).map_or_else(|| self.address.to_string(), |register| register.name())
    }

    /// Returns the register and its bit, if the user has given the bit by the name of the register.
    fn named_bit(&self) -> Option<(&RegisterRef, u32)> {
        let register = self.registers.first().filter(|_| !self.text.starts_with('%'))?;
        Some((register, self.bit_of(register)?))
    }

    /// Returns the number of the bit in `register`.
    fn bit_of(&self, register: &RegisterRef) -> Option<u32> {
        Some(u32::from(self.bit()?) + 8 * (self.offset() - register.offset()))
    }

    /// Returns the name and address for messages: `node2.w_CPU_CONTROL (%MW3.200000)`.
    pub fn label(&self, live: RegisterPhase) -> String {
        match self.name(live) {
            name if name.starts_with('%') || name == self.address.to_string() => name,
            name => format!("{name} ({})", self.address),
        }
    }

    /// Parses a value for this place: a number, or a name of the register's values or bits (`value::named`).
    ///
    /// # Errors
    /// `BadValue`, which names the register.
    pub fn parse_value(&self, text: &str) -> Result<u32, BadValue> {
        // The valid structure is not known here, but any structure gives the right result: the types at one address
        // differ only in their names.
        let live = self.last_phase();
        let ty = self.ty(live);
        let value = match (self.bit(), self.exact(live)) {
            (Some(_), _) => value::parse_bit(text),
            (None, Some(register)) => {
                value::parse(text, ty).or_else(|error| value::named(text, register.register.meaning, error))
            }
            (None, None) => value::parse(text, ty),
        };
        value.map_err(|source| BadValue { place: self.label(live), source })
    }

    /// Parses a bit pattern for this place, for example a mask. A pattern is also a value, but every decimal number that
    /// fits the width without a sign is a pattern, whatever the type of the register: 255 for a SINT.
    ///
    /// # Errors
    /// `BadValue`, which names the register.
    pub(crate) fn parse_pattern(&self, text: &str) -> Result<u32, BadValue> {
        self.parse_value(text).or_else(|error| match error.source {
            ValueError::Range { ty, .. } => {
                value::parse(text, ty.pattern()).map_err(|source| BadValue { source, ..error })
            }
            _ => Err(error),
        })
    }

    /// True if this is exactly one register or plain RAM, and not a part of a register or several registers.
    pub fn is_whole(&self) -> bool {
        self.registers.is_empty() || self.exact(self.last_phase()).is_some()
    }

    /// Returns the side that writes the register in phase `live`; `None` if the place is not exactly one register.
    pub fn owner(&self, live: RegisterPhase) -> Option<Owner> {
        self.exact(live).map(|register| register.owner())
    }

    /// Formats the value in IEC notation. A single bit is formatted as 0 or 1.
    pub fn format(&self, live: RegisterPhase, value: u32) -> String {
        match self.bit() {
            Some(bit) => (value >> bit & 1).to_string(),
            None => format_value(self.ty(live), value),
        }
    }

    /// Returns the meaning of the value, as the layout describes it. For a place that is not a complete register,
    /// returns the register that contains it, the registers that it contains, or the meaning of its bit. If there is no
    /// register at this place, or the slot is empty, returns a text that says so.
    pub fn meaning(&self, phase: RegisterPhase, value: u32) -> String {
        if self.is_empty {
            return "nothing is plugged in".to_owned();
        }
        if let Some(register) = self.exact(phase) {
            return meaning_in(&register, phase, value);
        }
        let live: Vec<_> = self.registers.iter().filter(|found| is_live(found, phase)).copied().collect();
        if !live.is_empty() {
            return self.meaning_of_parts(&without_twins(live), value);
        }
        let parts = without_twins(self.registers.clone());
        let meaning = self.meaning_of_parts(&parts, value);
        match parts.as_slice() {
            [] => meaning,
            [register] => not_live(&meaning, register.structure().name),
            _ => format!("{meaning} (not live)"),
        }
    }

    /// Returns the meaning of a place that is a part of one of the registers, or contains them.
    fn meaning_of_parts(&self, parts: &[RegisterRef], value: u32) -> String {
        let names: Vec<_> = parts.iter().map(RegisterRef::name).collect();
        match (names.as_slice(), self.bit()) {
            ([], _) => "no register".to_owned(),
            ([name], Some(bit_in_byte)) => {
                let is_set = value >> bit_in_byte & 1 != 0;
                let bit = parts.first().and_then(|register| Some((register, self.bit_of(register)?)));
                let (number, meaning) =
                    bit.map_or((0, String::new()), |(register, bit)| (bit, register.decode_bit(bit, is_set)));
                match (meaning.as_str(), self.named_bit()) {
                    ("", _) => format!("bit {number} of {name}"),
                    (meaning, Some(_)) => meaning.to_owned(),
                    (meaning, None) => format!("bit {number} of {name}: {meaning}"),
                }
            }
            ([name], None) => format!("part of {name}"),
            (several, _) => several.join(", "),
        }
    }
}

/// Returns the register that shows which structure of an area is valid, if structures overlay each other.
pub(crate) fn status_of(area: &'static Area) -> Option<RegisterRef> {
    let phases = area.phases?;
    let placed = area.structures.iter().find(|placed| placed.live != RegisterPhase::ALWAYS)?;
    area.registers_of(placed).find(|register| register.register.name == phases.register)
}

/// True if the register is valid in phase `live`. Its structure is then valid, or shares the register with a valid
/// structure.
pub(crate) fn is_live(register: &RegisterRef, live: RegisterPhase) -> bool {
    let structures = register.area.structures.iter().filter(|placed| placed.live.is_valid_in(live));
    structures.filter(|placed| placed.shares_role(register.placed)).any(|placed| {
        core::ptr::eq(placed.structure, register.structure())
            || placed
                .structure
                .registers
                .iter()
                .any(|other| other.name == register.register.name && other.offset == register.register.offset)
    })
}

/// Removes duplicate registers, because structures that overlay each other share their first registers.
pub(crate) fn without_twins(mut registers: Vec<RegisterRef>) -> Vec<RegisterRef> {
    let mut known = HashSet::with_capacity(registers.len());
    registers.retain(|register| known.insert((register.offset(), register.register.name)));
    registers
}

/// Returns the meaning of `value` in a register, with a note if the structure of the register is not valid.
pub(crate) fn meaning_in(register: &RegisterRef, live: RegisterPhase, value: u32) -> String {
    let meaning = register.decode(value);
    match live_name(register, live) {
        None => meaning,
        Some(structure) => not_live(&meaning, structure),
    }
}

fn not_live(meaning: &str, structure: &str) -> String {
    format!("{meaning} ({structure}, not live)")
}

/// Returns the name of the register's structure if this structure is not valid.
fn live_name(register: &RegisterRef, live: RegisterPhase) -> Option<&'static str> {
    (!is_live(register, live)).then_some(register.structure().name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::devices::samples::tables::phases;

    fn place(text: &str) -> NamedLocation {
        NamedLocation::parse(&DeviceFit::unknown(&DEVICE), text).unwrap()
    }

    #[test]
    fn names_and_addresses_lead_to_the_same_register() {
        let by_name = place("line2:node2.w_OPTION_STATUS");
        assert_eq!((by_name.plc.as_deref(), by_name.text()), (Some("line2"), "node2.w_OPTION_STATUS"));
        let by_address = place("%MW3.200002");
        assert_eq!(by_address.name(phases::CYCLIC), "node2.w_OPTION_STATUS");
        assert_eq!(by_address.name(phases::INIT), "node2.w_OPTION_STATUS");
        assert_eq!(by_address.format(phases::CYCLIC, 0x43), "16#0043");
    }

    #[test]
    fn the_phase_decides_between_overlaid_structures() {
        let overlaid = place("%MB3.200012");
        assert_eq!(overlaid.name(phases::INIT), "node2.b_MA_SL_MODE");
        assert_eq!(overlaid.name(phases::CYCLIC), "node2.b_CTRLREG_WRC1");
        let init = place("node2.b_BT_0");
        assert!(!init.meaning(phases::INIT, 0).contains("not live"));
        let structure = DEVICE.register("node2.b_BT_0").unwrap().structure().name;
        assert!(init.meaning(phases::CYCLIC, 0).ends_with(&format!("({structure}, not live)")));
        assert!(!place("node2.w_OPTION_STATUS").meaning(phases::INIT, 1).contains("not live"));
        let bit = place("node2.b_CTRLREG_WRC1.2");
        assert_eq!(bit.meaning(phases::CYCLIC, 0), "bit 2 of node2.b_CTRLREG_WRC1");
        let structure = DEVICE.register("node2.b_CTRLREG_WRC1").unwrap().structure().name;
        let text = format!("bit 2 of node2.b_CTRLREG_WRC1 ({structure}, not live)");
        assert_eq!(bit.meaning(phases::INIT, 0), text);
    }

    #[test]
    fn parts_of_registers_are_named() {
        assert_eq!(place("%MB3.200003").meaning(phases::CYCLIC, 0), "part of node2.w_OPTION_STATUS");
        assert_eq!(
            place("%MD3.200000").meaning(phases::CYCLIC, 0),
            "node2.w_CPU_CONTROL, node2.w_OPTION_STATUS"
        );
        let bit = place("%MX3.200003.1");
        assert_eq!(bit.meaning(phases::CYCLIC, 2), "bit 9 of node2.w_OPTION_STATUS");
        assert_eq!((bit.format(phases::CYCLIC, 2), bit.format(phases::CYCLIC, 1)), ("1".into(), "0".into()));
        assert_eq!(place("%MD3.1000000").meaning(phases::CYCLIC, 0), "no register");
    }

    #[test]
    fn a_bit_given_by_name_keeps_it_and_has_its_meaning() {
        let bit = place("node2.w_CPU_CONTROL.10");
        assert_eq!(bit.name(phases::CYCLIC), "node2.w_CPU_CONTROL.10");
        assert_eq!(bit.label(phases::CYCLIC), "node2.w_CPU_CONTROL.10 (%MX3.200001.2)");
        let named = place("node2.w_CPU_CONTROL.7");
        assert_eq!(named.meaning(phases::CYCLIC, 0x80), "reset CAN controller");
        assert_eq!(named.meaning(phases::CYCLIC, 0), "bit 7 of node2.w_CPU_CONTROL");
        let by_address = place("%MX3.200000.7").meaning(phases::CYCLIC, 0x80);
        assert_eq!(by_address, "bit 7 of node2.w_CPU_CONTROL: reset CAN controller");
    }

    #[test]
    fn parts_of_registers_and_several_at_once_are_not_whole() {
        for whole in ["node2.w_CPU_CONTROL", "%MW3.200000", "%MD3.1000000", "%MB3.200012"] {
            assert!(place(whole).is_whole(), "{whole}");
        }
        for not in ["%MD3.200000", "%MB3.200001", "%MX3.200000.0", "node2.w_CPU_CONTROL.0"] {
            assert!(!place(not).is_whole(), "{not}");
        }
    }

    #[test]
    fn values_are_checked_against_the_registers_type() {
        assert_eq!(place("node2.a_WR_VALUE[0]").parse_value("-1").unwrap(), 0xFFFF_FFFF);
        let error = place("node2.w_CPU_CONTROL").parse_value("-1").unwrap_err();
        let text = "node2.w_CPU_CONTROL (%MW3.200000): `-1` is out of range, a WORD holds 0 to 65535 (16#0 to 16#FFFF)";
        assert_eq!(error.to_string(), text);
        let bit = place("%MX3.200000.1");
        assert_eq!(["0", "16#1", "false", " True "].map(|text| bit.parse_value(text).unwrap()), [0, 1, 0, 1]);
        for wrong in ["2", "16#2", "-1", "300", "many", ""] {
            let text = format!(
                "%MX3.200000.1: `{wrong}` is no value of a single bit; write 0 or 1, or FALSE or TRUE"
            );
            assert_eq!(bit.parse_value(wrong).unwrap_err().to_string(), text);
        }
    }
}
