//! Runs the buses of a large plant independently of each other, on a single core or on several.
//!
//! Buses interact only at certain moments: at SYNC edges, and at events of devices. Between two such moments,
//! buses that allow it ([`Bus::apart_until`]) run independently: each bus handles all its events in a row.
//! The processor's caches then load the data of a bus once, not for each event. Several cores share the
//! buses, and also the watches of the access checker. The journal contains the events of such a period in the
//! order in which a sequential run would record them: by time, then in plant order.

use super::Plant;
use super::ports::PluggedPort;
use super::worker_pool::WorkerPool;
use crate::check::DeviceWatch;
use crate::devices::{Bus, PortWatch, World};
use crate::fault::Faults;
use crate::identity::{BusIndex, DeviceIndex};
use crate::journal::Journal;
use core::num::NonZero;

/// Minimum number of buses. For fewer buses, the plant needs more time to sort their events than it saves.
pub(super) const LEAST: usize = 32;
/// Maximum number of sources of events in each device at one moment: its watch, its poll, and the watches and polls of
/// its ports.
const TELLERS: usize = 256;

/// Buses that run independently, with their ports.
type Share = (BusIndex, Vec<Box<dyn Bus>>, Journal);

/// A period in which buses run independently, and the processor cycles in this period. A cycle runs only if
/// it would change the state.
#[derive(Clone, Copy)]
struct IndependentPeriod {
    /// Emulated time at which the period ends, in microseconds.
    until: u64,
    first_cycle: u64,
    cycle_us: u64,
    /// Number of sources that report in processor cycles. In the numbering of sources, the buses follow them.
    lookers: usize,
}

impl Plant {
    /// Sets how many cores the plant may use; the default is 1. The number affects only the run time, not the
    /// results.
    pub fn set_cores(&mut self, count: NonZero<usize>) {
        let count = if self.named_buses < LEAST { 1 } else { count.get() };
        self.workers = WorkerPool::of(count - 1);
        self.drafts = if self.named_buses < LEAST {
            Vec::new()
        } else {
            (0..count).map(|_| Journal::draft()).collect()
        };
    }

    /// Runs the buses independently, if this is possible, until the next event of another participant, but
    /// not beyond `time`. Skips processor cycles that change nothing. Returns true if the buses have run.
    // Its values take kilobytes of stack, which each advance of a small plant would otherwise touch.
    #[inline(never)]
    pub(super) fn go_apart(&mut self, time: u64) -> bool {
        // The plant must apply faults, and record changes of followed registers, event by event.
        if !self.is_unobserved() {
            return false;
        }
        let first = self.next_device.min(time.saturating_add(1));
        // Placeholders run event by event.
        let unnamed = self.buses[self.named_buses..].iter().map(|bus| bus.next_time());
        let first = unnamed.fold(first, u64::min);
        let until = self.buses().iter().map(|bus| bus.apart_until()).fold(first, u64::min);
        if !self.is_worth_while(until) {
            return false;
        }
        let until = until.min(self.last_needed_cycle(time));
        if !self.is_worth_while(until) {
            return false;
        }
        let (first_cycle, cycle_us) = (self.next_cycle, self.cycle_us);
        let stretch =
            IndependentPeriod { until, first_cycle, cycle_us, lookers: self.devices.len() * TELLERS };
        let seats = self.ports.seats();
        let run = move |(first, mut buses, mut draft): Share| {
            let mut last = 0;
            for (index, bus) in buses.iter_mut().enumerate() {
                let index = BusIndex::at(first.index() + index);
                last = stretch.run(index, &mut **bus, &seats[index.index()], &mut draft).max(last);
            }
            ((first, buses, draft), last)
        };
        let unnamed = self.buses.split_off(self.named_buses);
        let shares = self.shares();
        let mut last = 0;
        for ((_, buses, draft), share_last) in self.workers.share(shares, run) {
            last = share_last.max(last);
            self.buses.extend(buses);
            self.drafts.push(draft);
        }
        self.buses.extend(unnamed);
        self.journal.merge_drafts(self.drafts.iter_mut());
        if first_cycle < until {
            self.next_cycle += (until - first_cycle).div_ceil(cycle_us) * cycle_us;
        }
        self.now = self.now.max(last);
        self.is_rescheduled = true;
        true
    }

    /// True if enough buses have events before `until`.
    fn is_worth_while(&self, until: u64) -> bool {
        self.buses().iter().filter(|bus| bus.next_time() < until).nth(LEAST - 1).is_some()
    }

