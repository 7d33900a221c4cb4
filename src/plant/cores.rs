//! Media on several cores.
//!
//! Between two moments at which something passes from one to another (SYNC edges, processor cycles, times of devices) media that
//! say so go on by themselves ([`Medium::apart_until`]), each with all its events on one core; so do the watches of the access
//! checker. What they tell is put into the journal in the order in which one core would have told it: by time, then in
//! plant order.

use super::Plant;
use super::ports::Seat;
use crate::check::DeviceWatch;
use crate::devices::{Medium, World};
use crate::fault::Faults;
use crate::journal::Journal;
use core::num::NonZero;
use std::sync::{Mutex, PoisonError};
use std::thread::Builder;

/// With fewer media there is less to do than it takes to ask another core.
const LEAST: usize = 32;
/// Of a device, what tells something at one moment: its own watch, and those over its ports.
const TELLERS: usize = 256;

impl Plant {
    /// How many cores may work at it: 1, unless somebody says otherwise. It makes no difference but to how long it takes.
    pub fn set_cores(&mut self, count: NonZero<usize>) {
        self.drafts = match count.get() {
            1 => Vec::new(),
            count => (0..count).map(|_| Journal::draft()).collect(),
        };
    }

    fn can_part(&self) -> bool {
        !self.drafts.is_empty() && self.named_media >= LEAST
    }

    /// Time moves on: lets the media go on by themselves, if they can, before anything else is due at `until`. Tells whether
    /// they did.
    pub(super) fn go_apart(&mut self, until: u64) -> bool {
        // Who strikes whom in between, and which registers were changed by whom, is found out one event after the other.
        if !self.can_part()
            || !self.faults.is_empty()
            || !self.forces.list().is_empty()
            || self.journal.follows()
        {
            return false;
        }
        let media = &mut self.media[..self.named_media];
        let until = media.iter().map(|medium| medium.apart_until()).fold(until, u64::min);
        if media.iter().filter(|medium| medium.next_time() < until).count() < LEAST {
            return false;
        }
        let share = media.len().div_ceil(self.drafts.len());
        let run = |(part, media): (usize, &mut [Box<dyn Medium>]), draft: &mut Journal| {
            let (mut faults, mut edges) = (Faults::default(), Vec::new());
            let mut last = 0;
            for (index, medium) in media.iter_mut().enumerate() {
                draft.told_by(part * share + index);
                while medium.next_time() < until {
                    let now = medium.next_time();
                    medium.event(&mut World { now, journal: draft, faults: &mut faults, edges: &mut edges });
                    last = last.max(now);
                }
            }
            last
        };
        let parts = media.chunks_mut(share).enumerate();
        let last = on_cores(parts, &mut self.drafts, run);
        self.journal.put_in(self.drafts.iter_mut());
        self.now = self.now.max(last);
        self.is_rescheduled = true;
        true
    }

    /// As the plant looks for writes, device by device, and then what belongs to their ports. `false`: that is for one core.
    pub(super) fn look_on_cores(&mut self) -> bool {
        if !self.can_part() {
            return false;
        }
        let now = self.now;
        self.each_watch(
            |plc, watch, draft| {
                draft.told_by(plc * TELLERS);
                watch.look(now, draft);
            },
            |medium, place, seat, draft| {
                draft.told_by(seat.device * TELLERS + seat.port + 1);
                medium.judge_writes(place, now, draft);
            },
        );
        self.journal.put_in(self.drafts.iter_mut());
        true
    }

    /// As the plant notes what the firmware leaves. `false`: that is for one core.
    pub(super) fn leave_on_cores(&mut self) -> bool {
        let can_part = self.can_part();
        if can_part {
            self.each_watch(|_, watch, _| watch.leave(), |medium, place, _, _| medium.leave(place));
        }
        can_part
    }

    /// Calls the functions for the watches of all devices and for those of all ports, where they are plugged in.
    fn each_watch(
        &mut self,
        of_device: impl Fn(usize, &mut DeviceWatch, &mut Journal) + Sync,
        of_port: impl Fn(&mut Box<dyn Medium>, usize, Seat, &mut Journal) + Sync,
    ) {
        let Plant { media, ports, watches, drafts, .. } = self;
        let share = watches.len().div_ceil(drafts.len());
        let parts = watches.chunks_mut(share).enumerate();
        on_cores(parts, drafts, |(part, watches): (usize, &mut [DeviceWatch]), draft| {
            for (index, watch) in watches.iter_mut().enumerate() {
                of_device(part * share + index, watch, draft);
            }
            0
        });
        let share = media.len().div_ceil(drafts.len());
        let parts = media.chunks_mut(share).zip(ports.seats().chunks(share));
        on_cores(parts, drafts, |(media, seats): (&mut [Box<dyn Medium>], &[Vec<Seat>]), draft| {
            for (medium, seats) in media.iter_mut().zip(seats) {
                for (place, seat) in seats.iter().enumerate() {
                    of_port(medium, place, *seat, draft);
                }
            }
            0
        });
    }
}

/// Does the parts at the same time, each with a draft of its own. Returns the largest number that one of them ends with.
fn on_cores<P: Send>(
    parts: impl Iterator<Item = P>,
    drafts: &mut [Journal],
    run: impl Fn(P, &mut Journal) -> u64 + Sync,
) -> u64 {
    let parts: Vec<_> = parts.zip(drafts).collect();
    let others = parts.len().saturating_sub(1);
    let parts = Mutex::new(parts);
    let next = || parts.lock().unwrap_or_else(PoisonError::into_inner).pop();
    let work = || {
        let mut largest = 0;
        while let Some((part, draft)) = next() {
            largest = run(part, draft).max(largest);
        }
        largest
    };
    std::thread::scope(|scope| {
        // Where no thread can be had, this one does it all.
        let start = |_| Builder::new().spawn_scoped(scope, work).ok();
        let others: Vec<_> = (0..others).filter_map(start).collect();
        let own = work();
        let others = others.into_iter().map(|other| other.join());
        // Who has panicked takes this one with it.
        let others = others.map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        others.fold(own, u64::max)
    })
}
