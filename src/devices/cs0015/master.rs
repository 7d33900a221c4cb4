//! The built-in program as master: what `NMM_SET_NMT_MASTER`, `NMM_ADD_NODE`, `NMM_START_GUARDING`, `NMM_NODE_GUARDING` with
//! AUTO_RESTART, `NMM_SET_OPERATIONAL` and `PDO_SEND_SYNC_OBJ` do for the nodes of the plant file (p. 52-67).

use super::nmt::{Nmt, Restart};
use super::node::Node;
use crate::devices::canopen::nmt::{Command, State};
use serde::{Deserialize, Serialize};

/// How long it waits for its nodes before it starts the network, in us (D-432).
const BOOT_UP_US: u64 = 2_000_000;

/// What the program of a master is told.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MasterConfig {
    /// Its nodes.
    pub nodes: Vec<u8>,
    /// Time between two requests for a node's state, in us.
    pub guard_us: u64,
    /// Answers in a row that may be missing.
    pub life: u8,
    /// Time between two SYNC objects in us; none sends no SYNC.
    pub sync_us: Option<u64>,
}

/// A master at work.
#[derive(Serialize, Deserialize)]
pub(super) struct Master {
    config: MasterConfig,
    /// When it gives up to wait for its nodes; none once it has started them.
    boot_up_until: Option<u64>,
    next_sync: u64,
}

impl Master {
    /// The program calls the blocks.
    pub(super) fn new(config: MasterConfig, nmt: &mut Nmt, now: u64) -> Self {
        config.nodes.iter().for_each(|node| nmt.network.add(*node, config.guard_us, config.life));
        nmt.network.start(0, now);
        let next_sync = config.sync_us.map_or(u64::MAX, |sync_us| now.saturating_add(sync_us));
        Master { config, boot_up_until: Some(now + BOOT_UP_US), next_sync }
    }

    /// The end of a cycle of the program: starts the network, the master itself included, when all nodes have told their state,
    /// or have had the time to (D-432).
    pub(super) fn start(&mut self, nmt: &mut Nmt, node: &mut Node, now: u64) {
        let Some(until) = self.boot_up_until else { return };
        let has_all = self.config.nodes.iter().all(|number| nmt.network.state(*number).is_some());
        if has_all || now >= until {
            self.boot_up_until = None;
            nmt.restart = Restart::Always;
            nmt.command(node, Command::Start, 0);
            node.set_state(State::Operational, now);
        }
    }

    /// When it has something to send.
    pub(super) fn next_time(&self, nmt: &Nmt) -> u64 {
        nmt.network.next_time().min(self.next_sync)
    }

    /// Sends what is due.
    pub(super) fn due(&mut self, nmt: &mut Nmt, node: &mut Node, now: u64) {
        nmt.guard(node, now);
        if let Some(sync_us) = self.config.sync_us.filter(|_| self.next_sync <= now) {
            self.next_sync = now.saturating_add(sync_us);
            node.send_sync(now);
        }
    }
}
