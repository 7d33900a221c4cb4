//! The checks for each register of a CANsync structure. They are derived from the register maps.

use crate::check::word;
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::registers::{CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT as Master};
use crate::layout::{Area, Meaning, Owner, RegisterPhase, RegisterRef, Role};
use core::mem::offset_of;
use std::sync::{Arc, Mutex, PoisonError};

/// Use of a register in the rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RegisterUse {
    /// The register has no rule except for its value.
    Plain,
    /// Only the firmware may write the register.
    Owned,
    /// No program and no firmware may write the register.
    Reserved,
    /// A reserved register at an address that the initialization structure also uses.
    ReservedUnderInit,
    /// Selects the value in a word of a frame.
    Mapping,
    /// Selects the slaves for requests of actual values.
    Request,
    /// Releases frame 1 or 2 (index 0 or 1).
    Release(usize),
    /// Control register of the control word for a slave.
    ControlWord(u8),
    /// Data of a frame. The field is the offset of the control register that releases the frame.
    RequestData(u16),
    /// Control register of the master's parameter job for a slave.
    Parameter(u8),
    /// Number or value of the master's parameter job for a slave. The second field is true for the value.
    ParameterData(u8, bool),
    /// Control register of the master's job in block 1.
    Block,
    /// A setting or the data of the job in block 1. The field is true for the data.
    BlockData(bool),
    /// Control register of a job at the slave; the status register follows it.
    SlaveJob,
}

/// Restriction of the permitted values.
#[derive(Clone, Copy, Debug)]
pub(super) enum ValueLimit {
    None,
    /// A slave number, 0 to 31.
    Slave,
    /// A slave number or 16#80.
    SlaveOrAutomatic,
    /// The manual must not reserve the value.
    NotReserved(&'static Meaning),
}

/// A register with its checks.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchedRegister {
    /// Offset in the structure.
    pub offset: u16,
    /// Width of the register in bytes.
    pub width: u8,
    pub kind: RegisterUse,
    pub limit: ValueLimit,
    pub reserved_bits: u32,
}

impl WatchedRegister {
    /// Returns the register's bits in its 64-bit word.
    pub(crate) fn mask(&self) -> u64 {
        word::mask(self.offset.into(), self.width.into())
    }

    /// Returns the register's value in its 64-bit word.
    pub(crate) fn of(&self, word: u64) -> u32 {
        word::value(word, self.offset.into(), self.width.into())
    }
}

/// The registers of a structure, indexed by byte.
pub(super) struct RegisterMap {
    registers: Vec<WatchedRegister>,
    /// Index in `registers` for each byte; [`RegisterMap::NONE`] for padding.
    bytes: Vec<u16>,
}

impl RegisterMap {
    const NONE: u16 = u16::MAX;

    /// Creates the map of the structure in `area` in phase `live`, for a node with this role.
    fn new(area: &'static Area, role: Role, live: RegisterPhase) -> Self {
        let mut map = RegisterMap { registers: Vec::new(), bytes: Vec::new() };
        let placed = area.structures.iter().filter(|placed| placed.live.is_valid_in(live));
        let placed = placed.filter(|placed| placed.role.is_none_or(|it| it == role));
        for register in placed.flat_map(|placed| area.registers_of(placed)) {
            let watched = watched(&register, role, live);
            let (start, end) =
                (usize::from(watched.offset), usize::from(watched.offset) + register.width() as usize);
            map.bytes.resize(map.bytes.len().max(end), Self::NONE);
            map.bytes[start..end].fill(map.registers.len() as u16);
            map.registers.push(watched);
        }
        map
    }

    /// Returns the length of the structure in bytes.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Returns the registers that have at least one bit of `differing` in the word at byte `first`, in
    /// ascending order.
    pub(crate) fn registers_with(
        &self,
        first: usize,
        mut differing: u64,
    ) -> impl Iterator<Item = &WatchedRegister> {
        core::iter::from_fn(move || {
            while differing != 0 {
                let place = differing.trailing_zeros() / u8::BITS;
                let index = self.bytes.get(first + place as usize).copied().unwrap_or(Self::NONE);
                let Some(register) = self.registers.get(usize::from(index)) else {
                    // Padding.
                    differing &= !(0xFF << (u8::BITS * place));
                    continue;
                };
                differing &= !register.mask();
                return Some(register);
            }
            None
        })
    }

    /// Returns the registers that begin within `first .. first + bytes`, in ascending order.
    pub(crate) fn registers(&self, first: usize, bytes: usize) -> impl Iterator<Item = &WatchedRegister> {
        let covered = self.bytes.get(first..self.bytes.len().min(first + bytes)).unwrap_or_default();
        let mut last = Self::NONE;
        covered.iter().filter_map(move |&index| {
            let is_new = index != last;
            last = index;
            self.registers.get(usize::from(index)).filter(|_| is_new)
        })
    }
}

