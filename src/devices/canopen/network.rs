//! The master's end of network management: it asks its nodes for their states, resets those that do not answer, and starts them
//! again.

use super::nmt::{Command, State};

/// What a master is to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// A remote frame that asks this node for its state.
    Ask(u8),
    /// A command for this node, 0 for all.
    Command(Command, u8),
}

/// A node as its master sees it.
#[derive(Clone, Copy, Debug)]
struct Guarded {
    node: u8,
    guard_us: u64,
    /// Answers in a row that may be missing.
    life: u8,
    next_at: u64,
    /// Requests in a row without an answer.
    unanswered: u8,
    state: Option<State>,
    /// Of the next answer; none before the first one.
    toggle: Option<u8>,
    is_missing: bool,
}

/// The nodes of a master.
#[derive(Clone, Debug, Default)]
pub struct Network {
    nodes: Vec<Guarded>,
}

/// The toggle bit of a guarding answer.
const TOGGLE: u8 = 0x80;

impl Network {
    /// Nobody is asked any more.
    pub fn clear(&mut self) {
        self.nodes.clear();
    }

    /// Asks `node` for its state from `now` on, every `guard_us` microseconds; `life` answers in a row may be missing.
    pub fn add(&mut self, node: u8, guard_us: u64, life: u8, now: u64) {
        self.nodes.push(Guarded {
            node,
            guard_us: guard_us.max(1),
            life: life.max(1),
            next_at: now,
            unanswered: 0,
            state: None,
            toggle: None,
            is_missing: false,
        });
    }

    /// The first node that is missing.
    #[must_use]
    pub fn missing(&self) -> Option<u8> {
        self.nodes.iter().find(|it| it.is_missing).map(|it| it.node)
    }

    /// The state that `node` has last told.
    #[must_use]
    pub fn state(&self, node: u8) -> Option<State> {
        self.nodes.iter().find(|it| it.node == node)?.state
    }

    /// `node` has told its state. One that comes back from a reset is started again if `is_running`. An answer whose toggle bit has
    /// not changed is none.
    pub fn answered(&mut self, node: u8, answer: u8, is_running: bool) -> Option<Order> {
        let it = self.nodes.iter_mut().find(|it| it.node == node)?;
        let (toggle, state) = (answer & TOGGLE, State::from_code(answer & !TOGGLE)?);
        if it.toggle.is_some_and(|expected| expected != toggle) {
            return None;
        }
        let was_missing = core::mem::replace(&mut it.is_missing, false);
        (it.unanswered, it.state, it.toggle) = (0, Some(state), Some(toggle ^ TOGGLE));
        let comes_back = was_missing || state == State::PreOperational;
        (comes_back && is_running).then_some(Order::Command(Command::Start, node))
    }

    /// When somebody is to be asked next; `u64::MAX` if there is nobody.
    #[must_use]
    pub fn next_time(&self) -> u64 {
        self.nodes.iter().map(|it| it.next_at).fold(u64::MAX, u64::min)
    }

    /// What is to be sent at `now`.
    pub fn due(&mut self, now: u64) -> Vec<Order> {
        let mut orders = Vec::new();
        for it in self.nodes.iter_mut().filter(|it| it.next_at <= now) {
            it.next_at = now + it.guard_us;
            if it.unanswered >= it.life {
                it.is_missing = true;
                // After its reset it begins anew.
                it.toggle = None;
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

    #[test]
    fn a_node_that_answers_is_asked_again() {
        let mut network = Network::default();
        network.add(5, 100, 2, 10);
        assert_eq!((network.next_time(), network.due(10)), (10, vec![Order::Ask(5)]));
        assert_eq!(network.answered(5, 127, false), None);
        assert_eq!((network.state(5), network.next_time()), (Some(State::PreOperational), 110));
        assert_eq!(network.due(110), [Order::Ask(5)]);
        assert_eq!(network.answered(5, 0x85, true), None);
        assert_eq!(network.state(5), Some(State::Operational));
        assert_eq!(network.answered(6, 5, true), None, "nobody has added it");
    }

    /// P. 28: resets go on and on.
    #[test]
    fn a_node_that_does_not_answer_is_reset_until_it_does_and_is_started_then() {
        let mut network = Network::default();
        network.add(5, 100, 2, 0);
        network.due(0);
        network.answered(5, 5, true);
        assert_eq!([network.due(100), network.due(200)], [[Order::Ask(5)], [Order::Ask(5)]]);
        assert_eq!(network.answered(5, 5, true), None, "the toggle bit has not changed");
        assert_eq!(network.missing(), None);
        let again = [Order::Command(Command::ResetNode, 5), Order::Ask(5)];
        assert_eq!([network.due(300), network.due(400)], [again, again]);
        assert_eq!(network.missing(), Some(5));
        assert_eq!(network.answered(5, 127, true), Some(Order::Command(Command::Start, 5)));
        assert_eq!((network.missing(), network.due(500)), (None, vec![Order::Ask(5)]));
    }
}
