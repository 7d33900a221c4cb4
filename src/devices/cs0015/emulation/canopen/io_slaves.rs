//! I/O modules from the point of view of the master: their configuration, and their words in the flags (p.
//! 71-85).

use crate::devices::canopen::sdo::EntryAddress;
use crate::devices::cr201x::{CHANNELS, Channels, Model, Role};
use crate::devices::cs0015::emulation::ram::Registers;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Numbers of modules that have words in the flags (p. 71).
pub(crate) const NODES: core::ops::RangeInclusive<u32> = 1..=32;
/// Maximum number of missing nodes that `COP_MSTR_MAIN` notes (p. 75).
const MISSING: usize = 8;
/// The entries with the configuration in a module's object dictionary (D-451).
const CONNECTORS: u16 = 0x2000;
const PWM: EntryAddress = EntryAddress { index: 0x2001, sub: 0 };

/// Outputs of a module: a bit for each connector, and four words. `None` for outputs that the module does not
/// have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ModuleOutputs {
    pub bits: Option<u8>,
    pub words: Option<[u16; 4]>,
}

/// A module with a known configuration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Slave {
    pub node: u8,
    pub channels: Channels,
    /// True if `SLAVE_CRxxxx_WORK` was called with INIT.
    pub is_known: bool,
    /// Inputs as last received.
    pub bits: u8,
    pub words: [u16; 4],
    /// Outputs sent since the module became Operational.
    pub sent: ModuleOutputs,
}

impl Slave {
    /// Exchanges the words of the module with the flags: writes the inputs into the flags, and returns the outputs from
    /// the flags.
    pub(crate) fn exchange(&self, registers: &Registers) -> ModuleOutputs {
        let Some(flags) =
            usize::from(self.node).checked_sub(1).and_then(|it| registers.slaves.a_SLAVE.get(it))
        else {
            return ModuleOutputs::default();
        };
        let mut sent = ModuleOutputs::default();
        for (connector, flag) in flags.iter().enumerate().take(CHANNELS) {
            let pair = connector / 2;
            match self.channels.role(connector) {
                Role::Off => {}
                Role::DigitalInput => flag.store(u16::from(self.bits >> connector & 1)),
                Role::AnalogInput(index) => flag.store(self.words[index]),
                Role::DigitalOutput => {
                    *sent.bits.get_or_insert(0) |= u8::from(flag.load() & 1 != 0) << connector;
                }
                Role::AnalogOutput(index) | Role::Signed(index, true) => {
                    sent.words.get_or_insert([0; 4])[index] = flag.load();
                }
                // Manual p. 85: the flag of a current-controlled output contains the current. The flag of a
                // PWM output is not written.
                Role::Signed(..) if self.channels.reports_current(pair) => flag.store(self.words[pair]),
                Role::Signed(..) => {}
            }
        }
        sent
    }
}

/// One transfer of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Transfer {
    /// Writes a byte into this entry of the module.
    Write(EntryAddress, u8),
    /// Reads a byte from this entry of the module.
    Read(EntryAddress),
}

/// A configuration in progress. It belongs to a place of the job block.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Configuring {
    place: usize,
    to_do: VecDeque<Transfer>,
    read: Vec<u8>,
}

impl Configuring {
    /// Plans the transfers: first writes the configuration `to_write`, if it is given, then reads the
    /// configuration if `is_read`.
    fn new(place: usize, model: Model, to_write: Option<(&[u8], u8)>, is_read: bool) -> Self {
        let connector = |index: usize| EntryAddress { index: CONNECTORS, sub: index as u8 + 1 };
        let mut to_do = VecDeque::new();
        if let Some((kinds, pwm_hz)) = to_write {
            to_do.extend(
                kinds.iter().enumerate().map(|(index, kind)| Transfer::Write(connector(index), *kind)),
            );
            to_do.push_back(Transfer::Write(PWM, pwm_hz));
        }
        if is_read {
            to_do.extend((0..model.values()).map(|index| Transfer::Read(connector(index))));
        }
        Configuring { place, to_do, read: Vec::new() }
    }

    /// Returns the next waiting transfer, if there is one.
    pub(crate) fn now(&self) -> Option<Transfer> {
        self.to_do.front().copied()
    }

    /// Removes the finished transfer, and keeps its data.
    pub(crate) fn is_done(&mut self, data: &[u8]) {
        if let Some(Transfer::Read(_)) = self.to_do.pop_front() {
            self.read.extend(data.first());
        }
    }

