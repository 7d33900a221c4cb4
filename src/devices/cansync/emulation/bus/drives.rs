//! The drives on a bus. Accesses bring them up to date.
//!
//! SYNC edges and reference value frames come to all drives in every interval, but few drives are accessed in
//! an interval. So the bus does not pass these events to each drive, but logs them once for all. An access
//! through this module first brings the drive up to date.

use crate::devices::cansync::drive::{BusEvent, Drive, EventLog};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use std::sync::OnceLock;

/// Number of logged events after which all drives process the log: about 128 intervals, four times the number
/// of drives that can be requested in turn.
const MOST: usize = 384;

/// The drives on a bus.
#[derive(Default)]
pub(super) struct Drives {
    all: Vec<Drive>,
    /// Snapshot of each drive at power-on.
    fresh: Vec<Box<[u8]>>,
    /// Events since the moment at which all drives were last up to date.
    passed: EventLog,
    /// For each drive, the number of logged events that it has processed.
    taken: Vec<usize>,
    /// Drives that are switched off, bit n for slave n. These drives receive no events.
    off: u32,
    /// Slaves with actual value frames that at least one drive evaluates, bit n for slave n.
    overheard: u32,
    /// Copies of the drives for readers. The copies are up to date.
    shown: OnceLock<Vec<Drive>>,
}

impl Drives {
    /// Adds a drive, as it is at power-on.
    pub(super) fn push(&mut self, mut drive: Drive) {
        if let Some(other) = self.all.last() {
            drive.share(other);
        }
        self.overheard |= drive.wants_overheard();
        let mut fresh = Saving::default();
        drive.save(&mut fresh);
        self.fresh.push(fresh.into_bytes().into());
        self.all.push(drive);
        self.taken.push(self.passed.len());
    }

    /// Returns the number of drives.
    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// Returns true if the bus has no drives.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Logs an event that comes to all drives.
    #[inline]
    pub(super) fn pass(&mut self, passed: BusEvent) {
        if self.all.is_empty() {
            return;
        }
        if self.passed.len() >= MOST {
            self.settle();
        }
        self.shown.take();
        self.passed.push(passed);
    }

    /// Returns true if a drive evaluates actual value frames of this slave.
    #[inline]
    pub(super) fn overhears(&self, number: u8) -> bool {
        self.overheard.checked_shr(number.into()).unwrap_or(0) & 1 != 0
    }

    /// Returns a drive, up to date.
    #[inline]
    pub(super) fn get_mut(&mut self, index: usize) -> Option<&mut Drive> {
        let (drive, taken) = (self.all.get_mut(index)?, self.taken.get_mut(index)?);
        let from = core::mem::replace(taken, self.passed.len());
        if !is_off(self.off, drive) {
            drive.catch_up(&self.passed.since(from));
        }
        self.shown.take();
        Some(drive)
    }

    /// Brings all drives up to date and clears the log.
    pub(super) fn settle(&mut self) -> &mut [Drive] {
        for (drive, from) in self.all.iter_mut().zip(&mut self.taken) {
            if !is_off(self.off, drive) {
                drive.catch_up(&self.passed.since(*from));
            }
            *from = 0;
        }
        self.passed.clear();
        self.shown.take();
        &mut self.all
    }

    /// Returns all drives for reading, with their present states.
    pub(super) fn look(&self) -> &[Drive] {
        if self.taken.iter().all(|taken| *taken == self.passed.len()) {
            return &self.all;
        }
        self.shown.get_or_init(|| {
            let up_to_date = |(drive, from): (&Drive, &usize)| {
                let mut drive = drive.clone();
                if !is_off(self.off, &drive) {
                    drive.catch_up(&self.passed.since(*from));
                }
                drive
            };
            self.all.iter().zip(&self.taken).map(up_to_date).collect()
        })
    }

    /// Switches exactly these drives off, bit n for slave n. A drive that is switched on or off gets its
    /// state at power-on.
    pub(super) fn switch_off(&mut self, off: u32) {
        self.settle();
        let changed = self.off ^ off;
        for (drive, fresh) in self.all.iter_mut().zip(&self.fresh) {
            if is_off(changed, drive) {
                // The snapshot was taken from this drive.
                let _ = drive.restore(&mut Saved::new(fresh));
            }
        }
        self.off = off;
    }
}

fn is_off(off: u32, drive: &Drive) -> bool {
    off.checked_shr(drive.slave_number().into()).unwrap_or(0) & 1 != 0
}

impl SnapshotFields for Drives {
    fn save(&self, to: &mut Saving) {
        let Self { all: _, fresh: _, passed: _, taken: _, off, overheard: _, shown: _ } = self;
        to.value(off);
        self.look().save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.off = from.value()?;
        self.passed.clear();
        self.taken.fill(0);
        self.shown.take();
        self.all.restore(from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cansync::drive::{DriveConfig, ParamFormat, ReferenceMapping, Source, ZkParameters};
    use crate::devices::cansync::frames::Channel;

    /// Returns a drive that takes a reference value from the frames of this slave.
    fn follower(slave: u8) -> Drive {
        let (channel, format) = (Channel::One, ParamFormat::Doubleword);
        let mapping = ReferenceMapping { word: 0, channel, format, source: Source::Slave(slave) };
        let demo = DriveConfig::demo("follower", 1);
        let zk = ZkParameters { zk_4: mapping.to_zk(), ..demo.standard_mapping() };
        Drive::new(&DriveConfig { zk: Some(zk), ..demo }, 500).unwrap()
    }

    #[test]
    fn drives_overhear_only_the_frames_of_slaves_that_they_follow() {
        let mut drives = Drives::default();
        assert!(!(0..=u8::MAX).any(|number| drives.overhears(number)));
        [2, 5].into_iter().for_each(|slave| drives.push(follower(slave)));
        let heard: Vec<u8> = (0..=u8::MAX).filter(|number| drives.overhears(*number)).collect();
        assert_eq!(heard, [2, 5]);
    }
}
