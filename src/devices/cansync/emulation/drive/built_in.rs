//! The built-in drive of a PLC. It is connected to the PLC's BAPS: an Omega Drive-Line II is a module inside
//! the drive.

use super::config::{DriveError, ParameterNumbers};
use super::drivecom::{DrivecomState, Enable};
use super::monitoring::{BapsMonitoring, Monitor, fault};
use super::parameters::ParameterSpec;
use super::regler::{Setup, VRegler};
use crate::devices::cansync::frames::SyncLock;
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;

/// Permitted difference between the SYNC slot (P167) and the time between two trigger edges, in us (decision
/// D-156).
const TOLERANCE_US: u32 = 20;
/// Time after an edge during which the trigger signal counts as running, in us. It is longer than any period
/// of a board timer or of CANsync.
const TRIGGERED_US: u64 = 100_000;

/// The drive of a PLC, section `[plc.drive]` of the plant file. Every key has a default.
///
/// ```
/// let drive: commram::devices::cansync::drive::BuiltInDriveConfig = toml::from_str(r#"
///     software = 308             # before re-initialization existed
///     parameters = [{ number = 400, format = "word", initial = 7, max = 100 }]
/// "#)?;
/// assert_eq!(drive.service_time_us, 2000);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[serde(expecting = "a drive: a table with its settings")]
pub struct BuiltInDriveConfig {
    /// Version of the drive software; 309 means 000309. From 309 on, the drive can be re-initialized while
    /// process data run, and it exchanges four actual values in one cycle (manual 5.00005.03a p. 90, 104).
    pub software: u32,
    /// State after power-on.
    pub enable: Enable,
    /// Time in us for which the trigger controller must supply its signal without a gap until the drive is
    /// synchronized (D-07).
    pub lock_time_us: u64,
    /// Time in us without the signal of the trigger controller after which the drive is no longer
    /// synchronized. Left out: two and a half SYNC slots (P167); see [`SyncLock`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sync_loss_us: Option<u64>,
    /// Reaction of the drive if the trigger signal or the process data of the PLC are missing.
    pub monitoring: BapsMonitoring,
    /// Time from a service data job to its answer, in us (decision D-158).
    pub service_time_us: u64,
    /// Largest change of the speed per second, as for a drive on the bus.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ramp_per_second: Option<NonZeroU32>,
    /// Numbers of built-in parameters for which the available manuals give no number.
    pub numbers: ParameterNumbers,
    /// Further parameters.
    pub parameters: Vec<ParameterSpec>,
}

impl Default for BuiltInDriveConfig {
    fn default() -> Self {
        BuiltInDriveConfig {
            software: 309,
            enable: Enable::ByControlWord,
            lock_time_us: 1_000_000,
            sync_loss_us: None,
            monitoring: BapsMonitoring::default(),
            service_time_us: 2000,
            ramp_per_second: None,
            numbers: ParameterNumbers::default(),
            parameters: Vec::new(),
        }
    }
}

/// A drive without a bus, synchronized by its trigger controller.
#[derive(Clone, Debug)]
pub struct BuiltInDrive {
    regler: VRegler,
    sync: SyncLock,
    /// The last edge that the drive accepted.
    last_edge: Option<u64>,
    sync_monitor: Monitor,
    cyclic_data: Option<Monitor>,
}

snapshot_fields!(BuiltInDrive { values: last_edge; parts: regler, sync, sync_monitor, cyclic_data });

impl BuiltInDrive {
    /// Creates the drive of PLC `plc` in its state after power-on.
    ///
    /// # Errors
    /// [`DriveError`] names the PLC and the wrong parameter.
    pub fn new(plc: &str, config: &BuiltInDriveConfig) -> Result<Self, DriveError> {
        let regler = VRegler::new(&Setup {
            name: plc,
            enable: config.enable,
            ramp_per_second: config.ramp_per_second,
            numbers: &config.numbers,
            parameters: &config.parameters,
            software: Some(config.software),
            sync_slot_us: None,
        })?;
        let mut sync = SyncLock::new(config.lock_time_us, config.sync_loss_us);
        sync.set_mode(true);
        let BapsMonitoring { sync: watch, cyclic_data } = &config.monitoring;
        Ok(BuiltInDrive {
            regler,
            sync,
            last_edge: None,
            sync_monitor: Monitor::new(watch, fault::SYNC),
            cyclic_data: cyclic_data.map(|watch| Monitor::new(&watch, fault::CYCLIC_DATA)),
        })
    }

