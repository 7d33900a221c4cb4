//! Verbs that wait for registers and expect values.

use super::Bench;
use super::register::Register;
use crate::layout::RegisterPhase;
use crate::script::{Failure, Numbers, ScenarioError, Span, Value};
use crate::time::{seconds, short};
use core::panic::Location;

impl Bench {
    /// Waits until the register holds the value; returns the time waited, in microseconds.
    ///
    /// # Errors
    /// The register does not get the value within this time. Also returns the errors of [`Bench::poke`].
    #[track_caller]
    pub fn wait(
        &mut self,
        register: &str,
        value: impl Into<Value>,
        within: impl Into<Span>,
    ) -> Result<u64, ScenarioError> {
        let at = Location::caller();
        let register = self.find(register)?;
        let (mask, value) = register.pattern(value.into().bits(&register.place)?);
        self.wait_for(&register, mask, value, within.into(), at)
    }

    /// Waits like [`Bench::wait`], but compares only the bits of `mask`.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::wait`]. It is also an error if the value has bits outside the mask.
    #[track_caller]
    pub fn wait_bits(
        &mut self,
        register: &str,
        mask: impl Into<Value>,
        value: impl Into<Value>,
        within: impl Into<Span>,
    ) -> Result<u64, ScenarioError> {
        let at = Location::caller();
        let (register, mask, value) = self.masked(register, mask.into(), value.into())?;
        self.wait_for(&register, mask, value, within.into(), at)
    }

    /// Waits until `condition` holds. The condition is evaluated after each event that may change it. Returns the time
    /// waited, in microseconds.
    ///
    /// # Errors
    /// The condition does not hold within this time, or `condition` fails.
    #[track_caller]
    pub fn wait_until(
        &mut self,
        within: impl Into<Span>,
        mut condition: impl FnMut(&mut Self) -> Result<bool, ScenarioError>,
    ) -> Result<u64, ScenarioError> {
        let at = Location::caller();
        let (within_us, start) = (self.span(within)?, self.now()?);
        while !condition(self)? {
            self.pass_or_fail(start, within_us, at)?;
        }
        self.time_since(start)
    }

    /// Returns the emulated time since `start_us`, or 0 if another client has taken the plant back to an earlier moment.
    pub(in crate::script) fn time_since(&mut self, start_us: u64) -> Result<u64, ScenarioError> {
        Ok(self.now()?.saturating_sub(start_us))
    }

    /// Advances the clock to the next event during a wait that began at `start_us`. Fails if the end of the wait is
    /// reached.
    ///
    /// # Errors
    /// The end of the wait is reached, or the emulator of the instance has ended.
    pub fn pass_or_fail(
        &mut self,
        start_us: u64,
        within_us: u64,
        at: &Location<'_>,
    ) -> Result<(), ScenarioError> {
        if self.pass(start_us.saturating_add(within_us))? {
            return Ok(());
        }
        let what =
            format!("the condition did not hold within {} from {} on", short(within_us), seconds(start_us));
        let mut failure = self.failure(what, at)?;
        failure.within_us = Some(within_us);
        Err(failure.into())
    }

    /// Advances the clock to the next event, at most to `deadline`. Returns `false` if the deadline is over.
    pub(super) fn pass(&mut self, deadline: u64) -> Result<bool, ScenarioError> {
        let left_us = deadline.saturating_sub(self.now()?);
        if left_us > 0 {
            self.advance_to_event(left_us)?;
        }
        Ok(left_us > 0)
    }

    /// Expects that the register holds the value.
    ///
    /// # Errors
    /// The register holds another value. Also returns the errors of [`Bench::poke`].
    #[track_caller]
    pub fn expect(&mut self, register: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let at = Location::caller();
        let register = self.find(register)?;
        let (mask, value) = register.pattern(value.into().bits(&register.place)?);
        self.expect_pattern(&register, mask, value, at)
    }

    /// Expects that the register's bits under `mask` equal the bits of `value`.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::expect`]. It is also an error if the value has bits outside the mask.
    #[track_caller]
    pub fn expect_bits(
        &mut self,
        register: &str,
        mask: impl Into<Value>,
        value: impl Into<Value>,
    ) -> Result<(), ScenarioError> {
        let at = Location::caller();
        let (register, mask, value) = self.masked(register, mask.into(), value.into())?;
        self.expect_pattern(&register, mask, value, at)
    }

