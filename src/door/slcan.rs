//! SLCAN, the ASCII protocol of serial CAN adapters, in the variant that python-can uses. This module only reads and
//! writes the lines; the [`Adapter`] executes the commands.
//!
//! Lines end in CR. `tIIILDD..` and `TIIIIIIIILDD..` send data frames of the standard and the extended format. `rIIIL`
//! and `RIIIIIIIIL` send remote frames. The answer is `z` for the standard format and `Z` for the extended format, then
//! CR. `Sn` names a rate. `O` connects the guest to the bus, `L` connects it for listening only, `C` disconnects it.
//! Empty lines are ignored. The answer to a valid line ends in CR. The answer to any other line is BEL.
//!
//! The line `KN` is an addition of this emulator, with a letter that no adapter uses. It requests that emulated time
//! advance by N microseconds (hexadecimal digits). The answer follows when the time has advanced.

use super::protocol::{GuestSession, Protocol, TrafficKind};
use super::spec::Carrier;
use super::wire::{Adapter, BadLength, BusMessage};
use crate::can::{ErrorState, ExtendedId, Frame, Id, Payload, StandardId};
use core::fmt::Write;

/// Positive answer. It is also the end of each line.
const OK: u8 = b'\r';
/// The character BEL: negative answer.
const BELL: u8 = 7;
/// Length of the longest valid line: an extended frame with eight bytes and a time.
const LONGEST: usize = 32;

/// A rate, as the code that follows `S`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rate(u8);

/// The codes, each with a rate in bit/s. For adapters, `S7` means 800 kbit/s; for python-can, it means 750 kbit/s. Only
/// python-can has `S9`.
const RATES: [(u8, u32); 11] = [
    (0, 10_000),
    (1, 20_000),
    (2, 50_000),
    (3, 100_000),
    (4, 125_000),
    (5, 250_000),
    (6, 500_000),
    (7, 800_000),
    (7, 750_000),
    (8, 1_000_000),
    (9, 83_300),
];

impl Rate {
    fn of_code(code: u8) -> Option<Self> {
        RATES.iter().any(|(known, _)| *known == code).then_some(Rate(code))
    }

    /// True if the code can mean `bit_s`. If no code means the rate of the bus, any code is accepted, because the guest
    /// cannot name that rate.
    #[must_use]
    pub fn fits(self, bit_s: u32) -> bool {
        let mut codes = RATES.iter().filter(|(_, known)| *known == bit_s).map(|(code, _)| *code).peekable();
        codes.peek().is_none() || codes.any(|code| code == self.0)
    }

    /// Returns the code: the number that follows `S`.
    #[must_use]
    pub const fn code(self) -> u8 {
        self.0
    }

    /// Rate in bit/s. If the code means several rates, the first one in `RATES`.
    #[must_use]
    pub fn bit_s(self) -> u32 {
        RATES.iter().find(|(code, _)| *code == self.0).map_or(0, |(_, bit_s)| *bit_s)
    }
}

/// The data that `F` requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Status {
    /// True if the guest has missed frames since its last request.
    pub(super) has_missed: bool,
    /// Error state of the guest's controller.
    pub(super) errors: ErrorState,
}

impl Status {
    /// Returns the status byte. The bits are the same as in the adapters for which the protocol was made: 2 error
    /// warning, 3 overrun, 5 error-passive. Bit 7 means a bus error in adapters. In this emulator it means BUS-off
    /// (decision D-287).
    fn code(self) -> u8 {
        let errors = match self.errors {
            ErrorState::Active => 0,
            ErrorState::Warning => 0x04,
            ErrorState::Passive => 0x24,
            ErrorState::BusOff => 0xA4,
        };
        errors | if self.has_missed { 0x08 } else { 0 }
    }
}

/// The protocol SLCAN of a door.
pub(super) struct Slcan;

