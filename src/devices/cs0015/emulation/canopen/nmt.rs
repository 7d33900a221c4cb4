//! The device as network master after `NMM_SET_NMT_MASTER`: nodes, their emergencies, and SDOs (p. 52-70).

use super::io_slaves::IoSlaves;
use super::node::Node;
use super::sdo_client::{SdoClient, SdoResult};
use crate::devices::canopen::network::{Network, Order};
use crate::devices::canopen::nmt::{Command, State};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// First identifiers of the predefined connection set (p. 38): emergencies, PDOs of I/O modules, answers of SDO servers, guarding.
const EMERGENCY: u16 = 0x080;
const IO_BITS: u16 = 0x180;
const IO_WORDS: u16 = 0x280;
const SDO_ANSWER: u16 = 0x580;
const GUARDING: u16 = 0x700;
/// Maximum number of emergencies that wait for the program (D-441).
const EMERGENCIES: usize = 30;

/// Condition for starting a node when it has sent its state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Restart {
    /// The node is never started automatically.
    #[default]
    Never,
    /// The node was missing before its answer: AUTO_RESTART (p. 59).
    Missing,
    /// The node is in Pre-Operational, for any reason.
    Always,
}

/// An emergency message of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Emergency {
    pub node: u8,
    pub code: u16,
    pub register: u8,
    pub data: [u8; 5],
}

/// The master of the network.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct Nmt {
    pub network: Network,
    pub restart: Restart,
    /// True if `PDO_INI_SEND_SYNC_OBJ` was called.
    pub has_sync: bool,
    pub emergencies: VecDeque<Emergency>,
    pub sdo: SdoClient,
    pub io: IoSlaves,
}

impl Nmt {
    fn give(node: &mut Node, order: Order) {
        match order {
            Order::Ask(number) => node.ask(GUARDING + u16::from(number)),
            Order::Command(command, number) => node.send_command(command, number),
        }
    }

    /// Handles a received frame, which may come from a node.
    pub(crate) fn received(&mut self, node: &mut Node, now: u64, id: u16, data: &[u8]) {
        let of = |first: u16| id.checked_sub(first).and_then(|number| u8::try_from(number).ok());
        let of = |first| of(first).filter(|number| self.network.has(*number));
        if let (Some(number), &[answer]) = (of(GUARDING), data) {
            self.answered(node, number, answer);
        } else if let (Some(number), Ok(answer)) = (of(SDO_ANSWER), data.try_into()) {
            if let Some(request) = self.sdo.answered(number, answer, now) {
                node.send_sdo(number, request);
            }
        } else if let (Some(number), &[low, high, register, a, b, c, d, e]) = (of(EMERGENCY), data) {
            let (code, data) = (u16::from_le_bytes([low, high]), [a, b, c, d, e]);
            if self.emergencies.len() < EMERGENCIES {
                self.emergencies.push_back(Emergency { node: number, code, register, data });
            }
        } else if let Some(number) = of(IO_BITS) {
            self.io.set_bits(number, data);
        } else if let Some(number) = of(IO_WORDS) {
            self.io.set_words(number, data);
        }
    }

    /// Handles the state that a node has sent.
    fn answered(&mut self, node: &mut Node, number: u8, answer: u8) {
        let Some(answered) = self.network.answered(number, answer) else { return };
        let is_to_start = match self.restart {
            Restart::Never => false,
            Restart::Missing => answered.was_missing,
            Restart::Always => answered.was_missing || answered.state == State::PreOperational,
        };
        if is_to_start {
            self.command(node, Command::Start, number);
        }
        self.show(node);
    }

    /// Sends a command to a node, or to all nodes if the number is 0.
    pub(crate) fn command(&mut self, node: &mut Node, command: Command, number: u8) {
        node.send_command(command, number);
        self.network.commanded(command, number);
    }

    /// Sends the requests for states of nodes that are due.
    pub(crate) fn guard(&mut self, node: &mut Node, now: u64) {
        self.network.due(now).into_iter().for_each(|order| Self::give(node, order));
        self.show(node);
    }

    /// Shows the number of the missing slave; 0 if no slave is missing (p. 152).
    pub(crate) fn show(&self, node: &Node) {
        node.registers.flags.COP_GUARDFAIL_NODEID.store(self.network.missing().unwrap_or(0));
    }

    /// Returns the time at which the waiting time for the answer to an SDO ends.
    pub(crate) fn next_time(&self) -> u64 {
        self.sdo.next_time()
    }

    pub(crate) fn due(&mut self, node: &mut Node, now: u64) {
        if let Some((number, abort)) = self.sdo.due(now) {
            node.send_sdo(number, abort);
        }
    }

    /// Handles the withdrawal of an order at a place of the job block.
    pub(crate) fn withdraw(&mut self, node: &mut Node, place: usize) {
        self.io.withdraw(place);
        if let Some((number, abort)) = self.sdo.withdraw(place) {
            node.send_sdo(number, abort);
        }
    }

    /// Takes the result of the SDO of a place of the job block.
    pub(crate) fn finished(&mut self, place: usize) -> Option<SdoResult> {
        self.sdo.finished(place)
    }
}
