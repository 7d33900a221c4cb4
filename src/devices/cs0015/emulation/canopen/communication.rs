//! CANopen parameters: identifiers, transmission types, Node-ID and bit rate. This module distinguishes three
//! kinds of values: values in force, stored values, and values that a reset restores (p. 155).

use crate::devices::canopen::pdo::Transmission;
use crate::devices::cs0015::emulation::ram::Registers;
use crate::devices::cs0015::registers::DEVICE;
use crate::snapshot_fields;
use embedded_can::StandardId;
use serde::{Deserialize, Serialize};

/// PDOs of each direction.
pub(crate) const PDOS: usize = 8;
/// Bit rates in kbit/s; the index is the code in 20F2h and 20F3h (p. 41).
const RATES: [u16; 8] = [1000, 500, 250, 125, 100, 50, 20, 10];

/// Bits of a COB-ID.
const INVALID: u32 = 1 << 31;
const BIT_30: u32 = 1 << 30;
const ID: u32 = 0x7FF;

/// Direction of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PdoDirection {
    /// The device receives it.
    Receive,
    /// The device sends it.
    Transmit,
}

impl PdoDirection {
    /// Returns the index of the first PDO's parameters.
    fn first(self) -> u16 {
        match self {
            PdoDirection::Receive => 0x1400,
            PdoDirection::Transmit => 0x1800,
        }
    }
}

/// Settings that a program requests by `PDO_RX_CONFIG` or `PDO_TX_CONFIG` (p. 47-50).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoConfig {
    /// Identifier, from 380h on; `None` keeps the present identifier.
    pub id: Option<u16>,
    /// Transmission type of the PDO.
    pub kind: Transmission,
    /// Minimum time between two asynchronous PDOs, in us.
    pub inhibit_us: u64,
}

/// Parameters of a PDO.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Pdo {
    /// COB-ID; `None` for the default. The default depends on the Node-ID, or is a factory setting.
    cob_id: Option<u32>,
    /// Transmission type in force.
    pub kind: Transmission,
    /// Transmission type in the object dictionary. It takes effect at the next start of Operational (p. 155).
    pub written_kind: Transmission,
    pub inhibit_us: u64,
}

impl Pdo {
    fn new(config: Option<PdoConfig>) -> Self {
        let config =
            config.unwrap_or(PdoConfig { id: None, kind: Transmission::Asynchronous(255), inhibit_us: 0 });
        let PdoConfig { id, kind, inhibit_us } = config;
        Pdo { cob_id: id.map(u32::from), kind, written_kind: kind, inhibit_us }
    }
}

/// Values of the communication parameters at delivery.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factory {
    pub node: u8,
    pub kbit_s: u16,
}

/// The identifiers in force; `None` if the COB-ID is marked as unused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Identifiers {
    #[serde(with = "crate::can::kept")]
    pub sync: Option<StandardId>,
    #[serde(with = "crate::can::kept")]
    pub guarding: Option<StandardId>,
    #[serde(with = "crate::can::kept")]
    pub emergency: Option<StandardId>,
    #[serde(with = "crate::can::kept")]
    pub sdo_request: Option<StandardId>,
    #[serde(with = "crate::can::kept")]
    pub sdo_answer: Option<StandardId>,
    #[serde(with = "crate::can::kept")]
    pub receive: [Option<StandardId>; PDOS],
    #[serde(with = "crate::can::kept")]
    pub transmit: [Option<StandardId>; PDOS],
    /// Transmit PDOs that are sent on request.
    pub on_request: [bool; PDOS],
}

/// The communication parameters of the device.
pub(crate) struct Communication {
    factory: Factory,
    node: u8,
    sdo: [Option<u32>; 2],
    receive: [Pdo; PDOS],
    transmit: [Pdo; PDOS],
    /// PDO settings that the program has requested.
    asked: [[Option<PdoConfig>; PDOS]; 2],
    /// 20F0h to 20F3h as last written.
    entered: [u8; 4],
}

snapshot_fields!(Communication { values: node, sdo, receive, transmit, asked, entered; built: factory });

impl Communication {
    pub(crate) fn new(factory: Factory) -> Self {
        Communication {
            factory,
            node: factory.node,
            sdo: [None; 2],
            receive: [Pdo::new(None); PDOS],
            transmit: [Pdo::new(None); PDOS],
            asked: [[None; PDOS]; 2],
            entered: [0; 4],
        }
    }

