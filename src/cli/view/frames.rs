//! Frames on the buses, interval by interval.

use super::list::List;
use crate::can::wire;
use crate::devices;
use crate::identity::BusIndex;
use crate::journal::text::Text;
use crate::journal::{Format, Names, Record, Ring, Source};
use crate::request::{BusScene, InstanceInfo};
use serde::Serialize;
use std::collections::VecDeque;

/// Number of frames that are kept.
const KEPT: usize = 8_192;
/// Number of SYNC edges that are kept for each bus.
const EDGES: usize = 2_048;
/// While the user holds an interval, the numbers of kept frames and edges are multiplied by this factor, so that the
/// displayed frames are not dropped.
const HELD: usize = 2;
/// Length of the time windows of a bus without SYNC, in microseconds.
const PART_US: u64 = 10_000;

/// A frame on a bus, or an entry for a frame that the bus expected and that was not sent.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BusFrame {
    /// Number of the bus.
    #[serde(skip)]
    bus: BusIndex,
    /// Start of the frame, in microseconds.
    pub from_us: u64,
    /// End of reception, in microseconds.
    pub until_us: u64,
    /// Description from the journal.
    pub text: String,
    /// True if the frame was omitted, lost or garbled.
    pub is_bad: bool,
}

impl BusFrame {
    /// Returns a copy of the frame that ends at another time.
    fn at(&self, until_us: u64) -> Self {
        let from_us = until_us.saturating_sub(self.until_us - self.from_us);
        Self { from_us, until_us, ..self.clone() }
    }

    /// True if a part of the frame is in the window.
    fn is_in(&self, window: Window) -> bool {
        self.until_us > window.begin_us && self.from_us < window.begin_us + window.us
    }
}

/// A time window of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Window {
    /// Start of the window: the SYNC edge, if the bus has SYNC.
    pub begin_us: u64,
    /// Length of the window.
    pub us: u64,
    /// True if the window begins with a SYNC edge.
    pub is_interval: bool,
}

/// A time window with its frames.
#[derive(Debug, Serialize)]
pub(crate) struct WindowFrames {
    window: Window,
    frames: Vec<BusFrame>,
}

/// Frames and SYNC edges of all buses, and the selection of the user.
#[derive(Default)]
pub(crate) struct Frames {
    wires: VecDeque<BusFrame>,
    /// Records with a count that can still grow, each with the last frame that it counts.
    counting: Vec<(Record, BusFrame)>,
    /// SYNC edges of each bus, the oldest first.
    edges: Vec<VecDeque<u64>>,
    text: Option<Text>,
    /// Bus with the displayed frames.
    pub(super) bus: BusIndex,
    /// Start of the held window, in microseconds; `None` if the latest window is displayed.
    held: Option<u64>,
    /// True if new records were dropped while the user held a window: the memory was full.
    has_dropped_records: bool,
    /// The list of frames, with the chosen frame.
    pub(super) list: List,
}

impl Frames {
    /// Adds new journal records, and the records with a count that can still grow.
    pub(crate) fn take(&mut self, records: &[Record], pending: &[Record], names: &Names, scene: &[BusScene]) {
        self.edges.resize_with(names.buses.len(), VecDeque::new);
        if self.held.is_some() && self.is_full() {
            self.has_dropped_records = true;
            return;
        }
        let mut text = self.text.take().unwrap_or_else(|| Text::new(names.clone(), devices::catalogue()));
        for record in records {
            self.add_edges(record);
            if let Some(last) = last_of(record, &mut text, names, scene) {
                self.wires.extend(record.times().map(|time| last.at(time)));
            }
        }
        self.counting.clear();
        for record in pending {
            self.add_edges(record);
            let last = last_of(record, &mut text, names, scene);
            self.counting.extend(last.map(|last| (record.clone(), last)));
        }
        self.text = Some(text);
        if self.held.is_some() {
            return;
        }
        let surplus = self.wires.len().saturating_sub(KEPT);
        self.wires.drain(..surplus);
        for edges in &mut self.edges {
            let surplus = edges.len().saturating_sub(EDGES);
            edges.drain(..surplus);
        }
    }

