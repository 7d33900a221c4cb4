//! Network management, master side: the master guards its nodes and resets the nodes that do not answer.

use super::nmt::{Command, State};
use serde::{Deserialize, Serialize};

/// A message that a master has to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// A remote frame that requests the state of this node.
    Ask(u8),
    /// A command for this node, or for all nodes if it is 0.
    Command(Command, u8),
}

/// Data of the master about a node.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct GuardedNode {
    node: u8,
    guard_us: u64,
    /// Number of consecutive missing answers after which the node counts as missing.
    life: u8,
    /// Time of the next request, in microseconds; `None` while the node is not guarded.
    next_at: Option<u64>,
    /// Number of consecutive requests without an answer.
    unanswered: u8,
    state: Option<State>,
    /// Toggle bit of the next answer; `None` before the first answer.
    toggle: Option<u8>,
    is_missing: bool,
}

/// Content of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GuardAnswer {
    /// State of the node.
    pub state: State,
    /// True if the node was missing before this answer.
    pub was_missing: bool,
}

/// The nodes of a master.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Network {
    nodes: Vec<GuardedNode>,
    /// The missing node that was returned last.
    shown: Option<u8>,
}

/// The toggle bit of a guarding answer.
const TOGGLE: u8 = 0x80;

impl Network {
    /// Adds `node`. Its state is requested every `guard_us` microseconds, or never if `guard_us` is 0. The node
    /// counts as missing after `life` requests in a row without an answer.
    pub(crate) fn add(&mut self, node: u8, guard_us: u64, life: u8) {
        self.nodes.retain(|it| it.node != node);
        self.nodes.push(GuardedNode {
            node,
            guard_us,
            life: life.max(1),
            next_at: None,
            unanswered: 0,
            state: None,
            toggle: None,
            is_missing: false,
        });
    }

