//! Faults to be injected: what goes wrong, where, from when and how often.
//!
//! A [`Fault`] names buses and PLCs by their index, so that it is small and can travel anywhere; a
//! [`FaultSpec`] is the same with names, as plant files and the command line have it. What the kinds do to the
//! plant is described in `docs/faults.md` and done in [`crate::plant`].

mod acting;
mod error;
mod kind;
mod record;
mod sites;
mod spec;
#[cfg(test)]
mod tests;
mod words;

pub use acting::Faults;
pub use error::{FaultError, Refusal, slave_list};
pub use kind::{Field, Kind, Target};
pub use record::{FaultNews, Hit, KINDS, News};
pub use sites::Sites;
pub use spec::FaultSpec;
pub use words::WordError;

use crate::devices::cansync::bus::codec::updown::MAX_OFFSET;
use crate::devices::cansync::bus::{Channel, Frame, FrameKind};

/// Longest delay of a frame, in emulated microseconds.
pub const MAX_DELAY_US: u32 = 1_000_000;
/// Longest time by which a drive is late at the BAPS, in emulated microseconds: longer than the function blocks wait.
pub const MAX_SLOWNESS_US: u32 = 60_000_000;
/// Largest jitter of SYNC edges, in microseconds; at most a quarter of the running interval takes effect.
pub const MAX_JITTER_US: u32 = 2_000;
/// Longest duration of a fault: one hour of emulated time, in microseconds.
pub const MAX_DURATION_US: u32 = 3_600_000_000;
/// Latest begin of a fault: 365 days of emulated time after power-on, in microseconds.
pub const MAX_AT_US: u64 = 31_536_000_000_000;
/// Most faults that wait or act at a time.
pub const MAX_FAULTS: usize = 256;

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fault {
    /// What goes wrong, and where.
    pub effect: Effect,
    /// Emulated time of its begin in microseconds since power-on, at most [`MAX_AT_US`]; a time in the past
    /// (0, for example) means at once.
    pub at_us: u64,
    /// How long or how often.
    pub limit: Limit,
}

/// A fault that waits or acts, as an installation lists it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultStatus {
    /// Its number in the installation, from 1.
    pub id: u16,
    /// The fault.
    pub fault: Fault,
    /// Whether it has begun.
    pub acting: bool,
    /// How often it has hit so far.
    pub hits: u32,
}

/// When a fault ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Limit {
    /// When somebody clears it.
    UntilCleared,
    /// After so many hits, at least 1.
    Count(u32),
    /// So many emulated microseconds after its begin, 1 to [`MAX_DURATION_US`].
    Duration(u32),
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Effect {
    /// Frames on a bus.
    Frame {
        /// Index of the bus.
        bus: u16,
        /// Which frames.
        frames: Frames,
        /// What happens to them.
        what: FrameEffect,
    },
    /// The SYNC signal of a bus.
    Sync {
        /// Index of the bus.
        bus: u16,
        /// What happens to its edges.
        what: SyncEffect,
    },
    /// A slave.
    Slave {
        /// Index of the bus.
        bus: u16,
        /// Slave number, 0 to 31.
        slave: u8,
        /// What is wrong with it.
        what: SlaveEffect,
    },
    /// The CAN controller of a CANsync node, or the drive behind the BAPS.
    Node {
        /// Index of the PLC.
        plc: u16,
        /// 1 (slave) or 2 (master); 0 for the BAPS.
        node: u8,
        /// What is wrong with it.
        what: NodeEffect,
    },
}

/// What happens to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameEffect {
    /// Nobody receives it; its sender does not notice.
    Lose,
    /// It begins so many microseconds after its slot, 1 to [`MAX_DELAY_US`].
    Delay(u32),
    /// It arrives once more, so many microseconds after its end plus its own length, 0 to [`MAX_DELAY_US`].
    Duplicate(u32),
}

/// What happens to SYNC edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyncEffect {
    /// The slaves do not see them.
    Lose,
    /// They come so many microseconds late and early in turn, 1 to [`MAX_JITTER_US`].
    Jitter(u32),
}

