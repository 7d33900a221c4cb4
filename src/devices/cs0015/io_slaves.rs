//! I/O modules as their master knows them: what they are configured as, and their words in the flags (p. 71-85).

use super::ram::Registers;
use crate::devices::canopen::sdo::At;
use crate::devices::cr201x::{CHANNELS, Channels, Model, Role};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Numbers of modules whose words have a place in the flags (p. 71).
pub(super) const NODES: core::ops::RangeInclusive<u32> = 1..=32;
/// Missing nodes that `COP_MSTR_MAIN` notes (p. 75).
const MISSING: usize = 8;
/// The entries of a module's object dictionary that its configuration is in (D-451).
const CONNECTORS: u16 = 0x2000;
const PWM: At = At { index: 0x2001, sub: 0 };

/// What goes to a module: a bit for each connector, and four words; none of what it does not have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Sent {
    pub bits: Option<u8>,
    pub words: Option<[u16; 4]>,
}

/// A module whose configuration has been read.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Slave {
    pub node: u8,
    pub channels: Channels,
    /// `SLAVE_CRxxxx_WORK` was called with INIT.
    pub is_known: bool,
    /// What it has told last.
    pub bits: u8,
    pub words: [u16; 4],
    /// What it was sent since it is Operational.
    pub sent: Sent,
}

impl Slave {
    /// Exchanges its words in the flags: inputs are written there, and what is to go out is returned.
    pub(super) fn exchange(&self, registers: &Registers) -> Sent {
        let Some(flags) =
            usize::from(self.node).checked_sub(1).and_then(|it| registers.slaves.a_SLAVE.get(it))
        else {
            return Sent::default();
        };
        let mut sent = Sent::default();
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
                // P. 85: the current stands here, of a PWM output nothing.
                Role::Signed(..) if self.channels.tells_current(pair) => flag.store(self.words[pair]),
                Role::Signed(..) => {}
            }
        }
        sent
    }
}

/// One transfer of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Transfer {
    /// Writes a byte.
    Write(At, u8),
    /// Reads one.
    Read(At),
}

/// A configuration under way, for a place of the job block.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Configuring {
    place: usize,
    to_do: VecDeque<Transfer>,
    read: Vec<u8>,
}

impl Configuring {
    /// Writes a module's configuration, if there is one to be written, and then reads it, if it is to be.
    fn new(place: usize, model: Model, to_write: Option<(&[u8], u8)>, is_read: bool) -> Self {
        let connector = |index: usize| At { index: CONNECTORS, sub: index as u8 + 1 };
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

    /// What is to be done now, if anything is left.
    pub(super) fn now(&self) -> Option<Transfer> {
        self.to_do.front().copied()
    }

    /// That has been done.
    pub(super) fn is_done(&mut self, data: &[u8]) {
        if let Some(Transfer::Read(_)) = self.to_do.pop_front() {
            self.read.extend(data.first());
        }
    }

    /// What was read.
    pub(super) fn read(&self) -> &[u8] {
        &self.read
    }
}

/// What a master knows of its I/O modules.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct IoSlaves {
    pub slaves: Vec<Slave>,
    configuring: Vec<Configuring>,
    /// When `COP_MSTR_BOOTUP` of a place of the job block is done.
    pub boot_up: Option<(usize, u64)>,
    /// When `COP_MSTR_MAIN` sends the next SYNC object.
    pub next_sync: u64,
    /// Nodes that are missing now, and those that have been, in their order.
    now_missing: Vec<u8>,
    missing: Vec<u8>,
}

impl IoSlaves {
    /// What is under way for a place of the job block; it begins if there is nothing yet.
    pub(super) fn configuring(
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

    /// Nobody waits at a place of the job block any more.
    pub(super) fn withdraw(&mut self, place: usize) {
        self.configuring.retain(|it| it.place != place);
        self.boot_up.take_if(|(of, _)| *of == place);
    }

    /// A module's configuration was read.
    pub(super) fn has_read(&mut self, node: u8, model: Model, kinds: &[u8]) {
        let mut channels = Channels::new(model);
        kinds.iter().enumerate().for_each(|(index, kind)| _ = channels.set(index, *kind));
        match self.slaves.iter_mut().find(|it| it.node == node) {
            Some(known) => (known.channels, known.sent) = (channels, Sent::default()),
            None => {
                let (bits, words, sent) = (0, [0; 4], Sent::default());
                self.slaves.push(Slave { node, channels, is_known: false, bits, words, sent });
            }
        }
    }

    /// A module has told its inputs.
    pub(super) fn told_bits(&mut self, node: u8, data: &[u8]) {
        if let (Some(slave), Some(bits)) = (self.slaves.iter_mut().find(|it| it.node == node), data.first()) {
            slave.bits = *bits;
        }
    }

    /// A module has told what it measures.
    pub(super) fn told_words(&mut self, node: u8, data: &[u8]) {
        if let Some(slave) = self.slaves.iter_mut().find(|it| it.node == node) {
            let words = data.as_chunks::<2>().0;
            slave.words.iter_mut().zip(words).for_each(|(to, two)| *to = u16::from_le_bytes(*two));
        }
    }

    /// These nodes are missing now; who was not before is noted, as long as there is room (p. 75).
    pub(super) fn note_missing(&mut self, nodes: Vec<u8>) {
        let new = nodes.iter().filter(|node| !self.now_missing.contains(node));
        let room = MISSING.saturating_sub(self.missing.len());
        self.missing.extend(new.take(room));
        self.now_missing = nodes;
    }

    /// Those that have been missing are forgotten; those that still are, are not noted again.
    pub(super) fn forget_missing(&mut self) {
        self.missing.clear();
    }

    /// The nodes that have been missing, 0 behind them.
    pub(super) fn missing(&self) -> [u8; MISSING] {
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
