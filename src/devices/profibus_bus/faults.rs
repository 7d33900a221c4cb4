//! Kinds of faults of a PROFIBUS: faults of telegrams, a station that cannot send, and noise on the line.

use crate::devices::emulation::can_faults::{IN_US, delay};
use crate::fault::{self, Fault, FaultKind, Field, Form, TargetKind};
use crate::profibus::{FunctionCode, MAX_OCTETS, Telegram};

/// Effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) enum Effect {
    /// The fault acts on telegrams.
    Telegram(Telegrams, TelegramEffect),
    /// The fault puts the given number of octets on the line, 1 to [`MAX_OCTETS`].
    Noise(u8),
}

/// Effect of a fault on a telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) enum TelegramEffect {
    /// No station receives the telegram; its sender does not notice.
    Lose,
    /// The telegram begins later by the given number of microseconds.
    Delay(u32),
    /// The telegram is repeated the given number of microseconds after its end.
    Repeat(u32),
    /// A bit of the telegram is inverted, so that no station can decode it.
    Garble,
    /// The frame count bit of the telegram is inverted, with a correct check sum.
    WrongFrameCount,
}

/// Properties of a telegram by which faults select it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Traits {
    /// Address of the sender, if it is known.
    pub station: Option<u8>,
    is_answer: Option<bool>,
    /// Service access point of the station that must answer, or that answers.
    sap: Option<u8>,
    /// True if the telegram is a request with a valid frame count bit.
    pub has_frame_count: bool,
}

impl Traits {
    /// Returns the facts about a telegram. `station` is the address of the sender, if the octets do not
    /// contain it.
    pub(super) fn of(octets: &[u8], station: Option<u8>) -> Self {
        match Telegram::parse(octets) {
            Ok(Telegram::Frame(frame)) => {
                let is_answer = FunctionCode::is_answer(frame.fc);
                let code = FunctionCode::parse(frame.fc);
                Traits {
                    station: Some(frame.sa),
                    is_answer: Some(is_answer),
                    sap: if is_answer { frame.ssap } else { frame.dsap },
                    has_frame_count: matches!(code, FunctionCode::Request { fcv: true, .. }),
                }
            }
            Ok(Telegram::ShortAck) => Traits { station, is_answer: Some(true), ..Traits::default() },
            Ok(Telegram::Token { sa, .. }) => Traits { station: Some(sa), ..Traits::default() },
            Err(_) => Traits { station, ..Traits::default() },
        }
    }
}

/// Selection of the telegrams that a fault affects. A telegram must match all criteria that are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices) struct Telegrams {
    station: Option<u32>,
    is_answer: Option<bool>,
    sap: Option<u32>,
}

impl Telegrams {
    fn of(fault: &Fault) -> Self {
        Telegrams {
            station: fault.value(STATION.name()),
            is_answer: fault.value(WHAT.name()).map(|word| word == 1),
            sap: fault.value(SAP.name()),
        }
    }

    /// True if the fault affects a telegram with these properties.
    pub(super) fn include(&self, seen: &Traits) -> bool {
        let agrees =
            |wanted: Option<u32>, seen: Option<u8>| wanted.is_none() || wanted == seen.map(u32::from);
        agrees(self.station, seen.station)
            && agrees(self.sap, seen.sap)
            && (self.is_answer.is_none() || self.is_answer == seen.is_answer)
    }
}

const ADDRESS: Form = Form::Number { least: 0, most: 126 };
const STATION: Field = Field::new("station", ADDRESS, "Address of the sender; all senders if left out");
const WHAT: Field =
    Field::new("what", Form::Word(&["request", "answer"]), "Kind of the telegram; all telegrams if left out");
const SAP: Field = Field::new(
    "sap",
    Form::Number { least: 0, most: 63 },
    "Service access point of the slave, for example 61 for Set_Prm; all telegrams if left out",
);
const OCTETS: Field = Field::new(
    "octets",
    Form::Number { least: 1, most: MAX_OCTETS as u64 },
    "Number of octets; 8 if left out",
)
.default(8);

fn us(fault: &Fault) -> u32 {
    fault.value("delay_us").unwrap_or(0)
}

fn telegram(fault: &Fault, what: TelegramEffect) -> fault::Effect {
    fault::Effect::new(Effect::Telegram(Telegrams::of(fault), what))
}

