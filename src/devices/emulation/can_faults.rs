//! Kinds of faults that all buses with CAN frames share: faults of frames, and faults in the controllers of
//! ports. The family of a bus defines the effect of each fault, and refuses the kinds that its buses cannot
//! have.

use crate::can::Arbitration;
use crate::fault::{self, Fault, FaultKind, Field, Form, TargetKind};

/// Longest delay of a frame, in emulated microseconds.
pub(in crate::devices) const MAX_DELAY_US: u32 = 1_000_000;
/// Highest identifier of the standard format.
const MAX_STANDARD: u32 = 0x7FF;
const MAX_EXTENDED: u32 = 0x1FFF_FFFF;

/// Effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) enum Effect {
    /// The fault affects frames.
    Frame(Frames, FrameEffect),
    /// A CAN controller switches itself off.
    BusOff,
    /// A CAN controller cannot receive frames in time and loses them.
    Overrun,
}

/// Effect of a fault on a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) enum FrameEffect {
    /// No station receives the frame; its sender does not notice the loss.
    Lose,
    /// The frame begins later by the given number of microseconds, 1 to [`MAX_DELAY_US`].
    Delay(u32),
    /// The frame arrives once more after the given number of microseconds, 0 to [`MAX_DELAY_US`].
    Duplicate(u32),
    /// The frame ends in an error frame.
    Disturb,
    /// The frame loses an arbitration that it would have won.
    LoseArbitration,
}

/// Frames that a fault concerns: the identifier must agree with `id` in the bits that are 1 in `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) struct Frames {
    /// Identifier, no bit outside the mask.
    id: u32,
    /// The bits of the identifier that are compared are 1. If the mask is 0, the fault concerns all frames.
    mask: u32,
    /// True for identifiers of 29 bits, false for identifiers of 11 bits, `None` for both.
    is_extended: Option<bool>,
    /// Index of the slot in [`SLOTS`]; `None` means all slots.
    slot: Option<u32>,
}

/// The slots of an interval of CANsync in the order of the manual's table (5.00005.03a p. 125).
pub(in crate::devices) const SLOTS: &[&str] = &["WRC1", "RDC1", "WRC2", "RDC2", "CC", "RC"];

impl Frames {
    fn of(fault: &Fault) -> Self {
        let id = fault.value(ID.name());
        let is_extended = match (fault.value(FORMAT.name()), id) {
            (Some(format), _) => Some(format == 1),
            (None, Some(id)) => Some(id > MAX_STANDARD),
            (None, None) => None,
        };
        let all = if is_extended == Some(true) { MAX_EXTENDED } else { MAX_STANDARD };
        let mask = id.map_or(0, |_| fault.value(MASK.name()).unwrap_or(all));
        Frames { id: id.unwrap_or(0), mask, is_extended, slot: fault.value(SLOT.name()) }
    }

    /// True if the fault concerns a frame with this arbitration field.
    pub(in crate::devices) fn include(&self, field: Arbitration) -> bool {
        field.number() & self.mask == self.id && self.is_extended.is_none_or(|it| it == field.is_extended())
    }

    /// True if the fault concerns a frame of CANsync with this identifier, in this slot.
    pub(in crate::devices) fn include_in_slot(&self, id: u16, slot: Option<u32>) -> bool {
        u32::from(id) & self.mask == self.id && self.slot.is_none_or(|its| slot == Some(its))
    }
}

const SLOT: Field =
    Field::new("slot", Form::Word(SLOTS), "Slot of the frame on a CANsync bus; all slots if left out");
const ID: Field = Field::new(
    "id",
    Form::Hex { least: 0, most: MAX_EXTENDED as u64, digits: 3 },
    "Identifier of the frame; all identifiers if left out",
);
const MASK: Field = Field::new(
    "mask",
    Form::Hex { least: 0, most: MAX_EXTENDED as u64, digits: 3 },
    "Bits of the identifier that are compared with `id`; all bits if left out",
);
const FORMAT: Field = Field::new(
    "format",
    Form::Word(&["standard", "extended"]),
    "Identifiers of 11 or 29 bits on a CAN bus. If left out: extended for an `id` above 16#7FF, standard for another `id`, both without `id`",
);

