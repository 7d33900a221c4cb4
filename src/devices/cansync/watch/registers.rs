//! What is to be watched at each register of a CANsync structure, taken from the register maps.

use crate::check::word;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::layout::{Area, Meaning, Owner, RegisterPhase, RegisterRef, Role};
use std::sync::{Arc, Mutex, PoisonError};

/// What the rules have to do with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Nothing beyond its value.
    Plain,
    /// Only the firmware writes it.
    Owned,
    /// Nobody writes it.
    Reserved,
    /// Reserved, and under the initialization data.
    ReservedUnderInit,
    /// Tells which value travels in a word of a frame.
    Mapping,
    /// Says which slaves are asked for actual values.
    Request,
    /// Releases frame 1 or 2 (index 0 or 1).
    Release(usize),
    /// Control register of the control word for a slave.
    ControlWord(u8),
    /// Control register of the master's parameter job for a slave.
    Parameter(u8),
    /// Number, or with `true` value, of the master's parameter job for a slave.
    ParameterData(u8, bool),
    /// Control register of the master's block 1 job.
    Block,
    /// What the block 1 job does, or with `true` its data.
    BlockData(bool),
    /// Control register of a job at the slave; the status register lies behind it.
    SlaveJob,
}

/// Values that make no sense.
#[derive(Clone, Copy, Debug)]
pub(super) enum Limit {
    None,
    /// A slave number, 0 to 31.
    Slave,
    /// A slave number or 16#80.
    SlaveOrAutomatic,
    /// Not one of the values that the manual reserves.
    NotReserved(&'static Meaning),
}

/// A register to be watched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    /// Offset in the structure.
    pub offset: u16,
    /// Bytes.
    pub width: u8,
    pub kind: Kind,
    pub limit: Limit,
    pub reserved_bits: u32,
}

impl Watched {
    /// The register's bits in the 64-bit word it lies in.
    pub(crate) fn mask(&self) -> u64 {
        word::mask(self.offset.into(), self.width.into())
    }

    /// The register's value in that word.
    pub(crate) fn of(&self, word: u64) -> u32 {
        word::value(word, self.offset.into(), self.width.into())
    }
}

/// The registers of a structure by their bytes.
pub(super) struct Map {
    registers: Vec<Watched>,
    /// Index into `registers` for each byte; [`Map::NONE`] for padding.
    bytes: Vec<u16>,
}

impl Map {
    const NONE: u16 = u16::MAX;

