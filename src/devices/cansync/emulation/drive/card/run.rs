//! A run of the card: many intervals in one step, see [`Drive::cruise`](super::super::Drive::cruise).

use super::{Card, DELAY_LINE};
use crate::can::Payload;
use crate::devices::cansync::drive::catch_up::UniformIntervals;
use crate::devices::cansync::drive::parameters::ParameterSlot;
use crate::devices::cansync::drive::regler::VRegler;
use crate::devices::cansync::drive::zk::Source;
use crate::devices::cansync::frames::Channel;

/// The card's reference values in a run.
pub(in crate::devices::cansync::emulation::drive) struct References([RunSlot; 2]);

/// One reference value in a run.
#[derive(Clone, Copy)]
struct RunSlot {
    channel: Channel,
    shift: u8,
    end: u8,
    mask: u32,
    target: Option<ParameterSlot>,
    is_speed: bool,
    received: Option<u32>,
    /// The last value that was passed to the drive.
    value: Option<u32>,
}

impl RunSlot {
    /// An unused slot. Its `end` is larger than the length of any frame.
    const NONE: Self = RunSlot {
        channel: Channel::One,
        shift: 0,
        end: u8::MAX,
        mask: 0,
        target: None,
        is_speed: false,
        received: None,
        value: None,
    };

    /// Returns true if frames of eight bytes on these channels carry the value.
    #[inline]
    fn is_heard(&self, channels: u8) -> bool {
        self.target.is_some()
            && usize::from(self.end) <= size_of::<u64>()
            && self.channel_bit() & channels != 0
    }

    #[inline]
    fn channel_bit(&self) -> u8 {
        1 << self.channel.index()
    }

    /// Returns the value in the data of a frame.
    #[inline]
    fn value_in(&self, bits: u64) -> u32 {
        (bits >> self.shift) as u32 & self.mask
    }
}

impl References {
    /// Returns the speed reference values, one per interval; `None` if no speed reference values come.
    #[inline]
    pub(crate) fn speeds<'a>(
        &self,
        alike: &UniformIntervals<'a>,
        heard: u8,
    ) -> Option<impl ExactSizeIterator<Item = u32> + DoubleEndedIterator + Clone + use<'a>> {
        let slot = *self.0.iter().find(|slot| slot.is_speed && slot.is_heard(heard))?;
        Some(alike.bits(slot.channel).map(move |bits| slot.value_in(bits)))
    }

    /// Returns the channels that carry the values.
    #[inline]
    fn heard(&self, channels: u8) -> u8 {
        let heard = self.0.iter().filter(|slot| slot.is_heard(channels));
        heard.fold(0, |all, slot| all | slot.channel_bit())
    }
}

impl Card {
    /// Starts a run of many intervals without lost frames. Returns `None` unless the card only passes on the
    /// master's reference values, without a delay.
    pub(crate) fn begin_run(&self, regler: &VRegler) -> Option<References> {
        if self.delay != 0 || self.stopped || self.may_stop() || self.control_word.is_some() {
            return None;
        }
        let mut references = References([RunSlot::NONE; 2]);
        for (slot, own) in references.0.iter_mut().zip(&self.references) {
            let Some(own) = own else { continue };
            if own.source != Source::Master {
                return None;
            }
            *slot = RunSlot {
                channel: own.channel,
                shift: own.shift,
                end: own.end,
                mask: own.format.mask(),
                target: Some(own.target),
                is_speed: regler.takes_in_run(own.target)?,
                received: own.received,
                value: None,
            };
        }
        let [one, other] = &references.0;
        let is_clear = one.target.is_none() || one.target != other.target;
        is_clear.then_some(references)
    }

    /// Receives a frame from the master during a run, like [`Card::receive`].
    #[inline]
    pub(crate) fn receive_in_run(
        &mut self,
        references: &mut References,
        channel: Channel,
        payload: &Payload,
    ) {
        let bits = u64::from_le_bytes(payload.padded());
        for slot in &mut references.0 {
            if slot.channel == channel && payload.len() >= usize::from(slot.end) {
                slot.received = Some(slot.value_in(bits));
                self.underway = DELAY_LINE as u8;
                self.losses.seen |= slot.channel_bit();
            }
        }
    }

    /// Does the same as [`Card::hand_over`] during a run. Returns the speed reference value if it has come.
    #[inline]
    pub(crate) fn hand_over_in_run(&mut self, references: &mut References) -> Option<u32> {
        self.count_losses();
        self.underway = self.underway.saturating_sub(1);
        let mut speed = None;
        for slot in &mut references.0 {
            if let Some(value) = slot.received.take() {
                slot.value = Some(value);
                if slot.is_speed {
                    speed = Some(value);
                }
            }
        }
        speed
    }

    /// Returns true if every expected reference value comes, provided that each interval has frames of eight
    /// bytes on these channels.
    #[inline]
    pub(crate) fn misses_nothing(&self, references: &References, channels: u8) -> bool {
        (self.losses.expected | self.losses.seen) & !references.heard(channels) == 0
    }

    /// Processes all these intervals at once, except the first hand-over. The result is the same as with
    /// [`Card::receive_in_run`] and [`Card::hand_over_in_run`] for each interval. The caller must have
    /// checked [`Card::misses_nothing`].
    #[inline]
    pub(crate) fn leap(&mut self, references: &mut References, alike: &UniformIntervals, channels: u8) {
        let heard = references.heard(channels);
        let handed_over = alike.count() - 1;
        if handed_over > 0 {
            self.losses.expected |= heard;
            self.losses.in_succession = 0;
        }
        self.losses.seen |= heard;
        self.underway = match heard {
            0 => self.underway.saturating_sub(handed_over.min(DELAY_LINE) as u8),
            _ => DELAY_LINE as u8,
        };
        for slot in references.0.iter_mut().filter(|slot| slot.is_heard(channels)) {
            let its = *slot;
            let value_in = |interval| its.value_in(alike.bits_in(interval, its.channel));
            slot.received = Some(value_in(handed_over));
            slot.value = handed_over.checked_sub(1).map(value_in).or(slot.value);
        }
    }

    /// Ends the run: writes to the parameters the values that the card has passed on.
    pub(crate) fn end_run(&mut self, references: &References, regler: &mut VRegler) {
        for (slot, own) in references.0.iter().zip(&mut self.references) {
            let Some(own) = own else { continue };
            if let Some(value) = slot.value {
                regler.take_reference(own.target, own.format, value);
            }
            own.received = slot.received;
        }
    }
}