    /// Handles an edge of the trigger signal at `now_us`. The drive becomes synchronized when the edges have
    /// had the distance of the SYNC slot (P167) during the lock time. Returns true if the drive accepts this
    /// edge: a synchronized drive ignores an edge at the wrong time.
    pub(crate) fn trigger_edge(&mut self, now_us: u64) -> bool {
        let was_synchronized = self.is_synchronized();
        let slot = self.sync_slot_us();
        if slot == 0 {
            self.sync.unlock();
        } else {
            self.sync.edge(now_us, slot, TOLERANCE_US);
        }
        self.notice_lock(was_synchronized, now_us);
        let counts = !self.sync.is_locked() || self.sync.last_edge() == now_us;
        if counts {
            self.last_edge = Some(now_us);
        }
        counts
    }

    /// Runs the control task once at `now_us`. The previous run was `us` earlier. If the trigger signal has
    /// been missing for too long, the drive is no longer synchronized.
    pub(crate) fn step(&mut self, now_us: u64, us: u32) {
        let was_synchronized = self.is_synchronized();
        self.sync.pass(now_us);
        self.notice_lock(was_synchronized, now_us);
        self.regler.monitor(now_us, core::iter::once(&mut self.sync_monitor).chain(&mut self.cyclic_data));
        self.regler.step(us);
    }

    fn notice_lock(&mut self, was_synchronized: bool, now_us: u64) {
        let is_synchronized = self.is_synchronized();
        self.regler.show_synchronized(is_synchronized);
        if is_synchronized {
            self.sync_monitor.mark_present();
        } else if was_synchronized {
            self.sync_monitor.mark_missing(now_us);
        }
    }

    /// Restarts the monitoring time, because the PLC has exchanged process data at `now_us` (decision D-295).
    pub(crate) fn exchanged(&mut self, now_us: u64) {
        if let Some(monitor) = &mut self.cyclic_data {
            monitor.mark_present();
            monitor.mark_missing(now_us);
        }
    }

    /// Stops the monitoring until the first exchange of process data, because the PLC configures new process
    /// data.
    pub(crate) fn configured(&mut self) {
        if let Some(monitor) = &mut self.cyclic_data {
            monitor.mark_present();
        }
    }

    fn sync_slot_us(&self) -> u32 {
        self.regler.sync_times().0
    }

    /// Returns the start of the first slot at `earliest` or later. A slot starts at the SYNC offset after an
    /// edge. `None` unless the drive is synchronized.
    pub(crate) fn next_slot(&self, earliest: u64) -> Option<u64> {
        let edge = self.last_edge.filter(|_| self.is_synchronized())?;
        let (slot, offset) = self.regler.sync_times();
        let first = edge + u64::from(offset);
        let missed = earliest.saturating_sub(first).div_ceil(u64::from(slot.max(1)));
        Some(first + missed * u64::from(slot))
    }

    /// Returns the SYNC offset (P168): the time from an edge of the trigger signal to the start of the drive's slot.
    pub(crate) fn sync_offset_us(&self) -> u32 {
        self.regler.sync_times().1
    }

    /// Returns the SYNC slot (P167) if it must be the time between two communications over the BAPS. This is
    /// required with a trigger signal in mode "synchronous reference position" (manual 5.00005.03a p. 89).
    pub(crate) fn required_slot_us(&self, now_us: u64) -> Option<u32> {
        let is_triggered = self.last_edge.is_some_and(|last| now_us.saturating_sub(last) <= TRIGGERED_US);
        (is_triggered || self.regler.is_following_angle()).then(|| self.sync_slot_us())
    }

    pub(crate) fn regler(&self) -> &VRegler {
        &self.regler
    }

    pub(crate) fn regler_mut(&mut self) -> &mut VRegler {
        &mut self.regler
    }

    /// Returns true if the drive is synchronized to its trigger signal.
    #[inline]
    pub fn is_synchronized(&self) -> bool {
        self.sync.is_locked()
    }

    /// Returns true if no value will change without a command, and no monitoring will report an error.
    pub(crate) fn is_quiescent(&self) -> bool {
        let reports = [Some(&self.sync_monitor), self.cyclic_data.as_ref()];
        self.regler.is_quiescent()
            && reports.into_iter().flatten().all(|monitor| monitor.next_time().is_none())
    }

