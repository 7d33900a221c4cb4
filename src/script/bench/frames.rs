//! Frames on a bus.

use super::Bench;
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use crate::devices::BUS_KINDS;
use crate::identity::BusIndex;
use crate::journal::{Record, Ring, Source};
use crate::request::Op;
use crate::script::{ScenarioError, Span};
use crate::time::{seconds, short};
use core::panic::Location;

/// Number of frames in a failure.
const LAST_FRAMES: usize = 6;

/// A frame that was on a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeenFrame {
    /// Emulated time of the end of the frame, in microseconds.
    pub time_us: u64,
    /// The frame on the bus.
    pub frame: Frame,
    /// The meaning of the frame on this kind of bus; empty if it is not known.
    pub text: String,
}

/// Identifier and data of the awaited frames.
struct Pattern {
    id: u32,
    mask: u32,
    /// True if the identifier has 29 bits.
    extended: bool,
    /// Data bytes of the frame; a byte is `None` if it can have any value. `None` instead of the list allows any data
    /// of any length.
    data: Option<Vec<Option<u8>>>,
}

impl Pattern {
    /// Returns a pattern with an identifier of 11 bits.
    fn new(id: u16, mask: u16, data: &str) -> Result<Self, ScenarioError> {
        if id > STANDARD || mask > STANDARD || id & !mask != 0 {
            let text = format!("16#{id:X} under mask 16#{mask:X}");
            let right = "identifiers have 11 bits, 0 to 16#7FF, and none outside the mask".to_owned();
            return Err(ScenarioError::Argument { text, right });
        }
        Ok(Self { id: id.into(), mask: mask.into(), extended: false, data: parse_data(data)? })
    }

    /// Returns a pattern with an identifier of 29 bits.
    fn extended(id: u32, data: &str) -> Result<Self, ScenarioError> {
        extended_id(id)?;
        Ok(Self { id, mask: EXTENDED, extended: true, data: parse_data(data)? })
    }

    fn matches(&self, frame: &Frame) -> bool {
        let (field, payload) = (frame.arbitration(), frame.payload());
        let same = |data: &Vec<Option<u8>>| {
            let bytes = payload.data();
            data.len() == bytes.len()
                && data.iter().zip(bytes).all(|(wanted, byte)| wanted.is_none_or(|w| w == *byte))
        };
        field.is_extended() == self.extended
            && !field.is_remote()
            && field.number() & self.mask == self.id
            && self.data.as_ref().is_none_or(same)
    }

    /// `16#101 44 33 ..`
    fn describe(&self, bus: &str) -> String {
        let mut text = match self.extended {
            true => format!("frame 16#{:08X}", self.id),
            false => format!("frame 16#{:03X}", self.id),
        };
        if !self.extended && self.mask != u32::from(STANDARD) {
            text += &format!(" under mask 16#{:03X}", self.mask);
        }
        let byte = |byte: &Option<u8>| byte.map_or_else(|| "..".to_owned(), |byte| format!("{byte:02X}"));
        match &self.data {
            None => {}
            Some(data) if data.is_empty() => text += " without data",
            Some(data) => text += &format!(" {}", data.iter().map(byte).collect::<Vec<_>>().join(" ")),
        }
        format!("{text} on bus {bus}")
    }
}

/// Mask with all bits of a standard identifier; also the highest standard identifier.
const STANDARD: u16 = 0x7FF;
const EXTENDED: u32 = 0x1FFF_FFFF;

fn standard_id(id: u32) -> Result<Id, ScenarioError> {
    let known = u16::try_from(id).ok().and_then(StandardId::new);
    let right = "identifiers have 11 bits, 0 to 16#7FF; those with more are `extended`";
    known.map(Id::Standard).ok_or_else(|| ScenarioError::argument(&format!("16#{id:X}"), right))
}

fn extended_id(id: u32) -> Result<Id, ScenarioError> {
    let right = "extended identifiers have 29 bits, 0 to 16#1FFFFFFF";
    let known = ExtendedId::new(id).map(Id::Extended);
    known.ok_or_else(|| ScenarioError::argument(&format!("16#{id:X}"), right))
}

