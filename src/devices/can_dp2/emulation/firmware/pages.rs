//! The gateway in page mode. Each telegram carries one page of the identifiers. So the gateway can have more
//! identifiers than a configuration has modules (p. 50-60).

use super::form;
use super::modules::EXTENDED;
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use crate::devices::can_dp2::page::{COUNTER, END, HEAD, MARK, MORE, RECORD, RESULT, divide, number, places};
use core::ops::Range;
use embedded_can::Frame as _;
use serde::{Deserialize, Serialize};

/// Result of a page (D-467).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// The page is accepted.
    Good = 0,
    /// The page is not the page that the sequence requires next.
    Turn = 1,
    /// A record has an invalid identifier, or an identifier that is already used in the other direction.
    Identifier = 2,
    /// A record has a length other than 1 to 8, or its data do not fit on a page.
    Length = 3,
    /// The mark after the last record is missing.
    Mark = 4,
}

/// Progress of a gateway in page mode: register `page_state`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) enum PagePhase {
    /// Waits for page 0.
    #[default]
    Waiting = 1,
    /// Waits for pages with definitions of sent identifiers.
    Tx = 2,
    /// Waits for pages with definitions of received identifiers.
    Rx = 3,
    /// Exchanges pages with data.
    Data = 4,
}

/// An identifier that the gateway sends, with its last data.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Tx {
    #[serde(with = "crate::can::kept")]
    id: Id,
    form: u8,
    length: usize,
    /// Data of the last transmission. A transmission that did not take place, because CAN was off, also
    /// counts.
    data: [u8; 8],
    force: u8,
}

/// An identifier that the gateway receives, with its last data.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Rx {
    #[serde(with = "crate::can::kept")]
    id: Id,
    form: u8,
    length: usize,
    data: [u8; 8],
    count: u8,
    /// True if a later entry of the configuration has the identifier of this entry (p. 35). The data of this
    /// entry then never change.
    is_frozen: bool,
}

/// A gateway in page mode.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct Pages {
    /// The segments in their order. Positions are counted from the first output and from the first input.
    outputs: Vec<Range<usize>>,
    inputs: Vec<Range<usize>>,
    phase: PagePhase,
    /// Required number of the next page of a configuration.
    next: u16,
    /// Counter of the last page; 0 before the first page.
    counter: u8,
    tx: Vec<Tx>,
    rx: Vec<Rx>,
    /// Identifiers on each page with data.
    tx_pages: Vec<Range<usize>>,
    rx_pages: Vec<Range<usize>>,
    /// All segments that the DP master reads, in order.
    shown: Vec<u8>,
}

/// Effects of a page on the gateway.
#[derive(Debug, Default, PartialEq, Eq)]
pub(in crate::devices::can_dp2::emulation) struct PageEffect {
    /// True if the page was new.
    pub is_new: bool,
    /// True if the page has changed the set of identifiers.
    pub has_configured: bool,
    /// Frames that the gateway must send on CAN.
    pub frames: Vec<Frame>,
}

/// Returns the number of content octets of a page with these segments.
fn carries(segments: &[Range<usize>]) -> usize {
    places(segments).count()
}

/// Returns the identifier in a record. It has 29 bits if bit 29 is set or the number is above 16#7FF, as in
/// the window (D-383).
fn identifier(bytes: [u8; 4]) -> Option<Id> {
    let number = u32::from_be_bytes(bytes);
    let id = number & !EXTENDED;
    match (number & EXTENDED != 0, u16::try_from(id).ok().and_then(StandardId::new)) {
        (false, Some(id)) => Some(id.into()),
        _ => ExtendedId::new(id).map(Id::from),
    }
}

impl Pages {
    /// Starts page mode. `outputs` and `inputs` are the ranges of the segments.
    pub(in crate::devices::can_dp2::emulation) fn new(
        outputs: Vec<Range<usize>>,
        inputs: Vec<Range<usize>>,
    ) -> Self {
        let shown = vec![0; inputs.last().map_or(0, |last| last.end)];
        Pages {
            outputs,
            inputs,
            phase: PagePhase::default(),
            next: 0,
            counter: 0,
            tx: Vec::new(),
            rx: Vec::new(),
            tx_pages: Vec::new(),
            rx_pages: Vec::new(),
            shown,
        }
    }

