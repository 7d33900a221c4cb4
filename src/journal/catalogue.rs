//! All event kinds and rules that the families of devices register.

use super::coded::Words;
use super::event::Event;
use super::kind::EventKind;
use super::rule::Rule;

/// The part of a kind of fault that records need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultName {
    /// Number of the kind.
    pub number: u8,
    /// Name of the kind.
    pub name: &'static str,
}

/// All kinds of events, rules of the access checker and kinds of faults, in the order of their numbers.
#[derive(Debug)]
pub struct Catalogue {
    /// All kinds of events.
    pub kinds: Vec<&'static EventKind>,
    /// All rules of the access checker.
    pub rules: Vec<&'static Rule>,
    /// All kinds of faults.
    pub faults: Vec<FaultName>,
}

impl Catalogue {
    /// Returns the kind of event with this name.
    pub fn kind(&self, name: &str) -> Option<&'static EventKind> {
        self.kinds.iter().copied().find(|kind| kind.name() == name)
    }

    /// Returns the rule with this number.
    pub fn rule(&self, number: u8) -> Option<&'static Rule> {
        self.rules.iter().copied().find(|rule| rule.number() == number)
    }

    /// Returns the rule with this name.
    pub fn rule_called(&self, id: &str) -> Option<&'static Rule> {
        self.rules.iter().copied().find(|rule| rule.id() == id)
    }

    /// Returns the name of the kind of fault with this number.
    pub fn fault(&self, number: u8) -> Option<&'static str> {
        self.faults.iter().find(|fault| fault.number == number).map(|fault| fault.name)
    }

    /// Decodes an event; `None` if the words are not an event.
    pub fn event(&self, words: Words) -> Option<Event> {
        let [number, ..] = words[0].to_le_bytes();
        let kind = self.kinds.iter().copied().find(|kind| kind.number() == number)?;
        (kind.normal(words, self)? == words).then(|| Event::of_words(kind, words))
    }
}
