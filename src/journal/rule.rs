//! A rule of the access checker: an error of a PLC program, its severity, and its source. The module that checks a
//! rule declares it with `rules!`.

use core::fmt;

/// Severity of a violation of a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Severity {
    /// The manual forbids the act, or the act cannot have the intended effect.
    Error,
    /// The act is allowed or has no effect, but is probably not intended.
    Warning,
}

impl Severity {
    /// `error` or `warning`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
        }
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A rule of the access checker. Rules are equal if their numbers are equal.
pub struct Rule {
    number: u8,
    id: &'static str,
    severity: Severity,
    source: &'static str,
    text: &'static str,
}

impl Rule {
    /// Creates a rule; `rules!` calls this. No other rule may have the same number or name.
    pub const fn new(
        number: u8,
        id: &'static str,
        severity: Severity,
        source: &'static str,
        text: &'static str,
    ) -> Self {
        Rule { number, id, severity, source, text }
    }

    /// Returns the number of the rule in journal and channel; rules are listed in this order.
    #[must_use]
    pub const fn number(&self) -> u8 {
        self.number
    }

    /// Returns the name by which people refer to the rule.
    #[must_use]
    pub const fn id(&self) -> &'static str {
        self.id
    }

    /// Severity of a violation.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        self.severity
    }

    /// Returns the error of the PLC program, and the right use.
    #[must_use]
    pub const fn text(&self) -> &'static str {
        self.text
    }

    /// Pages of the manual, or a decision of the project.
    #[must_use]
    pub const fn source(&self) -> &'static str {
        self.source
    }
}

impl PartialEq for Rule {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for Rule {}

impl fmt::Debug for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id)
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.id)
    }
}

/// Declares rules, and `ALL` of them as a list: number, name, severity, source, text. A device registers them, and
/// its firmware reports a violation with `ctx.find(&IT, ..)`.
///
/// ```
/// commram::rules! {
///     TOO_FAR: 250, "too-far", Warning, "p. 7", "The angle is above 90 degrees. A door opens by 90 degrees at most.";
/// }
/// assert_eq!(ALL, [&TOO_FAR]);
/// ```
#[macro_export]
macro_rules! rules {
    ($($rule:ident: $number:literal, $id:literal, $severity:ident, $source:literal, $text:literal;)+) => {
        $(
            #[doc = $text]
            #[allow(unreachable_pub, reason = "the module may be private")]
            pub static $rule: $crate::journal::Rule = $crate::journal::Rule::new(
                $number, $id, $crate::journal::Severity::$severity, $source, $text,
            );
        )+

        /// All rules of this list.
        #[allow(unreachable_pub, reason = "the module may be private")]
        pub static ALL: &[&$crate::journal::Rule] = &[$(&$rule),+];
    };
}