    /// True if there is no room for further frames or edges.
    fn is_full(&self) -> bool {
        self.wires.len() >= HELD * KEPT || self.edges.iter().any(|edges| edges.len() >= HELD * EDGES)
    }

    fn add_edges(&mut self, record: &Record) {
        let Source::Bus(bus) = record.event.source() else { return };
        if record.event.kind().ring() != Ring::Registers {
            return;
        }
        let Some(edges) = self.edges.get_mut(bus.index()) else { return };
        let last = edges.back().copied();
        let mut new: Vec<_> = record
            .times()
            .rev()
            .take(EDGES)
            .take_while(|time| last.is_none_or(|last| *time > last))
            .collect();
        new.reverse();
        edges.extend(new);
    }

    /// Removes frames and edges after `now_us`: the emulated time has gone back.
    pub(super) fn go_back(&mut self, now_us: u64) {
        self.wires.retain(|wire| wire.until_us <= now_us);
        self.counting.clear();
        self.edges.iter_mut().for_each(|edges| edges.retain(|edge| *edge <= now_us));
        self.held = self.held.filter(|held| *held <= now_us);
    }

    /// True if the displayed window stays while the clock advances.
    pub(super) fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Returns the displayed window.
    pub(super) fn window(&self, info: &InstanceInfo, scene: &[BusScene]) -> Window {
        let place = self.place(info);
        let begin = self.edges.get(self.bus.index()).zip(place);
        let begin = begin.and_then(|(edges, place)| Some((edges.get(place)?, edges.get(place + 1))));
        match begin {
            Some((begin, next)) => {
                let interval = scene.get(self.bus.index()).and_then(|bus| bus.interval.as_ref());
                let usual = interval.map_or(PART_US, |interval| u64::from(interval.us));
                // If the next edge is not known, the interval has the usual length.
                let us = next.map_or(usual, |next| next - begin).clamp(1, usual.max(1) * 2);
                Window { begin_us: *begin, us, is_interval: true }
            }
            None => {
                let part = self.held.unwrap_or(info.time_us) / PART_US;
                Window { begin_us: part * PART_US, us: PART_US, is_interval: false }
            }
        }
    }

    /// Returns the index of the edge that begins the displayed interval; `None` if there is no edge.
    fn place(&self, info: &InstanceInfo) -> Option<usize> {
        let edges = self.edges.get(self.bus.index())?;
        match self.held {
            Some(held) => edges.iter().rposition(|edge| *edge <= held),
            None => self.latest(info),
        }
    }

    /// Returns the index of the edge that begins the latest complete interval. If the clock runs, the interval must
    /// have ended before the time was read: the journal is read later and already contains newer, incomplete intervals.
    fn latest(&self, info: &InstanceInfo) -> Option<usize> {
        let edges = self.edges.get(self.bus.index())?;
        let come = edges.partition_point(|edge| *edge <= info.time_us);
        come.checked_sub(1 + usize::from(!info.is_stepped))
    }

    /// Returns the frames of the displayed bus that are in the window.
    pub(super) fn within(&self, window: Window) -> Vec<BusFrame> {
        let of_bus = self.wires.iter().filter(|wire| wire.bus == self.bus);
        let mut found: Vec<_> = of_bus.filter(|wire| wire.is_in(window)).cloned().collect();
        for (record, last) in self.counting.iter().filter(|(_, last)| last.bus == self.bus) {
            // Compares the times before it formats texts: a counted record can contain hundreds of frames.
            let end_us = window.begin_us + window.us + (last.until_us - last.from_us);
            let times = record.times().filter(|time| (window.begin_us..end_us).contains(time));
            found.extend(times.map(|time| last.at(time)).filter(|wire| wire.is_in(window)));
        }
        found.sort_by_key(|wire| (wire.from_us, wire.until_us));
        found
    }