    /// Returns the value of parameter `number`, if the drive has it.
    pub fn parameter(&self, number: u16) -> Option<u32> {
        self.regler.parameter(number)
    }

    /// Returns the status word (parameter 121).
    pub fn status_word(&self) -> u16 {
        self.regler.status_word()
    }

    /// Returns the state of the drive's state machine.
    pub fn state(&self) -> DrivecomState {
        self.regler.state()
    }

    /// Trips the drive, as [`Drive::trip`](super::Drive::trip) does.
    pub(crate) fn trip(&mut self, fault: u16) -> bool {
        self.regler.trip(fault)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cansync::drive::{ParamFormat, number};

    fn drive() -> BuiltInDrive {
        BuiltInDrive::new("line", &BuiltInDriveConfig { lock_time_us: 4000, ..Default::default() }).unwrap()
    }

    fn locks(drive: &mut BuiltInDrive, times: &[u64]) -> Vec<bool> {
        times
            .iter()
            .map(|&at| {
                drive.trigger_edge(at);
                drive.is_synchronized()
            })
            .collect()
    }

    #[test]
    fn locks_to_edges_at_the_distance_of_the_sync_slot() {
        let mut drive = drive();
        assert_eq!(locks(&mut drive, &[100, 2100, 4100, 6120]), [false, false, true, true]);
        assert_eq!(drive.status_word() & 0x8000, 0x8000);
        assert_eq!(
            locks(&mut drive, &[8141, 10120, 14120]),
            [true, true, true],
            "one at the wrong time, one missing"
        );
        assert_eq!(
            locks(&mut drive, &[19120, 21120, 23120]),
            [false, false, true],
            "two and a half slots without"
        );
    }

    /// Decision D-155: the trigger defines the time slices of a drive. A synchronized drive accepts an edge
    /// only at the right time.
    #[test]
    fn a_synchronized_drive_ignores_an_edge_at_the_wrong_time() {
        let mut drive = drive();
        let counts: Vec<_> = [0, 1500, 4000, 6000, 8000].map(|at| drive.trigger_edge(at)).into();
        assert_eq!(
            (counts, drive.is_synchronized()),
            (vec![true; 5], true),
            "it accepts each edge until then"
        );
        assert!(!drive.trigger_edge(8_300), "at the wrong time");
        assert!(drive.trigger_edge(10_000), "in time");
    }

    #[test]
    fn another_distance_never_locks() {
        for distance in [1000, 2021, 4000] {
            let times: Vec<u64> = (0..9).map(|n| n * distance).collect();
            assert!(!locks(&mut drive(), &times).contains(&true), "{distance}");
        }
        let mut drive = drive();
        drive.regler_mut().write_element(number::SYNC_SLOT, 7, ParamFormat::Word, 0).unwrap();
        assert!(!locks(&mut drive, &[0, 0, 0]).contains(&true));
    }

    #[test]
    fn a_signal_that_fails_ends_the_lock() {
        let mut drive = drive();
        locks(&mut drive, &[0, 2000, 4000]);
        drive.step(8999, 500);
        assert!(drive.is_synchronized());
        drive.step(9000, 500);
        assert!(!drive.is_synchronized());
        assert_eq!(drive.status_word() & 0x8000, 0);
    }

    #[test]
    fn the_time_without_signal_can_be_set() {
        let config =
            BuiltInDriveConfig { lock_time_us: 4000, sync_loss_us: Some(20_000), ..Default::default() };
        let mut drive = BuiltInDrive::new("line", &config).unwrap();
        locks(&mut drive, &[0, 2000, 4000]);
        drive.step(23_999, 500);
        assert!(drive.is_synchronized());
        drive.step(24_000, 500);
        assert_eq!((drive.is_synchronized(), drive.parameter(number::FAULT_NUMBER)), (false, Some(501)));
    }

    #[test]
    fn a_bad_parameter_names_the_plc() {
        let parameters = vec![ParameterSpec::new(120, ParamFormat::Word)];
        let error = BuiltInDrive::new("line", &BuiltInDriveConfig { parameters, ..Default::default() });
        assert!(
            error
                .unwrap_err()
                .to_string()
                .starts_with("drive line: parameter 120: the drive has this parameter itself")
        );
    }

    #[test]
    fn misspelt_keys_are_refused() {
        for text in ["softwear = 1", "ramp_per_second = 0"] {
            assert!(toml::from_str::<BuiltInDriveConfig>(text).is_err(), "{text}");
        }
    }
}