/// What is wrong with a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SlaveEffect {
    /// It is off: a drive without power, a PLC's node with its plug pulled.
    Off,
    /// Its answers to jobs begin so many microseconds after their slot, 1 to [`MAX_DELAY_US`].
    Late(u32),
    /// It answers jobs with BUSY.
    Busy,
    /// It refuses jobs with this error number.
    Error(u16),
    /// Blocks of an up-/download travel with this offset, 0 to 4095 bytes, instead of their own.
    WrongOffset {
        /// In the master's job or in the slave's answer.
        at: OffsetAt,
        /// The wrong offset; `None`: the right one plus 6.
        offset: Option<u16>,
    },
    /// It is a drive and has this fault, 1 to 65535.
    Trip(u16),
}

/// Which frame carries the wrong offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OffsetAt {
    /// The master's job, on its way to the slave.
    Job,
    /// The slave's answer.
    Answer,
}

/// What is wrong with a CAN controller, or with the drive behind the BAPS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NodeEffect {
    /// It switches itself off.
    BusOff,
    /// It cannot receive frames in time and loses them.
    Overrun,
    /// The drive has this fault, 1 to 65535.
    Trip(u16),
    /// The drive leaves out what it has to do at the BAPS.
    Silent,
    /// It does that so many microseconds late, 1 to [`MAX_SLOWNESS_US`].
    Slow(u32),
}

/// A slot of the CANsync interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameSlot {
    /// Reference value frame 1 of the master.
    Wrc1,
    /// Actual value frame 1 of a slave.
    Rdc1,
    /// Reference value frame 2.
    Wrc2,
    /// Actual value frame 2.
    Rdc2,
    /// Command channel: action commands and jobs of the master.
    Cc,
    /// Response channel: answers of the slaves.
    Rc,
}

impl FrameSlot {
    /// All slots in the order of the manual's table (5.00005.03a p. 125).
    pub const ALL: [FrameSlot; 6] =
        [FrameSlot::Wrc1, FrameSlot::Rdc1, FrameSlot::Wrc2, FrameSlot::Rdc2, FrameSlot::Cc, FrameSlot::Rc];

    /// Its name in the manual.
    pub const fn name(self) -> &'static str {
        match self {
            FrameSlot::Wrc1 => "WRC1",
            FrameSlot::Rdc1 => "RDC1",
            FrameSlot::Wrc2 => "WRC2",
            FrameSlot::Rdc2 => "RDC2",
            FrameSlot::Cc => "CC",
            FrameSlot::Rc => "RC",
        }
    }

    /// The slot in which frames of a kind travel.
    pub const fn of(kind: FrameKind) -> Self {
        match kind {
            FrameKind::ReferenceValue(Channel::One, _) => FrameSlot::Wrc1,
            FrameKind::ReferenceValue(Channel::Two, _) => FrameSlot::Wrc2,
            FrameKind::ActualValue(Channel::One, _) => FrameSlot::Rdc1,
            FrameKind::ActualValue(Channel::Two, _) => FrameSlot::Rdc2,
            FrameKind::Action | FrameKind::Job(_) => FrameSlot::Cc,
            FrameKind::Response(_) => FrameSlot::Rc,
        }
    }
}

/// Which frames a fault concerns: those of a slot whose identifier agrees with `id` where `mask` has a 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Frames {
    /// Identifier, 0 to 16#7FF, no bit outside the mask.
    pub id: u16,
    /// The bits of the identifier that count, 0 to 16#7FF; 0: all frames.
    pub mask: u16,
    /// The slot; `None`: all.
    pub slot: Option<FrameSlot>,
}

impl Frames {
    /// All frames.
    pub const ALL: Frames = Frames { id: 0, mask: 0, slot: None };
    /// Highest identifier.
    pub const MAX_ID: u16 = 0x7FF;

    /// Whether the fault concerns `frame`.
    pub fn include(&self, frame: &Frame) -> bool {
        frame.id() & self.mask == self.id
            && self.slot.is_none_or(|slot| frame.kind().is_some_and(|kind| FrameSlot::of(kind) == slot))
    }
}

