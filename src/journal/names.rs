//! What numbers in records mean: names of PLCs, buses and registers.

use super::{BAPS_NODE, Event, Origin, Record, Source};
use crate::devices::omega_drive_line_2::registers::DEVICE;
use crate::layout::{Address, Live, RegType, RegisterRef, Width, format_value};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::HashMap;

/// Names of the things that records refer to by their index.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Names {
    /// The PLCs, in the order of the plant.
    pub plcs: Vec<String>,
    /// The buses, in the order of the plant.
    pub buses: Vec<String>,
}

impl Names {
    /// The PLC's name; `plc3` if it has none.
    pub(crate) fn plc(&self, index: u16) -> Cow<'_, str> {
        name(&self.plcs, index, "plc")
    }

    /// The bus's name; `bus3` if it has none.
    pub(crate) fn bus(&self, index: u16) -> Cow<'_, str> {
        name(&self.buses, index, "bus")
    }

    /// Bus, PLC, or node as `line:node2`.
    pub(super) fn source(&self, source: Source) -> String {
        match source {
            Source::Bus(index) => self.bus(index).into_owned(),
            Source::Plc(index) => self.plc(index).into_owned(),
            Source::Node(Origin { plc, node: BAPS_NODE }) => format!("{}:baps", self.plc(plc)),
            Source::Node(origin) => format!("{}:node{}", self.plc(origin.plc), origin.node),
        }
    }
}

fn name<'a>(names: &'a [String], index: u16, what: &str) -> Cow<'a, str> {
    match names.get(usize::from(index)) {
        Some(name) => Cow::Borrowed(name),
        None => Cow::Owned(format!("{what}{index}")),
    }
}

/// Names and what the records so far tell about the state of the nodes: INIT and cyclic structure overlay
/// each other, so the name of a register depends on it.
pub(super) struct Context {
    pub names: Names,
    /// Which structure is live in nodes that have not been heard of.
    unheard: Option<Live>,
    live: HashMap<(u16, u8), Live>,
    registers: HashMap<(u32, Live), Option<RegisterRef>>,
}

impl Context {
    pub fn new(names: Names) -> Self {
        Context { names, unheard: None, live: HashMap::new(), registers: HashMap::new() }
    }

    /// Takes note of what a record tells about the state.
    pub fn observe(&mut self, record: &Record) {
        // Who has seen all records since power-on knows that the nodes began with INIT.
        self.unheard.get_or_insert(if record.seq == 0 { Live::Init } else { Live::Cyclic });
        if let Event::State { origin, to, .. } = record.event {
            self.live.insert((origin.plc, origin.node), Live::of_option_status(to));
        }
    }

    /// Records are missing: the nodes' states may have changed.
    pub fn gap(&mut self) {
        self.unheard = Some(Live::Cyclic);
        self.live.clear();
    }

    fn live(&self, plc: u16, area: &str) -> Live {
        let node = match area {
            "node1" => 1,
            "node2" => 2,
            _ => return Live::Always,
        };
        self.live.get(&(plc, node)).copied().or(self.unheard).unwrap_or(Live::Cyclic)
    }

    /// The register that begins at `offset` of the PLC's RAM.
    pub fn register(&mut self, plc: u16, offset: u32) -> Option<RegisterRef> {
        let address = Address::byte(offset);
        let live = self.live(plc, DEVICE.area_at(address).ok()?.name);
        *self.registers.entry((offset, live)).or_insert_with(|| {
            let found = DEVICE.registers_at(address, Some(live)).ok()?;
            found.into_iter().find(|register| register.offset() == offset)
        })
    }

    /// The register that an access of `width` bytes at `offset` means, if it is just one.
    pub fn accessed(&mut self, plc: u16, offset: u32, width: u8) -> Place {
        let register = self.register(plc, offset).filter(|register| register.width() == u32::from(width));
        let (ty, width) = match width {
            1 => (RegType::Byte, Width::Byte),
            2 => (RegType::Word, Width::Word),
            _ => (RegType::Dword, Width::Dword),
        };
        let address = Address::new(width, offset).unwrap_or(Address::byte(offset));
        Place { register, address, ty }
    }

    /// The register at `offset`, whatever its width.
    pub fn whole(&mut self, plc: u16, offset: u32) -> Place {
        match self.register(plc, offset) {
            Some(register) => {
                Place { register: Some(register), address: register.address(), ty: register.ty() }
            }
            None => self.accessed(plc, offset, 2),
        }
    }

    /// The register `name` of a node.
    pub fn of_node(&self, origin: Origin, name: &str) -> Option<RegisterRef> {
        DEVICE.register(&format!("node{}.{name}", origin.node)).ok()
    }
}

/// A register, or a part of the RAM that is none.
pub(super) struct Place {
    pub register: Option<RegisterRef>,
    pub address: Address,
    ty: RegType,
}

impl Place {
    /// `b_CTRLREG_WRC1 (%MB3.200012)`, or just the address.
    pub fn label(&self) -> String {
        match &self.register {
            Some(register) => format!("{} ({})", register.path(), self.address),
            None => self.address.to_string(),
        }
    }

    /// `16#05`
    pub fn value(&self, value: u32) -> String {
        format_value(self.ty, value)
    }

    /// What the value means, if it means more than a number.
    pub fn meaning(&self, value: u32) -> Option<String> {
        self.register
            .filter(|register| register.register.meaning.is_some())
            .map(|register| register.decode(value))
    }
}
