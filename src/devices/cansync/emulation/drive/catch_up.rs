//! Events that come to all drives on a bus. A drive processes them later than they occur.
//!
//! A drive sends nothing on its own initiative. So it need not process edges and reference values when they
//! come. It is sufficient to process them, in their order, before the drive is read or gets an individual
//! command.

use super::Drive;
use crate::can::Payload;
use crate::devices::cansync::frames::{Channel, is_in_time};

/// An event that comes to all drives on a bus.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BusEvent {
    /// A SYNC edge, which starts an interval of this length.
    Edge {
        /// Time of the edge in us.
        now_us: u64,
        /// Length of the interval.
        interval_us: u32,
    },
    /// A reference value frame of the master.
    Reference {
        /// Baud rate of the bus. Drives at another rate do not receive the frame.
        kbit_s: u16,
        /// Frame 1 or 2.
        channel: Channel,
        /// Content of the frame.
        payload: Payload,
    },
}

/// Log of the events, in their order.
#[derive(Debug, Default)]
pub(crate) struct EventLog {
    /// The events that at least one drive has not processed yet.
    passed: Vec<BusEvent>,
    /// Index of the last edge.
    edge: Option<usize>,
    /// Index of the first of the uniform intervals directly before the last edge.
    alike_from: usize,
    frames: IntervalFrames,
}

/// The reference value frames of an interval: at most one of each channel, in the order of the channels. Each
/// frame has eight bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct IntervalFrames {
    /// The channels of the frames: bit 0 for frame 1, bit 1 for frame 2.
    channels: u8,
    /// Baud rate of the frames; 0 without frames.
    kbit_s: u16,
}

impl IntervalFrames {
    /// Returns the frames of an interval with these events; `None` if the frames do not have this form.
    #[inline]
    fn of(came: &[BusEvent]) -> Option<Self> {
        let mut frames = IntervalFrames::default();
        for it in came {
            let BusEvent::Reference { kbit_s, channel, payload } = it else { return None };
            let bit = 1 << channel.index();
            if frames.channels >= bit || payload.len() != payload.padded().len() {
                return None;
            }
            if frames.channels != 0 && frames.kbit_s != *kbit_s {
                return None;
            }
            frames = IntervalFrames { channels: frames.channels | bit, kbit_s: *kbit_s };
        }
        Some(frames)
    }

    /// Returns the number of events in such an interval, including its edge.
    #[inline]
    fn stride(self) -> usize {
        1 + self.channels.count_ones() as usize
    }
}

impl EventLog {
    /// Adds an event that the drives process later.
    #[inline]
    pub(crate) fn push(&mut self, it: BusEvent) {
        if let BusEvent::Edge { now_us, interval_us } = it {
            self.begin(now_us, interval_us);
        }
        self.passed.push(it);
    }

    /// Ends an interval, because an edge comes.
    #[inline]
    fn begin(&mut self, now_us: u64, interval_us: u32) {
        let next = self.passed.len();
        let Some(edge) = self.edge.replace(next) else {
            self.alike_from = next;
            return;
        };
        let is_first = self.alike_from == edge;
        let frames = IntervalFrames::of(&self.passed[edge + 1..]);
        let frames = frames.filter(|frames| is_first || *frames == self.frames);
        match (frames, self.passed[edge]) {
            (Some(frames), BusEvent::Edge { now_us: before_us, interval_us: its })
                if its == interval_us && is_in_time(now_us.saturating_sub(before_us), its) =>
            {
                self.frames = frames;
            }
            _ => self.alike_from = next,
        }
    }

    /// Returns the number of events.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.passed.len()
    }

    /// Clears the log, because all drives are up to date.
    pub(crate) fn clear(&mut self) {
        self.passed.clear();
        self.edge = None;
    }

    /// Returns the events after the first `taken`.
    #[inline]
    pub(crate) fn since(&self, taken: usize) -> PendingEvents<'_> {
        let passed = self.passed.get(taken..).unwrap_or_default();
        let Some(edge) = self.edge.filter(|edge| *edge >= taken) else {
            return PendingEvents {
                one_by_one: &[],
                alike: UniformIntervals { passed: &[], frames: self.frames },
                rest: passed,
            };
        };
        let stride = self.frames.stride();
        let skipped = taken.saturating_sub(self.alike_from).next_multiple_of(stride);
        let (before, rest) = passed.split_at(edge - taken);
        let (one_by_one, alike) = before.split_at((self.alike_from + skipped).max(taken) - taken);
        PendingEvents { one_by_one, alike: UniformIntervals { passed: alike, frames: self.frames }, rest }
    }
}

