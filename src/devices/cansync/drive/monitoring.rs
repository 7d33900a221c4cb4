//! Communication monitoring of a drive: what it does when SYNC, reference values or its PLC stay away.
//!
//! The manuals say that the drive then reports an error, and that its reaction can be set (5.00005.03a p. 135;
//! 5.01010.01 p. 17, 22). They name no time, no reaction by default and no number: those are ours (decision D-293).

use crate::snapshot_fields;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU16;

/// Fault numbers where the plant file gives none (decision D-293).
pub(super) mod fault {
    pub(crate) const SYNC: u16 = 501;
    pub(crate) const REFERENCE_VALUES: u16 = 502;
    pub(crate) const CYCLIC_DATA: u16 = 503;
}

/// What a drive does beside reporting the error (5.00005.03a p. 135: quick stop, inhibit, ...).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[serde(expecting = "a reaction of the drive, as a word")]
pub enum Reaction {
    /// Nothing: a warning, which goes when its cause does.
    #[default]
    None,
    /// Brakes to standstill, then "fault".
    QuickStop,
    /// Switches the power stage off at once: "fault".
    Inhibit,
}

/// One thing that is monitored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table that says what is watched")]
pub struct Watch {
    /// How long it must have been away until the error is reported, in us, at most one hour. SYNC counts from the loss of
    /// the lock, reference values from the moment at which ZK 26 stops the exchange, cyclic data from the last exchange.
    pub time_us: u64,
    /// What the drive does then.
    pub reaction: Reaction,
    /// Number that parameter 308 shows. Left out: 501 SYNC, 502 reference values, 503 cyclic data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<NonZeroU16>,
}

/// Table `[bus.drive.monitoring]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with what the card watches")]
pub struct CardMonitoring {
    /// The SYNC signal.
    pub sync: Watch,
    /// Reference values, by ZK 26.
    pub reference_values: Watch,
}

/// Table `[plc.drive.monitoring]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with what the BAPS watches")]
pub struct BapsMonitoring {
    /// The signal of the trigger controller.
    pub sync: Watch,
    /// Process data of the PLC; left out: not monitored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cyclic_data: Option<Watch>,
}

/// A [`Watch`] at work.
#[derive(Clone, Copy, Debug)]
pub(super) struct Monitor {
    watch: Watch,
    fault: u16,
    /// Since when the thing has been away.
    since: Option<u64>,
    reported: bool,
}

snapshot_fields!(Monitor { values: since, reported; built: watch, fault });

impl Monitor {
    /// A monitor that reports `fault` unless `watch` names another number.
    pub(crate) fn new(watch: &Watch, fault: u16) -> Self {
        let fault = watch.fault.map_or(fault, NonZeroU16::get);
        Monitor { watch: *watch, fault, since: None, reported: false }
    }

    /// The thing is away, or still away, at `now`.
    #[inline]
    pub(crate) fn away(&mut self, now: u64) {
        if self.since.is_none() {
            (self.since, self.reported) = (Some(now), false);
        }
    }

    /// The thing is there.
    #[inline]
    pub(crate) fn there(&mut self) {
        self.since = None;
    }

    /// Whether the thing is away.
    #[inline]
    pub(crate) fn is_away(&self) -> bool {
        self.since.is_some()
    }

    /// When the error will be reported.
    pub(crate) fn next_time(&self) -> Option<u64> {
        self.due().filter(|_| !self.reported)
    }

    fn due(&self) -> Option<u64> {
        self.since.map(|since| since.saturating_add(self.watch.time_us))
    }

    /// Number and reaction, if the thing has been away for too long at `now`.
    #[inline]
    pub(crate) fn error(&mut self, now: u64) -> Option<(u16, Reaction)> {
        let is_due = self.due()? <= now;
        self.reported |= is_due;
        is_due.then_some((self.fault, self.watch.reaction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_due_after_its_time_and_until_the_cause_is_gone() {
        let watch = Watch { time_us: 100, reaction: Reaction::QuickStop, fault: None };
        let mut monitor = Monitor::new(&watch, 7);
        assert_eq!((monitor.next_time(), monitor.error(1_000)), (None, None));
        monitor.away(1_000);
        monitor.away(1_050);
        assert_eq!((monitor.next_time(), monitor.error(1_099)), (Some(1_100), None));
        for now in [1_100, 1_200] {
            assert_eq!(monitor.error(now), Some((7, Reaction::QuickStop)));
            assert_eq!(monitor.next_time(), None, "it is reported");
        }
        monitor.there();
        assert_eq!(monitor.error(1_300), None);
        monitor.away(1_300);
        assert_eq!(monitor.next_time(), Some(1_400));
    }

    #[test]
    fn the_plant_file_chooses_the_number() {
        let mut monitor = Monitor::new(&Watch { fault: NonZeroU16::new(9), ..Watch::default() }, 7);
        monitor.away(5);
        assert_eq!(monitor.error(5), Some((9, Reaction::None)));
    }
}