    /// Expects that the register, as a number of its type, differs from `value` by at most `tolerance`.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::expect`].
    #[track_caller]
    pub fn expect_near(
        &mut self,
        register: &str,
        value: impl Into<Value>,
        tolerance: u32,
    ) -> Result<(), ScenarioError> {
        let at = Location::caller();
        let register = self.find(register)?;
        let bits = value.into().bits(&register.place)?;
        let found = self.load(register.spot)?;
        let live = self.live(&register)?;
        let ty = register.place.ty(live);
        let (wanted, actual) = (ty.number(bits), register.number(live, found));
        if wanted.abs_diff(actual) <= u64::from(tolerance) {
            return Ok(());
        }
        let what = format!("{} is {actual}, not {wanted} +- {tolerance}", register.label(live));
        let expected = format!("{wanted} +- {tolerance}");
        let mut failure = self.register_failure(&register, live, what, expected, found, at)?;
        let (expected, mask, tolerance) = (wanted, None, Some(tolerance));
        failure.numbers = Some(Numbers { expected, actual, mask, tolerance });
        Err(failure.into())
    }

    /// Expects that `holds`, a condition that the scenario has evaluated itself, is true. `text` describes the
    /// condition.
    ///
    /// # Errors
    /// The condition is false.
    #[track_caller]
    pub fn expect_that(&mut self, holds: bool, text: &str) -> Result<(), ScenarioError> {
        let at = Location::caller();
        if holds { Ok(()) } else { Err(self.failure(format!("not so: {text}"), at)?.into()) }
    }

    /// Parses the register, the mask and the value, and checks that they fit each other.
    fn masked(&self, text: &str, mask: Value, value: Value) -> Result<(Register, u32, u32), ScenarioError> {
        let register = self.whole_register(text)?;
        let (mask, value) = (mask.pattern(&register.place)?, value.pattern(&register.place)?);
        if value & !mask != 0 {
            let right = "the value has bits outside the mask, so this can never be".to_owned();
            return Err(ScenarioError::Argument { text: text.to_owned(), right });
        }
        Ok((register, mask, value))
    }

    fn wait_for(
        &mut self,
        register: &Register,
        mask: u32,
        value: u32,
        within: Span,
        at: &Location<'_>,
    ) -> Result<u64, ScenarioError> {
        let us = self.span(within)?;
        let start = self.now()?;
        let Err(found) = self.wait_op(register.spot, mask, value, us)? else {
            return self.time_since(start);
        };
        let live = self.live(register)?;
        let expected = expected(register, live, mask, value);
        let what = format!(
            "{} did not become {} within {} from {} on",
            register.label(live),
            wanted(register, live, mask, value),
            short(us),
            seconds(start)
        );
        let mut failure = self.register_failure(register, live, what, expected, found, at)?;
        failure.numbers = Some(numbers(register, live, mask, value, found));
        failure.within_us = Some(us);
        Err(failure.into())
    }

    fn expect_pattern(
        &mut self,
        register: &Register,
        mask: u32,
        value: u32,
        at: &Location<'_>,
    ) -> Result<(), ScenarioError> {
        let found = self.load(register.spot)?;
        if found & mask == value {
            return Ok(());
        }
        let live = self.live(register)?;
        let expected = expected(register, live, mask, value);
        let [is, not] = [register.place.format(live, found), wanted(register, live, mask, value)];
        let what = format!("{} is {is}, not {not}", register.label(live));
        let mut failure = self.register_failure(register, live, what, expected, found, at)?;
        failure.numbers = Some(numbers(register, live, mask, value, found));
        Err(failure.into())
    }

    fn register_failure(
        &mut self,
        register: &Register,
        live: RegisterPhase,
        what: String,
        expected: String,
        found: u32,
        at: &Location<'_>,
    ) -> Result<Failure, ScenarioError> {
        let mut failure = self.failure(what, at)?;
        failure.register = Some(register.name(live));
        failure.address = Some(register.place.address().to_string());
        failure.expected = Some(expected);
        failure.actual = Some(register.describe(live, found, self.is_forced(register)?));
        Ok(failure)
    }
}

/// Returns the expected value, as short as possible.
fn wanted(register: &Register, live: RegisterPhase, mask: u32, value: u32) -> String {
    let (whole, _) = register.pattern(0);
    let text = register.place.format(live, value);
    if mask == whole { text } else { format!("{text} under mask {}", register.place.format(live, mask)) }
}

/// Returns the expected value, with its meaning if all bits count.
fn expected(register: &Register, live: RegisterPhase, mask: u32, value: u32) -> String {
    let (whole, _) = register.pattern(0);
    if mask == whole { register.describe(live, value, false) } else { wanted(register, live, mask, value) }
}

/// Returns the expected and the actual value, as numbers.
fn numbers(register: &Register, live: RegisterPhase, mask: u32, value: u32, found: u32) -> Numbers {
    let (whole, _) = register.pattern(0);
    let number = |bits| register.place.ty(live).number(bits);
    // The expected value of a single bit is 0 or 1, regardless of its position.
    let expected = if register.place.bit().is_some() { i64::from(value != 0) } else { number(value) };
    let mask = (mask != whole).then_some(mask);
    Numbers { expected, actual: register.number(live, found), mask, tolerance: None }
}