    /// Splits all buses and drafts into shares. Each share has one draft.
    fn shares(&mut self) -> Vec<Share> {
        let size = self.buses.len().div_ceil(self.drafts.len());
        let mut buses = core::mem::take(&mut self.buses).into_iter();
        let drafts = self.drafts.drain(..).enumerate();
        drafts
            .map(|(part, draft)| (BusIndex::at(part * size), buses.by_ref().take(size).collect(), draft))
            .collect()
    }

    /// Checks the writes of clients on several cores: for each device, first its own registers, then the registers of
    /// its ports. Returns `false` if the caller must do the work on one core.
    pub(super) fn look_on_cores(&mut self) -> bool {
        if self.drafts.len() < 2 {
            return false;
        }
        let now = self.now;
        self.each_watch(
            move |plc, watch, draft| {
                draft.set_reporter(plc.index() * TELLERS);
                watch.look(now, draft);
            },
            move |watch, place, seat, draft| {
                draft.set_reporter(seat.device.index() * TELLERS + seat.port + 1);
                watch.judge_writes(place, now, draft);
            },
        );
        self.journal.merge_drafts(self.drafts.iter_mut());
        true
    }

    /// Stores the baselines after a firmware run, on several cores. Returns `false` if the caller must do the work on
    /// one core.
    pub(super) fn leave_on_cores(&mut self) -> bool {
        let is_shared = self.drafts.len() > 1;
        if is_shared {
            self.each_watch(|_, watch, _| watch.leave(), |watch, place, _, _| watch.store_baseline(place));
        }
        is_shared
    }

    /// Calls one function for the watch of each device, and the other function for the watches of the ports
    /// on each bus.
    fn each_watch(
        &mut self,
        of_device: impl Fn(DeviceIndex, &mut DeviceWatch, &mut Journal) + Copy + Send + 'static,
        of_port: impl Fn(&mut dyn PortWatch, usize, PluggedPort, &mut Journal) + Copy + Send + 'static,
    ) {
        let size = self.watches.len().div_ceil(self.drafts.len());
        let mut watches = core::mem::take(&mut self.watches).into_iter();
        let parts = self.shares().into_iter().enumerate();
        let parts: Vec<_> =
            parts.map(|(part, share)| (part * size, watches.by_ref().take(size).collect(), share)).collect();
        let seats = self.ports.seats();
        let run = move |(first_watch, mut watches, (first, mut buses, mut draft)): (usize, Vec<_>, Share)| {
            for (index, watch) in watches.iter_mut().enumerate() {
                of_device(DeviceIndex::at(first_watch + index), watch, &mut draft);
            }
            for (bus, seats) in buses.iter_mut().zip(&seats[first.index()..]) {
                let Some(watch) = bus.watch() else { continue };
                for (place, seat) in seats.iter().enumerate() {
                    of_port(watch, place, *seat, &mut draft);
                }
            }
            (watches, buses, draft)
        };
        for (watches, buses, draft) in self.workers.share(parts, run) {
            self.watches.extend(watches);
            self.buses.extend(buses);
            self.drafts.push(draft);
        }
    }
}

impl IndependentPeriod {
    /// Runs bus number `index`, with the processor cycles of the ports in `seats`. Returns the time of its last
    /// event.
    fn run(self, index: BusIndex, bus: &mut dyn Bus, seats: &[PluggedPort], draft: &mut Journal) -> u64 {
        let (mut faults, mut edges) = (Faults::default(), Vec::new());
        let (mut last, mut cycle) = (0, self.first_cycle);
        loop {
            let next = bus.next_time().min(self.until);
            // If a processor cycle and an event of the bus are due at one time, the processor cycle runs
            // first.
            while cycle < self.until && cycle <= next {
                for (place, seat) in seats.iter().enumerate() {
                    if !bus.poll_changes_nothing(place, cycle, true) {
                        draft.set_reporter(seat.device.index() * TELLERS + seat.port);
                        bus.processor_cycle(place, cycle, draft);
                    }
                }
                cycle += self.cycle_us;
            }
            // The poll in a processor cycle may have changed the next event.
            let now = bus.next_time();
            if now >= self.until {
                return last;
            }
            if now > next {
                continue;
            }
            draft.set_reporter(self.lookers + index.index());
            bus.event(&mut World { now, journal: draft, faults: &mut faults, edges: &mut edges });
            last = now;
        }
    }
}