impl Protocol for Slcan {
    fn name(&self) -> &'static str {
        "slcan"
    }

    fn traffic_kind(&self) -> TrafficKind {
        TrafficKind::Frames
    }

    fn tcp_number(&self) -> u16 {
        1
    }

    fn pty_number(&self) -> Option<u16> {
        Some(2)
    }

    fn answers_refusals(&self) -> bool {
        true
    }

    fn begin(&self, _: Carrier, _: &mut dyn Adapter) -> Box<dyn GuestSession> {
        Box::new(Session::default())
    }
}

impl GuestSession for Session {
    fn hear(
        &mut self,
        bytes: &[u8],
        adapter: &mut dyn Adapter,
        answer: &mut Vec<u8>,
    ) -> Result<(), BadLength> {
        self.hear(bytes, adapter, answer);
        Ok(())
    }

    fn grant(&self, time_us: u64, _: u64, to: &mut Vec<u8>) {
        Session::grant(time_us, to);
    }

    fn encode(&self, time_us: u64, message: &BusMessage, to: &mut Vec<u8>) {
        if let BusMessage::Frame(frame) = message {
            self.encode(time_us, frame, to);
        }
    }
}

/// The emulator's side of the protocol for a guest.
#[derive(Debug, Default)]
pub(super) struct Session {
    line: Vec<u8>,
    /// True if lines with frames to the guest contain the time.
    times: bool,
}

impl Session {
    /// Interprets bytes from the guest and appends the answers to `answer`.
    pub(super) fn hear(&mut self, bytes: &[u8], adapter: &mut dyn Adapter, answer: &mut Vec<u8>) {
        for &byte in bytes {
            match byte {
                b'\r' | b'\n' if self.line.is_empty() => {}
                b'\r' | b'\n' => {
                    let line = core::mem::take(&mut self.line);
                    self.obey(&line, adapter, answer);
                    self.line = line;
                    self.line.clear();
                }
                // The guard keeps one byte more than the longest valid line has. Such a line is invalid, so its further
                // bytes need not be kept.
                _ if self.line.len() <= LONGEST => self.line.push(byte),
                _ => {}
            }
        }
    }

    fn obey(&mut self, line: &[u8], adapter: &mut dyn Adapter, answer: &mut Vec<u8>) {
        let Some((command, rest)) = line.split_first().filter(|_| line.len() <= LONGEST) else {
            answer.push(BELL);
            return;
        };
        let done = match (command, rest) {
            (b't' | b'T' | b'r' | b'R', _) => {
                let sent = frame(*command, rest).is_some_and(|frame| adapter.send(BusMessage::Frame(frame)));
                if sent {
                    answer.push(if command.is_ascii_lowercase() { b'z' } else { b'Z' });
                }
                sent
            }
            (b'S', [code]) => {
                let rate = code.checked_sub(b'0').and_then(Rate::of_code);
                rate.is_some() && adapter.set_rate(rate)
            }
            // The value is meant for the bit timing registers of an adapter's controller. The emulator has no such
            // registers, so it does not check the value.
            (b's', [_, ..]) if rest.iter().all(u8::is_ascii_hexdigit) => adapter.set_rate(None),
            (b'O', []) => {
                adapter.open(false);
                true
            }
            (b'L', []) => {
                adapter.open(true);
                true
            }
            (b'C', []) => {
                adapter.close();
                true
            }
            (b'Z', [b'0' | b'1']) => {
                self.times = rest == b"1";
                true
            }
            (b'V', []) => {
                answer.extend_from_slice(b"V0101");
                true
            }
            (b'N', []) => {
                answer.extend_from_slice(b"NCRAM");
                true
            }
            (b'F', []) => {
                answer.extend_from_slice(format!("F{:02X}", adapter.take_status().code()).as_bytes());
                true
            }
            // The answer is sent when the requested time has passed.
            (b'K', _) if number(rest).is_some_and(|us| adapter.ask(us)) => return,
            // These settings have no effect: all frames are always sent when they arrive.
            (b'X', [b'0' | b'1']) => true,
            (b'M', b"00000000") | (b'm', b"FFFFFFFF" | b"ffffffff") => true,
            _ => false,
        };
        answer.push(if done { OK } else { BELL });
    }