fn identifier(id: u32, extended: bool) -> Result<Id, ScenarioError> {
    if extended { extended_id(id) } else { standard_id(id) }
}

/// Parses `44 33 .. 11` or `4433..11`, or `*` for any data.
fn parse_data(text: &str) -> Result<Option<Vec<Option<u8>>>, ScenarioError> {
    if text.trim() == "*" {
        return Ok(None);
    }
    let digit = |letter: u8| char::from(letter).to_digit(16);
    let byte = |pair: &[u8]| match *pair {
        [b'.', b'.'] | [b'?', b'?'] => Some(None),
        // Two digits give at most 255.
        [high, low] => Some(Some((16 * digit(high)? + digit(low)?) as u8)),
        _ => None,
    };
    // Blanks may only be between bytes, so each word has an even number of characters.
    let pairs = text.split_whitespace().flat_map(|word| word.as_bytes().chunks(2));
    let data: Option<Vec<_>> = pairs.map(byte).collect();
    data.filter(|data| data.len() <= 8).map(Some).ok_or_else(|| ScenarioError::Argument {
        text: text.to_owned(),
        right: "write up to eight bytes of two hexadecimal digits, for example `01 02 FF` or `0102FF`; `..` is any \
                byte, and `*` any data"
            .to_owned(),
    })
}

impl Bench {
    /// Waits for a frame with identifier `id` and `data`, and advances the clock until the end of this frame. `data` is
    /// for example `44 33 .. 11`, in the order of the bytes, with `..` for any byte; or `*` for any data.
    ///
    /// # Errors
    /// No such frame ends within this time, the bus does not exist, or the identifier is invalid.
    #[track_caller]
    pub fn expect_frame(
        &mut self,
        bus: &str,
        id: u16,
        data: &str,
        within: impl Into<Span>,
    ) -> Result<SeenFrame, ScenarioError> {
        self.expect_masked_frame(bus, id, 0x7FF, data, within)
    }

    /// Expects a frame like [`Bench::expect_frame`], with any identifier that equals `id` in the bits of `mask`.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::expect_frame`].
    #[track_caller]
    pub fn expect_masked_frame(
        &mut self,
        bus: &str,
        id: u16,
        mask: u16,
        data: &str,
        within: impl Into<Span>,
    ) -> Result<SeenFrame, ScenarioError> {
        self.expect_match(bus, &Pattern::new(id, mask, data)?, within.into(), Location::caller())
    }

    /// Expects a frame like [`Bench::expect_frame`], with an identifier of 29 bits.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::expect_frame`].
    #[track_caller]
    pub fn expect_extended_frame(
        &mut self,
        bus: &str,
        id: u32,
        data: &str,
        within: impl Into<Span>,
    ) -> Result<SeenFrame, ScenarioError> {
        self.expect_match(bus, &Pattern::extended(id, data)?, within.into(), Location::caller())
    }

    fn expect_match(
        &mut self,
        bus: &str,
        pattern: &Pattern,
        within: Span,
        at: &Location<'_>,
    ) -> Result<SeenFrame, ScenarioError> {
        let start = self.now()?;
        if let Some(found) = self.look_for(bus, pattern, within.clone())? {
            return Ok(found);
        }
        let expected = pattern.describe(bus);
        let others = self.frames(bus, start)?;
        let last = others.get(others.len().saturating_sub(LAST_FRAMES)..).unwrap_or_default();
        let last: Vec<_> = last.iter().map(SeenFrame::to_string).collect();
        let what = format!("no {expected} within {}", short(within.us()?));
        let mut failure = self.failure(what, at)?;
        failure.within_us = Some(within.us()?);
        failure.expected = Some(expected);
        failure.actual = Some(match last.as_slice() {
            [] => "no frame at all".to_owned(),
            last => format!("the last frames are\n    {}", last.join("\n    ")),
        });
        Err(failure.into())
    }

    /// Advances the clock by this time, and expects that no frame with the bits of `id` under `mask` ends within it.
    ///
    /// # Errors
    /// Such a frame has ended, the bus does not exist, or the identifier is invalid.
    #[track_caller]
    pub fn expect_no_frame(
        &mut self,
        bus: &str,
        id: u16,
        mask: u16,
        within: impl Into<Span>,
    ) -> Result<(), ScenarioError> {
        self.expect_no_match(bus, &Pattern::new(id, mask, "*")?, within.into(), Location::caller())
    }