    /// Moves to the previous or next interval. The interval stays displayed, unless it is the latest one.
    pub(super) fn turn(&mut self, is_back: bool, info: &InstanceInfo, scene: &[BusScene]) {
        // The pane gets its text formatter with the first records. Before that, there is nothing to turn to.
        if self.text.is_none() {
            return;
        }
        self.list.chosen = 0;
        let Window { begin_us, is_interval, .. } = self.window(info, scene);
        let next = match (self.edges.get(self.bus.index()), self.place(info)) {
            (Some(edges), Some(place)) if is_back => edges.get(place.saturating_sub(1)).copied(),
            (Some(edges), Some(place)) => {
                let latest = self.latest(info).unwrap_or(0);
                edges.get(place + 1).copied().filter(|_| place + 1 < latest)
            }
            _ if is_interval => None,
            _ if is_back => Some(begin_us.saturating_sub(PART_US)),
            _ => Some(begin_us + PART_US).filter(|next| next + PART_US <= info.time_us),
        };
        match next {
            Some(next) => self.held = Some(next),
            None => self.follow(),
        }
    }

    /// Returns the last complete windows of a bus, at most `count`, the oldest first.
    pub(crate) fn latest_windows(
        &mut self,
        bus: BusIndex,
        info: &InstanceInfo,
        scene: &[BusScene],
        count: usize,
    ) -> Vec<WindowFrames> {
        self.bus = bus;
        self.follow();
        let mut windows: Vec<WindowFrames> = Vec::new();
        while windows.len() < count {
            let window = self.window(info, scene);
            if windows.last().is_some_and(|last| last.window.begin_us <= window.begin_us) {
                break;
            }
            windows.push(WindowFrames { window, frames: self.within(window) });
            self.turn(true, info, scene);
        }
        windows.reverse();
        windows
    }

    /// Displays the latest window, and each later one when it is complete.
    pub(super) fn follow(&mut self) {
        self.held = None;
        if core::mem::take(&mut self.has_dropped_records) {
            self.wires.clear();
            self.edges.iter_mut().for_each(VecDeque::clear);
        }
    }
}

/// Returns the last frame of a record, or the entry for a missing frame; `None` for records of other kinds.
fn last_of(record: &Record, text: &mut Text, names: &Names, scene: &[BusScene]) -> Option<BusFrame> {
    let (event, source) = (record.event, record.event.source());
    let is_bad = event.kind().ring() == Ring::Missed;
    if event.kind().ring() != Ring::Traffic && !is_bad {
        text.skip(record);
        return None;
    }
    // The text formatter gets a record with one frame, because the text must describe a single frame.
    let single = Record { seq: 0, count: 1, period_us: 0, ..record.clone() };
    let mut line = String::new();
    text.record(&single, &mut line);
    let name = names.source(source);
    let bus = match source {
        Source::Bus(bus) => bus,
        _ => BusIndex::at(scene.iter().position(|bus| bus.ports.contains(&name))?),
    };
    let bit_s = scene.get(bus.index()).map_or(0, |bus| bus.bit_s);
    let us = event.frame().filter(|_| bit_s > 0).map_or(0, |carried| {
        u64::from(wire::bits_to_end_of_frame(&carried.frame)) * 1_000_000 / u64::from(bit_s)
    });
    let event_text = line.split_once(" s  ").map_or(line.as_str(), |(_, event_text)| event_text);
    let event_text = event_text.strip_prefix(name.as_str()).unwrap_or(event_text).trim();
    let until_us = record.time_us;
    Some(BusFrame {
        bus,
        from_us: until_us.saturating_sub(us),
        until_us,
        text: event_text.to_owned(),
        is_bad,
    })
}
