//! The built-in program as master: what `NMM_SET_NMT_MASTER`, `NMM_ADD_NODE`, `NMM_START_GUARDING`, `NMM_NODE_GUARDING` with
//! AUTO_RESTART, `NMM_SET_OPERATIONAL` and `PDO_SEND_SYNC_OBJ` do for the nodes of the plant file (p. 52-67).

use super::node::Node;
use crate::devices::canopen::network::{Network, Order};
use crate::devices::canopen::nmt::{Command, State};

/// How long it waits for its nodes before it starts the network, in us (D-432).
const BOOT_UP_US: u64 = 2_000_000;
/// Guarding identifiers of the predefined connection set.
const GUARDING: u16 = 0x700;

/// What the program of a master is told.
#[derive(Clone, Debug, PartialEq, Eq)]
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
pub(super) struct Master {
    config: MasterConfig,
    network: Network,
    /// When it gives up to wait for its nodes; none once it has started them.
    boot_up_until: Option<u64>,
    next_sync: u64,
}

impl Master {
    /// The program calls the blocks.
    pub(super) fn new(config: &MasterConfig, now: u64) -> Self {
        let mut network = Network::default();
        config.nodes.iter().for_each(|node| network.add(*node, config.guard_us, config.life, now));
        let next_sync = config.sync_us.map_or(u64::MAX, |sync_us| now.saturating_add(sync_us));
        Master { config: config.clone(), network, boot_up_until: Some(now + BOOT_UP_US), next_sync }
    }

    fn give(&self, node: &mut Node, order: Order) {
        match order {
            Order::Ask(number) => node.ask(GUARDING + u16::from(number)),
            Order::Command(command, number) => node.send_command(command, number),
        }
    }

    /// A frame has come: a node's state, perhaps.
    pub(super) fn received(&mut self, node: &mut Node, id: u16, data: &[u8]) {
        let (Some(number), &[answer]) = (id.checked_sub(GUARDING), data) else { return };
        let Ok(number) = u8::try_from(number) else { return };
        let is_running = self.boot_up_until.is_none();
        if let Some(order) = self.network.answered(number, answer, is_running) {
            self.give(node, order);
        }
        self.show(node);
    }

    /// The end of a cycle of the program: starts the network, the master itself included, when all nodes have told their state,
    /// or have had the time to (D-432). Tells whether it has.
    pub(super) fn start(&mut self, node: &mut Node, now: u64) -> bool {
        let Some(until) = self.boot_up_until else { return false };
        let has_all = self.config.nodes.iter().all(|number| self.network.state(*number).is_some());
        let is_time = has_all || now >= until;
        if is_time {
            self.boot_up_until = None;
            node.send_command(Command::Start, 0);
            node.set_state(State::Operational, now);
        }
        is_time
    }

    /// When it has something to send.
    pub(super) fn next_time(&self) -> u64 {
        self.network.next_time().min(self.next_sync)
    }

    /// Sends what is due.
    pub(super) fn due(&mut self, node: &mut Node, now: u64) {
        for order in self.network.due(now) {
            self.give(node, order);
        }
        if let Some(sync_us) = self.config.sync_us.filter(|_| self.next_sync <= now) {
            self.next_sync = now.saturating_add(sync_us);
            node.send_sync(now);
        }
        self.show(node);
    }

    /// The number of the slave that is missing, 0 if there is none (p. 152).
    fn show(&self, node: &Node) {
        node.registers.flags.COP_GUARDFAIL_NODEID.store(self.network.missing().unwrap_or(0));
    }
}
