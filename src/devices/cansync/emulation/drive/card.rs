//! The CANsync card in the drive. It extracts reference values from frames and inserts actual values into
//! frames. Once per interval it exchanges both kinds of values and the control word with the drive (manual
//! 5.01010.01 p. 14-20).
//!
//! The ZK parameters are converted to bit positions and parameter slots when the drive is built, so that a
//! frame costs few instructions.

mod run;

pub(super) use run::References;

use super::card_function::CardFunction;
use super::config::ZkError;
use super::parameters::{ParamFormat, ParameterSlot, ParameterStore};
use super::regler::VRegler;
use super::table::number::{ANGLE_REFERENCE, CONTROL_WORD, STATUS_WORD};
use super::zk::{ActualMapping, ReferenceMapping, Source, ZkParameters};
use crate::can::Payload;
use crate::devices::cansync::frames::Channel;
use crate::devices::cansync::registers::values::drive_status;
use crate::snapshot_fields;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// Number of intervals that a delay line covers: the longest delay of ZK 24, and the present interval.
const DELAY_LINE: usize = 4;

#[derive(Clone, Debug)]
struct ReferenceSlot {
    source: Source,
    channel: Channel,
    format: ParamFormat,
    shift: u8,
    /// Minimum length of a frame that carries the value, in bytes.
    end: u8,
    target: ParameterSlot,
    /// True for a synchronous position reference value. A drive takes it only while it is synchronized (decision D-82).
    is_position: bool,
    /// True if the value is used only if its frame has also come in the previous interval.
    needs_every: bool,
    /// True if the frame came in the previous interval.
    came_before: bool,
    received: Option<u32>,
    delayed: [Option<u32>; DELAY_LINE],
}

#[derive(Clone, Debug)]
struct ActualSlot {
    channel: Channel,
    format: ParamFormat,
    shift: u8,
    /// Parameter of the value; `None` for the status word.
    origin: Option<ParameterSlot>,
}

/// Reference value losses, see ZK 26.
#[derive(Clone, Debug, Default)]
struct Losses {
    allowed: u32,
    /// Frames of the master that carry a mapped reference value: bit 0 for frame 1, bit 1 for frame 2.
    wanted: u8,
    /// Frames of `wanted` that have come at least once. Before its first arrival, a frame does not count as
    /// lost.
    expected: u8,
    /// Frames of `wanted` that have come in the present interval.
    seen: u8,
    in_succession: u32,
    total: u64,
}

/// The card of one drive.
#[derive(Clone, Debug)]
pub(super) struct Card {
    references: [Option<ReferenceSlot>; 2],
    actuals: [Option<ActualSlot>; 3],
    delay: u8,
    turn: u8,
    /// The control word that waits for the next hand-over to the drive.
    control_word: Option<u16>,
    /// Number of hand-overs until every delay line is empty; 0 if no value waits in a delay line.
    underway: u8,
    losses: Losses,
    stopped: bool,
    /// Status word in `frames`; `None` before the first sample.
    sampled_status: Option<u16>,
    frames: [u64; 2],
    lens: [u8; 2],
}

snapshot_fields!(ReferenceSlot {
    values: came_before, received, delayed;
    built: source, channel, format, shift, end, target, is_position, needs_every
});
snapshot_fields!(Losses { values: expected, seen, in_succession, total; built: allowed, wanted });

impl SnapshotFields for Card {
    fn save(&self, to: &mut Saving) {
        let Self {
            references,
            actuals: _,
            delay: _,
            turn,
            control_word,
            underway,
            losses,
            stopped,
            sampled_status,
            frames,
            lens: _,
        } = self;
        to.value(&(turn, control_word, underway, stopped, sampled_status, frames));
        references.save(to);
        losses.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let Self { turn, control_word, underway, stopped, sampled_status, frames, .. } = self;
        (*turn, *control_word, *underway, *stopped, *sampled_status, *frames) = from.value()?;
        from.check(usize::from(self.turn) < DELAY_LINE, "place in the delay line")?;
        self.references.restore(from)?;
        self.losses.restore(from)
    }
}