    /// Appends the answer to a request for time. `time_us` is the present emulated time.
    pub(super) fn grant(time_us: u64, line: &mut Vec<u8>) {
        line.extend_from_slice(format!("K{time_us:X}").as_bytes());
        line.push(OK);
    }

    /// Appends the line for a frame that has arrived at this emulated time.
    pub(super) fn encode(&self, time_us: u64, frame: &Frame, line: &mut Vec<u8>) {
        let mut text = String::with_capacity(LONGEST);
        let field = frame.arbitration();
        // Writing into a text cannot fail.
        let _ = match (field.id(), field.is_remote()) {
            (Id::Standard(id), false) => write!(text, "t{:03X}", id.as_raw()),
            (Id::Standard(id), true) => write!(text, "r{:03X}", id.as_raw()),
            (Id::Extended(id), false) => write!(text, "T{:08X}", id.as_raw()),
            (Id::Extended(id), true) => write!(text, "R{:08X}", id.as_raw()),
        };
        let _ = write!(text, "{:X}", frame.length());
        for byte in frame.payload().data() {
            let _ = write!(text, "{byte:02X}");
        }
        if self.times {
            // The time is in milliseconds and begins again at 0 after a minute.
            let _ = write!(text, "{:04X}", time_us / 1000 % 60_000);
        }
        line.extend_from_slice(text.as_bytes());
        line.push(OK);
    }
}

/// Reads a number that consists of hexadecimal digits only.
fn number(digits: &[u8]) -> Option<u64> {
    let text =
        core::str::from_utf8(digits).ok().filter(|text| text.bytes().all(|c| c.is_ascii_hexdigit()))?;
    u64::from_str_radix(text, 16).ok()
}

