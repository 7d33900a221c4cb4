//! Effects of faults on a bus: frames that are lost, delayed or changed, and slaves that are switched off.

use super::schedule::Slot;
use super::slots::OnWire;
use super::{Sender, SimBus, Station};
use crate::devices::cansync::frames::{Frame, FrameKind};
use serde::{Deserialize, Serialize};

/// Effects of faults on a bus.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Disturbance {
    /// Slaves that are switched off, bit n for slave n.
    off: u32,
    /// Slaves that are switched off by faults.
    faulty: u32,
    /// Slaves in devices without power.
    unpowered: u32,
    /// Frames in progress that no station will receive, bit n for place n on the wire.
    pub(super) lost: u8,
    /// Frames in progress that a fault has delayed, bit n for place n on the wire.
    pub(super) late: u8,
    /// Frames that arrive outside of their slots.
    pub(super) strays: Vec<Stray>,
    /// Time by which the present SYNC edge is later than its regular time, in us.
    pub(super) shift: i64,
    /// The job in progress. It is stored only while there are faults.
    pub(super) job: Option<Frame>,
    /// The answer to the job, if a fault produces the answer instead of the slave.
    pub(super) answer: Option<Frame>,
}

/// State of a frame at its regular end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// The receivers have the frame.
    Arrives,
    /// No station receives the frame. The sender does not notice.
    Lost,
    /// The frame is still in progress.
    Late,
}

/// A frame that arrives outside of its slot.
#[derive(Serialize, Deserialize)]
pub(super) struct Stray {
    /// Time at which the frame arrives, in microseconds.
    pub(super) end: u64,
    pub(super) frame: Frame,
    /// True if the frame arrives for the second time.
    pub(super) copy: bool,
    /// The guest that has sent the frame; `None` if no guest has sent it.
    pub(super) guest: Option<u8>,
}

impl Disturbance {
    #[inline]
    pub(super) fn is_off(&self, slave: u8) -> bool {
        self.off.checked_shr(slave.into()).unwrap_or(0) & 1 != 0
    }

    /// Returns the fate of the frame at this place on the wire at its regular end, and clears it.
    #[inline]
    pub(super) fn take_fate(&mut self, place: usize) -> Fate {
        let bit = 1 << place;
        let fate = match (self.lost & bit != 0, self.late & bit != 0) {
            (true, _) => Fate::Lost,
            (false, true) => Fate::Late,
            (false, false) => Fate::Arrives,
        };
        self.lost &= !bit;
        self.late &= !bit;
        fate
    }

    /// Clears all frames, because the bus has stopped.
    pub(super) fn forget_frames(&mut self) {
        self.lost = 0;
        self.late = 0;
        self.strays.clear();
        self.shift = 0;
        self.job = None;
        self.answer = None;
    }

    #[inline]
    pub(super) fn take_answer(&mut self) -> Option<Frame> {
        self.answer.take()
    }

    /// Removes the shift, so that the next edge comes at its regular time.
    #[inline]
    pub(super) fn end_jitter(&mut self) {
        self.shift = 0;
    }

    /// Returns the time by which the present edge is later than its regular time, in us.
    #[inline]
    pub(super) fn shift(&self) -> i64 {
        self.shift
    }
}

impl SimBus {
    /// Switches off the slaves in `off`, bit n for slave n, because of faults. Slaves that faults no longer
    /// switch off are switched on.
    pub(super) fn switch_off_by_faults(&mut self, now: u64, off: u32) {
        self.disturbance.faulty = off;
        self.switch_off(now, off | self.disturbance.unpowered);
    }

    /// Connects or disconnects the power of a drive's device.
    pub(super) fn supply_drive(&mut self, now: u64, number: u8, has_power: bool) {
        let bit = 1u32.checked_shl(number.into()).unwrap_or(0);
        let unpowered = self.disturbance.unpowered;
        self.disturbance.unpowered = if has_power { unpowered & !bit } else { unpowered | bit };
        if self.disturbance.unpowered != unpowered {
            self.switch_off(now, self.disturbance.faulty | self.disturbance.unpowered);
        }
    }

    /// Switches off exactly these slaves, bit n for slave n. A drive that is switched on again starts as at
    /// power-on. The node of a PLC is disconnected from the bus, as if its plug were pulled (decision D-123).
    fn switch_off(&mut self, now: u64, off: u32) {
        let changed = self.disturbance.off ^ off;
        self.disturbance.off = off;
        self.drives.switch_off(off);
        for number in (0..32u8).filter(|number| changed >> number & 1 != 0) {
            self.destroy_frames_of(now, Sender::Slave(number));
        }
    }

    /// Trips the drive with this slave number. Returns true if the drive exists, has power, and had no fault.
    pub(super) fn trip_drive(&mut self, now: u64, slave: u8, fault: u16) -> bool {
        let Some(Station::Drive(index)) = self.stations.get(usize::from(slave)) else { return false };
        let drive = self.drives.get_mut(*index).filter(|_| !self.disturbance.is_off(slave));
        let trips = drive.is_some_and(|drive| drive.trip(fault));
        if trips {
            // Even if there is no SYNC, the drive must come to a standstill.
            self.wake_drives(now);
        }
        trips
    }

    /// Marks as lost the frames of this sender that are on the wire or scheduled, because the sender has
    /// stopped. Frames that have already ended are not affected.
    pub(super) fn destroy_frames_of(&mut self, now: u64, sender: Sender) {
        for (place, wire) in self.on_wire.iter_mut().enumerate() {
            if let Some(OnWire { due, .. }) = wire.take_if(|wire| wire.sender == sender && wire.until > now)
                // A fault has delayed the frame beyond its slot, so the place may now contain another frame.
                && due > now
            {
                self.disturbance.lost |= 1 << place;
            }
        }
        self.disturbance.strays.retain(|stray| !stray.is_of(sender));
        match sender {
            Sender::Master => {
                // A frame that the firmware is still building never reaches the controller.
                for (reference, built) in self.reference.iter_mut().zip([Slot::Built1, Slot::Built2]) {
                    reference.take_if(|_| self.schedule.at(built).is_some());
                }
            }
            Sender::Slave(number) if self.asked == Some(number) => {
                self.drive_answer = None;
                self.disturbance.answer = None;
            }
            Sender::Slave(_) => {}
        }
    }
}

impl Stray {
    fn is_of(&self, sender: Sender) -> bool {
        if self.guest.is_some() {
            return false;
        }
        match (self.frame.kind(), sender) {
            (Some(FrameKind::ActualValue(_, number) | FrameKind::Response(number)), Sender::Slave(slave)) => {
                number == slave
            }
            (Some(FrameKind::ReferenceValue(..) | FrameKind::Action | FrameKind::Job(_)), Sender::Master) => {
                true
            }
            _ => false,
        }
    }
}