    /// Handles power-on: reads the stored values, and resets all other values.
    pub(crate) fn power_on(&mut self, registers: &Registers) {
        let stored = &registers.parameters;
        *self = Communication::new(self.factory);
        self.node = Some(stored.b_NODE_ID.load()).filter(|it| is_node(*it)).unwrap_or(self.factory.node);
        let kbit_s = self.stored_kbit_s(registers);
        registers.flags.CANBAUDRATE.store(kbit_s);
        registers.flags.NODEID.store(self.node);
        self.entered = [self.node, self.node, code(kbit_s), code(kbit_s)];
    }

    /// Resets the communication. Values that are not stored get their values at power-on, except those that
    /// the program has requested.
    pub(crate) fn reset(&mut self) {
        self.sdo = [None; 2];
        let [receive, transmit] = self.asked;
        self.receive = receive.map(Pdo::new);
        self.transmit = transmit.map(Pdo::new);
    }

    /// Handles the start of Operational. The transmission types that were written since its last start take
    /// effect (p. 155).
    pub(crate) fn take_over_kinds(&mut self) {
        self.receive.iter_mut().chain(&mut self.transmit).for_each(|pdo| pdo.kind = pdo.written_kind);
    }

    /// Records the program's request for PDO number `pdo`, counted from 0. The request takes effect at the next reset
    /// of the communication.
    pub(crate) fn ask(&mut self, way: PdoDirection, pdo: usize, config: PdoConfig) {
        let [receive, transmit] = &mut self.asked;
        let asked = match way {
            PdoDirection::Receive => receive,
            PdoDirection::Transmit => transmit,
        };
        if let Some(asked) = asked.get_mut(pdo) {
            *asked = Some(config);
        }
    }

    fn stored_kbit_s(&self, registers: &Registers) -> u16 {
        let stored = registers.parameters.w_KBIT_S.load();
        if is_rate(stored) { stored } else { self.factory.kbit_s }
    }

    /// Returns the Node-ID in force.
    pub(crate) fn node(&self) -> u8 {
        self.node
    }

    pub(crate) fn pdo(&self, way: PdoDirection, pdo: usize) -> &Pdo {
        match way {
            PdoDirection::Receive => &self.receive[pdo],
            PdoDirection::Transmit => &self.transmit[pdo],
        }
    }

    pub(crate) fn pdo_mut(&mut self, way: PdoDirection, pdo: usize) -> &mut Pdo {
        match way {
            PdoDirection::Receive => &mut self.receive[pdo],
            PdoDirection::Transmit => &mut self.transmit[pdo],
        }
    }

    /// Returns the default value in the object dictionary, at this Node-ID.
    fn default(&self, index: u16, sub: u8) -> u32 {
        DEVICE.object(index, sub).map_or(0, |object| object.default.at_node(self.node))
    }

    /// Returns the stored COB-ID of SYNC (1005h), guarding (100Eh) or emergencies (1014h).
    pub(crate) fn stored_cob_id(&self, registers: &Registers, index: u16) -> u32 {
        let stored = match index {
            0x1005 => registers.parameters.d_COB_ID_SYNC.load(),
            0x100E => registers.parameters.d_COB_ID_GUARDING.load(),
            _ => registers.parameters.d_COB_ID_EMCY.load(),
        };
        if stored == 0 { self.default(index, 0) } else { stored }
    }

    /// Returns the COB-ID of requests (sub 1) or answers (sub 2) of the SDO.
    pub(crate) fn sdo_cob_id(&self, sub: u8) -> u32 {
        let own = self.sdo.get(usize::from(sub).wrapping_sub(1)).copied().flatten();
        own.unwrap_or_else(|| self.default(0x1200, sub))
    }

    pub(crate) fn set_sdo_cob_id(&mut self, sub: u8, cob_id: u32) {
        if let Some(own) = self.sdo.get_mut(usize::from(sub).wrapping_sub(1)) {
            *own = Some(cob_id);
        }
    }

    /// Returns the COB-ID of a PDO, counted from 0.
    pub(crate) fn pdo_cob_id(&self, way: PdoDirection, pdo: usize) -> u32 {
        self.pdo(way, pdo).cob_id.unwrap_or_else(|| self.default(way.first() + pdo as u16, 1))
    }