    /// Returns the numbers of the known nodes.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = u8> {
        self.nodes.iter().map(|it| it.node)
    }

    /// True if `node` is known.
    #[must_use]
    pub(crate) fn has(&self, node: u8) -> bool {
        self.nodes.iter().any(|it| it.node == node)
    }

    /// Starts guarding `node`, or all nodes if it is 0; returns `false` if the node is not known.
    pub(crate) fn start(&mut self, node: u8, now: u64) -> bool {
        let nodes = self.nodes.iter_mut().filter(|it| node == 0 || it.node == node);
        nodes.filter(|it| it.guard_us != 0).for_each(|it| it.next_at = it.next_at.or(Some(now)));
        node == 0 || self.has(node)
    }

    /// Stops guarding `node`, or all nodes if it is 0. A node that is not guarded does not count as missing.
    /// Returns `false` if the node is not known.
    pub(crate) fn stop(&mut self, node: u8) -> bool {
        for it in self.nodes.iter_mut().filter(|it| node == 0 || it.node == node) {
            (it.next_at, it.unanswered, it.is_missing) = (None, 0, false);
        }
        node == 0 || self.has(node)
    }

    /// Returns the first missing node.
    #[must_use]
    pub(crate) fn missing(&self) -> Option<u8> {
        self.all_missing().next()
    }

    /// Returns all missing nodes.
    pub(crate) fn all_missing(&self) -> impl Iterator<Item = u8> {
        self.nodes.iter().filter(|it| it.is_missing).map(|it| it.node)
    }

    /// Returns the number of a missing node, or `None` if no node is missing. Successive calls return all
    /// missing nodes in turn, and then begin with the first again.
    pub(crate) fn next_missing(&mut self) -> Option<u8> {
        let next = self.all_missing().skip_while(|node| Some(*node) != self.shown).nth(1);
        self.shown = next.or_else(|| self.all_missing().next());
        self.shown
    }

    /// Returns the state of `node`, from its last answer or from the last command to it.
    #[must_use]
    pub(crate) fn state(&self, node: u8) -> Option<State> {
        self.nodes.iter().find(|it| it.node == node)?.state
    }

    /// Notes that the master sends a command to `node`, or to all nodes if it is 0.
    pub(crate) fn commanded(&mut self, command: Command, node: u8) {
        for it in self.nodes.iter_mut().filter(|it| node == 0 || it.node == node) {
            it.state = match command {
                Command::Start => Some(State::Operational),
                Command::Stop => Some(State::Stopped),
                Command::EnterPreOperational => Some(State::PreOperational),
                Command::ResetNode | Command::ResetCommunication => None,
            };
            if it.state.is_none() {
                // The node restarts its toggle bit.
                it.toggle = None;
            }
        }
    }

    /// Handles an answer in which `node` has sent its state, or 0 because it has just started. Ignores an
    /// answer with an unchanged toggle bit.
    pub(crate) fn answered(&mut self, node: u8, answer: u8) -> Option<GuardAnswer> {
        let it = self.nodes.iter_mut().find(|it| it.node == node)?;
        let (toggle, code) = (answer & TOGGLE, State::from_code(answer & !TOGGLE)?);
        let has_started = code == State::Initialising;
        let state = if has_started { State::PreOperational } else { code };
        if !has_started && it.toggle.is_some_and(|expected| expected != toggle) {
            return None;
        }
        let was_missing = core::mem::replace(&mut it.is_missing, false);
        it.toggle = (!has_started).then_some(toggle ^ TOGGLE);
        (it.unanswered, it.state) = (0, Some(state));
        Some(GuardAnswer { state, was_missing })
    }

    /// Returns the time of the next request; `u64::MAX` if no node is guarded.
    #[must_use]
    pub(crate) fn next_time(&self) -> u64 {
        self.nodes.iter().filter_map(|it| it.next_at).fold(u64::MAX, u64::min)
    }

    /// Returns the messages that are to be sent at `now`.
    pub(crate) fn due(&mut self, now: u64) -> Vec<Order> {
        let mut orders = Vec::new();
        for it in self.nodes.iter_mut().filter(|it| it.next_at.is_some_and(|next_at| next_at <= now)) {
            it.next_at = Some(now + it.guard_us);
            if it.unanswered >= it.life {
                it.is_missing = true;
                // After the reset, the node begins with toggle bit 0 again.
                (it.toggle, it.state) = (None, None);
                orders.push(Order::Command(Command::ResetNode, it.node));
            }
            it.unanswered = it.unanswered.saturating_add(1);
            orders.push(Order::Ask(it.node));
        }
        orders
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRE_OPERATIONAL: Option<GuardAnswer> =
        Some(GuardAnswer { state: State::PreOperational, was_missing: false });

    #[test]
    fn a_node_that_answers_is_guarded_again() {
        let mut network = Network::default();
        network.add(5, 100, 2);
        assert_eq!((network.next_time(), network.start(6, 10)), (u64::MAX, false));
        assert!(network.start(5, 10));
        assert_eq!((network.next_time(), network.due(10)), (10, vec![Order::Ask(5)]));
        assert_eq!(network.answered(5, 127), PRE_OPERATIONAL);
        assert_eq!((network.state(5), network.next_time()), (Some(State::PreOperational), 110));
        assert_eq!(network.due(110), [Order::Ask(5)]);
        assert!(network.answered(5, 0x85).is_some_and(|it| it.state == State::Operational));
        assert_eq!(network.answered(6, 5), None, "it was not added");
        assert!(network.stop(0) && !network.stop(6));
        assert_eq!((network.next_time(), network.due(1000)), (u64::MAX, vec![]));
    }

    /// Manual p. 28: the resets are repeated without a limit.
    #[test]
    fn a_node_that_does_not_answer_is_reset_until_it_does() {
        let mut network = Network::default();
        network.add(5, 100, 2);
        network.start(0, 0);
        network.due(0);
        network.answered(5, 5);
        assert_eq!([network.due(100), network.due(200)], [[Order::Ask(5)], [Order::Ask(5)]]);
        assert_eq!(network.answered(5, 5), None, "the toggle bit has not changed");
        assert_eq!(network.missing(), None);
        let again = [Order::Command(Command::ResetNode, 5), Order::Ask(5)];
        assert_eq!([network.due(300), network.due(400)], [again, again]);
        assert_eq!((network.missing(), network.state(5)), (Some(5), None));
        assert!(network.answered(5, 127).is_some_and(|it| it.was_missing));
        assert_eq!((network.missing(), network.due(500)), (None, vec![Order::Ask(5)]));
        network.due(600);
        network.due(700);
        assert_eq!(network.missing(), Some(5));
        network.stop(5);
        assert_eq!(network.missing(), None, "guarding was stopped");
    }

    #[test]
    fn a_started_node_restarts_its_toggle_bit() {
        let mut network = Network::default();
        network.add(5, 100, 2);
        network.answered(5, 5);
        assert_eq!(network.answered(5, 0), PRE_OPERATIONAL);
        assert_eq!(network.answered(5, 127), PRE_OPERATIONAL);
        network.commanded(Command::ResetNode, 0);
        assert_eq!(network.state(5), None);
        assert_eq!(network.answered(5, 127), PRE_OPERATIONAL);
        network.commanded(Command::Stop, 5);
        assert_eq!(network.state(5), Some(State::Stopped));
    }

    /// Manual p. 59.
    #[test]
    fn missing_nodes_are_shown_one_after_another() {
        let mut network = Network::default();
        (1..=4).for_each(|node| network.add(node, 100, 1));
        network.start(0, 0);
        network.due(0);
        network.answered(2, 5);
        network.due(100);
        let shown: Vec<_> = (0..5).filter_map(|_| network.next_missing()).collect();
        assert_eq!(shown, [1, 3, 4, 1, 3]);
        assert!([1, 3, 4].iter().all(|node| network.answered(*node, 127).is_some()));
        assert_eq!(network.next_missing(), None);
    }
}