/// Events that a drive has not processed yet, in three consecutive parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PendingEvents<'a> {
    /// Events before the uniform intervals.
    pub one_by_one: &'a [BusEvent],
    /// Whole intervals up to the last edge.
    pub alike: UniformIntervals<'a>,
    /// The last edge and the events after it.
    pub rest: &'a [BusEvent],
}

/// Intervals with frames on equal channels. Each begins in time after the previous interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UniformIntervals<'a> {
    passed: &'a [BusEvent],
    frames: IntervalFrames,
}

impl<'a> UniformIntervals<'a> {
    /// Returns the events one by one.
    pub(crate) fn passed(&self) -> &'a [BusEvent] {
        self.passed
    }

    /// Returns the time of the first edge, the time of the last edge, and the length of the intervals; `None`
    /// if there is no interval.
    #[inline]
    pub(crate) fn edges(&self) -> Option<(u64, u64, u32)> {
        let last = self.passed.len().checked_sub(self.frames.stride())?;
        match (self.passed.first()?, self.passed.get(last)?) {
            (BusEvent::Edge { now_us: first, interval_us }, BusEvent::Edge { now_us: last, .. }) => {
                Some((*first, *last, *interval_us))
            }
            _ => None,
        }
    }

    /// Returns the number of intervals.
    #[inline]
    pub(crate) fn count(&self) -> usize {
        self.passed.len() / self.frames.stride()
    }

    /// Returns the frames that a drive with this baud rate receives in each interval: bit 0 for frame 1, bit
    /// 1 for frame 2.
    #[inline]
    pub(crate) fn heard_at(&self, kbit_s: u16) -> u8 {
        if kbit_s == self.frames.kbit_s { self.frames.channels } else { 0 }
    }

    /// Returns the data of this channel's frame in each interval, with the first byte as the lowest byte; 0
    /// if there is no frame.
    #[inline]
    pub(crate) fn bits(
        &self,
        channel: Channel,
    ) -> impl ExactSizeIterator<Item = u64> + DoubleEndedIterator + Clone + use<'a> {
        let place = self.place(channel);
        self.passed.chunks_exact(self.frames.stride()).map(move |interval| bits_of(interval.get(place)))
    }

    /// Returns the content of this channel's frame in one interval.
    #[inline]
    pub(crate) fn bits_in(&self, interval: usize, channel: Channel) -> u64 {
        bits_of(self.passed.get(interval * self.frames.stride() + self.place(channel)))
    }

    /// Returns the index of the channel's frame within an interval.
    #[inline]
    fn place(&self, channel: Channel) -> usize {
        let before = self.frames.channels & ((1 << channel.index()) - 1);
        1 + before.count_ones() as usize
    }
}

#[inline]
fn bits_of(frame: Option<&BusEvent>) -> u64 {
    match frame {
        Some(BusEvent::Reference { payload, .. }) => u64::from_le_bytes(payload.padded()),
        _ => 0,
    }
}

impl Drive {
    /// Processes the events since the last update. The card sends samples only in the interval that begins
    /// with their edge. So it takes samples only at the last of the edges.
    pub(crate) fn catch_up(&mut self, since: &PendingEvents) {
        let before = since.one_by_one.len() + since.alike.passed.len();
        if before > 0 {
            let taken = self.cruise(since);
            if taken < before {
                self.take_edges(since.one_by_one.iter().chain(since.alike.passed).skip(taken));
            }
        }
        for it in since.rest {
            self.take(it, true);
        }
    }

    /// Processes the events one by one. The card takes no samples at these edges, because it would never send
    /// them.
    #[cold]
    fn take_edges<'a>(&mut self, passed: impl Iterator<Item = &'a BusEvent>) {
        passed.for_each(|it| self.take(it, false));
    }

    /// Processes one event. `is_looked_at` is true if the samples of the card may be read before the next
    /// edge.
    #[inline]
    fn take(&mut self, passed: &BusEvent, is_looked_at: bool) {
        match *passed {
            BusEvent::Edge { now_us, interval_us } => self.edge(now_us, interval_us, is_looked_at),
            BusEvent::Reference { kbit_s, channel, ref payload } => {
                if kbit_s == self.kbit_s {
                    self.reference_frame(channel, payload);
                }
            }
        }
    }
}
