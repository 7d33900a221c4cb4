//! Communication monitoring of a drive: its reaction to a missing SYNC signal, missing reference values or a missing
//! PLC.
//!
//! According to the manuals, the drive then reports an error, with an adjustable reaction (5.00005.03a p.
//! 135; 5.01010.01 p. 17, 22). The manuals name no time, no default reaction and no error number. Decision
//! D-293 defines these.

use crate::snapshot_fields;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU16;

/// Default fault numbers (decision D-293).
pub(super) mod fault {
    pub(crate) const SYNC: u16 = 501;
    pub(crate) const REFERENCE_VALUES: u16 = 502;
    pub(crate) const CYCLIC_DATA: u16 = 503;
}

/// Reaction of a drive to an error, in addition to the error report (5.00005.03a p. 135: quick stop, inhibit,
/// ...).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[serde(expecting = "a reaction of the drive, as a word")]
pub enum Reaction {
    /// The drive continues. The error is a warning, which ends when its cause ends.
    #[default]
    None,
    /// Brakes to standstill, then "fault".
    QuickStop,
    /// Switches the power stage off at once: "fault".
    Inhibit,
}

/// Settings of one monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with the settings of a monitor")]
pub struct MonitorSettings {
    /// Time from the loss to the error report, in us, at most one hour. For SYNC, the time starts when the
    /// lock ends. For reference values, it starts when ZK 26 stops the exchange. For cyclic data, it starts
    /// at the last exchange.
    pub time_us: u64,
    /// Reaction of the drive.
    pub reaction: Reaction,
    /// Fault number in parameter 308. If it is omitted: 501 for SYNC, 502 for reference values, 503 for cyclic data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<NonZeroU16>,
}

/// Table `[bus.drive.monitoring]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with the monitors of the card")]
pub struct CardMonitoring {
    /// Monitor of the SYNC signal.
    pub sync: MonitorSettings,
    /// Monitor of the reference values, by ZK 26.
    pub reference_values: MonitorSettings,
}

/// Table `[plc.drive.monitoring]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a table with the monitors of the BAPS")]
pub struct BapsMonitoring {
    /// The signal of the trigger controller.
    pub sync: MonitorSettings,
    /// Monitoring of the PLC's process data. If it is omitted, the drive does not monitor the process data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cyclic_data: Option<MonitorSettings>,
}

/// The running monitor of one signal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Monitor {
    watch: MonitorSettings,
    fault: u16,
    /// Start of the present loss, in microseconds.
    since: Option<u64>,
    reported: bool,
}

snapshot_fields!(Monitor { values: since, reported; built: watch, fault });

impl Monitor {
    /// Creates a monitor. It reports `fault` unless `watch` has another number.
    pub(crate) fn new(watch: &MonitorSettings, fault: u16) -> Self {
        let fault = watch.fault.map_or(fault, NonZeroU16::get);
        Monitor { watch: *watch, fault, since: None, reported: false }
    }

    /// Notes that the signal is missing at `now`.
    #[inline]
    pub(crate) fn mark_missing(&mut self, now: u64) {
        if self.since.is_none() {
            (self.since, self.reported) = (Some(now), false);
        }
    }

    /// Notes that the signal is present.
    #[inline]
    pub(crate) fn mark_present(&mut self) {
        self.since = None;
    }

    /// Returns true if the signal is missing.
    #[inline]
    pub(crate) fn is_missing(&self) -> bool {
        self.since.is_some()
    }

    /// Returns the time at which the error will be reported.
    pub(crate) fn next_time(&self) -> Option<u64> {
        self.due().filter(|_| !self.reported)
    }

    fn due(&self) -> Option<u64> {
        self.since.map(|since| since.saturating_add(self.watch.time_us))
    }

    /// Returns number and reaction of the error if the signal has been missing for too long at `now`.
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
        let watch = MonitorSettings { time_us: 100, reaction: Reaction::QuickStop, fault: None };
        let mut monitor = Monitor::new(&watch, 7);
        assert_eq!((monitor.next_time(), monitor.error(1_000)), (None, None));
        monitor.mark_missing(1_000);
        monitor.mark_missing(1_050);
        assert_eq!((monitor.next_time(), monitor.error(1_099)), (Some(1_100), None));
        for now in [1_100, 1_200] {
            assert_eq!(monitor.error(now), Some((7, Reaction::QuickStop)));
            assert_eq!(monitor.next_time(), None, "it is reported");
        }
        monitor.mark_present();
        assert_eq!(monitor.error(1_300), None);
        monitor.mark_missing(1_300);
        assert_eq!(monitor.next_time(), Some(1_400));
    }

    #[test]
    fn the_plant_file_chooses_the_number() {
        let mut monitor =
            Monitor::new(&MonitorSettings { fault: NonZeroU16::new(9), ..MonitorSettings::default() }, 7);
        monitor.mark_missing(5);
        assert_eq!(monitor.error(5), Some((9, Reaction::None)));
    }
}
