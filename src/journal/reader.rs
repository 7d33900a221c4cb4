//! Translates numbers in records into names and registers.

use super::catalogue::Catalogue;
use super::event::{Origin, Source};
use super::names::Names;
use super::record::Record;
use super::registers::State;
use crate::identity::{DeviceIndex, PortNumber};
use crate::layout::{Address, Area, RegType, RegisterPhase, RegisterRef, Width, format_value};
use std::collections::HashMap;
use std::sync::Arc;

/// Names of devices and buses, and the phase of each port according to the records so far. The name of a register
/// depends on the phase, because structures overlay each other.
pub struct Reader {
    pub(crate) names: Names,
    pub(crate) catalogue: &'static Catalogue,
    /// True if the phases of all ports are known. A record contains them, or the reader has had all records since
    /// power-on. A port without a record is then in its first phase.
    knows_phases: Option<bool>,
    /// True if any record so far has contained phases. If so, later records contain phases wherever the reader may not
    /// know them.
    gets_phases: bool,
    live: HashMap<Origin, RegisterPhase>,
    /// Octets of the last record.
    octets: Option<Arc<[u8]>>,
    registers: HashMap<(DeviceIndex, u32, RegisterPhase), Option<RegisterRef>>,
}

impl Reader {
    /// Creates a reader without records.
    pub(super) fn new(names: Names, catalogue: &'static Catalogue) -> Self {
        Reader {
            names,
            catalogue,
            knows_phases: None,
            gets_phases: false,
            live: HashMap::new(),
            octets: None,
            registers: HashMap::new(),
        }
    }

    /// Takes the phase and the octets from a record.
    pub(super) fn observe(&mut self, record: &Record) {
        if let Some(phases) = &record.phases {
            self.knows_phases = Some(true);
            self.gets_phases = true;
            self.live = phases.iter().map(|it| (it.port, it.live)).collect();
        }
        self.knows_phases.get_or_insert(record.seq == 0);
        self.octets.clone_from(&record.octets);
        if let Some(State { origin, live, .. }) = record.event.get() {
            self.live.insert(origin, live);
        }
    }

    /// Called when records are missing: phases may have changed.
    pub(super) fn gap(&mut self) {
        if self.gets_phases {
            return;
        }
        self.knows_phases = Some(false);
        self.live.clear();
    }

    /// Returns the octets of the last record, if the record has octets in addition to its event.
    pub(crate) fn octets(&self) -> Option<Arc<[u8]>> {
        self.octets.clone()
    }

    /// Returns the name of a kind of fault.
    pub(crate) fn fault(&self, number: u8) -> &'static str {
        self.catalogue.fault(number).unwrap_or("unknown")
    }

    fn live(&self, plc: DeviceIndex, area: &Area) -> RegisterPhase {
        let mut ports = self.names.device(plc).ports.iter();
        let port = ports.find(|port| port.area.bytes > 0 && port.area.first == area.first);
        let node = port.map_or(PortNumber::DEVICE, |port| port.number);
        match self.live.get(&Origin { plc, node }) {
            Some(live) => *live,
            None if self.knows_phases == Some(true) => area.first_phase(),
            None => area.phase(None),
        }
    }

    /// Returns the register that begins at `offset` of the device's RAM.
    fn register(&mut self, plc: DeviceIndex, offset: u32) -> Option<RegisterRef> {
        let device = self.names.device(plc);
        let live = self.live(plc, device.area_at(device.at(Width::Byte, offset)).ok()?);
        self.valid_register(plc, offset, live)
    }

    /// Returns the register that begins at `offset` in phase `live`.
    fn valid_register(&mut self, plc: DeviceIndex, offset: u32, live: RegisterPhase) -> Option<RegisterRef> {
        let fitted = self.names.fitted(plc);
        let address = fitted.device().at(Width::Byte, offset);
        *self.registers.entry((plc, offset, live)).or_insert_with(|| {
            let found = fitted.registers_at(address, Some(live)).ok()?;
            found.into_iter().find(|register| register.offset() == offset)
        })
    }

    /// Returns the register at `offset`, if an access of `width` bytes covers exactly one register.
    pub(super) fn accessed(&mut self, plc: DeviceIndex, offset: u32, width: u8) -> RegisterLocation {
        let register = self.register(plc, offset);
        self.place(register, plc, offset, width)
    }

    /// Returns the register of this width at `offset` in phase `live`. If the area does not use the register of this phase,
    /// the bytes belong to a register of another phase, which has another width.
    pub(super) fn followed(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        live: RegisterPhase,
    ) -> RegisterLocation {
        let is_followed =
            |register: &RegisterRef| register.offset() == offset && register.width() == width.bytes();
        let register = self.valid_register(plc, offset, live).and_then(|register| {
            if is_followed(&register) {
                return Some(register);
            }
            let fitted = self.names.fitted(plc);
            let all = fitted.registers_at(fitted.device().at(Width::Byte, offset), None).ok()?;
            all.into_iter().find(is_followed)
        });
        self.place(register, plc, offset, width.bytes() as u8)
    }

    fn place(
        &self,
        register: Option<RegisterRef>,
        plc: DeviceIndex,
        offset: u32,
        width: u8,
    ) -> RegisterLocation {
        let register = register.filter(|register| register.width() == u32::from(width));
        let width = Width::of_bytes(width.into()).unwrap_or(Width::Dword);
        let device = self.names.device(plc);
        let address = device.aligned(width, offset).unwrap_or(device.at(Width::Byte, offset));
        RegisterLocation { register, address, ty: width.bits() }
    }

    /// Returns the register at `offset`, of any width.
    pub(crate) fn whole(&mut self, plc: DeviceIndex, offset: u32) -> RegisterLocation {
        match self.register(plc, offset) {
            Some(register) => {
                RegisterLocation { register: Some(register), address: register.address(), ty: register.ty() }
            }
            None => self.accessed(plc, offset, 2),
        }
    }

    /// Returns the name of a port, with its device as a prefix: `line:node2`.
    #[must_use]
    pub fn port(&self, origin: Origin) -> String {
        self.names.source(Source::Node(origin))
    }

    /// Returns the register `name` of a port.
    pub(crate) fn of_port(&self, origin: Origin, name: &str) -> NamedRegister {
        let fitted = self.names.fitted(origin.plc);
        NamedRegister(fitted.register(&format!("{}.{name}", self.names.port(origin))).ok())
    }
}