    pub(in crate::devices::can_dp2::emulation) fn phase(&self) -> PagePhase {
        self.phase
    }

    /// Returns the received identifiers and their numbers of bytes. The result is empty until the
    /// configuration is complete.
    pub(in crate::devices::can_dp2::emulation) fn received_ids(&self) -> impl Iterator<Item = (Id, usize)> {
        let rx = self.rx.iter().filter(|rx| self.phase == PagePhase::Data && !rx.is_frozen);
        rx.map(|rx| (rx.id, rx.length))
    }

    /// Returns the octets that the DP master reads, from the first input on.
    pub(in crate::devices::can_dp2::emulation) fn shown(&self) -> &[u8] {
        &self.shown
    }

    /// Handles all outputs that the DP master has written. Frames are sent only if `sends` is true.
    pub(in crate::devices::can_dp2::emulation) fn written(
        &mut self,
        outputs: &[u8],
        sends: bool,
    ) -> PageEffect {
        let Some(head) = self.outputs.first().and_then(|first| outputs.get(first.clone())) else {
            return PageEffect::default();
        };
        let Some(&[high, low, ..]) = head.first_chunk::<HEAD>() else { return PageEffect::default() };
        let (number, counter) = (u16::from_be_bytes([high, low]), head[COUNTER]);
        // A counter of 0 means that the outputs were cleared, so they do not contain a page.
        if counter == 0 || core::mem::replace(&mut self.counter, counter) == counter {
            return PageEffect::default();
        }
        let payload: Vec<u8> =
            places(&self.outputs).filter_map(|place| outputs.get(place).copied()).collect();
        let mut taken = PageEffect { is_new: true, ..PageEffect::default() };
        let outcome = match number {
            number::START => {
                self.start();
                taken.has_configured = true;
                Ok(())
            }
            number::TX..number::DATA if number == self.next => {
                let before = self.phase;
                let outcome = self.configure(&payload);
                taken.has_configured = before != PagePhase::Data && self.phase == PagePhase::Data;
                outcome
            }
            number::DATA.. if self.phase == PagePhase::Data => {
                if sends {
                    taken.frames = self.data(number, &payload);
                }
                Ok(())
            }
            _ => Err((Outcome::Turn, 0)),
        };
        self.show(number, counter, outcome);
        taken
    }

    /// Page 0: restarts the configuration.
    fn start(&mut self) {
        (self.phase, self.next) = (PagePhase::Tx, number::TX);
        self.tx.clear();
        self.rx.clear();
    }

    /// Handles a page with records. The error names the first wrong record, counted from 0 on the page.
    fn configure(&mut self, payload: &[u8]) -> Result<(), (Outcome, u8)> {
        let is_tx = self.phase == PagePhase::Tx;
        let (mut tx, mut rx) = (self.tx.clone(), self.rx.clone());
        let room = carries(if is_tx { &self.outputs } else { &self.inputs });
        let (mut rest, mut record) = (payload, 0);
        let mark = loop {
            let wrong = |outcome| (outcome, record);
            let Some(bytes) = rest.first_chunk::<MARK>() else { return Err(wrong(Outcome::Mark)) };
            if let [MORE, MORE, MORE, MORE] | [END, END, END, END] = bytes {
                break bytes[0];
            }
            let Some((&[a, b, c, d, form, length], following)) = rest.split_first_chunk::<RECORD>() else {
                return Err(wrong(Outcome::Mark));
            };
            let id = identifier([a, b, c, d]).ok_or(wrong(Outcome::Identifier))?;
            let length = usize::from(length);
            if !(1..=8).contains(&length) || length + 1 > room {
                return Err(wrong(Outcome::Length));
            }
            // P. 10: an identifier can have only one direction. In page mode an identifier also cannot be
            // sent by two records.
            if tx.iter().any(|it| it.id == id) {
                return Err(wrong(Outcome::Identifier));
            }
            if is_tx {
                tx.push(Tx { id, form, length, data: [0; 8], force: 0 });
            } else {
                rx.iter_mut().filter(|it| it.id == id).for_each(|it| it.is_frozen = true);
                rx.push(Rx { id, form, length, data: [0; 8], count: 0, is_frozen: false });
            }
            (rest, record) = (following, record.saturating_add(1));
        };
        let is_last = self.next + 1 == number::RX || self.next + 1 == number::DATA;
        match (mark, is_tx) {
            // The number of pages of one kind is limited (p. 55).
            (MORE, _) if is_last => return Err((Outcome::Turn, 0)),
            (MORE, _) => self.next += 1,
            (_, true) => (self.phase, self.next) = (PagePhase::Rx, number::RX),
            (_, false) => {
                (self.phase, self.next) = (PagePhase::Data, 0);
                self.tx_pages = divide(tx.iter().map(|it| it.length), carries(&self.outputs));
                self.rx_pages = divide(rx.iter().map(|it| it.length), carries(&self.inputs));
            }
        }
        (self.tx, self.rx) = (tx, rx);
        Ok(())
    }