/// The register maps of a node in both phases.
pub(super) struct RegisterMaps {
    pub init: RegisterMap,
    pub cyclic: RegisterMap,
}

impl RegisterMaps {
    /// Returns the maps of a node in `area` with this role. The maps are created once and shared by all
    /// plants.
    pub(crate) fn of(area: &'static Area, role: Role) -> Arc<Self> {
        static MADE: Mutex<Vec<(&'static Area, Role, Arc<RegisterMaps>)>> = Mutex::new(Vec::new());
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |it: &&(&Area, Role, Arc<RegisterMaps>)| core::ptr::eq(it.0, area) && it.1 == role;
        if let Some((.., maps)) = made.iter().find(is_it) {
            return Arc::clone(maps);
        }
        let [init, cyclic] = [phases::INIT, phases::CYCLIC].map(|live| RegisterMap::new(area, role, live));
        let maps = Arc::new(RegisterMaps { init, cyclic });
        made.push((area, role, Arc::clone(&maps)));
        maps
    }

    /// Returns the map of a phase.
    pub(crate) fn of_phase(&self, live: RegisterPhase) -> &RegisterMap {
        if live == phases::INIT { &self.init } else { &self.cyclic }
    }
}

fn watched(register: &RegisterRef, role: Role, live: RegisterPhase) -> WatchedRegister {
    let meaning = register.register.meaning;
    let mut watched = WatchedRegister {
        offset: register.offset_in_structure() as u16,
        width: register.width() as u8,
        kind: RegisterUse::Plain,
        limit: ValueLimit::None,
        reserved_bits: 0,
    };
    if register.is_reserved() {
        let under_init = live == phases::CYCLIC && (watched.offset) < INIT_BYTES;
        watched.kind = if under_init { RegisterUse::ReservedUnderInit } else { RegisterUse::Reserved };
        return watched;
    }
    if register.owner() == Owner::Firmware {
        watched.kind = RegisterUse::Owned;
        return watched;
    }
    let reserved = meaning.iter().flat_map(|meaning| meaning.bits).filter(|bits| bits.reserved);
    watched.reserved_bits = reserved.map(|bits| bits.mask()).fold(0, |all, mask| all | mask);
    (watched.kind, watched.limit) = match (meaning.map_or("", |meaning| meaning.name), meaning) {
        ("cfg_word" | "cfg_wrc_master", _) => (RegisterUse::Mapping, ValueLimit::None),
        ("max_sl_nr", _) => (RegisterUse::Request, ValueLimit::Slave),
        ("sl_nr", _) => (RegisterUse::Plain, ValueLimit::Slave),
        ("request", _) => (RegisterUse::Plain, ValueLimit::SlaveOrAutomatic),
        ("sl_typ" | "action_command", Some(meaning)) => {
            (RegisterUse::Plain, ValueLimit::NotReserved(meaning))
        }
        _ => (RegisterUse::Plain, ValueLimit::None),
    };
    let slave = register.index[0] as u8;
    let is_master = role == Role::Master;
    watched.kind = match register.register.name {
        "b_CTRLREG_RD_ORDER_RDC1" | "b_CTRLREG_RD_ORDER_RDC2" => RegisterUse::Request,
        "b_CTRLREG_WRC1" if is_master => RegisterUse::Release(0),
        "b_CTRLREG_WRC2" if is_master => RegisterUse::Release(1),
        "b_CTRLREG_RD_RDC1" => RegisterUse::Release(0),
        "b_CTRLREG_RD_RDC2" => RegisterUse::Release(1),
        "a_STEUREG_CONTROLWORD" => RegisterUse::ControlWord(slave),
        "a_CONTROLWORD_SL" => {
            RegisterUse::RequestData(offset_of!(Master, a_STEUREG_CONTROLWORD) as u16 + u16::from(slave))
        }
        "d_SL_MASK_BC0" | "b_CMD_BC0" | "b_DATA_BYTE_BC0" | "w_DATA_WORD_BC0" => {
            RegisterUse::RequestData(offset_of!(Master, b_CTRL_REG_BC0) as u16)
        }
        "d_SL_MASK_BC1" | "b_CMD_BC1" | "b_DATA_BYTE_BC1" | "w_DATA_WORD_BC1" => {
            RegisterUse::RequestData(offset_of!(Master, b_CTRL_REG_BC1) as u16)
        }
        "d_SL_MASK_BC2" | "b_CMD_BC2" | "b_DATA_BYTE_BC2" | "w_DATA_WORD_BC2" => {
            RegisterUse::RequestData(offset_of!(Master, b_CTRL_REG_BC2) as u16)
        }
        "b_STEUREG_PAR_CMD" if is_master => RegisterUse::Parameter(slave),
        "w_PAR_NR" => RegisterUse::ParameterData(slave, false),
        "d_PAR_VALUE" => RegisterUse::ParameterData(slave, true),
        "b_STEUREG_UPDOWNBLK1" if is_master => RegisterUse::Block,
        "b_SL_NR_UPDOWNBLK1" | "w_SUBSL_NR_UPDOWNBLK1" | "d_BASE_ADR_UPDOWNBLK1" | "w_LENGTH_UPDOWNBLK1"
            if is_master =>
        {
            RegisterUse::BlockData(false)
        }
        "a_DATA_UPDOWNBLK1" if is_master => RegisterUse::BlockData(true),
        "b_STEUREG_PAR_CMD" | "b_STEUREG_UPDOWNBLK1" | "b_STEUREG_UPDOWN_SINGLE" => RegisterUse::SlaveJob,
        _ => watched.kind,
    };
    watched
}

/// Length of the initialization structure, which overlays the cyclic structures.
pub(super) const INIT_BYTES: u16 = size_of::<CANsync_INIT_BMSTRUCT>() as u16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::{bm4_o_can_06, omega_drive_line_2};

