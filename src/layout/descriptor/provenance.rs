//! Sources of facts.

use core::fmt;

/// Source of a fact of the layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Provenance {
    /// The manual states the fact, on the given page.
    Manual,
    /// Another document states the fact: a manual with its page, or the vendor's type library.
    Documented(&'static str),
    /// The manual does not state the fact. The decision of the project with this number gives the reason.
    Inferred(&'static str),
}

impl Provenance {
    /// Returns the decision from which the fact follows; `None` if the fact is documented.
    #[must_use]
    pub const fn decision(self) -> Option<&'static str> {
        match self {
            Provenance::Manual | Provenance::Documented(_) => None,
            Provenance::Inferred(decision) => Some(decision),
        }
    }

    /// Returns `manual`, or the inferred facts with their decisions: `offset D-02, reset D-320`.
    #[must_use]
    pub fn summary(facts: &[(&str, Self)]) -> String {
        Self::inferred(facts).unwrap_or_else(|| Self::Manual.to_string())
    }

    /// Returns the inferred facts with their decisions: `offset D-02, reset D-320`; `None` if all are documented.
    pub(crate) fn inferred(facts: &[(&str, Self)]) -> Option<String> {
        let inferred: Vec<_> =
            facts.iter().filter_map(|(fact, from)| Some(format!("{fact} {}", from.decision()?))).collect();
        (!inferred.is_empty()).then(|| inferred.join(", "))
    }
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Provenance::Manual => f.pad("manual"),
            Provenance::Documented(document) => f.pad(&format!("manual: {document}")),
            Provenance::Inferred(decision) => f.pad(&format!("inferred {decision}")),
        }
    }
}
