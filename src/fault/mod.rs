//! Faults that a user can inject into a plant. A fault has a kind, a target, a start and a limit.
//!
//! This module defines no kind of fault: each family of devices or buses defines its kinds ([`FaultKind`]) and applies
//! the faults. A [`Fault`] refers to buses and PLCs by index, so it is small and easy to send. The values of a
//! [`Fault`] are always valid for its kind. A [`FaultSpec`] is an unchecked fault with names, as in plant files and on
//! the command line. `docs/reference/faults.md` describes the effects on the plant.

mod acting;
mod effect;
mod error;
mod field;
mod field_value;
mod kind;
mod record;
mod sites;
mod spec;
#[cfg(test)]
mod tests;
mod text;
mod words;

pub use acting::Faults;
pub use effect::Effect;
pub use error::{FaultError, Refusal, slave_list};
pub use field::{Field, Form};
pub use field_value::{FaultSpec, FieldValue};
pub(crate) use kind::{DECLARED_BITS, Declaration, MOST_DECLARED, is_declared};
pub use kind::{FaultKind, MAX_BITS, MAX_FIELDS, MAX_PARTICIPANT, TargetKind};
pub use record::{FaultNews, Hit, KINDS, News};
pub use sites::{BusSite, DeviceSite, Owner, Sites, Target};
#[cfg(feature = "script")]
pub(crate) use spec::in_installation;
pub use words::WordError;

use kind::{AT_US, COUNT, DURATION_US};
use serde::{Deserialize, Serialize};

/// Maximum duration of a fault: one hour of emulated time, in microseconds.
pub const MAX_DURATION_US: u32 = 3_600_000_000;
/// Latest start of a fault: 365 days of emulated time after power-on, in microseconds.
pub const MAX_AT_US: u64 = 31_536_000_000_000;
/// Maximum number of pending and active faults at a time.
pub const MAX_FAULTS: usize = 256;

/// Values of a kind's own fields, in their order; `None` for an omitted field without a default.
pub type Values = [Option<u32>; MAX_FIELDS];

/// A fault that is valid for its kind. [`Sites::owner`] checks whether an installation can have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fault {
    kind: &'static FaultKind,
    target: Target,
    values: Values,
    at_us: u64,
    limit: Limit,
}

/// A fault before [`Draft::check`].
#[derive(Clone, Copy, Debug)]
pub struct Draft {
    /// Kind of the fault.
    pub kind: &'static FaultKind,
    /// Target of the fault.
    pub target: Target,
    /// Values of the kind's own fields, in their order; `None` for an omitted field.
    pub values: [Option<u64>; MAX_FIELDS],
    /// Emulated time at which the fault begins, in microseconds since power-on. With a time in the past, for example 0,
    /// it begins at once.
    pub at_us: u64,
    /// Number of hits after which the fault ends.
    pub count: Option<u64>,
    /// Duration of the fault, in emulated microseconds.
    pub duration_us: Option<u64>,
}

/// A pending or active fault in the list of an installation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultStatus {
    /// Number of the fault in the installation, from 1.
    pub id: u16,
    /// Description of the fault.
    pub fault: Fault,
    /// True if the fault has begun.
    pub acting: bool,
    /// Number of times that the fault has hit.
    pub hits: u32,
}

/// Condition that ends a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Limit {
    /// The fault ends when a client clears it.
    UntilCleared,
    /// The fault ends after the given number of hits, at least 1.
    Count(u32),
    /// The fault ends the given number of emulated microseconds after its start, 1 to [`MAX_DURATION_US`].
    Duration(u32),
}

impl Draft {
    /// Creates a fault without values, which begins at once and ends as its kind defines.
    #[must_use]
    pub const fn new(kind: &'static FaultKind, target: Target) -> Self {
        Draft { kind, target, values: [None; MAX_FIELDS], at_us: 0, count: None, duration_us: None }
    }

    /// Returns the fault, if it is valid for its kind.
    ///
    /// # Errors
    /// [`Refusal`] names the field and a correct value.
    pub fn check(self) -> Result<Fault, Refusal> {
        let Draft { kind, target, values: given, at_us, count, duration_us } = self;
        if target.place() != kind.place() {
            return Err(Refusal::OtherPlace { place: kind.place() });
        }
        if let Target::Participant { number, .. } = target {
            kind::SLAVE.check(number.into())?;
        }
        let mut values = [None; MAX_FIELDS];
        for (field, (value, given)) in kind.fields().iter().zip(values.iter_mut().zip(given)) {
            *value = match given {
                // No range of a field has more than 32 bits.
                Some(given) => Some(field.check(given)? as u32),
                None => field.default_value(),
            };
            if let (None, Some(right)) = (*value, field.missing()) {
                return Err(Refusal::Missing { field, right: right.to_owned() });
            }
        }
        AT_US.check(at_us)?;
        let limit = match (count, duration_us) {
            (None, None) if kind.happens_once() => Limit::Count(1),
            (None, None) => Limit::UntilCleared,
            (Some(_), Some(_)) => return Err(Refusal::TwoLimits),
            (Some(_), None) if !kind.has_hits() => return Err(Refusal::NotCounted { kind }),
            (Some(count), None) => Limit::Count(COUNT.check(count)? as u32),
            (None, Some(us)) => Limit::Duration(DURATION_US.check(us)? as u32),
        };
        let fault = Fault { kind, target, values, at_us, limit };
        kind.agree(&fault).map_err(Refusal::Disagree)?;
        Ok(fault)
    }
}

impl Fault {
    /// Kind of the fault.
    #[must_use]
    pub const fn kind(&self) -> &'static FaultKind {
        self.kind
    }

    /// Target of the fault.
    #[must_use]
    pub const fn target(&self) -> Target {
        self.target
    }

    /// Returns values of the kind's own fields, in their order.
    #[must_use]
    pub const fn values(&self) -> Values {
        self.values
    }

    /// Returns the value of the kind's own field `name`; `None` if it is omitted.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<u32> {
        let index = self.kind.fields().iter().position(|field| field.name() == name)?;
        self.values[index]
    }

    /// Emulated time at which the fault begins, in microseconds since power-on, at most [`MAX_AT_US`]. With a time in
    /// the past, for example 0, it begins at once.
    #[must_use]
    pub const fn at_us(&self) -> u64 {
        self.at_us
    }

    /// Limit of duration or hits.
    #[must_use]
    pub const fn limit(&self) -> Limit {
        self.limit
    }

    /// Effect of the fault, in the type of its family.
    #[must_use]
    pub fn effect(&self) -> Effect {
        self.kind.effect(self)
    }
}