impl ReferenceSlot {
    /// Returns the value that was received in the previous interval, if the drive may use it.
    #[inline]
    fn take_received(&mut self) -> Option<u32> {
        let received = self.received.take();
        if !self.needs_every {
            return received;
        }
        let came_before = core::mem::replace(&mut self.came_before, received.is_some());
        received.filter(|_| came_before)
    }

    /// Returns true if the card passes the value to a drive in this SYNC state.
    #[inline]
    const fn reaches(&self, is_synchronized: bool) -> bool {
        is_synchronized || !self.is_position
    }
}

type ZkFault = (u8, u16, ZkError);

impl Card {
    /// Creates the card from the ZK parameters. The error names the wrong ZK parameter and its value.
    pub(crate) fn new(
        zk: &ZkParameters,
        function: CardFunction,
        slave_number: u8,
        store: &ParameterStore,
    ) -> Result<Self, ZkFault> {
        if zk.zk_24 > 3 {
            return Err((24, zk.zk_24, ZkError::Delay));
        }
        let mut card = Card {
            references: [
                reference((0, zk.zk_0), (4, zk.zk_4), slave_number, store)?,
                reference((1, zk.zk_1), (5, zk.zk_5), slave_number, store)?,
            ],
            actuals: [
                actual((16, zk.zk_16), (20, zk.zk_20), store)?,
                actual((17, zk.zk_17), (21, zk.zk_21), store)?,
                status(zk.zk_25)?,
            ],
            delay: zk.zk_24 as u8, // at most 3
            turn: 0,
            control_word: None,
            underway: 0,
            losses: Losses {
                allowed: if function.counts_losses() { zk.zk_26.into() } else { 0 },
                ..Losses::default()
            },
            stopped: false,
            sampled_status: None,
            frames: [0; 2],
            lens: [0; 2],
        };
        card.lay_out(zk)?;
        for slot in card.references.iter_mut().flatten() {
            slot.needs_every = function.needs_every_frame() && slot.source != Source::Master;
        }
        for slot in card.references.iter().flatten().filter(|slot| slot.source == Source::Master) {
            card.losses.wanted |= 1 << slot.channel.index();
        }
        Ok(card)
    }

    /// Calculates the lengths of the actual value frames. Fails if two values would share a word of a frame.
    fn lay_out(&mut self, zk: &ZkParameters) -> Result<(), ZkFault> {
        let assignments = [(20, zk.zk_20), (21, zk.zk_21), (25, zk.zk_25)];
        let mut owners: [[Option<u8>; 4]; 2] = [[None; 4]; 2];
        for (slot, (zk_number, value)) in self.actuals.iter().zip(assignments) {
            let Some(slot) = slot else { continue };
            let channel = slot.channel.index();
            let (first, words) = (usize::from(slot.shift) / 16, slot.format.bytes() / 2);
            for owner in owners[channel].iter_mut().skip(first).take(words) {
                if let Some(other) = owner.replace(zk_number) {
                    return Err((zk_number, value, ZkError::Overlap(other)));
                }
            }
            self.lens[channel] = self.lens[channel].max(2 * (first + words) as u8); // at most 8
        }
        Ok(())
    }

    /// Handles a frame with values of `source`.
    #[inline]
    pub(crate) fn receive(&mut self, source: Source, channel: Channel, payload: &Payload) {
        let bits = u64::from_le_bytes(payload.padded());
        for slot in self.references.iter_mut().flatten() {
            if slot.channel == channel && slot.source == source && payload.len() >= usize::from(slot.end) {
                slot.received = Some((bits >> slot.shift) as u32 & slot.format.mask());
                self.underway = DELAY_LINE as u8;
                if source == Source::Master {
                    self.losses.seen |= 1 << channel.index();
                }
            }
        }
    }

    /// Stores the master's control word. A later control word replaces it.
    pub(crate) fn receive_control_word(&mut self, word: u16) {
        self.control_word = Some(word);
    }

    /// Samples the actual values and the status word of the drive, to be sent in this interval.
    #[inline]
    pub(crate) fn sample(&mut self, store: &mut ParameterStore, status_word: u16) {
        if self.stopped {
            return self.sample_sync_state(status_word & drive_status::SYNCHRONIZED);
        }
        if !(store.take_changed() || self.sampled_status != Some(status_word)) {
            return;
        }
        self.sampled_status = Some(status_word);
        let mut frames = [0; 2];
        for slot in self.actuals.iter().flatten() {
            let value = slot.origin.map_or(u32::from(status_word), |origin| store.get(origin));
            frames[slot.channel.index()] |= u64::from(value & slot.format.mask()) << slot.shift;
        }
        self.frames = frames;
    }

