//! Effects of injected faults on the telegrams of a PROFIBUS segment. None of this code runs without a fault,
//! with one exception: delayed and repeated telegrams begin even if their fault has ended in the meantime.

use super::ProfibusBus;
use super::faults::{Effect, TelegramEffect, Traits};
use super::guests::guest_of;
use crate::devices::World;
use crate::fault::{Hit, Owner};
use crate::profibus::{Passage, Telegram};
use serde::{Deserialize, Serialize};

/// Sender number of noise on the line.
pub(super) const NOISE: usize = 1 << 17;

/// An octet with which no telegram begins.
const NOISE_OCTET: u8 = 0x55;

/// Frame count bit in a function code.
const FCB: u8 = 0x20;

/// A telegram that a fault holds back.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct HeldTelegram {
    /// Bit time at which the telegram begins, even if the line is busy.
    pub at: u64,
    pub sender: usize,
    pub octets: Vec<u8>,
    /// True if the telegram was sent before.
    pub is_copy: bool,
}

/// Effects of all faults on a telegram.
#[derive(Default)]
struct Disturbance {
    is_lost: bool,
    delay_us: Option<u32>,
    is_garbled: bool,
    is_counted_wrong: bool,
    copies_us: Vec<u32>,
}

impl Disturbance {
    /// Adds an effect. Returns false if the telegram cannot have this effect.
    fn take(&mut self, effect: TelegramEffect, seen: &Traits) -> bool {
        match effect {
            _ if self.is_lost || self.delay_us.is_some() => return false,
            TelegramEffect::Lose => self.is_lost = true,
            TelegramEffect::Delay(us) => self.delay_us = Some(us),
            TelegramEffect::Repeat(us) => self.copies_us.push(us),
            TelegramEffect::Garble if !self.is_garbled => self.is_garbled = true,
            TelegramEffect::WrongFrameCount if seen.has_frame_count && !self.is_counted_wrong => {
                self.is_counted_wrong = true;
            }
            TelegramEffect::Garble | TelegramEffect::WrongFrameCount => return false,
        }
        true
    }
}

/// Inverts the frame count bit of a request.
fn count_wrong(octets: &[u8]) -> Option<Vec<u8>> {
    let Ok(Telegram::Frame(mut frame)) = Telegram::parse(octets) else { return None };
    frame.fc ^= FCB;
    Telegram::Frame(frame).octets().ok()
}

/// Inverts a bit: a bit of the check sum, or of the start delimiter if the telegram has no check sum.
fn garble(octets: &mut [u8]) {
    let place = if octets.len() > 3 { octets.len() - 2 } else { 0 };
    if let Some(octet) = octets.get_mut(place) {
        *octet ^= 0x01;
    }
}

impl ProfibusBus {
    /// Begins a telegram at bit time `at`, with the faults that act on it.
    pub(super) fn begin(&mut self, sender: usize, at: u64, octets: Vec<u8>, world: &mut World) {
        if world.faults.is_empty() {
            self.line.begin(sender, at, octets);
        } else {
            self.begin_disturbed(sender, at, octets, world);
        }
    }

    #[cold]
    fn begin_disturbed(&mut self, sender: usize, at: u64, mut octets: Vec<u8>, world: &mut World) {
        let seen = Traits::of(&octets, self.address_of(sender));
        let mut all = Disturbance::default();
        let owner = Owner::Bus(self.index);
        world.faults.fire(world.now, owner, world.journal, |_, effect, _| match *effect {
            Effect::Telegram(telegrams, what) if telegrams.include(&seen) && all.take(what, &seen) => {
                Some(Hit::Plain)
            }
            _ => None,
        });
        if all.is_counted_wrong {
            octets = count_wrong(&octets).unwrap_or(octets);
        }
        if all.is_garbled {
            garble(&mut octets);
        }
        let bits = |us: u32| self.rate.bits_at(u64::from(us));
        let end = at.saturating_add(Telegram::bits(octets.len()));
        let copy = |us: u32| HeldTelegram {
            at: end.saturating_add(bits(us)),
            sender,
            octets: octets.clone(),
            is_copy: true,
        };
        let mut held: Vec<_> = all.copies_us.into_iter().map(copy).collect();
        if let Some(us) = all.delay_us {
            held.push(HeldTelegram { at: at.saturating_add(bits(us)), sender, octets, is_copy: false });
        } else {
            let passage = if all.is_lost { Passage::Lost } else { Passage::Normal };
            self.line.begin_with(sender, at, octets, passage);
        }
        self.held.extend(held);
    }

    /// Begins a telegram that a fault has held back until now.
    pub(super) fn begin_held(&mut self, index: usize) {
        if index < self.held.len() {
            let HeldTelegram { at, sender, octets, is_copy } = self.held.remove(index);
            let passage = if is_copy { Passage::Copy } else { Passage::Normal };
            self.line.begin_with(sender, at, octets, passage);
        }
    }

    /// Returns the next telegram that a fault holds back: its bit time and its index.
    pub(super) fn next_held(&self) -> Option<(u64, usize)> {
        self.held.iter().enumerate().map(|(index, held)| (held.at, index)).min()
    }

    /// Puts noise on the line.
    pub(super) fn make_noise(&mut self, octets: u8, now: u64) {
        self.line.begin(NOISE, self.rate.bits_at(now), vec![NOISE_OCTET; octets.into()]);
        self.plan(now);
    }

    /// Returns the address of a sender, if it is known.
    fn address_of(&self, sender: usize) -> Option<u8> {
        if let Some(end) = self.ends.get(sender) {
            return end.port.presence().map(|presence| presence.address);
        }
        let number = guest_of(sender)?;
        self.guests.present().find(|(guest, _)| *guest == number)?.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_garbled_telegram_is_none() {
        let telegrams: [&[u8]; 4] = [
            &[0xE5],
            &[0xDC, 3, 2],
            &[0x10, 5, 2, 0x49, 0x50, 0x16],
            &[0x68, 4, 4, 0x68, 5, 2, 0x7D, 9, 0x8D, 0x16],
        ];
        for telegram in telegrams {
            assert!(Telegram::parse(telegram).is_ok(), "{telegram:02X?}");
            let mut octets = telegram.to_vec();
            garble(&mut octets);
            assert!(Telegram::parse(&octets).is_err(), "{octets:02X?}");
        }
        let counted = count_wrong(telegrams[3]).unwrap();
        let Ok(Telegram::Frame(frame)) = Telegram::parse(&counted) else { panic!("{counted:02X?}") };
        assert_eq!(frame.fc, 0x5D);
    }
}
