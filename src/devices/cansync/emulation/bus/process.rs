//! Process data within an interval: SYNC, WRC1, RDC1, WRC2, RDC2.

use super::disturbance::Fate;
use super::schedule::Slot;
use super::{Run, Sender, Station};
use crate::devices::cansync::Deadline;
use crate::devices::cansync::drive::BusEvent;
use crate::devices::cansync::firmware::Built;
use crate::devices::cansync::frames::{Channel, Frame, FrameKind};
use crate::devices::cansync::records::SyncEdge;

/// Time to build or take over one word of a frame, in us (manual 5.00005.03a p. 154: 15 to 60 us).
const WORD_US: u64 = 15;

impl Run<'_> {
    /// Handles an edge of the master's SYNC signal. Returns true if the edge went out on the line.
    pub(super) fn sync_edge(&mut self, own_sync: bool) -> bool {
        let timing = self.timing;
        let interval_us = u32::from(timing.b_TIME_PATTERN) * 1000;
        if own_sync {
            self.schedule_next_edge(interval_us);
        }
        self.bus.actual = [None; 2];
        self.master(|master, _| master.sync_edge());
        if let Some(master) = self.bus.masters.first() {
            master.count_sync();
        }
        if self.bus.asked.is_some() || self.bus.command.is_some() {
            self.at(Slot::ResponseStart, timing.t_RC);
        }
        self.at(Slot::Build1, timing.deadline_WRC.earliest);
        self.at(Slot::CommandStart, timing.t_CC);
        let lost = !self.faults.is_empty() && self.edge_is_lost();
        if lost {
            self.miss_edge(interval_us);
        } else {
            if self.bus.is_wired {
                self.journal.push(self.now, SyncEdge { bus: self.bus.index });
            }
            self.deliver_edge(interval_us);
        }
        self.sync_events(lost);
        !lost
    }

    /// Adds the edge as an event of the devices. The devices come after all other receivers. If the edge is
    /// `lost`, only the device of the master gets it.
    fn sync_events(&mut self, lost: bool) {
        self.edges.extend(self.bus.masters.first().map(|master| master.origin));
        if !lost {
            let disturbance = &self.bus.disturbance;
            let heard = self.bus.slaves.iter().filter(|end| !disturbance.is_off(end.firmware.number()));
            self.edges.extend(heard.map(|end| end.origin));
            let drives = self.bus.drive_ends.iter().filter(|end| !disturbance.is_off(end.number));
            self.edges.extend(drives.map(|end| end.origin));
        }
    }

    fn schedule_next_edge(&mut self, interval_us: u32) {
        let regular =
            (self.start + u64::from(interval_us)).saturating_add_signed(-self.bus.disturbance.shift());
        if !self.faults.is_empty() {
            self.move_next_edge();
        } else {
            self.bus.disturbance.end_jitter();
        }
        let shift = self.bus.disturbance.shift();
        self.bus.schedule.set(Slot::Sync, regular.saturating_add_signed(shift));
    }

    fn deliver_edge(&mut self, interval_us: u32) {
        let now = self.now;
        let disturbance = &self.bus.disturbance;
        for end in self.bus.slaves.iter_mut().filter(|end| !disturbance.is_off(end.firmware.number())) {
            end.count_sync();
            // SYNC has a separate line, so a node receives SYNC edges at any baud rate.
            if end.firmware.is_on_bus() {
                end.firmware.sync_edge(now, interval_us);
            }
        }
        self.bus.drives.pass(BusEvent::Edge { now_us: now, interval_us });
        self.bus.edge_for_drives(now, interval_us);
    }

    /// Handles a lost edge. A locked slave detects the loss, because it computes the time of the next edge.
    #[cold]
    fn miss_edge(&mut self, interval_us: u32) {
        let now = self.now;
        let disturbance = &self.bus.disturbance;
        for end in self.bus.slaves.iter_mut().filter(|end| !disturbance.is_off(end.firmware.number())) {
            end.firmware.edge_lost(now);
        }
        self.bus.no_edge_for_drives(now, interval_us);
    }

    /// Handles the deadline of reference value frame 1 and of the slaves' actual value frame 1 (decision
    /// D-354).
    pub(super) fn build_first(&mut self) {
        self.at(Slot::BuildActual2, self.timing.deadline_RDC2.latest);
        self.build_actual(Channel::One);
        let built = self.master(|master, ctx| master.build_reference(ctx, Channel::One)).flatten();
        self.bus.reference[0] = built;
        self.bus.schedule.set(Slot::Built1, self.now + build_time(built.as_ref()));
    }

    pub(super) fn built_first(&mut self) {
        self.send_reference(Channel::One);
        let built = self.master(|master, ctx| master.build_reference(ctx, Channel::Two)).flatten();
        self.bus.reference[1] = built;
        self.bus.schedule.set(Slot::Built2, self.now + build_time(built.as_ref()));
    }

    pub(super) fn built_second(&mut self) {
        self.send_reference(Channel::Two);
    }

    /// Acknowledges a reference value frame that is built, and puts the frame into its slot.
    fn send_reference(&mut self, channel: Channel) {
        let Some(built) = self.bus.reference[channel.index()] else { return };
        let frame = self.bus.frame_length.of(built.frame);
        self.bus.reference[channel.index()] = Some(Built { frame, ..built });
        self.master(|master, ctx| master.acknowledge_reference(ctx, channel));
        let (slot, offset) = match channel {
            Channel::One => (Slot::Reference1End, self.timing.t_WRC1),
            Channel::Two => (Slot::Reference2End, self.timing.t_WRC2),
        };
        self.transmit(slot, &frame, self.start + u64::from(offset), Sender::Master);
    }

    pub(super) fn reference_end(&mut self, channel: Channel) {
        let Some(built) = self.bus.reference[channel.index()].take() else { return };
        let slot = match channel {
            Channel::One => Slot::Reference1End,
            Channel::Two => Slot::Reference2End,
        };
        if self.arrives(slot, &built.frame) == Fate::Arrives {
            self.deliver(&built.frame, false);
        }
        if channel == Channel::One {
            self.advance_actual2();
        }
    }

    pub(super) fn deliver_reference(&mut self, channel: Channel, frame: &Frame) {
        let kbit_s = self.timing.kbit_per_s;
        self.bus.drives.pass(BusEvent::Reference { kbit_s, channel, payload: *frame.payload() });
        self.each_node(|slave, _| slave.reference_value(channel, frame));
    }

    /// Makes the slave that the identifier selects send its actual value frame in the slot of this frame.
    pub(super) fn request_actual(&mut self, channel: Channel, number: u8) {
        let answer = match self.station(number) {
            Station::Vacant => None,
            Station::Drive(index) => self.drive(index).and_then(|drive| {
                let payload = drive.actual_value_frame(channel)?;
                Some(Frame::of(FrameKind::ActualValue(channel, number), payload))
            }),
            Station::Node(index) => {
                self.node(index, |slave, ctx| slave.requested_actual(ctx, channel)).flatten()
            }
        };
        let Some(frame) = answer.map(|frame| self.bus.frame_length.of(frame)) else { return };
        self.bus.actual[channel.index()] = Some(frame);
        let (slot, offset) = match channel {
            Channel::One => (Slot::Actual1End, self.timing.t_RDC1),
            Channel::Two => (Slot::Actual2End, self.timing.t_RDC2),
        };
        // If a fault has delayed the request beyond the slot of the answer, the answer is sent at once.
        self.transmit(slot, &frame, self.start + u64::from(offset), Sender::Slave(number));
    }

    pub(super) fn actual_end(&mut self, channel: Channel) {
        let Some(frame) = self.bus.actual[channel.index()].take() else { return };
        let slot = match channel {
            Channel::One => Slot::Actual1End,
            Channel::Two => Slot::Actual2End,
        };
        if self.arrives(slot, &frame) == Fate::Arrives {
            self.deliver(&frame, false);
        }
    }

    pub(super) fn deliver_actual(&mut self, channel: Channel, number: u8, frame: &Frame) {
        self.master(|master, _| master.actual_value(channel, number, frame));
        if self.bus.drives.overhears(number) {
            self.drives().for_each(|drive| drive.overheard_frame(number, channel, frame.payload()));
        }
        self.each_node(|slave, _| slave.overheard_actual(channel, number, frame));
    }

    pub(super) fn build_actual(&mut self, channel: Channel) {
        self.each_node(|slave, ctx| slave.build_actual(ctx, channel));
    }

    /// Sets the time at which the slaves build their second actual value frame: when WRC1 has been received
    /// and processed, within the limits of the rate (manual 5.00005.03a p. 182; several slaves: decision
    /// D-26). If the device has a separate fixed deadline, this deadline may have passed already.
    fn advance_actual2(&mut self) {
        let Deadline { earliest, latest, .. } = self.timing.deadline_RDC2;
        let [earliest, latest] = [earliest, latest].map(|after| self.start + u64::from(after));
        if self.now >= latest {
            return;
        }
        let mut words = 1;
        self.each_node(|slave, _| words = words.max(slave.words_taken()));
        let due = (self.now + WORD_US * u64::from(words)).clamp(earliest, latest);
        self.bus.schedule.set(Slot::BuildActual2, due);
    }
}

/// Returns the time for building a frame: 15 us for each used word, at least 15 us (decision D-09).
fn build_time(built: Option<&Built>) -> u64 {
    WORD_US * built.map_or(1, |built| u64::from(built.used_words.max(1)))
}