/// Returns a delay of a frame or an answer.
pub(in crate::devices) const fn delay(least: u64, about: &'static str) -> Field {
    Field::new("delay_us", Form::Time { least, most: MAX_DELAY_US as u64 }, about).or("us")
}

/// Hint for a missing time.
pub(in crate::devices) const IN_US: &str = "give it in microseconds";

/// Checks that at least one identifier can agree with `id` under the mask.
fn agree(fault: &Fault) -> Result<(), String> {
    let (id, mask) = (fault.value(ID.name()), fault.value(MASK.name()));
    match (id, mask) {
        (None, Some(_)) => Err("id is missing; a mask needs the identifier it is compared with".to_owned()),
        (Some(id), Some(mask)) if id & !mask != 0 => Err(format!(
            "id 16#{id:03X} can never match under the mask 16#{mask:03X}; clear the bits outside the mask"
        )),
        (Some(id), _) if id > MAX_STANDARD && fault.value(FORMAT.name()) == Some(0) => {
            Err(format!("id 16#{id:03X} has more than 11 bits; give format=extended, or leave format out"))
        }
        _ => Ok(()),
    }
}

/// Checks that a CANsync bus can have the fault: this bus has only identifiers of 11 bits.
pub(in crate::devices) fn fits_cansync(fault: &Fault) -> Result<(), String> {
    let beyond = [&ID, &MASK].map(|field| fault.value(field.name()).filter(|value| *value > MAX_STANDARD));
    match (beyond, fault.value(FORMAT.name())) {
        ([Some(id), _], _) => Err(format!("id is 16#{id:03X}; on a CANsync bus it must be 16#000 to 16#7FF")),
        ([_, Some(mask)], _) => {
            Err(format!("mask is 16#{mask:03X}; on a CANsync bus it must be 16#000 to 16#7FF"))
        }
        (_, Some(1)) => Err("format is extended; a CANsync bus knows standard frames only".to_owned()),
        _ => Ok(()),
    }
}

/// Checks that a CAN bus can have the fault: this bus has no slots.
pub(in crate::devices) fn fits_can(fault: &Fault) -> Result<(), String> {
    match fault.value(SLOT.name()).and_then(|slot| SLOTS.get(slot as usize)) {
        Some(slot) => Err(format!("slot is {slot}; a CAN bus has no slots, choose frames by id")),
        None => Ok(()),
    }
}

fn us(fault: &Fault) -> u32 {
    fault.value("delay_us").unwrap_or(0)
}

fn frame(fault: &Fault, what: FrameEffect) -> fault::Effect {
    fault::Effect::new(Effect::Frame(Frames::of(fault), what))
}

pub(in crate::devices) static LOSE_FRAME: FaultKind = FaultKind::new(
    1,
    "lose_frame",
    TargetKind::Bus,
    "No station receives a frame; its sender does not notice",
    |fault| frame(fault, FrameEffect::Lose),
)
.with(const { &[SLOT, ID, MASK, FORMAT] })
.agreeing(agree)
.shown("slot=WRC1 count=3");

pub(in crate::devices) static DELAY_FRAME: FaultKind =
    FaultKind::new(2, "delay_frame", TargetKind::Bus, "A frame comes later than it would", |fault| {
        frame(fault, FrameEffect::Delay(us(fault)))
    })
    .with(
        const {
            &[
                SLOT,
                ID,
                MASK,
                FORMAT,
                delay(1, "Delay after the normal time of the frame, in us").required(IN_US),
            ]
        },
    )
    .agreeing(agree)
    .shown("slot=RC delay=500us count=1");

