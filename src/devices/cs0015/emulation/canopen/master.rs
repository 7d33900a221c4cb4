//! The built-in program as master. For the nodes of the plant file, it does what a program does with
//! `NMM_SET_NMT_MASTER`, `NMM_ADD_NODE`, `NMM_START_GUARDING`, `NMM_NODE_GUARDING` with AUTO_RESTART,
//! `NMM_SET_OPERATIONAL` and `PDO_SEND_SYNC_OBJ` (p. 52-67).

use super::nmt::{Nmt, Restart};
use super::node::Node;
use crate::devices::canopen::nmt::{Command, State};
use serde::{Deserialize, Serialize};

/// Time for which the master waits for its nodes before it starts the network, in us (D-432).
const BOOT_UP_US: u64 = 2_000_000;

/// Settings of a master's program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MasterConfig {
    /// Numbers of the nodes.
    pub nodes: Vec<u8>,
    /// Time between two requests for a node's state, in us.
    pub guard_us: u64,
    /// Number of consecutive answers that may be missing.
    pub life: u8,
    /// Time between two SYNC objects in us; `None` sends no SYNC.
    pub sync_us: Option<u64>,
}

/// A running NMT master.
#[derive(Serialize, Deserialize)]
pub(crate) struct Master {
    config: MasterConfig,
    /// Time in microseconds at which the master stops waiting for its nodes; `None` when it has started them.
    boot_up_until: Option<u64>,
    next_sync: u64,
}

impl Master {
    /// Calls the blocks for the program.
    pub(crate) fn new(config: MasterConfig, nmt: &mut Nmt, now: u64) -> Self {
        config.nodes.iter().for_each(|node| nmt.network.add(*node, config.guard_us, config.life));
        nmt.network.start(0, now);
        let next_sync = config.sync_us.map_or(u64::MAX, |sync_us| now.saturating_add(sync_us));
        Master { config, boot_up_until: Some(now + BOOT_UP_US), next_sync }
    }

    /// Handles the end of a program cycle. When all nodes have sent their state, or when the waiting time is
    /// over, starts the network, including the master itself (D-432).
    pub(crate) fn start(&mut self, nmt: &mut Nmt, node: &mut Node, now: u64) {
        let Some(until) = self.boot_up_until else { return };
        let has_all = self.config.nodes.iter().all(|number| nmt.network.state(*number).is_some());
        if has_all || now >= until {
            self.boot_up_until = None;
            nmt.restart = Restart::Always;
            nmt.command(node, Command::Start, 0);
            node.set_state(State::Operational, now);
        }
    }

    /// Returns the time of the next transmission.
    pub(crate) fn next_time(&self, nmt: &Nmt) -> u64 {
        nmt.network.next_time().min(self.next_sync)
    }

    /// Sends the due frames.
    pub(crate) fn due(&mut self, nmt: &mut Nmt, node: &mut Node, now: u64) {
        nmt.guard(node, now);
        if let Some(sync_us) = self.config.sync_us.filter(|_| self.next_sync <= now) {
            self.next_sync = now.saturating_add(sync_us);
            node.send_sync(now);
        }
    }
}