    /// Handles a page with outputs. Returns the frames that must be sent according to `force` (p. 59).
    fn data(&mut self, number: u16, payload: &[u8]) -> Vec<Frame> {
        let mut frames = Vec::new();
        let Some(ids) = self.tx_pages.get(usize::from(number - number::DATA)) else { return frames };
        let mut rest = payload;
        for tx in &mut self.tx[ids.clone()] {
            let Some((&force, following)) = rest.split_first() else { break };
            let (data, following) = following.split_at(tx.length.min(following.len()));
            rest = following;
            let is_changed = !tx.data.starts_with(data);
            let is_toggled = core::mem::replace(&mut tx.force, force) != force;
            let is_sent = match force {
                1 => true,
                2 => is_changed,
                3 | 4 => is_toggled,
                _ => false,
            };
            if is_sent {
                tx.data[..data.len()].copy_from_slice(data);
                let mut data = data.to_vec();
                form::swap(tx.form, &mut data);
                frames.extend(Payload::new(&data).map(|payload| Frame::new(tx.id, payload)));
            }
        }
        frames
    }

    /// Writes the answer to a page: the page number in each segment, the counter, the result and the
    /// requested content.
    fn show(&mut self, number: u16, counter: u8, outcome: Result<(), (Outcome, u8)>) {
        let (outcome, record) = outcome.map_or_else(|wrong| wrong, |()| (Outcome::Good, 0));
        self.shown.fill(0);
        let answers = if number == number::START { number::SIZES } else { number };
        for segment in &self.inputs {
            // The last segment may be shorter.
            let octets = &mut self.shown[segment.clone()];
            octets.iter_mut().zip(answers.to_be_bytes()).for_each(|(to, from)| *to = from);
        }
        if let Some(head) = self.shown.first_chunk_mut::<HEAD>() {
            (head[COUNTER], head[RESULT], head[RESULT + 1]) = (counter, outcome as u8, record);
        }
        let carried: Vec<u8> = match number {
            number::START => {
                let sizes =
                    [&self.outputs, &self.inputs].map(|segments| segments.last().map_or(0, |last| last.end));
                sizes.into_iter().flat_map(|size| (size as u16).to_be_bytes()).collect()
            }
            number::DATA.. if outcome == Outcome::Good => {
                let page = self.rx_pages.get(usize::from(number - number::DATA)).cloned().unwrap_or(0..0);
                self.rx[page].iter().flat_map(Rx::record).collect()
            }
            _ => Vec::new(),
        };
        for (place, octet) in places(&self.inputs).zip(carried) {
            self.shown[place] = octet;
        }
    }

    /// Handles a frame: counts it, and stores its data until the DP master requests the page of the frame
    /// again.
    pub(in crate::devices::can_dp2::emulation) fn received(&mut self, frame: &Frame) {
        if self.phase != PagePhase::Data {
            return;
        }
        let Some(rx) = self.rx.iter_mut().find(|rx| rx.id == frame.id() && !rx.is_frozen) else { return };
        let mut data = frame.data().to_vec();
        data.truncate(rx.length);
        form::swap(rx.form, &mut data);
        rx.data[..data.len()].copy_from_slice(&data);
        rx.count = rx.count.wrapping_add(1);
    }
}

impl Rx {
    /// Returns counter and data in the format of a page.
    fn record(&self) -> impl Iterator<Item = u8> {
        core::iter::once(self.count).chain(self.data[..self.length].iter().copied())
    }
}

#[cfg(test)]
mod tests;
