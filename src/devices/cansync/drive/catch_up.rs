//! What concerns all drives on a bus alike, and how a drive takes it later.
//!
//! A drive tells nobody anything of its own accord. So it need not take edges and reference values when they come: it is
//! enough that it has taken them, in their order, before somebody looks at it or gives it something that is for it alone.

use super::Drive;
use crate::can::Payload;
use crate::devices::cansync::bus::{Channel, is_in_time};

/// Something that has come to all drives on a bus.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Passed {
    /// A SYNC edge, with which an interval of this length begins.
    Edge {
        /// When.
        now_us: u64,
        /// Length of the interval.
        interval_us: u32,
    },
    /// A reference value frame of the master.
    Reference {
        /// Baud rate of the bus: drives that are set to another one do not hear it.
        kbit_s: u16,
        /// Frame 1 or 2.
        channel: Channel,
        /// What is in it.
        payload: Payload,
    },
}

/// All of it, in its order.
#[derive(Debug, Default)]
pub(crate) struct Log {
    passed: Vec<Passed>,
    /// The last edge.
    edge: Option<usize>,
    /// Where the intervals before that edge begin that are all alike and follow each other in step.
    alike_from: usize,
    frames: Frames,
}

/// The reference value frames of an interval: at most one of a channel, in their order, of eight bytes each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Frames {
    /// Bit 0 frame 1, bit 1 frame 2.
    channels: u8,
    /// Their baud rate; 0 if there is none.
    kbit_s: u16,
}

impl Frames {
    /// Those that have come, if they are of this kind.
    #[inline]
    fn of(came: &[Passed]) -> Option<Self> {
        let mut frames = Frames::default();
        for it in came {
            let Passed::Reference { kbit_s, channel, payload } = it else { return None };
            let bit = 1 << channel.index();
            if frames.channels >= bit || payload.len() != payload.padded().len() {
                return None;
            }
            if frames.channels != 0 && frames.kbit_s != *kbit_s {
                return None;
            }
            frames = Frames { channels: frames.channels | bit, kbit_s: *kbit_s };
        }
        Some(frames)
    }

    /// How much has passed in such an interval, its edge included.
    #[inline]
    fn stride(self) -> usize {
        1 + self.channels.count_ones() as usize
    }
}

impl Log {
    /// Something has come.
    #[inline]
    pub(crate) fn push(&mut self, it: Passed) {
        if let Passed::Edge { now_us, interval_us } = it {
            self.begin(now_us, interval_us);
        }
        self.passed.push(it);
    }

    /// An edge comes: an interval has ended.
    #[inline]
    fn begin(&mut self, now_us: u64, interval_us: u32) {
        let next = self.passed.len();
        let Some(edge) = self.edge.replace(next) else {
            self.alike_from = next;
            return;
        };
        let is_first = self.alike_from == edge;
        let frames = Frames::of(&self.passed[edge + 1..]);
        let frames = frames.filter(|frames| is_first || *frames == self.frames);
        match (frames, self.passed[edge]) {
            (Some(frames), Passed::Edge { now_us: before_us, interval_us: its })
                if its == interval_us && is_in_time(now_us.saturating_sub(before_us), its) =>
            {
                self.frames = frames;
            }
            _ => self.alike_from = next,
        }
    }

    /// How much it is.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.passed.len()
    }

    /// All have taken it.
    pub(crate) fn clear(&mut self) {
        self.passed.clear();
        self.edge = None;
    }

    /// What has come behind the first `taken`.
    #[inline]
    pub(crate) fn since(&self, taken: usize) -> Since<'_> {
        let passed = self.passed.get(taken..).unwrap_or_default();
        let Some(edge) = self.edge.filter(|edge| *edge >= taken) else {
            return Since {
                one_by_one: &[],
                alike: Alike { passed: &[], frames: self.frames },
                rest: passed,
            };
        };
        let stride = self.frames.stride();
        let behind = taken.saturating_sub(self.alike_from).next_multiple_of(stride);
        let (before, rest) = passed.split_at(edge - taken);
        let (one_by_one, alike) = before.split_at((self.alike_from + behind).max(taken) - taken);
        Since { one_by_one, alike: Alike { passed: alike, frames: self.frames }, rest }
    }
}

