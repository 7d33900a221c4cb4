//! Kinds of faults on a CANsync bus, at its slaves and in the CAN controllers of its nodes.

use super::bus::codec::updown::MAX_OFFSET;
use super::bus::{Channel, Frame, FrameKind};
use crate::fault::{self, Fault, Field, Form, Kind, Place};

/// Longest delay of a frame, in emulated microseconds.
pub const MAX_DELAY_US: u32 = 1_000_000;
/// Largest jitter of SYNC edges, in microseconds; at most a quarter of the running interval takes effect.
pub const MAX_JITTER_US: u32 = 2_000;
/// Highest identifier of a frame.
const MAX_ID: u16 = 0x7FF;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// Frames.
    Frame(Frames, FrameEffect),
    /// The slaves do not see SYNC edges.
    LoseSync,
    /// SYNC edges come so many microseconds late and early in turn, 1 to [`MAX_JITTER_US`].
    JitterSync(u32),
    /// A slave is off: a drive without power, a PLC's node with its plug pulled.
    SlaveOff,
    /// A slave's answers to jobs begin so many microseconds after their slot, 1 to [`MAX_DELAY_US`].
    SlaveLate(u32),
    /// A slave answers jobs with BUSY.
    SlaveBusy,
    /// A slave refuses jobs with this error number.
    SlaveError(u16),
    /// Blocks of an up-/download travel with this offset, 0 to 4095 bytes, instead of their own.
    WrongOffset {
        /// In the master's job or in the slave's answer.
        at: OffsetAt,
        /// The wrong offset; `None`: the right one plus 6.
        offset: Option<u16>,
    },
    /// A CAN controller switches itself off.
    BusOff,
    /// A CAN controller cannot receive frames in time and loses them.
    Overrun,
    /// A slave is a drive and has this fault, 1 to 65535.
    Trip(u16),
}

/// What happens to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameEffect {
    /// Nobody receives it; its sender does not notice.
    Lose,
    /// It begins so many microseconds after its slot, 1 to [`MAX_DELAY_US`].
    Delay(u32),
    /// It arrives once more, so many microseconds after its end plus its own length, 0 to [`MAX_DELAY_US`].
    Duplicate(u32),
}

/// Which frame carries the wrong offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OffsetAt {
    /// The master's job, on its way to the slave.
    Job,
    /// The slave's answer.
    Answer,
}

/// Which frames a fault concerns: those of a slot whose identifier agrees with `id` where `mask` has a 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Frames {
    /// Identifier, no bit outside the mask.
    id: u16,
    /// The bits of the identifier that count; 0: all frames.
    mask: u16,
    /// The slot, by its place in [`SLOTS`]; `None`: all.
    slot: Option<u32>,
}

/// The slots of the interval in the order of the manual's table (5.00005.03a p. 125).
const SLOTS: &[&str] = &["WRC1", "RDC1", "WRC2", "RDC2", "CC", "RC"];

/// The slot in which frames of a kind travel, by its place in [`SLOTS`].
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

impl Frames {
    fn of(fault: &Fault) -> Self {
        let id = fault.value(ID.name()).map(|id| id as u16);
        let mask = fault.value(MASK.name()).map_or(MAX_ID, |mask| mask as u16);
        Frames { id: id.unwrap_or(0), mask: id.map_or(0, |_| mask), slot: fault.value(SLOT.name()) }
    }

    /// Whether the fault concerns `frame`.
    pub(super) fn include(&self, frame: &Frame) -> bool {
        frame.id() & self.mask == self.id
            && self.slot.is_none_or(|slot| frame.kind().is_some_and(|kind| slot_of(kind) == slot))
    }
}

const SLOT: Field = Field::new("slot", Form::Word(SLOTS), "Left out: all");
const ID: Field =
    Field::new("id", Form::Hex { least: 0, most: MAX_ID as u64, digits: 3 }, "Identifier. Left out: all");
const MASK: Field = Field::new(
    "mask",
    Form::Hex { least: 0, most: MAX_ID as u64, digits: 3 },
    "Bits of `id` that count. Left out: all 11",
);

/// A delay of a frame.
const fn delay(least: u64, about: &'static str) -> Field {
    Field::new("delay_us", Form::Time { least, most: MAX_DELAY_US as u64 }, about).or("us")
}

const IN_US: &str = "give it in microseconds";

/// A number that a drive or slave gives.
const fn error(least: u64, about: &'static str) -> Field {
    Field::new("error", Form::Hex { least, most: 0xFFFF, digits: 4 }, about)
}

/// Some identifier must agree with the mask.
fn agree(fault: &Fault) -> Result<(), String> {
    let (id, mask) = (fault.value(ID.name()), fault.value(MASK.name()));
    match (id, mask) {
        (None, Some(_)) => Err("id is missing; a mask needs the identifier it is compared with".to_owned()),
        (Some(id), Some(mask)) if id & !mask != 0 => Err(format!(
            "id 16#{id:03X} can never match under the mask 16#{mask:03X}; clear the bits outside the mask"
        )),
        _ => Ok(()),
    }
}