    /// Expects no frame like [`Bench::expect_no_frame`], for an identifier of 29 bits.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::expect_no_frame`].
    #[track_caller]
    pub fn expect_no_extended_frame(
        &mut self,
        bus: &str,
        id: u32,
        within: impl Into<Span>,
    ) -> Result<(), ScenarioError> {
        self.expect_no_match(bus, &Pattern::extended(id, "*")?, within.into(), Location::caller())
    }

    /// Sends a data frame from guest 0, a separate station of the bus. `data` is for example `44 33 11`. The clock does
    /// not advance. The frame takes part in the arbitration with other frames that wait for the bus.
    ///
    /// # Errors
    /// There is no such bus, the identifier or `data` is invalid, or the bus refuses the frame: 64 frames wait already,
    /// the bus has no such frames, or no master runs the bus.
    pub fn send_frame(
        &mut self,
        bus: &str,
        id: u32,
        extended: bool,
        data: &str,
    ) -> Result<(), ScenarioError> {
        let bytes = parse_data(data)?.and_then(|data| data.into_iter().collect::<Option<Vec<u8>>>());
        let payload = bytes.and_then(|bytes| Payload::new(&bytes)).ok_or_else(|| {
            let right = "data to be sent are up to eight bytes of two hexadecimal digits, for example `01 02 FF`; `..` \
                         and `*` are only for awaited frames";
            ScenarioError::argument(data, right)
        })?;
        let frame = Frame::new(identifier(id, extended)?, payload);
        let bus = self.bus(bus)?;
        Ok(self.ask(Op::BusSend { bus, frame: Some(frame) })?.written()?)
    }

    /// Sends a remote frame with this identifier and a length of 0.
    ///
    /// # Errors
    /// Returns the errors of [`Bench::send_frame`].
    pub fn rtr(&mut self, bus: &str, id: u32, extended: bool) -> Result<(), ScenarioError> {
        let frame = Frame::remote(identifier(id, extended)?, 0);
        let bus = self.bus(bus)?;
        Ok(self.ask(Op::BusSend { bus, frame })?.written()?)
    }

    fn expect_no_match(
        &mut self,
        bus: &str,
        pattern: &Pattern,
        within: Span,
        at: &Location<'_>,
    ) -> Result<(), ScenarioError> {
        let Some(found) = self.look_for(bus, pattern, within)? else { return Ok(()) };
        let wanted = pattern.describe(bus);
        let mut failure = self.failure(format!("there is a {wanted}"), at)?;
        failure.expected = Some(format!("no {wanted}"));
        failure.actual = Some(found.to_string());
        Err(failure.into())
    }

    /// Returns the frames on a bus that have ended at time `since` (microseconds) or later. With the time 0, returns the
    /// frames that the journal still keeps.
    ///
    /// # Errors
    /// There is no such bus, or the journal may no longer have all of these frames.
    pub fn frames(&mut self, bus: &str, since: u64) -> Result<Vec<SeenFrame>, ScenarioError> {
        let bus = self.bus(bus)?;
        let (records, _) = self.records(0)?;
        if since > 0 {
            let begin = self.journal_begin()?;
            // Records before a return to an earlier moment are not newer than this moment.
            let is_later = self.returned_us.is_some_and(|returned_us| since >= returned_us);
            let first = if is_later { records.partition_point(|record| record.seq < begin) } else { 0 };
            let kept = records.get(first..).unwrap_or_default();
            // The journal of a return to a snapshot can begin with this snapshot.
            let known_us = self.returned_us.unwrap_or(self.started_us);
            if crate::journal::may_be_lost(kept, Ring::Traffic, begin, since, known_us) {
                let right = "the journal no longer has all frames since this time: it keeps the last 65,536 of all buses, \
                             fewer with telegrams, and none from before a snapshot from which it continues; call `frames` more \
                             often, or with the time 0 for the frames that are left";
                return Err(ScenarioError::argument(&format!("frames since {}", short(since)), right));
            }
        }
        let records = records.iter().filter(|record| record.time_us >= since);
        Ok(records.filter_map(|record| frame_of(record, bus)).collect())
    }

