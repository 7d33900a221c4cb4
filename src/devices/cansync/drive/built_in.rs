//! The drive behind the BAPS of a PLC: the Omega Drive-Line II is a module inside of it.

use super::config::{DriveError, ParameterNumbers};
use super::drivecom::{Enable, State};
use super::monitoring::{BapsMonitoring, Monitor, fault};
use super::parameters::ParameterSpec;
use super::regler::{Setup, VRegler};
use crate::devices::cansync::bus::SyncLock;
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;

/// How far from the SYNC slot (P167) the distance of two trigger edges may be, in us (decision D-156).
const TOLERANCE_US: u32 = 20;
/// How long after an edge the trigger signal counts as running, in us: longer than any period that a board timer or
/// CANsync can have.
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
    /// Version of the drive software, 309 for 000309: from there on it can be re-initialized while process data
    /// run, and it exchanges four actual values in the same cycle (manual 5.00005.03a p. 90, 104).
    pub software: u32,
    /// State after power-on.
    pub enable: Enable,
    /// How long the trigger controller's signal must come without a gap, in us, until the drive is synchronized (D-07).
    pub lock_time_us: u64,
    /// How long that signal may be gone, in us, until the drive is no longer synchronized. Left out: two and a half SYNC
    /// slots (P167); see [`SyncLock`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sync_loss_us: Option<u64>,
    /// What the drive does when the signal or the PLC's process data stay away.
    pub monitoring: BapsMonitoring,
    /// Time from a service data job to its answer, in us (decision D-158).
    pub service_time_us: u64,
    /// Largest change of the speed per second; as for a drive on the bus.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ramp_per_second: Option<NonZeroU32>,
    /// Numbers of the built-in parameters that no manual at hand gives.
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
    /// The last edge that the drive goes by.
    last_edge: Option<u64>,
    sync_monitor: Monitor,
    cyclic_data: Option<Monitor>,
}

snapshot_fields!(BuiltInDrive { values: last_edge; parts: regler, sync, sync_monitor, cyclic_data });

impl BuiltInDrive {
    /// The drive of PLC `plc` as it is after power-on.
    ///
    /// # Errors
    /// [`DriveError`] names the PLC and the parameter at fault.
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

    /// An edge of the trigger signal at `now_us`. In step with the SYNC slot (P167) for the lock time, the drive is
    /// synchronized. Tells whether the drive goes by this edge: once synchronized, not by one that is off its time.
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

    /// One run of the control task at `now_us`, `us` after the last. A trigger signal that has been gone for too long
    /// ends the synchronized state.
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
            self.sync_monitor.there();
        } else if was_synchronized {
            self.sync_monitor.away(now_us);
        }
    }

    /// The PLC has exchanged process data at `now_us`: until it does so again, it is away (decision D-295).
    pub(crate) fn exchanged(&mut self, now_us: u64) {
        if let Some(monitor) = &mut self.cyclic_data {
            monitor.there();
            monitor.away(now_us);
        }
    }

    /// The PLC configures the process data anew: nothing is to come before the first exchange.
    pub(crate) fn configured(&mut self) {
        if let Some(monitor) = &mut self.cyclic_data {
            monitor.there();
        }
    }

    fn sync_slot_us(&self) -> u32 {
        self.regler.sync_times().0
    }

    /// The first slot at `earliest` or later that lies at the SYNC offset after an edge; `None` unless the drive is
    /// synchronized.
    pub(crate) fn next_slot(&self, earliest: u64) -> Option<u64> {
        let edge = self.last_edge.filter(|_| self.is_synchronized())?;
        let (slot, offset) = self.regler.sync_times();
        let first = edge + u64::from(offset);
        let missed = earliest.saturating_sub(first).div_ceil(u64::from(slot.max(1)));
        Some(first + missed * u64::from(slot))
    }

    /// SYNC offset (P168): when, after an edge of the trigger signal, the drive's slot begins.
    pub(crate) fn sync_offset_us(&self) -> u32 {
        self.regler.sync_times().1
    }

    /// SYNC slot (P167) if it has to be the time between two communications over the BAPS: with a trigger signal and
    /// in mode "synchronous reference position" (manual 5.00005.03a p. 89).
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

    /// Whether the drive is synchronized to its trigger signal.
    #[inline]
    pub fn is_synchronized(&self) -> bool {
        self.sync.is_locked()
    }

    /// Whether nothing changes by itself, and no error will be reported.
    pub(crate) fn is_at_rest(&self) -> bool {
        let reports = [Some(&self.sync_monitor), self.cyclic_data.as_ref()];
        self.regler.is_at_rest() && reports.into_iter().flatten().all(|monitor| monitor.next_time().is_none())
    }

    /// The value of parameter `number`, if the drive has it.
    pub fn parameter(&self, number: u16) -> Option<u32> {
        self.regler.parameter(number)
    }

    /// The status word (parameter 121).
    pub fn status_word(&self) -> u16 {
        self.regler.status_word()
    }

    /// State of the drive's state machine.
    pub fn state(&self) -> State {
        self.regler.state()
    }

    /// Brings a fault upon the drive, as [`Drive::trip`](super::Drive::trip) does.
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
            "one off its time, one missing"
        );
        assert_eq!(
            locks(&mut drive, &[19120, 21120, 23120]),
            [false, false, true],
            "two and a half slots without"
        );
    }

    /// D-155: the slices of a drive lie where its trigger says; of one that is synchronized only where that is in time.
    #[test]
    fn a_synchronized_drive_goes_by_no_edge_that_is_off_its_time() {
        let mut drive = drive();
        let counts: Vec<_> = [0, 1500, 4000, 6000, 8000].map(|at| drive.trigger_edge(at)).into();
        assert_eq!((counts, drive.is_synchronized()), (vec![true; 5], true), "it goes by each until then");
        assert!(!drive.trigger_edge(8_300), "off its time");
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