    /// Returns the maps of the nodes of both devices. The structures of the devices differ, as their manuals
    /// do.
    fn maps(role: Role) -> [Arc<RegisterMaps>; 2] {
        let (omega, bm4) = (&omega_drive_line_2::registers::DEVICE, &bm4_o_can_06::registers::DEVICE);
        let node = if role == Role::Master { "node2" } else { "node1" };
        [omega.area(node), bm4.area("slotJ")].map(|area| RegisterMaps::of(area.unwrap(), role))
    }

    fn at(map: &RegisterMap, offset: usize) -> Option<WatchedRegister> {
        map.registers(offset, 1).next().copied()
    }

    #[test]
    fn each_byte_finds_its_register_and_a_range_finds_it_once() {
        for maps in maps(Role::Master) {
            let map = &maps.cyclic;
            assert_eq!(at(map, 3).unwrap().offset, 2);
            assert_eq!(map.registers(8, 5).map(|register| register.offset).collect::<Vec<_>>(), [8, 10, 12]);
            assert_eq!(map.registers(829, 3).count(), 0, "padding");
            assert_eq!((maps.init.len(), map.len()), (52, 3996));
        }
        let lengths = maps(Role::Slave).map(|maps| (maps.init.len(), maps.cyclic.len()));
        assert_eq!(lengths, [(52, 3542), (52, 3524)]);
    }

    /// A slot can contain one of two modules. The checks must use the structure of the module that is
    /// present.
    #[test]
    fn the_role_selects_the_structure() {
        let [master, slave] =
            [Role::Master, Role::Slave].map(|role| maps(role).map(|maps| maps.cyclic.len()));
        assert!(master[0] != slave[0] && master[1] != slave[1]);
        let starts = |map: &RegisterMap| map.registers.windows(2).all(|pair| pair[0].offset < pair[1].offset);
        for maps in [Role::Master, Role::Slave].into_iter().flat_map(maps) {
            assert!(starts(&maps.init) && starts(&maps.cyclic), "each byte belongs to one register");
        }
    }

    #[test]
    fn register_maps_define_the_checks() {
        for maps in maps(Role::Master) {
            let kind = |offset| at(&maps.cyclic, offset).unwrap().kind;
            assert_eq!(kind(0), RegisterUse::Plain, "w_CPU_CONTROL");
            assert_eq!(kind(2), RegisterUse::Owned, "w_OPTION_STATUS");
            assert_eq!(kind(12), RegisterUse::Release(0));
            assert_eq!(kind(14), RegisterUse::ReservedUnderInit);
            assert_eq!(kind(84), RegisterUse::Reserved, "a_WR_VALUE[8]");
            assert_eq!(kind(832 + 4 * 7), RegisterUse::Owned, "a_RD_BMARRAY[0][7]");
            assert_eq!(kind(832 + 4 * 8), RegisterUse::Reserved, "a_RD_BMARRAY[0][8]");
            assert_eq!(kind(2916 + 5), RegisterUse::ControlWord(5));
            assert_eq!(kind(2948 + 2 * 5), RegisterUse::RequestData(2916 + 5));
            assert_eq!(kind(3012 + 2 * 31), RegisterUse::Parameter(31));
            assert_eq!(kind(3012 + 2 * 31 + 1), RegisterUse::Plain, "b_STATREG_PAR_CMD");
            assert_eq!(kind(3076 + 8), RegisterUse::ParameterData(1, true));
            assert_eq!(at(&maps.cyclic, 317).unwrap().reserved_bits, 0xC0);
            assert_eq!(at(&maps.cyclic, 20).unwrap().reserved_bits, 0x80);
        }
        for maps in maps(Role::Slave) {
            let kind = |offset| at(&maps.cyclic, offset).unwrap().kind;
            assert_eq!(kind(2892), RegisterUse::Owned, "at the slave only the firmware writes w_PAR_NR");
            assert_eq!(kind(12), RegisterUse::Plain, "b_CTRLREG_WRC1 of a slave only reports");
            assert_eq!(kind(2884), RegisterUse::SlaveJob);
        }
    }
}