    /// Returns the last status word of the drive, if there was one.
    pub(crate) const fn sampled_status(&self) -> Option<u16> {
        self.sampled_status
    }

    /// Updates bit 15 of the last status word while the drive sends no status word: this bit belongs to the
    /// card (p. 30).
    fn sample_sync_state(&mut self, sync_state: u16) {
        let Some(last) = self.sampled_status.filter(|last| last & drive_status::SYNCHRONIZED != sync_state)
        else {
            return;
        };
        self.sampled_status = Some(last ^ drive_status::SYNCHRONIZED);
        for slot in self.actuals.iter().flatten().filter(|slot| slot.origin.is_none()) {
            self.frames[slot.channel.index()] ^= u64::from(drive_status::SYNCHRONIZED) << slot.shift;
        }
    }

    /// Passes the control word and reference values to the drive. The values are those of the previous
    /// interval; with a delay (ZK 24), those of one to three intervals before that. If no value has come, or
    /// if the drive refuses the value, the drive keeps its last value. `is_synchronized`: the drive is
    /// synchronized now and was synchronized in the previous interval.
    #[inline]
    pub(crate) fn hand_over(&mut self, regler: &mut VRegler, is_synchronized: bool) {
        if let (Some(word), false) = (self.control_word, self.stopped) {
            self.control_word = None;
            regler.command(word);
        }
        if self.underway == 0 {
            return;
        }
        self.underway -= 1;
        if self.delay == 0 {
            return self.hand_over_at_once(regler, is_synchronized);
        }
        self.turn = (self.turn + 1) % DELAY_LINE as u8;
        let (now, later) = (usize::from(self.turn), usize::from(self.turn + self.delay) % DELAY_LINE);
        for slot in self.references.iter_mut().flatten() {
            let reaches = slot.reaches(is_synchronized);
            slot.delayed[later] = slot.take_received().filter(|_| reaches);
            let value = slot.delayed[now].take().filter(|_| reaches && !self.stopped);
            if let Some(value) = value {
                regler.take_reference(slot.target, slot.format, value);
            }
        }
    }

    /// Passes the received reference values to the drive without a delay.
    #[inline]
    fn hand_over_at_once(&mut self, regler: &mut VRegler, is_synchronized: bool) {
        for slot in self.references.iter_mut().flatten() {
            let reaches = slot.reaches(is_synchronized) && !self.stopped;
            if let Some(value) = slot.take_received().filter(|_| reaches) {
                regler.take_reference(slot.target, slot.format, value);
            }
        }
    }

    /// Counts the expected reference value frames that did not come in the previous interval. Too many losses stop the
    /// exchange (ZK 26).
    #[inline]
    pub(crate) fn count_losses(&mut self) {
        let losses = &mut self.losses;
        losses.expected |= losses.seen;
        let missing = losses.expected & !losses.seen;
        losses.seen = 0;
        if missing == 0 {
            losses.in_succession = 0;
            return;
        }
        let lost = missing.count_ones();
        losses.total += u64::from(lost);
        losses.in_succession = losses.in_succession.saturating_add(lost);
        if losses.allowed != 0 && losses.in_succession > losses.allowed {
            self.stopped = true;
        }
    }

    /// Drops the reference values that come while card and drive exchange no data. The control word continues
    /// to wait.
    #[inline]
    pub(crate) fn discard(&mut self) {
        self.losses.seen = 0;
        self.losses.expected = 0;
        self.losses.in_succession = 0;
        if self.underway == 0 {
            return;
        }
        self.underway = 0;
        for slot in self.references.iter_mut().flatten() {
            slot.received = None;
            slot.came_before = false;
            slot.delayed = [None; DELAY_LINE];
        }
    }

    /// Resumes the exchange after too many losses have stopped it.
    pub(crate) fn resume(&mut self) {
        self.stopped = false;
        self.losses.in_succession = 0;
        self.losses.expected = 0;
    }