/// What a drive has not taken yet, in three parts one behind the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Since<'a> {
    /// Whatever came before the intervals that are alike.
    pub one_by_one: &'a [Passed],
    /// Whole intervals up to the last edge.
    pub alike: Alike<'a>,
    /// The last edge, and what came behind it.
    pub rest: &'a [Passed],
}

/// Intervals that all bring the same frames, each beginning in step with the one before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Alike<'a> {
    passed: &'a [Passed],
    frames: Frames,
}

impl<'a> Alike<'a> {
    /// All of it, one by one.
    pub(crate) fn passed(&self) -> &'a [Passed] {
        self.passed
    }

    /// The first edge, the last one, and the length of the intervals; `None`: there is no interval.
    #[inline]
    pub(crate) fn edges(&self) -> Option<(u64, u64, u32)> {
        let last = self.passed.len().checked_sub(self.frames.stride())?;
        match (self.passed.first()?, self.passed.get(last)?) {
            (Passed::Edge { now_us: first, interval_us }, Passed::Edge { now_us: last, .. }) => {
                Some((*first, *last, *interval_us))
            }
            _ => None,
        }
    }

    /// How many intervals these are.
    #[inline]
    pub(crate) fn count(&self) -> usize {
        self.passed.len() / self.frames.stride()
    }

    /// The frames that a drive of this baud rate hears in each interval: bit 0 frame 1, bit 1 frame 2.
    #[inline]
    pub(crate) fn heard_at(&self, kbit_s: u16) -> u8 {
        if kbit_s == self.frames.kbit_s { self.frames.channels } else { 0 }
    }

    /// What the frames of this channel bring, interval by interval, first byte lowest; 0 where there is none.
    #[inline]
    pub(crate) fn bits(
        &self,
        channel: Channel,
    ) -> impl ExactSizeIterator<Item = u64> + DoubleEndedIterator + Clone + use<'a> {
        let place = self.place(channel);
        self.passed.chunks_exact(self.frames.stride()).map(move |interval| bits_of(interval.get(place)))
    }

    /// The same of one interval.
    #[inline]
    pub(crate) fn bits_in(&self, interval: usize, channel: Channel) -> u64 {
        bits_of(self.passed.get(interval * self.frames.stride() + self.place(channel)))
    }

    /// Where in an interval its frame stands.
    #[inline]
    fn place(&self, channel: Channel) -> usize {
        let before = self.frames.channels & ((1 << channel.index()) - 1);
        1 + before.count_ones() as usize
    }
}

#[inline]
fn bits_of(frame: Option<&Passed>) -> u64 {
    match frame {
        Some(Passed::Reference { payload, .. }) => u64::from_le_bytes(payload.padded()),
        _ => 0,
    }
}

impl Drive {
    /// Takes what has passed since it was last up to date. What the card samples at an edge goes out in its interval, if at
    /// all: of all these edges that is the last one.
    pub(crate) fn catch_up(&mut self, since: &Since) {
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

    /// One by one, of all of which nobody can tell what the card samples.
    #[cold]
    fn take_edges<'a>(&mut self, passed: impl Iterator<Item = &'a Passed>) {
        passed.for_each(|it| self.take(it, false));
    }

    /// Takes one of them; unless it `is_looked_at` before the next edge, nobody can tell what the card samples.
    #[inline]
    fn take(&mut self, passed: &Passed, is_looked_at: bool) {
        match *passed {
            Passed::Edge { now_us, interval_us } => self.edge(now_us, interval_us, is_looked_at),
            Passed::Reference { kbit_s, channel, ref payload } => {
                if kbit_s == self.kbit_s {
                    self.reference_frame(channel, payload);
                }
            }
        }
    }
}
