//! What the card does in a run: many intervals in one go, see [`Drive::cruise`](super::super::Drive::cruise).

use super::{Card, DELAY_LINE};
use crate::can::Payload;
use crate::devices::cansync::bus::Channel;
use crate::devices::cansync::drive::parameters::{ParameterStore, Slot};
use crate::devices::cansync::drive::regler::VRegler;
use crate::devices::cansync::drive::zk::Source;

/// The card's reference values in a run.
pub(in crate::devices::cansync::drive) struct References([InRun; 2]);

/// One of them.
#[derive(Clone, Copy)]
struct InRun {
    channel: Channel,
    shift: u8,
    end: u8,
    mask: u32,
    target: Option<Slot>,
    is_speed: bool,
    received: Option<u32>,
    /// The last one that was handed over.
    value: Option<u32>,
}

impl InRun {
    /// No frame is long enough for it.
    const NONE: Self = InRun {
        channel: Channel::One,
        shift: 0,
        end: u8::MAX,
        mask: 0,
        target: None,
        is_speed: false,
        received: None,
        value: None,
    };
}

impl Card {
    /// Many intervals are about to come, of which none is lost. `None` if the card does more than to hand the master's
    /// reference values over at once.
    pub(crate) fn begin_run(&self, regler: &VRegler) -> Option<References> {
        if self.delay != 0 || self.stopped || self.may_stop() {
            return None;
        }
        let mut references = References([InRun::NONE; 2]);
        for (slot, own) in references.0.iter_mut().zip(&self.references) {
            let Some(own) = own else { continue };
            if own.source != Source::Master {
                return None;
            }
            *slot = InRun {
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

    /// As [`Card::receive`] from the master, in a run.
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
                slot.received = Some((bits >> slot.shift) as u32 & slot.mask);
                self.underway = DELAY_LINE as u8;
                self.losses.seen |= 1 << channel.index();
            }
        }
    }

    /// As [`Card::hand_over`], in a run; returns the speed reference value if it came.
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

    /// The run is over: what was handed over stands in the parameters.
    pub(crate) fn end_run(&mut self, references: &References, store: &mut ParameterStore) {
        for (slot, own) in references.0.iter().zip(&mut self.references) {
            if let (Some(target), Some(value)) = (slot.target, slot.value) {
                store.set(target, value);
            }
            if let Some(own) = own {
                own.received = slot.received;
            }
        }
    }
}
