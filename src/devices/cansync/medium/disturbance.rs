//! What faults have done to a bus: which frames under way do not arrive as they should, and who is off.

use super::schedule::Slot;
use super::slots::OnWire;
use super::{Sender, SimBus, Station};
use crate::devices::cansync::bus::{Frame, FrameKind};
use serde::{Deserialize, Serialize};

/// What faults have done to a bus.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Disturbance {
    /// Slaves that are off, bit n for slave n.
    off: u32,
    /// Those of them that faults have switched off.
    faulty: u32,
    /// Those of them whose device has no power.
    unpowered: u32,
    /// Frames under way that nobody receives at all, by place on the wire.
    pub(super) lost: u8,
    /// Frames under way that end later than regularly, by place on the wire.
    pub(super) late: u8,
    /// Frames that arrive outside of their slots.
    pub(super) strays: Vec<Stray>,
    /// How far the present SYNC edge lies behind its regular time, in us.
    pub(super) shift: i64,
    /// The job under way, while there are faults.
    pub(super) job: Option<Frame>,
    /// The answer that a fault gives to it in place of the slave.
    pub(super) answer: Option<Frame>,
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// Its receivers have it.
    Arrives,
    /// Nobody ever has it; its sender does not notice.
    Lost,
    /// It is still on its way.
    Late,
}

/// A frame that arrives outside of its slot.
#[derive(Serialize, Deserialize)]
pub(super) struct Stray {
    pub(super) end: u64,
    pub(super) frame: Frame,
    /// Whether it comes a second time.
    pub(super) copy: bool,
    /// The guest whose it is, if it is one's.
    pub(super) guest: Option<u8>,
}

impl Disturbance {
    #[inline]
    pub(super) fn is_off(&self, slave: u8) -> bool {
        self.off.checked_shr(slave.into()).unwrap_or(0) & 1 != 0
    }

    /// What becomes of the frame at this place on the wire, whose regular end is now.
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

    /// The bus stands still.
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

    /// The next edge comes at its regular time.
    #[inline]
    pub(super) fn end_jitter(&mut self) {
        self.shift = 0;
    }

    /// How far the present edge lies behind its regular time, in us.
    #[inline]
    pub(super) fn shift(&self) -> i64 {
        self.shift
    }
}

impl SimBus {
    /// Slaves that faults have switched off, bit n for slave n.
    pub(super) fn switch_off_by_faults(&mut self, now: u64, off: u32) {
        self.disturbance.faulty = off;
        self.switch_off(now, off | self.disturbance.unpowered);
    }

    /// The device of a drive has power or not.
    pub(super) fn supply_drive(&mut self, now: u64, number: u8, has_power: bool) {
        let bit = 1u32.checked_shl(number.into()).unwrap_or(0);
        let unpowered = self.disturbance.unpowered;
        self.disturbance.unpowered = if has_power { unpowered & !bit } else { unpowered | bit };
        if self.disturbance.unpowered != unpowered {
            self.switch_off(now, self.disturbance.faulty | self.disturbance.unpowered);
        }
    }

    /// Slaves that are off from now on, bit n for slave n. Drives that go off are as at power-on when they come
    /// back; a PLC's node has its plug pulled (decision D-123).
    fn switch_off(&mut self, now: u64, off: u32) {
        let changed = self.disturbance.off ^ off;
        self.disturbance.off = off;
        self.drives.switch_off(off);
        for number in (0..32u8).filter(|number| changed >> number & 1 != 0) {
            self.destroy_frames_of(now, Sender::Slave(number));
        }
    }

    /// Brings a fault upon the drive with this slave number. Tells whether there is one, with power and without a
    /// fault.
    pub(super) fn trip_drive(&mut self, now: u64, slave: u8, fault: u16) -> bool {
        let Some(Station::Drive(index)) = self.stations.get(usize::from(slave)) else { return false };
        let drive = self.drives.get_mut(*index).filter(|_| !self.disturbance.is_off(slave));
        let trips = drive.is_some_and(|drive| drive.trip(fault));
        if trips {
            // It has to come to a standstill, also without SYNC.
            self.wake_drives(now);
        }
        trips
    }

    /// This sender has stopped in the middle: the frames that it has on the wire, or about to be, are lost. A frame
    /// that has ended is out of its hands.
    pub(super) fn destroy_frames_of(&mut self, now: u64, sender: Sender) {
        for (place, wire) in self.on_wire.iter_mut().enumerate() {
            if let Some(OnWire { due, .. }) = wire.take_if(|wire| wire.sender == sender && wire.until > now)
                // The place of a frame that a fault has delayed may be another one's already.
                && due > now
            {
                self.disturbance.lost |= 1 << place;
            }
        }
        self.disturbance.strays.retain(|stray| !stray.is_of(sender));
        match sender {
            Sender::Master => {
                // What is still being built never gets to the controller.
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
