//! Kinds of faults of a serial line: faults of characters, a participant that cannot send, and breaks.

use crate::devices::emulation::can_faults::{IN_US, delay};
use crate::fault::{self, Fault, FaultKind, Field, Form, TargetKind};

/// Effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) enum Effect {
    /// The fault acts on characters.
    Character(Characters, CharacterEffect),
    /// The line is low for the given number of microseconds.
    Break(u32),
}

/// Effect of a fault on a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) enum CharacterEffect {
    /// No participant receives the character; its sender does not notice.
    Lose,
    /// The lowest data bit of the character is inverted.
    Garble,
    /// The character begins later by the given number of microseconds.
    Delay(u32),
}

/// Properties of a character by which faults select it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Traits {
    /// True if the sender is the port of a device.
    pub is_port: bool,
    /// Address of the sender, if it is a drive of the line.
    pub address: Option<u8>,
    /// The octet.
    pub octet: u8,
}

/// Selection of the characters that a fault concerns. All given criteria must match.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) struct Characters {
    is_port: Option<bool>,
    octet: Option<u32>,
    address: Option<u32>,
}

impl Characters {
    fn of(fault: &Fault) -> Self {
        Characters {
            is_port: fault.value(SENDER.name()).map(|word| word == 0),
            octet: fault.value(OCTET.name()),
            address: fault.value(ADDRESS.name()),
        }
    }

    /// True if the fault concerns a character with these traits.
    pub(super) fn include(&self, seen: &Traits) -> bool {
        self.is_port.is_none_or(|is_port| is_port == seen.is_port)
            && self.octet.is_none_or(|octet| octet == u32::from(seen.octet))
            && self.address.is_none_or(|address| seen.address.is_some_and(|seen| u32::from(seen) == address))
    }
}

const SENDERS: Form = Form::Word(&["port", "partner"]);
const SENDER: Field = Field::new(
    "sender",
    SENDERS,
    "Sender of the character: the port of a PLC, or a partner, for example at a door; all if left out",
);
const OCTET: Field = Field::new(
    "octet",
    Form::Hex { least: 0, most: 0xFF, digits: 2 },
    "The character; all characters if left out",
);
const ADDRESS: Field =
    Field::new("address", Form::Number { least: 0, most: 31 }, "Address of the drive on the line")
        .required("give the address of the drive, 0 to 31");

fn us(fault: &Fault) -> u32 {
    fault.value("delay_us").unwrap_or(0)
}

fn character(fault: &Fault, effect: CharacterEffect) -> fault::Effect {
    fault::Effect::new(Effect::Character(Characters::of(fault), effect))
}

static LOSE_CHARACTER: FaultKind = FaultKind::new(
    50,
    "lose_character",
    TargetKind::Bus,
    "No participant receives a character; its sender does not notice",
    |fault| character(fault, CharacterEffect::Lose),
)
.with(const { &[SENDER, OCTET] })
.shown("octet=16#10 count=1");

static GARBLE_CHARACTER: FaultKind = FaultKind::new(
    51,
    "garble_character",
    TargetKind::Bus,
    "A bit of a character is wrong; a receiver notices it only by the parity",
    |fault| character(fault, CharacterEffect::Garble),
)
.with(const { &[SENDER, OCTET] })
.shown("sender=partner count=1");

static DELAY_CHARACTER: FaultKind = FaultKind::new(
    52,
    "delay_character",
    TargetKind::Bus,
    "A character comes later than it would",
    |fault| character(fault, CharacterEffect::Delay(us(fault))),
)
.with(
    const {
        &[
            SENDER,
            OCTET,
            delay(1, "Delay after the normal time of the character, in us").required(IN_US)
        ]
    },
)
.shown("octet=16#02 delay=250ms count=1");

static SILENT_PARTICIPANT: FaultKind = FaultKind::new(
    53,
    "silent_participant",
    TargetKind::Bus,
    "Participants receive but cannot send",
    |fault| character(fault, CharacterEffect::Lose),
)
.with(
    const {
        &[Field::new("sender", SENDERS, "The participants: ports of PLCs, or partners")
            .required("give port or partner")]
    },
)
.shown("sender=partner for=3s");

static SILENT_DRIVE: FaultKind = FaultKind::new(
    58,
    "silent_drive",
    TargetKind::Bus,
    "A drive on a serial line receives but cannot send",
    |fault| character(fault, CharacterEffect::Lose),
)
.with(const { &[ADDRESS] })
.shown("address=3 for=3s");

static LINE_BREAK: FaultKind =
    FaultKind::new(54, "line_break", TargetKind::Bus, "The line is low, as in a break", |fault| {
        fault::Effect::new(Effect::Break(fault.value("length_us").unwrap_or(0)))
    })
    .with(
        const {
            &[Field::new(
            "length_us",
            Form::Time { least: 0, most: 10_000_000 },
            "Length of the break in us; at least one character time, which is also the length if left out",
        )
        .default(0)]
        },
    )
    .once()
    .shown("length=20ms");

/// All kinds of this module.
pub(in crate::devices) static KINDS: &[&FaultKind] =
    &[&LOSE_CHARACTER, &GARBLE_CHARACTER, &DELAY_CHARACTER, &SILENT_PARTICIPANT, &LINE_BREAK, &SILENT_DRIVE];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_are_chosen_by_what_is_given() {
        let seen = [(true, 2), (false, 2), (false, 3)].map(|(is_port, octet)| Traits {
            is_port,
            octet,
            address: None,
        });
        for (is_port, octet, expected) in [
            (None, None, [true, true, true]),
            (Some(true), None, [true, false, false]),
            (Some(false), Some(3), [false, false, true]),
            (None, Some(2), [true, true, false]),
        ] {
            let characters = Characters { is_port, octet, address: None };
            assert_eq!(seen.map(|it| characters.include(&it)), expected, "{characters:?}");
        }
        let drive = Characters { is_port: None, octet: None, address: Some(3) };
        let senders = [None, Some(2), Some(3)].map(|address| Traits { is_port: false, octet: 2, address });
        assert_eq!(senders.map(|it| drive.include(&it)), [false, false, true]);
    }
}