    /// Returns the bytes read.
    pub(crate) fn read(&self) -> &[u8] {
        &self.read
    }
}

/// The I/O modules of a master.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct IoSlaves {
    pub slaves: Vec<Slave>,
    configuring: Vec<Configuring>,
    /// Place of the job block with a `COP_MSTR_BOOTUP` in progress, and the time at which it ends.
    pub boot_up: Option<(usize, u64)>,
    /// Time at which `COP_MSTR_MAIN` sends the next SYNC object, in microseconds.
    pub next_sync: u64,
    /// Nodes that are missing now. `missing` contains nodes that have been missing, in order.
    now_missing: Vec<u8>,
    missing: Vec<u8>,
}

impl IoSlaves {
    /// Returns the configuration in progress for a place of the job block, or starts one.
    pub(crate) fn configuring(
        &mut self,
        place: usize,
        model: Model,
        to_write: Option<(&[u8], u8)>,
        is_read: bool,
    ) -> &mut Configuring {
        let known = self.configuring.iter().position(|it| it.place == place);
        let at = known.unwrap_or(self.configuring.len());
        if known.is_none() {
            self.configuring.push(Configuring::new(place, model, to_write, is_read));
        }
        &mut self.configuring[at]
    }

    /// Removes the work for a place of the job block.
    pub(crate) fn withdraw(&mut self, place: usize) {
        self.configuring.retain(|it| it.place != place);
        self.boot_up.take_if(|(of, _)| *of == place);
    }

    /// Records a module's configuration that was read.
    pub(crate) fn has_read(&mut self, node: u8, model: Model, kinds: &[u8]) {
        let mut channels = Channels::new(model);
        kinds.iter().enumerate().for_each(|(index, kind)| _ = channels.set(index, *kind));
        match self.slaves.iter_mut().find(|it| it.node == node) {
            Some(known) => (known.channels, known.sent) = (channels, ModuleOutputs::default()),
            None => {
                let (bits, words, sent) = (0, [0; 4], ModuleOutputs::default());
                self.slaves.push(Slave { node, channels, is_known: false, bits, words, sent });
            }
        }
    }

    /// Records the digital inputs of a module.
    pub(crate) fn set_bits(&mut self, node: u8, data: &[u8]) {
        if let (Some(slave), Some(bits)) = (self.slaves.iter_mut().find(|it| it.node == node), data.first()) {
            slave.bits = *bits;
        }
    }

    /// Records the measured values of a module.
    pub(crate) fn set_words(&mut self, node: u8, data: &[u8]) {
        if let Some(slave) = self.slaves.iter_mut().find(|it| it.node == node) {
            let words = data.as_chunks::<2>().0;
            slave.words.iter_mut().zip(words).for_each(|(to, two)| *to = u16::from_le_bytes(*two));
        }
    }

    /// Records the missing nodes. Nodes that were not missing before are noted if there is room (p. 75).
    pub(crate) fn note_missing(&mut self, nodes: Vec<u8>) {
        let new = nodes.iter().filter(|node| !self.now_missing.contains(node));
        let room = MISSING.saturating_sub(self.missing.len());
        self.missing.extend(new.take(room));
        self.now_missing = nodes;
    }

    /// Removes the noted nodes. Nodes that have been missing since then are not noted again.
    pub(crate) fn forget_missing(&mut self) {
        self.missing.clear();
    }

    /// Returns the noted missing nodes, followed by 0.
    pub(crate) fn missing(&self) -> [u8; MISSING] {
        core::array::from_fn(|index| self.missing.get(index).copied().unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_nodes_are_noted_once_in_their_order_up_to_eight() {
        let mut io = IoSlaves::default();
        io.note_missing(vec![5]);
        io.note_missing(vec![3, 5]);
        io.note_missing(vec![]);
        io.note_missing(vec![5]);
        assert_eq!(io.missing(), [5, 3, 5, 0, 0, 0, 0, 0]);
        io.note_missing((5..20).collect());
        assert_eq!(io.missing(), [5, 3, 5, 6, 7, 8, 9, 10]);
        io.forget_missing();
        io.note_missing((5..20).collect());
        assert_eq!(io.missing(), [0; 8]);
        io.note_missing((5..21).collect());
        assert_eq!(io.missing(), [20, 0, 0, 0, 0, 0, 0, 0]);
    }
}