pub(in crate::devices) static DUPLICATE_FRAME: FaultKind =
    FaultKind::new(3, "duplicate_frame", TargetKind::Bus, "A frame comes once more", |fault| {
        frame(fault, FrameEffect::Duplicate(us(fault)))
    })
    .with(
        const {
            &[
                SLOT,
                ID,
                MASK,
                FORMAT,
                delay(0, "Time from the end of the first frame to the second frame, in us; 0 if left out")
                    .default(0),
            ]
        },
    )
    .agreeing(agree)
    .shown("slot=CC delay=50us");

/// Families of buses with ports that have a CAN controller.
pub(in crate::devices) const CONTROLLERS: &[&str] = &["cansync", "can"];

pub(in crate::devices) static BUS_OFF: FaultKind = FaultKind::new(
    11,
    "bus_off",
    TargetKind::Port,
    "The CAN controller of a port that takes part in its bus switches itself off",
    |_| fault::Effect::new(Effect::BusOff),
)
.once()
.at_ports_to(CONTROLLERS)
.shown("plc=line node=2");

pub(in crate::devices) static OVERRUN: FaultKind =
    FaultKind::new(12, "overrun", TargetKind::Port, "A CAN controller loses frames that it receives", |_| {
        fault::Effect::new(Effect::Overrun)
    })
    .once()
    .at_ports_to(CONTROLLERS)
    .shown("node=2 count=2");

static ERROR_FRAME: FaultKind =
    FaultKind::new(17, "error_frame", TargetKind::Bus, "An error frame destroys a frame", |fault| {
        frame(fault, FrameEffect::Disturb)
    })
    .with(const { &[ID, MASK, FORMAT] })
    .agreeing(agree)
    .shown("bus=drives id=16#180 count=16");

static LOST_ARBITRATION: FaultKind = FaultKind::new(
    18,
    "lost_arbitration",
    TargetKind::Bus,
    "A frame loses an arbitration that it would have won",
    |fault| frame(fault, FrameEffect::LoseArbitration),
)
.with(const { &[ID, MASK, FORMAT] })
.agreeing(agree)
.shown("id=16#180 count=1");

/// Kinds of faults of a CAN bus.
pub(in crate::devices) static OF_CAN: &[&FaultKind] =
    &[&LOSE_FRAME, &DELAY_FRAME, &DUPLICATE_FRAME, &BUS_OFF, &OVERRUN, &ERROR_FRAME, &LOST_ARBITRATION];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{ExtendedId, StandardId};
    use crate::fault::{Draft, Target};
    use crate::identity::BusIndex;

    fn frames(id: Option<u64>, mask: Option<u64>, format: Option<u64>) -> Frames {
        let values = [None, id, mask, format, None];
        let fault = Draft { values, ..Draft::new(&LOSE_FRAME, Target::Bus(BusIndex(0))) }.check().unwrap();
        Frames::of(&fault)
    }

    #[test]
    fn identifiers_have_a_format() {
        let standard = |id| Arbitration::new(StandardId::new(id).unwrap(), false);
        let extended = |id| Arbitration::new(ExtendedId::new(id).unwrap(), true);
        for (frames, expected) in [
            (frames(None, None, None), [true; 4]),
            (frames(Some(0x101), None, None), [true, false, false, false]),
            (frames(Some(0x101), None, Some(1)), [false, false, true, false]),
            (frames(Some(0x1800_0101), None, None), [false, false, false, true]),
            (frames(Some(0x100), Some(0x700), None), [true, true, false, false]),
            (frames(Some(1), Some(1), Some(1)), [false, false, true, true]),
            (frames(None, None, Some(0)), [true, true, false, false]),
        ] {
            let fields = [standard(0x101), standard(0x102), extended(0x101), extended(0x1800_0101)];
            assert_eq!(fields.map(|field| frames.include(field)), expected, "{frames:?}");
        }
    }
}