    pub(crate) fn set_pdo_cob_id(&mut self, way: PdoDirection, pdo: usize, cob_id: u32) {
        self.pdo_mut(way, pdo).cob_id = Some(cob_id);
    }

    /// Returns 20F0h to 20F3h: `entry` 0 to 3.
    pub(crate) fn entered(&self, entry: usize) -> u8 {
        self.entered[entry]
    }

    /// Writes 20F0h to 20F3h; returns `false` if the value is not permitted. The entries 20F0h and 20F1h are
    /// a pair, and so are 20F2h and 20F3h. When both entries of a pair have an equal, changed value, the
    /// device stores the value. A Node-ID takes effect at once, a bit rate after the next power-on (p. 41,
    /// 163).
    pub(crate) fn enter(&mut self, registers: &Registers, entry: usize, value: u8) -> bool {
        let is_node = entry < 2;
        let is_right = if is_node { self::is_node(value) } else { usize::from(value) < RATES.len() };
        if !is_right {
            return false;
        }
        self.entered[entry] = value;
        if is_node && self.entered[..2] == [value; 2] && value != self.node {
            self.node = value;
            registers.parameters.b_NODE_ID.store(value);
            registers.flags.NODEID.store(value);
        }
        if !is_node && self.entered[2..] == [value; 2] {
            registers.parameters.w_KBIT_S.store(RATES[usize::from(value)]);
        }
        true
    }

    /// Sets the bit rate for the program. It takes effect at once and is stored.
    pub(crate) fn set_rate(&mut self, registers: &Registers, kbit_s: u16) {
        self.entered[2..].fill(code(kbit_s));
        registers.parameters.w_KBIT_S.store(kbit_s);
        registers.flags.CANBAUDRATE.store(kbit_s);
    }

    /// True if this is the default identifier of the PDO. The default depends on the Node-ID, or is the
    /// factory setting.
    pub(crate) fn is_predefined(&self, way: PdoDirection, pdo: usize, id: u16) -> bool {
        self.default(way.first() + pdo as u16, 1) == u32::from(id)
    }

    /// Returns the identifiers in force.
    pub(crate) fn identifiers(&self, registers: &Registers) -> Identifiers {
        let stored = |index| self.stored_cob_id(registers, index);
        let pdos = |way| core::array::from_fn(|pdo| valid(self.pdo_cob_id(way, pdo)));
        Identifiers {
            sync: identifier(stored(0x1005)),
            guarding: identifier(stored(0x100E)),
            // Manual p. 157: bit 30 is set if the node sends emergencies.
            emergency: Some(stored(0x1014)).filter(|cob_id| cob_id & BIT_30 != 0).and_then(identifier),
            sdo_request: valid(self.sdo_cob_id(1)),
            sdo_answer: valid(self.sdo_cob_id(2)),
            receive: pdos(PdoDirection::Receive),
            transmit: pdos(PdoDirection::Transmit),
            on_request: core::array::from_fn(|pdo| {
                self.pdo_cob_id(PdoDirection::Transmit, pdo) & BIT_30 == 0
            }),
        }
    }
}

/// True if the value is a valid COB-ID: an 11-bit identifier above 0, without the bit for 29-bit frames (D-419).
pub(crate) fn is_cob_id(value: u32) -> bool {
    value & ID != 0 && value & !(INVALID | BIT_30 | ID) == 0
}

fn identifier(cob_id: u32) -> Option<StandardId> {
    StandardId::new((cob_id & ID) as u16)
}

fn valid(cob_id: u32) -> Option<StandardId> {
    Some(cob_id).filter(|cob_id| cob_id & INVALID == 0).and_then(identifier)
}

/// Returns the code of a bit rate.
fn code(kbit_s: u16) -> u8 {
    RATES.iter().position(|rate| *rate == kbit_s).unwrap_or(3) as u8
}

/// True if a number is a valid Node-ID.
pub(crate) fn is_node(number: u8) -> bool {
    (1..=127).contains(&number)
}

/// True if the device supports a bit rate in kbit/s.
pub(crate) fn is_rate(kbit_s: u16) -> bool {
    RATES.contains(&kbit_s)
}