impl Fault {
    /// Which kind it is.
    pub const fn kind(&self) -> Kind {
        match self.effect {
            Effect::Frame { what: FrameEffect::Lose, .. } => Kind::LoseFrame,
            Effect::Frame { what: FrameEffect::Delay(_), .. } => Kind::DelayFrame,
            Effect::Frame { what: FrameEffect::Duplicate(_), .. } => Kind::DuplicateFrame,
            Effect::Sync { what: SyncEffect::Lose, .. } => Kind::LoseSync,
            Effect::Sync { what: SyncEffect::Jitter(_), .. } => Kind::JitterSync,
            Effect::Slave { what: SlaveEffect::Off, .. } => Kind::SlaveOff,
            Effect::Slave { what: SlaveEffect::Late(_), .. } => Kind::SlaveLate,
            Effect::Slave { what: SlaveEffect::Busy, .. } => Kind::SlaveBusy,
            Effect::Slave { what: SlaveEffect::Error(_), .. } => Kind::SlaveError,
            Effect::Slave { what: SlaveEffect::WrongOffset { .. }, .. } => Kind::WrongOffset,
            Effect::Node { what: NodeEffect::BusOff, .. } => Kind::BusOff,
            Effect::Node { what: NodeEffect::Overrun, .. } => Kind::Overrun,
            Effect::Slave { what: SlaveEffect::Trip(_), .. } => Kind::DriveFault,
            Effect::Node { what: NodeEffect::Trip(_), .. } => Kind::BapsDriveFault,
            Effect::Node { what: NodeEffect::Silent, .. } => Kind::BapsSilent,
            Effect::Node { what: NodeEffect::Slow(_), .. } => Kind::BapsSlow,
        }
    }

    /// Where it acts.
    pub const fn target(&self) -> Target {
        match self.effect {
            Effect::Frame { bus, .. } | Effect::Sync { bus, .. } => Target::Bus(bus),
            Effect::Slave { bus, slave, .. } => Target::Slave { bus, slave },
            Effect::Node { plc, node, .. } => Target::Node { plc, node },
        }
    }

    /// Checks all numbers and that the installation has what the fault names.
    ///
    /// # Errors
    /// [`Refusal`] names what is wrong and what would be right.
    pub fn check(&self, sites: &Sites) -> Result<(), Refusal> {
        self.check_numbers()?;
        sites.check(&self.effect)
    }

    fn check_numbers(&self) -> Result<(), Refusal> {
        let within = |field, value: u64, least: u64, most: u64| {
            if (least..=most).contains(&value) {
                Ok(())
            } else {
                Err(Refusal::Range { field, value, least, most })
            }
        };
        let (delay, jitter) = (u64::from(MAX_DELAY_US), u64::from(MAX_JITTER_US));
        within(Field::AtUs, self.at_us, 0, MAX_AT_US)?;
        match self.limit {
            Limit::UntilCleared => {}
            Limit::Count(_) if self.kind() == Kind::SlaveOff => return Err(Refusal::NotCounted),
            Limit::Count(count) => within(Field::Count, count.into(), 1, u32::MAX.into())?,
            Limit::Duration(us) => within(Field::DurationUs, us.into(), 1, MAX_DURATION_US.into())?,
        }
        match self.effect {
            Effect::Frame { frames, what, .. } => {
                within(Field::Mask, frames.mask.into(), 0, Frames::MAX_ID.into())?;
                within(Field::Id, frames.id.into(), 0, Frames::MAX_ID.into())?;
                if frames.id & !frames.mask != 0 {
                    return Err(Refusal::NeverMatches { id: frames.id, mask: frames.mask });
                }
                match what {
                    FrameEffect::Lose => Ok(()),
                    FrameEffect::Delay(us) => within(Field::DelayUs, us.into(), 1, delay),
                    FrameEffect::Duplicate(us) => within(Field::DelayUs, us.into(), 0, delay),
                }
            }
            Effect::Sync { what: SyncEffect::Jitter(us), .. } => {
                within(Field::AmplitudeUs, us.into(), 1, jitter)
            }
            Effect::Slave { what: SlaveEffect::Late(us), .. } => within(Field::DelayUs, us.into(), 1, delay),
            Effect::Node { what: NodeEffect::Slow(us), .. } => {
                within(Field::DelayUs, us.into(), 1, MAX_SLOWNESS_US.into())
            }
            Effect::Slave { what: SlaveEffect::WrongOffset { offset: Some(offset), .. }, .. } => {
                within(Field::Offset, offset.into(), 0, MAX_OFFSET.into())
            }
            Effect::Slave { what: SlaveEffect::Trip(number), .. }
            | Effect::Node { what: NodeEffect::Trip(number), .. } => {
                within(Field::Error, number.into(), 1, u16::MAX.into())
            }
            _ => Ok(()),
        }
    }
}
