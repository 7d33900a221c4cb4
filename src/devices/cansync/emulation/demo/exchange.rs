//! The cyclic part of the soft-PLC. A real PLC does this work in its SYNC event task.

use super::trace::{Trace, Writer};
use crate::devices::cansync::registers::values::send;
use crate::devices::emulation::demo::DemoError;
use std::time::Duration;

/// Slave numbers of the drives.
pub(crate) const DRIVES: [u8; 3] = [1, 2, 3];
/// Number of traced intervals. In this number of intervals each drive answers once: the first request goes to
/// slave 0, and an answer is visible one interval later.
const TRACED: u32 = 6;
/// Increase of the reference value per interval.
const SLOPE: u32 = 100;
/// The reference value at the end. Its digits are easy to recognize.
const LAST: u32 = 0x1122_3344;
/// Time limit for a SYNC pulse, in real time.
const SYNC: Duration = Duration::from_secs(5);

/// Exchange of process data, with counters.
pub(crate) struct Exchange<'a> {
    trace: &'a Trace<'a>,
    /// Length of the exchange in intervals: a second of emulated time.
    intervals: u32,
    /// SYNC pulses counted up to now.
    syncs: u32,
    /// Number of intervals in which the soft-PLC reacted in time.
    seen: u32,
    /// Number of intervals that passed unnoticed, because this process did not get the processor.
    unseen: u32,
    /// Number of reference value frames that the firmware took over before the next interval.
    sent: u32,
    /// Received actual value frames of each drive.
    received: [u32; DRIVES.len()],
}

impl<'a> Exchange<'a> {
    /// Starts at the next SYNC pulse; `intervals` is the number of intervals per second.
    pub(crate) fn new(trace: &'a Trace<'a>, intervals: u32) -> Self {
        Self {
            trace,
            intervals,
            syncs: trace.syncs(),
            seen: 0,
            unseen: 0,
            sent: 0,
            received: [0; DRIVES.len()],
        }
    }

    /// Exchanges process data for one second, then checks that the drives return a reference value as actual value.
    ///
    /// # Errors
    /// The emulator has ended, or a drive does not follow.
    pub(crate) fn run(mut self) -> Result<(), DemoError> {
        let intervals = self.intervals;
        self.trace.headline(&format!("Process data: the first {TRACED} of {intervals} intervals"))?;
        for interval in 0..intervals {
            self.interval(interval * SLOPE, interval < TRACED)?;
        }
        self.report()?;
        self.trace.headline("One more reference value, until all drives have it")?;
        // All drives must return the value as their actual value within half a second.
        let settle = intervals / 2;
        for _ in 0..settle {
            self.interval(LAST, false)?;
            if self.actual_values().all(|value| value == LAST) {
                return self.show_settled();
            }
        }
        let values: Vec<_> = self.actual_values().map(|value| format!("16#{value:08X}")).collect();
        let text = format!("reference value 16#{LAST:08X}, but actual values {}", values.join(", "));
        Err(DemoError::NotFollowed(format!("the drives have not followed within {settle} intervals: {text}")))
    }

    fn actual_values(&self) -> impl Iterator<Item = u32> {
        DRIVES.into_iter().map(|drive| self.trace.node.a_RD_BMARRAY[usize::from(drive)][0].load())
    }

    /// Executes an interval: waits for SYNC, reads the result of the previous interval, and writes the next reference
    /// value.
    fn interval(&mut self, reference: u32, traced: bool) -> Result<(), DemoError> {
        let what = format!("a SYNC pulse at {}", self.trace.port());
        self.trace.await_change(&what, SYNC, || self.trace.syncs() != self.syncs)?;
        let now = self.trace.syncs();
        self.unseen += now.wrapping_sub(self.syncs) - 1;
        self.syncs = now;
        if traced {
            self.trace.note_sync(now);
        }
        if self.seen > 0 {
            self.sent += u32::from(self.trace.node.b_CTRLREG_WRC1.load() == 0x04);
            if traced {
                self.trace.note(Writer::Firmware, &self.trace.node.b_CTRLREG_WRC1)?;
            }
        }
        self.seen += 1;
        self.read_actual_value(traced)?;
        self.write_reference_value(reference, traced)
    }

    fn read_actual_value(&mut self, traced: bool) -> Result<(), DemoError> {
        let node = &self.trace.node;
        let slave = node.b_STATREG_RDC1.load();
        let Some(index) = DRIVES.iter().position(|drive| *drive == slave) else { return Ok(()) };
        self.received[index] += 1;
        if traced {
            self.trace.note(Writer::Firmware, &node.b_STATREG_RDC1)?;
            self.trace.note(Writer::Firmware, &node.a_RD_BMARRAY[usize::from(slave)][0])?;
        }
        // Any value other than that of a received frame makes the register ready for the next frame.
        node.b_STATREG_RDC1.store(0xFF);
        Ok(())
    }

    fn write_reference_value(&self, reference: u32, traced: bool) -> Result<(), DemoError> {
        let node = &self.trace.node;
        node.a_WR_VALUE[0].store(reference);
        node.b_CTRLREG_WRC1.store(send::RELEASED);
        if traced {
            self.trace.note(Writer::Plc, &node.a_WR_VALUE[0])?;
            self.trace.note(Writer::Plc, &node.b_CTRLREG_WRC1)?;
        }
        self.trace.ring()
    }

    fn report(&self) -> Result<(), DemoError> {
        self.trace.print()?;
        let received = DRIVES.iter().zip(self.received);
        let received: Vec<_> = received.map(|(drive, count)| format!("drive {drive} {count}")).collect();
        let answered = self.seen.saturating_sub(1);
        let mut text = format!(
            "in {} intervals: {} reference value frames sent in time, {} too late; actual value frames: {}\n",
            self.seen,
            self.sent,
            answered.saturating_sub(self.sent),
            received.join(", "),
        );
        if self.unseen > 0 {
            let unseen = self.unseen;
            text.push_str(&format!("{unseen} more went by while the soft-PLC did not get the processor\n"));
        }
        self.trace.print_text(&text)
    }

    fn show_settled(&self) -> Result<(), DemoError> {
        let node = &self.trace.node;
        self.trace.note(Writer::Plc, &node.a_WR_VALUE[0])?;
        for drive in DRIVES {
            self.trace.note(Writer::Firmware, &node.a_RD_BMARRAY[usize::from(drive)][0])?;
        }
        self.trace.print()
    }
}