    /// Returns true if lost reference values can stop the exchange. The last samples then stay valid.
    #[inline]
    pub(crate) const fn may_stop(&self) -> bool {
        self.losses.allowed != 0
    }

    /// Returns true if too many reference value losses have stopped the exchange.
    pub(crate) const fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// Returns the number of lost reference value frames.
    pub(crate) const fn total_losses(&self) -> u64 {
        self.losses.total
    }

    /// Returns the card's actual value frame, if a value is mapped into it.
    #[inline]
    pub(crate) const fn frame(&self, channel: Channel) -> Option<Payload> {
        let (bits, len) = (self.frames[channel.index()], self.lens[channel.index()]);
        if len == 0 { None } else { Some(Payload::from_padded(bits.to_le_bytes(), len as usize)) }
    }

    /// Returns true if the master's reference value frames of this channel carry a value for the drive.
    #[inline]
    pub(crate) const fn wants_reference(&self, channel: Channel) -> bool {
        self.losses.wanted >> channel.index() & 1 != 0
    }

    /// Returns the slaves that send reference values for the drive in their actual value frames, bit n for slave n.
    pub(crate) fn wants_overheard(&self) -> u32 {
        self.references.iter().flatten().fold(0, |mask, slot| match slot.source {
            Source::Master => mask,
            Source::Slave(number) => mask | 1 << (number & 31),
        })
    }
}

/// Returns the parameter that ZK parameter `name` maps, if the parameter exists and has the format of the
/// mapping.
fn mapped(
    (name, number): (u8, u16),
    (zk, mapping): (u8, u16),
    format: ParamFormat,
    store: &ParameterStore,
) -> Result<ParameterSlot, ZkFault> {
    if matches!(number, CONTROL_WORD | STATUS_WORD) {
        return Err((name, number, ZkError::ControlOrStatusWord(number)));
    }
    let slot = store.slot(number).ok_or((name, number, ZkError::NoParameter(number)))?;
    if store.format(slot) != format {
        return Err((zk, mapping, ZkError::Format(number)));
    }
    Ok(slot)
}

fn reference(
    number: (u8, u16),
    mapping: (u8, u16),
    slave_number: u8,
    store: &ParameterStore,
) -> Result<Option<ReferenceSlot>, ZkFault> {
    let (zk, value) = mapping;
    let Some(ReferenceMapping { word, channel, format, source }) =
        ReferenceMapping::from_zk(value).map_err(|reason| (zk, value, reason.into()))?
    else {
        return Ok(None);
    };
    if source == Source::Slave(slave_number) {
        return Err((zk, value, ZkError::OwnFrame));
    }
    let target = mapped(number, mapping, format, store)?;
    if store.is_read_only(target) {
        return Err((number.0, number.1, ZkError::ReadOnly(number.1)));
    }
    let end = 2 * word + format.bytes() as u8;
    let shift = 16 * word;
    let delayed = [None; DELAY_LINE];
    let is_position = number.1 == ANGLE_REFERENCE;
    Ok(Some(ReferenceSlot {
        source,
        channel,
        format,
        shift,
        end,
        target,
        is_position,
        needs_every: false,
        came_before: false,
        received: None,
        delayed,
    }))
}

fn actual(
    number: (u8, u16),
    mapping: (u8, u16),
    store: &ParameterStore,
) -> Result<Option<ActualSlot>, ZkFault> {
    let (zk, value) = mapping;
    let Some(ActualMapping { word, channel, format }) =
        ActualMapping::from_zk(value).map_err(|reason| (zk, value, reason.into()))?
    else {
        return Ok(None);
    };
    let origin = Some(mapped(number, mapping, format, store)?);
    Ok(Some(ActualSlot { channel, format, shift: 16 * word, origin }))
}

fn status(value: u16) -> Result<Option<ActualSlot>, ZkFault> {
    let mapping = ActualMapping::from_zk_25(value).map_err(|reason| (25, value, reason.into()))?;
    Ok(mapping.map(|ActualMapping { word, channel, format }| ActualSlot {
        channel,
        format,
        shift: 16 * word,
        origin: None,
    }))
}