fn us(fault: &Fault) -> u32 {
    fault.value("delay_us").unwrap_or(0)
}

fn number(fault: &Fault) -> u16 {
    fault.value("error").unwrap_or(0) as u16
}

static LOSE_FRAME: Kind = Kind::new(
    1,
    "lose_frame",
    Place::Medium,
    "Nobody receives a frame; its sender does not notice",
    |fault| fault::Effect::new(Effect::Frame(Frames::of(fault), FrameEffect::Lose)),
)
.with(const { &[SLOT, ID, MASK] })
.agreeing(agree)
.shown("slot=WRC1 count=3");

static DELAY_FRAME: Kind =
    Kind::new(2, "delay_frame", Place::Medium, "A frame comes later than its slot", |fault| {
        fault::Effect::new(Effect::Frame(Frames::of(fault), FrameEffect::Delay(us(fault))))
    })
    .with(const { &[SLOT, ID, MASK, delay(1, "After its slot").required(IN_US)] })
    .agreeing(agree)
    .shown("slot=RC delay=500us count=1");

static DUPLICATE_FRAME: Kind =
    Kind::new(3, "duplicate_frame", Place::Medium, "A frame comes once more", |fault| {
        fault::Effect::new(Effect::Frame(Frames::of(fault), FrameEffect::Duplicate(us(fault))))
    })
    .with(const { &[SLOT, ID, MASK, delay(0, "After the end of the first one; 0 if left out").default(0)] })
    .agreeing(agree)
    .shown("slot=CC delay=50us");

static LOSE_SYNC: Kind = Kind::new(4, "lose_sync", Place::Medium, "The slaves miss SYNC edges", |_| {
    fault::Effect::new(Effect::LoseSync)
})
.shown("bus=drives count=2");

static JITTER_SYNC: Kind =
    Kind::new(5, "jitter_sync", Place::Medium, "SYNC edges come late and early in turn", |fault| {
        fault::Effect::new(Effect::JitterSync(fault.value("amplitude_us").unwrap_or(0)))
    })
    .with(
        const {
            &[Field::new(
                "amplitude_us",
                Form::Time { least: 1, most: MAX_JITTER_US as u64 },
                "At most a quarter of the interval takes effect",
            )
            .required(IN_US)]
        },
    )
    .shown("amplitude=40us duration=1s");

static SLAVE_OFF: Kind =
    Kind::new(6, "slave_off", Place::Participant, "A slave has no power, or its plug is pulled", |_| {
        fault::Effect::new(Effect::SlaveOff)
    })
    .without_hits()
    .shown("slave=2 duration=100ms");

static SLAVE_LATE: Kind =
    Kind::new(7, "slave_late", Place::Participant, "A slave answers jobs late", |fault| {
        fault::Effect::new(Effect::SlaveLate(us(fault)))
    })
    .with(const { &[delay(1, "After the slot of the answer").required(IN_US)] })
    .shown("slave=1 delay=700us");

static SLAVE_BUSY: Kind = Kind::new(8, "slave_busy", Place::Participant, "A slave answers jobs BUSY", |_| {
    fault::Effect::new(Effect::SlaveBusy)
})
.shown("slave=1 count=5");

static SLAVE_ERROR: Kind =
    Kind::new(9, "slave_error", Place::Participant, "A slave refuses jobs with an error number", |fault| {
        fault::Effect::new(Effect::SlaveError(number(fault)))
    })
    .with(const { &[error(0, "Error number").required("give the error number, for example 16#FFFB")] })
    .shown("slave=1 error=16#FFFB count=1");

static WRONG_OFFSET: Kind = Kind::new(
    10,
    "wrong_offset",
    Place::Participant,
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
                "In the job (CC) or in the answer (RC, if left out)",
            ),
            Field::new(
                "offset",
                Form::Number { least: 0, most: MAX_OFFSET as u64 },
                "The wrong offset. Left out: the right one plus 6",
            ),
        ]
    },
)
.shown("slave=5 slot=CC");

static BUS_OFF: Kind = Kind::new(11, "bus_off", Place::Port, "A CAN controller switches itself off", |_| {
    fault::Effect::new(Effect::BusOff)
})
.once()
.shown("plc=line node=2");

static OVERRUN: Kind =
    Kind::new(12, "overrun", Place::Port, "A CAN controller loses frames that it receives", |_| {
        fault::Effect::new(Effect::Overrun)
    })
    .once()
    .shown("node=2 count=2");

static DRIVE_FAULT: Kind =
    Kind::new(13, "drive_fault", Place::Participant, "A drive brakes and waits for a fault reset", |fault| {
        fault::Effect::new(Effect::Trip(number(fault)))
    })
    .with(
        const {
            &[error(1, "Fault number, which parameter 308 shows")
                .required("give the fault number, 1 to 16#FFFF")]
        },
    )
    .once()
    .shown("slave=1 error=17");

/// All kinds.
pub static KINDS: &[&Kind] = &[
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