    /// The map of the structure that lies in `area` in phase `live` if a `role` is there.
    fn new(area: &'static Area, role: Role, live: RegisterPhase) -> Self {
        let mut map = Map { registers: Vec::new(), bytes: Vec::new() };
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

    /// Length of the structure in bytes.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The registers in the word at byte `first` that have one of the bits of `differing` in it, in ascending order.
    pub(crate) fn registers_with(&self, first: usize, mut differing: u64) -> impl Iterator<Item = &Watched> {
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

    /// The registers that begin within `first .. first + bytes`, in ascending order.
    pub(crate) fn registers(&self, first: usize, bytes: usize) -> impl Iterator<Item = &Watched> {
        let covered = self.bytes.get(first..self.bytes.len().min(first + bytes)).unwrap_or_default();
        let mut last = Self::NONE;
        covered.iter().filter_map(move |&index| {
            let is_new = index != last;
            last = index;
            self.registers.get(usize::from(index)).filter(|_| is_new)
        })
    }
}

/// The maps of a node in both phases.
pub(super) struct Maps {
    pub init: Map,
    pub cyclic: Map,
}

impl Maps {
    /// The maps of a node in `area` that is a `role`. They are made once for all plants.
    pub(crate) fn of(area: &'static Area, role: Role) -> Arc<Self> {
        static MADE: Mutex<Vec<(&'static Area, Role, Arc<Maps>)>> = Mutex::new(Vec::new());
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |it: &&(&Area, Role, Arc<Maps>)| core::ptr::eq(it.0, area) && it.1 == role;
        if let Some((.., maps)) = made.iter().find(is_it) {
            return Arc::clone(maps);
        }
        let [init, cyclic] =
            [RegisterPhase::Init, RegisterPhase::Cyclic].map(|live| Map::new(area, role, live));
        let maps = Arc::new(Maps { init, cyclic });
        made.push((area, role, Arc::clone(&maps)));
        maps
    }

    /// The map in a phase.
    pub(crate) fn of_phase(&self, live: RegisterPhase) -> &Map {
        if live == RegisterPhase::Init { &self.init } else { &self.cyclic }
    }
}

fn watched(register: &RegisterRef, role: Role, live: RegisterPhase) -> Watched {
    let meaning = register.register.meaning;
    let mut watched = Watched {
        offset: register.offset_in_structure() as u16,
        width: register.width() as u8,
        kind: Kind::Plain,
        limit: Limit::None,
        reserved_bits: 0,
    };
    if register.is_reserved() {
        let under_init = live == RegisterPhase::Cyclic && (watched.offset) < INIT_BYTES;
        watched.kind = if under_init { Kind::ReservedUnderInit } else { Kind::Reserved };
        return watched;
    }
    if register.owner() == Owner::Firmware {
        watched.kind = Kind::Owned;
        return watched;
    }
    let reserved = meaning.iter().flat_map(|meaning| meaning.bits).filter(|bits| bits.reserved);
    watched.reserved_bits = reserved.map(|bits| bits.mask()).fold(0, |all, mask| all | mask);
    (watched.kind, watched.limit) = match (meaning.map_or("", |meaning| meaning.name), meaning) {
        ("cfg_word" | "cfg_wrc_master", _) => (Kind::Mapping, Limit::None),
        ("max_sl_nr", _) => (Kind::Request, Limit::Slave),
        ("sl_nr", _) => (Kind::Plain, Limit::Slave),
        ("request", _) => (Kind::Plain, Limit::SlaveOrAutomatic),
        ("sl_typ" | "action_command", Some(meaning)) => (Kind::Plain, Limit::NotReserved(meaning)),
        _ => (Kind::Plain, Limit::None),
    };
    let slave = register.index[0] as u8;
    let is_master = role == Role::Master;
    watched.kind = match register.register.name {
        "b_CTRLREG_RD_ORDER_RDC1" | "b_CTRLREG_RD_ORDER_RDC2" => Kind::Request,
        "b_CTRLREG_WRC1" if is_master => Kind::Release(0),
        "b_CTRLREG_WRC2" if is_master => Kind::Release(1),
        "b_CTRLREG_RD_RDC1" => Kind::Release(0),
        "b_CTRLREG_RD_RDC2" => Kind::Release(1),
        "a_STEUREG_CONTROLWORD" => Kind::ControlWord(slave),
        "b_STEUREG_PAR_CMD" if is_master => Kind::Parameter(slave),
        "w_PAR_NR" => Kind::ParameterData(slave, false),
        "d_PAR_VALUE" => Kind::ParameterData(slave, true),
        "b_STEUREG_UPDOWNBLK1" if is_master => Kind::Block,
        "b_SL_NR_UPDOWNBLK1" | "w_SUBSL_NR_UPDOWNBLK1" | "d_BASE_ADR_UPDOWNBLK1" | "w_LENGTH_UPDOWNBLK1"
            if is_master =>
        {
            Kind::BlockData(false)
        }
        "a_DATA_UPDOWNBLK1" if is_master => Kind::BlockData(true),
        "b_STEUREG_PAR_CMD" | "b_STEUREG_UPDOWNBLK1" | "b_STEUREG_UPDOWN_SINGLE" => Kind::SlaveJob,
        _ => watched.kind,
    };
    watched
}

/// Length of the structure that overlays the cyclic ones.
pub(super) const INIT_BYTES: u16 = size_of::<CANsync_INIT_BMSTRUCT>() as u16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::{bm4_o_can_06, omega_drive_line_2};

    /// The maps of the nodes of both devices; their structures differ where the manuals do.
    fn maps(role: Role) -> [Arc<Maps>; 2] {
        let (omega, bm4) = (&omega_drive_line_2::registers::DEVICE, &bm4_o_can_06::registers::DEVICE);
        let node = if role == Role::Master { "node2" } else { "node1" };
        [omega.area(node), bm4.area("slotJ")].map(|area| Maps::of(area.unwrap(), role))
    }

    fn at(map: &Map, offset: usize) -> Option<Watched> {
        map.registers(offset, 1).next().copied()
    }

    #[test]
    fn registers_are_found_by_each_of_their_bytes_and_once_per_stretch() {
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

    /// Where two modules can be in one slot, the structure of the one that is there counts.
    #[test]
    fn the_role_selects_the_structure() {
        let [master, slave] =
            [Role::Master, Role::Slave].map(|role| maps(role).map(|maps| maps.cyclic.len()));
        assert!(master[0] != slave[0] && master[1] != slave[1]);
        let starts = |map: &Map| map.registers.windows(2).all(|pair| pair[0].offset < pair[1].offset);
        for maps in [Role::Master, Role::Slave].into_iter().flat_map(maps) {
            assert!(starts(&maps.init) && starts(&maps.cyclic), "each byte is one register's");
        }
    }

    #[test]
    fn the_register_maps_say_what_is_watched() {
        for maps in maps(Role::Master) {
            let kind = |offset| at(&maps.cyclic, offset).unwrap().kind;
            assert_eq!(kind(0), Kind::Plain, "w_CPU_CONTROL");
            assert_eq!(kind(2), Kind::Owned, "w_OPTION_STATUS");
            assert_eq!(kind(12), Kind::Release(0));
            assert_eq!(kind(14), Kind::ReservedUnderInit);
            assert_eq!(kind(84), Kind::Reserved, "a_WR_VALUE[8]");
            assert_eq!(kind(832 + 4 * 7), Kind::Owned, "a_RD_BMARRAY[0][7]");
            assert_eq!(kind(832 + 4 * 8), Kind::Reserved, "a_RD_BMARRAY[0][8]");
            assert_eq!(kind(2916 + 5), Kind::ControlWord(5));
            assert_eq!(kind(3012 + 2 * 31), Kind::Parameter(31));
            assert_eq!(kind(3012 + 2 * 31 + 1), Kind::Plain, "b_STATREG_PAR_CMD");
            assert_eq!(kind(3076 + 8), Kind::ParameterData(1, true));
            assert_eq!(at(&maps.cyclic, 317).unwrap().reserved_bits, 0xC0);
            assert_eq!(at(&maps.cyclic, 20).unwrap().reserved_bits, 0x80);
        }
        for maps in maps(Role::Slave) {
            let kind = |offset| at(&maps.cyclic, offset).unwrap().kind;
            assert_eq!(kind(2892), Kind::Owned, "w_PAR_NR is the firmware's at the slave");
            assert_eq!(kind(12), Kind::Plain, "b_CTRLREG_WRC1 of a slave only reports");
            assert_eq!(kind(2884), Kind::SlaveJob);
        }
    }
}