    /// Returns the records that end at time `since` (microseconds) or later and that the journal still keeps.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    pub fn journal(&mut self, since: u64) -> Result<Vec<Record>, ScenarioError> {
        let (records, _) = self.records(0)?;
        Ok(crate::journal::since(records, since))
    }

    /// Waits for the first frame that matches and ends after the call.
    fn look_for(
        &mut self,
        bus: &str,
        pattern: &Pattern,
        within: Span,
    ) -> Result<Option<SeenFrame>, ScenarioError> {
        let (bus, us) = (self.bus(bus)?, self.span(within)?);
        let deadline = self.now()? + us;
        // A frame needs a station that acknowledges it. So a scenario that waits for frames takes part in the bus,
        // without sending.
        self.ask(Op::BusSend { bus, frame: None })?.written()?;
        let mut next = self.journal_end()?;
        loop {
            let (records, end) = self.records(next)?;
            next = end;
            let mut found = records
                .iter()
                .filter(|record| transmitted(record, bus).is_some_and(|frame| pattern.matches(&frame)));
            if let Some(found) = found.find_map(|record| frame_of(record, bus)) {
                return Ok(Some(found));
            }
            if !self.pass(deadline)? {
                return Ok(None);
            }
        }
    }
}

/// Returns the frame that a record describes, if it was on this bus.
fn transmitted(record: &Record, on: BusIndex) -> Option<Frame> {
    let carried = record.event.frame()?;
    (record.event.source() == Source::Bus(on)).then_some(carried.frame)
}

fn frame_of(record: &Record, on: BusIndex) -> Option<SeenFrame> {
    let frame = transmitted(record, on)?;
    let kind = BUS_KINDS.iter().find(|kind| kind.records.contains(&record.event.kind()));
    let text = kind.map_or_else(String::new, |kind| (kind.describe)(&frame));
    Some(SeenFrame { time_us: record.time_us, frame, text })
}

impl core::fmt::Display for SeenFrame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let payload = self.frame.payload();
        let bytes: String = payload.data().iter().map(|byte| format!(" {byte:02X}")).collect();
        let field = self.frame.arbitration();
        write!(f, "{}  {field:?}{bytes}", seconds(self.time_us))?;
        if self.text.is_empty() { Ok(()) } else { write!(f, "  ({})", self.text) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::Payload;

    #[test]
    fn data_have_two_digits_per_byte() {
        assert_eq!(parse_data("*").unwrap(), None);
        assert_eq!(parse_data("").unwrap(), Some(vec![]));
        assert_eq!(parse_data("0a .. FF").unwrap(), Some(vec![Some(10), None, Some(255)]));
        assert_eq!(parse_data("?? 7F").unwrap(), Some(vec![None, Some(127)]));
        // The notation of candump has no blanks.
        assert_eq!(parse_data("0102fF").unwrap(), parse_data("01 02 FF").unwrap());
        assert_eq!(parse_data("01..FF ??80").unwrap(), parse_data("01 .. FF .. 80").unwrap());
        for wrong in
            ["1", "123", "1 23", "0 1", "GG", "0x1", "0x12", "+1", "+101", ".", "...", "01*", "\u{e9}"]
        {
            assert!(parse_data(wrong).is_err(), "{wrong}");
        }
        for wrong in ["00 00 00 00 00 00 00 00 00", "000000000000000000"] {
            assert!(parse_data(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_pattern_matches_identifier_length_and_bytes() {
        let frame = Frame::standard(0x303, Payload::new(&[1, 2]).unwrap());
        let matches = |id, mask, data| Pattern::new(id, mask, data).unwrap().matches(&frame);
        assert!(
            matches(0x303, 0x7FF, "01 02") && matches(0x300, 0x780, "*") && matches(0x303, 0x7FF, ".. 02")
        );
        assert!(
            !matches(0x302, 0x7FF, "*") && !matches(0x303, 0x7FF, "01") && !matches(0x303, 0x7FF, "01 03")
        );
        assert!(Pattern::new(0x800, 0x7FF, "*").is_err() && Pattern::new(0x303, 0x780, "*").is_err());
    }
}
