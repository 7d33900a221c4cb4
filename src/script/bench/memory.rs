//! Copies of register areas, and their changes.

use super::Bench;
use crate::identity::DeviceIndex;
use crate::layout::place::{status_of, without_twins};
use crate::layout::{Area, DeviceFit, DeviceLayout, RegisterPhase, RegisterRef, split_plc};
use crate::request::{Op, ranges};
use crate::script::ScenarioError;
use core::panic::Location;

/// All registers of an area at one moment.
#[derive(Clone, Debug)]
pub struct MemoryCopy {
    plc: DeviceIndex,
    /// Prefix of the names: the PLC, if the plant has several.
    prefix: String,
    fitted: DeviceFit,
    area: &'static Area,
    bytes: Vec<u8>,
}

/// A register with a changed value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// Name of the register.
    pub register: String,
    /// Address of the register.
    pub address: String,
    /// Value in the first snapshot.
    pub before: u32,
    /// Value in the second snapshot.
    pub after: u32,
    /// The value before and the value after the change with their meanings: `16#0001 ... -> 16#0002 ...`.
    pub text: String,
}

impl MemoryCopy {
    /// Copies the registers of an area of PLC number `plc`. `read` gets an offset in the image of the PLC and a number
    /// of bytes, and reads these bytes.
    ///
    /// # Errors
    /// Returns the errors of `read`.
    pub fn read<E>(
        (plc, prefix): (DeviceIndex, String),
        fitted: DeviceFit,
        area: &'static Area,
        read: impl FnOnce(u32, u32) -> Result<Vec<u8>, E>,
    ) -> Result<Self, E> {
        let len = area.structures.iter().map(|placed| placed.structure.bytes).max().unwrap_or(0);
        Ok(Self { plc, prefix, fitted, area, bytes: read(area.first, len)? })
    }

    /// Returns the name of the area, with the PLC as a prefix if there are several.
    pub fn area(&self) -> String {
        format!("{}{}", self.prefix, self.area.name)
    }

    /// True if both copies are of the same area of the same device.
    pub fn is_of_area_of(&self, other: &Self) -> bool {
        (self.plc, &self.prefix, self.fitted.device()) == (other.plc, &other.prefix, other.fitted.device())
            && core::ptr::eq(self.area, other.area)
    }

    /// Returns the registers with their values in the copy, in the order of their addresses. If structures overlay each
    /// other, the copy contains only the registers of the valid structure.
    pub fn registers(&self) -> Vec<(String, i64)> {
        let number = |register: &RegisterRef| register.ty().number(self.value(register));
        let registers = self.live_registers(self.live(), |_| true);
        registers.iter().map(|register| (format!("{}{register}", self.prefix), number(register))).collect()
    }

    /// Returns the changes from this copy to `now`, in the order of the addresses. If structures overlay each other,
    /// only registers of the valid structure in `now` count. Both copies must be of the same area.
    pub fn changes(&self, now: &Self) -> Vec<Change> {
        let is_other = |register: &RegisterRef| self.value(register) != now.value(register);
        let changed = now.live_registers(now.live(), is_other);
        let change = |register: &RegisterRef| {
            let [before, after] = [self, now].map(|copy| copy.value(register));
            let [was, is] = [before, after]
                .map(|value| format!("{} {}", register.format_value(value), register.decode(value)));
            Change {
                register: format!("{}{register}", now.prefix),
                address: register.address().to_string(),
                before,
                after,
                text: format!("{} -> {}", was.trim_end(), is.trim_end()),
            }
        };
        changed.iter().map(change).collect()
    }

    fn live_registers(&self, live: RegisterPhase, wanted: impl Fn(&RegisterRef) -> bool) -> Vec<RegisterRef> {
        let all = self.fitted.registers_in(self.area, live);
        let mut found = without_twins(all.filter(wanted).collect());
        found.sort_by_key(RegisterRef::offset);
        found
    }

    fn value(&self, register: &RegisterRef) -> u32 {
        let start = (register.offset() - self.area.first) as usize;
        let bytes = self.bytes.get(start..start + register.width() as usize).unwrap_or_default();
        bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
    }

    fn live(&self) -> RegisterPhase {
        self.area.phase(status_of(self.area).map(|status| self.value(&status)))
    }
}

/// Returns the area with this name, if it has registers.
pub(super) fn register_area(
    device: &'static DeviceLayout,
    name: &str,
) -> Result<&'static Area, ScenarioError> {
    let with_registers = || device.named_areas().filter(|area| !area.structures.is_empty());
    with_registers().find(|area| area.name == name).ok_or_else(|| {
        let known: Vec<_> = with_registers().map(|area| area.name).collect();
        ScenarioError::Unknown { what: "area", name: name.to_owned(), known: known.join(", ") }
    })
}

impl Bench {
    /// Copies the registers of an area, for example `node2` or `line2:node1`.
    ///
    /// # Errors
    /// There is no such area, or it has no registers.
    pub fn snapshot(&mut self, area: &str) -> Result<MemoryCopy, ScenarioError> {
        let (plc, name) = split_plc(area);
        let plc = self.plc(plc, name)?;
        self.copy(plc, register_area(self.names.device(plc), name)?)
    }

    fn copy(&mut self, plc: DeviceIndex, area: &'static Area) -> Result<MemoryCopy, ScenarioError> {
        let (of, fitted) = ((plc, self.prefix(plc)), self.names.fitted(plc));
        MemoryCopy::read(of, fitted, area, |offset, len| {
            let mut bytes = Vec::with_capacity(len as usize);
            for (offset, len) in ranges(offset, len) {
                bytes.extend(self.ask(Op::ReadRange { plc, offset, len })?.bytes()?);
            }
            Ok(bytes)
        })
    }

    /// Returns the registers that have changed since the snapshot, in the order of their addresses.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    pub fn changes(&mut self, since: &MemoryCopy) -> Result<Vec<Change>, ScenarioError> {
        let now = self.copy(since.plc, since.area)?;
        Ok(since.changes(&now))
    }

    /// Expects that exactly these registers have changed since the snapshot, in any order.
    ///
    /// # Errors
    /// Another register has changed, one of these registers has not changed, or a name is wrong.
    #[track_caller]
    pub fn expect_changes(&mut self, since: &MemoryCopy, registers: &[&str]) -> Result<(), ScenarioError> {
        let at = Location::caller();
        let mut wanted = Vec::with_capacity(registers.len());
        for text in registers {
            let register = self.find(text)?;
            let live = self.live(&register)?;
            wanted.push(register.name(live));
        }
        let changes = self.changes(since)?;
        let too_many = changes.iter().filter(|change| !wanted.contains(&change.register));
        let too_many =
            too_many.map(|change| format!("{} ({}) {}", change.register, change.address, change.text));
        let missing = wanted.iter().filter(|name| !changes.iter().any(|change| change.register == **name));
        let missing = missing.map(|name| format!("{name} has not changed"));
        let wrong: Vec<_> = too_many.chain(missing).collect();
        if wrong.is_empty() {
            return Ok(());
        }
        let what = format!("the changed registers of {} are not the expected ones", since.area());
        let mut failure = self.failure(what, at)?;
        failure.expected = Some(if wanted.is_empty() { "no change".to_owned() } else { wanted.join(", ") });
        failure.actual = Some(wrong.join("\n            "));
        Err(failure.into())
    }
}
