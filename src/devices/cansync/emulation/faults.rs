//! Kinds of faults on a CANsync bus, at its slaves and in the CAN controllers of its nodes. `devices::can_faults` has
//! the kinds that all CAN buses share.

use super::frames::codec::updown::MAX_OFFSET;
use super::frames::{Channel, Frame, FrameKind};
use crate::devices::emulation::can_faults::{
    BUS_OFF, DELAY_FRAME, DUPLICATE_FRAME, Frames, IN_US, LOSE_FRAME, OVERRUN, delay,
};
use crate::fault::{self, Fault, FaultKind, Field, Form, TargetKind};

/// Largest jitter of SYNC edges, in microseconds. The effective jitter is at most a quarter of the present interval.
pub(crate) const MAX_JITTER_US: u32 = 2_000;

/// Effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// The slaves do not see SYNC edges.
    LoseSync,
    /// SYNC edges are alternately late and early, by the given number of microseconds, 1 to
    /// [`MAX_JITTER_US`].
    JitterSync(u32),
    /// A slave is off: a drive has no power, or a PLC's node is disconnected from the bus.
    SlaveOff,
    /// A slave's answers to jobs begin the given number of microseconds after their slot, 1 to
    /// [`MAX_DELAY_US`](crate::devices::emulation::can_faults::MAX_DELAY_US).
    SlaveLate(u32),
    /// A slave answers jobs with BUSY.
    SlaveBusy,
    /// A slave refuses jobs with this error number.
    SlaveError(u16),
    /// Blocks of an up-/download carry this offset, 0 to 4095 bytes, instead of the right one.
    WrongOffset {
        /// The frame with the wrong offset.
        at: OffsetAt,
        /// The wrong offset of the block; `None` for the correct offset plus 6.
        offset: Option<u16>,
    },
    /// A slave, which must be a drive, has this fault, 1 to 65535.
    Trip(u16),
}

/// The frame that carries the wrong offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OffsetAt {
    /// The master's job, on its way to the slave.
    Job,
    /// The answer of the slave, on its way to the master.
    Answer,
}

/// Returns the slot in which frames of a kind travel, as an index into [`SLOTS`](crate::devices::emulation::can_faults::SLOTS).
const fn slot_of(kind: FrameKind) -> u32 {
    match kind {
        FrameKind::ReferenceValue(Channel::One, _) => 0,
        FrameKind::ActualValue(Channel::One, _) => 1,
        FrameKind::ReferenceValue(Channel::Two, _) => 2,
        FrameKind::ActualValue(Channel::Two, _) => 3,
        FrameKind::Action | FrameKind::Job(_) => 4,
        FrameKind::Response(_) => 5,
    }
}

/// Returns true if a fault for `frames` applies to `frame`.
pub(super) fn includes(frames: &Frames, frame: &Frame) -> bool {
    frames.include_in_slot(frame.id(), frame.kind().map(slot_of))
}

/// Returns the field for an error or fault number of a drive or slave.
const fn error(least: u64, about: &'static str) -> Field {
    Field::new("error", Form::Hex { least, most: 0xFFFF, digits: 4 }, about)
}

fn us(fault: &Fault) -> u32 {
    fault.value("delay_us").unwrap_or(0)
}

fn number(fault: &Fault) -> u16 {
    fault.value("error").unwrap_or(0) as u16
}

static LOSE_SYNC: FaultKind =
    FaultKind::new(4, "lose_sync", TargetKind::Bus, "The slaves miss SYNC edges", |_| {
        fault::Effect::new(Effect::LoseSync)
    })
    .shown("bus=drives count=2");

static JITTER_SYNC: FaultKind =
    FaultKind::new(5, "jitter_sync", TargetKind::Bus, "SYNC edges come late and early in turn", |fault| {
        fault::Effect::new(Effect::JitterSync(fault.value("amplitude_us").unwrap_or(0)))
    })
    .with(
        const {
            &[Field::new(
                "amplitude_us",
                Form::Time { least: 1, most: MAX_JITTER_US as u64 },
                "Largest shift of an edge, in us; at most a quarter of the interval takes effect",
            )
            .required(IN_US)]
        },
    )
    .shown("amplitude=40us duration=1s");

static SLAVE_OFF: FaultKind = FaultKind::new(
    6,
    "slave_off",
    TargetKind::Participant,
    "A slave has no power, or its plug is pulled",
    |_| fault::Effect::new(Effect::SlaveOff),
)
.without_hits()
.shown("slave=2 duration=100ms");

static SLAVE_LATE: FaultKind =
    FaultKind::new(7, "slave_late", TargetKind::Participant, "A slave answers jobs late", |fault| {
        fault::Effect::new(Effect::SlaveLate(us(fault)))
    })
    .with(const { &[delay(1, "Delay after the slot of the answer, in us").required(IN_US)] })
    .shown("slave=1 delay=700us");

static SLAVE_BUSY: FaultKind =
    FaultKind::new(8, "slave_busy", TargetKind::Participant, "A slave answers jobs BUSY", |_| {
        fault::Effect::new(Effect::SlaveBusy)
    })
    .shown("slave=1 count=5");

static SLAVE_ERROR: FaultKind = FaultKind::new(
    9,
    "slave_error",
    TargetKind::Participant,
    "A slave refuses jobs with an error number",
    |fault| fault::Effect::new(Effect::SlaveError(number(fault))),
)
.with(const { &[error(0, "Error number").required("give the error number, for example 16#FFFB")] })
.shown("slave=1 error=16#FFFB count=1");

static WRONG_OFFSET: FaultKind = FaultKind::new(
    10,
    "wrong_offset",
    TargetKind::Participant,
    "A block of an up-/download carries a wrong offset",
    |fault| {
        let at = if fault.value("slot") == Some(0) { OffsetAt::Job } else { OffsetAt::Answer };
        let offset = fault.value("offset").map(|offset| offset as u16);
        fault::Effect::new(Effect::WrongOffset { at, offset })
    },
)
.with(
    const {
        &[
            Field::new(
                "slot",
                Form::Word(&["CC", "RC"]),
                "Frame with the wrong offset: the job (CC) or the answer (RC); RC if left out",
            ),
            Field::new(
                "offset",
                Form::Number { least: 0, most: MAX_OFFSET as u64 },
                "The wrong offset; if left out, the right offset plus 6",
            ),
        ]
    },
)
.shown("slave=5 slot=CC");

static DRIVE_FAULT: FaultKind = FaultKind::new(
    13,
    "drive_fault",
    TargetKind::Participant,
    "A drive brakes and waits for a fault reset",
    |fault| fault::Effect::new(Effect::Trip(number(fault))),
)
.with(
    const {
        &[error(1, "Fault number, which parameter 308 shows").required("give the fault number, 1 to 16#FFFF")]
    },
)
.once()
.shown("slave=1 error=17");

/// All fault kinds of this module.
pub(crate) static KINDS: &[&FaultKind] = &[
    &LOSE_FRAME,
    &DELAY_FRAME,
    &DUPLICATE_FRAME,
    &LOSE_SYNC,
    &JITTER_SYNC,
    &SLAVE_OFF,
    &SLAVE_LATE,
    &SLAVE_BUSY,
    &SLAVE_ERROR,
    &WRONG_OFFSET,
    &BUS_OFF,
    &OVERRUN,
    &DRIVE_FAULT,
];