/// A register of a port, found by its name; `None` if the device has no such register.
pub(crate) struct NamedRegister(Option<RegisterRef>);

impl NamedRegister {
    /// `w_CPU_CONTROL (%MW3.200000)`
    pub(crate) fn label(&self) -> String {
        let label = |register: &RegisterRef| format!("{} ({})", register.path(), register.address());
        self.0.as_ref().map_or_else(|| "?".to_owned(), label)
    }

    /// `16#0002`
    pub(crate) fn value(&self, value: u32) -> String {
        self.0.as_ref().map_or_else(|| format!("16#{value:04X}"), |register| register.format_value(value))
    }

    /// Returns the meaning of the value.
    pub(crate) fn meaning(&self, value: u32) -> String {
        self.0.as_ref().map(|register| register.decode(value)).unwrap_or_default()
    }

    /// Returns the value, and its meaning if it has one: `16#02, end phase detected`.
    pub(crate) fn explained(&self, value: u32) -> String {
        self.value(value) + &after_comma(&self.meaning(value))
    }
}

/// Returns a meaning with a comma before it, for the end of a line; empty if there is none.
fn after_comma(meaning: &str) -> String {
    if meaning.is_empty() { String::new() } else { format!(", {meaning}") }
}

/// A register, or a part of the RAM without one.
pub(crate) struct RegisterLocation {
    register: Option<RegisterRef>,
    address: Address,
    ty: RegType,
}

impl RegisterLocation {
    /// `b_CTRLREG_WRC1 (%MB3.200012)`, or just the address.
    pub(crate) fn label(&self) -> String {
        match &self.register {
            Some(register) => format!("{} ({})", register.path(), self.address),
            None => self.address.to_string(),
        }
    }

    /// Returns the name of the register with the name of its area; `None` if the place is not a register.
    pub(super) fn name(&self) -> Option<String> {
        self.register.map(|register| register.name())
    }

    /// Returns the width of the register.
    pub(super) fn width(&self) -> Width {
        self.address.width()
    }

    /// Returns the address of the register.
    pub(super) fn address(&self) -> String {
        self.address.to_string()
    }

    /// `16#05`
    pub(crate) fn value(&self, value: u32) -> String {
        format_value(self.ty, value)
    }

    /// Returns the value as a number of the register's type.
    pub(super) fn number(&self, value: u32) -> i64 {
        self.register.map_or(i64::from(value), |register| register.ty().number(value))
    }

    /// Returns the meaning of the value; `None` if it is just a number.
    pub(super) fn meaning(&self, value: u32) -> Option<String> {
        self.register
            .filter(|register| register.register.meaning.is_some())
            .map(|register| register.decode(value))
    }

    /// Returns the meaning of the value with a comma before it, for the end of a line: `, restart`. Empty if the value is
    /// just a number, or if its meaning has no text.
    pub(super) fn meaning_after_comma(&self, value: u32) -> String {
        after_comma(&self.meaning(value).unwrap_or_default())
    }
}