/// Reads the frame of a line from the text after the letter. A time after the frame is ignored.
fn frame(command: u8, rest: &[u8]) -> Option<Frame> {
    let text = core::str::from_utf8(rest).ok().filter(|text| text.bytes().all(|c| c.is_ascii_hexdigit()))?;
    let (id, rest) = text.split_at_checked(if command.is_ascii_lowercase() { 3 } else { 8 })?;
    let raw = u32::from_str_radix(id, 16).ok()?;
    let id = if command.is_ascii_lowercase() {
        Id::Standard(StandardId::new(u16::try_from(raw).ok()?)?)
    } else {
        Id::Extended(ExtendedId::new(raw)?)
    };
    let (length, data) = rest.split_at_checked(1)?;
    let length = usize::from_str_radix(length, 16).ok().filter(|length| *length <= 8)?;
    if command.eq_ignore_ascii_case(&b'r') {
        return Frame::remote(id, length).filter(|_| matches!(data.len(), 0 | 4));
    }
    let (data, time) = data.split_at_checked(2 * length)?;
    if !matches!(time.len(), 0 | 4) {
        return None;
    }
    let mut bytes = [0; 8];
    for (byte, at) in bytes.iter_mut().zip(0..length) {
        *byte = u8::from_str_radix(data.get(2 * at..2 * at + 2)?, 16).ok()?;
    }
    Some(Frame::new(id, Payload::from_padded(bytes, length)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Default)]
    struct Noted {
        rate: Option<Rate>,
        open: Option<bool>,
        sent: Vec<Frame>,
        asked: Vec<u64>,
        status: Status,
    }

    impl Adapter for Noted {
        fn set_rate(&mut self, rate: Option<Rate>) -> bool {
            let may = self.open.is_none();
            if may {
                self.rate = rate;
            }
            may
        }

        fn open(&mut self, listens: bool) {
            self.open = Some(listens);
        }

        fn close(&mut self) {
            self.open = None;
        }

        fn send(&mut self, message: BusMessage) -> bool {
            let may = self.open == Some(false);
            match message {
                BusMessage::Frame(frame) if may => self.sent.push(frame),
                _ => {}
            }
            may
        }

        fn ask_until(&mut self, _: u64) -> bool {
            false
        }

        fn ask(&mut self, us: u64) -> bool {
            self.asked.push(us);
            us > 0
        }

        fn take_status(&mut self) -> Status {
            let status = self.status;
            self.status.has_missed = false;
            status
        }
    }

    fn hear(session: &mut Session, noted: &mut Noted, text: &str) -> String {
        let mut answer = Vec::new();
        session.hear(text.as_bytes(), noted, &mut answer);
        String::from_utf8(answer).unwrap()
    }

    fn standard(id: u16, data: &[u8]) -> Frame {
        Frame::standard(id, Payload::new(data).unwrap())
    }

    #[test]
    fn frames_of_all_four_kinds_go_both_ways() {
        let extended = ExtendedId::new(0x18FF_1234).unwrap();
        let frames = [
            ("t1232AABB\r", standard(0x123, &[0xAA, 0xBB])),
            ("t0000\r", standard(0, &[])),
            ("r7208\r", Frame::remote(StandardId::new(0x720).unwrap(), 8).unwrap()),
            ("T18FF12343010203\r", Frame::new(extended, Payload::new(&[1, 2, 3]).unwrap())),
            ("R18FF12340\r", Frame::remote(extended, 0).unwrap()),
        ];
        let (mut session, mut noted) = (Session::default(), Noted { open: Some(false), ..Noted::default() });
        for (line, frame) in frames {
            let yes = if line.starts_with(|c: char| c.is_lowercase()) { "z\r" } else { "Z\r" };
            assert_eq!(hear(&mut session, &mut noted, line), yes, "{line}");
            assert_eq!(noted.sent.pop(), Some(frame), "{line}");
            let mut sent_bytes = Vec::new();
            session.encode(0, &frame, &mut sent_bytes);
            assert_eq!(String::from_utf8(sent_bytes).unwrap(), line);
        }
    }

    #[test]
    fn bad_lines_are_answered_by_the_bell() {
        let (mut session, mut noted) = (Session::default(), Noted { open: Some(false), ..Noted::default() });
        for line in [
            "x",
            "t",
            "t12",
            "t1239",
            "t12310",
            "t1231001",
            "t8000",
            "t12g0",
            "T200000000",
            "t123100000",
            "r12310",
            "SA",
            "S",
            "S10",
            "O1",
            "M12345678",
            "t+120",
            "Z2",
            "s",
            "sXY",
        ] {
            assert_eq!(hear(&mut session, &mut noted, &format!("{line}\r")), "\x07", "{line}");
        }
        let long = format!("t1231{}\r", "0".repeat(1000));
        assert_eq!(hear(&mut session, &mut noted, &long), "\x07");
        assert_eq!(hear(&mut session, &mut noted, "t12310A\r"), "z\r", "the next line counts again");
        assert_eq!(noted.sent.len(), 1);
    }

    #[test]
    fn empty_lines_are_passed_over_and_lines_come_in_pieces() {
        let (mut session, mut noted) = (Session::default(), Noted::default());
        assert_eq!(hear(&mut session, &mut noted, "\r\r\n\rC"), "");
        assert_eq!(hear(&mut session, &mut noted, "\r\nS4\r\nO\r"), "\r\r\r");
        assert_eq!((noted.rate.map(Rate::bit_s), noted.open), (Some(125_000), Some(false)));
    }

    #[test]
    fn requests_of_python_can_are_answered() {
        let (mut session, mut noted) = (Session::default(), Noted::default());
        noted.status.has_missed = true;
        assert_eq!(hear(&mut session, &mut noted, "V\rN\r"), "V0101\rNCRAM\r");
        assert_eq!(hear(&mut session, &mut noted, "F\rF\r"), "F08\rF00\r");
        for (errors, answer) in
            [(ErrorState::Warning, "F04\r"), (ErrorState::Passive, "F24\r"), (ErrorState::BusOff, "FA4\r")]
        {
            noted.status = Status { has_missed: false, errors };
            assert_eq!(hear(&mut session, &mut noted, "F\r"), answer);
        }
        assert_eq!(hear(&mut session, &mut noted, "t1230\r"), "\x07", "it does not take part");
        assert_eq!(hear(&mut session, &mut noted, "L\rt1230\rS5\rC\rs031C\r"), "\r\x07\x07\r\r");
        assert_eq!((noted.rate, noted.open), (None, None));
    }

    #[test]
    fn a_frame_with_a_time_has_its_millisecond() {
        let (mut session, mut noted) = (Session::default(), Noted::default());
        assert_eq!(hear(&mut session, &mut noted, "Z1\r"), "\r");
        let mut sent_bytes = Vec::new();
        session.encode(60_123_999, &standard(0x10, &[5]), &mut sent_bytes);
        assert_eq!(sent_bytes, b"t010105007B\r");
    }

    #[test]
    fn a_request_for_time_is_answered_later() {
        let (mut session, mut noted) = (Session::default(), Noted::default());
        assert_eq!(hear(&mut session, &mut noted, "K1\rK3e8\rKFFFFFFFFFFFFFFFF\r"), "");
        assert_eq!(noted.asked, [1, 1000, u64::MAX]);
        let mut sent_bytes = Vec::new();
        Session::grant(1_000_000, &mut sent_bytes);
        assert_eq!(sent_bytes, b"KF4240\r");
        for line in ["K", "K0", "K-1", "K+1", "Kx", "K10000000000000000"] {
            assert_eq!(hear(&mut session, &mut noted, &format!("{line}\r")), "\x07", "{line}");
        }
    }

    #[test]
    fn a_rate_without_a_code_takes_any() {
        let rate = |code| Rate::of_code(code).unwrap();
        assert!(rate(4).fits(125_000) && !rate(4).fits(500_000) && !rate(5).fits(125_000));
        assert!(rate(7).fits(800_000) && rate(7).fits(750_000) && rate(9).fits(83_300));
        assert!((0..10).all(|code| rate(code).fits(33_300)));
        assert_eq!(Rate::of_code(10), None);
    }

    /// For any input, the protocol does not panic, and each line that is not empty has one answer: at once, or when its
    /// time has come.
    fn each_line_has_one_answer(bytes: &[u8]) {
        let (mut session, mut noted) = (Session::default(), Noted { open: Some(false), ..Noted::default() });
        let mut answer = Vec::new();
        session.hear(bytes, &mut noted, &mut answer);
        let lines = bytes.split(|byte| matches!(byte, b'\r' | b'\n')).rev().skip(1);
        let wanted = lines.filter(|line| !line.is_empty()).count();
        let answers = answer.iter().filter(|byte| matches!(**byte, OK | BELL)).count();
        let later = noted.asked.iter().filter(|us| **us > 0).count();
        assert_eq!(answers + later, wanted);
    }

    #[test]
    fn fuzz_slcan() {
        crate::fuzz("slcan", each_line_has_one_answer);
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        /// Every frame is written as a line that is read as the same frame.
        #[test]
        fn frames_are_unchanged_after_a_round_trip(id in 0..1_u32 << 29, is_long: bool, is_remote: bool, data in prop::collection::vec(any::<u8>(), 0..=8)) {
            let id: crate::can::Id = if is_long {
                ExtendedId::new(id).unwrap().into()
            } else {
                StandardId::new((id & 0x7FF) as u16).unwrap().into()
            };
            let frame = if is_remote {
                Frame::remote(id, data.len()).unwrap()
            } else {
                Frame::new(id, Payload::new(&data).unwrap())
            };
            let (mut session, mut noted) = (Session::default(), Noted { open: Some(false), ..Noted::default() });
            let (mut sent_bytes, mut answer) = (Vec::new(), Vec::new());
            session.encode(0, &frame, &mut sent_bytes);
            session.hear(&sent_bytes, &mut noted, &mut answer);
            prop_assert_eq!(noted.sent, vec![frame]);
        }

        #[test]
        fn any_line_has_one_answer(bytes in prop::collection::vec(prop_oneof![any::<u8>(), Just(b'\r'), 48u8..58, Just(b't'), Just(b'K')], 0..200)) {
            each_line_has_one_answer(&bytes);
        }
    }
}