static LOSE_TELEGRAM: FaultKind = FaultKind::new(
    20,
    "lose_telegram",
    TargetKind::Bus,
    "No station receives a telegram; its sender does not notice",
    |fault| telegram(fault, TelegramEffect::Lose),
)
.with(const { &[STATION, WHAT, SAP] })
.shown("what=answer count=1");

static DELAY_TELEGRAM: FaultKind =
    FaultKind::new(21, "delay_telegram", TargetKind::Bus, "A telegram comes later than it would", |fault| {
        telegram(fault, TelegramEffect::Delay(us(fault)))
    })
    .with(
        const {
            &[
                STATION,
                WHAT,
                SAP,
                delay(1, "Delay after the normal time of the telegram, in us").required(IN_US),
            ]
        },
    )
    .shown("what=answer delay=5ms count=1");

static REPEAT_TELEGRAM: FaultKind =
    FaultKind::new(22, "repeat_telegram", TargetKind::Bus, "A telegram comes once more", |fault| {
        telegram(fault, TelegramEffect::Repeat(us(fault)))
    })
    .with(
        const {
            &[
                STATION,
                WHAT,
                SAP,
                delay(
                    0,
                    "Time from the end of the first telegram to the second telegram, in us; 0 if left out",
                )
                .default(0),
            ]
        },
    )
    .shown("what=request delay=2ms");

static GARBLE_TELEGRAM: FaultKind = FaultKind::new(
    23,
    "garble_telegram",
    TargetKind::Bus,
    "A bit of a telegram is wrong, so no station understands it",
    |fault| telegram(fault, TelegramEffect::Garble),
)
.with(const { &[STATION, WHAT, SAP] })
.shown("station=5 count=1");

static WRONG_FRAME_COUNT: FaultKind = FaultKind::new(
    24,
    "wrong_frame_count",
    TargetKind::Bus,
    "A request has the same frame count bit as the previous request of the master to this slave",
    |fault| telegram(fault, TelegramEffect::WrongFrameCount),
)
.with(const { &[STATION, SAP] })
.shown("count=1");

static SILENT_STATION: FaultKind =
    FaultKind::new(25, "silent_station", TargetKind::Bus, "A station receives but cannot send", |fault| {
        telegram(fault, TelegramEffect::Lose)
    })
    .with(
        const {
            &[Field::new("station", ADDRESS, "Address of the station").required("give its address, 0 to 126")]
        },
    )
    .shown("station=5 for=100ms");

static NOISE: FaultKind = FaultKind::new(
    26,
    "noise",
    TargetKind::Bus,
    "Octets are on the line that no station has sent",
    |fault| fault::Effect::new(Effect::Noise(fault.value(OCTETS.name()).unwrap_or(1) as u8)),
)
.with(const { &[OCTETS] })
.once()
.shown("octets=20");

/// All kinds of this module.
pub(in crate::devices) static KINDS: &[&FaultKind] = &[
    &LOSE_TELEGRAM,
    &DELAY_TELEGRAM,
    &REPEAT_TELEGRAM,
    &GARBLE_TELEGRAM,
    &WRONG_FRAME_COUNT,
    &SILENT_STATION,
    &NOISE,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telegrams_are_chosen_by_what_is_given() {
        let request = [0x68, 5, 5, 0x68, 0x85, 0x82, 0x7D, 0x3D, 0x3E, 0xFF, 0x16];
        let seen = Traits::of(&request, None);
        let wanted =
            Traits { station: Some(2), is_answer: Some(false), sap: Some(61), has_frame_count: true };
        assert_eq!(seen, wanted);
        let receipt = Traits::of(&[0xE5], Some(5));
        let wanted = Traits { station: Some(5), is_answer: Some(true), sap: None, has_frame_count: false };
        assert_eq!(receipt, wanted);
        for (telegrams, expected) in [
            (Telegrams { station: None, is_answer: None, sap: None }, [true, true]),
            (Telegrams { station: Some(2), is_answer: None, sap: None }, [true, false]),
            (Telegrams { station: None, is_answer: Some(true), sap: None }, [false, true]),
            (Telegrams { station: None, is_answer: None, sap: Some(61) }, [true, false]),
            (Telegrams { station: Some(5), is_answer: None, sap: Some(61) }, [false, false]),
        ] {
            assert_eq!([seen, receipt].map(|it| telegrams.include(&it)), expected, "{telegrams:?}");
        }
    }
}
